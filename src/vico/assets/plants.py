"""Trees, shrubs and hedges: trunks, branches, and crowns of leaf cards with a generated cut-out texture."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from vico.assets.model import Model, model
from vico.assets.shapes import Colour, ball, box
from vico.world.mesh import Material, Surface
from vico.world.seeds import rng

_SIDE = 128


@cache
def leaf_material(kind: str) -> Material:
    """A cut-out texture of leaves: ``broad``, ``small``, ``needle`` or ``frond``; near white, to be tinted."""
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
    """A twig along v with side twigs, all set with needles."""
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
    """A palm leaf along v."""
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
    faces = np.array([[0, 1, 2], [0, 2, 3]])[None] + (np.arange(n) * 4)[:, None, None]
    uv = np.tile(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32), (n, 1))
    return Surface.from_triangles(
        corners.reshape(-1, 3),
        faces.reshape(-1, 3),
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
    """A tapered branch."""
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


def _crown_tree(
    name: str,
    *,
    height: float,
    crown: tuple[float, float],
    bare: float,
    trunk: float,
    bark: Colour,
    leaves: Colour,
    texture: str,
    card: float,
    cards: int = 105,
) -> Model:
    """A leafy tree: `crown` is its radius and half height, `bare` the clear height of its trunk."""
    random = rng(0, "tree", name)
    wide, tall = crown
    middle = np.array([0, 0, height - tall])
    fork = np.array([random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), bare + 0.4])
    parts = [
        _limb(np.zeros(3), fork, trunk, trunk * 0.72, bark, 7),
        _limb(fork, middle + np.array([0, 0, tall * 0.35]), trunk * 0.72, trunk * 0.2, bark),
    ]
    for k in range(5):
        turn = 2 * np.pi * (k + random.uniform(-0.2, 0.2)) / 5
        reach = wide * random.uniform(0.5, 0.7)
        end = middle + np.array([reach * np.cos(turn), reach * np.sin(turn), random.uniform(-0.25, 0.35) * tall])
        parts.append(_limb(fork + np.array([0, 0, 0.15 * k]), end, trunk * 0.42, trunk * 0.12, bark, 4))
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
    side = card * random.uniform(0.8, 1.2, cards)
    # Half of them face outwards, half at random: no view through, no visible planes.
    facing = _unit(out + random.normal(0, 0.55, (cards, 3)))
    spin = _unit(np.cross(facing, random.normal(0, 1, (cards, 3))))
    over = np.cross(facing, spin)
    normals = _unit(out * 0.85 + [0, 0, 0.35])
    light = 0.8 + 0.24 * np.clip((centres[:, 2] - middle[2]) / tall, -1, 1) + random.uniform(-0.1, 0.1, cards)
    light = np.where(inner < 0.7, light * 0.7, light)
    warm = random.uniform(-0.07, 0.07, cards)
    tint = (
        np.array(leaves) * np.clip(light, 0.25, 1.05)[:, None] * np.column_stack([1 + warm, np.ones(cards), 1 - warm])
    )
    colours = np.clip(tint, 0, 255).astype(np.uint8)
    parts.append(_cards(centres, spin * side[:, None], over * side[:, None], normals, colours, leaf_material(texture)))
    return model(name, parts, kind="tree", group="natural", foot=(2 * trunk + 0.1, 2 * trunk + 0.1))


def _conifer(name: str, *, height: float, radius: float, leaves: Colour) -> Model:
    """A spruce: whorls of drooping branches."""
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


def _palm(name: str) -> Model:
    """A fan of fronds on a slender, slightly bent trunk."""
    random = rng(0, "tree", name)
    bark = (128, 106, 82)
    knots = [np.array([0.25 * (k / 5) ** 2, 0, 6.2 * k / 5]) for k in range(6)]
    parts = [_limb(knots[k], knots[k + 1], 0.21 - 0.012 * k, 0.20 - 0.012 * k, bark, 6) for k in range(5)]
    top = knots[-1]
    material = leaf_material("frond")
    for k in range(22):
        turn = 2 * np.pi * k * 0.382 + random.uniform(-0.1, 0.1)
        lift = 0.9 - 1.25 * k / 21
        flat = np.array([np.cos(turn), np.sin(turn), 0.0])
        aside = np.array([-np.sin(turn), np.cos(turn), 0.0]) * 0.42
        spine = [top + flat * 2.3 * t + [0, 0, 2.1 * (lift * t - 0.95 * t * t)] for t in np.linspace(0, 1, 4)]
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
        (radii[0] * 0.8, radii[1] * 0.8, radii[2] * 0.85),
        (0, 0, radii[2] * 0.85),
        colour=(int(leaves[0] * 0.35), int(leaves[1] * 0.38), int(leaves[2] * 0.35)),
        sides=7,
        rings=4,
    )
    k = np.arange(cards) + 0.5
    z = 1 - 1.6 * k / cards
    turn = k * (np.pi * (3 - np.sqrt(5)))
    rim = np.sqrt(np.clip(1 - z * z, 0, 1))
    out = np.column_stack([rim * np.cos(turn), rim * np.sin(turn), z])
    centres = np.array([0, 0, radii[2] * 0.9]) + out * radii * random.uniform(0.78, 0.98, (cards, 1))
    facing = _unit(out + random.normal(0, 0.5, (cards, 3)))
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


def _hedge(length: float = 2.0, width: float = 0.7, height: float = 1.2) -> Model:
    random = rng(0, "hedge")
    core = box((length, width * 0.9, height * 0.95), (0, 0, height * 0.475), colour=(44, 66, 34))
    # Rows of cards on both sides and the top, a little out of line.
    columns = (np.arange(8) + 0.5) / 8 * length - length / 2
    rows = [(side, z) for side in (-1, 1) for z in (0.22, 0.62, 1.0)] + [(0, height)]
    x = np.concatenate([columns for _ in rows]) + random.uniform(-0.08, 0.08, 8 * len(rows))
    side = np.repeat([row[0] for row in rows], 8).astype(np.float64)
    z = np.repeat([row[1] for row in rows], 8) + random.uniform(-0.06, 0.06, 8 * len(rows))
    cards = len(x)
    y = np.where(side == 0, random.uniform(-0.2, 0.2, cards), side * width / 2)
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
    return model("hedge", [core, leafage], group="natural", foot=(length, width))


def plant_models() -> list[Model]:
    """Every plant and stone of the streets."""
    stone = ball((0.62, 0.5, 0.42), (0, 0, 0.3), colour=(128, 124, 118), sides=7, rings=4)
    return [
        _crown_tree("tree_lime", height=11.0, crown=(3.0, 4.0), bare=2.6, trunk=0.22, bark=(88, 74, 60),
                    leaves=(116, 156, 74), texture="broad", card=0.85),
        _crown_tree("tree_maple", height=9.5, crown=(3.4, 3.3), bare=2.4, trunk=0.2, bark=(96, 84, 72),
                    leaves=(132, 160, 66), texture="broad", card=0.9),
        _crown_tree("tree_oak", height=12.5, crown=(4.3, 4.2), bare=2.8, trunk=0.3, bark=(78, 66, 54),
                    leaves=(98, 138, 62), texture="broad", card=1.1),
        _crown_tree("tree_birch", height=10.0, crown=(2.0, 4.0), bare=2.2, trunk=0.14, bark=(214, 210, 200),
                    leaves=(146, 176, 84), texture="small", card=0.75),
        _crown_tree("tree_young", height=5.6, crown=(1.4, 1.9), bare=1.9, trunk=0.09, bark=(102, 88, 72),
                    leaves=(128, 166, 78), texture="small", card=0.52, cards=72),
        _conifer("tree_spruce", height=11.5, radius=2.5, leaves=(74, 112, 66)),
        _palm("tree_palm"),
        _bush("shrub", (0.75, 0.75, 0.55), (112, 152, 74), 46, 0.3),
        _bush("shrub_tall", (0.9, 0.9, 0.95), (98, 136, 70), 58, 0.36),
        _hedge(),
        model("stone", [stone], group="natural", foot=(1.1, 0.9)),
    ]  # fmt: skip
