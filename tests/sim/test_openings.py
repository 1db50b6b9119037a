"""Opening hours: who is let in when, and who has to leave."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import toy_city
from vico.sim.config import NO_DAY, SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.world import World

HOURS = "Mo-Fr 09:00-17:00; Sa,Su off"


def city() -> World:
    """The toy city with a shop that keeps hours."""
    world = toy_city.world()
    places = [
        place.model_copy(update={"opening_hours": HOURS if place.id == toy_city.SHOP else None})
        for place in world.places
    ]
    world.__dict__["places"] = places
    return world


def at_the_shop(start: int, **config: Any) -> tuple[Simulation, dict[str, Any]]:
    """An assistant who asks to be let into the shop; its state afterwards."""
    config = {"date": "2026-06-22", "opening_hours": True} | config
    sim = Simulation(city(), None, SimConfig(assistants=1, start=start, observe=(), transit=False, **config))
    sim.scenario.place_agent("assistant_0", (5.0, 3.5))
    result = sim.step({"assistant_0": {"type": "enter", "place": toy_city.SHOP}})
    return sim, result.observations["assistant_0"]["state"]


def test_a_closed_shop_lets_nobody_in_and_says_its_hours() -> None:
    sim, state = at_the_shop(8 * 3600)
    assert state["action_code"] == "closed"
    name = next(place.name for place in sim.world.places if place.id == toy_city.SHOP)
    assert sim.state.people.reason[0] == f"enter: {name} is closed now; it is open 09:00-17:00 on Mo"
    assert sim.observe()[1]["assistant_0"]["closed_now"] == [toy_city.SHOP]
    # On Sundays it does not open; nobody asks for hours who does not say so.
    assert at_the_shop(12 * 3600, date="2026-06-21")[0].state.people.reason[0].endswith("it is not open on Su")
    assert at_the_shop(12 * 3600)[1]["action_status"] == "ok"
    assert at_the_shop(8 * 3600, opening_hours=False)[1]["action_status"] == "ok"


def test_who_is_in_at_closing_time_is_told() -> None:
    sim, state = at_the_shop(17 * 3600 - 5)
    assert state["action_status"] == "ok"
    assert "closed_now" not in sim.observe()[1]["assistant_0"]
    for _ in range(6):
        sim.step({})
    assert sim.observe()[1]["assistant_0"]["closed_now"] == [toy_city.SHOP]


def test_a_run_is_on_the_communitys_day_unless_it_is_told_another() -> None:
    world, people = toy_city.world(), toy_city.community()
    bare = SimConfig(observe=(), transit=False)
    assert Simulation(world, people, bare).config.date == people.date.isoformat()
    assert Simulation(world, people, replace(bare, date="2026-12-24")).config.date == "2026-12-24"
    assert Simulation(world, None, bare).config.date == NO_DAY.isoformat()
