"""What a physics engine has to do for the robots, and what it is told about their surroundings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.sim.bodies import Bodies
from vico.world.heights import HeightField

#: Seconds a frame of physics lasts: fifty a second, five in a sub-step of the simulation.
FRAME = 0.02


@dataclass(frozen=True)
class StaticScene:
    """Everything that never moves.

    Attributes
    ----------
    height
        The ground.
    hulls
        Corner points of convex solids, metres, each of shape ``(n, 3)``.
    boxes
        Upright boxes: x, y, z of the centre, yaw, half extents; float64, shape ``(n, 7)``.
    pillars
        Upright cylinders: x, y, z of the centre, radius, half height; float64, shape ``(n, 5)``.
    """

    height: HeightField
    hulls: tuple[NDArray[np.float64], ...] = ()
    boxes: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 7)))
    pillars: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 5)))


@dataclass(frozen=True)
class Base:
    """Motion of a robot's base.

    Attributes
    ----------
    position
        Of its origin, ENU metres, shape ``(3,)``.
    rotation
        Base to world, shape ``(3, 3)``.
    velocity
        Metres a second in the world's frame, shape ``(3,)``.
    angular_velocity_body
        Radians a second in the base's own frame, shape ``(3,)``.
    quaternion
        The rotation as w, x, y, z.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    velocity: NDArray[np.float64]
    angular_velocity_body: NDArray[np.float64]
    quaternion: NDArray[np.float64]

    @property
    def yaw(self) -> float:
        """Heading, radians."""
        return math.atan2(self.rotation[1, 0], self.rotation[0, 0])


class PhysicsEngine(Protocol):
    """Robots among fixed scene and kinematic bodies. Robots are addressed by their index.

    What is there is fixed when the engine is built; `arrays` and `restore` give exact snapshots.
    """

    def base(self, robot: int) -> Base:
        """Where a robot's base is and how it moves. Its arrays are shared until the next step: do not change them."""

    def joints(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Angles and speeds of the driven joints, rad and rad/s, in the order of the model's `joints`."""

    def command(self, robot: int, targets: NDArray[np.float64], gains: tuple[float, float] | None = None) -> None:
        """Set what the servos follow from now on; legs' servos also take a stiffness and a damping with it."""

    def set_dynamic_obstacles(self, obstacles: Bodies, dt: float) -> None:
        """Say which bodies are near: they arrive at their positions `dt` seconds from now, at their velocities."""

    def step(self, frames: int = 1, *, extra_substeps: bool = False) -> None:
        """Move on by some frames with the servos as they are; with smaller steps where bodies lie and throw limbs."""

    def links(self, robot: int) -> NDArray[np.float64]:
        """Poses of the links, in the order of the model's `shapes`, shape ``(n, 4, 4)``."""

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that decides the future."""

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held, bit for bit."""
