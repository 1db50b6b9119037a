"""Signals of central Helsinki: what they show, and who obeys them."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from helsinki_traffic import network, traffic_by
from road_city import road_city
from vico.agents.wayfinding import shows_red
from vico.errors import SchemaError
from vico.sim.bodies.arrays import Bodies
from vico.sim.traffic import JunctionRule, Traffic
from vico.sim.traffic.signals import SignalClock
from vico.sim.traffic.state import AMBER, DARK, GREEN, RED
from vico.world.lanes import read_lanes

NOWHERE = Bodies.none()
CYCLE = 94


def _shown(traffic: Traffic) -> tuple[np.ndarray, np.ndarray]:
    """What lanes' and crossings' signals show in each second of two cycles, shape (seconds, signals)."""
    lanes, walks = [], []
    clock = traffic.signals
    assert clock is not None
    for second in range(2 * CYCLE):
        traffic.set_signals(second, ())
        lanes.append(traffic._net.lanes["light"][clock.lane])
        walks.append(traffic.paths.walkways["light"][clock.walkway])
    return np.array(lanes), np.array(walks)


def test_every_signal_turns_from_green_over_three_seconds_of_amber_to_red_and_back() -> None:
    lanes, walks = _shown(traffic_by(JunctionRule.SIGNALS, 0))
    assert lanes.shape[1] >= 50
    assert walks.shape[1] >= 20
    for column in lanes.T:
        changes = {(int(a), int(b)) for a, b in pairwise(column) if a != b}
        assert changes == {(GREEN, AMBER), (AMBER, RED), (RED, GREEN)}
        ambers = np.flatnonzero((column[:-1] == GREEN) & (column[1:] == AMBER)) + 1
        assert all((column[k : k + 3] == AMBER).all() for k in ambers if k + 3 < len(column))
    assert set(np.unique(walks)) == {GREEN, RED}


def test_nobody_gets_green_within_two_seconds_of_another_ones_amber() -> None:
    traffic = traffic_by(JunctionRule.SIGNALS, 0)
    lanes, walks = _shown(traffic)
    clock = traffic.signals
    assert clock is not None
    for program in np.unique(clock._lane_program):
        mine = lanes[:, clock._lane_program == program]
        everybody = np.column_stack([mine, walks[:, clock._walk_program == program]])
        begins = (everybody[1:] == GREEN) & (everybody[:-1] == RED)
        for k in np.flatnonzero(begins.any(axis=1)) + 1:
            if k >= 2:
                assert not (mine[k - 2 : k] == AMBER).any()


def test_nobody_drives_into_a_junction_or_steps_on_a_crossing_at_red() -> None:
    traffic = traffic_by(JunctionRule.SIGNALS, 60, 60)
    net, paths = traffic._net, traffic.paths
    entered = crossed = waited = 0
    red_since = np.zeros(len(net.lanes))
    for step in range(2400):
        traffic.set_signals(step // 10, ())
        red_since = np.where(net.lanes["light"] == RED, red_since + 0.1, 0.0)
        before, walked = traffic.fleet.lane.copy(), traffic.pedestrian_state.walkway.copy()
        # Who is asked to go by a vehicle that stands before it may.
        asked = traffic.fleet.blocker[traffic.fleet.stopped_time > 1.0] - traffic.vehicles
        traffic.advance(0.1, NOWHERE)
        lane, walkway = traffic.fleet.lane, traffic.pedestrian_state.walkway
        into = (before != lane) & (traffic.lanes.zone[before] < 0) & (net.lanes["light"][lane] != DARK)
        entered += int(into.sum())
        assert red_since[lane[into]].max(initial=0.0) < 1.5
        onto = np.flatnonzero((walked != walkway) & (paths.walkways["light"][walkway] != DARK))
        onto = np.setdiff1d(onto, asked)
        crossed += len(onto)
        assert (paths.walkways["light"][walkway[onto]] == GREEN).all()
        waited += int((net.lanes["light"][lane] == RED).sum())
    assert entered > 50
    assert crossed > 5


def test_a_power_cut_turns_signals_off_and_one_vehicle_at_a_time_passes() -> None:
    traffic = traffic_by(JunctionRule.SIGNALS, 0)
    clock = traffic.signals
    assert clock is not None
    x, y = clock.position[0].tolist()
    traffic.set_signals(0, ((x, y, 5.0),))
    mine = clock._lane_program == 0
    assert (traffic._net.lanes["light"][clock.lane[mine]] == DARK).all()
    assert (traffic._net.lanes["light"][clock.lane[~mine]] != DARK).all()
    exclusive = traffic.junctions.claims.exclusive
    assert set(np.flatnonzero(exclusive)) == set(traffic.lanes.zone[clock.lane[mine]].tolist())
    traffic.set_signals(0, ())
    assert not exclusive.any()
    assert (traffic._net.lanes["light"][clock.lane] != DARK).all()


def test_what_a_signal_shows_over_the_day_is_what_it_shows_in_each_second() -> None:
    traffic = traffic_by(JunctionRule.SIGNALS, 0)
    clock = traffic.signals
    assert clock is not None
    lanes, walks = _shown(traffic)
    for shown, rows, day_of in ((lanes, clock.lane, clock.day_of_lane), (walks, clock.walkway, clock.day_of_walkway)):
        for column, row in zip(shown.T, rows.tolist(), strict=True):
            light = day_of(row).light
            assert np.array_equal(column, light[np.arange(len(column)) % len(light)])


def test_each_seed_begins_the_programs_at_other_seconds() -> None:
    lanes, walks = network().lanes, network().walks
    one, same, other = (SignalClock(lanes, walks, seed)._offset.tolist() for seed in (1, 1, 2))
    assert one == same != other


def test_everybody_is_told_what_signals_near_them_show_and_residents_wait_at_red() -> None:
    traffic = traffic_by(JunctionRule.SIGNALS, 0)
    clock, shown = traffic.signals, traffic.signals_shown()
    assert clock is not None
    assert shown is not None
    way = clock.walkway[0]
    for second in range(CYCLE):
        traffic.set_signals(second, ())
        middle = traffic.walks.points[traffic.walks.first[way] : traffic.walks.first[way + 1]].mean(axis=0)
        shown = traffic.signals_shown()
        assert shown is not None
        info = {"signals": shown.near(*middle.tolist(), 60.0)}
        assert {one["for"] for one in info["signals"]} == {"vehicles", "pedestrians"}
        light = traffic.paths.walkways["light"][way]
        assert shows_red(tuple(middle.tolist()), info) == (light == RED)
        assert not shows_red((1e4, 0.0), info)


def test_signals_are_drawn_as_they_are_lit() -> None:
    traffic = traffic_by(JunctionRule.SIGNALS, 3)
    prototypes = traffic.prototypes()
    names = []
    for second in (0, 30, 45, 60):
        traffic.set_signals(second, ())
        drawn = traffic.draw()
        names.append([drawn.prototypes[k] for k in drawn.index])
        assert set(names[-1]) <= set(prototypes)
    assert len({tuple(name) for name in names}) > 1
    assert any(name.startswith("signal_red") for name in names[0])


def test_without_the_rule_there_are_no_signals() -> None:
    traffic = traffic_by(JunctionRule.SHARED, 3)
    traffic.set_signals(0, ())
    assert traffic.signals_shown() is None
    assert not traffic._net.lanes["light"].any()


def test_a_program_that_lacks_a_link_is_refused(tmp_path: Path) -> None:
    text = road_city().network.net_xml.decode()
    begin = text.index('state="', text.index("<tlLogic")) + len('state="')
    path = tmp_path / "roads.net.xml"
    path.write_text(text[:begin] + "r" + text[begin:])
    with pytest.raises(SchemaError, match="has no phases of equal links"):
        read_lanes(path)
