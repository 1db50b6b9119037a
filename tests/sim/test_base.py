"""What never changes is built once a world; a simulation on it equals one in a fresh process."""

from __future__ import annotations

import pytest

import toy_city
from vico.errors import InputError
from vico.sim.base import SimulationBase
from vico.sim.config import SimConfig
from vico.sim.simulation import Simulation


def test_simulations_of_a_world_share_what_never_changes() -> None:
    world = toy_city.world()
    a, b = (Simulation(world, toy_city.community(), SimConfig(seed=seed, observe=())) for seed in (0, 1))
    assert a.state.indoor is b.state.indoor
    assert a.base is b.base is SimulationBase.of(world)


def test_a_base_of_another_world_is_refused() -> None:
    with pytest.raises(InputError, match="made of another world"):
        Simulation(toy_city.world(), None, base=SimulationBase.of(toy_city.world()))
