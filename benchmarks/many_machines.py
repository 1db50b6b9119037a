"""How much sooner an evaluation is over on several processors, and what 1,000 worlds would cost on a cluster.

    python benchmarks/many_machines.py --worlds W1 W2 --built W... --table benchmarks/results/many_machines.md

The same episodes are played by one process, by two, and by a Ray cluster of two processors that is started for them
(the extra ``ray``); the ways take turns, so that what else the machine does is shared fairly, and ratios are within a
round. All must come to the same bytes. The cost is simulated: seconds a world are drawn from those of the builds of
``--built``, seconds an episode are those measured here; machines take one task a processor, and may be taken away.
"""

from __future__ import annotations

import argparse
import heapq
import os
import statistics
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from reporting import machine, publish, row, vico

from vico.io.files import read_json
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.world import stage_seconds

WAYS = {
    "one process": ("--workers", "1"),
    "two processes": ("--workers", "2"),
    "Ray, two processors": ("--workers", "2", "--ray", "local"),
}
WORLDS, EPISODES = 1000, 3
#: Machines, processors of each, chance an hour that one is taken away.
CLUSTERS = ((1, 2, 0.0), (1, 64, 0.0), (10, 16, 0.0), (10, 16, 0.05), (40, 16, 0.05))
_BACK = 300.0  # seconds until there is another machine for one that was taken away


@dataclass(frozen=True)
class Round:
    """Seconds of each way, of all its processors together, and of an episode in the first of them."""

    seconds: dict[str, float]
    busy: dict[str, float]
    episode: float


class ProcessorSeconds:
    """What this process's descendants use, looked at several times a second: Ray's do not wait for each other."""

    def __init__(self) -> None:
        self._used: dict[int, float] = {}
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> ProcessorSeconds:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    @property
    def total(self) -> float:
        """Seconds of all together."""
        return sum(self._used.values())

    def _watch(self) -> None:
        unit = os.sysconf("SC_CLK_TCK")
        while not self._over.wait(0.2):
            parents: dict[int, int] = {}
            used: dict[int, float] = {}
            for path in Path("/proc").glob("[0-9]*/stat"):
                with suppress(OSError):
                    fields = path.read_text().rpartition(")")[2].split()
                    parents[int(path.parent.name)] = int(fields[1])
                    used[int(path.parent.name)] = (int(fields[11]) + int(fields[12])) / unit
            for pid in parents:
                above = pid
                while above in parents and above != os.getpid():
                    above = parents[above]
                if above == os.getpid() and pid != above:
                    self._used[pid] = used[pid]


def play_round(arguments: argparse.Namespace) -> Round:
    """Play the episodes in every way; stop if they do not come to the same."""
    seconds: dict[str, float] = {}
    busy: dict[str, float] = {}
    written: list[bytes] = []
    with tempfile.TemporaryDirectory(prefix="vico-") as folder:
        for name, words in WAYS.items():
            out = Path(folder) / name.replace(" ", "_")
            asked = [
                "--worlds",
                *map(str, arguments.worlds),
                "--seeds",
                str(arguments.seeds),
                "--steps",
                str(arguments.steps),
            ]
            with ProcessorSeconds() as used:
                done = vico("eval", "assistant", "--method", "heuristic", *asked, *words, "--out", str(out))
            seconds[name], busy[name] = done.seconds, used.total
            written.append((out / "results.json").read_bytes() + (out / "results.md").read_bytes())
        episodes = read_json(Path(folder) / "one_process" / "timing.json")["episodes"]
    if len(set(written)) > 1:
        raise SystemExit("the ways came to different tables")
    return Round(seconds, busy, statistics.mean(episode["wall_seconds"] for episode in episodes))


def simulate(tasks: Sequence[float], machines: int, processors: int, taken: float) -> tuple[float, float, int]:
    """Return the hours until tasks are done, the hours of processors that are paid for, and the tasks done twice.

    Each machine takes one task a processor. One that is taken away loses what it is at, and comes back after a while.

    Parameters
    ----------
    tasks
        Seconds each.
    taken
        Chance an hour that a machine is taken away.
    """
    chance = rng(0, "many machines", machines, processors, int(1000 * taken))
    lost_at = [float(chance.exponential(3600.0 / taken)) if taken else float("inf") for _ in range(machines)]
    free = [(0.0, k) for k in range(machines) for _ in range(processors)]
    heapq.heapify(free)
    waiting, end, twice = list(reversed(tasks)), 0.0, 0
    while waiting:
        now, k = heapq.heappop(free)
        if now >= lost_at[k]:
            lost_at[k] = now + _BACK + float(chance.exponential(3600.0 / taken))
            free = [(max(at, now + _BACK) if other == k else at, other) for at, other in [*free, (now, k)]]
            heapq.heapify(free)
            continue
        task = waiting.pop()
        if now + task > lost_at[k]:
            waiting.append(task)
            twice += 1
            heapq.heappush(free, (lost_at[k], k))
            continue
        end = max(end, now + task)
        heapq.heappush(free, (now + task, k))
    return end / 3600.0, end / 3600.0 * machines * processors, twice


def cost_lines(built: Sequence[float], episode: float, price: float) -> list[str]:
    """Return the table of what the worlds and their episodes would cost."""
    chance = rng(0, "many machines", "worlds")
    tasks = [float(x) for x in chance.choice(built, WORLDS)] + [episode] * (WORLDS * EPISODES)
    busy = sum(tasks) / 3600.0
    lines = [
        "| machines | processors each | taken away, an hour | hours | processor hours | tasks done twice | dollars |",
        "|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for machines, processors, taken in CLUSTERS:
        hours, paid, twice = simulate(tasks, machines, processors, taken)
        lines.append(
            f"| {machines} | {processors} | {100 * taken:.0f} % | {hours:.2f} | {paid:.1f} | {twice} "
            f"| {paid * price:.2f} |"
        )
    return [
        f"Hours = ({WORLDS} x seconds a world + {WORLDS * EPISODES} x seconds an episode) / processors / 3600, plus "
        f"what processors wait at the end; here {busy:.1f} hours of work. Seconds a world: median "
        f"{statistics.median(built):.0f}, {min(built):.0f} to {max(built):.0f}, of {len(built)} builds on two "
        f"processors of a shared machine. Seconds an episode: {episode:.1f}. Dollars at {price:.3f} a processor hour "
        "(an assumption: put in your own).",
        "",
        *lines,
    ]


def main() -> None:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=Path, nargs="+", required=True)
    parser.add_argument("--built", type=Path, nargs="+", required=True, help="worlds whose build times are drawn from")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--price", type=float, default=0.04, help="dollars a processor hour")
    parser.add_argument("--table", type=Path)
    arguments = parser.parse_args()
    head = machine()
    with tempfile.TemporaryDirectory(prefix="vico-") as folder:  # what is compiled once is no one's
        words = ["--worlds", str(arguments.worlds[0]), "--seeds", "1", "--steps", "2", "--workers", "1"]
        vico("eval", "assistant", "--method", "heuristic", *words, "--out", f"{folder}/warm")
    rounds = [play_round(arguments) for _ in range(arguments.repeat)]
    built = [sum(stage_seconds(read_world(path)).values()) for path in arguments.built]
    first = next(iter(WAYS))
    episode = statistics.median(one.episode for one in rounds)
    lines = [
        "# Many machines",
        "",
        f"{head} Ray {version('ray')}. {len(arguments.worlds) * arguments.seeds} episodes of the delivery task, "
        f"{arguments.steps} steps each. All ways came to the same results.json and results.md, byte for byte.",
        "",
        "Where the machine is shared with other work (see the load), seconds by the clock say more of that than of the "
        "ways; processor seconds do not depend on it. Ratios are within a round, whose ways took turns.",
        "",
        "| way, seconds in all | median | least | most | n |",
        "|---|---:|---:|---:|---:|",
        *(row(name, [one.seconds[name] for one in rounds], 1) for name in WAYS),
        "",
        "| times as fast as one process | median | least | most | n |",
        "|---|---:|---:|---:|---:|",
        *(row(name, [one.seconds[first] / one.seconds[name] for one in rounds], 2) for name in WAYS if name != first),
        "",
        "| processor seconds of all processes | median | least | most | n |",
        "|---|---:|---:|---:|---:|",
        *(row(name, [one.busy[name] for one in rounds], 1) for name in WAYS),
        "",
        "So two free processors would be, at best, so many times as fast as one:",
        "",
        "| 2 x processor seconds of one process / those of this way | median | least | most | n |",
        "|---|---:|---:|---:|---:|",
        *(row(name, [2 * one.busy[first] / one.busy[name] for one in rounds], 2) for name in WAYS if name != first),
        "",
        f"## {WORLDS:,} worlds, {EPISODES} such episodes in each: simulated",
        "",
        *cost_lines(built, episode, arguments.price),
    ]
    publish(lines, arguments.table)


if __name__ == "__main__":
    main()
