"""Arm skills alone: how often things are picked, put where they are to be, and lost on the way.

    python benchmarks/grasps.py --out out/grasps [--world WORLD] [--table benchmarks/results/grasps.md]
    python benchmarks/grasps.py --out out/grasps --reduced                  # some minutes

*Picks*: a manipulator in a level field, its camera, real physics; things of all kinds that fit its jaw, and random
boxes, in turn, on the ground or on a table 35 to 75 cm high; it is told which thing, and about where. What was picked
is put down on the ground, on the table, or on the deck of a carrier. *Drives*, in a WORLD: over a kerb such as the
robots' ways lead over, turned about, and back, with a thing in the jaw or lying on the carrier's deck. Trials are kept
in --out as they are done: the same command goes on after a kill, and counts what is there.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from grasp_drives import SORTS, drive, kerbs
from grasp_trials import trial
from reporting import machine, publish

from vico.api import read_world

#: Things that are picked, and drives of each sort, in a whole run and in a reduced one.
WHOLE, REDUCED = (200, 100), (24, 4)
Row = dict[str, Any]


def main() -> None:
    """Do the trials that are missing, and report all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder that trials are kept in")
    parser.add_argument("--world", type=Path, help="world that is driven in; none for no drives")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--picks", type=int, help=f"default {WHOLE[0]}")
    parser.add_argument("--drives", type=int, help=f"of each sort, default {WHOLE[1]}")
    parser.add_argument("--reduced", action="store_true", help=f"{REDUCED[0]} picks, {REDUCED[1]} drives")
    parser.add_argument("--report", action="store_true", help="report what is there without another trial")
    parser.add_argument("--table", type=Path)
    options = parser.parse_args()
    counts = REDUCED if options.reduced else WHOLE
    picks = counts[0] if options.picks is None else options.picks
    drives = counts[1] if options.drives is None else options.drives
    options.out.mkdir(parents=True, exist_ok=True)
    seed, here = options.seed, machine()
    picked = _done(
        options.out / f"picks_{seed}.jsonl", 0 if options.report else picks, lambda k: asdict(trial(k, seed=seed))
    )
    driven: list[Row] = []
    where = ""
    if options.world is not None:
        world = read_world(options.world)
        where = world.manifest.name
        spots = [kerbs(world, sort, max(drives, 1), seed=seed) for sort in range(len(SORTS))]
        driven = _done(
            options.out / f"drives_{seed}.jsonl",
            0 if options.report else min(2 * drives, *(2 * len(found) for found in spots)),
            lambda k: asdict(drive(world, spots[k % 2][k // 2], k, seed=seed)),
        )
    publish([*_head(here, seed), *_picks(picked), *_places(picked), *_drives(driven, where)], options.table)


def _done(path: Path, count: int, make: Callable[[int], Row]) -> list[Row]:
    """Return the rows of a file after those that it lacks were made: the first `count`, and what else it holds."""
    rows: list[Row] = []
    if path.exists():
        # A kill may have cut the last line short.
        whole = [line for line in path.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]
        path.write_text("".join(whole), encoding="utf-8")
        rows = [json.loads(line) for line in whole]
    known = {row["number"] for row in rows}
    with path.open("a", encoding="utf-8") as file:
        for number in range(count):
            if number not in known:
                rows.append(make(number))
                file.write(json.dumps(rows[-1]) + "\n")
                file.flush()
    return sorted(rows, key=lambda row: row["number"])


def _head(here: str, seed: int) -> list[str]:
    return [
        "# Arm skills alone", "", here, "",
        f"`python benchmarks/grasps.py --out FOLDER --world WORLD`, seed {seed}. Intervals are Wilson's, 95 %.", "",
    ]  # fmt: skip


def _picks(rows: Sequence[Row]) -> list[str]:
    if not rows:
        return []
    lines = ["## Picked", "", "| what | n | picked | interval | tries, mean | simulated s, median | why not |"]
    lines += ["|---|---|---|---|---|---|---|", _pick_row("all", rows)]
    for surface in sorted({row["surface"] for row in rows}):
        lines.append(_pick_row(f"from the {surface}", [row for row in rows if row["surface"] == surface]))
    for kind in sorted({row["kind"] for row in rows}):
        lines.append(_pick_row(kind, [row for row in rows if row["kind"] == kind]))
    wrong = sum(1 for row in rows if row["said"])
    seconds = statistics.median(row["processor_seconds"] for row in rows)
    return [
        *lines, "", f"The robot's own word on a pick was wrong {wrong} times. A trial, pick and place, takes "
        f"{seconds:.1f} s of a processor (median).", "",
    ]  # fmt: skip


def _pick_row(name: str, rows: Sequence[Row]) -> str:
    good = [row for row in rows if row["picked"]]
    seconds = f"{statistics.median(row['pick_seconds'] for row in good):.1f}" if good else "-"
    tries = statistics.mean(row["tries"] + 1 for row in rows)
    why = _causes(row["pick_cause"] for row in rows if not row["picked"])
    return f"| {name} | {_share(len(good), len(rows))} | {tries:.2f} | {seconds} | {why} |"


def _places(rows: Sequence[Row]) -> list[str]:
    held = [row for row in rows if row["placed"] is not None]
    if not held:
        return []
    lines = ["## Put down", ""]
    lines += ["| where | n | placed | interval | off cm, median | off cm, worst | stand | simulated s | why not |"]
    lines += ["|---|---|---|---|---|---|---|---|---|"]
    for target in ("all", *sorted({row["target"] for row in held})):
        mine = [row for row in held if target in ("all", row["target"])]
        good = [row for row in mine if row["placed"]]
        off = [100.0 * row["off"] for row in good] or [math.nan]
        stand = sum(1 for row in good if row["leans"] < 0.35)
        seconds = statistics.median(row["place_seconds"] for row in good) if good else math.nan
        why = _causes(row["place_cause"] for row in mine if not row["placed"])
        name = target if target == "all" else f"on the {target}"
        lines.append(
            f"| {name} | {_share(len(good), len(mine))} | {statistics.median(off):.1f} | {max(off):.1f} | {stand} | "
            f"{seconds:.1f} | {why} |"
        )
    return [
        *lines, "", "Placed: at rest in nobody's jaw, within 10 cm of its spot (15 cm where it lies on its side), and "
        "within 3 cm of the surface's height. *Stand*: leans by less than 20 degrees.", "",
    ]  # fmt: skip


def _drives(rows: Sequence[Row], world: str) -> list[str]:
    done = [row for row in rows if row["began"]]
    if not done:
        return []
    lines = [
        "## Lost while driving",
        "",
        "| where | drives | lost | interval | kerbs crossed | m | shifts cm, median |",
    ]
    lines += ["|---|---|---|---|---|---|---|"]
    for sort in sorted({row["sort"] for row in done}):
        mine = [row for row in done if row["sort"] == sort]
        lost = sum(1 for row in mine if row["lost"])
        shift = statistics.median(100.0 * row["shift"] for row in mine)
        way, crossed = sum(row["metres"] for row in mine), sum(row["kerbs"] for row in mine)
        low, high = wilson(lost, len(mine))
        lines.append(
            f"| {sort} | {len(mine)} | {lost} ({100.0 * lost / len(mine):.1f} %) | {100 * low:.1f} to {100 * high:.1f} "
            f"% | {crossed} | {way:.0f} | {shift:.1f} |"
        )
    missing = len(rows) - len(done)
    return [
        *lines, "", f"World: {world}. A drive: 5 m over a kerb of 2 cm or more at 0.6 m/s, half a turn at "
        f"0.7 rad/s, and back; kerbs that ways lead over: of 6 cm at most with the manipulator, of any height with "
        f"the carrier. What is slender is not put on a deck. Not begun, for nothing was in the jaw or on the "
        f"deck: {missing}.", "",
    ]  # fmt: skip


def _share(good: int, count: int) -> str:
    low, high = wilson(good, count)
    return f"{count} | {good} ({100.0 * good / max(count, 1):.1f} %) | {100 * low:.1f} to {100 * high:.1f} %"


def _causes(causes: Iterable[str]) -> str:
    return ", ".join(f"{cause} {n}" for cause, n in sorted(Counter(causes).items(), key=lambda one: -one[1])) or "-"


def wilson(good: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson, 1927)."""
    if not count:
        return 0.0, 1.0
    share, spread = good / count, z * z / count
    middle = (share + spread / 2) / (1 + spread)
    half = z / (1 + spread) * math.sqrt(share * (1 - share) / count + spread / (4 * count))
    return max(middle - half, 0.0), min(middle + half, 1.0)


if __name__ == "__main__":
    main()
