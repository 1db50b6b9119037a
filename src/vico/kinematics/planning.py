"""Ways of an arm that touch nothing: RRT-Connect (Kuffner and LaValle, 2000) in the space of its joints."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.kinematics.arm import Chain
from vico.kinematics.limbs import Limbs, ball_places
from vico.kinematics.room import Room, clearance

Array = NDArray[np.float64]

# Radians between two looks along a way, and between two nodes of a tree; nodes of a tree at most.
_LOOK, _STEP, _MOST = 0.06, 0.35, 1500
# Straight pieces that are tried in place of parts of a way.
_SHORTCUTS = 60


class Arm(NamedTuple):
    """An arm in its surroundings.

    Attributes
    ----------
    chain
        Its joints.
    limbs
        Its body, with what it holds.
    room
        What stands around it.
    gap
        That it keeps to everything, metres.
    """

    chain: Chain
    limbs: Limbs
    room: Room
    gap: float = 0.0


def is_free(arm: Arm, angles: Array) -> bool:
    """Return whether an arm touches nothing at some angles."""
    return bool(_is_free(arm, angles, np.empty((len(arm.limbs.link), 3))))


def way_is_free(arm: Arm, way: Array) -> bool:
    """Return whether an arm touches nothing all along a way, angles, shape ``(m, n)``."""
    places = np.empty((len(arm.limbs.link), 3))
    return is_free(arm, way[0]) and all(bool(_edge(arm, a, b, places)) for a, b in pairwise(way))


def free_way(arm: Arm, start: Array, goal: Array, *, seed: int = 0) -> Array | None:
    """Return angles from a start to a goal between which nothing is touched, shape ``(m, n)``; None if none is found.

    The way begins with the start. It is straight where nothing is in between, else found by two trees that grow
    towards each other, and shortened.

    Parameters
    ----------
    seed
        Decides the draws: the same seed gives the same way.
    """
    way = np.empty((2 * _MOST + 2, len(start)))
    count = _connect(arm, start, goal, np.uint64(seed), way)
    return way[:count].copy() if count else None


@compiled
def _draw(luck):  # type: ignore[no-untyped-def]
    """Return a number from 0 to 1 (splitmix64: Steele, Lea and Flood, 2014)."""
    luck[0] += np.uint64(0x9E3779B97F4A7C15)
    z = luck[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return np.float64(z >> np.uint64(11)) / 9007199254740992.0


@compiled
def _is_free(arm, angles, places):  # type: ignore[no-untyped-def]
    ball_places(arm.chain, arm.limbs, angles, places)
    return clearance(arm.room, arm.limbs, places, arm.gap) >= arm.gap


@compiled
def _edge(arm, start, end, places):  # type: ignore[no-untyped-def]
    """Whether a straight way of the joints is free, its start left out."""
    longest = 0.0
    for j in range(len(start)):
        longest = max(longest, abs(end[j] - start[j]))
    count = max(int(np.ceil(longest / _LOOK)), 1)
    between = np.empty(len(start))
    for k in range(1, count + 1):
        for j in range(len(start)):
            between[j] = start[j] + (end[j] - start[j]) * k / count
        if not _is_free(arm, between, places):
            return False
    return True


@compiled
def _nearest(nodes, count, angles):  # type: ignore[no-untyped-def]
    best, found = 1e18, 0
    for k in range(count):
        away = 0.0
        for j in range(len(angles)):
            away += (nodes[k, j] - angles[j]) ** 2
        if away < best:
            best, found = away, k
    return found


@compiled
def _grow(arm, nodes, before, count, towards, places):  # type: ignore[no-untyped-def]
    """Add a node a step towards angles; return 0 for none, 1 for one, 2 for one that is there."""
    near = _nearest(nodes, count, towards)
    away = 0.0
    for j in range(len(towards)):
        away += (towards[j] - nodes[near, j]) ** 2
    away = np.sqrt(away)
    share = min(1.0, _STEP / away) if away > 1e-12 else 1.0
    for j in range(len(towards)):
        nodes[count, j] = nodes[near, j] + share * (towards[j] - nodes[near, j])
    if not _edge(arm, nodes[near], nodes[count], places):
        return 0
    before[count] = near
    return 2 if share >= 1.0 else 1


@compiled
def _connect(arm, start, goal, seed, way):  # type: ignore[no-untyped-def]
    """Write a way; return how many angles it has, 0 for none."""
    places = np.empty((len(arm.limbs.link), 3))
    if not _is_free(arm, start, places) or not _is_free(arm, goal, places):
        return 0
    way[0] = start
    if _edge(arm, start, goal, places):
        way[1] = goal
        return 2
    luck = np.array([seed], np.uint64)
    nodes = np.empty((2, _MOST, len(start)))
    before = np.zeros((2, _MOST), np.int64)
    counts = np.ones(2, np.int64)
    nodes[0, 0], nodes[1, 0] = start, goal
    drawn = np.empty(len(start))
    side = 0
    for _ in range(4 * _MOST):
        other = 1 - side
        if counts[side] >= _MOST - 1 or counts[other] >= _MOST - 1:
            return 0
        for j in range(len(start)):
            drawn[j] = arm.chain.low[j] + _draw(luck) * (arm.chain.high[j] - arm.chain.low[j])
        if _grow(arm, nodes[side], before[side], counts[side], drawn, places):
            new = nodes[side, counts[side]]
            counts[side] += 1
            reached = 1
            while reached == 1 and counts[other] < _MOST - 1:
                reached = _grow(arm, nodes[other], before[other], counts[other], new, places)
                if reached:
                    counts[other] += 1
            if reached == 2:
                count = _joined(nodes, before, counts, way)
                return _shortened(arm, way, count, places, luck)
        side = other
    return 0


@compiled
def _joined(nodes, before, counts, way):  # type: ignore[no-untyped-def]
    """Write the way from the first tree's root to the second's through their newest nodes."""
    count, k = 0, counts[0] - 1
    while True:
        way[count] = nodes[0, k]
        count += 1
        if k == 0:
            break
        k = before[0, k]
    for i in range(count // 2):
        for j in range(way.shape[1]):
            way[i, j], way[count - 1 - i, j] = way[count - 1 - i, j], way[i, j]
    k = counts[1] - 1
    while k != 0:  # the newest node of the second tree is that of the first
        k = before[1, k]
        way[count] = nodes[1, k]
        count += 1
    return count


@compiled
def _shortened(arm, way, count, places, luck):  # type: ignore[no-untyped-def]
    for _ in range(_SHORTCUTS):
        if count < 3:
            break
        a = int(_draw(luck) * (count - 2))
        b = a + 2 + int(_draw(luck) * (count - a - 2))
        if _edge(arm, way[a], way[b], places):
            removed = b - a - 1
            for k in range(a + 1, count - removed):
                way[k] = way[k + removed]
            count -= removed
    return count
