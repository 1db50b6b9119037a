"""Coverings of the ground: seeded, tileable textures, and patches of colour too large to tile."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.seeds import rng
from vico.world.mesh import Material
from vico.world.model import ENTITY_GREEN, ENTITY_GROUND, ENTITY_ROAD, ENTITY_WATER
from vico.worldgen.facts.street_habits import Paving
from vico.worldgen.texture_canvas import Canvas, TextureCache, periodic_noise

Rgb = tuple[int, int, int]
Picture = NDArray[np.uint8]
_NOTHING: Mapping[str, Paving] = {}


@dataclass(frozen=True)
class GroundStyle:
    """How a kind of ground looks.

    Attributes
    ----------
    material, tile, tint
        What covers it, metres that the texture covers, and the colour it is multiplied by.
    entity
        What it is.
    patches
        Strength of its large patches.
    bearing
        Radians from east by which the texture is turned: stones lie along the streets.
    """

    material: str
    tile: float
    tint: Rgb
    entity: int
    patches: float = 0.05
    bearing: float = 0.0

    def uv(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Texture coordinates of points, metres, shape ``(n, 2)``."""
        c, s = np.cos(self.bearing), np.sin(self.bearing)
        return np.stack([c * xy[:, 0] + s * xy[:, 1], c * xy[:, 1] - s * xy[:, 0]], axis=1) / self.tile


_ASPHALT = GroundStyle("ground_asphalt", 12.0, (255, 255, 255), ENTITY_ROAD, 0.08)
LOOKS: dict[str, GroundStyle] = {
    "carriageway": _ASPHALT,
    "parking": GroundStyle("ground_asphalt", 12.0, (255, 250, 242), ENTITY_ROAD, 0.10),
    "cycleway": GroundStyle("ground_asphalt", 12.0, (255, 196, 176), ENTITY_ROAD, 0.05),
    "kerb": GroundStyle("ground_concrete", 6.0, (214, 211, 206), ENTITY_GROUND, 0.03),
    "sidewalk": GroundStyle("ground_slabs", 4.0, (240, 240, 238), ENTITY_GROUND, 0.06),
    "tactile": GroundStyle("ground_tactile", 1.2, (255, 255, 255), ENTITY_GROUND, 0.0),
    "pedestrian": GroundStyle("ground_setts", 3.2, (255, 246, 236), ENTITY_GROUND, 0.07),
    "steps": GroundStyle("ground_concrete", 6.0, (206, 200, 192), ENTITY_GROUND, 0.03),
    "path": GroundStyle("ground_gravel", 5.0, (255, 246, 228), ENTITY_GROUND, 0.07),
    "playground": GroundStyle("ground_rubber", 4.0, (196, 120, 92), ENTITY_GROUND, 0.04),
    "ballast": GroundStyle("ground_gravel", 5.0, (150, 151, 156), ENTITY_GROUND, 0.06),
    "court": GroundStyle("ground_rubber", 4.0, (92, 128, 150), ENTITY_GROUND, 0.02),
    "clay": GroundStyle("ground_rubber", 4.0, (190, 104, 74), ENTITY_GROUND, 0.03),
    "turf": GroundStyle("ground_turf", 24.0, (255, 255, 255), ENTITY_GREEN, 0.03),
    "concrete": GroundStyle("ground_concrete", 6.0, (230, 228, 222), ENTITY_GROUND, 0.06),
    "sand": GroundStyle("ground_sand", 5.0, (255, 255, 255), ENTITY_GROUND, 0.06),
    "gravel": GroundStyle("ground_gravel", 5.0, (232, 222, 204), ENTITY_GROUND, 0.07),
    "garden": GroundStyle("ground_grass", 11.0, (236, 255, 226), ENTITY_GREEN, 0.16),
    "grass": GroundStyle("ground_grass", 11.0, (255, 255, 255), ENTITY_GREEN, 0.13),
    "woods": GroundStyle("ground_forest", 9.0, (255, 255, 255), ENTITY_GREEN, 0.18),
    "farmland": GroundStyle("ground_furrows", 8.0, (255, 255, 255), ENTITY_GREEN, 0.12),
    "earth": GroundStyle("ground_earth", 7.0, (255, 255, 255), ENTITY_GROUND, 0.12),
    "water": GroundStyle("ground_water", 18.0, (255, 255, 255), ENTITY_WATER, 0.05),
    "yard": GroundStyle("ground_slabs", 5.0, (204, 204, 203), ENTITY_GROUND, 0.10),
    "field": GroundStyle("ground_grass", 11.0, (240, 236, 206), ENTITY_GREEN, 0.16),
    "wall": GroundStyle("ground_blocks", 3.0, (214, 208, 200), ENTITY_GROUND, 0.05),
    "quay": GroundStyle("ground_blocks", 4.0, (176, 172, 166), ENTITY_GROUND, 0.05),
}
"""The kinds of `ground_partition`, and walls."""

_COVERS: dict[str, tuple[str, float, Rgb]] = {
    "setts": ("ground_setts", 3.2, (236, 232, 226)),
    "stones": ("ground_bricks", 3.0, (238, 230, 222)),
    "concrete": ("ground_concrete", 6.0, (226, 224, 218)),
    "asphalt": ("ground_asphalt", 12.0, (255, 255, 255)),
    "gravel": ("ground_gravel", 5.0, (236, 226, 206)),
    "earth": ("ground_earth", 7.0, (255, 255, 255)),
    "grass": ("ground_grass", 11.0, (236, 236, 216)),
    "wood": ("ground_planks", 3.0, (255, 255, 255)),
    "sand": ("ground_sand", 5.0, (255, 255, 255)),
}


_ON_FOOT = ("sidewalk", "pedestrian", "yard", "path", "tactile", "kerb")


def look_of(kind: str, usual: Mapping[str, Paving] = _NOTHING, bearing: float = 0.0) -> GroundStyle:
    """How a kind of `ground_partition` looks, its paving included.

    Parameters
    ----------
    kind
        As ``sidewalk`` or ``sidewalk:stones``.
    usual
        Pavings of the place that differ from ours, by kind of ground or of paving.
    bearing
        Direction in which stones are laid, radians from east.

    Raises
    ------
    SchemaError
        If a paving's material is none of ours.
    """
    base, _, paving = kind.partition(":")
    look = LOOKS[base]
    if base in _ON_FOOT or base == "carriageway":
        look = replace(look, bearing=bearing)
    own = usual.get(paving or base) if base in _ON_FOOT else None
    if own is not None:
        if own.material not in _PAINTERS:
            raise SchemaError(f"paving of {kind}: no material {own.material!r}; there are {', '.join(_PAINTERS)}")
        return replace(look, material=own.material, tile=own.tile, tint=own.tint)
    if not paving or (base == "cycleway" and paving == "asphalt"):
        return look
    material, tile, tint = _COVERS[paving]
    if base == "sidewalk" and paving == "asphalt":
        tint = (255, 252, 248)
    return replace(look, material=material, tile=tile, tint=tint)


def patches(xy: NDArray[np.float64], strength: float, seed: int = 7) -> NDArray[np.float64]:
    """Factors about 1 that vary over tens of metres and never repeat within a world, shape ``(n, 3)``."""
    field = _patch_field(seed)
    n = len(field)

    def noise(scale: float, shift: float) -> NDArray[np.float64]:
        u = np.mod(xy / scale + shift, n)
        i = np.floor(u).astype(np.int64) % n
        f = u - np.floor(u)
        f = f * f * (3.0 - 2.0 * f)
        x, y = i[:, 0], i[:, 1]
        right, up = (x + 1) % n, (y + 1) % n
        south = field[y, x] * (1 - f[:, 0]) + field[y, right] * f[:, 0]
        north = field[up, x] * (1 - f[:, 0]) + field[up, right] * f[:, 0]
        return np.asarray(south * (1 - f[:, 1]) + north * f[:, 1])

    tone = 0.6 * noise(41.0, 0.37) + 0.4 * noise(13.0, 11.71)
    warm = noise(67.0, 23.13)
    return 1.0 + strength * np.stack([tone + 0.35 * warm, tone, tone - 0.35 * warm], axis=1)


@cache
def _patch_field(seed: int) -> NDArray[np.float64]:
    return rng(seed, "ground", "patches").uniform(-1.0, 1.0, (256, 256))


def vertex_colours(look: GroundStyle, xy: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Vertex colours of a kind of ground, shape ``(n, 3)``."""
    colour = np.asarray(look.tint, np.float64) * patches(xy, look.patches)
    return np.clip(np.round(colour), 0, 255).astype(np.uint8)


def _courses(canvas: Canvas, rows: int, columns: int, tone: float, joint: float, *, bond: float = 0.5) -> None:
    """Stones in courses, each of its own tone, with dark joints."""
    random, side = canvas.random, len(canvas.pixels)
    high, wide = side / rows, side / columns
    for r in range(rows):
        shift = (r % 2) * bond * wide
        for c in range(columns):
            factor = 1.0 + tone * float(random.standard_normal())
            x0, y0 = c * wide + shift, r * high
            for left in (x0, x0 - side):
                canvas.shade(left + 1, y0 + 1, left + wide, y0 + high, factor)
                canvas.shade(max(left, 0), y0, max(left + 1, 0), y0 + high, joint)
        canvas.shade(0, r * high, side, r * high + 1, joint)


def _asphalt(random: np.random.Generator) -> Picture:
    """Worn asphalt: fine stones, stains, patched trenches and cracks sealed with bitumen."""
    canvas = Canvas(512, 512, (98, 99, 101), random)
    canvas.noise(3.0, 4)
    canvas.noise(2.5, 20)
    canvas.grain(6.5)
    for _ in range(3):
        x, y = random.uniform(20, 380, 2)
        canvas.shade(x, y, x + random.uniform(40, 110), y + random.uniform(25, 60), float(random.uniform(0.93, 1.05)))
    for _ in range(4):
        x, y = random.uniform(40, 470, 2)
        heading = random.uniform(0, 2 * np.pi)
        for _ in range(70):
            heading += random.normal(0, 0.25)
            x, y = (x + 1.5 * np.cos(heading)) % 510, (y + 1.5 * np.sin(heading)) % 510
            canvas.shade(x, y, x + 1.6, y + 1.6, 0.84)
    return canvas.texture()


def _slabs(random: np.random.Generator) -> Picture:
    canvas = Canvas(512, 512, (178, 177, 174), random)
    _courses(canvas, 8, 8, 0.028, 0.84, bond=0.5)
    canvas.noise(3, 6)
    canvas.grain(4)
    return canvas.texture()


def _flags(random: np.random.Generator) -> Picture:
    """Poured concrete, scored into squares, four a side, with spots of trodden gum."""
    canvas = Canvas(512, 512, (186, 184, 177), random)
    _courses(canvas, 4, 4, 0.03, 0.74, bond=0.0)
    canvas.noise(3, 5)
    canvas.noise(3, 23)
    canvas.grain(4)
    for _ in range(60):
        x, y = random.uniform(4, 506, 2)
        canvas.shade(x, y, x + 2, y + 2, 0.86)
    return canvas.texture()


def _tiles(random: np.random.Generator) -> Picture:
    """Square slabs of concrete, sixteen a side, joint over joint."""
    canvas = Canvas(512, 512, (180, 178, 173), random)
    _courses(canvas, 16, 16, 0.03, 0.86, bond=0.0)
    canvas.noise(3, 6)
    canvas.grain(4)
    return canvas.texture()


def _mosaic(random: np.random.Generator) -> Picture:
    """Small stones of natural rock, fitted together by hand: every one of its own tone and a little out of line."""
    canvas = Canvas(512, 512, (128, 128, 129), random)
    side = 512 / 40
    for r in range(40):
        for c in range(40):
            x, y = c * side + random.uniform(-1.5, 1.5), r * side + random.uniform(-1.5, 1.5)
            canvas.shade(x + 1, y + 1, x + side - 1, y + side - 1, 1.22 + 0.12 * float(random.standard_normal()))
    canvas.noise(4, 5)
    canvas.grain(5)
    return canvas.texture()


def _setts(random: np.random.Generator) -> Picture:
    canvas = Canvas(512, 512, (166, 160, 152), random)
    _courses(canvas, 32, 16, 0.075, 0.72)
    canvas.noise(3, 8)
    canvas.grain(6)
    return canvas.texture()


def _bricks(random: np.random.Generator) -> Picture:
    """Rectangular paving stones, laid alternately lengthwise and across."""
    canvas = Canvas(512, 512, (178, 166, 156), random)
    for r in range(16):
        for c in range(16):
            x, y, across = c * 32, r * 32, (r + c) % 2
            for k in range(2):
                factor = 1.0 + 0.05 * float(random.standard_normal())
                a, b = (0, 16 * k) if across else (16 * k, 0)
                w, h = (32, 16) if across else (16, 32)
                canvas.shade(x + a, y + b, x + a + w, y + b + h, factor)
                canvas.shade(x + a, y + b, x + a + 1, y + b + h, 0.8)
                canvas.shade(x + a, y + b, x + a + w, y + b + 1, 0.8)
    canvas.grain(5)
    return canvas.texture()


def _concrete(random: np.random.Generator) -> Picture:
    canvas = Canvas(256, 256, (188, 186, 180), random)
    canvas.noise(4, 3)
    canvas.noise(3, 17)
    canvas.grain(3.5)
    canvas.shade(0, 0, 256, 1, 0.86)
    canvas.shade(0, 0, 1, 256, 0.86)
    return canvas.texture()


def _gravel(random: np.random.Generator) -> Picture:
    canvas = Canvas(256, 256, (184, 172, 150), random)
    canvas.noise(5, 5)
    canvas.noise(7, 90)
    canvas.grain(9)
    return canvas.texture()


def _sand(random: np.random.Generator) -> Picture:
    canvas = Canvas(256, 256, (214, 196, 158), random)
    canvas.noise(5, 7)
    canvas.grain(4)
    return canvas.texture()


def _earth(random: np.random.Generator) -> Picture:
    canvas = Canvas(256, 256, (146, 124, 98), random)
    canvas.noise(8, 5)
    canvas.noise(7, 40)
    canvas.grain(7)
    return canvas.texture()


def _grass(random: np.random.Generator) -> Picture:
    canvas = Canvas(512, 512, (94, 116, 62), random)
    canvas.noise(6, 5)
    canvas.noise(7, 44)
    canvas.pixels += random.normal(0, 10, (512, 512, 1)).astype(np.float32) * np.array([1.0, 1.1, 0.6], np.float32)
    return canvas.texture()


def _turf(random: np.random.Generator) -> Picture:
    """Paint a mown pitch in stripes of six metres."""
    canvas = Canvas(512, 512, (88, 124, 62), random)
    for k in range(4):
        canvas.shade(k * 128, 0, (k + 1) * 128, 512, 1.05 if k % 2 else 0.95)
    canvas.noise(4, 30)
    canvas.pixels += random.normal(0, 7, (512, 512, 1)).astype(np.float32) * np.array([1.0, 1.1, 0.6], np.float32)
    return canvas.texture()


def _forest(random: np.random.Generator) -> Picture:
    """Litter, moss and bare earth under trees."""
    canvas = Canvas(256, 256, (104, 98, 66), random)
    moss = periodic_noise((256, 256), 9, random)[..., None]
    canvas.pixels += moss * np.array([-14, 4, -8], np.float32)
    canvas.noise(8, 34)
    canvas.grain(9)
    return canvas.texture()


def _furrows(random: np.random.Generator) -> Picture:
    canvas = Canvas(256, 256, (140, 128, 84), random)
    for k in range(16):
        canvas.shade(0, k * 16, 256, k * 16 + 6, 0.86)
    canvas.noise(6, 30)
    canvas.grain(6)
    return canvas.texture()


def _rubber(random: np.random.Generator) -> Picture:
    canvas = Canvas(256, 256, (246, 246, 246), random)
    canvas.noise(3, 5)
    canvas.grain(5)
    return canvas.texture()


def _planks(random: np.random.Generator) -> Picture:
    canvas = Canvas(256, 256, (150, 122, 92), random)
    for k in range(20):
        canvas.shade(0, k * 12.8, 256, (k + 1) * 12.8, 1.0 + 0.08 * float(random.standard_normal()))
        canvas.shade(0, k * 12.8, 256, k * 12.8 + 1.5, 0.55)
    canvas.grain(5)
    return canvas.texture()


def _tactile(random: np.random.Generator) -> Picture:
    """Slabs with rows of domes, which a cane feels before a crossing."""
    canvas = Canvas(128, 128, (206, 198, 176), random)
    for r in range(12):
        for c in range(12):
            x, y = c * 10.67 + 3, r * 10.67 + 3
            canvas.shade(x, y, x + 5, y + 5, 1.12)
            canvas.shade(x + 1, y - 1, x + 6, y, 0.8)
    canvas.grain(3)
    return canvas.texture()


def _water(random: np.random.Generator) -> Picture:
    canvas = Canvas(512, 512, (62, 92, 108), random)
    canvas.noise(5, 6, 2)
    canvas.noise(5, 22, 2)
    canvas.noise(4, 64, 2)
    return canvas.texture()


def _stone_blocks(random: np.random.Generator) -> Picture:
    canvas = Canvas(256, 256, (196, 190, 180), random)
    _courses(canvas, 8, 5, 0.06, 0.74)
    canvas.noise(5, 6)
    canvas.grain(5)
    return canvas.texture()


_PAINTERS: dict[str, Callable[[np.random.Generator], Picture]] = {
    "ground_asphalt": _asphalt,
    "ground_slabs": _slabs,
    "ground_flags": _flags,
    "ground_tiles": _tiles,
    "ground_mosaic": _mosaic,
    "ground_setts": _setts,
    "ground_bricks": _bricks,
    "ground_concrete": _concrete,
    "ground_gravel": _gravel,
    "ground_sand": _sand,
    "ground_earth": _earth,
    "ground_grass": _grass,
    "ground_turf": _turf,
    "ground_forest": _forest,
    "ground_furrows": _furrows,
    "ground_rubber": _rubber,
    "ground_planks": _planks,
    "ground_tactile": _tactile,
    "ground_water": _water,
    "ground_blocks": _stone_blocks,
}

_PAINTED = TextureCache(__file__, __name__)


@cache
def ground_material(name: str) -> Material:
    """Return the ground material of that name."""
    texture, png = _PAINTED.picture(name, lambda: _PAINTERS[name](rng(0, "ground", name)))
    return Material(name, texture, png=png)
