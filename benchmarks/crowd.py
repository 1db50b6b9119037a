"""Many people, many pictures, all robots: times real time, processor time and memory, of four workloads in one table.

    python benchmarks/crowd.py WORLD COMMUNITY_50 COMMUNITY_1000 [--rounds 3] [--steps 120] [--before SOURCE]
        [--cases robots,observing] [--table benchmarks/results/crowd.md]

Every measurement has a process of its own, and the workloads take turns, round by round. Residents follow their
schedules from 08:00, robots go on errands, compiled code is loaded. Where agents observe (256 x 256 RGB, depth and
segmentation), all pictures are asked for after each step, before the next one begins; nothing is left out that somebody
who looks at them would wait for. With `--before`, the folder ``src`` of another state of the sources, every workload is
measured there too, turn about.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

_WARM = 5
_ROBOTS = ("husky", "go2", "h1", "drone", "manipulator")


@dataclass(frozen=True)
class Workload:
    """What is measured: its line in the table, the goal, and the simulation's options.

    Attributes
    ----------
    title
        In words.
    goal
        Times real time, at least.
    people
        How many residents take part.
    options
        Of `SimConfig`.
    memory
        MB, at most; None: no goal.
    """

    title: str
    goal: float
    people: int
    options: dict[str, Any] = field(default_factory=dict)
    memory: int | None = None


_WORKLOADS = {
    "robots": Workload("five kinds of robots, 50 residents, no pictures", 20.0, 50, {"robots": _ROBOTS, "observe": ()}),
    "observing": Workload(
        "50 residents and five robots observe, 100 cars, 100 pedestrians",
        5.0,
        50,
        {"robots": _ROBOTS, "cars": 100, "pedestrians": 100},
    ),
    "many observing": Workload(
        "200 residents observe, 100 cars, 100 pedestrians, no robots",
        1.0,
        200,
        {"cars": 100, "pedestrians": 100},
        4096,
    ),
    "crowd": Workload(
        "1,000 residents, 400 cars, 400 pedestrians, no pictures",
        10.0,
        1000,
        {"cars": 400, "pedestrians": 400, "observe": ()},
    ),
}


def asked_together(followers: dict[str, Any]) -> tuple[list[Any], list[str]]:
    """Return groups with their members' names, and who is asked alone: everybody where these sources have no groups."""
    try:
        from vico.agents.base import split_groups
    except ImportError:
        return [], list(followers)
    return split_groups(followers)


def ask(followers: dict[str, Any], together: tuple[list[Any], list[str]], told: tuple[Any, Any]) -> dict[str, Any]:
    """Return everybody's actions; `together` as from `asked_together`, `told` observations and infos."""
    observations, infos = told
    groups, alone = together
    actions: dict[str, Any] = {}
    for group, names in groups:
        actions |= group.act_for(names, observations, infos)
    return actions | {name: followers[name].act(observations[name], infos[name]) for name in alone}


def measure(workload: Workload, world_folder: Path, community_folder: Path, count: int) -> dict[str, Any]:
    """Measure steps of a workload in this process."""
    from vico.agents.schedule import followers_of
    from vico.community import read_community
    from vico.sim.config import SimConfig
    from vico.sim.loop.simulation import Simulation
    from vico.world.folder import read_world
    from vico.world.public import PublicMap

    world = read_world(world_folder)
    community = read_community(community_folder, world)
    config = SimConfig(errands=True, residents=workload.people, **workload.options)
    sim = Simulation(world, community, config)
    known = followers_of(community, PublicMap.from_world(world), seed=config.seed)
    followers = {name: agent for name, agent in known.items() if name in sim.agents}
    observations, infos = sim.observe()
    together = asked_together(followers)
    cpu, wall = [], []
    # As the runner of these sources does.
    freeze_heap: Any = nullcontext
    with suppress(ImportError):
        from vico.runner.loop import freeze_heap
    with freeze_heap():
        for step in range(count + _WARM):
            if step == _WARM:
                sim.metrics.seconds.clear()
            began, spent = time.perf_counter(), time.process_time()
            result = sim.step(ask(followers, together, (observations, infos)))
            observations, infos = result.observations, result.infos
            if config.observe is None:
                _ = [(observations[name], infos[name]) for name in sim.agents]
            if step >= _WARM:
                cpu.append(1000 * (time.process_time() - spent))
                wall.append(1000 * (time.perf_counter() - began))
    phases = {name: 1000 * seconds / count for name, seconds in sim.metrics.seconds.items()}
    phases["agents, waiting for pictures, and the rest"] = float(np.mean(wall)) - sum(phases.values())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform != "darwin" else 1024 * 1024)
    percentiles = {"cpu": np.percentile(cpu, [50, 90]).tolist(), "wall": np.percentile(wall, [50, 90, 99]).tolist()}
    return {**percentiles, "phases": phases, "peak_mb": peak}


def measured(name: str, source: Path, given: argparse.Namespace) -> dict[str, Any]:
    """Measure one workload in a process of its own, with the given sources."""
    command = [sys.executable, __file__, str(given.world), str(given.small), str(given.large), "--case", name]
    environment = {**os.environ, "PYTHONPATH": str(source)}
    done = subprocess.run(
        [*command, "--steps", str(given.steps)], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{name}: exit status {done.returncode}\n{done.stderr}")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def table(results: dict[tuple[str, str], list[dict[str, Any]]]) -> list[str]:
    """Return the lines of the report."""
    lines = [
        "| workload | sources | times real time | slowest..fastest round | goal | CPU ms a step | wall ms a step | "
        "90 % | 99 % | peak MB |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for (name, which), rounds in results.items():
        workload = _WORKLOADS[name]
        speeds = [1000 / one["wall"][0] for one in rounds]
        cpu = np.median([one["cpu"][0] for one in rounds])
        wall = np.median([one["wall"] for one in rounds], axis=0)
        peak = max(one["peak_mb"] for one in rounds)
        goal = f">= {workload.goal:g}" + (f", < {workload.memory} MB" if workload.memory else "")
        lines.append(
            f"| {workload.title} | {which} | **{np.median(speeds):.1f}** | {min(speeds):.1f}..{max(speeds):.1f} "
            f"| {goal} | {cpu:.1f} | {wall[0]:.1f} | {wall[1]:.1f} | {wall[2]:.1f} | {peak:.0f} |"
        )
    lines += ["", "Wall milliseconds a step by phase, mean, of the median round:", ""]
    for (name, which), rounds in results.items():
        middle = sorted(rounds, key=lambda one: one["wall"][0])[len(rounds) // 2]
        phases = ", ".join(f"{phase} {value:.1f}" for phase, value in middle["phases"].items())
        lines.append(f"- {_WORKLOADS[name].title} ({which}): {phases}")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("small", type=Path, help="community of 50 residents or more")
    parser.add_argument("large", type=Path, help="community of 1,000 residents or more")
    parser.add_argument("--before", type=Path, help="src of another state of the sources, measured turn about")
    parser.add_argument("--steps", type=int, default=120)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--cases", default=",".join(_WORKLOADS), help="which workloads")
    parser.add_argument("--table", type=Path)
    parser.add_argument("--case", choices=list(_WORKLOADS), help="measure this one here, and print it as JSON")
    given = parser.parse_args()
    if given.case:
        workload = _WORKLOADS[given.case]
        community = given.small if workload.people <= 50 else given.large
        print(json.dumps(measure(workload, given.world, community, given.steps)))
        return
    from reporting import machine, publish

    sources = {"now": Path(__file__).parents[1] / "src"}
    if given.before:
        sources = {"before": given.before, **sources}
    before = " --before ../before/src" if given.before else ""
    lines = [
        "# Crowds, pictures and robots: how much faster than real time",
        "",
        machine(),
        f"Made by `python benchmarks/crowd.py WORLD COMMUNITY_50 COMMUNITY_1000 --rounds {given.rounds} "
        f"--steps {given.steps}{before} --table benchmarks/results/crowd.md`.",
        "",
        f"World: {json.loads((given.world / 'world.json').read_text())['name']}. A step is a second of simulated time. "
        f"{given.steps} steps from 08:00 a round, {given.rounds} rounds, each workload in a process of its own: "
        "medians over steps, then over rounds; percentiles are over steps. Residents follow their schedules, "
        "robots are on errands. Where anybody observes (256 x 256 RGB, depth, segmentation), all pictures are "
        "asked for before the next step begins.",
        "",
    ]
    results: dict[tuple[str, str], list[dict[str, Any]]] = {
        (name, which): [] for name in given.cases.split(",") for which in sources
    }
    for _ in range(given.rounds):
        for name, which in results:
            results[name, which].append(measured(name, sources[which], given))
    publish([*lines, *table(results)], given.table)


if __name__ == "__main__":
    main()
