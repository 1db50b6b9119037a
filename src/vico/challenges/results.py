"""Results: one record an episode, and a table with 95 % confidence intervals over episodes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from vico.io.files import write_bytes, write_json


@dataclass(frozen=True)
class EpisodeResult:
    """What one episode came to.

    Attributes
    ----------
    success
        Per subtask.
    steps
        Steps until the last subtask was done; the limit if not all were.
    tokens, cost
        Of language model calls, in tokens and US dollars.
    """

    world: str
    seed: int
    category: str
    method: str
    assistants: int
    success: list[bool]
    done_at: list[int | None]
    steps: int
    limit: int
    wall_seconds: float
    state_hash: str
    tokens: int = 0
    cost: float = 0.0


def interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Mean and 95 % confidence interval of a mean (Student's t); the interval is infinite for one value."""
    sample = np.asarray(values, np.float64)
    mean = float(sample.mean())
    if len(sample) < 2:
        return mean, -math.inf, math.inf
    spread = float(sample.std(ddof=1)) / math.sqrt(len(sample)) * float(stats.t.ppf(0.975, len(sample) - 1))
    return mean, mean - spread, mean + spread


def summary(episodes: Sequence[EpisodeResult]) -> dict[str, Any]:
    """Condense the episodes of one method and category.

    Returns
    -------
    dict
        ``SR`` is a percentage, ``Ts`` steps; ``*_low`` and ``*_high`` bound them with 95 % confidence (None where
        a single episode gives no interval).
    """
    first = episodes[0]
    rate, rate_low, rate_high = interval([100.0 * float(np.mean(e.success)) for e in episodes])
    steps, steps_low, steps_high = interval([float(e.steps) for e in episodes])

    def bound(value: float, low: float, high: float) -> float | None:
        return float(np.clip(value, low, high)) if math.isfinite(value) else None

    return {
        "category": first.category,
        "method": first.method,
        "assistants": first.assistants,
        "episodes": len(episodes),
        "subtasks": sum(len(e.success) for e in episodes),
        "successes": sum(sum(e.success) for e in episodes),
        "SR": rate,
        "SR_low": bound(rate_low, 0.0, 100.0),
        "SR_high": bound(rate_high, 0.0, 100.0),
        "Ts": steps,
        "Ts_low": bound(steps_low, 0.0, first.limit),
        "Ts_high": bound(steps_high, 0.0, first.limit),
        "wall_seconds": sum(e.wall_seconds for e in episodes),
        "tokens": sum(e.tokens for e in episodes),
        "cost": sum(e.cost for e in episodes),
    }


def markdown_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """One line a method, in the paper's columns, with intervals."""

    def span(row: Mapping[str, Any], name: str, form: str) -> str:
        low, high = row[f"{name}_low"], row[f"{name}_high"]
        bounds = "one episode" if low is None else f"{low:{form}} to {high:{form}}"
        return f"{row[name]:{form}} ({bounds})"

    lines = [
        "| Category | Method | Assistants | Episodes | Subtasks "
        "| SR % (95 % CI) | Ts (95 % CI) | Wall s | Tokens | Cost $ |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row['category']} | {row['method']} | {row['assistants']} | {row['episodes']} | {row['subtasks']} "
            f"| {span(row, 'SR', '.1f')} | {span(row, 'Ts', '.0f')} | {row['wall_seconds']:.1f} "
            f"| {row['tokens']} | {row['cost']:.2f} |"
        )
    return "\n".join(lines) + "\n"


def write_results(folder: Path, episodes: Sequence[EpisodeResult]) -> dict[str, Any]:
    """Write ``results.json`` (every episode and the summary) and ``results.md``; return the summary."""
    condensed = summary(episodes)
    write_json(
        folder / "results.json",
        {"schema_name": "vico.results", "version": 1, "summary": condensed, "episodes": [asdict(e) for e in episodes]},
    )
    write_bytes(folder / "results.md", markdown_table([condensed]).encode())
    return condensed
