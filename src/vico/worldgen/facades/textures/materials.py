"""Procedural textures: facades by bay and storey, roofs and grounds. Seeded, tileable, sides powers of two.

Everything is painted with plain rectangles and periodic noise on float arrays. Walls are near white, so that a vertex
colour gives each building its own; a facade sheet holds eight bays (across) by four storeys (up), all different. Alpha
is the light a texel gives at night: see `Material.emission`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vico.seeds import rng
from vico.world.mesh import Material
from vico.worldgen.facades.catalogue import styles
from vico.worldgen.facades.textures.block_walls import UPPER_FLOORS
from vico.worldgen.facades.textures.doors import paint_doors
from vico.worldgen.facades.textures.ground_floors import GROUNDS
from vico.worldgen.facades.textures.trims import HOLED, TRIMS
from vico.worldgen.facades.textures.windows import windows_digest
from vico.worldgen.kept_textures import Painters
from vico.worldgen.texture_canvas import Canvas, blocks, bricks, plaster

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


def _seamed(random: np.random.Generator) -> NDArray[np.uint8]:
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
    "roof_metal": _seamed,
    "roof_sheet": _seamed,
    "roof_zinc": _seamed,
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


_PAINTED = Painters(__file__, __name__)


def material(name: str, seed: int = 0) -> Material:
    """Return the material of that name: same name and seed, same picture; what has lit texels shines at night."""
    picture = name if name in PAINTERS else styles().families[name].picture
    texture, png = _PAINTED.picture(
        f"{name} {picture} {seed}", lambda: PAINTERS[picture](rng(seed, "texture", name)), data=windows_digest()
    )
    holed = name in HOLED
    emission = 1.0 if texture.shape[2] == 4 and not holed else 0.0
    return Material(name, texture, cutout=holed, emission=emission, double_sided=name.startswith("rail_"), png=png)
