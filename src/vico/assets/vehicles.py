"""Vehicles modelled from measurements: cars of five kinds, a city bus, a bicycle.

Models stand on z = 0 with their footprint's centre at the origin, +x forward, metres. Every vehicle is closed enough to
be seen from any side at street distance, 300 to 1200 triangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import Colour, box
from vico.world.mesh import Surface, joined, quad_triangles

_GLASS: Colour = (44, 54, 64)
_TYRE: Colour = (26, 26, 28)
_RIM: Colour = (165, 168, 172)
_TRIM: Colour = (38, 39, 42)
_HEADLIGHT: Colour = (240, 240, 228)
_TAILLIGHT: Colour = (170, 20, 20)
_INDICATOR: Colour = (230, 130, 20)
_PLATE: Colour = (235, 235, 230)

PAINTS: dict[str, Colour] = {
    "white": (232, 233, 232),
    "silver": (172, 176, 180),
    "grey": (96, 100, 106),
    "black": (30, 31, 34),
    "red": (158, 28, 30),
    "blue": (34, 66, 122),
    "green": (44, 84, 66),
    "sand": (190, 172, 138),
    "yellow": (240, 186, 24),
}

# Kinds of cars in traffic and the paints each comes in.
CAR_KINDS: dict[str, tuple[str, ...]] = {
    "hatchback": ("red", "white", "blue", "silver"),
    "sedan": ("black", "silver", "grey", "blue"),
    "suv": ("white", "grey", "green", "black"),
    "van": ("white", "silver", "sand"),
    "taxi": ("yellow",),
}


@dataclass(frozen=True)
class _Build:
    """A car's measures; heights and stations along x from the rear bumper to the front one.

    `lower` lists the body below the windows as (x, bottom, top, half width); `base` and `roof` are the window line's
    and the roof's (rear x, front x, half width, height).
    """

    length: float
    width: float
    height: float
    wheelbase: float
    overhang: float
    wheel: float
    lower: tuple[tuple[float, float, float, float], ...]
    base: tuple[float, float, float, float]
    roof: tuple[float, float, float, float]
    pillars: tuple[float, ...]


_BUILDS: dict[str, _Build] = {
    "hatchback": _Build(
        4.0, 1.76, 1.48, 2.52, 0.80, 0.31,
        (
            (-2.0, 0.40, 0.72, 0.74), (-1.93, 0.28, 0.92, 0.83), (-1.6, 0.24, 0.97, 0.88), (0.6, 0.22, 0.96, 0.88),
            (1.3, 0.22, 0.90, 0.87), (1.8, 0.24, 0.80, 0.82), (2.0, 0.36, 0.66, 0.72),
        ),
        (-1.92, 0.98, 0.82, 0.94), (-1.42, 0.18, 0.61, 1.48), (-0.95, -0.05),
    ),
    "sedan": _Build(
        4.7, 1.82, 1.45, 2.78, 0.92, 0.33,
        (
            (-2.35, 0.42, 0.74, 0.76), (-2.26, 0.30, 0.95, 0.85), (-1.5, 0.24, 1.00, 0.91), (0.5, 0.22, 0.96, 0.91),
            (1.4, 0.22, 0.90, 0.90), (2.1, 0.24, 0.79, 0.85), (2.35, 0.36, 0.66, 0.75),
        ),
        (-1.72, 1.05, 0.84, 0.95), (-0.98, 0.22, 0.62, 1.45), (-0.88, 0.0),
    ),
    "suv": _Build(
        4.6, 1.90, 1.70, 2.70, 0.92, 0.37,
        (
            (-2.3, 0.48, 0.86, 0.80), (-2.22, 0.36, 1.10, 0.90), (-1.8, 0.32, 1.14, 0.95), (0.6, 0.30, 1.10, 0.95),
            (1.4, 0.30, 1.06, 0.94), (2.1, 0.32, 0.94, 0.90), (2.3, 0.46, 0.80, 0.82),
        ),
        (-2.18, 1.06, 0.88, 1.08), (-1.80, 0.28, 0.70, 1.70), (-1.15, -0.10),
    ),
    "van": _Build(
        5.1, 1.98, 2.02, 3.10, 0.95, 0.34,
        (
            (-2.55, 0.42, 0.95, 0.86), (-2.48, 0.30, 1.16, 0.96), (-1.5, 0.26, 1.18, 0.99), (1.2, 0.24, 1.14, 0.99),
            (1.9, 0.24, 1.02, 0.97), (2.4, 0.28, 0.84, 0.90), (2.55, 0.42, 0.76, 0.82),
        ),
        (-2.46, 1.72, 0.95, 1.12), (-2.40, 0.90, 0.84, 2.02), (-1.0, 0.25),
    ),
}  # fmt: skip
_BUILDS["taxi"] = _BUILDS["sedan"]

BUS_SIZE = (12.0, 2.55, 3.1)
_BUS_OVERHANG, _BUS_WHEELBASE = 2.75, 5.9
BICYCLE_SIZE = (1.75, 0.6, 1.05)


def vehicle_size(name: str) -> tuple[float, float, float, float, float]:
    """Length, width, height, front overhang and wheelbase of a prototype, metres."""
    kind = name.split("_")[0]
    if kind == "bus":
        return (*BUS_SIZE, _BUS_OVERHANG, _BUS_WHEELBASE)
    if kind == "bicycle":
        return (*BICYCLE_SIZE, 0.33, 1.08)
    build = _BUILDS[kind]
    return build.length, build.width, build.height, build.overhang, build.wheelbase


@cache
def vehicle_prototypes() -> dict[str, list[Surface]]:
    """Every vehicle by its prototype's name: ``sedan_black`` and the like, ``bus``, ``bicycle``."""
    models = {f"{kind}_{paint}": [car(kind, PAINTS[paint])] for kind, paints in CAR_KINDS.items() for paint in paints}
    models["bus"] = [bus()]
    models["bicycle"] = [bicycle()]
    return models


def _joined(parts: Sequence[Surface]) -> Surface:
    return joined(parts)[0]


def _quads(corners: NDArray[np.float64] | Sequence[Sequence[Sequence[float]]], colour: Colour) -> Surface:
    """Flat quadrilaterals, shape (n, 4, 3), counter-clockwise from outside."""
    points = np.asarray(corners, np.float64).reshape(-1, 3)
    return Surface.from_triangles(points, quad_triangles(np.arange(0, len(points), 4), by_halves=True), colour=colour)


def _mirrored(surface: Surface) -> Surface:
    """Return the same on the other side of the x axis."""
    flip = np.array([1, -1, 1], np.float32)
    return Surface(
        surface.positions * flip, surface.normals * flip, surface.uv, surface.colour, surface.entity,
        np.ascontiguousarray(surface.triangles[:, ::-1]), surface.material,
    )  # fmt: skip


def _loft(rings: NDArray[np.float64], colour: Colour) -> Surface:
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


def _disc(centre: tuple[float, float, float], radius: float, colour: Colour, sides: int = 12) -> Surface:
    """Make a disc that faces +y."""
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.column_stack([np.cos(angles) * radius, np.zeros(sides), np.sin(angles) * radius]) + centre
    faces = [(0, i + 1, i) for i in range(1, sides - 1)]
    return Surface.from_triangles(ring, np.array(faces), colour=colour)


def _wheel(x: float, y: float, radius: float, width: float = 0.22) -> list[Surface]:
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
    tyre = _loft(rings[:, ::-1], _TYRE)
    return [
        tyre,
        _disc((x, y + 0.004, radius), radius * 0.66, _RIM, 10),
        _disc((x, y + 0.008, radius), radius * 0.22, _TRIM, 6),
    ]


def _arch(x: float, y: float, radius: float, sill: float) -> Surface:
    """Make the dark opening around a wheel on the side that faces +y."""
    angles = np.linspace(0, np.pi, 9)
    points = [(x + np.cos(a) * radius, y, max(sill, radius * 0.86 + np.sin(a) * radius)) for a in angles]
    ring = np.array([*points, (x - radius, y, sill), (x + radius, y, sill)])
    faces = [(0, i + 1, i) for i in range(1, len(ring) - 1)]
    return Surface.from_triangles(ring, np.array(faces), colour=_TRIM)


def _both_sides(parts: Sequence[Surface]) -> list[Surface]:
    return [*parts, *(_mirrored(part) for part in parts)]


def car(kind: str, paint: Colour) -> Surface:
    """Make a car.

    Parameters
    ----------
    kind
        hatchback, sedan, suv, van or taxi.
    paint
        Colour of the body.
    """
    build = _BUILDS[kind]
    parts = [_body(build, paint), *_cabin(build, paint)]
    front = build.length / 2 - build.overhang
    rear = front - build.wheelbase
    side = build.width / 2
    wheels: list[Surface] = []
    for x in (front, rear):
        wheels.append(_arch(x, side + 0.002, build.wheel * 1.22, 0.22))
        wheels += _wheel(x, side + 0.012, build.wheel)
    parts += _both_sides(wheels)
    parts += _fittings(build, paint)
    if kind == "taxi":
        parts.append(box((0.22, 0.5, 0.14), (-0.35, 0, build.height + 0.06), colour=(250, 246, 220)))
        for k in range(8):
            x = -1.0 + k * 0.25
            parts += _both_sides([_panel(x, x + 0.125, side + 0.004, 0.62 + 0.06 * (k % 2), 0.68 + 0.06 * (k % 2))])
    return _joined(parts)


def _panel(x0: float, x1: float, y: float, z0: float, z1: float, colour: Colour = _TRIM) -> Surface:
    """Make an upright rectangle that faces +y."""
    return _quads([[(x1, y, z0), (x0, y, z0), (x0, y, z1), (x1, y, z1)]], colour)


def _front(x: float, half: float, z0: float, z1: float, colour: Colour) -> Surface:
    """Make an upright rectangle across the vehicle that faces forward, or backward where `half` is negative."""
    return _quads([[(x, -half, z0), (x, half, z0), (x, half, z1), (x, -half, z1)]], colour)


def _body(build: _Build, paint: Colour) -> Surface:
    """Make the body below the windows: a skin over sections with rounded shoulders and sills."""
    rings = []
    for x, low, top, half in build.lower:
        shoulder = top - min(0.14, (top - low) * 0.3)
        right = [(half * 0.90, low), (half, low + 0.12), (half, shoulder), (half * 0.94, top - 0.02)]
        # Counter-clockwise seen from the front, where +y is to the right.
        outline = [*right, (0.0, top), *((-y, z) for y, z in right[::-1])]
        rings.append([(x, y, z) for y, z in outline])
    return _loft(np.array(rings), paint)


def _cabin(build: _Build, paint: Colour) -> list[Surface]:
    """Make the greenhouse: a painted frame with glass a finger's breadth proud of it."""
    rear, front, wide, low = build.base
    back, fore, narrow, top = build.roof
    crown = top - 0.05
    base = np.array([(front, wide, low), (rear, wide, low), (rear, -wide, low), (front, -wide, low)])
    roof = np.array([(fore, narrow, crown), (back, narrow, crown), (back, -narrow, crown), (fore, -narrow, crown)])
    lid = np.array(
        [(fore - 0.12, narrow - 0.1, top), (back + 0.12, narrow - 0.1, top),
         (back + 0.12, -narrow + 0.1, top), (fore - 0.12, -narrow + 0.1, top)]
    )  # fmt: skip
    parts = [_loft(np.stack([base, roof, lid]), paint)]
    parts.append(_glass(base[3], base[0], roof[0], roof[3], 0.06, 0.10))
    parts.append(_glass(base[1], base[2], roof[2], roof[1], 0.10, 0.14))
    # Side glass between the pillars, on the plane of the frame.
    cuts = [rear, *build.pillars, front]
    shares = [(x - rear) / (front - rear) for x in cuts]
    sides = []
    for a, b in pairwise(shares):
        low_a, low_b = base[1] + (base[0] - base[1]) * a, base[1] + (base[0] - base[1]) * b
        high_a, high_b = roof[1] + (roof[0] - roof[1]) * a, roof[1] + (roof[0] - roof[1]) * b
        sides.append(_glass(low_b, low_a, high_a, high_b, 0.05, 0.10))
    return parts + _both_sides(sides)


def _glass(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64],
    margin: float, sill: float,
) -> Surface:  # fmt: skip
    """Make a pane within the quadrilateral a-b (bottom), c-d (top), inset by margins and set a little outward."""
    width = max(float(np.linalg.norm(b - a)), 1e-6)
    high = max(float(np.linalg.norm(d - a)), 1e-6)
    u, v0, v1 = min(margin / width, 0.4), min(sill / high, 0.4), 1 - min(margin / high, 0.4)

    def at(s: float, t: float) -> NDArray[np.float64]:
        return np.asarray((a + (b - a) * s) * (1 - t) + (d + (c - d) * s) * t)

    corners = np.array([at(u, v0), at(1 - u, v0), at(1 - u, v1), at(u, v1)])
    normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    return _quads([(corners + normal / np.linalg.norm(normal) * 0.012).tolist()], _GLASS)


def _fittings(build: _Build, paint: Colour) -> list[Surface]:
    """Lights, grille, bumpers, plates, mirrors, door lines and handles."""
    tip, tail = build.length / 2, -build.length / 2
    half = build.width / 2
    _, low, high, nose = build.lower[-1]
    _, rear_low, rear_high, stern = build.lower[0]
    parts = [
        box((0.06, nose * 1.1, (high - low) * 0.42), (tip - 0.01, 0, low + (high - low) * 0.36), colour=_TRIM),
        box((0.03, 0.5, 0.11), (tip + 0.02, 0, low + (high - low) * 0.36), colour=_PLATE),
        box((0.03, 0.5, 0.11), (tail - 0.005, 0, rear_low + (rear_high - rear_low) * 0.62), colour=_PLATE),
        box((0.10, stern * 1.9, 0.16), (tail + 0.06, 0, rear_low + 0.04), colour=_TRIM),
        box((0.14, nose * 1.96, 0.15), (tip - 0.05, 0, low + 0.02), colour=_TRIM),
    ]
    belt = build.base[3]
    door = build.pillars[-1]
    middle = tip - build.overhang - build.wheelbase / 2
    sides = [
        box((0.24, 0.30, 0.13), (tip - 0.10, nose - 0.13, high - 0.08), colour=_HEADLIGHT),
        box((0.12, 0.22, 0.20), (tail + 0.07, stern - 0.09, rear_high - 0.02), colour=_TAILLIGHT),
        box((0.12, 0.18, 0.13), (build.base[1] - 0.30, half - 0.02, belt + 0.10), colour=paint),
        _panel(door - 0.012, door + 0.012, half + 0.004, 0.36, belt - 0.10),
        _panel(build.base[1] - 0.16, build.base[1] - 0.136, half + 0.004, 0.36, belt - 0.12),
        box((0.18, 0.02, 0.035), (door - 0.2, half + 0.006, belt - 0.18), colour=_TRIM),
        box((build.wheelbase - build.wheel * 2.6, 0.03, 0.12), (middle, half - 0.02, 0.27), colour=_TRIM),
    ]  # fmt: skip
    return parts + _both_sides(sides)


def mirrored(surface: Surface) -> Surface:
    """Return the same with left and right exchanged."""
    other = np.array([1.0, -1.0, 1.0], np.float32)
    return replace(
        surface,
        positions=surface.positions * other,
        normals=surface.normals * other,
        triangles=np.ascontiguousarray(surface.triangles[:, ::-1]),
    )


def bus(paint: Colour = (0, 114, 178), sign: Colour = (246, 170, 30)) -> Surface:
    """Make a 12 m low-floor city bus with three doors on its right side and a lit line sign."""
    length, width, height = BUS_SIZE
    x1, x0, half = length / 2, -length / 2, width / 2
    white: Colour = (236, 238, 238)
    low, belt, eaves = 0.32, 1.12, 2.62

    def ring(x: float, inset: float, top: float) -> list[tuple[float, float, float]]:
        y = half - inset
        outline = [(y, low), (y, belt), (y, eaves), (y - 0.12, top - 0.06), (y - 0.3, top)]
        return [(x, a, b) for a, b in outline] + [(x, -a, b) for a, b in outline[::-1]]

    rings = np.array(
        [ring(x0, 0.12, height - 0.12), ring(x0 + 0.18, 0.0, height - 0.1), ring(x1 - 0.35, 0.0, height - 0.1),
         ring(x1, 0.14, height - 0.2)]
    )  # fmt: skip
    parts = [_loft(rings, white)]
    parts.append(box((6.5, 1.7, 0.22), (-1.6, 0, height - 0.06), colour=(214, 217, 218)))
    front = x1 - _BUS_OVERHANG
    rear = front - _BUS_WHEELBASE
    sides: list[Surface] = [_panel(x0 + 0.2, x1 - 0.4, half + 0.003, low, belt - 0.16, paint)]
    for x in (front, rear):
        sides.append(_arch(x, half + 0.006, 0.58, low))
        sides += _wheel(x, half + 0.012, 0.48, 0.3)
    sides.append(box((0.16, 0.26, 0.16), (x0 + 0.06, half - 0.3, 0.9), colour=_TAILLIGHT))
    sides.append(box((0.12, 0.36, 0.18), (x1 - 0.02, half - 0.38, 0.72), colour=_HEADLIGHT))
    sides.append(box((0.10, 0.12, 0.18), (x1 - 0.05, half - 0.16, 0.72), colour=_INDICATOR))
    sides.append(box((0.10, 0.10, 0.36), (x1 - 0.1, half + 0.0, 2.2), colour=_TRIM))
    parts += _both_sides(sides)
    # Left: windows all along; right (-y): windows between the doors.
    left_panes = [
        _panel(x, x + 1.28, half + 0.008, belt + 0.02, eaves - 0.16, _GLASS) for x in np.arange(-5.6, 4.6, 1.36)
    ]
    parts += left_panes
    doors = ((3.95, 5.35), (-0.75, 0.65), (-4.2, -2.9))
    right: list[Surface] = []
    for x in np.arange(-5.6, 4.6, 1.36):
        if all(x + 1.28 < a or x > b for a, b in doors):
            right.append(_panel(x, x + 1.28, half + 0.008, belt + 0.02, eaves - 0.16, _GLASS))
    for a, b in doors:
        right.append(_panel(a, b, half + 0.007, low + 0.02, eaves - 0.04, _TRIM))
        middle = (a + b) / 2
        for c, d in ((a + 0.06, middle - 0.03), (middle + 0.03, b - 0.06)):
            right.append(_panel(c, d, half + 0.011, low + 0.16, eaves - 0.14, _GLASS))
    right.append(_panel(2.0, 3.4, half + 0.014, eaves - 0.36, eaves - 0.1, sign))
    parts += [_mirrored(part) for part in right]
    nose = x1 + 0.012
    parts.append(_front(nose, half - 0.26, 1.0, 2.48, _GLASS))
    parts.append(_front(nose, 0.85, 2.52, 2.82, sign))
    back = x0 - 0.012
    parts.append(_front(back, -half + 0.3, 1.5, 2.4, _GLASS))
    parts.append(_front(back, -0.35, 2.5, 2.76, sign))
    parts.append(box((0.08, width - 0.5, 0.28), (x1 - 0.02, 0, 0.46), colour=_TRIM))
    parts.append(box((0.08, width - 0.5, 0.34), (x0 + 0.02, 0, 0.5), colour=paint))
    return _joined(parts)


def _tube(a: Sequence[float], b: Sequence[float], radius: float, colour: Colour, sides: int = 5) -> Surface:
    """Make a straight tube between two points."""
    start, end = np.asarray(a, np.float64), np.asarray(b, np.float64)
    axis = (end - start) / np.linalg.norm(end - start)
    other = np.array([0.0, 1.0, 0.0]) if abs(axis[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    u = np.cross(axis, other)
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    circle = (np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v) * radius
    return _loft(np.stack([start + circle, end + circle]), colour)


def bicycle(paint: Colour = (255, 200, 0)) -> Surface:
    """Make a city bicycle with mudguards and a basket."""
    radius, rear, front = 0.34, -0.54, 0.54
    parts: list[Surface] = []
    angles = np.linspace(0, 2 * np.pi, 17)
    for x in (rear, front):
        rim = [(x + np.cos(t) * radius, 0.0, radius + np.sin(t) * radius) for t in angles]
        parts += [_tube(p, q, 0.02, _TYRE, 4) for p, q in pairwise(rim)]
        for t in np.linspace(0, np.pi, 4, endpoint=False):
            c, s = np.cos(t) * (radius - 0.02), np.sin(t) * (radius - 0.02)
            parts.append(_tube((x - c, 0, radius - s), (x + c, 0, radius + s), 0.004, _RIM, 3))
    crank, seat, head = (-0.08, 0.0, 0.29), (-0.24, 0.0, 0.78), (0.38, 0.0, 0.80)
    low_head = (0.42, 0.0, 0.62)
    for a, b in (
        (crank, seat), (crank, low_head), (seat, low_head), (crank, (rear, 0, radius)), (seat, (rear, 0, radius)),
        (head, (front, 0, radius)),
    ):  # fmt: skip
        parts.append(_tube(a, b, 0.022, paint))
    parts += [
        _tube(head, (0.35, 0, 1.02), 0.016, _TRIM),
        _tube((0.35, 0, 1.02), (0.28, 0.29, 1.04), 0.016, _TRIM),
        _tube((0.35, 0, 1.02), (0.28, -0.29, 1.04), 0.016, _TRIM),
        _tube(seat, (-0.27, 0, 0.92), 0.015, _RIM),
        box((0.27, 0.15, 0.06), (-0.27, 0, 0.95), colour=_TRIM),
        box((0.26, 0.34, 0.03), (0.58, 0, 0.78), colour=_TRIM),
        box((0.02, 0.34, 0.2), (0.70, 0, 0.88), colour=_TRIM),
        box((0.02, 0.34, 0.2), (0.46, 0, 0.88), colour=_TRIM),
        box((0.26, 0.02, 0.2), (0.58, 0.16, 0.88), colour=_TRIM),
        box((0.26, 0.02, 0.2), (0.58, -0.16, 0.88), colour=_TRIM),
        _tube((-0.08, -0.09, 0.29), (-0.08, 0.09, 0.29), 0.015, _RIM),
        box((0.1, 0.09, 0.025), (-0.08, 0.15, 0.14), colour=_TRIM),
        box((0.1, 0.09, 0.025), (-0.08, -0.15, 0.44), colour=_TRIM),
    ]
    for t0, t1 in zip(np.linspace(0.5, 2.9, 6)[:-1], np.linspace(0.5, 2.9, 6)[1:], strict=True):
        arc = [(rear + np.cos(t) * (radius + 0.04), 0.0, radius + np.sin(t) * (radius + 0.04)) for t in (t0, t1)]
        parts.append(_tube(arc[0], arc[1], 0.018, paint, 4))
    return _joined(parts)
