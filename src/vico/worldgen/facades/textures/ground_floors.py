"""Ground floors: eight bays side by side from the pavement to the first floor, in twice the detail of those above.

One more sheet has door leaves, show windows and plain paint, from which doorways and shop fronts are put together.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vico.assets.house_doors import DOOR_CELLS, SHEET, Cell
from vico.worldgen.facades.textures.walls import BAYS
from vico.worldgen.facades.textures.windows import glass, railing, shutters, window, window_style
from vico.worldgen.texture_canvas import Canvas, Colour, blocks, bricks, plaster

_PX = 256  # pixels a bay and a ground floor
_W = BAYS * _PX

BARE = {
    "ground_shops": "ground_rusticated",
    "ground_cafes": "ground_rusticated",
    "ground_lobby": "ground_rusticated",
    "ground_loft": "ground_rusticated",
    "ground_gates": "ground_plain",
}
"""What stands for bare wall where a sheet has next to none between its windows."""
PIER = {
    "ground_shops": 0.05,
    "ground_cafes": 0.11,
    "ground_lobby": 0.08,
    "ground_gates": 0.08,
    "ground_arcade": 0.18,
    "ground_loft": 0.07,
    "ground_brownstone": 0.13,
    "ground_shuttered": 0.18,
}
"""Share of a bay, to either side of its edge, that shows bare wall; elsewhere it is `PIER_ELSE`."""
PIER_ELSE = 0.22

Picture = NDArray[np.uint8]


def _course(canvas: Canvas, colour: Colour, low: float = 240.0) -> None:
    """Paint the string course under the first floor, and its shadow."""
    canvas.rect(0, low, _W, _PX, colour)
    canvas.rect(0, low + 5, _W, low + 7, np.asarray(colour, np.float32) * 0.9)
    canvas.shade(0, low - 7, _W, low, 0.66)


def _soil(canvas: Canvas) -> None:
    """Splashed and worn near the pavement."""
    fade = np.linspace(0.8, 1.0, 26, dtype=np.float32)[:, None, None]
    canvas.pixels[:26] *= fade


_GOODS = np.array(
    [
        [206, 196, 178], [172, 140, 104], [62, 70, 92], [70, 68, 68], [142, 74, 62], [104, 106, 80], [184, 142, 138],
        [196, 176, 140], [216, 214, 208], [44, 44, 48], [186, 150, 78], [122, 138, 122], [112, 84, 66], [92, 112, 128],
    ],
    np.float32,
)  # fmt: skip
"""Colours of what stands in shop windows."""


def show_window(
    canvas: Canvas, x0: float, y0: float, x1: float, y1: float, *, kind: int = 0, lamp: float = 0.9
) -> None:
    """Paint a shop window: a lit room with shelves, dummies, tables or posters, dim by day behind the mirrored street.

    Parameters
    ----------
    kind
        0 shelves of goods, 1 dummies on a podium, 2 tables and lamps, 3 counters and posters.
    lamp
        How brightly it is lit at night, 0..1.
    """
    random = canvas.random
    a, b, c, d = (round(v) for v in (x0, y0, x1, y1))
    if c - a < 3 or d - b < 3:
        return
    up = np.linspace(0, 1, d - b, dtype=np.float32)[:, None, None]
    across = np.linspace(0, 1, c - a, dtype=np.float32)[None, :, None]
    width, height = c - a, d - b
    # A room: floor, back wall lit from above, ceiling with lamps.
    warm = np.array([[158, 136, 106], [150, 140, 124], [146, 112, 76], [142, 136, 126]][kind], np.float32)
    wall = 0.3 + 0.42 * np.clip(1.1 - np.abs(up - 0.66) * 1.9, 0, 1) * (1.0 - 0.35 * np.abs(across - 0.5))
    canvas.pixels[b:d, a:c] = warm * np.where(up < 0.1, 0.5, np.where(up > 0.86, 0.34, wall))
    canvas.glow[b:d, a:c] = 255 * lamp

    def thing(x: float, y: float, w: float, h: float, colour: Colour, opacity: float = 0.9) -> None:
        left, right = max(a + x, a), min(a + x + w, c)
        view = canvas.pixels[round(b + y) : min(round(b + y + h), d), round(left) : round(right)]
        view += (np.asarray(colour, np.float32) - view) * opacity

    def colour_of_goods() -> NDArray[np.float32]:
        return _GOODS[own[int(random.integers(4))]] * np.float32(random.uniform(0.62, 1.0))

    # A shop has few colours of its own.
    own = random.choice(len(_GOODS), 4, replace=False)
    for x in np.arange(0.08, 1.0, max(22 / width, 0.12)) * width:
        thing(x, 0.9 * height, 5, 2, (255, 246, 220), 1.0)
    if kind == 0:
        _shelves(thing, colour_of_goods, width, height, random)
    elif kind == 1:
        thing(0, 0, width, 0.1 * height, (168, 162, 152))
        thing(0, 0.09 * height, width, 2, (206, 200, 190))
        for x in np.arange(0.16, 1.0, max(0.36, 58 / width)) * width:
            cloth = colour_of_goods()
            thing(x - 6, 0.1 * height, 4, 0.3 * height, cloth * 0.5)
            thing(x + 1, 0.1 * height, 4, 0.3 * height, cloth * 0.5)
            thing(x - 8, 0.36 * height, 15, 0.29 * height, cloth)
            thing(x - 10, 0.4 * height, 3, 0.24 * height, cloth * 0.8)
            thing(x + 6, 0.4 * height, 3, 0.24 * height, cloth * 0.8)
            thing(x - 3, 0.66 * height, 6, 0.08 * height, (196, 176, 158))
    elif kind == 2:
        for x in np.arange(0.1, 1.0, max(0.28, 34 / width)) * width:
            thing(x - 12, 0.28 * height, 26, 3, (112, 82, 58))
            thing(x, 0.02 * height, 3, 0.26 * height, (58, 46, 38))
            thing(x - 16, 0.04 * height, 5, 0.38 * height, (50, 42, 38))
            thing(x + 14, 0.04 * height, 5, 0.38 * height, (50, 42, 38))
            thing(x - 4, 0.72 * height, 9, 0.06 * height, (252, 226, 170), 1.0)
            thing(x, 0.78 * height, 1, 0.22 * height, (40, 36, 34))
    else:
        x = 4.0
        while x < width - 12:
            w, h = float(random.uniform(14, 30)), float(random.uniform(0.08, 0.24)) * height
            thing(x, 0, w, h, (176, 172, 164), 0.8)
            thing(x, h - 1.5, w, 1.5, (214, 210, 202))
            for place in np.arange(x + 2, x + w - 5, 8.0):
                thing(
                    place, h, float(random.uniform(3, 6)), float(random.uniform(0.05, 0.16)) * height, colour_of_goods()
                )
            x += w + float(random.uniform(4, 22))
        if random.random() < 0.5:
            left = float(random.uniform(0.1, 0.6)) * width
            thing(left, 0.42 * height, 0.26 * width, 0.36 * height, colour_of_goods(), 0.8)
            for line in (0.5, 0.56, 0.62):
                thing(left + 0.03 * width, line * height, float(random.uniform(0.08, 0.2)) * width, 2, (226, 222, 214))
    # By day the street mirrors in the pane: the sky above the roofs opposite, dull facades below.
    steps = np.sort(random.uniform(0.0, 1.0, 3))
    roofs = random.uniform(0.45, 0.85, 4).astype(np.float32)[np.searchsorted(steps, across[0, :, 0])][None, :, None]
    sky = np.clip((up + 0.06 * across - roofs) * 14.0, 0, 1)
    view = canvas.pixels[b:d, a:c]
    view += (np.array([84, 82, 82], np.float32) - view) * np.float32(0.16)
    view += (np.array([150, 168, 188], np.float32) - view) * (0.3 * sky * (0.75 + 0.25 * up))
    canvas.shade(a, d - 5, c, d, 0.6)
    canvas.shade(a, b, a + 2, d, 0.7)


def _shelves(
    thing: Callable[..., None],
    colour_of_goods: Callable[[], NDArray[np.float32]],
    width: int,
    height: int,
    random: np.random.Generator,
) -> None:
    """Shelves up to a man's height, filled in runs of like things."""
    for level in (0.03, 0.22, 0.41, 0.6):
        thing(0, level * height - 2, width, 2, (78, 68, 58))
        x = 2.0
        while x < width - 6:
            w, h = float(random.uniform(3, 8)), float(random.uniform(0.07, 0.15)) * height
            colour = colour_of_goods()
            for _ in range(int(random.integers(2, 6))):
                if x < width - w:
                    thing(x, level * height, w - 1, h * float(random.uniform(0.9, 1.05)), colour)
                x += w
            x += float(random.uniform(0, 6))


def _shops(random: np.random.Generator) -> Picture:
    """Recent shop fronts: panes between slim piers, lights above a transom; no trade is recognisable."""
    canvas = blocks(_PX, _W, random, 32, 64, (158, 155, 150))
    paints = ((58, 62, 66), (78, 52, 46), (50, 66, 60), (62, 58, 72), (104, 94, 76), (46, 56, 74), (70, 70, 68))
    for i in range(BAYS):
        x = i * _PX
        canvas.rect(x + 14, 14, x + _PX - 14, 234, (48, 48, 50))
        edges = np.linspace(x + 18, x + _PX - 18, 4 if i % 2 else 3)
        kind = int(random.integers(4))
        for left, right in pairwise(edges):
            show_window(canvas, left + 2, 26, right - 2, 184, kind=kind, lamp=float(random.choice([0.25, 0.6, 0.85])))
        paint = np.asarray(paints[i % len(paints)], np.float32)
        canvas.rect(x + 14, 184, x + _PX - 14, 192, paint)
        for left, right in pairwise(np.linspace(x + 18, x + _PX - 18, 5 if i % 2 else 4)):
            glass(canvas, left + 2, 194, right - 2, 228, lively=0.0, lit=0.4)
        canvas.rect(x + 12, 228, x + _PX - 12, 233, paint * 1.2)
        canvas.shade(x + 14, 180, x + _PX - 14, 184, 0.6)
        canvas.shade(x + 16, 222, x + _PX - 16, 228, 0.6)
    _course(canvas, (206, 202, 196))
    canvas.rect(0, 0, _W, 12, (112, 108, 104))
    _soil(canvas)
    return canvas.texture()


def _cafes(random: np.random.Generator) -> Picture:
    """Older shop fronts in a stone ground floor: piers, panelled stall-risers, fanlights, some with an awning."""
    canvas = blocks(_PX, _W, random, 32, 64, (206, 201, 193))
    paints = ((46, 66, 56), (96, 46, 42), (52, 60, 84), (122, 98, 64), (58, 54, 52), (74, 88, 82))
    for i in range(BAYS):
        x = i * _PX
        paint = np.asarray(paints[int(random.integers(len(paints)))], np.float32)
        canvas.rect(x + 30, 12, x + _PX - 30, 222, paint * 0.85)
        parts = [(x + 38, x + 124), (x + 132, x + _PX - 38)]
        kind = int(random.integers(4))
        lamp = float(random.choice([0.3, 0.65, 0.9]))
        for left, right in parts:
            show_window(canvas, left, 58, right, 156, kind=kind, lamp=lamp)
            glass(canvas, left, 162, right, 184, lively=0.0, lit=lamp)
            canvas.rect(left, 18, right, 52, paint * 1.15)
            canvas.shade(left + 6, 23, right - 6, 47, 0.82)
            canvas.shade(left + 8, 25, right - 8, 45, 1.2)
        canvas.rect(x + 26, 190, x + _PX - 26, 222, paint)
        for k in range(4):  # a frieze of panels, where a sign would be one board
            panel = x + 34 + k * 47.5
            canvas.shade(panel, 195, panel + 40, 215, 0.76)
            canvas.shade(panel + 2, 197, panel + 38, 213, 1.26)
        canvas.rect(x + 26, 218, x + _PX - 26, 222, paint * 1.3)
        canvas.shade(x + 30, 184, x + _PX - 30, 190, 0.55)
        if i in (2, 5):
            canvas.rect(x + 24, 152, x + _PX - 24, 190, paint * 1.2)
            canvas.rect(x + 24, 152, x + _PX - 24, 160, paint * 0.9)
            canvas.shade(x + 24, 142, x + _PX - 24, 152, 0.6)
    _course(canvas, (232, 228, 220))
    canvas.rect(0, 0, _W, 10, (150, 146, 140))
    _soil(canvas)
    return canvas.texture()


def _rustication(random: np.random.Generator) -> Picture:
    """Grooved blocks over a plinth, windows in surrounds with keystones."""
    canvas = blocks(_PX, _W, random, 32, 128, (226, 223, 217))
    canvas.rect(0, 0, _W, 34, (158, 154, 150))
    canvas.shade(0, 34, _W, 37, 0.8)
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        look = window_style("ground_rusticated")
        window(canvas, x - 46, 78, x + 46, 204, look, lit=0.34)
        canvas.rect(x - 9, 206, x + 9, 232, (232, 229, 223))
        canvas.shade(x + 9, 206, x + 12, 232, 0.8)
        if i % 4 == 2:
            for bar in range(7):
                canvas.rect(x - 40 + bar * 13, 80, x - 38 + bar * 13, 202, (62, 62, 62))
        canvas.rect(x - 16, 10, x + 16, 26, (74, 72, 70))
    _course(canvas, (236, 233, 227))
    _soil(canvas)
    return canvas.texture()


def _plain(random: np.random.Generator) -> Picture:
    """Smooth render over a dark plinth."""
    canvas = plaster(_PX, _W, random)
    canvas.rect(0, 0, _W, 40, (168, 164, 158))
    canvas.shade(0, 40, _W, 42, 0.84)
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        half = (50, 44, 50, 30)[i % 4]
        look = window_style("ground_plain", columns=2 if half > 30 else 1)
        window(canvas, x - half, 84, x + half, 200, look, lit=0.36)
    _course(canvas, (222, 219, 213), 246)
    _soil(canvas)
    return canvas.texture()


def _shutter(random: np.random.Generator) -> Picture:
    """Render with shuttered windows, stone frames and an iron grille now and then."""
    canvas = plaster(_PX, _W, random, (214, 210, 202))
    canvas.rect(0, 0, _W, 44, (188, 180, 168))
    canvas.shade(0, 44, _W, 47, 0.82)
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        look = window_style("ground_shuttered")
        window(canvas, x - 34, 84, x + 34, 204, look, lit=0.34)
        if i % 3 == 2:
            railing(canvas, x - 36, 84, x + 34, 204, (52, 52, 52), gap=9)
        else:
            shutters(canvas, x - 34, 84, x + 34, 204, (112, 120, 108), shut=0.2)
    _course(canvas, (228, 222, 212), 246)
    _soil(canvas)
    return canvas.texture()


def _stucco(random: np.random.Generator) -> Picture:
    """Paint white stucco, lined out as stone, over an area's railings: the ground floor of a Georgian terrace."""
    canvas = plaster(_PX, _W, random, (236, 234, 228))
    for y in range(48, 236, 30):
        canvas.shade(0, y, _W, y + 3, 0.8)
        canvas.shade(0, y + 3, _W, y + 4, 1.04)
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        for joint in (-100, 100):
            canvas.shade(x + joint, 50, x + joint + 2, 232, 0.86)
        look = window_style("ground_stucco", arch=i % 4 == 1)
        window(canvas, x - 42, 74, x + 42, 214, look, lit=0.34)
    canvas.rect(0, 0, _W, 40, (178, 176, 172))
    canvas.shade(0, 0, _W, 34, 0.7)
    railing(canvas, 2, 2, _W - 6, 66, (30, 32, 34), gap=12)
    _course(canvas, (240, 238, 232), 238)
    _soil(canvas)
    return canvas.texture()


def _granite(random: np.random.Generator) -> Picture:
    """Paint rough-hewn granite with round-headed openings: below the roughcast of Nordic Art Nouveau."""
    canvas = blocks(_PX, _W, random, 32, 64, (150, 140, 136))
    canvas.grain(12)
    canvas.noise(7, 64)
    for y in range(0, _PX, 32):  # hewn faces catch the light above and throw a shadow below
        canvas.shade(0, y + 24, _W, y + 31, 1.14)
        canvas.shade(0, y + 2, _W, y + 8, 0.82)
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        look = window_style("ground_granite", arch=i % 2 == 0)
        window(canvas, x - 52, 72, x + 52, 212 if i % 2 == 0 else 196, look, lit=0.36)
    _course(canvas, (172, 164, 158), 242)
    _soil(canvas)
    return canvas.texture()


def _brick_ground(random: np.random.Generator, base: Colour = (158, 104, 86)) -> Picture:
    canvas = bricks(_PX, _W, random, 8, 16, base)
    canvas.rect(0, 0, _W, 38, (176, 170, 164))
    canvas.shade(0, 38, _W, 41, 0.8)
    stone = (222, 216, 204)
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        look = window_style("ground_brick", trim=stone)
        window(canvas, x - 42, 76, x + 42, 202, look, lit=0.34)
    _course(canvas, stone, 242)
    _soil(canvas)
    return canvas.texture()


def _brownstone(random: np.random.Generator) -> Picture:
    """Paint a high stone basement of brown sandstone below brick."""
    canvas = blocks(_PX, _W, random, 32, 128, (176, 146, 122))
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        look = window_style("ground_brownstone")
        for side in (-50, 50):
            window(canvas, x + side - 28, 74, x + side + 28, 204, look, lit=0.36)
            if i % 2:
                for bar in range(5):
                    canvas.rect(x + side - 24 + bar * 12, 76, x + side - 22 + bar * 12, 202, (48, 48, 48))
    _course(canvas, (196, 168, 144), 242)
    canvas.rect(0, 0, _W, 30, (140, 116, 98))
    _soil(canvas)
    return canvas.texture()


def _boards_ground(random: np.random.Generator) -> Picture:
    canvas = plaster(_PX, _W, random, (206, 204, 200))
    for y in range(0, _PX, 14):
        canvas.pixels[y : y + 2] *= 0.74
        canvas.pixels[y + 2 : y + 5] *= 0.94
    canvas.rect(0, 0, _W, 36, (164, 160, 154))
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        look = window_style("ground_boards")  # fmt: skip
        window(canvas, x - 38, 82, x + 38, 204, look, lit=0.36)
    canvas.rect(0, 246, _W, _PX, (240, 239, 236))
    _soil(canvas)
    return canvas.texture()


def _arcade(random: np.random.Generator) -> Picture:
    canvas = blocks(_PX, _W, random, 32, 64, (206, 203, 198))
    canvas.rect(0, 0, _W, 30, (156, 152, 148))
    canvas.shade(0, 30, _W, 33, 0.8)
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        canvas.rect(x - 78, 30, x + 78, 160, (224, 221, 215))
        canvas.arch(x - 78, 100, x + 78, 236, (224, 221, 215))
        look = window_style("ground_arcade")
        window(canvas, x - 62, 36, x + 62, 222, look, lively=0.4, lit=0.4)
        canvas.rect(x - 9, 216, x + 9, 240, (230, 227, 221))
    _course(canvas, (230, 227, 221))
    _soil(canvas)
    return canvas.texture()


def _lobby(random: np.random.Generator) -> Picture:
    """Paint a glazed office ground floor with columns and lit halls behind."""
    canvas = blocks(_PX, _W, random, 64, 128, (176, 176, 176))
    for i in range(BAYS):
        x = i * _PX
        canvas.rect(x + 22, 12, x + _PX - 22, 226, (60, 64, 68))
        lamp = float(random.choice([0.3, 0.6, 0.9]))
        for k in range(2):
            left = x + 28 + k * 102
            show_window(canvas, left, 16, left + 98, 168, kind=3 if i % 3 == 0 else 2, lamp=lamp)
            glass(canvas, left, 174, left + 98, 220, lively=0.15, lit=lamp)
    _course(canvas, (150, 152, 154), 232)
    _soil(canvas)
    return canvas.texture()


def _loft_ground(random: np.random.Generator) -> Picture:
    """Cast-iron columns before wide panes."""
    canvas = Canvas(_PX, _W, (196, 190, 180), random)
    canvas.noise(3, 30)
    for i in range(BAYS):
        x = i * _PX
        canvas.shade(x, 0, x + 8, _PX, 0.86)
        canvas.shade(x + _PX - 8, 0, x + _PX, _PX, 1.08)
        canvas.shade(x, 196, x + _PX, 204, 0.84)
        canvas.rect(x + 20, 14, x + _PX - 20, 200, (74, 72, 70))
        kind = int(random.integers(4))
        for k in range(3):
            left = x + 24 + k * 70
            show_window(canvas, left, 48, left + 66, 150, kind=kind, lamp=float(random.choice([0.2, 0.8])))
            glass(canvas, left, 156, left + 66, 196, lively=0.0, lit=0.5)
    _course(canvas, (206, 200, 190), 230)
    _soil(canvas)
    return canvas.texture()


def _gates(random: np.random.Generator) -> Picture:
    canvas = plaster(_PX, _W, random, (214, 212, 208))
    for i in range(BAYS):
        x = i * _PX
        canvas.rect(x + 22, 0, x + _PX - 22, 196, (168, 170, 172))
        for k in range(9):
            canvas.shade(x + 22, k * 22, x + _PX - 22, k * 22 + 3, 0.72)
        canvas.shade(x + 22, 184, x + _PX - 22, 196, 0.6)
    _soil(canvas)
    return canvas.texture()


def _base(random: np.random.Generator) -> Picture:
    """Bare blocks over a stepped plinth: below the windows of churches and halls."""
    canvas = blocks(_PX, _W, random, 32, 64, (204, 198, 186))
    canvas.rect(0, 0, _W, 44, (184, 178, 166))
    canvas.shade(0, 44, _W, 47, 1.14)
    for i in range(BAYS):
        canvas.shade(i * _PX, 0, i * _PX + 32, _PX, 1.08)
        canvas.shade(i * _PX + 32, 0, i * _PX + 40, _PX, 0.72)
        canvas.shade((i + 1) * _PX - 16, 0, (i + 1) * _PX, _PX, 1.05)
    _soil(canvas)
    return canvas.texture()


def _shed(random: np.random.Generator) -> Picture:
    """Upright boards and a window with a cross."""
    canvas = Canvas(_PX // 2, _W // 2, (168, 150, 130), random)
    canvas.noise(6, 10)
    for x in range(0, _W // 2, 8):
        canvas.pixels[:, x : x + 8] *= np.float32(random.normal(1.0, 0.07))
        canvas.pixels[:, x : x + 1] *= np.float32(0.6)
    for i in range(0, BAYS, 2):
        x = i * 128 + 64
        window(canvas, x - 16, 56, x + 16, 92, window_style("ground_shed"), lit=0.05)
    return canvas.texture()


GROUNDS: dict[str, Callable[[np.random.Generator], Picture]] = {
    "ground_shops": _shops,
    "ground_cafes": _cafes,
    "ground_rusticated": _rustication,
    "ground_plain": _plain,
    "ground_shuttered": _shutter,
    "ground_stucco": _stucco,
    "ground_granite": _granite,
    "ground_brick": _brick_ground,
    "ground_brick_stock": lambda random: _brick_ground(random, (148, 126, 98)),
    "ground_brownstone": _brownstone,
    "ground_boards": _boards_ground,
    "ground_arcade": _arcade,
    "ground_lobby": _lobby,
    "ground_loft": _loft_ground,
    "ground_gates": _gates,
    "ground_base": _base,
    "ground_shed": _shed,
}
"""Painters of ground floors by material name."""


_WIDTH, _HEIGHT = SHEET

# Leaves stand in the upper row, 256 pixels high; show windows and the rest in the lower one.
CELLS = DOOR_CELLS | {
    "vitrine_4": Cell(1536, 256, 256, 256),
    "vitrine_5": Cell(1792, 256, 256, 256),
    "vitrine_0": Cell(0, 0, 256, 256),
    "vitrine_1": Cell(256, 0, 256, 256),
    "vitrine_2": Cell(512, 0, 256, 256),
    "vitrine_3": Cell(768, 0, 256, 256),
    "paint": Cell(1024, 0, 128, 256),
    "stripes": Cell(1152, 0, 128, 256),
    "cross": Cell(1280, 0, 128, 128),
    "lamp": Cell(1280, 128, 128, 128),
    "stone": Cell(1408, 0, 128, 256),
    "vitrine_6": Cell(1536, 0, 256, 256),
    "vitrine_7": Cell(1792, 0, 256, 256),
}
"""Where everything lies; `vitrine_<k>` shows the wares of kind k % 4."""


def _leaf(canvas: Canvas, x: float, y: float, width: float, height: float) -> None:
    """Paint a wooden leaf with three panels, near white: the vertex colour paints it."""
    canvas.rect(x, y, x + width, y + height, (198, 194, 188))
    for low, high in ((0.05, 0.3), (0.36, 0.64), (0.7, 0.95)):
        a, b = y + low * height, y + high * height
        canvas.shade(x + 7, a, x + width - 7, b, 0.78)
        canvas.shade(x + 10, a + 3, x + width - 10, b - 3, 1.18)


def _handle(canvas: Canvas, x: float, y: float, length: float = 20.0) -> None:
    canvas.rect(x, y, x + 4, y + length, (214, 196, 150))


def _corner(name: str) -> tuple[float, float]:
    """Return the lower left corner of a cell of the sheet, pixels."""
    return float(CELLS[name].x), float(CELLS[name].y)


def paint_doors(random: np.random.Generator) -> NDArray[np.uint8]:
    """Paint the sheet that `CELLS` describes."""
    canvas = Canvas(_HEIGHT, _WIDTH, (226, 224, 220), random)
    for name in ("double", "panelled", "single"):
        _wooden_door(canvas, name)
    _glass_door(canvas)
    for name in ("office", "hotel"):
        _hall_door(canvas, name)
    _portal(canvas)
    _gate(canvas)
    for k in range(8):
        x, y = _corner(f"vitrine_{k}")
        canvas.rect(x, y, x + 256, y + 256, (52, 50, 48))
        show_window(canvas, x + 6, y + 6, x + 250, y + 250, kind=k % 4, lamp=0.95)
        canvas.rect(x + 126, y + 6, x + 130, y + 250, (52, 50, 48))
    _plain_cells(canvas)
    return canvas.texture()


def _wooden_door(canvas: Canvas, name: str) -> None:
    x, y = _corner(name)
    canvas.rect(x, y, x + 128, y + 256, (224, 220, 212))
    canvas.shade(x, y + 249, x + 128, y + 256, 0.6)
    glass(canvas, x + 10, y + 208, x + 118, y + 246, lively=0.0, lit=0.7)
    if name == "single":
        _leaf(canvas, x + 10, y + 2, 108, 198)
        glass(canvas, x + 30, y + 120, x + 98, y + 188, lively=0.3, lit=0.6)
        canvas.rect(x + 63, y + 120, x + 66, y + 188, (198, 194, 188))
        _handle(canvas, x + 104, y + 92)
        canvas.rect(x + 46, y + 86, x + 82, y + 92, (176, 160, 120))
        return
    for left in (x + 10, x + 65):
        _leaf(canvas, left, y + 2, 53, 198)
        if name == "panelled":
            glass(canvas, left + 9, y + 96, left + 44, y + 190, lively=0.2, lit=0.6)
            for k in range(4):
                canvas.rect(left + 12 + k * 9, y + 96, left + 14 + k * 9, y + 190, (50, 48, 46))
    canvas.rect(x + 62, y + 2, x + 66, y + 202, (70, 66, 62))
    _handle(canvas, x + 55, y + 92)
    _handle(canvas, x + 69, y + 92)


def _glass_door(canvas: Canvas) -> None:
    x, y = _corner("glass")
    canvas.rect(x, y, x + 128, y + 256, (208, 206, 202))
    glass(canvas, x + 8, y + 214, x + 120, y + 248, lively=0.0, lit=1.0)
    for left in (x + 8, x + 66):
        glass(canvas, left, y + 12, left + 54, y + 206, lively=0.0, lit=1.0)
        canvas.rect(left + 14, y + 130, left + 40, y + 142, (226, 224, 218), 0.55)
    _handle(canvas, x + 54, y + 84, 44)
    _handle(canvas, x + 70, y + 84, 44)


def _hall_door(canvas: Canvas, name: str) -> None:
    """Paint the glazed entrance of an office or of a hotel, in steel or in brass."""
    x, y = _corner(name)
    canvas.rect(x, y, x + 256, y + 256, (92, 96, 100) if name == "office" else (150, 122, 74))
    for k in range(4):
        left = x + 6 + k * 62
        glass(canvas, left, y + 8, left + 58, y + 200, lively=0.0, lit=1.0)
        glass(canvas, left, y + 206, left + 58, y + 250, lively=0.0, lit=1.0)
    _handle(canvas, x + 120, y + 84, 44)
    _handle(canvas, x + 134, y + 84, 44)


def _portal(canvas: Canvas) -> None:
    """Paint a church's portal: a pointed arch in steps, with iron bands on the leaves."""
    x, y = _corner("portal")
    canvas.rect(x, y, x + 256, y + 256, (206, 200, 190))
    for inset, tone in ((6, 0.86), (18, 1.12), (30, 0.82), (40, 0.4)):
        inside, view, _ = canvas.inside_arch(x + inset, y, x + 256 - inset, y + 252 - inset, pointed=True)
        view[inside] = np.array((206, 200, 190), np.float32) * tone
    for left in (x + 48, x + 130):
        canvas.rect(left, y, left + 78, y + 128, (112, 78, 54))
        for k in range(1, 6):
            canvas.shade(left + k * 13, y, left + k * 13 + 2, y + 128, 0.7)
        for height in (26, 96):
            canvas.rect(left, y + height, left + 64, y + height + 6, (48, 44, 42))
    canvas.rect(x + 40, y + 128, x + 216, y + 136, (176, 168, 156))
    canvas.rect(x + 124, y, x + 132, y + 128, (150, 142, 130))


def _gate(canvas: Canvas) -> None:
    """Paint a sectional gate."""
    x, y = _corner("gate")
    canvas.rect(x, y, x + 256, y + 256, (196, 196, 194))
    for k in range(10):
        canvas.shade(x, y + k * 25.6, x + 256, y + k * 25.6 + 3, 0.7)
    canvas.shade(x, y + 246, x + 256, y + 256, 0.5)
    _handle(canvas, x + 126, y + 36, 6)


def _plain_cells(canvas: Canvas) -> None:
    """Paint what boards, awnings, crosses, lamps and steps are cut from."""
    cell = CELLS["paint"]
    canvas.rect(cell.x, cell.y, cell.x + 128, cell.y + 256, (232, 231, 228))
    cell = CELLS["stripes"]
    for k in range(8):
        stripe = (238, 236, 230) if k % 2 else (150, 148, 146)
        canvas.rect(cell.x + k * 16, cell.y, cell.x + k * 16 + 16, cell.y + 256, stripe)
    cell = CELLS["cross"]
    canvas.rect(cell.x, cell.y, cell.x + 128, cell.y + 128, (20, 60, 36), glow=60)
    for a, b, c, d in ((46, 14, 82, 114), (14, 46, 114, 82)):
        canvas.rect(cell.x + a, cell.y + b, cell.x + c, cell.y + d, (70, 226, 120), glow=255)
    cell = CELLS["lamp"]
    canvas.rect(cell.x, cell.y, cell.x + 128, cell.y + 128, (252, 240, 214), glow=255)
    cell = CELLS["stone"]
    canvas.rect(cell.x, cell.y, cell.x + 128, cell.y + 256, (214, 210, 203))
    for k in range(8):
        canvas.shade(cell.x, cell.y + k * 32, cell.x + 128, cell.y + k * 32 + 2, 0.82)
