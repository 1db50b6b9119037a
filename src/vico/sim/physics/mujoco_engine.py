"""The physics engine of the default install: MuJoCo.

People, cars and buses near a robot are kinematic ("mocap") shapes out of a fixed stock; the rest of the stock is
parked far below the ground. They meet only the robots' bumpers, a box of each robot's whole outline, so that what
other movers keep clear of and what physics keeps clear of are the same.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.errors import SchemaError, VicoError
from vico.io.compiled import compiled
from vico.sim.bodies import Bodies
from vico.sim.physics.engine import FRAME, Base, StaticScene
from vico.sim.physics.mujoco_model import (
    EXTRA_SUBSTEPS,
    PARKED,
    SLEEP,
    SUBSTEPS,
    add_scene,
    add_stock,
    set_options,
    standing_pose,
)

#: Bodies within this distance of a robot can be met, metres.
NEAR = 10.0
#: Kinematic bodies are this much larger than what they stand for: soft contact never lets the real ones overlap.
_SKIN = 0.03
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class PhysicsError(VicoError, ArithmeticError):
    """The equations of motion have no finite solution any more."""


class PhysicsWarning(RuntimeWarning):
    """MuJoCo says that something is about to go wrong."""


# MuJoCo calls back from C, where an exception would end the process: what it says is kept until the step is over.
_SAID: list[str] = []


def _take_note(message: str) -> None:
    if len(_SAID) < 10:
        _SAID.append(message)


@compiled
def _gaps(position, half_length, half_width, centres):  # type: ignore[no-untyped-def]
    """Distance of every body's outline (at least) from the nearest of `centres`, metres."""
    out = np.empty(len(position))
    for k in range(len(position)):
        least = np.inf
        for c in range(len(centres)):
            least = min(least, math.hypot(position[k, 0] - centres[c, 0], position[k, 1] - centres[c, 1]))
        out[k] = least - max(half_length[k], half_width[k])
    return out


class MujocoEngine:
    """Robots in MuJoCo.

    Parameters
    ----------
    scene
        What never moves.
    models, places
        The robots, and where each stands at first: x, y, yaw, shape ``(n, 3)``.
    people, vehicles
        How many of each can be near robots at once; of more, the nearest count.
    """

    def __init__(
        self,
        scene: StaticScene,
        models: Sequence[RobotModel],
        places: NDArray[np.float64],
        *,
        people: int = 32,
        vehicles: int = 16,
    ) -> None:
        # By default MuJoCo appends its warnings to a file in the folder people happen to be in.
        if mujoco.get_mju_user_warning() is None:
            mujoco.set_mju_user_warning(_take_note)
        self._robots = tuple(models)
        self._people, self._vehicles = people, vehicles
        spec = mujoco.MjSpec()
        set_options(spec)
        add_scene(spec, scene)
        add_stock(spec, people, vehicles)
        for index, (model, place) in enumerate(zip(models, places, strict=True)):
            robot = mujoco.MjSpec.from_string(model.mjcf)
            set_options(robot)
            root = robot.body("base")
            root.sleep = mujoco.mjtSleepPolicy.mjSLEEP_NEVER
            root.pos, root.quat = standing_pose(scene.height, model, place)
            spec.attach(robot, prefix=f"r{index}/", frame=spec.worldbody.add_frame())
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._qpos, self._qvel = self._data.qpos, self._data.qvel
        self._place_scene()
        self._index()
        for index, model in enumerate(self._robots):
            self._data.qpos[self._angle[index]] = model.rest
            self._data.ctrl[self._motor[index]] = model.stance
        self._from = np.zeros((people + vehicles, 3))
        self._pace = np.zeros((people + vehicles, 3))
        self._left = 0.0
        self._size = mujoco.mj_stateSize(self._model, _STATE)
        self._park_all()

    def _index(self) -> None:
        m = self._model
        self._root, self._root_speed = [], []
        self._angle, self._rate, self._motor, self._links = [], [], [], []
        # Motors that follow angles: those alone have a stiffness that can be set.
        self._servo: list[NDArray[np.int64]] = []
        # What servos were last given; not part of the state, it only saves writing it again.
        self._gains_of: list[tuple[float, float] | None] = [None] * len(self._robots)
        self._forget()
        for index, model in enumerate(self._robots):
            prefix = f"r{index}/"
            motors = np.array([m.actuator(prefix + motor).id for motor in model.motors], np.int64)
            joints = [_joint_of(m, prefix + joint, driven=joint in model.motors) for joint in model.joints]
            self._motor.append(motors)
            self._servo.append(motors[[servo == "position" for servo in model.servos]])
            self._angle.append(_run_of(m.jnt_qposadr[joints]))
            self._rate.append(_run_of(m.jnt_dofadr[joints]))
            first = int(m.body(prefix + "base").jntadr[0])
            self._root.append(int(m.jnt_qposadr[first]))
            self._root_speed.append(int(m.jnt_dofadr[first]))
            self._links.append(np.array([m.body(prefix + link).id for link in model.shapes]))
        self._servos = np.concatenate([np.zeros(0, np.int64), *self._servo])
        names = [f"person{i}" for i in range(self._people)] + [f"vehicle{i}" for i in range(self._vehicles)]
        bodies = [m.body(name).id for name in names]
        self._mocap = np.array([m.body_mocapid[body] for body in bodies], np.int64)
        self._stock_geom = np.array([m.body_geomadr[body] for body in bodies], np.int64)
        self._stock_bvh = np.array([m.body_bvhadr[body] for body in bodies], np.int64)

    @property
    def geoms(self) -> int:
        """How many collision shapes there are."""
        return int(self._model.ngeom)

    def _forget(self) -> None:
        """Drop what was computed from a state that is no more."""
        self._bases: list[Base | None] = [None] * len(self._robots)
        self._kinematics_of = -1.0

    def _place_scene(self) -> None:
        """Compute the poses of all that never moves, which steps leave out."""
        flags = self._model.opt.enableflags
        self._model.opt.enableflags = flags & ~SLEEP
        mujoco.mj_kinematics(self._model, self._data)
        self._model.opt.enableflags = flags

    def _park_all(self) -> None:
        count = self._people + self._vehicles
        self._from[:] = 0.0
        self._from[:, 0] = 20.0 * np.arange(count)
        self._from[:, 2] = PARKED
        self._pace[:] = 0.0
        self._left = 0.0
        self._data.mocap_pos[self._mocap] = self._from
        self._data.mocap_quat[self._mocap] = (1.0, 0.0, 0.0, 0.0)

    def base(self, robot: int) -> Base:
        """Where a robot's base is and how it moves."""
        known = self._bases[robot]
        if known is not None:
            return known
        q, v = self._root[robot], self._root_speed[robot]
        pose, motion = self._qpos[q : q + 7].copy(), self._qvel[v : v + 6].copy()
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, pose[3:])
        base = Base(pose[:3], rotation.reshape(3, 3), motion[:3], motion[3:], pose[3:])
        self._bases[robot] = base
        return base

    def joints(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Angles and speeds of the driven joints."""
        return self._qpos[self._angle[robot]].copy(), self._qvel[self._rate[robot]].copy()

    def command(self, robot: int, targets: NDArray[np.float64], gains: tuple[float, float] | None = None) -> None:
        """Set what the servos follow, and how stiffly: Nm/rad and Nms/rad."""
        motors = self._motor[robot]
        self._data.ctrl[motors] = targets
        if gains is not None and gains != self._gains_of[robot]:
            self._set_gains(self._servo[robot], *gains)
            self._gains_of[robot] = gains

    def _set_gains(self, motors: NDArray[Any], stiffness: Any, damping: Any) -> None:
        self._model.actuator_gainprm[motors, 0] = stiffness
        self._model.actuator_biasprm[motors, 1] = -stiffness
        self._model.actuator_biasprm[motors, 2] = -damping

    def set_dynamic_obstacles(self, obstacles: Bodies, dt: float) -> None:
        """Take bodies near robots out of the stock, the nearest first; followers alone mind the rest."""
        self._park_all()
        if not len(obstacles):
            return
        centres = np.array([self._qpos[q : q + 2] for q in self._root]).reshape(-1, 2)
        gap = _gaps(obstacles.position, obstacles.half_length, obstacles.half_width, centres)
        if gap.min() >= NEAR:
            return
        person = obstacles.person
        for first, count, chosen in ((0, self._people, person), (self._people, self._vehicles, ~person)):
            near = np.flatnonzero(chosen & (gap < NEAR))
            near = near[np.lexsort((obstacles.entity[near], gap[near]))][:count]
            # In the order of their numbers, so that who comes and goes far away changes nothing.
            near = near[np.argsort(obstacles.entity[near], kind="stable")]
            self._fill(np.arange(first, first + len(near)), obstacles, near, dt, upright=chosen is person)

    def _fill(self, slots: NDArray[Any], bodies: Bodies, rows: NDArray[Any], dt: float, *, upright: bool) -> None:
        if not len(rows):
            return
        m, geoms = self._model, self._stock_geom[slots]
        half = np.empty((len(rows), 3))
        half[:, 0] = bodies.half_length[rows] + _SKIN
        half[:, 1] = bodies.half_width[rows] + _SKIN
        half[:, 2] = bodies.height[rows] / 2
        if upright:
            m.geom_size[geoms, 0] = half[:, 1]
            m.geom_size[geoms, 1] = half[:, 2]
            half[:, 0] = half[:, 1]
        else:
            m.geom_size[geoms] = half
        # What the broad and middle phases go by has to follow the size.
        m.geom_rbound[geoms] = np.sqrt((half * half).sum(axis=1))
        m.geom_aabb[geoms, 3:] = half
        m.bvh_aabb[self._stock_bvh[slots], 3:] = half
        self._pace[slots, :2] = bodies.velocity[rows]
        self._from[slots] = bodies.position[rows]
        self._from[slots, 2] += bodies.height[rows] / 2
        self._from[slots] -= self._pace[slots] * dt
        yaw = bodies.yaw[rows] / 2
        turn = np.zeros((len(rows), 4))
        turn[:, 0], turn[:, 3] = np.cos(yaw), np.sin(yaw)
        self._data.mocap_quat[self._mocap[slots]] = turn
        self._left = dt
        self._data.mocap_pos[self._mocap] = self._from

    def step(self, frames: int = 1, *, extra_substeps: bool = False) -> None:
        """Move on by some frames; surrounding bodies move first."""
        steps = EXTRA_SUBSTEPS if extra_substeps else SUBSTEPS
        self._model.opt.timestep = FRAME / steps
        if self._left > 0.0:
            self._from += self._pace * (FRAME * frames)
            self._left -= FRAME * frames
            self._data.mocap_pos[self._mocap] = self._from
        self._forget()
        mujoco.mj_step(self._model, self._data, steps * frames)
        said, _SAID[:] = _SAID[:], ()
        if not math.isfinite(float(np.add.reduce(self._qvel))):
            why = f" ({said[0]})" if said else ""
            raise PhysicsError(
                f"physics: the robots' motion diverged at {self._data.time:.2f} s{why}; report it with the snapshot"
            )
        for message in said:
            warnings.warn(f"physics: MuJoCo says: {message}", PhysicsWarning, stacklevel=2)

    def links(self, robot: int) -> NDArray[np.float64]:
        """Poses of the links, shape ``(n, 4, 4)``."""
        if self._kinematics_of != self._data.time:
            mujoco.mj_kinematics(self._model, self._data)
            self._kinematics_of = self._data.time
        bodies = self._links[robot]
        poses = np.zeros((len(bodies), 4, 4))
        poses[:, :3, :3] = self._data.xmat[bodies].reshape(-1, 3, 3)
        poses[:, :3, 3] = self._data.xpos[bodies]
        poses[:, 3, 3] = 1.0
        return poses

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Positions, velocities, servo targets, the solver's warm start and the stock of kinematic bodies."""
        state = np.empty(self._size)
        mujoco.mj_getState(self._model, self._data, state, _STATE)
        servos = self._servos
        return {
            "state": state,
            "stiffness": self._model.actuator_gainprm[servos, 0].copy(),
            "damping": -self._model.actuator_biasprm[servos, 2],
            "stock_size": self._model.geom_size[self._stock_geom].copy(),
            "stock_from": self._from.copy(),
            "stock_pace": self._pace.copy(),
            "stock_left": np.array([self._left]),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held.

        Raises
        ------
        SchemaError
            If it belongs to other robots or surroundings.
        """
        state = np.ascontiguousarray(arrays["state"], np.float64)
        if state.shape != (self._size,) or arrays["stock_from"].shape != self._from.shape:
            raise SchemaError(
                "physics: the saved state belongs to other robots or surroundings; start with the same ones"
            )
        mujoco.mj_resetData(self._model, self._data)
        self._place_scene()
        mujoco.mj_setState(self._model, self._data, state, _STATE)
        self._set_gains(self._servos, np.asarray(arrays["stiffness"]), np.asarray(arrays["damping"]))
        sizes = np.asarray(arrays["stock_size"])
        half = sizes.copy()
        people = slice(0, self._people)
        half[people] = sizes[people][:, [0, 0, 1]]
        self._model.geom_size[self._stock_geom] = sizes
        self._model.geom_rbound[self._stock_geom] = np.sqrt((half * half).sum(axis=1))
        self._model.geom_aabb[self._stock_geom, 3:] = half
        self._model.bvh_aabb[self._stock_bvh, 3:] = half
        self._from[:] = arrays["stock_from"]
        self._pace[:] = arrays["stock_pace"]
        self._left = float(arrays["stock_left"][0])
        self._forget()
        self._gains_of = [None] * len(self._robots)


def _joint_of(model: Any, name: str, *, driven: bool) -> int:
    """Return a joint: the one an actuator drives, or the one that has the name itself."""
    return int(model.actuator_trnid[model.actuator(name).id, 0]) if driven else int(model.joint(name).id)


def _run_of(indices: NDArray[Any]) -> slice | NDArray[Any]:
    """Return a slice where indices follow each other: reading it is much faster."""
    if not len(indices):
        return slice(0, 0)
    first = int(indices[0])
    run = np.array_equal(indices, np.arange(first, first + len(indices)))
    return slice(first, first + len(indices)) if run else indices.copy()
