"""What buildings wear: facade materials by use and region, and texture coordinates in whole bays and storeys."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vico.worldgen.facades.textures import BAYS
from vico.worldgen.facades.textures import STOREYS as STOREYS

Rgb = tuple[int, int, int]

# What a wall shows, by what it faces.
BLANK, BACK, FRONT, SHOPFRONT = 0, 1, 2, 3

ROOF_TILE = {"roof_tiles": 3.2, "roof_metal": 2.4, "roof_slate": 3.2, "roof_gravel": 4.0}
"""Metres a roof texture covers."""

BLANK_TILE = {"blank_plaster": 3.0, "blank_brick": 2.4, "blank_stone": 2.4, "blank_boards": 3.0}
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
_SAND: tuple[Rgb, ...] = ((255, 246, 230), (246, 222, 196), (255, 236, 204), (238, 206, 188), (244, 240, 232))
_TERRACOTTA: tuple[Rgb, ...] = ((255, 252, 244), (240, 226, 206), (236, 196, 170), (214, 212, 208), (246, 240, 228))
_BOARDS: tuple[Rgb, ...] = (
    (255, 255, 252),
    (238, 226, 176),
    (196, 204, 206),
    (178, 104, 86),
    (206, 216, 196),
    (224, 206, 178),
    (168, 188, 204),
)
_WARM: tuple[Rgb, ...] = (
    (255, 224, 164),
    (255, 236, 196),
    (252, 206, 150),
    (248, 196, 168),
    (255, 244, 222),
    (240, 216, 176),
    (252, 224, 200),
    (236, 180, 148),
)
_TIMBER: tuple[Rgb, ...] = ((255, 255, 250), (255, 246, 226), (250, 232, 200), (255, 250, 240))
_ALPINE: tuple[Rgb, ...] = ((255, 253, 246), (255, 255, 252), (255, 246, 224), (250, 238, 210), (255, 250, 238))
_WHITE: tuple[Rgb, ...] = ((255, 255, 255),)
_PALETTES: Mapping[str, tuple[Rgb, ...]] = {
    "wall_brick": _BRICK,
    "wall_tenement": (*_BRICK, (226, 188, 170), (255, 226, 196)),
    "wall_tenement_buff": (*_BRICK, (226, 214, 206), (255, 246, 232)),
    "wall_loft": _BRICK,
    "wall_stone": _STONE,
    "wall_arched": _SAND,
    "wall_french": ((255, 250, 240), (255, 244, 226), (250, 238, 214), (244, 240, 234)),
    "wall_shuttered": _WARM,
    "wall_timbered": _TIMBER,
    "wall_alpine": _ALPINE,
    "wall_boards": _BOARDS,
    "wall_ribbon": _STONE,
    "wall_slab": _STONE,
    "wall_grid": _TERRACOTTA,
    "wall_panels": _PANEL,
    "wall_church": _SAND,
    "wall_shed": ((255, 255, 255), (226, 216, 206), (196, 190, 186), (214, 160, 140)),
    "wall_glass": _WHITE,
    "wall_fins": (*_WHITE, (236, 226, 210), (206, 210, 216)),
}
_ROOF: Mapping[str, tuple[Rgb, ...]] = {
    "roof_tiles": ((176, 104, 82), (160, 92, 74), (172, 116, 92), (148, 88, 70), (190, 122, 94), (142, 100, 84)),
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
    """The materials and colours of one building.

    Attributes
    ----------
    wall, ground, blank, roof, back
        Materials of upper floors, ground floor, walls without windows, roof, and upper floors away from streets.
    bay
        Wished width of a bay, metres.
    tint, ground_tint, roof_tint, back_tint
        What multiplies their pictures.
    hall
        One row of windows from a low base to the eaves, as churches have.
    gable, gable_tint
        What a front shows above its eaves; "": as its blank walls.
    reach
        How far a pitched roof reaches out over the walls, metres.
    eaves
        The finish of what reaches out (`buildings.finishes`).
    flat_tint
        Colour of a flat roof's gravel or felt.
    """

    wall: str
    ground: str
    blank: str
    roof: str
    bay: float
    tint: Rgb
    ground_tint: Rgb
    roof_tint: Rgb
    back: str = "wall_plain"
    back_tint: Rgb = (255, 255, 255)
    hall: bool = False
    gable: str = ""
    gable_tint: Rgb = (255, 255, 255)
    reach: float = 0.0
    eaves: str = "eaves"
    flat_tint: Rgb = (150, 148, 146)


Shares = tuple[tuple[str, float], ...]

_WITH_CORNICE = (
    "wall_classic",
    "wall_stone",
    "wall_arched",
    "wall_french",
    "wall_tenement",
    "wall_tenement_buff",
    "wall_loft",
)
"""Families that end in a cornice instead of eaves."""

_REACH: Mapping[str, float] = {"alpine": 1.0, "german": 0.42, "nordic": 0.4, "southern": 0.42, "british": 0.24}
"""How far roofs reach out, metres, by region."""

_WOODS: tuple[Rgb, ...] = ((128, 92, 66), (112, 78, 56), (150, 112, 80), (98, 72, 56))
_FELT: tuple[Rgb, ...] = ((150, 148, 146), (176, 172, 166), (128, 127, 127), (104, 104, 106), (160, 152, 142))

_OWN_COLOUR = (
    "wall_brick",
    "wall_tenement",
    "wall_tenement_buff",
    "wall_loft",
    "wall_timbered",
    "wall_shed",
    "wall_arched",
    "wall_church",
)
_DRESSY = (
    "wall_classic",
    "wall_stone",
    "wall_arched",
    "wall_french",
    "wall_brick",
    "wall_tenement",
    "wall_tenement_buff",
    "wall_timbered",
    "wall_shuttered",
    "wall_grid",
)
"""Families whose backs are plainer than their fronts."""

_BAY: Mapping[str, float] = {
    "wall_glass": 3.6,
    "wall_fins": 3.9,
    "wall_ribbon": 3.9,
    "wall_panels": 4.4,
    "wall_stone": 3.3,
    "wall_arched": 3.1,
    "wall_grid": 3.6,
    "wall_slab": 3.4,
    "wall_balconies": 3.6,
    "wall_loft": 3.8,
    "wall_tenement": 3.2,
    "wall_tenement_buff": 3.2,
    "wall_french": 2.7,
    "wall_shuttered": 2.8,
    "wall_timbered": 2.9,
    "wall_alpine": 3.1,
    "wall_boards": 2.9,
    "wall_church": 4.4,
    "wall_shed": 4.0,
}
"""Wished width of a bay, metres; 3 for all others."""

_BLANKS: Mapping[str, str] = {
    "wall_brick": "blank_brick",
    "wall_tenement": "blank_brick",
    "wall_tenement_buff": "blank_brick",
    "wall_loft": "blank_brick",
    "wall_stone": "blank_stone",
    "wall_arched": "blank_stone",
    "wall_church": "blank_stone",
    "wall_glass": "blank_stone",
    "wall_boards": "blank_boards",
    "wall_shed": "blank_boards",
}

_GROUNDS: Mapping[str, tuple[str, ...]] = {
    "wall_classic": ("ground_rusticated", "ground_rusticated", "ground_arcade", "ground_plain"),
    "wall_plain": ("ground_plain", "ground_plain", "ground_rusticated"),
    "wall_brick": ("ground_brick", "ground_brick", "ground_rusticated"),
    "wall_tenement_buff": ("ground_loft", "ground_brownstone", "ground_rusticated"),
    "wall_tenement": ("ground_brownstone", "ground_brownstone", "ground_brick", "ground_loft"),
    "wall_stone": ("ground_arcade", "ground_rusticated"),
    "wall_arched": ("ground_arcade", "ground_rusticated"),
    "wall_french": ("ground_rusticated", "ground_shuttered", "ground_arcade"),
    "wall_shuttered": ("ground_shuttered", "ground_shuttered", "ground_plain"),
    "wall_timbered": ("ground_plain", "ground_shuttered", "ground_rusticated"),
    "wall_alpine": ("ground_shuttered", "ground_plain", "ground_plain"),
    "wall_boards": ("ground_boards",),
    "wall_ribbon": ("ground_lobby",),
    "wall_glass": ("ground_lobby",),
    "wall_fins": ("ground_lobby",),
    "wall_grid": ("ground_lobby", "ground_arcade"),
    "wall_slab": ("ground_plain", "ground_lobby"),
    "wall_balconies": ("ground_plain", "ground_lobby"),
    "wall_panels": ("ground_gates",),
    "wall_loft": ("ground_loft", "ground_brick"),
    "wall_church": ("ground_base",),
    "wall_shed": ("ground_shed",),
}

_OF_MATERIAL: Mapping[str, Shares] = {
    **dict.fromkeys(("brick", "bricks"), (("wall_brick", 1.0),)),
    **dict.fromkeys(("sandstone", "limestone"), (("wall_arched", 0.6), ("wall_stone", 0.4))),
    **dict.fromkeys(("stone", "granite", "marble"), (("wall_stone", 1.0),)),
    **dict.fromkeys(("glass", "mirror"), (("wall_glass", 1.0),)),
    **dict.fromkeys(
        ("plaster", "stucco", "render", "loam", "adobe", "clay"), (("wall_classic", 0.6), ("wall_plain", 0.4))
    ),
    **dict.fromkeys(("concrete", "cement_block", "cement"), (("wall_ribbon", 0.5), ("wall_slab", 0.5))),
    **dict.fromkeys(("metal", "steel", "tin", "metal_plates", "aluminium"), (("wall_panels", 1.0),)),
    **dict.fromkeys(("timber_framing", "half_timbered", "timber_frame"), (("wall_timbered", 1.0),)),
    **dict.fromkeys(("wood", "timber", "vinyl", "vinyl_siding", "weatherboard"), (("wall_boards", 1.0),)),
    **dict.fromkeys(("tiles", "panels", "eternit"), (("wall_grid", 1.0),)),
}
_OF_STYLE: Mapping[str, Shares] = {
    **dict.fromkeys(("modern", "contemporary", "high-tech", "postmodern"), (("wall_grid", 0.5), ("wall_fins", 0.5))),
    **dict.fromkeys(("brutalist", "brutalism"), (("wall_ribbon", 0.5), ("wall_slab", 0.5))),
    **dict.fromkeys(("international_style", "functionalism", "modernism", "bauhaus"), (("wall_plain", 1.0),)),
    **dict.fromkeys(
        ("neoclassicism", "neoclassical", "classicism", "empire", "eclectic", "historicism", "art_nouveau"),
        (("wall_classic", 0.7), ("wall_stone", 0.3)),
    ),
    **dict.fromkeys(
        ("baroque", "neo-baroque", "renaissance", "neo-renaissance", "neo-romanesque", "romanesque"),
        (("wall_arched", 1.0),),
    ),
    **dict.fromkeys(("victorian", "georgian", "edwardian", "federal"), (("wall_brick", 0.8), ("wall_classic", 0.2))),
    **dict.fromkeys(("haussmann", "second_empire"), (("wall_french", 1.0),)),
    **dict.fromkeys(("half-timbered", "timber_frame", "tudor"), (("wall_timbered", 1.0),)),
}
_MODERN_WALLS = ("wall_ribbon", "wall_glass", "wall_grid", "wall_fins", "wall_panels")
_MODERN: Shares = (("wall_ribbon", 0.28), ("wall_glass", 0.25), ("wall_grid", 0.27), ("wall_fins", 0.2))
# What streets are lined with, by region: old town houses, small old ones, cottages, houses of 1920-1975, later ones.
_CUSTOMS: Mapping[str, Mapping[str, Shares]] = {
    "northern": {
        "old": (("wall_classic", 0.55), ("wall_stone", 0.12), ("wall_brick", 0.15), ("wall_french", 0.1),
                ("wall_arched", 0.08)),
        "small": (("wall_classic", 0.5), ("wall_plain", 0.2), ("wall_shuttered", 0.15), ("wall_brick", 0.15)),
        "cottage": (("wall_plain", 0.5), ("wall_brick", 0.2), ("wall_shuttered", 0.3)),
        "middle": (("wall_plain", 0.6), ("wall_slab", 0.2), ("wall_brick", 0.2)),
        "new": (("wall_balconies", 0.5), ("wall_grid", 0.3), ("wall_plain", 0.2)),
    },
    "nordic": {
        "old": (("wall_classic", 0.68), ("wall_stone", 0.14), ("wall_arched", 0.08), ("wall_brick", 0.1)),
        "small": (("wall_classic", 0.6), ("wall_plain", 0.3), ("wall_boards", 0.1)),
        "cottage": (("wall_boards", 0.55), ("wall_plain", 0.45)),
        "middle": (("wall_plain", 0.78), ("wall_slab", 0.07), ("wall_brick", 0.15)),
        "new": (("wall_balconies", 0.55), ("wall_grid", 0.25), ("wall_fins", 0.2)),
    },
    "british": {
        "old": (("wall_brick", 0.42), ("wall_stone", 0.24), ("wall_classic", 0.16), ("wall_arched", 0.12),
                ("wall_loft", 0.06)),
        "small": (("wall_brick", 0.7), ("wall_classic", 0.2), ("wall_stone", 0.1)),
        "cottage": (("wall_brick", 0.85), ("wall_plain", 0.15)),
        "middle": (("wall_brick", 0.5), ("wall_ribbon", 0.2), ("wall_slab", 0.15), ("wall_stone", 0.15)),
        "new": (("wall_grid", 0.4), ("wall_glass", 0.2), ("wall_balconies", 0.2), ("wall_fins", 0.2)),
    },
    "german": {
        "old": (("wall_classic", 0.5), ("wall_arched", 0.24), ("wall_shuttered", 0.14), ("wall_brick", 0.06),
                ("wall_stone", 0.06)),
        "small": (("wall_shuttered", 0.4), ("wall_classic", 0.28), ("wall_timbered", 0.14), ("wall_plain", 0.1),
                  ("wall_arched", 0.08)),
        "cottage": (("wall_shuttered", 0.4), ("wall_plain", 0.35), ("wall_timbered", 0.25)),
        "middle": (("wall_plain", 0.75), ("wall_slab", 0.25)),
        "new": (("wall_balconies", 0.5), ("wall_grid", 0.3), ("wall_plain", 0.2)),
    },
    "alpine": {
        "old": (("wall_alpine", 0.34), ("wall_classic", 0.26), ("wall_shuttered", 0.3), ("wall_arched", 0.1)),
        "small": (("wall_alpine", 0.72), ("wall_shuttered", 0.24), ("wall_classic", 0.04)),
        "cottage": (("wall_alpine", 0.7), ("wall_shuttered", 0.2), ("wall_plain", 0.1)),
        "middle": (("wall_alpine", 0.5), ("wall_plain", 0.5)),
        "new": (("wall_alpine", 0.35), ("wall_balconies", 0.4), ("wall_plain", 0.25)),
    },
    "southern": {
        "old": (("wall_shuttered", 0.4), ("wall_french", 0.36), ("wall_classic", 0.14), ("wall_arched", 0.1)),
        "small": (("wall_shuttered", 0.8), ("wall_french", 0.2)),
        "cottage": (("wall_shuttered", 0.75), ("wall_plain", 0.25)),
        "middle": (("wall_balconies", 0.55), ("wall_shuttered", 0.25), ("wall_plain", 0.2)),
        "new": (("wall_balconies", 0.8), ("wall_fins", 0.1), ("wall_grid", 0.1)),
    },
    "american": {
        "old": (("wall_tenement", 0.4), ("wall_tenement_buff", 0.22), ("wall_brick", 0.22), ("wall_loft", 0.12),
                ("wall_stone", 0.04)),
        "small": (("wall_tenement", 0.38), ("wall_tenement_buff", 0.19), ("wall_brick", 0.33), ("wall_boards", 0.1)),
        "cottage": (("wall_boards", 0.75), ("wall_brick", 0.25)),
        "middle": (("wall_brick", 0.75), ("wall_slab", 0.1), ("wall_plain", 0.15)),
        "new": (("wall_grid", 0.3), ("wall_fins", 0.25), ("wall_balconies", 0.2), ("wall_brick", 0.25)),
    },
}  # fmt: skip


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
    """Dress a building: by its material, architecture and colour tags, else by use, age, size and region, and a draw.

    `region` is what `region_of` says; an unknown one counts as northern.
    """
    draw = random.random(8)
    wall = family_of(use, tags, levels=levels, area=area, region=region, draw=(float(draw[0]), float(draw[5])))
    palette = _PALETTES.get(wall, _PLASTER)
    tint: Rgb = palette[int(draw[1] * len(palette))]
    given = colour_of(tags.get("building:colour", tags.get("building:color")))
    if given is not None and wall not in ("wall_glass", "wall_fins"):
        # The pictures are paler than white plaster; brick is red of its own, so only a brick's shade is taken over.
        strength = 0.5 if wall in _OWN_COLOUR else 1.0
        tint = _mixed((255, 255, 255), _lifted(given), strength)
    options = _GROUNDS[wall]
    ground = options[int(draw[2] * len(options))]
    if use in ("garage", "industrial") and wall != "wall_shed":
        ground = "ground_gates"
    elif use in ("office", "hotel", "commercial") and levels >= 7 and draw[6] < 0.7:
        ground = "ground_lobby"
    roof = _roof_material(tags, region, float(draw[3]))
    if wall in _MODERN_WALLS and not tags.get("roof:material"):
        roof = "roof_metal"
    shades = _ROOF[roof] if wall not in _MODERN_WALLS else ((104, 108, 112), (84, 88, 92), (70, 72, 76))
    roof_tint = colour_of(tags.get("roof:colour", tags.get("roof:color"))) or shades[int(draw[4] * len(shades))]
    stony = ground in ("ground_arcade", "ground_lobby", "ground_rusticated", "ground_loft") and draw[6] < 0.5
    ground_tint: Rgb = _mixed((226, 222, 216), tint, 0.3) if stony else tint
    if ground == "ground_brownstone":
        ground_tint = (255, 255, 255)
    elif wall in _OWN_COLOUR and ground not in ("ground_brick", "ground_shed"):
        ground_tint = _STONE[int(draw[7] * len(_STONE))]
    bay = _BAY.get(wall, 3.0) * (0.92 + 0.2 * float(draw[7]))
    back, back_tint = wall, tint
    if wall in _DRESSY and area > 120.0:
        brick = wall in ("wall_brick", "wall_tenement", "wall_tenement_buff", "wall_loft") or (
            region == "british" and draw[6] < 0.7
        )
        back = "wall_back_brick" if brick else "wall_back"
        back_tint = (255, 250, 240) if brick else _mixed((238, 234, 226), tint, 0.5)
    blank = _BLANKS.get(wall, "blank_brick" if back == "wall_back_brick" else "blank_plaster")
    hall = wall == "wall_church"
    wooden = wall == "wall_alpine" or (wall == "wall_shuttered" and region == "alpine" and draw[6] < 0.5)
    reach = _REACH.get(region, 0.35) * (0.8 + 0.4 * float(draw[2]))
    if wall in _WITH_CORNICE or hall or levels > 7:
        reach = 0.0 if wall in _WITH_CORNICE else 0.25
    return Look(
        wall,
        ground,
        blank,
        roof,
        bay,
        tint,
        ground_tint,
        roof_tint,
        back,
        back_tint,
        hall,
        gable="blank_boards" if wooden else "",
        gable_tint=_WOODS[int(draw[7] * len(_WOODS))] if wooden else (255, 255, 255),
        reach=reach,
        eaves="eaves_wood" if wooden or (region in ("alpine", "nordic") and wall == "wall_boards") else "eaves",
        flat_tint=_FELT[int(draw[6] * len(_FELT))],
    )


def told_apart(looks: Sequence[Look], pairs: Sequence[tuple[int, int]], free: Sequence[bool]) -> list[Look]:
    """Give neighbours that would wear the same wall in the same colour different ones.

    Parameters
    ----------
    looks
        Of all buildings.
    pairs
        Neighbours, the earlier first, in order.
    free
        Whose colour the map does not say.
    """
    made = list(looks)
    for i, j in pairs:
        palette = _PALETTES.get(made[j].wall, _PLASTER)
        if made[i].wall != made[j].wall or made[i].tint != made[j].tint or not free[j] or made[j].tint not in palette:
            continue
        # Two steps on: neighbours in a palette are like each other.
        tint = palette[(palette.index(made[j].tint) + 2) % len(palette)]
        same = made[j].ground_tint == made[j].tint
        made[j] = replace(made[j], tint=tint, ground_tint=tint if same else made[j].ground_tint)
    return made


def family_of(
    use: str,
    tags: Mapping[str, str],
    *,
    levels: int,
    area: float,
    region: str,
    draw: tuple[float, float] = (0.5, 0.5),
) -> str:
    """The family of facade a building belongs to, by name of its material.

    What the map says of material and architecture comes first; then use and height; homes and houses of trade follow
    the customs of their region, the old ones where the map or a small plot suggests age.
    """
    said = tags.get("building:material", tags.get("building:facade:material", "")).lower()
    style = tags.get("building:architecture", "").lower()
    small = area < 60.0 and levels <= 1
    if said in _OF_MATERIAL:
        return _picked(_OF_MATERIAL[said], draw[0])
    if use == "religious" and tags.get("building") not in ("house", "residential", "apartments", "office", "yes"):
        return "wall_church"
    if style in _OF_STYLE and levels >= 2:
        return _picked(_OF_STYLE[style], draw[0])
    if tags.get("building") in ("shed", "hut", "barn", "cabin", "farm_auxiliary", "stable"):
        return "wall_shed" if said not in ("brick", "stone") else "wall_brick"
    if use == "garage" or small:
        return _picked(
            (("wall_plain", 0.56), ("wall_shed", 0.14), ("wall_brick", 0.15), ("wall_panels", 0.15)), draw[0]
        )
    year = year_of(tags.get("start_date"))
    if use == "industrial" or (use == "transport" and area > 1500):
        old = year is not None and year < 1945
        return _picked((("wall_loft", 1.0),) if old else (("wall_panels", 0.6), ("wall_loft", 0.4)), draw[0])
    if levels >= 8 and region == "southern" and use in ("residential", "other"):
        return _picked((("wall_balconies", 0.82), ("wall_french", 0.1), ("wall_fins", 0.08)), draw[0])
    if levels >= 14:
        homes = use == "residential"
        return _picked(
            (("wall_balconies", 0.45), ("wall_slab", 0.25), ("wall_fins", 0.3))
            if homes
            else (("wall_glass", 0.45), ("wall_fins", 0.3), ("wall_ribbon", 0.15), ("wall_grid", 0.1)),
            draw[0],
        )
    customs = _CUSTOMS.get(region, _CUSTOMS["northern"])
    old_town = "heritage" in tags or "historic" in tags
    if year is None and not old_town and area < 320.0 and levels <= 5 and use not in ("office", "industrial"):
        old_town = draw[1] < 0.6
    if old_town:
        year = year if year is not None else 1880
    if year is not None:
        old = year < 1920
        middle = 1920 <= year < 1975
        table = customs["old"] if old else customs["middle"] if middle else customs["new"]
        if old and levels <= 4 and area < 420.0 and use in ("residential", "other", "retail", "commercial", "hotel"):
            table = customs["cottage"] if area < 140.0 and levels <= 3 else customs["small"]
        return _picked(table, draw[0])
    if use in ("civic", "education", "health", "religious"):
        return _picked((("wall_stone", 0.3), ("wall_arched", 0.25), *customs["old"], *customs["middle"]), draw[0])
    if region in ("german", "alpine") and levels <= 4 and area < 900.0 and use in ("commercial", "retail", "hotel"):
        return _picked(customs["small"] if draw[1] < 0.72 else customs["new"], draw[0])
    if use in ("office", "commercial", "retail", "transport", "hotel"):
        modern = _picked(_MODERN, draw[0])
        return modern if draw[1] < (0.7 if use == "office" else 0.4) else _picked(customs["old"], draw[0])
    if levels >= 8:
        table = (("wall_balconies", 0.35), ("wall_plain", 0.2), ("wall_slab", 0.08), ("wall_grid", 0.1))
        return _picked((*table, *customs["middle"], *customs["old"]), draw[0])
    if levels <= 2 and area < 260.0:
        return _picked(customs["cottage"], draw[0])
    return _picked(
        customs["old"] if draw[1] < 0.62 else customs["middle"] if draw[1] < 0.86 else customs["new"], draw[0]
    )


def year_of(text: str | None) -> int | None:
    """The year a ``start_date`` means: ``1887``, ``~1900``, ``1960s``, ``C19``, ``before 1800``; None for others."""
    if not text:
        return None
    century = re.search(r"\bC(\d{1,2})\b", text.strip())
    if century:
        return int(century.group(1)) * 100 - 50
    year = re.search(r"(?<!\d)(1\d{3}|20\d{2})(?!\d{2})", text)
    return int(year.group(1)) if year else None


def _picked(table: Sequence[tuple[str, float]], draw: float) -> str:
    """One of the names, by their shares."""
    edges = np.cumsum([share for _, share in table])
    return table[int(np.searchsorted(edges, min(draw, 0.999999) * edges[-1], side="right"))][0]


def region_of(lat: float, lon: float) -> str:
    """What building customs to expect: american, alpine, southern (Mediterranean), british, german, nordic, northern.

    Only customs of windows and stuffs hang on it; what the map says of a building always goes first.
    """
    if lon < -30.0:
        return "american"
    if (46.2 < lat < 47.75 and 9.2 < lon < 14.2) or (45.7 < lat < 46.75 and 6.2 < lon < 8.6):
        return "alpine"
    if -25.0 < lat < 45.5:
        return "southern"
    if lon < 2.0 and lat > 49.6:
        return "british"
    if lat > 54.8:
        return "nordic"
    return "german" if 5.8 < lon < 17.5 and lat > 45.5 else "northern"


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
    if region in ("german", "alpine"):
        return "roof_tiles" if draw < 0.84 else "roof_slate" if draw < 0.93 else "roof_metal"
    if region == "british":
        return "roof_slate" if draw < 0.66 else "roof_tiles" if draw < 0.84 else "roof_metal"
    if region == "northern":
        return "roof_metal" if draw < 0.36 else "roof_slate" if draw < 0.68 else "roof_tiles"
    return "roof_metal" if draw < 0.62 else "roof_tiles" if draw < 0.86 else "roof_slate"


def _mixed(a: Rgb, b: Rgb, share: float) -> Rgb:
    r, g, b_ = (round(x + (y - x) * share) for x, y in zip(a, b, strict=True))
    return r, g, b_


def _lifted(colour: Rgb) -> Rgb:
    """A facade's tagged colour made up for the grey of the picture it multiplies."""
    r, g, b = (min(round(c * 1.18) + 6, 255) for c in colour)
    return r, g, b


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
