"""A long live session with a browser's stream beside it: whether its memory grows.

    python benchmarks/live_day.py WORLD COMMUNITY --out OUT [--hours 24] [--table benchmarks/results/live_day.md]
        [-- OPTIONS OF vico live]

`vico live --speed 0` in a process of its own, read by another one ten frames a second as a page reads it. The resident
set of the first is read from the system every few seconds, beside how far the recording has come. Growth is the median
of the last tenth of the readings less that of the second tenth. The session begins at eight: in the first tenth people
go to where they spend the day, and what is kept of ways and rooms is filled; the night that follows adds nothing to it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

from live import READER
from reporting import machine, publish, split_options
from soak import Piece, recorded_steps, resident_mb

_PERIOD = 2.0  # s between readings
_TENTHS = 10
_USUAL = ("--robots", "none", "--cars", "30", "--pedestrians", "30")


def address(log: Path, process: subprocess.Popen[str]) -> str:
    """Wait until a live session says where its page is."""
    while process.poll() is None:
        for word in log.read_text(encoding="utf-8").split():
            if word.startswith("http://127.0.0.1:"):
                return word
        time.sleep(0.5)
    sys.exit(f"vico live: exit status {process.returncode}; see {log}")


def session(command: list[str], out: Path, last: int) -> tuple[Piece, list[int]]:
    """Run a live session to step `last` with a stream beside it; also the step of every reading."""
    log, began = out.with_suffix(".log"), time.perf_counter()
    resident: list[float] = []
    steps: list[int] = []
    with log.open("w", encoding="utf-8") as told:
        process = subprocess.Popen(command, stdout=told, stderr=told, text=True)
    base, _, token = address(log, process).partition("/?token=")
    place = base.replace("http:", "ws:") + "/stream"
    with subprocess.Popen([sys.executable, "-c", READER, place, token, "1"]) as reader:
        # When the run is over the page goes on showing it, so the session does not end by itself.
        while process.poll() is None and reader.poll() is None and recorded_steps(out) < last:
            time.sleep(_PERIOD)
            steps.append(recorded_steps(out))
            resident.append(resident_mb(process.pid))
        ended = process.poll() is not None or reader.poll() is not None
        reader.kill()
    process.kill()
    process.wait()
    if ended or not resident:
        sys.exit(f"vico live: the session or its stream ended at step {recorded_steps(out)}; see {log}")
    return Piece(0, recorded_steps(out), time.perf_counter() - began, resident), steps


def main() -> None:
    """Run it and report."""
    arguments, given_to_live = split_options(_USUAL)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--table", type=Path)
    given = parser.parse_args(arguments)
    about, steps = machine(), round(3600 * given.hours)
    fixed = ["--speed", "0", "--start", "08:00", "--steps", str(steps)]
    words = [str(given.world), str(given.community), "--out", str(given.out), *fixed, *given_to_live]
    piece, reached = session([sys.executable, "-m", "vico.cli.main", "live", *words], given.out, steps)
    lines = [
        f"# A live session of {given.hours:g} simulated hours",
        "",
        about,
        "Made by `python benchmarks/live_day.py WORLD COMMUNITY --out OUT --table benchmarks/results/live_day.md`.",
        "",
        f"`vico live` with `{' '.join([*fixed, *given_to_live])}` and one stream of ten frames a second: "
        f"{piece.last} steps in {piece.seconds:.0f} s, {piece.last / piece.seconds:.1f} times real time.",
        "",
        "| up to step | MB, median of a tenth of the readings |",
        "|---|---|",
    ]
    share = max(len(reached) // _TENTHS, 1)
    for k in range(0, len(reached) - share + 1, share):
        part = sorted(piece.resident[k : k + share])
        lines.append(f"| {reached[k + share - 1]} | {part[len(part) // 2]:.0f} |")
    lines += ["", f"Growth from the second tenth to the last: {piece.growth():.1f} MB."]
    publish(lines, given.table)


if __name__ == "__main__":
    main()
