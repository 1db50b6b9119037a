"""What to do next where it is uncertain: each first choice is tried in many worlds that may be, and the best one taken.

In each of these worlds it is drawn where everything is; after the first choice one goes on by chance per second, and
what is found when is counted (rollout of a greedy policy, Bertsekas et al. 1997). All choices meet the same worlds, so
that luck does not decide between them. Compiled: some hundreds of plans a millisecond.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

#: How far a subtask has come: to be found, in hand, done.
OPEN, IN_HAND, DONE = 0, 1, 2
#: How much a subtask that is done at the end counts less than one that is done at once.
IMPATIENCE = 0.25


class Situation(NamedTuple):
    """A task as rollouts take it: ways between points, and places to look at ("spots") for each subtask.

    Attributes
    ----------
    travel
        Seconds from point to point, float64, shape ``(points, points)``; one is at the first.
    spot_point, spot_task, spot_seconds, spot_chance, spot_finds
        Of each spot: its point, its subtask's row, how long a look takes, how likely it is there, and how likely a look
        finds what is there.
    end, service
        Of each subtask: the point where it ends, -1 where it ends where it is found; and seconds from each point to
        there once it is found, with all there is to do, shape ``(points, subtasks)``.
    brought
        Whether what is found is picked up and brought later, with others.
    pick, put, load
        Seconds of picking up and of putting down, and hands that it takes.
    stage
        How far each has come.
    hands
        Free hands.
    left
        Seconds to the end.
    """

    travel: NDArray[np.float64]
    spot_point: NDArray[np.int64]
    spot_task: NDArray[np.int64]
    spot_seconds: NDArray[np.float64]
    spot_chance: NDArray[np.float64]
    spot_finds: NDArray[np.float64]
    end: NDArray[np.int64]
    service: NDArray[np.float64]
    brought: NDArray[np.bool_]
    pick: NDArray[np.float64]
    put: NDArray[np.float64]
    load: NDArray[np.int64]
    stage: NDArray[np.int64]
    hands: int
    left: float


def draw_worlds(
    situation: Situation, chance: np.random.Generator, count: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Draw where everything is, and which looks would find it.

    Returns
    -------
    tuple
        The spot of each subtask, -1 for none of them, shape ``(count, subtasks)``; and whether a look at each spot
        finds what is there, shape ``(count, spots)``.
    """
    tasks = len(situation.stage)
    # Evenly spread over each subtask's chances, and paired at random: fewer worlds are needed than with plain draws.
    spread = (np.arange(count) + 0.5) / count
    truth = np.full((count, tasks), -1, np.int64)
    for k in range(tasks):
        spots = np.flatnonzero(situation.spot_task == k)
        drawn = chance.permutation(spread)
        which = np.searchsorted(np.cumsum(situation.spot_chance[spots]), drawn, side="right")
        inside = which < len(spots)
        truth[inside, k] = spots[which[inside]]
    finds = chance.random((count, len(situation.spot_task))) < situation.spot_finds
    return truth, finds


def choose(situation: Situation, chance: np.random.Generator, *, worlds: int) -> int:
    """Return the best first choice: a spot's index, or the number of spots plus the row of what is brought; -1: none.

    Parameters
    ----------
    worlds
        How many are drawn.
    """
    values = _values(situation, *draw_worlds(situation, chance, worlds))
    best = int(np.argmax(values)) if len(values) else -1
    return best if best >= 0 and values[best] > 0.0 else -1


def worth(situation: Situation, chance: np.random.Generator, *, worlds: int) -> float:
    """Return what the greedy policy achieves on average: subtasks done, those done late a little less."""
    return float(_worth(situation, *draw_worlds(situation, chance, worlds)))


@compiled
def _values(situation, truth, finds):  # type: ignore[no-untyped-def]
    spots = len(situation.spot_task)
    values = np.full(spots + len(situation.stage), -1.0)
    looked = np.zeros(spots, np.bool_)
    for first in range(len(values)):
        if not _may(situation, first, situation.stage, situation.hands, looked):
            continue
        total = 0.0
        for world in range(len(truth)):
            total += _play(situation, first, truth[world], finds[world])
        values[first] = total / len(truth)
    return values


@compiled
def _worth(situation, truth, finds):  # type: ignore[no-untyped-def]
    looked = np.zeros(len(situation.spot_task), np.bool_)
    first = _greedy(situation, 0, 0.0, situation.stage, situation.hands, looked)
    if first < 0:
        return 0.0
    total = 0.0
    for world in range(len(truth)):
        total += _play(situation, first, truth[world], finds[world])
    return total / len(truth)


@compiled
def _may(situation, choice, stage, hands, looked):  # type: ignore[no-untyped-def]
    """Return whether a choice is one: something to bring is in hand, or a spot may still be looked at."""
    spots = len(situation.spot_task)
    if choice >= spots:
        return stage[choice - spots] == IN_HAND
    k = situation.spot_task[choice]
    return not looked[choice] and stage[k] == OPEN and hands >= situation.load[k]


@compiled
def _play(situation, first, truth, finds):  # type: ignore[no-untyped-def]
    """Return the worth of a choice and what follows from it in one world."""
    spots = len(situation.spot_task)
    stage, looked = situation.stage.copy(), np.zeros(spots, np.bool_)
    hands, at, time, value = situation.hands, 0, 0.0, 0.0
    choice = first
    while choice >= 0 and time < situation.left:
        done = -1
        if choice >= spots:
            done = choice - spots
            time += situation.travel[at, situation.end[done]] + situation.put[done]
            at = situation.end[done]
            hands += situation.load[done]
        else:
            k, point = situation.spot_task[choice], situation.spot_point[choice]
            time += situation.travel[at, point] + situation.spot_seconds[choice]
            at = point
            looked[choice] = True
            if truth[k] == choice and finds[choice]:
                if situation.brought[k]:
                    time += situation.pick[k]
                    stage[k] = IN_HAND
                    hands -= situation.load[k]
                else:
                    done = k
                    time += situation.service[point, k]
                    if situation.end[k] >= 0:
                        at = situation.end[k]
        if done >= 0:
            stage[done] = DONE
            if time <= situation.left:
                value += 1.0 - IMPATIENCE * time / situation.left
        choice = _greedy(situation, at, time, stage, hands, looked)
    return value


@compiled
def _greedy(situation, at, time, stage, hands, looked):  # type: ignore[no-untyped-def]
    """Return the choice with the most chance per second of those that may be done in time; -1 if there is none."""
    spots = len(situation.spot_task)
    # What is left of each subtask's chances: the spots that were looked at are out of the question.
    rest = np.ones(len(stage))
    for spot in range(spots):
        if looked[spot]:
            rest[situation.spot_task[spot]] -= situation.spot_chance[spot]
    best, chosen = 0.0, -1
    for choice in range(spots + len(stage)):
        if not _may(situation, choice, stage, hands, looked):
            continue
        if choice >= spots:
            k = choice - spots
            seconds = situation.travel[at, situation.end[k]] + situation.put[k]
            service, likely = 0.0, 1.0
        else:
            k, point = situation.spot_task[choice], situation.spot_point[choice]
            seconds = situation.travel[at, point] + situation.spot_seconds[choice]
            service = situation.service[point, k]
            likely = situation.spot_finds[choice] * situation.spot_chance[choice] / max(rest[k], 0.05)
        if time + seconds + service > situation.left:
            continue
        rate = likely / (seconds + likely * service + 1.0)
        if rate > best:
            best, chosen = rate, choice
    return chosen
