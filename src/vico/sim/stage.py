"""What the rules look at: the world's fixed facts, looked up quickly, beside everything that changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.sim.avatars import Avatars
from vico.sim.bodies import Bodies, HasBodies, Subsystem
from vico.sim.events import Events
from vico.sim.indoor import DOOR_REACH, INNER_DOOR_REACH, Indoor, near_door
from vico.sim.state import Goods, People, Vehicle
from vico.sim.transit import TransitSystem
from vico.world.folder import World
from vico.world.model import Entrance, Place


class TrafficSystem(Subsystem, Protocol):
    """What the rules and the renderer ask of traffic, beside what the loop does."""

    @property
    def walkers(self) -> Bodies:
        """The pedestrians alone."""

    @property
    def gait(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Speed (m/s) and distance walked so far (m) of each pedestrian."""


class RobotNote(Protocol):
    """Something that happened to a robot."""

    @property
    def robot(self) -> int:
        """Its index."""

    @property
    def kind(self) -> str:
        """arrived, blocked, fallen, ..."""

    @property
    def position(self) -> NDArray[np.float64]:
        """Where, ENU metres."""


class RobotSystem(Subsystem, Protocol):
    """What the rules ask of robots, beside what the loop does. Robots are addressed by their index.

    Attributes
    ----------
    names
        Agents' names, ``robot_0`` and on.
    reasons
        Why each robot's last action was refused; "" if it was not.
    """

    names: list[str]
    reasons: list[str]

    def control_size(self, robot: int) -> int:
        """How many numbers the robot's control vector has."""

    def command(self, robot: int, vector: NDArray[np.float64]) -> None:
        """Drive the robot by a control vector until the next one comes."""

    def camera_heights(self) -> NDArray[np.float64]:
        """Height of each robot's camera above the ground it stands on, metres."""

    def events(self) -> Sequence[RobotNote]:
        """What happened to robots since this was last asked."""

    def deck(self, entity: int) -> NDArray[np.float64] | None:
        """Middle of the deck of the robot with this entity, ENU metres; None if it has none."""


@dataclass
class Stage:
    """A world with everyone in it.

    Attributes
    ----------
    second
        Time of day, seconds.
    traffic, transit, robots
        None where a run has none.
    """

    world: World
    indoor: Indoor
    people: People
    goods: Goods
    avatars: Avatars
    events: Events
    traffic: TrafficSystem | None = None
    transit: TransitSystem | None = None
    robots: RobotSystem | None = None
    second: float = 0.0
    place_index: dict[str, int] = field(default_factory=dict)
    entrances: dict[str, Entrance] = field(default_factory=dict)
    doors: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))

    def __post_init__(self) -> None:
        self.place_index = {place.id: i for i, place in enumerate(self.world.places)}
        self.entrances = {entrance.id: entrance for entrance in self.world.entrances}
        far = (1e9, 1e9)
        doors = [self.entrances[p.entrance].position[:2] if p.entrance else far for p in self.world.places]
        self.doors = np.array(doors, np.float64).reshape(-1, 2)

    @property
    def names(self) -> list[str]:
        """Every agent: people first, then robots."""
        return self.people.names + (list(self.robots.names) if self.robots is not None else [])

    def place(self, place_id: str) -> Place | None:
        """A place by id."""
        index = self.place_index.get(place_id)
        return None if index is None else self.world.places[index]

    def obstacles(self) -> Bodies:
        """Every body outdoors."""
        return Bodies.joined([owner.bodies() for owner in self.owners()])

    def owners(self) -> list[HasBodies]:
        """Who has bodies: traffic, transit, avatars, robots; those of them that there are."""
        return [o for o in (self.traffic, self.transit, self.avatars, self.robots) if o is not None]

    def position_of(self, name: str) -> NDArray[np.float64] | None:
        """Where an agent is, shape ``(3,)``."""
        if name in self.people.names:
            return self.people.position[self.people.names.index(name)].copy()
        if self.robots is not None and name in self.robots.names:
            return np.asarray(self.robots.bodies().position[list(self.robots.names).index(name)])
        return None

    def same_space(self, i: int, j: int) -> bool:
        """Whether two people are in the same room, the same bus, or both in the street."""
        p = self.people
        in_bus = Vehicle.BUS in (p.vehicle[i], p.vehicle[j])
        if in_bus:
            return bool(p.vehicle[i] == p.vehicle[j] and p.vehicle_entity[i] == p.vehicle_entity[j])
        return bool(p.room[i] == p.room[j])

    def hearers(self, i: int, reach: float) -> list[str]:
        """Agents within `reach` metres of person `i` in the same space, in the order of names."""
        p = self.people
        away = np.linalg.norm(p.position - p.position[i], axis=1)
        heard = [p.names[j] for j in np.flatnonzero(away <= reach) if j != i and self.same_space(i, int(j))]
        if self.robots is not None and p.room[i] < 0 and p.vehicle[i] != Vehicle.BUS:
            positions = self.robots.bodies().position
            near = np.linalg.norm(positions - p.position[i], axis=1) <= reach
            heard += [name for name, close in zip(self.robots.names, near, strict=True) if close]
        return heard

    def accessible_places(self, i: int) -> list[str]:
        """What person `i` could enter from where it is: places outdoors, rooms from a room."""
        p = self.people
        if p.vehicle[i] != Vehicle.NONE:
            return []
        if p.room[i] >= 0:
            room = int(p.room[i])
            doors = self.indoor.doors[room]
            near = [d.to for d in doors if d.to >= 0 and near_door(p.position[i], d, INNER_DOOR_REACH)]
            return [self.indoor.rooms[to].id for to in near]
        away = np.hypot(*(self.doors - p.position[i, :2]).T)
        return [self.world.places[k].id for k in np.flatnonzero(away <= DOOR_REACH) if self.world.places[k].rooms]

    def doors_of(self, i: int) -> list[dict[str, Any]]:
        """Ways out of the room that person `i` is in: where each leads, and where it is."""
        room = int(self.people.room[i])
        if room < 0:
            return []
        rooms = self.indoor.rooms
        return [
            {"to": "outside" if d.to < 0 else rooms[d.to].id, "position": list(d.position)}
            for d in self.indoor.doors[room]
        ]

    def people_in(self, room: int, *, without: int = -1) -> NDArray[np.float64]:
        """Where people stand in a room, shape ``(k, 3)``."""
        inside = self.people.room == room
        if without >= 0:
            inside[without] = False
        return self.people.position[inside]

    def obstacles_to(self, i: int) -> Bodies:
        """Every body outdoors but person `i`'s."""
        everyone = self.obstacles()
        return everyone.where(everyone.entity != self.people.entity[i])

    def all_arrays(self) -> Mapping[str, NDArray[Any]]:
        """Every array that decides the future, under a name each, in a fixed order."""
        found: dict[str, NDArray[Any]] = {"second": np.array([self.second])}
        parts: dict[str, Any] = {
            "people": self.people,
            "goods": self.goods,
            "events": self.events,
            "traffic": self.traffic,
            "transit": self.transit,
            "robots": self.robots,
        }
        for name, part in parts.items():
            if part is not None:
                found |= {f"{name}.{key}": value for key, value in part.arrays().items()}
        return found
