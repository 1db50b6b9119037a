"""Robots in rooms: each of them in a small engine of its own, beside the engine of everything outdoors.

Rooms lie below ground, where the city's physics has its terrain. A robot that goes indoors is taken out of that, and
stands anew on a level floor in a scene of its own, around whose origin walls, furniture, people and other robots of the
room are kinematic bodies. Nothing outdoors is any slower for it, and any engine can do it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.bodies.arrays import Bodies
from vico.sim.physics.engine import Actuate, PhysicsEngine, PhysicsScene
from vico.sim.physics.records import COARSE, Base, Contacts, Imu, Motion, ObjectMotion, Party, RigidObject

Array = NDArray[np.float64]


@dataclass(frozen=True)
class IndoorRobot:
    """A robot in a room: its engine, in which it is the only robot, and where that engine's origin is, ENU metres."""

    engine: PhysicsEngine
    origin: Array


class CompositeEngine:
    """The engine of everything outdoors, and those of the robots indoors, as one; see `PhysicsEngine`.

    Positions of robots are the world's, wherever they are. What is said of people, things and friction is outdoors'.

    Parameters
    ----------
    outdoors
        Engine of all robots.
    """

    def __init__(self, outdoors: PhysicsEngine) -> None:
        self.outdoors = outdoors
        self.inside: dict[int, IndoorRobot] = {}

    def house(self, robot: int, scene: PhysicsScene, origin: Array, place: Array) -> None:
        """Stand a robot in a room.

        Parameters
        ----------
        scene
            A level floor and this kind of robot alone.
        origin
            Where the scene's origin is, ENU metres.
        place
            x, y (ENU metres) and yaw.
        """
        self.outdoors.park(robot)
        engine = scene.engine(np.array([[place[0] - origin[0], place[1] - origin[1], place[2]]]))
        self.inside[robot] = IndoorRobot(engine, np.array(origin, np.float64))
        # In their order, whoever came first: that of a run that was saved and restored.
        self.inside = dict(sorted(self.inside.items()))

    def release(self, robot: int, place: Array) -> None:
        """Stand a robot outdoors: x, y (ENU metres) and yaw."""
        del self.inside[robot]
        self.outdoors.stand(robot, place)

    def surround(self, robot: int, bodies: Bodies, dt: float) -> None:
        """Say what is in the room of a robot; see `PhysicsEngine.set_dynamic_obstacles`."""
        housed = self.inside[robot]
        housed.engine.set_dynamic_obstacles(replace(bodies, position=bodies.position - housed.origin), dt)

    def _engine(self, robot: int) -> tuple[PhysicsEngine, int]:
        housed = self.inside.get(robot)
        return (self.outdoors, robot) if housed is None else (housed.engine, 0)

    # Robots.

    def link_names(self, robot: int) -> tuple[str, ...]:
        """Names of a robot's links, base first."""
        return self.outdoors.link_names(robot)

    def base(self, robot: int) -> Base:
        """Where a robot's base is and how it moves."""
        housed = self.inside.get(robot)
        if housed is None:
            return self.outdoors.base(robot)
        base = housed.engine.base(0)
        return replace(base, position=base.position + housed.origin)

    def joints(self, robot: int) -> tuple[Array, Array]:
        """Positions and speeds of the joints."""
        engine, index = self._engine(robot)
        return engine.joints(index)

    def motion(self, robots: NDArray[np.int64]) -> Motion:
        """Motion of several robots of one kind."""
        if self.inside.keys().isdisjoint(robots.tolist()):
            return self.outdoors.motion(robots)
        rows = [self._motion_of(robot) for robot in robots.tolist()]
        return Motion(*(np.concatenate([getattr(row, one.name) for row in rows]) for one in fields(Motion)))

    def _motion_of(self, robot: int) -> Motion:
        engine, index = self._engine(robot)
        motion = engine.motion(np.array([index]))
        return motion if index == robot else replace(motion, position=motion.position + self.inside[robot].origin)

    def motor_forces(self, robot: int) -> Array:
        """Torques of the motors in the last step."""
        engine, index = self._engine(robot)
        return engine.motor_forces(index)

    def imu(self, robot: int) -> Imu:
        """Angular velocity, and acceleration without gravity's, in the base's frame."""
        engine, index = self._engine(robot)
        return engine.imu(index)

    def links(self, robot: int) -> Array:
        """Poses of the links, shape ``(n, 4, 4)``."""
        housed = self.inside.get(robot)
        if housed is None:
            return self.outdoors.links(robot)
        poses = np.array(housed.engine.links(0))
        poses[:, :3, 3] += housed.origin
        return poses

    def command(self, robot: int, targets: Array, gains: tuple[float, float] | None = None) -> None:
        """Set what the servos follow, and how stiffly."""
        engine, index = self._engine(robot)
        engine.command(index, targets, gains)

    def command_all(
        self, robots: NDArray[np.int64], targets: Array, gains: Sequence[tuple[float, float] | None]
    ) -> None:
        """Set what the servos of several robots of one kind follow."""
        if self.inside.keys().isdisjoint(robots.tolist()):
            self.outdoors.command_all(robots, targets, gains)
            return
        for robot, values, wanted in zip(robots.tolist(), targets, gains, strict=True):
            self.command(robot, values, wanted)

    def thrust(self, robot: int, sites: Sequence[str], forces: Array, torques: Array | None = None) -> None:
        """Push a robot at named sites from now on."""
        engine, index = self._engine(robot)
        engine.thrust(index, sites, forces, torques)

    def thrust_all(self, robots: NDArray[np.int64], site: str, wrenches: Array) -> None:
        """Push several robots of one kind at the site of one name from now on."""
        for robot, wrench in zip(robots.tolist(), wrenches, strict=True):
            engine, index = self._engine(robot)
            engine.thrust_all(np.array([index]), site, wrench[None])

    def park(self, robot: int) -> None:
        """Take a robot out of the scene outdoors."""
        self.outdoors.park(robot)

    def stand(self, robot: int, place: Array) -> None:
        """Stand a robot outdoors."""
        self.outdoors.stand(robot, place)

    # Everybody else.

    def set_dynamic_obstacles(self, obstacles: Bodies, dt: float) -> None:
        """Take people and vehicles outdoors; rooms are told by `surround`."""
        self.outdoors.set_dynamic_obstacles(obstacles, dt)

    @property
    def left_out(self) -> int:
        """How many bodies near robots found no place."""
        return self.outdoors.left_out + sum(housed.engine.left_out for housed in self.inside.values())

    def set_friction(self, share: float) -> None:
        """Have the ground outdoors grip with a share of its friction; floors are dry."""
        self.outdoors.set_friction(share)

    # Free rigid objects.

    def place_object(self, slot: int, thing: RigidObject) -> None:
        """Put an object into a slot."""
        self.outdoors.place_object(slot, thing)

    def remove_object(self, slot: int) -> None:
        """Take an object out of the scene."""
        self.outdoors.remove_object(slot)

    def objects(self) -> ObjectMotion:
        """Where all objects are."""
        return self.outdoors.objects()

    def clearance_below(self, points: Array) -> Array:
        """Metres from each point outdoors straight down to what is there."""
        return self.outdoors.clearance_below(points)

    # Time.

    def contacts(self) -> Contacts:
        """Who touched whom in the last step, outdoors and in rooms."""
        found = [self.outdoors.contacts()]
        for robot, housed in self.inside.items():
            one = housed.engine.contacts()
            owner = np.where(one.party == Party.ROBOT, robot, one.owner).astype(np.int32)
            found.append(replace(one, owner=owner, position=one.position + housed.origin))
        return Contacts(*(np.concatenate([getattr(one, f.name) for one in found]) for f in fields(Contacts)))

    def step(
        self,
        frames: int = 1,
        *,
        frame: float = COARSE,
        holding: bool | None = None,
        actuate: Actuate | None = None,
    ) -> None:
        """Move on by some frames; only outdoors anybody is actuated within them."""
        self.outdoors.step(frames, frame=frame, holding=holding, actuate=actuate)
        for housed in self.inside.values():
            housed.engine.step(frames, frame=frame, holding=holding)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that decides the future, outdoors' and each room's."""
        found = self.outdoors.arrays()
        for robot, housed in self.inside.items():
            found |= {f"room_{robot}_{name}": array for name, array in housed.engine.arrays().items()}
        return found

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held, with the same robots indoors as then."""
        self.outdoors.restore({name: array for name, array in arrays.items() if not name.startswith("room_")})
        for robot, housed in self.inside.items():
            start = f"room_{robot}_"
            housed.engine.restore({k[len(start) :]: array for k, array in arrays.items() if k.startswith(start)})
