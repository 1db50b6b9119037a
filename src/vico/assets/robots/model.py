"""Robots as models: what physics, control and drawing need to know of each.

Every robot has a model of our own, primitive shapes with published masses, lengths and limits. Where the packages that
ship a robot's meshes (and, for Go2, its walking policy) are installed, those are used instead.

A model says everything about its robot itself: its motors and joints, the spaces it can be commanded in with their
units and bounds, the controller that turns a velocity into motor commands and what that has to know of the body, its
sensors, its deck and the period of its control. Nothing is concluded from how many joints it has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.world.mesh import Surface


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


# Collision bits.
TOUCH = 1  #: touches everything that is solid: links, ground, walls, objects, people, vehicles
BUMP = 2  #: keeps out of the outline that traffic and people see of a robot: all but ground and objects
LIMB = 4  #: touches all but other links: a contype of parts that lie within the motion of their neighbours
#: A box of the robot's whole outline, which is what `Bodies` show of it: it keeps out of walls, people, vehicles and
#: other robots' outlines. Ground and objects meet links alone, and links meet all.
BUMPER = "bumper"
#: Contact of feet (MuJoCo's `solref`, `solimp`): they sink 1 cm at most. Softer ones sink below the cells of uneven
#: ground and meet those from the side.
FOOT_CONTACT = ("0.01 1", "0.9 0.95 0.001")

#: What a motor follows: an angle (rad), a speed (rad/s), a force or torque (N, Nm), or the speed of a rotor in the air
#: (rad/s), of which `RobotModel.rotors` says what it does.
Servo = Literal["position", "velocity", "force", "rotor"]
#: Seconds that control periods are multiples of.
TICK = 0.01


@dataclass(frozen=True)
class ActionSpace:
    """One form of vectors that a robot is commanded by.

    Attributes
    ----------
    drives
        What a vector is: targets of all motors in their order (``motors``), or a velocity that the robot's controller
        follows (``velocity``): vx, vy (m/s, along its heading and to the left of it) and wz (rad/s, to the left);
        robots that fly take vx, vy, vz (m/s, up) and wz.
    entries, units
        Name and unit of each number.
    low, high
        Bounds of each number, float64, shape ``(n,)``. A vector beyond them is clipped to them.
    """

    drives: Literal["motors", "velocity"]
    entries: tuple[str, ...]
    units: tuple[str, ...]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.entries)


def velocity_space(forward: float, sideways: float, turn: float) -> ActionSpace:
    """Return the space of velocities up to some metres a second ahead and aside, and radians a second of turning."""
    high = np.array([forward, sideways, turn])
    return ActionSpace("velocity", ("vx", "vy", "wz"), ("m/s", "m/s", "rad/s"), -high, high)


def flight_space(sideways: float, climb: float, turn: float) -> ActionSpace:
    """Return the space of velocities of what flies: m/s ahead, aside and up, and radians a second of turning."""
    high = np.array([sideways, sideways, climb, turn])
    return ActionSpace("velocity", ("vx", "vy", "vz", "wz"), ("m/s", "m/s", "m/s", "rad/s"), -high, high)


@dataclass(frozen=True)
class Sensors:
    """What a robot feels.

    Attributes
    ----------
    joints
        Whether it measures angles and speeds of its joints; of rotors where it flies.
    imu
        Whether it measures how its base turns, speeds up and stands to gravity.
    odometry
        Whether it knows pose and velocity of its base.
    contacts
        Links that feel whether they touch anything.
    camera
        Camera in the frame of the base, metres; it looks along +x. None: it has none.
    camera_pitch
        Radians the camera looks up (negative: down); it is held level otherwise.
    rotors
        Whether it measures the speeds of its rotors.
    battery
        Whether it knows how full its battery is.
    """

    joints: bool = True
    imu: bool = True
    odometry: bool = True
    contacts: tuple[str, ...] = ()
    camera: tuple[float, float, float] | None = None
    camera_pitch: float = 0.0
    rotors: bool = False
    battery: bool = False


@dataclass(frozen=True)
class DeckModel:
    """A level rectangle of a moving body on which things can be put; they move with it.

    Attributes
    ----------
    centre
        Middle of its surface in the frame of the body, metres.
    length, width
        Extents along the body's x and y, metres.
    recess
        The lower part of it between rails; None where it is level all over.
    """

    centre: tuple[float, float, float]
    length: float
    width: float
    recess: DeckModel | None = None


@dataclass(frozen=True)
class RotorModel:
    """Rotors that carry a robot, the air's drag, and the battery.

    Attributes
    ----------
    site
        Site of `RobotModel.mjcf` at the origin of the base, along its axes, at which all forces act.
    links
        Links that turn with the rotors, in the order of the motors: they are drawn so.
    places
        Middles of the rotors in the frame of the base, metres, shape ``(rotors, 3)``.
    turns
        1 for rotors that turn to the left seen from above, -1 for others, shape ``(rotors,)``.
    thrust
        Newtons for each (rad/s)^2.
    moment
        Torque of a rotor, against its turning, for each newton of its thrust, metres.
    speed_up, slow_down
        Time constants of a rotor's speed, seconds.
    rotor_drag
        Newtons for each m/s of air across a rotor and each rad/s that it turns with.
    drag_area
        Drag coefficient times area of all the rest, square metres.
    radius
        Of a rotor, metres.
    efficiency
        Share of the battery's power that goes into the air that rotors push down.
    idle_power
        What everything but the rotors takes, watts.
    capacity
        Of the battery, joules.
    """

    site: str
    links: tuple[str, ...]
    places: NDArray[np.float64]
    turns: NDArray[np.float64]
    thrust: float
    moment: float
    speed_up: float
    slow_down: float
    rotor_drag: float
    drag_area: float
    radius: float
    efficiency: float
    idle_power: float
    capacity: float


@dataclass(frozen=True)
class BatteryModel:
    """Where a robot on the ground has its power from; those that fly have theirs in `RotorModel`.

    Attributes
    ----------
    capacity
        Joules.
    idle_power
        What everything but the motors takes, watts.
    holding
        Watts that the motor of a joint turns into heat for each (Nm)^2 of its torque (N^2 of its force), whether it
        moves or not.
    efficiency
        Share of the remaining power of motors that becomes work.
    """

    capacity: float
    idle_power: float
    holding: float
    efficiency: float = 0.75


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
        One floating body with collision shapes, inertias and actuators (named as `motors`), without meshes.
    motors
        Actuators, in the order of vectors that drive motors.
    servos
        What each motor follows, in that order.
    joints
        Measured joints: names of the actuators that drive them, or their own.
    rest
        Joint angles at which it stands, rad, in the order of `joints`.
    controller
        What turns velocities into commands of its motors.
    action_spaces
        What it can be commanded by, by name; the first is its own unless another is asked for.
    control_period
        Seconds between two commands of its motors; a multiple of 0.01.
    sensors
        What it feels.
    deck
        Where things can be put on it; None: nowhere.
    stand
        Height of the base's origin above level ground at `rest`, metres.
    half_length, half_width, height
        Upright box around the robot, metres, centred on the base.
    kerb
        Highest kerb that it drives or steps up, metres; its ways lead round higher ones. None: any.
    grade
        Steepest ground that it drives or walks up, metres up a metre; its ways lead round steeper ground. None: any.
    lookahead, arrival
        How far ahead on its way it steers for, and how near the end it has arrived, metres.
    fallen_below
        Cosine of the tilt at which it counts as fallen; None: it can't fall.
    rotors
        What carries it in the air; None: it does not fly.
    battery
        Where it has its power from; None: nobody keeps account of that.
    shapes
        Surfaces by link, in the link's frame; links are bodies of `mjcf`.

    Raises
    ------
    InputError
        If its parts do not fit each other.
    """

    name: str
    title: str
    source: str
    mjcf: str
    motors: tuple[str, ...]
    servos: tuple[Servo, ...]
    joints: tuple[str, ...]
    rest: NDArray[np.float64]
    controller: ControllerSettings
    action_spaces: Mapping[str, ActionSpace]
    control_period: float
    stand: float
    half_length: float
    half_width: float
    height: float
    shapes: Mapping[str, list[Surface]] = field(repr=False)
    sensors: Sensors = Sensors()
    deck: DeckModel | None = None
    kerb: float | None = None
    grade: float | None = None
    lookahead: float = 0.7
    arrival: float = 0.3
    fallen_below: float | None = 0.7
    rotors: RotorModel | None = None
    battery: BatteryModel | None = None

    def __post_init__(self) -> None:
        def need(good: bool, what: str) -> None:
            if not good:
                raise InputError(f"robot model {self.name!r}: {what}")

        need(len(self.servos) == len(self.motors), f"{len(self.servos)} servos for {len(self.motors)} motors")
        need(len(self.rest) == len(self.joints), f"{len(self.rest)} angles at rest for {len(self.joints)} joints")
        need(bool(self.action_spaces), "it has no action space; name at least one")
        for name, space in self.action_spaces.items():
            wanted = len(self.motors) if space.drives == "motors" else (3 if self.rotors is None else 4)
            sizes = {len(space.entries), len(space.units), len(space.low), len(space.high)}
            need(sizes == {wanted}, f"action space {name!r} needs {wanted} entries, units and bounds")
            need(bool(np.all(space.low <= space.high)), f"action space {name!r} has a lower bound above the upper one")
        velocity = any(space.drives == "velocity" for space in self.action_spaces.values())
        need(
            velocity == (self.controller.name != NoController.name),
            "an action space of velocities and a controller that follows them go together",
        )
        flies = self.rotors is not None
        need(
            all((servo == "rotor") == flies for servo in self.servos),
            "what has rotors has no other motors, nor others it",
        )
        has_battery = (self.battery or self.rotors) is not None
        need(has_battery or not self.sensors.battery, "it can't know how full a battery is that it has not")
        need(self.battery is None or not flies, "the battery of what flies belongs to its rotors")
        ticks = round(self.control_period / TICK)
        need(
            ticks >= 1 and abs(ticks * TICK - self.control_period) < 1e-9,
            f"a control period of {self.control_period} s is no multiple of {TICK} s",
        )

    @property
    def default_space(self) -> str:
        """Name of the action space its vectors belong to unless they say otherwise."""
        return next(iter(self.action_spaces))

    @cached_property
    def velocity_limit(self) -> NDArray[np.float64] | None:
        """Fastest it is driven: vx, vy (and vz), m/s, and wz, rad/s; None if it follows no velocities."""
        found = [space.high for space in self.action_spaces.values() if space.drives == "velocity"]
        return found[0] if found else None

    @cached_property
    def motor_limits(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Least and largest target of each motor; without bounds where no action space drives motors."""
        for space in self.action_spaces.values():
            if space.drives == "motors":
                return space.low, space.high
        count = len(self.motors)
        return np.full(count, -np.inf), np.full(count, np.inf)

    @cached_property
    def motor_units(self) -> tuple[str, ...]:
        """Units of the motors' targets; rad where no action space drives motors."""
        found = [space.units for space in self.action_spaces.values() if space.drives == "motors"]
        return found[0] if found else ("rad",) * len(self.motors)

    @property
    def driven(self) -> tuple[str, ...]:
        """The motors that are actuators of `mjcf`: all but rotors."""
        return () if self.rotors is not None else self.motors

    @cached_property
    def stance(self) -> NDArray[np.float64]:
        """Motor targets at rest: the joints' angles for servos that follow angles, 0 for others."""
        angle = dict(zip(self.joints, self.rest.tolist(), strict=True))
        pairs = zip(self.motors, self.servos, strict=True)
        return np.array([angle.get(motor, 0.0) if servo == "position" else 0.0 for motor, servo in pairs])

    def with_space(self, space: str) -> RobotModel:
        """Return the same robot with another action space as its own.

        Raises
        ------
        InputError
            If it has no such action space.
        """
        if space not in self.action_spaces:
            known = ", ".join(self.action_spaces)
            raise InputError(f"robot {self.name!r} has no action space {space!r}; choose among {known}")
        rest = {name: one for name, one in self.action_spaces.items() if name != space}
        return replace(self, action_spaces={space: self.action_spaces[space]} | rest)
