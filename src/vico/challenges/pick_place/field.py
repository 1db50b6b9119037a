"""A level square under the sky, with a table or without: where pick-and-place is taught."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import box, cylinder
from vico.seeds import rng
from vico.version import __version__
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import ENTITY_GROUND, ENTITY_ROAD, Manifest, Origin
from vico.world.objects import Objects
from vico.world.street_model import Roads
from vico.world.transit_model import Transit
from vico.world.walkable import BLOCKED, SIDEWALK, WalkableMap
from vico.world.world import World

#: Half the side, metres; name of such worlds.
HALF, NAME = 20.0, "field"
#: Of a table's top, along x and y, and how thick it is, metres.
TABLE, TOP = (0.5, 0.9), 0.04
_CELLS, _SLABS = 0.5, 60
#: Entity of the table.
ENTITY_TABLE = 1000


def level_field(seed: int, *, table: tuple[float, float, float] | None = None) -> World:
    """Return a level field whose ground looks as a seed says.

    Parameters
    ----------
    table
        Middle of a table's top, ENU metres; None for no table.
    """
    manifest = Manifest(
        producer=f"vico {__version__}",
        name=NAME,
        origin=Origin(lat=60.0, lon=25.0),
        half=HALF,
        bbox=(24.99, 59.99, 25.01, 60.01),
        seed=0,  # how the ground looks makes no other world of it
        sources=[],
        stages=[],
        counts={},
        places_by_type={},
        files={},
    )
    cells = round(2 * HALF / _CELLS)
    classes = np.full((cells, cells), SIDEWALK, np.uint8)
    surfaces = [] if table is None else _table(table)
    if table is not None:
        middles = (np.arange(cells) + 0.5) * _CELLS - HALF
        x, y = np.meshgrid(middles, middles)
        classes[(np.abs(x - table[0]) < TABLE[0] / 2 + 0.3) & (np.abs(y - table[1]) < TABLE[1] / 2 + 0.3)] = BLOCKED
    return World(
        manifest,
        height=HeightField.flat(HALF),
        objects=Objects.none(),
        walkable=WalkableMap(classes, HALF),
        buildings=[],
        places=[],
        entrances=[],
        rooms=[],
        roads=Roads(roads=[], junctions=[], crossings=[]),
        transit=Transit(stops=[], lines=[], bike_stations=[], origin={}),
        models={},
        layers={
            "collision": surfaces,
            "buildings": [],
            "roofs": [],
            "rooms": [],
            "ground": [*_ground(seed), *surfaces],
        },
    )


def _ground(seed: int) -> list[Surface]:
    """Return ground of some shade with slabs of others on it: what moves over it can see that it moves."""
    chance = rng(seed, "pick place", "ground")
    shade = chance.uniform(70.0, 190.0) + chance.uniform(-18.0, 18.0, 3)
    found = [box((2 * HALF, 2 * HALF, 1.0), (0.0, 0.0, -0.5), colour=_colour(shade)).of_entity(ENTITY_GROUND)]
    for _ in range(_SLABS):
        x, y = chance.uniform(-6.0, 6.0, 2)
        size = chance.uniform(0.3, 1.5, 2)
        colour = _colour(shade + chance.normal(0.0, 14.0) + chance.uniform(-6.0, 6.0, 3))
        slab = box((float(size[0]), float(size[1]), 0.002), (float(x), float(y), 0.0), colour=colour)
        found.append(slab.of_entity(ENTITY_ROAD))
    return found


def _table(middle: tuple[float, float, float]) -> list[Surface]:
    x, y, top = middle
    found = [box((*TABLE, TOP), (x, y, top - TOP / 2), colour=(176, 140, 98))]
    for across in (-1.0, 1.0):
        for along in (-1.0, 1.0):
            at = (x + across * (TABLE[0] / 2 - 0.05), y + along * (TABLE[1] / 2 - 0.05), 0.0)
            found.append(cylinder(0.02, top - TOP, sides=8, colour=(70, 70, 76), centre=at))
    return [surface.of_entity(ENTITY_TABLE) for surface in found]


def _colour(shade: NDArray[np.float64]) -> tuple[int, int, int]:
    red, green, blue = (int(value) for value in np.clip(shade, 20.0, 235.0))
    return red, green, blue
