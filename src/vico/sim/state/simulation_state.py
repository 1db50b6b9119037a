"""The state of a simulation: everything that changes, with quick look-ups of the world's fixed facts.

`TrafficSystem` and `RobotSystem` say what the rules of a simulation ask of traffic and robots.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import ActionSpace
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
    from vico.sim.robots.hardware import Reading


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
    action_status
        How each robot's last action went, as `vico.rules.ActionStatus`, int8, shape ``(n,)``.
    reason, reason_code
        Why, in words ("" if it was done), shape ``(n,)``, and as `vico.rules.ReasonCode`, int16, shape ``(n,)``.
    """

    names: list[str]

    @property
    def action_status(self) -> NDArray[np.int8]:
        """How each robot's last action went."""

    @property
    def reason(self) -> NDArray[np.str_]:
        """Why, in words."""

    @property
    def reason_code(self) -> NDArray[np.int16]:
        """Why, as a code."""

    def begin(self, who: NDArray[np.bool_] | None = None) -> None:
        """Forget how the last actions went of the robots that act now; None: all of them."""

    def advance(self, dt: float, obstacles: Bodies, *, since: float = 0.0, substep: float | None = None) -> None:
        """Move on by `dt` seconds, a multiple of 0.01.

        Parameters
        ----------
        obstacles
            Everybody else's bodies, where they are at the end of the sub-step that this slice of time is part of.
        since
            Seconds of that sub-step that have passed already.
        substep
            Length of that sub-step, seconds; None if the slice is all of it.
        """

    def set_grip(self, grip: float) -> None:
        """Have robots grip the ground with a share of what they do on dry ground, 0..1; told before every sub-step."""

    def set_closed_ground(self, circles: tuple[tuple[float, float, float], ...]) -> None:
        """Have robots go round ground that events close: x, y and radius of circles, ENU metres."""

    def set_wind(self, east: float, north: float) -> None:
        """Have the mean wind 10 m above ground blow with so many m/s towards east and north; told like the grip."""

    def control_period(self, robot: int) -> float:
        """How often the robot's model wants to be controlled, seconds."""

    def action_spaces(self, robot: int) -> Mapping[str, ActionSpace]:
        """Return what the robot can be commanded by, by name; the first is its own."""

    def command(self, robot: int, vector: NDArray[np.float64], space: str = "") -> None:
        """Have the robot follow a vector of an action space ("": its own) until another command comes."""

    def has_way(self, robot: int, xy: NDArray[np.float64]) -> bool:
        """Return whether there is a way to a point that is wide enough for the robot."""

    def go_to(self, robot: int, xy: NDArray[np.float64], room: int = -1) -> bool:
        """Have the robot go to a point of a room (-1: outdoors); False if there is no way."""

    @property
    def rooms(self) -> NDArray[np.int32]:
        """The room each robot is in, -1 outdoors, int32, shape ``(n,)``."""

    def outdoor_bodies(self) -> Bodies:
        """Bodies of the robots that are outdoors."""

    def room_at(self, point: NDArray[np.float64]) -> int:
        """Return the room that a point lies in, ENU metres, -1 for none."""

    def trip_refusal(self, robot: int, room: int, point: NDArray[np.float64]) -> str:
        """Why a robot can't go to a point of a room (-1: outdoors), in words; "" if it can."""

    def trip_room(self, robot: int) -> int:
        """Return the room that a robot is going to, -1 outdoors, -2 for no trip."""

    def at_doors(self) -> list[tuple[int, int]]:
        """Return the robots that wait at doors, and the rooms behind those (-1: outdoors)."""

    def ride(self, robot: int, dt: float) -> float:
        """Have a robot ride on in a lift; return the seconds that it has."""

    def room_needed(self, robot: int) -> float:
        """Return how much room a robot needs around its middle, metres."""

    def pass_door(self, robot: int, room: int, taken: NDArray[np.float64]) -> bool:
        """Have a robot come through a door into a room (-1: outdoors); False if no spot there is clear of discs."""

    def give_up(self, robot: int) -> None:
        """Have a robot end its way before it is there."""

    def is_empty(self, robot: int) -> bool:
        """Return whether a robot's battery is empty."""

    def flies(self, robot: int) -> bool:
        """Return whether the robot flies."""

    def flight_refusal(self, robot: int, target: NDArray[np.float64]) -> str:
        """Why a robot that flies can't fly to a point, ENU metres; "" if it can."""

    def can_land(self, robot: int, xy: NDArray[np.float64] | None = None) -> bool:
        """Return whether a robot that flies can land at a point, or where it is."""

    def fly_to(self, robot: int, target: NDArray[np.float64]) -> None:
        """Have a robot fly to a point and hover there."""

    def land(self, robot: int, xy: NDArray[np.float64] | None = None) -> None:
        """Have a robot that flies land at a point, or where it is."""

    def has_arm(self, robot: int) -> bool:
        """Return whether the robot has an arm."""

    def in_hand(self, robot: int) -> int:
        """Return the entity of what the robot's hand holds; 0 for nothing."""

    def held_by_oracle(self, robot: int) -> int:
        """Return the entity of what the robot's hand holds by oracle grasp; 0 for nothing, and in runs without that."""

    def can_grasp(self, robot: int, size: NDArray[np.float64]) -> bool:
        """Return whether the robot's jaw is wide enough for a thing of some extents, metres."""

    def reach(self, robot: int, target: NDArray[np.float64]) -> None:
        """Have the robot bring its hand to a point."""

    def pick(self, robot: int, entity: int) -> None:
        """Have the robot pick a thing up."""

    def place(self, robot: int, target: NDArray[np.float64] | int) -> None:
        """Have the robot put down what it holds, at a point or on a deck."""

    def offer(self, robot: int, person: NDArray[np.float64]) -> None:
        """Have the robot hold out what it holds to a person at a point, until it is taken."""

    def follow_body(self, robot: int, entity: int) -> None:
        """Have the robot keep near a body, wherever that goes."""

    def stop(self, robot: int) -> None:
        """Have the robot stand still."""

    def sees(self, robot: int) -> bool:
        """Return whether the robot has a camera."""

    def readings(self, robot: int) -> Mapping[str, Reading]:
        """Return shape and bounds of what the robot's sensors give, by name."""

    def observation(self, robot: int) -> dict[str, NDArray[Any]]:
        """Return what the robot's sensors give, by name."""

    def cameras(self) -> NDArray[np.float64]:
        """Where each robot's camera is, ENU metres, and the unit vector it looks along, shape ``(n, 6)``."""

    def camera_heights(self) -> NDArray[np.float64]:
        """Height of each robot's camera above the ground it stands on, metres."""

    def base_poses(self) -> NDArray[np.float64]:
        """Return where the robots' bases are: x, y, z, quaternion w, x, y, z, float64, shape ``(n, 7)``."""

    def joint_positions(self) -> list[NDArray[np.float64]]:
        """Return the angles of each robot's joints, rad; as many as it has."""

    def physics_record(self) -> dict[str, Any]:
        """Return the engine, how many frames of either length there were and why, and what found no room in it."""

    def events(self) -> Sequence[RobotNote]:
        """Return what happened to robots since this was last asked."""

    def deck(self, entity: int) -> DeckPose | None:
        """Return the deck of the robot with this entity; None if it has none."""


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
    robots: RobotSystem | None = None
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
