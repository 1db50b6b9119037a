"""Bodies as arrays: what every moving thing shows of itself for collisions, drawing and recording.

A body is an upright prism: a footprint over the ground, and an extent in height. Two bodies of one space are in each
other's way where their footprints meet and so do their extents; `docs/bodies.md` says who has which body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.world.heights import HeightField
from vico.world.mesh import Surface

KINDS = (
    "resident",
    "assistant",
    "robot",
    "car",
    "bus",
    "bicycle",
    "pedestrian",
    "object",
    "fixture",
    "tram",
    "cyclist",
)
RESIDENT, ASSISTANT, ROBOT, CAR, BUS, BICYCLE, PEDESTRIAN, OBJECT, FIXTURE, TRAM, CYCLIST = range(len(KINDS))
#: By kind: whether it is a person.
IS_PERSON = np.isin(np.arange(len(KINDS)), (RESIDENT, ASSISTANT, PEDESTRIAN, CYCLIST))
#: By kind: whether its footprint is round at the ends. A bicycle left standing takes the room its rider took with it.
IS_ROUND = IS_PERSON | (np.arange(len(KINDS)) == BICYCLE)
#: People step over what is no higher than this, metres: the lowest part of a person's extent is in nobody's way.
STEP_HEIGHT = 0.1
#: Nobody on the ground reaches as high as this, metres, on foot or in the saddle.
TALLEST = 2.5


@dataclass(frozen=True)
class Bodies:
    """Upright bodies; index = the owner's stable order.

    Attributes
    ----------
    entity
        int32, shape ``(n,)``, unique in the simulation.
    kind
        Index into `KINDS`, int8, shape ``(n,)``.
    position
        Centre of the underside, ENU metres, float64, shape ``(n, 3)``: on the ground, unless the body flies or stands
        on something.
    yaw
        Radians, float64, shape ``(n,)``.
    half_length, half_width
        Half the footprint's extents along and across its heading, metres, float64, shape ``(n,)``. People and
        bicycles have a round footprint: all that is within `half_width` of a line as long as leaves `half_length` in
        all; a disc on foot, a stadium with a bicycle. Everything else has a rectangle.
    height
        From the underside to the top, metres, float64, shape ``(n,)``.
    velocity
        Metres a second over the ground, float64, shape ``(n, 2)``.
    """

    entity: NDArray[np.int32]
    kind: NDArray[np.int8]
    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    half_length: NDArray[np.float64]
    half_width: NDArray[np.float64]
    height: NDArray[np.float64]
    velocity: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.entity)

    @property
    def person(self) -> NDArray[np.bool_]:
        """Which bodies are people, on foot or on bicycles."""
        return IS_PERSON[self.kind]

    @property
    def rounding(self) -> NDArray[np.float64]:
        """Radius of the footprints' round ends, metres: 0 for rectangles, `half_width` for the rest; shape ``(n,)``.

        A footprint is all that is within `rounding` of its core, a rectangle of `half_length` and `half_width` less
        `rounding`: a point for people on foot, a line for cyclists and bicycles.
        """
        return np.where(IS_ROUND[self.kind], self.half_width, 0.0)

    @property
    def bottom(self) -> NDArray[np.float64]:
        """Where the extents that are in others' way begin, ENU metres, shape ``(n,)``: people lift their feet."""
        return np.asarray(self.position[:, 2] + STEP_HEIGHT * self.person, np.float64)

    @property
    def top(self) -> NDArray[np.float64]:
        """Where the extents end, ENU metres, shape ``(n,)``."""
        return np.asarray(self.position[:, 2] + self.height, np.float64)

    def levels(self, ground: HeightField) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return `bottom` and `top` above the ground or the deck beneath each body, metres.

        For who looks far ahead: whoever stands further up the same street is on the same level.
        """
        below = ground.near(self.position)
        return self.bottom - below, self.top - below

    def where(self, chosen: NDArray[Any]) -> Bodies:
        """Return the bodies a mask or an index array picks."""
        return Bodies(*[column[chosen] for column in self._columns()])

    def _columns(self) -> tuple[NDArray[Any], ...]:
        return (
            self.entity, self.kind, self.position, self.yaw,
            self.half_length, self.half_width, self.height, self.velocity,
        )  # fmt: skip

    @classmethod
    def none(cls) -> Bodies:
        """No bodies."""
        empty = np.zeros(0)
        return cls(
            np.zeros(0, np.int32), np.zeros(0, np.int8), np.zeros((0, 3)), empty, empty, empty, empty, np.zeros((0, 2))
        )

    @classmethod
    def joined(cls, parts: Sequence[Bodies]) -> Bodies:
        """All bodies of several owners, in order."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else cls.none()
        return cls(*map(np.concatenate, zip(*[part._columns() for part in parts], strict=True)))


@dataclass(frozen=True)
class Drawn:
    """Rigid shapes to draw: `index` points into `prototypes`.

    Attributes
    ----------
    transforms
        Model to world, float32, shape ``(n, 4, 4)``.
    entity
        Entity number of each, as in the label image, int32, shape ``(n,)``.
    """

    prototypes: list[str]
    index: NDArray[np.int32]
    transforms: NDArray[np.float32]
    entity: NDArray[np.int32]


def concatenate_drawn(parts: list[Drawn]) -> Drawn:
    """Return shapes to draw as one lot."""
    first = np.cumsum([0] + [len(part.prototypes) for part in parts[:-1]])
    return Drawn(
        [name for part in parts for name in part.prototypes],
        np.concatenate([part.index + np.int32(k) for k, part in zip(first, parts, strict=True)]),
        np.concatenate([part.transforms for part in parts]),
        np.concatenate([part.entity for part in parts]),
    )


class HasBodies(Protocol):
    """Who takes up room."""

    def bodies(self) -> Bodies:
        """Where everything is now."""


class Subsystem(HasBodies, Protocol):
    """What the loop asks of traffic, transit and robots."""

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future, random state among them: what is hashed and saved."""

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""

    def advance(self, dt: float, obstacles: Bodies) -> None:
        """Move on by `dt` seconds without touching anything of one's own or of `obstacles`."""

    def draw(self) -> Drawn:
        """Return what to draw, by prototype."""

    def prototypes(self) -> dict[str, list[Surface]]:
        """Return the shapes `draw` refers to."""
