"""What the judge sees of an episode, once a second."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.challenges.teaming.thresholds import STILL, UPRIGHT

Array = NDArray[np.float64]


class Truth(Protocol):
    """What the judge may look at of people and things: the state itself, no agent's view of it."""

    def agent_position(self, name: str) -> Array:
        """Where a person stands, metres, shape ``(3,)``."""

    def agent_place(self, name: str) -> str | None:
        """Id of the place a person is in; None outdoors."""

    def agent_room(self, name: str) -> str | None:
        """Id of the room a person is in; None outdoors."""

    def object_position(self, name: str) -> Array:
        """Where a thing is, metres, shape ``(3,)``."""

    def object_entity(self, name: str) -> int:
        """Its entity, as pictures show it."""


class Robots(Protocol):
    """What the judge looks at of the robots."""

    @property
    def names(self) -> Sequence[str]:
        """Of the robots."""

    def bodies(self) -> Any:
        """Positions and more of all robots."""

    def observation(self, robot: int) -> dict[str, NDArray[Any]]:
        """Return what a robot feels of itself."""


@dataclass(frozen=True)
class Look:
    """How things stand.

    Attributes
    ----------
    second
        Of the episode.
    robots
        Where they are, ENU metres, shape ``(n, 3)``.
    stands
        Whether each is upright and still.
    person, place, outdoors
        Where the person is, id of the place they are in ("": none), and whether they are in no room; where nobody is
        walked with, the origin.
    said
        What the person has said since the last look.
    thing
        Where the thing is; None where there is none.
    shown
        Pixels of the thing in each robot's picture, where it is near enough; else 0.
    """

    second: float
    robots: Array
    stands: tuple[bool, ...]
    person: Array
    place: str
    outdoors: bool
    said: tuple[str, ...] = ()
    thing: Array | None = None
    shown: tuple[int, ...] = ()


def stands_of(robots: Robots) -> tuple[bool, ...]:
    """Return which robots are upright and still."""
    return tuple(_stands(robots.observation(k)) for k in range(len(robots.names)))


def has_fallen(robots: Robots) -> bool:
    """Return whether a robot lies on the ground, or is on its way up from there."""
    return any(bool(robots.observation(k)["fallen"][0]) for k in range(len(robots.names)))


def _stands(felt: dict[str, NDArray[Any]]) -> bool:
    upright = float(-felt["gravity"][2]) >= UPRIGHT
    return upright and not felt["fallen"][0] and float(np.hypot(*felt["base_velocity"][:2])) <= STILL


def away(a: Any, b: Any) -> float:
    """Metres between two points over the ground."""
    return float(np.hypot(*(np.asarray(a, np.float64)[:2] - np.asarray(b, np.float64)[:2])))


@dataclass
class Company:
    """How much of a person's way a robot was with them.

    Attributes
    ----------
    walked, beside
        Looks at the person on the way, and those at which the robot was near enough.
    """

    walked: int = 0
    beside: int = 0

    def count(self, near: bool) -> None:
        """Count a look."""
        self.walked += 1
        self.beside += near

    def share(self) -> float:
        """Return on which share of the way the robot was near enough, percent."""
        return 100.0 * self.beside / self.walked if self.walked else 0.0
