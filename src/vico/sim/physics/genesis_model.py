"""Genesis: how it is started, what a scene in it is made of, and where a robot's numbers are in its arrays.

Genesis is started once a process; its arrays are read and written without copies. It reads the same MJCF as MuJoCo,
through MuJoCo. It cannot add bodies to what it has built, nor resize them, and keeps tables of 0.8 MB for every shape
that differs from all others; so boxes and cylinders are built alike, of unit extents, and get their own by writing them
where Genesis looks them up (`GenesisShapes`).
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import BUMP, LIMB, TOUCH, RobotModel
from vico.errors import InputError, MissingExtraError
from vico.geometry import rotation_matrix
from vico.io.compiled import compiled
from vico.io.mujoco import mujoco
from vico.sim.physics.mujoco_model import PARKED, PARKED_APART, SOLID, ground_grid, robot_spec
from vico.sim.physics.records import Capacity, StaticScene

#: The version this engine is written against: it writes to arrays that are no part of Genesis' documented surface.
VERSION = "1.4.5"
_LOCK = threading.Lock()


def genesis() -> Any:
    """Return the package, started in double precision on the processor.

    Raises
    ------
    MissingExtraError
        If it does not import, or is another version.
    InputError
        If somebody started it in this process with other settings.
    """
    try:
        import genesis as gs
    except ImportError as error:
        raise MissingExtraError(
            f"physics: Genesis does not import ({error}): pip install 'virtual-community[genesis]', and on Debian "
            "apt install libgl1 libegl1 libxrender1 libxext6"
        ) from error
    if gs.__version__ != VERSION:
        raise MissingExtraError(
            f"physics: Genesis is {gs.__version__}, and this engine is written for {VERSION}: "
            f"pip install genesis-world=={VERSION}"
        )
    with _LOCK:
        if not getattr(gs, "_initialized", False):
            # Metres from the origin of a city leave too few digits for contacts in single precision.
            gs.init(backend=gs.cpu, precision="64", logging_level="error")
        elif gs.backend != gs.cpu or gs.np_float is not np.float64:
            raise InputError(
                "physics: Genesis was started in this process with other settings; leave starting it to vico, or call "
                "genesis.init(backend=genesis.cpu, precision='64')"
            )
    return gs


def numpy_view(array: Any) -> NDArray[Any]:
    """Return an array of Genesis as numpy's, sharing its memory."""
    from genesis.utils.misc import qd_to_torch

    shared: NDArray[Any] = qd_to_torch(array, copy=False).numpy()
    return shared


def state_of(solver: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield what Genesis' rigid solver carries from one step to the next, by name, sharing its memory."""
    from genesis.utils import array_class

    for item in solver.data:
        if isinstance(item, array_class.ArrayItem) and item.kind == array_class.DataKind.STATE:
            yield item.name, numpy_view(item.array)


#: How a joint is driven, as Genesis counts it: towards a position, towards a speed, by a force.
POSITION, VELOCITY, FORCE = range(3)


@compiled
def _write_targets(joints, transmission, targets, controls):
    """Write what joints follow for the motors that drive them to follow `targets`.

    Parameters
    ----------
    joints
        Degrees of freedom, and how each is driven.
    transmission
        What the motors' positions or speeds make of the joints', and the other way round.
    controls
        Positions, speeds and forces that all joints follow: written.
    """
    driven, mode = joints
    joint_of, motor_of = transmission
    for k in range(len(driven)):
        wanted = 0.0
        for motor in range(len(targets)):
            wanted += (motor_of[motor, k] if mode[k] == FORCE else joint_of[k, motor]) * targets[motor]
        for kind in range(len(controls)):
            controls[kind][driven[k]] = wanted if kind == mode[k] else 0.0


class GenesisIndex:
    """Where a robot's numbers are.

    Motors of Genesis sit on joints. A motor on a tendon of joints, such as those that drive and turn a base on two
    wheels, is there a servo of each of these joints towards the speed at which the tendons have theirs.

    Parameters
    ----------
    model
        The robot.
    spec
        The same, compiled by MuJoCo alone.
    entity
        The same in Genesis.

    Attributes
    ----------
    root, root_speed
        First of its base's position and speed.
    positions, speeds
        All its positions and speeds.
    angle, rate
        Positions and speeds of its joints, in the order of the model's `joints`, int64.
    driven
        Degrees of freedom that its motors drive, int64.
    mode
        How each of those is driven, int32.
    gain, bias, limit
        Genesis' numbers of each: force = gain * target + bias . (1, position, speed), within the limits; shapes
        ``(n,)``, ``(n, 3)``, ``(n, 2)``.
    servo
        Which of those follow angles, bool.
    links, link
        Names of all its bodies, base first; and their numbers.
    shown
        Links in the order of the model's `shapes`.
    sites
        Sites by name: row in `site_link` and the others.
    site_link, site_place, site_turn
        Link of each site, and its place and rotation in the frame of that.
    gripping
        Shapes whose friction goes before that of what they touch (tyres, feet), int64.
    weightless, lift
        Links whose weight is carried for them, and the force that does, N, shape ``(n, 3)``.
    """

    def __init__(self, model: RobotModel, spec: Any, entity: Any) -> None:
        self._offset = int(entity.dof_start), int(entity.q_start)
        self.root, self.root_speed = int(entity.q_start), int(entity.dof_start)
        self.positions = slice(self.root, self.root + int(entity.n_qs))
        self.speeds = slice(self.root_speed, self.root_speed + int(entity.n_dofs))
        names = [link.name for link in entity.links]
        self.links = tuple(names)
        self.link = np.array([link.idx for link in entity.links], np.int64)
        of = dict(zip(names, self.link.tolist(), strict=True))
        self.shown = np.array([of[name] for name in model.shapes], np.int64)
        self._dof = {joint.name: int(joint.dofs_idx[0]) for joint in entity.joints if joint.n_dofs == 1}
        self._q = {joint.name: int(joint.qs_idx[0]) for joint in entity.joints if joint.n_dofs == 1}
        # Joints by their own names, but those of motors by the motors'.
        moved = {name: spec.joint(int(spec.actuator_trnid[spec.actuator(name).id, 0])).name for name in model.driven}
        measured = [str(moved.get(name, name)) for name in model.joints]
        self.angle = np.array([self._q[name] for name in measured], np.int64)
        self.rate = np.array([self._dof[name] for name in measured], np.int64)
        self._index_motors(model, spec)
        self._index_sites(spec, of)
        self.gripping = _gripping(spec, entity)
        carried = np.flatnonzero(spec.body_gravcomp > 0.0)
        self.weightless = np.array([of[spec.body(k).name] for k in carried.tolist()], np.int64)
        self.lift = np.zeros((len(carried), 3))
        self.lift[:, 2] = spec.body_mass[carried] * spec.body_gravcomp[carried] * -spec.opt.gravity[2]

    def _index_motors(self, model: RobotModel, spec: Any) -> None:
        """Note what each motor drives, and make of motors on tendons servos of joints."""
        actuators = [spec.actuator(name).id for name in model.driven]
        through: dict[int, NDArray[np.float64]] = {}  # joint -> how much of it is in each motor
        for row, actuator in enumerate(actuators):
            for joint, share in _transmission(spec, actuator):
                through.setdefault(joint, np.zeros(len(actuators)))[row] += share
        joints = list(through)
        #: What the speeds of the driven joints make of the speeds of the motors, shape ``(motors, n)``.
        of_joint = np.array([through[joint] for joint in joints]).reshape(len(joints), len(actuators))
        self._motor_of = np.ascontiguousarray(of_joint.T)
        self._joint_of = np.ascontiguousarray(np.linalg.pinv(self._motor_of))
        self.driven = np.array([self._dof[spec.joint(joint).name] for joint in joints], np.int64)
        count = len(joints)
        self.mode = np.zeros(count, np.int32)
        self.gain, self.bias = np.zeros(count), np.zeros((count, 3))
        self.limit = np.tile([-np.inf, np.inf], (count, 1))
        follows = dict(zip(model.motors, model.servos, strict=True))
        modes = {"position": POSITION, "velocity": VELOCITY, "force": FORCE}
        for k in range(count):
            mine = np.flatnonzero(self._motor_of[:, k])
            share = np.abs(self._motor_of[mine, k])
            motors = [actuators[row] for row in mine]
            servos = {follows[model.driven[row]] for row in mine}
            if len(servos) > 1 or (len(mine) > 1 and servos != {"velocity"}):
                raise InputError(
                    f"physics: joint {spec.joint(joints[k]).name!r} of robot {model.name!r} has motors of several "
                    "kinds, which Genesis has not; take --physics mujoco"
                )
            self.mode[k] = modes[servos.pop()]
            # As stiff as the stiffest of its motors is to the joints that turn together in it.
            stiff = [
                float(spec.actuator_gainprm[motor, 0] * s * np.abs(self._motor_of[row]).sum())
                for motor, row, s in zip(motors, mine, share, strict=True)
            ]
            self.gain[k] = max(stiff)
            if len(mine) == 1 and share[0] == 1.0:
                self.gain[k] = spec.actuator_gainprm[motors[0], 0]
                self.bias[k] = spec.actuator_biasprm[motors[0], :3]
            else:
                self.bias[k, 2] = -self.gain[k]
            if all(spec.actuator_forcelimited[motor] for motor in motors):
                most = float(np.sum(share * spec.actuator_forcerange[motors, 1]))
                self.limit[k] = -most, most
        self.servo = self.mode == POSITION

    def _index_sites(self, spec: Any, of: dict[str, int]) -> None:
        self.sites = {spec.site(k).name: k for k in range(spec.nsite)}
        bodies = [spec.body(int(body)).name for body in spec.site_bodyid]
        self.site_link = np.array([of[name] for name in bodies], np.int64)
        self.site_place = np.array(spec.site_pos, np.float64).reshape(-1, 3)
        self.site_turn = rotation_matrix(np.array(spec.site_quat, np.float64).reshape(-1, 4)).reshape(-1, 3, 3)

    def follow(self, targets: NDArray[np.float64], controls: tuple[NDArray[np.float64], ...]) -> None:
        """Have the motors follow `targets`: write what their joints do into `controls`, by `mode`."""
        _write_targets((self.driven, self.mode), (self._joint_of, self._motor_of), targets, controls)

    def motor_forces(self, forces: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the motors' forces, given the driven joints'."""
        return self._joint_of.T @ forces


def _gripping(spec: Any, entity: Any) -> NDArray[np.int64]:
    """Return shapes with a priority. Genesis has those of a link that touch anything in MuJoCo's order."""
    found: list[int] = []
    for link in entity.links:
        body = spec.body(link.name)
        first, count = int(body.geomadr[0]), int(body.geomnum[0])
        touching = [k for k in range(first, first + count) if spec.geom_contype[k] or spec.geom_conaffinity[k]]
        found += [geom.idx for geom, k in zip(link.geoms, touching, strict=True) if spec.geom_priority[k] > 0]
    return np.array(found, np.int64)


def _transmission(spec: Any, actuator: int) -> list[tuple[int, float]]:
    """Joints an actuator drives, and how much of it goes into each."""
    kind, target = int(spec.actuator_trntype[actuator]), int(spec.actuator_trnid[actuator, 0])
    gear = float(spec.actuator_gear[actuator, 0])
    if kind == int(mujoco.mjtTrn.mjTRN_JOINT):
        return [(target, gear)]
    if kind == int(mujoco.mjtTrn.mjTRN_TENDON):
        first, count = int(spec.tendon_adr[target]), int(spec.tendon_num[target])
        rows = range(first, first + count)
        if all(spec.wrap_type[k] == int(mujoco.mjtWrap.mjWRAP_JOINT) for k in rows):
            return [(int(spec.wrap_objid[k]), gear * float(spec.wrap_prm[k])) for k in rows]
    name = spec.actuator(actuator).name
    raise InputError(f"physics: motor {name!r} drives no joints, which Genesis' motors do; take --physics mujoco")


#: Genesis takes the larger of two frictions, and 0.01 at least. Tyres and feet, which go before the ground in MuJoCo,
#: have more than the ground here; solids and people have none of their own.
GROUND_FRICTION = 0.6
SMOOTH = 0.01
OBJECT_FRICTION = 0.6
#: Side of the squares whose solids are one link, metres: boxes around links are compared first.
_TILE = 120.0
#: Collisions that are looked at in a step at most.
_PAIRS = 400
_GRID = 16
_BITS = {"contype": TOUCH | BUMP, "conaffinity": TOUCH | BUMP | LIMB}


@dataclass
class Built:
    """A scene that Genesis has built.

    Attributes
    ----------
    scene, solver
        Genesis' own.
    robots
        Their entities.
    movers, objects
        Links of the kinematic bodies and of the free boxes, int64.
    specs
        Each robot, compiled by MuJoCo alone: names and numbers that Genesis does not keep.
    shapes
        Boxes and cylinders that can be resized.
    """

    scene: Any
    solver: Any
    robots: list[Any]
    movers: NDArray[np.int64]
    objects: NDArray[np.int64]
    specs: list[Any]
    shapes: GenesisShapes


def build_scene(gs: Any, static: StaticScene, models: Sequence[RobotModel], capacity: Capacity, step: float) -> Built:
    """Build ground, solids, robots, and all the bodies that `capacity` allows, parked."""
    scene = gs.Scene(
        sim_options=gs.options.SimOptions(dt=step, substeps=1, gravity=(0.0, 0.0, -9.81)),
        rigid_options=gs.options.RigidOptions(
            # Shapes that say nothing themselves are as stiff as the step allows.
            constraint_timeconst=None,
            max_collision_pairs=_PAIRS,
            friction_cone=gs.friction_cone.elliptic,
            impratio=1.0,
            enable_torsional_friction=True,
            integrator=gs.integrator.implicitfast,
        ),
        show_viewer=False,
    )
    _add_ground(gs, scene, static)
    solids = _Solids()
    solids.add(static)
    city = _add_model(gs, scene, solids.spec) if solids.tiles else None
    specs, robots = [], []
    for index, model in enumerate(models):
        spec = robot_spec(model)
        specs.append(spec.compile())
        robots.append(_add_model(gs, scene, spec, (10.0 * index, 0.0, model.stand)))
    movers = [
        scene.add_entity(_mover(gs, k, k < capacity.people), material=_material(gs, SMOOTH))
        for k in range(capacity.people + capacity.vehicles)
    ]
    objects = [_add_object(gs, scene, k) for k in range(capacity.objects)]
    scene.build()
    solver = scene.sim.rigid_solver
    shapes = GenesisShapes(solver)
    if city is not None:
        geoms = [geom.idx for link in city.links for geom in link.geoms]
        shapes.resize(np.array(geoms), np.array(solids.in_order([link.name for link in city.links])))
    return Built(scene, solver, robots, _links(movers), _links(objects), specs, shapes)


def _material(gs: Any, friction: float | None = None) -> Any:
    """Return a rigid material; without a friction, shapes have that of their model.

    Genesis samples the distance around every shape on a grid, though none of ours needs it: on the coarsest it takes.
    """
    return gs.materials.Rigid(friction=friction, sdf_min_res=_GRID, sdf_max_res=_GRID)


def _links(entities: list[Any]) -> NDArray[np.int64]:
    return np.array([entity.links[0].idx for entity in entities], np.int64)


def _add_model(gs: Any, scene: Any, spec: Any, place: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    """Add a specification, without anything to look at."""
    spec.compile()
    # Aligned bodies have another frame than the one that the model says.
    morph = gs.morphs.MJCF(file=spec.to_xml(), pos=place, visualization=False, align=False, decimate=False)
    entity = scene.add_entity(morph, material=_material(gs))
    # What touches what holds between models, too: Genesis keeps to it within each alone.
    entity._is_local_collision_mask = False
    return entity


def _add_ground(gs: Any, scene: Any, static: StaticScene) -> None:
    heights, half = ground_grid(static, kerbs=False)
    low, high = float(heights.min()), float(heights.max())
    rough = _material(gs, GROUND_FRICTION)
    if high - low < 1e-4:
        bits = {"contype": TOUCH, "conaffinity": TOUCH | LIMB}
        scene.add_entity(gs.morphs.Plane(pos=(0.0, 0.0, low), visualization=False, **bits), material=rough)
        return
    cell = 2.0 * half / (len(heights) - 1)
    # Genesis' first index goes along x.
    terrain = gs.morphs.Terrain(
        pos=(-half, -half, low),
        height_field=(heights.T - low).astype(np.float64),
        horizontal_scale=cell,
        vertical_scale=1.0,
        visualization=False,
    )
    entity = scene.add_entity(terrain, material=rough)
    for geom in entity.geoms:
        geom.desc.contype, geom.desc.conaffinity = TOUCH, TOUCH | LIMB


@dataclass
class _Solids:
    """Solids as one model, those of a square as one body of it.

    Attributes
    ----------
    spec
        The model.
    tiles
        Bodies by square.
    sizes
        Extents of a body's boxes and cylinders, in their order, by its name; zeros for hulls.
    """

    spec: Any = field(default_factory=mujoco.MjSpec)
    tiles: dict[tuple[int, int], Any] = field(default_factory=dict)
    sizes: dict[str, list[tuple[float, float, float]]] = field(default_factory=dict)

    def add(self, static: StaticScene) -> None:
        for index, points in enumerate(static.hulls):
            middle = (points.min(axis=0) + points.max(axis=0)) / 2
            self.spec.add_mesh(
                name=f"hull{index}",
                uservert=(points - middle).astype(np.float32).ravel().tolist(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
            )
            self._geom(middle, (0.0, 0.0, 0.0), type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"hull{index}")
        for x, y, z, yaw, a, b, c in static.boxes.tolist():
            turn = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
            box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": [0.5] * 3, "quat": turn}
            self._geom((x, y, z), (2 * a, 2 * b, 2 * c), **box)
        for x, y, z, radius, half in static.pillars.tolist():
            pillar = {"type": mujoco.mjtGeom.mjGEOM_CYLINDER, "size": [0.5, 0.5, 0.0]}
            self._geom((x, y, z), (2 * radius, 2 * radius, 2 * half), **pillar)

    def _geom(
        self, middle: Sequence[float] | NDArray[np.float64], extents: tuple[float, float, float], **shape: Any
    ) -> None:
        x, y, z = (float(v) for v in middle)
        key = int(x // _TILE), int(y // _TILE)
        name = f"tile_{key[0]}_{key[1]}"
        if key not in self.tiles:
            self.tiles[key] = self.spec.worldbody.add_body(name=name)
        self.tiles[key].add_geom(pos=[x, y, z], contype=0, conaffinity=SOLID, friction=[SMOOTH, 0.0, 0.0], **shape)
        self.sizes.setdefault(name, []).append(extents)

    def in_order(self, links: Sequence[str]) -> list[tuple[float, float, float]]:
        """Return the sizes of the shapes of links, in their order."""
        return [size for link in links for size in self.sizes.get(link, [])]


def _mover(gs: Any, index: int, on_foot: bool) -> Any:
    place = PARKED_APART * index, 0.0, PARKED
    parked: Mapping[str, Any] = {"pos": place, "fixed": True, "visualization": False, **_BITS}
    if on_foot:
        return gs.morphs.Cylinder(radius=0.5, height=1.0, **parked)
    return gs.morphs.Box(size=(1.0, 1.0, 1.0), **parked)


def _add_object(gs: Any, scene: Any, index: int) -> Any:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="object", pos=[0.0, 0.0, 0.0])
    body.add_freejoint()
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.5] * 3,
        mass=1.0,
        condim=4,
        friction=[OBJECT_FRICTION, 0.005, 0.0001],
        contype=TOUCH | SOLID,
        conaffinity=TOUCH | LIMB,
    )
    return _add_model(gs, scene, spec, (PARKED_APART * index, PARKED_APART, PARKED))


# Of a unit box, as Genesis counts them: x slowest, z fastest.
_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


class GenesisShapes:
    """Extents of boxes and cylinders where Genesis looks them up.

    Parameters
    ----------
    solver
        Of a built scene.

    Attributes
    ----------
    corners
        Of the box around each shape, in its frame, metres, shape ``(n, 8, 3)``.
    """

    def __init__(self, solver: Any) -> None:
        info, collider = solver.dyn_info, solver.collider.collider_info
        self._data, self.corners = numpy_view(info.geoms.data), numpy_view(solver.rigid_info.geoms_init_AABB)
        self._vertices, self._link = numpy_view(info.verts.init_pos), numpy_view(info.geoms.link_idx)
        self._start, self._end = numpy_view(info.geoms.vert_start), numpy_view(info.geoms.vert_end)
        self._position, self._quaternion = numpy_view(info.geoms.pos), numpy_view(info.geoms.quat)
        self._link_low, self._link_high = (
            numpy_view(collider.links_init_aabb_min),
            numpy_view(collider.links_init_aabb_max),
        )
        self._first, self._last = numpy_view(info.links.geom_start), numpy_view(info.links.geom_end)
        self._type, self._cylinder = numpy_view(info.geoms.type), int(solver.geoms[0].type.__class__.CYLINDER)
        # Unit shapes: what they are scaled from.
        self._unit = self._vertices.copy()

    def resize(self, geoms: NDArray[np.int64], sizes: NDArray[np.float64]) -> None:
        """Give shapes their extents along x, y and z, metres, shape ``(n, 3)``; rows of zeros stay as they are."""
        for geom, size in zip(geoms.tolist(), sizes, strict=True):
            if not size.any():
                continue
            self._data[geom, :3] = (size[0] / 2, size[2], 0.0) if self._type[geom] == self._cylinder else size
            self.corners[geom] = _CORNERS * size / 2
            rows = slice(int(self._start[geom]), int(self._end[geom]))
            self._vertices[rows] = self._unit[rows] * size
        for link in np.unique(self._link[geoms]).tolist():
            self._set_bounds(link)

    def _set_bounds(self, link: int) -> None:
        """Fit the box around a link's shapes, in its frame."""
        mine = range(int(self._first[link]), int(self._last[link]))
        points = np.concatenate(
            [self.corners[g] @ rotation_matrix(self._quaternion[g]).T + self._position[g] for g in mine]
        )
        self._link_low[link], self._link_high[link] = points.min(axis=0), points.max(axis=0)
