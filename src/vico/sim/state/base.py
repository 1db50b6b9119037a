"""Fixed facts of a world, in the form that simulations look them up in: built once, shared by all of them.

Beside the world's own facts these are the residents' schedules as appointments (where each puts them at what time of
the day), and opening hours (which places are open to whom).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date as Date
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.assets.house_doors import DOOR_MATERIAL, house_doors
from vico.assets.models.library import furniture_models, street_models
from vico.clock import DAY, seconds_of_day
from vico.community.model import ActivityTag, ItemType, Mode, Resident, ScheduleItem
from vico.community.place_index import stated_hours
from vico.errors import InputError
from vico.rules import DOOR_REACH
from vico.sim.bodies.rooms import Indoor
from vico.sim.bodies.seats import Seats, Till, tills_of
from vico.sim.environment import CityEvent, EventSites
from vico.sim.environment.event_sites import Spot
from vico.sim.physics import DEFAULT_ENGINE
from vico.sim.robots.scene import RobotScene
from vico.sim.traffic.network import TrafficNetwork
from vico.sim.traffic.stopping_places import with_spots, with_stopping_places
from vico.sim.transit import BusPlan, plan_buses
from vico.sim.transit.tram_network import TramNetwork
from vico.world.city_world import CityWorld
from vico.world.model import Entrance, Place
from vico.world.objects import Objects
from vico.world.opening_hours import DAYS, Coordinates, Span, is_within
from vico.world.routing import Router
from vico.world.world import World

if TYPE_CHECKING:
    from vico.community.model import Community


@dataclass(frozen=True)
class Appointment:
    """Being at a place from `due` until `until`, seconds of the day, and by what one means to get there.

    `asleep` are the stretches of it that one sleeps, seconds of the day.
    """

    place: int
    due: int
    until: int
    mode: Mode = Mode.WALK
    asleep: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class Whereabouts:
    """Where a schedule says someone is: at `place`, or `share` of the way from `origin` to it."""

    place: int
    origin: int
    share: float


def appointments(schedule: Sequence[ScheduleItem], places: dict[str, int]) -> list[Appointment]:
    """Return the stays of a day, neighbours at one place joined, travel left out."""
    stays: list[Appointment] = []
    mode = Mode.WALK
    for item in schedule:
        if item.type is ItemType.COMMUTE:
            mode = item.mode or Mode.WALK
            continue
        if item.place is None or item.place not in places:
            continue
        place, due = places[item.place], seconds_of_day(item.start)
        until = seconds_of_day(item.end)
        asleep = ((due, until),) if item.type is ItemType.SLEEP else ()
        if stays and stays[-1].place == place:
            stays[-1] = replace(stays[-1], until=until, asleep=stays[-1].asleep + asleep)
        else:
            stays.append(Appointment(place, due, until, mode, asleep))
        mode = Mode.WALK
    return stays


def whereabouts(stays: Sequence[Appointment], second: float) -> Whereabouts | None:
    """Where the schedule puts someone at a second of the day; None without any stay."""
    if not stays:
        return None
    for k, stay in enumerate(stays):
        if stay.due <= second <= stay.until:
            return Whereabouts(stay.place, stay.place, 1.0)
        if second < stay.due:
            before = stays[k - 1] if k else stay
            left = before.until if k else 0
            share = (second - left) / max(1.0, stay.due - left)
            return Whereabouts(stay.place, before.place, min(1.0, max(0.0, share)))
    return Whereabouts(stays[-1].place, stays[-1].place, 1.0)


#: Whole ways that are remembered, and plans of buses: more than a community asks for at its start.
_KEPT = 4096
#: Robots' scenes that are kept: each holds a compiled model.
_SCENES = 4


class SimulationBase:
    """The fixed facts of a world; a simulation is arrays on top of it.

    Its parts are made the first time somebody asks for them. Nobody may change them.

    Parameters
    ----------
    world
        The world.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self._ways: dict[tuple[int, int], NDArray[np.float64] | None] = {}
        self._bus_plans: dict[int, BusPlan] = {}
        self._robot_scenes: dict[tuple[str, ...], RobotScene] = {}
        self._days: tuple[Community, list[list[Appointment]]] | None = None

    @classmethod
    def of(cls, world: World) -> SimulationBase:
        """Return the base of a world; it is kept with the world."""
        return world.shared(cls, lambda: cls(world))

    def require(self, world: World) -> None:
        """Refuse another world than the base's.

        Raises
        ------
        InputError
            If it is another one.
        """
        if world is not self.world:
            raise InputError(
                f"simulation: the base was made of another world ({self.world.manifest.name!r}), not of this one "
                f"({world.manifest.name!r}); leave it out, or take SimulationBase.of(world)"
            )

    @cached_property
    def indoor(self) -> Indoor:
        """All rooms as arrays."""
        return Indoor.from_world(self.world.rooms, self.world.places, self.world.objects)

    @cached_property
    def seats(self) -> Seats:
        """Seats and beds."""
        models = street_models() | furniture_models()
        return Seats.of(self.world.objects, models, self.indoor, self.world.height)

    @cached_property
    def tills(self) -> dict[int, Till]:
        """Tills of shops and cafés by room, and where people stand in line before them."""
        return tills_of(self.world.places, self.indoor, self.world.objects)

    def know_things(self) -> None:
        """Make what people ask for of the world's things: a city's are forgotten once a run has begun."""
        _ = self.seats, self.tills

    @cached_property
    def solids(self) -> list[shapely.Polygon]:
        """Footprints nobody walks through: buildings, and the feet of solid things outdoors."""
        world = self.world
        solids = [shapely.Polygon(b.footprint[0], b.footprint[1:]) for b in world.buildings]
        things = world.objects.where(np.asarray(world.objects.solid & world.objects.outdoors, bool))
        solids += [shapely.Polygon(corners) for corners in things.feet()]
        return [solid for solid in solids if solid.is_valid and not solid.is_empty]

    @property
    def _signal_poles(self) -> Objects:
        objects = self.world.objects
        return objects.where(np.asarray(objects.kind == "traffic_signals", bool))

    @cached_property
    def streets(self) -> TrafficNetwork:
        """Network that traffic moves on."""
        world = self.world
        # Of a city that lies on the disk alone: a world of one tile takes a second or two, and may be made up.
        known = world.digest if isinstance(world, CityWorld) else ""
        poles = self._signal_poles
        network = TrafficNetwork.of(world.lanes, self.solids, poles, world.height, world.edges, kept_as=known)
        driven = with_stopping_places(network.driven, network.lanes, network.walks, self.world, self.solids)
        walked = with_spots(network.walked, network.walks, self.world, self.solids)
        return replace(network, driven=driven, walked=walked)

    @cached_property
    def tram_network(self) -> TramNetwork:
        """Network that trams drive on, and what is in their way there."""
        return TramNetwork(self.world.transit.tram_lines, self.streets.lanes, self.streets.walks)

    @cached_property
    def router(self) -> Router:
        """Finds ways on the walkable map."""
        return self.world.router

    @cached_property
    def event_sites(self) -> EventSites:
        """Sites where events can be."""
        return EventSites(self.world, lambda: self.streets.walks)

    @cached_property
    def event_spots(self) -> dict[CityEvent, list[Spot]]:
        """Spots of the things of events, of those that were asked for so far."""
        return {}

    @cached_property
    def place_index(self) -> dict[str, int]:
        """Index of each place in ``world.places`` by id."""
        return {place.id: i for i, place in enumerate(self.world.places)}

    @cached_property
    def entrances(self) -> dict[str, Entrance]:
        """Entrances by id."""
        return {entrance.id: entrance for entrance in self.world.entrances}

    @cached_property
    def house_doors(self) -> NDArray[np.void]:
        """Doors of ``world.entrances``, `vico.assets.house_doors.HOUSE_DOOR`, as facades have them."""
        return house_doors(self.world.geometry("buildings", DOOR_MATERIAL), self.world.entrances)

    @cached_property
    def entrance_index(self) -> dict[str, int]:
        """Row of each entrance in ``world.entrances`` by id."""
        return {entrance.id: k for k, entrance in enumerate(self.world.entrances)}

    @cached_property
    def doors(self) -> NDArray[np.float64]:
        """Entrance of each place, ENU metres, float64, shape ``(places, 2)``; far away for places without one."""
        far = (1e9, 1e9)
        doors = [self.entrances[p.entrance].position[:2] if p.entrance else far for p in self.world.places]
        return np.array(doors, np.float64).reshape(-1, 2)

    @cached_property
    def place_spots(self) -> NDArray[np.float64]:
        """Position of each place, ENU metres, float64, shape ``(places, 2)``."""
        return np.array([place.position[:2] for place in self.world.places], np.float64).reshape(-1, 2)

    @cached_property
    def has_rooms(self) -> NDArray[np.bool_]:
        """Whether each place has rooms, shape ``(places,)``."""
        return np.array([bool(place.rooms) for place in self.world.places], bool)

    @cached_property
    def _places_by_cell(self) -> dict[tuple[int, int], list[tuple[int, float, float]]]:
        """Places with rooms whose entrance may be in reach from a cell as wide as the reach, and that, in order."""
        found: dict[tuple[int, int], list[tuple[int, float, float]]] = {}
        for k, place in enumerate(self.world.places):
            if place.entrance and place.rooms:
                column, row = (int(c) for c in np.floor(self.doors[k] / DOOR_REACH))
                for cell in product(range(column - 1, column + 2), range(row - 1, row + 2)):
                    found.setdefault(cell, []).append((k, *self.doors[k].tolist()))
        return found

    def entrances_near(self, x: float, y: float) -> list[int]:
        """Return the places with rooms that one could enter from a point outdoors, by their indices."""
        cell = math.floor(x / DOOR_REACH), math.floor(y / DOOR_REACH)
        near = self._places_by_cell.get(cell, ())
        return [k for k, door_x, door_y in near if math.hypot(door_x - x, door_y - y) <= DOOR_REACH]

    def days(self, community: Community) -> list[list[Appointment]]:
        """Return the appointments of a community's residents; those of the last community asked for are kept."""
        if self._days is None or self._days[0] is not community:
            self._days = community, [appointments(r.schedule, self.place_index) for r in community.residents]
        return self._days[1]

    def bus_plan(self, second: int) -> BusPlan:
        """Return which buses drive at a second of the day, and where they are."""
        if second not in self._bus_plans:
            if len(self._bus_plans) >= _KEPT:
                self._bus_plans.clear()
            self._bus_plans[second] = plan_buses(self.world.transit, self.world.lanes, float(second))
        return self._bus_plans[second]

    def robot_scene(self, kinds: Sequence[str], physics: str = DEFAULT_ENGINE) -> RobotScene:
        """Return what is fixed about robots of some kinds, in their order, in a physics engine."""
        key = (physics, *kinds)
        if key not in self._robot_scenes:
            if len(self._robot_scenes) >= _SCENES:
                self._robot_scenes.clear()
            self._robot_scenes[key] = RobotScene(
                self.world, kinds, router=self.router, physics=physics, indoor=self.indoor
            )
        return self._robot_scenes[key]

    def way(self, origin: int, goal: int) -> NDArray[np.float64] | None:
        """Return the way on foot from one place to another, by their indices; None if there is none."""
        if (origin, goal) not in self._ways:
            if len(self._ways) >= _KEPT:
                self._ways.clear()
            places = self.world.places
            self._ways[origin, goal] = self.router.path(places[origin].position[:2], places[goal].position[:2])
        return self._ways[origin, goal]


class OpeningHours:
    """When places are open that say so on the map.

    Who lives, works or learns at a place is let in at all hours, and so is who has an appointment there after hours.

    Parameters
    ----------
    places
        Of the world.
    date
        The first day; every day is like it, as the days of a community are.
    coordinates
        Latitude and longitude of the world, degrees: for public holidays and the sun.
    residents, days
        The first of the state's people, and their appointments.
    """

    def __init__(
        self,
        places: Sequence[Place],
        date: Date,
        coordinates: Coordinates,
        residents: Sequence[Resident] = (),
        days: Sequence[Sequence[Appointment]] = (),
    ) -> None:
        self._spans: dict[str, list[Span]] = {}
        self._weekday = date.weekday()
        for place in places:
            spans = stated_hours(place, date, coordinates) if place.rooms else None
            if spans is not None:
                self._spans[place.id] = spans
        belongs = {(i, place) for i, one in enumerate(residents) for place in (one.home, one.workplace) if place}
        belongs |= {
            (i, item.place)
            for i, one in enumerate(residents)
            for item in one.schedule
            if item.place and item.tag in (ActivityTag.WORK, ActivityTag.STUDY)
        }
        for i, day in enumerate(days):
            at = [(places[one.place].id, one.due) for one in day]
            belongs |= {(i, place) for place, due in at if not self.is_open(place, due)}
        self._belongs = frozenset(belongs)

    def is_open(self, place: str, second: float) -> bool:
        """Return whether a place is open to everybody at a second; those whose hours nobody says are."""
        spans = self._spans.get(place)
        if spans is None:
            return True
        return is_within(spans, second % DAY / 60.0)

    def lets_in(self, person: int, place: str, second: float) -> bool:
        """Return whether somebody may be at a place at a second."""
        return self.is_open(place, second) or (person, place) in self._belongs

    def hours(self, place: str) -> str:
        """Return the hours of a place on the day in words."""
        spans = self._spans.get(place, [])
        told = ", ".join(f"{_clock(start)}-{_clock(end)}" for start, end in spans if end > start)
        return f"open {told} on {DAYS[self._weekday]}" if told else f"not open on {DAYS[self._weekday]}"


def _clock(minute: int) -> str:
    return f"{minute // 60 % 24:02d}:{minute % 60:02d}"
