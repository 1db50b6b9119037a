"""Tracks across streets: vehicles stop before them while a tram comes, do not stand on them, and are waited for."""

import numpy as np

from helsinki_traffic import network
from road_city import HALF
from vico.sim.bodies.arrays import Bodies
from vico.sim.traffic import JunctionRule, Traffic, TrafficSetup
from vico.sim.traffic.placement import placed_traffic
from vico.sim.traffic.route import STANDING_ROOM
from vico.sim.traffic.state import TRACK_CROSSING
from vico.sim.transit.tram_network import TramCrossings
from vico.world.heights import HeightField
from vico.world.transit import Track

_NOBODY = np.zeros((0, 9))


def crossed() -> tuple[Traffic, TramCrossings, int, float]:
    """A car 40 m before a track across the longest lane without others beside it, and where along it they meet."""
    lanes = network().lanes
    plain = (lanes.inside < 0) & (lanes.left < 0) & (lanes.right < 0) & (lanes.zone < 0)
    lane = int(np.argmax(np.where(plain, lanes.length, 0.0)))
    meets = float(lanes.length[lane]) / 2
    x, y, yaw = lanes.at(lane, meets)
    across = np.array([-np.sin(yaw), np.cos(yaw)]) * 20.0
    track = Track([(x - across[0], y - across[1]), (x + across[0], y + across[1])])
    placed = placed_traffic({"cars": [{"at": lanes.at(lane, meets - 40.0)[:2].tolist()}]})
    traffic = Traffic(
        network(),
        HeightField.flat(HALF),
        cars=0,
        pedestrians=0,
        seed=1,
        first_entity=1_000_000,
        setup=TrafficSetup(JunctionRule.ONE, placed),
    )
    assert traffic.fleet.lane[0] == lane
    return traffic, TramCrossings([track], traffic), lane, meets


def drive(traffic: Traffic, seconds: int) -> None:
    for _ in range(seconds * 10):
        traffic.advance(0.1, Bodies.none())


def test_a_car_waits_before_tracks_until_the_tram_has_passed_and_a_tram_for_a_car_on_them() -> None:
    traffic, crossings, lane, meets = crossed()
    crossings.begin_step(_NOBODY)
    # Far from the lane nobody has to wait; a tram that comes is let through, and the car stops before its way.
    assert crossings.metres_to_wait(0, 0.0, 5.0, 40.0) == np.inf
    assert crossings.called.all()
    drive(traffic, 15)
    assert traffic.fleet.speed[0] == 0.0
    assert meets - 8.0 < traffic.fleet.offset[0] < meets - 2.0
    # Nobody comes any more: it drives on, and is waited for while it is on the tracks.
    crossings.begin_step(_NOBODY)
    waited = []
    for _ in range(12):
        drive(traffic, 1)
        waited.append(crossings.metres_to_wait(0, 10.0, 2.0, 40.0))
        crossings.begin_step(_NOBODY)
    assert traffic.fleet.lane[0] != lane or traffic.fleet.offset[0] > meets + 5.0
    assert 0.0 < min(waited) < 10.0
    assert waited[-1] == np.inf


def test_a_tram_behind_somebody_who_stands_before_the_crossing_does_not_keep_that_one_from_it() -> None:
    traffic, crossings, _, _ = crossed()
    track = crossings._tracks[0]
    begin = crossings._stretches[0][0].start
    x, y, yaw = track.section(np.array([begin - 1.0]))[0]
    car = np.array([[x, y, np.cos(yaw), np.sin(yaw), 1.9, 0.9, 0.0, 0.0, 0.0]])
    crossings.begin_step(car)
    assert crossings.metres_to_wait(0, begin - 6.0, 0.0, 3.0) == np.inf  # what is ahead is told by `free`
    front = begin - 4.0
    assert crossings.metres_to_wait(0, front, 0.0, 5.0) < 4.0
    assert not crossings.called.any()
    car[0, 7:] = 2.0 * np.cos(yaw), 2.0 * np.sin(yaw)  # once it drives on the tram comes next
    crossings.begin_step(car)
    crossings.metres_to_wait(0, front, 0.0, 5.0)
    assert crossings.called.all()
    assert traffic.crossed_tracks().sum() == 0


def short_street() -> tuple[int, int]:
    """A lane that leads through a junction onto one street alone, of 25 to 60 m, that goes on; and that street."""
    lanes, driven = network().lanes, network().driven.lanes
    for before in np.flatnonzero((lanes.inside < 0) & (lanes.length > 25.0) & ~driven["closed"]).tolist():
        inside = lanes.following(before)
        is_asked_for = len(inside) == 1 and driven["junction"][inside[0]] >= 0
        street = lanes.following(int(inside[0])) if is_asked_for else []
        if len(street) == 1 and 25.0 < lanes.length[street[0]] < 60.0 and len(lanes.following(int(street[0]))):
            return before, int(street[0])
    raise AssertionError("no such street in central Helsinki")


def test_a_car_drives_through_a_junction_though_tracks_leave_no_room_to_stand_on_the_street_behind_it() -> None:
    lanes = network().lanes
    before, street = short_street()
    at = lanes.at(before, float(lanes.length[before]) - 4.0)[:2]
    setup = TrafficSetup(JunctionRule.ONE, placed_traffic({"cars": [{"at": at.tolist()}]}))
    traffic = Traffic(
        network(), HeightField.flat(HALF), cars=0, pedestrians=0, seed=1, first_entity=1_000_000, setup=setup
    )
    assert traffic.fleet.lane[0] == before
    behind = float(traffic.fleet.length[0]) + STANDING_ROOM - 0.2  # m
    traffic.put_tracks(np.array([(street, 0.0, float(lanes.length[street]) - behind, False)], TRACK_CROSSING))
    drive(traffic, 30)
    assert traffic.fleet.lane[0] not in (before, street)
