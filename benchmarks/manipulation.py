"""How many steps a second manipulation environments take: one, a plain loop over several, and batches.

    python benchmarks/manipulation.py [--envs 256] [--steps 50] [--repeats 5] [--table FILE]

A step is one of control (a twentieth of a second, five of physics) with sampled actions, observation and reward
included. *Plain loop*: as many single environments in a Python list. Seconds are those of the clock; the share of a
processor that the process got stands beside them, as other work may run.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from reporting import machine, publish

from vico.challenges.learning.manipulation import MANIPULATION, make_manipulation, make_manipulation_vec
from vico.seeds import rng


def single(task: str, envs: int, actions: np.ndarray[Any, Any], base: str) -> Callable[[], int]:
    """Return what steps single environments one after the other."""
    made = [make_manipulation(task, base=base, max_steps=10**6) for _ in range(envs)]
    for k, env in enumerate(made):
        env.reset(seed=k)

    def run() -> int:
        for step in actions:
            for k, env in enumerate(made):
                env.step(step[k])
        return len(actions) * envs

    return run


def batched(task: str, envs: int, actions: np.ndarray[Any, Any], base: str, threads: int) -> Callable[[], int]:
    """Return what steps a batch."""
    batch = make_manipulation_vec(task, num_envs=envs, threads=threads, base=base, max_steps=10**6)
    batch.reset(seed=0)

    def run() -> int:
        for step in actions:
            batch.step(step[:envs])
        return len(actions) * envs

    return run


def measured(name: str, run: Callable[[], int], repeats: int) -> str:
    """Return a row of the table."""
    run()  # compiles, and brings arms into motion
    rates, shares = [], []
    for _ in range(repeats):
        began, busy = time.perf_counter(), time.process_time()
        steps = run()
        seconds = time.perf_counter() - began
        rates.append(steps / seconds)
        shares.append((time.process_time() - busy) / seconds)
    low, high = min(rates), max(rates)
    share = statistics.median(shares)
    return (
        f"| {name} | {statistics.median(rates):,.0f} | {low:,.0f} | {high:,.0f} | {share:.2f} | "
        f"{statistics.median(rates) / share:,.0f} | {repeats} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", type=int, default=256)
    parser.add_argument("--steps", type=int, default=50)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--task", choices=sorted(MANIPULATION), default="lift")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    drawn = rng(0, "benchmark actions").uniform(-1, 1, (given.steps, given.envs, 8)).astype(np.float32)
    lines = [
        "# Manipulation environments", "", machine(), "",
        f"`python benchmarks/manipulation.py --envs {given.envs} --steps {given.steps} --repeats {given.repeats}`: "
        f"control steps a second of `{given.task}`, five steps of physics each; median, least and greatest.", "",
        "| | steps/s | least | greatest | processors | steps/s a processor | n |", "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for base in ("fixed", "wheels"):
        one = single(given.task, 1, drawn, base)
        lines.append(measured(f"base {base}: one environment", one, given.repeats))
        loop = single(given.task, given.envs, drawn[: max(given.steps // 10, 1)], base)
        lines.append(measured(f"base {base}: plain loop over {given.envs}", loop, given.repeats))
        for threads in range(1, min(2, os.cpu_count() or 1) + 1):
            batch = batched(given.task, given.envs, drawn, base, threads)
            lines.append(measured(f"base {base}: batch of {given.envs}, {threads} thread(s)", batch, given.repeats))
    publish(lines, given.table)


if __name__ == "__main__":
    main()
