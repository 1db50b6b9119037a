"""Punctuality: residents' schedules on the simulation's clock, where they are due, and whether they made it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY
from vico.community.model import Mode
from vico.geometry import distances
from vico.sim.bodies.state_arrays import FIRST_TRAM, ArrayState, Vehicle
from vico.sim.state.base import Appointment
from vico.sim.state.simulation_state import SimulationState

# Somebody who comes up to a minute after the hour is not called late.
GRACE = 60
# An open place is reached when its position is this near, metres.
OPEN_REACH = 5.0
#: Ways to get about, by number.
MODES = tuple(Mode)
# Who was in a bus at all came by bus, of the others who was in a tram by tram: a way's mode by the bits of `rode`.
_IN_BUS, _ON_BIKE, _IN_TRAM = 1, 2, 4
_MADE = tuple(
    MODES.index(
        Mode.BUS if bits & _IN_BUS else Mode.TRAM if bits & _IN_TRAM else Mode.BIKE if bits & _ON_BIKE else Mode.WALK
    )
    for bits in range(8)
)
#: Seconds late that are told apart begin here (who is earlier counts as this early), and end there.
EARLIEST, _LATEST = -300, 1800


@dataclass
class Punctuality(ArrayState):
    """Next appointments of everybody, and how it went so far.

    Attributes
    ----------
    place, due, until
        Stays of all residents end to end; those of resident ``i`` are ``start[i]`` up to ``start[i + 1]``.
    following
        Index of the stay each resident is due at next (its row in `place`).
    day
        Days since the first on which that stay is: schedules come again every day.
    told
        Whether it has been noted that the next stay began without the resident.
    rode
        In what each resident was since the last stay was reached, the sum of: 1 a bus, 2 a bicycle, 4 a tram.
    meant
        By what the way to each stay is to be made, a number of `MODES`.
    trips
        Stays reached, by how the way was meant and how it was made, shape ``(MODES, MODES)``.
    lateness
        Of ways by how they were made: how many took each number of seconds more than the schedule gives, from
        `EARLIEST`; shape ``(MODES, seconds)``.
    arrivals, late
        Stays reached so far, and stays that began without the resident by more than `GRACE` seconds.
    """

    place: NDArray[np.int32]
    due: NDArray[np.int64]
    until: NDArray[np.int64]
    start: NDArray[np.int64]
    following: NDArray[np.int64]
    day: NDArray[np.int64]
    told: NDArray[np.bool_]
    rode: NDArray[np.int8]
    meant: NDArray[np.int8]
    trips: NDArray[np.int64]
    lateness: NDArray[np.int32]
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
        made = cls(
            np.array([stay.place for stay in rows], np.int32),
            due,
            np.array([stay.until for stay in rows], np.int64),
            start,
            following,
            np.zeros(n, np.int64),
            np.zeros(n, bool),
            np.zeros(n, np.int8),
            np.array([MODES.index(stay.mode) for stay in rows], np.int8),
            np.zeros((len(MODES), len(MODES)), np.int64),
            np.zeros((len(MODES), _LATEST - EARLIEST + 1), np.int32),
            np.zeros(n, np.int64),
            np.zeros(n, np.int64),
        )
        for i in range(n):
            made._wrap(i)
        return made

    def watch(self, state: SimulationState) -> None:
        """Note arrivals and failures to arrive, as events and in the counts."""
        n = len(self.rode)
        vehicles, trams = state.people.vehicle[:n], state.people.vehicle_entity[:n] >= FIRST_TRAM
        self.rode[vehicles == Vehicle.BIKE] |= _ON_BIKE
        self.rode[(vehicles == Vehicle.BUS) & ~trams] |= _IN_BUS
        self.rode[(vehicles == Vehicle.BUS) & trams] |= _IN_TRAM
        some = np.flatnonzero(self.start[1:] > self.start[:-1])
        rows, shift = self.following[some], DAY * self.day[some]
        places = self.place[rows]
        late = (state.second > self.due[rows] + shift + GRACE) & ~self.told[some]
        there = self._are_there(some, places, state)
        for n in np.flatnonzero(late | there | (state.second > self.until[rows] + shift)).tolist():
            i, k = int(some[n]), int(rows[n])
            place = state.world.places[int(places[n])]
            name, position = state.people.names[i], state.people.position[i]
            if late[n]:
                self.told[i] = True
                self.late[i] += 1
                state.events.add("late", name, f"is late for {place.name}", position, place=place.id)
            if there[n]:
                behind = float(state.second - self.due[k] - shift[n])
                self.arrivals[i] += 1
                made = _MADE[self.rode[i]]
                self.trips[self.meant[k], made] += 1
                self.lateness[made, min(max(round(behind), EARLIEST), _LATEST) - EARLIEST] += 1
                self.rode[i] = 0
                how = {"seconds_late": behind, "mode": MODES[made].value}
                state.events.add("arrival", name, f"arrives at {place.name}", position, place=place.id, **how)
            elif state.second <= self.until[k] + shift[n]:
                continue
            self.following[i] += 1
            self.told[i] = False
            self._wrap(i)

    def by_mode(self) -> dict[str, dict[str, int]]:
        """Return what became of ways, by how they were made.

        Returns
        -------
        dict
            Of each mode: ``made``; ``meant``, ways that were to be made so and were made, however; ``on_time``, made
            no more than `GRACE` seconds late; ``late_median`` and ``late_p90``, seconds, where any was made.
        """
        found: dict[str, dict[str, int]] = {}
        for mode, name in enumerate(MODES):
            counts = np.cumsum(self.lateness[mode])
            made = int(counts[-1])
            found[name.value] = {
                "made": made,
                "meant": int(self.trips[mode].sum()),
                "on_time": int(counts[GRACE - EARLIEST]),
            }
            if made:
                for what, share in (("late_median", 0.5), ("late_p90", 0.9)):
                    found[name.value][what] = EARLIEST + int(np.searchsorted(counts, share * made))
        return found

    def _wrap(self, i: int) -> None:
        """Go on with the next day's stays after a day's last; who ends it where it began is there already."""
        first, end = int(self.start[i]), int(self.start[i + 1])
        if first < end == self.following[i]:
            self.day[i] += 1
            stays_on = end - first > 1 and self.place[first] == self.place[end - 1]
            self.following[i] = first + stays_on

    @staticmethod
    def _are_there(who: NDArray[np.int64], places: NDArray[np.int32], state: SimulationState) -> NDArray[np.bool_]:
        """Whether each is at a place: in one of its rooms, or near an open one; shape ``(who,)``."""
        people = state.people
        away = distances(people.position[who, :2], state.base.place_spots[places])
        near = (people.room[who] < 0) & (away <= OPEN_REACH)
        return np.where(state.base.has_rooms[places], people.place[who] == places, near)
