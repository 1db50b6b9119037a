"""Residents asked together: who would only wait, or walk straight on, is not asked at all."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Info, Observation
from vico.agents.talk.conversation import GREETING_DISTANCE, GREETING_PAUSE
from vico.agents.talk.memory import CrowdMemory
from vico.agents.wayfinding import Stride, stride_lengths
from vico.clock import DAY
from vico.observation_arrays import CrowdObservations
from vico.world.walkable import WalkableMap

__all__ = ["BatchResident", "Residents"]
_LYING = 2
_NEVER = -1e9


class BatchResident(Protocol):
    """A resident that may have nothing to decide for a while, and remembers nothing new meanwhile."""

    @property
    def rests_until(self) -> float:
        """Time before which it only waits, unless spoken to, met or moved."""

    @property
    def stride(self) -> Stride | None:
        """What it goes on with, outdoors, unless spoken to, met or stopped; None for what has to be decided."""

    @property
    def walks_until(self) -> float:
        """Time before which it goes on with `stride`."""

    @property
    def acquaintances(self) -> Collection[str]:
        """Agents it would greet."""

    @property
    def greeting_times(self) -> Mapping[str, float]:
        """When it last spoke with agents, seconds."""

    @property
    def encounters(self) -> int:
        """Changes whenever `greeting_times` does."""

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming second."""


class Residents:
    """Residents that are asked together: each does what it would do alone.

    Those who rest where they were when they last decided to, or are on a straight way, heard nothing and see nobody
    they would greet are found in arrays; they wait, or walk on. Only the others are asked. Whom all of them see is
    taken down for their memories.

    Parameters
    ----------
    members
        By name; one has to say when it acted or was changed otherwise (`forget`).
    walkable
        Where they walk.
    """

    def __init__(self, members: Mapping[str, BatchResident], walkable: WalkableMap) -> None:
        self._walkable = walkable
        self._members = list(members.values())
        self._number = {name: k for k, name in enumerate(members)}
        n = len(members)
        # Each rests from the first to the second time, or walks on.
        self._since, self._until = np.full(n, np.inf), np.full(n, -np.inf)
        self._walks, self._strides = np.zeros(n, bool), np.zeros((n, len(Stride._fields)))
        self._pose = np.zeros((n, 2))
        self._where = np.zeros((n, 3), np.int64)
        # Who would greet whom, as one number a pair, ascending; and when they last spoke.
        pairs = sorted(
            (k * n + self._number[other], other)
            for k, member in enumerate(self._members)
            for other in member.acquaintances
            if other in self._number
        )
        self._pairs = np.array([pair for pair, _ in pairs], np.int64)
        self._greeted = np.full(len(pairs), _NEVER)
        self._acquaintances = [other for _, other in pairs]
        self._first_pair = np.searchsorted(self._pairs, np.arange(n + 1) * n).tolist()
        self._encounters = [-1] * n
        self._changed = set(range(n))
        self._rows: tuple[Mapping[str, int], NDArray[np.int64]] | None = None
        self._memories = CrowdMemory([getattr(member, "memory", None) for member in self._members])

    def forget(self, name: str) -> None:
        """Take nothing for granted of a member any more: it acted, or was restored."""
        k = self._number[name]
        self._until[k] = -np.inf
        self._changed.add(k)

    def act_for(
        self, names: Sequence[str], observations: Mapping[str, Observation], infos: Mapping[str, Info]
    ) -> dict[str, Action | Exception]:
        """Return the members' actions for the coming second; see `vico.agents.base.GroupAgent`."""
        crowd: CrowdObservations | None = getattr(observations, "crowd", None)
        # Members act on what is in view by sight lines: nobody waits for pictures.
        observations = getattr(observations, "without_pictures", observations)
        infos = getattr(infos, "without_pictures", infos)
        numbers = np.array([self._number[name] for name in names], np.int64)
        if crowd is not None:
            self._memories.look(crowd, numbers, lambda: self._members_by_row(crowd))
        going_on = np.full(len(names), np.nan) if crowd is None else self._going_on(crowd, numbers)
        found: dict[str, Action | Exception] = {}
        for name, k, distance in zip(names, numbers.tolist(), going_on.tolist(), strict=True):
            if distance >= 0.0:
                found[name] = {"type": "move_forward", "distance": distance} if distance else {"type": "wait"}
                continue
            try:
                found[name] = self._members[k].act(observations[name], infos[name])
            except Exception as error:
                found[name] = error
                continue
            if crowd is not None:
                self._note(k, crowd, crowd.index[name])
        return found

    def _note(self, k: int, crowd: CrowdObservations, row: int) -> None:
        """Remember until when and where a member rests or walks on."""
        member = self._members[k]
        stride = member.stride
        until = member.rests_until if stride is None else member.walks_until
        if until > crowd.time:
            self._since[k], self._until[k] = crowd.time, until
            self._pose[k] = crowd.pose[row, :2]
            self._where[k] = crowd.place[row], crowd.room[row], crowd.posture[row]
            self._walks[k] = stride is not None
            if stride is not None:
                self._strides[k] = stride

    def _going_on(self, crowd: CrowdObservations, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return how far ahead some members walk that have nothing to decide, metres: 0 for who rests; NaN else."""
        rows = self._rows_in(crowd)[numbers]
        where = np.column_stack([crowd.place[rows], crowd.room[rows], crowd.posture[rows]])
        meets = self._meeting(crowd)[numbers] & (crowd.posture[rows] != _LYING)
        now = (self._since[numbers] <= crowd.time) & (crowd.time < self._until[numbers])
        undisturbed = now & (self._where[numbers] == where).all(axis=1) & ~crowd.heard[rows] & ~meets
        still = (self._pose[numbers] == crowd.pose[rows, :2]).all(axis=1)
        found = np.where(undisturbed & still & ~self._walks[numbers], 0.0, np.nan)
        walks = np.flatnonzero(undisturbed & self._walks[numbers] & ~crowd.stopped[rows])
        strides, pose = self._strides[numbers[walks]], crowd.pose[rows[walks]]
        found[walks] = stride_lengths(strides, pose, crowd.time % DAY, self._walkable)
        return found

    def _meeting(self, crowd: CrowdObservations) -> NDArray[np.bool_]:
        """Return which members see somebody near whom they would greet."""
        self._learn_greetings()
        n = len(self._members)
        meeting = np.zeros(n, bool)
        number = self._members_by_row(crowd)
        near = crowd.distance <= GREETING_DISTANCE
        me, other = number[crowd.viewer[near]], number[crowd.seen[near]]
        both = (me >= 0) & (other >= 0)
        me, pair = me[both], me[both] * n + other[both]
        if not len(self._pairs) or not len(pair):
            return meeting
        at = np.minimum(np.searchsorted(self._pairs, pair), len(self._pairs) - 1)
        due = (self._pairs[at] == pair) & (crowd.time - self._greeted[at] > GREETING_PAUSE)
        meeting[me[due]] = True
        return meeting

    def _learn_greetings(self) -> None:
        for k in self._changed:
            member = self._members[k]
            if member.encounters == self._encounters[k]:
                continue
            self._encounters[k], greeted = member.encounters, member.greeting_times
            for pair in range(self._first_pair[k], self._first_pair[k + 1]):
                self._greeted[pair] = greeted.get(self._acquaintances[pair], _NEVER)
        self._changed.clear()

    def _members_by_row(self, crowd: CrowdObservations) -> NDArray[np.int64]:
        """Return the member's number by row of the crowd; -1 for others."""
        number = np.full(len(crowd.pose), -1, np.int64)
        rows = self._rows_in(crowd)
        number[rows[rows >= 0]] = np.flatnonzero(rows >= 0)
        return number

    def _rows_in(self, crowd: CrowdObservations) -> NDArray[np.int64]:
        """Return the members' rows; -1 for those who take no part in a run."""
        if self._rows is None or self._rows[0] != crowd.index:
            rows = np.array([crowd.index.get(name, -1) for name in self._number], np.int64)
            self._rows = crowd.index, rows
        return self._rows[1]
