"""Departures, and the times that the buses there are can keep."""

from __future__ import annotations

import pytest

from vico.clock import DAY
from vico.rules import BUS_DWELL, ride_price
from vico.world.transit import Line, LineTimes, buses_needed, departure, next_departure


def line(departures: list[int], travel: list[float]) -> Line:
    stops = [f"stop_{k}" for k in range(len(travel) - 1)]
    return Line(id="l", name="1", colour="#000000", stops=stops, lanes=[], departures=departures, travel=travel)


HOURLY = line(list(range(5 * 3600, 23 * 3600 + 1, 600)), [0.0, 60.0, 150.0, 300.0])


def test_every_day_is_alike() -> None:
    n = len(HOURLY.departures)
    assert departure(HOURLY, n) == HOURLY.departures[0] + DAY
    assert next_departure(HOURLY, DAY + 5 * 3600.0) == n
    times = LineTimes.of(HOURLY)
    assert times.next_round(0, DAY + 5 * 3600.0) == n
    assert times.next_round(0, DAY + 5 * 3600.5) == n + 1


def test_a_bus_leaves_a_stop_after_the_time_that_people_board_in() -> None:
    times = LineTimes.of(HOURLY)
    assert times.leaves(0, 0) == 5 * 3600
    assert times.arrives(0, 1) == 5 * 3600 + 60
    assert times.leaves(0, 1) == 5 * 3600 + 60 + BUS_DWELL
    assert times.next_round(1, 5 * 3600 + 60 + BUS_DWELL) == 0
    assert times.next_round(1, 5 * 3600 + 60.1 + BUS_DWELL) == 1


def test_at_the_end_of_its_round_a_bus_waits_for_its_next_departure() -> None:
    times = LineTimes.of(HOURLY)
    assert times.buses == 1
    assert times.arrives(0, 3) == 5 * 3600 + 300
    assert times.leaves(0, 3) == times.begins(1)


def test_a_line_with_too_few_buses_runs_as_often_as_they_come_back() -> None:
    # Every five minutes, a round of 17 and the time to board: two buses (no more than stops) are back every 525 s.
    crowded = line(list(range(36_000, 40_000, 300)), [0.0, 500.0, 1020.0])
    times = LineTimes.of(crowded)
    assert times.buses == buses_needed(crowded) == 2
    assert times.departures[:4] == (36_000.0, 36_300.0, 37_050.0, 37_350.0)
    assert all(b >= a for a, b in zip(times.departures, times.departures[1:], strict=False))


def test_a_ride_costs_by_the_started_minute() -> None:
    assert [ride_price(s, returned=True) for s in (0.0, 60.0, 61.0)] == pytest.approx([0.2, 0.2, 0.4])
