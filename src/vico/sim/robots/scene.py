"""What is fixed about the robots of a run: built once a world and kinds of robots, shared by all its simulations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import TICK, RobotModel, robot_model
from vico.assets.robots.ground import narrow_ground
from vico.sim.bodies import ROBOT
from vico.sim.indoor import Indoor
from vico.sim.physics import DEFAULT_ENGINE, PhysicsEngine, PhysicsScene, make_scene
from vico.sim.physics.city_chunks import surroundings_of
from vico.sim.physics.records import Capacity, StaticScene
from vico.sim.robots.airspace import Airspace
from vico.sim.robots.controller import MotorController
from vico.sim.robots.controllers import controller_for
from vico.sim.robots.rooms import RobotRooms
from vico.world.heights import HeightField
from vico.world.routing import Router
from vico.world.world import World

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
        self.groups = _groups(self.models)
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
            self._narrow[key] = narrow_ground(self.world, model)
        return self._narrow[key]


def _groups(models: Sequence[RobotModel]) -> tuple[RobotGroup, ...]:
    members: dict[str, list[int]] = {}
    for robot, model in enumerate(models):
        members.setdefault(model.name, []).append(robot)
    return tuple(
        RobotGroup(model, controller_for(model), np.array(robots, np.int64), round(model.control_period / TICK))
        for robots in members.values()
        for model in (models[robots[0]],)
    )
