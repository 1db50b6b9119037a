"""What the runner costs an agent: copies in this process, messages to and from a process of its own.

    python benchmarks/runner.py WORLD [--steps 100] [--table benchmarks/results/runner.md]

Ten agents that do nothing but answer, asked again and again about what they observe at 08:00, with and without pictures
of 256 x 256. Processor time, of this process and of theirs; a busy machine does not blur it.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path
from typing import Any

from reporting import machine

from vico.runner.foreign import Terms, foreign_agents
from vico.runner.gather import Gatherer
from vico.runner.loading import AgentSeat
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.folder import read_world
from vico.world.world import World

AGENTS = 10


class Waiter:
    """Waits."""

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        """Wait."""
        return {"type": "wait"}

    def state(self) -> dict[str, Any]:
        """Return nothing."""
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        """Remember nothing."""


def spent_by_children() -> float:
    """Processor seconds of processes that were waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measure(world: World, *, steps: int, pictures: bool, how: str) -> tuple[float, float]:
    """Return milliseconds an agent and step: of this process, and of the agent's own."""
    names = [f"assistant_{i}" for i in range(AGENTS)]
    sim = Simulation(
        world, None, SimConfig(assistants=AGENTS, cars=30, pedestrians=30, observe=None if pictures else ())
    )
    observations, infos = sim.observe()
    costs = []
    for count in (0, steps):  # what starting and ending a process costs is taken off
        before = spent_by_children()
        seats = [AgentSeat(name, number=i, of=AGENTS) for i, name in enumerate(names)]
        players = foreign_agents(f"{__file__}:Waiter", seats, world, Terms(isolate=how == "isolated"))
        agents = Gatherer(players, trusted=names if how == "trusted" else (), deadline=60.0)
        agents.gather(observations, infos)
        began = time.process_time()
        for _ in range(count):
            agents.gather(observations, infos)
        mine = time.process_time() - began
        agents.close()
        costs.append((mine, spent_by_children() - before))
    (_, idle), (mine, theirs) = costs
    each = 1000 / (steps * AGENTS)
    return mine * each, max(0.0, theirs - idle) * each if how == "isolated" else 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    world = read_world(given.world)
    lines = [
        "# The runner: processor milliseconds an agent and step",
        "",
        machine(),
        "Made by `python benchmarks/runner.py WORLD --table benchmarks/results/runner.md`.",
        "",
        "| agents | pictures | this process | the agent's |",
        "|---|---|---|---|",
    ]
    for how in ("trusted", "in this process", "isolated"):
        for pictures in (False, True):
            mine, theirs = measure(world, steps=given.steps, pictures=pictures, how=how)
            lines.append(f"| {how} | {'256 x 256' if pictures else 'none'} | {mine:.3f} | {theirs:.3f} |")
    text = "\n".join(lines) + "\n"
    print(text)
    if given.table is not None:
        given.table.write_text(text)


if __name__ == "__main__":
    main()
