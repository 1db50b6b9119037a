"""Objects that people print say in a line what they are."""

from __future__ import annotations

import toy_city
import vico
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.public import PublicMap
from vico.world.world import World


def test_a_simulation_says_where_and_when_it_is_and_who_is_in_it() -> None:
    config = SimConfig(assistants=4, observe=(), transit=False, date="2026-06-21")
    shown = repr(Simulation(toy_city.world(), None, config))
    assert "2026-06-21 08:00:00, step 0, 4 agents (assistant_0, assistant_1, assistant_2, ...)" in shown
    assert len(shown.splitlines()) == 1


def test_a_map_says_how_much_is_on_it() -> None:
    world = toy_city.world()
    assert f"{len(world.places)} places, {len(world.buildings)} buildings" in repr(PublicMap.from_world(world))


def test_a_view_says_how_large_it_is(helsinki: World) -> None:
    view = vico.view_world(helsinki, width=64, height=48)
    assert repr(view) == f"WorldView(64 x 48 pixels, {len(view.names)} named things in view)"
