"""The graded ground: streets level across, water below its banks, kerbs at the drawn borders, decks above streets."""

from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import shapely

from vico.geo.elevation import read_elevation
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, OsmWay, read_osm
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.worldgen.bridges import decks_of
from vico.worldgen.grading import graded, open_water, standing_outlines
from vico.worldgen.ground import ground_from_osm
from vico.worldgen.kerbs import KERB, lowered_kerbs
from vico.worldgen.levels import CLEARANCE, OVER_A_STREET, overpasses, passages
from vico.worldgen.partition import ground_partition, water_pieces
from vico.worldgen.roads import is_traffic_street, roads_from_osm, streets_from_osm
from vico.worldgen.streets import StreetPolygons, road_polygons
from vico.worldgen.terrain import flat_terrain, terrain_from_dem

PLACE = Path(str(resources.files("vico") / "data" / "helsinki.osm.pbf"))
HALF = 120.0
FRAME = LocalFrame(60.1690, 24.9435)


@pytest.fixture(scope="module")
def osm() -> OsmData:
    return read_osm(PLACE, FRAME, HALF)


@pytest.fixture(scope="module")
def streets(osm: OsmData) -> StreetPolygons:
    return road_polygons(osm, standing_outlines(osm, seed=0))


@pytest.fixture(scope="module")
def level(osm: OsmData, streets: StreetPolygons) -> HeightField:
    return graded(flat_terrain(half=HALF), osm, streets)


def drawn(surfaces: list[Surface], count: int = 3000) -> np.ndarray:
    """Points on the faces of the ground that look up, paint and what lies under them left out."""
    random = np.random.default_rng(0)
    found = []
    for surface in surfaces:
        if surface.material.name in ("paint", "ground_tactile"):
            continue
        corner = surface.positions[surface.triangles].astype(np.float64)
        across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        up = across[:, 2] > 0.6 * np.linalg.norm(across, axis=1)
        corner, area = corner[up], across[up, 2]
        if len(corner):
            k = random.choice(len(corner), count, p=area / area.sum())
            found.append((corner[k] * random.dirichlet((1, 1, 1), count)[..., None]).sum(axis=1))
    points = np.concatenate(found)
    return points[np.abs(points[:, :2]).max(axis=1) < HALF]


def test_level_ground_stays_level_but_for_kerbs_and_waters(
    osm: OsmData, streets: StreetPolygons, level: HeightField
) -> None:
    assert level.heights.size == 4
    points = np.random.default_rng(1).uniform(-HALF, HALF, (20_000, 2))
    water = shapely.union_all(water_pieces(osm, streets, shapely.box(-HALF, -HALF, HALF, HALF)))
    dry = ~shapely.contains_xy(shapely.buffer(water, 1.0), points[:, 0], points[:, 1])
    heights = level(points[dry])
    assert heights.min() >= -KERB - 1e-6
    assert heights.max() <= 1e-6
    street = shapely.contains_xy(shapely.buffer(streets.sunken, -0.2), points[dry, 0], points[dry, 1])
    assert heights[street] == pytest.approx(-KERB, abs=2e-3)


def test_kerbs_are_lowered_where_people_cross(streets: StreetPolygons, level: HeightField) -> None:
    ends = lowered_kerbs(streets.crossings)
    steps = []
    for line in ends.geoms:
        middle = line.interpolate(0.5, normalized=True)
        if max(abs(middle.x), abs(middle.y)) < HALF + 50.0 and streets.sunken.distance(middle) < 0.05:
            steps.append(float(level.upper((middle.x, middle.y)) - level.lower((middle.x, middle.y))))
    assert len(steps) > 10
    assert max(steps) < 0.06


def test_drawn_ground_and_height_field_agree(osm: OsmData, streets: StreetPolygons, level: HeightField) -> None:
    points = drawn(ground_from_osm(osm, level, HALF, streets))
    away = points[:, 2] - level(points[:, :2])
    edge = shapely.distance(shapely.points(points[:, :2]), shapely.boundary(streets.carriageway))
    seen = (away > -0.35) & (away < 2.0)  # the rest is the underlay and the mouths of tunnels
    assert np.percentile(np.abs(away[seen & (edge > 0.12)]), 99.9) < 0.05


def test_streets_of_a_mountain_town_are_level_across(shared_data: Path) -> None:
    frame, folder = LocalFrame(42.50745, 1.52536), shared_data / "places" / "andorra"
    osm = read_osm(folder / "andorra.osm.pbf", frame, HALF)
    rough = terrain_from_dem(read_elevation(folder / "dem_srtm.tif", frame, HALF), half=HALF)
    streets = road_polygons(osm)
    field = graded(rough, osm, streets)
    tilts = []
    for street in streets.streets:
        line = shapely.LineString(street.line)
        for along in np.arange(4.0, line.length - 4.0, 5.0):
            here, there = (np.asarray(line.interpolate(v).coords[0]) for v in (along, along + 1.0))
            if np.abs(here).max() < HALF:
                side = np.array([there[1] - here[1], here[0] - there[0]]) * (street.width / 2 - 0.5)
                tilts.append(abs(float(field.smooth(here + side) - field.smooth(here - side))) / (street.width - 1.0))
    assert len(tilts) > 100
    assert np.percentile(tilts, 85) < 0.03
    for water in open_water(field, water_pieces(osm, streets, shapely.box(-HALF, -HALF, HALF, HALF))):
        bank = shapely.get_coordinates(water.polygon.exterior)
        assert np.median(field.smooth(bank) - water.level(bank)) > 0.1


def _way(number: int, nodes: list[int], points: list[tuple[float, float]], **tags: str) -> OsmWay:
    return OsmWay(number, nodes, np.array(points), False, {k.replace("_", ":"): v for k, v in tags.items()})


@pytest.fixture
def crossroads() -> OsmData:
    """A street under a bridge whose ramps begin 100 m away."""
    ways = [
        _way(1, [1, 2], [(0, -90), (0, 90)], highway="residential"),
        _way(2, [3, 4], [(-110, 0), (-40, 0)], highway="secondary"),
        _way(3, [4, 5], [(-40, 0), (40, 0)], highway="secondary", bridge="yes", layer="1"),
        _way(4, [5, 6], [(40, 0), (110, 0)], highway="secondary"),
    ]
    return OsmData(FRAME, HALF, 60.0, [], ways, [], [])


def test_a_bridge_over_a_street_is_high_and_left_out_of_the_traffic(crossroads: OsmData) -> None:
    assert overpasses(crossroads) == {3}
    streets = road_polygons(crossroads)
    field = graded(flat_terrain(half=HALF), crossroads, streets)
    (deck,) = decks_of(crossroads, field)
    over = np.abs(deck.line[:, 0]) < 4.0
    assert (deck.z[over] - deck.slab - field.smooth(deck.line[over])).min() > CLEARANCE - 0.2
    assert abs(deck.z[0] - float(field.smooth(deck.line[0]))) < 0.3
    used = [s.way for s in streets_from_osm(crossroads, HALF) if is_traffic_street(s)]
    assert used == [1, 2, 4]
    closed = {road.osm_id: road.closed for road in roads_from_osm(crossroads).roads}
    assert closed[3] == OVER_A_STREET
    assert closed[1] is None


def test_a_bridge_over_nothing_mapped_is_the_ground(crossroads: OsmData) -> None:
    alone = replace(crossroads, ways=crossroads.ways[1:])
    assert overpasses(alone) == frozenset()
    assert passages(alone, frozenset()) == []
    middle = shapely.Point(0, 0)
    assert road_polygons(alone).carriageway.contains(middle)


def test_a_place_without_streets_has_a_ground(osm: OsmData) -> None:
    empty = replace(osm, ways=[w for w in osm.ways if "highway" not in w.tags and "railway" not in w.tags])
    streets = road_polygons(empty)
    field = graded(flat_terrain(half=HALF), empty, streets)
    assert sum(len(s.triangles) for s in ground_from_osm(empty, field, HALF, streets)) > 100
    window = shapely.box(-HALF, -HALF, HALF, HALF)
    pieces = ground_partition(empty, streets, window)
    assert sum(p.area for shapes in pieces.values() for p in shapes) == pytest.approx(window.area, rel=1e-3)
