"""Traffic on the streets of central Helsinki: nothing ever touches, nothing ever gridlocks, all repeats exactly."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from road_city import HALF, road_city
from vico.errors import InputError
from vico.sim.bodies.arrays import OBJECT, RESIDENT, Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import Traffic, TrafficNetwork
from vico.sim.traffic.jams import vehicles_backing_up
from vico.sim.traffic.pedestrians import place_pedestrian
from vico.sim.traffic.route import step_back_lane
from vico.sim.traffic.shapes import Shapes
from vico.sim.traffic.state import LaneNetwork, Records, new_fleet
from vico.world.heights import HeightField
from vico.world.walkways import SIDEWALK


def _traffic(cars: int = 30, pedestrians: int = 30, seed: int = 1) -> Traffic:
    city = road_city()
    return Traffic(
        TrafficNetwork.of(city.lanes, city.solids),
        HeightField.flat(HALF),
        cars=cars,
        pedestrians=pedestrians,
        seed=seed,
        first_entity=1_000_000,
    )


def _person(x: float, y: float) -> Bodies:
    one = np.full(1, 0.25)
    return Bodies(
        np.array([7], np.int32), np.array([RESIDENT], np.int8), np.array([[x, y, 0.0]]), np.zeros(1), one, one,
        np.array([1.7]), np.zeros((1, 2)),
    )  # fmt: skip


def _run(traffic: Traffic, seconds: int, obstacles: Bodies | None = None) -> int:
    """Overlaps counted over all sub-steps."""
    overlaps = 0
    for _ in range(seconds * 10):
        traffic.advance(0.1, obstacles or Bodies.none())
        overlaps += len(overlapping(Bodies.joined([traffic.bodies(), obstacles or Bodies.none()]), 0.0))
    return overlaps


def test_no_two_bodies_of_a_crowd_overlap_in_any_sub_step() -> None:
    assert _run(_traffic(120, 200), 240) == 0


@pytest.mark.slow
@pytest.mark.parametrize(("cars", "pedestrians"), [(30, 30), (120, 200)])
def test_no_two_bodies_overlap_in_half_an_hour(cars: int, pedestrians: int) -> None:
    assert _run(_traffic(cars, pedestrians), 1800) == 0


@pytest.mark.slow
def test_an_hour_of_dense_traffic_never_gridlocks() -> None:
    traffic = _traffic(120, 200)
    for _ in range(12):
        before = traffic.fleet.laps.sum()
        _run(traffic, 300)
        assert traffic.fleet.laps.sum() - before > 30
    # Taken out of a jam: fewer than one in ten of those that drove through.
    assert traffic.fleet.teleports.sum() < 0.1 * traffic.fleet.laps.sum()


@dataclass
class _Watched:
    """What a run showed: seconds that each body stood at its longest, and the share of time it moved."""

    longest: NDArray[np.float64]
    moving: NDArray[np.float64]
    overlaps: int


def _watched(traffic: Traffic, seconds: int) -> _Watched:
    """Standing = within a metre of where it was; looked at once a second."""
    here = np.column_stack([traffic.shapes.x, traffic.shapes.y])
    stood, longest, moved, overlaps = np.zeros(len(here)), np.zeros(len(here)), np.zeros(len(here)), 0
    for _ in range(seconds):
        overlaps += _run(traffic, 1)
        now = np.column_stack([traffic.shapes.x, traffic.shapes.y])
        away = np.linalg.norm(now - here, axis=1) > 1.0
        here[away] = now[away]
        stood = np.where(away, 0.0, stood + 1.0)
        longest = np.maximum(longest, stood)
        moved += np.hypot(traffic.shapes.vx, traffic.shapes.vy) > 0.1
    return _Watched(longest, moved / seconds, overlaps)


def test_everybody_gets_on_for_ten_minutes() -> None:
    traffic = _traffic(30, 30)
    seen = _watched(traffic, 600)
    assert seen.longest.max() < 90.0
    assert seen.moving[:30].mean() > 0.85
    assert seen.moving[30:].mean() > 0.95
    assert seen.overlaps == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_everybody_gets_on_for_an_hour(seed: int) -> None:
    traffic = _traffic(30, 30, seed)
    seen = _watched(traffic, 3600)
    assert seen.longest.max() < 180.0
    assert seen.moving[:30].mean() > 0.85
    assert seen.moving[30:].mean() > 0.85
    assert seen.overlaps == 0
    assert traffic.fleet.teleports.sum() < 0.02 * traffic.fleet.laps.sum()


def test_two_people_who_meet_between_walls_do_not_stand_there() -> None:
    traffic = _traffic(0, 2)
    narrow = (traffic.walks.kind == SIDEWALK) & (traffic.walks.length > 30.0)
    stretch = int(
        np.argmin(
            np.where(narrow, np.minimum.reduceat(traffic.walks.room.sum(axis=1), traffic.walks.first[:-1]), np.inf)
        )
    )
    for i, (share, way) in enumerate([(0.4, 1), (0.6, -1)]):
        offset = share * traffic.walks.length[stretch]
        assert place_pedestrian(traffic.paths, traffic._walkers, i, stretch, offset, way, traffic.shapes, i)
    assert _watched(traffic, 120).longest.max() < 30.0


def test_only_one_vehicle_is_granted_a_junction_at_a_time() -> None:
    traffic = _traffic(60, 0)
    zone = traffic.lanes.zone
    for _ in range(1200):
        traffic.advance(0.1, Bodies.none())
        inside = [int(z) for z in zone[traffic.fleet.lane] if z >= 0]
        assert len(inside) == len(set(inside))


def test_cars_keep_moving() -> None:
    traffic = _traffic(30, 30)
    speeds = []
    for _ in range(3000):
        traffic.advance(0.1, Bodies.none())
        speeds.append(traffic.fleet.speed.mean())
    assert np.mean(speeds) > 2.5


def test_a_car_stops_for_a_person_in_its_lane() -> None:
    traffic = _traffic(1, 0)
    lane = int(np.argmax(np.where((traffic.lanes.inside < 0) & ~traffic.lanes.buses_only, traffic.lanes.length, 0)))
    traffic.fleet.lane[0], traffic.fleet.offset[0], traffic.fleet.speed[0] = lane, 12.0, 8.0
    traffic.fleet.planned_count[0] = 0
    x, y, _ = traffic.lanes.at(lane, 12.0)
    traffic.shapes.x[0], traffic.shapes.y[0] = x, y
    person = _person(*traffic.lanes.at(lane, 60.0)[:2])
    assert _run(traffic, 30, person) == 0
    assert traffic.fleet.speed[0] < 0.1
    gap = 60.0 - 0.25 - traffic.fleet.offset[0]
    assert 0.5 < gap < 4.0


def test_pedestrians_walk_about_as_fast_as_people_out_of_buildings_and_within_reach_of_their_way() -> None:
    import shapely

    traffic = _traffic(0, 60)
    _run(traffic, 300)
    people = shapely.points(traffic.walkers.position[:, :2])
    assert not len(shapely.STRtree(road_city().solids).query(people, predicate="within")[0])
    ways = shapely.union_all([shapely.LineString(traffic.walks.line(i)) for i in range(len(traffic.walks))])
    assert shapely.distance(people, ways).max() < 2.5
    walked = traffic.pedestrian_state.distance_walked
    assert 0.8 < np.median(walked) / 300 < 1.5


def test_the_same_seed_gives_the_same_state() -> None:
    states = []
    for _ in range(2):
        traffic = _traffic()
        for _ in range(600):
            traffic.advance(0.1, Bodies.none())
        states.append(traffic.arrays())
    assert all(np.array_equal(states[0][k], states[1][k]) for k in states[0])


def test_another_seed_gives_another_state() -> None:
    a, b = _traffic(seed=1), _traffic(seed=2)
    assert not np.array_equal(a.arrays()["fleet.lane"], b.arrays()["fleet.lane"])


def test_going_on_from_a_saved_state_equals_never_having_stopped() -> None:
    traffic = _traffic()
    for _ in range(300):
        traffic.advance(0.1, Bodies.none())
    saved = traffic.arrays()
    for _ in range(300):
        traffic.advance(0.1, Bodies.none())
    other = _traffic()
    other.restore(saved)
    for _ in range(300):
        other.advance(0.1, Bodies.none())
    there, here = traffic.arrays(), other.arrays()
    assert all(np.array_equal(there[k], here[k]) for k in there)


def test_more_cars_than_streets_hold_are_refused() -> None:
    with pytest.raises(InputError, match=r"ask for .* cars"):
        _traffic(cars=4000, pedestrians=0)


def test_what_is_drawn_are_known_prototypes_at_the_bodies() -> None:
    traffic = _traffic()
    drawn = traffic.draw()
    assert {drawn.prototypes[k] for k in np.unique(drawn.index)} <= set(traffic.prototypes())
    assert np.allclose(drawn.transforms[:, :3, 3], traffic.bodies().position[: len(drawn.index)], atol=1e-3)


def _blocked_street() -> tuple[Traffic, Bodies]:
    """One car on the longest street, and somebody who stands in its lane for good."""
    traffic = _traffic(1, 0)
    lane = int(np.argmax(np.where((traffic.lanes.inside < 0) & ~traffic.lanes.buses_only, traffic.lanes.length, 0)))
    traffic.fleet.lane[0], traffic.fleet.offset[0], traffic.fleet.speed[0] = lane, 12.0, 8.0
    traffic.fleet.planned_count[0] = 0
    x, y, _ = traffic.lanes.at(lane, 12.0)
    traffic.shapes.x[0], traffic.shapes.y[0] = x, y
    return traffic, _person(*traffic.lanes.at(lane, 60.0)[:2])


def test_who_is_taken_out_of_a_jam_is_told_with_place_and_reason() -> None:
    traffic, person = _blocked_street()
    _run(traffic, 100, person)
    stuck = traffic.stuck()
    assert [(jam.entity, jam.before) for jam in stuck] == [(1_000_000, 7)]
    assert traffic.jams.count == 0
    where = traffic.shapes.x[0], traffic.shapes.y[0]
    _run(traffic, 80, person)
    rescued = traffic.jams.rescued()
    assert traffic.jams.count == traffic.fleet.teleports.sum() == 1
    assert [(jam.entity, jam.before, jam.position) for jam in rescued] == [(1_000_000, 7, where)]
    assert rescued[0].stood >= 150.0
    assert rescued[0].at > rescued[0].stood


def test_rescues_are_remembered_in_a_saved_state() -> None:
    traffic, person = _blocked_street()
    _run(traffic, 180, person)
    other = _traffic(1, 0)
    other.restore(traffic.arrays())
    assert other.jams.rescued() == traffic.jams.rescued() != []


@pytest.mark.parametrize(("z", "stops"), [(0.0, True), (30.0, False)])
def test_whoever_flies_above_the_street_or_stands_on_a_deck_over_it_stops_no_car(z: float, stops: bool) -> None:
    traffic, person = _blocked_street()
    above = replace(person, position=person.position + np.array([0.0, 0.0, z]))
    far = 0.0
    for _ in range(200):
        traffic.advance(0.1, above)
        far = max(far, float(traffic.fleet.offset[0]))
    assert (far < 60.0) is stops


@pytest.mark.parametrize("height", [0.05, 0.5])
def test_a_car_stops_for_a_thing_that_lies_in_its_lane(height: float) -> None:
    traffic, person = _blocked_street()
    thing = replace(person, kind=np.array([OBJECT], np.int8), height=np.array([height]))
    assert _run(traffic, 30, thing) == 0
    assert traffic.fleet.speed[0] < 0.1


def test_pedestrians_go_round_a_cyclist_as_long_as_the_bicycle() -> None:
    traffic = _traffic(0, 60)
    cyclists = replace(
        Bodies.joined([_person(*traffic.lanes.walks.line(i)[1][:2]) for i in range(12)]),
        entity=np.arange(7, 19, dtype=np.int32),
        half_length=np.full(12, 0.85),
        yaw=np.linspace(0, 3, 12),
    )
    start = len(overlapping(Bodies.joined([traffic.bodies(), cyclists]), 0.0))
    assert start == 0
    assert _run(traffic, 120, cyclists) == 0


def _bus_in_a_junction_beside_a_car(x: float, y: float, yaw: float) -> tuple[LaneNetwork, Records, Shapes]:
    """A bus that turns in a junction, its middle in the origin, headed east, and a car that both stand and touch."""
    net = TrafficNetwork.of(road_city().lanes).driven
    lanes = net.lanes
    fleet = new_fleet(2, 0)
    fleet["lane"] = np.flatnonzero(lanes["junction"] >= 0)[0], np.flatnonzero(lanes["inside"] < 0)[0]
    fleet["length"], fleet["stopped_time"], fleet["blocker"] = (12.0, 4.7), 5.0, (1, -1)
    sides = np.array([[6.0, 2.35], [1.27, 0.9]])
    place, none = np.array([[0.0, x], [0.0, y], [0.0, yaw]]), np.zeros(2)
    return net, fleet, Shapes(*place, *sides, none, none, none + 2.0, none.copy(), none.copy())


def test_a_car_beside_a_turning_bus_backs_up_and_stays_there_until_the_bus_has_gone() -> None:
    net, fleet, shapes = _bus_in_a_junction_beside_a_car(-4.0, 2.3, 0.25)
    assert vehicles_backing_up(net, fleet, shapes, 0.1).tolist() == [False, True]
    assert fleet["gives_way_to"].tolist() == [-1, 0]
    # The bus rolls: the car has nothing to back up for, and does not come back into its way either.
    fleet["blocker"][0], fleet["stopped_time"][0] = -1, 0.0
    assert vehicles_backing_up(net, fleet, shapes, 0.1).tolist() == [False, False]
    assert fleet["gives_way_to"].tolist() == [-1, 0]
    shapes.x[0] += 20.0
    vehicles_backing_up(net, fleet, shapes, 0.1)
    assert fleet["gives_way_to"].tolist() == [-1, -1]


def test_a_car_ahead_in_the_queue_does_not_back_up() -> None:
    net, fleet, shapes = _bus_in_a_junction_beside_a_car(9.0, 0.0, 0.0)
    assert not vehicles_backing_up(net, fleet, shapes, 0.1).any()
    assert fleet["gives_way_to"].tolist() == [-1, -1]


def test_in_a_bend_the_car_ahead_on_the_same_lane_does_not_back_up() -> None:
    net, fleet, shapes = _bus_in_a_junction_beside_a_car(7.0, 3.5, 0.8)
    fleet["lane"][1], fleet["offset"] = fleet["lane"][0], (3.0, 9.0)
    assert not vehicles_backing_up(net, fleet, shapes, 0.1).any()
    fleet["offset"] = 9.0, 3.0
    assert vehicles_backing_up(net, fleet, shapes, 0.1).tolist() == [False, True]


def test_who_waits_on_another_street_backs_up_for_who_cannot_leave_the_junction() -> None:
    net, fleet, shapes = _bus_in_a_junction_beside_a_car(9.0, 0.0, 0.3)
    fleet["junction_wait"][1] = 5.0
    assert vehicles_backing_up(net, fleet, shapes, 0.1).tolist() == [False, True]
    fleet["gives_way_to"], fleet["planned_lanes"][0, 0], fleet["planned_count"][0] = -1, fleet["lane"][1], 1
    assert not vehicles_backing_up(net, fleet, shapes, 0.1).any()


def test_nobody_lets_another_one_pass_for_ever() -> None:
    net, fleet, shapes = _bus_in_a_junction_beside_a_car(-4.0, 2.3, 0.25)
    vehicles_backing_up(net, fleet, shapes, 0.1)
    fleet["stopped_time"] = 0.0
    for _ in range(300):
        fleet["blocker"][0] = -1
        vehicles_backing_up(net, fleet, shapes, 0.1)
    assert fleet["gives_way_to"].tolist() == [-1, -1]


def test_who_backed_onto_the_lane_before_plans_to_take_its_lane_again() -> None:
    fleet, net = new_fleet(1, 0), TrafficNetwork.of(road_city().lanes).driven
    vehicle = fleet.view(np.recarray)[0]
    before, lane, onward = 3, int(net.next[net.lanes[3]["first_next"]]), 5
    vehicle.lane, vehicle.offset, vehicle.previous_lanes[0] = lane, -0.4, before
    vehicle.planned_lanes[0], vehicle.planned_count = onward, 1
    step_back_lane(net, fleet[0])
    assert (vehicle.lane, vehicle.planned_count) == (before, 2)
    assert vehicle.planned_lanes[:2].tolist() == [lane, onward]
    assert vehicle.offset == pytest.approx(net.lanes[before]["length"] - 0.4)
    assert vehicle.previous_lanes[0] == -1
