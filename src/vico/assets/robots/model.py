"""Robots as models: what physics, control and drawing need to know of each, and which are known.

Every robot has a model of our own, primitive shapes with published masses, lengths and limits. Where the packages
that ship a robot's meshes (and, for Go2, its walking policy) are installed, those are used instead.

The control vector of a robot has one entry a motor, in the order of `RobotModel.joints`. Motors are servos: wheels
follow a speed (rad/s), legs an angle (rad), within the motor's torque.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vico.world.mesh import Surface

#: Collision bits: 1 is what robots stand on and touch each other with, 2 is what their bumper meets.
TOUCH, BUMP = 1, 2
#: A box of the robot's whole outline. It meets walls, people and vehicles, never the ground.
BUMPER = "bumper"
#: Contact of feet (MuJoCo's `solref`, `solimp`): they sink 1 cm at most. Softer ones sink below the cells of uneven
#: ground and meet those from the side.
FOOT_CONTACT = ("0.01 1", "0.9 0.95 0.001")


@dataclass(frozen=True)
class PolicyNetwork:
    """A walking policy: dense layers with ELU between them, from 45 observations to 12 joint offsets.

    Attributes
    ----------
    weights, biases
        float32, one per layer; weights have shape ``(outputs, inputs)``.
    order
        The policy's order of joints: entry ``k`` is the index in `RobotModel.joints` of its joint ``k``.
    rest
        Joint angles that offset zero stands for, policy's order, radians.
    scale
        Radians a unit of output, policy's order.
    """

    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]
    order: NDArray[np.int64]
    rest: NDArray[np.float64]
    scale: NDArray[np.float64]


@dataclass(frozen=True)
class RobotModel:
    """A kind of robot.

    Attributes
    ----------
    name, title
        As asked for on the command line; as people say it.
    source
        Where shape and policy come from.
    mjcf
        One floating body with collision shapes, inertias and servos (named as `joints`), without meshes.
    joints
        Driven joints, in the order of the control vector.
    lower, upper
        Limits of the control vector, rad/s for wheels, rad for legs.
    rest
        Joint angles at which it stands, rad.
    stand
        Height of the base's origin above level ground at `rest`, metres.
    half_length, half_width, height
        Upright box around the robot, metres, centred on the base.
    speed
        Fastest it is driven, metres a second; `turn` is radians a second.
    eye
        Camera in the frame of the base, metres; it looks along +x.
    shapes
        Surfaces by link, in the link's frame; links are bodies of `mjcf`.
    policy
        None: it walks by our own gait (legged), or has wheels.
    """

    name: str
    title: str
    source: str
    mjcf: str
    joints: tuple[str, ...]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    rest: NDArray[np.float64]
    stand: float
    half_length: float
    half_width: float
    height: float
    speed: float
    turn: float
    eye: tuple[float, float, float]
    shapes: Mapping[str, list[Surface]] = field(repr=False)
    policy: PolicyNetwork | None = None

    @property
    def legged(self) -> bool:
        """True for robots that walk."""
        return len(self.joints) > 4
