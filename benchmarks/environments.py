"""Steps a second of environments for learners: one and two processes, with and without pictures.

    python benchmarks/environments.py WORLD COMMUNITY [--steps 40] [-n 5] [--table benchmarks/results/environments.md]

All environments are made first and then measured in turns, so that other load on the machine meets all of them alike:
ratios are those of one turn, and count more than the seconds. Processor time is that of the environments' processes.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from reporting import machine, publish

import vico
from vico.challenges.learning.make import make_task_vec
from vico.envs.vector import SharedArrays, Sharing
from vico.envs.workers import Call, Workers

SIDE = 128
_TICK = os.sysconf("SC_CLK_TCK")


class Still:
    """An environment that does nothing but tell of pictures."""

    def __init__(self, side: int) -> None:
        self.observation_space = spaces.Dict(
            {
                "rgb": spaces.Box(0, 255, (side, side, 3), np.uint8),
                "depth": spaces.Box(0.0, np.inf, (side, side), np.float32),
                "segmentation": spaces.Box(0, 2**31 - 1, (side, side), np.int32),
            }
        )
        self.seen = self.observation_space.sample()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Return the pictures."""
        return self.seen, 0.0, False, False, {}


def cpu_seconds(pids: list[int | None]) -> float:
    """Return the processor time of processes so far."""
    ticks = 0
    for pid in pids:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / _TICK


def turn(vector: Any, steps: int) -> tuple[float, float]:
    """Take steps in all environments of a vector; return steps a second, and a second of processor time, of all."""
    cpu, began = cpu_seconds(vector.pids), time.perf_counter()
    for _ in range(steps):
        vector.step(vector.action_space.sample())
    wall, used = time.perf_counter() - began, cpu_seconds(vector.pids) - cpu
    return vector.num_envs * steps / wall, vector.num_envs * steps / used


def transport(side: int, steps: int) -> tuple[float, float]:
    """Return the milliseconds a step that pictures take to come through a pipe, and by shared memory."""
    found = []
    for shared in (False, True):
        make: Callable[[], Any] = partial(Still, side)
        workers = Workers([partial(Sharing, make) if shared else make])
        arrays = SharedArrays(Still(side).observation_space, 1)
        try:
            if shared:
                workers.ask([Call("attach", (arrays.name, arrays.layout, 0))])
            workers.ask([Call("step", (0,))])
            began = time.perf_counter()
            for _ in range(steps):
                (answer,) = workers.ask([Call("step", (0,))])
                if shared:
                    arrays.batch([answer[0]])
            found.append((time.perf_counter() - began) / steps * 1000.0)
        finally:
            workers.close()
            arrays.close()
    return found[0], found[1]


def made(world: Path, community: Path) -> dict[str, dict[int, Any]]:
    """Return the vectors that are measured, by what they are and how many processes they have."""
    agent = {"form": "arrays", "cars": 30, "pedestrians": 30, "max_steps": 10**6}
    seeing = {"observe": ("assistant_0",), "image": SIDE}
    alone = {"max_steps": 10**6, "reach": 0.5}
    goal = partial(make_task_vec, "make_point_goal", world, **alone)
    return {
        "a point goal, alone in the city": {n: goal(num_envs=n) for n in (1, 2)},
        f"the same, pictures of {SIDE} x {SIDE}": {n: goal(num_envs=n, **seeing) for n in (1, 2)},
        "among residents, 30 cars and 30 passers-by": {
            1: vico.make_vec(world, community, num_envs=1, observe="none", **agent)
        },
    }


def middle(values: list[float]) -> str:
    """Return the median and the range of values."""
    return f"{statistics.median(values):.1f} ({min(values):.1f}-{max(values):.1f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("-n", type=int, default=5, help="turns")
    parser.add_argument("--steps", type=int, default=40, help="steps a turn of each environment")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    about = machine()
    residents = len(vico.read_community(given.community).residents)
    vectors = made(given.world, given.community)
    speeds: dict[tuple[str, int], list[tuple[float, float]]] = {}
    try:
        for by_count in vectors.values():
            for vector in by_count.values():
                vector.reset(seed=0)
                turn(vector, 10)  # everything is compiled and rendered once
        for _ in range(given.n):
            for name, by_count in vectors.items():
                for n, vector in by_count.items():
                    speeds.setdefault((name, n), []).append(turn(vector, given.steps))
    finally:
        for by_count in vectors.values():
            for vector in by_count.values():
                vector.close()
    rows = []
    for name in vectors:
        one, two = ([wall for wall, _ in speeds.get((name, n), [])] for n in (1, 2))
        cpu = [used for _, used in speeds[name, 1]]
        gain = [b / a for a, b in zip(one, two, strict=False)]
        both = f"{middle(two)} | {middle(gain)}" if two else "- | -"
        rows.append(f"| {name} | {middle(one)} | {both} | {middle(cpu)} |")
    ways = {side: [transport(side, 100) for _ in range(given.n)] for side in (64, SIDE, 256)}
    lines = [
        "# Environments for learners",
        "",
        about,
        f"Made by `python benchmarks/environments.py WORLD COMMUNITY --steps {given.steps} -n {given.n} --table "
        "benchmarks/results/environments.md`. The machine was shared with other work: ratios of one turn tell more "
        "than the seconds, and steps a second of processor time are what an idle core makes. Where the load is higher "
        "than the number of processors, a second process finds no idle core, and its ratio tells of the load.",
        "",
        f"Array form, sampled actions; median of {given.n} turns of {given.steps} steps (least-greatest). The "
        f"community has {residents} residents who follow their day. Pictures are colour, depth and segmentation of one "
        "agent, by the renderer for processors.",
        "",
        "| environment | steps a second, 1 process | 2 processes, together | ratio | steps a processor second |",
        "|---|---|---|---|---|",
        *rows,
        "",
        "## Pictures on their way from a process",
        "",
        f"An environment that does nothing but return colour, depth and segmentation: milliseconds a step, median of "
        f"{given.n} turns of 100 steps (least-greatest), copying included.",
        "",
        "| side, pixels | by pipe | by shared memory | ratio |",
        "|---|---|---|---|",
        *(
            f"| {side} | {_ms([a for a, _ in found])} | {_ms([b for _, b in found])} | "
            f"{middle([a / b for a, b in found])} |"
            for side, found in ways.items()
        ),
    ]
    publish(lines, given.table)


def _ms(values: list[float]) -> str:
    return f"{statistics.median(values):.2f} ({min(values):.2f}-{max(values):.2f})"


if __name__ == "__main__":
    main()
