"""An arm as a chain of joints: where its hand is, which angles bring it to a pose, and its body as balls.

Inverse kinematics is damped least squares from several starts. Balls on the links say what has to stay clear of
everything.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

Array = NDArray[np.float64]

# Of the search for joint angles.
_DAMPING = 0.03
_STEPS = 60  # at most
_LONGEST = 0.25  # step, radians
_STARTS = 12


class Chain(NamedTuple):
    """Joints of an arm, as in `vico.assets.robots.MobileManipulator`."""

    places: Array
    axes: Array
    low: Array
    high: Array
    grip: float


@compiled
def joint_origin(chain, k, r, p):
    """Move on from joint `k` - 1 to where joint `k` is; `r` and `p` are what has been reached of the chain."""
    for i in range(3):
        step = 0.0
        for j in range(3):
            step += r[i, j] * chain.places[k, j]
        p[i] += step


@compiled
def joint_turn(chain, k, angle, r):
    """Turn what has been reached of the chain about joint `k`."""
    c, s = math.cos(angle), math.sin(angle)
    for i in range(3):
        a, b, d = r[i, 0], r[i, 1], r[i, 2]
        if chain.axes[k, 2] > 0.5:  # about z
            r[i, 0], r[i, 1] = c * a + s * b, c * b - s * a
        else:  # about y
            r[i, 0], r[i, 2] = c * a - s * d, s * a + c * d


@compiled
def hand_pose(chain, angles, origins, directions, out):
    """Write the hand's rotation (columns 0-2) and position (column 3) in the base's frame, and each joint's place."""
    r = np.eye(3)
    p = np.zeros(3)
    for k in range(len(angles)):
        joint_origin(chain, k, r, p)
        for i in range(3):
            origins[k, i] = p[i]
            directions[k, i] = r[i, 0] * chain.axes[k, 0] + r[i, 1] * chain.axes[k, 1] + r[i, 2] * chain.axes[k, 2]
        joint_turn(chain, k, angles[k], r)
    for i in range(3):
        out[i, :3] = r[i]
        out[i, 3] = p[i] + r[i, 2] * chain.grip


@compiled
def hand_error(pose, goal, error):
    """Write what is left to a pose, metres and radians; return both summed."""
    for i in range(3):
        error[i] = goal[i, 3] - pose[i, 3]
        error[3 + i] = 0.0
    for axis in range(3):
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            error[3 + i] += 0.5 * (pose[j, axis] * goal[k, axis] - pose[k, axis] * goal[j, axis])
    left = math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
    left += math.sqrt(error[3] ** 2 + error[4] ** 2 + error[5] ** 2)
    return left


@compiled
def hand_jacobian(pose, origins, directions, out):
    """Write how the hand moves and turns with each joint, shape ``(6, n)``."""
    for k in range(len(origins)):
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            out[i, k] = directions[k, a] * (pose[b, 3] - origins[k, b]) - directions[k, b] * (
                pose[a, 3] - origins[k, a]
            )
            out[3 + i, k] = directions[k, i]


@compiled
def damped_step(jacobian, error, change):
    """Write J^T (J J^T + d^2)^-1 error: by Cholesky's factors, in one order everywhere."""
    n = jacobian.shape[1]
    lower, half = np.zeros((6, 6)), np.empty(6)
    for i in range(6):
        for j in range(i + 1):
            total = _DAMPING**2 if i == j else 0.0
            for k in range(n):
                total += jacobian[i, k] * jacobian[j, k]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = math.sqrt(total) if i == j else total / lower[j, j]
    for i in range(6):
        total = error[i]
        for k in range(i):
            total -= lower[i, k] * half[k]
        half[i] = total / lower[i, i]
    for i in range(5, -1, -1):
        total = half[i]
        for k in range(i + 1, 6):
            total -= lower[k, i] * half[k]
        half[i] = total / lower[i, i]
    for k in range(n):
        total = 0.0
        for i in range(6):
            total += jacobian[i, k] * half[i]
        change[k] = total


@compiled
def solve(chain, angles, goal, steps):
    """Bring the hand nearer to a pose, in place; return what is left, metres and radians summed."""
    n = len(angles)
    origins, directions, pose = np.empty((n, 3)), np.empty((n, 3)), np.empty((3, 4))
    jacobian, error, change = np.empty((6, n)), np.empty(6), np.empty(n)
    left = 1e9
    for _ in range(steps):
        hand_pose(chain, angles, origins, directions, pose)
        left = hand_error(pose, goal, error)
        if left < 1e-4:
            break
        hand_jacobian(pose, origins, directions, jacobian)
        damped_step(jacobian, error, change)
        most = np.abs(change).max()
        share = min(1.0, _LONGEST / most) if most > 0.0 else 0.0
        for k in range(n):
            angles[k] = min(max(angles[k] + share * change[k], chain.low[k]), chain.high[k])
    return left


def reach_pose(chain: Chain, goal: Array, near: Array) -> Array | None:
    """Return angles that bring the hand to a pose in the base's frame, shape ``(3, 4)``; None if none are found.

    The first start is `near`; of several solutions the nearest to it counts.
    """
    stream = np.random.Generator(np.random.PCG64(7))
    best: tuple[float, Array] | None = None
    for start in range(_STARTS):
        angles = near.copy() if start == 0 else stream.uniform(0.7 * chain.low, 0.7 * chain.high)
        if solve(chain, angles, goal, _STEPS) < 2e-3:
            far = float(np.abs(angles - near).max())
            if best is None or far < best[0]:
                best = far, angles
    return None if best is None else best[1]


class CollisionSpheres(NamedTuple):
    """Balls that cover an arm.

    Attributes
    ----------
    link
        Joint that moves each, int64, shape ``(n,)``; they are in order.
    centre
        In that joint's frame, metres, shape ``(n, 3)``.
    radius
        Metres, shape ``(n,)``.
    """

    link: NDArray[np.int64]
    centre: Array
    radius: Array


class Jaw(NamedTuple):
    """Size of a parallel jaw, metres, in the frame of the last joint: it opens along y, its pads lie along z.

    Attributes
    ----------
    palm
        Half its width, and how far it is from the joint.
    pads
        From where to where the fingers reach.
    thickness
        Radius of balls that cover palm and fingers.
    """

    palm: tuple[float, float] = (0.17, 0.045)
    pads: tuple[float, float] = (0.06, 0.19)
    thickness: float = 0.028


def collision_spheres(chain: Chain, radii: Array, *, jaw: Jaw, opening: float) -> CollisionSpheres:
    """Cover an arm with balls.

    Parameters
    ----------
    radii
        Of each link, metres, shape ``(n,)``.
    jaw
        At its end.
    opening
        Of each finger off the middle, metres.
    """
    found: list[tuple[int, Array, float]] = []
    count = len(chain.places)
    for k in range(count - 1):
        end, radius = chain.places[k + 1], float(radii[k])
        found += [(k, point, radius) for point in _along(np.zeros(3), end, radius)]
    wide, at = jaw.palm
    reach = wide - jaw.thickness
    balls = _along(np.array([0.0, -reach, at]), np.array([0.0, reach, at]), jaw.thickness)
    for side in (-1.0, 1.0):
        finger = [np.array([0.0, side * (opening + jaw.thickness * 0.5), z]) for z in jaw.pads]
        balls += _along(finger[0], finger[1] - np.array([0.0, 0.0, jaw.thickness]), jaw.thickness)
    found += [(count - 1, point, jaw.thickness) for point in balls]
    found.sort(key=lambda one: one[0])
    return CollisionSpheres(
        np.array([one[0] for one in found], np.int64),
        np.array([one[1] for one in found]),
        np.array([one[2] for one in found]),
    )


def with_held_object(limbs: CollisionSpheres, points: Array, radius: float) -> CollisionSpheres:
    """Return limbs with a held thing on the last link.

    Parameters
    ----------
    points
        All over the thing, in the frame of the last joint, metres, shape ``(m, 3)``.
    radius
        Of the balls there, metres.
    """
    last = int(limbs.link[-1])
    return CollisionSpheres(
        np.concatenate([limbs.link, np.full(len(points), last)]),
        np.concatenate([limbs.centre, points]),
        np.concatenate([limbs.radius, np.full(len(points), radius)]),
    )


def box_points(half: Array, spacing: float) -> Array:
    """Return points on the faces of a box about the origin, no farther apart than told, shape ``(m, 3)``."""
    counts = np.maximum(np.ceil(2.0 * half / spacing).astype(int), 1)
    steps = [np.linspace(-half[k], half[k], counts[k] + 1) for k in range(3)]
    points = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    return points[(np.abs(np.abs(points) - half) < 1e-9).any(axis=1)]


def _along(start: Array, end: Array, radius: float) -> list[Array]:
    """Return points on a line, no farther apart than balls of a radius cover well."""
    count = max(math.ceil(float(np.linalg.norm(end - start)) / (1.2 * radius)), 1)
    return [start + (end - start) * k / count for k in range(count + 1)]


@compiled
def sphere_positions(chain, limbs, angles, out):
    """Write where an arm's balls are in the base's frame, metres, shape ``(n, 3)``."""
    r = np.eye(3)
    p = np.zeros(3)
    ball = 0
    for k in range(len(angles)):
        joint_origin(chain, k, r, p)
        joint_turn(chain, k, angles[k], r)
        while ball < len(limbs.link) and limbs.link[ball] == k:
            for i in range(3):
                out[ball, i] = (
                    p[i]
                    + r[i, 0] * limbs.centre[ball, 0]
                    + r[i, 1] * limbs.centre[ball, 1]
                    + r[i, 2] * limbs.centre[ball, 2]
                )
            ball += 1
