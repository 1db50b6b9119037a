"""The state of a simulation: everything that changes, with quick look-ups of the world's fixed facts.

`TrafficSystem` says what the rules of a simulation ask of traffic.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.rules import INNER_DOOR_REACH, ActionStatus, ReasonCode
from vico.sim.bodies.arrays import STEP_HEIGHT, TALLEST, Bodies, HasBodies, Subsystem
from vico.sim.bodies.avatars import Avatars
from vico.sim.bodies.collisions import DeckPose, HasDecks
from vico.sim.bodies.rooms import DoorLeaves, Indoor, doors_near
from vico.sim.bodies.seats import Lines, Seats, Till
from vico.sim.bodies.state_arrays import (
    FIRST_THING,
    FIRST_UMBRELLA,
    RADIUS,
    REASON_LENGTH,
    MovableObjects,
    People,
    Vehicle,
)
from vico.sim.environment import Conditions, Environment
from vico.sim.state.base import OpeningHours, SimulationBase
from vico.sim.state.event_things import EventThings
from vico.sim.state.snapshot import arrays_of
from vico.sim.state.steps import TICKS_PER_SECOND, Events
from vico.sim.traffic.drawing import PedestrianGaits
from vico.sim.traffic.gatherings import Gatherings
from vico.sim.traffic.jams import Jam, JamLog
from vico.sim.traffic.junctions import JunctionRule
from vico.sim.traffic.signals import SignalsShown
from vico.sim.transit import TransitSystem
from vico.world.lanes import LaneGraph
from vico.world.mesh import Surface
from vico.world.model import Entrance, Place
from vico.world.world import World

if TYPE_CHECKING:
    from vico.sim.robots.population import RobotPopulation


# A thing that lies so near to the middle of a seat leaves no room to sit, metres.
_ON_SEAT = 0.25
# By number: looking an enumeration's member up costs more than all the rest.
_ON_FOOT = int(Vehicle.NONE)


class HasArrays(Protocol):
    """A part of the state: hashed, saved and restored as named arrays."""

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every array by name."""

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""


class TrafficSystem(Subsystem, Protocol):
    """What the rules and the renderer ask of traffic, beside what the loop does."""

    @property
    def walkers(self) -> Bodies:
        """The pedestrians alone, then the cyclists."""

    @property
    def lanes(self) -> LaneGraph:
        """The lanes that vehicles drive on."""

    @property
    def cyclists(self) -> int:
        """How many cyclists there are."""

    @property
    def ridden(self) -> NDArray[np.float64]:
        """Metres that each cyclist has ridden."""

    def entities(self) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
        """Return entity and kind of all, those that are not in the streets now among them."""

    @property
    def gatherings(self) -> Gatherings:
        """Leads pedestrians to events."""

    @property
    def riding(self) -> NDArray[np.bool_]:
        """Which pedestrians ride in buses."""

    @property
    def passengers(self) -> Bodies:
        """The pedestrians who ride in buses, where they sit or stand."""

    @property
    def lights(self) -> NDArray[np.uint8]:
        """Which lights each vehicle among the bodies shows, bits as `vico.sim.traffic.lights` has them."""

    @property
    def gait(self) -> PedestrianGaits:
        """How each pedestrian walks, and each cyclist rides."""

    @property
    def junction_rule(self) -> JunctionRule:
        """Who may be in a junction."""

    @property
    def jams(self) -> JamLog:
        """Who was taken out of a jam."""

    @property
    def reentered(self) -> int:
        """How often cars that had left the map came back in."""

    def set_conditions(self, conditions: Conditions) -> None:
        """Have everybody drive and walk as it is outdoors now; told before every sub-step."""

    def set_shut(self, lanes: NDArray[np.bool_] | None, walkways: NDArray[np.bool_] | None) -> None:
        """Have cars keep off some lanes, and pedestrians off some walkways (masks); told before every sub-step."""

    def set_signals(self, second: int, dark: tuple[tuple[float, float, float], ...]) -> None:
        """Have signals show what they do at a second, and nothing where the power is cut; told every second."""

    def signals_shown(self) -> SignalsShown | None:
        """Return what all signals show now; None where they are not obeyed."""

    def drop_shut_plans(self) -> None:
        """Have cars plan anew that were about to drive where it is shut since."""

    def is_taken(self, lanes: NDArray[np.bool_]) -> bool:
        """Whether a car is on some lanes (a mask), or on its way there."""

    def stuck(self) -> list[Jam]:
        """Who gets nowhere now."""


@dataclass
class SimulationState:
    """The state of a simulation.

    Attributes
    ----------
    base
        What never changes: the world, in the form it is looked up in.
    people, objects
        Avatars, and the movable objects they carry.
    avatars
        Moves `people`.
    events
        What happened in the step, and what agents heard.
    environment
        Weather, ground and light outdoors.
    things
        What stands in the city because of events.
    traffic, transit, robots
        Subsystems with a state of their own; None where a run has none.
    lines
        Who stands in line at tills.
    leaves
        Doors of houses that are not closed.
    openings
        When places are open; None in a run that does not ask.
    homes
        Index of the place that each person lives in, -1 for none, int32, shape ``(n,)``. Not part of the state.
    clothes_at_start
        Weather that everybody has dressed for at the start, as `People.clothes`, shape ``(3,)``. Not part of the state.
    entities
        Kind and name of every body of the run by entity number, and the agent's name of those that have one.
    shapes
        Shapes of movable objects, by prototype.
    tick
        Hundredths of a second since midnight of the first day.
    on_substep
        Called after every sub-step, for checks; it has to leave the state as it is. Not part of the state.
    """

    base: SimulationBase
    people: People
    objects: MovableObjects
    avatars: Avatars
    events: Events
    environment: Environment
    things: EventThings = field(default_factory=EventThings)
    traffic: TrafficSystem | None = None
    transit: TransitSystem | None = None
    robots: RobotPopulation | None = None
    openings: OpeningHours | None = None
    homes: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    clothes_at_start: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    lines: Lines = field(default_factory=lambda: Lines.of(0))
    leaves: DoorLeaves = field(default_factory=DoorLeaves)
    tick: int = 0
    entities: dict[int, dict[str, str]] = field(default_factory=dict)
    shapes: dict[str, list[Surface]] = field(default_factory=dict)
    on_substep: Callable[[], None] | None = None

    @property
    def world(self) -> World:
        """Where it happens."""
        return self.base.world

    @property
    def indoor(self) -> Indoor:
        """The world's rooms as arrays."""
        return self.base.indoor

    @property
    def tills(self) -> Mapping[int, Till]:
        """Tills by the index of their room."""
        return self.base.tills

    @property
    def seats(self) -> Seats:
        """The world's seats and beds."""
        return self.base.seats

    @property
    def place_index(self) -> Mapping[str, int]:
        """Index of each place in ``world.places`` by id."""
        return self.base.place_index

    @property
    def entrances(self) -> Mapping[str, Entrance]:
        """Entrances by id."""
        return self.base.entrances

    @property
    def second(self) -> float:
        """Seconds since midnight of the first day."""
        return self.tick / TICKS_PER_SECOND

    @property
    def names(self) -> list[str]:
        """Every agent: people first, then robots."""
        return self.people.names + (list(self.robots.names) if self.robots is not None else [])

    def place(self, place_id: str) -> Place | None:
        """Return a place by id; None if there is none."""
        index = self.place_index.get(place_id)
        return None if index is None else self.world.places[index]

    def obstacles(self) -> Bodies:
        """Every body outdoors that somebody on the ground could touch."""
        robots = self.robots
        everything = Bodies.joined(
            [owner.bodies() if owner is not robots else robots.outdoor_bodies() for owner in self.owners()]
        )
        bottom, _ = everything.levels(self.world.height)
        return everything.where(bottom < TALLEST)

    def owners(self) -> list[HasBodies]:
        """Who has bodies: traffic, transit, objects, things of events, avatars, robots; those of them there are."""
        things = self.things if len(self.things) else None
        owners = (self.traffic, self.transit, self.objects, things, self.avatars, self.robots)
        return [owner for owner in owners if owner is not None]

    def carriers(self) -> list[HasDecks]:
        """Who may have decks that things lie on."""
        return [owner for owner in (self.robots,) if owner is not None]

    def deck(self, entity: int) -> DeckPose | None:
        """Return the deck of a body that moves; None if it has none."""
        decks = (carrier.deck(entity) for carrier in self.carriers())
        return next((deck for deck in decks if deck is not None), None)

    def position_of(self, agent: int) -> NDArray[np.float64]:
        """Return where an agent is, ENU metres, shape ``(3,)``; `agent` is its index in `names`."""
        if agent < len(self.people):
            return self.people.position[agent]
        assert self.robots is not None
        return self.robots.bodies().position[agent - len(self.people)]

    def set_outcome(self, agent: int, status: ActionStatus, code: ReasonCode, reason: str) -> None:
        """Note how an agent's action went, and why."""
        if agent < len(self.people):
            self.people.status[agent] = status
            self.people.reason[agent] = reason[:REASON_LENGTH]
            self.people.reason_code[agent] = code
        elif self.robots is not None:
            robot = agent - len(self.people)
            self.robots.action_status[robot] = status
            self.robots.reason[robot] = reason[:REASON_LENGTH]
            self.robots.reason_code[robot] = code

    def entity(self, entity: int) -> dict[str, str]:
        """Return kind and name of an entity of the world or of this run."""
        if FIRST_UMBRELLA <= entity < FIRST_THING:
            return {"kind": "umbrella", "name": "umbrella"}
        known = self.entities.get(entity) or self.world.entities.get(entity) or self.things.entity(entity)
        return known or {"kind": "unknown", "name": str(entity)}

    def same_space(self, i: int, j: int) -> bool:
        """Whether two people are in the same room, the same bus, or both in the street."""
        p = self.people
        in_bus = Vehicle.BUS in (p.vehicle[i], p.vehicle[j])
        if in_bus:
            return bool(p.vehicle[i] == p.vehicle[j] and p.vehicle_entity[i] == p.vehicle_entity[j])
        return bool(p.room[i] == p.room[j])

    def accessible_places(self, i: int) -> list[str]:
        """Return what person `i` could enter from where it is: places outdoors, rooms from a room."""
        p = self.people
        if p.vehicle.item(i) != _ON_FOOT:
            return []
        if (room := p.room.item(i)) >= 0:
            indoor = self.indoor
            near = doors_near(p.position[i], indoor.doors[room], INNER_DOOR_REACH)
            return [indoor.rooms[door.to].id for door in near if door.to >= 0]
        x, y = p.position[i, :2].tolist()
        return [self.world.places[k].id for k in self.base.entrances_near(x, y)]

    def doors_of(self, i: int) -> list[dict[str, Any]]:
        """Ways out of the room that person `i` is in: where each leads, and where it is."""
        return self.doors_in(self.people.room.item(i))

    def doors_in(self, room: int) -> list[dict[str, Any]]:
        """Ways out of a room (-1: none): where each leads, and where it is."""
        if room < 0:
            return []
        rooms = self.indoor.rooms
        return [
            {"to": "outside" if d.to < 0 else rooms[d.to].id, "position": list(d.position)}
            for d in self.indoor.doors[room]
        ]

    def weather_to_dress_for(self) -> NDArray[np.float64]:
        """Return what it is like outdoors now, as `People.clothes`, shape ``(3,)``."""
        weather = self.environment.weather
        return np.array([weather.temperature, weather.rain, weather.snow])

    def is_locked_out(self, i: int, place: str) -> bool:
        """Return whether a place is shut now to person `i`, by its hours."""
        return self.openings is not None and not self.openings.lets_in(i, place, self.second)

    def taken_in(self, room: int, *, without: int = -1) -> NDArray[np.float64]:
        """Where nobody can stand in a room: who stands there already, and points of what lies in the way.

        Returns
        -------
        ndarray
            ENU metres, shape ``(k, 3)``: whoever keeps two radii of a person from each is clear of all.
        """
        inside = self.people.room == room
        if without >= 0:
            inside[without] = False
        objects = self.objects
        lying = objects.in_rooms()
        things = objects.bodies_of(lying[objects.room[lying] == room])
        things = things.where(things.height > STEP_HEIGHT)
        if self.robots is not None and (self.robots.rooms == room).any():
            things = Bodies.joined([things, self.robots.bodies().where(self.robots.rooms == room)])
        return np.vstack([self.people.position[inside], *(_points_of(things, k) for k in range(len(things)))])

    def seats_taken(self) -> NDArray[np.bool_]:
        """Return which of `seats` nobody else can have: somebody is there, or a thing lies on them; shape ``(m,)``."""
        seats, objects, mine = self.seats, self.objects, self.people.seat
        taken = np.zeros(len(seats), np.bool_)
        taken[mine[mine >= 0]] = True
        for k in np.flatnonzero(objects.holder == 0).tolist():
            here = seats.in_room(int(objects.room[k]))
            away = np.abs(seats.position[here] - objects.position[k])
            taken[here] |= (away[:, :2].max(axis=1, initial=0.0) < _ON_SEAT) & (away[:, 2] < _ON_SEAT)
        return taken

    def obstacles_to(self, i: int) -> Bodies:
        """Every body outdoors but person `i`'s."""
        everyone = self.obstacles()
        return everyone.where(everyone.entity != self.people.entity[i])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return every array that decides the future, under a name each, in a fixed order; not copied."""
        found: dict[str, NDArray[Any]] = {"tick": np.array([self.tick], np.int64)}
        for name, part in self._parts().items():
            found |= {f"{name}.{key}": value for key, value in part.arrays().items()}
        return found

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        self.tick = int(arrays["tick"][0])
        for name, part in self._parts().items():
            part.restore(arrays_of(arrays, name))
        if self.traffic is not None:
            effects = self.environment.agenda.effects
            shut = effects.walkways if self.transit is None else self.transit.shut_walkways(effects.walkways)
            self.traffic.set_shut(effects.lanes, shut)
            off = None if self.transit is None else self.transit.on_tracks
            self.traffic.gatherings.follow(self.environment.agenda.gatherings(off))
        self.show_signals()

    def show_signals(self) -> None:
        """Have traffic's signals show what they do now."""
        if self.traffic is not None:
            self.traffic.set_signals(int(self.second), self.environment.agenda.effects.dark)

    def _parts(self) -> dict[str, HasArrays]:
        parts: dict[str, HasArrays | None] = {
            "people": self.people,
            "objects": self.objects,
            "events": self.events,
            "environment": self.environment,
            "things": self.things,
            "traffic": self.traffic,
            "transit": self.transit,
            "lines": self.lines,
            "leaves": self.leaves,
            "robots": self.robots,
        }
        return {name: part for name, part in parts.items() if part is not None}


def _points_of(bodies: Bodies, k: int) -> NDArray[np.float64]:
    """Return points of a rectangle that leave no gap as wide as a person between them, its corners among them."""
    a, b, yaw = float(bodies.half_length[k]), float(bodies.half_width[k]), float(bodies.yaw[k])
    u, v = (np.linspace(-half, half, 2 + int(2 * half / RADIUS)) for half in (a, b))
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    c, s = np.cos(yaw), np.sin(yaw)
    turned = np.column_stack([c * grid[:, 0] - s * grid[:, 1], s * grid[:, 0] + c * grid[:, 1], np.zeros(len(grid))])
    return np.asarray(bodies.position[k] + turned, np.float64)
