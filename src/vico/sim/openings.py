"""Opening hours: which places are open to whom, and what is told to who finds a door shut."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date as Date

from vico.clock import DAY
from vico.community.hours import given_hours
from vico.community.model import ActivityTag, Resident
from vico.sim.appointments import Appointment
from vico.world.model import Place
from vico.world.opening_hours import DAYS, Coordinates, Span, is_within


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
            spans = given_hours(place, date, coordinates) if place.rooms else None
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
