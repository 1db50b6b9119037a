"""Skills of every assistant: go somewhere, look around a region, walk up to an object, leave a building.

A skill is asked once a step for an action, and answers None when it is done. Skills see what the agent observes and
the public map, nothing else. `LookAround` turns about at one spot after the other, indoors in one room after the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import AgentState, FieldState
from vico.agents.navigation.navigator import Navigator
from vico.agents.navigation.path_planning import Target
from vico.agents.perception import Sighting, SightingMemory, sightings
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
    def hands(self) -> list[int]:
        """Entities in the hands, 0 where one is free."""
        return [int(entity or 0) for entity in self.state["held"]]

    @property
    def was_refused(self) -> bool:
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


class AssistantSkills(FieldState):
    """The skills of one assistant, with what it remembers of rooms and things.

    Parameters
    ----------
    public_map
        What it knows of the world.
    generator
        Decides how it gets out of others' way.
    """

    _generator: np.random.Generator
    navigator: Navigator
    seen: SightingMemory
    places: dict[str, str]  # the place to which each room that one was in belongs
    _trail: list[str]
    _tries: int = 0

    def __init__(self, public_map: PublicMap, generator: np.random.Generator) -> None:
        self.map = public_map
        self._generator = generator
        self.navigator = Navigator(public_map, generator)
        self.navigator.walker.wide_drift = _DRIFT
        self.seen = SightingMemory()
        #: Metres a second outdoors.
        self.pace = WALK
        self.places, self._trail = {}, []

    def notice(self, view: ObservationView) -> None:
        """Take in a new observation: what stands where, what was seen, and the way one came."""
        self.navigator.notice(
            dict(view.observation), dict(view.info), ignore=[entity for entity in view.hands if entity]
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
        if at_door and not (view.was_refused and self._tries > 3):
            self._tries = self._tries + 1 if view.was_refused else 1
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


# Views of 90 degrees overlap a little, four of them show everything around.
_TURN = 88.0
_VIEWS = 4
_SPOT = 25  # steps in which one tries to get to a spot outdoors
_MIDDLE = 12  # to the middle of a room
_DOOR = 40  # to a door
# Spots outdoors lie so far from the region's middle, share of its radius; regions smaller than this, metres, need none.
_RING, _ONE_LOOK = 0.6, 5.0
# One looks from spots at most so far apart, metres.
_SPOT_SPACING = 9.0


class LookAround:
    """Looks through a region for what is wanted.

    Parameters
    ----------
    wanted
        Tells whether a sighting is what is looked for.
    region
        Where to look, as instructions name it; None for wherever one is.
    large
        Whether it is as large as a person: then one look from the middle of a region outdoors, and one from the door of
        each room, is enough.

    Attributes
    ----------
    found
        The sighting that ended the search; None as long as there is none.
    """

    def __init__(
        self,
        skills: AssistantSkills,
        wanted: Callable[[Sighting], bool],
        region: Mapping[str, Any] | None,
        *,
        large: bool = False,
    ) -> None:
        self.skills = skills
        self.wanted = wanted
        self.found: Sighting | None = None
        self._place = None if region is None else region["place"]
        self._views = 0
        self._large = large
        self._spots = [] if large else _viewpoints_of(region, skills)
        self._rooms_done: set[str] = set()
        self._ways: dict[str, list[str]] = {}  # rooms known to lie behind each room's doors
        self._walked = 0

    def state(self) -> AgentState:
        """Return what was looked at so far, and what is still to be; the skills are their owner's to save."""
        return {
            "views": self._views,
            "spots": np.array(self._spots, np.float64).reshape(-1, 2),
            "rooms_done": sorted(self._rooms_done),
            "ways": {room: list(beyond) for room, beyond in self._ways.items()},
            "walked": self._walked,
        }

    def restore(self, state: AgentState) -> None:
        """Go on with a search for the same thing in the same region."""
        self._views, self._walked = state["views"], state["walked"]
        self._spots = list(np.array(state["spots"], np.float64).reshape(-1, 2))
        self._rooms_done = set(state["rooms_done"])
        self._ways = {room: list(beyond) for room, beyond in state["ways"].items()}

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action; None when something was found (see `found`) or everything was looked at."""
        self.found = next((thing for thing in view.things if self.wanted(thing)), None)
        if self.found is not None:
            return None
        if self._views < _VIEWS:
            self._views += 1
            return {"type": "turn_left", "degrees": _TURN}
        return self._outdoors(view) if view.room is None else self._indoors(view, view.room)

    def _outdoors(self, view: ObservationView) -> Action | None:
        """Go to the next spot of the region."""
        while self._spots:
            step = self.skills.approach(view, self._spots[0], near=1.0)
            self._walked += 1
            if step is not None and self._walked < _SPOT:
                return step
            self._spots.pop(0)
            self._look_again(1)
            return {"type": "turn_left", "degrees": _TURN}
        return None

    def _indoors(self, view: ObservationView, room: str) -> Action | None:
        """Look from the middle of the room, too, then go on to the next one."""
        if room not in self._rooms_done:
            self._walked += 1
            near_by = not self._large and self._walked < _MIDDLE and self._place in (None, view.place)
            step = self.skills.walk_indoors(view, _viewpoint_ahead(view), near=0.8) if near_by else None
            if step is not None:
                return step
            self._rooms_done.add(room)
            if not self._large:
                self._look_again(1)
                return {"type": "turn_left", "degrees": _TURN}
        if room not in self._ways:
            self._ways[room] = [str(door["to"]) for door in view.state["doors"] if door["to"] != OUTSIDE]
        onward = self._next_room(room)
        if onward is None:
            return None
        step = self.skills.go_through(view, onward)
        self._walked += 1
        if step is None or self._walked > _DOOR:
            # That door can't be got to: the room behind it has to go without a look.
            self._rooms_done.add(onward)
            self._ways[room].remove(onward)
            self._walked = 0
            return {"type": "wait"}
        if step["type"] == "enter":
            self._look_again(_VIEWS if onward in self._rooms_done else 0)  # no second look at what was seen
        return step

    def _look_again(self, views: int) -> None:
        self._views, self._walked = views, 0

    def _next_room(self, here: str) -> str | None:
        """Return the neighbour through which the nearest room lies that was not looked at; None if all were."""
        first: dict[str, str] = {name: name for name in self._ways[here]}
        queue = list(first)
        while queue:
            room = queue.pop(0)
            if room not in self._rooms_done:
                return first[room]
            for name in self._ways.get(room, []):
                if name != here and name not in first:
                    first[name] = first[room]
                    queue.append(name)
        return None


def _viewpoints_of(region: Mapping[str, Any] | None, skills: AssistantSkills) -> list[NDArray[np.float64]]:
    """Return spots from which all of a region outdoors comes into view, beside its middle."""
    if region is None or region["kind"] != "outdoor" or float(region["radius"]) < _ONE_LOOK:
        return []
    middle, reach = np.asarray(region["centre"], np.float64)[:2], _RING * float(region["radius"])
    count = max(4, math.ceil(2 * math.pi * reach / _SPOT_SPACING))
    angles = 2 * math.pi * np.arange(count) / count
    ring = middle + reach * np.column_stack([np.cos(angles), np.sin(angles)])
    return [spot for spot in ring if skills.map.walkable.is_connected(spot)]


def _viewpoint_ahead(view: ObservationView) -> NDArray[np.float64]:
    """Return a spot from which more of the room is in view: ahead, half as far as one sees."""
    depth = np.asarray(view.observation["depth"])
    ahead = float(np.median(depth[depth > 0])) if bool((depth > 0).any()) else 1.0
    middle: NDArray[np.float64] = view.pose[:2] + view.pose[3:5] * min(ahead * 0.5, 3.0)
    return middle
