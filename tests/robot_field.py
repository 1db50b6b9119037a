"""A level or hilly square of sidewalk with walls, and people who stand on it: where robots are tried."""

import numpy as np
import pytest

from vico.assets.packages import installed_folder
from vico.assets.robots.packs import GO2_PACKAGE
from vico.assets.shapes import box
from vico.sim.bodies.arrays import RESIDENT, Bodies
from vico.sim.config import PHYSICS_ENGINES
from vico.sim.physics import DEFAULT_ENGINE, engine_names
from vico.world.heights import HeightField
from vico.world.model import Manifest, Origin
from vico.world.objects import Objects
from vico.world.transit import Transit
from vico.world.walkable import BLOCKED, SIDEWALK, WalkableMap
from vico.world.world import World

HALF = 40.0
#: Physics engines: MuJoCo, which comes with the package, and those whose package is installed, which take minutes.
ENGINES = [
    pytest.param(
        name,
        marks=[
            pytest.mark.skipif(name not in engine_names(), reason=f"the extra {name!r} is not installed"),
            *([] if name == DEFAULT_ENGINE else [pytest.mark.slow]),
        ],
    )
    for name in PHYSICS_ENGINES
]
#: With our own models, and with installed packages where there are.
PACKS = [
    False,
    pytest.param(
        True,
        marks=pytest.mark.skipif(
            installed_folder(GO2_PACKAGE) is None,
            reason="the Go2 package is not installed (vico assets install robots)",
        ),
    ),
]


def field(*walls: tuple[float, float, float, float], height: HeightField | None = None) -> World:
    """An 80 m square of sidewalk with walls given by their middle and size."""
    manifest = Manifest(
        producer="test",
        name="field",
        origin=Origin(lat=60.0, lon=25.0),
        half=HALF,
        bbox=(24.0, 59.0, 26.0, 61.0),
        seed=0,
        sources=[],
        stages=[],
        counts={},
        places_by_type={},
        files={},
    )
    cls = np.full((160, 160), SIDEWALK, np.uint8)
    centre = (np.arange(160) + 0.5) * 0.5 - HALF
    x, y = np.meshgrid(centre, centre)
    for cx, cy, sx, sy in walls:
        cls[(np.abs(x - cx) < sx / 2 + 0.3) & (np.abs(y - cy) < sy / 2 + 0.3)] = BLOCKED
    return World(
        manifest,
        height=height or HeightField.flat(HALF),
        objects=Objects.none(),
        walkable=WalkableMap(cls, HALF),
        buildings=[],
        places=[],
        entrances=[],
        rooms=[],
        transit=Transit(stops=[], lines=[], bike_stations=[], origin={}),
        layers={
            "collision": [box((sx, sy, 5.0), (cx, cy, 2.0)) for cx, cy, sx, sy in walls],
            "buildings": [],
            "roofs": [],
        },
    )


def drawn_field(*, table: float = 0.0) -> World:
    """Return a level field that can be looked at; at (3, 0) with a table of a height, metres."""
    world = field()
    world.__dict__["_models"] = {}
    world._layers |= {"ground": [box((60, 60, 1), (0, 0, -0.5)).of_entity(2)], "rooms": []}
    if table:
        top = box((0.5, 0.8, 0.04), (3.0, 0.0, table - 0.02)).of_entity(77)
        world._layers["ground"].append(top)
        world._layers["collision"].append(top)
    return world


def people(*points: tuple[float, float], velocity: tuple[float, float] = (0.0, 0.0)) -> Bodies:
    n = len(points)
    quarter = np.full(n, 0.25)
    return Bodies(
        np.arange(500, 500 + n).astype(np.int32),
        np.full(n, RESIDENT, np.int8),
        np.column_stack([np.array(points), np.zeros(n)]),
        np.zeros(n),
        quarter,
        quarter,
        np.full(n, 1.75),
        np.tile(np.array(velocity), (n, 1)),
    )
