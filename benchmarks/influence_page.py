"""Write the page of the influence table from what benchmarks/tables.py played; nothing on it is typed by hand.

    python benchmarks/tables.py --table influence --worlds WORLDS --first-seed 355358 --out OUT
    python benchmarks/influence_page.py OUT --page benchmarks/results/influence_bodies.md

All numbers are of a pairing's first strategy, over both assignments of the characters.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from reporting import write_page

from vico.agents.influence.situation import FAILURES
from vico.challenges.influence import INFLUENCE
from vico.challenges.influence.evaluate import CAUSES
from vico.challenges.tables.results import read_results, setting_words, table
from vico.errors import InputError

BLOCKS = {
    "pairings": "Every pairing of the offline strategies",
    "ablation": "Ablation: one half of ours against one half of another",
}
_ABLATION_NOTE = (
    "In `ours+nearest/ours` both talk as ours does, and the rival chooses whom to see as nearest does: Win says what "
    "our target choice is worth. In `ours+ours/nearest` both choose as ours does, and the rival talks as nearest does: "
    "Win says what our dialogue is worth."
)

Results = Mapping[str, Any]


def results_in(out: Path) -> dict[str, Results]:
    """Return the results of each block that was played, by its name.

    Raises
    ------
    InputError, SchemaError
        If there are none, they are another challenge's, or damaged.
    """
    found: dict[str, Results] = {}
    for name in BLOCKS:
        path = out / name / "results.json"
        if path.exists():
            content, episodes = read_results(path)
            if content["challenge"] != "influence":
                raise InputError(f"{path.parent}: results of another challenge; give the folder of the influence table")
            found[name] = {**content, "seconds": sum(record.wall_seconds for _, record in episodes)}
    if not found:
        raise InputError(f"{out}: no results; play the table with benchmarks/tables.py --table influence --out {out}")
    return found


def rates(results: Results) -> list[str]:
    """Return Win and Conv, a row a pairing, with intervals over communities."""
    metrics = [metric for metric in INFLUENCE.metrics("day") if metric.key.startswith(("win", "conv"))]
    head = ["Pairing", "Communities", *(metric.label for metric in metrics)]
    body = [
        [row["method"], str(row["episodes"]), *(_interval(row["metrics"].get(metric.key)) for metric in metrics)]
        for row in results["rows"]
    ]
    return table(head, body)


def by_community(results: Results) -> list[str]:
    """Return Win and Conv of each community, a row a pairing."""
    played = results["episodes"]
    where = list(dict.fromkeys(_where(one) for one in played))
    cells = {(one["method"], _where(one)): _pair(one["metrics"]) for one in played}
    methods = [row["method"] for row in results["rows"]]
    return table(
        ["Pairing, Win / Conv", *where], [[name, *(cells.get((name, one), "-") for one in where)] for name in methods]
    )


def causes(results: Results) -> list[str]:
    """Return why members were not won, a row a pairing."""
    body = [
        [row["method"], f"{row['done']} of {row['parts']}", *(str(row["causes"].get(cause, 0)) for cause in CAUSES)]
        for row in results["rows"]
    ]
    return table(["Pairing", "Won", *CAUSES], body)


def visits(results: Results) -> list[str]:
    """Return how visits ended, a row a pairing: means a day."""
    keys = ["visits", "talks", *(f"visits_{ending.replace(' ', '_')}" for ending in FAILURES)]
    body = [
        [row["method"], *(f"{row['metrics'][key]['mean']:.1f}" if key in row["metrics"] else "-" for key in keys)]
        for row in results["rows"]
    ]
    return table(["Pairing, a day", "visits", "talks", *FAILURES], body)


def cost(results: Results) -> str:
    """Return what it took, and what was not played, in a sentence."""
    episodes = sum(row["episodes"] for row in results["rows"])
    missing = sum(row["not_played"] for row in results["rows"])
    faults = sum(sum(row["faults"].values()) for row in results["rows"])
    return (
        f"{episodes} episodes of two days, {results['seconds'] / 3600:.1f} hours on the clock of a shared machine, "
        f"{faults} faults of agents; {missing} episodes could not be played."
    )


def page(blocks: Mapping[str, Results]) -> str:
    """Return the page."""
    first = next(iter(blocks.values()))
    seeds = sorted({one["seed"] for one in first["episodes"]})
    setting = first["episodes"][0]["setting"] if first["episodes"] else {}
    settings = setting_words({name: value for name, value in setting.items() if value not in ("", 0)})
    lines = [
        "# Influence: all pairings, with bodies",
        "",
        f"Written by `benchmarks/influence_page.py`. vico {first['vico']}, code `{first['code'][:12]}`; communities: "
        f"{', '.join(first['worlds'])}; seeds {', '.join(map(str, seeds))}; {settings}. Percent, means over "
        "communities with 95 % intervals (Student's t). Each pairing is played twice, with the characters swapped; all "
        "numbers are of the first strategy. The opinion model was frozen by `f917a9d`, the strategy `ours` by "
        "`056c1ea`, whose first six digits are the reported seed (355358).",
        "",
    ]
    for name, results in blocks.items():
        lines += [f"## {BLOCKS[name]}", ""]
        lines += [_ABLATION_NOTE, ""] if name == "ablation" else []
        for rows in (rates(results), by_community(results)):
            lines += [*rows, ""]
        lines += ["Why members were not won (members of all days together):", "", *causes(results), ""]
        lines += ["How visits ended:", "", *visits(results), "", cost(results), ""]
    return "\n".join(lines).rstrip() + "\n"


def _where(episode: Mapping[str, Any]) -> str:
    return f"{episode['world_folder']} {episode['seed']}"


def _pair(metrics: Mapping[str, float]) -> str:
    conv = f"{metrics['conv']:.0f}" if "conv" in metrics else "-"
    return f"{metrics['win']:.0f} / {conv}"


def _interval(found: Mapping[str, Any] | None) -> str:
    if found is None:
        return "-"
    if found["low"] is None:
        return f"{found['mean']:.1f} (one community)"
    return f"{found['mean']:.1f} ({found['low']:.0f} to {found['high']:.0f})"


def main(words: Sequence[str] | None = None) -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    return write_page(parser, lambda it: page(results_in(it.out)), words)


if __name__ == "__main__":
    sys.exit(main())
