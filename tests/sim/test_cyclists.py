"""Cyclists in traffic, on the streets of central Helsinki: beside the kerb, overtaken where there is a lane for it."""

import numpy as np
import pytest

from helsinki_traffic import network
from road_city import HALF
from vico.sim.bodies.arrays import CYCLIST, Bodies
from vico.sim.environment.environment import conditions
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import JunctionRule, Traffic, TrafficSetup
from vico.sim.traffic.path import project_on_polyline
from vico.world.heights import HeightField

NOWHERE = Bodies.none()


def _traffic(cars: int, pedestrians: int, cyclists: int) -> Traffic:
    setup = TrafficSetup(JunctionRule.SIGNALS, cyclists=cyclists)
    return Traffic(
        network(), HeightField.flat(HALF), cars=cars, pedestrians=pedestrians, seed=2, first_entity=1, setup=setup
    )


def _right_of_lane(traffic: Traffic, v: int) -> float:
    """How far right of its lane's middle the middle of a bicycle is, metres."""
    lanes, lane = traffic.lanes, int(traffic.fleet.lane[v])
    x, y = traffic.shapes.x[v], traffic.shapes.y[v]
    return -float(project_on_polyline(lanes.points, lanes.along, lanes.first[lane], lanes.first[lane + 1], x, y)[1])


def test_cyclists_ride_beside_the_kerb_touch_nobody_and_go_on_from_a_saved_state() -> None:
    traffic, again = _traffic(20, 15, 25), _traffic(20, 15, 25)
    fleet, own = traffic.fleet, np.arange(20, 45)
    assert (traffic.entities()[1][own] == CYCLIST).all()
    beside, speeds = [], []
    for step in range(600):
        if step % 10 == 0:
            traffic.set_signals(step // 10, ())
            assert step % 20 or len(overlapping(traffic.bodies(), 0.0)) == 0
            straight = own[(traffic.lanes.inside[fleet.lane[own]] < 0) & (fleet.offset[own] > 4.0)]
            straight = straight[fleet.lateral_offset[straight] == 0.0]
            beside += [_right_of_lane(traffic, v) - traffic.lanes.width[fleet.lane[v]] / 2 for v in straight.tolist()]
        traffic.advance(0.1, NOWHERE)
        speeds.append(fleet.speed[own])
        if step == 560:
            again.restore(traffic.arrays())
            again.set_signals(step // 10, ())
        elif step > 560:
            if step % 10 == 0:
                again.set_signals(step // 10, ())
            again.advance(0.1, NOWHERE)
    assert all(np.array_equal(a, again.arrays()[name]) for name, a in traffic.arrays().items())
    assert np.median(beside) == pytest.approx(-0.65, abs=0.02)
    assert np.quantile(np.abs(np.array(beside) + 0.65), 0.9) < 0.2
    assert (np.max(speeds, axis=0) <= fleet.target_speed[own] + 1e-9).all()
    assert np.mean(speeds) > 2.0
    assert traffic.ridden.sum() == pytest.approx(np.sum(speeds) * 0.1, rel=1e-3)
    assert (fleet.lights[own] == 0).all()
    gait = traffic.gait
    assert len(traffic.walkers) == len(gait.walked) == 15 + 25
    assert (gait.cycling[15:] & ~gait.afoot[15:]).all()


def test_who_goes_back_to_where_the_weather_was_another_one_goes_on_in_the_same_way() -> None:
    same = {"visibility": 20_000.0, "snowfall": 0.0, "dark": 0.0, "lamps": 0.0, "ice": 0.0}
    dry = conditions(rain=0.0, wet=0.0, cover=0.0, **same)
    snowy = conditions(rain=0.0, wet=0.0, cover=1.0, **same)
    traffic = _traffic(4, 0, 4)

    def onwards() -> bytes:
        traffic.set_conditions(snowy)
        for _ in range(5):
            traffic.advance(0.1, NOWHERE)
        return traffic.shapes.x.tobytes()

    traffic.set_conditions(dry)
    traffic.advance(0.1, NOWHERE)
    kept = traffic.arrays()
    first = onwards()
    traffic.restore(kept)
    assert onwards() == first


def _behind_cyclist(beside: bool) -> tuple[Traffic, float, float]:
    """A car 20 m behind a slow cyclist, 10 s later, with a second lane or without; how far ahead, and the least gap."""
    traffic = _traffic(1, 0, 1)
    lanes, fleet = traffic.lanes, traffic.fleet
    usable = (lanes.inside < 0) & (lanes.zone < 0) & ~lanes.buses_only & (lanes.right < 0)
    usable &= (lanes.left >= 0) == beside
    lane = int(np.argmax(np.where(usable, lanes.length, 0.0)))
    for v, offset, speed in ((0, 8.0, 8.0), (1, 28.0, 3.0)):
        assert traffic._place_vehicle(v, lane, offset, 0.5)
        fleet.speed[v], fleet.target_speed[1], fleet.time_since_lane_change[v] = speed, 3.0, 60.0
    nearest = 1e9
    street = lanes.edge[lane]
    for _ in range(100):
        traffic.advance(0.1, NOWHERE)
        assert lanes.edge[fleet.lane[0]] == street
        gap = fleet.offset[1] - traffic.fleet.length[1] - fleet.offset[0]
        nearest = min(nearest, gap) if fleet.lane[0] == fleet.lane[1] else nearest
        assert len(overlapping(traffic.bodies(), 0.0)) == 0
    return traffic, float(fleet.offset[0] - fleet.offset[1]), nearest


def test_a_car_overtakes_a_cyclist_on_the_lane_beside_else_it_follows() -> None:
    traffic, ahead, _ = _behind_cyclist(beside=True)
    assert ahead > 5.0
    assert traffic.fleet.speed[0] > 5.0
    traffic, ahead, nearest = _behind_cyclist(beside=False)
    assert ahead < 0.0
    assert nearest > 0.3
    assert traffic.fleet.speed[0] == pytest.approx(3.0, abs=0.3)
