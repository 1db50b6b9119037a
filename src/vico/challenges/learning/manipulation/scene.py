"""The physics of a manipulation environment: a robot, a box, the ground and a table, as a model of MuJoCo's.

Cities are simulated by `vico.sim`, whose scenes hold streets, people and vehicles. A learner needs nothing of that but
millions of steps, so this is a model of its own: the same robot from the same MJCF, and settings of contact that hold
things (elliptic cones, `impratio` 10).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import LIMB, TOUCH, MobileManipulator, RobotModel, robot_model
from vico.challenges.learning.manipulation.options import PHYSICS_STEP
from vico.io.mujoco import mujoco
from vico.kinematics.arm import Chain

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
class Thing:
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
        _put_brakes_on(spec)
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
    return _indexed(spec.compile(), robot, base)


def _put_brakes_on(spec: Any) -> None:
    """Fix the base to the ground, without wheels."""
    for joint in list(spec.body("base").joints):
        spec.delete(joint)
    for actuator in list(spec.actuators):
        if actuator.name in ("forward", "yaw"):
            spec.delete(actuator)
    for tendon in list(spec.tendons):
        spec.delete(tendon)
    for name in ("left_wheel", "right_wheel"):
        spec.delete(spec.body(name))


def _indexed(model: Any, robot: RobotModel, base: str) -> Scene:
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


def write_thing(model: Any, thing: Thing) -> None:
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


def listen() -> None:
    """Have MuJoCo keep to itself what it would append to a file in the folder people happen to be in.

    Motion that breaks down is noticed by its numbers.
    """
    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(_ignore)


def _ignore(message: str) -> None:
    """Say nothing: MuJoCo calls from C, on any thread."""
