"""Four legs: a walking policy or a trot, standing, and getting up again, of all robots of a kind at once.

A walking policy is a trained network: observations in, joint targets out, with the same bits on every run.

The trot needs no learning: feet are planned by phase, legs bent by inverse kinematics. Diagonal legs swing together.
A foot on the ground moves backwards as fast as the body is to move forwards; a foot in the air is put where it will be
half a stance ahead of the hip, and further out when the body moves faster than it should (Raibert, "Legged robots that
balance", 1986). Leg lengths on the ground resist roll and pitch.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import FourLegs, RobotModel
from vico.io.compiled import compiled
from vico.sim.physics.records import Base, Motion
from vico.sim.robots.controller import (
    TRIM_SIZE,
    Array,
    Gains,
    MotorController,
    TrimSettings,
    approach,
    planar_motion,
    trim_command,
)

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
def leg_angles(x, y, z, side, legs):
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


# What the gait remembers.
_PHASE = 0  # 0..1
_FEET = 1  # for each leg the foot's x and y, and where it left the ground, metres
_FOOT_SIZE = 4
_MOTION = _FEET + 4 * _FOOT_SIZE  # the smoothed motion: vx, vy, wz
_MEMORY = _MOTION + 3
_FOOT_X, _FOOT_Y, _LIFTED_X, _LIFTED_Y = range(4)


@compiled
def trot(memory, command, moving, tilt, legs, dt):
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
def _trot_all(geometry, limits, motion, command, memory, dt):
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


# Scales of the observation and its limit, from the policy's deployment configuration.
_SPIN = 0.25  # of angular velocities, rad/s
_JOINT_SPEED = 0.05  # of the joints' speeds, rad/s
_LIMIT = 100.0


@compiled
def _elu(values):
    """Replace what is negative by exp(x) - 1, to 3e-7 of it.

    A polynomial for x / 64, doubled six times: without a branch or a call, so that all of it is vectorised.
    """
    one, two = np.float32(1.0), np.float32(2.0)
    for i in range(len(values)):
        x = max(min(values[i], np.float32(0.0)), np.float32(-20.0)) * np.float32(1.0 / 64.0)
        e = one + x * (np.float32(1 / 2) + x * (np.float32(1 / 6) + x * (np.float32(1 / 24) + x * np.float32(1 / 120))))
        e = x * e
        e = e * (e + two)
        e = e * (e + two)
        e = e * (e + two)
        e = e * (e + two)
        e = e * (e + two)
        e = e * (e + two)
        values[i] = max(values[i], np.float32(0.0)) + e


@compiled
def dense_layer(inputs, weights, bias, last):
    """One layer of all robots, shape ``(k, outputs)``.

    Summed input by input: vectorised over outputs, in one order whatever the machine's BLAS and however many robots.
    """
    out = np.empty((len(inputs), len(bias)), np.float32)
    for k in range(len(inputs)):
        x, sums = inputs[k], out[k]
        sums[:] = bias
        # Four inputs at a time, so that sums are read and written a quarter as often.
        whole = len(x) - len(x) % 4
        for j in range(0, whole, 4):
            for i in range(len(sums)):
                first = sums[i] + weights[j, i] * x[j] + weights[j + 1, i] * x[j + 1]
                sums[i] = first + weights[j + 2, i] * x[j + 2] + weights[j + 3, i] * x[j + 3]
        for j in range(whole, len(x)):
            for i in range(len(sums)):
                sums[i] += weights[j, i] * x[j]
        if not last:
            _elu(sums)
    return out


# Where the parts of the policy's observation begin.
_ANGULAR_VELOCITY = 0
_GRAVITY = 3
_OBSERVED_COMMAND = 6
_ANGLES = 9  # relative to the pose at rest
_SPEEDS = 21
_ACTION = 33  # the last one
_OBSERVED = 45


@compiled
def _evaluate(layers, motion, command, memory, pose):
    """Return joint targets in the model's order, shape ``(k, 12)``; `memory` becomes the actions."""
    order, rest, scale = pose
    rotation, angular_velocity_body, angles, speeds = motion
    seen = np.empty((len(command), _OBSERVED))
    for robot in range(len(command)):
        for k in range(3):
            seen[robot, _ANGULAR_VELOCITY + k] = angular_velocity_body[robot, k] * _SPIN
            seen[robot, _GRAVITY + k] = -rotation[robot, 2, k]
            seen[robot, _OBSERVED_COMMAND + k] = command[robot, k]
        for k in range(12):
            seen[robot, _ANGLES + k] = angles[robot, order[k]] - rest[k]
            seen[robot, _SPEEDS + k] = speeds[robot, order[k]] * _JOINT_SPEED
            seen[robot, _ACTION + k] = memory[robot, k]
    x = np.minimum(np.maximum(seen, -_LIMIT), _LIMIT).astype(np.float32)
    for index in range(len(layers)):
        x = dense_layer(x, layers[index][0], layers[index][1], index == len(layers) - 1)
    out = np.empty((len(seen), 12))
    for robot in range(len(seen)):
        for k in range(12):
            memory[robot, k] = min(max(np.float64(x[robot, k]), -_LIMIT), _LIMIT)
            out[robot, order[k]] = rest[k] + memory[robot, k] * scale[k]
    return out


class WalkingPolicy:
    """Go2's trained gait. It has no memory but its last action, which its owner keeps.

    Parameters
    ----------
    model
        A robot with a policy.
    """

    #: Numbers of memory: the last action.
    memory = 12

    def __init__(self, model: RobotModel) -> None:
        assert isinstance(model.controller, FourLegs)
        policy = model.controller.policy
        assert policy is not None
        self._pose = (policy.order, policy.rest, policy.scale)
        self._layers = tuple(
            (np.array(w.T, np.float32, order="C"), np.array(b, np.float32))
            for w, b in zip(policy.weights, policy.biases, strict=True)
        )

    def targets(self, motion: Motion, command: NDArray[np.float64], memory: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joint angles to hold until the next call, shape ``(k, 12)``; all robots in one batch.

        Parameters
        ----------
        motion
            Of the robots, row = robot.
        command
            vx, vy, metres a second in the base's frame, and radians a second to the left, shape ``(k, 3)``.
        memory
            The last actions, shape ``(k, 12)``; updated in place.
        """
        moving = (motion.rotation, motion.angular_velocity_body, motion.angles, motion.speeds)
        found: NDArray[np.float64] = _evaluate(self._layers, moving, command, memory, self._pose)
        return found


# What legs remember: the command as far as it was let through, seconds without one, the joint angles held, the trim,
# and the gait's memory.
_COMMAND = slice(0, 3)
_IDLE = 3
_HELD = slice(4, 16)
_TRIM = slice(16, 16 + TRIM_SIZE)
_GAIT = _TRIM.stop


class LegGait(Protocol):
    """Joint targets of robots that walk."""

    memory: int

    def targets(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Joint angles to hold until the next call, shape ``(k, 12)``; parameters as of a controller's."""


class LegSettings(NamedTuple):
    """How legs begin and cease to walk.

    Attributes
    ----------
    trim
        Of the velocity.
    slew
        What the command may change by in one period, m/s and rad/s, shape ``(3,)``.
    patience
        Seconds without a command after which they stop stepping.
    ease
        Radians a joint moves in one period while they stop, shape ``(12,)``.
    rest
        Joint angles they stand at, shape ``(12,)``.
    period
        Seconds between two calls.
    """

    trim: TrimSettings
    slew: NDArray[np.float64]
    patience: float
    ease: NDArray[np.float64]
    rest: NDArray[np.float64]
    period: float


@compiled
def _stand_or_walk(settings, motion, angles, command, memory, wanted):
    """Decide whether each robot walks; move those that stand towards rest, and set `wanted` of those that walk.

    Parameters
    ----------
    motion
        Rotation, velocity and angular velocity of the bases.
    wanted
        Velocity that a gait is to follow, shape ``(k, 3)``; written.
    """
    rotation, velocity, angular_velocity_body = motion
    walks = np.zeros(len(command), np.bool_)
    for k in range(len(command)):
        now, held, trim, gait = memory[k, _COMMAND], memory[k, _HELD], memory[k, _TRIM], memory[k, _GAIT:]
        approach(now, command[k], settings.slew)
        memory[k, _IDLE] = 0.0 if command[k].any() or now.any() else memory[k, _IDLE] + settings.period
        if memory[k, _IDLE] > settings.patience or not held.any():
            # From where the legs are, not from where softer servos were told to be: that would make it jump.
            if gait.any() or not held.any():
                held[:] = angles[k]
                memory[k, _IDLE] = settings.patience + settings.period
            trim[:] = 0.0
            gait[:] = 0.0
            approach(held, settings.rest, settings.ease)
        else:
            walks[k] = True
            moving = planar_motion(rotation[k], velocity[k], angular_velocity_body[k])
            wanted[k] = trim_command(settings.trim, moving, now, trim)
    return walks


class Legs(MotorController):
    """Four legs: walk while there is a velocity to follow, stand otherwise, and get up where they fell."""

    def __init__(self, model: RobotModel) -> None:
        super().__init__(model)
        assert isinstance(model.controller, FourLegs)
        c, period = model.controller, model.control_period
        self._gait: LegGait = WalkingPolicy(model) if c.policy is not None else Trot(model)
        if c.policy is not None:
            rest = np.asarray(model.rest, np.float64)
        else:
            legs = LegGeometry.of(c)
            rest = np.concatenate([leg_angles(0.0, s * legs.side, -BODY, s, legs) for s in (1.0, -1.0, 1.0, -1.0)])
        self._settings = LegSettings(
            TrimSettings(np.array((1.0, 1.0, 1.5)), np.array((0.35, 0.25, 0.5)), 0.3, period),
            np.array([2.5, 2.0, 5.0]) * period,
            0.6,
            np.full(12, 1.5 * period),
            rest,
            period,
        )
        self.memory = _GAIT + self._gait.memory
        self._gait_gains = c.gait_gains
        self._policy_gains = c.policy_gains if c.policy is not None else c.gait_gains
        self.command_gains = c.policy_gains if c.policy is not None else None

    def targets(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Joint angles, rad."""
        wanted = np.zeros((len(motion), 3))
        moving = (motion.rotation, motion.velocity, motion.angular_velocity_body)
        walking = _stand_or_walk(self._settings, moving, motion.angles, command, memory, wanted)
        if walking.all():
            gait = memory[:, _GAIT:].copy()
            memory[:, _HELD] = self._gait.targets(motion, wanted, gait)
            memory[:, _GAIT:] = gait
        elif walking.any():
            walks = walking.nonzero()[0]
            gait = memory[walks, _GAIT:]
            memory[walks, _HELD] = self._gait.targets(motion.where(walks), wanted[walks], gait)
            memory[walks, _GAIT:] = gait
        return memory[:, _HELD].copy()

    def gains(self, memory: Array) -> list[Gains | None]:
        """Soft where the policy expects it, stiff to stand and for our own gait."""
        walking = (memory[:, _IDLE] <= self._settings.patience).tolist()
        return [self._policy_gains if walks else self._gait_gains for walks in walking]

    def lying_targets(self, lying: float, base: Base) -> tuple[Array, Gains | None] | None:
        """Get up."""
        legs = get_up_targets(lying, base, self.model.rest)
        return (self.model.rest if legs is None else np.clip(legs, *self.model.motor_limits)), self._gait_gains

    def stands(self, lying: float, base: Base, angles: Array, above_ground: float) -> bool:
        """Return whether it is the end of an attempt to get up that brought the robot onto its feet."""
        bent = float(np.abs(angles - self.model.rest).max())
        calm = np.abs(base.angular_velocity_body).max() < 0.5
        high = above_ground > 0.6 * self.model.stand
        return bool(high and calm and bent < 0.4 and get_up_targets(lying, base, self.model.rest) is None)


#: Angles of a leg drawn in below the body: hip (outward positive), thigh, calf.
FOLDED = np.array([0.0, 1.4, -2.65])
# Lying on its back, the legs of one side and of the other; lying on a side, the legs below and above. Found by random
# search in simulation over both models and seven ways to lie, the score being how soon all of them are up.
_ON_BACK = np.array([[0.98, 3.3, -1.9], [-0.71, 2.81, -1.8]])
_ON_SIDE = np.array([[-0.83, 3.32, -1.89], [0.0, 1.41, -1.56]])
_TRY = 3.0  # s that an attempt to get up lasts
_PUSH = 0.5  # s from its beginning at which the legs begin to push ...
_PULL = 2.06  # ... and cease to


def get_up_targets(lying: float, base: Base, rest: Array) -> Array | None:
    """Return what a fallen robot's legs do `lying` seconds after it fell; None once it should stand.

    It draws its legs in. On its belly it rises. On its back or side it throws the legs out against the ground, again
    and again, sides in turn.
    """
    folded = np.tile(FOLDED, 4)
    turn, phase = divmod(lying, _TRY)
    upright = float(base.rotation[2, 2])
    if upright > 0.8 and phase > _PUSH:
        return None if phase > _TRY - 0.1 else folded + (rest - folded) * min(1.0, phase - _PUSH)
    if not _PUSH <= phase <= _PULL:
        return folded
    on_back = upright < -0.3
    # Of the side that begins (0 left), the hip's outward direction is positive on the left.
    side = int(turn) % 2 if on_back else int(base.rotation[2, 1] >= 0.0)
    pose = (_ON_BACK if on_back else _ON_SIDE).copy()
    out = folded.reshape(4, 3).copy()
    for which, legs in ((0, side), (1, 1 - side)):
        out[legs::2] = pose[which] * (1.0 if legs == 0 else -1.0, 1.0, 1.0)
    return out.ravel()
