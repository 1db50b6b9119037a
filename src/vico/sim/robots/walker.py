"""Walking on two legs: all robots of a kind at once."""

from __future__ import annotations

import math

import numpy as np

from vico.assets.robots import RobotModel, TwoLegs
from vico.exact import apply_matrix
from vico.io.compiled import compiled
from vico.sim.physics.records import Base, Motion
from vico.sim.robots.controller import Array, Gains, MotorController
from vico.sim.robots.policy import dense
from vico.sim.robots.standing import KNEE, StanceSettings, feel_ground, fit_to_ground, wanted_velocity
from vico.sim.robots.tracking import approach, planar_motion
from vico.sim.robots.two_legs import (
    COMMAND,
    LEG,
    LEGS,
    MEMORY,
    OBSERVED,
    StepSettings,
    advance_clock,
    leg_targets,
    observe,
)

#: What a command may change by in a second: m/s ahead and aside, rad/s.
_SLEW = (1.5, 1.0, 3.0)
#: Seconds a fallen one lies before it is lifted, and m/s that it is.
_LIFTED_AFTER, _LIFT_SPEED = 3.0, 0.35
#: How hard it is pulled to where it should be, N/m and Ns/m, and upright, Nm and Nms.
_PULL, _HOLD, _UPRIGHT, _UPRIGHT_HOLD = 1500.0, 400.0, 200.0, 60.0


@compiled
def _walk(layers, settings, motion, command, memory):  # type: ignore[no-untyped-def]
    """Return the joints' targets of all robots, shape ``(k, 10)``."""
    steps, stance, slew = settings
    position, rotation, velocity, spin, angles, speeds = motion
    count = len(command)
    seen, wanted = np.empty((count, OBSERVED)), np.empty(3)
    for k in range(count):
        mine = memory[k]
        wanted_velocity(steps.period, command[k], position[k], rotation[k], mine, wanted)
        approach(mine[COMMAND : COMMAND + 3], wanted, slew)
        planar = planar_motion(rotation[k], velocity[k], spin[k])
        advance_clock(steps, planar, math.acos(min(max(rotation[k, 2, 2], -1.0), 1.0)), mine)
        feel_ground(stance, rotation[k], angles[k], mine)
        level = angles[k].copy()
        fit_to_ground(mine, level, -1.0)
        observe(steps, (rotation[k], velocity[k], spin[k]), (level, speeds[k]), mine, seen[k])
    x = seen.astype(np.float32)
    for index in range(len(layers)):
        x = dense(x, layers[index][0], layers[index][1], index == len(layers) - 1)
    out = np.empty((count, LEGS))
    for k in range(count):
        leg_targets(steps, x[k].astype(np.float64), memory[k], out[k])
        fit_to_ground(memory[k], out[k], 1.0)
    return np.minimum(np.maximum(out, steps.low), steps.high)


class TwoLegWalker(MotorController):
    """Walks on two legs, stands, and steps to catch itself when it is pushed. Who fell is set on its feet."""

    memory = MEMORY

    def __init__(self, model: RobotModel) -> None:
        super().__init__(model)
        c, period = model.controller, model.control_period
        assert isinstance(c, TwoLegs)
        low, high = model.motor_limits
        steps = StepSettings(period, c.stride, np.array(model.rest[:LEG]), low, high)
        stance = StanceSettings(period, c.places, float(model.rest[KNEE]))
        self._settings = (steps, stance, np.array(_SLEW) * period)
        self._layers = tuple((np.ascontiguousarray(w), np.array(b)) for w, b in zip(c.weights, c.biases, strict=True))

    def targets(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Joint angles, rad."""
        m = motion
        moving = (m.position, m.rotation, m.velocity, m.angular_velocity_body, m.angles, m.speeds)
        found: Array = _walk(self._layers, self._settings, moving, command, memory)
        return found

    def lying_targets(self, lying: float, base: Base) -> tuple[Array, Gains | None] | None:
        """Keep the legs as they are at rest."""
        return self.model.stance, None

    def lift(self, lying: float, base: Base, above_ground: float) -> tuple[str, Array] | None:
        """Be lifted by the chest and set upright, as by a crane: no robot of this kind gets up by itself."""
        c = self.model.controller
        assert isinstance(c, TwoLegs)
        up = lying - _LIFTED_AFTER
        if up < 0.0:
            return c.hoist, np.zeros((2, 3))
        height = min(self.model.stand + 0.01, 0.15 + _LIFT_SPEED * up)
        force = -_HOLD * base.velocity
        force[2] += c.mass * 9.81 + _PULL * (height - above_ground)
        force[2] = min(max(force[2], 0.0), 2.0 * c.mass * 9.81)
        axis = base.rotation[:, 2]
        torque = _UPRIGHT * np.array([axis[1], -axis[0], 0.0])
        turned = apply_matrix(base.angular_velocity_body, base.rotation)
        wrench = np.array([force, torque - _UPRIGHT_HOLD * turned])
        return c.hoist, apply_matrix(wrench, base.rotation.T)

    def stands(self, lying: float, base: Base, angles: Array, above_ground: float) -> bool:
        """Return whether it was set on its feet, and is still."""
        still = float(np.abs(base.velocity).max()) < 0.1 and float(np.abs(base.angular_velocity_body).max()) < 0.3
        bent = float(np.abs(angles - self.model.rest).max())
        return lying > _LIFTED_AFTER and abs(above_ground - self.model.stand) < 0.06 and still and bent < 0.3
