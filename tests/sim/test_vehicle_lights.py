"""What vehicles show with their lamps, and how hard they brake for who is suddenly in their way."""

import numpy as np
import pytest

from helsinki_traffic import traffic_by
from vico.sim.bodies.arrays import RESIDENT, ROBOT, Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import JunctionRule, Traffic
from vico.sim.traffic.lights import BRAKE, LEFT, RIGHT

NOWHERE = Bodies.none()


def test_who_brakes_or_stands_shows_it_and_who_turns_signals_before() -> None:
    traffic = traffic_by(JunctionRule.SIGNALS, 60)
    fleet, net = traffic.fleet, traffic._net
    braked = turned = 0
    for step in range(900):
        traffic.set_signals(step // 10, ())
        before, laps = fleet.speed.copy(), fleet.laps.copy()
        traffic.advance(0.1, NOWHERE)
        before[laps != fleet.laps] = fleet.speed[laps != fleet.laps]  # it has left the map, and come back in
        slows, on_brake = before - fleet.speed > 0.1, traffic.lights & BRAKE > 0
        assert on_brake[slows | ((fleet.stopped_time > 0.1) & (fleet.speed == 0.0))].all()
        assert not on_brake[(fleet.speed > before) & (fleet.speed > 0.0)].any()
        braked += int(slows.sum())
        turn = net.lanes["turn"][fleet.lane]
        steady = (turn != 0) & (fleet.lateral_offset == 0.0)
        shown = np.where(traffic.lights & LEFT > 0, 1, np.where(traffic.lights & RIGHT > 0, -1, 0))
        assert (shown[steady] == turn[steady]).all()
        turned += int(steady.sum())
    assert braked > 100
    assert turned > 100


def test_lit_lamps_are_drawn_on_their_vehicles() -> None:
    traffic = traffic_by(JunctionRule.ONE, 2)
    traffic.fleet.lights[:] = BRAKE | LEFT, 0
    drawn = traffic.draw()
    names = [drawn.prototypes[k] for k in drawn.index]
    kind = names[0].split("_")[0]
    assert set(names[2:]) <= {f"{kind}:brake", f"{kind}:left"}
    assert f"{kind}:brake" in names
    assert set(names) <= set(traffic.prototypes())
    assert (drawn.entity[2:] == drawn.entity[0]).all()


def _in_the_way(traffic: Traffic, ahead: float, kind: int) -> Bodies:
    """A person or a robot so many metres before the first car's front, on its lane."""
    car = traffic.fleet[0]
    x, y, yaw = traffic.lanes.at(car.lane, car.offset + ahead)
    size = 0.25 if kind == RESIDENT else 0.4
    one = np.full(1, size)
    return Bodies(
        np.array([7], np.int32), np.array([kind], np.int8), np.array([[x, y, 0.0]]), np.array([yaw]), one, one,
        np.array([1.0]), np.zeros((1, 2)),
    )  # fmt: skip


@pytest.mark.parametrize("kind", [RESIDENT, ROBOT])
def test_a_car_brakes_as_hard_as_it_can_for_who_is_suddenly_in_its_way(kind: int) -> None:
    traffic = traffic_by(JunctionRule.ONE, 1)
    car = traffic.fleet[0]
    for _ in range(3000):
        traffic.advance(0.1, NOWHERE)
        if car.speed > 8.0 and traffic.lanes.length[car.lane] - car.offset > 25.0 and car.lateral_offset == 0.0:
            break
    start, speed = traffic.arrays(), float(car.speed)
    # Nearer than where a comfortable braking would end, farther than where the hardest one does.
    ahead = speed**2 / (2 * 6.0) + 1.5
    assert ahead < speed**2 / (2 * 2.0)
    ends, hardest = [], []
    for obstacles in (_in_the_way(traffic, ahead, kind), NOWHERE):
        traffic.restore(start)
        rates = []
        for _ in range(50):
            before = float(car.speed)
            traffic.advance(0.1, obstacles)
            rates.append((before - float(car.speed)) / 0.1)
            assert len(overlapping(Bodies.joined([traffic.bodies(), obstacles]), 0.0)) == 0
        ends.append(float(car.speed))
        hardest.append(max(rates))
    assert ends[0] == 0.0 < 4.0 < ends[1]
    assert hardest[0] > 4.0 > hardest[1]
