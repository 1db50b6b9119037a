"""Means with 95 % confidence intervals, where episodes of one world are more alike than those of two.

An interval treats each world as one cluster: with ``n`` values, the mean ``m`` and ``G`` worlds, the variance of the
mean is ``G / (G - 1)`` times the sum over worlds of the squared sum of ``(x - m) / n`` (the cluster-robust variance of
Liang and Zeger, 1986), and the interval takes Student's t with ``G - 1`` degrees of freedom. With equally many episodes
a world that is exactly Student's t over the worlds' means. With a single world the interval is Student's t over its
episodes, and speaks of that world alone.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats


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

    def clipped(self, low: float, high: float) -> Estimate:
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
