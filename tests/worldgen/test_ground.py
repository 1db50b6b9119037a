"""Streets and the ground: a partition that covers the world, drapes on it and carries paint."""

from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import shapely

from stages_alone import ground_of
from vico.geo.elevation import HeightSamples, read_elevation
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, OsmWay, read_osm
from vico.geo.osm_parts import OsmParts
from vico.world.mesh import Surface
from vico.world.model import ENTITY_GREEN, ENTITY_GROUND, ENTITY_ROAD
from vico.worldgen.facts.fault_isolation import NamedShape
from vico.worldgen.facts.land_cover import ground_partition, mapped_areas, sea_of_map, sea_polygons
from vico.worldgen.facts.site import site_facts
from vico.worldgen.facts.streets import StreetPolygons, carriageway_width, lane_count
from vico.worldgen.ground.terrain import flat_terrain, terrain_from_dem
from vico.worldgen.streets.polygons import road_polygons

PLACE = Path(str(resources.files("vico") / "data" / "helsinki.osm.pbf"))
HALF = 110.0
WINDOW = shapely.box(-HALF, -HALF, HALF, HALF)


@pytest.fixture(scope="module")
def osm() -> OsmData:
    return read_osm(PLACE, LocalFrame(60.1690, 24.9435), HALF)


@pytest.fixture(scope="module")
def streets(osm: OsmData) -> StreetPolygons:
    return road_polygons(site_facts(osm))


@pytest.fixture(scope="module")
def ground(osm: OsmData, streets: StreetPolygons) -> list[Surface]:
    return ground_of(osm, flat_terrain(half=HALF), streets)


def plan_area(surface: Surface) -> float:
    a, b, c = (surface.positions[surface.triangles[:, k], :2].astype(np.float64) for k in range(3))
    return float((((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2).sum())


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        ({"highway": "residential", "width": "7,5"}, 7.5),
        ({"highway": "primary", "lanes": "4"}, 4 * 3.2 + 0.7),
        ({"highway": "residential", "oneway": "yes"}, 3.2 + 0.7),
        ({"highway": "residential", "parking:lane:both": "parallel"}, 2 * 3.2 + 0.7 + 4.0),
        ({"highway": "service", "service": "driveway"}, 3.0),
        ({"highway": "tertiary", "width": "wide"}, 2 * 3.2 + 0.7),
    ],
)
def test_widths_follow_tags_before_class(tags: dict[str, str], expected: float) -> None:
    assert carriageway_width(tags) == pytest.approx(expected)


def test_lanes_are_as_tagged_or_as_usual() -> None:
    assert lane_count({"highway": "primary", "lanes": "3"}) == 3
    assert lane_count({"highway": "primary"}) == 4
    assert lane_count({"highway": "residential", "oneway": "yes"}) == 1


def test_street_surfaces_do_not_overlap(streets: StreetPolygons) -> None:
    kinds = [streets.carriageway, streets.sidewalk, streets.pedestrian, streets.path, streets.cycleway, streets.steps]
    shared = [shapely.intersection(a, b).area for k, a in enumerate(kinds) for b in kinds[k + 1 :]]
    assert max(shared) < 0.5


def test_lanes_of_streets_lie_on_the_carriageway(osm: OsmData, streets: StreetPolygons) -> None:
    lines = shapely.MultiLineString([street.line for street in streets.streets])
    window = shapely.box(-HALF, -HALF, HALF, HALF)
    inside = shapely.intersection(lines, window)
    on_it = shapely.intersection(inside, shapely.buffer(streets.carriageway, 0.1))
    assert on_it.length > 0.995 * inside.length


def test_crossings_lie_across_carriageways(streets: StreetPolygons) -> None:
    inside = [c for c in streets.crossings if np.abs([c.start, c.end]).max() < HALF + 50.0]
    assert len(inside) > 10
    near = shapely.buffer(streets.carriageway, 1.0)
    assert all(near.contains(shapely.LineString([c.start, c.end])) for c in inside)


def test_nothing_is_paved_under_buildings(osm: OsmData) -> None:
    solid = shapely.box(-30, -30, 30, 30)
    cleared = road_polygons(site_facts(osm), [NamedShape("w1", solid)])
    assert shapely.intersection(cleared.sidewalk, solid).area < 0.1
    assert shapely.intersection(cleared.pedestrian, solid).area < 0.1


def test_the_partition_covers_the_window_once(osm: OsmData, streets: StreetPolygons) -> None:
    pieces = ground_partition(site_facts(osm), streets, WINDOW)
    total = sum(shape.area for shapes in pieces.values() for shape in shapes)
    assert total == pytest.approx(WINDOW.area, rel=1e-4)
    assert shapely.union_all([shape for shapes in pieces.values() for shape in shapes]).area == pytest.approx(
        WINDOW.area, rel=1e-4
    )


def test_the_mesh_faces_up_and_covers_the_ground_and_its_underlay(osm: OsmData, ground: list[Surface]) -> None:
    for surface in ground:
        assert (surface.normals[:, 2] > -1e-6).all()
    # Under houses nothing is drawn but the underlay; the mouths of tunnels stand on the ground.
    window = shapely.box(-HALF - 40, -HALF - 40, HALF + 40, HALF + 40)
    houses = [a.polygon for a in osm.areas if a.tags.get("building", "no") != "no"]
    inside = shapely.intersection(shapely.union_all(shapely.buffer(houses, -1.5, join_style="mitre")), window).area
    total = sum(plan_area(s) for s in ground if s.material.name != "paint")
    assert 2 * window.area - 1.02 * inside < total < 2 * window.area + 1500.0


def _streets_alone(osm: OsmData, *lines: list[tuple[float, float]], tags: dict[str, str]) -> StreetPolygons:
    """Return what streets some ways alone make."""
    nodes = {point: k for k, point in enumerate(dict.fromkeys(point for line in lines for point in line), 1)}
    ways = [
        OsmWay(k, [nodes[point] for point in line], np.array(line), line[0] == line[-1], tags)
        for k, line in enumerate(lines, 1)
    ]
    return road_polygons(site_facts(replace(osm, nodes=[], ways=ways, areas=[], relations=[])))


def test_what_is_narrow_between_pavings_is_paved_and_lawns_keep_their_corners(osm: OsmData) -> None:
    lawn = [(0.0, 60.0), (40.0, 60.0), (40.0, 90.0), (0.0, 90.0), (0.0, 60.0)]
    fork = [(40.0, 4.0), (0.0, 0.0)], [(0.0, 0.0), (40.0, -4.0)]
    walk = _streets_alone(osm, *fork, lawn, tags={"highway": "footway", "width": "2"}).sidewalk
    # Between two ways that part a knife's point would be left; it is a metre wide where it begins.
    gap = shapely.difference(shapely.Polygon([(0.0, 0.0), (38.0, 3.8), (38.0, -3.8)]), walk)
    beginning = gap.bounds[0]
    assert 13.0 < beginning < 16.0
    assert shapely.intersection(gap, shapely.box(beginning, -9, beginning + 0.1, 9)).bounds[3] > 0.35
    inside = shapely.difference(shapely.Polygon(lawn), walk)
    assert inside.area == pytest.approx(38.0 * 28.0, abs=0.1)


def test_lawns_have_kerbs_where_the_street_lies_lower(osm: OsmData) -> None:
    def stones(kind: str) -> tuple[float, float]:
        alone = replace(osm, nodes=[], areas=[], relations=[], ways=[
            OsmWay(1, [1, 2], np.array([(-90.0, 0.0), (90.0, 0.0)]), False, {"highway": kind, "sidewalk": "no"}),
        ])  # fmt: skip
        site = site_facts(alone)
        plan = road_polygons(site)
        pieces = ground_partition(site, plan, WINDOW)
        return sum(piece.area for piece in pieces.get("kerb", [])), plan.carriageway.length

    assert stones("service")[0] == 0.0
    area, around = stones("primary")
    assert area == pytest.approx(0.22 * around, rel=0.02)


def test_corners_of_junctions_are_paved_as_the_streets_around_them(osm: OsmData) -> None:
    lines = [(-40.0, 0.0), (0.0, 0.0), (40.0, 0.0)], [(0.0, -40.0), (0.0, 0.0), (0.0, 40.0)]
    plan = _streets_alone(osm, *lines, tags={"highway": "tertiary", "surface": "sett"})
    assert shapely.difference(plan.carriageway, plan.paved["setts"]).area < 0.2
    assert _streets_alone(osm, *lines, tags={"highway": "tertiary"}).paved == {}


def test_entities_tell_roads_greens_and_the_rest_apart(ground: list[Surface]) -> None:
    found = set(np.unique(np.concatenate([s.entity for s in ground])).tolist())
    assert {ENTITY_GROUND, ENTITY_ROAD, ENTITY_GREEN} <= found


def test_zebras_are_painted_over_the_asphalt(ground: list[Surface]) -> None:
    paint = next(s for s in ground if s.material.name == "paint")
    assert (paint.positions[:, 2] > 0.01).all()
    white = (paint.colour > 220).all(axis=1)
    assert white.sum() / 4 > 80


def test_the_ground_follows_a_hill(osm: OsmData, streets: StreetPolygons) -> None:
    side = np.arange(-400, 401, 25.0)
    x, y = (v.ravel() for v in np.meshgrid(side, side))
    hill = 30 * np.exp(-(x**2 + y**2) / 150**2) + 0.05 * x
    terrain = terrain_from_dem(HeightSamples(np.stack([x, y, hill], 1), 25.0, "hill", ""), half=HALF)
    for surface in ground_of(osm, terrain, streets):
        middle = surface.positions[surface.triangles].mean(axis=1).astype(np.float64)
        above = middle[:, 2] - terrain(middle[:, :2])
        if surface.material.name == "paint":
            assert above.min() > -0.02
            continue
        if surface.material.name == "ground_blocks":
            continue  # walls: the parapets beside the mouths of tunnels
        corner = surface.positions[surface.triangles].astype(np.float64)
        across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        lying = across[:, 2] > 0.7 * np.linalg.norm(across, axis=1)
        # What is far below is the underlay, what is far above the mouths of tunnels.
        top = lying & (above > -0.12) & (above < 2.0)
        # Treads of stairs, of concrete, lie within half a step.
        if top.any():
            assert np.percentile(np.abs(above[top]), 99.5) < (0.1 if "concrete" in surface.material.name else 0.05)


def test_the_sea_lies_to_the_right_of_the_coast() -> None:
    frame = LocalFrame(43.73, 7.42)
    line = np.array([(-500.0, 0.0), (0.0, 20.0), (500.0, 0.0)])  # eastwards: land to the north
    osm = OsmData(frame, 200.0, 0.0, [], [OsmWay(1, [1, 2, 3], line, False, {"natural": "coastline"})], [], [])
    (sea,) = sea_polygons(osm, shapely.box(-200, -200, 200, 200))
    assert sea.contains(shapely.Point(0, -100))
    assert not sea.contains(shapely.Point(0, 100))


def test_a_coast_that_ends_within_the_window_goes_straight_on_to_its_edge() -> None:
    line = np.array([(-500.0, 0.0), (0.0, 20.0), (150.0, 0.0)])
    osm = OsmData(
        LocalFrame(43.73, 7.42), 200.0, 0.0, [], [OsmWay(1, [1, 2, 3], line, False, {"natural": "coastline"})], [], []
    )
    (sea,) = sea_polygons(osm, shapely.box(-200, -200, 200, 200))
    assert sea.area == pytest.approx(400 * 200 + 4000, rel=0.03)
    assert not sea.contains(shapely.Point(180, 50))


def test_beyond_what_the_map_covers_the_sea_goes_straight_on() -> None:
    line = np.array([(-500.0, 0.0), (500.0, 0.0)])
    osm = OsmData(
        LocalFrame(43.73, 7.42), 200.0, 0.0, [], [OsmWay(1, [1, 2], line, False, {"natural": "coastline"})], [], [],
        covered=(-150.0, -100.0, 100.0, 300.0),
    )  # fmt: skip
    window = shapely.box(-200, -200, 200, 200)
    sea = shapely.union_all(sea_of_map(osm, window))
    assert sea.equals(shapely.box(-200, -200, 200, 0))
    # Where land reaches the edge there is land beyond.
    bay = np.array([(-500.0, 0.0), (0.0, 0.0), (0.0, -300.0)])
    osm = replace(osm, ways=[OsmWay(1, [1, 2, 3], bay, False, {"natural": "coastline"})])
    assert shapely.union_all(sea_of_map(osm, window)).equals(shapely.box(-200, -200, 0, 0))
    assert sea_of_map(replace(osm, covered=(300.0, 300.0, 400.0, 400.0)), window) == []


def test_helsinki_s_harbour_goes_on_beyond_its_map(shared_data: Path) -> None:
    osm = read_osm(shared_data / "places" / "helsinki" / "helsinki.osm.pbf", LocalFrame(60.17, 24.941), 1100.0)
    assert osm.covered is not None
    east = osm.covered[2]
    assert 600.0 < east < 700.0
    sea = shapely.union_all(sea_of_map(osm, shapely.box(-1100, -1100, 1100, 1100)))
    at_edge, far_out = (shapely.intersection(sea, shapely.LineString([(x, -1100), (x, 1100)])) for x in (east, 1099.0))
    assert far_out.length > 20.0
    assert shapely.bounds(far_out)[1::2].tolist() == shapely.bounds(at_edge)[1::2].tolist()


def test_a_part_of_a_map_in_the_open_sea_is_sea() -> None:
    line = np.array([(-900.0, 0.0), (900.0, 0.0)])
    osm = OsmData(
        LocalFrame(43.73, 7.42), 800.0, 0.0, [], [OsmWay(1, [1, 2], line, False, {"natural": "coastline"})], [], []
    )
    whole = replace(osm, sea=sea_of_map(osm, shapely.box(-800, -800, 800, 800)))
    part = OsmParts(whole).within(half=100.0, margin=20.0, east=300.0, north=-500.0)
    assert not part.ways
    areas = mapped_areas(site_facts(part), shapely.box(-100, -100, 100, 100))
    assert sum(one.shape.area for one in areas["water"]) == pytest.approx(200.0 * 200.0)


def test_monaco_s_harbour_is_water(shared_data: Path) -> None:
    frame = LocalFrame(43.7350, 7.4235)
    osm = read_osm(shared_data / "places" / "monaco" / "monaco.osm.pbf", frame, 250.0)
    terrain = terrain_from_dem(
        read_elevation(shared_data / "places" / "monaco" / "dem_srtm.tif", frame, 250.0), half=250
    )
    pieces = ground_partition(site_facts(osm), road_polygons(site_facts(osm)), shapely.box(-250, -250, 250, 250))
    harbour = [shape for shape in pieces["water"] if shape.area > 5_000]
    assert sum(shape.area for shape in harbour) > 20_000
    assert all(abs(terrain(np.asarray(shape.representative_point().coords[0]))) < 8.0 for shape in harbour)
