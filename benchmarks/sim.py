"""How long a second of simulation takes, part by part.

    python benchmarks/sim.py WORLD COMMUNITY [--steps 120] [--robots husky,go2] [--table benchmarks/results/sim.md]

Three runs from 08:00 with the residents following their schedules: nobody looking, nobody looking without robots,
and everybody looking. Compiled code is warmed first. Times are processor time of the process (a busy machine does not
blur them) and wall time; the median step is given with the 10th and 90th percentile.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path

import numpy as np
from reporting import machine

from vico.agents.schedule import followers_of
from vico.community import read_community
from vico.community.model import Community
from vico.runner.gather import Gatherer
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.folder import read_world
from vico.world.public import PublicMap
from vico.world.world import World

_WARM = 5


def measure(world: World, community: Community, config: SimConfig, steps: int) -> dict[str, float | str]:
    """Median milliseconds a step, and the share of each phase."""
    sim = Simulation(world, community, config)
    followers = followers_of(community, PublicMap.from_world(world), seed=config.seed)
    agents = Gatherer(followers, trusted=followers.keys())
    observations, infos = sim.observe()
    cpu, wall = [], []
    for step in range(steps + _WARM):
        if step == _WARM:
            sim.metrics.seconds.clear()
        began, spent = time.perf_counter(), time.process_time()
        gathered = agents.gather(observations, infos)
        result = sim.step(gathered.actions, gathered.agent_faults)
        observations, infos = result.observations, result.infos
        if step >= _WARM:
            cpu.append(1000 * (time.process_time() - spent))
            wall.append(1000 * (time.perf_counter() - began))
    low, middle, high = np.percentile(cpu, [10, 50, 90])
    phases = ", ".join(f"{name} {1000 * value / steps:.1f}" for name, value in sim.metrics.seconds.items())
    return {
        "cpu_ms": round(float(middle), 1),
        "spread": f"{low:.1f}..{high:.1f}",
        "wall_ms": round(float(np.median(wall)), 1),
        "factor": round(1000 / float(np.median(wall)), 1),
        "phases": phases,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("--steps", type=int, default=120)
    parser.add_argument("--robots", default="husky,go2")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    world = read_world(given.world)
    community = read_community(given.community, world)
    robots = tuple(given.robots.split(",")) if given.robots else ()
    plain = SimConfig(cars=30, pedestrians=30, observe=(), errands=True)
    cases = {
        "nobody looks, no robots": plain,
        "nobody looks": SimConfig(cars=30, pedestrians=30, observe=(), robots=robots, errands=True),
        "everybody looks": SimConfig(cars=30, pedestrians=30, robots=robots, errands=True),
    }
    lines = [
        "# Simulation: milliseconds a step of one second",
        "",
        machine(),
        "Made by `vico bench sim --table benchmarks/results/sim.md`.",
        "",
        f"{given.steps} steps each from 08:00, {len(community.residents)} residents on their schedules, 30 cars, "
        f"30 pedestrians, robots {given.robots or 'none'}. Encoding films is not in it: it runs beside.",
        "",
        "| run | CPU ms a step, median | 10..90 % | wall ms a step | times real time | wall ms by phase, mean |",
        "|---|---|---|---|---|---|",
    ]
    for name, config in cases.items():
        row = measure(world, community, config, given.steps)
        lines.append(f"| {name} | {' | '.join(str(value) for value in row.values())} |")
    lines += ["", f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"]
    text = "\n".join(lines) + "\n"
    print(text)
    if given.table:
        given.table.write_text(text)


if __name__ == "__main__":
    main()
