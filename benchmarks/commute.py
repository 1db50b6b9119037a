"""Play the methods of the commute challenge on some worlds and print the paper's table.

    python benchmarks/commute.py --worlds W1 W2 --seeds 0 1 --methods rule mcts ours --hours 2 --out results/commute

Episodes that lie in the folder of ``--out`` already are not played again; ``vico eval commute`` is to take its place.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from statistics import mean
from typing import Any

from vico.challenges.commute import COMMUTE
from vico.challenges.records import Job


def played(job: Job, path: Path) -> dict[str, Any]:
    """Play an episode, or read what it came to."""
    if not path.is_file():
        record = asdict(COMMUTE.play(job))
        path.write_text(json.dumps(record, indent=1, default=str))
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def table(records: Sequence[dict[str, Any]]) -> str:
    """Return the table, best first, and why commutes failed."""
    metrics = COMMUTE.metrics("commute")
    head = ["method", "days", "commutes", *(f"{m.label} ({m.unit})" for m in metrics), "s a day"]
    rows, causes = [], []
    for method in COMMUTE.methods:
        mine = [record for record in records if record["method"] == method]
        if not mine:
            continue
        parts = [part for record in mine for part in record["parts"]]
        late = [p for p in parts if not p["success"] and p["cause"] != "bike_astray"]
        values = [mean(record["metrics"][m.key] for record in mine) for m in metrics]
        values[0] = 100.0 * len(late) / len(parts)  # of all commutes, as the paper has it
        shown = [f"{value:.{m.digits}f}" for value, m in zip(values, metrics, strict=True)]
        seconds = mean(record["wall_seconds"] for record in mine)
        rows.append([method, str(len(mine)), str(len(parts)), *shown, f"{seconds:.0f}"])
        counted = Counter(p["cause"] for p in parts if not p["success"]).most_common()
        causes.append(f"- {method}: {', '.join(f'{cause} {n}' for cause, n in counted) or 'none failed'}")
    lines = [" | ".join(row) for row in [head, ["---"] * len(head), *rows]]
    return "\n".join(f"| {line} |" for line in lines) + "\n\n" + "\n".join(causes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=Path, nargs="+", required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--methods", nargs="+", default=[m for m in COMMUTE.methods if m != "llm"])
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    jobs = {
        given.out / f"{world.name}_{method}_{seed}_{given.hours:g}.json": Job(
            "commute", "commute", method, {"hours": given.hours}, world, seed
        )
        for seed in given.seeds
        for world in given.worlds
        for method in given.methods
    }
    records = []
    with ProcessPoolExecutor(given.workers) as pool:
        for done in as_completed([pool.submit(played, job, path) for path, job in jobs.items()]):
            record = done.result()
            records.append(record)
            numbers = {key: round(value, 2) for key, value in record["metrics"].items()}
            print(
                record["world"],
                record["method"],
                record["seed"],
                numbers,
                f"{record['wall_seconds']:.0f} s",
                flush=True,
            )
    print(table(records))


if __name__ == "__main__":
    main()
