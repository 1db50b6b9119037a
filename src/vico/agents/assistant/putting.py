"""Putting down what is in hand where it is to be, and out of the way of whoever goes in and out there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from vico.agents.assistant.options import Search, WalkUp
from vico.agents.assistant.skills import OUTSIDE, Action, AssistantSkills, ObservationView
from vico.agents.perception import Sighting
from vico.agents.state import AgentState
from vico.exact import each

# Steps after which one gives up, and for which one goes further into a room; how far, metres.
_LONGEST, _GOING_IN, _INTO = 50, 4, 1.8
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
        full = [hand for hand, entity in enumerate(view.held) if entity and (mine is None or entity in mine)]
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
            if view.refused and self._on:
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
    ahead = math.atan2(float(view.pose[4]), float(view.pose[3]))
    around = [ahead + 2.0 * math.pi * k / _DIRECTIONS for k in range(_DIRECTIONS)]
    doors = np.array([door["position"][:2] for door in view.state["doors"]], np.float64).reshape(-1, 2) - view.pose[:2]
    if not len(doors):
        return around
    ways = each(math.atan2, doors[:, 1], doors[:, 0])
    clear = [float(np.abs((ways - angle + math.pi) % (2.0 * math.pi) - math.pi).min()) for angle in around]
    return [around[k] for k in np.argsort([-c for c in clear], kind="stable")]
