"""Pedestrians who walk together, on the streets of central Helsinki."""

import numpy as np

from helsinki_traffic import traffic_by
from vico.sim.bodies.arrays import Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import JunctionRule, Traffic
from vico.sim.traffic.pedestrian_routes import leave_crossing, note_distance
from vico.sim.traffic.pedestrians import asked_to_go
from vico.world.walkways import CORNER, CROSSING

NOWHERE = Bodies.none()


def test_a_third_walk_in_twos_and_threes_and_stay_together_and_touch_nobody() -> None:
    traffic = traffic_by(JunctionRule.SIGNALS, 30, 120)
    walkers = traffic.pedestrian_state
    led = np.flatnonzero(walkers.leader >= 0)
    assert 0.2 < (walkers.group_size > 1).mean() < 0.45
    assert set(walkers.group_size.tolist()) == {1, 2, 3}
    apart, beside, overlaps = [], [], 0
    for step in range(1800):
        if step % 10 == 0:
            traffic.set_signals(step // 10, ())
        traffic.advance(0.1, NOWHERE)
        if step % 10 == 9:
            body = traffic.walkers
            to_leader = body.position[walkers.leader[led], :2] - body.position[led, :2]
            forward = np.column_stack([np.cos(body.yaw[led]), np.sin(body.yaw[led])])
            apart.append(np.hypot(*to_leader.T))
            beside.append(np.abs((to_leader * forward).sum(axis=1)) < 0.4)
            overlaps += len(overlapping(traffic.bodies(), 0.0))
    assert overlaps == 0
    assert (np.array(apart) < 4.0).mean() > 0.95
    assert 0.2 < (np.array(beside) & (np.array(apart) < 2.5)).mean() < 0.9
    # Nobody stands because of the others: they get as far as those who walk alone, and none stands before its own.
    assert walkers.jammed_time.max() < 60.0
    alone = walkers.distance_walked[walkers.group_size == 1].mean()
    assert walkers.distance_walked[led].mean() > 0.8 * alone


def test_groups_go_on_from_a_saved_state_as_if_nothing_had_been() -> None:
    first, again = traffic_by(JunctionRule.ONE, 5, 40), traffic_by(JunctionRule.ONE, 5, 40)
    assert (first.pedestrian_state.leader >= 0).any()
    for _ in range(200):
        first.advance(0.1, NOWHERE)
    again.restore(first.arrays())
    for _ in range(100):
        first.advance(0.1, NOWHERE)
        again.advance(0.1, NOWHERE)
    assert all(np.array_equal(a, again.arrays()[name]) for name, a in first.arrays().items())


def test_who_stands_beyond_the_end_of_a_crossing_is_off_it_however_little_it_walked() -> None:
    traffic = traffic_by(JunctionRule.ONE, 0, 1)
    walks, walkers, paths = traffic.walks, traffic._walkers, traffic.paths
    crossing = int(np.flatnonzero(walks.kind == CROSSING)[0])
    line = walks.line(crossing)
    out = (line[-1] - line[-2]) / np.linalg.norm(line[-1] - line[-2])
    traffic.junctions.walkers_on[crossing] = 1
    walkers["leaving_crossing"], walkers["leaving_since"] = crossing, walkers["distance_walked"]
    for beyond, is_off in ((-1.0, False), (0.1, False), (0.4, True)):
        leave_crossing(paths, walkers[0], traffic.junctions, *(line[-1] + beyond * out))
        assert (walkers["leaving_crossing"][0] < 0) == is_off
        assert traffic.junctions.walkers_on[crossing] == (0 if is_off else 1)


def test_who_waits_for_a_crossing_on_rails_before_a_tram_goes_at_once() -> None:
    traffic = traffic_by(JunctionRule.ONE, 60, 60)
    walkers = traffic.pedestrian_state
    for _ in range(1200):
        traffic.advance(0.1, NOWHERE)
        waits = np.flatnonzero((walkers.crossing_wait > 1.0) & (walkers.crossing_wait < 5.0) & (walkers.leader < 0))
        if len(waits) > 1:
            break
    one, other = waits[:2].tolist()
    walkers.before_tram[one] = True
    traffic.advance(0.1, NOWHERE)
    assert (walkers.crossing_wait[[one, other]] > 0.0).tolist() == [False, True]
    assert traffic.walks.kind[walkers.walkway[[one, other]]].tolist() == [CROSSING, CORNER]


def pair() -> tuple[Traffic, int]:
    """Traffic by one occupant at a time, and who leads the first two who walk together."""
    traffic = traffic_by(JunctionRule.ONE, 5, 60)
    walkers = traffic.pedestrian_state
    return traffic, int(np.flatnonzero((walkers.group_size == 2) & (walkers.leader < 0))[0])


def test_who_leads_does_not_wait_for_a_companion_who_is_ahead() -> None:
    traffic, leader = pair()
    walkers, shapes, first = traffic._walkers, traffic.shapes, traffic.vehicles
    other = leader + 1
    for name in ("walkway", "direction"):
        walkers[name][other] = walkers[name][leader]
    shapes.x[first + other] = shapes.x[first + leader] + 5.0
    shapes.y[first + other] = shapes.y[first + leader]
    for ahead, apart in ((-5.0, 5.0), (5.0, 0.0)):
        walkers["offset"][other] = walkers["offset"][leader] + ahead * walkers["direction"][leader]
        note_distance(walkers, leader, shapes, first)
        note_distance(walkers, other, shapes, first)
        assert (walkers["apart"][leader], walkers["apart"][other]) == (apart, 5.0)


def test_a_vehicle_that_waits_for_a_companion_asks_who_leads_it_to_go_too() -> None:
    traffic, leader = pair()
    fleet, first = traffic._vehicles, traffic.vehicles
    fleet["blocker"] = -1
    fleet["blocker"][0], fleet["stopped_time"][0] = first + leader + 1, 5.0
    assert np.flatnonzero(asked_to_go(fleet, first, traffic._walkers)).tolist() == [leader, leader + 1]
    fleet["blocker"] = -1
    traffic._walkers["before_tram"][leader + 1] = True
    assert np.flatnonzero(asked_to_go(fleet, first, traffic._walkers)).tolist() == [leader, leader + 1]
