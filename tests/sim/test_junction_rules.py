"""Who may be in a junction, by each rule, on the streets of central Helsinki."""

import numpy as np
import pytest

from helsinki_traffic import network, traffic_by
from vico.errors import InputError
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import JunctionRule


def test_those_in_a_shared_junction_are_on_lanes_that_do_not_conflict() -> None:
    traffic = traffic_by(JunctionRule.SHARED)
    first, conflict = network().conflicts
    together = 0
    for _ in range(1200):
        traffic.advance(0.1, Bodies.none())
        inside = [int(lane) for lane in traffic.fleet.lane if traffic.lanes.zone[lane] >= 0]
        for k, lane in enumerate(inside):
            others = set(inside[k + 1 :]) - {lane}
            assert not set(conflict[first[lane] : first[lane + 1]]) & others
        zones = [int(traffic.lanes.zone[lane]) for lane in inside]
        together += len(zones) - len(set(zones))
    assert together > 0


def test_a_crowd_gets_on_faster_where_junctions_are_shared_and_nobody_touches_anybody() -> None:
    speeds = {}
    for rule in (JunctionRule.ONE, JunctionRule.SHARED):
        traffic = traffic_by(rule, 100, 100)
        driven = []
        for _ in range(900):
            traffic.advance(0.1, Bodies.none())
            driven.append(traffic.fleet.speed.mean())
            assert len(overlapping(traffic.bodies(), 0.0)) == 0
        speeds[rule] = np.mean(driven[300:])
    assert speeds[JunctionRule.SHARED] > 1.2 * speeds[JunctionRule.ONE]


def test_an_unknown_rule_is_refused() -> None:
    with pytest.raises(InputError, match="junctions is 'none'; take one, shared, signals, both"):
        SimConfig(junctions="none")
