"""A scene that Genesis has built, which its engines take turns to use."""

from __future__ import annotations

import threading
import warnings
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.sim.physics.frames import COARSE, FINE
from vico.sim.physics.genesis_index import GenesisIndex
from vico.sim.physics.genesis_model import build_scene
from vico.sim.physics.genesis_runtime import genesis, state_of, view
from vico.sim.physics.mujoco_scene import CompiledScene
from vico.sim.physics.mujoco_views import place_bodies
from vico.sim.physics.records import Capacity, Party, StaticScene
from vico.sim.quaternions import matrix_of

#: Steps in which Genesis solves a frame: 1/200 s each in fine frames, 1/100 s in coarse ones.
STEPS = {FINE: 2, COARSE: 2}


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
        pairs = zip(models, self.built.specs, self.built.robots, strict=True)
        self.robots = [GenesisIndex(model, spec, entity) for model, spec, entity in pairs]
        self.first = np.array([(robot.root, robot.root_speed) for robot in self.robots], np.int64).reshape(-1, 2)
        self.holder: Holder | None = None
        self.twin: CompiledScene | None = None
        self.lock = threading.RLock()
        solver = self.built.solver
        self.solver = solver
        self.state = {name: array for name, array in state_of(solver) if array.size}
        self.positions, self.speeds = view(solver.rigid_info.qpos)[:, 0], view(solver.dyn_state.dofs.vel)[:, 0]
        self.applied = view(solver.dyn_state.dofs.qf_applied)[:, 0]
        self.link_position = view(solver.dyn_state.links.pos)[:, 0]
        self.link_quaternion = view(solver.dyn_state.links.quat)[:, 0]
        self.grip = view(solver.dyn_state.geoms.friction_ratio)[:, 0]
        self.gain, self.bias = view(solver.dyn_info.dofs.act_gain), view(solver.dyn_info.dofs.act_bias)
        self.limit = view(solver.dyn_info.dofs.force_range)
        self.weightless = view(solver.dyn_info.entities.gravity_compensation)
        self._step = view(solver.rigid_info.substep_dt)
        from genesis.engine.solvers.rigid.abd.forward_kinematics import kernel_forward_kinematics_links_geoms

        self._kinematics = kernel_forward_kinematics_links_geoms
        self._everywhere = self.built.scene._sanitize_envs_idx(None)
        self.sparse = _SPARSE
        links = solver.dyn_state.links
        self._centre, self._middle = view(links.root_COM)[:, 0], view(links.i_pos)[:, 0]
        self._pushed, self._turned = view(links.cfrc_applied_vel)[:, 0], view(links.cfrc_applied_ang)[:, 0]
        self._index_links()
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
        rows = self._touched()
        saved["contact_rows"] = rows
        for name in _SPARSE:
            if name in self.state:
                saved[name] = self.state[name][rows].copy()
        return saved

    def load(self, saved: dict[str, NDArray[Any]]) -> None:
        """Write back what `save` returned."""
        touched = self._touched()
        for name, array in self.state.items():
            if name in _SPARSE:
                array[touched] = 0.0
                array[saved["contact_rows"]] = saved[name]
            else:
                array[...] = saved[name]

    def _touched(self) -> NDArray[np.int64]:
        if _SPARSE[1] not in self.state:
            return np.zeros(0, np.int64)
        depth, direction = self.state[_SPARSE[1]][:, 0], self.state[_SPARSE[0]][:, 0]
        return np.flatnonzero((depth != 0.0) | direction.any(axis=1))

    def place_links(self) -> None:
        """Compute poses of all links and shapes from the state as it is."""
        solver = self.solver
        self._kinematics(self._everywhere, solver.dyn_state, solver.dyn_info, solver.rigid_info, solver.rigid_config)
        solver._is_forward_pos_updated = solver._is_forward_vel_updated = True

    def place_movers(self, poses: NDArray[np.float64], entity: NDArray[np.int32]) -> None:
        """Put kinematic bodies at their poses (middle and yaw), and those that are nobody out of the way."""
        place_bodies(poses, entity, self.built.movers, self.link_position, self.link_quaternion)

    def poses(self, links: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the poses of links, shape ``(n, 4, 4)``."""
        found = np.zeros((len(links), 4, 4))
        found[:, :3, :3] = matrix_of(self.link_quaternion[links])
        found[:, :3, 3] = self.link_position[links]
        found[:, 3, 3] = 1.0
        return found

    def step(self, frame: float, wrenches: list[NDArray[np.float64]]) -> str:
        """Solve a frame; return what Genesis says if that fails, else "".

        Parameters
        ----------
        wrenches
            Force and torque in the frame of each robot's sites, N and Nm, shape ``(sites, 6)`` each.
        """
        steps = STEPS[frame]
        self._step[...] = frame / steps
        # Poses computed at the end of a step and those computed from a restored state could differ in their last bits.
        self.place_links()
        try:
            for _ in range(steps):
                self._push(wrenches)
                self.built.scene.step(update_visualizer=False)
            self.solver.check_errno()
        except self._gs.GenesisException as error:
            return f" (Genesis says: {error})"
        return ""

    def _push(self, wrenches: list[NDArray[np.float64]]) -> None:
        """Apply forces at sites, and carry what is weightless, in the next step."""
        for robot, wrench in zip(self.robots, wrenches, strict=True):
            if wrench.any():
                body = matrix_of(self.link_quaternion[robot.site_link])
                turn = body @ robot.site_turn
                place = self.link_position[robot.site_link] + np.einsum("nij,nj->ni", body, robot.site_place)
                force, torque = (np.einsum("nij,nj->ni", turn, wrench[:, part]) for part in _WRENCH)
                self._apply(robot.site_link, place - self._centre[robot.site_link], force, torque)
            if len(robot.weightless):
                self._apply(robot.weightless, self._middle[robot.weightless], robot.lift, np.zeros_like(robot.lift))

    def _apply(
        self,
        links: NDArray[np.int64],
        arm: NDArray[np.float64],
        force: NDArray[np.float64],
        torque: NDArray[np.float64],
    ) -> None:
        """Push links in the next step, as Genesis' `apply_links_external_wrench` does, which takes 0.2 ms a call.

        Parameters
        ----------
        arm
            From the centre of mass of all of a link's robot to where the force acts, ENU metres, shape ``(n, 3)``.
        """
        np.subtract.at(self._pushed, links, force)
        np.subtract.at(self._turned, links, torque + np.cross(arm, force))

    def link_names(self, robot: int) -> tuple[str, ...]:
        """Names of a robot's links, base first."""
        return self.robots[robot].links

    def site_names(self, robot: int) -> tuple[str, ...]:
        """Names of the sites a robot can be pushed at."""
        return tuple(self.robots[robot].sites)


_WRENCH = (slice(0, 3), slice(3, 6))
#: Kept for every pair of shapes that could ever touch: hundreds of thousands in a city, nearly all of them zero.
_SPARSE = ("collider_state.contact_cache.normal", "collider_state.contact_cache.penetration")
