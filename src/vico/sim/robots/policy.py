"""Evaluating a walking policy: observations in, joint targets out, with the same bits on every run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import FourLegs, RobotModel
from vico.io.compiled import compiled
from vico.sim.physics.records import Motion

# Scales of the observation and its limit, from the policy's deployment configuration.
_SPIN, _JOINT_SPEED, _LIMIT = 0.25, 0.05, 100.0


@compiled
def _elu(values):  # type: ignore[no-untyped-def]
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
def dense(inputs, weights, bias, last):  # type: ignore[no-untyped-def]
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


#: Where the parts of the policy's observation begin: angular velocity, gravity and command (3 each), joint angles
#: relative to the pose at rest, joint speeds and the last action (12 each).
_ANGULAR_VELOCITY, _GRAVITY, _COMMAND, _ANGLES, _SPEEDS, _ACTION, _OBSERVED = 0, 3, 6, 9, 21, 33, 45


@compiled
def _observation(angular_velocity_body, rotation, command, joints, action, order, rest):  # type: ignore[no-untyped-def]
    """Return what the policy sees, scaled, shape ``(45,)``."""
    angles, speeds = joints
    seen = np.empty(_OBSERVED)
    for k in range(3):
        seen[_ANGULAR_VELOCITY + k] = angular_velocity_body[k] * _SPIN
        seen[_GRAVITY + k] = -rotation[2, k]
        seen[_COMMAND + k] = command[k]
    for k in range(12):
        seen[_ANGLES + k] = angles[order[k]] - rest[k]
        seen[_SPEEDS + k] = speeds[order[k]] * _JOINT_SPEED
        seen[_ACTION + k] = action[k]
    return seen


@compiled
def _observe_all(motion, command, memory, pose):  # type: ignore[no-untyped-def]
    """Return what the policy sees of all robots, shape ``(k, 45)``."""
    rotation, angular_velocity_body, angles, speeds = motion
    order, rest, _ = pose
    seen = np.empty((len(command), _OBSERVED))
    for k in range(len(command)):
        seen[k] = _observation(
            angular_velocity_body[k], rotation[k], command[k], (angles[k], speeds[k]), memory[k], order, rest
        )
    return seen


@compiled
def _evaluate(layers, motion, command, memory, pose):  # type: ignore[no-untyped-def]
    """Return joint targets in the model's order, shape ``(k, 12)``; `memory` becomes the actions."""
    order, rest, scale = pose
    seen = _observe_all(motion, command, memory, pose)
    x = np.minimum(np.maximum(seen, -_LIMIT), _LIMIT).astype(np.float32)
    for index in range(len(layers)):
        x = dense(x, layers[index][0], layers[index][1], index == len(layers) - 1)
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
