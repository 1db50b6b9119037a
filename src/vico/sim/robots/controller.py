"""Controllers of robots: from velocities to motor targets, of all robots of a kind in one call.

`MotorController` is the base of all of them. Commands are let through slowly, and corrected by what is missing of
them. Wheels that skid turn a velocity of the base into speeds of the wheels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel, SkidSteering
from vico.io.compiled import compiled
from vico.sim.physics.records import Base, Motion

Array = NDArray[np.float64]
#: Stiffness and damping of servos that follow angles, Nm/rad and Nms/rad.
Gains = tuple[float, float]


class MotorController:
    """The controller of robots whose motors are commanded directly, and what every other one is derived from.

    A controller is made once a kind of robot. All it remembers of a robot is a row of an array that its owner keeps,
    so that robots can be saved and restored; what it returns for a robot does not depend, bit for bit, on which other
    robots are asked about in the same call.

    Attributes
    ----------
    memory
        How many numbers it remembers of each robot; zeros at first.
    command_gains
        Gains of the servos while their motors are commanded directly; None: they stay as they are.
    """

    memory: int = 0
    command_gains: Gains | None = None

    def __init__(self, model: RobotModel) -> None:
        self.model = model

    def targets(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Return what the servos follow until the next call, a `RobotModel.control_period` later.

        Parameters
        ----------
        motion
            Of the robots, row = robot.
        command
            vx, vy, metres a second in the base's frame, and radians a second to the left, shape ``(k, 3)``.
        memory
            Shape ``(k, memory)``; updated in place.

        Returns
        -------
        ndarray
            Shape ``(k, motors)``.
        """
        return np.tile(self.model.stance, (len(motion), 1))

    def command_targets(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Return what servos follow that are commanded one by one, shape ``(k, motors)``; arguments as above."""
        memory[:] = 0.0
        return command

    def rotor_speeds(self, motion: Motion, setpoints: Array, memory: Array, seconds: float) -> Array:
        """Return what the rotors of robots that fly follow for some seconds, rad/s, shape ``(k, rotors)``.

        Parameters
        ----------
        setpoints
            As `vico.sim.robots.quadrotor.FlightArrays` has them, shape ``(k, 8)``: moved on in place.
        """
        return self.targets(motion, setpoints, memory)

    def gains(self, memory: Array) -> list[Gains | None]:
        """Return what gains the targets just given need, one a robot; None: they stay as they are."""
        return [None] * len(memory)

    def lying_targets(self, lying: float, base: Base) -> tuple[Array, Gains | None] | None:
        """Return targets and gains for a robot that fell `lying` seconds ago; None: commands go on."""
        return self.model.stance, None

    def lift(self, lying: float, base: Base, above_ground: float) -> tuple[str, Array] | None:
        """Return how a robot is lifted that fell `lying` seconds ago: a site, and force and torque there; None: not.

        Parameters
        ----------
        above_ground
            Height of the base above the ground, metres.

        Returns
        -------
        tuple or None
            Name of a site, and newtons and newton metres in its frame, shape ``(2, 3)``.
        """
        return None

    def stands(self, lying: float, base: Base, angles: Array, above_ground: float) -> bool:
        """Return whether a fallen robot whose base is upright again stands.

        Parameters
        ----------
        above_ground
            Height of the base above the ground, metres.
        """
        return True


class DirectMotors(MotorController):
    """Follows no velocities: motors keep to the model's stance until they are commanded, fallen or not."""

    def lying_targets(self, lying: float, base: Base) -> tuple[Array, Gains | None] | None:
        """Commands go on."""
        return None


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
    period
        Seconds between two corrections.
    """

    gain: NDArray[np.float64]
    limit: NDArray[np.float64]
    smoothing: float
    period: float


#: What a trim remembers: smoothed motion, correction (3 + 3).
TRIM_SIZE = 6
_SMOOTHED, _CORRECTION = 0, 3


@compiled
def approach(values, goal, step):
    """Bring `values` nearer to `goal`, each by at most its `step`."""
    for k in range(len(values)):
        values[k] += min(max(goal[k] - values[k], -step[k]), step[k])


@compiled
def planar_motion(rotation, velocity, angular_velocity_body):
    """Return vx, vy, wz in the base's frame."""
    out = np.empty(3)
    for k in range(2):
        out[k] = rotation[0, k] * velocity[0] + rotation[1, k] * velocity[1] + rotation[2, k] * velocity[2]
    out[2] = angular_velocity_body[2]
    return out


@compiled
def trim_command(trim, motion, command, memory):
    """Return a command corrected by the integral of what is missing of it."""
    out = np.empty(3)
    share = trim.period / (trim.smoothing + trim.period)
    for k in range(3):
        smoothed, correction = _SMOOTHED + k, _CORRECTION + k
        memory[smoothed] += (motion[k] - memory[smoothed]) * share
        memory[correction] += trim.gain[k] * (command[k] - memory[smoothed]) * trim.period
        memory[correction] = min(max(memory[correction], -trim.limit[k]), trim.limit[k])
        out[k] = command[k] + memory[correction]
    return out


class WheelGeometry(NamedTuple):
    """Of wheels that skid, as in `vico.assets.robots.SkidSteering`."""

    radius: float
    half_track: float
    slip: float


# What wheels remember: their command as far as it was let through, the trim, and how far they have rolled since they
# stand, metres.
_COMMAND = slice(0, 3)
_TRIM = slice(3, 3 + TRIM_SIZE)
_ROLLED = 3 + TRIM_SIZE
# On a slope wheels give way, slowly: they drive back by so much a second of what they have rolled, at most so fast,
# m/s.
_BACK, _BACK_SPEED = 4.0, 0.2


@compiled
def _wheel_speeds(settings, rotation, velocity, angular_velocity_body, command, memory):
    """Return wheel speeds of all robots, rad/s, left and right in turn, shape ``(k, wheels)``."""
    trim, slew, top, wheels = settings
    out = np.empty((len(command), len(top)))
    for robot in range(len(command)):
        motion = planar_motion(rotation[robot], velocity[robot], angular_velocity_body[robot])
        mine = memory[robot]
        wanted_now, trim_memory = mine[_COMMAND], mine[_TRIM]
        approach(wanted_now, command[robot], slew)
        if not command[robot].any() and not wanted_now.any():  # brakes
            trim_memory[:] = 0.0
            mine[_ROLLED] += motion[0] * trim.period
            out[robot] = min(max(-_BACK * mine[_ROLLED], -_BACK_SPEED), _BACK_SPEED) / wheels.radius
            continue
        mine[_ROLLED] = 0.0
        wanted = trim_command(trim, motion, wanted_now, trim_memory)
        for k in range(len(top)):
            side = -1.0 if k % 2 == 0 else 1.0
            speed = (wanted[0] + side * wanted[2] * wheels.half_track * wheels.slip) / wheels.radius
            out[robot, k] = min(max(speed, -top[k]), top[k])
    return out


class SkidSteer(MotorController):
    """Wheels in pairs, those of a side alike. Turning means skidding, so how fast the base turns is measured."""

    def __init__(self, model: RobotModel) -> None:
        super().__init__(model)
        assert isinstance(model.controller, SkidSteering)
        c, period = model.controller, model.control_period
        trim = TrimSettings(np.array((2.0, 0.0, 2.0)), np.array((0.4, 0.0, 1.0)), 0.1, period)
        # Metres a second and radians a second the command may change by in one period.
        slew = np.array([1.0, 0.0, 2.5]) * period
        self._settings = (trim, slew, model.motor_limits[1], WheelGeometry(c.wheel_radius, c.half_track, c.slip))
        self.memory = _ROLLED + 1

    def targets(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Wheel speeds, rad/s."""
        found: Array = _wheel_speeds(
            self._settings, motion.rotation, motion.velocity, motion.angular_velocity_body, command, memory
        )
        return found
