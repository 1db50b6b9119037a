"""Play the influence challenge's pairings on several communities, and print Win and Conv with intervals.

    python benchmarks/influence_pairings.py --worlds W1 W2 --communities 5 --out results/influence
    python benchmarks/influence_pairings.py --worlds W --communities 5 --set simulation=schedule start=08:00 hours=12

Each pairing is played twice on a community, with the characters swapped; a community is a world and a seed, and the
worlds take turns. What an episode came to is written as soon as it is over, and not played again.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from hashlib import sha256
from pathlib import Path

from vico.challenges.influence import INFLUENCE
from vico.challenges.influence.opinion import opinion_digest
from vico.challenges.influence.tasks import settings_of
from vico.challenges.records import Job, Setting
from vico.challenges.tables.summary import estimate
from vico.io.files import read_json, write_json
from vico.version import __version__

PAIRINGS = ("ours+random", "ours+nearest", "ours+persuadable")


def play(job: Job, out: Path) -> dict[str, object]:
    """Play an episode, unless its result is there already."""
    told = {"method": job.method, "world": str(job.world.resolve()), "seed": job.seed, "setting": dict(job.setting)}
    decides = {**told, "version": __version__, "opinion": opinion_digest()}
    key = sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()[:16]
    path = out / "episodes" / f"{job.method.replace('/', '_')}_{job.world.name}_{job.seed}_{key}.json"
    if path.exists():
        return read_json(path)
    record = asdict(INFLUENCE.play(job))
    write_json(path, record)
    print(f"{job.method} {job.world.name} {job.seed}: Win {record['metrics']['win']:.1f}", flush=True)
    return record


def table(rows: dict[str, list[dict[str, object]]], keys: Sequence[str]) -> str:
    """Return a line a pairing: means over communities, with 95 % intervals."""
    lines = ["| Pairing | Communities | " + " | ".join(keys) + " | Wall s |", "|---" * (len(keys) + 3) + "|"]
    for method, records in rows.items():
        cells = []
        for key in keys:
            values = [r["metrics"][key] for r in records if key in r["metrics"]]
            if not values:
                cells.append("-")
                continue
            found = estimate(values, range(len(values))).clipped(0.0, 100.0)
            bounds = "one community" if found.low is None else f"{found.low:.0f} to {found.high:.0f}"
            cells.append(f"{found.mean:.1f} ({bounds})")
        wall = sum(r["wall_seconds"] for r in records) / len(records)
        lines.append(f"| {method} | {len(records)} | " + " | ".join(cells) + f" | {wall:.0f} |")
    return "\n".join(lines)


def by_community(rows: dict[str, list[dict[str, object]]]) -> str:
    """Return Win and Conv of each community, a line a pairing."""
    first = next(iter(rows.values()))
    heads = [f"{r['world']} {r['seed']}" for r in first]
    lines = ["| Pairing, Win / Conv | " + " | ".join(heads) + " |", "|---" * (len(heads) + 1) + "|"]
    for method, records in rows.items():
        cells = [f"{r['metrics']['win']:.0f} / {r['metrics'].get('conv', float('nan')):.0f}" for r in records]
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def setting_of(pairs: Sequence[str]) -> Setting:
    """Return settings given as NAME=VALUE."""
    found: dict[str, bool | int | float | str] = {}
    for pair in pairs:
        name, _, value = pair.partition("=")
        found[name] = float(value) if name == "hours" else int(value) if name == "llm_tokens" else value
    settings_of(found)
    return found


def main() -> None:
    """Play, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", nargs="+", type=Path, required=True)
    parser.add_argument("--communities", type=int, default=5)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--methods", nargs="+", default=list(PAIRINGS))
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="settings, such as hours=2")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    setting = setting_of(args.set)
    where = [(args.worlds[k % len(args.worlds)], args.first_seed + k) for k in range(args.communities)]
    jobs = [Job("influence", "day", method, setting, world, seed) for world, seed in where for method in args.methods]
    (args.out / "episodes").mkdir(parents=True, exist_ok=True)
    if args.workers > 1:
        with ProcessPoolExecutor(args.workers) as pool:
            records = list(pool.map(partial(play, out=args.out), jobs))
    else:
        records = [play(job, args.out) for job in jobs]
    rows = {m: [r for job, r in zip(jobs, records, strict=True) if job.method == m] for m in args.methods}
    keys = [metric.key for metric in INFLUENCE.metrics("day")]
    print(table(rows, keys))
    print()
    print(by_community(rows))


if __name__ == "__main__":
    main()
