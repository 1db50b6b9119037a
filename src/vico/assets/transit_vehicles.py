"""City bus, tram, light rail and train: shapes that can be looked into, with their seats, doors and cabins.

Windows are openings; behind them are floor, seats and poles. The leaves of doors are shapes of their own. The bus is a
12 m low-floor bus. Trams are made of coupled sections. Light rail is a tram in other paint; trains have another roof,
couplers and a pantograph too.

Frames: a bus stands on z = 0 with its footprint's centre at the origin, +x forward, its three doors on the right. A
section of a tram or train stands on z = 0 with its middle at the origin, +x forward, doors on both sides. Metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import Colour, box, pose_matrix, tube
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
    mirror,
    one_surface,
    panel,
    quads,
    straight_tube,
    wheel,
)
from vico.rules import TRAM_SECTION, TRAM_SECTIONS, TRAM_WIDTH
from vico.world.mesh import Surface
from vico.world.transit import TRAM_DOORS

BUS_SIZE = (12.0, 2.55, 3.1)
#: Front overhang and wheelbase, metres.
BUS_AXLES = (2.75, 5.9)
#: Height of the floor riders stand on, metres.
BUS_FLOOR = 0.36
#: Doors on the right side: from x to x, metres.
BUS_DOORS = ((3.95, 5.35), (-0.75, 0.65), (-4.2, -2.9))

_BUS_LENGTH, _BUS_WIDTH, _BUS_HEIGHT = BUS_SIZE
_BUS_REAR, _BUS_NOSE, _BUS_HALF = -_BUS_LENGTH / 2, _BUS_LENGTH / 2, _BUS_WIDTH / 2
#: Middles of the outer faces of the left lamps, in front and at the rear, metres.
BUS_LAMPS = ((_BUS_NOSE + 0.04, _BUS_HALF - 0.38, 0.72), (_BUS_REAR - 0.02, _BUS_HALF - 0.3, 0.9))
# Sides are straight between these.
_BUS_STRAIGHT = (_BUS_REAR + 0.18, _BUS_NOSE - 0.35)
# Heights, metres.
_BUS_SILL = 0.32
_BUS_BELT = 1.12
_BUS_LINTEL = 2.46
_BUS_EAVES = 2.62
_BUS_CEILING = 2.6
_BUS_LEAF = 0.7  # width of a door leaf
# The lining's distance from the skin; it is drawn from within only.
_LINING = 0.05
# Windows and the pillars between them.
_BUS_PANE, _BUS_PANE_PITCH = 1.28, 1.36
_BUS_FIRST_PANE, _BUS_LAST_PANE = -5.6, 4.6

_BUS_WHITE: Colour = (236, 238, 238)
_BUS_INSIDE: Colour = (198, 202, 204)
_FLOOR: Colour = (92, 96, 100)
_BUS_SEAT: Colour = (34, 74, 128)
_POLE: Colour = (236, 190, 40)

# Rows of seats: x of the hips, metres; all on the left, those clear of the doors on the right; a bench at the back.
_BUS_ROWS = (3.2, 2.35, 1.5, 0.65, -0.2, -1.05, -1.9, -2.75, -3.6, -4.45)
_BUS_RIGHT_ROWS = (3.2, 2.35, 1.5, -1.9)
_BUS_BENCH = -5.3
_BUS_ACROSS = (1.0, 0.53)
_SEAT_HEIGHT = 0.45
_BUS_CAB = 4.3


@cache
def bus_places() -> tuple[NDArray[np.float64], int]:
    """Return where riders are: seats from the front to the back first, then room to stand, in the order of filling.

    Returns
    -------
    tuple
        Points on the floor, in the bus's frame, metres, float64, shape ``(n, 2)``, and how many of them are seats.
    """
    seats = [(x, y) for x in _BUS_ROWS for y in _BUS_ACROSS]
    seats += [(x, -y) for x in _BUS_RIGHT_ROWS for y in _BUS_ACROSS]
    seats += [(_BUS_BENCH, y) for y in (1.0, 0.53, 0.0, -0.53, -1.0)]
    standing = [(x, 0.0) for x in np.arange(3.9, -4.8, -0.55)]
    # Beside the doors, out of the way of who gets in.
    for a, b in BUS_DOORS[1:]:
        middle = (a + b) / 2
        standing += [(middle + dx, y) for dx in (0.45, -0.45, 0.0) for y in (-0.55, -0.95)]
    return np.array(seats + standing, np.float64), len(seats)


def _bus_panes(side: str) -> list[tuple[float, float]]:
    """Return the windows of a side, from x to x; doors have theirs."""
    panes = [(float(x), float(x) + _BUS_PANE) for x in np.arange(_BUS_FIRST_PANE, _BUS_LAST_PANE, _BUS_PANE_PITCH)]
    if side == "left":
        return panes
    clear = [(a, b) for a, b in panes if all(b < c or a > d for c, d in BUS_DOORS)]
    return sorted([*clear, *BUS_DOORS])


def _bus_wall(side: str) -> list[Surface]:
    """Make the left side (the right one has to be mirrored) between belt and eaves, open where windows are."""
    y, inner = _BUS_HALF, _BUS_HALF - _LINING
    cuts = [_BUS_STRAIGHT[0], *(x for pane in _bus_panes(side) for x in pane), _BUS_STRAIGHT[1]]
    parts = []
    for a, b in zip(cuts[::2], cuts[1::2], strict=True):
        parts.append(panel(a, b, y, _BUS_BELT, _BUS_LINTEL, _BUS_WHITE))
        parts.append(_inward_quads(a, b, inner, _BUS_BELT, _BUS_LINTEL))
    for a, b in _bus_between_doors(side, *_BUS_STRAIGHT):
        parts.append(panel(a, b, y, _BUS_SILL, _BUS_BELT, _BUS_WHITE))
        parts.append(_inward_quads(a, b, inner, BUS_FLOOR, _BUS_BELT))
    parts.append(panel(*_BUS_STRAIGHT, y, _BUS_LINTEL, _BUS_EAVES, _BUS_WHITE))
    parts.append(_inward_quads(*_BUS_STRAIGHT, inner, _BUS_LINTEL, _BUS_CEILING))
    return parts


def _bus_between_doors(side: str, start: float, end: float) -> list[tuple[float, float]]:
    """Return the stretches of a side below the windows, from x to x: the right one is open at its doors."""
    doors = [x for door in sorted(BUS_DOORS) for x in door] if side == "right" else []
    edges = [start, *doors, end]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _inward_quads(x0: float, x1: float, y: float, z0: float, z1: float) -> Surface:
    """Make an upright rectangle at `y` that is seen from the bus's middle."""
    return quads([[(x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1)]], _BUS_INSIDE)


def _bus_shell() -> list[Surface]:
    """Make everything painted white: below the windows, above them, and the corners between."""

    def ring(x: float, inset: float, heights: tuple[tuple[float, float], ...]) -> list[tuple[float, float, float]]:
        y = _BUS_HALF - inset
        return [(x, y - d, z) for d, z in heights] + [(x, -(y - d), z) for d, z in heights[::-1]]

    def skin(drop: tuple[float, float], heights: tuple[tuple[float, float], ...]) -> Surface:
        stations = (
            (_BUS_REAR, 0.12, drop[0]),
            (_BUS_STRAIGHT[0], 0.0, 0.0),
            (_BUS_STRAIGHT[1], 0.0, 0.0),
            (_BUS_NOSE, 0.14, drop[1]),
        )
        top = heights[-1][1]
        rings = [
            ring(x, inset, tuple((d, z - lower if z > top - 0.2 else z) for d, z in heights))
            for x, inset, lower in stations
        ]
        return loft(np.array(rings), _BUS_WHITE)

    roof = _BUS_HEIGHT - 0.1
    parts = [
        # Below the floor; the walls above it are open at the top.
        skin((0.0, 0.0), ((0.0, _BUS_SILL), (0.0, BUS_FLOOR - 0.01))),
        skin((0.02, 0.1), ((0.0, _BUS_EAVES), (0.12, roof - 0.06), (0.3, roof))),
        box((6.5, 1.7, 0.22), (-1.6, 0, _BUS_HEIGHT - 0.06), colour=(214, 217, 218)),
    ]
    corners = [
        quads(
            [
                [(x0, y0, _BUS_SILL), (x1, y1, _BUS_SILL), (x1, y1, _BUS_EAVES), (x0, y0, _BUS_EAVES)],
                [(x1, y1, _BUS_SILL), (x0, y0, _BUS_SILL), (x0, y0, _BUS_EAVES), (x1, y1, _BUS_EAVES)],
            ],
            _BUS_WHITE,
        )
        for (x0, y0), (x1, y1) in (
            ((_BUS_STRAIGHT[0], _BUS_HALF), (_BUS_REAR, _BUS_HALF - 0.12)),
            ((_BUS_REAR, _BUS_HALF - 0.12), (_BUS_REAR, _BUS_HALF - 0.32)),
            ((_BUS_NOSE, _BUS_HALF - 0.14), (_BUS_STRAIGHT[1], _BUS_HALF)),
            ((_BUS_NOSE, _BUS_HALF - 0.28), (_BUS_NOSE, _BUS_HALF - 0.14)),
        )
    ]
    return parts + both_sides(corners)


def _bus_lining() -> list[Surface]:
    """Make floor, ceiling, and the lower walls at both ends, seen from within."""
    x0, x1, y = _BUS_REAR + 0.05, _BUS_NOSE - 0.05, _BUS_HALF - _LINING
    floor = [(x0, -y, BUS_FLOOR), (x1, -y, BUS_FLOOR), (x1, y, BUS_FLOOR), (x0, y, BUS_FLOOR)]
    ceiling = [(x0, y, _BUS_CEILING), (x1, y, _BUS_CEILING), (x1, -y, _BUS_CEILING), (x0, -y, _BUS_CEILING)]
    return [
        quads([floor], _FLOOR),
        quads([ceiling], _BUS_INSIDE),
        front(x0, y, BUS_FLOOR, 1.5, _BUS_INSIDE),
        front(x1, -y, BUS_FLOOR, _BUS_BELT, _BUS_INSIDE),
    ]


def _bus_furniture() -> list[Surface]:
    """Make seats, poles, and what the driver sits behind."""
    places, count = bus_places()
    parts = []
    for x, y in places[:count]:
        # Riders' hips are at x: the seat reaches a hand behind them, the back stands there.
        parts.append(box((0.42, 0.44, 0.08), (x + 0.02, y, BUS_FLOOR + _SEAT_HEIGHT - 0.04), colour=_BUS_SEAT))
        parts.append(box((0.06, 0.44, 0.62), (x - 0.22, y, BUS_FLOOR + _SEAT_HEIGHT + 0.27), colour=_BUS_SEAT))
    for x in (3.5, 0.9, -1.3, -4.6):
        parts.append(tube((x, -0.28, BUS_FLOOR), (x, -0.28, _BUS_CEILING), 0.018, _POLE))
    parts.append(box((0.04, 1.0, 1.0), (_BUS_CAB, 0.72, BUS_FLOOR + 0.5), colour=_BUS_INSIDE))
    parts.append(box((0.45, 0.48, 0.5), (_BUS_CAB + 0.5, 0.7, BUS_FLOOR + 0.25), colour=TRIM))
    parts.append(box((0.08, 0.48, 0.7), (_BUS_CAB + 0.28, 0.7, BUS_FLOOR + 0.8), colour=TRIM))
    parts.append(box((0.3, 1.9, 0.3), (_BUS_NOSE - 0.3, 0.0, 0.98), colour=TRIM))
    return parts


def _bus_outside(paint: Colour, sign: Colour) -> list[Surface]:
    """Make stripe, wheels, lights, doors' frames, signs and bumpers."""
    axle = _BUS_NOSE - BUS_AXLES[0]
    sides: list[Surface] = []
    stripes = []
    for side in ("left", "right"):
        for a, b in _bus_between_doors(side, _BUS_REAR + 0.2, _BUS_NOSE - 0.4):
            stripe = panel(a, b, _BUS_HALF + 0.003, _BUS_SILL, _BUS_BELT - 0.16, paint)
            stripes.append(stripe if side == "left" else mirror(stripe))
    for x in (axle, axle - BUS_AXLES[1]):
        sides.append(arch(x, _BUS_HALF + 0.006, 0.58, _BUS_SILL))
        sides += wheel(x, _BUS_HALF + 0.012, 0.48, 0.3)
    sides.append(box((0.16, 0.26, 0.16), (_BUS_REAR + 0.06, _BUS_HALF - 0.3, 0.9), colour=TAILLIGHT))
    sides.append(box((0.12, 0.36, 0.18), (_BUS_NOSE - 0.02, _BUS_HALF - 0.38, 0.72), colour=HEADLIGHT))
    sides.append(box((0.10, 0.12, 0.18), (_BUS_NOSE - 0.05, _BUS_HALF - 0.16, 0.72), colour=INDICATOR))
    sides.append(box((0.10, 0.10, 0.36), (_BUS_NOSE - 0.1, _BUS_HALF, 2.2), colour=TRIM))
    parts = both_sides(sides) + stripes
    doors = [panel(a, b, _BUS_HALF + 0.007, _BUS_LINTEL, _BUS_EAVES - 0.04, TRIM) for a, b in BUS_DOORS]
    doors.append(panel(2.0, 3.4, _BUS_HALF + 0.014, _BUS_LINTEL + 0.01, _BUS_EAVES - 0.01, sign))
    parts += [mirror(part) for part in doors]
    back, nose = _BUS_REAR - 0.012, _BUS_NOSE + 0.012
    parts.append(front(nose, 0.85, _BUS_LINTEL + 0.04, 2.86, sign))
    parts.append(front(nose, _BUS_HALF - 0.14, _BUS_LINTEL, _BUS_EAVES, _BUS_WHITE))
    parts.append(front(_BUS_NOSE, _BUS_HALF - 0.14, _BUS_SILL, _BUS_BELT, _BUS_WHITE))
    parts.append(front(back, -_BUS_HALF + 0.12, 2.4, _BUS_EAVES, _BUS_WHITE))
    parts.append(front(back, -_BUS_HALF + 0.12, _BUS_SILL, 1.5, _BUS_WHITE))
    parts.append(front(back - 0.002, -0.35, 2.44, 2.6, sign))
    parts.append(box((0.08, _BUS_WIDTH - 0.5, 0.28), (_BUS_NOSE - 0.02, 0, 0.46), colour=TRIM))
    parts.append(box((0.08, _BUS_WIDTH - 0.5, 0.34), (_BUS_REAR + 0.02, 0, 0.5), colour=paint))
    return parts


def bus_door_leaves() -> tuple[list[tuple[float, float, float]], float]:
    """Return the leaves of the doors when closed (middle x, y, and which way along x each slides); their width."""
    leaves = []
    for a, b in BUS_DOORS:
        middle = (a + b) / 2
        leaves += [(middle + way * _BUS_LEAF / 2, -_BUS_HALF - 0.004, way) for way in (-1.0, 1.0)]
    return leaves, _BUS_LEAF


def bus_leaf() -> Surface:
    """Make a door leaf, its middle at the origin: a frame with glass below, seen from both sides."""
    half, y = _BUS_LEAF / 2, 0.004
    strips = [
        panel(-half, half, y, _BUS_SILL + 0.02, _BUS_SILL + 0.16, TRIM),
        panel(-half, half, y, _BUS_BELT - 0.06, _BUS_BELT, TRIM),
        panel(-half, half, y, _BUS_LINTEL - 0.06, _BUS_LINTEL, TRIM),
        panel(-half, -half + 0.05, y, _BUS_SILL + 0.16, _BUS_LINTEL - 0.06, TRIM),
        panel(half - 0.05, half, y, _BUS_SILL + 0.16, _BUS_LINTEL - 0.06, TRIM),
        panel(-half + 0.05, half - 0.05, y, _BUS_SILL + 0.16, _BUS_BELT - 0.06, GLASS),
    ]
    return one_surface(both_sides(strips))


def bus_inside_lights() -> Surface:
    """Return what shines in the bus when it is dark."""
    y = _BUS_HALF - _LINING - 0.01
    return inside_lights((_BUS_REAR + 0.06, -y, BUS_FLOOR + 0.003), (_BUS_NOSE - 0.9, y, _BUS_CEILING - 0.004))


def bus_cabin() -> Cabin:
    """Return the inside of the bus."""
    y = _BUS_HALF - _LINING / 2
    return Cabin(
        low=(_BUS_REAR + 0.03, -y, BUS_FLOOR - 0.02),
        high=(_BUS_NOSE - 0.03, y, _BUS_CEILING + 0.01),
        windows=(_BUS_BELT, _BUS_LINTEL),
        left=tuple(_bus_panes("left")),
        right=tuple(_bus_panes("right")),
        front=(_BUS_BELT, _BUS_LINTEL),
        rear=(1.5, 2.4),
        end_half=_BUS_HALF - 0.3,
    )


def bus(paint: Colour = (0, 114, 178), sign: Colour = (246, 170, 30)) -> Surface:
    """Make the bus.

    Parameters
    ----------
    paint, sign
        Colours of the stripe along its sides, and of the lit line signs.
    """
    walls = _bus_wall("left") + [mirror(part) for part in _bus_wall("right")]
    return one_surface([*_bus_shell(), *walls, *_bus_lining(), *_bus_furniture(), *_bus_outside(paint, sign)])


TRAM_HEIGHT = 3.4
#: Height of the floor riders stand on, metres.
TRAM_FLOOR = 0.36

#: Metres at either end of a section that belong to the bellows.
TRAM_BELLOWS = 0.22

_TRAM_HALF = TRAM_WIDTH / 2
_TRAM_END = TRAM_SECTION / 2 - TRAM_BELLOWS
# Heights, metres.
_TRAM_SILL = 0.22
_TRAM_BELT = 1.1
_TRAM_LINTEL = 2.4
_TRAM_EAVES = 2.85
_TRAM_CEILING = 2.7
_TRAM_LEAF = 0.64  # width of a leaf; a door has two
_TRAM_PANES = ((-3.86, -3.12), (-1.48, -0.05), (0.05, 1.48), (3.12, 3.86))
_TRAM_ROWS = (1.1, 0.25, -0.6, -1.35)
_TRAM_ACROSS = (0.93, 0.46)

#: Paint of the sides, of what is above it, and of seats.
TRAM_PAINT: Colour = (0, 124, 80)
TRAM_CREAM: Colour = (238, 226, 168)
_TRAM_INSIDE: Colour = (200, 204, 204)
TRAM_SEAT: Colour = (44, 98, 76)
_BELLOWS_COLOUR: Colour = (44, 46, 50)


@cache
def tram_places() -> tuple[NDArray[np.float64], int]:
    """Return where riders are: seats first, then room to stand, in the order of filling.

    Returns
    -------
    tuple
        Section (from the front), and where in it on the floor, metres, float64, shape ``(n, 3)``; how many are seats.
    """
    sections = range(TRAM_SECTIONS)
    seats = [(k, x, y) for k in sections for x in _TRAM_ROWS for across in _TRAM_ACROSS for y in (across, -across)]
    standing = [(k, x, 0.0) for k in sections for x in (2.9, 2.3, 1.7, -1.95, -2.6)]
    standing += [(k, a + d, y) for k in sections for a in TRAM_DOORS for d, y in ((0.35, 0.55), (-0.35, -0.55))]
    return np.array(seats + standing, np.float64), len(seats)


#: How many a tram takes.
TRAM_CAPACITY = len(tram_places()[0])


def tram_door_leaves() -> tuple[list[tuple[float, float, float]], float]:
    """Return the leaves of a section's doors, closed (middle x, y, which way along x each slides), and their width."""
    leaves = []
    for middle in TRAM_DOORS:
        for way in (-1.0, 1.0):
            leaves += [(middle + way * _TRAM_LEAF / 2, y, way) for y in (-_TRAM_HALF, _TRAM_HALF)]
    return leaves, _TRAM_LEAF


def tram_cabin() -> Cabin:
    """Return the inside of a section, up to the middle of the bellows."""
    y, end = _TRAM_HALF - _LINING / 2, TRAM_SECTION / 2
    panes = tuple(sorted([*_TRAM_PANES, *((middle - _TRAM_LEAF, middle + _TRAM_LEAF) for middle in TRAM_DOORS)]))
    return Cabin(
        (-end, -y, TRAM_FLOOR - 0.02), (end, y, _TRAM_CEILING + 0.01), (_TRAM_BELT, _TRAM_LINTEL), panes, panes
    )


def _tram_sides() -> list[Surface]:
    parts: list[Surface] = []

    def wall(a: float, b: float, low: float, high: float, colour: Colour) -> None:
        parts.append(panel(a, b, _TRAM_HALF, low, high, colour))
        y = _TRAM_HALF - _LINING
        parts.append(
            quads(
                [
                    [
                        (a, y, max(low, TRAM_FLOOR)),
                        (b, y, max(low, TRAM_FLOOR)),
                        (b, y, min(high, _TRAM_CEILING)),
                        (a, y, min(high, _TRAM_CEILING)),
                    ]
                ],
                _TRAM_INSIDE,
            )
        )

    # The edges of the stretches of a side between the doors
    edges = [
        -_TRAM_END,
        *(x for middle in sorted(TRAM_DOORS) for x in (middle - _TRAM_LEAF, middle + _TRAM_LEAF)),
        _TRAM_END,
    ]
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        wall(a, b, _TRAM_SILL, _TRAM_BELT, TRAM_PAINT)
        cuts = [a, *(x for pane in _TRAM_PANES if a <= pane[0] and pane[1] <= b for x in pane), b]
        for c, d in zip(cuts[::2], cuts[1::2], strict=True):
            wall(c, d, _TRAM_BELT, _TRAM_LINTEL, TRAM_CREAM)
    wall(-_TRAM_END, _TRAM_END, _TRAM_LINTEL, _TRAM_EAVES, TRAM_CREAM)
    return both_sides(parts)


def _tram_shell(nose: bool) -> list[Surface]:
    def ring(x: float, inset: float, heights: tuple[tuple[float, float], ...]) -> list[tuple[float, float, float]]:
        y = _TRAM_HALF - inset
        return [(x, y - d, z) for d, z in heights] + [(x, -(y - d), z) for d, z in heights[::-1]]

    def skin(heights: tuple[tuple[float, float], ...], colour: Colour) -> Surface:
        return loft(np.array([ring(x, 0.0, heights) for x in (-_TRAM_END, _TRAM_END)]), colour)

    y, x0, x1 = _TRAM_HALF - _LINING, -_TRAM_END, _TRAM_END
    parts = [
        skin(((0.1, 0.14), (0.0, _TRAM_SILL), (0.0, TRAM_FLOOR - 0.01)), TRIM),
        skin(((0.0, _TRAM_EAVES), (0.12, TRAM_HEIGHT - 0.36), (0.3, TRAM_HEIGHT - 0.3)), TRAM_CREAM),
        box((2.6, 1.5, 0.28), (0.4, 0.0, TRAM_HEIGHT - 0.16), colour=(206, 208, 206)),
        quads([[(x0, -y, TRAM_FLOOR), (x1, -y, TRAM_FLOOR), (x1, y, TRAM_FLOOR), (x0, y, TRAM_FLOOR)]], _FLOOR),
        quads(
            [[(x0, y, _TRAM_CEILING), (x1, y, _TRAM_CEILING), (x1, -y, _TRAM_CEILING), (x0, -y, _TRAM_CEILING)]],
            _TRAM_INSIDE,
        ),
        *_tram_sides(),
    ]
    for x in (-2.9, 2.9):
        for sign in (-1, 1):
            parts.append(box((1.7, 0.06, 0.3), (x * 0.35, sign * (_TRAM_HALF - 0.16), 0.17), colour=TRIM))
    for end in [-1.0] if nose else [-1.0, 1.0]:
        x = end * (_TRAM_END + 0.1)
        parts.append(box((0.24, TRAM_WIDTH - 0.3, 0.26), (x, 0.0, TRAM_FLOOR - 0.13), colour=_BELLOWS_COLOUR))
        parts.append(box((0.24, TRAM_WIDTH - 0.3, 0.2), (x, 0.0, _TRAM_CEILING + 0.06), colour=_BELLOWS_COLOUR))
        parts += both_sides(
            [box((0.24, 0.12, _TRAM_CEILING - TRAM_FLOOR), (x, _TRAM_HALF - 0.21, 1.5), colour=_BELLOWS_COLOUR)]
        )
    return parts + (_tram_nose() if nose else [])


def _tram_nose() -> list[Surface]:
    x = _TRAM_END
    parts = [
        front(x + 0.002, _TRAM_HALF, _TRAM_SILL, _TRAM_BELT, TRAM_PAINT),
        front(x + 0.002, _TRAM_HALF, _TRAM_LINTEL + 0.05, _TRAM_EAVES, TRAM_CREAM),
        front(x + 0.03, 0.75, _TRAM_LINTEL + 0.1, _TRAM_EAVES - 0.06, (246, 170, 30)),
        front(x - 0.06, -_TRAM_HALF, TRAM_FLOOR, _TRAM_BELT, _TRAM_INSIDE),
        box((0.2, TRAM_WIDTH - 0.3, 0.34), (x + 0.08, 0.0, 0.42), colour=TRIM),
        box((0.04, TRAM_WIDTH - 0.2, 1.9), (x - 0.72, 0.0, TRAM_FLOOR + 0.95), colour=(120, 128, 126)),
        box((0.3, 1.7, 0.25), (x - 0.25, 0.0, 1.0), colour=TRIM),
    ]
    parts += both_sides(
        [
            box((0.1, 0.12, 1.4), (x - 0.02, _TRAM_HALF - 0.06, 1.75), colour=TRAM_CREAM),
            box((0.08, 0.3, 0.18), (x + 0.02, _TRAM_HALF - 0.36, 0.82), colour=HEADLIGHT),
            box((0.06, 0.2, 0.12), (x + 0.02, _TRAM_HALF - 0.16, 1.0), colour=TAILLIGHT),
        ]
    )
    return parts


def _tram_furniture() -> list[Surface]:
    parts: list[Surface] = []
    for x in _TRAM_ROWS:
        for across in _TRAM_ACROSS:
            for y in (across, -across):
                parts.append(box((0.4, 0.4, 0.08), (x + 0.02, y, TRAM_FLOOR + _SEAT_HEIGHT - 0.04), colour=TRAM_SEAT))
                parts.append(box((0.06, 0.4, 0.6), (x - 0.21, y, TRAM_FLOOR + _SEAT_HEIGHT + 0.26), colour=TRAM_SEAT))
    return parts


def _tram_leaf() -> Surface:
    """Make a door leaf whose outer side faces both ways, its middle at the origin."""
    half, y = _TRAM_LEAF / 2, 0.02
    strips = [
        panel(-half, half, y, _TRAM_SILL + 0.04, 0.5, TRAM_PAINT),
        panel(-half, half, y, _TRAM_LINTEL - 0.06, _TRAM_EAVES - 0.12, TRIM),
        panel(-half, -half + 0.06, y, 0.5, _TRAM_LINTEL - 0.06, TRIM),
        panel(half - 0.06, half, y, 0.5, _TRAM_LINTEL - 0.06, TRIM),
        panel(-half + 0.06, half - 0.06, y, 0.5, _TRAM_BELT, GLASS),
    ]
    return one_surface(both_sides(strips))


@cache
def tram_prototypes() -> dict[str, list[Surface]]:
    """Return the shapes of a tram: front, middle and rear section, and a door leaf."""
    turned = pose_matrix(yaw=np.pi)
    y = _TRAM_HALF - _LINING - 0.01
    lit = inside_lights((-_TRAM_END, -y, TRAM_FLOOR + 0.003), (_TRAM_END, y, _TRAM_CEILING - 0.004))
    return {
        "tram_front": [one_surface([*_tram_shell(nose=True), *_tram_furniture()]), lit],
        "tram_middle": [one_surface([*_tram_shell(nose=False), *_tram_furniture()]), lit],
        "tram_rear": [one_surface([*(part.moved(turned) for part in _tram_shell(nose=True)), *_tram_furniture()]), lit],
        "tram_leaf": [_tram_leaf()],
    }


#: What lines of a kind (`TramLine.kind`) are made of: the names of their shapes begin so.
SHAPES_OF = {"tram": "tram", "light_rail": "light_rail", "rail": "train"}
_TRAIN_PAINTS: Mapping[Colour, Colour] = {
    TRAM_PAINT: (168, 26, 38),
    TRAM_CREAM: (222, 224, 226),
    TRAM_SEAT: (42, 58, 110),
}
_LIGHT_RAIL_PAINTS: Mapping[Colour, Colour] = {
    TRAM_PAINT: (28, 84, 150),
    TRAM_CREAM: (234, 236, 236),
    TRAM_SEAT: (60, 78, 120),
}
_ROOF_COLOUR: Colour = (150, 154, 158)
_STEEL_COLOUR: Colour = (96, 100, 104)


@cache
def train_prototypes() -> dict[str, list[Surface]]:
    """Return the shapes of trains and of light rail: front, middle and rear section, and a door leaf of each."""
    turned = pose_matrix(yaw=np.pi)
    found = {}
    for name, surfaces in tram_prototypes().items():
        part = name.removeprefix("tram_")
        found[f"light_rail_{part}"] = _repaint(surfaces, _LIGHT_RAIL_PAINTS)
        train = _repaint(surfaces, _TRAIN_PAINTS)
        if part != "leaf":
            parts = _train_roof() + (_train_pantograph() if part == "middle" else _train_cab())
            if part == "rear":
                parts = [extra.moved(turned) for extra in parts]
            train[0] = one_surface([train[0], *parts])
        found[f"train_{part}"] = train
    return found


def _repaint(surfaces: list[Surface], paints: Mapping[Colour, Colour]) -> list[Surface]:
    found = []
    for surface in surfaces:
        colour = surface.colour.copy()
        for old, new in paints.items():
            colour[(surface.colour == np.array(old, np.uint8)).all(axis=1)] = new
        found.append(replace(surface, colour=colour))
    return found


def _train_roof() -> list[Surface]:
    """Make a deep roof along a section, and bogies and boxes under it."""
    length = TRAM_SECTION - 0.7
    parts = [
        box((length, TRAM_WIDTH - 0.5, 0.16), (0.0, 0.0, TRAM_HEIGHT - 0.24), colour=_ROOF_COLOUR),
        box((2.2, TRAM_WIDTH - 0.9, 0.26), (-2.4, 0.0, TRAM_HEIGHT - 0.06), colour=_ROOF_COLOUR),
        box((1.9, 0.5, 0.18), (0.0, 0.0, 0.12), colour=_STEEL_COLOUR),
    ]
    for x in (-2.9, 2.9):
        parts.append(box((2.0, TRAM_WIDTH - 0.4, 0.2), (x, 0.0, 0.13), colour=TRIM))
    return parts


def _train_cab() -> list[Surface]:
    """Make what is at a train's end: a coupler, a plough, and the paint around the windscreen."""
    x, half = TRAM_SECTION / 2 - 0.2, TRAM_WIDTH / 2
    red = _TRAIN_PAINTS[TRAM_PAINT]
    parts = [
        box((0.3, 0.3, 0.26), (x + 0.14, 0.0, 0.66), colour=TRIM),
        box((0.1, TRAM_WIDTH - 0.5, 0.24), (x + 0.12, 0.0, 0.16), colour=_STEEL_COLOUR),
        box((0.14, 1.2, 0.42), (x, 0.0, 0.82), colour=(236, 190, 24)),
    ]
    for side in (-1.0, 1.0):
        parts.append(box((0.14, 0.3, 1.3), (x, side * (half - 0.18), 1.8), colour=red))
    return parts


def _train_pantograph() -> list[Surface]:
    """Make the current collector on the roof, raised to the wire."""
    z = TRAM_HEIGHT - 0.1
    parts = [
        box((0.9, 0.9, 0.1), (1.2, 0.0, z), colour=_STEEL_COLOUR),
        box((0.16, 1.5, 0.05), (0.6, 0.0, z + 1.3), colour=TRIM),
    ]
    for y in (-0.25, 0.25):
        parts += [
            straight_tube((0.9, y, z), (1.6, y, z + 0.65), 0.025, _STEEL_COLOUR),
            straight_tube((1.6, y, z + 0.65), (0.6, y, z + 1.28), 0.02, _STEEL_COLOUR),
        ]
    return parts


#: Ends of the names of sections of trams and trains, which are alike inside.
_SECTION_SUFFIXES = ("_front", "_middle", "_rear")
_RAIL_KINDS = ("tram", "light_rail", "train")


@cache
def cabin_of(name: str, *, mirrored: bool = False) -> Cabin | None:
    """Return the inside of a vehicle's prototype, None of what has none that is seen.

    Parameters
    ----------
    name
        As in `vico.assets.vehicles.vehicle_prototypes`, `tram_prototypes` and `train_prototypes`.
    mirrored
        Whether a bus has its doors on the left.
    """
    if name == "bus":
        cabin = bus_cabin()
        return replace(cabin, left=cabin.right, right=cabin.left) if mirrored else cabin
    if name.endswith(_SECTION_SUFFIXES) and name.rpartition("_")[0] in _RAIL_KINDS:
        return tram_cabin()
    return None
