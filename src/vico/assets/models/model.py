"""A thing that worlds are furnished with: its shape, what it is, and what can lie on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vico.rules import BED_WIDTH
from vico.world.mesh import Surface, merge_surfaces


@dataclass(frozen=True)
class Top:
    """A surface of a model that things can lie on.

    Attributes
    ----------
    kind
        Kind of container: sofa, table, chair, desk or bed.
    height
        Above the foot, metres.
    size
        Extent along x and y, metres.
    centre
        Its middle, from the model's origin, metres.
    """

    kind: str
    height: float
    size: tuple[float, float]
    centre: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Seat:
    """Where people sit or lie on a model, looking along its +x; who lies has the head at -x.

    Attributes
    ----------
    lies
        Whether one lies there: a bed.
    height
        Of what one sits or lies on above the foot, metres.
    size
        Extent along x and y, metres: wide ones have several places side by side.
    centre
        Its middle, from the model's origin, metres.
    """

    lies: bool
    height: float
    size: tuple[float, float]
    centre: tuple[float, float] = (0.0, 0.0)

    @property
    def places(self) -> list[tuple[float, float]]:
        """Where people's hips are, one a place, from the model's origin, metres."""
        count = max(1, int(self.size[1] / (BED_WIDTH if self.lies else _SITTING_WIDTH) + 1e-9))
        pitch = self.size[1] / count
        first = self.centre[1] - 0.5 * (count - 1) * pitch
        return [(self.centre[0], first + k * pitch) for k in range(count)]


# Kinds of tops that are seats.
_SEATS = ("chair", "sofa")
# Width of a place, metres.
_SITTING_WIDTH = 0.48


@dataclass(frozen=True)
class ModelCredit:
    """Whom a world that shows a model has to thank, and under which licence it may.

    Attributes
    ----------
    licence, words
        As its entry says.
    sha256
        Of the file that its mesh is in.
    """

    licence: str
    words: str
    sha256: str


@dataclass(frozen=True)
class Model:
    """A prototype: origin at the middle of its foot, z up, +x forward (the side people use it from), metres.

    Attributes
    ----------
    name
        Name of the prototype, unique.
    kind
        What it is.
    group
        amenity, natural, transit or indoor.
    solid
        Whether bodies are stopped by it.
    foot
        Extent along x and y of the part that stands in people's way, metres; None: the whole outline.
    top
        What things can lie on, if anything.
    own_seat
        Where people sit or lie where that is not its `top`.
    build
        Makes its surfaces; called once, when they are first asked for.
    credit
        Whom to thank for it, where it is not ours.
    """

    name: str
    kind: str
    group: str
    build: Callable[[], list[Surface]]
    solid: bool = True
    foot: tuple[float, float] | None = None
    top: Top | None = None
    own_seat: Seat | None = None
    credit: ModelCredit | None = None

    @property
    def seat(self) -> Seat | None:
        """Where people sit or lie on it: as its entry says, or on a top that is a chair's, a sofa's or a bed's."""
        if self.own_seat is not None or self.top is None:
            return self.own_seat
        if self.top.kind == "bed":
            # Pillows are no place to put things on, but to lie on.
            return Seat(True, self.top.height, self.top.size, (0.0, self.top.centre[1]))
        return Seat(False, self.top.height, self.top.size, self.top.centre) if self.top.kind in _SEATS else None

    @cached_property
    def surfaces(self) -> list[Surface]:
        """Its shape, one surface a material."""
        return self.build()

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest corner, float64, shape ``(2, 3)``."""
        points = np.concatenate([surface.positions for surface in self.surfaces])
        return np.array([points.min(0), points.max(0)], np.float64)

    @cached_property
    def size(self) -> tuple[float, float, float]:
        """Extent along x, y, z of the box around the origin that holds the model, metres."""
        low, high = self.bounds
        x, y = 2 * max(-low[0], high[0]), 2 * max(-low[1], high[1])
        return round(float(x), 3), round(float(y), 3), round(float(high[2]), 3)

    @property
    def triangles(self) -> int:
        """How many triangles it has."""
        return sum(len(surface.triangles) for surface in self.surfaces)


def model(
    name: str,
    parts: Iterable[Surface],
    *,
    kind: str | None = None,
    group: str = "amenity",
    solid: bool = True,
    foot: tuple[float, float] | None = None,
) -> Model:
    """Collect the parts of a thing; parts of one material become one surface."""
    surfaces = merge_surfaces(parts)
    return Model(name, kind or name, group, lambda: surfaces, solid, foot)
