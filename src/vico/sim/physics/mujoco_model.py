"""What MuJoCo's model of a run is made of: options, ground and solids, a stock of kinematic bodies, standing robots."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import BUMP, TOUCH, RobotModel
from vico.errors import InputError
from vico.sim.physics.engine import FRAME, StaticScene
from vico.world.heights import HeightField

#: MuJoCo's steps in a frame (1/150 s each), and in one for which extra sub-steps are asked (1/200 s).
SUBSTEPS, EXTRA_SUBSTEPS = 3, 4
SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)
#: Height at which the stock waits, metres.
PARKED = -500.0
#: Finest grid of the ground, metres: finer ones cost time and give robots nothing.
_CELL = 2.0
#: ... and where it has kerbs, which are ramps half a metre wide then.
_KERB_CELL = 0.5
#: Solids whose tops are lower than this above the ground are met by feet and wheels as well as bumpers, metres.
_LOW = 0.5


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


def set_options(spec: Any) -> None:
    """Set how a model is solved."""
    spec.option.timestep = FRAME / SUBSTEPS
    # Servo damping is integrated implicitly: stable for light legs.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Robots never sleep; what never moves does, and its poses are not computed again at every step.
    spec.option.enableflags |= SLEEP
    # Bad numbers are an error here; MuJoCo would put everybody back to the start.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 3.0


def add_scene(spec: Any, scene: StaticScene) -> None:
    """Ground and low solids as one body, tall solids as the world's own.

    Bodies whose bits do not match are passed over as a whole: feet and wheels are never compared with walls, which
    the bumper around them keeps away.
    """
    ground = spec.worldbody.add_body(name="ground")
    touch, bump = {"contype": TOUCH, "conaffinity": TOUCH}, {"contype": BUMP, "conaffinity": BUMP}
    both = {"contype": TOUCH | BUMP, "conaffinity": TOUCH | BUMP}

    def owner(top: float, foot: NDArray[np.float64]) -> tuple[Any, dict[str, int]]:
        low = top - float(scene.height(foot).max()) < _LOW
        return (ground, both) if low else (spec.worldbody, bump)

    heights, half = _grid(scene)
    low, high = float(heights.min()), float(heights.max())
    if high - low < 1e-4:
        ground.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[half, half, 1.0], pos=[0, 0, low], **touch)
    else:
        rows, columns = heights.shape
        spec.add_hfield(
            name="ground",
            size=[half, half, high - low, 5.0],
            nrow=rows,
            ncol=columns,
            userdata=((heights - low) / (high - low)).astype(np.float32).ravel().tolist(),
        )
        ground.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", pos=[0, 0, low], **touch)
    for index, points in enumerate(scene.hulls):
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        spec.add_mesh(
            name=f"hull{index}",
            uservert=(points - middle).astype(np.float32).ravel().tolist(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
        )
        body, bits = owner(float(points[:, 2].max()), points[:, :2])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"hull{index}", pos=middle.tolist(), **bits)
    for x, y, z, yaw, a, b, c in scene.boxes.tolist():
        body, bits = owner(z + c, np.array([x, y]))
        turn = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[a, b, c], pos=[x, y, z], quat=turn, **bits)
    for x, y, z, radius, length in scene.pillars.tolist():
        body, bits = owner(z + length, np.array([x, y]))
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[radius, length, 0], pos=[x, y, z], **bits)


def _grid(scene: StaticScene) -> tuple[NDArray[np.float64], float]:
    """Heights of the ground on a square grid, and half the side of that."""
    field = scene.height
    if field.heights.shape[0] != field.heights.shape[1]:
        raise InputError("physics: the height field has to be square")
    if field.steps is None:
        count = min(field.heights.shape[0], round(2 * field.half / _CELL) + 1)
    else:
        count = min(field.steps.edge.shape[0], round(2 * field.half / _KERB_CELL) + 1)
    axis = np.linspace(-field.half, field.half, max(count, 2))
    xx, yy = np.meshgrid(axis, axis)
    return field(np.stack([xx, yy], axis=-1)), field.half


def add_stock(spec: Any, people: int, vehicles: int) -> None:
    """Add the kinematic bodies that people and vehicles near robots are taken from, parked."""
    shape = {"contype": BUMP, "conaffinity": BUMP, "condim": 1, "priority": 2, "solref": [0.01, 1.0]}
    for index in range(people):
        body = spec.worldbody.add_body(name=f"person{index}", mocap=True, pos=[0, 0, PARKED])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.28, 0.85, 0], **shape)
    for index in range(vehicles):
        body = spec.worldbody.add_body(name=f"vehicle{index}", mocap=True, pos=[0, 0, PARKED])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[2.3, 0.95, 0.75], **shape)
