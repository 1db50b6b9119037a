"""When places are open and staffed: their own hours where the map says them, the usual ones of their kind elsewhere.

Usual hours are data: ``vico/data/community/hours.toml`` and a user's own files.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date as Date
from pathlib import Path

from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.world.model import Place
from vico.world.opening_hours import DAYS, MINUTES, Coordinates, Span, customary_weekday, open_spans, weekly_hours

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
    """When a place of this kind is usually open on a day, minutes; empty where it is closed.

    Parameters
    ----------
    weekday
        0 Monday .. 6 Sunday; a working day unless given.
    """
    usual = usual_hours()
    week = usual.by_kind.get(kind) or usual.by_kind.get(category, usual.otherwise)
    return list(week[weekday])


def given_hours(place: Place, date: Date, coordinates: Coordinates, *, holidays: bool = True) -> list[Span] | None:
    """When a place says that it is open on a date, minutes; None if it says nothing that can be read.

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
    """When a place is open on a date, minutes: what it says, else what is usual for its kind."""
    given = given_hours(place, date, coordinates)
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


def staffed(spans: Sequence[Span]) -> list[Span]:
    """Return from when until when staff may be at a place with these opening hours, minutes of the day."""
    return [
        (min(start for start, _ in stretch) - STAFF_MARGIN, max(end for _, end in stretch) + STAFF_MARGIN)
        for stretch in staffed_stretches(spans)
    ]
