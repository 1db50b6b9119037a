"""Residents' schedules on the simulation's clock: where they start, where they are due, and whether they made it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY, seconds_of_day
from vico.community.model import ItemType, ScheduleItem
from vico.sim.simulation_state import SimulationState
from vico.sim.state import ArrayState

# Somebody who comes up to a minute after the hour is not called late.
GRACE = 60
# An open place is reached when its position is this near, metres.
OPEN_REACH = 5.0


@dataclass(frozen=True)
class Appointment:
    """Being at a place from `due` until `until`, seconds of the day."""

    place: int
    due: int
    until: int


@dataclass(frozen=True)
class Whereabouts:
    """Where a schedule says someone is: at `place`, or `share` of the way from `origin` to it."""

    place: int
    origin: int
    share: float


def appointments(schedule: Sequence[ScheduleItem], places: dict[str, int]) -> list[Appointment]:
    """Return the stays of a day, neighbours at one place joined, travel left out."""
    stays: list[Appointment] = []
    for item in schedule:
        if item.type is ItemType.COMMUTE or item.place is None or item.place not in places:
            continue
        place, due = places[item.place], seconds_of_day(item.start)
        until = seconds_of_day(item.end)
        if stays and stays[-1].place == place:
            stays[-1] = Appointment(place, stays[-1].due, until)
        else:
            stays.append(Appointment(place, due, until))
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


@dataclass
class Punctuality(ArrayState):
    """Who is due where next, and how it went so far.

    Attributes
    ----------
    place, due, until
        Stays of all residents end to end; those of resident ``i`` are ``start[i]`` up to ``start[i + 1]``.
    following
        Index of the stay each resident is due at next (its row in `place`).
    told
        Whether it has been noted that the next stay began without the resident.
    arrivals, late
        Stays reached so far, and stays that began without the resident by more than `GRACE` seconds.
    """

    place: NDArray[np.int32]
    due: NDArray[np.int64]
    until: NDArray[np.int64]
    start: NDArray[np.int64]
    following: NDArray[np.int64]
    told: NDArray[np.bool_]
    arrivals: NDArray[np.int64]
    late: NDArray[np.int64]

    @classmethod
    def of(cls, days: Sequence[Sequence[Appointment]], second: int) -> Punctuality:
        """Start watching at a second of the day: stays under way are taken as reached."""
        rows = [stay for day in days for stay in day]
        start = np.cumsum([0, *(len(day) for day in days)]).astype(np.int64)
        due = np.array([stay.due for stay in rows], np.int64)
        following = np.array(
            [start[i] + sum(stay.due <= second for stay in day) for i, day in enumerate(days)], np.int64
        )
        n = len(days)
        return cls(
            np.array([stay.place for stay in rows], np.int32),
            due,
            np.array([stay.until for stay in rows], np.int64),
            start,
            following,
            np.zeros(n, bool),
            np.zeros(n, np.int64),
            np.zeros(n, np.int64),
        )

    def watch(self, state: SimulationState) -> None:
        """Note arrivals and failures to arrive, as events and in the counts."""
        second = state.second % DAY
        for i in range(len(self.following)):
            k = int(self.following[i])
            if k >= self.start[i + 1]:
                continue
            index = int(self.place[k])
            place = state.world.places[index]
            name, position = state.people.names[i], state.people.position[i]
            is_late = second > self.due[k] + GRACE
            if is_late and not self.told[i]:
                self.told[i] = True
                self.late[i] += 1
                state.events.add("late", name, f"is late for {place.name}", position, place=place.id)
            if self._is_there(i, index, state):
                behind = float(second - self.due[k])
                self.arrivals[i] += 1
                state.events.add(
                    "arrival", name, f"arrives at {place.name}", position, place=place.id, seconds_late=behind
                )
            elif second <= self.until[k]:
                continue
            self.following[i] += 1
            self.told[i] = False

    def _is_there(self, i: int, index: int, state: SimulationState) -> bool:
        place = state.world.places[index]
        if place.rooms:
            return bool(state.people.place[i] == index)
        away = np.hypot(*(state.people.position[i, :2] - np.array(place.position[:2])))
        return bool(state.people.room[i] < 0 and away <= OPEN_REACH)
