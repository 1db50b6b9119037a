"""Residents' schedules as stays: where each puts them at what time of the day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from vico.clock import seconds_of_day
from vico.community.model import ItemType, Mode, ScheduleItem


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
