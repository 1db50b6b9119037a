"""A trot without learning: feet planned by phase, legs bent by inverse kinematics.

Diagonal legs swing together. A foot on the ground moves backwards as fast as the body is to move forwards; a foot in
the air is put where it will be half a stance ahead of the hip, and further out when the body moves faster than it
should (Raibert, "Legged robots that balance", 1986). Leg lengths on the ground resist roll and pitch.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import FourLegs, RobotModel
from vico.io.compiled import compiled
from vico.sim.physics.records import Motion
from vico.sim.robots.tracking import planar_motion

#: Seconds a cycle lasts and the share of it a foot is on the ground.
CYCLE, STANCE = 0.36, 0.55
#: Height of the hips, and how high a foot swings, metres.
BODY, LIFT = 0.27, 0.055


class LegGeometry(NamedTuple):
    """Lengths of a leg and where its hip is; metres, as in `vico.assets.robots.FourLegs`."""

    hip_x: float
    hip_y: float
    side: float
    thigh: float
    shin: float

    @classmethod
    def of(cls, legs: FourLegs) -> LegGeometry:
        """Return a robot's."""
        return cls(legs.hip_x, legs.hip_y, legs.side, legs.thigh, legs.shin)


@compiled
def leg_angles(x, y, z, side, legs):  # type: ignore[no-untyped-def]
    """Return the angles (hip, thigh, calf) that bring a foot to x, y, z in the frame of its hip.

    `side` is 1 on the left, -1 on the right; `legs` is a `LegGeometry`. Points out of reach are brought to
    the nearest length the leg has.
    """
    across = np.sqrt(max(y * y + z * z - legs.side * legs.side, 1e-6))
    hip = np.arctan2(z, y) + np.arctan2(across, side * legs.side)
    while hip > np.pi:
        hip -= 2 * np.pi
    while hip < -np.pi:
        hip += 2 * np.pi
    reach = min(max(np.sqrt(x * x + across * across), 0.12), legs.thigh + legs.shin - 0.005)
    calf = (
        np.arccos(min(max((legs.thigh**2 + legs.shin**2 - reach * reach) / (2 * legs.thigh * legs.shin), -1.0), 1.0))
        - np.pi
    )
    lean = np.arccos(min(max((legs.thigh**2 + reach * reach - legs.shin**2) / (2 * legs.thigh * reach), -1.0), 1.0))
    return hip, np.arctan2(-x, across) + lean, calf


#: What the gait remembers: the phase; for each leg the foot's x, y and where it left the ground; the smoothed motion.
_PHASE, _FEET, _FOOT_SIZE, _MOTION, _MEMORY = 0, 1, 4, 17, 20
_FOOT_X, _FOOT_Y, _LIFTED_X, _LIFTED_Y = range(4)


@compiled
def trot(memory, command, moving, tilt, legs, dt):  # type: ignore[no-untyped-def]
    """Advance the feet by `dt` and return the twelve joint angles.

    `memory` holds the phase, then for every leg the foot's x, y and where it left the ground (x, y). `command` and
    `moving` are vx, vy, wz wanted and measured; `tilt` is roll, pitch and their rates.
    """
    roll, pitch, roll_rate, pitch_rate = tilt
    memory[_PHASE] = (memory[_PHASE] + dt / CYCLE) % 1.0
    out = np.empty(12)
    hold = STANCE * CYCLE
    for leg in range(4):
        front = 1.0 if leg < 2 else -1.0
        side = 1.0 if leg % 2 == 0 else -1.0
        hx, hy = front * legs.hip_x, side * (legs.hip_y + legs.side)
        first = _FEET + _FOOT_SIZE * leg
        foot = memory[first : first + _FOOT_SIZE]
        phase = (memory[_PHASE] + (0.0 if leg == 0 or leg == 3 else 0.5)) % 1.0
        vx, vy = command[0] - command[2] * hy, command[1] + command[2] * hx
        mx, my = moving[0] - moving[2] * hy, moving[1] + moving[2] * hx
        z = -BODY
        if phase < STANCE:
            foot[_FOOT_X] -= vx * dt
            foot[_FOOT_Y] -= vy * dt
            foot[_LIFTED_X], foot[_LIFTED_Y] = foot[_FOOT_X], foot[_FOOT_Y]
            # Stretch where the body sinks, give way where it rises.
            z += 0.5 * (hy * roll - hx * pitch) + 0.03 * (hy * roll_rate - hx * pitch_rate)
        else:
            s = (phase - STANCE) / (1.0 - STANCE)
            goal_x = 0.5 * hold * vx + 0.03 * (mx - vx)
            goal_y = 0.5 * hold * vy + 0.06 * (my - vy)
            goal_x = min(max(goal_x, -0.16), 0.16)
            goal_y = min(max(goal_y, -0.10), 0.10)
            blend = s * s * (3.0 - 2.0 * s)
            foot[_FOOT_X] = foot[_LIFTED_X] + (goal_x - foot[_LIFTED_X]) * blend
            foot[_FOOT_Y] = foot[_LIFTED_Y] + (goal_y - foot[_LIFTED_Y]) * blend
            z += LIFT * np.sin(np.pi * s)
        hip, thigh, calf = leg_angles(foot[_FOOT_X], foot[_FOOT_Y] + side * legs.side, z, side, legs)
        out[3 * leg], out[3 * leg + 1], out[3 * leg + 2] = hip, thigh, calf
    return out


@compiled
def _trot_all(geometry, limits, motion, command, memory, dt):  # type: ignore[no-untyped-def]
    """Advance the feet of all robots and return their joint angles, shape ``(k, 12)``."""
    rotation, velocity, angular_velocity_body = motion
    low, high = limits
    out = np.empty((len(command), 12))
    for k in range(len(command)):
        r, w = rotation[k], angular_velocity_body[k]
        smoothed = memory[k, _MOTION:_MEMORY]
        moving = planar_motion(r, velocity[k], w)
        for n in range(3):
            smoothed[n] += (moving[n] - smoothed[n]) * (dt / 0.1)
        roll = math.atan2(r[2, 1], r[2, 2])
        pitch = -math.asin(min(max(r[2, 0], -1.0), 1.0))
        wanted = trot(memory[k], command[k], smoothed, (roll, pitch, w[0], w[1]), geometry, dt)
        for n in range(12):
            out[k, n] = min(max(wanted[n], low[n]), high[n])
    return out


class Trot:
    """Our own gait for a model without a policy."""

    #: Phase, the feet, and the body's motion smoothed over a step.
    memory = _MEMORY

    def __init__(self, model: RobotModel) -> None:
        assert isinstance(model.controller, FourLegs)
        self._limits = model.motor_limits
        self._legs = LegGeometry.of(model.controller)
        self._period = model.control_period

    def targets(self, motion: Motion, command: NDArray[np.float64], memory: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joint angles to hold until the next call, shape ``(k, 12)``; parameters as of a controller's."""
        moving = (motion.rotation, motion.velocity, motion.angular_velocity_body)
        found: NDArray[np.float64] = _trot_all(self._legs, self._limits, moving, command, memory, self._period)
        return found
