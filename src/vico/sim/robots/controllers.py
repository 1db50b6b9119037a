"""From a velocity to what the motors follow: wheels that skid, legs that walk, stand, fall and get up."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import FourLegs, RobotModel, SkidSteering
from vico.errors import InputError
from vico.io.compiled import compiled
from vico.sim.physics.engine import Base
from vico.sim.robots.gait import BODY, LegGeometry, Trot, leg_angles
from vico.sim.robots.policy import WalkingPolicy

#: Seconds between two evaluations of a controller.
PERIOD = 0.02
Vector = NDArray[np.float64]


class Controller(Protocol):
    """Follows a velocity. All its memory is an array its owner keeps, so that a robot can be saved and restored."""

    @property
    def memory(self) -> int:
        """How many numbers it remembers."""

    def gains(self, memory: Vector) -> tuple[float, float] | None:
        """Stiffness and damping the servos need for the targets just given; None: always the same."""

    def targets(self, base: Base, angles: Vector, speeds: Vector, command: Vector, memory: Vector) -> Vector:
        """Return what the servos follow for the next `PERIOD` seconds.

        Parameters
        ----------
        base, angles, speeds
            The robot's motion; joints in the order of the model's `joints`.
        command
            vx, vy, metres a second in the base's frame, and radians a second to the left, shape ``(3,)``.
        memory
            Updated in place; zeros at first.
        """


@compiled
def _approach(values, goal, step):  # type: ignore[no-untyped-def]
    """Bring `values` nearer to `goal`, each by at most its `step`."""
    for k in range(len(values)):
        values[k] += min(max(goal[k] - values[k], -step[k]), step[k])


class TrimSettings(NamedTuple):
    """How a command is corrected by the integral of what is missing of it; vx, vy, wz.

    Attributes
    ----------
    gain
        Correction a second for each unit that is missing, 1/s, shape ``(3,)``.
    limit
        Largest correction, m/s and rad/s, shape ``(3,)``.
    smoothing
        Seconds over which the motion is smoothed.
    """

    gain: Vector
    limit: Vector
    smoothing: float


#: What a trim remembers: smoothed motion, correction (3 + 3).
_TRIM_SIZE = 6
_SMOOTHED, _CORRECTION = 0, 3


def _trim(gain: tuple[float, float, float], limit: tuple[float, float, float], smoothing: float) -> TrimSettings:
    return TrimSettings(np.array(gain), np.array(limit), smoothing)


@compiled
def _planar_motion(rotation, velocity, angular_velocity_body):  # type: ignore[no-untyped-def]
    """Return vx, vy, wz in the base's frame."""
    out = np.empty(3)
    for k in range(2):
        out[k] = rotation[0, k] * velocity[0] + rotation[1, k] * velocity[1] + rotation[2, k] * velocity[2]
    out[2] = angular_velocity_body[2]
    return out


def _motion_of(base: Base) -> Vector:
    found: Vector = _planar_motion(base.rotation, base.velocity, base.angular_velocity_body)
    return found


@compiled
def _trimmed(trim, motion, command, memory):  # type: ignore[no-untyped-def]
    """Return a command corrected by the integral of what is missing of it."""
    out = np.empty(3)
    share = PERIOD / (trim.smoothing + PERIOD)
    for k in range(3):
        smoothed, correction = _SMOOTHED + k, _CORRECTION + k
        memory[smoothed] += (motion[k] - memory[smoothed]) * share
        memory[correction] += trim.gain[k] * (command[k] - memory[smoothed]) * PERIOD
        memory[correction] = min(max(memory[correction], -trim.limit[k]), trim.limit[k])
        out[k] = command[k] + memory[correction]
    return out


#: What a controller remembers of its command: as far as it was let through.
_COMMAND = slice(0, 3)
#: What comes after that in the memory of wheels.
_WHEELS_TRIM = slice(3, 3 + _TRIM_SIZE)


class WheelGeometry(NamedTuple):
    """Of wheels that skid, as in `vico.assets.robots.SkidSteering`."""

    radius: float
    half_track: float
    slip: float


@compiled
def _skid(trim, slew, top, wheels, motion, command, memory):  # type: ignore[no-untyped-def]
    """Return wheel speeds, rad/s."""
    wanted_now, trim_memory = memory[_COMMAND], memory[_WHEELS_TRIM]
    _approach(wanted_now, command, slew)
    out = np.zeros(4)
    if not command.any() and not wanted_now.any():  # brakes
        trim_memory[:] = 0.0
        return out
    wanted = _trimmed(trim, motion, wanted_now, trim_memory)
    for k in range(4):
        side = -1.0 if k % 2 == 0 else 1.0
        speed = (wanted[0] + side * wanted[2] * wheels.half_track * wheels.slip) / wheels.radius
        out[k] = min(max(speed, -top[k]), top[k])
    return out


class SkidSteer:
    """Four wheels, the two of a side alike. Turning means skidding, so how fast the base turns is measured."""

    #: Metres a second and radians a second the command may change by in one period.
    slew = np.array([0.02, 0.0, 0.05])

    def __init__(self, model: RobotModel) -> None:
        assert isinstance(model.controller, SkidSteering)
        c = model.controller
        self._wheels = WheelGeometry(c.wheel_radius, c.half_track, c.slip)
        self._limit = model.motor_limits[1]
        self._trim = _trim((2.0, 0.0, 2.0), (0.4, 0.0, 1.0), 0.1)
        self.memory = _WHEELS_TRIM.stop

    def gains(self, memory: Vector) -> tuple[float, float] | None:
        """Wheels' servos have one stiffness."""
        return None

    def targets(self, base: Base, angles: Vector, speeds: Vector, command: Vector, memory: Vector) -> Vector:
        """Wheel speeds, rad/s."""
        found: Vector = _skid(self._trim, self.slew, self._limit, self._wheels, _motion_of(base), command, memory)
        return found


#: What legs remember after the command: seconds without one, the joint angles held, the trim, and the gait's memory.
_LEGS_IDLE = 3
_LEGS_HELD = slice(4, 16)
_LEGS_TRIM = slice(16, 16 + _TRIM_SIZE)
_LEGS_GAIT = _LEGS_TRIM.stop


class Legs:
    """Four legs: walks while there is a velocity to follow, stands otherwise."""

    slew = np.array([0.05, 0.04, 0.10])
    #: Seconds without a command after which it stops stepping, and radians a joint moves in one period while it does.
    patience, ease = 0.6, np.full(12, 0.03)

    def __init__(self, model: RobotModel) -> None:
        assert isinstance(model.controller, FourLegs)
        self._settings = model.controller
        self._learned = self._settings.policy is not None
        self._gait: WalkingPolicy | Trot = WalkingPolicy(model) if self._learned else Trot(model)
        self._trim = _trim((1.0, 1.0, 1.5), (0.35, 0.25, 0.5), 0.3)
        if self._learned:
            self.rest = model.rest
        else:
            legs = LegGeometry.of(self._settings)
            self.rest = np.concatenate([leg_angles(0.0, s * legs.side, -BODY, s, legs) for s in (1.0, -1.0, 1.0, -1.0)])
        self.memory = _LEGS_GAIT + self._gait.memory

    def gains(self, memory: Vector) -> tuple[float, float] | None:
        """Soft where the policy expects it, stiff to stand and for our own gait."""
        c = self._settings
        return c.policy_gains if self._learned and memory[_LEGS_IDLE] <= self.patience else c.gait_gains

    def targets(self, base: Base, angles: Vector, speeds: Vector, command: Vector, memory: Vector) -> Vector:
        """Joint angles, rad."""
        wanted, held = memory[_COMMAND], memory[_LEGS_HELD]
        trim, gait = memory[_LEGS_TRIM], memory[_LEGS_GAIT:]
        _approach(wanted, command, self.slew)
        memory[_LEGS_IDLE] = 0.0 if command.any() or wanted.any() else memory[_LEGS_IDLE] + PERIOD
        if memory[_LEGS_IDLE] > self.patience or not held.any():
            # From where the legs are, not from where softer servos were told to be: that would make it jump.
            if gait.any() or not held.any():
                held[:] = angles
                memory[_LEGS_IDLE] = self.patience + PERIOD
            trim[:] = 0.0
            gait[:] = 0.0
            _approach(held, self.rest, self.ease)
            return held.copy()
        trimmed = _trimmed(self._trim, _motion_of(base), wanted, trim)
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


class Motors:
    """No controller: the motors keep to their targets at rest until somebody commands them."""

    def __init__(self, model: RobotModel) -> None:
        self._stance = model.stance
        self.memory = 0

    def gains(self, memory: Vector) -> tuple[float, float] | None:
        """They stay as they are."""
        return None

    def targets(self, base: Base, angles: Vector, speeds: Vector, command: Vector, memory: Vector) -> Vector:
        """Targets at rest."""
        return self._stance


#: Makers of controllers by name.
CONTROLLERS: dict[str, Callable[[RobotModel], Controller]] = {
    "skid_steer": SkidSteer,
    "four_legs": Legs,
    "motors": Motors,
}


def controller_for(model: RobotModel) -> Controller:
    """Return what drives a kind of robot.

    Raises
    ------
    InputError
        If there is no controller of the name the model gives.
    """
    name = model.controller.name
    if name not in CONTROLLERS:
        raise InputError(
            f"robot {model.name!r}: no controller is called {name!r}; choose among {', '.join(CONTROLLERS)}"
        )
    return CONTROLLERS[name](model)
