"""Opening hours: the common forms of OSM's `opening_hours`."""

from __future__ import annotations

import re
from collections.abc import Sequence

DAYS = ("Mo", "Tu", "We", "Th", "Fr", "Sa", "Su")
MINUTES = 24 * 60

#: Open from, until, in minutes of the day; `until` may lie past midnight.
Span = tuple[int, int]

#: Staff are at their place so long before it opens and after it closes, at most, minutes.
STAFF_MARGIN = 60

_DAY = "(?:Mo|Tu|We|Th|Fr|Sa|Su|PH|SH)"
_DAYS = re.compile(rf"{_DAY}(?:\s*-\s*{_DAY})?(?:\s*,\s*{_DAY}(?:\s*-\s*{_DAY})?)*")
_TIMES = re.compile(r"(\d{1,2})(?::(\d{2}))?\s*-\s*(\d{1,2})(?::(\d{2}))?")
# A comma before a day name starts a new rule ("Mo-Fr 8:00-20:00, Sa 9:00-18:00"), unless it only lists days.
_RULES = re.compile(rf";|,\s*(?={_DAYS.pattern}\s*(?:\d|off|closed))")


def _days_of(text: str) -> set[int]:
    found: set[int] = set()
    for part in text.split(","):
        ends = [p.strip() for p in part.split("-")]
        if ends[0] not in DAYS or ends[-1] not in DAYS:
            continue  # public and school holidays: the communities' day is neither
        first, last = DAYS.index(ends[0]), DAYS.index(ends[-1])
        found.update((first + k) % 7 for k in range((last - first) % 7 + 1))
    return found


def _spans_of(text: str) -> list[Span] | None:
    spans: list[Span] = []
    for part in text.split(","):
        match = _TIMES.fullmatch(part.strip().rstrip("+"))
        if match is None:
            return None
        first_hour, first_minute, last_hour, last_minute = (int(part or 0) for part in match.groups())
        start, end = first_hour * 60 + first_minute, last_hour * 60 + last_minute
        if start > MINUTES or end > 30 * 60:
            return None
        spans.append((start, end if end > start else end + MINUTES))
    return spans


def is_within(spans: Sequence[Span], minute: float) -> bool:
    """Return whether a minute of the day, 0..1440, lies in one of some spans, those of the day before included."""
    return any(start <= minute < end or start <= minute + MINUTES < end for start, end in spans)


def weekly_hours(text: str) -> list[list[Span]] | None:
    """Read an `opening_hours` value.

    Parameters
    ----------
    text
        For example ``Mo-Fr 08:00-20:00; Sa 10:00-18:00; PH off``, ``Tu-Sa 11:00-14:30,17:00-00:00`` or ``24/7``.

    Returns
    -------
    list of list of Span or None
        For each day, Monday first, when it is open; None if the value has forms not read here (months, sunset,
        comments): nothing is known then.
    """
    if text.strip() == "24/7":
        return [[(0, MINUTES)] for _ in DAYS]
    week: list[list[Span]] = [[] for _ in DAYS]
    for rule in _RULES.split(text):
        if not (rule := rule.strip()):
            continue
        match = _DAYS.match(rule)
        days = set(range(7)) if match is None else _days_of(match[0])
        rest = rule[match.end() :].strip(" :") if match else rule
        if rest in ("off", "closed"):
            spans: list[Span] | None = []
        elif rest == "":
            spans = [(0, MINUTES)]
        else:
            spans = _spans_of(rest)
        if spans is None:
            return None
        for day in sorted(days):
            week[day] = list(spans)
    return week


def open_spans(text: str, weekday: int) -> list[Span] | None:
    """When a place is open on a day (0 Monday .. 6 Sunday), by its `opening_hours`; None if they can't be read.

    Spans that reach past midnight are kept whole; what spills over from the day before comes first.
    """
    week = weekly_hours(text)
    if week is None:
        return None
    spill = [(0, end - MINUTES) for _, end in week[(weekday - 1) % 7] if end > MINUTES]
    return sorted(spill + week[weekday])


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
