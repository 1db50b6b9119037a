"""A city as a photogrammetry tileset gives it: one soup of textured triangles, in the local frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class TileMesh:
    """Textured triangles of a 3D tileset, ENU metres.

    Attributes
    ----------
    positions
        float64, shape ``(n, 3)``.
    triangles
        Vertex indices, counter-clockwise seen from outside, int32, shape ``(m, 3)``.
    uv
        Texture coordinates, float32, shape ``(n, 2)``; v = 0 is the texture's row 0.
    texture_of
        Index into `textures` of each triangle, or -1 where it has none, int32, shape ``(m,)``.
    textures
        sRGB, uint8, shape ``(h, w, 3)`` each.
    colour
        Base colour of each vertex, sRGB uint8, shape ``(n, 3)``; multiplies the texture.
    attributions
        Whom to credit, each once.
    """

    positions: NDArray[np.float64]
    triangles: NDArray[np.int32]
    uv: NDArray[np.float32]
    texture_of: NDArray[np.int32]
    textures: tuple[NDArray[np.uint8], ...]
    colour: NDArray[np.uint8]
    attributions: tuple[str, ...] = ()
