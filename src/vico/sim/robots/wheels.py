"""Wheels that skid: from a velocity of the base to speeds of the wheels, of all robots of a kind at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vico.assets.robots import RobotModel, SkidSteering
from vico.io.compiled import compiled
from vico.sim.physics.records import Motion
from vico.sim.robots.controller import Array, MotorController
from vico.sim.robots.tracking import TRIM_SIZE, TrimSettings, approach, planar_motion, trimmed


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
def _skid(trim, slew, top, wheels, motion, command, memory):  # type: ignore[no-untyped-def]
    """Return wheel speeds of one robot, rad/s; left and right in turn."""
    wanted_now, trim_memory = memory[_COMMAND], memory[_TRIM]
    approach(wanted_now, command, slew)
    out = np.zeros(len(top))
    if not command.any() and not wanted_now.any():  # brakes
        trim_memory[:] = 0.0
        memory[_ROLLED] += motion[0] * trim.period
        out[:] = min(max(-_BACK * memory[_ROLLED], -_BACK_SPEED), _BACK_SPEED) / wheels.radius
        return out
    memory[_ROLLED] = 0.0
    wanted = trimmed(trim, motion, wanted_now, trim_memory)
    for k in range(len(top)):
        side = -1.0 if k % 2 == 0 else 1.0
        speed = (wanted[0] + side * wanted[2] * wheels.half_track * wheels.slip) / wheels.radius
        out[k] = min(max(speed, -top[k]), top[k])
    return out


@compiled
def _skid_all(settings, rotation, velocity, angular_velocity_body, command, memory):  # type: ignore[no-untyped-def]
    """Return wheel speeds of all robots, shape ``(k, wheels)``."""
    trim, slew, top, wheels = settings
    out = np.empty((len(command), len(top)))
    for k in range(len(command)):
        motion = planar_motion(rotation[k], velocity[k], angular_velocity_body[k])
        out[k] = _skid(trim, slew, top, wheels, motion, command[k], memory[k])
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
        found: Array = _skid_all(
            self._settings, motion.rotation, motion.velocity, motion.angular_velocity_body, command, memory
        )
        return found
