"""What squares and pavements are furnished with: monuments, fountains, stalls, boxes, counters, seats."""

from __future__ import annotations

import itertools
import math

import numpy as np

from vico.assets.model import Model, Top, model
from vico.assets.shapes import Colour, ball, box, cylinder, extrusion, lathe, pose_matrix
from vico.assets.street_parts import (
    BLACK,
    BLUE,
    BRONZE,
    GLASS,
    GRANITE,
    GREEN,
    IRON,
    RED,
    STEEL,
    STONE,
    WATER,
    WHITE,
    WOOD,
    YELLOW,
    plate,
    polygon,
    post,
    tilted,
    tube,
)
from vico.world.mesh import Surface

_GOLD: Colour = (176, 150, 90)
_LAMP: Colour = (250, 240, 212)


def _figure(base: float, tone: Colour) -> list[Surface]:
    """A standing figure in a long coat, one arm out."""

    def at(x: float, y: float, z: float) -> tuple[float, float, float]:
        return x, y, base + z

    return [
        cylinder(0.36, 0.08, sides=8, colour=tone, centre=at(0, 0, 0)),
        tube(at(0.02, -0.13, 0.05), at(0.0, -0.1, 0.95), 0.12, tone, sides=6, tip=0.14),
        tube(at(0.1, 0.13, 0.05), at(0.0, 0.1, 0.95), 0.12, tone, sides=6, tip=0.14),
        lathe([(0.3, base + 0.5), (0.24, base + 1.0), (0.21, base + 1.2), (0.3, base + 1.62), (0.26, base + 1.74),
               (0.1, base + 1.82), (0.075, base + 1.9), (0, base + 1.9)], sides=9, colour=tone),
        ball((0.125, 0.11, 0.15), at(0.02, 0, 2.04), colour=tone, sides=8, rings=6),
        tube(at(0, 0.28, 1.66), at(0.12, 0.36, 1.3), 0.085, tone, sides=5, tip=0.065),
        tube(at(0.12, 0.36, 1.3), at(0.3, 0.24, 1.12), 0.065, tone, sides=5, tip=0.045),
        tube(at(0, -0.28, 1.66), at(0.26, -0.36, 1.5), 0.085, tone, sides=5, tip=0.065),
        tube(at(0.26, -0.36, 1.5), at(0.6, -0.34, 1.66), 0.065, tone, sides=5, tip=0.04),
    ]  # fmt: skip


def _pedestal(side: float, height: float, tone: Colour = GRANITE) -> list[Surface]:
    return [
        box((side * 1.5, side * 1.5, 0.58), (0, 0, -0.11), colour=STONE),
        box((side * 1.22, side * 1.22, 0.2), (0, 0, 0.28), colour=tone),
        box((side, side, height - 0.5), (0, 0, 0.36 + (height - 0.5) / 2), colour=tone),
        box((side * 1.14, side * 1.14, 0.14), (0, 0, height - 0.07), colour=STONE),
        box((0.02, side * 0.6, 0.3), (side / 2 + 0.005, 0, height * 0.55), colour=_GOLD),
    ]


def _monuments() -> list[Model]:
    bust = [
        *_pedestal(0.55, 1.45),
        lathe([(0.16, 1.45), (0.13, 1.55), (0.28, 1.75), (0.26, 1.86), (0.1, 1.94), (0.08, 2.02), (0, 2.02)], sides=9,
              colour=BRONZE),
        ball((0.14, 0.12, 0.17), (0.02, 0, 2.16), colour=BRONZE, sides=8, rings=6),
        box((0.05, 0.04, 0.05), (0.15, 0, 2.15), colour=BRONZE),
    ]  # fmt: skip
    cross = [
        box((0.8, 0.8, 0.25), (0, 0, 0.125), colour=STONE),
        box((0.55, 0.55, 0.5), (0, 0, 0.5), colour=GRANITE),
        box((0.16, 0.2, 2.3), (0, 0, 1.9), colour=WOOD),
        box((0.16, 1.2, 0.18), (0, 0, 2.4), colour=WOOD),
        box((0.05, 0.1, 0.7), (0.1, 0, 2.05), colour=_GOLD),
        box((0.05, 0.7, 0.07), (0.1, 0, 2.36), colour=_GOLD),
        ball((0.07, 0.06, 0.08), (0.11, 0, 2.47), colour=_GOLD, sides=6, rings=4),
        *[box((0.5, 0.06, 0.03), (0.12, 0.36 * s, 3.0), colour=IRON) for s in (-1, 1)],
    ]
    tomb = [
        box((1.9, 0.95, 0.22), (0, 0, 0.11), colour=STONE),
        box((1.5, 0.7, 0.12), (0.1, 0, 0.26), colour=GRANITE),
        box((0.16, 0.8, 1.1), (-0.85, 0, 0.6), colour=GRANITE),
        box((0.02, 0.5, 0.4), (-0.76, 0, 0.8), colour=_GOLD),
    ]
    stone = [
        lathe([(0.3, -0.1), (0.28, 0.7), (0.2, 0.95), (0.08, 1.04), (0, 1.05)], sides=7, colour=GRANITE),
        box((0.02, 0.24, 0.2), (0.27, 0, 0.55), colour=(214, 210, 198)),
    ]
    memorial = [
        box((1.2, 2.0, 0.14), (0, 0, 0.07), colour=STONE),
        box((0.9, 1.6, 0.14), (-0.06, 0, 0.21), colour=GRANITE),
        extrusion([(-0.3, 0.28), (0.2, 0.28), (0.08, 2.1), (-0.26, 2.25)], 1.2, colour=(112, 106, 102)),
        *[box((0.02, 0.72 - 0.1 * (k % 2), 0.05), (0.17 - 0.0125 * k, 0, 1.7 - 0.13 * k), colour=_GOLD)
          for k in range(5)],
        lathe([(0.2, 0.28), (0.26, 0.34), (0.16, 0.44), (0, 0.44)], sides=9, colour=GREEN, centre=(0.36, 0, 0)),
        ball((0.1, 0.1, 0.06), (0.36, 0, 0.46), colour=RED, sides=6, rings=4),
    ]  # fmt: skip
    column = [
        *_pedestal(1.6, 2.2),
        lathe([(0.62, 2.2), (0.62, 2.4), (0.5, 2.5), (0.42, 7.6), (0.6, 7.9), (0.6, 8.1), (0, 8.1)], sides=12,
              colour=(176, 170, 158)),
        lathe([(0.3, 8.1), (0.22, 9.1), (0.3, 9.6), (0.1, 9.8), (0.0, 9.8)], sides=8, colour=BRONZE),
        ball((0.13, 0.12, 0.16), (0, 0, 10.0), colour=BRONZE, sides=8, rings=5),
    ]  # fmt: skip
    turn = np.linspace(0, 1.6 * np.pi, 10)
    path = [(0.55 * math.cos(t), 0.42 * math.sin(t), 1.5 + 0.9 * math.sin(t * 0.9 + 0.6)) for t in turn]
    loop = [*_pedestal(0.9, 0.7)]
    loop += [tube(a, b, 0.14, (176, 96, 52), sides=7) for a, b in itertools.pairwise(path)]
    loop += [ball((0.145, 0.145, 0.145), p, colour=(176, 96, 52), sides=6, rings=4) for p in (path[0], path[-1])]
    blocks = [*_pedestal(1.0, 0.6)]
    tones: tuple[Colour, ...] = ((186, 60, 48), (224, 176, 52), (50, 96, 150), (220, 220, 214))
    for k, tone in enumerate(tones):
        blocks.append(box((0.62 - 0.06 * k, 0.62 - 0.06 * k, 0.62), (0.05 * (-1) ** k, 0.06 * k - 0.1, 0.9 + 0.58 * k),
                          colour=tone, yaw=0.5 * k))  # fmt: skip
    return [
        model("statue", [*_pedestal(1.0, 1.6), *_figure(1.6, BRONZE)], kind="artwork"),
        model("bust", bust, kind="artwork"),
        model("column", column, kind="monument"),
        model("wayside_cross", cross, kind="memorial"),
        model("tomb", tomb, kind="memorial"),
        model("boundary_stone", stone, kind="memorial"),
        model("memorial", memorial),
        model("sculpture", loop, kind="artwork"),
        model("sculpture_blocks", blocks, kind="artwork"),
    ]


def _fountains() -> list[Model]:
    jet: Colour = (206, 226, 236)
    basin = [
        box((4.4, 4.4, 0.46), (0, 0, -0.17), colour=GRANITE),
        *[box((4.4 if k % 2 else 0.3, 0.3 if k % 2 else 4.4, 0.45), xy, colour=STONE) for k, xy in
          enumerate([(2.05, 0, 0.225), (0, 2.05, 0.225), (-2.05, 0, 0.225), (0, -2.05, 0.225)])],
        box((3.8, 3.8, 0.02), (0, 0, 0.3), colour=WATER),
    ]  # fmt: skip
    for x, y, tall in ((0, 0, 1.7), (0.9, 0.9, 0.9), (-0.9, 0.9, 0.9), (0.9, -0.9, 0.9), (-0.9, -0.9, 0.9)):
        basin.append(lathe([(0.05, 0.3), (0.035, tall * 0.7), (0.11, tall), (0.16, tall * 0.8), (0.2, 0.32)], sides=6,
                           colour=jet, centre=(x, y, 0)))  # fmt: skip
    wall = [
        box((0.35, 1.5, 1.9), (-0.3, 0, 0.95), colour=STONE),
        box((0.45, 1.7, 0.14), (-0.3, 0, 1.95), colour=GRANITE),
        box((0.8, 1.2, 0.55), (0.25, 0, 0.275), colour=STONE),
        box((0.62, 1.0, 0.02), (0.27, 0, 0.555), colour=WATER),
        tube((-0.13, 0, 1.1), (0.16, 0, 1.05), 0.03, BRONZE),
        tube((0.16, 0, 1.05), (0.22, 0, 0.56), 0.02, jet),
    ]
    trough = [
        box((0.9, 2.4, 0.7), (0, 0, 0.35), colour=GRANITE),
        box((0.66, 2.1, 0.02), (0, 0, 0.70), colour=WATER),
        *[box((0.12, 2.4, 0.08), (x, 0, 0.73), colour=STONE) for x in (-0.39, 0.39)],
        *[box((0.9, 0.14, 0.08), (0, y, 0.73), colour=STONE) for y in (-1.13, 1.13)],
        box((0.34, 0.34, 1.7), (-0.6, 0, 0.85), colour=GRANITE),
        cylinder(0.24, 0.2, top=0.02, sides=4, colour=STONE, centre=(-0.6, 0, 1.7)),
        tube((-0.45, 0, 1.25), (-0.08, 0, 1.15), 0.025, IRON),
        tube((-0.08, 0, 1.15), (-0.05, 0, 0.71), 0.018, jet),
    ]
    pump = [
        lathe([(0.2, 0), (0.2, 0.1), (0.1, 0.14), (0.09, 1.1), (0.14, 1.16), (0.1, 1.3), (0, 1.42)], sides=8,
              colour=GREEN),
        tube((0.06, 0, 0.86), (0.34, 0, 0.8), 0.035, GREEN, sides=6),
        tube((-0.05, 0, 1.22), (-0.55, 0, 0.9), 0.025, IRON),
        box((0.4, 0.4, 0.2), (0.36, 0, 0.1), colour=STONE),
        box((0.3, 0.3, 0.01), (0.36, 0, 0.205), colour=(60, 76, 84)),
    ]  # fmt: skip
    return [
        model("fountain_jets", basin, kind="fountain"),
        model("fountain_wall", wall, kind="fountain"),
        model("fountain_trough", trough, kind="fountain"),
        model("water_pump", pump, kind="drinking_water"),
    ]


def _stripes(x: float, tones: tuple[Colour, Colour], wide: float, z: float) -> list[Surface]:
    """A sloping striped awning over a counter that faces +x."""
    count = 6
    return [
        extrusion([(x - 1.1, z + 0.55), (x, z), (x, z + 0.04), (x - 1.1, z + 0.59)], wide / count,
                  colour=tones[k % 2]).moved(pose_matrix(0, (k + 0.5) * wide / count - wide / 2, 0))
        for k in range(count)
    ]  # fmt: skip


def _stalls() -> list[Model]:
    found = []
    for name, tones in (("market_stall", ((190, 52, 46), WHITE)), ("market_stall_green", ((52, 110, 70), WHITE))):
        goods: tuple[Colour, ...] = ((206, 60, 44), (232, 150, 40), (110, 150, 60), (230, 206, 90), (150, 60, 90))
        parts = [
            box((0.9, 2.6, 0.06), (0.2, 0, 0.86), colour=WOOD),
            box((0.04, 2.6, 0.8), (0.63, 0, 0.44), colour=(214, 206, 190)),
            *[tube((x, y, 0), (x, y, 2.5 if x < 0 else 2.1), 0.025, STEEL) for x in (-0.7, 0.9) for y in (-1.3, 1.3)],
            *_stripes(1.1, tones, 2.8, 2.08),
            *[extrusion([(-1.0, 2.1), (0.1, 2.63), (0.1, 2.67), (-1.0, 2.14)], 2.8, colour=tones[0])],
        ]
        for k, tone in enumerate(goods):
            y = -1.0 + 0.5 * k
            parts.append(box((0.6, 0.42, 0.12), (0.25, y, 0.95), colour=(170, 132, 88)))
            parts.append(ball((0.26, 0.19, 0.1), (0.25, y, 1.01), colour=tone, sides=5, rings=4))
        found.append(model(name, parts, kind="market_stall", top=Top("table", 0.89, (0.5, 2.4))))
    canvas: Colour = (226, 222, 208)
    party = [*[tube((x, y, 0), (x, y, 2.3), 0.03, STEEL) for x in (-1.5, 1.5) for y in (-1.5, 1.5)]]
    party.append(cylinder(2.2, 1.1, top=0.05, sides=4, colour=canvas).moved(pose_matrix(0, 0, 2.3, math.pi / 4)))
    party += [box((3.06, 0.03, 0.3), (0, y, 2.18), colour=canvas) for y in (-1.53, 1.53)]
    party += [box((0.03, 3.06, 0.3), (x, 0, 2.18), colour=canvas) for x in (-1.53, 1.53)]
    party += [box((0.02, 3.0, 1.9), (-1.5, 0, 1.1), colour=canvas)]
    camp = [
        extrusion([(-1.2, 0), (1.2, 0), (0, 1.5)], 2.4, colour=(206, 120, 54)).moved(pose_matrix(yaw=math.pi / 2)),
        plate([(-0.55, 0.02), (0.55, 0.02), (0, 1.2)], 0.02, (90, 60, 40), 1.205, 0, 0),
        *[tube((1.2 * sx, 0, 1.5), (2.1 * sx, 0, 0), 0.01, WHITE, sides=3) for sx in (-1, 1)],
    ]
    table = [
        post(0.72, 0.035, IRON),
        cylinder(0.26, 0.03, sides=8, colour=IRON),
        cylinder(0.42, 0.03, sides=12, colour=(196, 186, 168), centre=(0, 0, 0.72)),
    ]
    for turn in (0.5, 2.6, 4.5):
        c, s = math.cos(turn), math.sin(turn)
        table += [
            box((0.42, 0.42, 0.04), (0.72 * c, 0.72 * s, 0.45), colour=WOOD, yaw=turn),
            box((0.04, 0.42, 0.4), (0.92 * c, 0.92 * s, 0.68), colour=WOOD, yaw=turn),
        ]
        for a in (-0.18, 0.18):
            for b in (-0.18, 0.18):
                x, y = 0.72 * c + a * c - b * s, 0.72 * s + a * s + b * c
                table.append(tube((x, y, 0), (x, y, 0.45), 0.018, IRON, sides=3))
    shade: Colour = (196, 70, 56)
    parasol = [
        tube((0, 0, 0.75), (0, 0, 2.6), 0.022, WOOD),
        lathe([(1.35, 2.12), (0.7, 2.42), (0.0, 2.66)], sides=8, colour=shade, smooth=False),
        lathe([(0.0, 2.58), (1.33, 2.10)], sides=8, colour=(150, 60, 50)),
    ]
    return [
        *found,
        model("tent", party),
        model("tent_small", camp, kind="tent"),
        model("cafe_table", table, kind="table", top=Top("table", 0.75, (0.6, 0.6))),
        model("cafe_parasol", [*table, *parasol], kind="table", top=Top("table", 0.75, (0.6, 0.6))),
    ]


def _kiosk() -> Model:
    """A kiosk with a counter, magazines and a broad roof."""
    wall: Colour = (178, 196, 184)
    parts = [
        box((2.2, 2.9, 0.6), (0, 0, -0.1), colour=GRANITE),
        box((2.1, 2.8, 2.2), (0, 0, 1.2), colour=wall),
        box((2.8, 3.5, 0.1), (0.1, 0, 2.42), colour=GREEN),
        box((2.2, 2.9, 0.24), (0, 0, 2.34), colour=GREEN),
        box((1.3, 1.9, 0.26), (0, 0, 2.6), colour=GREEN),
        box((0.04, 1.9, 0.95), (1.04, 0, 1.6), colour=(54, 66, 72)),
        box((0.45, 2.1, 0.05), (1.22, 0, 1.08), colour=WOOD),
        box((0.05, 2.5, 0.32), (1.5, 0, 2.27), colour=RED),
        box((0.056, 1.7, 0.16), (1.5, 0, 2.27), colour=WHITE),
        box((0.9, 0.04, 1.9), (-0.3, 1.41, 1.1), colour=WOOD),
        box((0.06, 0.04, 0.1), (0.05, 1.44, 1.1), colour=STEEL),
        box((1.2, 0.04, 0.9), (0, -1.41, 1.5), colour=(54, 66, 72)),
    ]
    tones: tuple[Colour, ...] = ((200, 70, 60), (60, 110, 170), (230, 190, 70), (90, 150, 90), (230, 230, 226))
    for k in range(10):
        parts.append(box((0.03, 0.26, 0.34), (1.075, -0.9 + 0.45 * (k % 5), 0.42 + 0.4 * (k // 5)),
                         colour=tones[(3 * k) % 5]))  # fmt: skip
    return model("kiosk", parts)


def _telephone() -> Model:
    """A glazed box with bars, a crown, and the telephone inside."""
    parts = [
        box((0.92, 0.92, 0.14), (0, 0, 0.07), colour=IRON),
        box((0.96, 0.96, 0.2), (0, 0, 2.3), colour=RED),
        box((0.8, 0.8, 0.1), (0, 0, 2.45), colour=RED),
        box((0.02, 0.66, 0.1), (0.485, 0, 2.3), colour=WHITE),
        box((0.1, 0.3, 0.55), (-0.36, 0, 1.3), colour=BLACK),
        box((0.06, 0.06, 0.3), (-0.3, 0.1, 1.36), colour=STEEL),
    ]
    parts += [box((0.09, 0.09, 2.1), (x, y, 1.18), colour=RED) for x in (-0.4, 0.4) for y in (-0.4, 0.4)]
    for z in (0.3, 0.85, 1.4, 1.95):
        parts += [box((0.76, 0.03, 0.05), (0, y, z), colour=RED) for y in (-0.41, 0.41)]
        parts += [box((0.03, 0.76, 0.05), (-0.41, 0, z), colour=RED)]
    parts += [box((0.76, 0.012, 1.9), (0, y, 1.15), colour=GLASS) for y in (-0.405, 0.405)]
    parts += [box((0.012, 0.76, 1.9), (-0.405, 0, 1.15), colour=GLASS)]
    return model("telephone", parts)


def _boxes() -> list[Model]:
    """Machines and containers."""
    pillar = [
        cylinder(0.24, 0.12, sides=12, colour=BLACK),
        lathe([(0.22, 0.12), (0.22, 1.36), (0.27, 1.38), (0.27, 1.46), (0.16, 1.56), (0, 1.58)], sides=12, colour=RED),
        box((0.04, 0.22, 0.05), (0.215, 0, 1.24), colour=BLACK),
        box((0.02, 0.16, 0.22), (0.22, 0, 0.95), colour=WHITE),
    ]
    blue = [
        box((0.5, 0.56, 0.95), (0, 0, 0.65), colour=(34, 62, 116)),
        *[box((0.06, 0.06, 0.2), (x, y, 0.1), colour=(34, 62, 116)) for x in (-0.2, 0.2) for y in (-0.22, 0.22)],
        cylinder(0.28, 0.5, sides=12, colour=(34, 62, 116)).moved(_lying(0, -0.25, 1.1)),
        box((0.02, 0.36, 0.06), (0.27, 0, 1.16), colour=BLACK),
        box((0.02, 0.3, 0.2), (0.255, 0, 0.8), colour=WHITE),
    ]
    glass = [
        lathe([(0.5, 0.0), (0.62, 0.3), (0.66, 0.9), (0.5, 1.4), (0.2, 1.6), (0, 1.62)], sides=12,
              colour=(60, 118, 76)),
        plate(polygon(9, 0.12), 0.06, BLACK, 0.56, 0, 1.16),
        plate(polygon(9, 0.12), 0.06, BLACK, -0.56, 0, 1.16),
        box((0.02, 0.4, 0.3), (0.655, 0, 0.66), colour=WHITE),
        box((0.1, 0.1, 0.16), (0, 0, 1.66), colour=IRON),
    ]  # fmt: skip
    bins = []
    tones: tuple[Colour, ...] = ((64, 68, 72), (44, 84, 140), (60, 110, 66))
    for k, tone in enumerate(tones):
        y = (k - 1) * 0.78
        bins += [
            extrusion([(-0.28, 0.12), (0.26, 0.06), (0.36, 0.95), (-0.36, 0.98)], 0.6, colour=(70, 74, 76)).moved(
                pose_matrix(0, y, 0)
            ),
            extrusion([(-0.42, 0.98), (0.38, 0.95), (0.34, 1.05), (-0.4, 1.1)], 0.66, colour=tone).moved(
                pose_matrix(0, y, 0)
            ),
            *[cylinder(0.1, 0.06, sides=8, colour=BLACK).moved(_lying(-0.32, y + s * 0.27 - 0.03, 0.1))
              for s in (-1, 1)],
        ]  # fmt: skip
    skip = [
        extrusion([(-0.62, 0.2), (0.62, 0.2), (0.72, 1.15), (-0.72, 1.15)], 1.36, colour=(72, 96, 84)).moved(
            pose_matrix(yaw=math.pi / 2)
        ),
        extrusion([(-0.75, 1.15), (0.75, 1.15), (0.5, 1.38), (-0.5, 1.38)], 1.42, colour=(52, 70, 62)).moved(
            pose_matrix(yaw=math.pi / 2)
        ),
        *[cylinder(0.1, 0.08, sides=7, colour=BLACK).moved(_lying(x, y, 0.1)) for x in (-0.5, 0.5)
          for y in (-0.55, 0.47)],
    ]  # fmt: skip
    dog = [
        post(1.35, 0.035, GREEN, x=-0.1),
        box((0.26, 0.3, 0.42), (0.06, 0, 0.72), colour=GREEN),
        box((0.14, 0.22, 0.24), (0.03, 0, 1.2), colour=WHITE),
        box((0.02, 0.12, 0.1), (0.105, 0, 1.22), colour=GREEN),
    ]
    grit = [
        box((0.7, 1.0, 0.6), (0, 0, 0.32), colour=YELLOW),
        extrusion([(-0.4, 0.62), (0.4, 0.62), (0.36, 0.7), (-0.3, 0.86)], 1.06, colour=(204, 156, 40)),
        box((0.02, 0.3, 0.16), (0.36, 0, 0.4), colour=BLACK),
    ]
    toilets = [
        box((2.3, 3.3, 2.9), (0, 0, 1.05), colour=(104, 122, 116)),
        box((2.6, 3.6, 0.14), (0, 0, 2.57), colour=(64, 80, 74)),
        *[box((0.03, 0.9, 2.0), (1.16, y, 1.02), colour=(70, 90, 84)) for y in (-0.8, 0.8)],
        *[box((0.05, 0.05, 0.14), (1.18, y + 0.34, 1.05), colour=STEEL) for y in (-0.8, 0.8)],
        *[box((0.04, 0.3, 0.3), (1.16, y, 2.2), colour=BLUE) for y in (-0.8, 0.8)],
        *[box((0.05, 0.08, 0.2), (1.165, y, 2.2), colour=WHITE) for y in (-0.8, 0.8)],
        *[box((0.04, 0.06, 2.4), (1.155, y, 1.2), colour=(84, 102, 96)) for y in (-1.6, 0.0, 1.6)],
    ]
    locker = [box((0.62, 2.6, 2.0), (0, 0, 1.0), colour=(70, 76, 84)), box((0.8, 2.7, 0.06), (0.06, 0, 2.05),
                                                                            colour=IRON)]  # fmt: skip
    for k in range(5):
        for j in range(3):
            locker.append(box((0.02, 0.46, 0.58), (0.315, -1.04 + 0.52 * k, 0.38 + 0.62 * j), colour=(150, 160, 168)))
            locker.append(box((0.03, 0.04, 0.08), (0.325, -0.88 + 0.52 * k, 0.38 + 0.62 * j), colour=IRON))
    cabinet = [
        box((0.42, 1.2, 0.1), (0, 0, 0.05), colour=GRANITE),
        box((0.38, 1.14, 1.1), (0, 0, 0.65), colour=(132, 138, 130)),
        extrusion([(-0.22, 1.2), (0.22, 1.2), (0.2, 1.24), (-0.2, 1.3)], 1.2, colour=(116, 122, 114)),
        box((0.01, 0.02, 1.0), (0.193, 0, 0.65), colour=BLACK),
        *[box((0.03, 0.04, 0.14), (0.2, y, 0.7), colour=BLACK) for y in (-0.06, 0.06)],
        *[box((0.01, 0.36, 0.02), (0.193, y, 0.24 + 0.05 * k), colour=(90, 96, 90)) for y in (-0.3, 0.3)
          for k in range(4)],
        plate([(-0.08, 0), (0.08, 0), (0, 0.14)], 0.01, YELLOW, 0.2, 0.3, 0.95),
    ]  # fmt: skip
    books = [
        box((0.5, 0.9, 0.08), (0, 0, 0.7), colour=WOOD),
        *[box((0.5, 0.05, 1.2), (0, y, 1.3), colour=WOOD) for y in (-0.44, 0.44)],
        box((0.04, 0.86, 1.2), (-0.22, 0, 1.3), colour=WOOD),
        extrusion([(-0.36, 1.88), (0.36, 1.88), (0, 2.1)], 1.1, colour=(120, 56, 48)),
        box((0.4, 0.86, 0.03), (0, 0, 1.28), colour=WOOD),
        *[tube((-0.1, y, 0), (-0.1, y, 0.7), 0.04, WOOD) for y in (-0.3, 0.3)],
    ]
    spines: tuple[Colour, ...] = ((170, 60, 50), (60, 90, 140), (220, 200, 150), (70, 110, 80), (110, 70, 110))
    books += [box((0.2, 0.075, 0.24 + 0.06 * (k % 3)), (0, -0.37 + 0.092 * (k % 9), 0.88 + 0.57 * (k // 9)),
                  colour=spines[(2 * k) % 5]) for k in range(18)]  # fmt: skip
    aed = [
        post(1.9, 0.04, WHITE, x=-0.08),
        box((0.2, 0.42, 0.46), (0.04, 0, 1.3), colour=(46, 140, 80)),
        box((0.02, 0.2, 0.06), (0.145, 0, 1.32), colour=WHITE),
        box((0.02, 0.06, 0.2), (0.145, 0, 1.32), colour=WHITE),
        box((0.04, 0.36, 0.36), (0, 0, 1.8), colour=(46, 140, 80)),
    ]
    grill = [
        box((0.6, 1.0, 0.75), (0, 0, 0.375), colour=(146, 92, 72)),
        box((0.7, 1.1, 0.08), (0, 0, 0.78), colour=STONE),
        box((0.45, 0.7, 0.03), (0, 0, 0.83), colour=BLACK),
    ]
    pump = [
        box((0.5, 0.9, 1.8), (0, 0, 0.98), colour=WHITE),
        box((0.6, 1.1, 0.12), (0, 0, 0.06), colour=STONE),
        box((0.51, 0.91, 0.2), (0, 0, 1.78), colour=RED),
        box((0.02, 0.5, 0.34), (0.255, 0, 1.4), colour=BLACK),
        *[tube((0.28, y, 1.0), (0.3, y + 0.1, 0.5), 0.025, BLACK) for y in (-0.3, 0.3)],
    ]
    return [
        model("post_box_pillar", pillar, kind="post_box"),
        model("post_box_blue", blue, kind="post_box"),
        model("recycling_glass", glass, kind="recycling"),
        model("bins", bins, kind="waste_disposal"),
        model("waste_container", skip, kind="waste_disposal"),
        model("dog_bin", dog, kind="waste_basket", foot=(0.4, 0.4)),
        model("grit_bin", grit),
        model("toilets", toilets),
        model("luggage_locker", locker),
        model("street_cabinet", cabinet),
        model("public_bookcase", books),
        model("defibrillator", aed, foot=(0.3, 0.4)),
        model("bbq", grill),
        model("fuel_pump", pump),
    ]


def _lying(x: float, y: float, z: float):  # type: ignore[no-untyped-def]
    """Turn the z axis to +y, then move."""
    matrix = tilted(x, y, z)
    matrix[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    return matrix


def _seats() -> list[Model]:
    block = [
        box((0.5, 1.8, 0.36), (0, 0, 0.18), colour=STONE),
        box((0.54, 1.84, 0.07), (0, 0, 0.42), colour=GRANITE),
    ]
    flat = [
        *[box((0.1, 1.7, 0.04), (x, 0, 0.44), colour=WOOD) for x in (-0.18, -0.06, 0.06, 0.18)],
        *[box((0.44, 0.07, 0.42), (0, y, 0.21), colour=IRON) for y in (-0.65, 0.65)],
    ]
    round_seat = [
        lathe([(1.0, 0.4), (1.0, 0.46), (1.0, 0.46), (0.45, 0.46), (0.45, 0.46), (0.45, 0.4)], sides=14, colour=WOOD),
        *[box((0.5, 0.06, 0.4), (0.72 * math.cos(t), 0.72 * math.sin(t), 0.2), colour=IRON, yaw=t)
          for t in np.arange(6) * math.pi / 3],
    ]  # fmt: skip
    lounger = [
        *[box((0.09, 0.62, 0.03), (-0.5 + 0.11 * k, 0, 0.36 + (0.0 if k < 7 else 0.09 * (k - 6))), colour=WOOD)
          for k in range(12)],
        *[box((1.3, 0.05, 0.06), (0.05, y, 0.32), colour=IRON) for y in (-0.28, 0.28)],
        *[tube((x, y, 0), (x, y, 0.32), 0.025, IRON) for x in (-0.45, 0.5) for y in (-0.28, 0.28)],
    ]  # fmt: skip
    return [
        model("bench_stone", block, kind="bench"),
        model("bench_flat", flat, kind="bench"),
        model("bench_round", round_seat, kind="bench"),
        model("lounger", lounger, kind="bench"),
    ]


def _lamps() -> list[Model]:
    """Further lamps: two arms, a wall of light, an old lantern, a low one."""
    dark: Colour = (44, 50, 52)
    double = [lathe([(0.15, 0), (0.15, 0.6), (0.09, 0.7), (0.06, 7.2), (0, 7.2)], sides=8, colour=(84, 90, 94))]
    for side in (-1, 1):
        double += [
            tube((0, 0, 7.0), (1.2 * side, 0, 7.2), 0.035, (84, 90, 94)),
            box((0.7, 0.26, 0.1), (1.45 * side, 0, 7.22), colour=(70, 74, 78)),
            box((0.56, 0.18, 0.03), (1.45 * side, 0, 7.165), colour=_LAMP),
        ]
    lantern = [
        lathe([(0.2, 0), (0.2, 0.12), (0.12, 0.2), (0.1, 0.9), (0.06, 1.0), (0.045, 3.4), (0.09, 3.5), (0, 3.5)],
              sides=8, colour=dark),
        box((0.04, 0.6, 0.04), (0, 0, 3.1), colour=dark),
        lathe([(0.11, 3.5), (0.2, 3.95), (0.2, 3.95), (0.0, 3.95)], sides=6, colour=_LAMP, smooth=False),
        lathe([(0.24, 3.95), (0.1, 4.14), (0.04, 4.2), (0, 4.3)], sides=6, colour=dark, smooth=False),
    ]  # fmt: skip
    low = [
        cylinder(0.09, 0.75, sides=8, colour=dark),
        cylinder(0.085, 0.18, sides=8, colour=_LAMP, centre=(0, 0, 0.75)),
        cylinder(0.1, 0.06, sides=8, colour=dark, centre=(0, 0, 0.93)),
    ]
    return [
        model("street_lamp_double", double, kind="street_lamp", foot=(0.3, 0.3)),
        model("lantern", lantern, kind="street_lamp", foot=(0.3, 0.3)),
        model("lamp_low", low, kind="bollard"),
    ]


def civic_models() -> list[Model]:
    """Furniture of squares and pavements."""
    return [
        *_monuments(), *_fountains(), *_stalls(), _kiosk(), _telephone(), *_boxes(), *_seats(), *_lamps(),
    ]  # fmt: skip
