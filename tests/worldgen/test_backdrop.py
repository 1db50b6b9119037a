"""What is seen beyond the edge of a world: it closes views, and touches nothing within."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import MultiPolygon

from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import ENTITY_BACKDROP, Building
from vico.worldgen.facts.site import site_facts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.ground.backdrop import backdrop_of

HALF = 60.0
NONE = MultiPolygon()
FLAT = HeightField.flat(HALF)


def building(x: float, y: float, *, size: float = 10.0) -> Building:
    ring = [(x, y), (x + size, y), (x + size, y + size), (x, y + size)]
    return Building(
        id=f"w{x:.0f}.{y:.0f}", entity=1000, name=None, use="residential", footprint=[ring], base=0.0, height=18.0,
        levels=5, roof_shape="gabled", colour="#c8b090", accessible=False,
    )  # fmt: skip


def seen(buildings: list[Building], areas: list[OsmArea] | None = None, road: MultiPolygon = NONE) -> list[Surface]:
    site = site_facts(OsmData(LocalFrame(50.0, 8.0), HALF, 20.0, [], [], areas or [], []))
    streets = StreetPolygons(road, NONE, NONE, NONE, NONE, NONE, NONE, NONE, [], [], [])
    return backdrop_of(site, FLAT, streets, buildings, seed=3)


def corners(surfaces: list[Surface], name: str = "") -> np.ndarray:
    found = [s.positions for s in surfaces if s.material.name.startswith(name)]
    return np.concatenate(found) if found else np.zeros((0, 3))


def test_houses_stand_beyond_a_built_edge_and_trees_beyond_a_bare_one() -> None:
    surfaces = seen([building(45.0, y) for y in range(-50, 50, 20)])
    houses, leaves = corners(surfaces, "backdrop_walls"), corners(surfaces, "leaves")
    assert (houses[:, 0] > -HALF).all()
    assert 12.0 < houses[:, 2].max() < 21.0  # as tall as those within
    assert (leaves[:, 0] < -HALF).any()
    assert {int(entity) for s in surfaces for entity in np.unique(s.entity)} == {ENTITY_BACKDROP}


def test_nothing_of_it_stands_in_the_world() -> None:
    found = corners(seen([building(45.0, y) for y in range(-50, 50, 20)]))
    assert np.abs(found[:, :2]).max(axis=1).min() > HALF
    assert np.abs(found[:, :2]).max() < HALF + 75.0


def test_water_stays_open() -> None:
    sea = OsmArea("w9", shapely.box(50.0, -120.0, 160.0, 120.0), {"natural": "water"})
    found = corners(seen([building(20.0, 0.0)], [sea]))
    east = found[(found[:, 0] > HALF) & (np.abs(found[:, 1]) < HALF - 15.0)]
    assert len(found)
    assert not len(east)


def test_what_closes_the_view_along_a_street_stands_farther_out() -> None:
    road = MultiPolygon([shapely.box(-110.0, -4.0, 110.0, 4.0)])
    town = [building(45.0, y) for y in range(-50, 50, 20)]
    walls = corners(seen(town, road=road), "backdrop_walls")
    before = walls[(np.abs(walls[:, 1]) < 4.0) & (walls[:, 0] > 0.0)]
    assert not len(before) or before[:, 0].min() > HALF + 34.0


def test_it_is_the_same_in_every_build() -> None:
    town = [building(45.0, y) for y in range(-50, 50, 20)]
    one, other = seen(town), seen(town)
    assert all(np.array_equal(a.positions, b.positions) for a, b in zip(one, other, strict=True))
