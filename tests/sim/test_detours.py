"""Buses of central Helsinki go round a street that an event shuts, and come back onto their line."""

import numpy as np

from helsinki_traffic import network
from road_city import HALF, road_city
from vico.sim.bodies.arrays import Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import Traffic
from vico.sim.transit import TransitSystem, plan_buses
from vico.sim.transit.buses import round_past_closures
from vico.world.heights import HeightField

# When bus 0 drives to its third stop, which the street that is shut cuts off.
SECOND = 8 * 3600.0 - 180.0
LINE, SHUT_STREET = "line_0", "369151175#0"


def _systems() -> tuple[Traffic, TransitSystem, np.ndarray]:
    """One line's buses, and the lanes of a street between its second stop and its fourth."""
    city = road_city()
    lines = [line for line in city.transit.lines if line.id == LINE]
    transit = city.transit.model_copy(update={"lines": lines, "tram_lines": []})
    plan = plan_buses(transit, city.lanes, SECOND)
    traffic = Traffic(
        network(), HeightField.flat(HALF), cars=0, pedestrians=0, seed=3, first_entity=1, buses=plan.bus_routes
    )
    system = TransitSystem(transit, traffic, plan, second=SECOND, first_bike=1_100_000)
    return traffic, system, city.lanes.edge == city.lanes.edges.index(SHUT_STREET)


def _advance(traffic: Traffic, transit: TransitSystem, seconds: int) -> list[int]:
    """Run; return the stops that bus 0 comes to."""
    served: list[int] = []
    for _ in range(seconds * 10):
        traffic.advance(0.1, Bodies.none())
        transit.advance(0.1, Bodies.none())
        stop = transit.stopped_at(0)
        at = -1 if stop is None else transit.line_of(0).stops.index(stop)
        if at >= 0 and at not in served[-1:]:
            served.append(at)
    return served


def test_a_way_round_is_driveable_keeps_the_order_and_leaves_what_is_shut() -> None:
    _, transit, shut = _systems()
    lanes, plan = road_city().lanes, transit._plan
    found = round_past_closures(plan.routes[0], plan.places[0][0], shut, lanes)
    assert found is not None
    assert not shut[list(found.lanes)].any()
    for here, there in zip(found.lanes, (*found.lanes[1:], found.lanes[0]), strict=True):
        assert there in lanes.following(here) or there in (lanes.left[here], lanes.right[here])
    kept = [at for at in found.origin if at >= 0]
    assert kept == sorted(kept)
    assert [plan.routes[0][at] for at in kept] == [one for one, at in zip(*found, strict=True) if at >= 0]
    assert round_past_closures(plan.routes[0], plan.places[0][0], np.zeros(len(lanes), bool), lanes) is None


def test_a_bus_goes_round_a_shut_street_skips_what_it_cannot_reach_and_comes_back() -> None:
    traffic, transit, shut = _systems()
    skipped = next(stop for stop in transit.transit.stops if stop.id == transit.line_of(0).stops[2])
    _advance(traffic, transit, 20)
    assert transit.stop[0] == 2
    assert transit.lateness()["skipped"] == 0
    assert transit.goes_round(skipped.wait, 3.0) is None
    traffic.set_shut(shut, None)
    served = _advance(traffic, transit, 100)
    assert transit.detours.on[0]
    # Who waits there is told, who waits elsewhere is not.
    assert transit.goes_round(skipped.wait, 3.0) == transit.line_of(0).name
    elsewhere = next(stop for stop in transit.transit.stops if stop.id == transit.line_of(0).stops[3])
    assert transit.goes_round(elsewhere.wait, 3.0) is None
    # Goes on from a saved state, in traffic that knows nothing of it, as if nothing had been.
    again, transit_again, _ = _systems()
    again.restore(traffic.arrays())
    transit_again.restore(transit.arrays())
    again.set_shut(shut.copy(), None)
    following = _advance(traffic, transit, 40)
    assert _advance(again, transit_again, 40) == following
    assert all(np.array_equal(a, again.arrays()[name]) for name, a in traffic.arrays().items())
    assert all(np.array_equal(a, transit_again.arrays()[name]) for name, a in transit.arrays().items())
    served += following
    for _ in range(25):
        served += _advance(traffic, transit, 10)
        assert not shut[traffic.fleet.lane].any()
        assert len(overlapping(traffic.bodies(), 0.0)) == 0
        if 3 in served:
            break
    assert 2 not in served
    assert 3 in served
    assert transit.lateness()["skipped"] >= 1
    traffic.set_shut(None, None)
    _advance(traffic, transit, 60)
    assert not transit.detours.on.any()
    assert transit.goes_round(skipped.wait, 3.0) is None
    assert traffic.fleet.teleports.sum() == 0
