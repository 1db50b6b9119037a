"""What a controller is: from velocities to motor targets, of all robots of a kind in one call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
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

    def commanded(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Return what servos follow that are commanded one by one, shape ``(k, motors)``; arguments as above."""
        memory[:] = 0.0
        return command

    def rotor_speeds(self, motion: Motion, setpoints: Array, memory: Array, seconds: float) -> Array:
        """Return what the rotors of robots that fly follow for some seconds, rad/s, shape ``(k, rotors)``.

        Parameters
        ----------
        setpoints
            As `vico.sim.robots.rotors.FlightArrays` has them, shape ``(k, 8)``: moved on in place.
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
