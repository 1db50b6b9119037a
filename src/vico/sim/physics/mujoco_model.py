"""MuJoCo's model of a scene, and kernels that read and write its arrays.

The model has options, ground and solids, pools of movers and objects, and robots. Kernels read the motion of robots out
of MuJoCo's arrays, and write poses into them, of many at once.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import BUMP, BUMPER, LIMB, TOUCH, RobotModel
from vico.errors import InputError
from vico.io.compiled import compiled
from vico.io.mujoco import mujoco
from vico.sim.physics.collision_shapes import SLACK, find_near, is_clear, moved_poses
from vico.sim.physics.records import (
    BALL,
    BOX,
    COARSE,
    CONTACT_FORCE,
    CONTACT_NORMAL,
    CONTACT_POSITION,
    CYLINDER,
    PARTS,
    SOLVER_STEPS,
    Capacity,
    StaticScene,
)
from vico.world.heights import HeightField

SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)
#: Height at which unused movers and objects wait, metres.
PARKED = -500.0
#: Metres between parked bodies.
PARKED_APART = 20.0
#: Height at which robots hang that are not in the scene, metres: they have weight, and the ground is solid from below.
PARKED_ROBOTS = 3000.0
#: Finest grid of the ground, metres: finer ones cost time and give robots nothing.
_CELL = 2.0
#: ... and where it has kerbs, which are ramps half a metre wide then.
_KERB_CELL = 0.5
#: Ground that rises by less is level, metres.
_LEVEL = 1e-4
#: What ground and objects say of what they touch; solids meet whatever has their bit, outlines of robots too.
_SOLID = {"contype": TOUCH, "conaffinity": TOUCH | LIMB}
SOLID = 8
#: Groups of shapes: rays meet all but the outlines of robots.
SOLID_GROUPS = np.array([1, 1, 1, 1, 0, 0], np.uint8)
_OUTLINES = 4
#: Extents and kilograms that objects are compiled with; every engine writes its own.
OBJECT_HALF, OBJECT_MASS = 0.15, 1.0
_FRICTION = [0.6, 0.005, 0.0001]
#: What objects touch: contype and conaffinity of their parts.
OBJECT_BITS = TOUCH | SOLID, TOUCH | LIMB
_SHAPES = {
    BOX: mujoco.mjtGeom.mjGEOM_BOX,
    CYLINDER: mujoco.mjtGeom.mjGEOM_CYLINDER,
    BALL: mujoco.mjtGeom.mjGEOM_SPHERE,
}
#: How much harder friction is than contact, by whether it has to hold things. Held things creep out of a grasp where
#: friction is soft, 5 kg 24 mm a minute at 10 and less than 1 mm at 100; wheels and feet follow commands alike at 1, at
#: 60 % of the cost.
FRICTION = {True: 100.0, False: 1.0}


def standing_pose(
    height: HeightField, model: RobotModel, place: NDArray[np.float64]
) -> tuple[list[float], list[float]]:
    """Position and quaternion of a base that stands along the slope of the ground."""
    x, y, yaw = (float(v) for v in place)
    a, b = model.half_length, model.half_width
    c, s = np.cos(yaw), np.sin(yaw)
    ends = np.array([[a * c, a * s], [-a * c, -a * s], [-b * s, b * c], [b * s, -b * c]]) + place[:2]
    front, back, left, right = (float(h) for h in height(ends))
    forward = np.array([2 * a * c, 2 * a * s, front - back])
    sideways = np.array([-2 * b * s, 2 * b * c, left - right])
    up = np.cross(forward, sideways)
    forward, up = forward / np.linalg.norm(forward), up / np.linalg.norm(up)
    rotation = np.column_stack([forward, np.cross(up, forward), up])
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    ground = float(height(np.array([x, y])))
    return [x, y, ground + model.stand / float(up[2]) + 0.01], quaternion.tolist()


#: Bytes that MuJoCo may take for contacts and its solver: people in a heap on a robot that lies need more than it would
#: choose. The system gives what is used.
_WORKING_MEMORY = 128 << 20


def compiled_model(scene: StaticScene, models: tuple[RobotModel, ...], capacity: Capacity) -> Any:
    """Compile a scene."""
    spec = mujoco.MjSpec()
    spec.memory = _WORKING_MEMORY
    _set_options(spec)
    _add_scene(spec, scene)
    for index, model in enumerate(models):
        _add_robot(spec, index, model)
    _add_movers(spec, capacity)
    _add_objects(spec, capacity)
    return spec.compile()


def _set_options(spec: Any) -> None:
    spec.option.timestep = COARSE / SOLVER_STEPS[COARSE]
    # Servo damping is integrated implicitly: stable for light legs.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Parked objects sleep, and what never moves is not computed again at every step. Nobody who moves at all falls
    # asleep later: how near one is to it is no part of MuJoCo's state, and a restored run has to go on bit for bit.
    spec.option.enableflags |= SLEEP
    spec.option.sleep_tolerance = 0.0
    # Bad numbers are an error here; MuJoCo would put everybody back to the start.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    # Whether to start from the last solution is decided for everybody at once: what one robot meets would change the
    # last bits of another's motion a street away. Islands are solved each for itself, and converge as soon from zero.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_WARMSTART)
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = FRICTION[False]


def robot_spec(model: RobotModel) -> Any:
    """Return a robot alone, as MuJoCo's specification: its outline marked, all that touches told to meet solids.

    Raises
    ------
    InputError
        If its base does not float.
    """
    robot = mujoco.MjSpec.from_string(model.mjcf)
    root = robot.body("base")
    if not any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in root.joints):
        raise InputError(f"physics: the body 'base' of robot {model.name!r} has no free joint; give it one")
    for geom in robot.geoms:
        if geom.name == BUMPER:
            geom.group = _OUTLINES
        if geom.contype or geom.conaffinity & (TOUCH | BUMP):
            geom.contype |= SOLID
    return robot


def _add_robot(spec: Any, index: int, model: RobotModel) -> None:
    robot = robot_spec(model)
    _set_options(robot)
    root = robot.body("base")
    root.sleep = mujoco.mjtSleepPolicy.mjSLEEP_NEVER
    root.pos = [10.0 * index, 0.0, model.stand]
    for site in robot.sites:
        for axis in range(6):
            gear = [0.0] * 6
            gear[axis] = 1.0
            robot.add_actuator(
                name=thruster(site.name, axis), target=site.name, trntype=mujoco.mjtTrn.mjTRN_SITE, gear=gear
            )
    spec.attach(robot, prefix=f"r{index}/", frame=spec.worldbody.add_frame())


def thruster(site: str, axis: int) -> str:
    """Name of what pushes a site along one of its axes (0-2), or turns it about it (3-5)."""
    return f"thrust/{site}/{axis}"


def _add_scene(spec: Any, scene: StaticScene) -> None:
    """Ground as one body, solids as the world's own."""
    world = spec.worldbody
    bits = {"contype": 0, "conaffinity": SOLID}
    _add_ground(spec, scene)
    for index, points in enumerate(scene.hulls):
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        spec.add_mesh(
            name=f"hull{index}",
            uservert=(points - middle).astype(np.float32).ravel().tolist(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
        )
        world.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"hull{index}", pos=middle.tolist(), **bits)
    for x, y, z, yaw, a, b, c in scene.boxes.tolist():
        turn = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        world.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[a, b, c], pos=[x, y, z], quat=turn, **bits)
    for x, y, z, radius, length in scene.pillars.tolist():
        world.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[radius, length, 0], pos=[x, y, z], **bits)


def _add_ground(spec: Any, scene: StaticScene) -> None:
    ground = spec.worldbody.add_body(name="ground")
    if scene.squares is None:
        heights, half = ground_grid(scene)
        low, high = float(heights.min()), float(heights.max())
        if high - low < _LEVEL:
            ground.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[half, half, 1.0], pos=[0, 0, low], **_SOLID)
        else:
            _add_field(spec, ground, (0.0, 0.0), heights, half)
        return
    for west, south in scene.squares.tolist():
        half = scene.side / 2
        # Neighbouring squares have the same heights along their common edge.
        count = max(round(scene.side / _KERB_CELL), 1) + 1
        x, y = (np.linspace(first, first + scene.side, count) for first in (west, south))
        xx, yy = np.meshgrid(x, y)
        _add_field(spec, ground, (west + half, south + half), scene.height(np.stack([xx, yy], axis=-1)), half)


def _add_field(spec: Any, body: Any, middle: tuple[float, float], heights: NDArray[np.float64], half: float) -> None:
    """Add a square of ground, metres; a plane would be one without an end."""
    low, high = float(heights.min()), float(heights.max())
    name, rise = f"ground{len(spec.hfields)}", max(high - low, _LEVEL)
    spec.add_hfield(
        name=name,
        size=[half, half, rise, 5.0],
        nrow=heights.shape[0],
        ncol=heights.shape[1],
        userdata=((heights - low) / rise).astype(np.float32).ravel().tolist(),
    )
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=name, pos=[*middle, low], **_SOLID)


def ground_grid(scene: StaticScene, *, kerbs: bool = True) -> tuple[NDArray[np.float64], float]:
    """Heights of the ground on a square grid, and half the side of that; without kerbs, its cells are 2 m or more."""
    field = scene.height
    if field.heights.shape[0] != field.heights.shape[1]:
        raise InputError("physics: the height field has to be square")
    if field.steps is None or not kerbs:
        count = min(field.heights.shape[0], round(2 * field.half / _CELL) + 1)
    else:
        count = min(field.steps.edge.shape[0], round(2 * field.half / _KERB_CELL) + 1)
    axis = np.linspace(-field.half, field.half, max(count, 2))
    xx, yy = np.meshgrid(axis, axis)
    return field(np.stack([xx, yy], axis=-1)), field.half


def _add_movers(spec: Any, capacity: Capacity) -> None:
    """Add the kinematic bodies that people and vehicles near robots are taken from, parked.

    They meet links and objects, and the outline of robots that everybody else keeps clear of.
    """
    bits = {"contype": TOUCH | BUMP, "conaffinity": TOUCH | BUMP | LIMB}
    shape = {**bits, "condim": 1, "priority": 2, "solref": [0.01, 1.0]}
    for index in range(capacity.people):
        body = spec.worldbody.add_body(name=f"person{index}", mocap=True, pos=[0, 0, PARKED])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.28, 0.85, 0], **shape)
    for index in range(capacity.vehicles):
        body = spec.worldbody.add_body(name=f"vehicle{index}", mocap=True, pos=[0, 0, PARKED])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[2.3, 0.95, 0.75], **shape)


def _add_objects(spec: Any, capacity: Capacity) -> None:
    """Add free bodies that movable objects near robots are taken from, asleep and parked; the first part is a box."""
    for index in range(capacity.objects):
        body = spec.worldbody.add_body(name=f"object{index}", pos=parked_object(index))
        body.sleep = mujoco.mjtSleepPolicy.mjSLEEP_INIT
        body.add_freejoint()
        for number, shape in enumerate(PARTS):
            body.add_geom(
                type=_SHAPES[shape],
                size=[OBJECT_HALF] * 3,
                mass=0.0 if number else OBJECT_MASS,
                condim=4,
                friction=_FRICTION,
                solref=[0.01, 1.0],
                contype=OBJECT_BITS[0],
                conaffinity=OBJECT_BITS[1],
            )


def parked_robot(robot: int) -> list[float]:
    """Position and quaternion of a robot that is not in the scene."""
    return [PARKED_APART * robot, 0.0, PARKED_ROBOTS, 1.0, 0.0, 0.0, 0.0]


def parked_object(slot: int) -> list[float]:
    """Where the object of a slot waits."""
    return [PARKED_APART * slot, PARKED_APART, PARKED]


@compiled
def base_motion(positions, speeds, first):
    """Return the motion of bases.

    Parameters
    ----------
    positions, speeds
        All coordinates, as MuJoCo orders them.
    first
        Where those of each base begin, shape ``(k, 2)``.

    Returns
    -------
    tuple of ndarray
        Position, rotation, velocity, angular velocity in the base's frame and quaternion, as `Base` has them; row =
        base.
    """
    n = len(first)
    position, quaternion, rotation = np.empty((n, 3)), np.empty((n, 4)), np.empty((n, 3, 3))
    velocity, angular_velocity_body = np.empty((n, 3)), np.empty((n, 3))
    for k in range(n):
        q, v = first[k, 0], first[k, 1]
        for i in range(3):
            position[k, i] = positions[q + i]
            velocity[k, i], angular_velocity_body[k, i] = speeds[v + i], speeds[v + 3 + i]
        turn = q + 3  # its quaternion follows its position
        w, x, y, z = positions[turn], positions[turn + 1], positions[turn + 2], positions[turn + 3]
        quaternion[k] = w, x, y, z
        rotation[k, 0] = w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
        rotation[k, 1] = 2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)
        rotation[k, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z
    return position, rotation, velocity, angular_velocity_body, quaternion


@compiled
def motion_of(positions, speeds, first, angle, rate):
    """Return what `Motion` holds of robots of one kind, in its order.

    Parameters
    ----------
    angle, rate
        Where positions and speeds of the joints are, shape ``(k, joints)``; the rest is as for `base_motion`.
    """
    position, rotation, velocity, angular_velocity_body, _ = base_motion(positions, speeds, first)
    angles, rates = np.empty(angle.shape), np.empty(rate.shape)
    for k in range(angle.shape[0]):
        for j in range(angle.shape[1]):
            angles[k, j], rates[k, j] = positions[angle[k, j]], speeds[rate[k, j]]
    return position, velocity, rotation, angular_velocity_body, angles, rates


@compiled
def place_bodies(poses, entity, where, positions, quaternions):
    """Put kinematic bodies at their poses (middle and yaw), and those that are nobody (entity 0) out of the way."""
    for k in range(len(poses)):
        body = where[k]
        if entity[k]:
            positions[body] = poses[k, :3]
            quaternions[body] = math.cos(poses[k, 3] / 2), 0.0, 0.0, math.sin(poses[k, 3] / 2)
        else:
            positions[body] = PARKED_APART * k, 0.0, PARKED
            quaternions[body] = 1.0, 0.0, 0.0, 0.0


class LinkState(NamedTuple):
    """Links of all robots as `begin_frame` takes them; row = link, but for `places` and `motion` (body), `centre`.

    Attributes
    ----------
    owner, body, radius, root
        As `CompiledScene.link_parts`.
    places, motion, centre
        Positions of bodies, their angular and linear velocities about the centres of their robots' masses, and those
        centres, as MuJoCo has them.
    meets
        Which links might meet solids, bool; written.
    """

    owner: NDArray[np.int64]
    body: NDArray[np.int64]
    radius: NDArray[np.float64]
    root: NDArray[np.int64]
    places: NDArray[np.float64]
    motion: NDArray[np.float64]
    centre: NDArray[np.float64]
    meets: NDArray[np.bool_]


@compiled
def begin_frame(frame, known, state, solids, links, movers, mocap):
    """Say which links could touch something solid in a frame, and move people and vehicles on to its end.

    Parameters
    ----------
    frame
        Its length, seconds.
    known
        Seconds since the poses and velocities of `links` were computed; negative: they are of another state.
    state
        Positions and speeds, where in them each robot's base begins, and where to put the velocities of bases.
    solids
        As `SolidCells.cells`, reaches of the robots, and `near`, which is written: of which robots links might meet
        solids, bool, shape ``(robots,)``.
    links
        A `LinkState`.
    movers
        Entities, poses at the beginning and at the end of the motion, and seconds of it that have passed.
    mocap
        Which kinematic body each is, and where positions and quaternions of those are.
    """
    positions, speeds, first, before = state
    cells, reach, near = solids
    find_near(cells, reach, frame, (positions, speeds, first), near)
    for k in range(len(first)):
        for i in range(3):
            before[k, i] = speeds[first[k, 1] + i]
    for k in range(len(links.owner)):
        links.meets[k] = near[links.owner[k]]
        if known < 0.0 or not links.meets[k]:
            continue
        b, centre, radius = links.body[k], links.centre[links.root[k]], links.radius[k]
        wx, wy, wz, vx, vy, vz = links.motion[b]
        x, y, z = links.places[b]
        ax, ay, az = x - centre[0], y - centre[1], z - centre[2]
        vx, vy, vz = vx + wy * az - wz * ay, vy + wz * ax - wx * az, vz + wx * ay - wy * ax
        speed = math.sqrt(vx * vx + vy * vy + vz * vz) + math.sqrt(wx * wx + wy * wy + wz * wz) * radius
        if 2.0 * speed * (frame + known) < SLACK:
            links.meets[k] = not is_clear(cells, (x, y, z), radius + SLACK)
    entity, start, end, time = movers
    if time[0] < time[1] - 1e-9 and entity.any():
        time[0] += frame
        poses = moved_poses(start, end, time)
        place_bodies(poses, entity, mocap[0], mocap[1], mocap[2])


def solved_contacts(data: Any) -> NDArray[np.float64]:
    """Contacts that the last step solved: two shapes, and the columns `CONTACT_POSITION` and on, shape ``(n, 9)``."""
    contact, solved = data.contact, np.asarray(data.contact.efc_address) >= 0
    found = np.empty((int(solved.sum()), 9))
    found[:, :2] = np.asarray(contact.geom)[solved]
    found[:, CONTACT_POSITION] = np.asarray(contact.pos)[solved]
    found[:, CONTACT_NORMAL] = np.asarray(contact.frame)[solved, :3]
    # The first row of an elliptic or frictionless contact is its normal force.
    found[:, CONTACT_FORCE] = data.efc_force[np.asarray(contact.efc_address)[solved]]
    return found
