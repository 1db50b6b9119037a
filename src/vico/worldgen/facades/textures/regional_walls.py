"""Upper floors of one country, coast or building boom: town houses, valleys, and blocks of flats and high houses.

What they are copied from is named in the data. The rows of the sheets of town houses are storeys from the first floor
up (`records.Family.by_storey`): their windows grow smaller towards the eaves, and what belongs to the best floor is on
the lowest row.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vico.worldgen.facades.textures.walls import BAYS, STOREYS, WALLS, Picture, band, cells
from vico.worldgen.facades.textures.windows import glass, railing, shutters, window, window_style
from vico.worldgen.texture_canvas import Canvas, Colour, blocks, bricks, plaster

_PX = 128  # pixels a bay and a storey
_W, _H = BAYS * _PX, STOREYS * _PX


def _bracket(canvas: Canvas, x: float, y: float, colour: Colour, height: float = 12.0) -> None:
    """Paint a console that carries a hood or a sill, with its shadow."""
    canvas.rect(x - 3, y - height, x + 3, y, colour)
    canvas.shade(x + 3, y - height, x + 5, y, 0.72)
    canvas.shade(x - 3, y - height, x + 3, y - height + 3, 0.8)


def _balusters(canvas: Canvas, x0: float, x1: float, y: float, height: float, colour: Colour) -> None:
    canvas.rect(x0, y, x1, y + height, colour)
    for x in np.arange(x0 + 4, x1 - 4, 6.0):
        canvas.shade(x, y + 2, x + 3, y + height - 3, 0.66)


def _tenement_palace(random: np.random.Generator) -> Picture:
    """Paint the stucco of a Berlin tenement: grooves, pilasters, pediments on consoles, a frieze under the eaves."""
    canvas = plaster(_H, _W, random, (216, 212, 205))
    trim = (240, 237, 230)
    canvas.pixels[:_PX] *= 0.97
    for groove in range(6, _PX, 15):  # banded stucco of the first floor
        canvas.shade(0, groove, _W, groove + 2, 0.78)
        canvas.shade(0, groove + 2, _W, groove + 3, 1.05)
    for j, height in enumerate((9, 8, 5, 5)):
        band(canvas, j * _PX, height, trim)
    hoods = ("flat", "gable", "flat", "")
    for i, j, x, y in cells():
        look = window_style("tenement_palace", hood=hoods[j])
        low, high = (26, 104) if j < 3 else (26, 96)
        if j in (1, 2):  # pilasters between the bays
            for side in (-58, 52):
                canvas.rect(x + side, y + 9, x + side + 6, y + 122, trim)
                canvas.shade(x + side + 6, y + 9, x + side + 9, y + 122, 0.8)
                canvas.rect(x + side - 2, y + 116, x + side + 8, y + 122, trim)
        window(canvas, x - 23, y + low, x + 23, y + high, look, lit=0.34)
        if j == 1:
            _balusters(canvas, x - 31, x + 31, y + 9, 13, trim)
            for side in (-29, 29):
                _bracket(canvas, x + side, y + high + 7, trim)
        elif j == 2:
            canvas.shade(x - 27, y + 8, x + 27, y + 20, 0.88)
            canvas.shade(x - 24, y + 10, x + 24, y + 18, 1.18)
            canvas.rect(x - 5, y + high, x + 5, y + high + 14, trim)
        elif j == 3:
            for k in range(5):  # consoles of the main cornice
                _bracket(canvas, i * _PX + 13 + k * 25.6, y + _PX - 1, trim, 17)
    return canvas.texture()


def _georgian(random: np.random.Generator) -> Picture:
    """Paint stock brick of the eighteenth century: flat gauged arches over sashes that shrink towards the parapet."""
    canvas = bricks(_H, _W, random, 4, 8, (148, 126, 98))
    canvas.noise(5, 12)
    band(canvas, 0, 6, (228, 224, 214), 0.8)
    tall = ((10, 112), (24, 108), (32, 96), (38, 82))
    for _, j, x, y in cells():
        low, high = tall[j]
        for k in range(12):  # a flat arch of rubbed bricks widens upwards
            side = 21 + 0.45 * k
            canvas.rect(x - side, y + high + k, x + side, y + high + k + 1, (176, 112, 84))
        for joint in np.linspace(-20, 20, 9):
            canvas.shade(x + joint, y + high, x + joint + 1, y + high + 12, 0.86)
        look = window_style("georgian", rows=(4, 4, 4, 2)[j])
        window(canvas, x - 19, y + low, x + 19, y + high, look, lit=0.32)
        if j == 0:
            railing(canvas, x - 24, y + 9, x + 23, y + 34, (38, 40, 42), gap=4.0)
    return canvas.texture()


def _victorian(random: np.random.Generator) -> Picture:
    """Paint red brick in bands of buff, sashes of plate glass in pairs under white heads with keystones."""
    canvas = bricks(_H, _W, random, 4, 8, (150, 82, 66))
    white, buff = (226, 220, 206), (198, 170, 126)
    for j in range(STOREYS):
        for low, height in ((24, 5), (92, 4), (118, 6)):
            canvas.rect(0, j * _PX + low, _W, j * _PX + low + height, buff if height != 6 else (116, 60, 50))
        for k in range(_W // 16):  # dog-tooth course
            canvas.shade(k * 16, j * _PX + 118, k * 16 + 8, j * _PX + 124, 0.78)
    for _, j, x, y in cells():
        for side in (-22, 22):
            look = window_style("victorian", arch=j == 1, trim=white)
            window(canvas, x + side - 16, y + 30, x + side + 16, y + (100 if j else 104), look, lit=0.34)
            canvas.rect(x + side - 4, y + 99, x + side + 4, y + 111, white)
        canvas.rect(x - 44, y + 22, x + 44, y + 28, white)
        canvas.shade(x - 44, y + 18, x + 44, y + 22, 0.7)
    return canvas.texture()


def _brownstone(random: np.random.Generator) -> Picture:
    """Paint smooth brown sandstone: tall windows in heavy frames, hoods and sills on brackets."""
    canvas = blocks(_H, _W, random, 64, 512, (126, 90, 72), joint=0.94)
    canvas.noise(4, 20)
    trim = (144, 104, 84)
    tall = ((12, 110), (22, 106), (26, 102), (28, 98))
    for _, j, x, y in cells():
        low, high = tall[j]
        look = window_style("brownstone", trim=trim)
        window(canvas, x - 24, y + low, x + 24, y + high, look, lit=0.34)
        canvas.rect(x - 38, y + high + 8, x + 38, y + high + 15, trim)
        canvas.shade(x - 38, y + high + 4, x + 38, y + high + 8, 0.55)
        for side in (-31, 31):
            _bracket(canvas, x + side, y + high + 8, trim)
            _bracket(canvas, x + side * 0.8, y + low - 5, trim, 7)
    return canvas.texture()


def _cast_iron(random: np.random.Generator) -> Picture:
    """Paint a front of cast iron: columns, wide windows with round corners, an entablature at every floor."""
    canvas = Canvas(_H, _W, (220, 216, 206), random)
    canvas.noise(3, 24)
    canvas.grain(1)
    for i, j, x, y in cells():
        look = window_style("cast_iron", arch=j == STOREYS - 1)
        window(canvas, x - 44, y + 20, x + 44, y + 108, look, lively=0.5, lit=0.3)
        for side in (i * _PX + 4, (i + 1) * _PX - 14):
            canvas.rect(side, y + 18, side + 10, y + 110, (230, 226, 217))
            canvas.shade(side, y + 18, side + 2, y + 110, 0.8)
            canvas.shade(side + 6, y + 18, side + 10, y + 110, 0.86)
            canvas.rect(side - 2, y + 104, side + 12, y + 110, (236, 232, 224))
            canvas.rect(side - 2, y + 16, side + 12, y + 21, (236, 232, 224))
        canvas.shade(x - 44, y + 106, x + 44, y + 110, 0.6)
    for j in range(STOREYS):
        band(canvas, j * _PX, 9, (234, 230, 221), 0.55)
        canvas.shade(0, j * _PX + 113, _W, j * _PX + 115, 0.78)
    return canvas.texture()


def _jugend(random: np.random.Generator) -> Picture:
    """Paint Nordic Art Nouveau: roughcast, small panes above clear ones, unlike windows, a frieze of leaves."""
    canvas = plaster(_H, _W, random, (206, 202, 194))
    canvas.grain(9)
    canvas.noise(5, 60)
    stone = (172, 166, 158)
    rough = canvas.pixels[3 * _PX + 6 :].copy()
    canvas.pixels[3 * _PX + 6 :] = rough * np.array([1.06, 1.04, 1.0], np.float32)
    for k in range(_W // 32):  # relief of leaves under the top floor
        for dx, dy in ((-9, 0), (0, 5), (9, 0), (-5, 8), (5, 8)):
            across, up = k * 32 + 16 + dx, 3 * _PX - 14 + dy
            canvas.rect(across - 3, up - 3, across + 3, up + 3, (228, 224, 214))
            canvas.shade(across - 3, up - 5, across + 3, up - 3, 0.78)
    for j in (0, 3):
        band(canvas, j * _PX, 5, stone, 0.84)
    for i, j, x, y in cells():
        wide = i % 4 in (1, 2)
        spans = ((-42, 42),) if wide and j != 3 else ((-34, -4), (4, 34)) if j != 2 else ((-22, 22),)
        for left, right in spans:
            arch = j == 2 and not wide
            look = window_style("jugend", columns=3 if right - left > 60 else 1 if right - left < 34 else 2, arch=arch)
            x0, x1, y0, y1 = x + left, x + right, y + 28, y + (108 if arch else 102)
            window(canvas, x0, y0, x1, y1, look, lit=0.34)
            if not arch:  # small panes in the upper third
                cut = y1 - (y1 - y0) * 0.36
                for bar in np.arange(x0 + 7, x1 - 3, 7.5):
                    canvas.rect(bar, cut, bar + 1.3, y1, look.frame)
                canvas.rect(x0, (cut + y1) / 2, x1, (cut + y1) / 2 + 1.3, look.frame)
        if j == 1 and wide:
            canvas.rect(x - 46, y + 103, x + 46, y + 112, stone)
            canvas.shade(x - 46, y + 101, x + 46, y + 103, 0.7)
    return canvas.texture()


def _palazzo(random: np.random.Generator) -> Picture:
    """Paint Italian stucco: wide walls between tall shuttered windows in pale frames, small ones under the eaves."""
    canvas = plaster(_H, _W, random, (214, 209, 200))
    canvas.noise(7, 7)
    canvas.noise(4, 30)
    pale = (238, 234, 224)
    for j, height in enumerate((7, 4, 4, 4)):
        band(canvas, j * _PX, height, pale, 0.8)
    tall = ((14, 108), (20, 104), (26, 98), (44, 92))
    for _, j, x, y in cells():
        low, high = tall[j]
        look = window_style("palazzo", hood="flat" if j < 2 else "", surround=5 if j < 3 else 4)
        window(canvas, x - 17, y + low, x + 17, y + high, look, lit=0.3)
        shutters(canvas, x - 17, y + low, x + 17, y + high, (66, 92, 74), shut=0.4)
        if j == 0:
            canvas.rect(x - 26, y + 8, x + 26, y + 13, pale)
    return canvas.texture()


def _azulejo(random: np.random.Generator) -> Picture:
    """Paint a front of glazed tiles: a small pattern all over, French windows in limestone behind iron."""
    canvas = Canvas(_H, _W, (208, 210, 208), random)
    y, x = np.mgrid[0:_H, 0:_W]
    u, v = np.abs(x % 8 - 3.5), np.abs(y % 8 - 3.5)
    flower = (np.hypot(u, v) < 2.2) | (u + v > 6.2)
    canvas.pixels[flower] *= np.array([0.72, 0.78, 0.86], np.float32)
    glaze = random.normal(1.0, 0.035, (_H // 8, _W // 8)).astype(np.float32)
    canvas.pixels *= glaze.repeat(8, 0).repeat(8, 1)[..., None]
    canvas.noise(3, 9)
    stone = (236, 229, 214)
    for j in range(STOREYS):
        band(canvas, j * _PX, 6, stone, 0.78)
    for _, _, x0, y0 in cells():
        look = window_style("azulejo", trim=stone)
        window(canvas, x0 - 20, y0 + 10, x0 + 20, y0 + 104, look, lit=0.32)
        canvas.rect(x0 - 30, y0 + 3, x0 + 30, y0 + 9, stone)
        canvas.shade(x0 - 30, y0 - 2, x0 + 30, y0 + 3, 0.66)
        railing(canvas, x0 - 28, y0 + 9, x0 + 27, y0 + 46, (36, 42, 40), gap=3.6)
    return canvas.texture()


def _canal_house(random: np.random.Generator) -> Picture:
    """Paint a canal house: dark brick all but given over to large white sashes of many panes."""
    canvas = bricks(_H, _W, random, 4, 8, (104, 72, 60))
    stone = (222, 216, 204)
    tall = ((12, 116), (16, 110), (22, 104), (30, 92))
    for _, j, x, y in cells():
        low, high = tall[j]
        canvas.rect(x - 40, y + high, x + 40, y + high + 6, (132, 84, 66))
        canvas.rect(x - 5, y + high, x + 5, y + high + 8, stone)
        look = window_style("canal_house", rows=(5, 4, 4, 3)[j])
        window(canvas, x - 37, y + low, x + 37, y + high, look, lively=0.8, lit=0.36)
    return canvas.texture()


TOWNHOUSES: dict[str, Callable[[np.random.Generator], Picture]] = {
    "wall_tenement_palace": _tenement_palace,
    "wall_georgian": _georgian,
    "wall_victorian": _victorian,
    "wall_brownstone": _brownstone,
    "wall_cast_iron": _cast_iron,
    "wall_jugend": _jugend,
    "wall_palazzo": _palazzo,
    "wall_azulejo": _azulejo,
    "wall_canal_house": _canal_house,
}
"""Painters of upper floors by material name."""


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
