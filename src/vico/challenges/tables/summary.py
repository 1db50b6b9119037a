"""Summary of a method in a category: means of all metrics, causes of failure, faults, and cost.

Means have 95 % confidence intervals, where episodes of one world are more alike than those of two.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from vico.challenges.episodes import Outcome
from vico.challenges.records import Challenge, Metric, Setting, setting_of_task
from vico.runner.gather import FAULT_KINDS


@dataclass(frozen=True)
class Estimate:
    """A mean, with 95 % confidence.

    Attributes
    ----------
    low, high
        Its interval; None where one episode, or nothing, gives none.
    count
        Episodes it is over.
    clusters
        Worlds it is over.
    """

    mean: float
    low: float | None
    high: float | None
    count: int
    clusters: int

    def clip(self, low: float, high: float) -> Estimate:
        """Return it with an interval that does not leave some bounds."""
        if self.low is None or self.high is None:
            return self
        return Estimate(self.mean, max(self.low, low), min(self.high, high), self.count, self.clusters)

    @property
    def differs(self) -> bool:
        """Whether its interval leaves 0 out."""
        return self.low is not None and self.high is not None and (self.low > 0.0 or self.high < 0.0)


def estimate(values: Sequence[float], worlds: Sequence[Hashable]) -> Estimate:
    """Return the mean of values, with an interval that is clustered by world.

    Parameters
    ----------
    worlds
        In which world each value was found.
    """
    return estimate_of_means([values], [worlds])


def estimate_of_means(groups: Sequence[Sequence[float]], worlds: Sequence[Sequence[Hashable]]) -> Estimate:
    """Return the mean of several groups' means (each counts the same), with an interval clustered by world."""
    x = np.concatenate([np.asarray(group, np.float64) for group in groups])
    where = [world for group in worlds for world in group]
    weight = np.concatenate([np.full(len(group), 1.0 / (len(groups) * len(group))) for group in groups])
    means = np.concatenate([np.full(len(group), float(np.mean(group))) for group in groups])
    mean = float(np.mean([np.mean(group) for group in groups]))
    clusters = len(set(where))
    labels: Sequence[Hashable] = where if clusters > 1 else range(len(x))
    spread = _spread(weight * (x - means), labels)
    if spread is None:
        return Estimate(mean, None, None, len(x), clusters)
    return Estimate(mean, mean - spread, mean + spread, len(x), clusters)


def _spread(residuals: NDArray[np.float64], labels: Sequence[Hashable]) -> float | None:
    """Return half the interval's width; None for a single cluster."""
    sums: dict[Hashable, float] = {}
    for label, residual in zip(labels, residuals, strict=True):
        sums[label] = sums.get(label, 0.0) + float(residual)
    number = len(sums)
    if number < 2:
        return None
    variance = number / (number - 1) * math.fsum(value**2 for value in sums.values())
    return math.sqrt(variance) * float(stats.t.ppf(0.975, number - 1))


@dataclass(frozen=True)
class Row:
    """One method in one category.

    Attributes
    ----------
    episodes
        How many were played.
    not_played
        How many could not be.
    metrics
        Means, with intervals, by key; one that no episode has is left out.
    parts, done
        How many things were asked for, and done.
    causes
        How many of the others failed for which cause.
    faults
        How often agents did something wrong, by kind.
    wall_seconds, tokens, cost
        Of all episodes together.
    """

    category: str
    method: str
    episodes: int
    not_played: int
    metrics: Mapping[str, Estimate]
    parts: int
    done: int
    causes: Mapping[str, int]
    faults: Mapping[str, int]
    wall_seconds: float
    tokens: int
    cost: float


@dataclass(frozen=True)
class Difference:
    """How a method differs from a reference in the same tasks.

    Attributes
    ----------
    metrics
        Mean differences, method minus reference, with intervals, by key.
    pairs
        Episodes that both have played.
    """

    category: str
    method: str
    reference: str
    metrics: Mapping[str, Estimate]
    pairs: int


@dataclass(frozen=True)
class Average:
    """A method's first metric over all categories, each counting the same, and its difference from the reference.

    Attributes
    ----------
    difference
        None for the reference itself, and where no episodes are paired in a category.
    """

    method: str
    key: str
    mean: Estimate
    difference: Estimate | None


@dataclass(frozen=True)
class Summary:
    """What an evaluation of one challenge in one setting came to.

    Attributes
    ----------
    reference
        The method that the others are compared with.
    averages
        Empty unless there are several categories whose first metric is the same.
    """

    challenge: str
    setting: Setting
    reference: str
    rows: list[Row]
    differences: list[Difference]
    averages: list[Average]


def summarise(challenge: Challenge, outcomes: Sequence[Outcome], *, reference: str = "") -> Summary:
    """Condense the outcomes of one setting; methods and categories keep their order.

    Parameters
    ----------
    reference
        The method that the others are compared with; the first one without.
    """
    categories = list(dict.fromkeys(outcome.job.category for outcome in outcomes))
    methods = list(dict.fromkeys(outcome.job.method for outcome in outcomes))
    reference = reference or methods[0]
    groups = {
        (category, method): [o for o in outcomes if (o.job.category, o.job.method) == (category, method)]
        for category in categories
        for method in methods
    }
    rows = [_row(challenge, category, method, group) for (category, method), group in groups.items() if group]
    differences = [
        _difference(challenge.metrics(category), category, method, group, groups[category, reference])
        for (category, method), group in groups.items()
        if method != reference and group and groups.get((category, reference))
    ]
    averages = _averages(challenge, categories, methods, groups, reference)
    setting = setting_of_task(outcomes[0].job.setting)
    return Summary(challenge.name, setting, reference, rows, differences, averages)


def _row(challenge: Challenge, category: str, method: str, outcomes: Sequence[Outcome]) -> Row:
    records = [outcome.record for outcome in outcomes if outcome.record is not None]
    metrics = {}
    for metric in challenge.metrics(category):
        values = _values(outcomes, metric.key)
        if values:
            mean = estimate([value for value, _ in values], [world for _, world in values])
            metrics[metric.key] = mean.clip(metric.low, metric.high)
    parts = [part for record in records for part in record.parts]
    counted = Counter(part.cause for part in parts if not part.success)
    faults = {kind: sum(record.fault_counts.get(kind, 0) for record in records) for kind in FAULT_KINDS}
    return Row(
        category=category,
        method=method,
        episodes=len(records),
        not_played=len(outcomes) - len(records),
        metrics=metrics,
        parts=len(parts),
        done=sum(part.success for part in parts),
        causes={cause: counted[cause] for cause in challenge.causes(category) if counted[cause]},
        faults={kind: number for kind, number in faults.items() if number},
        wall_seconds=sum(record.wall_seconds for record in records),
        tokens=sum(record.tokens for record in records),
        cost=sum(record.cost for record in records),
    )


def _difference(
    metrics: Sequence[Metric], category: str, method: str, outcomes: Sequence[Outcome], others: Sequence[Outcome]
) -> Difference:
    found = {}
    for metric in metrics:
        pairs = _paired_differences(outcomes, others, metric.key)
        if pairs:
            found[metric.key] = estimate([value for value, _ in pairs], [world for _, world in pairs])
    both = _tasks(outcomes) & _tasks(others)
    return Difference(category, method, others[0].job.method, found, len(both))


def _averages(
    challenge: Challenge,
    categories: Sequence[str],
    methods: Sequence[str],
    groups: Mapping[tuple[str, str], Sequence[Outcome]],
    reference: str,
) -> list[Average]:
    first = [challenge.metrics(category)[0] for category in categories]
    if len(categories) < 2 or any(metric != first[0] for metric in first):
        return []
    key, averages = first[0].key, []
    for method in methods:
        values = [_values(groups[category, method], key) for category in categories]
        if not all(values):
            continue
        mean = estimate_of_means([[v for v, _ in group] for group in values], [[w for _, w in g] for g in values])
        pairs = [_paired_differences(groups[c, method], groups.get((c, reference), []), key) for c in categories]
        difference = None
        if method != reference and all(pairs):
            difference = estimate_of_means([[v for v, _ in p] for p in pairs], [[w for _, w in p] for p in pairs])
        averages.append(Average(method, key, mean.clip(first[0].low, first[0].high), difference))
    return averages


def _values(outcomes: Sequence[Outcome], key: str) -> list[tuple[float, str]]:
    """Return a metric of each episode that has it, and in which world it was."""
    return [(o.record.metrics[key], _world(o)) for o in outcomes if o.record is not None and key in o.record.metrics]


def _paired_differences(outcomes: Sequence[Outcome], others: Sequence[Outcome], key: str) -> list[tuple[float, str]]:
    """Return how much larger a metric is than in the other method's episode of the same task, and in which world."""
    theirs = {_task(o): o.record.metrics[key] for o in others if o.record is not None and key in o.record.metrics}
    return [
        (o.record.metrics[key] - theirs[_task(o)], _world(o))
        for o in outcomes
        if o.record is not None and key in o.record.metrics and _task(o) in theirs
    ]


def _tasks(outcomes: Sequence[Outcome]) -> set[tuple[str, int]]:
    return {_task(outcome) for outcome in outcomes if outcome.record is not None}


def _task(outcome: Outcome) -> tuple[str, int]:
    return _world(outcome), outcome.job.seed


def _world(outcome: Outcome) -> str:
    return str(outcome.job.world)
