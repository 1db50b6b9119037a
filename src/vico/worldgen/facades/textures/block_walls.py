"""Upper floors of blocks of flats and high houses that stand for a country: slabs, set-back towers, tiled mansions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vico.worldgen.facades.textures.regional_walls import REGIONAL
from vico.worldgen.facades.textures.townhouse_walls import TOWNHOUSES
from vico.worldgen.facades.textures.walls import BAYS, STOREYS, WALLS, Picture, band, cells
from vico.worldgen.facades.textures.windows import glass, window, window_style
from vico.worldgen.texture_canvas import Canvas, blocks, bricks

_PX = 128  # pixels a bay and a storey
_W, _H = BAYS * _PX, STOREYS * _PX


def _large_panels(random: np.random.Generator) -> Picture:
    """Paint a large-panel block: storey-high panels of washed gravel in dark joints, loggias in every fourth bay."""
    canvas = Canvas(_H, _W, (206, 203, 196), random)
    canvas.grain(8)
    for i, j, x, y in cells():
        left = i * _PX
        canvas.shade(left, y, left + _PX, y + _PX, float(random.normal(1.0, 0.03)))
        if i % 4 == 3:
            canvas.rect(left + 4, y + 4, left + _PX - 4, y + 122, (120, 118, 114))
            window(canvas, left + 16, y + 8, left + 112, y + 108, window_style("panel_loggia"), lit=0.4)
            canvas.shade(left + 4, y + 98, left + _PX - 4, y + 122, 0.55)
            canvas.shade(left + 4, y + 4, left + 14, y + 122, 0.7)
            parapet = ((214, 186, 140), (176, 196, 204), (222, 216, 204))[(i // 4 + j) % 3]
            canvas.rect(left + 2, y + 2, left + _PX - 2, y + 50, parapet)
            for k in range(9):
                canvas.shade(left + 6 + k * 13, y + 4, left + 8 + k * 13, y + 48, 0.84)
            canvas.rect(left + 2, y + 50, left + _PX - 2, y + 53, (88, 88, 88))
            continue
        half = 36 if i % 4 != 2 else 20
        window(canvas, x - half, y + 38, x + half, y + 100, window_style("panel"), lit=0.42)
    for j in range(STOREYS):
        canvas.rect(0, j * _PX - 1, _W, j * _PX + 3, (104, 102, 98))
    for i in range(BAYS):
        canvas.rect(i * _PX - 1, 0, i * _PX + 3, _H, (104, 102, 98))
    return canvas.texture()


def _set_back(random: np.random.Generator) -> Picture:
    """Paint a tower of the 1920s: piers right up, pairs of sashes between, dark spandrels sunk behind the piers."""
    canvas = bricks(_H, _W, random, 4, 8, (196, 178, 150))
    canvas.noise(4, 16)
    for i, _, x, y in cells():
        canvas.shade(x - 50, y, x + 50, y + _PX, 0.8)
        canvas.rect(x - 47, y + 4, x + 47, y + 34, (134, 112, 92))
        for k in range(6):
            canvas.shade(x - 44 + 15.4 * k, y + 8, x - 36 + 15.4 * k, y + 30, 0.82)
        for side in (-25, 25):
            window(canvas, x + side - 19, y + 36, x + side + 19, y + 112, window_style("set_back"), lit=0.32)
        canvas.shade(x - 50, y, x - 45, y + _PX, 0.6)
        canvas.rect(x - 4, y, x + 4, y + _PX, (206, 190, 164))
        canvas.shade(i * _PX, y, i * _PX + 14, y + _PX, 1.08)
        canvas.shade((i + 1) * _PX - 14, y, (i + 1) * _PX, y + _PX, 1.04)
    return canvas.texture()


def _chicago(random: np.random.Generator) -> Picture:
    """Paint glazed terracotta of the 1900s: a wide fixed pane between two sashes in every bay, moulded floors."""
    canvas = blocks(_H, _W, random, 16, 32, (222, 216, 204), joint=0.88)
    trim = (234, 229, 219)
    for j in range(STOREYS):
        band(canvas, j * _PX, 8, trim, 0.72)
        for k in range(_W // 16):
            canvas.shade(k * 16 + 3, j * _PX + 12, k * 16 + 11, j * _PX + 20, 0.9)
    for i, _, x, y in cells():
        canvas.rect(x - 52, y + 26, x + 52, y + 112, (72, 68, 62))
        glass(canvas, x - 27, y + 29, x + 27, y + 109, lively=0.5, lit=0.3)
        for side in (-40, 40):
            window(canvas, x + side - 11, y + 28, x + side + 11, y + 110, window_style("chicago"), lit=0.3)
        canvas.shade(x - 52, y + 104, x + 52, y + 112, 0.55)
        canvas.rect(i * _PX, y, i * _PX + 5, y + _PX, trim)
    return canvas.texture()


def _mansion(random: np.random.Generator) -> Picture:
    """Paint Japanese flats: small glazed tiles, a balcony right along, sliding doors, screens and air conditioners."""
    canvas = blocks(_H, _W, random, 4, 8, (196, 184, 168), joint=0.9)
    for i, j, _, y in cells():
        left = i * _PX
        canvas.rect(left, y + 8, left + _PX, y + 120, (118, 114, 108))
        window(canvas, left + 12, y + 12, left + 116, y + 104, window_style("sliding"), lit=0.42)
        canvas.shade(left, y + 92, left + _PX, y + 120, 0.55)
        if i % 2 == 0:  # the screen to the neighbour's
            canvas.rect(left, y + 8, left + 5, y + 110, (204, 202, 196))
        if (i + j) % 3 == 1:
            canvas.rect(left + 88, y + 10, left + 114, y + 46, (208, 206, 200))
            canvas.shade(left + 92, y + 16, left + 110, y + 40, 0.7)
        if random.random() < 0.3:  # washing on its pole
            canvas.rect(left + 14, y + 88, left + 100, y + 90, (214, 214, 212))
            for k in range(4):
                cloth = ((226, 226, 228), (150, 172, 198), (206, 154, 150))[int(random.integers(3))]
                canvas.rect(left + 20 + 19 * k, y + 60, left + 34 + 19 * k, y + 88, cloth)
        canvas.rect(left, y, left + _PX, y + 12, (214, 206, 192))
        if i % 4 < 2:
            tiles = blocks(38, _PX, random, 2, 8, (204, 192, 176), joint=0.92)
            canvas.pixels[round(y) + 8 : round(y) + 46, left : left + _PX] = tiles.pixels
            canvas.glow[round(y) + 8 : round(y) + 46, left : left + _PX] = 0.0
        else:
            canvas.rect(left, y + 10, left + _PX, y + 46, (172, 186, 190), 0.78)
            canvas.glow[round(y) + 10 : round(y) + 46, left : left + _PX] *= 0.3
            for k in range(4):
                canvas.rect(left + k * 32, y + 8, left + k * 32 + 2, y + 46, (148, 148, 146))
        canvas.rect(left, y + 45, left + _PX, y + 49, (168, 166, 162))
    return canvas.texture()


def _pencil(random: np.random.Generator) -> Picture:
    """Paint a narrow house of shops and offices in a Japanese street: square tiles, one window across the bay."""
    canvas = blocks(_H, _W, random, 8, 8, (206, 204, 200), joint=0.88)
    for i, j, x, y in cells():
        canvas.rect(x - 58, y + 40, x + 58, y + 108, (92, 92, 92))
        window(canvas, x - 56, y + 42, x + 56, y + 106, window_style("pencil"), lively=0.7, lit=0.4)
        canvas.shade(x - 58, y + 100, x + 58, y + 108, 0.6)
        if (3 * i + j) % 5 == 0:
            canvas.rect(x - 50, y + 12, x - 22, y + 32, (206, 206, 202))
            canvas.shade(x - 46, y + 15, x - 27, y + 29, 0.72)
        if (i + 2 * j) % 4 == 1:  # lettering on the panes is as usual as a sign
            canvas.rect(x - 50, y + 48, x - 4, y + 100, (206, 70, 60), 0.35)
    for j in range(STOREYS):
        canvas.shade(0, j * _PX, _W, j * _PX + 3, 0.72)
    return canvas.texture()


UPPER_FLOORS: dict[str, Callable[[np.random.Generator], Picture]] = {
    **WALLS,
    **TOWNHOUSES,
    **REGIONAL,
    "wall_large_panels": _large_panels,
    "wall_set_back": _set_back,
    "wall_chicago": _chicago,
    "wall_mansion": _mansion,
    "wall_pencil": _pencil,
}
"""All painters of upper floors by material name."""
