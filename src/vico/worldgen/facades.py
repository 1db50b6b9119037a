"""What buildings wear: facade materials by use and region, and texture coordinates in whole bays and storeys."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import box, pose_matrix
from vico.world.mesh import Surface, joined
from vico.world.model import Building, Entrance
from vico.worldgen.textures import BAYS, STOREYS, material

Rgb = tuple[int, int, int]

# What a wall shows, by what it faces.
BLANK, BACK, FRONT, SHOPFRONT = 0, 1, 2, 3

ROOF_TILE = {"roof_tiles": 3.2, "roof_metal": 2.4, "roof_slate": 3.2, "roof_gravel": 4.0}
"""Metres a roof texture covers."""

BLANK_TILE = {"blank_plaster": 3.0, "blank_brick": 2.4, "blank_stone": 2.4}
"""Metres a blank wall's texture covers."""

_PLASTER: tuple[Rgb, ...] = (
    (255, 236, 190),
    (255, 246, 224),
    (250, 226, 168),
    (244, 214, 176),
    (255, 252, 244),
    (238, 236, 232),
    (242, 206, 186),
    (222, 232, 222),
    (226, 226, 220),
    (248, 232, 206),
    (232, 214, 178),
    (214, 222, 232),
)
_BRICK: tuple[Rgb, ...] = ((255, 255, 255), (232, 216, 208), (255, 238, 214), (206, 196, 190), (246, 224, 206))
_STONE: tuple[Rgb, ...] = ((242, 236, 226), (226, 222, 216), (236, 222, 204), (214, 208, 204), (232, 204, 190))
_PANEL: tuple[Rgb, ...] = ((240, 240, 240), (214, 220, 226), (226, 218, 204))
_ROOF: Mapping[str, tuple[Rgb, ...]] = {
    "roof_tiles": ((176, 104, 82), (160, 92, 74), (172, 116, 92)),
    "roof_metal": ((104, 108, 112), (128, 74, 62), (84, 92, 92), (112, 148, 132), (70, 72, 76)),
    "roof_slate": ((126, 128, 134), (104, 106, 112)),
    "roof_gravel": ((176, 172, 166), (150, 148, 146), (116, 114, 114)),
}
_NAMED: Mapping[str, Rgb] = {
    "white": (250, 250, 248),
    "black": (62, 62, 64),
    "grey": (186, 186, 186),
    "gray": (186, 186, 186),
    "lightgrey": (216, 216, 214),
    "lightgray": (216, 216, 214),
    "darkgrey": (122, 122, 124),
    "darkgray": (122, 122, 124),
    "silver": (206, 208, 210),
    "red": (206, 96, 82),
    "darkred": (146, 62, 54),
    "maroon": (136, 58, 54),
    "brown": (156, 112, 84),
    "yellow": (250, 226, 140),
    "lightyellow": (255, 246, 206),
    "orange": (240, 176, 112),
    "green": (132, 168, 128),
    "blue": (128, 156, 196),
    "lightblue": (196, 216, 234),
    "beige": (244, 232, 204),
    "tan": (222, 196, 154),
    "cream": (252, 242, 214),
    "pink": (244, 206, 198),
    "ivory": (252, 250, 236),
    "sandybrown": (236, 186, 134),
}


@dataclass(frozen=True)
class Look:
    """The materials and colours of one building; `bay` is the wished width of a bay, metres."""

    wall: str
    ground: str
    blank: str
    roof: str
    bay: float
    tint: Rgb
    ground_tint: Rgb
    roof_tint: Rgb


def colour_of(tag: str | None) -> Rgb | None:
    """An OSM colour (``#rgb``, ``#rrggbb`` or a common name); None where it is none of these."""
    if not tag:
        return None
    text = tag.strip().lower().split(";")[0].replace(" ", "").replace("_", "")
    if text.startswith("#"):
        digits = text[1:]
        if len(digits) == 3:
            digits = "".join(2 * c for c in digits)
        if len(digits) == 6 and all(c in "0123456789abcdef" for c in digits):
            return int(digits[:2], 16), int(digits[2:4], 16), int(digits[4:], 16)
    return _NAMED.get(text)


def look_of(
    use: str, tags: Mapping[str, str], *, levels: int, area: float, region: str, random: np.random.Generator
) -> Look:
    """Dress a building: by its material and colour tags, else by use and region, else by its own draw.

    `region` is one of northern, southern (the Mediterranean) and american.
    """
    draw = random.random(6)

    def pick(options: Sequence[str], shares: Sequence[float], value: float) -> str:
        edges = np.cumsum(shares) / np.sum(shares)
        return options[int(np.searchsorted(edges, min(value, 0.999999), side="right"))]

    said = tags.get("building:material", tags.get("building:facade:material", "")).lower()
    homes = ("wall_classic", "wall_plain", "wall_brick", "wall_stone", "wall_balconies")
    if said in ("brick", "bricks"):
        wall = "wall_brick"
    elif said in ("stone", "granite", "limestone", "sandstone", "marble"):
        wall = "wall_stone"
    elif said in ("glass", "mirror"):
        wall = "wall_glass"
    elif said in ("plaster", "stucco", "render"):
        wall = "wall_classic" if draw[0] < 0.6 else "wall_plain"
    elif said in ("concrete", "cement_block"):
        wall = "wall_ribbon"
    elif said in ("metal", "steel", "tin"):
        wall = "wall_panels"
    elif use in ("industrial", "garage") or (use == "transport" and area > 1500):
        wall = "wall_panels" if draw[0] < 0.6 else "wall_brick"
    elif use in ("civic", "religious", "education", "health"):
        shares = (0.7, 0.0, 0.3) if use == "religious" else (0.5, 0.3, 0.2)
        wall = pick(("wall_stone", "wall_classic", "wall_brick"), shares, draw[0])
    elif use == "office":
        wall = pick(("wall_ribbon", "wall_glass", "wall_stone", "wall_classic"), (0.35, 0.3, 0.2, 0.15), draw[0])
    elif use in ("commercial", "retail", "transport"):
        wall = pick(
            ("wall_classic", "wall_stone", "wall_ribbon", "wall_glass", "wall_brick"),
            (0.3, 0.25, 0.2, 0.1, 0.15),
            draw[0],
        )
    elif levels >= 8:
        wall = pick(
            ("wall_balconies", "wall_plain", "wall_brick"), (0.5, 0.3, 0.0 if region == "southern" else 0.2), draw[0]
        )
    elif region == "american":
        wall = pick(homes, (0.08, 0.1, 0.7, 0.07, 0.05), draw[0])
    elif region == "southern":
        wall = pick(homes, (0.58, 0.24, 0.0, 0.06, 0.12), draw[0])
    else:
        wall = pick(homes, (0.5, 0.22, 0.1, 0.1, 0.08), draw[0])
    palette = {"wall_brick": _BRICK, "wall_stone": _STONE, "wall_ribbon": _STONE, "wall_panels": _PANEL}.get(
        wall, _PLASTER
    )
    tint: Rgb = (255, 255, 255) if wall == "wall_glass" else palette[int(draw[1] * len(palette))]
    given = colour_of(tags.get("building:colour", tags.get("building:color")))
    if given is not None and wall != "wall_glass":
        # The pictures are paler than white plaster; brick is red of its own, so only a brick's shade is taken over.
        strength = 0.5 if wall == "wall_brick" else 1.0
        tint = _mixed((255, 255, 255), _lifted(given), strength)
    ground = {
        "wall_classic": "ground_rusticated" if draw[2] < 0.8 else "ground_arcade",
        "wall_plain": "ground_rusticated",
        "wall_brick": "ground_brick",
        "wall_stone": "ground_arcade" if draw[2] < 0.6 else "ground_rusticated",
        "wall_ribbon": "ground_lobby",
        "wall_glass": "ground_lobby",
        "wall_balconies": "ground_rusticated" if draw[2] < 0.6 else "ground_lobby",
        "wall_panels": "ground_gates",
    }[wall]
    if use == "religious":
        ground = "ground_arcade"
    if use in ("garage", "industrial"):
        ground = "ground_gates"
    blank = {"wall_brick": "blank_brick", "wall_stone": "blank_stone", "wall_glass": "blank_stone"}.get(
        wall, "blank_plaster"
    )
    roof = _roof_material(tags, region, float(draw[3]))
    shades = _ROOF[roof]
    roof_tint = colour_of(tags.get("roof:colour", tags.get("roof:color"))) or shades[int(draw[4] * len(shades))]
    stony = ground in ("ground_arcade", "ground_lobby", "ground_brick")
    ground_tint = tint if not stony or ground == "ground_brick" else _mixed((226, 222, 216), tint, 0.3)
    bay = {"wall_glass": 3.6, "wall_ribbon": 3.9, "wall_panels": 4.4, "wall_stone": 3.3, "wall_balconies": 3.6}.get(
        wall, 3.0
    )
    return Look(wall, ground, blank, roof, bay, tint, ground_tint, roof_tint)


def region_of(lat: float, lon: float) -> str:
    """What building customs to expect: american, southern (around the Mediterranean) or northern."""
    if lon < -30.0:
        return "american"
    return "southern" if -25.0 < lat < 45.5 else "northern"


def _roof_material(tags: Mapping[str, str], region: str, draw: float) -> str:
    said = tags.get("roof:material", "").lower()
    if "tile" in said:
        return "roof_tiles"
    if said in ("metal", "copper", "tin", "zinc", "steel", "metal_sheet"):
        return "roof_metal"
    if said in ("slate", "stone", "asphalt_shingle", "wood"):
        return "roof_slate"
    if said in ("gravel", "concrete", "tar_paper", "bitumen", "asphalt", "grass"):
        return "roof_gravel"
    if region == "southern":
        return "roof_tiles" if draw < 0.85 else "roof_metal"
    if region == "american":
        return "roof_slate" if draw < 0.7 else "roof_metal"
    return "roof_metal" if draw < 0.62 else "roof_tiles" if draw < 0.86 else "roof_slate"


def _mixed(a: Rgb, b: Rgb, share: float) -> Rgb:
    r, g, b_ = (round(x + (y - x) * share) for x, y in zip(a, b, strict=True))
    return r, g, b_


def _lifted(colour: Rgb) -> Rgb:
    """A facade's tagged colour made up for the grey of the picture it multiplies."""
    r, g, b = (min(round(c * 1.18) + 6, 255) for c in colour)
    return r, g, b


def cut_at_heights(
    points: NDArray[np.float64], faces: NDArray[np.int64], owner: NDArray[np.int64], heights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Cut closed meshes by a horizontal plane each, without opening them.

    Parameters
    ----------
    points, faces
        All meshes together, shapes ``(n, 3)`` and ``(m, 3)``; no two share points.
    owner
        The mesh each face belongs to, shape ``(m,)``.
    heights
        Where each mesh is cut, shape ``(meshes,)``; NaN leaves it whole.

    Returns
    -------
    tuple
        Points, faces and owners after the cut: no triangle crosses its mesh's plane, and every edge that does is
        divided at one point that both its triangles use.
    """
    level = np.full(len(points), np.nan)
    level[faces.ravel()] = np.repeat(heights[owner], 3)
    above = points[:, 2] - level
    side = np.where(np.isnan(above) | (np.abs(above) < 1e-4), 0, np.sign(np.nan_to_num(above))).astype(np.int64)
    corner = side[faces]
    crossing = (corner.max(axis=1) > 0) & (corner.min(axis=1) < 0)
    if not crossing.any():
        return points, faces, owner
    cut, cut_side, cut_owner = faces[crossing], corner[crossing], owner[crossing]
    # Turn each triangle so that its first corner is the one alone on its side, or the one on the plane.
    flat = (cut_side == 0).any(axis=1)
    alone = np.where(cut_side.sum(axis=1)[:, None] > 0, cut_side < 0, cut_side > 0)
    first = np.where(flat, np.argmax(cut_side == 0, axis=1), np.argmax(alone, axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    cut = np.take_along_axis(cut, turn, axis=1)
    a, b, c = cut.T
    pairs = np.concatenate(
        [
            np.stack([b[flat], c[flat]], axis=1),
            np.stack([a[~flat], b[~flat]], axis=1),
            np.stack([a[~flat], c[~flat]], axis=1),
        ]
    )
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    keys, index = np.unique(low * np.int64(len(points)) + high, return_inverse=True)
    p, q = points[keys // len(points)], points[keys % len(points)]
    share = (level[keys // len(points)] - p[:, 2]) / (q[:, 2] - p[:, 2])
    new = p + (q - p) * share[:, None]
    new[:, 2] = level[keys // len(points)]
    index = index.ravel() + len(points)
    n_flat, n_split = int(flat.sum()), int((~flat).sum())
    on_bc, on_ab, on_ac = index[:n_flat], index[n_flat : n_flat + n_split], index[n_flat + n_split :]
    fa, fb, fc = cut[flat].T
    sa, sb, sc = cut[~flat].T
    made = np.concatenate(
        [
            np.stack([fa, fb, on_bc], axis=1),
            np.stack([fa, on_bc, fc], axis=1),
            np.stack([sa, on_ab, on_ac], axis=1),
            np.stack([on_ab, sb, sc], axis=1),
            np.stack([on_ab, sc, on_ac], axis=1),
        ]
    )
    whose = np.concatenate([*[cut_owner[flat]] * 2, *[cut_owner[~flat]] * 3])
    return (
        np.concatenate([points, new]),
        np.concatenate([faces[~crossing], made]),
        np.concatenate([owner[~crossing], whose]),
    )


def bays(length: NDArray[np.float64], wished: NDArray[np.float64]) -> NDArray[np.float64]:
    """How many bays walls of these lengths get: whole numbers, at least one."""
    return np.maximum(np.round(length / wished), 1.0)


def bay_coordinates(
    along: NDArray[np.float64], length: NDArray[np.float64], count: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Horizontal texture coordinate at a distance along a wall, in sheets of `BAYS` bays."""
    return along / length * count / BAYS


def storey_coordinates(
    z: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], count: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vertical texture coordinate of upper floors between two heights, in sheets of `STOREYS` storeys."""
    return (z - low) / (high - low) * count / STOREYS


_DOOR_COLOURS: tuple[Rgb, ...] = (
    (122, 78, 52),
    (92, 62, 46),
    (62, 84, 72),
    (58, 70, 92),
    (128, 56, 48),
    (150, 118, 82),
)
_GLAZED = {"retail", "commercial", "office", "hotel", "civic", "transport", "health"}


def door_surfaces(entrances: Sequence[Entrance], buildings: Sequence[Building]) -> list[Surface]:
    """Doors at entrances: a double door in a stone surround, standing a hand's breadth out of the wall.

    Parameters
    ----------
    entrances
        Where doors are; their position is the middle of the threshold.
    buildings
        The buildings they belong to: their use decides between glass and wood.

    Returns
    -------
    list of Surface
        For the "buildings" layer, entity that of the building.
    """
    known = {building.id: building for building in buildings}
    wood, glazed, stone = material("door_wood"), material("door_glass"), material("blank_stone")
    made: list[Surface] = []
    for entrance in entrances:
        building = known[entrance.building]
        shop = building.use in _GLAZED
        colour = _DOOR_COLOURS[zlib.crc32(entrance.id.encode()) % len(_DOOR_COLOURS)]
        place = pose_matrix(*entrance.position, entrance.facing)
        width, height = (1.9, 2.6) if shop else (1.6, 2.5)
        posts = [
            box((0.14, 0.3, height + 0.35), (0.05, side * (width / 2 + 0.15), (height + 0.05) / 2), material=stone)
            for side in (-1, 1)
        ]
        lintel = box((0.16, width + 0.6, 0.32), (0.05, 0.0, height + 0.16), material=stone)
        step = box((0.35, width + 0.5, 0.24), (0.1, 0.0, -0.06), material=stone)
        made += [s.tinted((214, 210, 204)).moved(place).of_entity(building.entity) for s in (*posts, lintel, step)]
        leaf = Surface.from_triangles(
            np.array(
                [
                    (0.05, -width / 2, 0.06),
                    (0.05, width / 2, 0.06),
                    (0.05, width / 2, height),
                    (0.05, -width / 2, height),
                ]
            ),
            np.array([(0, 1, 2), (0, 2, 3)]),
            colour=(255, 255, 255) if shop else colour,
            uv=np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]),
            material=glazed if shop else wood,
        )
        made.append(leaf.moved(place).of_entity(building.entity))
    return joined(made)
