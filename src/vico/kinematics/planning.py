"""Motion planning of an arm: paths that touch nothing, by RRT-Connect (Kuffner and LaValle, 2000) in joint space.

What stands around an arm is a grid of distances to what was seen, and to the robot's own base. Angles that bring a hand
to a pose keep the arm near a posture and off everything.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vico.io.compiled import compiled
from vico.kinematics.arm import (
    Chain,
    CollisionSpheres,
    damped_step,
    hand_error,
    hand_jacobian,
    hand_pose,
    sphere_positions,
)
from vico.seeds import rng

Array = NDArray[np.float64]


class DistanceGrid(NamedTuple):
    """Distances around a base, in its frame.

    Attributes
    ----------
    distance
        Metres from the cells' centres to the nearest thing, at most `FAR`, float32, shape ``(nx, ny, nz)``.
    low
        Corner of the grid, metres.
    cell
        Side of a cell, metres.
    posts
        The base itself: x, y, radius and top of upright cylinders, metres, shape ``(p, 4)``.
    """

    distance: NDArray[np.float32]
    low: Array
    cell: float
    posts: Array


#: Distances are no larger; nothing is known beyond the grid, so it is free.
FAR = 1.0
#: What an arm of about a metre reaches, metres.
LOW, HIGH, CELL = np.array([-0.6, -1.1, -0.2]), np.array([1.3, 1.1, 1.6]), 0.025
# Balls of links below this one belong to the torso, which the base carries.
_FIRST_FREE = 2


def distance_grid(points: Array, posts: Array, *, ground: float | None = None) -> DistanceGrid:
    """Make the room of points that were seen.

    Parameters
    ----------
    points
        In the base's frame, metres, shape ``(n, 3)``; what lies beyond the grid is left out.
    posts
        See `Room`.
    ground
        Height of level ground below which all is taken to be solid; None where it was seen.
    """
    shape = np.ceil((HIGH - LOW) / CELL).astype(int)
    free = np.ones(shape, bool)
    cells = np.floor((points - LOW) / CELL).astype(np.int64)
    cells = cells[((cells >= 0) & (cells < shape)).all(axis=1)]
    free[cells[:, 0], cells[:, 1], cells[:, 2]] = False
    if ground is not None:
        free[:, :, : max(int(np.floor((ground - LOW[2]) / CELL)), 0)] = False
    if free.all():
        distance = np.full(shape, FAR, np.float32)
    else:
        # A point lies anywhere in its cell.
        far = ndimage.distance_transform_edt(free, sampling=CELL) - CELL / 2
        distance = np.clip(far, 0.0, FAR).astype(np.float32)
    return DistanceGrid(distance, LOW.copy(), CELL, np.asarray(posts, np.float64).reshape(-1, 4))


@compiled
def clearance(room, limbs, places, enough):
    """Return how far an arm's balls are from everything, metres; once less than enough is found, that.

    Parameters
    ----------
    places
        Of the balls, shape ``(n, 3)``.
    """
    least = 1e9
    shape = room.distance.shape
    for k in range(len(places)):
        at = np.empty(3, np.int64)
        inside = True
        for i in range(3):
            at[i] = int(np.floor((places[k, i] - room.low[i]) / room.cell))
            inside = inside and at[i] >= 0 and at[i] < shape[i]
        if inside:
            least = min(least, room.distance[at[0], at[1], at[2]] - limbs.radius[k])
        if limbs.link[k] > _FIRST_FREE:
            for p in range(len(room.posts)):
                aside = np.sqrt((places[k, 0] - room.posts[p, 0]) ** 2 + (places[k, 1] - room.posts[p, 1]) ** 2)
                aside -= room.posts[p, 2]
                above = places[k, 2] - room.posts[p, 3]
                if above > 0.0 and aside > 0.0:
                    aside = np.sqrt(aside * aside + above * above)
                else:
                    aside = max(aside, above)
                least = min(least, aside - limbs.radius[k])
        if least < enough:
            return least
    return least


def empty_distance_grid(posts: Array) -> DistanceGrid:
    """Return a room with nothing in it but the base."""
    return distance_grid(np.zeros((0, 3)), posts)


def obstacle_distance(room: DistanceGrid, limbs: CollisionSpheres, places: Array) -> float:
    """Return how far an arm's balls are from everything, metres."""
    return float(clearance(room, limbs, places, -1e9))


_LOOK = 0.06  # between two looks along a way, radians
_STEP = 0.35  # between two nodes of a tree, radians
_MOST = 1500  # nodes of a tree
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
    limbs: CollisionSpheres
    room: DistanceGrid
    gap: float = 0.0


def is_free(arm: Arm, angles: Array) -> bool:
    """Return whether an arm touches nothing at some angles."""
    return bool(_is_free(arm, angles, np.empty((len(arm.limbs.link), 3))))


def is_path_free(arm: Arm, way: Array) -> bool:
    """Return whether an arm touches nothing all along a way, angles, shape ``(m, n)``."""
    places = np.empty((len(arm.limbs.link), 3))
    return is_free(arm, way[0]) and all(bool(_edge(arm, a, b, places)) for a, b in pairwise(way))


def plan_path(arm: Arm, start: Array, goal: Array, *, seed: int = 0) -> Array | None:
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
def _draw(luck):
    """Return a number from 0 to 1 (splitmix64: Steele, Lea and Flood, 2014)."""
    luck[0] += np.uint64(0x9E3779B97F4A7C15)
    z = luck[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return np.float64(z >> np.uint64(11)) / 9007199254740992.0


@compiled
def _is_free(arm, angles, places):
    sphere_positions(arm.chain, arm.limbs, angles, places)
    return clearance(arm.room, arm.limbs, places, arm.gap) >= arm.gap


@compiled
def _edge(arm, start, end, places):
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
def _nearest(nodes, count, angles):
    best, found = 1e18, 0
    for k in range(count):
        away = 0.0
        for j in range(len(angles)):
            away += (nodes[k, j] - angles[j]) ** 2
        if away < best:
            best, found = away, k
    return found


@compiled
def _grow(arm, nodes, before, count, towards, places):
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
def _connect(arm, start, goal, seed, way):
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
                count = _join_trees(nodes, before, counts, way)
                return _shorten(arm, way, count, places, luck)
        side = other
    return 0


@compiled
def _join_trees(nodes, before, counts, way):
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
def _shorten(arm, way, count, places, luck):
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


_STEPS = 80  # at most
_LONGEST = 0.25  # step, radians
_STARTS = 12
# Share of what is left to the posture that a step takes; exact enough, metres and radians summed.
_DRAWN, _EXACT = 0.15, 2e-3


def collision_free_reach(
    arm: Arm, goals: Sequence[Array], near: Array, *, posture: Array | None = None
) -> tuple[Array, int] | None:
    """Return angles that bring the hand to one of some poses and touch nothing, and which pose it is.

    The poses are tried in order; each from `near`, from the posture, and from starts drawn for it. Of the solutions
    of a pose the nearest to `near` counts.

    Parameters
    ----------
    goals
        Of the hand in the base's frame, shape ``(3, 4)``, the best first.
    near
        Angles the arm has, rad.
    posture
        Angles it is drawn to where the hand leaves it a choice; None for the middle of its bounds.
    """
    chain = arm.chain
    drawn = (chain.low + chain.high) / 2 if posture is None else posture
    for number, goal in enumerate(goals):
        stream = rng(0, "inverse kinematics")
        best: tuple[float, Array] | None = None
        for start in range(_STARTS):
            angles = (
                near.copy()
                if start == 0
                else drawn.copy()
                if start == 1
                else stream.uniform(0.8 * chain.low, 0.8 * chain.high)
            )
            if solve_near(chain, angles, goal, drawn, _STEPS) > _EXACT or not is_free(arm, angles):
                continue
            far = float(np.abs(angles - near).max())
            if best is None or far < best[0]:
                best = far, angles
        if best is not None:
            return best[1], number
    return None


@compiled
def solve_near(chain, angles, goal, posture, steps):
    """Bring the hand to a pose and the joints towards a posture, in place; return what is left, metres plus radians.

    Damped least squares; the pull to the posture is in the null space of the hand's motion, and within the bounds.
    """
    n = len(angles)
    origins, directions, pose = np.empty((n, 3)), np.empty((n, 3)), np.empty((3, 4))
    jacobian, error, change = np.empty((6, n)), np.empty(6), np.empty(n)
    pull, felt, back = np.empty(n), np.empty(6), np.empty(n)
    left = 1e9
    for step in range(steps):
        hand_pose(chain, angles, origins, directions, pose)
        left = hand_error(pose, goal, error)
        # Half a turn off there is no error that leads back.
        if left < 1e-4 and pose[0, 0] * goal[0, 0] + pose[1, 0] * goal[1, 0] + pose[2, 0] * goal[2, 0] < 0.0:
            return 1e9
        if left < 1e-4 and step > steps // 2:
            break
        hand_jacobian(pose, origins, directions, jacobian)
        damped_step(jacobian, error, change)
        # In the last steps the hand alone counts.
        share = _DRAWN if step < steps // 2 else 0.0
        for k in range(n):
            pull[k] = share * (posture[k] - angles[k])
        for i in range(6):
            felt[i] = 0.0
            for k in range(n):
                felt[i] += jacobian[i, k] * pull[k]
        damped_step(jacobian, felt, back)
        most = 0.0
        for k in range(n):
            change[k] += pull[k] - back[k]
            most = max(most, abs(change[k]))
        scale = min(1.0, _LONGEST / most) if most > 0.0 else 0.0
        for k in range(n):
            angles[k] = min(max(angles[k] + scale * change[k], chain.low[k]), chain.high[k])
    return left
