"""Parking spots and parked cars of one street drawn by hand."""

from functools import cache

import numpy as np
import pytest
import shapely

from road_city import lanes_of
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, OsmNode, OsmWay
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.objects import Objects
from vico.world.transit import Transit
from vico.worldgen.facts.site import SiteFacts, site_facts
from vico.worldgen.facts.streets import Street, StreetPolygons, kerb_bays, lot_bays
from vico.worldgen.objects.parking import Parking, parking_from_osm
from vico.worldgen.streets.lane_shapes import CarriagewayEdges
from vico.worldgen.streets.netconvert import road_network
from vico.worldgen.streets.polygons import road_polygons
from vico.worldgen.streets.roads import streets_from_osm

NO_TRANSIT = Transit(stops=[], lines=[], bike_stations=[], origin={})
PARKING = {"highway": "residential", "parking:lane:both": "parallel"}


@cache
def town(tags: tuple[tuple[str, str], ...], lot: bool = False) -> tuple[SiteFacts, StreetPolygons, LaneGraph]:
    """A street from west to east with a way back, a hydrant at x = 30, and a car park to the north."""
    street = OsmWay(1, [10, 11], np.array([(-70.0, 0.0), (70.0, 0.0)]), False, dict(tags))
    ring = np.array([(70.0, 0.0), (70.0, -60.0), (-70.0, -60.0), (-70.0, 0.0)])
    back = OsmWay(2, [11, 12, 13, 10], ring, False, {"highway": "secondary"})
    hydrant = OsmNode(999, np.array([30.0, -5.0]), {"emergency": "fire_hydrant"})
    areas = [OsmArea("w7", shapely.box(-60, 30, 0, 50), {"amenity": "parking"})] if lot else []
    site = site_facts(OsmData(LocalFrame(60.0, 25.0), 80.0, 20.0, [hydrant], [street, back], areas, []))
    streets = road_polygons(site)
    kerbs = CarriagewayEdges(streets.carriageway, [])
    lanes = lanes_of(road_network(site, streets_from_osm(site, ()), HeightField.flat(100.0), kerbs))
    return site, streets, lanes


def parked(tags: dict[str, str], *, lot: bool = False, seed: int = 0) -> tuple[Parking, StreetPolygons, LaneGraph]:
    site, streets, lanes = town(tuple(tags.items()), lot)
    found = parking_from_osm(
        site,
        streets=streets,
        lanes=lanes,
        objects=Objects.from_rows([]),
        solids=[],
        height=HeightField.flat(100.0),
        transit=NO_TRANSIT,
        seed=seed,
    )
    return found, streets, lanes


def test_cars_stand_in_the_parking_lanes_of_the_map_and_leave_lanes_and_sidewalks_free() -> None:
    found, streets, lanes = parked(PARKING)
    feet = shapely.polygons(found.cars.feet())
    assert 0.5 < len(feet) / len(found.spots) < 0.98
    assert len(feet) >= 30
    assert shapely.covers(streets.carriageway, feet).all()
    for k in range(len(lanes)):
        half = lanes.width[k] / 2 - 0.1
        assert not shapely.intersects(shapely.LineString(lanes.line(k)).buffer(half, cap_style="flat"), feet).any()
    for k in range(len(lanes.walks)):
        assert shapely.distance(shapely.LineString(lanes.walks.line(k)), feet).min() > 0.4


def test_cars_at_kerbs_face_the_way_traffic_goes_and_spots_know_their_lane() -> None:
    found, _, lanes = parked(PARKING)
    assert len(lanes)
    east = found.cars.y < 0
    assert np.cos(found.cars.yaw[east]).min() > 0.99
    assert np.cos(found.cars.yaw[~east]).max() < -0.99
    for spot in found.spots:
        assert spot.lane is not None
        x, y, yaw = lanes.at(lanes.index[spot.lane], spot.offset)
        there = np.array([x - np.sin(yaw) * spot.side, y + np.cos(yaw) * spot.side])
        assert there == pytest.approx(spot.position[:2], abs=0.05)


def test_every_parked_car_is_the_car_of_one_spot() -> None:
    found, _, _ = parked(PARKING)
    assert sorted(spot.car for spot in found.spots if spot.car is not None) == found.cars.entity.tolist()


def test_nobody_parks_at_a_hydrant() -> None:
    found, _, _ = parked(PARKING)
    south = [spot for spot in found.spots if spot.position[1] < 0]
    assert min(abs(spot.position[0] - 30.0) for spot in south) > 5.0


@pytest.mark.parametrize(
    ("tags", "some"),
    [
        ({"highway": "residential"}, False),
        ({"highway": "residential", "width": "12"}, True),
        ({"highway": "residential", "width": "12", "parking:lane:both": "no_stopping"}, False),
        ({"highway": "secondary", "width": "12"}, False),
        ({**PARKING, "parking:condition:both": "loading"}, False),
    ],
)
def test_where_people_park_by_habit(tags: dict[str, str], some: bool) -> None:
    assert bool(parked(tags)[0].spots) == some


def test_cars_stand_across_the_street_where_the_map_says_so() -> None:
    found, _, _ = parked({"highway": "residential", "parking:lane:both": "perpendicular"})
    assert len(found.spots) > 30
    assert {(spot.kind, spot.length) for spot in found.spots} == {("across", 4.8)}
    assert 0.6 < len(found.cars) / len(found.spots) < 0.95


def test_a_side_for_cars_along_the_street_has_long_bays_though_they_stand_across_it_on_the_other() -> None:
    line = np.array([(0.0, 0.0), (40.0, 0.0)])
    street = Street(1, "residential", line, 13.0, 2, False, parking_left=4.8, parking_right=2.0, slanted=True)
    (left,), (right,) = (
        {round(bay.length, 2) for bay in kerb_bays(street, side, depth, shapely.Polygon())}
        for side, depth in ((1.0, 4.8), (-1.0, 2.0))
    )
    assert (left, right) == (4.8, 5.8)


def test_a_car_park_has_two_rows_and_an_aisle() -> None:
    found, streets, _ = parked({"highway": "residential"}, lot=True)
    lots = [spot for spot in found.spots if spot.kind == "lot"]
    assert len(lots) == len(lot_bays(streets.parking.geoms[0])) == 46
    assert {spot.lane for spot in lots} == {None}
    assert all(abs(spot.position[1] - 40.0) > 6.0 for spot in lots)


def test_the_seed_decides_who_parks_where() -> None:
    first, again, other = parked(PARKING)[0], parked(PARKING)[0], parked(PARKING, seed=1)[0]
    assert first.cars.x.tolist() == again.cars.x.tolist()
    assert first.cars.prototype.tolist() != other.cars.prototype.tolist()
    assert [s.id for s in first.spots] == [s.id for s in other.spots]
