"""The paper's physics engine, Genesis, behind the protocols: scenes, engines, batches and rays. It is an extra.

A run is in a scene that Genesis has built. Its numbers lie in that scene while it is stepped, and are kept here while
another run of the same scene is. What lies below a point is asked of MuJoCo, of the same scene with everybody where
Genesis has them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.errors import InputError, SchemaError
from vico.sim.bodies.arrays import Bodies
from vico.sim.physics.collision_shapes import KinematicBodies
from vico.sim.physics.engine import Actuate
from vico.sim.physics.genesis_model import GenesisIndex
from vico.sim.physics.genesis_scene import BuiltScene, ObjectSlots, contacts_of, read_contacts
from vico.sim.physics.mujoco_engine import MujocoEngine
from vico.sim.physics.mujoco_model import base_motion, motion_of, parked_robot, standing_pose
from vico.sim.physics.mujoco_scene import CompiledScene
from vico.sim.physics.records import (
    COARSE,
    FINE,
    Base,
    Capacity,
    Contacts,
    Imu,
    Motion,
    ObjectMotion,
    PhysicsError,
    RigidObject,
    StaticChunks,
    StaticScene,
)


class RayTwin:
    """The same scene compiled by MuJoCo, which is never stepped: Genesis casts rays with sensors that are built in.

    Parameters
    ----------
    scene
        In Genesis; the twin is compiled when it is first asked, and shared.
    """

    def __init__(self, scene: BuiltScene) -> None:
        if scene.twin is None:
            scene.twin = CompiledScene(scene.static, scene.models, scene.capacity)
        self._scene = scene
        self._engine = MujocoEngine(scene.twin, np.zeros((len(scene.models), 3)))

    def mirror(
        self, positions: NDArray[np.float64], movers: KinematicBodies, objects: ObjectMotion, slots: ObjectSlots
    ) -> None:
        """Put everybody where Genesis has them."""
        engine, mine = self._engine, self._scene
        for slot, there in enumerate(objects.present.tolist()):
            if there:
                pose = objects.position[slot], objects.quaternion[slot]
                engine.place_object(slot, RigidObject(slots.size[slot], float(slots.mass[slot]), *pose))
            else:
                engine.remove_object(slot)
        engine.follow_movers(movers)
        qpos, _ = engine.coordinates
        for theirs, index in zip(engine.compiled.robots, mine.robots, strict=True):
            qpos[theirs.root : theirs.root + 7] = positions[index.root : index.root + 7]
            qpos[theirs.angle] = positions[index.angle]

    def clearance_below(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `PhysicsEngine.clearance_below`."""
        return self._engine.clearance_below(points)


_GRAVITY = np.array([0.0, 0.0, 9.81])


class GenesisEngine:
    """One run in a built scene; see `vico.sim.physics.engine.PhysicsEngine`.

    Parameters
    ----------
    scene
        What is fixed.
    places
        Where each robot stands at first: x, y, yaw, shape ``(n, 3)``.
    """

    def __init__(self, scene: BuiltScene, places: NDArray[np.float64]) -> None:
        places = np.asarray(places, np.float64)
        if places.shape != (len(scene.models), 3):
            raise InputError(f"physics: {len(scene.models)} robots need as many places x, y, yaw, not {places.shape}")
        self._scene = scene
        self._movers = KinematicBodies(scene.capacity)
        self._slots = ObjectSlots(scene.capacity.objects)
        self._kept: dict[str, NDArray[Any]] = scene.pristine
        self._gain, self._bias, self._limit = scene.gain.copy(), scene.bias.copy(), scene.limit.copy()
        self._wrench = [np.zeros((len(robot.sites), 6)) for robot in scene.robots]
        self._grip = np.ones(1)
        # What the last frame leaves for sensors.
        self._velocity_before, self._frame = np.zeros((len(scene.models), 3)), np.zeros(1)
        self._forces = np.zeros(len(scene.speeds))
        self._contacts: NDArray[np.float64] | None = np.zeros((0, 9))
        self._twin: RayTwin | None = None
        self._hold()
        self._parked = np.zeros(len(scene.models), np.bool_)
        for robot, place in enumerate(places):
            index = scene.robots[robot]
            self._limit[index.driven] = index.limit
            scene.state["dyn_state.dofs.ctrl_mode"][index.driven, 0] = index.mode
            self._stand(robot, place)
        self._put_parameters()
        self._note()

    # Taking turns.

    def _hold(self) -> None:
        """Have Genesis be in this run's state."""
        scene = self._scene
        if scene.holder is self:
            return
        if scene.holder is not None:
            scene.holder.leave()
        scene.load(self._kept)
        scene.holder = self
        self._put_parameters()

    def leave(self) -> None:
        """Take this run's state with it: another one's comes."""
        self._last_contacts()
        self._kept = self._scene.save()

    def _put_parameters(self) -> None:
        """Write what differs from run to run and that Genesis takes for the model."""
        scene = self._scene
        scene.gain[:], scene.bias[:], scene.limit[:] = self._gain, self._bias, self._limit
        scene.grip[scene.gripping] = self._grip[0]
        scene.built.shapes.resize(scene.mover_geom, 2.0 * self._movers.half)
        self._slots.put(scene)
        self._move_movers()

    def _note(self) -> None:
        """Keep what queries answer from."""
        self._qpos, self._qvel = self._scene.positions.copy(), self._scene.speeds.copy()
        self._bases: list[Base] = []
        self._motions: dict[bytes, Motion] = {}

    # Robots.

    def link_names(self, robot: int) -> tuple[str, ...]:
        """Names of a robot's links, base first."""
        return self._scene.link_names(robot)

    def base(self, robot: int) -> Base:
        """Where a robot's base is and how it moves."""
        if not self._bases:
            rows = base_motion(self._qpos, self._qvel, self._scene.first)
            self._bases = [Base(*row) for row in zip(*rows, strict=True)]
        return self._bases[robot]

    def joints(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions and speeds of the joints."""
        index = self._scene.robots[robot]
        return self._qpos[index.angle], self._qvel[index.rate]

    def motion(self, robots: NDArray[np.int64]) -> Motion:
        """Motion of several robots of one kind."""
        key = robots.tobytes()
        found = self._motions.get(key)
        if found is None:
            found = Motion(*motion_of(self._qpos, self._qvel, *self._scene.kind(robots)))
            self._motions[key] = found
        return found

    def motor_forces(self, robot: int) -> NDArray[np.float64]:
        """Torques of the motors in the last step."""
        index = self._scene.robots[robot]
        return index.motor_forces(self._forces[index.driven])

    def imu(self, robot: int) -> Imu:
        """Angular velocity, and acceleration without gravity's, in the base's frame."""
        base, frame = self.base(robot), float(self._frame[0])
        gained = base.velocity - self._velocity_before[robot]
        acceleration = gained / frame if frame > 0.0 else np.zeros(3)
        return Imu(base.angular_velocity_body.copy(), base.rotation.T @ (acceleration + _GRAVITY))

    def links(self, robot: int) -> NDArray[np.float64]:
        """Poses of the links, shape ``(n, 4, 4)``."""
        scene = self._scene
        with scene.lock:
            self._hold()
            scene.place_links()
            return scene.poses(scene.robots[robot].shown)

    def command(self, robot: int, targets: NDArray[np.float64], gains: tuple[float, float] | None = None) -> None:
        """Set what the servos follow, and how stiffly: Nm/rad and Nms/rad."""
        index = self._scene.robots[robot]
        with self._scene.lock:
            self._hold()
            self._follow(index, np.asarray(targets, np.float64))
            if gains is not None:
                stiff = index.driven[index.servo]
                self._gain[stiff], self._bias[stiff, 1], self._bias[stiff, 2] = gains[0], -gains[0], -gains[1]
                self._scene.gain[stiff], self._scene.bias[stiff] = self._gain[stiff], self._bias[stiff]

    def _follow(self, index: GenesisIndex, targets: NDArray[np.float64]) -> None:
        if len(index.driven):
            index.follow(targets, self._scene.controls)

    def command_all(
        self, robots: NDArray[np.int64], targets: NDArray[np.float64], gains: Sequence[tuple[float, float] | None]
    ) -> None:
        """Set what the servos of several robots of one kind follow."""
        for robot, values, wanted in zip(robots.tolist(), targets, gains, strict=True):
            self.command(robot, values, wanted)

    def thrust(
        self, robot: int, sites: Sequence[str], forces: NDArray[np.float64], torques: NDArray[np.float64] | None = None
    ) -> None:
        """Push a robot at named sites from now on; in the frames of the sites."""
        known = self._scene.robots[robot].sites
        wrench = np.zeros((len(sites), 6))
        wrench[:, :3] = forces
        if torques is not None:
            wrench[:, 3:] = torques
        if not np.isfinite(wrench).all():
            raise InputError(f"physics: forces on robot {robot} have to be finite, not {wrench.tolist()}")
        for site, values in zip(sites, wrench, strict=True):
            if site not in known:
                raise InputError(
                    f"physics: robot {robot} ({self._scene.models[robot].name}) has no site {site!r}; "
                    f"it has {', '.join(known) or 'none'}"
                )
            self._wrench[robot][known[site]] = values

    def thrust_all(self, robots: NDArray[np.int64], site: str, wrenches: NDArray[np.float64]) -> None:
        """Push several robots of one kind at the site of one name from now on."""
        for robot, values in zip(robots.tolist(), wrenches, strict=True):
            self._wrench[robot][self._scene.robots[robot].sites[site]] = values

    def park(self, robot: int) -> None:
        """Take a robot out of the scene."""
        with self._scene.lock:
            self._hold()
            self._parked[robot] = True
            self._rest(robot, parked_robot(robot))
            self._note()

    def stand(self, robot: int, place: NDArray[np.float64]) -> None:
        """Stand a robot on the ground at rest."""
        with self._scene.lock:
            self._hold()
            self._parked[robot] = False
            self._stand(robot, place)
            self._put_parameters()
            self._note()

    def _stand(self, robot: int, place: NDArray[np.float64]) -> None:
        index, model = self._scene.robots[robot], self._scene.models[robot]
        position, quaternion = standing_pose(self._scene.height, model, place)
        self._rest(robot, [*position, *quaternion])
        self._gain[index.driven], self._bias[index.driven] = index.gain, index.bias
        self._velocity_before[robot] = 0.0

    def _rest(self, robot: int, pose: list[float]) -> None:
        """Put a robot to a pose, at rest, pushed by nothing."""
        scene, index, model = self._scene, self._scene.robots[robot], self._scene.models[robot]
        scene.positions[index.positions] = scene.pristine["rigid_info.qpos"][index.positions, 0]
        scene.positions[index.root : index.root + 7] = pose
        scene.positions[index.angle] = model.rest
        scene.speeds[index.speeds] = 0.0
        self._wrench[robot][:] = 0.0
        self._follow(index, model.stance if model.driven else np.zeros(0))

    # Everybody else.

    def set_dynamic_obstacles(self, obstacles: Bodies, dt: float) -> None:
        """Take people and vehicles near robots; they arrive `dt` seconds from now."""
        before = self._movers.half.copy()
        with self._scene.lock:
            self._hold()
            centres = self._qpos[self._scene.first[:, :1] + np.arange(2)]
            self._movers.set(obstacles, dt, centres[~self._parked])
            changed = np.flatnonzero((before != self._movers.half).any(axis=1))
            if len(changed):
                self._scene.built.shapes.resize(self._scene.mover_geom[changed], 2.0 * self._movers.half[changed])
            self._move_movers()

    @property
    def left_out(self) -> int:
        """How many bodies near robots found no place."""
        return int(self._movers.left_out[0])

    def _move_movers(self) -> None:
        """Put kinematic bodies where they are now, and who is nobody out of the way."""
        self._scene.place_movers(self._movers.poses(), self._movers.entity)

    def set_friction(self, share: float) -> None:
        """Have ground, tyres and feet grip with this share of their friction on dry ground."""
        with self._scene.lock:
            self._hold()
            self._grip[0] = share
            self._scene.grip[self._scene.gripping] = share

    # Free rigid objects.

    def place_object(self, slot: int, thing: RigidObject) -> None:
        """Put an object into a slot."""
        with self._scene.lock:
            self._hold()
            self._slots.place(self._scene, slot, thing)
            self._note()

    def remove_object(self, slot: int) -> None:
        """Take an object out of the scene."""
        with self._scene.lock:
            self._hold()
            self._slots.remove(self._scene, slot)
            self._note()

    def objects(self) -> ObjectMotion:
        """Where all objects are."""
        return self._slots.motion(self._scene, self._qpos, self._qvel)

    def clearance_below(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres from each point straight down to what is there; inf for nothing, -inf inside of something."""
        if self._twin is None:
            self._twin = RayTwin(self._scene)
        self._twin.mirror(self._qpos, self._movers, self.objects(), self._slots)
        return self._twin.clearance_below(points)

    # Time.

    def step(
        self,
        frames: int = 1,
        *,
        frame: float = COARSE,
        holding: bool | None = None,
        actuate: Actuate | None = None,
    ) -> None:
        """Move on by some frames; people and vehicles move first, at every one. Friction is always the same."""
        before = None if actuate is None else self._before_step(actuate)
        firm = frame == FINE if holding is None else holding
        scene, parked = self._scene, np.flatnonzero(self._parked).tolist()
        with scene.lock:
            self._hold()
            for _ in range(frames):
                if self._movers.moving:
                    self._movers.advance(frame)
                    self._move_movers()
                for robot in parked:
                    self._rest(robot, parked_robot(robot))
                self._velocity_before[:] = scene.speeds[scene.first[:, 1:] + np.arange(3)]
                said = scene.step(frame, self._wrench, holding=firm, actuate=before)
                self._contacts = None
                self._slots.watch(scene, frame)
                if said or not math.isfinite(float(np.add.reduce(scene.speeds))):
                    raise PhysicsError(f"physics: the robots' motion diverged{said}; report it with the snapshot")
            self._frame[0] = frame
            self._forces[:] = scene.applied
            self._note()

    def _before_step(self, actuate: Actuate) -> Actuate:
        """Return `actuate` as it is called in a step: with motions as they are then."""

        def before(since: float, seconds: float) -> None:
            self._note()
            actuate(since, seconds)

        return before

    def _last_contacts(self) -> NDArray[np.float64]:
        """Links, position, normal and force of the last step's contacts."""
        if self._contacts is None:
            self._contacts = read_contacts(self._scene.solver)
        return self._contacts

    def contacts(self) -> Contacts:
        """Who touched whom in the last step."""
        return contacts_of(self._scene, self._last_contacts(), self._movers.entity)

    # State.

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that decides the future, and what sensors answer from."""
        scene = self._scene
        with scene.lock:
            self._hold()
            contacts = self._last_contacts().copy()
            kept = scene.save()
        wrench = np.concatenate([np.zeros((0, 6)), *self._wrench])
        return {
            **{f"genesis_{name}": array for name, array in kept.items()},
            "gain": self._gain.copy(),
            "bias": self._bias.copy(),
            "wrench": wrench,
            "grip": self._grip.copy(),
            "velocity_before": self._velocity_before.copy(),
            "frame": self._frame.copy(),
            "parked": self._parked.copy(),
            "forces": self._forces.copy(),
            "contacts": contacts,
            **self._slots.arrays(),
            **self._movers.arrays(),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held.

        Raises
        ------
        SchemaError
            If it belongs to other robots or surroundings, or to another engine.
        """
        scene = self._scene
        kept = {name: arrays.get(f"genesis_{name}") for name in scene.pristine}
        rows = ("contact_rows", *scene.sparse)
        if any(
            array is None or (name not in rows and array.shape != scene.pristine[name].shape)
            for name, array in kept.items()
        ):
            raise SchemaError(
                "physics: the saved state belongs to other robots or surroundings, or to another engine; start with "
                "the same ones"
            )
        with scene.lock:
            self._movers.restore(arrays)
            self._slots.restore(arrays)
            self._gain[:], self._bias[:], self._grip[:] = arrays["gain"], arrays["bias"], arrays["grip"]
            first = 0
            for wrench in self._wrench:
                wrench[:] = arrays["wrench"][first : first + len(wrench)]
                first += len(wrench)
            self._velocity_before[:], self._frame[:] = arrays["velocity_before"], arrays["frame"]
            self._parked[:] = arrays["parked"]
            self._forces[:], self._contacts = arrays["forces"], np.array(arrays["contacts"])
            if scene.holder is not None and scene.holder is not self:
                scene.holder.leave()
            scene.load({name: np.asarray(array) for name, array in kept.items()})
            scene.holder = self
            self._put_parameters()
            self._note()


class GenesisBatch:
    """Copies of one scene; see `vico.sim.physics.engine.PhysicsBatch`.

    Each copy is an engine, so it computes what an engine computes, bit for bit. They are stepped one after the other:
    Genesis' own batches, on a GPU, compute with other bits than a scene alone.

    Parameters
    ----------
    scene
        What is fixed.
    copies
        How many.
    places
        Where the robots of every copy stand at first: x, y, yaw, shape ``(n, 3)``.
    threads
        Only one is used.
    """

    def __init__(self, scene: BuiltScene, copies: int, places: NDArray[np.float64], *, threads: int = 0) -> None:
        if copies < 1 or threads < 0:
            raise InputError(f"physics: a batch needs 1 or more copies and 0 or more threads, not {copies}, {threads}")
        self.engines = [GenesisEngine(scene, places) for _ in range(copies)]

    def __len__(self) -> int:
        return len(self.engines)

    def restore(self, copies: NDArray[np.int64], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Put some copies into a saved state."""
        for k in np.asarray(copies, np.int64).tolist():
            self.engines[k].restore(arrays)

    def arrays(self, copy: int) -> dict[str, NDArray[Any]]:
        """State of one copy."""
        return self.engines[copy].arrays()

    def command(self, robot: int, targets: NDArray[np.float64]) -> None:
        """Set what the servos of a robot follow in each copy, shape ``(copies, motors)``."""
        for engine, values in zip(self.engines, targets, strict=True):
            engine.command(robot, values)

    def bases(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Poses and motions of a robot's base, shapes ``(copies, 7)`` and ``(copies, 6)``."""
        found = [engine.base(robot) for engine in self.engines]
        poses = [np.concatenate([one.position, one.quaternion]) for one in found]
        motions = [np.concatenate([one.velocity, one.angular_velocity_body]) for one in found]
        return np.stack(poses), np.stack(motions)

    def joints(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions and speeds of the joints, shape ``(copies, joints)`` each."""
        found = [engine.joints(robot) for engine in self.engines]
        return np.stack([one[0] for one in found]), np.stack([one[1] for one in found])

    def objects(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Poses and motions of the objects, shapes ``(copies, slots, 7)`` and ``(copies, slots, 6)``."""
        found = [engine.objects() for engine in self.engines]
        poses = [np.concatenate([one.position, one.quaternion], axis=1) for one in found]
        motions = [np.concatenate([one.velocity, one.angular_velocity_body], axis=1) for one in found]
        return np.stack(poses), np.stack(motions)

    def step(self, frames: int = 1, *, frame: float = COARSE) -> None:
        """Move all copies on by some frames."""
        for engine in self.engines:
            engine.step(frames, frame=frame)


class GenesisScene(BuiltScene):
    """See `vico.sim.physics.engine.PhysicsScene`; it has all of a city."""

    name = "genesis"

    def __init__(self, static: StaticScene | StaticChunks, models: tuple[RobotModel, ...], capacity: Capacity) -> None:
        super().__init__(static if isinstance(static, StaticScene) else static.whole(), models, capacity)

    def engine(self, places: NDArray[np.float64]) -> GenesisEngine:
        """Return a new state with robots standing at `places`."""
        return GenesisEngine(self, places)

    def batch(self, copies: int, places: NDArray[np.float64], *, threads: int = 0) -> GenesisBatch:
        """Return many copies of a new state, which take turns on one thread."""
        return GenesisBatch(self, copies, places, threads=threads)
