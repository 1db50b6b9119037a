"""Index of the places of a world for authors and the validator: which can be reached, how far, and when.

Places are open when the map says so, else at the usual hours of their kind. Usual hours are data:
``vico/data/community/hours.toml`` and a user's own files. What is indoors at places is kept in numbers: a city has
hundreds of thousands of rooms.
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date as Date
from datetime import timedelta
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vico.community.ride_times import RideTimes, Walks
from vico.errors import EmptyInputError, SchemaError
from vico.geometry import distances
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.io.memory import LruCache
from vico.rules import BED_WIDTH, WALK_SPEED
from vico.world.model import Category, Place, Point2
from vico.world.opening_hours import DAYS, MINUTES, Coordinates, Span, customary_weekday, open_spans, weekly_hours
from vico.world.walk_lengths import IndoorWays
from vico.world.walkable import CROSSING, ROADWAY
from vico.world.world import World

# Rooms that one only passes through.
_WAYS = frozenset({"corridor", "stairs", "lift", "lobby", "hall"})


class PlaceRooms:
    """Of each place, in the order of the world's.

    Attributes
    ----------
    inside
        Seconds on foot from the street to the farthest room; 0 in the open. float64, shape ``(places,)``.
    beds
        How many people can lie in the beds, which are for two where they are wide. int64, shape ``(places,)``.
    area
        Square metres of the rooms, without corridors, stairs and lifts. float64, shape ``(places,)``.
    """

    def __init__(self, world: World) -> None:
        places = world.places
        self.inside, self.area = np.zeros(len(places)), np.zeros(len(places))
        self.beds: NDArray[np.int64] = np.zeros(len(places), np.int64)
        by_id = world.room_by_id if any(place.rooms for place in places) else {}
        ways = IndoorWays(by_id)
        for k, place in enumerate(places):
            self.inside[k] = ways.seconds(place.rooms)
            rooms = [by_id[name] for name in place.rooms]
            beds = (top for room in rooms for top in room.containers if top.kind == "bed")
            self.beds[k] = sum(max(1, int(bed.size[1] / BED_WIDTH + 1e-9)) for bed in beds)
            self.area[k] = sum(room.size[0] * room.size[1] for room in rooms if room.kind not in _WAYS)

    @classmethod
    def of(cls, world: World) -> PlaceRooms:
        """Return those of a world, counted once."""
        return world.shared(cls, lambda: cls(world))


#: Staff are at their place so long before it opens and after it closes, at most, minutes.
STAFF_MARGIN = 60

_GUIDE = "docs/adding_people.md"
# Rules of a value of `opening_hours`, and days that are all there is in one: open round the clock, by the letter.
_RULES = re.compile(r";|\|\|")
_DAYS = re.compile(r"(?:Mo|Tu|We|Th|Fr|Sa|Su|PH|SH|[-,\s])+")


class _Usual(DataRecord):
    hours: str
    kinds: tuple[str, ...]


class _HoursFile(DataRecord):
    otherwise: str | None = None
    usual: tuple[_Usual, ...] = ()


@dataclass(frozen=True)
class UsualHours:
    """Spans of the seven days, Monday first, by kind or category of place, and of all others."""

    by_kind: Mapping[str, list[list[Span]]]
    otherwise: list[list[Span]]


@cached_data
def usual_hours() -> UsualHours:
    """Return when places are usually open; a kind has the hours that named it last.

    Raises
    ------
    SchemaError
        If a file can't be used, or hours can't be read.
    """
    by_kind: dict[str, list[list[Span]]] = {}
    otherwise: list[list[Span]] = [[] for _ in DAYS]
    for path in data_files("community", "hours"):
        file = read_record(path, _HoursFile, guide=_GUIDE)
        for k, entry in enumerate(file.usual):
            by_kind |= dict.fromkeys(entry.kinds, _week(path, f"usual.{k}.hours", entry.hours))
        if file.otherwise is not None:
            otherwise = _week(path, "otherwise", file.otherwise)
    return UsualHours(by_kind, otherwise)


def _week(path: Path, where: str, text: str) -> list[list[Span]]:
    """Return the hours of a week with those that spill over from the day before, or refuse a data file's value."""
    week = weekly_hours(text)
    if any(_DAYS.fullmatch(rule.strip()) for rule in _RULES.split(text) if rule.strip()):
        raise SchemaError(f"{path}: {where}: {text!r} names days without hours; write them like Mo-Fr 09:00-17:00")
    if week is None or not any(week[:5]):
        raise SchemaError(f"{path}: {where}: {text!r} says no hours of a working day; write them like 09:00-17:00")
    late = [[(0, end - MINUTES) for _, end in day if end > MINUTES] for day in week]
    return [sorted(late[k - 1] + day) for k, day in enumerate(week)]


def usual_spans(kind: str, category: str, weekday: int = 1) -> list[Span]:
    """Return when a place of this kind is usually open on a day, minutes; empty where it is closed.

    Parameters
    ----------
    weekday
        0 Monday .. 6 Sunday; a working day unless given.
    """
    usual = usual_hours()
    week = usual.by_kind.get(kind) or usual.by_kind.get(category, usual.otherwise)
    return list(week[weekday])


def stated_hours(place: Place, date: Date, coordinates: Coordinates, *, holidays: bool = True) -> list[Span] | None:
    """Return when a place says that it is open on a date, minutes; None if it says nothing that can be read.

    Parameters
    ----------
    coordinates
        Latitude and longitude of the world, degrees: for public holidays and the sun.
    holidays
        Whether public holidays count.
    """
    said = place.opening_hours
    return None if said is None else open_spans(said, date, coordinates, holidays=holidays)


def hours_on(place: Place, date: Date, coordinates: Coordinates) -> list[Span]:
    """Return when a place is open on a date, minutes: what it says, else what is usual for its kind."""
    given = stated_hours(place, date, coordinates)
    return usual_spans(place.kind, place.category, customary_weekday(date, coordinates)) if given is None else given


def staffed_stretches(spans: Sequence[Span]) -> list[list[Span]]:
    """Group the opening hours of a day into stretches between which staff go home.

    A place that closes at midday for less than twice `STAFF_MARGIN` stays staffed: one stretch of two spans.
    """
    stretches: list[list[Span]] = []
    for span in sorted(spans):
        if stretches and span[0] - max(end for _, end in stretches[-1]) <= 2 * STAFF_MARGIN:
            stretches[-1].append(span)
        else:
            stretches.append([span])
    return stretches


def staffed_spans(spans: Sequence[Span]) -> list[Span]:
    """Return from when until when staff may be at a place with these opening hours, minutes of the day."""
    return [
        (min(start for start, _ in stretch) - STAFF_MARGIN, max(end for _, end in stretch) + STAFF_MARGIN)
        for stretch in staffed_stretches(spans)
    ]


#: Accommodation in which people stay for a while, not for good.
GUEST_KINDS = frozenset({"hotel", "hostel", "motel", "guest_house", "apartment", "chalet", "alpine_hut"})

#: Distance that spawn points keep from each other, metres.
SPAWN_GAP = 2.0

_ESTIMATES = 1024  # places whose estimates to all others are kept, 2 bytes each: a city has tens of thousands
_MOST_MINUTES = 32_000  # of an estimate: it fits into 2 bytes
# A place that people can reach has its position on the walkable map, or a step beside it.
_REACH = 2.0


class PlaceIndex:
    """A world as its community knows it. Routes are found once and kept.

    Parameters
    ----------
    world
        Where people are to live.
    date
        The day whose opening hours count.
    holidays
        Whether public holidays count. Jobs are planned without them.
    """

    def __init__(self, world: World, date: Date, *, holidays: bool = True) -> None:
        self.world = world
        self.date, self.holidays = date, holidays
        self.coordinates = world.manifest.origin.lat, world.manifest.origin.lon
        self.router = world.router
        self.walks = Walks.of(world)
        self.place_by_id = {p.id: p for p in world.places}
        self.buildings = {b.id: b for b in world.buildings}
        self.spot = {p.id: k for k, p in enumerate(world.places)}
        self._positions = np.array([p.position[:2] for p in world.places], float).reshape(-1, 2)
        self._names = np.array([p.id for p in world.places])
        self._rooms = PlaceRooms.of(world)
        # From the street to the farthest room: whoever has come that far is there, whatever the room.
        self._inside = self._rooms.inside
        self._estimates: LruCache[str, NDArray[np.int16]] = LruCache(_ESTIMATES)
        self._reachable: dict[str, bool] = {}
        self._lists: dict[Category | frozenset[str], NDArray[np.int64]] = {}
        self._hours: dict[tuple[str, Date, bool], list[Span]] = {}

    @property
    def weekday(self) -> int:
        """The day of the week whose customs hold, 0 Monday .. 6 Sunday: Sunday's on public holidays."""
        return customary_weekday(self.date, self.coordinates) if self.holidays else self.date.weekday()

    @cached_property
    def rides(self) -> RideTimes:
        """Trips by bus, tram and bicycle."""
        return RideTimes(self.world.transit, self.walks)

    def on(self, date: Date, *, holidays: bool = True) -> PlaceIndex:
        """Return the same index for another date; what is known of ways is shared."""
        if (date, holidays) == (self.date, self.holidays):
            return self
        _ = self.rides  # built once for all days
        other = copy.copy(self)
        other.date, other.holidays = date, holidays
        return other

    def in_same_week(self, weekday: int) -> PlaceIndex:
        """Return the same index for a day of its week, 0 Monday .. 6 Sunday."""
        return self.on(self.date + timedelta(days=weekday - self.date.weekday()), holidays=self.holidays)

    def reachable(self, place: Place) -> bool:
        """Whether a place can be reached on foot from the map's edge."""
        if place.id not in self._reachable:
            found = self.router.nearest_walkable(place.position[:2], within=_REACH)
            self._reachable[place.id] = found is not None
        return self._reachable[place.id]

    def places(self, categories: Iterable[Category] = tuple(Category)) -> list[Place]:
        """Reachable places of some categories, in the world's order."""
        wanted = set(categories)
        return [p for p in self.world.places if p.category in wanted and self.reachable(p)]

    def homes(self) -> tuple[list[Place], list[Place]]:
        """Dwellings, then places for guests.

        Raises
        ------
        EmptyInputError
            If there is no reachable accommodation at all.
        """
        found = self.places([Category.ACCOMMODATION])
        if not found:
            raise EmptyInputError(
                f"community: world {self.world.manifest.name!r} has no reachable accommodation among its "
                f"{len(self.world.places)} places; build a world with a larger --radius"
            )
        return (
            [p for p in found if kind_of(p) not in GUEST_KINDS],
            [p for p in found if kind_of(p) in GUEST_KINDS],
        )

    def beds(self, place: Place) -> int:
        """Return how many people can lie in the beds of a place: wide beds are for two."""
        return int(self._rooms.beds[self.spot[place.id]])

    def floor_area(self, place: Place) -> float:
        """Square metres of a place's rooms, without corridors, stairs and lifts."""
        return float(self._rooms.area[self.spot[place.id]])

    def seconds(self, a: str, b: str) -> float:
        """Seconds on foot between two places, at 1 m/s; infinite if there is no way.

        From the farthest room of the one over stairs and corridors to the street, and on to the farthest room of the
        other: no door leads from place to place, not even in one building.
        """
        if a == b:
            return 0.0
        return self.outdoors(a, b) + float(self._inside[self.spot[a]] + self._inside[self.spot[b]])

    def indoors(self, a: str) -> float:
        """Seconds on foot from the door of a place to its farthest room; 0 in the open."""
        return float(self._inside[self.spot[a]])

    def outdoors(self, a: str, b: str) -> float:
        """Seconds on foot between the doors of two places, at 1 m/s; infinite if there is no way."""
        return self.walks.between(self.place_by_id[a].position[:2], self.place_by_id[b].position[:2]).metres

    def minutes(self, a: str, b: str, pace: float = WALK_SPEED) -> int | None:
        """Minutes to allow for the walk between two places at a pace in m/s; None if there is no way.

        A twentieth and twenty seconds more than the route takes (doors, others on the pavement), in whole minutes.
        """
        seconds = self.seconds(a, b) / pace
        if seconds == 0:
            return 0
        return None if math.isinf(seconds) else math.ceil((seconds * 1.05 + 20) / 60)

    def estimate(self, a: str, b: str, pace: float = WALK_SPEED) -> int:
        """Minutes that a walk may take, before a route is asked for: streets are half as long again as the bee line."""
        if a == b:
            return 0
        inside = float(self._inside[self.spot[a]] + self._inside[self.spot[b]])
        return math.ceil(((self.metres(a, b) * 1.5 + inside * 1.05) / pace + 45) / 60)

    def estimates(self, a: str, spots: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return `estimate` from a place to several, given as numbers of places (`spot`); the shape is theirs."""
        known = self._estimates.get(a)
        if known is None:
            k = self.spot[a]
            far = distances(self._positions, self._positions[k])
            inside = self._inside + self._inside[k]
            minutes = np.ceil((far * 1.5 + inside * 1.05 + 45) / 60)
            known = np.minimum(minutes, _MOST_MINUTES).astype(np.int16)
            known[k] = 0
            self._estimates.keep(a, known)
        return known[spots].astype(np.int64)

    def metres(self, a: str, b: str) -> float:
        """Metres between two places as the crow flies: enough to tell near from far."""
        p, q = self.place_by_id[a].position, self.place_by_id[b].position
        return math.hypot(p[0] - q[0], p[1] - q[1])

    def metres_to(self, a: str, places: Sequence[Place]) -> NDArray[np.float64]:
        """Metres from a place to others as the crow flies, shape ``(len(places),)``."""
        spots = [self.spot[place.id] for place in places]
        return distances(self._positions[spots], self._positions[self.spot[a]])

    def by_nearness(self, a: str) -> list[Place]:
        """Reachable places, the nearest to a place first."""
        x, y = self.place_by_id[a].position[:2]
        reachable, numbers = self._all_reachable
        far = np.round(distances(self._positions[numbers], (x, y)), 3)
        return [reachable[k] for k in np.lexsort((self._names[numbers], far)).tolist()]

    def nearest(self, a: str, *wanted: tuple[Category | Collection[str], int]) -> list[str]:
        """Ids of the reachable places nearest to one: so many of each category, or of some kinds, in that order."""
        x, y = self.place_by_id[a].position[:2]
        reachable, numbers = self._all_reachable
        found: list[str] = []
        for what, count in wanted:
            among = self._among(what if isinstance(what, Category) else frozenset(what))
            far = np.round(distances(self._positions[numbers[among]], (x, y)), 3)
            if len(far) > count:
                near = np.flatnonzero(far <= np.partition(far, count - 1)[count - 1])
                among, far = among[near], far[near]
            order = np.lexsort((self._names[numbers[among]], far))[:count]
            found += [reachable[k].id for k in among[order].tolist()]
        return found

    def _among(self, what: Category | frozenset[str]) -> NDArray[np.int64]:
        """Return which of all reachable places are of a category, or of some kinds."""
        if what not in self._lists:
            places = self._all_reachable[0]
            of = [p.category is what if isinstance(what, Category) else p.kind in what for p in places]
            self._lists[what] = np.flatnonzero(of)
        return self._lists[what]

    @cached_property
    def _all_reachable(self) -> tuple[list[Place], NDArray[np.int64]]:
        """All places that can be reached, and their numbers."""
        reachable = self.places()
        return reachable, np.array([self.spot[p.id] for p in reachable], np.int64)

    def given_hours(self, place: Place) -> list[Span] | None:
        """Return the stated opening hours of the day, minutes; None if there are none, or none that can be read."""
        return stated_hours(place, self.date, self.coordinates, holidays=self.holidays)

    def hours(self, place: Place) -> list[Span]:
        """Return when a place is open on the day, minutes: what it says, else what is usual for its kind."""
        key = place.id, self.date, self.holidays
        if key not in self._hours:
            given = self.given_hours(place)
            self._hours[key] = usual_spans(kind_of(place), place.category, self.weekday) if given is None else given
        return self._hours[key]

    def spawn_points(self, homes: list[str]) -> list[Point2]:
        """Return a free spot by each home: reachable, off the carriageway, at least `SPAWN_GAP` from all others.

        Parameters
        ----------
        homes
            Place ids; one may occur several times.

        Raises
        ------
        EmptyInputError
            If there is no room near a home.
        """
        walkable = self.world.walkable
        standing = walkable.connected & (walkable.cls != ROADWAY) & (walkable.cls != CROSSING)
        found: list[Point2] = []
        for home in homes:
            centre = np.asarray(self.place_by_id[home].position[:2])
            for reach in (12.0, 40.0, 120.0):
                low, high = walkable.cell_of([centre - reach, centre + reach])
                window = standing[low[1] : high[1] + 1, low[0] : high[0] + 1]
                iy, ix = np.nonzero(window)
                if len(ix):
                    break
            else:
                raise EmptyInputError(
                    f"community: no room to stand within 120 m of {self.place_by_id[home].name!r} ({home}); "
                    "ask for fewer residents"
                )
            points = walkable.centre_of(np.column_stack([ix + low[0], iy + low[1]]))
            # The distance in whole millimetres first, then the position: ties break the same way everywhere.
            far = np.rint(np.linalg.norm(points - centre, axis=1) * 1000)
            x, y = points[np.lexsort((points[:, 0], points[:, 1], far))[0]].tolist()
            found.append((x, y))
            # Nobody else stands nearer than the gap.
            low, high = walkable.cell_of([(x - SPAWN_GAP, y - SPAWN_GAP), (x + SPAWN_GAP, y + SPAWN_GAP)])
            around = np.ix_(np.arange(low[1], high[1] + 1), np.arange(low[0], high[0] + 1))
            centres = walkable.centre_of(np.stack(np.meshgrid(around[1].ravel(), around[0].ravel()), axis=-1))
            standing[around] &= np.hypot(centres[..., 0] - x, centres[..., 1] - y) >= SPAWN_GAP
        return found


def kind_of(place: Place) -> str:
    """Return the place's kind, of several (``nightclub;restaurant``) the first, in lower case."""
    return place.kind.split(";")[0].strip().lower()
