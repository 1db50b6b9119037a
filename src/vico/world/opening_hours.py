"""Opening hours: what a value of OSM's `opening_hours` means on a date at a place.

The library `opening-hours-py` reads the whole specification, knows the public holidays of countries and the sun. This
module asks it, turns its answers into minutes of a day, and says of every value how it was read.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import date as Date
from datetime import datetime, timedelta
from datetime import time as Time
from functools import lru_cache
from typing import Literal

import opening_hours as library

DAYS = ("Mo", "Tu", "We", "Th", "Fr", "Sa", "Su")
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
_SUN = re.compile(r"sunrise|sunset|dawn|dusk")

# Spellings that people use and the specification does not know, tried only where it refuses a value as it is typed.
_DAY = "(?:Mo|Tu|We|Th|Fr|Sa|Su|PH|SH)"
_DAY_NAMES = re.compile(
    r"\b(mo|tu|we|th|fr|sa|su)(?:n|ndays?|es|esdays?|d|dnesdays?|ur|urs|rs|ursdays?|i|idays?|t|turdays?)?\b\.?:?", re.I
)
_RESPELLED: tuple[tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]], ...] = (
    (re.compile("[‐‑‒–—−]"), "-"),
    (re.compile("[“”„«»]"), '"'),
    (re.compile("[\u00a0\u2009\u202f\\s]+"), " "),
    (re.compile(r"\b(?:daily|every ?day)\b", re.I), "Mo-Su"),
    (re.compile(r"\bweekdays\b", re.I), "Mo-Fr"),
    (re.compile(r"\bweekends?\b", re.I), "Sa-Su"),
    (re.compile(r"^\s*(?:open )?(?:24 ?/ ?7|24 ?h(?:ours?)?)\s*$", re.I), "24/7"),
    (re.compile(r"\bph\b", re.I), "PH"),
    (re.compile(r"\bsh\b", re.I), "SH"),
    (re.compile(r"\s*(?:\bto\b|\btill?\b|\buntil\b|\bbis\b)\s*", re.I), "-"),
    (re.compile(r"\s*(?:&|\band\b|\bund\b)\s*", re.I), ","),
    (re.compile(r"\s*-\s*"), "-"),
    (re.compile(r"\b(\d{1,2})h(\d{2})\b", re.I), r"\1:\2"),
    (re.compile(r"\b(\d{1,2}(?::\d{2})?)\s*(?:uhr|h)\b", re.I), r"\1"),
    (re.compile(r"\b(\d{1,2})\.(\d{2})\b(?=\s*-|\s*[,;]|\s*$|\s*[ap]\.?m)", re.I), r"\1:\2"),
    (re.compile(r"(?<=\d-)(\d{2})(\d{2})\b|\b(\d{2})(\d{2})(?=-\d)"), r"\1\3:\2\4"),
    (re.compile(r"\b(\d{1,2})(?::?(\d{2}))?\s*([ap])\.?m\b\.?", re.I), lambda found: _of_half_day(*found.groups())),
    (re.compile(r"(?<![\d:])(\d{1,2})(?=-(\d{1,2})(?::\d{2})?(?![\d:]))"), lambda found: _of_a_day(*found.groups())),
    (re.compile(r"(?<=\d:\d{2}-)(\d{1,2})(?![\d:])"), r"\1:00"),
    (re.compile(r"(\d:\d{2})-(?=\s*(?:[,;]|$))"), r"\1+"),
    (re.compile(rf"({_DAY})(?=\d)"), r"\1 "),
    (re.compile(rf"(\d:\d{{2}}\+?)[\s,.]+(?={_DAY}\b)"), r"\1, "),
)  # fmt: skip


# "Mo, Tu 10:00-12:00" lists days; by the letter of the specification its first rule would be "Mo", round the clock.
_SPACED_LIST = re.compile(rf"\b({_DAY}),\s+(?={_DAY}\b)")
# A last resort without certain hours ("|| on appointment") opens nothing; the library forgets all days but one for it.
_LAST_RESORT = re.compile(r"""\s*\|\|\s*(?:unknown\s*)?(?:"[^"]*")?\s*$""")
# Rules that override earlier ones; a semicolon within a comment separates nothing.
_OVERRIDING = re.compile(r';(?=(?:[^"]*"[^"]*")*[^"]*$)')


def _of_half_day(hour: str, minute: str | None, half: str) -> str:
    return f"{int(hour) % 12 + (12 if half.lower() == 'p' else 0):02d}:{minute or '00'}"


def _of_a_day(hour: str, until: str) -> str:
    """Return an hour without minutes as a time; left as it is in "9-5", which hardly means until five at night."""
    return hour if len(until) == 1 and int(until) <= int(hour) else f"{hour}:00"


def _respelled(text: str) -> str:
    """Return a value in the specification's spelling, as far as its parts are known words and times."""
    pieces = re.split(r'("[^"]*")', text)
    for k in range(0, len(pieces), 2):  # comments stay as they are
        piece = _DAY_NAMES.sub(lambda found: found[1].capitalize(), pieces[k])
        for pattern, instead in _RESPELLED:
            piece = pattern.sub(instead, piece)
        pieces[k] = piece
    return "".join(pieces).strip(" ,.;")


@lru_cache(maxsize=16384)
def _readable(text: str) -> str | None:
    """Return a value as the library takes it: as typed, else respelled; None where neither can be read."""
    for candidate in (text.strip(), _respelled(text)):
        if candidate and library.validate(candidate):
            return _LAST_RESORT.sub("", _SPACED_LIST.sub(r"\1,", candidate))
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


class _Calendar:
    """A readable value at a place, asked for what is open on dates."""

    def __init__(self, text: str, coordinates: Coordinates | None, holidays: bool) -> None:
        self._text, self._coordinates, self._holidays = text, coordinates, holidays
        self._hours = library.OpeningHours(text, coords=coordinates, auto_country=holidays)

    def _is_open(self, state: library.State, comment: str) -> bool:
        # A comment beside no `open` makes hours unknown by the specification ("by appointment"); the library says open.
        commented = comment != "" and not re.search(rf'\bopen\s*"{re.escape(comment)}"', self._text)
        return state == library.State.OPEN and not commented

    def _late_end(self, midnight: datetime) -> datetime:
        """Return until when it is open that is open up to a midnight.

        The library forgets the hours past midnight of one rule where another rule decides the next day: so the rules
        are asked one by one. The last one that is open up to midnight holds.
        """
        rules = _OVERRIDING.split(self._text)
        for rule in reversed(rules) if len(rules) > 1 else ():
            one = _calendar(rule, self._coordinates, self._holidays)
            spans = [] if one is None else one.open_between(midnight.date() - timedelta(days=1), 3)
            for low, high in spans:
                if low < midnight <= high:
                    return high
        return midnight

    def open_between(self, first: Date, days: int) -> list[tuple[datetime, datetime]]:
        """Return when it is open within some days, local time; what lies back to back is one interval."""
        start = datetime(first.year, first.month, first.day)
        found: list[tuple[datetime, datetime]] = []
        for low, high, state, comment in self._hours.intervals(start, start + timedelta(days=days)):
            if not self._is_open(state, comment):
                continue
            low, high = low.replace(tzinfo=None), high.replace(tzinfo=None)
            if found and found[-1][1] >= low:
                low = found.pop()[0]
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
            if high.time() == Time(0):
                high = self._late_end(high)
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
        Hours that a comment makes uncertain ("by appointment") are not open. None where nothing is known: the value
        can't be read, names only closings that are not on this date, or only uncertain hours.
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
