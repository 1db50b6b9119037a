"""Picking and placing by two policies that were trained apart: one lifts, then the other places."""

from __future__ import annotations

from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from vico.challenges.learning.manipulation.observation import FULL
from vico.challenges.learning.manipulation.policy import ArrayPolicy
from vico.errors import InputError

Numbers = NDArray[np.float32]

_ENDS = list(accumulate(FULL.values()))
#: Where in an observation its entries are.
PLACES = {name: slice(end - FULL[name], end) for name, end in zip(FULL, _ENDS, strict=True)}
# Metres above where it stood that a lifted box is to be, that it counts as lifted from, and as dropped below.
_GOAL, _LIFTED, _DROPPED = 0.2, 0.12, 0.03
_NEAR = 0.1


class DecomposedPolicy:
    """Lifts, then places, in `PickPlace` with full observations; takes what was dropped up again.

    Parameters
    ----------
    lift, place
        Trained on `Lift` and `Place`.

    Raises
    ------
    InputError
        If they were trained on other observations.
    """

    def __init__(self, lift: ArrayPolicy, place: ArrayPolicy) -> None:
        for name, policy in (("lift", lift), ("place", place)):
            if policy.inputs != sum(FULL.values()):
                raise InputError(
                    f"policy: {name} has {policy.inputs} inputs, not {sum(FULL.values())}; train it on full ones"
                )
        self._lift, self._place = lift, place
        self.reset()

    def reset(self) -> None:
        """Forget; the next observations are of episodes that begin."""
        self._start = np.zeros((0, 3), np.float32)
        self.places = np.zeros(0, bool)

    def act(self, seen: Numbers) -> Numbers:
        """Return actions of all copies, shape ``(n, 8)``, given their observations, shape ``(n, 42)``."""
        box, away = seen[:, PLACES["object"]], seen[:, PLACES["object_to_goal"]]
        if len(self._start) != len(seen):
            self._start, self.places = box.copy(), np.zeros(len(seen), bool)
        lifted = box[:, 2] - self._start[:, 2]
        held = (seen[:, PLACES["pressing"]] > 0.5).all(axis=1)
        there = np.linalg.norm(away, axis=1) < _NEAR
        dropped = self.places & ~held & ~there & (lifted < _DROPPED)
        # What was dropped lies somewhere else now.
        self._start[dropped] = box[dropped]
        self.places = (self.places | (held & (lifted > _LIFTED))) & ~dropped
        return np.where(self.places[:, None], self._place.act(seen), self._lift.act(self._as_lift(seen)))

    def _as_lift(self, seen: Numbers) -> Numbers:
        """Return observations with the goal that lifting has: above where the box stood."""
        told = seen.copy()
        up = self._start + np.array([0.0, 0.0, _GOAL], np.float32) - seen[:, PLACES["object"]]
        told[:, PLACES["object_to_goal"]] = up
        told[:, PLACES["hand_to_goal"]] = seen[:, PLACES["hand_to_object"]] + up
        return told
