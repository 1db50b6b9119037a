"""What is set on roofs and facades as bodies of their own: dormers' fronts, railings, steps. Eight bays to a sheet."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vico.worldgen.facades.textures.walls import BAYS
from vico.worldgen.facades.textures.windows import window, window_style
from vico.worldgen.texture_canvas import Canvas, bricks, plaster

_PX = 128
_RAIL = 64  # pixels a bay of railing, and its height
_SLAB = 11  # of these the floor's edge

Picture = NDArray[np.uint8]


def _dormer(random: np.random.Generator) -> Picture:
    """Paint a casement that all but fills a dormer's front."""
    canvas = plaster(_PX, BAYS * _PX, random, (226, 224, 220))
    for i in range(BAYS):
        x = (i + 0.5) * _PX
        look = window_style("dormer")
        window(canvas, x - 44, 26, x + 44, 116, look, lit=0.3)
    return canvas.texture()


def _oriel(random: np.random.Generator) -> Picture:
    """Paint a storey of an oriel: all but window, between mullions, over a panelled parapet."""
    canvas = plaster(_PX, BAYS * _PX, random, (230, 228, 222))
    for i in range(BAYS):
        x = (i + 0.5) * _PX
        canvas.rect(i * _PX, 0, (i + 1) * _PX, 5, (240, 238, 232))
        canvas.shade(x - 46, 11, x + 46, 31, 0.9)
        canvas.shade(x - 43, 13, x + 43, 29, 1.12)
        window(canvas, x - 50, 40, x + 50, 112, window_style("oriel"), lit=0.32)
        canvas.rect(i * _PX, 118, (i + 1) * _PX, _PX, (240, 238, 232))
        canvas.shade(i * _PX, 115, (i + 1) * _PX, 118, 0.74)
    return canvas.texture()


def _gable_window(random: np.random.Generator) -> Picture:
    """Paint the hatch of a warehouse loft in dark brick, below its hoisting beam."""
    canvas = bricks(_PX, BAYS * _PX, random, 4, 8, (104, 72, 60))
    for i in range(BAYS):
        x = (i + 0.5) * _PX
        window(canvas, x - 16, 18, x + 16, 104, window_style("gable"), lit=0.2)
        canvas.rect(x - 2, 110, x + 2, 122, (48, 40, 36))
    return canvas.texture()


def _pots(random: np.random.Generator) -> Picture:
    """Paint a row of chimney pots, with the dark between them."""
    canvas = Canvas(32, BAYS * 32, (52, 48, 46), random)
    for i in range(BAYS * 2):
        tone = float(random.uniform(0.85, 1.1))
        for k in range(13):
            round_ = 0.66 + 0.5 * float(np.sin(np.pi * (k + 0.5) / 13))
            canvas.rect(i * 16 + 1 + k, 0, i * 16 + 2 + k, 32, np.array([184, 118, 84]) * tone * round_)
        canvas.shade(i * 16 + 1, 27, i * 16 + 14, 29, 0.7)
    return canvas.texture()


def _with_holes(canvas: Canvas, solid: NDArray[np.bool_]) -> Picture:
    colour = np.clip(np.round(canvas.pixels), 0, 255).astype(np.uint8)
    return np.concatenate([colour, np.where(solid, 255, 0).astype(np.uint8)[..., None]], axis=2)


def _slab(canvas: Canvas, colour: tuple[int, int, int]) -> None:
    """Paint the edge of a balcony's floor, below its railing."""
    width = BAYS * _RAIL
    canvas.rect(0, 0, width, _SLAB, colour)
    canvas.rect(0, _SLAB - 2, width, _SLAB, np.asarray(colour, np.float32) * 1.06)


def _iron(random: np.random.Generator) -> Picture:
    """Upright bars between two rails, on a slab."""
    canvas = Canvas(_RAIL, BAYS * _RAIL, (58, 58, 60), random)
    canvas.grain(3)
    solid = _bars()
    solid[:_SLAB] = True
    _slab(canvas, (214, 211, 205))
    return _with_holes(canvas, solid)


def _landing(random: np.random.Generator) -> Picture:
    """Paint the same on an iron grating."""
    canvas = Canvas(_RAIL, BAYS * _RAIL, (52, 50, 50), random)
    canvas.grain(3)
    return _with_holes(canvas, _bars())


def _bars() -> NDArray[np.bool_]:
    solid = np.zeros((_RAIL, BAYS * _RAIL), bool)
    solid[:, np.arange(BAYS * _RAIL) % 8 < 3] = True
    solid[:5] = solid[-5:] = True
    solid[_SLAB : _SLAB + 4] = True
    return solid


def _trestle(random: np.random.Generator) -> Picture:
    """Legs, rails and crossed braces of steel."""
    canvas = Canvas(_RAIL, BAYS * _RAIL, (78, 74, 72), random)
    y, x = np.mgrid[0:_RAIL, 0 : BAYS * _RAIL]
    x = x % _RAIL
    solid = (x < 6) | (x >= _RAIL - 6) | (y >= _RAIL - 8) | (np.abs(y - x) < 3) | (np.abs(y - (_RAIL - 1 - x)) < 3)
    return _with_holes(canvas, solid)


def _steps(random: np.random.Generator) -> Picture:
    """Paint a flight of iron steps from the lower left to the upper right of every bay."""
    size = 2 * _RAIL
    canvas = Canvas(size, BAYS * size, (58, 56, 56), random)
    y, x = np.mgrid[0:size, 0 : BAYS * size]
    x = x % size
    rising = np.abs(y - x) < 5
    rail = (np.abs(y - x - 30) < 2) & (y < size - 2)
    posts = (x % 21 < 2) & (y > x) & (y < x + 31)
    return _with_holes(canvas, rising | rail | posts)


def _wood(random: np.random.Generator) -> Picture:
    """Carved boards, and geraniums along the rail."""
    canvas = Canvas(_RAIL, BAYS * _RAIL, (126, 88, 60), random)
    for x in range(0, BAYS * _RAIL, 8):
        canvas.pixels[:, x : x + 8] *= np.float32(random.normal(1.0, 0.08))
        canvas.shade(x, 0, x + 1, _RAIL, 0.55)
        canvas.rect(x + 3, 22, x + 6, 28, (48, 36, 28))
    _slab(canvas, (98, 68, 48))
    canvas.rect(0, 46, BAYS * _RAIL, 52, (112, 78, 54))
    blooms = np.array([[196, 44, 52], [214, 66, 96], [84, 122, 58], [72, 108, 50], [232, 214, 208]], np.float32)
    for x in range(BAYS):
        if x % 4 == 3:
            continue
        for _ in range(60):
            u, v = x * _RAIL + float(random.uniform(3, _RAIL - 7)), float(random.uniform(46, 61))
            canvas.rect(u, v, u + 3, v + 3, blooms[int(random.integers(len(blooms)))])
    return canvas.texture()


def _glass(random: np.random.Generator) -> Picture:
    """Panes between slim posts."""
    canvas = Canvas(_RAIL, BAYS * _RAIL, (172, 188, 194), random)
    up = np.linspace(0.86, 1.12, _RAIL, dtype=np.float32)[:, None, None]
    canvas.pixels *= up
    canvas.noise(6, 24)
    for x in range(0, BAYS * _RAIL, _RAIL):
        canvas.rect(x, 0, x + 3, _RAIL, (96, 100, 102))
    _slab(canvas, (214, 212, 208))
    canvas.rect(0, _RAIL - 5, BAYS * _RAIL, _RAIL, (108, 112, 114))
    return canvas.texture()


def _open(random: np.random.Generator) -> Picture:
    """Nothing at all: the open sides of what stands as a closed box."""
    made = np.zeros((4, 4, 4), np.uint8)
    made[..., :3] = 128
    return made


def _deck(random: np.random.Generator) -> Picture:
    """Paint a balcony's floor, from below and above."""
    canvas = plaster(64, 64, random)
    return canvas.texture()


TRIMS: dict[str, Callable[[np.random.Generator], Picture]] = {
    "dormer": _dormer,
    "oriel": _oriel,
    "gable_window": _gable_window,
    "chimney_pots": _pots,
    "rail_iron": _iron,
    "rail_steps": _steps,
    "rail_wood": _wood,
    "rail_glass": _glass,
    "rail_open": _open,
    "rail_deck": _deck,
    "rail_landing": _landing,
    "rail_trestle": _trestle,
}
"""Painters by material name; those of ``rail_`` are seen from behind too."""

HOLED = ("rail_iron", "rail_steps", "rail_open", "rail_landing", "rail_trestle")
"""Materials whose alpha means holes."""
