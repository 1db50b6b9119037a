"""A 12 m low-floor city bus that can be looked into: windows are openings, behind them floor, seats and poles.

It stands on z = 0 with its footprint's centre at the origin, +x forward, its three doors on the right, metres.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import Colour, box, tube
from vico.assets.vehicle_parts import (
    GLASS,
    HEADLIGHT,
    INDICATOR,
    TAILLIGHT,
    TRIM,
    Cabin,
    arch,
    both_sides,
    front,
    inside_lights,
    loft,
    mirrored,
    one_surface,
    panel,
    quads,
    wheel,
)
from vico.world.mesh import Surface

BUS_SIZE = (12.0, 2.55, 3.1)
#: Front overhang and wheelbase, metres.
BUS_AXLES = (2.75, 5.9)
#: Height of the floor riders stand on, metres.
BUS_FLOOR = 0.36
#: Doors on the right side: from x to x, metres.
BUS_DOORS = ((3.95, 5.35), (-0.75, 0.65), (-4.2, -2.9))

_LENGTH, _WIDTH, _HEIGHT = BUS_SIZE
_REAR, _NOSE, _HALF = -_LENGTH / 2, _LENGTH / 2, _WIDTH / 2
# Sides are straight between these.
#: Middles of the outer faces of the left lamps, in front and at the rear, metres.
BUS_LAMPS = ((_NOSE + 0.04, _HALF - 0.38, 0.72), (_REAR - 0.02, _HALF - 0.3, 0.9))
_STRAIGHT = (_REAR + 0.18, _NOSE - 0.35)
_LOW, _BELT, _LINTEL, _EAVES = 0.32, 1.12, 2.46, 2.62
_CEILING = 2.6
_LEAF = 0.7  # width of a door leaf
# The lining's distance from the skin; it is drawn from within only.
_LINING = 0.05
# Windows and the pillars between them.
_PANE, _PITCH = 1.28, 1.36
_FIRST_PANE, _LAST_PANE = -5.6, 4.6

_WHITE: Colour = (236, 238, 238)
_INSIDE: Colour = (198, 202, 204)
_FLOOR: Colour = (92, 96, 100)
_SEAT: Colour = (34, 74, 128)
_POLE: Colour = (236, 190, 40)

# Rows of seats: x of the hips, metres; all on the left, those clear of the doors on the right; a bench at the back.
_ROWS = (3.2, 2.35, 1.5, 0.65, -0.2, -1.05, -1.9, -2.75, -3.6, -4.45)
_RIGHT_ROWS = (3.2, 2.35, 1.5, -1.9)
_BENCH = -5.3
_ACROSS = (1.0, 0.53)
_SEAT_HEIGHT = 0.45
_CAB = 4.3


@cache
def bus_places() -> tuple[NDArray[np.float64], int]:
    """Return where riders are: seats from the front to the back first, then room to stand, in the order of filling.

    Returns
    -------
    tuple
        Points on the floor, in the bus's frame, metres, float64, shape ``(n, 2)``, and how many of them are seats.
    """
    seats = [(x, y) for x in _ROWS for y in _ACROSS]
    seats += [(x, -y) for x in _RIGHT_ROWS for y in _ACROSS]
    seats += [(_BENCH, y) for y in (1.0, 0.53, 0.0, -0.53, -1.0)]
    standing = [(x, 0.0) for x in np.arange(3.9, -4.8, -0.55)]
    # Beside the doors, out of the way of who gets in.
    for a, b in BUS_DOORS[1:]:
        middle = (a + b) / 2
        standing += [(middle + dx, y) for dx in (0.45, -0.45, 0.0) for y in (-0.55, -0.95)]
    return np.array(seats + standing, np.float64), len(seats)


def _panes(side: str) -> list[tuple[float, float]]:
    """Return the windows of a side, from x to x; doors have theirs."""
    panes = [(float(x), float(x) + _PANE) for x in np.arange(_FIRST_PANE, _LAST_PANE, _PITCH)]
    if side == "left":
        return panes
    clear = [(a, b) for a, b in panes if all(b < c or a > d for c, d in BUS_DOORS)]
    return sorted([*clear, *BUS_DOORS])


def _wall(side: str) -> list[Surface]:
    """Make the left side (the right one has to be mirrored) between belt and eaves, open where windows are."""
    y, inner = _HALF, _HALF - _LINING
    cuts = [_STRAIGHT[0], *(x for pane in _panes(side) for x in pane), _STRAIGHT[1]]
    parts = []
    for a, b in zip(cuts[::2], cuts[1::2], strict=True):
        parts.append(panel(a, b, y, _BELT, _LINTEL, _WHITE))
        parts.append(_inward(a, b, inner, _BELT, _LINTEL))
    for a, b in _between_doors(side, *_STRAIGHT):
        parts.append(panel(a, b, y, _LOW, _BELT, _WHITE))
        parts.append(_inward(a, b, inner, BUS_FLOOR, _BELT))
    parts.append(panel(*_STRAIGHT, y, _LINTEL, _EAVES, _WHITE))
    parts.append(_inward(*_STRAIGHT, inner, _LINTEL, _CEILING))
    return parts


def _between_doors(side: str, start: float, end: float) -> list[tuple[float, float]]:
    """Return the stretches of a side below the windows, from x to x: the right one is open at its doors."""
    doors = [x for door in sorted(BUS_DOORS) for x in door] if side == "right" else []
    edges = [start, *doors, end]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _inward(x0: float, x1: float, y: float, z0: float, z1: float) -> Surface:
    """Make an upright rectangle at `y` that is seen from the bus's middle."""
    return quads([[(x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1)]], _INSIDE)


def _shell() -> list[Surface]:
    """Make everything painted white: below the windows, above them, and the corners between."""

    def ring(x: float, inset: float, heights: tuple[tuple[float, float], ...]) -> list[tuple[float, float, float]]:
        y = _HALF - inset
        return [(x, y - d, z) for d, z in heights] + [(x, -(y - d), z) for d, z in heights[::-1]]

    def skin(drop: tuple[float, float], heights: tuple[tuple[float, float], ...]) -> Surface:
        stations = ((_REAR, 0.12, drop[0]), (_STRAIGHT[0], 0.0, 0.0), (_STRAIGHT[1], 0.0, 0.0), (_NOSE, 0.14, drop[1]))
        top = heights[-1][1]
        rings = [
            ring(x, inset, tuple((d, z - lower if z > top - 0.2 else z) for d, z in heights))
            for x, inset, lower in stations
        ]
        return loft(np.array(rings), _WHITE)

    roof = _HEIGHT - 0.1
    parts = [
        # Below the floor; the walls above it are open at the top.
        skin((0.0, 0.0), ((0.0, _LOW), (0.0, BUS_FLOOR - 0.01))),
        skin((0.02, 0.1), ((0.0, _EAVES), (0.12, roof - 0.06), (0.3, roof))),
        box((6.5, 1.7, 0.22), (-1.6, 0, _HEIGHT - 0.06), colour=(214, 217, 218)),
    ]
    corners = [
        quads(
            [
                [(x0, y0, _LOW), (x1, y1, _LOW), (x1, y1, _EAVES), (x0, y0, _EAVES)],
                [(x1, y1, _LOW), (x0, y0, _LOW), (x0, y0, _EAVES), (x1, y1, _EAVES)],
            ],
            _WHITE,
        )
        for (x0, y0), (x1, y1) in (
            ((_STRAIGHT[0], _HALF), (_REAR, _HALF - 0.12)),
            ((_REAR, _HALF - 0.12), (_REAR, _HALF - 0.32)),
            ((_NOSE, _HALF - 0.14), (_STRAIGHT[1], _HALF)),
            ((_NOSE, _HALF - 0.28), (_NOSE, _HALF - 0.14)),
        )
    ]
    return parts + both_sides(corners)


def _lining() -> list[Surface]:
    """Make floor, ceiling, and the lower walls at both ends, seen from within."""
    x0, x1, y = _REAR + 0.05, _NOSE - 0.05, _HALF - _LINING
    floor = [(x0, -y, BUS_FLOOR), (x1, -y, BUS_FLOOR), (x1, y, BUS_FLOOR), (x0, y, BUS_FLOOR)]
    ceiling = [(x0, y, _CEILING), (x1, y, _CEILING), (x1, -y, _CEILING), (x0, -y, _CEILING)]
    return [
        quads([floor], _FLOOR),
        quads([ceiling], _INSIDE),
        front(x0, y, BUS_FLOOR, 1.5, _INSIDE),
        front(x1, -y, BUS_FLOOR, _BELT, _INSIDE),
    ]


def _furniture() -> list[Surface]:
    """Make seats, poles, and what the driver sits behind."""
    places, count = bus_places()
    parts = []
    for x, y in places[:count]:
        # Riders' hips are at x: the seat reaches a hand behind them, the back stands there.
        parts.append(box((0.42, 0.44, 0.08), (x + 0.02, y, BUS_FLOOR + _SEAT_HEIGHT - 0.04), colour=_SEAT))
        parts.append(box((0.06, 0.44, 0.62), (x - 0.22, y, BUS_FLOOR + _SEAT_HEIGHT + 0.27), colour=_SEAT))
    for x in (3.5, 0.9, -1.3, -4.6):
        parts.append(tube((x, -0.28, BUS_FLOOR), (x, -0.28, _CEILING), 0.018, _POLE))
    parts.append(box((0.04, 1.0, 1.0), (_CAB, 0.72, BUS_FLOOR + 0.5), colour=_INSIDE))
    parts.append(box((0.45, 0.48, 0.5), (_CAB + 0.5, 0.7, BUS_FLOOR + 0.25), colour=TRIM))
    parts.append(box((0.08, 0.48, 0.7), (_CAB + 0.28, 0.7, BUS_FLOOR + 0.8), colour=TRIM))
    parts.append(box((0.3, 1.9, 0.3), (_NOSE - 0.3, 0.0, 0.98), colour=TRIM))
    return parts


def _outside(paint: Colour, sign: Colour) -> list[Surface]:
    """Make stripe, wheels, lights, doors' frames, signs and bumpers."""
    axle = _NOSE - BUS_AXLES[0]
    sides: list[Surface] = []
    stripes = []
    for side in ("left", "right"):
        for a, b in _between_doors(side, _REAR + 0.2, _NOSE - 0.4):
            stripe = panel(a, b, _HALF + 0.003, _LOW, _BELT - 0.16, paint)
            stripes.append(stripe if side == "left" else mirrored(stripe))
    for x in (axle, axle - BUS_AXLES[1]):
        sides.append(arch(x, _HALF + 0.006, 0.58, _LOW))
        sides += wheel(x, _HALF + 0.012, 0.48, 0.3)
    sides.append(box((0.16, 0.26, 0.16), (_REAR + 0.06, _HALF - 0.3, 0.9), colour=TAILLIGHT))
    sides.append(box((0.12, 0.36, 0.18), (_NOSE - 0.02, _HALF - 0.38, 0.72), colour=HEADLIGHT))
    sides.append(box((0.10, 0.12, 0.18), (_NOSE - 0.05, _HALF - 0.16, 0.72), colour=INDICATOR))
    sides.append(box((0.10, 0.10, 0.36), (_NOSE - 0.1, _HALF, 2.2), colour=TRIM))
    parts = both_sides(sides) + stripes
    doors = [panel(a, b, _HALF + 0.007, _LINTEL, _EAVES - 0.04, TRIM) for a, b in BUS_DOORS]
    doors.append(panel(2.0, 3.4, _HALF + 0.014, _LINTEL + 0.01, _EAVES - 0.01, sign))
    parts += [mirrored(part) for part in doors]
    back, nose = _REAR - 0.012, _NOSE + 0.012
    parts.append(front(nose, 0.85, _LINTEL + 0.04, 2.86, sign))
    parts.append(front(nose, _HALF - 0.14, _LINTEL, _EAVES, _WHITE))
    parts.append(front(_NOSE, _HALF - 0.14, _LOW, _BELT, _WHITE))
    parts.append(front(back, -_HALF + 0.12, 2.4, _EAVES, _WHITE))
    parts.append(front(back, -_HALF + 0.12, _LOW, 1.5, _WHITE))
    parts.append(front(back - 0.002, -0.35, 2.44, 2.6, sign))
    parts.append(box((0.08, _WIDTH - 0.5, 0.28), (_NOSE - 0.02, 0, 0.46), colour=TRIM))
    parts.append(box((0.08, _WIDTH - 0.5, 0.34), (_REAR + 0.02, 0, 0.5), colour=paint))
    return parts


def bus_door_leaves() -> tuple[list[tuple[float, float, float]], float]:
    """Return the leaves of the doors when closed (middle x, y, and which way along x each slides); their width."""
    leaves = []
    for a, b in BUS_DOORS:
        middle = (a + b) / 2
        leaves += [(middle + way * _LEAF / 2, -_HALF - 0.004, way) for way in (-1.0, 1.0)]
    return leaves, _LEAF


def bus_leaf() -> Surface:
    """Make a door leaf, its middle at the origin: a frame with glass below, seen from both sides."""
    half, y = _LEAF / 2, 0.004
    strips = [
        panel(-half, half, y, _LOW + 0.02, _LOW + 0.16, TRIM),
        panel(-half, half, y, _BELT - 0.06, _BELT, TRIM),
        panel(-half, half, y, _LINTEL - 0.06, _LINTEL, TRIM),
        panel(-half, -half + 0.05, y, _LOW + 0.16, _LINTEL - 0.06, TRIM),
        panel(half - 0.05, half, y, _LOW + 0.16, _LINTEL - 0.06, TRIM),
        panel(-half + 0.05, half - 0.05, y, _LOW + 0.16, _BELT - 0.06, GLASS),
    ]
    return one_surface(both_sides(strips))


def bus_inside_lights() -> Surface:
    """Return what shines in the bus when it is dark."""
    y = _HALF - _LINING - 0.01
    return inside_lights((_REAR + 0.06, -y, BUS_FLOOR + 0.003), (_NOSE - 0.9, y, _CEILING - 0.004))


def bus_cabin() -> Cabin:
    """Return the inside of the bus."""
    y = _HALF - _LINING / 2
    return Cabin(
        low=(_REAR + 0.03, -y, BUS_FLOOR - 0.02),
        high=(_NOSE - 0.03, y, _CEILING + 0.01),
        windows=(_BELT, _LINTEL),
        left=tuple(_panes("left")),
        right=tuple(_panes("right")),
        front=(_BELT, _LINTEL),
        rear=(1.5, 2.4),
        end_half=_HALF - 0.3,
    )


def bus(paint: Colour = (0, 114, 178), sign: Colour = (246, 170, 30)) -> Surface:
    """Make the bus.

    Parameters
    ----------
    paint, sign
        Colours of the stripe along its sides, and of the lit line signs.
    """
    walls = _wall("left") + [mirrored(part) for part in _wall("right")]
    return one_surface([*_shell(), *walls, *_lining(), *_furniture(), *_outside(paint, sign)])
