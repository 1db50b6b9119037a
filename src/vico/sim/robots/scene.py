"""Fixed facts of the robots of a run: models, controllers by name, groups, outlines, and start poses.

A `RobotScene` is built once a world and kinds of robots, and all its simulations share it. Others meet an upright box
around each robot.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import TICK, RobotModel, robot_model
from vico.assets.robots.traversability import untraversable_cells
from vico.errors import InputError
from vico.seeds import rng
from vico.sim.bodies.arrays import ROBOT, Bodies
from vico.sim.bodies.rooms import Indoor
from vico.sim.physics import DEFAULT_ENGINE, PhysicsEngine, PhysicsScene, make_scene
from vico.sim.physics.records import Capacity, StaticScene
from vico.sim.physics.surroundings import surroundings_of
from vico.sim.robots.biped import TwoLegWalker
from vico.sim.robots.controller import DirectMotors, MotorController, SkidSteer
from vico.sim.robots.manipulator import ArmOnWheels
from vico.sim.robots.path_planning import Airspace, RobotRooms
from vico.sim.robots.quadrotor import FourRotors
from vico.sim.robots.quadruped import Legs
from vico.world.heights import HeightField
from vico.world.routing import Router
from vico.world.world import World

#: Makers of controllers by name.
CONTROLLERS: dict[str, Callable[[RobotModel], MotorController]] = {
    "motors": DirectMotors,
    "skid_steer": SkidSteer,
    "four_legs": Legs,
    "mobile_manipulator": ArmOnWheels,
    "quadrotor": FourRotors,
    "two_legs": TwoLegWalker,
}


def controller_for(model: RobotModel) -> MotorController:
    """Return what drives a kind of robot.

    Raises
    ------
    InputError
        If there is no controller of the name the model gives.
    """
    name = model.controller.name
    if name not in CONTROLLERS:
        known = ", ".join(CONTROLLERS)
        raise InputError(f"robot {model.name!r}: no controller is called {name!r}; choose among {known}")
    return CONTROLLERS[name](model)


#: Half the side of floors in physics, metres, and who can be near a robot in a room: people, and walls and furniture.
_FLOOR, _IN_A_ROOM = 50.0, Capacity(people=12, vehicles=48, objects=0)


@dataclass(frozen=True)
class RobotGroup:
    """Robots of one kind: their controller is asked about all of them at once.

    Attributes
    ----------
    model
        Of the first; they differ in their own action space at most.
    controller
        What turns velocities into motor targets.
    robots
        Their indices, int64, shape ``(k,)``.
    period
        Ticks of 0.01 s between two commands of their motors.
    """

    model: RobotModel
    controller: MotorController
    robots: NDArray[np.int64]
    period: int


@dataclass(frozen=True)
class Outlines:
    """Upright boxes around robots; row = robot.

    Attributes
    ----------
    kind
        What kind of bodies they are, int8.
    half_length, half_width, height
        Of the boxes, metres.
    stand
        Height of a standing robot's base above the ground, metres.
    flies
        Whether they fly: they are where they are, and not on the ground below.
    """

    kind: NDArray[np.int8]
    half_length: NDArray[np.float64]
    half_width: NDArray[np.float64]
    height: NDArray[np.float64]
    stand: NDArray[np.float64]
    flies: NDArray[np.bool_]


class RobotScene:
    """World, models and controllers of a run's robots. Nothing in it changes.

    Parameters
    ----------
    world
        Where they are.
    kinds
        Names of their models, in order, as `vico.assets.robots.robot_model` takes them.
    packs
        Use installed packages' models; False: our own alone.
    router
        Finds ways; made from the world's walkable map when it is first needed if it is not given.
    physics
        Name of the physics engine.
    indoor
        The world's rooms as arrays; made when they are first needed if they are not given.

    Attributes
    ----------
    models
        One a robot.
    groups
        The robots by kind.

    Raises
    ------
    InputError
        If a model is not known.
    """

    def __init__(
        self,
        world: World,
        kinds: Sequence[str],
        *,
        packs: bool = True,
        router: Router | None = None,
        physics: str = DEFAULT_ENGINE,
        indoor: Indoor | None = None,
    ) -> None:
        self.world = world
        self.kinds = tuple(kinds)
        self.models = tuple(robot_model(kind, packs=packs) for kind in kinds)
        members: dict[str, list[int]] = {}
        for robot, model in enumerate(self.models):
            members.setdefault(model.name, []).append(robot)
        self.groups = tuple(
            RobotGroup(model, controller_for(model), np.array(robots, np.int64), round(model.control_period / TICK))
            for robots in members.values()
            for model in (self.models[robots[0]],)
        )
        self._router = router
        self._engine, self._indoor = physics, indoor
        self._room_physics: dict[str, PhysicsScene] = {}
        self._narrow: dict[tuple[float, float | None], NDArray[np.bool_]] = {}

    def __len__(self) -> int:
        return len(self.models)

    def engine(self, places: NDArray[np.float64]) -> PhysicsEngine:
        """Return physics in which the robots stand at `places`: x, y, yaw, shape ``(n, 3)``."""
        return self.physics.engine(places)

    @cached_property
    def outlines(self) -> Outlines:
        """The robots' outlines; not to be written to."""
        sizes = [(m.half_length, m.half_width, m.height, m.stand) for m in self.models]
        flies = np.array([model.rotors is not None for model in self.models], np.bool_)
        columns = np.array(sizes, np.float64).reshape(-1, 4).T.copy()
        kind = np.full(len(self), ROBOT, np.int8)
        return Outlines(kind, columns[0], columns[1], columns[2], columns[3], flies)

    @cached_property
    def physics(self) -> PhysicsScene:
        """Ground, solids and robots as physics has them, compiled when they are first needed."""
        flying = any(model.rotors is not None for model in self.models)
        return make_scene(self._engine, surroundings_of(self.world, flying=flying), self.models)

    @cached_property
    def rooms(self) -> RobotRooms:
        """Rooms, and ways in them, made when they are first needed."""
        world = self.world
        indoor = self._indoor or Indoor.from_world(world.rooms, world.places, world.objects)
        return RobotRooms(world, indoor)

    def room_physics(self, robot: int) -> PhysicsScene:
        """Return a level floor at height 0 and one robot of a kind, made when such a robot first goes indoors."""
        model = self.models[robot]
        if model.name not in self._room_physics:
            floor = StaticScene(HeightField.flat(_FLOOR))
            self._room_physics[model.name] = make_scene(self._engine, floor, (model,), _IN_A_ROOM)
        return self._room_physics[model.name]

    @cached_property
    def airspace(self) -> Airspace:
        """Heights of everything, and ways over it, made when they are first needed."""
        return Airspace(self.world)

    @property
    def router(self) -> Router:
        """Finds ways on the world's walkable map."""
        if self._router is None:
            self._router = Router(self.world.walkable)
        return self._router

    @cached_property
    def goals(self) -> NDArray[np.float64]:
        """Where the world's places are, ENU metres, shape ``(places, 2)``."""
        return np.array([place.position[:2] for place in self.world.places]).reshape(-1, 2)

    def narrow(self, robot: int) -> NDArray[np.bool_]:
        """Return the cells of the walkable map that a robot's ways keep off; not to be written to."""
        model = self.models[robot]
        key = model.half_width, model.kerb
        if key not in self._narrow:
            self._narrow[key] = untraversable_cells(self.world, model)
        return self._narrow[key]


#: Metres a robot has to be above where it stands on the ground to count as being in the air.
_AIRBORNE = 0.5


def bodies_of(
    scene: RobotScene, engine: PhysicsEngine, entities: NDArray[np.int32], rooms: NDArray[np.int32]
) -> Bodies:
    """Return upright boxes around the robots: on the ground, on the floor of their rooms, or where they fly."""
    outlines = scene.outlines
    bases = [engine.base(i) for i in range(len(entities))]
    position = np.array([base.position for base in bases]).reshape(-1, 3)
    ground = scene.world.height(position)
    inside = np.flatnonzero(rooms >= 0)
    if len(inside):
        ground[inside] = scene.rooms.indoor.floor[rooms[inside]]
    bottom = position[:, 2] - outlines.stand
    in_the_air = (bottom > ground + _AIRBORNE) | scene.outlines.flies
    position[:, 2] = np.where(in_the_air, bottom, ground)
    return Bodies(
        entities,
        outlines.kind,
        position,
        np.array([base.yaw for base in bases]),
        outlines.half_length,
        outlines.half_width,
        outlines.height,
        np.array([base.velocity for base in bases]).reshape(-1, 3)[:, :2].copy(),
    )


# Metres of free ground around each, and between two.
_ROOM, _APART = 1.0, 3.0


def spawn_poses(world: World, count: int, seed: int) -> NDArray[np.float64]:
    """Return reachable places apart from each other: x, y, yaw, shape ``(count, 3)``.

    Raises
    ------
    InputError
        If there is no room for so many.
    """
    found: list[NDArray[np.float64]] = []
    for i in range(count):
        stream = rng(seed, "robot spawn", i)
        for _ in range(200):
            xy = world.walkable.random_point(stream, clearance=_ROOM)
            if all(np.linalg.norm(xy - other[:2]) >= _APART for other in found):
                break
        else:
            raise InputError(f"robots: no room for {count} robots {_APART} m apart; take fewer")
        found.append(np.array([*xy, stream.uniform(-np.pi, np.pi)]))
    return np.array(found).reshape(-1, 3)
