"""What it takes to start an episode, to keep and restore a state, and to step several environments side by side.

    python benchmarks/reset.py WORLD COMMUNITY [-n 20] [--steps 60] [--table benchmarks/results/reset.md]

With five robots, 30 cars, 30 pedestrians and the community's residents. Resets and snapshots are measured as processor
time of the process, steps a second of environments in processes as wall-clock time.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from reporting import machine, publish, row

import vico
from vico.community import read_community
from vico.world.folder import read_world

ROBOTS = ("husky", "go2", "go2", "husky", "go2")


def cpu_ms(task: Callable[[int], Any], n: int) -> list[float]:
    """Processor time of a task, called with 0, 1, 2 and on, milliseconds."""
    found = []
    for k in range(n):
        began = time.process_time()
        task(k)
        found.append((time.process_time() - began) * 1000.0)
    return found


def steps_a_second(world: Path, community: Path, workers: int, steps: int) -> float:
    """Return the steps a second of one agent's environments, one a process, all together."""
    options: dict[str, Any] = {"cars": 30, "pedestrians": 30, "observe": "none", "max_steps": 10**6}
    vector = vico.make_vec(world, community, num_envs=workers, **options)
    try:
        vector.reset(seed=0)
        wait = [{"type": "wait"}] * workers
        vector.step(wait)
        began = time.perf_counter()
        for _ in range(steps):
            vector.step(wait)
        return workers * steps / (time.perf_counter() - began)
    finally:
        vector.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("-n", type=int, default=20, help="times each is measured")
    parser.add_argument("--steps", type=int, default=60, help="steps of each environment in a process")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    about = machine()
    world, community = read_world(given.world), read_community(given.community)
    made: list[Any] = []
    options: dict[str, Any] = {"robots": ROBOTS, "cars": 30, "pedestrians": 30, "observe": "none"}
    first = cpu_ms(lambda _: made.append(vico.make(world, community, **options)), 1)
    env = made[0]
    env.reset(seed=1000)  # once more, so that everything is compiled

    resets, others = cpu_ms(lambda _: env.reset(seed=7), given.n), cpu_ms(lambda k: env.reset(seed=k), given.n)
    env.reset(seed=0)
    env.step({})
    sim = env.sim
    kept = sim.snapshot()
    alone = vico.make(world, community, residents=1, observe="none")
    alone.reset(seed=0)
    one = alone.sim.snapshot()
    people = len(sim.state.people)
    rows = {
        "first environment of a world": first,
        "`reset`, the same seed": resets,
        "`reset`, another seed": others,
        "`snapshot`": cpu_ms(lambda _: sim.snapshot(), given.n),
        "`restore`": cpu_ms(lambda _: sim.restore(kept), given.n),
        "`snapshot` and `restore`, 1 resident alone": cpu_ms(
            lambda _: alone.sim.restore(alone.sim.snapshot()), given.n
        ),
        "`state_hash`": cpu_ms(lambda _: sim.state_hash(), given.n),
    }
    size, little = (sum(array.nbytes for array in arrays.values()) / 1000.0 for arrays in (kept, one))
    lines = [
        "# Starting, keeping, restoring",
        "",
        about,
        "Made by `python benchmarks/reset.py WORLD COMMUNITY --table benchmarks/results/reset.md`.",
        "",
        f"{people} residents, 30 cars, 30 pedestrians, 5 robots ({', '.join(ROBOTS)}), nobody's views rendered; "
        f"processor time. A snapshot is {size:.0f} kB, of one resident alone {little:.0f} kB. "
        "Goals: `reset` 50 ms, `snapshot` and `restore` together 5 ms.",
        "",
        "| what | median ms | least | greatest | n |",
        "|---|---|---|---|---|",
        *(row(name, values, 2) for name, values in rows.items()),
    ]
    if hasattr(vico, "make_vec"):
        lines += [
            "",
            "## Environments in processes",
            "",
            f"`vico.make_vec` with {people} residents who follow their day, 30 cars and 30 pedestrians, nobody's views "
            f"rendered: steps a second of all environments together, wall-clock, over {given.steps} steps each.",
            "",
            "| environments | steps a second |",
            "|---|---|",
        ]
        for workers in (1, 2, 4):
            speed = statistics.median(
                steps_a_second(given.world, given.community, workers, given.steps) for _ in range(3)
            )
            lines.append(f"| {workers} | {speed:.1f} |")
    publish(lines, given.table)


if __name__ == "__main__":
    main()
