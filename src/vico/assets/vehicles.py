"""Vehicles modelled from measurements: cars of five kinds, a bicycle, and the lamps of vehicles.

Models stand on z = 0 with their footprint's centre at the origin, +x forward, metres. Every vehicle is closed enough to
be seen from any side at street distance, 300 to 1200 triangles. Headlights and rear lights shine at night; brake lights
and indicators are lit now and then. The bus is in `vico.assets.transit_vehicles`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import Colour, box
from vico.assets.transit_vehicles import BUS_AXLES, BUS_LAMPS, BUS_SIZE, bus, bus_inside_lights
from vico.assets.vehicle_parts import (
    GLASS,
    HEADLIGHT,
    PLATE,
    RIM,
    SHINING,
    TAILLIGHT,
    TRIM,
    TYRE,
    arch,
    both_sides,
    loft,
    one_surface,
    panel,
    quads,
    straight_tube,
    wheel,
)
from vico.world.mesh import Surface

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

BICYCLE_SIZE = (1.75, 0.6, 1.05)
#: Paints of the bicycles in traffic; those to rent are yellow.
BICYCLE_PAINTS = ("black", "silver", "red", "blue", "green")
#: Where a bicycle's cranks turn, and how long they are, metres.
CRANK_AXLE, CRANK = (-0.08, 0.0, 0.29), 0.15


def vehicle_size(name: str) -> tuple[float, float, float, float, float]:
    """Length, width, height, front overhang and wheelbase of a prototype, metres."""
    kind = name.split("_")[0]
    if kind == "bus":
        return (*BUS_SIZE, *BUS_AXLES)
    if kind == "bicycle":
        return (*BICYCLE_SIZE, 0.33, 1.08)
    build = _BUILDS[kind]
    return build.length, build.width, build.height, build.overhang, build.wheelbase


class LampPlaces(NamedTuple):
    """Where a vehicle's left lamps are, in its model's frame, metres: the middles of their outer faces."""

    front: tuple[float, float, float]
    rear: tuple[float, float, float]


def lamp_places(kind: str) -> LampPlaces:
    """Return where the lamps of a kind of car, of the bus, or of a bicycle are."""
    if kind == "bus":
        return LampPlaces(*BUS_LAMPS)
    if kind == "bicycle":
        return LampPlaces((0.72, 0.03, 0.82), (-0.90, 0.02, 0.60))
    build = _BUILDS[kind]
    _, _, high, nose = build.lower[-1]
    _, _, rear_high, stern = build.lower[0]
    tip, tail = build.length / 2 + 0.02, -build.length / 2 + 0.01
    return LampPlaces((tip, nose - 0.13, high - 0.08), (tail, stern - 0.09, rear_high - 0.02))


@cache
def vehicle_prototypes() -> dict[str, list[Surface]]:
    """Every vehicle by its prototype's name: ``sedan_black`` and the like, ``bus``, ``bicycle``."""
    models = {f"{kind}_{paint}": [car(kind, PAINTS[paint])] for kind, paints in CAR_KINDS.items() for paint in paints}
    models["bus"] = [bus()]
    models["bicycle"] = [bicycle()]
    return models


@cache
def ridden_prototypes() -> dict[str, list[Surface]]:
    """Bicycles in traffic, ``bicycle_black`` and the like, without the ``cranks`` that turn beneath their riders."""
    models = {f"bicycle_{paint}": [bicycle(PAINTS[paint], parked=False)] for paint in BICYCLE_PAINTS}
    return models | {"cranks": [cranks()]}


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
        wheels.append(arch(x, side + 0.002, build.wheel * 1.22, 0.22))
        wheels += wheel(x, side + 0.012, build.wheel)
    parts += both_sides(wheels)
    parts += _fittings(build, paint)
    if kind == "taxi":
        parts.append(box((0.22, 0.5, 0.14), (-0.35, 0, build.height + 0.06), colour=(250, 246, 220)))
        for k in range(8):
            x = -1.0 + k * 0.25
            parts += both_sides([panel(x, x + 0.125, side + 0.004, 0.62 + 0.06 * (k % 2), 0.68 + 0.06 * (k % 2))])
    return one_surface(parts)


def _body(build: _Build, paint: Colour) -> Surface:
    """Make the body below the windows: a skin over sections with rounded shoulders and sills."""
    rings = []
    for x, low, top, half in build.lower:
        shoulder = top - min(0.14, (top - low) * 0.3)
        right = [(half * 0.90, low), (half, low + 0.12), (half, shoulder), (half * 0.94, top - 0.02)]
        # Counter-clockwise seen from the front, where +y is to the right.
        outline = [*right, (0.0, top), *((-y, z) for y, z in right[::-1])]
        rings.append([(x, y, z) for y, z in outline])
    return loft(np.array(rings), paint)


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
    parts = [loft(np.stack([base, roof, lid]), paint)]
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
    return parts + both_sides(sides)


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
    return quads([(corners + normal / np.linalg.norm(normal) * 0.012).tolist()], GLASS)


def _fittings(build: _Build, paint: Colour) -> list[Surface]:
    """Lights, grille, bumpers, plates, mirrors, door lines and handles."""
    tip, tail = build.length / 2, -build.length / 2
    half = build.width / 2
    _, low, high, nose = build.lower[-1]
    _, rear_low, rear_high, stern = build.lower[0]
    parts = [
        box((0.06, nose * 1.1, (high - low) * 0.42), (tip - 0.01, 0, low + (high - low) * 0.36), colour=TRIM),
        box((0.03, 0.5, 0.11), (tip + 0.02, 0, low + (high - low) * 0.36), colour=PLATE),
        box((0.03, 0.5, 0.11), (tail - 0.005, 0, rear_low + (rear_high - rear_low) * 0.62), colour=PLATE),
        box((0.10, stern * 1.9, 0.16), (tail + 0.06, 0, rear_low + 0.04), colour=TRIM),
        box((0.14, nose * 1.96, 0.15), (tip - 0.05, 0, low + 0.02), colour=TRIM),
    ]
    belt = build.base[3]
    door = build.pillars[-1]
    middle = tip - build.overhang - build.wheelbase / 2
    sides = [
        box((0.24, 0.30, 0.13), (tip - 0.10, nose - 0.13, high - 0.08), colour=HEADLIGHT),
        box((0.12, 0.22, 0.20), (tail + 0.07, stern - 0.09, rear_high - 0.02), colour=TAILLIGHT),
        box((0.12, 0.18, 0.13), (build.base[1] - 0.30, half - 0.02, belt + 0.10), colour=paint),
        panel(door - 0.012, door + 0.012, half + 0.004, 0.36, belt - 0.10),
        panel(build.base[1] - 0.16, build.base[1] - 0.136, half + 0.004, 0.36, belt - 0.12),
        box((0.18, 0.02, 0.035), (door - 0.2, half + 0.006, belt - 0.18), colour=TRIM),
        box((build.wheelbase - build.wheel * 2.6, 0.03, 0.12), (middle, half - 0.02, 0.27), colour=TRIM),
    ]  # fmt: skip
    return parts + both_sides(sides)


def cranks() -> Surface:
    """Make a bicycle's cranks and pedals, turning about the y axis at the origin; the left pedal is ahead."""
    parts = [straight_tube((0.0, -0.09, 0.0), (0.0, 0.09, 0.0), 0.015, RIM)]
    for side in (-1.0, 1.0):
        at = side * CRANK, side * 0.09, 0.0
        parts.append(straight_tube((0.0, side * 0.08, 0.0), at, 0.012, RIM))
        parts.append(straight_tube(at, (side * CRANK, side * 0.18, 0.0), 0.018, TRIM))
    return one_surface(parts)


def bicycle(paint: Colour = (255, 200, 0), *, parked: bool = True) -> Surface:
    """Make a city bicycle with mudguards and a basket; where it is not parked, without cranks and pedals."""
    radius, rear, front = 0.34, -0.54, 0.54
    parts: list[Surface] = []
    angles = np.linspace(0, 2 * np.pi, 17)
    for x in (rear, front):
        rim = [(x + np.cos(t) * radius, 0.0, radius + np.sin(t) * radius) for t in angles]
        parts += [straight_tube(p, q, 0.02, TYRE, 4) for p, q in pairwise(rim)]
        for t in np.linspace(0, np.pi, 4, endpoint=False):
            c, s = np.cos(t) * (radius - 0.02), np.sin(t) * (radius - 0.02)
            parts.append(straight_tube((x - c, 0, radius - s), (x + c, 0, radius + s), 0.004, RIM, 3))
    crank, seat, head = (-0.08, 0.0, 0.29), (-0.24, 0.0, 0.78), (0.38, 0.0, 0.80)
    low_head = (0.42, 0.0, 0.62)
    for a, b in (
        (crank, seat), (crank, low_head), (seat, low_head), (crank, (rear, 0, radius)), (seat, (rear, 0, radius)),
        (head, (front, 0, radius)),
    ):  # fmt: skip
        parts.append(straight_tube(a, b, 0.022, paint))
    parts += [
        straight_tube(head, (0.35, 0, 1.02), 0.016, TRIM),
        straight_tube((0.35, 0, 1.02), (0.28, 0.29, 1.04), 0.016, TRIM),
        straight_tube((0.35, 0, 1.02), (0.28, -0.29, 1.04), 0.016, TRIM),
        straight_tube(seat, (-0.27, 0, 0.92), 0.015, RIM),
        box((0.27, 0.15, 0.06), (-0.27, 0, 0.95), colour=TRIM),
        box((0.26, 0.34, 0.03), (0.58, 0, 0.78), colour=TRIM),
        box((0.02, 0.34, 0.2), (0.70, 0, 0.88), colour=TRIM),
        box((0.02, 0.34, 0.2), (0.46, 0, 0.88), colour=TRIM),
        box((0.26, 0.02, 0.2), (0.58, 0.16, 0.88), colour=TRIM),
        box((0.26, 0.02, 0.2), (0.58, -0.16, 0.88), colour=TRIM),
    ]
    if parked:
        parts += [
            straight_tube((-0.08, -0.09, 0.29), (-0.08, 0.09, 0.29), 0.015, RIM),
            box((0.1, 0.09, 0.025), (-0.08, 0.15, 0.14), colour=TRIM),
            box((0.1, 0.09, 0.025), (-0.08, -0.15, 0.44), colour=TRIM),
        ]
    for t0, t1 in zip(np.linspace(0.5, 2.9, 6)[:-1], np.linspace(0.5, 2.9, 6)[1:], strict=True):
        arc = [(rear + np.cos(t) * (radius + 0.04), 0.0, radius + np.sin(t) * (radius + 0.04)) for t in (t0, t1)]
        parts.append(straight_tube(arc[0], arc[1], 0.018, paint, 4))
    return one_surface(parts)


_HEADLIGHT_WHITE: Colour = (255, 250, 228)
_REAR_RED: Colour = (150, 16, 14)
_BRAKE_RED: Colour = (255, 36, 22)
_INDICATOR_AMBER: Colour = (255, 160, 20)
_LAMP_OFFSET = 0.006  # m that a lit lamp stands out of its face
_LAMP_THICKNESS = 0.012  # m


def _vehicle_lamp(place: tuple[float, float, float], size: tuple[float, float], colour: Colour, out: float) -> Surface:
    """Make a lit rectangle (width, height) on a face of a lamp, `out` metres forward of it."""
    x, y, z = place
    return box((_LAMP_THICKNESS, *size), (x + out, y, z), colour=colour, material=SHINING)


@cache
def night_lamps(kind: str) -> Surface:
    """Return the headlights and rear lights of a kind of car, of the bus or a bicycle: they shine when it is dark.

    With the bus comes the light in it.
    """
    front, rear = lamp_places(kind)
    sizes = ((0.06, 0.06), (0.04, 0.05)) if kind == "bicycle" else ((0.24, 0.11), (0.18, 0.16))
    lamps = both_sides(
        [_vehicle_lamp(front, sizes[0], _HEADLIGHT_WHITE, 0.0), _vehicle_lamp(rear, sizes[1], _REAR_RED, 0.0)]
    )
    return one_surface([*lamps, bus_inside_lights()] if kind == "bus" else lamps)


@cache
def lit_lamps() -> dict[str, list[Surface]]:
    """Return what is lit now and then: ``sedan:brake``, ``sedan:left`` and ``sedan:right``, and so on."""
    found: dict[str, list[Surface]] = {}
    for kind in (*CAR_KINDS, "bus"):
        front, rear = lamp_places(kind)
        upper, lower = (rear[0], rear[1], rear[2] + 0.04), (rear[0], rear[1], rear[2] - 0.055)
        outer = (front[0], front[1] + 0.11, front[2])
        left = [
            _vehicle_lamp(lower, (0.2, 0.08), _INDICATOR_AMBER, -2 * _LAMP_OFFSET),
            _vehicle_lamp(outer, (0.09, 0.12), _INDICATOR_AMBER, _LAMP_OFFSET),
        ]
        found[f"{kind}:brake"] = [
            one_surface(both_sides([_vehicle_lamp(upper, (0.2, 0.11), _BRAKE_RED, -_LAMP_OFFSET)]))
        ]
        found[f"{kind}:left"] = [one_surface(left)]
        found[f"{kind}:right"] = [one_surface(both_sides(left)[len(left) :])]
    return found
