"""The scene of a manipulation environment: options, physics in MuJoCo, motors, and what the seed decides.

A robot, a box, the ground and a table are one model. Actions move the targets of the arm's motors. The seed decides
boxes, where they stand, where they are to be, and how the arm begins.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import LIMB, TOUCH, MobileManipulator, RobotModel, robot_model
from vico.errors import EmptyInputError, InputError
from vico.geometry import yaw_quaternion
from vico.io.mujoco import mujoco
from vico.kinematics.arm import Chain, reach_pose
from vico.kinematics.hand_paths import downward

#: Control steps a second, and seconds of a step of physics.
RATE, PHYSICS_STEP = 20, 0.01
#: Steps of physics in one of control.
SUBSTEPS = 5

_CHOICES = {
    "reward": ("staged", "paper"),
    "observation": ("full", "paper"),
    "surface": ("any", "ground", "table"),
    "base": ("fixed", "wheels"),
    "start": ("ready", "folded"),
}


@dataclass(frozen=True, kw_only=True)
class ManipulationOptions:
    """Options of a manipulation environment.

    Attributes
    ----------
    reward
        ``"staged"``: parts that follow each other (align, down, close, lift, hold, place). ``"paper"``: the four terms
        of the paper.
    observation
        ``"paper"``: 31 numbers as the paper lists them. ``"full"``: these, and size and turn of the box to the hand
        and which fingers press on it, 42 numbers.
    surface
        What boxes stand on: ``"ground"``, ``"table"``, or ``"any"``, each every second time.
    base
        ``"fixed"``: with its brakes on, which steps twice as fast. ``"wheels"``: it stands on its wheels, as in a
        simulation of a city, and may roll.
    start
        ``"ready"``: the hand points down in front of the base. ``"folded"``: the arm is folded as on a drive.
    oracle_grasp
        Whether a box is fastened to the hand once both pads press on it while the jaw is being closed, and let go of
        when it is opened. Nothing else is given. Without it friction alone holds a box.
    max_steps
        Of an episode.
    terminate_on_success
        Whether an episode ends with success. If not, what has been achieved has to be kept until the end.
    joint_step, finger_step
        What an action of 1 moves a target by, rad and metres.

    Raises
    ------
    InputError
        If a value is not one of these.
    """

    reward: str = "staged"
    observation: str = "full"
    surface: str = "any"
    base: str = "fixed"
    start: str = "ready"
    oracle_grasp: bool = False
    max_steps: int = 250
    terminate_on_success: bool = False
    joint_step: float = 0.06
    finger_step: float = 0.01

    def __post_init__(self) -> None:
        for name, choices in _CHOICES.items():
            value: Any = getattr(self, name)
            if value not in choices:
                raise InputError(f"env: {name} is {value!r}; use {' or '.join(map(repr, choices))}")
        if self.max_steps < 1:
            raise InputError(f"env: max_steps is {self.max_steps}; it has to be 1 or more")
        for name, most in (("joint_step", 0.2), ("finger_step", 0.05)):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0.0 < value <= most):
                raise InputError(f"env: {name} is {value}; it has to be above 0 and at most {most}")


Array = NDArray[np.float64]

#: Half extents of the table, metres: a block that stands in the ground as deep as it is too high.
TABLE = np.array([0.22, 0.6, 0.5])
#: Middle of the table in front of the base, metres.
TABLE_X = 0.62
#: What is between the middle and each pad when the jaw is shut, metres.
PAD = 0.008
_AWAY = -2.0
_IMPRATIO = 10.0
# How a contact sensor sums several contacts up: mju reduce "netforce".
_NET_FORCE = 3
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True)
class Scene:
    """A compiled model, and where in its arrays things are.

    Attributes
    ----------
    model
        MuJoCo's; each copy of an environment has one of its own.
    robot
        Whose arm it is.
    chain
        Of its joints.
    joints, joint_rates
        Of the arm and both fingers in positions and speeds, int64, shape ``(9,)``.
    thing, thing_rate
        First number of the box in positions and speeds.
    base
        First number of the base in positions; None where it is fixed.
    stand
        Height of the base's frame above the ground, metres.
    """

    model: Any
    robot: RobotModel
    chain: Chain
    joints: NDArray[np.int64]
    joint_rates: NDArray[np.int64]
    thing: int
    thing_rate: int
    base: int | None
    stand: float

    @property
    def controller(self) -> MobileManipulator:
        """Bounds and lengths of the arm."""
        controller = self.robot.controller
        assert isinstance(controller, MobileManipulator)
        return controller

    @property
    def state_size(self) -> int:
        """How many numbers MuJoCo's state of a copy has: time, positions, speeds."""
        return int(mujoco.mj_stateSize(self.model, _STATE))


@dataclass(frozen=True)
class BoxParameters:
    """The box of an episode, and what it stands on.

    Attributes
    ----------
    half
        Half its sides, metres, shape ``(3,)``.
    mass
        Kilograms.
    friction
        Of its surface.
    surface
        Height of what it stands on, metres; 0 is the ground.
    """

    half: Array
    mass: float
    friction: float
    surface: float


def compile_scene(base: str) -> Scene:
    """Compile the model with its base ``"fixed"`` or on ``"wheels"``."""
    robot = robot_model("manipulator")
    spec = mujoco.MjSpec.from_string(robot.mjcf)
    option = spec.option
    option.timestep, option.impratio = PHYSICS_STEP, _IMPRATIO
    option.integrator, option.cone = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, mujoco.mjtCone.mjCONE_ELLIPTIC
    solid = {"contype": TOUCH, "conaffinity": TOUCH | LIMB, "friction": [0.8, 0.02, 0.001]}
    world = spec.worldbody
    world.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5.0, 5.0, 0.1], **solid)
    table = world.add_body(name="table", pos=[TABLE_X, 0.0, _AWAY])
    table.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_BOX, size=TABLE.tolist(), **solid)
    thing = world.add_body(name="thing", pos=[0.62, 0.0, 0.1])
    thing.add_freejoint()
    # Its own friction counts, whatever it touches.
    box = {**solid, "friction": [0.8, 0.02, 0.001], "condim": 4, "priority": 1, "solref": [0.01, 1.0]}
    thing.add_geom(name="thing", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.05] * 3, mass=0.5, **box)
    if base == "fixed":
        # The base is fixed to the ground, without wheels.
        for joint in list(spec.body("base").joints):
            spec.delete(joint)
        for actuator in list(spec.actuators):
            if actuator.name in ("forward", "yaw"):
                spec.delete(actuator)
        for tendon in list(spec.tendons):
            spec.delete(tendon)
        for wheel in ("left_wheel", "right_wheel"):
            spec.delete(spec.body(wheel))
    fingers = robot.motors[7:9]
    for name in fingers:
        pad = spec.body(name).geoms[1]
        pad.name = f"{name}_pad"
        spec.add_sensor(
            name=name,
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=pad.name,
            reftype=mujoco.mjtObj.mjOBJ_GEOM,
            refname="thing",
            intprm=[1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), _NET_FORCE, 1],
        )
    weld = spec.add_equality(
        name="grasp", type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1="gripper", name2="thing"
    )
    weld.active = False
    return _scene_of_model(spec.compile(), robot, base)


def _scene_of_model(model: Any, robot: RobotModel, base: str) -> Scene:
    arm = robot.controller
    assert isinstance(arm, MobileManipulator)
    names = robot.motors[:9]
    thing = model.body("thing")
    root = model.body("base")
    return Scene(
        model=model,
        robot=robot,
        chain=Chain(arm.places, arm.axes, arm.low, arm.high, arm.grip),
        joints=np.array([model.joint(name).qposadr[0] for name in names]),
        joint_rates=np.array([model.joint(name).dofadr[0] for name in names]),
        thing=int(model.jnt_qposadr[thing.jntadr[0]]),
        thing_rate=int(model.jnt_dofadr[thing.jntadr[0]]),
        base=None if base == "fixed" else int(model.jnt_qposadr[root.jntadr[0]]),
        stand=robot.stand,
    )


def write_thing(model: Any, thing: BoxParameters) -> None:
    """Write a box and its table into a copy's model, with what the solver derives from them."""
    body, geom = model.body("thing").id, model.geom("thing").id
    half, squares = thing.half, thing.half * thing.half
    model.geom_size[geom] = half
    model.geom_rbound[geom] = np.sqrt(squares.sum())
    model.geom_aabb[geom, 3:] = half
    model.bvh_aabb[model.body_bvhadr[body], 3:] = half
    model.geom_friction[geom, 0] = thing.friction
    inertia = thing.mass / 3.0 * (squares.sum() - squares)
    model.body_mass[body] = model.body_subtreemass[body] = thing.mass
    model.body_inertia[body] = inertia
    # Mean inverse inertia of a free body, in translation and in rotation: what contacts are scaled by.
    slow = np.array([1.0 / thing.mass, float((1.0 / inertia).mean())])
    model.body_invweight0[body] = slow
    first = int(model.body_dofadr[body])
    model.dof_M0[first : first + 6] = np.concatenate([np.full(3, thing.mass), inertia])
    model.dof_invweight0[first : first + 6] = np.repeat(slow, 3)
    height = thing.surface - TABLE[2] if thing.surface > 0.0 else _AWAY
    model.body_pos[model.body("table").id, 2] = height


def silence_warnings() -> None:
    """Have MuJoCo keep to itself what it would append to a file in the folder people happen to be in.

    Motion that breaks down is noticed by its numbers.
    """
    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(lambda message: None)


#: Of an action: the arm's joints and the jaw.
ACTIONS = 8
#: Column of the jaw in joints, targets and actions: it stands behind the arm's seven.
JAW = 7
# Targets run ahead of joints by no more, rad, and fingers past what they press on, metres: 150 Nm and 60 N.
_AHEAD, _PAST = 0.1, 0.03


class Motors(NamedTuple):
    """Bounds of joints and jaw, and what an action of 1 moves them by, rad and metres, shape ``(8,)`` each."""

    low: Array
    high: Array
    step: Array

    def move_targets(self, targets: Array, joints: Array, actions: Array) -> Array:
        """Return targets moved by actions, within bounds and not far ahead of the joints; shape ``(n, 8)`` each."""
        wanted = targets + np.clip(actions, -1.0, 1.0) * self.step
        ahead = np.append(np.full(7, _AHEAD), _PAST)
        return np.clip(np.clip(wanted, joints - ahead, joints + ahead), self.low, self.high)


def motors_of(arm: MobileManipulator, options: ManipulationOptions) -> Motors:
    """Return those of an arm."""
    step = np.append(np.full(7, options.joint_step), options.finger_step)
    return Motors(np.append(arm.low, 0.0), np.append(arm.high, arm.opening), step)


#: Sides of a box, metres; kilograms; friction; height of the table, metres.
SIDES, MASS, FRICTION, TABLES = (0.05, 0.25), (0.1, 2.0), (0.6, 1.0), (0.15, 0.5)
#: Where boxes stand: from the middle of the base, metres, and off straight ahead, rad.
DISTANCE, BEARING = (0.54, 0.70), 0.45
#: From a box to its goal at least; goals above it, metres.
APART, RAISED = 0.2, (0.15, 0.25)
#: Noise of the arm's first angles, rad; way of each finger then, metres.
NOISE, OPENING = 0.05, 0.08
#: Where a hand that is ready is, in the base's frame, metres.
READY = np.array([0.5, -0.1, 0.75])
# How far fingers are told to go past what they hold, and above what it stood on it is held, metres.
_SQUEEZE, _HELD = 0.03, (0.12, 0.2)
_TRIES = 60


@dataclass(frozen=True)
class EpisodeDraw:
    """How an episode begins.

    Attributes
    ----------
    thing
        The box.
    position, rotation
        Of its middle, metres, shape ``(3,)``, and its quaternion, shape ``(4,)``.
    goal
        Where its middle is to be, metres, shape ``(3,)``.
    arm
        Angles, rad, shape ``(7,)``.
    opening, target
        Way of each finger and where it is told to be, metres.
    """

    thing: BoxParameters
    position: Array
    rotation: Array
    goal: Array
    arm: Array
    opening: float
    target: float


class Hand(NamedTuple):
    """An arm and the height of its base's frame above the ground, metres."""

    chain: Chain
    stand: float


@cache
def hand_of_robot() -> Hand:
    """Return the arm that is drawn for."""
    robot = robot_model("manipulator")
    arm = robot.controller
    assert isinstance(arm, MobileManipulator)
    return Hand(Chain(arm.places, arm.axes, arm.low, arm.high, arm.grip), robot.stand)


@cache
def ready_angles() -> tuple[float, ...]:
    """Return the arm's angles with the hand down in front of the base, rad."""
    found = reach_pose(
        hand_of_robot().chain, downward(READY, np.array([0.0, 1.0]), 0.0), robot_model("manipulator").rest[:7]
    )
    assert found is not None
    return tuple(found.tolist())


def draw_spot(chance: np.random.Generator) -> Array:
    """Draw a place in front of the base, metres, shape ``(2,)``."""
    away, bearing = chance.uniform(*DISTANCE), chance.uniform(-BEARING, BEARING)
    return np.array([away * math.cos(bearing), away * math.sin(bearing)])


def draw_spot_apart(chance: np.random.Generator, other: Array) -> Array:
    """Draw a place that is not near another one, metres, shape ``(2,)``."""
    for _ in range(_TRIES):
        found = draw_spot(chance)
        if math.dist(found, other) >= APART:
            return found
    raise EmptyInputError(f"env: no place {APART} m from {other} in front of the robot in {_TRIES} draws; draw anew")


def standing_box(chance: np.random.Generator, options: ManipulationOptions) -> EpisodeDraw:
    """Draw a box on the ground or on a table, turned anyhow; its goal is where it stands."""
    half = chance.uniform(*SIDES, 3) / 2
    mass, friction = float(chance.uniform(*MASS)), float(chance.uniform(*FRICTION))
    # Both are drawn whatever is chosen: the rest of an episode does not depend on the choice.
    on_table, height = bool(chance.random() < 0.5), float(chance.uniform(*TABLES))
    if options.surface != "any":
        on_table = options.surface == "table"
    thing = BoxParameters(half, mass, friction, height if on_table else 0.0)
    place, yaw = draw_spot(chance), float(chance.uniform(-math.pi, math.pi))
    position = np.array([*place, thing.surface + half[2]])
    rest = np.array(ready_angles()) if options.start == "ready" else robot_model("manipulator").rest[:7]
    chain = hand_of_robot().chain
    arm = np.clip(rest + chance.uniform(-NOISE, NOISE, 7), chain.low, chain.high)
    return EpisodeDraw(thing, position, yaw_quaternion(yaw), position.copy(), arm, OPENING, OPENING)


def held_box(chance: np.random.Generator, options: ManipulationOptions) -> EpisodeDraw:
    """Draw a box in the closed jaw above a table or the ground; its goal is where it is.

    Fingers stand on its faces and are told to go past them: friction holds it from the first step on.
    """
    for _ in range(_TRIES):
        drawn = standing_box(chance, options)
        hand, thing = hand_of_robot(), drawn.thing
        up = float(chance.uniform(*_HELD))
        position = drawn.position + np.array([0.0, 0.0, up])
        grip = np.array([*position[:2], grip_height(thing.half[2], position[2]) - hand.stand])
        yaw = 2.0 * math.atan2(drawn.rotation[3], drawn.rotation[0])
        across = 0 if thing.half[0] <= thing.half[1] else 1
        turn = yaw + across * math.pi / 2
        for sign in (1.0, -1.0):
            along = sign * np.array([math.cos(turn), math.sin(turn)])
            arm = reach_pose(hand.chain, downward(grip, along, 0.0), np.array(ready_angles()))
            if arm is not None:
                opening = float(thing.half[across]) - PAD
                held = replace(drawn, position=position, goal=position.copy(), arm=arm, opening=opening)
                return replace(held, target=max(opening - _SQUEEZE, 0.0))
    raise EmptyInputError(f"env: no box that the arm can hold in {_TRIES} draws; draw anew")


def grip_height(half: float, middle: float) -> float:
    """Return where pads hold a box of half a height that stands with its middle at a height, metres."""
    return max(middle + half - 0.06, middle - half + 0.047)


def goal_beside(chance: np.random.Generator, drawn: EpisodeDraw) -> EpisodeDraw:
    """Draw a goal on what the box stands on, or is held above, at another place."""
    place = draw_spot_apart(chance, drawn.position[:2])
    return replace(drawn, goal=np.array([*place, drawn.thing.surface + drawn.thing.half[2]]))


def goal_above(chance: np.random.Generator, drawn: EpisodeDraw) -> EpisodeDraw:
    """Draw a goal above the box."""
    return replace(drawn, goal=drawn.position + np.array([0.0, 0.0, chance.uniform(*RAISED)]))
