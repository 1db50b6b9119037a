"""Primitive shapes to model things from, as surfaces at the origin, z up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.world.mesh import Material, Surface

Colour = tuple[int, int, int]


def pose_matrix(x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> NDArray[np.float64]:
    """4x4 transform: turn by `yaw` about z, then move."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]], np.float64)


def box(
    size: Sequence[float],
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    colour: Colour = (200, 200, 200),
    yaw: float = 0.0,
    material: Material | None = None,
) -> Surface:
    """A box of full extents `size` around `centre`; faces carry uv 0..1."""
    half = np.asarray(size, np.float64) / 2
    points: list[NDArray[np.float64]] = []
    faces: list[tuple[int, ...]] = []
    uv: list[tuple[float, float]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            start = len(points)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = np.zeros(3)
                corner[axis], corner[u], corner[v] = sign, a, b
                points.append(corner * half)
                uv.append(((a + 1) / 2, (b + 1) / 2))
            quad = [(0, 1, 2), (0, 2, 3)] if sign > 0 else [(0, 2, 1), (0, 3, 2)]
            faces += [tuple(start + i for i in face) for face in quad]
    surface = Surface.from_triangles(
        np.array(points), np.array(faces), colour=colour, uv=np.array(uv), material=material
    )
    return surface.moved(pose_matrix(float(centre[0]), float(centre[1]), float(centre[2]), yaw))


def lathe(
    profile: Sequence[tuple[float, float]],
    *,
    sides: int = 8,
    colour: Colour = (200, 200, 200),
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    smooth: bool = True,
) -> Surface:
    """A solid of revolution about z from (radius, z) pairs, bottom to top; ends of radius 0 close it."""
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
    return Surface.from_triangles(points, triangles, colour=colour, normals=normals).moved(pose_matrix(*centre))


def cylinder(
    radius: float,
    length: float,
    *,
    top: float | None = None,
    sides: int = 8,
    colour: Colour = (200, 200, 200),
    centre: Sequence[float] = (0.0, 0.0, 0.0),
) -> Surface:
    """A capped cylinder (or a cone, with another `top` radius) standing on z = 0 of `centre`."""
    upper = radius if top is None else top
    # The caps' rims are doubled so that the edge stays sharp under smooth normals.
    profile = [(0.0, 0.0), (radius, 0.0), (radius, 0.0), (upper, length), (upper, length), (0.0, length)]
    return lathe(profile, sides=sides, colour=colour, centre=centre)


def ball(
    radii: Sequence[float],
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    colour: Colour = (200, 200, 200),
    sides: int = 8,
    rings: int = 5,
) -> Surface:
    """An ellipsoid with the given x, y, z radii."""
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
    """A convex side outline in (x, z), counter-clockwise seen from -y, extruded symmetrically along y."""
    n = len(outline)
    ring = np.asarray(outline, np.float64)
    points = np.array([(x, y, z) for y in (-width / 2, width / 2) for x, z in ring])
    faces = [(0, i, i + 1) for i in range(1, n - 1)] + [(n, n + i + 1, n + i) for i in range(1, n - 1)]
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, n + i, n + j), (i, n + j, j)]
    return Surface.from_triangles(points, np.array(faces), colour=colour)
