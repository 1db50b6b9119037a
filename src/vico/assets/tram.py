"""A low-floor tram of coupled sections that can be looked into; the leaves of its doors are shapes of their own.

A section stands on z = 0 with its middle at the origin, +x forward; doors are on both sides. Metres.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import Colour, box, pose_matrix
from vico.assets.vehicle_parts import (
    GLASS,
    HEADLIGHT,
    TAILLIGHT,
    TRIM,
    Cabin,
    both_sides,
    front,
    inside_lights,
    loft,
    one_surface,
    panel,
    quads,
)
from vico.rules import TRAM_SECTION, TRAM_SECTIONS, TRAM_WIDTH
from vico.world.mesh import Surface
from vico.world.transit import TRAM_DOORS

TRAM_HEIGHT = 3.4
#: Height of the floor riders stand on, metres.
TRAM_FLOOR = 0.36

#: Metres at either end of a section that belong to the bellows.
TRAM_BELLOWS = 0.22

_HALF = TRAM_WIDTH / 2
_END = TRAM_SECTION / 2 - TRAM_BELLOWS
_LOW, _BELT, _LINTEL, _EAVES, _CEILING = 0.22, 1.1, 2.4, 2.85, 2.7
_LINING = 0.05
_LEAF = 0.64  # width of a leaf; a door has two
_PANES = ((-3.86, -3.12), (-1.48, -0.05), (0.05, 1.48), (3.12, 3.86))
_ROWS = (1.1, 0.25, -0.6, -1.35)
_ACROSS = (0.93, 0.46)
_SEAT_HEIGHT = 0.45

#: Paint of the sides, of what is above it, and of seats.
PAINT: Colour = (0, 124, 80)
CREAM: Colour = (238, 226, 168)
_INSIDE: Colour = (200, 204, 204)
_FLOOR: Colour = (92, 96, 100)
SEAT: Colour = (44, 98, 76)
_BELLOWS: Colour = (44, 46, 50)


@cache
def tram_places() -> tuple[NDArray[np.float64], int]:
    """Return where riders are: seats first, then room to stand, in the order of filling.

    Returns
    -------
    tuple
        Section (from the front), and where in it on the floor, metres, float64, shape ``(n, 3)``; how many are seats.
    """
    sections = range(TRAM_SECTIONS)
    seats = [(k, x, y) for k in sections for x in _ROWS for across in _ACROSS for y in (across, -across)]
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
            leaves += [(middle + way * _LEAF / 2, y, way) for y in (-_HALF, _HALF)]
    return leaves, _LEAF


def tram_cabin() -> Cabin:
    """Return the inside of a section, up to the middle of the bellows."""
    y, end = _HALF - _LINING / 2, TRAM_SECTION / 2
    panes = tuple(sorted([*_PANES, *((middle - _LEAF, middle + _LEAF) for middle in TRAM_DOORS)]))
    return Cabin((-end, -y, TRAM_FLOOR - 0.02), (end, y, _CEILING + 0.01), (_BELT, _LINTEL), panes, panes)


def _spans() -> list[tuple[float, float]]:
    """Return the stretches of a side between the doors."""
    edges = [-_END, *(x for middle in sorted(TRAM_DOORS) for x in (middle - _LEAF, middle + _LEAF)), _END]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _sides() -> list[Surface]:
    parts: list[Surface] = []

    def wall(a: float, b: float, low: float, high: float, colour: Colour) -> None:
        parts.append(panel(a, b, _HALF, low, high, colour))
        y = _HALF - _LINING
        parts.append(quads([[(a, y, max(low, TRAM_FLOOR)), (b, y, max(low, TRAM_FLOOR)), (b, y, min(high, _CEILING)),
                             (a, y, min(high, _CEILING))]], _INSIDE))  # fmt: skip

    for a, b in _spans():
        wall(a, b, _LOW, _BELT, PAINT)
        cuts = [a, *(x for pane in _PANES if a <= pane[0] and pane[1] <= b for x in pane), b]
        for c, d in zip(cuts[::2], cuts[1::2], strict=True):
            wall(c, d, _BELT, _LINTEL, CREAM)
    wall(-_END, _END, _LINTEL, _EAVES, CREAM)
    return both_sides(parts)


def _shell(nose: bool) -> list[Surface]:
    def ring(x: float, inset: float, heights: tuple[tuple[float, float], ...]) -> list[tuple[float, float, float]]:
        y = _HALF - inset
        return [(x, y - d, z) for d, z in heights] + [(x, -(y - d), z) for d, z in heights[::-1]]

    def skin(heights: tuple[tuple[float, float], ...], colour: Colour) -> Surface:
        return loft(np.array([ring(x, 0.0, heights) for x in (-_END, _END)]), colour)

    y, x0, x1 = _HALF - _LINING, -_END, _END
    parts = [
        skin(((0.1, 0.14), (0.0, _LOW), (0.0, TRAM_FLOOR - 0.01)), TRIM),
        skin(((0.0, _EAVES), (0.12, TRAM_HEIGHT - 0.36), (0.3, TRAM_HEIGHT - 0.3)), CREAM),
        box((2.6, 1.5, 0.28), (0.4, 0.0, TRAM_HEIGHT - 0.16), colour=(206, 208, 206)),
        quads([[(x0, -y, TRAM_FLOOR), (x1, -y, TRAM_FLOOR), (x1, y, TRAM_FLOOR), (x0, y, TRAM_FLOOR)]], _FLOOR),
        quads([[(x0, y, _CEILING), (x1, y, _CEILING), (x1, -y, _CEILING), (x0, -y, _CEILING)]], _INSIDE),
        *_sides(),
    ]
    for x in (-2.9, 2.9):
        for sign in (-1, 1):
            parts.append(box((1.7, 0.06, 0.3), (x * 0.35, sign * (_HALF - 0.16), 0.17), colour=TRIM))
    for end in [-1.0] if nose else [-1.0, 1.0]:
        x = end * (_END + 0.1)
        parts.append(box((0.24, TRAM_WIDTH - 0.3, 0.26), (x, 0.0, TRAM_FLOOR - 0.13), colour=_BELLOWS))
        parts.append(box((0.24, TRAM_WIDTH - 0.3, 0.2), (x, 0.0, _CEILING + 0.06), colour=_BELLOWS))
        parts += both_sides([box((0.24, 0.12, _CEILING - TRAM_FLOOR), (x, _HALF - 0.21, 1.5), colour=_BELLOWS)])
    return parts + (_nose() if nose else [])


def _nose() -> list[Surface]:
    x = _END
    parts = [
        front(x + 0.002, _HALF, _LOW, _BELT, PAINT),
        front(x + 0.002, _HALF, _LINTEL + 0.05, _EAVES, CREAM),
        front(x + 0.03, 0.75, _LINTEL + 0.1, _EAVES - 0.06, (246, 170, 30)),
        front(x - 0.06, -_HALF, TRAM_FLOOR, _BELT, _INSIDE),
        box((0.2, TRAM_WIDTH - 0.3, 0.34), (x + 0.08, 0.0, 0.42), colour=TRIM),
        box((0.04, TRAM_WIDTH - 0.2, 1.9), (x - 0.72, 0.0, TRAM_FLOOR + 0.95), colour=(120, 128, 126)),
        box((0.3, 1.7, 0.25), (x - 0.25, 0.0, 1.0), colour=TRIM),
    ]
    parts += both_sides(
        [
            box((0.1, 0.12, 1.4), (x - 0.02, _HALF - 0.06, 1.75), colour=CREAM),
            box((0.08, 0.3, 0.18), (x + 0.02, _HALF - 0.36, 0.82), colour=HEADLIGHT),
            box((0.06, 0.2, 0.12), (x + 0.02, _HALF - 0.16, 1.0), colour=TAILLIGHT),
        ]
    )
    return parts


def _furniture() -> list[Surface]:
    parts: list[Surface] = []
    for x in _ROWS:
        for across in _ACROSS:
            for y in (across, -across):
                parts.append(box((0.4, 0.4, 0.08), (x + 0.02, y, TRAM_FLOOR + _SEAT_HEIGHT - 0.04), colour=SEAT))
                parts.append(box((0.06, 0.4, 0.6), (x - 0.21, y, TRAM_FLOOR + _SEAT_HEIGHT + 0.26), colour=SEAT))
    return parts


def _leaf() -> Surface:
    """Make a door leaf whose outer side faces both ways, its middle at the origin."""
    half, y = _LEAF / 2, 0.02
    strips = [
        panel(-half, half, y, _LOW + 0.04, 0.5, PAINT),
        panel(-half, half, y, _LINTEL - 0.06, _EAVES - 0.12, TRIM),
        panel(-half, -half + 0.06, y, 0.5, _LINTEL - 0.06, TRIM),
        panel(half - 0.06, half, y, 0.5, _LINTEL - 0.06, TRIM),
        panel(-half + 0.06, half - 0.06, y, 0.5, _BELT, GLASS),
    ]
    return one_surface(both_sides(strips))


@cache
def tram_prototypes() -> dict[str, list[Surface]]:
    """Return the shapes of a tram: front, middle and rear section, and a door leaf."""
    turned = pose_matrix(yaw=np.pi)
    y = _HALF - _LINING - 0.01
    lit = inside_lights((-_END, -y, TRAM_FLOOR + 0.003), (_END, y, _CEILING - 0.004))
    return {
        "tram_front": [one_surface([*_shell(nose=True), *_furniture()]), lit],
        "tram_middle": [one_surface([*_shell(nose=False), *_furniture()]), lit],
        "tram_rear": [one_surface([*(part.moved(turned) for part in _shell(nose=True)), *_furniture()]), lit],
        "tram_leaf": [_leaf()],
    }
