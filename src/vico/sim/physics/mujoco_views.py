"""Reading the motion of robots out of MuJoCo's arrays, and writing poses into them, of many at once."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.physics.movers import moved_poses
from vico.sim.physics.mujoco_model import PARKED, PARKED_APART
from vico.sim.physics.solids import SLACK, find_near, is_clear


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


@compiled
def begin_frame(frame, known, state, solids, links, movers, mocap):  # type: ignore[no-untyped-def]
    """Say which links could touch something solid in a frame, and move people and vehicles on to its end.

    Parameters
    ----------
    frame
        Its length, seconds.
    known
        Seconds since the poses and velocities of `links` were computed; negative: they are of another state.
    state
        Positions and speeds, where in them each robot's base begins, and where to put the velocities of bases.
    solids
        As `SolidCells.cells`, reaches of the robots, and `near`, which is written: of which robots links might meet
        solids, bool, shape ``(robots,)``.
    links
        As `CompiledScene.link_parts`; positions of bodies, their velocities about the centres of their robots'
        masses and those centres, as MuJoCo has them; and what is written: which links might meet solids, bool.
    movers
        Entities, poses at the beginning and at the end of the motion, and seconds of it that have passed.
    mocap
        Which kinematic body each is, and where positions and quaternions of those are.
    """
    positions, speeds, first, before = state
    cells, reach, near = solids
    find_near(cells, reach, frame, (positions, speeds, first), near)
    for k in range(len(first)):
        for i in range(3):
            before[k, i] = speeds[first[k, 1] + i]
    owner, body, radius, root, places, motion, centre, meets = links
    for k in range(len(owner)):
        meets[k] = near[owner[k]]
        if known < 0.0 or not meets[k]:
            continue
        b = body[k]
        wx, wy, wz, vx, vy, vz = motion[b]
        x, y, z = places[b]
        ax, ay, az = x - centre[root[k], 0], y - centre[root[k], 1], z - centre[root[k], 2]
        vx, vy, vz = vx + wy * az - wz * ay, vy + wz * ax - wx * az, vz + wx * ay - wy * ax
        speed = math.sqrt(vx * vx + vy * vy + vz * vz) + math.sqrt(wx * wx + wy * wy + wz * wz) * radius[k]
        if 2.0 * speed * (frame + known) < SLACK:
            meets[k] = not is_clear(cells, (x, y, z), radius[k] + SLACK)
    entity, start, end, time = movers
    if time[0] < time[1] - 1e-9 and entity.any():
        time[0] += frame
        poses = moved_poses(start, end, time)
        place_bodies(poses, entity, mocap[0], mocap[1], mocap[2])


def solved_contacts(data: Any) -> NDArray[np.float64]:
    """Shapes (2), position (3), normal (3) and force of the contacts that the last step solved, shape ``(n, 9)``."""
    contact, solved = data.contact, np.asarray(data.contact.efc_address) >= 0
    found = np.empty((int(solved.sum()), 9))
    found[:, :2] = np.asarray(contact.geom)[solved]
    found[:, 2:5] = np.asarray(contact.pos)[solved]
    found[:, 5:8] = np.asarray(contact.frame)[solved, :3]
    # The first row of an elliptic or frictionless contact is its normal force.
    found[:, 8] = data.efc_force[np.asarray(contact.efc_address)[solved]]
    return found
