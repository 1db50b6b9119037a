"""Results: one record an episode, and a table with 95 % confidence intervals over episodes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter
from scipy import stats

from vico.io.files import read_json, write_bytes, write_json
from vico.runner.faults import FAULT_KINDS, Fault

SCHEMA = "vico.results"
VERSION = 3


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
    fault_counts, faults
        How often agents did something wrong, by kind (see `vico.runner.faults`), and the first of it.
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
    fault_counts: dict[str, int] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)


def write_episode(path: Path, key: str, result: EpisodeResult) -> None:
    """Write what an episode came to, whole or not at all.

    Parameters
    ----------
    key
        Digest of all that decides the episode.
    """
    write_json(path, {"schema_name": SCHEMA, "version": VERSION, "key": key, "episode": asdict(result)})


def read_episode(path: Path, key: str) -> EpisodeResult | None:
    """Read what `write_episode` wrote; None if there is none, or it is of another episode."""
    if not path.exists():
        return None
    content = read_json(path)
    known = (SCHEMA, VERSION, key)
    if not isinstance(content, dict) or tuple(content.get(name) for name in ("schema_name", "version", "key")) != known:
        return None
    return TypeAdapter(EpisodeResult).validate_python(content["episode"])


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
        "faults": {kind: n for kind in FAULT_KINDS if (n := sum(e.fault_counts.get(kind, 0) for e in episodes))},
    }


def fault_lines(episodes: Sequence[EpisodeResult]) -> list[str]:
    """Say which agents did something wrong, of which kinds, and why first: a line an episode, agent and kind."""
    lines = []
    for episode in episodes:
        for agent, kind in dict.fromkeys((fault.agent, fault.kind) for fault in episode.faults):
            first = next(fault for fault in episode.faults if (fault.agent, fault.kind) == (agent, kind))
            reason = " ".join(first.reason.split())  # of an agent's making: it must not end the line
            lines.append(
                f"- {episode.world}, seed {episode.seed}: {agent} {kind} at step {first.step} ({reason}); "
                f"{episode.fault_counts[kind]} times in the episode"
            )
    return lines


def markdown_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """One line a method, in the paper's columns, with intervals."""

    def span(row: Mapping[str, Any], name: str, form: str) -> str:
        low, high = row[f"{name}_low"], row[f"{name}_high"]
        bounds = "one episode" if low is None else f"{low:{form}} to {high:{form}}"
        return f"{row[name]:{form}} ({bounds})"

    def counts(faults: Mapping[str, int]) -> str:
        return ", ".join(f"{number} {kind}" for kind, number in faults.items()) or "0"

    lines = [
        "| Category | Method | Assistants | Episodes | Subtasks "
        "| SR % (95 % CI) | Ts (95 % CI) | Wall s | Tokens | Cost $ | Faults |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row['category']} | {row['method']} | {row['assistants']} | {row['episodes']} | {row['subtasks']} "
            f"| {span(row, 'SR', '.1f')} | {span(row, 'Ts', '.0f')} | {row['wall_seconds']:.1f} "
            f"| {row['tokens']} | {row['cost']:.2f} | {counts(row['faults'])} |"
        )
    return "\n".join(lines) + "\n"


def write_results(folder: Path, episodes: Sequence[EpisodeResult]) -> dict[str, Any]:
    """Write ``results.json`` (every episode and the summary) and ``results.md``; return the summary."""
    condensed = summary(episodes)
    write_json(
        folder / "results.json",
        {"schema_name": SCHEMA, "version": VERSION, "summary": condensed, "episodes": [asdict(e) for e in episodes]},
    )
    faults = fault_lines(episodes)
    told = ["", "What agents did wrong, waiting instead:", "", *faults, ""] if faults else []
    write_bytes(folder / "results.md", (markdown_table([condensed]) + "\n".join(told)).encode())
    return condensed
