"""Upper floors that belong to a few valleys or one coast; what they are copied from is named in the data.

The rows of these sheets are storeys from the first floor up (`records.Family.by_storey`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vico.worldgen.facades.textures.walls import BAYS, STOREYS, Picture, band, cells
from vico.worldgen.facades.textures.windows import shutters, window, window_style
from vico.worldgen.texture_canvas import Canvas, Colour, plaster

_PX = 128  # pixels a bay and a storey
_W, _H = BAYS * _PX, STOREYS * _PX


def _rubble(random: np.random.Generator, base: Colour) -> Canvas:
    """Lay flat stones of all lengths in courses of all heights, in deep joints."""
    canvas = Canvas(_H, _W, base, random)
    y = 0
    while y < _H:
        course = int(random.integers(6, 14))
        x = -int(random.integers(0, 30))
        while x < _W:
            long = int(random.integers(14, 52))
            tone = float(random.normal(1.0, 0.11))
            warm = random.normal(0.0, 5.0)
            stone = np.clip(np.array(base) * tone + np.array([warm, 0.0, -warm]), 40, 240)
            canvas.rect(max(x, 0), y, min(x + long, _W), min(y + course, _H), tuple(stone.tolist()))
            canvas.shade(max(x, 0), y, min(x + 2, _W), min(y + course, _H), 0.62)
            x += long
        canvas.shade(0, y, _W, min(y + 2, _H), 0.6)
        y += course
    canvas.noise(4, 9)
    canvas.grain(3)
    return canvas


def _schist(random: np.random.Generator) -> Picture:
    """Paint a house of brown slate stone: small casements under timber lintels, boarded shutters, wooden rails."""
    canvas = _rubble(random, (160, 146, 128))
    wood, dark = (112, 78, 52), (84, 58, 40)
    for i, j, x, y in cells():
        wide = j in (1, 2) and i % 3 != 2
        low = 14 if wide else 36
        canvas.rect(x - 30, y + 99, x + 30, y + 108, wood)
        canvas.shade(x - 30, y + 97, x + 30, y + 99, 0.7)
        window(canvas, x - 19, y + low, x + 19, y + 99, window_style("schist"), lit=0.34)
        for left in (x - 39, x + 20):
            canvas.rect(left, y + low, left + 19, y + 99, wood)
            for board in (6, 12):
                canvas.shade(left + board, y + low, left + board + 1.5, y + 99, 0.72)
        if wide:
            canvas.rect(x - 46, y + 8, x + 46, y + 14, dark)
            canvas.shade(x - 46, y + 3, x + 46, y + 8, 0.62)
            for bar in np.arange(x - 44, x + 44, 7.0):
                canvas.rect(bar, y + 14, bar + 3, y + 46, wood)
            canvas.rect(x - 46, y + 46, x + 46, y + 50, dark)
    return canvas.texture()


def _riviera(random: np.random.Generator) -> Picture:
    """Paint a front of the Riviera around 1900: pale stucco, garlands, French windows behind white balusters."""
    canvas = plaster(_H, _W, random, (216, 213, 206))
    canvas.noise(3, 30)
    white = (246, 243, 235)
    for j in range(STOREYS):
        band(canvas, j * _PX, 8 if j < 2 else 4, white, 0.8)
    for i, j, x, y in cells():
        left = i * _PX
        canvas.rect(left, y + 8, left + 7, y + _PX, white)
        canvas.shade(left + 7, y + 8, left + 9, y + _PX, 0.84)
        tall = j < 3
        low, high = (10, 104) if tall else (40, 100)
        look = window_style("riviera", hood="pediment" if j == 0 else "flat" if tall else "")
        window(canvas, x - 20, y + low, x + 20, y + high, look, lit=0.3)
        shutters(canvas, x - 20, y + low, x + 20, y + high, (142, 170, 168), shut=0.16)
        for k in (-12, -6, 0, 6, 12):  # a garland over the window
            canvas.rect(x + k - 2, y + 116 - abs(k) / 3, x + k + 2, y + 120 - abs(k) / 3, white)
        if tall:
            canvas.rect(x - 44, y + 4, x + 44, y + 10, white)
            canvas.shade(x - 44, y - 1, x + 44, y + 4, 0.7)
            canvas.shade(x - 42, y + 10, x + 42, y + 38, 0.86)
            for post in np.arange(x - 41, x + 40, 8.0):
                canvas.rect(post, y + 10, post + 4, y + 38, white)
                canvas.rect(post - 1, y + 17, post + 5, y + 26, white)
            canvas.rect(x - 44, y + 38, x + 44, y + 43, white)
    return canvas.texture()


def _casements(random: np.random.Generator) -> Picture:
    """Paint an old town front of the Baltic: smooth lime render, tall casements of six panes flush with the wall."""
    canvas = plaster(_H, _W, random, (214, 210, 202))
    canvas.noise(3, 70)
    for j, high in enumerate((6, 0, 0, 4)):
        if high:
            band(canvas, j * _PX, high, (232, 226, 214), 0.86)
    heights = ((20, 108), (24, 104), (28, 102), (44, 96))
    for _, j, x, y in cells():
        low, high = heights[j]
        window(canvas, x - 25, y + low, x + 25, y + high, window_style("casements", rows=3 if j < 3 else 2), lit=0.36)
    return canvas.texture()


REGIONAL: dict[str, Callable[[np.random.Generator], Picture]] = {
    "wall_schist": _schist,
    "wall_riviera": _riviera,
    "wall_casements": _casements,
}
"""Painters of upper floors by material name."""
