"""How fast a run is beside other programs that want the same processors.

    python benchmarks/under_load.py WORLD COMMUNITY [--steps 10] [--rounds 4] [--robots husky,go2] [--table FILE]

A neighbour is a process of niceness 5 that never waits. One run, with everybody observing, goes on in stretches that
take turns with none, one and two of them, so that a machine whose speed changes does so to all alike. Linux may share
processors among sessions first and by niceness only within one (autogroups): there a neighbour that somebody else
started counts as much as all threads of the run together, whatever its niceness. So neighbours come from the session of
the run, and each from one of its own. Beside each row stands how fast plain Python and compiled code ran in one thread
meanwhile: what they lose is the machine's doing.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from reporting import machine, publish

from vico.agents.schedule import followers_of
from vico.cli.machine_speed import compiled_speed, python_speed
from vico.community import read_community
from vico.runner.gather import Gatherer
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.folder import read_world
from vico.world.public import PublicMap

_NICENESS = 5
_WARM = 10
_ROBOTS = "husky,go2,h1,drone,manipulator"
_BUSY = f"import os; os.nice({_NICENESS})\nwhile True: pass"
# How many neighbours, and whether each is in a session of its own.
_CASES = ((0, False), (1, False), (2, False), (1, True), (2, True))
_AUTOGROUPS = Path("/proc/sys/kernel/sched_autogroup_enabled")


@contextmanager
def neighbours(number: int, *, apart: bool) -> Iterator[None]:
    """Keep so many busy processes while the block lasts."""
    busy = [subprocess.Popen([sys.executable, "-c", _BUSY], start_new_session=apart) for _ in range(number)]
    try:
        time.sleep(0.3)
        yield
    finally:
        for one in busy:
            one.kill()
        for one in busy:
            one.wait()


class Run:
    """A run that goes on in stretches."""

    def __init__(self, world: Path, community: Path, robots: tuple[str, ...]) -> None:
        where = read_world(world)
        people = read_community(community, where)
        config = SimConfig(cars=30, pedestrians=30, robots=robots, errands=True)
        self._sim = Simulation(where, people, config)
        followers = followers_of(people, PublicMap.from_world(where), seed=config.seed)
        self._agents = Gatherer(followers, trusted=followers.keys())
        self._seen = self._sim.observe()

    def go_on(self, steps: int) -> dict[str, float]:
        """Simulate; return times real time, and what a step took and waited."""
        began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF)
        for _ in range(steps):
            gathered = self._agents.gather(*self._seen)
            result = self._sim.step(gathered.actions, gathered.agent_faults)
            self._seen = result.observations, result.infos
        wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_SELF)
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return {
            "factor": steps / wall,
            "spent": spent / steps,
            "at once": spent / wall,
            "waited": (after.ru_nvcsw - before.ru_nvcsw) / steps,
            "pushed aside": (after.ru_nivcsw - before.ru_nivcsw) / steps,
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("--steps", type=int, default=10, help="of a stretch")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--robots", default=_ROBOTS)
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    described = machine()
    run = Run(given.world, given.community, tuple(given.robots.split(",")) if given.robots else ())
    run.go_on(_WARM)
    found: dict[tuple[int, bool], list[dict[str, float]]] = {case: [] for case in _CASES}
    for _ in range(given.rounds):
        for case in _CASES:
            with neighbours(case[0], apart=case[1]):
                speeds = {"python": python_speed(), "compiled": compiled_speed()}
                found[case].append({**run.go_on(given.steps), **speeds})
    autogroups = _AUTOGROUPS.read_text().strip() if _AUTOGROUPS.exists() else "unknown"
    lines = [
        "# A run beside busy neighbours",
        "",
        described,
        f"Made by `benchmarks/under_load.py`: medians of {given.rounds} stretches of {given.steps} s each, in turns. "
        f"Neighbours have niceness {_NICENESS}; sched_autogroup_enabled is {autogroups}.",
        "",
        "| neighbours | times real time | of its own speed | processor s a step | processors at once | waits a step "
        "| pushed aside a step | Python loop, million turns/s | compiled loop, million turns/s |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    alone = statistics.median(one["factor"] for one in found[_CASES[0]])
    for (number, apart), rows in found.items():
        middle = {name: statistics.median(one[name] for one in rows) for name in rows[0]}
        lines.append(
            f"| {number}{', each in a session of its own' if apart else ''} | {middle['factor']:.2f} "
            f"| {middle['factor'] / alone:.0%} | {middle['spent']:.3f} | {middle['at once']:.2f} "
            f"| {middle['waited']:.0f} | {middle['pushed aside']:.0f} | {middle['python']:.1f} "
            f"| {middle['compiled']:.0f} |"
        )
    publish(lines, given.table)


if __name__ == "__main__":
    main()
