"""The physics engine of the default install: MuJoCo, and the warnings that it gives.

People, cars and buses near a robot are kinematic ("mocap") shapes, movable things near it free boxes, both out of a
fixed number that is parked far below the ground. Free boxes that lie still sleep and cost next to nothing.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError, SchemaError
from vico.io.mujoco import mujoco
from vico.sim.bodies.arrays import Bodies
from vico.sim.physics.collision_shapes import KinematicBodies, parts_of
from vico.sim.physics.engine import Actuate
from vico.sim.physics.mujoco_model import (
    FRICTION,
    SOLID_GROUPS,
    LinkState,
    base_motion,
    begin_frame,
    motion_of,
    parked_object,
    parked_robot,
    place_bodies,
    solved_contacts,
    standing_pose,
)
from vico.sim.physics.mujoco_scene import CompiledScene, EngineParameters, SharedModel
from vico.sim.physics.records import (
    COARSE,
    CONTACT_FORCE,
    CONTACT_NORMAL,
    CONTACT_POSITION,
    FINE,
    SOLVER_STEPS,
    Base,
    Contacts,
    Imu,
    Motion,
    ObjectMotion,
    Party,
    PhysicsError,
    RigidObject,
)


class PhysicsWarning(RuntimeWarning):
    """MuJoCo says that something is about to go wrong."""


# MuJoCo calls back from C, where an exception would end the process: what it says is kept until the step is over.
_WARNINGS: list[str] = []


def _keep_warning(message: str) -> None:
    if len(_WARNINGS) < 10:
        _WARNINGS.append(message)


def step_solver(model: Any, data: Any, steps: int) -> None:
    """Have MuJoCo take some steps.

    Raises
    ------
    PhysicsError
        If it runs out of its working memory.
    """
    try:
        mujoco.mj_step(model, data, steps)
    except mujoco.FatalError as error:
        raise PhysicsError(
            f"physics: MuJoCo gave up at {data.time:.2f} s ({error}); report it with the snapshot"
        ) from None


def take_warnings() -> list[str]:
    """Return what MuJoCo has said since this was last asked."""
    said, _WARNINGS[:] = _WARNINGS[:], ()
    return said


STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_DOWN = np.array([0.0, 0.0, -1.0])
_GRAVITY = np.array([0.0, 0.0, 9.81])
#: Slower than this, m/s and rad/s, for so many seconds an object rests.
_SLOW, _CALM_TIME = 0.03, 0.2


class MujocoEngine:
    """One run in a compiled scene; see `vico.sim.physics.engine.PhysicsEngine`.

    Parameters
    ----------
    scene
        What is fixed.
    places
        Where each robot stands at first: x, y, yaw, shape ``(n, 3)``.
    """

    def __init__(self, scene: CompiledScene, places: NDArray[np.float64]) -> None:
        # MuJoCo would append its warnings to a file in the working directory.
        if mujoco.get_mju_user_warning() is None:
            mujoco.set_mju_user_warning(_keep_warning)
        places = np.asarray(places, np.float64)
        if places.shape != (len(scene.models), 3):
            raise InputError(f"physics: {len(scene.models)} robots need as many places x, y, yaw, not {places.shape}")
        # Making one takes milliseconds: things come and go.
        self._kept: dict[CompiledScene, Any] = {}
        self._use(scene.bare)
        self._movers = KinematicBodies(scene.capacity)
        count = scene.capacity.objects
        self._present = np.zeros(count, np.bool_)
        # Seconds for which each object has been slow.
        self._calm = np.zeros(count)
        # What the last frame leaves for sensors: velocities of bases before it and its length, torques, contacts.
        self._velocity_before = np.zeros((len(scene.models), 3))
        self._frame = np.zeros(1)
        self._contacts: NDArray[np.float64] | None = np.zeros((0, 9))
        self._gains_of: list[tuple[float, float] | None] = [None] * len(scene.models)
        self._near_solids = np.ones(len(scene.models), np.bool_)
        self._links_meet = np.ones(len(scene.link_parts[0]), np.bool_)
        self._parked = np.zeros(len(scene.models), np.bool_)
        for robot, place in enumerate(places):
            position, quaternion = standing_pose(scene.height, scene.models[robot], place)
            self._rest(robot, [*position, *quaternion])
        self._forget()
        self._move_movers()

    def link_names(self, robot: int) -> tuple[str, ...]:
        """Names of a robot's links, base first."""
        return self.compiled.link_names(robot)

    def _use(self, scene: CompiledScene) -> None:
        """Go to the beginning of a scene, the one without objects or the one with."""
        if scene not in self._kept:
            # Those of other chunks of a city are not gone back to.
            self._kept = {other: data for other, data in self._kept.items() if other.bare is scene.bare}
            self._kept[scene] = mujoco.MjData(scene.model)
        self.compiled, self._model = scene, scene.model
        self._data = self._kept[scene]
        self._qpos, self._qvel = self._data.qpos, self._data.qvel
        self._mocap_pos, self._mocap_quat = self._data.mocap_pos, self._data.mocap_quat
        self._ctrl = self._data.ctrl
        self._link_motion = self._data.xpos, self._data.cvel, self._data.subtree_com
        self._size = mujoco.mj_stateSize(self._model, STATE)
        self._parameters = EngineParameters(scene)
        # Seconds since MuJoCo computed where links are and how they move; negative: that was of another state.
        self._links_age = -1.0
        scene.reset(self._data)

    def _move_to(self, scene: CompiledScene) -> None:
        """Go on in another scene, one with objects, without them, or of other chunks: everybody as they are."""
        if scene is self.compiled:
            return
        contacts, data, parameters = self._last_contacts(), self._data, self._parameters
        if scene.slots == self.compiled.slots:
            state, forces = self._state(), np.array(data.actuator_force)
            self._use(scene)
            self._parameters.restore(parameters.numbers)
            self._set_state(state, forces, contacts, anew=False)
            return
        self._use(scene)
        count = min(len(self._qpos), len(data.qpos)), min(len(self._qvel), len(data.qvel))
        self._qpos[: count[0]], self._qvel[: count[1]] = data.qpos[: count[0]], data.qvel[: count[1]]
        self._mocap_pos[:], self._mocap_quat[:] = data.mocap_pos, data.mocap_quat
        self._data.ctrl[:], self._data.actuator_force[:] = data.ctrl, data.actuator_force
        self._data.time = data.time
        self._parameters.copy_from(parameters)
        self._contacts = contacts
        self._kinematics_of = -1.0

    def stay_in_scene(self, points: NDArray[np.float64] | None = None) -> None:
        """Have the scene hold what is around everybody whom physics moves, and around some points besides."""
        if self.compiled.chunked is None:
            return
        places = [self._qpos[self.compiled.base_position][~self._parked]]
        if self.compiled.slots:
            places.append(self._qpos[self.compiled.object_pose].reshape(-1, 7)[self._present, :2])
        if points is not None:
            places.append(points[:, :2])
        self._move_to(self.compiled.chunked.around(self.compiled, np.concatenate(places)))

    @property
    def coordinates(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """All positions and all velocities, as MuJoCo orders them; views."""
        return self._qpos, self._qvel

    def _forget(self) -> None:
        """Drop what was computed from a state that is no more."""
        self._bases: list[Base] = []
        self._motions: dict[bytes, Motion] = {}
        self._kinematics_of = -1.0

    # Robots.

    def base(self, robot: int) -> Base:
        """Where a robot's base is and how it moves."""
        if self._bases:
            return self._bases[robot]
        self._bases = [
            Base(*rows) for rows in zip(*base_motion(self._qpos, self._qvel, self.compiled.first), strict=True)
        ]
        return self._bases[robot]

    def joints(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions and speeds of the joints."""
        index = self.compiled.robots[robot]
        return self._qpos[index.angle].copy(), self._qvel[index.rate].copy()

    def motion(self, robots: NDArray[np.int64]) -> Motion:
        """Motion of several robots of one kind."""
        key = robots.tobytes()
        found = self._motions.get(key)
        if found is None:
            index = self.compiled.kind(robots)
            found = Motion(*motion_of(self._qpos, self._qvel, index.first, index.angle, index.rate))
            self._motions[key] = found
        return found

    def motor_forces(self, robot: int) -> NDArray[np.float64]:
        """Torques of the motors in the last step."""
        return np.array(self._data.actuator_force[self.compiled.robots[robot].motor])

    def imu(self, robot: int) -> Imu:
        """Angular velocity, and acceleration without gravity's, in the base's frame."""
        base, frame = self.base(robot), float(self._frame[0])
        gained = base.velocity - self._velocity_before[robot]
        acceleration = gained / frame if frame > 0.0 else np.zeros(3)
        force = np.zeros(3)
        mujoco.mju_mulMatTVec(force, base.rotation, acceleration + _GRAVITY)
        return Imu(base.angular_velocity_body.copy(), force)

    def links(self, robot: int) -> NDArray[np.float64]:
        """Poses of the links, shape ``(n, 4, 4)``."""
        self._refresh()
        bodies = self.compiled.robots[robot].shown
        poses = np.zeros((len(bodies), 4, 4))
        poses[:, :3, :3] = self._data.xmat[bodies].reshape(-1, 3, 3)
        poses[:, :3, 3] = self._data.xpos[bodies]
        poses[:, 3, 3] = 1.0
        return poses

    def _refresh(self) -> None:
        """Compute poses of links and objects from the state as it is."""
        if self._kinematics_of != self._data.time:
            mujoco.mj_kinematics(self._model, self._data)
            self._kinematics_of = self._data.time

    def command(self, robot: int, targets: NDArray[np.float64], gains: tuple[float, float] | None = None) -> None:
        """Set what the servos follow, and how stiffly: Nm/rad and Nms/rad."""
        index = self.compiled.robots[robot]
        self._ctrl[index.motor] = targets
        self._set_gains(robot, gains)

    def command_all(
        self, robots: NDArray[np.int64], targets: NDArray[np.float64], gains: Sequence[tuple[float, float] | None]
    ) -> None:
        """Set what the servos of several robots of one kind follow."""
        self._ctrl[self.compiled.kind(robots).motor] = targets
        for robot, wanted in zip(robots.tolist(), gains, strict=True):
            if wanted is not None:
                self._set_gains(robot, wanted)

    def _set_gains(self, robot: int, gains: tuple[float, float] | None) -> None:
        if gains is not None and gains != self._gains_of[robot]:
            mine = self.compiled.servos_of[robot]
            self._parameters.stiffness[mine], self._parameters.damping[mine] = gains
            self._parameters.mark_changed()
            self._gains_of[robot] = gains

    def thrust(
        self, robot: int, sites: Sequence[str], forces: NDArray[np.float64], torques: NDArray[np.float64] | None = None
    ) -> None:
        """Push a robot at named sites from now on; in the frames of the sites."""
        known = self.compiled.robots[robot].thrusters
        wrench = np.zeros((len(sites), 6))
        wrench[:, :3] = forces
        if torques is not None:
            wrench[:, 3:] = torques
        if not np.isfinite(wrench).all():
            raise InputError(f"physics: forces on robot {robot} have to be finite, not {wrench.tolist()}")
        for site, values in zip(sites, wrench, strict=True):
            if site not in known:
                raise InputError(
                    f"physics: robot {robot} ({self.compiled.models[robot].name}) has no site {site!r}; "
                    f"it has {', '.join(known) or 'none'}"
                )
            self._data.ctrl[known[site]] = values

    def thrust_all(self, robots: NDArray[np.int64], site: str, wrenches: NDArray[np.float64]) -> None:
        """Push several robots of one kind at the site of one name from now on."""
        self._ctrl[self.compiled.kind(robots).thrusters[site]] = wrenches

    def park(self, robot: int) -> None:
        """Take a robot out of the scene."""
        self._parked[robot] = True
        self._links_age = -1.0
        self._rest(robot, parked_robot(robot))
        self._forget()

    def stand(self, robot: int, place: NDArray[np.float64]) -> None:
        """Stand a robot on the ground at rest."""
        self._parked[robot] = False
        self._links_age = -1.0
        position, quaternion = standing_pose(self.compiled.height, self.compiled.models[robot], place)
        self._rest(robot, [*position, *quaternion])
        self._velocity_before[robot] = 0.0
        self._contacts = self._last_contacts()
        # As stiff as at the beginning, until its controller says otherwise.
        mine = self.compiled.servos_of[robot]
        self._parameters.stiffness[mine] = self.compiled.stiffness[mine]
        self._parameters.damping[mine] = self.compiled.damping[mine]
        self._parameters.mark_changed()
        self._gains_of[robot] = None
        self._forget()

    def _rest(self, robot: int, pose: list[float]) -> None:
        """Put a robot to a pose, at rest, pushed by nothing."""
        index, model = self.compiled.robots[robot], self.compiled.models[robot]
        self._qpos[index.positions] = self._model.qpos0[index.positions]
        self._qpos[index.root : index.root + 7] = pose
        self._qpos[index.angle] = model.rest
        self._qvel[index.speeds] = 0.0
        self._data.qacc_warmstart[index.speeds] = 0.0
        self._ctrl[index.actuators] = 0.0
        if model.driven:
            self._ctrl[index.motor] = model.stance

    # Everybody else.

    def set_dynamic_obstacles(self, obstacles: Bodies, dt: float) -> None:
        """Take people and vehicles near robots; they arrive `dt` seconds from now."""
        self._movers.set(obstacles, dt, self._qpos[self.compiled.base_position][~self._parked])
        if not np.array_equal(self._parameters.mover_half, self._movers.half):
            self._parameters.mover_half[:] = self._movers.half
            self._parameters.mark_changed()
        self._move_movers()

    @property
    def left_out(self) -> int:
        """How many bodies near robots found no place."""
        return int(self._movers.left_out[0])

    def follow_movers(self, movers: KinematicBodies) -> None:
        """Have people and vehicles be where those of another engine are."""
        self._movers.restore(movers.arrays())
        self._parameters.mover_half[:] = movers.half
        self._parameters.mark_changed()
        self._move_movers()
        self._forget()

    def _move_movers(self) -> None:
        """Put kinematic bodies where they are now, and who is nobody out of the way."""
        movers = self._movers
        place_bodies(movers.poses(), movers.entity, self.compiled.mover_mocap, self._mocap_pos, self._mocap_quat)

    def set_friction(self, share: float) -> None:
        """Have ground, tyres and feet grip with this share of their friction on dry ground."""
        if self._parameters.grip[0] != share:
            self._parameters.grip[0] = share
            self._parameters.mark_changed()

    # Free rigid objects.

    def place_object(self, slot: int, thing: RigidObject) -> None:
        """Put an object into a slot, awake."""
        self._check_slot(slot)
        parts = parts_of(thing)
        self._move_to(self.compiled.full)
        self._parameters.set_object(slot, parts, thing.mass)
        q, v = self.compiled.object_at(slot)
        # Written to another pose than the parked one, it is awake from the next step on.
        self._qpos[q : q + 7] = np.concatenate([thing.position, thing.quaternion])
        self._qvel[v : v + 6] = np.concatenate([thing.velocity, thing.angular_velocity_body])
        self._data.qacc_warmstart[v : v + 6] = 0.0
        self._present[slot], self._calm[slot] = True, 0.0
        self._kinematics_of = -1.0

    def remove_object(self, slot: int) -> None:
        """Take an object out of the scene."""
        self._check_slot(slot)
        if not self._present[slot]:
            return
        self._present[slot] = False
        if not self._present.any():
            self._calm[:] = 0.0
            self._move_to(self.compiled.bare)
            return
        q, v = self.compiled.object_at(slot)
        self._qpos[q : q + 7] = [*parked_object(slot), 1.0, 0.0, 0.0, 0.0]
        self._qvel[v : v + 6] = 0.0
        self._data.qacc_warmstart[v : v + 6] = 0.0
        # Nobody but a reset puts anybody to sleep.
        forces, contacts = np.array(self._data.actuator_force), self._last_contacts()
        self._set_state(self._state(), forces, contacts, anew=True)

    def _check_slot(self, slot: int) -> None:
        if not 0 <= slot < len(self._present):
            raise InputError(f"physics: there is no slot {slot} for objects; there are {len(self._present)}")

    def objects(self) -> ObjectMotion:
        """Where all objects are."""
        pose, motion = np.zeros((len(self._present), 7)), np.zeros((len(self._present), 6))
        if self.compiled.slots:
            pose[:] = self._qpos[self.compiled.object_pose].reshape(-1, 7)
            motion[:] = self._qvel[self.compiled.object_motion].reshape(-1, 6)
        resting = self._calm >= _CALM_TIME - 1e-9
        return ObjectMotion(self._present.copy(), pose[:, :3], pose[:, 3:], motion[:, :3], motion[:, 3:], resting)

    def clearance_below(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres from each point straight down to what is there; inf for nothing, -inf inside of something."""
        self.stay_in_scene(points)
        found, hit, normal = np.full(len(points), np.inf), np.zeros(1, np.int32), np.zeros(3)
        with self.compiled.shared.lock:
            self._parameters.hold(self.compiled.shared)
            self._refresh()
            for k, point in enumerate(np.asarray(points, np.float64)):
                away = mujoco.mj_ray(self._model, self._data, point, _DOWN, SOLID_GROUPS, 1, -1, hit, normal)
                if away >= 0.0:
                    found[k] = -np.inf if normal[2] < 0.0 else away
        return found

    # Time.

    def step(
        self,
        frames: int = 1,
        *,
        frame: float = COARSE,
        holding: bool | None = None,
        actuate: Actuate | None = None,
    ) -> None:
        """Move on by some frames; people and vehicles move first, at every one."""
        self.stay_in_scene()
        take_warnings()  # what was said of other models' steps says nothing of this one
        self.step_in(self.compiled.shared, frames, frame, holding=holding, actuate=actuate)
        self.judge()

    def step_in(
        self,
        shared: SharedModel,
        frames: int,
        frame: float,
        *,
        holding: bool | None = None,
        actuate: Actuate | None = None,
    ) -> None:
        """Step, with the equations of a model of the same scene: its own for each thread of a batch."""
        s, steps, movers = self.compiled, SOLVER_STEPS[frame], self._movers
        parked = [robot for robot, out in enumerate(self._parked.tolist()) if out]
        somebody = movers.entity != 0
        told = (
            (self._qpos, self._qvel, s.first, self._velocity_before),
            (s.solids.cells, s.solids.reaches, self._near_solids),
            LinkState(*s.link_parts, *self._link_motion, self._links_meet),
            (movers.entity, movers.start, movers.end, movers.time),
            (s.mover_mocap, self._mocap_pos, self._mocap_quat),
        )
        self._forget()
        with shared.lock:
            self._parameters.hold(shared)
            firm = frame == FINE if holding is None else holding
            shared.set_frame(frame / steps, FRICTION[firm])
            for _ in range(frames):
                for robot in parked:
                    self._rest(robot, parked_robot(robot))
                begin_frame(frame, self._links_age, *told)
                s.choose_pairs(shared, self._links_meet, somebody)
                if actuate is None:
                    step_solver(shared.model, self._data, steps)
                else:
                    for k in range(steps):
                        actuate(k * frame / steps, frame / steps)
                        step_solver(shared.model, self._data, 1)
                        self._forget()
                self._links_age = frame / steps
                if s.slots:
                    motion = self._qvel[s.object_motion].reshape(-1, 6)
                    self._calm = np.where(np.abs(motion).max(axis=1) < _SLOW, self._calm + frame, 0.0)
        self._frame[0] = frame
        self._contacts = None

    def judge(self) -> None:
        """Raise or warn if MuJoCo said something."""
        said, finite = take_warnings(), math.isfinite(float(np.add.reduce(self._qvel)))
        if said or not finite:
            if not finite:
                why = f" ({said[0]})" if said else ""
                raise PhysicsError(
                    f"physics: the robots' motion diverged at {self._data.time:.2f} s{why}; report it with the snapshot"
                )
            for message in said:
                warnings.warn(f"physics: MuJoCo says: {message}", PhysicsWarning, stacklevel=4)

    def _last_contacts(self) -> NDArray[np.float64]:
        """Shapes, position, normal and force of the last step's contacts: the state after it does not tell them.

        Shapes are counted from the first that moves; -1 is any that never does, of which scenes have more or fewer.
        """
        if self._contacts is None:
            self._contacts = solved_contacts(self._data)
            shapes = self._contacts[:, :2]
            shapes[:] = np.maximum(shapes - self.compiled.first_moving, -1.0)
        return self._contacts

    def contacts(self) -> Contacts:
        """Who touched whom in the last step."""
        s, kept = self.compiled, self._last_contacts()
        geoms = kept[:, :2].astype(np.int64)
        party, owner = s.geom_party[geoms], s.geom_owner[geoms]
        movers = party == Party.BODY
        owner = np.where(movers, self._movers.entity[np.where(movers, owner, 0)], owner).astype(np.int32)
        columns = (kept[:, column].copy() for column in (CONTACT_POSITION, CONTACT_NORMAL, CONTACT_FORCE))
        return Contacts(party, owner, s.geom_link[geoms], *columns)

    # State.

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Positions, velocities, servo targets, the solver's warm start, pools, and what sensors answer from."""
        return {
            "state": self._state(),
            "present": self._present.copy(),
            "calm": self._calm.copy(),
            "parked": self._parked.copy(),
            "velocity_before": self._velocity_before.copy(),
            "frame": self._frame.copy(),
            "forces": np.array(self._data.actuator_force),
            "contacts": self._last_contacts().copy(),
            "parameters": self._parameters.numbers.copy(),
            **self._movers.arrays(),
        }

    def _state(self) -> NDArray[np.float64]:
        state = np.empty(self._size)
        mujoco.mj_getState(self._model, self._data, state, STATE)
        return state

    def _set_state(
        self, state: NDArray[np.float64], forces: NDArray[np.float64], contacts: NDArray[np.float64], *, anew: bool
    ) -> None:
        """Go to a state; `anew` where somebody has to fall asleep for it."""
        if anew:
            self.compiled.reset(self._data)
        mujoco.mj_setState(self._model, self._data, state, STATE)
        self._data.actuator_force[:] = forces
        self._contacts = np.array(contacts)
        self._links_age = -1.0
        self._forget()

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held.

        Raises
        ------
        SchemaError
            If it belongs to other robots or surroundings.
        """
        state, present = np.ascontiguousarray(arrays["state"], np.float64), arrays["present"]
        scene = self.compiled.full if present.any() else self.compiled.bare
        other = scene is not self.compiled
        size = mujoco.mj_stateSize(scene.model, STATE) if other else self._size
        if state.shape != (size,) or present.shape != self._present.shape:
            raise SchemaError(
                "physics: the saved state belongs to other robots or surroundings; start with the same ones"
            )
        self._movers.restore(arrays)
        if other:
            self._use(scene)
        self._parameters.restore(arrays["parameters"])
        anew = not other and not np.array_equal(self._present, present)
        self._set_state(state, arrays["forces"], arrays["contacts"], anew=anew)
        self._present[:] = present
        self._calm[:], self._parked[:] = arrays["calm"], arrays["parked"]
        self._velocity_before[:] = arrays["velocity_before"]
        self._frame[:] = arrays["frame"]
        self._gains_of = [None] * len(self.compiled.models)
