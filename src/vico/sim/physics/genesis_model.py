"""What a scene in Genesis is made of: ground, solids, robots, pools of movers and of objects.

Genesis reads the same MJCF as MuJoCo, through MuJoCo. It cannot add bodies to what it has built, nor resize them, and
keeps tables of 0.8 MB for every shape that differs from all others; so boxes and cylinders are built alike, of unit
extents, and get their own by writing them where Genesis looks them up (`GenesisShapes`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import BUMP, LIMB, TOUCH, RobotModel
from vico.io.mujoco import mujoco
from vico.quaternions import matrix_of
from vico.sim.physics.genesis_runtime import view
from vico.sim.physics.mujoco_model import PARKED, PARKED_APART, SOLID, ground_grid, robot_spec
from vico.sim.physics.records import Capacity, StaticScene

#: Genesis takes the larger of two frictions, and 0.01 at least. Tyres and feet, which go before the ground in MuJoCo,
#: have more than the ground here; solids and people have none of their own.
GROUND_FRICTION, SMOOTH, OBJECT_FRICTION = 0.6, 0.01, 0.6
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
    parked: Mapping[str, Any] = {"pos": parked_mover(index), "fixed": True, "visualization": False, **_BITS}
    if on_foot:
        return gs.morphs.Cylinder(radius=0.5, height=1.0, **parked)
    return gs.morphs.Box(size=(1.0, 1.0, 1.0), **parked)


def parked_mover(index: int) -> tuple[float, float, float]:
    """Where a kinematic body waits that stands for nobody."""
    return PARKED_APART * index, 0.0, PARKED


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
        self._data, self.corners = view(info.geoms.data), view(solver.rigid_info.geoms_init_AABB)
        self._vertices, self._link = view(info.verts.init_pos), view(info.geoms.link_idx)
        self._start, self._end = view(info.geoms.vert_start), view(info.geoms.vert_end)
        self._position, self._quaternion = view(info.geoms.pos), view(info.geoms.quat)
        self._link_low, self._link_high = view(collider.links_init_aabb_min), view(collider.links_init_aabb_max)
        self._first, self._last = view(info.links.geom_start), view(info.links.geom_end)
        self._type, self._cylinder = view(info.geoms.type), int(solver.geoms[0].type.__class__.CYLINDER)
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
            self._bound(link)

    def _bound(self, link: int) -> None:
        """Fit the box around a link's shapes, in its frame."""
        mine = range(int(self._first[link]), int(self._last[link]))
        points = np.concatenate([self.corners[g] @ matrix_of(self._quaternion[g]).T + self._position[g] for g in mine])
        self._link_low[link], self._link_high[link] = points.min(axis=0), points.max(axis=0)
