"""Cars that park in car parks: a way in and out is found and driven smoothly, and people on it are waited for."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import shapely

from road_city import HALF, road_city
from vico.sim.bodies.arrays import PEDESTRIAN, Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import Traffic, TrafficNetwork
from vico.sim.traffic.state import APPROACHING, BACKING_OUT, DRIVING, DRIVING_IN, DRIVING_OUT, LEAVING, NONE, STANDING
from vico.sim.traffic.stopping_places import places_in_car_parks, with_places
from vico.world.heights import HeightField
from vico.world.model import ParkingSpot
from vico.world.objects import Objects
from vico.worldgen.objects.parking_paths import with_parking_paths

_ROWS, _PITCH = (14.0, 25.5), 2.5  # m from the lane's middle, and from spot to spot


@cache
def _spots() -> tuple[list[ParkingSpot], int]:
    """Two rows of spots beside a long street lane of Helsinki, without anything that stands there; and the lane."""
    lanes = road_city().lanes
    usable = (lanes.inside < 0) & (lanes.zone < 0) & ~lanes.buses_only & (lanes.right < 0)
    lane = int(np.argmax(np.where(usable, lanes.length, 0.0)))
    x, y, yaw = lanes.at(lane, float(lanes.length[lane]) / 2)
    ahead, right = np.array([np.cos(yaw), np.sin(yaw)]), np.array([np.sin(yaw), -np.cos(yaw)])
    spots = [
        ParkingSpot(
            id=f"lot0.{5 * row + k}",
            position=(*((x, y) + ahead * (k - 2) * _PITCH + right * away).tolist(), 0.0),
            yaw=float(yaw) - np.pi / 2 + np.pi * row,
            length=5.0,
            width=_PITCH,
            kind="lot",
            car=None if k % 2 else 90_000 + 5 * row + k,
        )
        for row, away in enumerate(_ROWS)
        for k in range(5)
    ]
    corners = [(x, y) + ahead * a + right * b for a, b in ((-24, 4), (24, 4), (24, 29), (-24, 29))]
    lines = shapely.linestrings([lanes.line(lane)])
    streets: Any = SimpleNamespace(
        carriageway=shapely.MultiPolygon(shapely.buffer(lines, 3.0).tolist()),
        parking=shapely.MultiPolygon([shapely.Polygon(corners)]),
        streets=[],
    )
    alone = replace(lanes, zone=np.where(np.arange(len(lanes)) == lane, -1, lanes.zone))
    return with_parking_paths(
        spots,
        streets=streets,
        lanes=alone,
        objects=Objects.from_rows([]),
        solids=[],
        height=HeightField.flat(HALF),
    ), lane


@cache
def _network() -> TrafficNetwork:
    city = road_city()
    network = TrafficNetwork.of(city.lanes, ())
    places, points = places_in_car_parks(_spots()[0], network.driven, network.lanes, network.walks, shapely.STRtree([]))
    return replace(network, driven=with_places(network.driven, places)._replace(way_points=points))


def _coming() -> Traffic:
    """Traffic whose car 0 comes to a car park, with nobody else near."""
    network = _network()
    traffic = Traffic(network, HeightField.flat(HALF), cars=1, pedestrians=0, seed=4, first_entity=1)
    place, fleet = network.driven.places[0], traffic.fleet
    assert traffic._place_vehicle(0, int(place["lane"]), float(place["middle"]) - 8.0, 0.1)
    fleet.place[0], fleet.stopping[0] = 0, APPROACHING
    fleet.stop_offset[0], fleet.way_offset[0] = place["middle"], 0.0
    return traffic


def _person(xy: tuple[float, float]) -> Bodies:
    return Bodies(
        entity=np.array([70_000], np.int32),
        kind=np.array([PEDESTRIAN], np.int8),
        position=np.array([[*xy, 0.0]]),
        yaw=np.zeros(1),
        half_length=np.array([0.25]),
        half_width=np.array([0.25]),
        height=np.array([1.7]),
        velocity=np.zeros((1, 3)),
    )


def test_a_way_leads_into_each_free_spot_past_the_cars_that_stand_and_out_again() -> None:
    spots, _ = _spots()
    free = [spot for spot in spots if spot.car is None]
    assert all(spot.ways is None for spot in spots if spot.car is not None)
    reached = [spot for spot in free if spot.ways is not None]
    assert len(reached) >= 2
    for spot in reached:
        assert spot.ways is not None
        for line in (spot.ways.into.line, spot.ways.back):
            assert np.hypot(*np.subtract(line[-1], spot.position[:2])) < 0.02
        assert spot.ways.out.line[0] == spot.ways.back[0]


def test_a_car_parks_in_a_car_park_waits_for_people_and_leaves_again_exactly() -> None:
    traffic, network = _coming(), _network()
    fleet, place, points = traffic.fleet, network.driven.places[0], network.driven.way_points
    inwards = points[place["first_in"] : place["end_in"]]
    k = int(np.searchsorted(inwards["s"], 20.0))
    person = _person((float(inwards["x"][k]), float(inwards["y"][k])))
    seen, saved = [int(fleet.stopping[0])], {}
    for step in range(1600):
        there = person if step < 200 else Bodies.none()
        yaw = float(traffic.shapes.yaw[0])
        traffic.advance(0.1, there)
        assert abs((traffic.shapes.yaw[0] - yaw + np.pi) % (2 * np.pi) - np.pi) < 0.1
        if step < 200:
            away = np.hypot(*(person.position[0, :2] - (traffic.shapes.x[0], traffic.shapes.y[0])))
            assert away > 1.0
        assert len(overlapping(traffic.bodies(), 0.0)) == 0
        now = int(fleet.stopping[0])
        if step == 199:
            assert now == DRIVING_IN
            assert fleet.speed[0] == 0.0
        if now != seen[-1]:
            seen.append(now)
            if now == STANDING:
                spot = next(spot for spot in _spots()[0] if spot.ways is not None)
                assert np.hypot(*((traffic.shapes.x[0], traffic.shapes.y[0]) - np.array(spot.position[:2]))) < 0.1
                fleet.stay_left[0] = 1.0
            elif now == BACKING_OUT:
                saved = traffic.arrays()
        if now == DRIVING:
            break
    assert seen == [APPROACHING, DRIVING_IN, STANDING, LEAVING, BACKING_OUT, DRIVING_OUT, DRIVING]
    assert (fleet.lane[0], fleet.place[0], fleet.teleports[0]) == (place["out_lane"], NONE, 0)
    others = [_coming() for _ in range(2)]
    for other in others:
        other.restore(saved)
        for _ in range(60):
            other.advance(0.1, Bodies.none())
    for name, array in others[0].arrays().items():
        np.testing.assert_array_equal(array, others[1].arrays()[name], err_msg=name)
