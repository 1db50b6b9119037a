"""Evaluating a walking policy: observations in, joint targets out, with the same bits on every run."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import FourLegs, RobotModel
from vico.io.compiled import compiled
from vico.sim.physics.engine import Base

# Scales of the observation and its limit, from the policy's deployment configuration.
_SPIN, _JOINT_SPEED, _LIMIT = 0.25, 0.05, 100.0
#: Seconds between two evaluations.
PERIOD = 0.02


@compiled
def _dense(inputs, weights, bias, last):  # type: ignore[no-untyped-def]
    """One layer, summed input by input: vectorised over outputs, and in one order whatever the machine's BLAS."""
    out = bias.copy()
    for j in range(len(inputs)):
        x = inputs[j]
        for i in range(len(out)):
            out[i] += weights[j, i] * x
    if not last:
        for i in range(len(out)):
            if out[i] < 0.0:
                out[i] = np.float32(np.expm1(out[i]))
    return out


#: Where the parts of the policy's observation begin: angular velocity, gravity and command (3 each), joint angles
#: relative to the pose at rest, joint speeds and the last action (12 each).
_ANGULAR_VELOCITY, _GRAVITY, _COMMAND, _ANGLES, _SPEEDS, _ACTION, _OBSERVED = 0, 3, 6, 9, 21, 33, 45


@compiled
def _observation(angular_velocity_body, rotation, command, angles, speeds, action, order, rest):  # type: ignore[no-untyped-def]
    """Return what the policy sees, scaled, shape ``(45,)``."""
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
def _evaluate(layers, seen, order, rest, scale, memory):  # type: ignore[no-untyped-def]
    """Return joint targets in the model's order; `memory` becomes the action."""
    x = np.minimum(np.maximum(seen, -_LIMIT), _LIMIT).astype(np.float32)
    for index in range(len(layers)):
        x = _dense(x, layers[index][0], layers[index][1], index == len(layers) - 1)
    out = np.empty(12)
    for k in range(12):
        memory[k] = min(max(np.float64(x[k]), -_LIMIT), _LIMIT)
        out[order[k]] = rest[k] + memory[k] * scale[k]
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
        self._policy = policy
        self._layers = tuple(
            (np.array(w.T, np.float32, order="C"), np.array(b, np.float32))
            for w, b in zip(policy.weights, policy.biases, strict=True)
        )

    def targets(
        self,
        base: Base,
        angles: NDArray[np.float64],
        speeds: NDArray[np.float64],
        command: NDArray[np.float64],
        memory: NDArray[np.float64],
    ) -> NDArray[Any]:
        """Joint angles to hold for the next `PERIOD` seconds.

        Parameters
        ----------
        base, angles, speeds
            The robot's motion, joints in the model's order.
        command
            vx, vy, metres a second in the base's frame, and radians a second to the left, shape ``(3,)``.
        memory
            The last action, shape ``(12,)``; updated in place.
        """
        p = self._policy
        seen = _observation(base.angular_velocity_body, base.rotation, command, angles, speeds, memory, p.order, p.rest)
        found: NDArray[Any] = _evaluate(self._layers, seen, p.order, p.rest, p.scale, memory)
        return found
