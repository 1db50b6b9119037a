"""Trams of central Helsinki obey the signals of the lanes beside them."""

import numpy as np

from helsinki_traffic import traffic_by
from road_city import road_city
from vico.sim.traffic import JunctionRule
from vico.sim.traffic.state import AMBER, GREEN, RED
from vico.sim.transit.tram_network import TramSignal, metres_to_signal, signals_of
from vico.sim.transit.trams import Trams

EIGHT = 8 * 3600


def _seconds_at_red(rule: JunctionRule, seconds: int) -> tuple[int, int, float]:
    """Signals that trams passed, how many of them at red, and the longest that one stood before red, seconds."""
    city, traffic = road_city(), traffic_by(rule, 0)
    trams = Trams(city.transit.tram_lines, traffic, second=EIGHT, first_entity=5_000)
    signals = signals_of(trams.tracks, city.lanes)
    passed, at_red, stood = 0, 0, np.zeros(len(trams))
    longest = 0.0
    for step in range(seconds * 10):
        traffic.set_signals(EIGHT + step // 10, ())
        before = trams.front.copy()
        trams.advance(EIGHT + step / 10, 0.1, traffic.bodies())
        for tram in np.flatnonzero((before >= 0.0) & (trams.front >= 0.0)).tolist():
            for place, lane in signals[trams.line_of[tram]]:
                is_red = traffic.lane_lights[lane] == RED
                is_passed = before[tram] < place <= trams.front[tram]
                passed, at_red = passed + is_passed, at_red + (is_passed and is_red)
                if is_red and 0.0 < place - trams.front[tram] < 2.0 and trams.speed[tram] == 0.0:
                    stood[tram] += 0.1
                elif is_passed:
                    stood[tram] = 0.0
        longest = max(longest, float(stood.max()))
    return passed, at_red, longest


def test_trams_stand_at_red_pass_at_green_and_mind_signals_only_where_these_are_obeyed() -> None:
    passed, at_red, longest = _seconds_at_red(JunctionRule.SIGNALS, 400)
    assert passed >= 5
    assert at_red == 0
    assert longest > 3.0
    assert _seconds_at_red(JunctionRule.ONE, 60)[2] == 0.0


def test_a_tram_drives_on_that_could_not_stop_any_more() -> None:
    light = np.array([AMBER, GREEN, RED], np.uint8)
    assert metres_to_signal([TramSignal(100.0, 0)], 50.0, 9.0, light) == 49.0
    assert metres_to_signal([TramSignal(100.0, 0)], 90.0, 9.0, light) == np.inf
    assert metres_to_signal([TramSignal(100.0, 1), TramSignal(120.0, 2)], 99.0, 3.0, light) == 20.0
