"""Looking for the thing of a task: how often, what was seen of it, and from where to look next."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Info, Observation
from vico.agents.robot.body import Stance, metres_apart
from vico.agents.robot.sight import seen_at
from vico.agents.state import AgentState

Array = NDArray[np.float64]

# Seconds between two looks.
_LOOKS_EVERY = 0.5
#: Farther away a thing is gone nearer to first, metres.
SURE = 8.0
# Seconds of a full turn to look about; places to look from lie on a ring about the middle, metres.
_ROUND, _RING, _PLACES = 9.5, 4.0, 6
# So high above the ground something is in a hand, metres.
_LOW = 0.2
# Sides that are tried one after the other are turned by so much, rad: none comes twice.
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


def side_of_try(number: int, first: float = 0.0) -> Array:
    """Return the side of a thing from which it is tried, a unit vector on the map, shape ``(2,)``.

    Parameters
    ----------
    first
        Heading of the side that is tried first, rad.
    """
    turn = first + _GOLDEN * number
    return np.array([math.cos(turn), math.sin(turn)])


class ThingSearch:
    """What a robot knows of where its thing is.

    Parameters
    ----------
    told
        What the task tells; see `vico.agents.robot.heuristic.Manipulator`.

    Attributes
    ----------
    entity, seen
        Of the thing, as it was in view last; where it stood, ENU metres; 0 and None before.
    middle
        About which it is looked for, ENU metres, shape ``(2,)``.
    """

    def __init__(self, told: Mapping[str, Any]) -> None:
        self._name, self._period = str(told["object"]), float(told["period"])
        self.entity = 0
        self.seen: Array | None = None
        self.middle = np.array(told["source"]["centre"][:2], np.float64)
        self._clock = self._looked = self._turned = 0.0
        self._place = 0

    @property
    def is_due(self) -> bool:
        """Whether it looks the next time."""
        return self._clock + self._period - self._looked >= _LOOKS_EVERY

    def pass_time(self) -> None:
        """Let a period pass."""
        self._clock += self._period

    def look(self, observation: Observation, info: Info, *, near: float = SURE) -> bool:
        """Look for the thing twice a second; return whether it is in view and near."""
        if self._clock - self._looked < _LOOKS_EVERY or "depth" not in observation:
            return False
        self._looked = self._clock
        found, here = seen_at(observation, info, self._name), Stance.of(observation)
        if found is None:
            return False
        self.entity, self.seen = found.entity, here.outside(found.low)
        return metres_apart(self.seen, here.position) <= near

    def lies_low(self, ground: float) -> bool:
        """Return whether the thing was seen low above a height of the ground, metres: nobody has it in hand."""
        return self.seen is not None and float(self.seen[2]) - ground < _LOW

    def move_to(self, middle: Array) -> None:
        """Look about another point from now on, ENU metres."""
        self.middle, self._place = middle[:2].copy(), 0

    def begin(self) -> None:
        """Begin a turn."""
        self._turned = 0.0

    def turns(self) -> bool:
        """Return whether the robot turns on; else it goes to the `next_place`."""
        self._turned += self._period
        if self._turned < _ROUND:
            return True
        self._turned = 0.0
        return False

    def next_place(self) -> Array:
        """Return where to look from next: one place after the other round the middle, ENU metres, shape ``(2,)``."""
        turn = 2.0 * math.pi * self._place / _PLACES
        self._place += 1
        ring = _RING * (1 + self._place // _PLACES % 2)
        return np.asarray(self.middle + ring * np.array([math.cos(turn), math.sin(turn)]))

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "entity": self.entity,
            "seen": None if self.seen is None else self.seen.copy(),
            "middle": self.middle.copy(),
            "seconds": [self._clock, self._looked, self._turned],
            "place": self._place,
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.entity, self._place = int(state["entity"]), int(state["place"])
        self.seen = None if state["seen"] is None else np.array(state["seen"])
        self.middle = np.array(state["middle"])
        self._clock, self._looked, self._turned = (float(value) for value in state["seconds"])
