"""Looking for a thing or a person: turn about at one spot after the other, indoors in one room after the other."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.assistant.skills import OUTSIDE, Action, AssistantSkills, ObservationView
from vico.agents.perception import Sighting
from vico.agents.state import AgentState

# Views of 90 degrees overlap a little, four of them show everything around.
_TURN = 88.0
_VIEWS = 4
# So long one tries to get to a spot outdoors, to the middle of a room and to a door, steps.
_SPOT, _MIDDLE, _DOOR = 25, 12, 40
# Spots outdoors lie so far from the region's middle, share of its radius; regions smaller than this, metres, need none.
_RING, _ONE_LOOK = 0.6, 5.0
# One looks from spots at most so far apart, metres.
_APART = 9.0


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
        self._spots = [] if large else _spots_of(region, skills)
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
            step = self.skills.walk_indoors(view, _middle(view), near=0.8) if near_by else None
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


def _spots_of(region: Mapping[str, Any] | None, skills: AssistantSkills) -> list[NDArray[np.float64]]:
    """Return spots from which all of a region outdoors comes into view, beside its middle."""
    if region is None or region["kind"] != "outdoor" or float(region["radius"]) < _ONE_LOOK:
        return []
    middle, reach = np.asarray(region["centre"], np.float64)[:2], _RING * float(region["radius"])
    count = max(4, math.ceil(2 * math.pi * reach / _APART))
    angles = 2 * math.pi * np.arange(count) / count
    ring = middle + reach * np.column_stack([np.cos(angles), np.sin(angles)])
    return [spot for spot in ring if skills.map.walkable.is_connected(spot)]


def _middle(view: ObservationView) -> NDArray[np.float64]:
    """Return a spot from which more of the room is in view: ahead, half as far as one sees."""
    depth = np.asarray(view.observation["depth"])
    ahead = float(np.median(depth[depth > 0])) if bool((depth > 0).any()) else 1.0
    middle: NDArray[np.float64] = view.pose[:2] + view.pose[3:5] * min(ahead * 0.5, 3.0)
    return middle
