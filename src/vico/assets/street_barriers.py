"""Fences, walls, rails and chains, in pieces of two metres along x that meet end to end.

Their posts and foundations reach below the ground, so that nothing hangs in the air on a slope.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from vico.assets.model import Model, model
from vico.assets.shapes import Colour, ball, box, extrusion, pose_matrix
from vico.assets.street_parts import IRON, RED, STEEL, STONE, WHITE, WOOD, tube
from vico.world.mesh import Surface
from vico.world.seeds import rng

_LONG = 2.0
_DEEP = 0.5  # below the ground, metres


def _post(height: float, side: float, colour: Colour, x: float) -> Surface:
    return box((side, side, height + _DEEP), (x, 0, (height - _DEEP) / 2), colour=colour)


def _railing(name: str, height: float) -> Model:
    parts = [box((_LONG, 0.04, 0.04), (0, 0, z), colour=IRON) for z in (0.14, height - 0.1)]
    parts += [
        tube((-0.9 + 0.2 * k, 0, 0.05), (-0.9 + 0.2 * k, 0, height), 0.014, IRON, sides=4, tip=0.005) for k in range(10)
    ]
    parts.append(_post(height, 0.06, IRON, -_LONG / 2))
    parts.append(ball((0.05, 0.05, 0.05), (-_LONG / 2, 0, height + 0.03), colour=IRON, sides=6, rings=4))
    return model(name, parts, kind="fence", foot=(_LONG, 0.1))


def _boards(name: str, height: float, tone: Colour, *, gap: float, boards: int) -> Model:
    wide = _LONG / boards - gap
    random = rng(0, "fence", name)
    parts = [box((_LONG, 0.05, 0.09), (0, -0.03, z), colour=tone) for z in (0.25 * height, 0.8 * height)]
    for k in range(boards):
        shade = float(random.uniform(0.86, 1.06))
        colour = tuple(min(int(c * shade), 255) for c in tone)
        top = height + float(random.uniform(-0.01, 0.01))
        x = (k + 0.5) * _LONG / boards - _LONG / 2
        parts.append(box((wide, 0.025, top + 0.1), (x, 0, (top - 0.1) / 2), colour=(colour[0], colour[1], colour[2])))
    parts.append(_post(height, 0.1, tone, -_LONG / 2))
    return model(name, parts, kind="fence", foot=(_LONG, 0.1))


def _mesh_fence() -> Model:
    tone: Colour = (76, 98, 84)
    parts = [tube((-1, 0, z), (1, 0, z), 0.008, tone, sides=3) for z in (0.06, 0.4, 0.75, 1.1, 1.45, 1.75)]
    parts += [tube((-0.95 + 0.1 * k, 0, 0.02), (-0.95 + 0.1 * k, 0, 1.76), 0.006, tone, sides=3) for k in range(20)]
    parts.append(_post(1.8, 0.06, tone, -1.0))
    return model("fence_mesh", parts, kind="fence", foot=(_LONG, 0.1))


def _chain() -> Model:
    parts: list[Surface] = [_post(0.8, 0.09, IRON, -1.0), ball((0.07, 0.07, 0.07), (-1.0, 0, 0.84), colour=IRON,
                                                               sides=7, rings=4)]  # fmt: skip
    knots = [(-1 + 0.25 * k, 0.0, 0.72 - 0.22 * (1 - (0.25 * k - 1) ** 2)) for k in range(9)]
    parts += [tube(a, b, 0.022, STEEL) for a, b in itertools.pairwise(knots)]
    return model("chain", parts, kind="fence", foot=(_LONG, 0.1))


def _rails() -> list[Model]:
    guard = [
        extrusion([(-0.03, 0.46), (0.02, 0.5), (0.02, 0.58), (-0.03, 0.62)], _LONG, colour=STEEL),
        extrusion([(-0.03, 0.62), (0.02, 0.66), (0.02, 0.74), (-0.03, 0.78)], _LONG, colour=STEEL),
    ]
    turned = [part.moved(_quarter()) for part in guard]
    turned.append(_post(0.75, 0.1, STEEL, -0.9))
    hand = [tube((-1, 0, z), (1, 0, z), 0.025, STEEL, sides=6) for z in (0.55, 1.0)]
    hand.append(_post(1.0, 0.05, STEEL, -1.0))
    jersey = [
        extrusion([(-0.3, -0.1), (0.3, -0.1), (0.3, 0.1), (0.12, 0.35), (0.08, 0.85), (-0.08, 0.85), (-0.12, 0.35),
                   (-0.3, 0.1)], 1.96, colour=(176, 174, 168)).moved(_quarter()),
    ]  # fmt: skip
    works = [
        *[box((_LONG, 0.03, 0.2), (0, 0, z), colour=WHITE) for z in (0.45, 0.95)],
        *[box((0.25, 0.034, 0.2), (-0.75 + 0.5 * k, 0, z), colour=RED) for k in range(4) for z in (0.45, 0.95)],
        *[box((0.06, 0.5, 0.05), (x, 0, 0.03), colour=IRON) for x in (-0.8, 0.8)],
        *[box((0.05, 0.03, 1.1), (x, 0, 0.55), colour=IRON) for x in (-0.8, 0.8)],
    ]
    return [
        model("guard_rail", turned, foot=(_LONG, 0.2)),
        model("handrail", hand, kind="guard_rail", foot=(_LONG, 0.1)),
        model("jersey_barrier", jersey, kind="guard_rail", foot=(_LONG, 0.6)),
        model("works_fence", works, kind="fence", foot=(_LONG, 0.3)),
    ]


def _quarter() -> NDArray[np.float64]:
    return pose_matrix(yaw=np.pi / 2)


def _walls() -> list[Model]:
    """Masonry in courses of blocks of uneven tone, with a coping."""
    found = []
    for name, height, thick, tone, courses, blocks in (
        ("wall_low", 0.6, 0.35, (160, 150, 136), 2, 4),
        ("wall", 1.2, 0.32, (156, 144, 128), 4, 4),
        ("wall_high", 2.0, 0.36, (150, 140, 126), 5, 4),
        ("wall_brick", 1.6, 0.3, (150, 88, 70), 5, 5),
    ):
        random = rng(0, "wall", name)
        parts = [box((_LONG, thick * 0.94, height + _DEEP), (0, 0, (height - _DEEP) / 2),
                     colour=tuple(int(c * 0.82) for c in tone))]  # type: ignore[arg-type]  # fmt: skip
        step = (height - 0.08) / courses
        for j in range(courses):
            shift = 0.0 if j % 2 else _LONG / blocks / 2
            for k in range(blocks if j % 2 else blocks - 1):
                shade = float(random.uniform(0.88, 1.1))
                colour = (int(tone[0] * shade), int(tone[1] * shade), int(tone[2] * shade))
                x = (k + 0.5) * _LONG / blocks - _LONG / 2 + shift
                parts.append(box((_LONG / blocks - 0.02, thick, step - 0.02), (x, 0, (j + 0.5) * step), colour=colour))
        parts.append(box((_LONG, thick + 0.1, 0.09), (0, 0, height - 0.035), colour=STONE))
        found.append(model(name, parts, kind="wall", foot=(_LONG, 0.4)))
    return found


def _block() -> Model:
    return model("block", [box((0.9, 0.6, 0.6), (0, 0, 0.28), colour=(168, 164, 156)),
                           box((0.8, 0.5, 0.06), (0, 0, 0.6), colour=(176, 172, 166))])  # fmt: skip


def _turnstile() -> Model:
    parts = [box((0.5, 0.3, 1.0), (0, -0.5, 0.5), colour=STEEL), box((0.5, 0.3, 1.0), (0, 0.5, 0.5), colour=STEEL)]
    parts += [tube((0, -0.35, 0.9), (0.0 + 0.25 * k, 0.15, 0.75 + 0.1 * k), 0.02, IRON) for k in (-1, 0, 1)]
    return model("turnstile", parts, kind="gate", solid=False)


def barrier_models() -> list[Model]:
    """Everything that keeps people out, or from falling."""
    return [
        _railing("fence", 1.1), _railing("fence_high", 1.9), _mesh_fence(),
        _boards("fence_wood", 1.1, WOOD, gap=0.06, boards=13),
        _boards("fence_panel", 1.8, (134, 104, 76), gap=0.008, boards=12),
        _chain(), *_rails(), *_walls(), _block(), _turnstile(),
    ]  # fmt: skip
