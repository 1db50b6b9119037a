"""A long run in pieces: whether memory grows, and who gets stuck, overlaps or stays down.

    python benchmarks/soak.py WORLD COMMUNITY --out OUT [--hours 24] [--pieces 6] [--table benchmarks/results/soak.md]
        [-- OPTIONS OF vico run]

`vico run` without pictures, in pieces of equal length: each is killed (SIGKILL) when it has recorded its share, and the
next goes on from the last checkpoint with `vico run --resume`. So does this script: called again with the same `--out`
it measures the pieces that are missing. Of each piece, the resident set is read from the system
every few seconds, beside how far the recording has come. Growth is the median of the last tenth of a piece's readings
less that of the second tenth (the first tenth fills caches).
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from reporting import machine, publish, split_options

from vico.sim.recording.run import Run, read_run

_PERIOD = 2.0  # s between readings
_USUAL = (
    "--robots", "husky,go2,h1,drone,manipulator", "--weather", "changing", "--cars", "60", "--pedestrians", "60",
    "--junctions", "signals",
)  # fmt: skip
_DOWN = ("fallen", "recovered", "lost")


@dataclass(frozen=True)
class Piece:
    """A process that went a part of the way.

    Attributes
    ----------
    first, last
        Steps it began and ended at.
    seconds
        Wall-clock seconds it took.
    resident
        Megabytes, at every reading.
    """

    first: int
    last: int
    seconds: float
    resident: list[float]

    def growth(self) -> float:
        """Return by how many megabytes it grew after its caches were filled."""
        tenth = max(len(self.resident) // 10, 1)
        return statistics.median(self.resident[-tenth:]) - statistics.median(self.resident[tenth : 2 * tenth])


def recorded_steps(out: Path) -> int:
    """Return how far a recording has come; 0 where there is nothing yet."""
    try:
        return read_run(out).last
    except (OSError, ValueError):  # being written for the first time
        return 0


def resident_mb(pid: int) -> float:
    """Return the resident set of a process; Linux only."""
    for line in Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return 0.0


def go_on(command: list[str], out: Path, until: int | None) -> Piece:
    """Run a piece up to step `until`, then kill it; without, to its end."""
    first, began = recorded_steps(out), time.perf_counter()
    resident: list[float] = []
    log = out.with_suffix(".log").open("a", encoding="utf-8")
    with log, subprocess.Popen(command, stdout=log, stderr=log) as process:
        while process.poll() is None:
            time.sleep(_PERIOD)
            reached = recorded_steps(out)
            if reached > first and process.poll() is None:
                resident.append(resident_mb(process.pid))
            if until is not None and reached >= until:
                process.kill()
        status = process.wait()
    if until is None and status not in (0, 1):  # 1: overlaps, which are told below
        sys.exit(f"vico run: exit status {status}; see {out.with_suffix('.log')}")
    return Piece(first, recorded_steps(out), time.perf_counter() - began, resident)


def falls(run: Run) -> dict[str, Any]:
    """Count robots' falls, and name those that were still down at the end."""
    counted: Counter[str] = Counter()
    down: dict[str, int] = {}
    for event in run.events:
        if event["kind"] == "robot" and event["text"] in _DOWN:
            counted[event["text"]] += 1
            name = str(event["agent"])
            down.pop(name, None) if event["text"] == "recovered" else down.setdefault(name, event["step"])
    return {**{kind: counted[kind] for kind in _DOWN}, "still down": down}


def report(run: Run, pieces: list[Piece]) -> list[str]:
    """Return the lines of the report."""
    metrics = run.metrics
    overlaps, found = metrics["overlaps"], falls(run)
    lines = [
        "| piece | steps | wall s | times real time | MB, second tenth to last | growth MB |",
        "|---|---|---|---|---|---|",
    ]
    for number, piece in enumerate(pieces, 1):
        length, tenth = piece.last - piece.first, max(len(piece.resident) // 10, 1)
        before, after = piece.resident[tenth : 2 * tenth], piece.resident[-tenth:]
        lines.append(
            f"| {number} | {piece.first}..{piece.last} | {piece.seconds:.0f} | {length / piece.seconds:.1f} | "
            f"{statistics.median(before):.0f} to {statistics.median(after):.0f} | {piece.growth():.1f} |"
        )
    lines += [
        "",
        f"- state hash at the end: `{metrics['state_hash']}`",
        f"- overlaps: {overlaps['pairs']} pairs in {overlaps['count']} of {overlaps['sub_steps']} sub-steps",
        f"- robots' falls: {found['fallen']}, up again {found['recovered']}, lost {found['lost']}, "
        f"down at the end: {found['still down'] or 'none'}",
        f"- taken out of jams: {metrics['rescued']['count']}; stuck at the end: {metrics['stuck']['count']}",
        f"- arrivals of residents: {metrics['arrivals']}, late: {metrics['late']}",
        f"- trips: `{json.dumps(metrics['trips'])}`",
        f"- agents' faults: {metrics.get('agent_faults', 0)}",
    ]
    told = [("taken out", who) for who in metrics["rescued"]["who"]] + [
        ("stuck", who) for who in metrics["stuck"]["who"]
    ]
    if told or overlaps["first"]:
        lines += ["", "Each exception:", ""]
        lines += [f"- {what}: `{json.dumps(who)}`" for what, who in told]
        lines += [f"- overlap: `{json.dumps(who)}`" for who in overlaps["first"]]
    return lines


def main() -> None:
    arguments, given_to_run = split_options(_USUAL)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--pieces", type=int, default=6)
    parser.add_argument("--table", type=Path)
    given = parser.parse_args(arguments)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    about, steps = machine(), round(3600 * given.hours)
    vico = [sys.executable, "-m", "vico.cli.main", "run"]
    fixed = ["--observe", "none", "--check", "overlaps", "--start", "00:00", "--steps", str(steps)]
    begin = [*vico, str(given.world), str(given.community), "--out", str(given.out), *fixed, *given_to_run]
    kept = given.out.with_suffix(".pieces.json")
    pieces = [Piece(**piece) for piece in json.loads(kept.read_text(encoding="utf-8"))] if kept.exists() else []
    for k in range(len(pieces), given.pieces):
        until = None if k == given.pieces - 1 else round(steps * (k + 1) / given.pieces)
        begun = recorded_steps(given.out) > 0
        pieces.append(go_on([*vico, "--resume", str(given.out)] if begun else begin, given.out, until))
        kept.write_text(json.dumps([asdict(piece) for piece in pieces]), encoding="utf-8")
    run = read_run(given.out)
    lines = [
        f"# Soak: {given.hours:g} simulated hours in {given.pieces} pieces",
        "",
        about,
        "Made by `python benchmarks/soak.py WORLD COMMUNITY --out OUT --table benchmarks/results/soak.md`.",
        "",
        f"`vico run` with `{' '.join([*fixed, *given_to_run])}`, {run.manifest['community']['residents']} residents; "
        "each piece but the last is killed, and the next goes on from its last checkpoint. Goals: memory growth below "
        "20 MB, nobody stuck, no overlap, no fall without getting up.",
        "",
    ]
    publish([*lines, *report(run, pieces)], given.table)


if __name__ == "__main__":
    main()
