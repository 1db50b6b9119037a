"""The robots of a run: driven by physics, steered by routes, velocities or motor commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.assets.robots import FourLegs, robot_model
from vico.errors import InputError, SchemaError
from vico.exact import apply_matrix
from vico.seeds import rng
from vico.sim.bodies import ROBOT, Bodies, Drawn
from vico.sim.carrying import DeckPose
from vico.sim.physics import MujocoEngine, PhysicsEngine
from vico.sim.physics.engine import FRAME, Base
from vico.sim.physics.surroundings import static_scene_of
from vico.sim.robots.controllers import PERIOD, controller_for, getting_up
from vico.sim.robots.navigation import GAP, SIGHT, neighbours_of
from vico.sim.robots.path_follower import PathFollower, RobotStatus
from vico.sim.state import REASON_LENGTH
from vico.world.folder import World
from vico.world.mesh import Surface
from vico.world.model import FIRST_BODY
from vico.world.routing import Router

#: Cosine of the tilt at which a robot counts as fallen, and seconds it has to last.
_FALLEN, _FALL_TIME = 0.7, 0.3
#: Seconds after which a robot that can't get up is left lying.
_GIVE_UP = 30.0
_SPAWN_ROOM, _SPAWN_APART = 1.0, 3.0
# What the states' arrays hold: members of an enumeration are slow to look up in the control loop.
_FALLEN_STATUS = int(RobotStatus.FALLEN)


class Mode(IntEnum):
    """Who decides what a robot does."""

    IDLE, VELOCITY, MOTORS, ROUTE = range(4)


_IDLE, _VELOCITY, _MOTORS, _ROUTE = (int(mode) for mode in Mode)


@dataclass(frozen=True)
class RobotEvent:
    """Something that happened to a robot: `kind` is arrived, blocked, fallen, recovered or lost.

    Attributes
    ----------
    position
        Of the robot's base when it is asked, world frame, metres, float64, shape ``(3,)``.
    """

    robot: int
    kind: str
    position: NDArray[np.float64]


_KINDS = ("arrived", "blocked", "fallen", "recovered", "lost")


class RobotPopulation:
    """All robots of a run.

    Parameters
    ----------
    world
        Where they are.
    kinds
        Names of their models, in order; robot ``i`` is the agent ``robot_i``.
    spawns
        Where each starts: x, y, yaw, shape ``(n, 3)``; None: reachable places apart from each other, by `seed`.
    seed
        Decides spawns and errands.
    first_entity
        Entity of robot 0; the others follow.
    errands
        Robots nobody commands go from place to place on their own.
    packs
        Use installed packages' models; False: our own alone.
    router
        Finds ways; made from the world's walkable map if it is not given.

    Raises
    ------
    InputError
        If a model is not known, or spawns do not fit.
    """

    def __init__(
        self,
        world: World,
        kinds: Sequence[str],
        spawns: ArrayLike | None = None,
        *,
        seed: int = 0,
        first_entity: int = FIRST_BODY,
        errands: bool = False,
        packs: bool = True,
        router: Router | None = None,
    ) -> None:
        self.world = world
        self.kinds = tuple(kinds)
        self.models = [robot_model(kind, packs=packs) for kind in kinds]
        self.names = [f"robot_{i}" for i in range(len(kinds))]
        self.entities = np.arange(first_entity, first_entity + len(kinds)).astype(np.int32)
        self.errands = errands
        self._seed = seed
        self._router = router
        places = self._spawns() if spawns is None else np.asarray(spawns, np.float64)
        if places.shape != (len(kinds), 3):
            raise InputError(f"robots: {len(kinds)} robots need as many spawns of x, y, yaw, not {places.shape}")
        self.engine: PhysicsEngine = MujocoEngine(static_scene_of(world), self.models, places)
        self._controllers = [controller_for(model) for model in self.models]
        n, memory = len(kinds), max((c.memory for c in self._controllers), default=0)
        self.mode = np.zeros(n, np.int8)
        self.status = np.zeros(n, np.int8)
        self.action_status = np.zeros(n, np.int8)
        self.reason = np.full(n, "", f"<U{REASON_LENGTH}")
        self.reason_code = np.zeros(n, np.int16)
        self._memory = np.zeros((n, memory))
        self._vector = np.zeros((n, max((max(len(model.motors), 3) for model in self.models), default=0)))
        self._velocity = np.zeros((n, 3))
        self._lying = np.zeros(n)
        self._errand = np.zeros(n, np.int64)
        self._rest = np.zeros(n)
        self._pending: list[tuple[int, int]] = []
        self._followers = [PathFollower(model) for model in self.models]
        self._bodies: Bodies | None = None

    def __len__(self) -> int:
        return len(self.models)

    def _spawns(self) -> NDArray[np.float64]:
        found: list[NDArray[np.float64]] = []
        for i in range(len(self.kinds)):
            stream = rng(self._seed, "robot spawn", i)
            for _ in range(200):
                xy = self.world.walkable.random_point(stream, clearance=_SPAWN_ROOM)
                if all(np.linalg.norm(xy - other[:2]) >= _SPAWN_APART for other in found):
                    break
            else:
                raise InputError(f"robots: no room for {len(self.kinds)} robots {_SPAWN_APART} m apart; take fewer")
            found.append(np.array([*xy, stream.uniform(-np.pi, np.pi)]))
        return np.array(found).reshape(-1, 3)

    # Commands.

    def begin(self, who: NDArray[np.bool_] | None = None) -> None:
        """Forget how the last actions went of the robots that act now; None: all of them."""
        chosen = slice(None) if who is None else who
        self.action_status[chosen] = 0
        self.reason[chosen] = ""
        self.reason_code[chosen] = 0

    def control_size(self, robot: int) -> int:
        """How many motors a robot has: wheel speeds (rad/s) or joint angles (rad)."""
        return len(self.models[robot].motors)

    def command(self, robot: int, vector: ArrayLike) -> None:
        """Have the motors follow `vector` until another command comes; it is clipped to their limits."""
        values = np.asarray(vector, np.float64)
        model = self.models[robot]
        if values.shape != (len(model.motors),) or not np.isfinite(values).all():
            raise InputError(f"control: {model.title} takes {len(model.motors)} finite numbers, not {values.tolist()}")
        self._vector[robot] = 0.0
        self._vector[robot, : len(values)] = np.clip(values, *model.motor_limits)
        self._set_mode(robot, Mode.MOTORS)

    def drive(self, robot: int, velocity: ArrayLike) -> None:
        """Follow a velocity (vx, vy, wz): metres a second in the base's frame, radians a second to the left."""
        values = np.asarray(velocity, np.float64)
        model = self.models[robot]
        if values.shape != (3,) or not np.isfinite(values).all():
            raise InputError(f"drive: 3 finite numbers (vx, vy, wz) are needed, not {values.tolist()}")
        limit = model.velocity_limit
        if limit is None:
            raise InputError(f"drive: {model.title} follows no velocities; command its motors")
        self._vector[robot, :3] = np.clip(values, -limit, limit)
        self._set_mode(robot, Mode.VELOCITY)

    def stop(self, robot: int) -> None:
        """Stand still."""
        self._set_mode(robot, Mode.IDLE)

    def go_to(self, robot: int, xy: ArrayLike) -> bool:
        """Find a way to a point and take it; False, and nothing changes, if there is none."""
        goal = np.asarray(xy, np.float64)[:2]
        path = self._way(robot, goal, np.zeros((0, 3)))
        if path is None:
            return False
        self.follow(robot, path)
        return True

    def follow(self, robot: int, path: ArrayLike) -> None:
        """Follow a polyline, ENU metres, shape ``(k, 2)``, ``k >= 2``."""
        points = np.ascontiguousarray(path, np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
            raise InputError(f"follow: a path is two or more finite points x, y, not {points.shape}")
        self._followers[robot].begin(points)
        self._set_mode(robot, Mode.ROUTE)

    def _set_mode(self, robot: int, mode: Mode) -> None:
        self.mode[robot] = mode
        if self.status[robot] != RobotStatus.FALLEN:
            self.status[robot] = RobotStatus.IDLE if mode == Mode.IDLE else RobotStatus.MOVING
        if mode != Mode.ROUTE:
            self._followers[robot].end()

    # Ways.

    @property
    def router(self) -> Router:
        """Finds ways on the world's walkable map."""
        if self._router is None:
            self._router = Router(self.world.walkable)
        return self._router

    @cached_property
    def _narrow(self) -> list[NDArray[np.bool_]]:
        """Cells too narrow for each robot."""
        clearance = self.world.walkable.clearance
        return [clearance < follower.room for follower in self._followers]

    def _way(self, robot: int, goal: NDArray[np.float64], closed: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return a way that keeps clear of discs (x, y, radius), or None."""
        walkable = self.world.walkable
        blocked = self._narrow[robot]
        if len(closed):
            blocked = blocked.copy()
            for x, y, radius in closed:
                (i0, j0), (i1, j1) = walkable.cell_of([[x - radius, y - radius], [x + radius, y + radius]])
                yy, xx = np.mgrid[j0 : j1 + 1, i0 : i1 + 1]
                centres = walkable.centre_of(np.stack([xx, yy], axis=-1))
                blocked[j0 : j1 + 1, i0 : i1 + 1] |= np.hypot(centres[..., 0] - x, centres[..., 1] - y) < radius
        here = self.engine.base(robot).position[:2]
        path = self.router.path(here, goal, blocked=blocked)
        if path is None:
            return None
        # The search may begin in a cell beside the robot's own.
        return path if len(path) > 1 and np.allclose(path[0], here) else np.vstack([here, path])

    def _next_errand(self, robot: int) -> None:
        """Send a robot to another place, 40 to 250 m away where there is one."""
        self._errand[robot] += 1
        stream = rng(self._seed, "errand", robot, int(self._errand[robot]))
        here = self.engine.base(robot).position[:2]
        goals = np.array([place.position[:2] for place in self.world.places]).reshape(-1, 2)
        away = np.hypot(*(goals - here).T)
        order = stream.permutation(np.flatnonzero((away > 40.0) & (away < 250.0)))
        for index in order[:5]:
            if self.go_to(robot, goals[index]):
                return

    # Time.

    def control_period(self, robot: int) -> float:
        """How often a robot's model wants to be controlled, seconds."""
        return PERIOD

    def advance(self, dt: float, obstacles: Bodies, *, since: float = 0.0, substep: float | None = None) -> None:
        """Let `dt` seconds (a multiple of 0.02) of physics pass.

        `obstacles` are everybody else's bodies, where they are at the end of the sub-step of `substep` seconds (None:
        `dt`), of which `since` have passed. Robots decide where to go at its beginning.
        """
        frames = round(dt / FRAME)
        ticks = round(PERIOD / FRAME)
        if frames % ticks or abs(frames * FRAME - dt) > 1e-9:
            raise InputError(f"robots: {dt} s is no multiple of {PERIOD} s")
        if not len(self):
            return
        whole = dt if substep is None else substep
        if since == 0.0:
            self.engine.set_dynamic_obstacles(obstacles, whole)
            everyone = Bodies.joined([obstacles, self.bodies()])
            for robot in range(len(self)):
                near = neighbours_of(everyone, int(self.entities[robot]), self._position(robot), SIGHT + 4)
                self._decide(robot, whole, near)
        # Limbs thrown about, by a controller of somebody's own or to get up, need smaller steps than wheels and gaits.
        extra_substeps = bool(np.any(self.status == _FALLEN_STATUS) or np.any(self.mode == _MOTORS))
        for _ in range(frames // ticks):
            for robot in range(len(self)):
                self._drive(robot)
            self.engine.step(ticks, extra_substeps=extra_substeps)
        self._bodies = None
        if since + dt > whole - 1e-9:
            for robot in range(len(self)):
                self._watch_falls(robot, whole)

    def _position(self, robot: int) -> NDArray[np.float64]:
        return self.engine.base(robot).position

    def _decide(self, robot: int, dt: float, others: NDArray[np.void]) -> None:
        """Set the velocity to follow until the next decision."""
        mode, velocity = self.mode[robot], self._velocity[robot]
        velocity[:] = 0.0
        if self.status[robot] == _FALLEN_STATUS:
            return
        base = self.engine.base(robot)
        follower = self._followers[robot]
        if mode == _VELOCITY:
            velocity[:] = self._vector[robot, :3]
            if velocity[0] > 0.0 and follower.free(base, others, float(velocity[0]))[0] < GAP:
                velocity[0] = 0.0
                self.status[robot] = RobotStatus.WAITING
            else:
                self.status[robot] = RobotStatus.MOVING
        elif mode == _ROUTE:
            velocity[:] = follower.steer(base, others, dt)
            self.status[robot] = follower.status
            if follower.wants_detour:
                path = self._way(robot, follower.path[-1], follower.closed(base, others))
                follower.detoured(path)
            if follower.status in (RobotStatus.ARRIVED, RobotStatus.BLOCKED):
                self._note(robot, "arrived" if follower.status == RobotStatus.ARRIVED else "blocked")
                self.mode[robot] = Mode.IDLE
                follower.end()
                self._rest[robot] = 0.0
        elif mode == _IDLE and self.errands:
            self._rest[robot] += dt
            if self._rest[robot] > 5.0 or self._errand[robot] == 0:
                self._rest[robot] = 0.0
                self._next_errand(robot)

    def _drive(self, robot: int) -> None:
        """Tell the motors what to follow for the next `PERIOD` seconds."""
        model, controller = self.models[robot], self._controllers[robot]
        memory = self._memory[robot, : controller.memory]
        fallen = self.status[robot] == _FALLEN_STATUS
        if not fallen and self.mode[robot] != _MOTORS:
            base = self.engine.base(robot)
            angles, speeds = self.engine.joints(robot)
            targets = controller.targets(base, angles, speeds, self._velocity[robot], memory)
            self.engine.command(robot, targets, controller.gains(memory))
            return
        memory[:] = 0.0
        if not fallen:
            settings = model.controller
            gains = settings.policy_gains if isinstance(settings, FourLegs) and settings.policy else None
            self.engine.command(robot, self._vector[robot, : len(model.motors)], gains)
        elif not isinstance(model.controller, FourLegs):
            self._lying[robot] += PERIOD
            self.engine.command(robot, model.stance)
        else:
            legs = getting_up(float(self._lying[robot]), self.engine.base(robot), model.rest)
            self._lying[robot] += PERIOD
            targets = model.rest if legs is None else np.clip(legs, *model.motor_limits)
            self.engine.command(robot, targets, model.controller.gait_gains)

    def _watch_falls(self, robot: int, dt: float) -> None:
        upright = float(self.engine.base(robot).rotation[2, 2])
        fallen = self.status[robot] == _FALLEN_STATUS
        if not fallen:
            self._lying[robot] = self._lying[robot] + dt if upright < _FALLEN else 0.0
            if self._lying[robot] > _FALL_TIME:
                self.status[robot] = RobotStatus.FALLEN
                self._lying[robot] = 0.0
                self._note(robot, "fallen")
            return
        model = self.models[robot]
        if upright > 0.95 and (not isinstance(model.controller, FourLegs) or self._stands(robot)):
            self.status[robot] = RobotStatus.MOVING if self.mode[robot] != Mode.IDLE else RobotStatus.IDLE
            self._lying[robot] = 0.0
            self._note(robot, "recovered")
        elif self._lying[robot] - dt <= _GIVE_UP < self._lying[robot]:
            self._note(robot, "lost")

    def _stands(self, robot: int) -> bool:
        """Return whether it is the end of an attempt to get up that brought a robot onto its feet."""
        model, base = self.models[robot], self.engine.base(robot)
        high = base.position[2] - float(self.world.height(base.position)) > 0.6 * model.stand
        bent = float(np.abs(self.engine.joints(robot)[0] - model.rest).max())
        calm = np.abs(base.angular_velocity_body).max() < 0.5
        return bool(high and calm and bent < 0.4 and getting_up(float(self._lying[robot]), base, model.rest) is None)

    def _note(self, robot: int, kind: str) -> None:
        self._pending.append((robot, _KINDS.index(kind)))

    def events(self) -> list[RobotEvent]:
        """Return what happened since this was last asked."""
        found = [RobotEvent(robot, _KINDS[kind], self._position(robot)) for robot, kind in self._pending]
        self._pending.clear()
        return found

    # What can be seen.

    def bodies(self) -> Bodies:
        """Oriented rectangles of the robots' outlines."""
        if self._bodies is None:
            bases = [self.engine.base(i) for i in range(len(self))]
            position = np.array([base.position for base in bases]).reshape(-1, 3)
            position[:, 2] = self.world.height(position)
            self._bodies = Bodies(
                self.entities,
                np.full(len(self), ROBOT, np.int8),
                position,
                np.array([base.yaw for base in bases]),
                np.array([model.half_length for model in self.models]),
                np.array([model.half_width for model in self.models]),
                np.array([model.height for model in self.models]),
                np.array([base.velocity[:2] for base in bases]).reshape(-1, 2),
            )
        return self._bodies

    def prototypes(self) -> dict[str, list[Surface]]:
        """Shapes of all links, by ``robot/<model>/<link>``."""
        return {
            f"robot/{model.name}/{link}": list(surfaces)
            for model in {model.name: model for model in self.models}.values()
            for link, surfaces in model.shapes.items()
        }

    def draw(self) -> Drawn:
        """Poses of all links."""
        names = list(self.prototypes())
        index: list[int] = []
        entity: list[int] = []
        transforms = [np.zeros((0, 4, 4))]
        for i, model in enumerate(self.models):
            index += [names.index(f"robot/{model.name}/{link}") for link in model.shapes]
            entity += [int(self.entities[i])] * len(model.shapes)
            transforms.append(self.engine.links(i))
        return Drawn(
            names,
            np.array(index, np.int32),
            np.concatenate(transforms).astype(np.float32),
            np.array(entity, np.int32),
        )

    def camera(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Position of a robot's camera, the direction it looks in, and its upward direction, shape ``(3,)`` each."""
        base = self.engine.base(robot)
        eye = base.position + apply_matrix(self.models[robot].sensors.camera or (0.0, 0.0, 0.0), base.rotation)
        return eye, base.rotation[:, 0].copy(), base.rotation[:, 2].copy()

    def camera_heights(self) -> NDArray[np.float64]:
        """Height of each robot's camera above the ground below it, metres."""
        eyes = np.array([self.camera(i)[0] for i in range(len(self))]).reshape(-1, 3)
        return np.asarray(eyes[:, 2] - self.world.height(eyes))

    def deck(self, entity: int) -> DeckPose | None:
        """Return the deck of the robot with this entity; None if it has none."""
        for i in np.flatnonzero(self.entities == entity):
            deck, base = self.models[i].deck, self.engine.base(int(i))
            if deck is not None:
                return DeckPose(base.position, base.rotation, np.array(deck.centre), deck.length, deck.width)
        return None

    def observation(self, robot: int) -> dict[str, NDArray[np.float64]]:
        """Return what a robot feels of itself.

        Returns
        -------
        dict
            ``joint_position`` and ``joint_velocity`` (rad, rad/s, order of the control vector); ``base_pose``
            (x, y, z, quaternion w, x, y, z); ``base_velocity`` (ENU, m/s); ``imu`` (angular velocity
            in the base's frame, rad/s, and the direction of gravity there).
        """
        base: Base = self.engine.base(robot)
        angles, speeds = self.engine.joints(robot)
        return {
            "joint_position": np.array(angles),
            "joint_velocity": np.array(speeds),
            "base_pose": np.concatenate([base.position, base.quaternion]),
            "base_velocity": base.velocity.copy(),
            "imu": np.concatenate([base.angular_velocity_body, -base.rotation[2]]),
        }

    # State.

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future."""
        paths = [follower.path for follower in self._followers]
        return {
            **{f"engine_{key}": value for key, value in self.engine.arrays().items()},
            "mode": self.mode.copy(),
            "status": self.status.copy(),
            "memory": self._memory.copy(),
            "vector": self._vector.copy(),
            "lying": self._lying.copy(),
            "errand": self._errand.copy(),
            "rest": self._rest.copy(),
            "pending": np.array(self._pending, np.int64).reshape(-1, 2),
            "followers": np.array([follower.numbers() for follower in self._followers]).reshape(len(self), -1),
            "path_ends": np.cumsum([len(path) for path in paths], dtype=np.int64),
            "paths": np.concatenate([np.zeros((0, 2)), *paths]),
            "action_status": self.action_status.copy(),
            "reason": self.reason.copy(),
            "reason_code": self.reason_code.copy(),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        if arrays["mode"].shape != self.mode.shape or arrays["memory"].shape != self._memory.shape:
            raise SchemaError("robots: the saved state belongs to other robots; start with the same ones")
        self.engine.restore({key[7:]: value for key, value in arrays.items() if key.startswith("engine_")})
        self.mode[:] = arrays["mode"]
        self.status[:] = arrays["status"]
        self._memory[:] = arrays["memory"]
        self._vector[:] = arrays["vector"]
        self._lying[:] = arrays["lying"]
        self._errand[:] = arrays["errand"]
        self._rest[:] = arrays["rest"]
        self._pending = [(int(a), int(b)) for a, b in arrays["pending"]]
        starts = np.concatenate([[0], arrays["path_ends"]]).astype(int)
        for i, follower in enumerate(self._followers):
            follower.restore(arrays["paths"][starts[i] : starts[i + 1]], arrays["followers"][i])
        self.action_status[:] = arrays["action_status"]
        self.reason[:] = arrays["reason"]
        self.reason_code[:] = arrays["reason_code"]
        self._bodies = None
