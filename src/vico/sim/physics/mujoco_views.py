"""Reading the motion of robots out of MuJoCo's arrays, and writing poses into them, of many at once."""

from __future__ import annotations

import math

import numpy as np

from vico.io.compiled import compiled
from vico.sim.physics.mujoco_model import PARKED, PARKED_APART


@compiled
def base_motion(positions, speeds, first):  # type: ignore[no-untyped-def]
    """Return the motion of bases.

    Parameters
    ----------
    positions, speeds
        All coordinates, as MuJoCo orders them.
    first
        Where those of each base begin, shape ``(k, 2)``.

    Returns
    -------
    tuple of ndarray
        Position, rotation, velocity, angular velocity in the base's frame and quaternion, as `Base` has them; row =
        base.
    """
    n = len(first)
    position, quaternion, rotation = np.empty((n, 3)), np.empty((n, 4)), np.empty((n, 3, 3))
    velocity, angular_velocity_body = np.empty((n, 3)), np.empty((n, 3))
    for k in range(n):
        q, v = first[k, 0], first[k, 1]
        for i in range(3):
            position[k, i] = positions[q + i]
            velocity[k, i], angular_velocity_body[k, i] = speeds[v + i], speeds[v + 3 + i]
        w, x, y, z = positions[q + 3], positions[q + 4], positions[q + 5], positions[q + 6]
        quaternion[k] = w, x, y, z
        rotation[k, 0] = w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
        rotation[k, 1] = 2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)
        rotation[k, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z
    return position, rotation, velocity, angular_velocity_body, quaternion


@compiled
def motion_of(positions, speeds, first, angle, rate):  # type: ignore[no-untyped-def]
    """Return what `Motion` holds of robots of one kind, in its order.

    Parameters
    ----------
    angle, rate
        Where positions and speeds of the joints are, shape ``(k, joints)``; the rest is as for `base_motion`.
    """
    position, rotation, velocity, angular_velocity_body, _ = base_motion(positions, speeds, first)
    angles, rates = np.empty(angle.shape), np.empty(rate.shape)
    for k in range(angle.shape[0]):
        for j in range(angle.shape[1]):
            angles[k, j], rates[k, j] = positions[angle[k, j]], speeds[rate[k, j]]
    return position, velocity, rotation, angular_velocity_body, angles, rates


@compiled
def place_bodies(poses, entity, where, positions, quaternions):  # type: ignore[no-untyped-def]
    """Put kinematic bodies at their poses (middle and yaw), and those that are nobody (entity 0) out of the way."""
    for k in range(len(poses)):
        body = where[k]
        if entity[k]:
            positions[body] = poses[k, :3]
            quaternions[body] = math.cos(poses[k, 3] / 2), 0.0, 0.0, math.sin(poses[k, 3] / 2)
        else:
            positions[body] = PARKED_APART * k, 0.0, PARKED
            quaternions[body] = 1.0, 0.0, 0.0, 0.0
