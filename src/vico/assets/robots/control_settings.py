"""Which controller drives a robot, and what each has to know of the robot's body."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


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


class ControllerSettings(Protocol):
    """Which controller drives a robot, and what that has to know of it."""

    @property
    def name(self) -> str:
        """Name of the controller, as in `vico.sim.robots.scene.CONTROLLERS`."""


@dataclass(frozen=True)
class SkidSteering:
    """Wheels in pairs, left first; the robot turns by driving its sides at different speeds.

    Attributes
    ----------
    wheel_radius, half_track
        Metres; half of what is between the middles of left and right wheels.
    slip
        How much faster than by rolling alone the wheels have to turn for the base to turn.
    """

    wheel_radius: float
    half_track: float
    slip: float
    name: str = "skid_steer"


@dataclass(frozen=True)
class FourLegs:
    """Four legs of three joints (hip, thigh, calf; front left, front right, rear left, rear right).

    Attributes
    ----------
    hip_x, hip_y
        Hip in the base's frame, metres.
    side, thigh, shin
        From the hip sideways to the leg's plane, and the leg's two parts, metres.
    gait_gains, policy_gains
        Stiffness and damping (Nm/rad, Nms/rad) of the servos for our own gait, and for the policy.
    policy
        A trained gait; None: our own.
    """

    hip_x: float
    hip_y: float
    side: float
    thigh: float
    shin: float
    gait_gains: tuple[float, float]
    policy_gains: tuple[float, float]
    policy: PolicyNetwork | None = field(default=None, repr=False)
    name: str = "four_legs"


@dataclass(frozen=True)
class TwoLegs:
    """Two legs of five joints (hip yaw, roll and pitch, knee, ankle; left, right), and a network that corrects steps.

    Attributes
    ----------
    weights, biases
        Of dense layers with ELU between them, float32, shapes ``(inputs, outputs)`` and ``(outputs,)``.
    stride
        Seconds of two steps.
    mass
        Of the robot, kg.
    hoist
        Site of `RobotModel.mjcf` by which it is lifted when it has fallen, along the axes of its base.
    places
        Where the joints of the left leg are, each in the frame of the one before, and the middle of its sole in that of
        the ankle; metres, shape ``(6, 3)``.
    """

    weights: tuple[NDArray[np.float32], ...] = field(repr=False)
    biases: tuple[NDArray[np.float32], ...] = field(repr=False)
    stride: float
    mass: float
    hoist: str
    places: NDArray[np.float64] = field(repr=False)
    name: str = "two_legs"


@dataclass(frozen=True)
class Quadrotor:
    """Four rotors or more, controlled from positions down to rotor speeds.

    Attributes
    ----------
    mass, inertia
        Of the robot, kg and kg m^2 about its axes, shape ``(3,)``.
    tilt
        The most it tilts, radians.
    """

    mass: float
    inertia: NDArray[np.float64]
    tilt: float
    name: str = "quadrotor"


@dataclass(frozen=True)
class MobileManipulator:
    """A base that drives and turns, and an arm with a jaw on it.

    Attributes
    ----------
    places, axes
        Of the arm's joints: each in the frame of the one before it, the first in the base's; metres, shape ``(n, 3)``.
    low, high
        Bounds of those joints, rad, shape ``(n,)``.
    grip
        Middle between the pads, along the last joint's z, metres; the jaw opens along its y.
    opening
        Way of each finger, metres.
    """

    places: NDArray[np.float64]
    axes: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    grip: float
    opening: float
    name: str = "mobile_manipulator"


@dataclass(frozen=True)
class NoController:
    """Nothing follows velocities: whoever drives the robot commands its motors."""

    name: str = "motors"
