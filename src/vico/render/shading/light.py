"""The tables that the shader reads of the light of a moment."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.lamps.grid import NO_LAMPS, LampGrid
from vico.render.records import LIGHT_UNIFORMS


class ShadowMap(NamedTuple):
    """What the sun sees of the static scene.

    Attributes
    ----------
    closeness
        To the sun of the first surface, 65535 nearest, uint16, shape ``(n, n)``.
    matrix
        Takes a world point (metres) and 1 to column, row and closeness, float32, shape ``(3, 4)``.
    """

    closeness: NDArray[np.uint16]
    matrix: NDArray[np.float32]


class ReliefMap(NamedTuple):
    """Blurred top heights of the static scene; points beneath them see less sky.

    Attributes
    ----------
    height
        World metres, float32, shape ``(m, m)``; rows go north.
    x, y
        South-west corner, world metres.
    texels_per_metre
        Along both axes.
    """

    height: NDArray[np.float32]
    x: float
    y: float
    texels_per_metre: float


class Light(NamedTuple):
    """What the shader reads of the light.

    Attributes
    ----------
    uniforms
        A `LIGHT_UNIFORMS` record.
    tone
        `tone_table`, uint8, shape ``(TONE_STEPS,)``.
    sky
        `paint_sky`: packed like a texture, uint32, shape ``(SKY_SIZE ** 2,)``.
    shadow, relief
        Of the static scene.
    lamps
        Those that stay where they are, as they shine now.
    """

    uniforms: Any
    tone: NDArray[np.uint8]
    sky: NDArray[np.uint32]
    shadow: ShadowMap
    relief: ReliefMap
    lamps: LampGrid


#: For pictures without colours.
NO_LIGHT = Light(
    np.zeros(1, LIGHT_UNIFORMS)[0],
    np.zeros(1, np.uint8),
    np.zeros(1, np.uint32),
    ShadowMap(np.zeros((1, 1), np.uint16), np.zeros((3, 4), np.float32)),
    ReliefMap(np.zeros((1, 1), np.float32), 0.0, 0.0, 0.0),
    NO_LAMPS,
)
