"""Trains and light rail: a tram's sections with other paint, and a train's roof, couplers and pantograph.

Places, doors and measures are those of `vico.assets.tram`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from vico.assets.shapes import Colour, box, pose_matrix
from vico.assets.tram import CREAM, PAINT, SEAT, TRAM_HEIGHT, tram_prototypes
from vico.assets.vehicle_parts import TRIM, one_surface, tube
from vico.rules import TRAM_SECTION, TRAM_WIDTH
from vico.world.mesh import Surface

#: What lines of a kind (`TramLine.kind`) are made of: the names of their shapes begin so.
SHAPES_OF = {"tram": "tram", "light_rail": "light_rail", "rail": "train"}
_TRAIN: Mapping[Colour, Colour] = {PAINT: (168, 26, 38), CREAM: (222, 224, 226), SEAT: (42, 58, 110)}
_LIGHT_RAIL: Mapping[Colour, Colour] = {PAINT: (28, 84, 150), CREAM: (234, 236, 236), SEAT: (60, 78, 120)}
_ROOF: Colour = (150, 154, 158)
_STEEL: Colour = (96, 100, 104)


@cache
def train_prototypes() -> dict[str, list[Surface]]:
    """Return the shapes of trains and of light rail: front, middle and rear section, and a door leaf of each."""
    turned = pose_matrix(yaw=np.pi)
    found = {}
    for name, surfaces in tram_prototypes().items():
        part = name.removeprefix("tram_")
        found[f"light_rail_{part}"] = _painted(surfaces, _LIGHT_RAIL)
        train = _painted(surfaces, _TRAIN)
        if part != "leaf":
            parts = _roof() + (_pantograph() if part == "middle" else _cab())
            if part == "rear":
                parts = [extra.moved(turned) for extra in parts]
            train[0] = one_surface([train[0], *parts])
        found[f"train_{part}"] = train
    return found


def _painted(surfaces: list[Surface], paints: Mapping[Colour, Colour]) -> list[Surface]:
    found = []
    for surface in surfaces:
        colour = surface.colour.copy()
        for old, new in paints.items():
            colour[(surface.colour == np.array(old, np.uint8)).all(axis=1)] = new
        found.append(replace(surface, colour=colour))
    return found


def _roof() -> list[Surface]:
    """Make a deep roof along a section, and bogies and boxes under it."""
    length = TRAM_SECTION - 0.7
    parts = [
        box((length, TRAM_WIDTH - 0.5, 0.16), (0.0, 0.0, TRAM_HEIGHT - 0.24), colour=_ROOF),
        box((2.2, TRAM_WIDTH - 0.9, 0.26), (-2.4, 0.0, TRAM_HEIGHT - 0.06), colour=_ROOF),
        box((1.9, 0.5, 0.18), (0.0, 0.0, 0.12), colour=_STEEL),
    ]
    for x in (-2.9, 2.9):
        parts.append(box((2.0, TRAM_WIDTH - 0.4, 0.2), (x, 0.0, 0.13), colour=TRIM))
    return parts


def _cab() -> list[Surface]:
    """Make what is at a train's end: a coupler, a plough, and the paint around the windscreen."""
    x, half = TRAM_SECTION / 2 - 0.2, TRAM_WIDTH / 2
    red = _TRAIN[PAINT]
    parts = [
        box((0.3, 0.3, 0.26), (x + 0.14, 0.0, 0.66), colour=TRIM),
        box((0.1, TRAM_WIDTH - 0.5, 0.24), (x + 0.12, 0.0, 0.16), colour=_STEEL),
        box((0.14, 1.2, 0.42), (x, 0.0, 0.82), colour=(236, 190, 24)),
    ]
    for side in (-1.0, 1.0):
        parts.append(box((0.14, 0.3, 1.3), (x, side * (half - 0.18), 1.8), colour=red))
    return parts


def _pantograph() -> list[Surface]:
    """Make the current collector on the roof, raised to the wire."""
    z = TRAM_HEIGHT - 0.1
    parts = [
        box((0.9, 0.9, 0.1), (1.2, 0.0, z), colour=_STEEL),
        box((0.16, 1.5, 0.05), (0.6, 0.0, z + 1.3), colour=TRIM),
    ]
    for y in (-0.25, 0.25):
        parts += [
            tube((0.9, y, z), (1.6, y, z + 0.65), 0.025, _STEEL),
            tube((1.6, y, z + 0.65), (0.6, y, z + 1.28), 0.02, _STEEL),
        ]
    return parts
