"""Arrivals are judged on every day of a run, not on the first alone."""

from __future__ import annotations

import toy_city
from vico.clock import DAY
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation


def evening() -> Simulation:
    """The toy city an hour before midnight, everybody where the day left them."""
    return Simulation(toy_city.world(), toy_city.community(), SimConfig(start=23 * 3600, observe=()))


def test_who_is_not_back_by_the_next_morning_is_late_and_who_goes_there_has_arrived() -> None:
    sim = evening()
    state, watched = sim.state, sim.punctuality
    cafe, shop = (state.place_index[place] for place in (toy_city.CAFE, toy_city.SHOP))
    assert (state.people.place[:2] == shop).all()

    def kinds(second: float) -> list[tuple[str, str]]:
        state.tick = second * 100
        state.events.begin(0, second, state.names)
        watched.watch(state)
        return [(event.agent, event.kind) for event in state.events.log]

    assert kinds(DAY - 5) == []
    assert kinds(DAY + 30) == []  # not called late for a minute
    assert ("resident_0", "late") in kinds(DAY + 90)
    state.people.place[0] = cafe
    assert ("resident_0", "arrival") in kinds(DAY + 600)
    state.people.place[0] = shop
    assert ("resident_0", "arrival") in kinds(DAY + 8 * 3600 + 100)
    assert watched.day[:2].tolist() == [2, 1]
    assert (watched.arrivals[0], watched.late[0]) == (2, 1)


def test_every_day_has_its_arrivals() -> None:
    sim = evening()
    state = sim.state
    cafe, shop = (state.place_index[place] for place in (toy_city.CAFE, toy_city.SHOP))
    for day in range(1, 6):
        for second, place in ((10, cafe), (8 * 3600 + 120, shop)):
            state.tick = 100 * (day * DAY + second)
            state.people.place[0] = place
            sim.punctuality.watch(state)
    assert (sim.punctuality.arrivals[0], sim.punctuality.late[0]) == (10, 0)
