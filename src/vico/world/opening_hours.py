"""Opening hours: what a value of OSM's `opening_hours` means on a date at a place.

The library `opening-hours-py` reads the whole specification, knows the public holidays of countries and the sun. This
module asks it, turns its answers into minutes of a day, and says of every value how it was read.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from datetime import date as Date
from datetime import datetime, timedelta
from functools import lru_cache
from typing import Literal

import opening_hours as library

from vico.world.hours_spelling import DAY, in_specification
from vico.world.hours_spelling import DAYS as DAYS

MINUTES = 24 * 60

#: Open from, until, in minutes of the day; `until` may lie past midnight.
Span = tuple[int, int]

#: Latitude and longitude of a place, degrees.
Coordinates = tuple[float, float]

# What is open past midnight until noon at most closes late; what is open longer has hours of the next day.
_LATEST = 12 * 60
# A week is an ordinary one if its days have these hours on so many of the year's dates.
_ORDINARY_SHARE = 0.9
# Any year without a rule of its own does: the weeks of this one are looked at for what is usual.
_ORDINARY_YEAR = 2026
_SUN = re.compile(r"sunrise|sunset|dawn|dusk", re.I)
_NOON = 12 * 60

# "Mo, Tu 10:00-12:00" lists days; by the letter of the specification its first rule would be "Mo", round the clock.
_SPACED_LIST = re.compile(rf"\b({DAY}),\s+(?={DAY}\b)")
# Times outside comments, each alone and as spans.
_TIME = r"(?<!\d)(\d{1,2}):(\d{2})(?!:?\d)"
_ONE_TIME = re.compile(_TIME)
_FROM_UNTIL = re.compile(rf"{_TIME}\s*-\s*{_TIME}(\s*(?:off|closed)\b)?", re.I)
_COMMENT = re.compile('("[^"]*")')
# Comments that say that the hours are for those alone who asked before.
_ON_REQUEST = (
    r"(?:only )?(?:(?:by|on|upon|with) (?:prior )?(?:appointment|request|arrangement|reservation|booking)|"
    r"(?:nur )?(?:nach|auf|mit) (?:[\w.]+ )?(?:vereinbarung|absprache|anmeldung|anfrage|termin(?:vereinbarung)?)|"
    r"(?:uniquement )?sur (?:rendez-vous|rdv|r[eé]servation|demande)|con (?:cita(?: previa)?|reserva)|"
    r"(?:solo )?su (?:appuntamento|prenotazione)|op afspraak)(?: only)?[.!]?"
)
# Any other comment beside hours is a remark ("Lunch"), with "open" or without. Quotes pair up behind it.
_REMARK = re.compile(
    rf'((?:\d:\d\d\+?|24/7|\)|sunrise|sunset|dawn|dusk))\s*(?:open\s*)?"(?!{_ON_REQUEST}")[^"]*"'
    r'(?=(?:[^"]*"[^"]*")*[^"]*$)',
    re.I,
)
_RULE = re.compile(r'([;,]|\|\||^)((?:"[^"]*"|[^";,|])*)')
_SAYS_NOTHING = re.compile(r'\s*(?:unknown)?\s*(?:"[^"]*")?\s*', re.I)


def _without_remarks(text: str) -> str:
    """Return a value without comments beside hours, and without rules that are comments alone beside other rules.

    By the letter "by appointment" would override all rules before it. People mean: at other times.
    """
    rules = [(separator, rule.rstrip()) for separator, rule in _RULE.findall(_REMARK.sub(r"\1", text))]
    said = [(separator, rule) for separator, rule in rules if not _SAYS_NOTHING.fullmatch(rule)] or rules
    return "".join((separator if k else "") + rule for k, (separator, rule) in enumerate(said)).strip()


@lru_cache(maxsize=16384)
def _readable(text: str) -> str | None:
    """Return a value as the library takes it: as typed, else respelled; None where neither can be read."""
    for candidate in (text.strip(), in_specification(text)):
        if candidate and library.validate(candidate):
            return _without_remarks(_SPACED_LIST.sub(r"\1,", candidate))
    return None


def how_read(text: str) -> Literal["as typed", "respelled", "not read"]:
    """Say how a value of `opening_hours` is read: as typed, in the specification's spelling instead, or not at all."""
    readable = _readable(text)
    if readable is None:
        return "not read"
    return "as typed" if library.validate(text.strip()) else "respelled"


def respelled(text: str) -> str:
    """Return the spelling in which a value is read, or the value itself where it can't be read."""
    return _readable(text) or text


def _clock(minutes: int) -> str:
    return f"{minutes // 60:02d}:{minutes % 60:02d}"


def _within_days(text: str) -> tuple[str, list[int]] | None:
    """Return a value whose spans all end on the day they begin, and the minutes that its times stand for.

    The library takes what is open past midnight from the hours of the next day: it forgets it where another rule
    decides the next day, and leaves it where the day it began is off. So the times of a value, those past midnight
    counted on, are put in order and stand as the minutes after noon: the k-th for k minutes. None where times follow
    the sun, or where a value closes by night.
    """
    if _SUN.search(text):
        return None
    pieces, moments = _COMMENT.split(text), set[int]()

    def with_end(found: re.Match[str]) -> str:
        hour, minute, to_hour, to_minute, closing = found.groups()
        begin, end = int(hour) * 60 + int(minute), int(to_hour) * 60 + int(to_minute)
        return f"{_clock(begin)}-{_clock(end if end > begin else end + MINUTES)}{closing or ''}"

    pieces[::2] = [_FROM_UNTIL.sub(with_end, piece) for piece in pieces[::2]]
    for piece in pieces[::2]:
        if any(
            closing and (int(hour), int(minute)) > (24, 0) for *_, hour, minute, closing in _FROM_UNTIL.findall(piece)
        ):
            return None
        moments |= {int(hour) * 60 + int(minute) for hour, minute in _ONE_TIME.findall(piece)}
    order = sorted(moments)

    def ranked(found: re.Match[str]) -> str:
        return _clock(_NOON + order.index(int(found[1]) * 60 + int(found[2])))

    pieces[::2] = [_ONE_TIME.sub(ranked, piece) for piece in pieces[::2]]
    return "".join(pieces), order


class _Calendar:
    """A readable value at a place, asked for what is open on dates."""

    def __init__(self, text: str, coordinates: Coordinates | None, holidays: bool) -> None:
        self._text = text
        asked, moments = _within_days(text) or (text, None)
        self._moments: list[int] | None = moments
        # Hours by the clock need no time zone: in some, clocks are put forward at midnight, and a day begins at one.
        self._hours = library.OpeningHours(
            asked, coords=coordinates, auto_country=holidays, auto_timezone=moments is None
        )

    def _is_open(self, state: library.State, comment: str) -> bool:
        # A comment beside no `open` makes a day unknown by the specification ("by appointment"); the library says open.
        commented = comment != "" and not re.search(rf'\bopen\s*"{re.escape(comment)}"', self._text)
        return state == library.State.OPEN and not commented

    def _by_the_clock(self, low: datetime, high: datetime) -> list[tuple[datetime, datetime]]:
        """Return what an answer of the library stands for, day by day."""
        if self._moments is None:
            return [(low, high)]
        found: list[tuple[datetime, datetime]] = []
        while low < high:
            day = datetime(low.year, low.month, low.day)
            until = min(high, day + timedelta(days=1))
            begin = 0 if low == day else self._moments[low.hour * 60 + low.minute - _NOON]
            end = (
                MINUTES if until > day + timedelta(hours=23) else self._moments[until.hour * 60 + until.minute - _NOON]
            )
            if begin < end:
                found.append((day + timedelta(minutes=begin), day + timedelta(minutes=end)))
            low = until
        return found

    def open_between(self, first: Date, days: int) -> list[tuple[datetime, datetime]]:
        """Return what begins within some days, local time; what lies back to back is one interval."""
        start = datetime(first.year, first.month, first.day)
        spans: list[tuple[datetime, datetime]] = []
        for low, high, state, comment in self._hours.intervals(start, start + timedelta(days=days)):
            if self._is_open(state, comment):
                spans += self._by_the_clock(low.replace(tzinfo=None), high.replace(tzinfo=None))
        found: list[tuple[datetime, datetime]] = []
        for low, high in sorted(spans):
            if found and found[-1][1] >= low:
                found[-1] = (found[-1][0], max(found[-1][1], high))
            else:
                found.append((low, high))
        return found

    def is_closed_on(self, date: Date) -> bool:
        """Whether it is closed for certain all day."""
        start = datetime(date.year, date.month, date.day)
        states = [state for _, _, state, _ in self._hours.intervals(start, start + timedelta(days=1))]
        return all(state == library.State.CLOSED for state in states)

    def spans_by_day(self, first: Date, days: int) -> list[list[Span]]:
        """Return the hours of some days in a row: what begins on each, minutes of the day."""
        result: list[list[Span]] = [[] for _ in range(days)]
        start = datetime(first.year, first.month, first.day) - timedelta(days=1)
        for low, high in self.open_between(first - timedelta(days=1), days + 2):
            begin, end = (round((moment - start).total_seconds() / 60) for moment in (low, high))
            while begin < end:
                midnight = (begin // MINUTES + 1) * MINUTES
                # Hours that go on beyond the next noon are cut where the day ends: the rest are the next day's.
                until = end if end <= midnight + _LATEST else midnight
                if 0 <= (day := begin // MINUTES - 1) < days:
                    result[day].append((begin % MINUTES, until - (day + 1) * MINUTES))
                begin = until
        return result


@lru_cache(maxsize=16384)
def _calendar(text: str, coordinates: Coordinates | None, holidays: bool) -> _Calendar | None:
    readable = _readable(text)
    return None if readable is None else _Calendar(readable, coordinates, holidays)


@lru_cache(maxsize=16384)
def _only_exceptions(text: str, coordinates: Coordinates | None, year: int) -> bool:
    """Whether a value never opens a place in a year: it names closings alone, or hours that are unknown."""
    calendar = _calendar(text, coordinates, True)
    return calendar is not None and not calendar.open_between(Date(year, 1, 1), 366)


@lru_cache(maxsize=65536)
def _spans(text: str, date: Date, coordinates: Coordinates | None, holidays: bool) -> tuple[Span, ...] | None:
    calendar = _calendar(text, coordinates, holidays)
    if calendar is None:
        return None
    if _only_exceptions(text, coordinates, date.year):
        # "PH off" says when a place is closed and nothing of other days.
        otherwise_open = _calendar(f"24/7; {_readable(text)}", coordinates, holidays)
        return () if otherwise_open is not None and otherwise_open.is_closed_on(date) else None
    before, own = calendar.spans_by_day(date - timedelta(days=1), 2)
    spill = [(0, end - MINUTES) for _, end in before if end > MINUTES]
    return tuple(sorted(spill + own))


def open_spans(
    text: str, date: Date, coordinates: Coordinates | None = None, *, holidays: bool = True
) -> list[Span] | None:
    """When a place is open on a date, by its `opening_hours`.

    Parameters
    ----------
    text
        A value of OSM's `opening_hours`, for example ``Mo-Fr 08:00-20:00; Sa,Su 10:00-16:00; PH off``.
    date
        The day.
    coordinates
        Latitude and longitude, degrees: they decide which public holidays there are and when the sun rises. Without
        them there are no public holidays, and the sun rises at 7:00 and sets at 19:00.
    holidays
        Whether public holidays count.

    Returns
    -------
    list of Span or None
        Sorted; what spills over from the day before comes first, and hours that reach past midnight are kept whole.
        A comment beside hours is a remark, unless it says "by appointment": such days, and days with a comment instead
        of hours, are not open. None where nothing is known: the value can't be read, names only closings that are not
        on this date, or no hours.
    """
    found = _spans(text, date, coordinates, holidays)
    return None if found is None else list(found)


def weekly_hours(text: str) -> list[list[Span]] | None:
    """Return the hours of an ordinary week.

    Parameters
    ----------
    text
        A value of OSM's `opening_hours`.

    Returns
    -------
    list of list of Span or None
        For each day, Monday first, the spans that begin on it. None if the value can't be read, or if there is no
        ordinary week: the hours follow the sun, the season or the number of the week, or nothing is said of them.
    """
    calendar = _calendar(text, None, False)
    if calendar is None or _SUN.search(text) or _only_exceptions(text, None, _ORDINARY_YEAR):
        return None
    first = Date(_ORDINARY_YEAR, 1, 1)
    by_day = calendar.spans_by_day(first, 52 * 7)
    week: list[list[Span]] = []
    for weekday in range(7):
        days = by_day[(weekday - first.weekday()) % 7 :: 7]
        usual, dates = Counter(tuple(day) for day in days).most_common(1)[0]
        if dates < _ORDINARY_SHARE * len(days):
            return None
        week.append(list(usual))
    return week


@lru_cache(maxsize=4096)
def is_public_holiday(date: Date, coordinates: Coordinates) -> bool:
    """Whether a date is a public holiday of the country that a place lies in, as far as the library knows."""
    calendar = _calendar("PH", coordinates, True)
    return calendar is not None and bool(calendar.open_between(date, 1))


def customary_weekday(date: Date, coordinates: Coordinates) -> int:
    """Return the day of the week whose customs hold on a date, 0 Monday .. 6 Sunday: Sunday's on public holidays."""
    return 6 if is_public_holiday(date, coordinates) else date.weekday()


def is_within(spans: Sequence[Span], minute: float) -> bool:
    """Return whether a minute of the day, 0..1440, lies in one of some spans, those of the day before included."""
    return any(start <= minute < end or start <= minute + MINUTES < end for start, end in spans)
