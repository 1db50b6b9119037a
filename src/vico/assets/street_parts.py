"""Pieces that street furniture is put together from: colours, tubes, plates, hoops, bicycles."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import Colour, box, cylinder, extrusion, pose_matrix
from vico.world.mesh import Surface

IRON: Colour = (58, 62, 66)
STEEL: Colour = (150, 154, 158)
GREEN: Colour = (52, 84, 66)
WOOD: Colour = (150, 112, 74)
STONE: Colour = (164, 160, 152)
GRANITE: Colour = (128, 124, 120)
GLASS: Colour = (150, 178, 190)
WATER: Colour = (92, 138, 164)
WHITE: Colour = (232, 232, 228)
BLACK: Colour = (28, 30, 32)
RED: Colour = (186, 44, 38)
YELLOW: Colour = (226, 178, 40)
BLUE: Colour = (40, 88, 156)
BRONZE: Colour = (94, 100, 84)

Point = Sequence[float]


def post(height: float, radius: float = 0.05, colour: Colour = IRON, x: float = 0.0, y: float = 0.0) -> Surface:
    """An upright pole on the ground."""
    return cylinder(radius, height, colour=colour, sides=6, centre=(x, y, 0))


def tilted(x: float, y: float, z: float) -> NDArray[np.float64]:
    """Turn the z axis to +x, then move."""
    matrix = pose_matrix(x, y, z)
    matrix[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    return matrix


def tube(a: Point, b: Point, radius: float, colour: Colour, *, sides: int = 4, tip: float | None = None) -> Surface:
    """A bar between two points, open at its ends; `tip` is its radius at `b`."""
    start, end = np.asarray(a, np.float64), np.asarray(b, np.float64)
    axis = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    other = np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    u = np.cross(axis, other)
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    turn = np.arange(sides) * (2 * np.pi / sides) + np.pi / 4
    around = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
    points = np.concatenate([start + around * radius, end + around * (radius if tip is None else tip)])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = np.concatenate([np.column_stack([i, j, sides + j]), np.column_stack([i, sides + j, sides + i])])
    return Surface.from_triangles(points, faces, colour=colour, normals=np.concatenate([around, around]))


def plate(
    outline: Sequence[tuple[float, float]], thick: float, colour: Colour, x: float = 0.0, y: float = 0.0, z: float = 0.0
) -> Surface:
    """A convex outline in (y, z), counter-clockwise seen from +x, as a plate that faces +x."""
    return extrusion(outline, thick, colour=colour).moved(pose_matrix(x, y, z, math.pi / 2))


def polygon(sides: int, radius: float, turn: float = 0.0) -> list[tuple[float, float]]:
    """Corners of a regular polygon around the origin."""
    angles = [turn + 2 * math.pi * k / sides for k in range(sides)]
    return [(radius * math.cos(a), radius * math.sin(a)) for a in angles]


def hoop(x: float, y: float, wide: float = 0.75, high: float = 0.8) -> list[Surface]:
    """A stand that bicycles lean on, along x."""
    bend = 0.12
    corners = [
        (x - wide / 2, y, 0.0),
        (x - wide / 2, y, high - bend),
        (x - wide / 2 + bend, y, high),
        (x + wide / 2 - bend, y, high),
        (x + wide / 2, y, high - bend),
        (x + wide / 2, y, 0.0),
    ]
    return [tube(a, b, 0.03, STEEL) for a, b in itertools.pairwise(corners)]


def ring(centre: Point, radius: float, thick: float, colour: Colour, *, axis: str = "y", sides: int = 12) -> Surface:
    """A flat tyre-like ring, seen from both sides."""
    turn = np.arange(sides) * (2 * np.pi / sides)
    flat = np.column_stack([np.cos(turn), np.sin(turn)])
    rims = np.concatenate([flat * radius, flat * (radius - thick)])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    front = np.concatenate([np.column_stack([i, j, sides + j]), np.column_stack([i, sides + j, sides + i])])
    points = np.zeros((2 * sides, 3))
    columns = {"y": (0, 2), "x": (1, 2), "z": (0, 1)}[axis]
    points[:, columns[0]], points[:, columns[1]] = rims[:, 0], rims[:, 1]
    both = np.concatenate([front, front[:, ::-1]])
    return Surface.from_triangles(points + np.asarray(centre), both, colour=colour)


def bicycle(x: float, y: float, paint: Colour, *, lean: float = 0.08) -> list[Surface]:
    """A parked bicycle along x, light enough to stand in dozens: wheels, frame, handlebar, saddle."""
    back, front, hub, head, seat = (-0.52, 0.34), (0.52, 0.34), (-0.08, 0.3), (0.38, 0.86), (-0.22, 0.88)

    def at(p: tuple[float, float]) -> tuple[float, float, float]:
        return x + p[0], y + lean * p[1], p[1]

    parts = [ring(at(back), 0.34, 0.045, BLACK, sides=10), ring(at(front), 0.34, 0.045, BLACK, sides=10)]
    for a, b in ((hub, head), (hub, seat), (seat, (0.34, 0.78)), (hub, back), (back, (-0.19, 0.74)), (front, head)):
        parts.append(tube(at(a), at(b), 0.02, paint, sides=3))
    bar, saddle = at((0.36, 0.98)), at((-0.24, 0.95))
    parts += [
        tube((bar[0], bar[1] - 0.27, bar[2]), (bar[0], bar[1] + 0.27, bar[2]), 0.015, BLACK, sides=3),
        tube(at(head), bar, 0.016, BLACK, sides=3),
        box((0.26, 0.12, 0.06), saddle, colour=BLACK),
    ]
    return parts
