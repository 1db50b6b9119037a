"""The graded ground: streets level across, water below its banks, kerbs at the drawn borders, decks above streets."""

from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely.affinity import translate

from road_city import roads_of
from stages_alone import ground_of
from vico.geo.elevation import read_elevation
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, OsmWay, read_osm
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.worldgen.facts.building_outlines import building_plans
from vico.worldgen.facts.fault_isolation import NamedShape
from vico.worldgen.facts.land_cover import ground_partition, water_of_map, water_pieces
from vico.worldgen.facts.site import CLEARANCE, OVER_A_STREET, WaterBody, overpasses, passages, site_facts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.ground.bridges import decks_of
from vico.worldgen.ground.grade_separation import portal_feet, portals_of
from vico.worldgen.ground.grading import grade_ground
from vico.worldgen.ground.kerbs_and_banks import KERB, lowered_kerbs, open_water, water_bodies
from vico.worldgen.ground.terrain import flat_terrain, terrain_from_dem
from vico.worldgen.streets.polygons import road_polygons
from vico.worldgen.streets.roads import is_traffic_street, streets_from_osm

PLACE = Path(str(resources.files("vico") / "data" / "helsinki.osm.pbf"))
HALF = 120.0
FRAME = LocalFrame(60.1690, 24.9435)


@pytest.fixture(scope="module")
def osm() -> OsmData:
    return read_osm(PLACE, FRAME, HALF)


@pytest.fixture(scope="module")
def streets(osm: OsmData) -> StreetPolygons:
    return road_polygons(site_facts(osm), building_plans(osm, seed=0).standing())


@pytest.fixture(scope="module")
def level(osm: OsmData, streets: StreetPolygons) -> HeightField:
    return grade_ground(flat_terrain(half=HALF), site_facts(osm), streets)


def drawn(surfaces: list[Surface], count: int = 3000) -> np.ndarray:
    """Points on the faces of the ground that look up, paint and what lies under them left out."""
    random = np.random.default_rng(0)
    found = []
    for surface in surfaces:
        if surface.material.name == "paint":
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
    water = shapely.union_all(water_pieces(site_facts(osm), streets, shapely.box(-HALF, -HALF, HALF, HALF)))
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
    points = drawn(ground_of(osm, level, streets))
    away = points[:, 2] - level(points[:, :2])
    edge = shapely.distance(shapely.points(points[:, :2]), shapely.boundary(streets.carriageway))
    mouths = shapely.buffer(shapely.union_all(portal_feet(portals_of(osm, streets))), 0.1)
    # The rest is the underlay, and the mouths of tunnels stand on the ground.
    seen = (away > -0.35) & (away < 2.0) & ~shapely.contains_xy(mouths, points[:, 0], points[:, 1])
    assert np.percentile(np.abs(away[seen & (edge > 0.12)]), 99.9) < 0.05


def test_streets_of_a_mountain_town_are_level_across(shared_data: Path) -> None:
    frame, folder = LocalFrame(42.50745, 1.52536), shared_data / "places" / "andorra"
    osm = read_osm(folder / "andorra.osm.pbf", frame, HALF)
    rough = terrain_from_dem(read_elevation(folder / "dem_srtm.tif", frame, HALF), half=HALF)
    streets = road_polygons(site_facts(osm))
    field = grade_ground(rough, site_facts(osm), streets)
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
    pieces = water_pieces(site_facts(osm), streets, shapely.box(-HALF, -HALF, HALF, HALF))
    for water in open_water(site_facts(osm), field, pieces):
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
    streets = road_polygons(site_facts(crossroads))
    field = grade_ground(flat_terrain(half=HALF), site_facts(crossroads), streets)
    (deck,) = decks_of(site_facts(crossroads), field)
    over = np.abs(deck.line[:, 0]) < 4.0
    assert (deck.z[over] - deck.slab - field.smooth(deck.line[over])).min() > CLEARANCE - 0.2
    assert abs(deck.z[0] - float(field.smooth(deck.line[0]))) < 0.3
    used = [s.way for s in streets_from_osm(site_facts(crossroads)) if is_traffic_street(s)]
    assert used == [1, 2, 4]
    closed = {road.osm_id: road.closed for road in roads_of(crossroads).roads}
    assert closed[3] == OVER_A_STREET
    assert closed[1] is None


def test_a_bridge_over_nothing_mapped_is_the_ground(crossroads: OsmData) -> None:
    alone = replace(crossroads, ways=crossroads.ways[1:])
    assert overpasses(alone) == frozenset()
    assert passages(alone, frozenset()) == []
    middle = shapely.Point(0, 0)
    assert road_polygons(site_facts(alone)).carriageway.contains(middle)


def test_a_place_without_streets_has_a_ground(osm: OsmData) -> None:
    empty = replace(osm, ways=[w for w in osm.ways if "highway" not in w.tags and "railway" not in w.tags])
    streets = road_polygons(site_facts(empty))
    field = grade_ground(flat_terrain(half=HALF), site_facts(empty), streets)
    assert sum(len(s.triangles) for s in ground_of(empty, field, streets)) > 100
    window = shapely.box(-HALF, -HALF, HALF, HALF)
    pieces = ground_partition(site_facts(empty), streets, window)
    assert sum(p.area for shapes in pieces.values() for p in shapes) == pytest.approx(window.area, rel=1e-3)


def test_ramps_of_a_bridge_over_a_street_climb_gently(crossroads: OsmData) -> None:
    streets = road_polygons(site_facts(crossroads), [])
    field = grade_ground(flat_terrain(half=180.0), site_facts(crossroads), streets)
    (deck,) = decks_of(site_facts(crossroads), field)
    x = np.arange(-150.0, 150.0, 3.0)
    ground = field.smooth(np.stack([x, np.zeros_like(x)], axis=1))
    ramp = np.abs(x) > 42.0
    both = ramp[1:] & ramp[:-1] & (np.sign(x[1:]) == np.sign(x[:-1]))
    assert (np.abs(np.diff(ground)) / 3.0)[both].max() < 0.085
    assert (np.abs(np.diff(deck.z)) / np.hypot(*np.diff(deck.line, axis=0).T)).max() < 0.085


def test_a_footway_beside_a_bridge_lies_as_high_and_has_no_parapet_between(crossroads: OsmData) -> None:
    beside = _way(9, [40, 50], [(-40, 6.6), (40, 6.6)], highway="footway", bridge="yes", layer="1")
    osm = replace(crossroads, ways=[*crossroads.ways, beside])
    field = grade_ground(flat_terrain(half=180.0), site_facts(osm), road_polygons(site_facts(osm), []))
    road, walk = sorted(decks_of(site_facts(osm), field), key=lambda deck: deck.way.id)
    middle = np.abs(walk.line[:, 0]) < 30.0
    level = np.interp(walk.line[middle, 0], road.line[:, 0], road.z)
    assert np.abs(walk.z[middle] - level).max() < 0.35


def test_stairs_lead_up_to_a_bridge_flight_after_flight(crossroads: OsmData) -> None:
    flights = [
        _way(10, [60, 61], [(0.5, 3), (0.5, 10)], highway="steps"),
        _way(11, [61, 62], [(0.5, 10), (0.5, 17)], highway="steps"),
    ]
    bridge = next(way for way in crossroads.ways if way.id == 3)
    joined = replace(
        bridge, nodes=[bridge.nodes[0], 60, bridge.nodes[-1]], line=np.array([(-40, 0), (0.5, 3), (40, 0)])
    )
    others = [way for way in crossroads.ways if way.id != 3]
    assert overpasses(replace(crossroads, ways=[*others, joined, *flights])) == {3, 10, 11}


def test_water_flows_on_below_a_bridge_without_a_hole(shared_data: Path) -> None:
    frame = LocalFrame(42.507297, 1.527672)
    place = shared_data / "places" / "andorra"
    osm = read_osm(place / "andorra.osm.pbf", frame, 60.0, need_buildings=False)
    streets = road_polygons(site_facts(osm), [])
    field = grade_ground(
        terrain_from_dem(read_elevation([place / "dem_srtm.tif"], frame, 60.0), half=60.0), site_facts(osm), streets
    )
    surfaces = ground_of(osm, field, streets)
    (water,) = (s for s in surfaces if s.material.name == "ground_water")
    corners = water.positions[water.triangles].astype(np.float64)
    flow = shapely.union_all(shapely.buffer(shapely.polygons(corners[..., :2]), 0.02))
    # The river's line leads below the Pont Prat de la Creu, which the map parts the water at.
    river = shapely.LineString([(20.0, 36.0), (7.0, 12.0), (-4.0, -9.0), (-20.0, -38.0)])
    assert shapely.difference(river, flow).length < 1.0


def test_ribbed_slabs_lie_in_the_pavement_not_under_it(
    osm: OsmData, streets: StreetPolygons, level: HeightField
) -> None:
    ground = ground_of(osm, level, streets)
    slabs = [_plan(s) for s in ground if s.material.name == "ground_tactile"]
    # What lies half a metre below shows nowhere.
    others = [_plan(s, above=-0.4) for s in ground if s.material.name not in ("paint", "ground_tactile")]
    laid, around = shapely.union_all(np.concatenate(slabs)), np.concatenate(others)
    near = around[shapely.STRtree(around).query(laid, predicate="intersects")]
    assert laid.area > 20.0
    assert shapely.intersection(laid, shapely.union_all(near)).area < 0.01 * laid.area


def _plan(surface: Surface, above: float = -1.0) -> np.ndarray:
    """Return a surface's triangles in plan, those that hang from kerbs and those below some height left out."""
    corners = surface.positions[surface.triangles].astype(np.float64)
    shapes: np.ndarray = shapely.polygons(corners[corners[:, :, 2].min(axis=1) > above][:, :, :2])
    return shapes[shapely.area(shapes) > 1e-4]


def test_a_part_of_a_city_has_its_waters_as_high_as_the_city_says() -> None:
    x, y = np.meshgrid(np.linspace(-400.0, 400.0, 81), np.linspace(-400.0, 400.0, 81))
    valley = HeightField((0.02 * x + 0.01 * y).astype(np.float32), 400.0)
    river = shapely.box(-390.0, -12.0, 390.0, 12.0)
    (body,) = water_bodies(valley, [NamedShape("w1", river)])
    seen = []
    for shift in (-100.0, 100.0):  # two tiles that meet at x = 0 have different pieces of it
        own = WaterBody(translate(body.outline, -shift, 0.0), body.shore - [shift, 0.0], body.banks, body.drop)
        site = replace(site_facts(OsmData(FRAME, 100.0, 60.0, [], [], [], [])), waters=[own])
        window = shapely.box(-100.0, -100.0, 100.0, 100.0)
        piece = shapely.intersection(translate(river, -shift, 0.0), window)
        (water,) = open_water(site, flat_terrain(half=160.0), [piece])
        seen.append(water.level(np.array([[-shift, -10.0], [-shift, 0.0], [-shift, 10.0]])))
    assert np.allclose(seen[0], seen[1], atol=1e-9)
    assert ((seen[0] < -1.3) & (seen[0] > -3.5)).all()  # below the banks near by, which lie between -1 and 1 m
    upstream, downstream = body.level(np.array([[200.0, 0.0], [-200.0, 0.0]]))
    assert upstream - downstream > 4.0


def test_a_tip_of_water_over_a_border_is_of_the_body_that_it_belongs_to() -> None:
    pond = shapely.Polygon([(-2.0, 0.0), (60.0, 60.0), (60.0, -60.0)])
    (body,) = water_bodies(flat_terrain(half=200.0), [NamedShape("w1", pond)])
    site = replace(site_facts(OsmData(FRAME, 100.0, 60.0, [], [], [], [])), waters=[body])
    tip = shapely.intersection(pond, shapely.box(-10.0, -10.0, -1.7, 10.0))
    assert not body.outline.contains(tip)
    assert open_water(site, flat_terrain(half=200.0), [tip])[0].body is body


def test_a_stream_goes_on_as_a_line_where_the_water_that_is_mapped_ends() -> None:
    # Half of it is mapped as an area, too, beside which its line runs: two parts of the map agree on the other half.
    stream = _way(1, [1, 2, 3], [(-90, 5), (0, 5), (90, 5)], waterway="river", width="6")
    area = OsmArea("w2", shapely.box(-95, -4, 0, 4), {"natural": "water"})
    osm = OsmData(FRAME, HALF, 60.0, [], [stream], [area], [])
    whole = shapely.union_all([one.shape for one in water_of_map(osm, shapely.box(-100, -100, 100, 100))])
    assert whole.intersection(shapely.box(-100, -9, -5, 9)).area == pytest.approx(90 * 8)
    assert whole.intersection(shapely.box(10, -9, 100, 9)).area == pytest.approx(80 * 6)
    assert len(shapely.get_parts(whole)) == 1  # without a gap
    for west, east in ((-100.0, 30.0), (30.0, 100.0)):
        window = shapely.box(west, -100, east, 100)
        part = shapely.union_all([one.shape for one in water_of_map(osm, window)])
        assert part.symmetric_difference(whole.intersection(window)).area < 1e-6


def test_a_river_lies_close_below_its_banks_however_far_it_falls() -> None:
    along = np.arange(-3000.0, 3000.0, 12.0)
    shore = np.concatenate([np.stack([along, np.full_like(along, y)], axis=1) for y in (-8.0, 8.0)])
    river = WaterBody(shapely.box(-3000.0, -8.0, 3000.0, 8.0), shore, 0.03 * shore[:, 0], drop=1.3)
    middle = np.stack([np.linspace(-2500.0, 2500.0, 101), np.zeros(101)], axis=1)
    below = 0.03 * middle[:, 0] - river.level(middle)
    assert ((below > 1.3) & (below < 2.0)).all()
    one_low = np.where(np.abs(shore[:, 0]) < 30.0, shore[:, 1] / 8.0, 1.0)  # by a stretch of 60 m of one bank
    lower = replace(river, banks=one_low * 3.0).level(np.array([[0.0, 0.0], [500.0, 0.0]]))
    assert lower == pytest.approx([-3.0 - 1.3 + 0.4, 3.0 - 1.3], abs=0.4)
