"""Mode choice: who walks and who takes the bus, the tram or a bicycle; the least time, money and bother counts.

Days are planned on foot. Where a ride is worth it, one sets out later instead and stays longer where one is; so
nobody's day hangs on it, and who misses the bus or tram is late by some minutes at most.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vico.clock import DAY, clock_of, seconds_of_day
from vico.community.model import ActivityTag, Group, ItemType, Mode, Resident, ScheduleItem
from vico.community.people import ALONE_FROM
from vico.community.place_index import PlaceIndex, staffed_spans
from vico.community.ride_times import RideTrip
from vico.rules import BIKE_RATE, BUS_FARE, WALK_SPEED, walk_speed
from vico.world.model import Place

#: Seconds kept for doors and for others on the pavement when setting out, as for walks.
SETTING_OUT = 20.0
#: Seconds that one sets out sooner besides, which nobody minds: who stands somewhere on a square has farther to go, and
#: who comes to the stop seconds late waits for the next bus.
SOONER = {Mode.BUS: 60.0, Mode.TRAM: 60.0, Mode.BIKE: 0.0}
#: Seconds kept in hand at the end: buses and trams are up to two minutes late, bicycles are ridden around others.
RESERVE = {Mode.BUS: 120.0, Mode.TRAM: 120.0, Mode.BIKE: 60.0}
# Shorter ways are walked, seconds.
_SHORT = 6 * 60
#: A way may be planned with time to spare, but not with an hour of it: so many times what it takes ...
SLACK = 2.0
#: ... and so many seconds more.
SPARE = 10 * 60
_LEAST_PRICE = {Mode.BUS: BUS_FARE, Mode.TRAM: BUS_FARE, Mode.BIKE: BIKE_RATE}
# Who carries a hundred would spend two minutes to save one; who carries more, less.
_SECONDS_OF_MONEY = 12_000.0
# At these ages people cycle.
_CYCLISTS = (12, 74)
_TIRED_FROM = 60  # age in years from which on walks seem longer
_TIRED = 0.015  # share by which each year beyond makes a walk longer
_BOTHER = {Mode.BUS: 0.0, Mode.TRAM: 0.0, Mode.BIKE: 270.0}
# A second on foot counts like so many spent sitting, as people choose.
_ON_FOOT = 1.5


@dataclass(frozen=True)
class Habits:
    """Costs of getting about for one person, in seconds of their time spent sitting.

    Attributes
    ----------
    walking
        Of a second on foot.
    money
        Of a unit of money.
    bother
        Of a ride as such, by mode; modes they don't use are missing.
    """

    walking: float
    money: float
    bother: dict[Mode, float]

    @classmethod
    def of(cls, resident: Resident, chance: np.random.Generator) -> Habits:
        """Draw somebody's habits from their age, money and character."""
        character = resident.personality
        off_bus, off_bike = chance.normal(0.0, 60.0), chance.normal(0.0, 120.0)
        # Who minds others in a bus minds them in a tram.
        bother = {mode: _BOTHER[mode] + float(off_bus) for mode in (Mode.BUS, Mode.TRAM)}
        if _CYCLISTS[0] <= resident.age <= _CYCLISTS[1]:
            # Among cars the anxious would rather walk; the open-minded cycle.
            mind = 150.0 * (character.neuroticism - character.openness)
            bother[Mode.BIKE] = _BOTHER[Mode.BIKE] + mind + float(off_bike)
        walking = _ON_FOOT + _TIRED * max(0, resident.age - _TIRED_FROM)
        return cls(walking, _SECONDS_OF_MONEY / max(resident.cash, 1), bother)

    def of_walk(self, seconds: float) -> float:
        """Return what a walk costs."""
        return seconds * self.walking

    def of_ride(self, mode: Mode, seconds: float, price: float) -> float:
        """Return what a ride costs of so many seconds from door to door, those on foot counted as `walking` has it."""
        return seconds + price * self.money + self.bother[mode]


def first_ride(index: PlaceIndex, ends: tuple[str, str], mode: Mode, times: tuple[float, float], cash: float) -> float:
    """Return the second of the day at which somebody is at a place who sets out by bus, tram or bicycle at one.

    From the farthest room of the one place to the farthest room of the other; infinite if there is no such ride.

    Parameters
    ----------
    times
        When they set out, and when they want to be there: if one ride is enough for that, it is taken; else they may
        change.
    """
    set_out, due = times
    a, b = (index.place_by_id[end] for end in ends)
    depart = set_out + index.indoors(a.id)
    ride = index.rides.first((a.position[:2], b.position[:2]), mode, depart, cash)
    if ride is not None and ride.arrive + index.indoors(b.id) <= due:
        return ride.arrive + index.indoors(b.id)
    trip = index.world.trips.plan(a.position[:2], b.position[:2], depart, modes=(mode.value,), cash=cash)
    arrivals = [found.arrive + index.indoors(b.id) for found in (ride, trip) if found is not None]
    return min(arrivals, default=math.inf)


class _Racks:
    """Bicycles and free places at each station, minute by minute: what the community has planned so far is taken."""

    def __init__(self, index: PlaceIndex) -> None:
        stations = index.world.transit.bike_stations
        self._number = {station.id: k for k, station in enumerate(stations)}
        self._bikes = np.array([[station.bikes] * (DAY // 60 + 1) for station in stations], np.int64)
        self._most = np.array([station.capacity for station in stations], np.int64)

    def serve(self, ride: RideTrip) -> bool:
        """Take the bicycle and the place for a ride; False, and nothing taken, where there is none to the day's end."""
        a, b = self._number[ride.origin], self._number[ride.destination]
        gone, back = (min(int(second) // 60, DAY // 60) for second in (ride.taken, ride.left))
        if self._bikes[a, gone:].min() < 1 or self._bikes[b, back:].max() >= self._most[b]:
            return False
        self._bikes[a, gone:] -= 1
        self._bikes[b, back:] += 1
        return True


def with_rides(
    residents: Sequence[Resident],
    groups: Sequence[Group],
    index: PlaceIndex,
    stream: Callable[[str], np.random.Generator],
) -> list[Resident]:
    """Put rides with buses, trams or bicycles into days where they cost residents less than to walk.

    Parameters
    ----------
    residents
        With their days on foot.
    groups
        When they meet; those times stay.
    index
        Places, ways and hours.
    stream
        Gives each resident's random stream, by id.
    """
    if not index.rides.any:
        return list(residents)
    meetings: set[tuple[str | None, str, str]] = {(group.place, group.start, group.end) for group in groups}
    # Small children and who comes along walk.
    ways_with_children = {
        (child.household, way.start, then.place)
        for child in residents
        if child.age < ALONE_FROM
        for way, then in pairwise(child.schedule)
        if way.type is ItemType.COMMUTE
    }
    means = _Means(index, _Racks(index), meetings, ways_with_children)
    return [
        resident.model_copy(update={"schedule": means.day(resident, Habits.of(resident, stream(resident.id)))})
        for resident in residents
    ]


@dataclass(frozen=True)
class _Ride:
    """A ride somebody may take: what it costs them, and when they set out, second of the day."""

    mode: Mode
    trip: RideTrip
    cost: float
    set_out: int


@dataclass(frozen=True)
class _Means:
    """Means of transport of a world.

    Attributes
    ----------
    meetings
        Place, start and end of all meetings.
    on_foot
        Household, start and goal of the ways that are walked in any case.
    """

    index: PlaceIndex
    racks: _Racks
    meetings: set[tuple[str | None, str, str]]
    on_foot: set[tuple[str | None, str, str | None]]

    def day(self, resident: Resident, habits: Habits) -> list[ScheduleItem]:
        """Return a resident's day, with rides where they are worth it."""
        old = resident.schedule
        items: list[ScheduleItem] = []
        for k, item in enumerate(old):
            if item.type is not ItemType.COMMUTE or not 0 < k < len(old) - 1 or self._walks(resident, item, old[k + 1]):
                items.append(item)
                continue
            ends = self.index.place_by_id[items[-1].place or ""], self.index.place_by_id[old[k + 1].place or ""]
            ride = self._best(resident, habits, ends, item)
            stays = ride is not None and self._may_stay(resident, items[-1], ride.set_out)
            too_soon = ride is not None and not stays and self._would_idle(resident, ends, item, ride.mode)
            if ride is None or too_soon or not self._is_to_be_had(ride):
                items.append(item)
                continue
            stay = items.pop()
            set_out = clock_of(ride.set_out) if stays else item.start
            items += self._longer(stay, set_out)
            how = "Cycle" if ride.mode is Mode.BIKE else f"Take the {ride.mode}"
            words = f"{how} home" if ends[1].id == resident.home else f"{how} to {ends[1].name}"
            items.append(item.model_copy(update={"start": set_out, "mode": ride.mode, "activity": words}))
        return items

    def _walks(self, resident: Resident, way: ScheduleItem, then: ScheduleItem) -> bool:
        """Return whether somebody goes with small children."""
        return resident.household is not None and (resident.household, way.start, then.place) in self.on_foot

    def _best(self, resident: Resident, habits: Habits, ends: tuple[Place, Place], way: ScheduleItem) -> _Ride | None:
        """Return the ride that costs somebody least on a way; None where to walk costs no more."""
        walk = 60 * (self.index.minutes(ends[0].id, ends[1].id, walk_speed(resident.age)) or 0)
        if walk < _SHORT:
            return None
        found: list[_Ride] = []
        most = habits.of_walk(walk)
        indoors = self.index.indoors(ends[0].id) + self.index.indoors(ends[1].id)
        for mode in habits.bother:
            # Who has to set out earlier than this loses more than is won.
            spare = most - habits.of_ride(mode, (habits.walking - 1.0) * indoors, _LEAST_PRICE[mode])
            not_before = max(seconds_of_day(way.end) - spare, seconds_of_day(way.start) + SOONER[mode])
            trip = self.index.rides.last(
                (ends[0].position[:2], ends[1].position[:2]),
                mode,
                (
                    not_before + self.index.indoors(ends[0].id) + SETTING_OUT,
                    seconds_of_day(way.end) - self.index.indoors(ends[1].id) - RESERVE[mode],
                ),
                float(resident.cash),
            )
            if trip is None:
                continue
            set_out = trip.depart - self.index.indoors(ends[0].id) - SETTING_OUT
            on_foot = trip.walked / WALK_SPEED + indoors
            seconds = seconds_of_day(way.end) - set_out + (habits.walking - 1.0) * on_foot
            cost = habits.of_ride(mode, seconds, trip.price)
            if cost < most:
                # Schedules have whole minutes.
                leave = max(seconds_of_day(way.start), math.floor((set_out - SOONER[mode]) / 60) * 60)
                found.append(_Ride(mode, trip, cost, leave))
        return min(found, key=lambda ride: ride.cost, default=None)

    def _would_idle(self, resident: Resident, ends: tuple[Place, Place], way: ScheduleItem, mode: Mode) -> bool:
        """Return whether who sets out at once would be there so early that nobody plans like that."""
        start, end = seconds_of_day(way.start), seconds_of_day(way.end)
        there = first_ride(self.index, (ends[0].id, ends[1].id), mode, (start, end), resident.cash)
        return end - start > SLACK * (there - start) + SPARE

    def _is_to_be_had(self, ride: _Ride) -> bool:
        """Take the bicycle for a ride; False where others have planned with it."""
        return ride.mode is not Mode.BIKE or self.racks.serve(ride.trip)

    def _may_stay(self, resident: Resident, item: ScheduleItem, until: int) -> bool:
        """Return whether somebody may be where they are until a second of the day."""
        if item.place is None or item.place == resident.home:
            return True
        hours = self.index.hours(self.index.place_by_id[item.place])
        spans = staffed_spans(hours) if item.place == resident.workplace else hours
        return any(60 * a <= seconds_of_day(item.start) and until <= 60 * b for a, b in spans)

    def _longer(self, item: ScheduleItem, until: str) -> list[ScheduleItem]:
        """Stay until a time; meetings end when they end."""
        if item.end == until:
            return [item]
        if (item.place, item.start, item.end) not in self.meetings:
            return [item.model_copy(update={"end": until})]
        chat = {"type": ItemType.MAIN, "start": item.end, "end": until, "activity": "Chat a little longer"}
        return [item, item.model_copy(update=chat | {"tag": ActivityTag.GROUP})]
