"""Charts: flat rectangles of texels on square pages, one for each plane piece of the buildings' walls and roofs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Chart:
    """A rectangle of texels in space.

    The centre of texel (i, j), pixel ``[y + j, x + i]`` of its page, lies at
    ``origin + (i + 0.5) * right + (j + 0.5) * up``.

    Attributes
    ----------
    entity
        Whose surface it is.
    page, x, y, width, height
        Where its texels lie, pixels; gutters are outside.
    origin
        Corner of texel (0, 0), ENU metres, float64, shape ``(3,)``.
    right, up
        Metres a texel along the rows and the columns, perpendicular, float64, shape ``(3,)``.
    normal
        Outward unit vector, float64, shape ``(3,)``; equals ``right x up`` in direction.
    patch
        Index among all the plane pieces of the surfaces that were unwrapped, those that got no chart included.
    """

    entity: int
    page: int
    x: int
    y: int
    width: int
    height: int
    origin: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    normal: NDArray[np.float64]
    patch: int = -1

    @property
    def box(self) -> tuple[slice, slice]:
        """Rows and columns of its page."""
        return slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)


@dataclass(frozen=True)
class Atlas:
    """The pages of all charts.

    Attributes
    ----------
    pages
        sRGB, uint8, shape ``(h, w, 3)`` each, sides powers of two.
    inside
        Texels that belong to a face, bool, shape ``(h, w)`` each.
    known
        Texels that hold a photo's colour, bool, shape ``(h, w)`` each; always within `inside`.
    charts
        In the order of the surfaces they came from.
    texel
        Side of a texel, metres.
    """

    pages: tuple[NDArray[np.uint8], ...]
    inside: tuple[NDArray[np.bool_], ...]
    known: tuple[NDArray[np.bool_], ...]
    charts: tuple[Chart, ...]
    texel: float
