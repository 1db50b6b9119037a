"""Parts that vehicles are made of: panels, skins over rings, wheels, tubes; on the side that faces +y."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import Colour
from vico.world.mesh import Material, Surface, merge_surfaces, quad_triangles

GLASS: Colour = (44, 54, 64)
TYRE: Colour = (26, 26, 28)
RIM: Colour = (165, 168, 172)
TRIM: Colour = (38, 39, 42)
HEADLIGHT: Colour = (240, 240, 228)
TAILLIGHT: Colour = (170, 20, 20)
INDICATOR: Colour = (230, 130, 20)
PLATE: Colour = (235, 235, 230)
#: What shines when it is dark.
SHINING = Material("vehicle lamp", emission=1.0)
_LIT_CEILING: Colour = (206, 204, 194)
_LIT_FLOOR: Colour = (88, 90, 90)


@dataclass(frozen=True)
class Cabin:
    """The inside of a vehicle, a box with windows, in the vehicle's frame, metres.

    Attributes
    ----------
    low, high
        Opposite corners of the room.
    windows
        Heights of the lower and upper rims of the side windows.
    left, right
        The windows of each side, from x to x.
    front, rear
        Heights of the lower and upper rims of the windows at the ends; equal where there is none.
    end_half
        Half the width of those.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    windows: tuple[float, float]
    left: tuple[tuple[float, float], ...]
    right: tuple[tuple[float, float], ...]
    front: tuple[float, float] = (0.0, 0.0)
    rear: tuple[float, float] = (0.0, 0.0)
    end_half: float = 0.0


def one_surface(parts: Sequence[Surface]) -> Surface:
    """Join parts of one material."""
    return merge_surfaces(parts)[0]


def quads(corners: NDArray[np.float64] | Sequence[Sequence[Sequence[float]]], colour: Colour) -> Surface:
    """Flat quadrilaterals, shape (n, 4, 3), counter-clockwise from outside."""
    points = np.asarray(corners, np.float64).reshape(-1, 3)
    return Surface.from_triangles(points, quad_triangles(np.arange(0, len(points), 4), by_halves=True), colour=colour)


def inside_lights(low: tuple[float, float, float], high: tuple[float, float, float]) -> Surface:
    """Make the lit ceiling and, fainter, the floor under it, of a vehicle with passengers: they shine when it is dark.

    `low` and `high` are opposite corners of what is between them, metres.
    """
    (x0, y0, z0), (x1, y1, z1) = low, high
    ceiling = quads([[(x0, y1, z1), (x1, y1, z1), (x1, y0, z1), (x0, y0, z1)]], _LIT_CEILING)
    floor = quads([[(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)]], _LIT_FLOOR)
    return replace(one_surface([ceiling, floor]), material=SHINING)


def mirror(surface: Surface) -> Surface:
    """Return the same with left and right exchanged."""
    other = np.array([1.0, -1.0, 1.0], np.float32)
    return replace(
        surface,
        positions=surface.positions * other,
        normals=surface.normals * other,
        triangles=np.ascontiguousarray(surface.triangles[:, ::-1]),
    )


def loft(rings: NDArray[np.float64], colour: Colour) -> Surface:
    """Make a closed skin over rings, shape (k, m, 3), that run counter-clockwise seen from the last one."""
    k, m, _ = rings.shape
    faces = []
    for a in range(k - 1):
        for i in range(m):
            j = (i + 1) % m
            p, q, r, s = a * m + i, a * m + j, (a + 1) * m + j, (a + 1) * m + i
            faces += [(p, q, r), (p, r, s)]
    for i in range(1, m - 1):
        faces += [(0, i + 1, i), ((k - 1) * m, (k - 1) * m + i, (k - 1) * m + i + 1)]
    return Surface.from_triangles(rings.reshape(-1, 3), np.array(faces), colour=colour)


def disc(centre: tuple[float, float, float], radius: float, colour: Colour, sides: int = 12) -> Surface:
    """Make a disc that faces +y."""
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.column_stack([np.cos(angles) * radius, np.zeros(sides), np.sin(angles) * radius]) + centre
    faces = [(0, i + 1, i) for i in range(1, sides - 1)]
    return Surface.from_triangles(ring, np.array(faces), colour=colour)


def wheel(x: float, y: float, radius: float, width: float = 0.22) -> list[Surface]:
    """Make a wheel whose outer side faces +y at `y`."""
    angles = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.zeros(14), np.sin(angles)])
    centre = np.array([x, 0.0, radius])
    rings = np.stack(
        [
            circle * radius + centre + (0, y - width, 0),
            circle * radius + centre + (0, y - 0.03, 0),
            circle * (radius - 0.04) + centre + (0, y, 0),
        ]
    )
    tyre = loft(rings[:, ::-1], TYRE)
    return [
        tyre,
        disc((x, y + 0.004, radius), radius * 0.66, RIM, 10),
        disc((x, y + 0.008, radius), radius * 0.22, TRIM, 6),
    ]


def arch(x: float, y: float, radius: float, sill: float) -> Surface:
    """Make the dark opening around a wheel on the side that faces +y."""
    angles = np.linspace(0, np.pi, 9)
    points = [(x + np.cos(a) * radius, y, max(sill, radius * 0.86 + np.sin(a) * radius)) for a in angles]
    ring = np.array([*points, (x - radius, y, sill), (x + radius, y, sill)])
    faces = [(0, i + 1, i) for i in range(1, len(ring) - 1)]
    return Surface.from_triangles(ring, np.array(faces), colour=TRIM)


def both_sides(parts: Sequence[Surface]) -> list[Surface]:
    """Return the parts of one side and the same of the other."""
    return [*parts, *(mirror(part) for part in parts)]


def panel(x0: float, x1: float, y: float, z0: float, z1: float, colour: Colour = TRIM) -> Surface:
    """Make an upright rectangle that faces +y."""
    return quads([[(x1, y, z0), (x0, y, z0), (x0, y, z1), (x1, y, z1)]], colour)


def front(x: float, half: float, z0: float, z1: float, colour: Colour) -> Surface:
    """Make an upright rectangle across the vehicle that faces forward, or backward where `half` is negative."""
    return quads([[(x, -half, z0), (x, half, z0), (x, half, z1), (x, -half, z1)]], colour)


def straight_tube(a: Sequence[float], b: Sequence[float], radius: float, colour: Colour, sides: int = 5) -> Surface:
    """Make a straight tube between two points."""
    start, end = np.asarray(a, np.float64), np.asarray(b, np.float64)
    axis = (end - start) / np.linalg.norm(end - start)
    other = np.array([0.0, 1.0, 0.0]) if abs(axis[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    u = np.cross(axis, other)
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    circle = (np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v) * radius
    return loft(np.stack([start + circle, end + circle]), colour)
