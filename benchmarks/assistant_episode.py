"""Processor seconds of episodes of the assistant challenge, and whether two checkouts play them alike.

    python benchmarks/assistant_episode.py WORLD... [--category carry] [--steps 1500] [-n 3] [--before CHECKOUT]
        [--table benchmarks/results/assistant_episode.md]

Each episode is played in a process of its own, which uses one thread where it can. Counted is the processor time of
the whole process, for others may share the machine; what starting takes is told apart from what the steps take. With
`--before`, the same episodes are played by the code of another checkout, in turn with this one's: the hashes of the
state after every step must be the same.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from reporting import machine, publish

_HERE = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Episode:
    """What an episode took: processor seconds until its first step is over, and after it; a hash of all states."""

    start: float
    steps: float
    states: str

    @property
    def total(self) -> float:
        """Processor seconds of the process."""
        return self.start + self.steps


def play(world: Path, category: str, method: str, steps: int) -> Episode:
    """Play an episode in this process."""
    from vico.challenges.assistant.challenge import ASSISTANT
    from vico.challenges.records import Job
    from vico.runner.loop import Runner, Step

    states, begun = hashlib.blake2b(digest_size=16), [0.0]
    usual = Runner._note

    def note(self: Runner, step: Step) -> None:
        if step.number == 1:
            begun[0] = time.process_time()
        states.update(step.result.hash.encode())
        usual(self, step)

    Runner._note = note  # type: ignore[method-assign]
    setting = {"assistants": 1, "advanced": False, "steps": steps}
    ASSISTANT.play(Job("assistant", category, method, setting, world, 0))
    return Episode(begun[0], time.process_time() - begun[0], states.hexdigest())


def played_by(checkout: Path, world: Path, given: argparse.Namespace) -> Episode:
    """Have the code of a checkout play an episode in a process of its own."""
    command = [sys.executable, __file__, str(world), "--category", given.category, "--method", given.method]
    environment = {**os.environ, "PYTHONPATH": str(checkout / "src"), "VICO_WORKERS": "1"}
    done = subprocess.run(
        [*command, "--steps", str(given.steps), "--play"], env=environment, capture_output=True, text=True, check=True
    )
    return Episode(**json.loads(done.stdout.splitlines()[-1]))


def cell(values: list[float]) -> str:
    """Return the median of some figures, and between what they lie."""
    return f"{statistics.median(values):.1f} ({min(values):.1f} to {max(values):.1f})"


def rows(world: Path, given: argparse.Namespace) -> list[str]:
    """Play the episodes in one world; return the lines of the table."""
    checkouts = {"before": given.before, "now": _HERE} if given.before else {"now": _HERE}
    found: dict[str, list[Episode]] = {name: [] for name in checkouts}
    for _ in range(given.n):
        for name, checkout in checkouts.items():
            found[name].append(played_by(checkout, world, given))
            print(world.name, name, found[name][-1], file=sys.stderr, flush=True)
    if len({one.states for some in found.values() for one in some}) > 1:
        raise SystemExit(f"{world.name}: the states are not the same: {found}")
    lines = []
    for name, some in found.items():
        ratio = "" if name == "before" or "before" not in found else f"{_ratio(found['before'], some):.2f}"
        starts, steps, totals = ([getattr(one, part) for one in some] for part in ("start", "steps", "total"))
        lines.append(
            f"| {world.name}, {given.category} | {name} | {cell(starts)} | {cell(steps)} | {cell(totals)} | {ratio} |"
        )
    return lines


def _ratio(before: list[Episode], now: list[Episode]) -> float:
    """Return what the steps take now, as a share of what they took before."""
    then, since = (statistics.median(one.steps for one in some) for some in (before, now))
    return then and since / then


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", type=Path, nargs="+")
    parser.add_argument("--category", default="carry")
    parser.add_argument("--method", default="heuristic")
    parser.add_argument("--steps", type=int, default=1500)
    parser.add_argument("-n", type=int, default=3, help="times each is played")
    parser.add_argument("--before", type=Path, help="a checkout to compare with")
    parser.add_argument("--table", type=Path)
    parser.add_argument("--play", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.play:
        print(json.dumps(vars(play(given.worlds[0], given.category, given.method, given.steps))))
        return
    lines = [
        "# An episode of the assistant challenge",
        "",
        machine(),
        f"Made by `python benchmarks/assistant_episode.py WORLD... {'--before CHECKOUT ' * (given.before is not None)}"
        f"--category {given.category} --steps {given.steps} -n {given.n} "
        "--table benchmarks/results/assistant_episode.md`.",
        "",
        f"{given.steps} steps, one assistant that sees everything (`{given.method}`), its residents and the traffic; "
        "processor seconds of the whole process, median (least to greatest)."
        + " The states after every step are the same before and now."
        * (given.before is not None),
        "",
        "| episode | code | start to first step | the other steps | whole | steps: now by before |",
        "|---|---|---|---|---|---|",
    ]
    for world in given.worlds:
        lines += rows(world, given)
    publish(lines, given.table)


if __name__ == "__main__":
    main()
