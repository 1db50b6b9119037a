"""Primitive shapes to build models from, as surfaces at the origin, z up; normals for meshes that come without any."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.world.mesh import Material, Surface

Colour = tuple[int, int, int]
Vector = Sequence[float] | NDArray[np.float64]


def pose_matrix(x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> NDArray[np.float64]:
    """4x4 transform: turn by `yaw` about z, then move."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]], np.float64)


def facing_x(x: float, y: float, z: float) -> NDArray[np.float64]:
    """4x4 transform: turn the z axis to +x, then move: what stood on the ground looks forward."""
    return np.array([[0, 0, 1, x], [0, 1, 0, y], [-1, 0, 0, z], [0, 0, 0, 1]], np.float64)


def facing_y(x: float, y: float, z: float) -> NDArray[np.float64]:
    """4x4 transform: turn the z axis to +y, then move: wheels, rolls."""
    return np.array([[1, 0, 0, x], [0, 0, 1, y], [0, -1, 0, z], [0, 0, 0, 1]], np.float64)


def _unit_box() -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """Corners at -1 and 1 (four for each face), triangles and uv of a box."""
    corners, faces, uv = np.zeros((24, 3)), [], []
    for face in range(6):
        axis, sign = face // 2, 2.0 * (face % 2) - 1.0
        for k, (a, b) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
            corners[4 * face + k, [axis, (axis + 1) % 3, (axis + 2) % 3]] = sign, a, b
            uv.append(((a + 1) / 2, (b + 1) / 2))
        quad = [(0, 1, 2), (0, 2, 3)] if sign > 0 else [(0, 2, 1), (0, 3, 2)]
        faces += [[4 * face + i for i in triangle] for triangle in quad]
    return corners, np.array(faces, np.int32), np.array(uv)


_BOX_CORNERS, _BOX_FACES, _BOX_UV = _unit_box()


def box(
    size: Vector,
    centre: Vector = (0.0, 0.0, 0.0),
    *,
    colour: Colour = (200, 200, 200),
    yaw: float = 0.0,
    material: Material | None = None,
) -> Surface:
    """Make a box of full extents `size` around `centre`; faces carry uv 0..1."""
    surface = Surface.from_triangles(
        _BOX_CORNERS * (np.asarray(size, np.float64) / 2), _BOX_FACES, colour=colour, uv=_BOX_UV, material=material
    )
    return surface.moved(pose_matrix(float(centre[0]), float(centre[1]), float(centre[2]), yaw))


def lathe(
    profile: Sequence[tuple[float, float]],
    *,
    sides: int = 8,
    colour: Colour = (200, 200, 200),
    centre: Vector = (0.0, 0.0, 0.0),
    smooth: bool = True,
) -> Surface:
    """Make a solid of revolution about z from (radius, z) pairs, bottom to top; ends of radius 0 close it."""
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    rings = np.array([[(r * np.cos(a), r * np.sin(a), z) for a in angles] for r, z in profile])
    n = len(profile)
    faces = []
    for k in range(n - 1):
        if profile[k] == profile[k + 1]:  # a doubled rim
            continue
        for i in range(sides):
            j = (i + 1) % sides
            a, b, c, d = k * sides + i, k * sides + j, (k + 1) * sides + j, (k + 1) * sides + i
            if profile[k][0] > 1e-9:
                faces.append((a, b, c))
            if profile[k + 1][0] > 1e-9:
                faces.append((a, c, d))
    points = rings.reshape(-1, 3)
    triangles = np.array(faces, np.int32)
    normals = None
    if smooth:
        corners = points[triangles]
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = np.zeros_like(points)
        for k in range(3):
            np.add.at(normals, triangles[:, k], flat)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    shift = pose_matrix(float(centre[0]), float(centre[1]), float(centre[2]))
    return Surface.from_triangles(points, triangles, colour=colour, normals=normals).moved(shift)


def cylinder(
    radius: float,
    length: float,
    *,
    top: float | None = None,
    sides: int = 8,
    colour: Colour = (200, 200, 200),
    centre: Vector = (0.0, 0.0, 0.0),
) -> Surface:
    """Make a capped cylinder (or a cone, with another `top` radius) standing on z = 0 of `centre`."""
    upper = radius if top is None else top
    # The caps' rims are doubled so that the edge stays sharp under smooth normals.
    profile = [(0.0, 0.0), (radius, 0.0), (radius, 0.0), (upper, length), (upper, length), (0.0, length)]
    return lathe(profile, sides=sides, colour=colour, centre=centre)


def ball(
    radii: Vector,
    centre: Vector = (0.0, 0.0, 0.0),
    *,
    colour: Colour = (200, 200, 200),
    sides: int = 8,
    rings: int = 5,
) -> Surface:
    """Make an ellipsoid with the given x, y, z radii."""
    turns = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    profile = [(max(float(np.cos(t)), 0.0), float(np.sin(t))) for t in turns]
    surface = lathe(profile, sides=sides, colour=colour)
    scale = np.asarray(radii, np.float64)
    normals = surface.normals / scale
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Surface.from_triangles(
        surface.positions * scale + np.asarray(centre), surface.triangles, colour=colour, normals=normals
    )


def extrusion(
    outline: Sequence[tuple[float, float]],
    width: float,
    *,
    colour: Colour = (200, 200, 200),
) -> Surface:
    """Extrude a convex side outline in (x, z), counter-clockwise seen from -y, symmetrically along y."""
    n = len(outline)
    ring = np.asarray(outline, np.float64)
    points = np.array([(x, y, z) for y in (-width / 2, width / 2) for x, z in ring])
    faces = [(0, i, i + 1) for i in range(1, n - 1)] + [(n, n + i + 1, n + i) for i in range(1, n - 1)]
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, n + i, n + j), (i, n + j, j)]
    return Surface.from_triangles(points, np.array(faces), colour=colour)


def tube(a: Vector, b: Vector, radius: float, colour: Colour, *, sides: int = 4, tip: float | None = None) -> Surface:
    """Make a bar between two points, open at its ends; `tip` is its radius at `b`."""
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
    outline: Sequence[tuple[float, float]],
    thick: float,
    colour: Colour,
    centre: Vector = (0.0, 0.0, 0.0),
    *,
    yaw: float = 0.0,
) -> Surface:
    """Make a plate of a convex outline in (y, z), counter-clockwise seen from +x, that faces +x before it is turned."""
    x, y, z = centre
    return extrusion(outline, thick, colour=colour).moved(pose_matrix(x, y, z, np.pi / 2 + yaw))


def polygon(sides: int, radius: float, turn: float = 0.0) -> list[tuple[float, float]]:
    """Corners of a regular polygon around the origin."""
    angles = [turn + 2 * math.pi * k / sides for k in range(sides)]
    return [(radius * math.cos(a), radius * math.sin(a)) for a in angles]


def ring(centre: Vector, radius: float, thick: float, colour: Colour, *, axis: str = "y", sides: int = 12) -> Surface:
    """Make a flat tyre-like ring, seen from both sides."""
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


def inside_out(surface: Surface) -> Surface:
    """Return the same surface, its faces turned round."""
    return replace(surface, normals=-surface.normals, triangles=surface.triangles[:, ::-1].copy())


Array = NDArray[Any]


def surface_with_normals(points: Array, faces: Array, colour: tuple[int, int, int], *, crease: float = 40.0) -> Surface:
    """Make a surface whose normals are smooth except across edges sharper than `crease` degrees."""
    corners = points[faces]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(weighted, axis=1, keepdims=True)
    unit = weighted / np.maximum(size, 1e-18)
    vertex = faces.ravel()
    face = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(vertex, kind="stable")
    starts = np.searchsorted(vertex[order], np.arange(len(points) + 1))
    normals = np.zeros((len(vertex), 3))
    limit = np.cos(np.radians(crease))
    for v in range(len(points)):
        around = order[starts[v] : starts[v + 1]]
        if len(around):
            near = unit[face[around]] @ unit[face[around]].T > limit
            normals[around] = near @ weighted[face[around]]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 1e-15, normals / np.maximum(length, 1e-18), unit[face])
    return Surface.from_triangles(points[vertex], np.arange(len(vertex)).reshape(-1, 3), colour=colour, normals=normals)
