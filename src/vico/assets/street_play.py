"""Equipment of playgrounds and pitches."""

from __future__ import annotations

import math

from vico.assets.model import Model, model
from vico.assets.shapes import Colour, ball, box, cylinder, extrusion, lathe, pose_matrix
from vico.assets.street_parts import BLACK, BLUE, RED, STEEL, WHITE, WOOD, YELLOW, plate, post, ring, tube
from vico.world.mesh import Surface

_SAND: Colour = (214, 194, 150)


def _springy() -> Model:
    parts = [
        cylinder(0.3, 0.04, sides=10, colour=BLACK),
        *[ring((0, 0, 0.1 + 0.09 * k), 0.11, 0.03, STEEL, axis="z", sides=8) for k in range(4)],
        ball((0.46, 0.16, 0.22), (0, 0, 0.62), colour=RED, sides=9, rings=6),
        ball((0.17, 0.13, 0.17), (0.44, 0, 0.9), colour=RED, sides=8, rings=5),
        box((0.04, 0.5, 0.04), (0.3, 0, 0.86), colour=YELLOW),
        box((0.04, 0.5, 0.04), (0.1, 0, 0.42), colour=YELLOW),
        box((0.05, 0.2, 0.3), (-0.36, 0, 0.86), colour=YELLOW),
    ]
    return model("springy", parts, kind="playground")


def _climbing_frame() -> Model:
    """A dome of bars."""
    radius, rows, sides = 1.5, ((0.0, 1.0), (0.75, 0.87), (1.25, 0.5)), 7
    knots = [
        [
            (
                radius * share * math.cos(2 * math.pi * (k + 0.5 * j) / sides),
                radius * share * math.sin(2 * math.pi * (k + 0.5 * j) / sides),
                z,
            )
            for k in range(sides)
        ]
        for j, (z, share) in enumerate(rows)
    ]
    parts: list[Surface] = []
    for j, (row, tone) in enumerate(zip(knots, (BLUE, RED, YELLOW), strict=True)):
        for k in range(sides):
            if j:
                parts.append(tube(row[k], row[(k + 1) % sides], 0.025, tone, sides=3))
                parts.append(tube(knots[j - 1][k], row[k], 0.025, tone, sides=3))
                parts.append(tube(knots[j - 1][(k + 1) % sides], row[k], 0.025, tone, sides=3))
    return model("climbing_frame", parts, kind="playground")


def _seesaw() -> Model:
    parts = [
        extrusion([(-0.3, 0), (0.3, 0), (0.06, 0.55), (-0.06, 0.55)], 0.3, colour=BLUE),
        tube((-1.5, 0, 0.34), (1.5, 0, 0.78), 0.08, YELLOW),
    ]
    for x, z in ((-1.35, 0.4), (1.35, 0.8)):
        parts += [
            box((0.36, 0.26, 0.05), (x, 0, z + 0.08), colour=RED),
            tube((x * 0.82, 0, z), (x * 0.82, 0, z + 0.4), 0.02, BLACK),
            tube((x * 0.82, -0.2, z + 0.4), (x * 0.82, 0.2, z + 0.4), 0.02, BLACK),
        ]
    return model("seesaw", parts, kind="playground")


def _sandpit() -> Model:
    parts = [
        box((2.6, 2.6, 0.08), (0, 0, 0.06), colour=_SAND),
        *[box((0.2, 3.0, 0.3), (x, 0, 0.15), colour=WOOD) for x in (-1.4, 1.4)],
        *[box((3.0, 0.2, 0.3), (0, y, 0.15), colour=WOOD) for y in (-1.4, 1.4)],
        ball((0.5, 0.4, 0.24), (0.4, -0.3, 0.1), colour=(206, 184, 140), sides=8, rings=4),
        cylinder(0.1, 0.18, top=0.13, sides=8, colour=RED, centre=(-0.5, 0.4, 0.1)),
    ]
    return model("sandpit", parts, kind="playground")


def _roundabout() -> Model:
    parts = [
        cylinder(0.95, 0.08, sides=14, colour=BLUE, centre=(0, 0, 0.14)),
        cylinder(0.16, 0.14, sides=8, colour=BLACK),
        post(0.8, 0.06, STEEL),
    ]
    for k in range(5):
        turn = 2 * math.pi * k / 5
        x, y = 0.8 * math.cos(turn), 0.8 * math.sin(turn)
        parts += [tube((x, y, 0.2), (x, y, 0.85), 0.025, YELLOW), tube((x, y, 0.85), (0, 0, 0.8), 0.025, YELLOW)]
    return model("roundabout", parts, kind="playground")


def _tower() -> Model:
    """A play tower with a roof, a slide, a climbing wall and a bridge of bars."""
    parts = [
        box((1.3, 1.3, 0.1), (-0.6, 0, 1.25), colour=WOOD),
        *[box((0.1, 0.1, 2.3), (x, y, 1.15), colour=WOOD) for x in (-1.2, 0.0) for y in (-0.6, 0.6)],
        lathe([(1.05, 2.3), (0.0, 3.1)], sides=4, colour=RED, smooth=False).moved(pose_matrix(-0.6, 0, 0, math.pi / 4)),
        extrusion([(0.0, 1.28), (2.2, 0.28), (2.2, 0.36), (0.0, 1.36)], 0.5, colour=YELLOW),
        *[
            extrusion([(0.0, 1.3), (2.2, 0.3), (2.2, 0.52), (0.0, 1.54)], 0.05, colour=YELLOW).moved(
                pose_matrix(0, y, 0)
            )
            for y in (-0.27, 0.27)
        ],
        *[box((1.1, 0.05, 0.5), (-0.6, y, 1.55), colour=BLUE) for y in (-0.6, 0.6)],
        *[tube((-1.25, y, 0), (-1.25, y, 1.3), 0.03, STEEL) for y in (-0.3, 0.3)],
        *[tube((-1.25, -0.3, 0.3 * k + 0.2), (-1.25, 0.3, 0.3 * k + 0.2), 0.02, STEEL) for k in range(4)],
    ]
    return model("play_tower", parts, kind="playground")


def _sports() -> list[Model]:
    basket = [
        post(3.3, 0.07, STEEL, x=-0.7),
        tube((-0.7, 0, 3.0), (0.0, 0, 3.2), 0.05, STEEL),
        box((0.04, 1.5, 1.0), (0, 0, 3.2), colour=WHITE),
        box((0.044, 0.5, 0.38), (0.002, 0, 3.1), colour=RED),
        box((0.048, 0.42, 0.3), (0.003, 0, 3.1), colour=WHITE),
        ring((0.28, 0, 3.05), 0.24, 0.03, (230, 100, 40), axis="z", sides=10),
        lathe([(0.12, 2.65), (0.22, 3.05)], sides=8, colour=WHITE, centre=(0.28, 0, 0)),
    ]
    goal = [
        *[tube((0, y, 0), (0, y, 2.0), 0.05, WHITE) for y in (-1.5, 1.5)],
        tube((0, -1.5, 2.0), (0, 1.5, 2.0), 0.05, WHITE),
        *[tube((0, y, 2.0), (-0.9, y, 0), 0.025, STEEL) for y in (-1.5, 1.5)],
        tube((-0.9, -1.5, 0.02), (-0.9, 1.5, 0.02), 0.025, STEEL),
        *[tube((0, -1.5 + 0.3 * k, 2.0), (-0.9, -1.5 + 0.3 * k, 0), 0.008, (214, 216, 214), sides=3)
          for k in range(11)],
        *[tube((-0.18 * k, -1.5, 2 - 0.4 * k), (-0.18 * k, 1.5, 2 - 0.4 * k), 0.008, (214, 216, 214), sides=3)
          for k in range(1, 5)],
    ]  # fmt: skip
    fitness = [
        *[tube((0, y, 0), (0, y, 2.3), 0.05, (70, 76, 80)) for y in (-1.1, 0.0, 1.1)],
        tube((0, -1.1, 2.3), (0, 0.0, 2.3), 0.025, YELLOW),
        tube((0, 0.0, 1.9), (0, 1.1, 1.9), 0.025, YELLOW),
        *[tube((0.7, y, 0), (0.7, y, 1.2), 0.04, (70, 76, 80)) for y in (-0.9, -0.4)],
        *[tube((-0.1, y, 1.2), (0.7, y, 1.2), 0.025, YELLOW) for y in (-0.9, -0.4)],
        box((1.1, 0.36, 0.06), (0.5, 0.7, 0.45), colour=(70, 76, 80)),
        *[tube((x, 0.7, 0), (x, 0.7, 0.45), 0.04, YELLOW) for x in (0.1, 0.9)],
    ]
    chess = [
        box((0.8, 0.8, 0.1), (0, 0, 0.75), colour=(150, 148, 144)),
        post(0.7, 0.09, (150, 148, 144)),
        *[box((0.07, 0.07, 0.01), (-0.28 + 0.08 * i, -0.28 + 0.08 * j, 0.803), colour=BLACK)
          for i in range(8) for j in range(8) if (i + j) % 4 == 0],
        *[cylinder(0.2, 0.45, sides=7, colour=(150, 148, 144), centre=(x, 0, 0)) for x in (-0.8, 0.8)],
    ]  # fmt: skip
    return [
        model("basketball_hoop", basket, kind="playground", foot=(0.6, 0.6)),
        model("goal", goal, kind="playground"),
        model("fitness_station", fitness, kind="playground"),
        model("chess_table", chess, kind="picnic_table"),
    ]


def _panel_swing() -> Model:
    """A nest swing."""
    parts = [tube((0, -1.5, 2.3), (0, 1.5, 2.3), 0.06, RED)]
    for y in (-1.5, 1.5):
        parts += [tube((0.9 * s, y * 1.1, 0), (0, y, 2.3), 0.05, BLUE) for s in (-1, 1)]
    parts += [ring((0, 0, 0.55), 0.55, 0.1, (40, 44, 48), axis="z", sides=12)]
    parts += [tube((0.35 * a, 0.35 * b, 0.55), (0, 0.6 * b, 2.3), 0.012, STEEL, sides=3) for a in (-1, 1)
              for b in (-1, 1)]  # fmt: skip
    parts.append(plate([(-0.01, 0), (0.01, 0), (0.01, 0.02), (-0.01, 0.02)], 0.9, BLACK, 0, 0, 0.54))
    return model("swing_nest", parts, kind="playground")


def play_models() -> list[Model]:
    """Everything children and players use."""
    return [_springy(), _climbing_frame(), _seesaw(), _sandpit(), _roundabout(), _tower(), *_sports(), _panel_swing()]
