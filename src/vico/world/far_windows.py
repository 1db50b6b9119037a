"""The windows of houses from afar: one small picture for all of them, which shines by night as near windows do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.world.mean_colours import LINEAR
from vico.world.mesh import Material

BAYS, STOREYS = 4, 4
"""Windows side by side, and above one another, in the picture."""

_SIDE = 16  # texels of a window with the wall around it
_BAY, _STOREY = 3.3, 3.2  # metres
_ACROSS, _UP = slice(5, 11), slice(5, 13)  # of the side: a window of 1.2 m x 1.6 m, as most are
_DARK, _DARK_SHINES = (66, 74, 84), 5
_LAMP, _LAMP_SHINES = (216, 182, 130), 184
# Every third window has a lamp on at night, as those of facades have: which ones looks like chance.
_LIT = frozenset({1, 4, 7, 10, 12})


def _picture() -> NDArray[np.uint8]:
    """Paint a white wall with windows, brighter where a lamp is on; alpha is the light they give."""
    picture = np.zeros((STOREYS * _SIDE, BAYS * _SIDE, 4), np.uint8)
    picture[..., :3] = 255
    for k in range(STOREYS * BAYS):
        row, column = divmod(k, BAYS)
        pane = picture[row * _SIDE :, column * _SIDE :][_UP, _ACROSS]
        pane[..., :3] = _LAMP if k in _LIT else _DARK
        pane[..., 3] = _LAMP_SHINES if k in _LIT else _DARK_SHINES
    return picture


WINDOWS = Material("far windows", _picture(), emission=1.0)
"""What walls with windows are of."""

assert WINDOWS.texture is not None
SHOWN = LINEAR[WINDOWS.texture[..., :3]].mean(axis=(0, 1))
"""The picture's mean colour in linear light: a wall's own colour is divided by it, shape ``(3,)``."""


def has_windows(length: NDArray[np.float64], height: float) -> NDArray[np.bool_]:
    """Return which walls have room for a window, given how long they are and their height, metres."""
    return (length > 0.8 * _BAY) & (height > 0.8 * _STOREY)


def places_of(length: NDArray[np.float64], foot: float, base: float, eaves: float, seed: int) -> NDArray[np.float64]:
    """Return where walls are in the picture, so that no window is cut.

    Parameters
    ----------
    length
        Of the walls, metres, shape ``(n,)``.
    foot, base, eaves
        Heights of their lower edge, of the ground and of their upper edge, metres.
    seed
        Chooses the windows that are lit.

    Returns
    -------
    NDArray
        Texture coordinates of the lower corners and the upper ones, shape ``(n, 4, 2)``: as quads are gone round.
    """
    bays = np.maximum(np.round(length / _BAY), 1.0) / BAYS
    storeys = max(round((eaves - base) / _STOREY), 1) / STOREYS
    below = (foot - base) / (eaves - base) * storeys
    left = (seed + 3.0 * np.arange(len(length))) % BAYS / BAYS
    low = (seed // BAYS) % STOREYS / STOREYS
    bottom, top = np.full(len(length), low + below), np.full(len(length), low + storeys)
    right = left + bays
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return np.stack([np.column_stack(corner) for corner in corners], axis=1)
