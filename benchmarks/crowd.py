"""Many people, many pictures: milliseconds of processor time a step, and memory.

    python benchmarks/crowd.py WORLD COMMUNITY_50 COMMUNITY_1000 [--before SOURCE] [--table benchmarks/results/crowd.md]

With `--before`, the folder ``src`` of another state of the sources, every case is measured there too, each in a
process of its own, turn about. Cases: everybody of the small community observing (256 x 256 RGB, depth and
segmentation) among 100 cars, 100 pedestrians and 2 robots; the large community without pictures among 200 cars and
200 pedestrians; one agent observing alone, 15 people walking before it; and peak memory of 1 and of all observing.
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
from pathlib import Path
from typing import Any

import numpy as np

_WARM = 5
_PEOPLE = 15


def asked_together(followers: dict[str, Any]) -> tuple[list[Any], list[str]]:
    """Return groups with their members' names, and who is asked alone: everybody where these sources have no groups."""
    try:
        from vico.agents.base import by_group
    except ImportError:
        return [], list(followers)
    return by_group(followers)


def ask(followers: dict[str, Any], together: tuple[list[Any], list[str]], told: tuple[Any, Any]) -> dict[str, Any]:
    """Return everybody's actions; `together` as from `asked_together`, `told` observations and infos."""
    observations, infos = told
    groups, alone = together
    actions: dict[str, Any] = {}
    for group, names in groups:
        actions |= group.act_for(names, observations, infos)
    return actions | {name: followers[name].act(observations[name], infos[name]) for name in alone}


def steps(
    world_folder: Path, community_folder: Path, options: dict[str, Any], count: int, *, look: bool = False
) -> dict[str, Any]:
    """Measure steps of a simulation whose residents follow their schedules from 08:00.

    With `look`, all pictures and what is in them are asked for after each step, before the next one begins.
    """
    from vico.agents.schedule import followers_of
    from vico.community import read_community
    from vico.sim.config import SimConfig
    from vico.sim.simulation import Simulation
    from vico.world.folder import read_world
    from vico.world.public import PublicMap

    world = read_world(world_folder)
    community = read_community(community_folder, world)
    config = SimConfig(errands=True, **options)
    sim = Simulation(world, community, config)
    followers = followers_of(community, PublicMap.from_world(world), seed=config.seed)
    observations, infos = sim.observe()
    together = asked_together(followers)
    cpu, wall = [], []
    # As the runner of these sources does.
    settled: Any = nullcontext
    with suppress(ImportError):
        from vico.runner.garbage import settled
    with settled():
        for step in range(count + _WARM):
            if step == _WARM:
                sim.metrics.seconds.clear()
            began, spent = time.perf_counter(), time.process_time()
            result = sim.step(ask(followers, together, (observations, infos)))
            observations, infos = result.observations, result.infos
            if look:
                _ = [(observations[name], infos[name]) for name in sim.agents]
            if step >= _WARM:
                cpu.append(1000 * (time.process_time() - spent))
                wall.append(1000 * (time.perf_counter() - began))
    phases = {name: 1000 * seconds / count for name, seconds in sim.metrics.seconds.items()}
    phases["agents and the rest"] = float(np.mean(wall)) - sum(phases.values())
    return {"cpu": cpu, "wall": wall, "phases": phases}


def one_view(world_folder: Path, count: int) -> dict[str, Any]:
    """Measure observations of one agent before whom people walk, posed and skinned anew each time; nothing is kept."""
    from vico.sim.config import SimConfig
    from vico.sim.simulation import Simulation
    from vico.world.folder import read_world

    world = read_world(world_folder)
    config = SimConfig(observe=("assistant_0",), assistants=_PEOPLE + 1, cars=15, pedestrians=0)
    sim = Simulation(world, None, config)
    generator = np.random.default_rng(3)
    people = sim.state.people
    sim.observe()
    cpu = []
    for _ in range(count):
        while True:
            spot, yaw = world.walkable.random_point(generator), float(generator.uniform(-np.pi, np.pi))
            before = spot + 6.0 * np.array([np.cos(yaw), np.sin(yaw)])
            if world.walkable.class_at(before):
                break
        scattered = before + generator.uniform(-3.0, 3.0, (_PEOPLE, 2))
        people.position[:, :2] = np.vstack([spot[None], scattered])
        people.position[:, 2] = world.height(people.position[:, :2])
        people.yaw[:] = np.concatenate([[yaw], generator.uniform(-np.pi, np.pi, _PEOPLE)])
        people.room[:] = people.place[:] = -1
        people.phase[:] = generator.uniform(0.0, 1.0, len(people))
        spent = time.process_time()
        observations, infos = sim.observe()
        _ = observations["assistant_0"]["rgb"], infos["assistant_0"]["entities"]
        cpu.append(1000 * (time.process_time() - spent))
    return {"cpu": cpu[_WARM:]}


def case(name: str, world: Path, small: Path, large: Path, count: int) -> dict[str, Any]:
    """Measure one case in this process."""
    busy = {"cars": 100, "pedestrians": 100, "robots": ("husky", "go2")}
    if name == "observing":
        found = steps(world, small, busy, count)
    elif name == "looking":
        found = steps(world, small, busy, count, look=True)
    elif name == "one observing":
        found = steps(world, small, {**busy, "observe": ("resident_0",)}, count)
    elif name == "crowd":
        found = steps(world, large, {"cars": 200, "pedestrians": 200, "observe": ()}, count)
    else:
        found = one_view(world, count)
    found["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return found


def measured(name: str, source: Path, given: argparse.Namespace) -> dict[str, Any]:
    """Measure one case in a process of its own, with the given sources."""
    count = given.steps if name != "view" else 4 * given.steps
    command = [sys.executable, __file__, str(given.world), str(given.small), str(given.large), "--case", name]
    environment = {**os.environ, "PYTHONPATH": str(source)}
    done = subprocess.run(
        [*command, "--steps", str(count)], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{name}: exit status {done.returncode}\n{done.stderr}")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


_TITLES = {
    "observing": "everybody of the small community observes, 100 + 100 traffic, 2 robots: a step",
    "looking": "the same, and all pictures are asked for before the next step: a step",
    "crowd": "large community, no pictures, 200 + 200 traffic: a step",
    "view": "one agent observes, 15 people about: an observation",
    "one observing": "as the first, one observes: a step",
}


def table(results: dict[tuple[str, str], dict[str, Any]]) -> list[str]:
    """Return the lines of the report."""
    lines = [
        "| case | sources | CPU ms median | p90 | p99 | wall ms median | p99 | peak MB |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (name, which), found in results.items():
        cpu = np.percentile(found["cpu"], [50, 90, 99])
        wall = np.percentile(found["wall"], [50, 99]) if "wall" in found else None
        walls = " | ".join(f"{value:.1f}" for value in wall) if wall is not None else " | "
        values = " | ".join(f"{value:.1f}" for value in cpu)
        lines.append(f"| {_TITLES[name]} | {which} | {values} | {walls} | {found['peak_mb']:.0f} |")
    lines += ["", "Wall milliseconds a step by phase, mean:", ""]
    for (name, which), found in results.items():
        if "phases" in found:
            phases = ", ".join(f"{phase} {value:.1f}" for phase, value in found["phases"].items())
            lines.append(f"- {_TITLES[name]} ({which}): {phases}")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("small", type=Path)
    parser.add_argument("large", type=Path)
    parser.add_argument("--before", type=Path, help="src of another state of the sources, measured turn about")
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--case", choices=list(_TITLES), help="measure this one here, and print it as JSON")
    given = parser.parse_args()
    if given.case:
        print(json.dumps(case(given.case, given.world, given.small, given.large, given.steps)))
        return
    from reporting import machine, publish

    sources = {"now": Path(__file__).parents[1] / "src"}
    if given.before:
        sources = {"before": given.before, **sources}
    lines = [
        "# Crowds and pictures: milliseconds a step of one second",
        "",
        machine(),
        "Made by `python benchmarks/crowd.py WORLD COMMUNITY_50 COMMUNITY_1000 --before ../before/src "
        "--table benchmarks/results/crowd.md`.",
        "",
        f"{given.steps} steps each from 08:00, residents on their schedules; each case in a process of its own, "
        "compiled code loaded. Percentiles are over steps. Residents look at no pictures; they are taken: "
        "while the next step goes on, or, by older sources, before it begins.",
        "",
    ]
    results = {}
    for name in _TITLES:
        for which, source in sources.items():
            results[name, which] = measured(name, source, given)
    publish([*lines, *table(results)], given.table)


if __name__ == "__main__":
    main()
