"""The plan of a resident's day: stays with times and places, changes to them, and the plan that is published.

A `Stay` says where to be by when, and when to set out. `DayPlanChanges` decides where a stay takes place after all:
elsewhere where a place is closed, in a storm, or to see what is on. It follows from what the resident is told (closed
places, weather, events) and from traits that the run's seed gives: how much rain, wind, cold and heat somebody stands,
and whether somebody goes to see what is on. `plan_of_day` and `plan_of_errand` make the plan that a page shows, from
what an agent remembers, when somebody asks.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from vico.agents.base import AgentState, Goal, Info, Plan
from vico.clock import DAY, clock_of, seconds_of_day
from vico.rules import walking_factor
from vico.seeds import rng
from vico.world.model import Category, Point3
from vico.world.public import PublicMap, PublicPlace

#: Metres a second of who has time, and at most of who is late.
EASY_PACE, RUN_PACE = 1.0, 2.4
#: Time kept in hand for corners, crossings and doors: a share of the way, and seconds.
SLACK_SHARE, SLACK = 0.15, 20.0


class ScheduleItem(Protocol):
    """A stretch of the day, as the community's schedules have it."""

    @property
    def type(self) -> str:
        """sleep, meal, main or commute."""

    @property
    def tag(self) -> str | None:
        """What it is about, as `vico.community.model.ActivityTag` has it; None if nobody said."""

    @property
    def start(self) -> str:
        """``HH:MM:SS``."""

    @property
    def end(self) -> str:
        """``HH:MM:SS``."""

    @property
    def activity(self) -> str:
        """What for, in words."""

    @property
    def place(self) -> str | None:
        """Id of the place; None on the way."""

    @property
    def mode(self) -> str | None:
        """On the way: walk, bus or bike; None is walk."""


@dataclass(frozen=True)
class Stay:
    """To be at a place by `due`, and to set out at `leave`, seconds of the day; `tag` says what for.

    `mode` is how one means to get there: walk, bus, tram or bike.
    """

    leave: float
    due: float
    type: str
    tag: str
    activity: str
    place: str
    mode: str = "walk"


def stays_of(schedule: Iterable[ScheduleItem], known: Mapping[str, object]) -> list[Stay]:
    """Return the stays of a day, each with the time to set out; items without a place on the map are left out."""
    stays: list[Stay] = []
    leave: float | None = None
    mode = "walk"
    for item in schedule:
        if str(item.type) == "commute":
            leave = seconds_of_day(item.start) if leave is None else leave
            mode = str(item.mode or "walk")
            continue
        if item.place is None or item.place not in known:
            continue
        due = seconds_of_day(item.start)
        when = due if leave is None else leave
        stays.append(Stay(when, due, str(item.type), str(item.tag or ""), item.activity, item.place, mode))
        leave, mode = None, "walk"
    return stays


def with_travel_times(stays: Sequence[Stay], public_map: PublicMap, pace: float = EASY_PACE) -> list[Stay]:
    """Give those stays time for the way whose schedule has none: two doors of one building may lie streets apart.

    Parameters
    ----------
    pace
        How fast they walk, m/s.
    """
    found = list(stays[:1])
    for before, stay in pairwise(stays):
        if stay.leave == stay.due and before.place != stay.place:
            places = public_map.place_by_id
            way = public_map.router.seconds(places[before.place].position, places[stay.place].position, pace)
            if math.isfinite(way):
                stay = replace(stay, leave=max(before.due, stay.due - way * (1.0 + SLACK_SHARE) - SLACK))
        found.append(stay)
    return found


# Of a day, so many stays are told.
_STAYS_PUBLISHED = 3

_ERRAND_TEXTS = {
    "look": "goes where it may be, and looks for it",
    "fetch": "goes where it saw it",
    "deliver": "brings what it holds",
}


def plan_of_day(
    stays: Sequence[Stay], departures: Sequence[float], second: float, public_map: PublicMap, way: Iterable[Any]
) -> Plan | None:
    """Return where a day leads next; None for a day without places.

    Parameters
    ----------
    departures
        When one sets out for each stay, seconds of the day.
    second
        Now, seconds since the first midnight.
    way
        Points that one walks along now, ENU metres.
    """
    if not stays:
        return None
    now = second % DAY
    at = max((k for k, leaves in enumerate(departures) if now >= leaves), default=0)
    goals = []
    for stay in stays[at : at + _STAYS_PUBLISHED]:
        place = public_map.place_by_id[stay.place]
        x, y, z = place.position
        goals.append(Goal(f"{stay.activity} from {clock_of(int(stay.due))[:5]}", (x, y, z), place.name or place.kind))
    stay = stays[at]
    by = "" if stay.mode == "walk" else f", by {stay.mode}"
    why = f"the day says {stay.activity} from {clock_of(int(stay.due))[:5]}{by}"
    return Plan(tuple(goals), _path_on_ground(way, public_map), why)


def plan_of_errand(
    told: Mapping[str, Any] | None, doing: str, public_map: PublicMap, way: Iterable[Any], *, source: int = -1
) -> Plan:
    """Return what an assistant is about.

    Parameters
    ----------
    told
        The subtask's instruction; None where there is none left.
    doing
        What it does for it, in words.
    source
        Which of the subtask's sources it goes to; -1 for none.
    """
    if told is None:
        return Plan(why="everything is reported")
    goals = [Goal(str(told["text"]))]
    regions = [*([told["sources"][source]] if source >= 0 else []), told["destination"]]
    for region in regions:
        if region is not None:
            x, y, z = region["centre"]
            goals.append(Goal(str(region["name"]), (x, y, z), str(region["name"])))
    return Plan(tuple(goals), _path_on_ground(way, public_map), _ERRAND_TEXTS.get(doing, doing))


def _path_on_ground(way: Iterable[Any], public_map: PublicMap) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(public_map.height((float(x), float(y))))) for x, y in way)


# Where a place is closed, another one of its kind within so many metres will do, but for what binds one to the place.
_OTHER_NEAR = 400.0
_OBLIGATORY = ("work", "study")
# What takes place in the open only as long as the weather allows.
_FOR_PLEASURE = ("leisure", "visit", "exercise")
#: Where one goes instead of a park in the rain.
_SHELTERS = {"arts_centre", "bar", "books", "cafe", "cinema", "community_centre", "department_store", "fitness_centre"}
_SHELTERS |= {"gallery", "library", "mall", "museum", "pub", "sports_centre"}
_NOT_FOR_CHILDREN, _GROWN_UP = {"bar", "pub"}, 18
# Which stays are spent at what is on, within so many metres of where one would be, by this share of people.
_ATTRACTED_STAYS = {"market": ("leisure", "shop"), "concert": ("leisure",)}
_WORTH_IT, _CURIOUS = 600.0, 0.4
# What one stands before and looks at, so far above the ground, metres.
_WATCHED_EVENTS, _STAGE_HEIGHT = ("concert",), 2.0
# How far from its middle one stands or strolls about, metres.
_NEAREST, _FARTHEST = 5.0, 14.0


class WeatherTolerance(NamedTuple):
    """How much bad weather somebody stands outdoors for pleasure or on a bicycle.

    Attributes
    ----------
    rain
        Water that falls as rain, mm/h; of snow a third of it.
    wind
        m/s, 10 m above ground.
    cold, heat
        Degrees Celsius.
    """

    rain: float
    wind: float
    cold: float
    heat: float

    @classmethod
    def of(cls, seed: int, name: str) -> WeatherTolerance:
        """Return a resident's own; from fair-weather people to those whom little keeps in."""
        low, high = np.array([0.5, 10.0, -12.0, 31.0]), np.array([6.0, 18.0, -2.0, 39.0])
        return cls(*rng(seed, "tolerance of weather", name).uniform(low, high).tolist())

    def is_exceeded(self, weather: Mapping[str, float]) -> bool:
        """Return whether it is too bad outdoors."""
        return (
            max(weather["rain"], 3.0 * weather["snow"]) > self.rain
            or weather["wind"] > self.wind
            or not self.cold <= weather["temperature"] <= self.heat
        )


class Attraction(NamedTuple):
    """What somebody thinks of an event: whether to go, the spot where one would be, and what one would look at."""

    comes: bool
    place: PublicPlace
    watched: Point3 | None


class DayPlanChanges:
    """Where a resident spends a stay, and when it sets out, as things are.

    Parameters
    ----------
    public_map
        Places.
    stays
        Of the day.
    seed, name
        Of the run, and of the resident.
    age
        Years.
    """

    def __init__(self, public_map: PublicMap, stays: Sequence[Stay], *, seed: int, name: str, age: int = 30) -> None:
        self._map, self._stays = public_map, stays
        self._seed, self._name = seed, name
        self._tolerance = WeatherTolerance.of(seed, name)
        self._shelters = _SHELTERS if age >= _GROWN_UP else _SHELTERS - _NOT_FOR_CHILDREN
        # Where one goes for a stay instead of its place: the stay, and the places that were thought of.
        self._instead: tuple[Stay | None, list[str]] = None, []
        # What was heard of the weather last: how fast one walks, and whether it is too bad to cycle.
        self._walking, self._keeps_off_bicycles = 1.0, False
        # For how fast one walks: when one sets out for each stay, and that in ascending order.
        self._departures: tuple[float, list[float], list[float]] = math.nan, [], []
        # Whether one goes to what is on, where one would stand, and what one would look at.
        self._events: dict[int, Attraction] = {}

    def state(self) -> AgentState:
        """Return what decides where stays take place, beside what is told anew."""
        stay, places = self._instead
        return {
            "instead": list(places),
            "instead_of": None if stay is None else self._stays.index(stay),
            "walking": self._walking,
            "keeps_off_bicycles": self._keeps_off_bicycles,
        }

    def restore(self, state: AgentState) -> None:
        """Go on with what `state` returned."""
        stay = state["instead_of"]
        self._instead = None if stay is None else self._stays[stay], [str(name) for name in state["instead"]]
        self._walking, self._keeps_off_bicycles = float(state["walking"]), bool(state["keeps_off_bicycles"])

    def notice(self, info: Info) -> None:
        """Take note of the weather."""
        weather = info.get("weather")
        if weather is None:
            return
        self._walking = walking_factor(weather["snow_cover"], weather["ice"])
        slippery = weather["ice"] > 0.1 or weather["snow_cover"] > 0.3
        self._keeps_off_bicycles = slippery or self._tolerance.is_exceeded(weather)

    @property
    def avoided_modes(self) -> tuple[str, ...]:
        """Modes that one does not choose in such weather."""
        return ("bike",) if self._keeps_off_bicycles else ()

    @property
    def departures(self) -> Sequence[float]:
        """When one sets out for each stay, seconds of the day: earlier than planned where it is slow to walk."""
        if self._departures[0] != self._walking:
            slower = 1.0 / self._walking - 1.0
            times = [stay.leave - (stay.due - stay.leave) * slower for stay in self._stays]
            self._departures = self._walking, times, sorted(times)
        return self._departures[1]

    def changes(self) -> Sequence[float]:
        """Return when one sets out for each stay, seconds of the day, in ascending order."""
        _ = self.departures
        return self._departures[2]

    def point_to_watch(self, place: PublicPlace) -> Point3 | None:
        """Return the point that those look at who came to a place; None where there is none."""
        return next((one.watched for one in self._events.values() if one.place is place), None)

    def place_of(self, stay: Stay, info: Info, inside: str) -> PublicPlace:
        """Return where one spends a stay, told this; `inside` is the id of the place one is in, or ""."""
        attraction = self._attraction(stay, info)
        if attraction is not None:
            return attraction
        if self._instead[0] is not stay:
            self._instead = None, []
        thought_of = self._instead[1]
        place = self._map.place_by_id[thought_of[-1] if thought_of else stay.place]
        closed = {name for event in info.get("events", ()) if event["goes_on"] for name in event["closed_places"]}
        # Who is in may stay when an event closes the place, but not after its hours.
        over = set(info.get("closed_now", ()))
        closed |= over
        if place.id in over or (place.id in closed and inside != place.id):
            return self._goes(stay, [*(thought_of or [place.id]), self._other(stay, closed.union(thought_of))])
        if place.building is None and self._is_too_bad(stay, info):
            return self._goes(stay, [*(thought_of or [place.id]), self._shelter(place, closed, stay)])
        return place

    def _goes(self, stay: Stay, places: list[str]) -> PublicPlace:
        self._instead = stay, places
        return self._map.place_by_id[places[-1]]

    def _other(self, stay: Stay, closed: Collection[str]) -> str:
        """Return where one goes who finds a place closed: the nearest of its kind, but not for work, or home."""
        wanted = self._map.place_by_id[stay.place]
        if stay.tag not in _OBLIGATORY:
            near = self._map.places_near(wanted.position, _OTHER_NEAR)
            for place in near:
                if (
                    place.kind == wanted.kind
                    and place.id not in closed
                    and (place.building is None) == (wanted.building is None)
                ):
                    return place.id
        home = self._home(stay)
        return stay.place if home in closed else home

    def _shelter(self, wanted: PublicPlace, closed: Collection[str], stay: Stay) -> str:
        """Return where one spends a stay that was to be in the open: the nearest café or museum, say, or home."""
        near = self._map.places_near(wanted.position, _OTHER_NEAR)
        roofs = (p.id for p in near if p.building is not None and p.kind in self._shelters and p.id not in closed)
        return next(roofs, self._home(stay))

    def _home(self, stay: Stay) -> str:
        return next((one.place for one in self._stays if one.type == "sleep"), stay.place)

    def _is_too_bad(self, stay: Stay, info: Info) -> bool:
        weather = info.get("weather")
        return stay.tag in _FOR_PLEASURE and weather is not None and self._tolerance.is_exceeded(weather)

    def _attraction(self, stay: Stay, info: Info) -> PublicPlace | None:
        """Return where something is on that one goes to see instead, or None."""
        found = None
        for event in info.get("events", ()):
            if not event["goes_on"] or stay.tag not in _ATTRACTED_STAYS.get(event["kind"], ()):
                continue
            if event["id"] not in self._events:
                self._events[event["id"]] = self._thought_of(event)
            thought = self._events[event["id"]]
            planned = self._map.place_by_id[stay.place].position
            if thought.comes and math.dist(planned[:2], thought.place.position[:2]) <= _WORTH_IT:
                found = thought.place
        return None if found is None or self._is_too_bad(stay, info) else found

    def _thought_of(self, event: Mapping[str, Any]) -> Attraction:
        """Return whether one goes to an event, and the spot where one would stand; the same whenever it is asked."""
        generator = rng(self._seed, "what is on", self._name, event["id"])
        comes = bool(generator.random() < _CURIOUS)
        x, y, z = event["position"]
        spot = np.array([x, y])
        # Around it, on ground where one can stand: what is on may stand in the middle itself.
        for _ in range(8):
            turn, away = generator.uniform(0.0, math.tau), generator.uniform(_NEAREST, _FARTHEST)
            near = np.array([x + away * math.cos(turn), y + away * math.sin(turn)])
            if self._map.walkable.is_connected(near):
                spot = near
                break
        at = (float(spot[0]), float(spot[1]), float(z))
        place = PublicPlace(f"event {event['id']}", event["name"], Category.OPEN, event["kind"], None, at, None)
        return Attraction(comes, place, (x, y, z + _STAGE_HEIGHT) if event["kind"] in _WATCHED_EVENTS else None)
