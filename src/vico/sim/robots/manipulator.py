"""A base that drives and turns with an arm on it: all robots of a kind at once."""

from __future__ import annotations

import numpy as np

from vico.assets.robots import MobileManipulator, RobotModel
from vico.io.compiled import compiled
from vico.kinematics.arm import Chain
from vico.sim.physics.records import Motion
from vico.sim.robots.controller import Array, MotorController
from vico.sim.robots.tracking import planar_motion

#: Entries of its memory: where the arm's servos are told to be and where they go, both less the model's rest; the
#: speeds of the base as far as they were let through; how far it has rolled and turned since it stands; for how long
#: motor commands have told it not to roll, and not to turn, seconds.
ARM_NOW, ARM_GOAL, DRIVEN, ROLLED, TOLD = slice(0, 9), slice(9, 18), slice(18, 20), slice(20, 22), slice(22, 24)
#: Of joints, rad/s; of fingers, m/s.
JOINT_SPEED, FINGER_SPEED = 0.9, 0.12
_SPEED_UP, _TURN_UP = 0.8, 2.0
# Who stands on a slope would roll down it as slowly as its servos give way: it drives back by so much a second of what
# it has rolled, at these speeds at most, m/s and rad/s.
_BACK, _BACK_SPEEDS = 4.0, (0.2, 0.4)
# Seconds in which it brakes that is told to stand: what it goes then is no rolling.
_BRAKES = 0.5


@compiled
def _all(rest, fastest, slew, period, moved, command, memory):  # type: ignore[no-untyped-def]
    out = np.empty((len(command), len(rest) + 2))
    n = len(rest)
    for k in range(len(command)):
        longest = 1.0
        for j in range(n):
            longest = max(longest, abs(memory[k, n + j] - memory[k, j]) / fastest[j])
        for j in range(n):
            memory[k, j] += (memory[k, n + j] - memory[k, j]) / longest
            out[k, j] = rest[j] + memory[k, j]
        for j in range(2):
            goal = command[k, 0] if j == 0 else command[k, 2]
            before = memory[k, 2 * n + j]
            memory[k, 2 * n + j] = before + min(max(goal - before, -slew[j]), slew[j])
            out[k, n + j] = memory[k, 2 * n + j]
            rolled = 2 * n + 2 + j
            if goal != 0.0 or memory[k, 2 * n + j] != 0.0:
                memory[k, rolled] = 0.0
                continue
            memory[k, rolled] += moved[k, j] * period
            out[k, n + j] = min(max(-_BACK * memory[k, rolled], -_BACK_SPEEDS[j]), _BACK_SPEEDS[j])
    return out


@compiled
def _standing(moved, period, command, memory):  # type: ignore[no-untyped-def]
    out = command.copy()
    n = command.shape[1] - 2
    for k in range(len(command)):
        memory[k, : 2 * n + 2] = 0.0
        for j in range(2):
            rolled, stands = 2 * n + 2 + j, 2 * n + 4 + j
            memory[k, stands] = 0.0 if command[k, n + j] != 0.0 else memory[k, stands] + period
            if memory[k, stands] < _BRAKES:
                memory[k, rolled] = 0.0
                continue
            memory[k, rolled] += moved[k, j] * period
            out[k, n + j] = min(max(-_BACK * memory[k, rolled], -_BACK_SPEEDS[j]), _BACK_SPEEDS[j])
    return out


@compiled
def _base_motion(rotation, velocity, angular_velocity_body):  # type: ignore[no-untyped-def]
    """Return how fast bases go ahead and turn, m/s and rad/s, shape ``(k, 2)``."""
    out = np.empty((len(rotation), 2))
    for k in range(len(rotation)):
        motion = planar_motion(rotation[k], velocity[k], angular_velocity_body[k])
        out[k, 0], out[k, 1] = motion[0], motion[2]
    return out


class ArmOnWheels(MotorController):
    """Drives the base by velocities, and brings the arm to where a task wants it."""

    memory = 24

    def __init__(self, model: RobotModel) -> None:
        super().__init__(model)
        c, period = model.controller, model.control_period
        assert isinstance(c, MobileManipulator)
        self.chain = Chain(c.places, c.axes, c.low, c.high, c.grip)
        self._fastest = np.array([JOINT_SPEED] * 7 + [FINGER_SPEED] * 2) * period
        self._slew, self._period = np.array([_SPEED_UP, _TURN_UP]) * period, period

    def targets(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Arm angles, fingers, and speeds of the base."""
        moved = _base_motion(motion.rotation, motion.velocity, motion.angular_velocity_body)
        found: Array = _all(self.model.rest, self._fastest, self._slew, self._period, moved, command, memory)
        return found

    def commanded(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Motor commands as they are, but a base that is told to stand drives back what it rolls."""
        moved = _base_motion(motion.rotation, motion.velocity, motion.angular_velocity_body)
        found: Array = _standing(moved, self._period, command, memory)
        return found
