"""Crowds of events: pedestrians who come, watch, march and go on, on the streets of central Helsinki."""

import numpy as np
import shapely

from helsinki_traffic import traffic_by
from vico.sim.animation import Hold
from vico.sim.bodies.arrays import Bodies
from vico.sim.environment.agenda import Agenda
from vico.sim.environment.event_sites import MARCH_SPEED, EventSites, Gathering, Spot, before_stage, gathering_of
from vico.sim.loop.checks import overlapping
from vico.sim.pictures.hands import hands_of_pedestrians
from vico.sim.traffic import JunctionRule, Traffic
from vico.sim.traffic.state import CROWD
from vico.world.walkways import SIDEWALK
from vico.world.world import World

NOWHERE = Bodies.none()


def _gathering(traffic: Traffic, manner: str, count: int) -> Gathering:
    """A crowd beside, or along, the sidewalk on which most pedestrians are."""
    walks = traffic.walks
    on = np.bincount(traffic.pedestrian_state.walkway, minlength=len(walks)) * (walks.kind == SIDEWALK)
    way = int(np.argmax(on + (walks.length > 40.0)))
    line = shapely.LineString(walks.line(way))
    offset = line.length / 2
    entry = line.interpolate(offset).coords[0]
    places = before_stage([Spot("open_air_stage", entry[0], entry[1], 0.0)])
    return Gathering(1, manner, count, 0.0, way, offset, entry[:2], places, shapely.get_coordinates(line), 2)


def _run(traffic: Traffic, one: Gathering, start: int, seconds: int) -> int:
    """Lead the crowd, and return how many overlaps there were."""
    overlaps = 0
    for second in range(start, start + seconds):
        traffic.gatherings.follow((one,) if second == start else traffic.gatherings.now)
        traffic.gatherings.advance(float(second))
        for _ in range(10):
            traffic.advance(0.1, NOWHERE)
        overlaps += len(overlapping(traffic.bodies(), 0.0))
    return overlaps


def test_places_before_a_stage_look_at_it_and_are_apart() -> None:
    places = before_stage([Spot("open_air_stage", 3.0, 4.0, 1.0)])
    to_stage = np.array([3.0, 4.0]) - places[:, :2]
    towards = np.column_stack([np.cos(places[:, 2]), np.sin(places[:, 2])])
    assert np.allclose(to_stage / np.linalg.norm(to_stage, axis=1)[:, None], towards)
    apart = np.hypot(*(places[:, None, :2] - places[None, :, :2]).transpose(2, 0, 1)) + 9.0 * np.eye(len(places))
    assert apart.min() > 0.8
    # Before it, not behind.
    assert (-to_stage @ [np.cos(1.0), np.sin(1.0)]).min() > 0.0


def test_a_crowd_comes_and_stands_and_goes_when_it_is_over() -> None:
    traffic, again = traffic_by(JunctionRule.ONE, 5, 60), traffic_by(JunctionRule.ONE, 5, 60)
    walkers, one = traffic.pedestrian_state, _gathering(traffic, "watch", 6)
    assert _run(traffic, one, 0, 165) == 0
    stands = np.flatnonzero(walkers.stand_kind == CROWD)
    assert len(stands) >= 2
    there = traffic.walkers.position[stands, :2] - one.places[walkers.place[stands], :2]
    assert (np.hypot(*there.T) < 0.25).sum() >= 2
    saved = traffic.arrays()
    assert _run(traffic, one, 165, 10) == 0
    again.gatherings.follow((one,))
    again.restore(saved)
    _run(again, one, 165, 10)
    assert all(np.array_equal(values, again.arrays()[name]) for name, values in traffic.arrays().items())
    traffic.gatherings.follow(())
    assert not walkers.event.any()
    assert not (walkers.stand_kind == CROWD).any()


def test_a_march_goes_slowly_along_its_street_and_back() -> None:
    one = _gathering(traffic_by(JunctionRule.ONE, 0, 30), "march", 6)
    walked = [one.place(5, float(second))[:2] for second in range(60)]
    steps = np.hypot(*np.diff(walked, axis=0).T)
    assert np.median(steps) < MARCH_SPEED + 0.1
    length = one.length
    there, back = one.place(0, 1.0), one.place(0, 1.0 + 2 * (length - 2.8) / MARCH_SPEED)
    assert np.allclose(there[:2], back[:2], atol=0.05)
    # Three rows of two.
    row = [one.place(k, 10.0)[:2] for k in range(6)]
    assert np.isclose(np.hypot(*(row[0] - row[1])), 0.95)


def test_one_of_three_who_march_brings_a_placard() -> None:
    traffic = traffic_by(JunctionRule.ONE, 0, 30)
    walkers = traffic.pedestrian_state
    one = _gathering(traffic, "march", 6)
    traffic.gatherings.now = (one,)
    walkers.event[:9] = one.id
    walkers.stand_kind[:3] = CROWD
    near, far = (np.tile(one.entry, (30, 1)) + np.array([away, 0.0]) for away in (10.0, 40.0))
    assert np.flatnonzero(traffic.gatherings.placards(near)).tolist() == [0, 3, 6]
    assert traffic.gatherings.placards(far).tolist() == [1.0] + [0.0] * 29
    hands = hands_of_pedestrians(np.zeros(30), 20.0, traffic.gatherings.placards(near), np.ones(30, bool))
    assert (hands.hold[[0, 3, 6]] == Hold.PLACARD_RIGHT).all()
    assert hands.hold[1] == Hold.UMBRELLA_RIGHT


def test_nobody_comes_along_a_walkway_that_nobody_walks_on(helsinki: World) -> None:
    sites = EventSites(helsinki)
    (occurrence,) = Agenda(
        sites, {"events": [{"kind": "demonstration", "street": "Mikonkatu", "begin": "00:00"}]}
    ).going_on
    first = gathering_of(occurrence, sites)
    assert first is not None
    off = np.zeros(len(sites.walks), np.bool_)
    off[first.walkway] = True
    other = gathering_of(occurrence, sites, off)
    assert other is None or other.walkway != first.walkway
