"""Cars and pedestrians placed by hand, on the streets of central Helsinki."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helsinki_traffic import network
from road_city import HALF
from vico.errors import InputError, SchemaError
from vico.sim.bodies.arrays import Bodies
from vico.sim.traffic import Traffic, TrafficSetup
from vico.sim.traffic.placement import placed_traffic
from vico.world.heights import HeightField
from vico.world.walkways import SIDEWALK

NOWHERE = Bodies.none()


def _traffic(content: dict[str, Any], cars: int = 0, pedestrians: int = 0) -> Traffic:
    return Traffic(
        network(), HeightField.flat(HALF), cars=cars, pedestrians=pedestrians, seed=1, first_entity=1_000_000,
        setup=TrafficSetup(placed=placed_traffic(content)),
    )  # fmt: skip


def _middle(lane: int) -> list[float]:
    lanes = network().lanes
    return [float(v) for v in lanes.at(lane, float(lanes.length[lane]) / 2)[:2]]


def _street_lanes() -> list[int]:
    """Lanes far from each other on which cars start, each the nearest to its own middle."""
    lanes, picked = network().lanes, []
    among = (lanes.inside < 0) & ~network().driven.lanes["closed"]
    for lane in network().starts.tolist():
        point = np.array(_middle(lane))
        found = lanes.nearest(point, among)
        apart = all(np.hypot(*(point - _middle(other))) > 150.0 for other in picked)
        if lanes.length[lane] > 25.0 and found is not None and found[0] == lane and apart:
            picked.append(lane)
    return picked


def _onward(lane: int, streets: int) -> int:
    """The street that one comes to after some others, always taking the last way that leads on."""
    lanes, driven, count = network().lanes, network().driven.lanes, 0
    among = (lanes.inside < 0) & ~driven["closed"]
    while True:
        lane = int(
            [way for way in lanes.following(lane) if lanes.component[way] == 0 and not driven["closed"][way]][-1]
        )
        count += lanes.inside[lane] < 0
        if count >= streets and lanes.inside[lane] < 0:
            found = lanes.nearest(np.array(_middle(lane)), among)
            if found is not None and found[0] == lane:
                return lane


def test_a_car_drives_its_route_in_order_and_then_as_others_do() -> None:
    lanes = network().lanes
    start = next(lane for lane in _street_lanes() if lanes.component[lane] == 0)
    goals = [_onward(start, 6)]
    goals.append(_onward(goals[0], 6))
    car = {"at": _middle(start), "route": [_middle(goal) for goal in goals], "model": "taxi_yellow"}
    traffic = _traffic({"cars": [car]}, cars=10)
    fleet = traffic.fleet
    assert len(fleet) == 11
    assert traffic.draw().prototypes[traffic.draw().index[0]] == "taxi_yellow"
    assert np.hypot(*(np.array([traffic.shapes.x[0], traffic.shapes.y[0]]) - car["at"])) < 5.0
    seen: list[int] = []
    for _ in range(6000):
        traffic.advance(0.1, NOWHERE)
        edge = int(lanes.edge[fleet.lane[0]])
        seen += [edge] if not seen or seen[-1] != edge else []
        if fleet.goal[0] < 0:
            break
    assert fleet.goal[0] == -1
    places = [seen.index(int(lanes.edge[goal])) for goal in goals]
    assert places == sorted(places)
    assert fleet.teleports[0] == 0


def test_the_example_file_of_traffic_is_driven_and_walked_in_central_helsinki() -> None:
    content = json.loads((Path(__file__).parents[2] / "examples" / "traffic.json").read_text())
    traffic = _traffic(content)
    assert (traffic.cars, traffic.pedestrians) == (3, 2)
    assert (traffic.fleet.goal[:2] >= 0).all()
    assert (traffic.pedestrian_state.goal >= 0).all()
    before = traffic.fleet.lane.copy()
    for _ in range(300):
        traffic.advance(0.1, NOWHERE)
    assert (traffic.fleet.lane != before).all()
    assert (traffic.pedestrian_state.distance_walked > 20.0).all()


def test_a_pedestrian_walks_its_route_and_goes_on_from_a_snapshot_as_if_nothing_had_been() -> None:
    walks = network().walks
    long = np.flatnonzero((walks.kind == SIDEWALK) & (walks.length > 30.0)).tolist()
    start = long[0]
    points = [walks.line(way).mean(axis=0) for way in long]
    away = [float(np.hypot(*(point - points[0]))) for point in points]
    goal = long[min((k for k in range(1, len(long)) if away[k] > 80.0), key=lambda k: away[k])]
    at, to = (walks.points[walks.first[way] : walks.first[way] + 2].mean(axis=0).tolist() for way in (start, goal))
    content = {"pedestrians": [{"at": at, "route": [to], "speed": 1.5}]}
    traffic, other = _traffic(content, pedestrians=5), _traffic(content, pedestrians=5)
    assert traffic.pedestrian_state.preferred_speed[0] == 1.5
    for step in range(6000):
        traffic.advance(0.1, NOWHERE)
        if step == 50:
            other.restore(traffic.arrays())
        if step >= 51 and step < 80:
            other.advance(0.1, NOWHERE)
            assert (other.shapes.x == traffic.shapes.x).all()
        if traffic.pedestrian_state.goal[0] < 0:
            break
    assert traffic.pedestrian_state.goal[0] == -1
    here = np.array([traffic.shapes.x[0], traffic.shapes.y[0]])
    ends = walks.points[walks.first[goal]], walks.points[walks.first[goal + 1] - 1]
    assert min(float(np.hypot(*(here - end))) for end in ends) < 4.0


@pytest.mark.parametrize(
    ("content", "error", "said"),
    [
        ({"cars": [{"at": [5000.0, 0.0]}]}, InputError, r"cars.0.at: no lane for cars within 10 m"),
        ({"pedestrians": [{"at": [5000.0, 0.0]}]}, InputError, r"pedestrians.0.at: no sidewalk within 10 m"),
        ({"cars": [{"at": [0.0, 0.0], "model": "tank"}]}, InputError, r"cars.0: no model 'tank'"),
        ({"cars": [{"at": [0.0, 0.0], "speed": 3}]}, SchemaError, r"traffic: cars.0.speed"),
        ({"cars": [{"at": [float("nan"), 0.0]}]}, SchemaError, r"traffic"),
        ({"bicycles": []}, SchemaError, r"traffic: bicycles"),
    ],
)
def test_what_cannot_be_placed_is_refused(content: dict[str, Any], error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        _traffic(content)


def test_two_in_one_place_are_refused() -> None:
    at = _middle(_street_lanes()[0])
    with pytest.raises(InputError, match=r"cars.1.at: no room there"):
        _traffic({"cars": [{"at": at}, {"at": at}]})
