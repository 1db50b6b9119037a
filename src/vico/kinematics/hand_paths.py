"""Straight paths of an arm's hand: down to an object and up, and with an object over what is in between."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vico.exact import dot
from vico.geometry import quaternion_from_matrix, rotation_matrix
from vico.kinematics.arm import Chain, hand_pose, reach_pose, solve

Array = NDArray[np.float64]

#: Metres the hand comes from above.
ABOVE = 0.14
#: Where the hand carries what it holds, in the base's frame.
CARRY = np.array([0.46, -0.17, 0.78])
_STEP, _TURN = 0.012, 0.1  # metres and radians between two points of a straight way of the hand


def downward(x: Array, along: Array, tilt: float) -> Array:
    """Pose of a hand at a point that points down and opens along a level direction, tilted about that."""
    c, s = math.cos(tilt), math.sin(tilt)
    side = np.array([along[1], -along[0], 0.0])
    z = -c * np.array([0.0, 0.0, 1.0]) + s * side
    y = np.array([along[0], along[1], 0.0])
    return np.column_stack([np.cross(y, z), y, z, x])


def path_down(chain: Chain, now: Array, goals: list[Array], *, holds: bool) -> tuple[Array, int] | None:
    """Return angles to above a pose, down to it and up again, of the first pose that can be reached.

    Parameters
    ----------
    now
        Angles of the arm, rad, shape ``(7,)``.
    goals
        Poses of the hand in the base's frame, shape ``(3, 4)``, the best first.
    holds
        Whether the hand holds something: that is lifted first, then brought over, where the arm can do so.

    Returns
    -------
    tuple or None
        Angles, shape ``(m, 7)``, and at which of them the hand is down; None if no pose can be reached.
    """
    for lifts in (True, False) if holds else (False,):
        for goal in goals:
            above = goal.copy()
            above[2, 3] += ABOVE
            way = path_over(chain, now, above) if lifts else reach_pose(chain, above, now)
            if way is None:
                continue
            before = np.atleast_2d(way)
            down = straight_path(chain, before[-1], above, goal)
            if down is not None:
                return np.concatenate([before, down, down[::-1], before[-1:]]), len(before) + len(down) - 1
    return None


def path_over(chain: Chain, now: Array, above: Array) -> Array | None:
    """Return angles that lift the hand to the height of a pose, and bring it there; None if it can't be gone.

    What the hand holds hangs below it: on the shortest way of the joints it would sweep through what it is put on.
    """
    poses = np.empty((7, 3)), np.empty((7, 3)), np.empty((3, 4))
    hand_pose(chain, now, *poses)
    corners = [poses[2].copy(), poses[2].copy(), above.copy(), above]
    corners[1][2, 3] = corners[2][2, 3] = max(float(poses[2][2, 3]), float(above[2, 3]))
    found, angles = [], now
    for start, end in pairwise(corners):
        part = straight_path(chain, angles, start, end)
        if part is None:
            return None
        found.append(part)
        angles = part[-1]
    return np.concatenate(found)


def straight_path(chain: Chain, angles: Array, start: Array, end: Array) -> Array | None:
    """Angles along a straight way of the hand, shape ``(m, 7)``; None if it can't be gone."""
    first, last = quaternion_from_matrix(start[:, :3]), quaternion_from_matrix(end[:, :3])
    turn = float(dot(first, last))
    last = last if turn >= 0.0 else -last
    turned = 2.0 * math.acos(min(abs(turn), 1.0)) > 1e-3
    count = max(2, math.ceil(float(np.linalg.norm(end[:, 3] - start[:, 3])) / _STEP))
    if turned:
        count = max(count, math.ceil(2.0 * math.acos(min(abs(turn), 1.0)) / _TURN))
    found, now = [], angles.copy()
    for k in range(1, count + 1):
        goal = start + (end - start) * (k / count)
        if turned:
            between = first + (last - first) * (k / count)
            goal[:, :3] = rotation_matrix(between / math.sqrt(float(dot(between, between))))
        before = now.copy()
        if solve(chain, now, goal, 30) > 4e-3 or np.abs(now - before).max() > 0.35:
            return None
        found.append(now.copy())
    return np.array(found)


def path_to_carry(chain: Chain, now: Array) -> Array:
    """Angles from where the arm is to where it carries: straight, or else however the hand points down there."""
    poses = np.empty((7, 3)), np.empty((7, 3)), np.empty((3, 4))
    hand_pose(chain, now, *poses)
    goal = poses[2].copy()
    goal[:, 3] = CARRY
    goal[2, 3] = max(CARRY[2], float(poses[2][2, 3]))
    way = straight_path(chain, now, poses[2], goal)
    if way is not None:
        return way
    turns = np.arange(8) * np.pi / 4
    poses_there = (downward(goal[:, 3], np.array([math.cos(turn), math.sin(turn)]), 0.0) for turn in turns)
    found = [angles for pose in poses_there if (angles := reach_pose(chain, pose, now)) is not None]
    return min(found, key=lambda angles: float(np.abs(angles - now).max()))[None] if found else now[None]
