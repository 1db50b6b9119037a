"""How long a world takes to build, stage by stage, and how much memory.

    python benchmarks/world.py [--radius 400] [-n 3] [--table benchmarks/results/world.md]

The packaged place, built anew each time in a process of its own. Stage seconds are wall time, as the world's own
``build.json`` tells them; the last lines are the whole command, imports and report included.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from reporting import machine, publish, row, vico

from vico.worldgen.packaged import packaged_extract

GOAL = 90.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--radius", type=float, default=400.0)
    parser.add_argument("-n", type=int, default=3, help="builds")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    place, about = packaged_extract(), machine()
    facts, whole, peaks = [], [], []
    with tempfile.TemporaryDirectory(prefix="vico-") as folder:
        for k in range(given.n):
            where = ["--lat", str(place.lat), "--lon", str(place.lon), "--radius", str(given.radius)]
            child = vico("world", "build", *where, "--out", f"{folder}/{k}", "--json")
            facts.append(json.loads(child.output))
            whole.append(child.seconds)
            peaks.append(child.peak_mb)
    last = facts[-1]
    lines = [
        "# World: seconds a stage",
        "",
        about,
        "Made by `vico bench world --table benchmarks/results/world.md`.",
        "",
        f"{place.name}, {2 * given.radius:.0f} m x {2 * given.radius:.0f} m: {last['buildings']} buildings, "
        f"{last['places']} places, {last['roads']} roads, {last['indoor_objects']} things indoors; "
        f"{last['megabytes']:.0f} MB on disk. Goal: {GOAL:.0f} s for 800 m x 800 m.",
        "",
        "| stage | median s | least | greatest | n |",
        "|---|---|---|---|---|",
    ]
    stages = [name for name in last["seconds"] if name != "total"]
    lines += [row(name, [f["seconds"][name] for f in facts], 2) for name in (*stages, "total")]
    lines.append(row("whole command", whole, 2))
    lines += ["", "| memory | median MB | least | greatest | n |", "|---|---|---|---|---|"]
    lines.append(row("peak resident set", peaks, 0))
    publish(lines, given.table)


if __name__ == "__main__":
    main()
