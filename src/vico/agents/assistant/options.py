"""Options that planners choose among: go somewhere, search, walk up to a thing, pick it up, put it down.

An option is asked once a step for an action, and answers None when it has come to its `outcome`. All planners share
them, so that tables compare plans and not legs. What is put down is left out of the way of whoever goes in and out
there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.agents.assistant.skills import GRASP, OUTSIDE, Action, AssistantSkills, LookAround, ObservationView
from vico.agents.base import AgentState, FieldState, heading
from vico.agents.perception import Sighting
from vico.exact import each

Region = Mapping[str, Any]

# Steps after which one gives up: going somewhere, walking up to a thing.
_ON_THE_WAY, _WALKING_UP = 500, 60
# From where one tries to pick, metres; and how long one comes no nearer before one gives up, steps.
_NEARER = (GRASP, 0.8, 0.4)
_IN_VAIN = 14
_VIEWS = 4
# Who moved so far, metres, is followed there at once; else not before so many steps after one was stopped.
_AFAR, _HOLD = 6.0, 6


class Option(Protocol):
    """One thing to do."""

    outcome: str

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action; None once `outcome` says what came of it."""

    def state(self) -> AgentState:
        """Return how far it came."""

    def restore(self, state: AgentState) -> None:
        """Go on where another one, made in the same way, was."""


class Pursuit(FieldState):
    """Going up to something that was seen, or somebody who moves, through the door that they were seen through.

    Attributes
    ----------
    position
        Where it was seen last, ENU metres, shape ``(3,)``; None before.
    """

    position: NDArray[np.float64] | None
    _through: str = ""
    # What is walked to: it follows the position by strides, so that a way round an obstacle is gone to its end.
    _goal: NDArray[np.float64] | None = None
    _holds: int = 0
    # Views to take in a room that one came into after it, before one walks to where it is thought to be.
    _views: int = 0

    def __init__(self, skills: AssistantSkills, position: NDArray[np.float64] | None = None) -> None:
        self.position = position
        self._skills = skills

    def see(self, view: ObservationView, position: NDArray[np.float64]) -> None:
        """Take note of where it is now."""
        self.position = position
        self._through = self._skills.door_before(view, position)
        self._views = 0

    def away(self, view: ObservationView) -> float:
        """Metres to where it was seen last; infinite where that is unknown or behind a door."""
        return math.inf if self.position is None or (view.room and self._through) else view.away(self.position)

    def step(self, view: ObservationView, *, near: float) -> Action | None:
        """Return the next action on the way there; None once within `near` metres, or where no way leads nearer."""
        if view.room is not None and self._through == view.room:
            self._views = _VIEWS
        if view.room is None or self._through == view.room:
            self._through = ""
        if self._views > 0:
            self._views -= 1
            return {"type": "turn_left", "degrees": 88.0}
        if self._through:
            action = self._skills.go_through(view, self._through)
            if action is not None:
                return action
            self._through = ""
        return None if self.position is None else self._skills.approach(view, self._aim(view, self.position), near=near)

    def _aim(self, view: ObservationView, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what to walk to."""
        self._holds = _HOLD if view.state["action_status"] == "collision" else max(0, self._holds - 1)
        moved = math.inf if self._goal is None else float(np.hypot(*(position - self._goal)[:2]))
        if self._goal is None or moved > _AFAR or (self._holds == 0 and moved > min(_AFAR, 0.3 * view.away(position))):
            self._goal = position
        return self._goal


class GoTo(FieldState):
    """Go to a region: into the place, or to the middle of the spot outdoors. Outcomes: ``arrived``, ``stuck``."""

    _steps: int = 0

    def __init__(self, skills: AssistantSkills, region: Region, *, near: float = 1.0) -> None:
        self.outcome = ""
        self._skills, self._region, self._near = skills, region, near

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action on the way."""
        action = self._skills.go_to(view, self._region, near=self._near)
        self._steps += 1
        if action is None or self._steps > _ON_THE_WAY:
            self.outcome = "arrived" if action is None else "stuck"
            return None
        return action


class Search:
    """Look through a region for something or somebody by name. Outcomes: ``found``, ``nothing``.

    Attributes
    ----------
    found
        What was found.
    """

    def __init__(
        self,
        skills: AssistantSkills,
        wanted: Callable[[Sighting], bool],
        region: Region | None,
        *,
        large: bool = False,
    ) -> None:
        self.outcome = ""
        self.found: Sighting | None = None
        self._look = LookAround(skills, wanted, region, large=large)

    def state(self) -> AgentState:
        """Return what was looked at."""
        return self._look.state()

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self._look.restore(state)

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action of looking about."""
        action = self._look.act(view)
        if action is None:
            self.found = self._look.found
            self.outcome = "found" if self.found is not None else "nothing"
        return action


class WalkUp(FieldState):
    """Walk up to a thing that was seen. Outcomes: ``arrived``, ``stuck``."""

    target: Sighting
    _pursuit: Pursuit
    _nearest: float = math.inf
    _steps: int = 0
    _vain: int = 0

    def __init__(self, skills: AssistantSkills, target: Sighting, *, near: float = GRASP) -> None:
        self.outcome = ""
        self.target = target
        self._near = near
        self._pursuit = Pursuit(skills, target.position)

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action on the way."""
        # What is in view again is placed better from nearer.
        seen = next((thing for thing in view.things if thing.entity == self.target.entity), None)
        if seen is not None:
            self.target = seen
            self._pursuit.see(view, seen.position)
        self._steps += 1
        action = self._pursuit.step(view, near=self._near)
        if action is None or self._is_stuck(view):
            self.outcome = "arrived" if action is None else "stuck"
            return None
        return action

    def _is_stuck(self, view: ObservationView) -> bool:
        """Whether it has come no nearer for a while, or takes too long."""
        away = view.away(self.target.position)
        self._vain = 0 if away < self._nearest - 0.2 else self._vain + 1
        self._nearest = min(self._nearest, away)
        return self._vain > _IN_VAIN or self._steps > _WALKING_UP


class PickUp:
    """Pick a thing up, from nearer if that is refused. Outcomes: ``picked``, ``refused``, ``hands full``."""

    def __init__(self, skills: AssistantSkills, target: Sighting) -> None:
        self.outcome = ""
        self.target = target
        self._skills = skills
        self._tries = 0
        self._walk: WalkUp | None = WalkUp(skills, target)
        self._asked = False

    def state(self) -> AgentState:
        """Return how far it came."""
        walk = None if self._walk is None else self._walk.state()
        return {"tries": self._tries, "walk": walk, "asked": self._asked, "target": self.target.state()}

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self._tries, self._asked, self.target = state["tries"], state["asked"], Sighting(**state["target"])
        self._walk = None
        if state["walk"] is not None:
            self._walk = WalkUp(self._skills, self.target, near=_NEARER[self._tries])
            self._walk.restore(state["walk"])

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action."""
        if self._asked:
            self._asked = False
            if self.target.entity in view.hands:
                self.outcome = "picked"
                return None
            self._tries += 1
            if self._tries >= len(_NEARER):
                self.outcome = "refused"
                return None
            self._walk = WalkUp(self._skills, self.target, near=_NEARER[self._tries])
        if self._walk is not None:
            action = self._walk.act(view)
            self.target = self._walk.target
            if action is not None:
                return action
            self._walk = None
        if all(view.hands):
            self.outcome = "hands full"
            return None
        self._asked = True
        return {"type": "pick", "hand": view.hands.index(0), "object": self.target.entity}


_LONGEST = 50  # steps after which one gives up
_GOING_IN = 4  # steps for which one goes further into a room
_INTO = 1.8  # metres of such a step
# A room with so many doors to others is a hall, which one tries to leave for so many steps.
_DOORS_OF_HALL, _LEAVING_HALL = 4, 15
# Metres from the middle of a spot outdoors at which things are put down there.
_SPOT = 0.7
# So many directions around are tried, those first that lie farthest from the ways to the room's doors.
_DIRECTIONS = 9
_LOW = 0.6  # metres above the floor that one looks at


class PutDown:
    """Put down what is in hand at a destination: on the surface it names, else on free ground away from the door.

    Outcomes: ``empty hands``, ``stuck``.

    Parameters
    ----------
    entities
        Which of the things in hand; None for all.
    """

    def __init__(
        self, skills: AssistantSkills, region: Mapping[str, Any], entities: frozenset[int] | None = None
    ) -> None:
        self.outcome = ""
        self._skills, self._region, self._entities = skills, region, entities
        self._surface: Search | None = None
        surface = region["surface"]
        if surface is not None:
            self._surface = Search(skills, lambda seen: bool(seen.entity == surface["entity"]), region)
        self._walk: WalkUp | None = None
        self._on = surface is not None
        self._steps = self._went = self._bearing = 0
        self._aimed = self._put = False
        # Steps on the way out of a hall, -1 once that is over; and the room one goes to.
        self._hall = 0
        self._room = ""

    def state(self) -> AgentState:
        """Return how far it came."""
        return {
            "steps": self._steps,
            "surface": None if self._surface is None else self._surface.state(),
            "walk": None if self._walk is None else self._walk.state(),
            "on": self._on,
            "went": self._went,
            "bearing": self._bearing,
            "aimed": self._aimed,
            "put": self._put,
            "hall": self._hall,
            "room": self._room,
        }

    def restore(self, state: AgentState) -> None:
        """Go on."""
        self._steps, self._on, self._went = state["steps"], state["on"], state["went"]
        self._bearing, self._aimed, self._put = state["bearing"], state["aimed"], state["put"]
        self._hall, self._room = state["hall"], state["room"]
        if state["surface"] is None:
            self._surface = None
        elif self._surface is not None:
            self._surface.restore(state["surface"])
        self._walk = None
        if state["walk"] is not None:
            self._walk = WalkUp(self._skills, Sighting(**state["walk"]["target"]))
            self._walk.restore(state["walk"])

    def act(self, view: ObservationView) -> Action | None:
        """Return the next action."""
        mine = self._entities
        full = [hand for hand, entity in enumerate(view.hands) if entity and (mine is None or entity in mine)]
        if not full:
            self.outcome = "empty hands"
            return None
        action = self._to_surface(view)
        if action is not None:
            return action
        self._steps += 1
        if self._steps > _LONGEST:
            self.outcome = "stuck"
            return None
        return self._out_of_hall(view) or self._go_to_spot(view) or self._lay_down(view, full[0])

    def _lay_down(self, view: ObservationView, hand: int) -> Action:
        """Put a thing on the surface that is named; else ahead, in one direction after the other."""
        if self._put:
            self._put = False
            if view.was_refused and self._on:
                self._on = False  # there is no room on it: beside it, then
            else:
                self._bearing, self._aimed = self._bearing + 1, False
        if self._on:
            self._put = True
            return {"type": "put", "hand": hand, "target": self._region["surface"]["entity"]}
        if not self._aimed and (view.room or self._bearing):
            self._aimed = True
            return {"type": "look_at", "target": self._aim(view)}
        self._put = True
        return {"type": "put", "hand": hand}

    def _aim(self, view: ObservationView) -> list[float]:
        """Return a point ahead, in the direction that is next."""
        angle = _free_directions(view)[self._bearing % _DIRECTIONS]
        x, y, z = (float(value) for value in view.pose[:3])
        return [x + math.cos(angle), y + math.sin(angle), z + _LOW]

    def _go_to_spot(self, view: ObservationView) -> Action | None:
        """Go to the middle of a spot outdoors, or a little further into the room: doors are to stay free."""
        if self._region["kind"] == "outdoor":
            far = view.room is None and view.away(self._region["centre"]) > _SPOT
            return self._skills.approach(view, self._region["centre"], near=_SPOT) if far else None
        if self._on or not view.room or self._went >= _GOING_IN:
            return None
        self._went += 1
        if view.state["action_status"] == "collision":
            self._went = _GOING_IN
            return None
        angle = _free_directions(view)[0]
        into = view.pose[:2] + _INTO / self._went * np.array([math.cos(angle), math.sin(angle)])
        return self._skills.walk_indoors(view, into, near=0.4)

    def _out_of_hall(self, view: ObservationView) -> Action | None:
        """Go into the next room from a hall: what lies there is in everybody's way, one's own first."""
        if self._on or not view.room or self._hall < 0:
            return None
        inner = [door for door in view.state["doors"] if door["to"] != OUTSIDE]
        if view.room == self._room or len(inner) < _DOORS_OF_HALL or self._hall >= _LEAVING_HALL:
            self._hall = -1
            return None
        self._hall += 1
        if not self._room:
            self._room = str(min(inner, key=lambda door: view.away(door["position"]))["to"])
        return self._skills.go_through(view, self._room)

    def _to_surface(self, view: ObservationView) -> Action | None:
        """Look for the surface that is named, and walk up to it."""
        if self._surface is not None:
            action = self._surface.act(view)
            if action is not None:
                return action
            if self._surface.found is not None:
                self._walk = WalkUp(self._skills, self._surface.found)
            self._surface = None
        if self._walk is not None:
            action = self._walk.act(view)
            if action is not None:
                return action
            self._walk = None
        return None


def _free_directions(view: ObservationView) -> list[float]:
    """Return directions around, radians, the one first that lies farthest from the ways to the room's doors."""
    ahead = heading(view.observation)
    around = [ahead + 2.0 * math.pi * k / _DIRECTIONS for k in range(_DIRECTIONS)]
    doors = np.array([door["position"][:2] for door in view.state["doors"]], np.float64).reshape(-1, 2) - view.pose[:2]
    if not len(doors):
        return around
    ways = each(math.atan2, doors[:, 1], doors[:, 0])
    clear = [float(np.abs((ways - angle + math.pi) % (2.0 * math.pi) - math.pi).min()) for angle in around]
    return [around[k] for k in np.argsort([-c for c in clear], kind="stable")]
