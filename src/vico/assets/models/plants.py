"""Trees, shrubs and hedges: trunks, branches, and crowns of leaf cards with a generated cut-out texture."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from vico.assets.models.model import Model, model
from vico.assets.shapes import Colour, ball, box
from vico.seeds import rng
from vico.world.mesh import Material, Surface, quad_triangles

_SIDE = 128


@cache
def leaf_material(kind: str) -> Material:
    """Make a cut-out texture of leaves: ``broad``, ``small``, ``needle`` or ``frond``; near white, to be tinted."""
    random = rng(0, "leaves", kind)
    scale = 4  # drawn larger, then reduced, for soft edges
    side = _SIDE * scale
    image = Image.new("RGBA", (side, side), (150, 168, 120, 0))
    draw = ImageDraw.Draw(image)
    if kind == "frond":
        _frond(draw, side)
    elif kind == "needle":
        _needles(draw, side, random)
    else:
        long, wide, count = (0.17, 0.085, 95) if kind == "broad" else (0.10, 0.06, 190)
        for _ in range(count):
            # Clustered towards the middle, so that cards have a ragged, rounded outline.
            radius = 0.43 * np.sqrt(random.random()) * (1 - 0.12 * random.random())
            turn = random.uniform(0, 2 * np.pi)
            x, y = side * (0.5 + radius * np.cos(turn)), side * (0.5 + radius * np.sin(turn))
            tone = int(random.integers(150, 256))
            _leaf(draw, x, y, side * long, side * wide, random.uniform(0, 2 * np.pi), tone)
    small = image.resize((_SIDE, _SIDE), Image.Resampling.BOX)
    pixels = np.asarray(small).copy()
    # Colour under the holes: the leaves' mean, so that filtering draws no fringe.
    seen = pixels[..., 3] > 127
    pixels[~seen, :3] = pixels[seen, :3].mean(0).astype(np.uint8)
    return Material(f"leaves_{kind}", pixels, cutout=True, double_sided=True)


def _leaf(draw: ImageDraw.ImageDraw, x: float, y: float, long: float, wide: float, turn: float, tone: int) -> None:
    t = np.linspace(0, 2 * np.pi, 13)[:-1]
    # Pointed at both ends.
    u, v = np.cos(t) * long / 2, np.sin(t) * np.abs(np.sin(t)) * wide / 2
    c, s = np.cos(turn), np.sin(turn)
    outline = [(float(a), float(b)) for a, b in zip(x + c * u - s * v, y + s * u + c * v, strict=True)]
    draw.polygon(outline, fill=(tone - 12, tone, tone - 45, 255))


def _needles(draw: ImageDraw.ImageDraw, side: int, random: np.random.Generator) -> None:
    """Draw a twig along v with side twigs, all set with needles."""
    for branch in np.linspace(0.04, 0.96, 22):
        reach = 0.46 * (1.0 - 0.72 * branch) + 0.04
        for sign in (-1, 1):
            x0, y0 = side * 0.5, side * branch
            x1, y1 = side * (0.5 + sign * reach), side * min(0.99, branch + 0.22)
            tone = int(random.integers(150, 240))
            draw.line([(x0, y0), (x1, y1)], fill=(tone - 20, tone, tone - 30, 255), width=int(side * 0.028))
            for t in np.linspace(0.08, 1.0, 12):
                cx, cy = x0 + (x1 - x0) * t, y0 + (y1 - y0) * t
                for lean in (-1, 1):
                    tip = (cx + side * 0.02 * sign, cy + lean * side * 0.045)
                    draw.line([(cx, cy), tip], fill=(tone - 15, tone, tone - 25, 255), width=int(side * 0.013))


def _frond(draw: ImageDraw.ImageDraw, side: int) -> None:
    """Draw a palm leaf along v."""
    draw.line([(side * 0.5, 0), (side * 0.5, side)], fill=(200, 205, 140, 255), width=int(side * 0.03))
    for t in np.linspace(0.03, 0.97, 30):
        reach = 0.47 * np.sin(np.pi * (0.18 + 0.8 * t)) ** 0.7
        for sign in (-1, 1):
            tone = 190 + int(40 * np.sin(40 * t))
            tip = (side * (0.5 + sign * reach), side * min(0.995, t + 0.12))
            draw.line([(side * 0.5, side * t), tip], fill=(tone - 15, tone, tone - 60, 255), width=int(side * 0.022))


def _cards(
    centres: NDArray[np.float64],
    right: NDArray[np.float64],
    up: NDArray[np.float64],
    normals: NDArray[np.float64],
    colours: NDArray[np.uint8],
    material: Material,
) -> Surface:
    """Quads around `centres` with half extents `right` and `up`; one normal and colour a card."""
    n = len(centres)
    corners = np.stack([centres - right - up, centres + right - up, centres + right + up, centres - right + up], axis=1)
    corners[..., 2] = np.maximum(corners[..., 2], 0.02)  # nothing grows downwards
    uv = np.tile(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32), (n, 1))
    return Surface.from_triangles(
        corners.reshape(-1, 3),
        quad_triangles(4 * np.arange(n)),
        colour=np.repeat(colours, 4, axis=0),
        uv=uv,
        normals=np.repeat(normals, 4, axis=0),
        material=material,
    )


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))


def _limb(
    start: NDArray[np.float64], end: NDArray[np.float64], radius: float, tip: float, colour: Colour, sides: int = 5
) -> Surface:
    """Make a tapered branch."""
    axis = _unit(end - start)
    helper = np.array([1.0, 0, 0]) if abs(axis[0]) < 0.7 else np.array([0, 1.0, 0])
    u = _unit(np.cross(axis, helper))
    v = np.cross(axis, u)
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    around = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
    points = np.concatenate([start + around * radius, end + around * tip])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = np.concatenate([np.column_stack([i, j, sides + j]), np.column_stack([i, sides + j, sides + i])])
    return Surface.from_triangles(points, faces, colour=colour, normals=np.concatenate([around, around]))


class _Trunk(NamedTuple):
    """Trunk of a leafy tree: clear height below the crown and radius, metres, and colour."""

    bare: float
    radius: float
    bark: Colour


class _Leafage(NamedTuple):
    """Leaves of a tree: tint, kind of texture, half extent of a card, metres, and how many cards carry them."""

    tint: Colour
    texture: str
    card: float
    cards: int = 105


def _crown_tree(name: str, *, height: float, crown: tuple[float, float], trunk: _Trunk, leaves: _Leafage) -> Model:
    """Make a leafy tree: `crown` is its radius and half height, metres."""
    random = rng(0, "tree", name)
    wide, tall = crown
    thick, bark, cards = trunk.radius, trunk.bark, leaves.cards
    middle = np.array([0, 0, height - tall])
    fork = np.array([random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), trunk.bare + 0.4])
    parts = [
        _limb(np.zeros(3), fork, thick, thick * 0.72, bark, 7),
        _limb(fork, middle + np.array([0, 0, tall * 0.35]), thick * 0.72, thick * 0.2, bark),
    ]
    for k in range(5):
        turn = 2 * np.pi * (k + random.uniform(-0.2, 0.2)) / 5
        reach = wide * random.uniform(0.5, 0.7)
        end = middle + np.array([reach * np.cos(turn), reach * np.sin(turn), random.uniform(-0.25, 0.35) * tall])
        parts.append(_limb(fork + np.array([0, 0, 0.15 * k]), end, thick * 0.42, thick * 0.12, bark, 4))
    # Cards on a lumpy shell and, fewer, within; a golden-angle spiral spreads them evenly.
    index = np.arange(cards) + 0.5
    z = 1 - 2 * index / cards
    turn = index * (np.pi * (3 - np.sqrt(5)))
    rim = np.sqrt(1 - z * z)
    out = np.column_stack([rim * np.cos(turn), rim * np.sin(turn), z])
    lumps = 1 + 0.13 * np.sin(3 * turn + 4 * z) + random.uniform(-0.12, 0.08, cards)
    inner = np.where(np.arange(cards) % 4 == 0, 0.55, 0.86)
    # A crown is flatter below than above.
    squash = np.where(out[:, 2:] < 0, 0.8, 1.0)
    centres = middle + out * [wide, wide, tall] * squash * (lumps * inner)[:, None]
    side = leaves.card * random.uniform(0.8, 1.2, cards)
    # Half of them face outwards, half at random: no view through, no visible planes.
    facing = _unit(out + random.normal(0, 0.55, (cards, 3)))
    spin = _unit(np.cross(facing, random.normal(0, 1, (cards, 3))))
    over = np.cross(facing, spin)
    normals = _unit(out * 0.85 + [0, 0, 0.35])
    light = 0.8 + 0.24 * np.clip((centres[:, 2] - middle[2]) / tall, -1, 1) + random.uniform(-0.1, 0.1, cards)
    light = np.where(inner < 0.7, light * 0.7, light)
    warm = random.uniform(-0.07, 0.07, cards)
    tint = (
        np.array(leaves.tint)
        * np.clip(light, 0.25, 1.05)[:, None]
        * np.column_stack([1 + warm, np.ones(cards), 1 - warm])
    )
    colours = np.clip(tint, 0, 255).astype(np.uint8)
    parts.append(
        _cards(centres, spin * side[:, None], over * side[:, None], normals, colours, leaf_material(leaves.texture))
    )
    return model(name, parts, kind="tree", group="natural", foot=(2 * thick + 0.1, 2 * thick + 0.1))


def _conifer(name: str, *, height: float, radius: float, leaves: Colour) -> Model:
    """Make a spruce: whorls of drooping branches."""
    random = rng(0, "tree", name)
    bark = (92, 70, 56)
    parts = [_limb(np.zeros(3), np.array([0, 0, height * 0.93]), 0.2, 0.03, bark, 6)]
    centres, rights, ups, normals, lights = [], [], [], [], []
    tiers = 13
    for tier in range(tiers):
        share = tier / (tiers - 1)
        z = 1.3 + (height - 1.7) * share**0.9
        reach = radius * (1 - share) ** 0.8 + 0.25
        count = 9 if tier < 8 else 6
        for k in range(count):
            turn = 2 * np.pi * (k + 0.5 * (tier % 2) + random.uniform(-0.15, 0.15)) / count
            droop = -0.62 + 0.55 * share + random.uniform(-0.12, 0.12)
            along = _unit(np.array([np.cos(turn), np.sin(turn), droop]))
            aside = np.array([-np.sin(turn), np.cos(turn), 0.0])
            centres.append([0, 0, z] + along * reach * 0.5)
            ups.append(along * reach * 0.55)
            # Tilted to either side in turn: seen from the side a whorl is no line.
            tilt = 0.75 if k % 2 else -0.75
            rights.append((aside * np.cos(tilt) + np.cross(along, aside) * np.sin(tilt)) * max(reach * 0.42, 0.3))
            normals.append(_unit(np.array([np.cos(turn), np.sin(turn), 0.8])))
            lights.append(0.75 + 0.3 * share + random.uniform(-0.1, 0.1))
    colours = np.clip(np.array(leaves) * np.array(lights)[:, None], 0, 255).astype(np.uint8)
    material = leaf_material("needle")
    parts.append(_cards(np.array(centres), np.array(rights), np.array(ups), np.array(normals), colours, material))
    return model(name, parts, kind="tree", group="natural", foot=(0.5, 0.5))


def _palm(name: str, *, trunk: float = 6.2, girth: float = 0.21, fronds: int = 22, reach: float = 2.3) -> Model:
    """Make a fan of fronds on a slender, slightly bent trunk."""
    random = rng(0, "tree", name)
    bark = (128, 106, 82)
    knots = [np.array([0.25 * (k / 5) ** 2, 0, trunk * k / 5]) for k in range(6)]
    parts = [_limb(knots[k], knots[k + 1], girth - 0.012 * k, girth - 0.01 - 0.012 * k, bark, 6) for k in range(5)]
    top = knots[-1]
    material = leaf_material("frond")
    for k in range(fronds):
        turn = 2 * np.pi * k * 0.382 + random.uniform(-0.1, 0.1)
        lift = 0.9 - 1.25 * k / (fronds - 1)
        flat = np.array([np.cos(turn), np.sin(turn), 0.0])
        aside = np.array([-np.sin(turn), np.cos(turn), 0.0]) * 0.42
        spine = [top + reach * (flat * t + [0, 0, 0.91 * (lift * t - 0.95 * t * t)]) for t in np.linspace(0, 1, 4)]
        points, uv = [], []
        for t, p in zip(np.linspace(0, 1, 4), spine, strict=True):
            points += [p - aside, p + aside]
            uv += [(0, t), (1, t)]
        faces = [face for s in range(3) for face in ((2 * s, 2 * s + 1, 2 * s + 3), (2 * s, 2 * s + 3, 2 * s + 2))]
        tone = 0.7 + 0.25 * lift
        colour = (int(112 * tone), int(150 * tone), int(72 * tone))
        normals = np.tile(_unit(flat * 0.4 + [0, 0, 1]), (8, 1))
        parts.append(
            Surface.from_triangles(
                np.array(points), np.array(faces), colour=colour, uv=np.array(uv), normals=normals, material=material
            )
        )
    return model(name, parts, kind="tree", group="natural", foot=(0.5, 0.5))


def _bush(name: str, radii: tuple[float, float, float], leaves: Colour, cards: int, card: float) -> Model:
    random = rng(0, "bush", name)
    core = ball(
        (radii[0] * 0.8, radii[1] * 0.8, radii[2] * 0.9),
        (0, 0, radii[2] * 0.55),
        colour=(int(leaves[0] * 0.35), int(leaves[1] * 0.38), int(leaves[2] * 0.35)),
        sides=7,
        rings=4,
    )
    core = replace(core, positions=np.maximum(core.positions, np.array([-np.inf, -np.inf, 0.0], np.float32)))
    k = np.arange(cards) + 0.5
    z = 1 - 1.5 * k / cards
    turn = k * (np.pi * (3 - np.sqrt(5)))
    rim = np.sqrt(np.clip(1 - z * z, 0, 1))
    out = np.column_stack([rim * np.cos(turn), rim * np.sin(turn), z])
    # Lobes about an uneven middle, and leaves down to the ground: no ball that stands on a point.
    lobes = 1 + 0.13 * np.sin(3 * turn + random.uniform(0, 6)) + 0.09 * np.sin(5 * turn + random.uniform(0, 6))
    spread = np.column_stack([lobes, lobes, 1 + 0.16 * np.sin(2 * turn)])
    centres = np.array([0, 0, radii[2] * 0.6]) + out * radii * spread * random.uniform(0.78, 0.98, (cards, 1))
    centres[:, 2] = np.maximum(centres[:, 2], card * 0.5)
    facing = _unit(out + random.normal(0, 0.35, (cards, 3)))
    spin = _unit(np.cross(facing, random.normal(0, 1, (cards, 3))))
    light = 0.7 + 0.25 * out[:, 2] + random.uniform(-0.12, 0.12, cards)
    colours = np.clip(np.array(leaves) * light[:, None], 0, 255).astype(np.uint8)
    leafage = _cards(
        centres,
        spin * card,
        np.cross(facing, spin) * card,
        _unit(out + np.array([0, 0, 0.4])),
        colours,
        leaf_material("small"),
    )
    return model(name, [core, leafage], kind="shrub", group="natural", foot=(radii[0] * 1.5, radii[1] * 1.5))


def _willow(name: str) -> Model:
    """Make a weeping tree: curtains of thin twigs that hang from a dome nearly to the ground."""
    random = rng(0, "tree", name)
    bark = (92, 80, 66)
    height, wide = 9.5, 3.9
    fork = np.array([0.1, 0.0, 2.6])
    parts = [_limb(np.zeros(3), fork, 0.34, 0.26, bark, 7)]
    for branch in range(7):
        turn = 2 * np.pi * (branch + random.uniform(-0.2, 0.2)) / 7
        end = np.array([2.3 * np.cos(turn), 2.3 * np.sin(turn), height - 2.0 + random.uniform(-0.4, 0.4)])
        parts.append(_limb(fork, end, 0.15, 0.04, bark, 4))
    cards = 120
    k = np.arange(cards) + 0.5
    around = k * (np.pi * (3 - np.sqrt(5)))
    share = np.sqrt(k / cards)
    radius = wide * share * random.uniform(0.92, 1.05, cards)
    top = height - 0.4 - (height * 0.3) * share**3
    long = np.where(share > 0.62, random.uniform(2.0, 3.1, cards), random.uniform(0.9, 1.5, cards))
    out = np.column_stack([np.cos(around), np.sin(around), np.zeros(cards)])
    centres = out * radius[:, None]
    centres[:, 2] = top - long
    aside = np.column_stack([-np.sin(around), np.cos(around), np.zeros(cards)])
    lean = aside + out * random.normal(0, 0.6, (cards, 1))
    light = random.uniform(0.72, 1.0, cards)[:, None] * np.where(share > 0.62, 1.0, 0.85)[:, None]
    colours = np.clip(np.array((150, 176, 88)) * light, 0, 255).astype(np.uint8)
    normals = _unit(out * 0.8 + np.array([0, 0, 0.5]))
    up = out * -0.1 + np.array([0, 0, 1.0])
    leafage = _cards(centres, _unit(lean) * 0.62, up * long[:, None], normals, colours, leaf_material("small"))
    parts.append(leafage)
    return model(name, parts, kind="tree", group="natural", foot=(0.75, 0.75))


def _hedge(name: str, length: float, width: float, height: float, *, kind: str = "hedge") -> Model:
    """Make a clipped hedge along x; its core reaches below the ground, so that it closes on slopes too."""
    random = rng(0, name)
    deep = 0.4
    core = box((length, width * 0.9, height * 0.95 + deep), (0, 0, (height * 0.95 - deep) / 2), colour=(44, 66, 34))
    # Rows of cards on both sides and the top, a little out of line.
    count = max(4, round(4 * length))
    columns = (np.arange(count) + 0.5) / count * length - length / 2
    levels = np.linspace(0.2, height - 0.18, max(2, round(height / 0.42)))
    rows = [(side, z) for side in (-1, 1) for z in levels] + [(0, height)] * max(1, round(width / 0.6))
    x = np.concatenate([columns for _ in rows]) + random.uniform(-0.08, 0.08, count * len(rows))
    side = np.repeat([row[0] for row in rows], count).astype(np.float64)
    z = np.repeat([row[1] for row in rows], count) + random.uniform(-0.06, 0.06, count * len(rows))
    cards = len(x)
    y = np.where(side == 0, random.uniform(-0.3, 0.3, cards) * width, side * width / 2)
    out = np.column_stack([np.zeros(cards), side, np.where(side == 0, 1.0, 0.0)])
    facing = _unit(out + random.normal(0, 0.22, (cards, 3)))
    spin = _unit(np.cross(facing, random.normal(0, 1, (cards, 3))))
    colours = np.clip(
        np.array((98, 140, 66)) * random.uniform(0.65, 1.0, (cards, 1)) * (0.7 + 0.3 * z / height)[:, None], 0, 255
    ).astype(np.uint8)
    leafage = _cards(
        np.column_stack([x, y, z]),
        spin * 0.27,
        np.cross(facing, spin) * 0.27,
        _unit(out + np.array([0, 0, 0.4])),
        colours,
        leaf_material("small"),
    )
    return model(name, [core, leafage], kind=kind, group="natural", foot=(length, width))


def _flowers(name: str, tones: tuple[Colour, ...]) -> Model:
    """Make a patch of a flower bed: low leaves, and blossoms over them."""
    random = rng(0, "flowers", name)
    half = 0.55
    soil = box((2 * half, 2 * half, 0.16), (0, 0, -0.05), colour=(84, 66, 50))
    parts = [soil]
    for lot, (count, size, low, high) in enumerate(((34, 0.15, 0.1, 0.24), (44, 0.09, 0.24, 0.38))):
        xy = random.uniform(-half + 0.06, half - 0.06, (count, 2))
        centres = np.column_stack([xy, random.uniform(low, high, count)])
        facing = _unit(random.normal(0, 0.6, (count, 3)) + np.array([0.0, 0.0, 1.0]))
        spin = _unit(np.cross(facing, random.normal(0, 1, (count, 3))))
        palette = np.array([(104, 146, 70)] if lot == 0 else tones)
        colours = palette[random.integers(0, len(palette), count)] * random.uniform(0.85, 1.0, (count, 1))
        normals = _unit(facing + np.array([0, 0, 0.8]))
        parts.append(
            _cards(centres, spin * size, np.cross(facing, spin) * size, normals, colours.astype(np.uint8),
                   leaf_material("broad"))
        )  # fmt: skip
    return model(name, parts, kind="flowers", group="natural", foot=(2 * half, 2 * half))


def _rock(name: str, radii: tuple[float, float, float], tone: Colour) -> Model:
    """Make a boulder with flat faces, sunk into the ground a little."""
    random = rng(0, "rock", name)
    round_one = ball(radii, (0, 0, radii[2] * 0.4), colour=tone, sides=8, rings=6)
    lumps = round_one.positions.astype(np.float64)
    # Points at one place move alike, or the stone would burst.
    _, where = np.unique(np.round(lumps, 4), axis=0, return_inverse=True)
    lumps = lumps * (1 + random.uniform(-0.16, 0.12, (int(where.max()) + 1, 1)))[where.ravel()]
    lumps[:, 2] = np.maximum(lumps[:, 2], -0.1)
    stone = Surface.from_triangles(lumps, round_one.triangles, colour=tone)
    return model(name, [stone], kind="stone", group="natural", foot=(radii[0] * 1.8, radii[1] * 1.8))


def _stump(name: str) -> Model:
    parts = [
        _limb(np.zeros(3), np.array([0, 0, 0.45]), 0.34, 0.26, (92, 74, 58), 9),
        box((0.36, 0.36, 0.02), (0, 0, 0.44), colour=(196, 164, 116)),
    ]
    return model(name, parts, kind="stump", group="natural", foot=(0.6, 0.6))


def plant_models() -> list[Model]:
    """Every plant and stone of the streets."""
    return [
        _crown_tree("tree_lime", height=11.0, crown=(3.0, 4.0), trunk=_Trunk(2.6, 0.22, (88, 74, 60)),
                    leaves=_Leafage((116, 156, 74), "broad", 0.85)),
        _crown_tree("tree_lime_tall", height=14.5, crown=(3.1, 5.6), trunk=_Trunk(3.0, 0.26, (84, 72, 60)),
                    leaves=_Leafage((108, 150, 70), "broad", 0.95, 112)),
        _crown_tree("tree_maple", height=9.5, crown=(3.4, 3.3), trunk=_Trunk(2.4, 0.2, (96, 84, 72)),
                    leaves=_Leafage((132, 160, 66), "broad", 0.9)),
        _crown_tree("tree_oak", height=12.5, crown=(4.3, 4.2), trunk=_Trunk(2.8, 0.3, (78, 66, 54)),
                    leaves=_Leafage((98, 138, 62), "broad", 1.1)),
        _crown_tree("tree_chestnut", height=13.0, crown=(4.0, 4.8), trunk=_Trunk(2.4, 0.32, (86, 70, 60)),
                    leaves=_Leafage((92, 130, 56), "broad", 1.15)),
        _crown_tree("tree_plane", height=14.0, crown=(4.7, 4.6), trunk=_Trunk(3.8, 0.32, (184, 176, 152)),
                    leaves=_Leafage((126, 158, 80), "broad", 1.15)),
        _crown_tree("tree_pollard", height=5.6, crown=(1.8, 1.2), trunk=_Trunk(2.9, 0.2, (164, 154, 132)),
                    leaves=_Leafage((118, 156, 72), "broad", 0.62, 80)),
        _crown_tree("tree_birch", height=10.0, crown=(2.0, 4.0), trunk=_Trunk(2.2, 0.14, (214, 210, 200)),
                    leaves=_Leafage((146, 176, 84), "small", 0.75)),
        _crown_tree("tree_poplar", height=17.0, crown=(1.5, 7.7), trunk=_Trunk(1.0, 0.26, (104, 94, 78)),
                    leaves=_Leafage((112, 150, 72), "small", 0.95, 118)),
        _crown_tree("tree_young", height=5.6, crown=(1.4, 1.9), trunk=_Trunk(1.9, 0.09, (102, 88, 72)),
                    leaves=_Leafage((128, 166, 78), "small", 0.52, 72)),
        _crown_tree("tree_fruit", height=4.6, crown=(2.0, 1.6), trunk=_Trunk(1.1, 0.12, (98, 82, 66)),
                    leaves=_Leafage((124, 158, 72), "small", 0.58, 84)),
        _crown_tree("tree_blossom", height=5.0, crown=(2.1, 1.7), trunk=_Trunk(1.4, 0.11, (86, 66, 60)),
                    leaves=_Leafage((255, 186, 250), "small", 0.6, 84)),
        _crown_tree("tree_olive", height=5.2, crown=(2.2, 1.8), trunk=_Trunk(1.2, 0.24, (128, 118, 102)),
                    leaves=_Leafage((148, 160, 122), "small", 0.62, 84)),
        _crown_tree("tree_cypress", height=12.0, crown=(0.95, 5.8), trunk=_Trunk(0.2, 0.16, (96, 80, 64)),
                    leaves=_Leafage((66, 98, 58), "small", 0.62, 110)),
        _crown_tree("tree_stone_pine", height=12.0, crown=(4.2, 1.6), trunk=_Trunk(7.2, 0.26, (128, 92, 70)),
                    leaves=_Leafage((88, 128, 66), "needle", 1.0, 112)),
        _crown_tree("tree_pine", height=15.0, crown=(2.5, 3.9), trunk=_Trunk(5.6, 0.22, (158, 106, 72)),
                    leaves=_Leafage((92, 128, 78), "needle", 0.95, 105)),
        _willow("tree_willow"),
        _conifer("tree_spruce", height=11.5, radius=2.5, leaves=(74, 112, 66)),
        _conifer("tree_fir", height=17.0, radius=2.7, leaves=(64, 102, 70)),
        _conifer("tree_larch", height=14.0, radius=2.4, leaves=(132, 164, 88)),
        _palm("tree_palm"),
        _palm("tree_palm_tall", trunk=11.5, girth=0.19, fronds=18, reach=1.8),
        _palm("tree_palm_date", trunk=4.2, girth=0.34, fronds=26, reach=3.0),
        _bush("shrub", (0.75, 0.75, 0.65), (112, 152, 74), 50, 0.3),
        _bush("shrub_tall", (0.9, 0.9, 1.1), (98, 136, 70), 64, 0.36),
        _bush("shrub_flowering", (0.8, 0.8, 0.75), (206, 130, 196), 56, 0.3),
        _hedge("hedge", 2.0, 0.7, 1.2),
        _hedge("hedge_low", 2.0, 0.5, 0.6),
        _hedge("hedge_high", 2.0, 0.9, 2.0),
        _hedge("hedge_block", 1.0, 1.0, 1.2),
        _flowers("flowers", ((206, 52, 60), (240, 206, 80), (236, 232, 224))),
        _flowers("flowers_violet", ((128, 84, 168), (206, 120, 180), (236, 232, 240))),
        _flowers("flowers_yellow", ((246, 200, 50), (240, 150, 50), (226, 90, 60))),
        _rock("stone", (0.62, 0.5, 0.42), (136, 132, 126)),
        _rock("rock", (1.3, 1.0, 0.95), (124, 120, 112)),
        _stump("stump"),
    ]  # fmt: skip
