"""What furniture is put together from: colours, boxes in a row, legs, rows of goods."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from vico.assets.model import Model, Top, model
from vico.assets.shapes import Colour, box
from vico.world.mesh import Surface

OAK: Colour = (176, 136, 92)
BIRCH: Colour = (214, 186, 144)
WALNUT: Colour = (112, 78, 54)
WHITE: Colour = (234, 232, 226)
STEEL: Colour = (156, 160, 164)
BLACK: Colour = (40, 42, 44)
LINEN: Colour = (226, 220, 206)
GREY: Colour = (120, 124, 128)
DARK: Colour = (74, 76, 80)
BLUE: Colour = (74, 102, 142)
TEAL: Colour = (66, 118, 116)
RED: Colour = (168, 68, 58)
GREEN: Colour = (86, 132, 84)
YELLOW: Colour = (222, 182, 74)
LEAF: Colour = (84, 130, 66)
GLASS: Colour = (178, 204, 212)
SCREEN: Colour = (64, 92, 120)
CERAMIC: Colour = (242, 242, 238)
CREAM: Colour = (236, 222, 190)
STONE: Colour = (172, 166, 156)
GOODS_COLOURS: tuple[Colour, ...] = (
    (196, 72, 60), (222, 180, 70), (80, 140, 98), (76, 112, 168), (200, 130, 70), (238, 236, 226), (140, 86, 140),
)  # fmt: skip

#: A box: extent along x, y, z, then its middle, then its colour.
Part = tuple[float, float, float, float, float, float, Colour]


def facing_front(x: float, y: float, z: float) -> NDArray[np.float64]:
    """Transform that lets what stands on z look towards +x, its foot at a point."""
    return np.array([[0, 0, 1, x], [0, 1, 0, y], [-1, 0, 0, z], [0, 0, 0, 1]], np.float64)


def lying(x: float, y: float, z: float) -> NDArray[np.float64]:
    """Transform that lays what stands on z along +y, its foot at a point: wheels, discs."""
    return np.array([[1, 0, 0, x], [0, 0, 1, y], [0, -1, 0, z], [0, 0, 0, 1]], np.float64)


def boxes(parts: Iterable[Part]) -> list[Surface]:
    """Boxes from rows of numbers."""
    return [box((a, b, c), (x, y, z), colour=colour) for a, b, c, x, y, z, colour in parts]


def legs(x: float, y: float, height: float, colour: Colour, thick: float = 0.06) -> list[Surface]:
    """Four legs under the corners of a top of extent x by y."""
    spots = [(i, j) for i in (-x / 2 + thick / 2, x / 2 - thick / 2) for j in (-y / 2 + thick / 2, y / 2 - thick / 2)]
    return [box((thick, thick, height), (i, j, height / 2), colour=colour) for i, j in spots]


def piece(
    name: str,
    parts: Sequence[Part],
    *more: Surface,
    kind: str | None = None,
    solid: bool = True,
    top: Top | None = None,
) -> Model:
    """A piece of furniture from boxes and other shapes."""
    return model(name, [*boxes(parts), *more], kind=kind, group="indoor", solid=solid, top=top)


def goods_row(
    x: float, y: float, z: float, length: float, *, deep: float, high: float, shift: int, count: int
) -> list[Part]:
    """Packets side by side along y on a shelf at height z, in colours that run on with `shift`."""
    each = length / count
    row: list[Part] = []
    for k in range(count):
        tall = high * (0.72 + 0.14 * ((k + shift) % 3))
        tone = GOODS_COLOURS[(k * 2 + shift) % len(GOODS_COLOURS)]
        row.append((deep, each * 0.86, tall, x, y - length / 2 + each * (k + 0.5), z + tall / 2, tone))
    return row
