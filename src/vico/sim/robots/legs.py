"""Four legs: walking, standing, and getting up again, of all robots of a kind at once."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import FourLegs, RobotModel
from vico.io.compiled import compiled
from vico.sim.physics.records import Base, Motion
from vico.sim.robots.controller import Array, Gains, MotorController
from vico.sim.robots.gait import BODY, LegGeometry, Trot, leg_angles
from vico.sim.robots.policy import WalkingPolicy
from vico.sim.robots.tracking import TRIM_SIZE, TrimSettings, approach, planar_motion, trimmed

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
def _stand_or_walk(settings, motion, angles, command, memory, wanted):  # type: ignore[no-untyped-def]
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
            wanted[k] = trimmed(settings.trim, moving, now, trim)
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
        legs = getting_up(lying, base, self.model.rest)
        return (self.model.rest if legs is None else np.clip(legs, *self.model.motor_limits)), self._gait_gains

    def stands(self, lying: float, base: Base, angles: Array, above_ground: float) -> bool:
        """Return whether it is the end of an attempt to get up that brought the robot onto its feet."""
        bent = float(np.abs(angles - self.model.rest).max())
        calm = np.abs(base.angular_velocity_body).max() < 0.5
        high = above_ground > 0.6 * self.model.stand
        return bool(high and calm and bent < 0.4 and getting_up(lying, base, self.model.rest) is None)


#: Angles of a leg drawn in below the body: hip (outward positive), thigh, calf.
FOLDED = np.array([0.0, 1.4, -2.65])
# Lying on its back, the legs of one side and of the other; lying on a side, the legs below and above. Found by random
# search in simulation over both models and seven ways to lie, the score being how soon all of them are up.
_ON_BACK = np.array([[0.98, 3.3, -1.9], [-0.71, 2.81, -1.8]])
_ON_SIDE = np.array([[-0.83, 3.32, -1.89], [0.0, 1.41, -1.56]])
#: Seconds an attempt to get up lasts, and when in it the legs begin and cease to push.
_TRY, _PUSH, _PULL = 3.0, 0.5, 2.06


def getting_up(lying: float, base: Base, rest: Array) -> Array | None:
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
