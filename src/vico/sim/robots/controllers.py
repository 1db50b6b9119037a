"""From a velocity to what the motors follow: wheels that skid, legs that walk, stand, fall and get up."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.assets.robots_go2 import GAIT_GAINS, POLICY_GAINS
from vico.assets.robots_husky import RADIUS, TRACK
from vico.sim.physics.engine import Base
from vico.sim.robots.gait import BODY, Trot, leg_angles
from vico.sim.robots.policy import WalkingPolicy

#: Seconds between two evaluations of a controller.
PERIOD = 0.02
#: How much faster than by rolling alone the wheels have to turn for the base to turn, on pavement.
SKID = 2.2
Vector = NDArray[np.float64]


class Controller(Protocol):
    """Follows a velocity. All its memory is an array its owner keeps, so that a robot can be saved and restored."""

    @property
    def memory(self) -> int:
        """How many numbers it remembers."""

    def gains(self, memory: Vector) -> tuple[float, float] | None:
        """Stiffness and damping the servos need for the targets just given; None: always the same."""

    def targets(self, base: Base, angles: Vector, speeds: Vector, command: Vector, memory: Vector) -> Vector:
        """What the servos follow for the next `PERIOD` seconds.

        Parameters
        ----------
        base, angles, speeds
            The robot's motion; joints in the order of the model's `joints`.
        command
            vx, vy, metres a second in the base's frame, and radians a second to the left, shape ``(3,)``.
        memory
            Updated in place; zeros at first.
        """


@njit(cache=True)
def _approach(values, goal, step):  # type: ignore[no-untyped-def]
    """Bring `values` nearer to `goal`, each by at most its `step`."""
    for k in range(len(values)):
        values[k] += min(max(goal[k] - values[k], -step[k]), step[k])


@njit(cache=True)
def _trimmed(gain, limit, smooth, rotation, velocity, spin, command, memory):  # type: ignore[no-untyped-def]
    """Correct a command by the integral of what is missing of it; `memory` is smoothed motion, then correction."""
    out = np.empty(3)
    share = PERIOD / (smooth + PERIOD)
    for k in range(3):
        if k < 2:
            moving = rotation[0, k] * velocity[0] + rotation[1, k] * velocity[1] + rotation[2, k] * velocity[2]
        else:
            moving = spin[2]
        memory[k] += (moving - memory[k]) * share
        memory[3 + k] += gain[k] * (command[k] - memory[k]) * PERIOD
        memory[3 + k] = min(max(memory[3 + k], -limit[k]), limit[k])
        out[k] = command[k] + memory[3 + k]
    return out


@njit(cache=True)
def _skid(gain, limit, smooth, slew, top, rotation, velocity, spin, command, memory):  # type: ignore[no-untyped-def]
    """Wheel speeds, rad/s; `memory` is the command as far as it was let through, then that of `_trimmed`."""
    _approach(memory[:3], command, slew)
    out = np.zeros(4)
    if not command.any() and not memory[:3].any():  # brakes
        memory[3:] = 0.0
        return out
    wanted = _trimmed(gain, limit, smooth, rotation, velocity, spin, memory[:3], memory[3:])
    for k in range(4):
        side = -1.0 if k % 2 == 0 else 1.0
        speed = (wanted[0] + side * wanted[2] * TRACK * SKID) / RADIUS
        out[k] = min(max(speed, -top[k]), top[k])
    return out


class _Trim:
    """What `_trimmed` goes by. Memory: smoothed motion, correction (3 + 3)."""

    size = 6

    def __init__(self, gain: tuple[float, float, float], limit: tuple[float, float, float], smooth: float) -> None:
        self.settings = (np.array(gain), np.array(limit), smooth)


class SkidSteer:
    """Four wheels, the two of a side alike. Turning means skidding, so how fast the base turns is measured."""

    #: Metres a second and radians a second the command may change by in one period.
    slew = np.array([0.02, 0.0, 0.05])

    def __init__(self, model: RobotModel) -> None:
        self._limit = np.array(model.upper, np.float64)
        self._trim = _Trim((2.0, 0.0, 2.0), (0.4, 0.0, 1.0), 0.1)
        self.memory = 3 + _Trim.size

    def gains(self, memory: Vector) -> tuple[float, float] | None:
        """Wheels' servos have one stiffness."""
        return None

    def targets(self, base: Base, angles: Vector, speeds: Vector, command: Vector, memory: Vector) -> Vector:
        """Wheel speeds, rad/s."""
        found: Vector = _skid(
            *self._trim.settings, self.slew, self._limit, base.rotation, base.velocity, base.spin, command, memory
        )
        return found


class Legs:
    """Four legs: walks while there is a velocity to follow, stands otherwise."""

    slew = np.array([0.05, 0.04, 0.10])
    #: Seconds without a command after which it stops stepping, and radians a joint moves in one period while it does.
    patience, ease = 0.6, np.full(12, 0.03)

    def __init__(self, model: RobotModel) -> None:
        self._learned = model.policy is not None
        self._gait: WalkingPolicy | Trot = WalkingPolicy(model) if model.policy else Trot(model)
        self._trim = _Trim((1.0, 1.0, 1.5), (0.35, 0.25, 0.5), 0.3)
        if model.policy:
            self.rest = model.rest
        else:
            self.rest = np.concatenate([leg_angles(0.0, s * 0.0955, -BODY, s) for s in (1.0, -1.0, 1.0, -1.0)])
        self.memory = 3 + 1 + 12 + _Trim.size + self._gait.memory

    def gains(self, memory: Vector) -> tuple[float, float] | None:
        """Soft where the policy expects it, stiff to stand and for our own gait."""
        return POLICY_GAINS if self._learned and memory[3] <= self.patience else GAIT_GAINS

    def targets(self, base: Base, angles: Vector, speeds: Vector, command: Vector, memory: Vector) -> Vector:
        """Joint angles, rad."""
        wanted, held, trim, gait = memory[:3], memory[4:16], memory[16:22], memory[22:]
        _approach(wanted, command, self.slew)
        memory[3] = 0.0 if command.any() or wanted.any() else memory[3] + PERIOD
        if memory[3] > self.patience or not held.any():
            # From where the legs are, not from where softer servos were told to be: that would make it jump.
            if gait.any() or not held.any():
                held[:] = angles
                memory[3] = self.patience + PERIOD
            trim[:] = 0.0
            gait[:] = 0.0
            _approach(held, self.rest, self.ease)
            return held.copy()
        trimmed = _trimmed(*self._trim.settings, base.rotation, base.velocity, base.spin, wanted, trim)
        held[:] = self._gait.targets(base, angles, speeds, trimmed, gait)
        return held.copy()


#: Angles of a leg drawn in below the body: hip (outward positive), thigh, calf.
FOLDED = np.array([0.0, 1.4, -2.65])
# Lying on its back, the legs of one side and of the other; lying on a side, the legs below and above. Found by random
# search in simulation over both models and seven ways to lie, the score being how soon all of them are up.
_ON_BACK = np.array([[0.98, 3.3, -1.9], [-0.71, 2.81, -1.8]])
_ON_SIDE = np.array([[-0.83, 3.32, -1.89], [0.0, 1.41, -1.56]])
#: Seconds an attempt to get up lasts, and when in it the legs begin and cease to push.
_TRY, _PUSH, _PULL = 3.0, 0.5, 2.06


def getting_up(lying: float, base: Base, rest: Vector) -> Vector | None:
    """What a fallen robot's legs do `lying` seconds after it fell; None once it should stand.

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


def controller_for(model: RobotModel) -> Controller:
    """Return what drives a kind of robot."""
    return Legs(model) if model.legged else SkidSteer(model)
