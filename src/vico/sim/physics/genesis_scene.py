"""A scene that Genesis has built, which its engines take turns to use: its bodies, contacts and free boxes.

Of free boxes there is a fixed number, hung up without weight where nobody comes until they are needed.
"""

from __future__ import annotations

import gc
import threading
import warnings
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.errors import InputError, SchemaError
from vico.geometry import rotation_matrix
from vico.io.compiled import compiled
from vico.sim.physics.engine import Actuate
from vico.sim.physics.genesis_model import GenesisIndex, build_scene, genesis, numpy_view, state_of
from vico.sim.physics.mujoco_model import parked_object, place_bodies
from vico.sim.physics.mujoco_scene import CompiledScene
from vico.sim.physics.records import (
    COARSE,
    CONTACT_FORCE,
    CONTACT_NORMAL,
    CONTACT_POSITION,
    FINE,
    Capacity,
    Contacts,
    ObjectMotion,
    Party,
    RigidObject,
    StaticScene,
)

#: Steps in which Genesis solves a frame: 1/200 s each in fine frames, 1/100 s in coarse ones. Fine ones in which
#: nothing has to be held are solved in one.
STEPS = {FINE: 2, COARSE: 2}


@compiled
def _rotate_vector(q, v):
    """Return a vector turned by a quaternion w, x, y, z."""
    w, x, y, z = q
    tx, ty, tz = 2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])
    return np.array(
        [
            v[0] + w * tx + y * tz - z * ty,
            v[1] + w * ty + z * tx - x * tz,
            v[2] + w * tz + x * ty - y * tx,
        ]
    )


@compiled
def _add_wrench(link, arm, force, torque, pushed, turned):
    """Add a force and a torque to what pushes a link; `arm`: from its robot's centre of mass to where they act."""
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        pushed[link, axis] -= force[axis]
        turned[link, axis] -= torque[axis] + arm[a] * force[b] - arm[b] * force[a]


@compiled
def _push_sites(sites, wrench, poses, pushed, turned):
    """Push links with forces and torques in the frames of sites, shape ``(n, 6)``."""
    links, place, turn = sites
    position, quaternion, centre = poses
    for k in range(len(links)):
        if not wrench[k].any():
            continue
        link = links[k]
        q = quaternion[link]
        arm = position[link] + _rotate_vector(q, place[k]) - centre[link]
        local = np.zeros((2, 3))
        for i in range(3):
            for j in range(3):
                local[0, i] += turn[k, i, j] * wrench[k, j]
                local[1, i] += turn[k, i, j] * wrench[k, 3 + j]
        _add_wrench(link, arm, _rotate_vector(q, local[0]), _rotate_vector(q, local[1]), pushed, turned)


@compiled
def _carry(links, lift, middle, pushed, turned):
    """Carry the weight of links at their own centres of mass (`middle`: from their robot's)."""
    for k in range(len(links)):
        _add_wrench(links[k], middle[links[k]], lift[k], np.zeros(3), pushed, turned)


@compiled
def _fit_boxes(geoms, corners, poses, boxes):
    """Fit the boxes around shapes, which the solver does of those alone that can move."""
    position, quaternion = poses
    low, high = boxes
    for geom in geoms:
        low[geom], high[geom] = np.inf, -np.inf
        for k in range(8):
            corner = position[geom] + _rotate_vector(quaternion[geom], corners[geom, k])
            for axis in range(3):
                low[geom, axis] = min(low[geom, axis], corner[axis])
                high[geom, axis] = max(high[geom, axis], corner[axis])


class Holder(Protocol):
    """A run whose state is in a scene."""

    def leave(self) -> None:
        """Take the state along: another one's comes."""


class BuiltScene:
    """Ground, solids, robots and parked bodies, built.

    Genesis keeps one state to a built scene, and building one takes half a minute in a city; so engines take turns:
    whoever steps puts its state there first, unless it is there already.

    Parameters
    ----------
    static
        What never moves.
    models
        The robots.
    capacity
        How many people, vehicles and objects there can be near robots.

    Attributes
    ----------
    robots
        Where the robots' numbers are.
    holder
        The engine whose state is there.
    twin
        The same scene in MuJoCo, which answers what lies below a point; made when that is first asked.
    lock
        Held by whoever uses it.
    positions, speeds
        Of all joints.
    controls
        Positions, speeds and forces that all joints follow.
    state
        What Genesis carries from one step to the next, by name: views.
    party, owner, number
        What each link belongs to, as `Party`; the robot, mover or slot; and the number of a robot's link.
    """

    def __init__(self, static: StaticScene, models: tuple[RobotModel, ...], capacity: Capacity) -> None:
        self.static, self.models, self.capacity = static, models, capacity
        self.height = static.height
        self._gs = genesis()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.built = build_scene(self._gs, static, models, capacity, COARSE / STEPS[COARSE])
            # Genesis leaves the picture on a level ground open: what warns of that is to be gone before others listen.
            gc.collect()
        pairs = zip(models, self.built.specs, self.built.robots, strict=True)
        self.robots = [GenesisIndex(model, spec, entity) for model, spec, entity in pairs]
        self.first = np.array([(robot.root, robot.root_speed) for robot in self.robots], np.int64).reshape(-1, 2)
        self.holder: Holder | None = None
        self.twin: CompiledScene | None = None
        self.lock = threading.RLock()
        solver = self.built.solver
        self.solver = solver
        self.state = {name: array for name, array in state_of(solver) if array.size}
        self.positions, self.speeds = (
            numpy_view(solver.rigid_info.qpos)[:, 0],
            numpy_view(solver.dyn_state.dofs.vel)[:, 0],
        )
        self.applied = numpy_view(solver.dyn_state.dofs.qf_applied)[:, 0]
        dofs = solver.dyn_state.dofs
        self.controls = tuple(numpy_view(array)[:, 0] for array in (dofs.ctrl_pos, dofs.ctrl_vel, dofs.ctrl_force))
        self.link_position = numpy_view(solver.dyn_state.links.pos)[:, 0]
        self.link_quaternion = numpy_view(solver.dyn_state.links.quat)[:, 0]
        self.grip = numpy_view(solver.dyn_state.geoms.friction_ratio)[:, 0]
        self.gain, self.bias = numpy_view(solver.dyn_info.dofs.act_gain), numpy_view(solver.dyn_info.dofs.act_bias)
        self.limit = numpy_view(solver.dyn_info.dofs.force_range)
        self.weightless = numpy_view(solver.dyn_info.entities.gravity_compensation)
        self._step = numpy_view(solver.rigid_info.substep_dt)
        from vico.sim.physics._genesis_step import SolverStep

        self._solver_step = SolverStep(solver)
        geoms = solver.dyn_state.geoms
        self._geom_position, self._geom_quaternion = numpy_view(geoms.pos)[:, 0], numpy_view(geoms.quat)[:, 0]
        self._placed = numpy_view(geoms.verts_updated)[:, 0]
        self._failed = numpy_view(solver._errno)
        self.sparse = _SPARSE
        links = solver.dyn_state.links
        self._centre, self._middle = numpy_view(links.root_COM)[:, 0], numpy_view(links.i_pos)[:, 0]
        self._pushed, self._turned = numpy_view(links.cfrc_applied_vel)[:, 0], numpy_view(links.cfrc_applied_ang)[:, 0]
        self._site_link = np.concatenate([np.zeros(0, np.int64), *(robot.site_link for robot in self.robots)])
        self._site_place = np.concatenate([np.zeros((0, 3)), *(robot.site_place for robot in self.robots)])
        self._site_turn = np.concatenate([np.zeros((0, 3, 3)), *(robot.site_turn for robot in self.robots)])
        self._weightless = np.concatenate([np.zeros(0, np.int64), *(robot.weightless for robot in self.robots)])
        self._lift = np.concatenate([np.zeros((0, 3)), *(robot.lift for robot in self.robots)])
        self._nothing = np.zeros((0, 6))
        self._kinds: dict[bytes, tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]] = {}
        self._index_links()
        self._boxes = numpy_view(geoms.aabb_min)[:, 0], numpy_view(geoms.aabb_max)[:, 0]
        self._fit_boxes(np.arange(len(solver.geoms)))
        #: The state that Genesis is in when it has been built.
        self.pristine = self.save()

    def _index_links(self) -> None:
        links = self.built.solver.links
        geoms = self.built.solver.geoms
        self.party = np.full(len(links), Party.SCENE, np.int8)
        self.owner, self.number = np.full(len(links), -1, np.int32), np.full(len(links), -1, np.int16)
        for index, robot in enumerate(self.robots):
            self.party[robot.link], self.owner[robot.link] = Party.ROBOT, index
            self.number[robot.link] = np.arange(len(robot.link))
        for party, mine in ((Party.BODY, self.built.movers), (Party.OBJECT, self.built.objects)):
            self.party[mine], self.owner[mine] = party, np.arange(len(mine))
        first = {geom.link.idx: geom.idx for geom in reversed(geoms)}
        self.mover_geom = np.array([first[k] for k in self.built.movers.tolist()], np.int64)
        self.object_geom = np.array([first[k] for k in self.built.objects.tolist()], np.int64)
        self.object_entity = np.array([links[k].entity.idx for k in self.built.objects.tolist()], np.int64)
        self.object_q = np.array([links[k].q_start for k in self.built.objects.tolist()], np.int64)
        self.object_v = np.array([links[k].dof_start for k in self.built.objects.tolist()], np.int64)
        # What grips more or less by weather: the ground, and tyres and feet.
        grips = [geom.idx for geom in geoms if self.party[geom.link.idx] == Party.SCENE]
        self.gripping = np.concatenate([np.array(grips, np.int64), *(robot.gripping for robot in self.robots)])

    def save(self) -> dict[str, NDArray[Any]]:
        """Return a copy of what Genesis carries from one step to the next.

        Directions of contacts, kept for every pair of shapes that could ever touch, are written as the rows that are
        not zero.
        """
        saved = {name: array.copy() for name, array in self.state.items() if name not in _SPARSE}
        rows = self._touched_slots()
        saved["contact_rows"] = rows
        for name in _SPARSE:
            if name in self.state:
                saved[name] = self.state[name][rows].copy()
        return saved

    def load(self, saved: dict[str, NDArray[Any]]) -> None:
        """Write back what `save` returned."""
        touched = self._touched_slots()
        for name, array in self.state.items():
            if name in _SPARSE:
                array[touched] = 0.0
                array[saved["contact_rows"]] = saved[name]
            else:
                array[...] = saved[name]

    def _touched_slots(self) -> NDArray[np.int64]:
        if _SPARSE[1] not in self.state:
            return np.zeros(0, np.int64)
        depth, direction = self.state[_SPARSE[1]][:, 0], self.state[_SPARSE[0]][:, 0]
        return np.flatnonzero((depth != 0.0) | direction.any(axis=1))

    def place_links(self) -> None:
        """Compute poses and velocities of all links and shapes that can move from the state as it is.

        Those of solids stay, which are many: Genesis' own way computes them, too.
        """
        self._solver_step.place()

    def place_movers(self, poses: NDArray[np.float64], entity: NDArray[np.int32]) -> None:
        """Put kinematic bodies at their poses (middle and yaw), and those that are nobody out of the way."""
        movers = self.built.movers
        place_bodies(poses, entity, movers, self.link_position, self.link_quaternion)
        # To Genesis they are fixed, and their shapes, which have the same frames, stay where they are.
        self._geom_position[self.mover_geom] = self.link_position[movers]
        self._geom_quaternion[self.mover_geom] = self.link_quaternion[movers]
        self._placed[self.mover_geom] = False
        self._fit_boxes(self.mover_geom)

    def _fit_boxes(self, geoms: NDArray[np.int64]) -> None:
        poses = self._geom_position, self._geom_quaternion
        _fit_boxes(geoms, self.built.shapes.corners, poses, self._boxes)

    def poses(self, links: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the poses of links, shape ``(n, 4, 4)``."""
        found = np.zeros((len(links), 4, 4))
        found[:, :3, :3] = rotation_matrix(self.link_quaternion[links])
        found[:, :3, 3] = self.link_position[links]
        found[:, 3, 3] = 1.0
        return found

    def step(
        self,
        frame: float,
        wrenches: list[NDArray[np.float64]],
        *,
        holding: bool = True,
        actuate: Actuate | None = None,
    ) -> str:
        """Solve a frame; return what Genesis says if that fails, else "".

        Parameters
        ----------
        holding
            Whether things have to be held still in it.
        wrenches
            Force and torque in the frame of each robot's sites, N and Nm, shape ``(sites, 6)`` each.
        actuate
            Called before each step of the solver; may change `wrenches`.
        """
        steps = STEPS[frame] if holding or frame == COARSE else 1
        self._step[...] = frame / steps
        # Poses computed at the end of a step and those computed from a restored state could differ in their last bits.
        self.place_links()
        try:
            for k in range(steps):
                if actuate is not None:
                    actuate(k * frame / steps, frame / steps)
                self._push(wrenches)
                self._solver_step.step()
                self._pushed[:], self._turned[:] = 0.0, 0.0
            if self._failed.any():
                self.solver.check_errno()
        except self._gs.GenesisException as error:
            return f" (Genesis says: {error})"
        return ""

    def _push(self, wrenches: list[NDArray[np.float64]]) -> None:
        """Apply forces at sites, and carry what is weightless, in the next step.

        As Genesis' `apply_links_external_wrench` does, which takes 0.2 ms a call.
        """
        wrench = np.concatenate([self._nothing, *wrenches])
        poses = self.link_position, self.link_quaternion, self._centre
        _push_sites((self._site_link, self._site_place, self._site_turn), wrench, poses, self._pushed, self._turned)
        _carry(self._weightless, self._lift, self._middle, self._pushed, self._turned)

    def kind(self, robots: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Where numbers of robots of one kind are: bases, and positions and speeds of joints; row = robot."""
        key = robots.tobytes()
        if key not in self._kinds:
            chosen = [self.robots[robot] for robot in robots.tolist()]
            joints = np.array([one.angle for one in chosen]), np.array([one.rate for one in chosen])
            self._kinds[key] = (self.first[robots], *joints)
        return self._kinds[key]

    def link_names(self, robot: int) -> tuple[str, ...]:
        """Names of a robot's links, base first."""
        return self.robots[robot].links

    def site_names(self, robot: int) -> tuple[str, ...]:
        """Names of the sites a robot can be pushed at."""
        return tuple(self.robots[robot].sites)


#: Kept for every pair of shapes that could ever touch: hundreds of thousands in a city, nearly all of them zero.
_SPARSE = ("collider_state.contact_cache.normal", "collider_state.contact_cache.penetration")


def read_contacts(solver: Any) -> NDArray[np.float64]:
    """Return the last step's contacts: two links, position, normal from the first to the second, and normal force.

    Returns
    -------
    ndarray
        float64, shape ``(n, 9)``.
    """
    solver.collider._contact_data_cache.clear()
    found = solver.collider.get_contacts(as_tensor=False, to_torch=False)
    kept = np.zeros((len(found["link_a"]), 9))
    # Genesis' normal points from the second to the first.
    kept[:, 0], kept[:, 1] = found["link_b"], found["link_a"]
    kept[:, CONTACT_POSITION], kept[:, CONTACT_NORMAL] = found["position"], found["normal"]
    kept[:, CONTACT_FORCE] = np.abs(np.einsum("ni,ni->n", found["force"], found["normal"]))
    return kept


def contacts_of(scene: BuiltScene, kept: NDArray[np.float64], entity: NDArray[np.int32]) -> Contacts:
    """Return contacts as the protocol has them, given who stands in each place for movers."""
    links = kept[:, :2].astype(np.int64)
    party, owner = scene.party[links], scene.owner[links]
    movers = party == Party.BODY
    owner = np.where(movers, entity[np.where(movers, owner, 0)], owner).astype(np.int32)
    columns = (kept[:, column].copy() for column in (CONTACT_POSITION, CONTACT_NORMAL, CONTACT_FORCE))
    return Contacts(party, owner, scene.number[links], *columns)


#: Slower than this, m/s and rad/s, for so many seconds an object rests.
_SLOW, _CALM_TIME = 0.03, 0.2


class ObjectSlots:
    """What is in which slot.

    Parameters
    ----------
    count
        How many slots there are.

    Attributes
    ----------
    present
        Which are taken, bool.
    size, mass
        Extents, metres, shape ``(n, 3)``, and kilograms.
    calm
        Seconds for which each has been slow.
    """

    def __init__(self, count: int) -> None:
        self.present, self.calm = np.zeros(count, np.bool_), np.zeros(count)
        self.size, self.mass = np.ones((count, 3)), np.ones(count)

    def check(self, slot: int) -> None:
        """Refuse a slot that is not there."""
        if not 0 <= slot < len(self.present):
            raise InputError(f"physics: there is no slot {slot} for objects; there are {len(self.present)}")

    def place(self, scene: BuiltScene, slot: int, thing: RigidObject) -> None:
        """Put an object into a slot."""
        self.check(slot)
        size = np.asarray(thing.size, np.float64)
        if size.shape != (3,) or not (np.isfinite(size).all() and size.min() > 0.0 and thing.mass > 0.0):
            raise InputError(
                f"physics: an object needs three positive extents and a mass, not {size.tolist()}, {thing.mass} kg"
            )
        self.size[slot], self.mass[slot], self.present[slot], self.calm[slot] = size, thing.mass, True, 0.0
        self._write(scene, slot)
        q, v = int(scene.object_q[slot]), int(scene.object_v[slot])
        scene.positions[q : q + 7] = np.concatenate([thing.position, thing.quaternion])
        scene.speeds[v : v + 6] = np.concatenate([thing.velocity, thing.angular_velocity_body])

    def remove(self, scene: BuiltScene, slot: int) -> None:
        """Take an object out of the scene."""
        self.check(slot)
        if not self.present[slot]:
            return
        self.present[slot], self.calm[slot] = False, 0.0
        scene.weightless[scene.object_entity[slot]] = 1.0
        q, v = int(scene.object_q[slot]), int(scene.object_v[slot])
        scene.positions[q : q + 7] = [*parked_object(slot), 1.0, 0.0, 0.0, 0.0]
        scene.speeds[v : v + 6] = 0.0

    def put(self, scene: BuiltScene) -> None:
        """Write extents and masses of all slots into a scene that another run had."""
        scene.weightless[scene.object_entity] = 1.0
        for slot in np.flatnonzero(self.present).tolist():
            self._write(scene, slot)

    def _write(self, scene: BuiltScene, slot: int) -> None:
        scene.weightless[scene.object_entity[slot]] = 0.0
        scene.built.shapes.resize(scene.object_geom[slot : slot + 1], self.size[slot : slot + 1])
        link, squares, mass = [int(scene.built.objects[slot])], self.size[slot] ** 2, float(self.mass[slot])
        inertia = np.diag(mass / 12.0 * (squares.sum() - squares))
        scene.solver.set_links_mass([mass], link)
        scene.solver.set_links_inertia(inertia[None], link)

    def watch(self, scene: BuiltScene, seconds: float) -> None:
        """Note who was slow in the last so many seconds."""
        if self.present.any():
            motion = scene.speeds[scene.object_v[:, None] + np.arange(6)]
            self.calm = np.where(np.abs(motion).max(axis=1) < _SLOW, self.calm + seconds, 0.0)

    def motion(self, scene: BuiltScene, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> ObjectMotion:
        """Where all objects are."""
        pose = qpos[scene.object_q[:, None] + np.arange(7)].reshape(-1, 7)
        motion = qvel[scene.object_v[:, None] + np.arange(6)].reshape(-1, 6)
        resting = self.calm >= _CALM_TIME - 1e-9
        return ObjectMotion(self.present.copy(), pose[:, :3], pose[:, 3:], motion[:, :3], motion[:, 3:], resting)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return what is in the slots."""
        return {
            "present": self.present.copy(),
            "calm": self.calm.copy(),
            "object_size": self.size.copy(),
            "object_mass": self.mass.copy(),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        if arrays["present"].shape != self.present.shape:
            raise SchemaError("physics: the saved state has room for another number of objects")
        self.present[:], self.calm = arrays["present"], np.array(arrays["calm"])
        self.size[:], self.mass[:] = arrays["object_size"], arrays["object_mass"]
