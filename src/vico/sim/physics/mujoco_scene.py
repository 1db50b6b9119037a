"""Compiled scenes in MuJoCo, shared by all engines of a world and its robots, and the numbers that differ by engine.

Those numbers are gains of servos, and sizes and masses of pooled bodies.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.errors import SchemaError
from vico.io.mujoco import mujoco
from vico.sim.physics.collision_shapes import PartRows, SolidCells, box_parts
from vico.sim.physics.mujoco_model import OBJECT_BITS, OBJECT_HALF, OBJECT_MASS, SLEEP, SOLID, compiled_model, thruster
from vico.sim.physics.records import PARTS, Capacity, Chunk, Party, StaticChunks, StaticScene
from vico.world.heights import HeightField


class RobotIndex:
    """Where a robot's numbers are in MuJoCo's arrays.

    Attributes
    ----------
    root, root_speed
        First of its base's position and speed.
    angle, rate
        Positions and speeds of its joints, in the order of the model's `joints`.
    motor, servo
        Its actuators in the order of the control vector, and those of them that follow angles.
    shown
        Bodies in the order of the model's `shapes`.
    links
        Names of all its bodies, base first.
    link_bodies
        Those bodies, int64, shape ``(links,)``.
    positions, speeds, actuators
        All its positions, speeds and actuators, in MuJoCo's order.
    reach
        Metres from its base within which all of it is, however its joints turn.
    thrusters
        Actuators of each site, force x, y, z and torque x, y, z; by name of the site.
    """

    def __init__(self, model: Any, index: int, robot: RobotModel) -> None:
        prefix = f"r{index}/"
        motors = np.array([model.actuator(prefix + motor).id for motor in robot.driven], np.int64)
        # A motor's name stands for the joint that it drives.
        joints = [
            int(model.actuator_trnid[model.actuator(prefix + name).id, 0] if name in robot.driven
                else model.joint(prefix + name).id)
            for name in robot.joints
        ]  # fmt: skip
        base = model.body(prefix + "base")
        self.motor = motors
        self.servo = motors[[servo == "position" for servo in robot.servos]] if robot.driven else motors
        self.angle, self.rate = _run_of(model.jnt_qposadr[joints]), _run_of(model.jnt_dofadr[joints])
        self.root = int(model.jnt_qposadr[int(base.jntadr[0])])
        self.root_speed = int(model.jnt_dofadr[int(base.jntadr[0])])
        self.shown = np.array([model.body(prefix + link).id for link in robot.shapes], np.int64)
        mine = [k for k in range(model.nbody) if model.body(k).name.startswith(prefix)]
        self.links = tuple(model.body(k).name.removeprefix(prefix) for k in mine)
        self.link_bodies = np.array(mine, np.int64)
        mine_too = np.flatnonzero(np.isin(model.jnt_bodyid, self.link_bodies))
        last = int(mine_too[-1])
        self.speeds = slice(self.root_speed, self.root_speed + int(np.isin(model.dof_bodyid, self.link_bodies).sum()))
        self.positions = slice(self.root, int(model.jnt_qposadr[last]) + (7 if len(mine_too) == 1 else 1))
        names = [model.actuator(k).name for k in range(model.nu)]
        self.actuators = np.array([k for k, name in enumerate(names) if name.startswith(prefix)], np.int64)
        sites = [model.site(k).name for k in range(model.nsite)]
        self.reach = _reach(model, self.link_bodies)
        self.thrusters = {
            site.removeprefix(prefix): np.array(
                [model.actuator(prefix + thruster(site.removeprefix(prefix), axis)).id for axis in range(6)]
            )
            for site in sites
            if site.startswith(prefix)
        }


#: Metres around robots and loose things within which a scene holds all of a city, and within which it does at first:
#: between the two they go without another. Nobody reaches as far as the first within a step.
_NEEDED, _AHEAD = 40.0, 160.0
# Scenes of parts of a city that are kept.
_SCENES = 3
# Sets of robots that were asked about together and are kept.
_KINDS = 64
_POSES = ("xpos", "xquat", "xmat", "xipos", "ximat", "geom_xpos", "geom_xmat", "site_xpos", "site_xmat")


class KindIndex:
    """Where the numbers of several robots of one kind are in MuJoCo's arrays; a row a robot.

    Attributes
    ----------
    first
        Where positions and speeds of their bases begin, int64, shape ``(k, 2)``.
    angle, rate
        Positions and speeds of their joints, shape ``(k, joints)``.
    motor
        Their actuators, shape ``(k, motors)``.
    thrusters
        Actuators of each site, by its name, shape ``(k, 6)``.
    """

    def __init__(self, robots: Sequence[RobotIndex], coordinates: int) -> None:
        everything = np.arange(coordinates)
        self.first = np.array([(robot.root, robot.root_speed) for robot in robots])
        self.angle = np.array([everything[robot.angle] for robot in robots])
        self.rate = np.array([everything[robot.rate] for robot in robots])
        self.motor = np.array([robot.motor for robot in robots])
        self.thrusters = {
            site: np.array([robot.thrusters[site] for robot in robots])
            for site in (robots[0].thrusters if robots else ())
        }


class SharedModel:
    """A model of MuJoCo that several engines take turns to use.

    Attributes
    ----------
    model
        The model.
    written
        Whose parameters it has now, as `Parameters.numbers`; None before the first.
    holder
        Stands for the parameters it has, as `Parameters.token`.
    met
        Which links meet solids now, and which kinematic bodies are anybody, as bytes of arrays of bool.
    lock
        Held by whoever uses it.
    """

    def __init__(self, model: Any) -> None:
        self.model = model
        self.written: NDArray[np.float64] | None = None
        self.holder: object = None
        self.met = b""
        self.lock = threading.RLock()
        self._frame = (0.0, 0.0)

    def set_frame(self, timestep: float, friction: float) -> None:
        """Have steps take so many seconds, and friction be so much harder than contact."""
        if self._frame != (timestep, friction):
            self.model.opt.timestep, self.model.opt.impratio = timestep, friction
            self._frame = (timestep, friction)


class CompiledScene:
    """Ground, solids, robots and parked bodies, compiled.

    The model itself is shared. The little of it that differs from run to run (servos' gains, sizes and masses of
    pooled bodies, the length of a step) belongs to engines, which write theirs into it before they use it (see
    `vico.sim.physics.mujoco_scene`), so that making another engine copies no terrain.

    Objects that sleep far away still cost a fifth of every step, so there are two models: one without any, and one with
    room for them, which is compiled when the first is placed. A robot moves alike in both, bit for bit.

    Parameters
    ----------
    static
        What never moves.
    models
        The robots.
    capacity
        How many people, vehicles and objects there can be near robots.
    bare
        The same scene without objects; None: this is it.

    Attributes
    ----------
    bare
        Itself, or the scene without objects.
    slots
        How many objects there is room for: none, or all.
    chunked
        Makes scenes of other parts of the same city, `chunks` being those in this one; None: this is all there is.
    first_moving
        Number of the first shape that is not of what never moves.
    link_parts
        Of the links of all robots: index of the robot, body, metres from that within which its shapes are, and body of
        the robot's base; shape ``(links,)`` each.
    """

    def __init__(
        self,
        static: StaticScene,
        models: tuple[RobotModel, ...],
        capacity: Capacity,
        bare: CompiledScene | None = None,
    ) -> None:
        self._static, self.models, self.capacity = static, models, capacity
        self.bare = self if bare is None else bare
        self.slots = 0 if bare is None else capacity.objects
        self.height: HeightField = static.height
        self.shared = SharedModel(compiled_model(static, models, replace(capacity, objects=self.slots)))
        m = self.model = self.shared.model
        if bare is not None:
            # What the solver takes for near enough depends on all there is.
            b = bare.model
            m.stat.meaninertia = b.stat.meaninertia * max(b.nv, 1) / m.nv
        self.robots = [RobotIndex(m, index, model) for index, model in enumerate(models)]
        self.base_position = np.array([np.arange(2) + robot.root for robot in self.robots], np.int64).reshape(-1, 2)
        self.first = np.array([(robot.root, robot.root_speed) for robot in self.robots], np.int64).reshape(-1, 2)
        self.servos = np.concatenate([np.zeros(0, np.int64), *(robot.servo for robot in self.robots)])
        self.servos_of = [np.isin(self.servos, robot.servo) for robot in self.robots]
        movers = [m.body(f"person{i}").id for i in range(capacity.people)]
        movers += [m.body(f"vehicle{i}").id for i in range(capacity.vehicles)]
        self.mover_body = np.array(movers, np.int64)
        self.mover_mocap = np.asarray(m.body_mocapid[self.mover_body], np.int64)
        self.mover_geom = np.asarray(m.body_geomadr[self.mover_body], np.int64)
        self.object_body = np.array([m.body(f"object{i}").id for i in range(self.slots)], np.int64)
        self.object_geoms = np.add.outer(np.asarray(m.body_geomadr[self.object_body], np.int64), np.arange(len(PARTS)))
        m.geom_sameframe[self.object_geoms] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE  # each engine says where they are
        nodes = 2 * len(PARTS) - 1
        self.object_nodes = np.add.outer(np.asarray(m.body_bvhadr[self.object_body], np.int64), np.arange(nodes))
        joint = m.body_jntadr[self.object_body]
        self.object_pose = _run_of(np.add.outer(m.jnt_qposadr[joint], np.arange(7)).ravel())
        self.object_motion = _run_of(np.add.outer(m.jnt_dofadr[joint], np.arange(6)).ravel())
        # What grips more or less by weather: the ground, and tyres and feet, whose friction goes before the ground's.
        on_robot = np.isin(m.geom_bodyid, np.concatenate([np.zeros(0, int), *(r.link_bodies for r in self.robots)]))
        ground = m.body("ground").id
        is_ground = m.geom_bodyid == ground
        # Shapes are in the order of their bodies: the world's solids, the ground, everybody else.
        self.first_moving = int((m.geom_bodyid <= ground).sum())
        self.gripping = np.flatnonzero(is_ground | (on_robot & (m.geom_priority > 0)))
        self.dry_friction = np.array(m.geom_friction[self.gripping, 0])
        self._kinds: dict[bytes, KindIndex] = {}
        self._full: CompiledScene | None = None
        self.chunked: ChunkedScenes | None = None if bare is None else bare.chunked
        self.chunks: frozenset[Chunk] = frozenset() if bare is None else bare.chunks
        self._index_contacts()
        reaches = np.array([robot.reach for robot in self.robots])
        self.solids: SolidCells = SolidCells(static, reaches) if bare is None else bare.solids
        self._links = np.concatenate([np.zeros(0, np.int64), *(robot.link_bodies for robot in self.robots)])
        self._link_bits = np.array(m.body_contype[self._links])
        self._mover_bits = np.array(m.body_contype[self.mover_body]), np.array(m.body_conaffinity[self.mover_body])
        owner = np.repeat(np.arange(len(models)), [len(robot.link_bodies) for robot in self.robots])
        radii = np.zeros(len(self._links))  # metres from a body's origin within which its shapes are
        sizes = np.linalg.norm(m.geom_pos, axis=1) + m.geom_rbound
        for k, body in enumerate(self._links.tolist()):
            radii[k] = sizes[m.geom_bodyid == body].max(initial=0.0)
        self.link_parts = owner, self._links, radii, np.asarray(m.body_rootid[self._links], np.int64)
        pristine = mujoco.MjData(m)
        m.opt.enableflags &= ~SLEEP
        mujoco.mj_kinematics(m, pristine)
        m.opt.enableflags |= SLEEP
        self._poses = {name: np.array(getattr(pristine, name)) for name in _POSES}
        # For every body that might meet the world's shapes MuJoCo joins the bits of all of them, at every step. They
        # are alike: two say what thousands do. Which of them are met is found from their tree of bounding boxes.
        m.body_geomnum[0] = min(int(m.body_geomnum[0]), 2)
        self.stiffness = np.array(m.actuator_gainprm[self.servos, 0])
        self.damping = -np.asarray(m.actuator_biasprm[self.servos, 2])

    @property
    def full(self) -> CompiledScene:
        """The same scene with room for objects."""
        bare = self.bare
        with bare.shared.lock:
            if bare._full is None:
                bare._full = CompiledScene(bare._static, bare.models, bare.capacity, bare)
            return bare._full

    def _index_contacts(self) -> None:
        """Note what each collision shape belongs to: party, owner (robot, mover or slot), link."""
        m = self.model
        party, owner = np.zeros(m.nbody, np.int8), np.full(m.nbody, -1, np.int32)
        link = np.full(m.nbody, -1, np.int16)
        for index, robot in enumerate(self.robots):
            party[robot.link_bodies], owner[robot.link_bodies] = Party.ROBOT, index
            link[robot.link_bodies] = np.arange(len(robot.link_bodies))
        party[self.mover_body], owner[self.mover_body] = Party.BODY, np.arange(len(self.mover_body))
        party[self.object_body], owner[self.object_body] = Party.OBJECT, np.arange(len(self.object_body))
        # Whatever never moves is the last row.
        body = np.append(m.geom_bodyid[self.first_moving :], 0)
        self.geom_party, self.geom_owner, self.geom_link = party[body], owner[body], link[body]

    def reset(self, data: Any) -> None:
        """Put everybody to the start: objects asleep where they are parked, and what never moves where it stands.

        Steps leave out what never moves and what sleeps; poses of those are computed once.
        """
        mujoco.mj_resetData(self.model, data)
        for name, poses in self._poses.items():
            getattr(data, name)[:] = poses

    def choose_pairs(self, shared: SharedModel, near: NDArray[np.bool_], somebody: NDArray[np.bool_]) -> None:
        """Have links meet solids that are near some, and kinematic bodies that are anybody; the rest touches nothing.

        Parameters
        ----------
        near
            Which links solids are near to, shape ``(links,)``.
        somebody
            Which kinematic bodies stand for people and vehicles, shape ``(movers,)``.
        """
        key = near.tobytes() + somebody.tobytes()
        if key != shared.met:
            kinds, affinities = shared.model.body_contype, shared.model.body_conaffinity
            kinds[self._links] = np.where(near, self._link_bits, self._link_bits & ~SOLID)
            kinds[self.mover_body] = np.where(somebody, self._mover_bits[0], 0)
            affinities[self.mover_body] = np.where(somebody, self._mover_bits[1], 0)
            shared.met = key

    def object_at(self, slot: int) -> tuple[int, int]:
        """First of an object's position and of its speed."""
        body = int(self.object_body[slot])
        return int(self.model.jnt_qposadr[self.model.body_jntadr[body]]), int(self.model.body_dofadr[body])

    def kind(self, robots: NDArray[np.int64]) -> KindIndex:
        """Return where the numbers of robots of one kind are."""
        key = robots.tobytes()
        if key not in self._kinds:
            if len(self._kinds) >= _KINDS:
                self._kinds.clear()
            self._kinds[key] = KindIndex([self.robots[robot] for robot in robots.tolist()], self.model.nq)
        return self._kinds[key]

    def link_names(self, robot: int) -> tuple[str, ...]:
        """Names of a robot's links, base first."""
        return self.robots[robot].links

    def site_names(self, robot: int) -> tuple[str, ...]:
        """Names of the sites a robot can be pushed at."""
        return tuple(self.robots[robot].thrusters)


class ChunkedScenes:
    """Scenes of the same robots in parts of a city, compiled when robots come near what the last one does not hold.

    A robot moves alike in all that hold what is around it, bit for bit.

    Parameters
    ----------
    static
        The city.
    models
        The robots.
    capacity
        How many people, vehicles and objects there can be near robots.
    """

    def __init__(self, static: StaticChunks, models: tuple[RobotModel, ...], capacity: Capacity) -> None:
        self._static, self._models, self._capacity = static, models, capacity
        self._along = round(2 * static.height.half / static.side)
        self._known: dict[frozenset[Chunk], CompiledScene] = {}
        self._lock = threading.Lock()

    def around(self, scene: CompiledScene, places: NDArray[np.float64]) -> CompiledScene:
        """Return a scene that holds what is around some places, with room for as many objects as another.

        Parameters
        ----------
        scene
            Is returned itself if it does.
        places
            ENU metres, shape ``(n, 2)``.
        """
        needed = self._near(places, _NEEDED)
        if needed <= scene.chunks:
            return scene
        with self._lock:
            known = next((one for one in reversed(self._known.values()) if needed <= one.chunks), None)
            if known is None:
                known = self._compiled_scene(self._near(places, _AHEAD))
        return known.full if scene.slots else known

    def _compiled_scene(self, chunks: frozenset[Chunk]) -> CompiledScene:
        while len(self._known) >= _SCENES:
            self._known.pop(next(iter(self._known)))
        # From the south-west: the order of solids decides the order of contacts.
        scene = CompiledScene(self._static.scene(sorted(chunks)), self._models, self._capacity)
        scene.chunked, scene.chunks = self, chunks
        self._known[chunks] = scene
        return scene

    def _near(self, places: NDArray[np.float64], within: float) -> frozenset[Chunk]:
        """Return the chunks within some metres of places, along either axis; beside the ground there are none."""
        half, side, last = self._static.height.half, self._static.side, self._along - 1
        first = np.floor((places - within + half) / side).astype(np.int64)
        until = np.floor((places + within + half) / side).astype(np.int64)
        return frozenset(
            (column, row)
            for (west, south), (east, north) in zip(first.tolist(), until.tolist(), strict=True)
            for column in range(max(west, 0), min(east, last) + 1)
            for row in range(max(south, 0), min(north, last) + 1)
        )


def _reach(model: Any, bodies: NDArray[np.int64]) -> float:
    """Metres from the first of a robot's bodies within which all of their shapes are, however its joints turn."""
    away = {int(bodies[0]): 0.0}
    whole = 0.0
    for body in bodies.tolist():
        if body not in away:
            away[body] = away[int(model.body_parentid[body])] + float(np.linalg.norm(model.body_pos[body]))
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        for joint in range(first, first + count):
            away[body] += _slide(model, joint)
        for geom in np.flatnonzero(model.geom_bodyid == body).tolist():
            size = float(np.linalg.norm(model.geom_pos[geom])) + float(model.geom_rbound[geom])
            whole = max(whole, away[body] + size)
    return whole


def _slide(model: Any, joint: int) -> float:
    """Metres a joint moves its body at most, away from where that turns."""
    kind = model.jnt_type[joint]
    if kind == mujoco.mjtJoint.mjJNT_SLIDE:
        return float(np.abs(model.jnt_range[joint]).max()) if model.jnt_limited[joint] else np.inf
    # A hinge or ball away from its body's origin swings that around itself.
    return 0.0 if kind == mujoco.mjtJoint.mjJNT_FREE else 2.0 * float(np.linalg.norm(model.jnt_pos[joint]))


def _run_of(indices: NDArray[Any]) -> slice | NDArray[Any]:
    """Return a slice where indices follow each other: reading it is much faster."""
    if not len(indices):
        return slice(0, 0)
    first = int(indices[0])
    run = np.array_equal(indices, np.arange(first, first + len(indices)))
    return slice(first, first + len(indices)) if run else indices.copy()


# Groups of shapes that are in use, which rays meet, and of those that are not.
_SHOWN, _UNUSED = 0, 5


class EngineParameters:
    """An engine's own numbers of the shared model.

    Attributes
    ----------
    stiffness, damping
        Of the servos that follow angles, Nm/rad and Nms/rad, shape ``(servos,)``.
    mover_half
        Half extents of people and vehicles, metres, shape ``(movers, 3)``.
    object_parts
        Of each object, as in `PartRows`, shape ``(objects, parts, 10)``.
    object_mass, object_inertia
        Kilograms, shape ``(objects,)``, and moments about their axes, kg m2, shape ``(objects, 3)``.
    grip
        Share of their dry friction that ground, tyres and feet have, shape ``(1,)``.
    numbers
        All of these in one array, of which they are views; whoever writes to any of them says so by `changed`.
    token
        Stands for what the numbers are now.
    """

    def __init__(self, scene: CompiledScene) -> None:
        self._scene = scene
        servos, movers, objects = len(scene.servos), len(scene.mover_body), len(scene.object_body)
        shapes = [(servos,), (servos,), (movers, 3), (objects, len(PARTS), 10), (objects,), (objects, 3), (1,)]
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
        # One array, so that two engines' numbers are compared at once.
        self.numbers = np.zeros(int(ends[-1]))
        parts = [part.reshape(shape) for part, shape in zip(np.split(self.numbers, ends[:-1]), shapes, strict=True)]
        self.stiffness, self.damping, self.mover_half, self.object_parts = parts[:4]
        self.object_mass, self.object_inertia, self.grip = parts[4:]
        self.stiffness[:], self.damping[:] = scene.stiffness, scene.damping
        self.mover_half[:], self.grip[:] = 0.25, 1.0
        cube = box_parts(np.full(3, OBJECT_HALF))
        self.object_parts[:], self.object_mass[:] = cube.rows, OBJECT_MASS
        self.object_inertia[:] = cube.inertia(OBJECT_MASS)
        self.token = object()

    def mark_changed(self) -> None:
        """Note that some of the numbers were written."""
        self.token = object()

    def set_object(self, slot: int, parts: PartRows, mass: float) -> None:
        """Say what an object is made of, and weighs, kilograms."""
        self.object_parts[slot], self.object_mass[slot] = parts.rows, mass
        self.object_inertia[slot] = parts.inertia(mass)
        self.mark_changed()

    def hold(self, model: SharedModel) -> None:
        """Have a model say what these say."""
        if model.holder is self.token:
            return
        if model.written is None or not np.array_equal(model.written, self.numbers):
            self.write(model.model)
            model.written = self.numbers.copy()
        model.holder = self.token

    def write(self, model: Any) -> None:
        """Write them, and what the broad phase and the solver derive from them, into a model of the scene."""
        s = self._scene
        model.actuator_gainprm[s.servos, 0] = self.stiffness
        model.actuator_biasprm[s.servos, 1] = -self.stiffness
        model.actuator_biasprm[s.servos, 2] = -self.damping
        model.geom_friction[s.gripping, 0] = s.dry_friction * self.grip
        people = s.capacity.people
        size = self.mover_half.copy()
        size[:people, 1], size[:people, 2] = self.mover_half[:people, 2], 0.0  # cylinders: radius, half height
        half = self.mover_half
        model.geom_size[s.mover_geom] = size
        model.geom_rbound[s.mover_geom] = np.sqrt((half * half).sum(axis=1))
        model.geom_aabb[s.mover_geom, 3:] = half
        model.bvh_aabb[model.body_bvhadr[s.mover_body], 3:] = half
        if s.slots:
            self._write_parts(model)
            self._write_masses(model)

    def _write_parts(self, model: Any) -> None:
        s, parts = self._scene, PartRows(self.object_parts)
        geoms, used = s.object_geoms, parts.is_used
        model.geom_size[geoms], model.geom_rbound[geoms] = parts.sizes, parts.radii
        model.geom_aabb[geoms, 3:] = parts.half
        model.geom_pos[geoms], model.geom_quat[geoms] = parts.position, parts.quaternion
        model.geom_contype[geoms] = np.where(used, OBJECT_BITS[0], 0)
        model.geom_conaffinity[geoms] = np.where(used, OBJECT_BITS[1], 0)
        model.geom_group[geoms] = np.where(used, _SHOWN, _UNUSED)
        # All boxes of a body's tree hold all of its parts: there are too few of those to tell them apart sooner.
        middle, reach = parts.bounds()
        nodes = s.object_nodes
        model.bvh_aabb[nodes, :3], model.bvh_aabb[nodes, 3:] = middle[:, None], reach[:, None]

    def _write_masses(self, model: Any) -> None:
        bodies, mass, inertia = self._scene.object_body, self.object_mass, self.object_inertia
        model.body_mass[bodies] = mass
        model.body_subtreemass[bodies] = mass
        model.body_inertia[bodies] = inertia
        # What the solver scales contacts by: mean inverse inertia of a free body, in translation and in rotation.
        slow = np.stack([1.0 / mass, (1.0 / inertia).mean(axis=1)], axis=1)
        model.body_invweight0[bodies] = slow
        first = model.body_dofadr[bodies]
        dofs = np.add.outer(first, np.arange(6))
        model.dof_M0[dofs] = np.concatenate([np.repeat(mass[:, None], 3, axis=1), inertia], axis=1)
        model.dof_invweight0[dofs] = np.repeat(slow, 3, axis=1)

    def copy_from(self, other: EngineParameters) -> None:
        """Take over what another engine of the same scene, with objects or without, says of all but objects."""
        self.stiffness[:], self.damping[:] = other.stiffness, other.damping
        self.mover_half[:], self.grip[:] = other.mover_half, other.grip
        self.mark_changed()

    def restore(self, numbers: NDArray[np.float64]) -> None:
        """Go back to what `numbers` was."""
        if numbers.shape != self.numbers.shape:
            raise SchemaError("physics: the saved state belongs to other robots or surroundings")
        self.numbers[:] = numbers
        self.mark_changed()
