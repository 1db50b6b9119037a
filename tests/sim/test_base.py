"""What never changes is built once a world; a simulation on it equals one in a fresh process."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import toy_city
from vico.errors import InputError
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.state.base import SimulationBase
from vico.world.world import World


def test_simulations_of_a_world_share_what_never_changes() -> None:
    world = toy_city.world()
    a, b = (Simulation(world, toy_city.community(), SimConfig(seed=seed, observe=())) for seed in (0, 1))
    assert a.state.indoor is b.state.indoor
    assert a.base is b.base is SimulationBase.of(world)


def test_a_base_of_another_world_is_refused() -> None:
    with pytest.raises(InputError, match="made of another world"):
        Simulation(toy_city.world(), None, base=SimulationBase.of(toy_city.world()))


CROWD = SimConfig(cars=4, pedestrians=4, robots=("husky", "go2"), assistants=1, observe=())


def hashes(sim: Simulation, steps: int) -> list[str]:
    """Hash of the state before and after each of some steps in which somebody and a robot move."""
    found = [sim.state_hash()]
    for k in range(steps):
        action = {"type": "turn_left", "degrees": 30.0} if k % 3 == 0 else {"type": "move_forward", "distance": 1.0}
        found.append(sim.step({"assistant_0": action}).hash)
    return found


def test_a_simulation_on_a_used_base_equals_one_in_a_fresh_process(helsinki: World, helsinki_path: Path) -> None:
    for seed in (3, 1):
        hashes(Simulation(helsinki, None, replace(CROWD, seed=seed)), 3)
    here = Path(__file__).parent
    program = (
        f"import sys; sys.path[:0] = [{str(here)!r}, {str(here.parent)!r}]\n"
        "from dataclasses import replace\nfrom pathlib import Path\n"
        "from test_base import CROWD, Simulation, hashes\n"
        "from vico.world.folder import read_world\n"
        f"print(*hashes(Simulation(read_world(Path({str(helsinki_path)!r})), None, replace(CROWD, seed=2)), 4))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONHASHSEED": "3"},
    )
    assert hashes(Simulation(helsinki, None, replace(CROWD, seed=2)), 4) == done.stdout.split()


def test_simulations_on_one_base_do_not_touch_each_other(helsinki: World) -> None:
    alone = hashes(Simulation(helsinki, None, CROWD), 4)
    first, second = Simulation(helsinki, None, CROWD), Simulation(helsinki, None, replace(CROWD, seed=5))
    assert first.base.robot_scene(CROWD.robots) is second.base.robot_scene(CROWD.robots)
    found = [first.state_hash()]
    for k in range(4):
        action = {"type": "turn_left", "degrees": 30.0} if k % 3 == 0 else {"type": "move_forward", "distance": 1.0}
        second.step({})
        found.append(first.step({"assistant_0": action}).hash)
    assert found == alone
