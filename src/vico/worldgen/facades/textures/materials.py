"""Procedural textures: facades by bay and storey, roofs and grounds. Seeded, tileable, sides powers of two.

Everything is painted with plain rectangles and periodic noise on float arrays. Walls are near white, so that a vertex
colour gives each building its own; a facade sheet holds eight bays (across) by four storeys (up), all different. Alpha
is the light a texel gives at night: see `Material.emission`. Trims are what is set on roofs and facades as bodies of
their own (dormers' fronts, railings, steps), eight bays to a sheet.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vico.seeds import rng
from vico.world.mesh import Material
from vico.worldgen.facades.facade_styles import styles
from vico.worldgen.facades.textures.ground_floors import GROUNDS, paint_doors
from vico.worldgen.facades.textures.regional_walls import UPPER_FLOORS
from vico.worldgen.facades.textures.walls import BAYS
from vico.worldgen.facades.textures.windows import window, window_style, windows_digest
from vico.worldgen.texture_canvas import Canvas, TextureCache, blocks, bricks, plaster

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


# ------------------------------------------------------------------------------------------------ blank walls, roofs


def _blank_plaster(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = plaster(256, 256, random)
    canvas.noise(3, 12)
    return canvas.texture()


def _blank_boards(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = plaster(256, 256, random, (206, 204, 200))
    for y in range(0, 256, 16):
        canvas.pixels[y : y + 2] *= 0.74
        canvas.pixels[y + 2 : y + 6] *= 0.94
    return canvas.texture()


def _tiles(random: np.random.Generator) -> NDArray[np.uint8]:
    size, course, pan = 256, 16, 16
    y, x = np.mgrid[0:size, 0:size]
    canvas = Canvas(size, size, (214, 208, 202), random)
    tone = random.normal(0, 1, (size // course, size // pan)).astype(np.float32)
    canvas.pixels += tone[y // course, x // pan][..., None] * 11
    wave = 1 + 0.16 * np.sin(x % pan / pan * 2 * np.pi) - 0.3 * (y % course < 3)
    canvas.pixels *= wave[..., None].astype(np.float32)
    canvas.noise(6, 8)
    return canvas.texture()


def _seams(random: np.random.Generator) -> NDArray[np.uint8]:
    size = 256
    canvas = Canvas(size, size, (214, 216, 216), random)
    canvas.noise(5, 5)
    canvas.noise(4, 24)
    for k in range(4):
        canvas.rect(k * 64, 0, k * 64 + 3, size, (236, 238, 238))
        canvas.shade(k * 64 + 3, 0, k * 64 + 7, size, 0.72)
        canvas.shade(k * 64, (k * 96) % size, k * 64 + 64, (k * 96) % size + 2, 0.82)
    return canvas.texture()


def _slates(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = blocks(256, 256, random, 16, 32, (190, 192, 196))
    canvas.grain(5)
    return canvas.texture()


def _gravel(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(256, 256, (206, 203, 198), random)
    canvas.grain(15)
    canvas.noise(5, 6)
    return canvas.texture()


# ------------------------------------------------------------------------------------------------------------ ground


def _asphalt(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(512, 512, (96, 97, 99), random)
    canvas.noise(3.5, 4)
    canvas.noise(3.0, 24)
    canvas.grain(7)
    return canvas.texture()


def _paving(random: np.random.Generator) -> NDArray[np.uint8]:
    """Slabs of half a metre on a 4 m tile."""
    canvas = blocks(512, 512, random, 64, 64, (184, 180, 174))
    canvas.grain(3)
    return canvas.texture()


def _setts(random: np.random.Generator) -> NDArray[np.uint8]:
    """Granite setts on a 3.2 m tile."""
    canvas = blocks(512, 512, random, 16, 32, (168, 162, 155))
    canvas.grain(6)
    return canvas.texture()


def _grass(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(512, 512, (96, 114, 66), random)
    canvas.noise(7, 5)
    canvas.noise(7, 40)
    canvas.pixels += random.normal(0, 11, (512, 512, 1)).astype(np.float32) * np.array([1.0, 1.1, 0.6], np.float32)
    return canvas.texture()


def _grit(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(256, 256, (182, 168, 142), random)
    canvas.noise(6, 6)
    canvas.grain(9)
    return canvas.texture()


def _water(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(256, 256, (72, 104, 122), random)
    canvas.noise(7, 8, 2)
    canvas.noise(5, 32, 2)
    return canvas.texture()


#: What paints the picture of a material, by name.
PAINTERS: dict[str, Callable[[np.random.Generator], NDArray[np.uint8]]] = {
    **UPPER_FLOORS,
    **GROUNDS,
    **TRIMS,
    "blank_plaster": _blank_plaster,
    "blank_brick": lambda random: bricks(256, 256, random).texture(),
    "blank_brick_stock": lambda random: bricks(256, 256, random, base=(148, 126, 98)).texture(),
    "blank_brick_dark": lambda random: bricks(256, 256, random, base=(104, 72, 60)).texture(),
    "blank_stone": lambda random: blocks(256, 256, random, 64, 128).texture(),
    "blank_boards": _blank_boards,
    "roof_tiles": _tiles,
    "roof_metal": _seams,
    "roof_sheet": _seams,
    "roof_zinc": _seams,
    "roof_slate": _slates,
    "roof_gravel": _gravel,
    "doors": paint_doors,
    "asphalt": _asphalt,
    "paving": _paving,
    "setts": _setts,
    "grass": _grass,
    "grit": _grit,
    "water": _water,
}


_PAINTED = TextureCache(__file__, __name__)


def material(name: str, seed: int = 0) -> Material:
    """Return the material of that name: same name and seed, same picture; what has lit texels shines at night."""
    picture = name if name in PAINTERS else styles().families[name].picture
    texture, png = _PAINTED.picture(
        f"{name} {picture} {seed}", lambda: PAINTERS[picture](rng(seed, "texture", name)), data=windows_digest()
    )
    holed = name in HOLED
    emission = 1.0 if texture.shape[2] == 4 and not holed else 0.0
    return Material(name, texture, cutout=holed, emission=emission, double_sided=name.startswith("rail_"), png=png)
