"""What every assistant can do: go somewhere, look around, walk up to a thing, leave a building.

A skill is asked once a step for an action, and answers None when it is done. Skills see what the agent observes and
the public map, nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.navigation.memory import SeenMemory
from vico.agents.navigation.navigator import Navigator
from vico.agents.navigation.search import Target
from vico.agents.perception import Sighting, sightings
from vico.agents.state import AgentState, generator_state, restore_generator
from vico.exact import dot
from vico.world.public import PublicMap

Action = dict[str, Any]

WALK = 2.0  # metres a step
_DRIFT = 0.3  # metres off the line in the open: what stands there is seen
OUTSIDE = "outside"  # where a door leads that leads into no other room
ENTER_REACH = 1.95  # metres from an entrance; the rules allow for 2
DOOR_REACH = 1.5
INNER_DOOR_REACH = 0.8
# A point so much farther off than a doorway, and seen within so much of its middle, is seen through it, metres.
_BEHIND_DOOR, _DOORWAY = 0.3, 0.7
GRASP = 1.15  # metres from a thing at which one stops to pick it up; arms reach 1.5


@dataclass(frozen=True)
class ObservationView:
    """One observation with its info, under short names."""

    observation: Mapping[str, Any]
    info: Mapping[str, Any]

    @cached_property
    def pose(self) -> NDArray[np.float64]:
        """Position and unit facing vector, shape ``(6,)``."""
        return np.asarray(self.observation["pose"], np.float64)

    @property
    def state(self) -> Mapping[str, Any]:
        """The part of the observation that is not an image."""
        state: Mapping[str, Any] = self.observation["state"]
        return state

    @property
    def room(self) -> str | None:
        """Id of the room one is in; None outdoors."""
        return self.state["room"] or None

    @property
    def place(self) -> str | None:
        """Id of the place one is in; None outdoors."""
        return self.state["place"] or None

    @property
    def held(self) -> list[int]:
        """Entities in the hands, 0 where one is free."""
        return [int(entity or 0) for entity in self.state["held"]]

    @property
    def refused(self) -> bool:
        """Whether the last action was refused."""
        return str(self.state["action_status"]) == "refused"

    @cached_property
    def things(self) -> list[Sighting]:
        """Named things in view, nearest first."""
        return sightings(self.observation, self.info["entities"])

    def away(self, point: ArrayLike) -> float:
        """Metres to a point, over the ground."""
        x, y = np.asarray(point, np.float64)[:2] - self.pose[:2]
        return math.hypot(x, y)


class AssistantSkills:
    """The skills of one assistant, with what it remembers of rooms and things.

    Parameters
    ----------
    public_map
        What it knows of the world.
    generator
        Decides how it gets out of others' way.
    """

    def __init__(self, public_map: PublicMap, generator: np.random.Generator) -> None:
        self.map = public_map
        self._rng = generator
        self.navigator = Navigator(public_map, generator)
        self.navigator.walker.wide_drift = _DRIFT
        self.seen = SeenMemory()
        #: Metres a second outdoors.
        self.pace = WALK
        #: Which place each room that one was in belongs to.
        self.places: dict[str, str] = {}
        self._trail: list[str] = []
        self._tries = 0

    def state(self) -> AgentState:
        """Return the way under way, what is known of rooms and things, and where chance stands."""
        return {
            "generator": generator_state(self._rng),
            "navigator": self.navigator.state(),
            "seen": self.seen.state(),
            "places": dict(self.places),
            "trail": list(self._trail),
            "tries": self._tries,
        }

    def restore(self, state: AgentState) -> None:
        """Go on with what `state` returned."""
        restore_generator(self._rng, state["generator"])
        self.navigator.restore(state["navigator"])
        self.seen.restore(state["seen"])
        self.places, self._trail, self._tries = dict(state["places"]), list(state["trail"]), state["tries"]

    def notice(self, view: ObservationView) -> None:
        """Take in a new observation: what stands where, what was seen, and the way one came."""
        self.navigator.notice(
            dict(view.observation), dict(view.info), ignore=[entity for entity in view.held if entity]
        )
        self.seen.notice(view.observation, view.things)
        room = view.room
        if room is not None:
            self.places[room] = view.place or ""
        if room is None:
            self._trail.clear()
        elif room in self._trail:
            del self._trail[self._trail.index(room) + 1 :]
        else:
            self._trail.append(room)

    def go_to(self, view: ObservationView, region: Mapping[str, Any], *, near: float = 1.0) -> Action | None:
        """Go to a region of a task: into the place, or to within `near` metres of the middle of the spot outdoors."""
        if region["kind"] == "place":
            return self.go_inside(view, str(region["place"]))
        if view.room is not None:
            return self.leave(view)
        return self.walk_to(view, region["centre"], near=near)

    def go_inside(self, view: ObservationView, place_id: str) -> Action | None:
        """Go into a place by its entrance."""
        if view.place == place_id:
            return None
        if view.room is not None:
            return self.leave(view)
        place = self.map.place_by_id[place_id]
        door = place.entrance or place.position
        at_door = view.away(door) <= ENTER_REACH
        if at_door and not (view.refused and self._tries > 3):
            self._tries = self._tries + 1 if view.refused else 1
            return {"type": "enter", "place": place_id}
        self._tries = 0
        # The spot before it that maps show may lie a little too far off.
        step = self.walk_to(view, place.position, near=0.3) or self.walk_to(view, door, near=ENTER_REACH - 0.5)
        return step or {"type": "wait"}

    def leave(self, view: ObservationView) -> Action | None:
        """Leave the building, room by room, the way one came."""
        doors: Sequence[Mapping[str, Any]] = view.state["doors"]
        out = next((door for door in doors if door["to"] == OUTSIDE), None)
        if out is not None:
            step = self.walk_indoors(view, out["position"], near=DOOR_REACH)
            return step or {"type": "exit"}
        back = self._trail[-2] if len(self._trail) > 1 else str(doors[0]["to"])
        return self.go_through(view, back)

    def go_through(self, view: ObservationView, room: str) -> Action | None:
        """Go through the door to a neighbouring room; None once there."""
        if view.room == room:
            return None
        door = next((door for door in view.state["doors"] if door["to"] == room), None)
        if door is None:
            return None
        step = self.walk_indoors(view, door["position"], near=INNER_DOOR_REACH)
        return step or {"type": "enter", "place": room}

    def door_before(self, view: ObservationView, point: ArrayLike) -> str:
        """Return the room behind the door through which a point is seen; empty where it is in the same room."""
        here, there = view.pose[:2], np.asarray(point, np.float64)[:2]
        away = math.dist(here, there)
        least, found = _DOORWAY, ""
        for door in view.state["doors"]:
            at = np.asarray(door["position"], np.float64)[:2]
            along = float(dot(at - here, there - here)) / max(away, 1e-9)
            across = math.sqrt(max(math.dist(here, at) ** 2 - along**2, 0.0))
            # The way of sight leaves the room once: by the door whose middle it passes nearest to.
            if door["to"] != OUTSIDE and 0.0 < along < away - _BEHIND_DOOR and across < least:
                least, found = across, str(door["to"])
        return found

    def walk_indoors(self, view: ObservationView, target: ArrayLike, *, near: float) -> Action | None:
        """Walk within a room around what depth images showed; None once within `near` metres of the target.

        And where no way leads nearer.
        """
        return self.navigator.towards(dict(view.observation), dict(view.info), Target.disc(target, near))

    def approach(self, view: ObservationView, position: ArrayLike, *, near: float) -> Action | None:
        """Walk up to a point, indoors or out; None once within `near` metres."""
        if view.away(position) <= near:
            return None
        if view.room is not None:
            return self.walk_indoors(view, position, near=near)
        return self.walk_to(view, position, near=near)

    def walk_to(self, view: ObservationView, point: ArrayLike, *, near: float) -> Action | None:
        """Walk outdoors on the public map; None once within `near` metres, or where no way leads nearer."""
        point = np.asarray(point, np.float64)[:2]
        return self.navigator.towards(
            dict(view.observation), dict(view.info), Target.disc(point, near), speed=self.pace
        )

    def walk_to_box(self, view: ObservationView, box: Target) -> Action | None:
        """Walk to a box, indoors or out; None once within its `near` metres, or where no way leads nearer."""
        return self.navigator.towards(dict(view.observation), dict(view.info), box, speed=self.pace)
