"""How good a policy is: one episode in each copy of a batch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.challenges.learning.manipulation.environment import ManipulationBatch

Numbers = NDArray[np.float32]
#: From observations, shape ``(n, size)``, to actions, shape ``(n, 8)``.
Policy = Callable[[Numbers], NDArray[Any]]


@dataclass(frozen=True)
class Score:
    """What episodes came to.

    Attributes
    ----------
    episodes
        How many.
    success_at_end, success_once
        Share of episodes whose last step was a success, and that had a successful step.
    total_reward
        Of an episode, mean.
    causes
        Of episodes that broke off, by what was said.
    """

    episodes: int
    success_at_end: float
    success_once: float
    total_reward: float
    causes: dict[str, int]

    def __str__(self) -> str:
        found = f"success {self.success_at_end:.2f} at the end, {self.success_once:.2f} at any time, "
        found += f"reward {self.total_reward:.1f}, {self.episodes} episodes"
        return found + (f"; {self.causes}" if self.causes else "")


def score(batch: ManipulationBatch, policy: Policy, *, seed: int = 10**6) -> Score:
    """Play an episode in each copy.

    Parameters
    ----------
    batch
        Has as many copies as episodes are to be played.
    policy
        May remember things between calls: it sees whole episodes from the first step on.
    seed
        Of the first copy's episode; the others have the following ones. Training draws from small seeds.
    """
    seen, _ = batch.reset(seed=seed)
    n = batch.num_envs
    over, once, at_end = np.zeros(n, bool), np.zeros(n, bool), np.zeros(n, bool)
    total, causes = np.zeros(n), dict[str, int]()
    while not over.all():
        seen, reward, ended, cut, info = batch.step(np.asarray(policy(seen), np.float32))
        total += np.where(over, 0.0, reward)
        once |= info["is_success"] & ~over
        ends = (ended | cut) & ~over
        at_end |= info["is_success"] & ends
        for k in np.nonzero(ends)[0].tolist():
            cause = info["final_info"][k].get("cause")
            if cause:
                causes[cause] = causes.get(cause, 0) + 1
        over |= ends
    return Score(n, float(at_end.mean()), float(once.mean()), float(total.mean()), causes)
