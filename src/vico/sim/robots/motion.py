"""Where robots of one kind are and how they move, as arrays: what their controller is given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.sim.physics import PhysicsEngine

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Motion of robots of one kind; row = robot.

    Attributes
    ----------
    position, velocity
        Of the base, ENU metres and metres a second, float64, shape ``(k, 3)``.
    rotation
        Base to world, shape ``(k, 3, 3)``.
    angular_velocity_body
        Radians a second in the base's frame, shape ``(k, 3)``.
    angles, speeds
        Of the model's joints in their order, rad and rad/s, shape ``(k, joints)``.
    """

    position: Array
    velocity: Array
    rotation: Array
    angular_velocity_body: Array
    angles: Array
    speeds: Array

    def __len__(self) -> int:
        return len(self.position)

    @classmethod
    def of(cls, engine: PhysicsEngine, robots: NDArray[np.int64]) -> Motion:
        """Return the motion of some robots of one kind."""
        bases = [engine.base(robot) for robot in robots.tolist()]
        joints = [engine.joints(robot) for robot in robots.tolist()]
        return cls(
            np.array([base.position for base in bases]),
            np.array([base.velocity for base in bases]),
            np.array([base.rotation for base in bases]),
            np.array([base.angular_velocity_body for base in bases]),
            np.array([angles for angles, _ in joints]),
            np.array([speeds for _, speeds in joints]),
        )

    def where(self, rows: NDArray[np.int64]) -> Motion:
        """Return some of the rows."""
        return Motion(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))
