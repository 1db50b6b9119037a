"""Opening hours: what a value of OSM's `opening_hours` means on a date at a place.

The library `opening-hours-py` reads the whole specification, knows the public holidays of countries and the sun. This
module asks it, turns its answers into minutes of a day, and says of every value how it was read.

Values as people type them are put into the specification's spelling first. Days have names in languages: which one a
value is written in is decided by all its names together. A value that could mean several things is left as it is.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from datetime import date as Date
from datetime import datetime, timedelta
from functools import lru_cache
from typing import Literal

import opening_hours as library

#: Days of the week as the specification writes them, Monday first.
DAYS = ("Mo", "Tu", "We", "Th", "Fr", "Sa", "Su")
#: Pattern of a day, public and school holidays included.
DAY = "(?:Mo|Tu|We|Th|Fr|Sa|Su|PH|SH)"

_Rules = tuple[tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]], ...]

# Monday to Sunday. Two letters or more of a name stand for it where they name one day only; what follows a slash is
# taken whole. The specification's own names are English ones.
_NAMES = {
    "English": "mondays tuesdays wednesdays/weds thursdays fridays saturdays sundays",
    "German": "montags dienstags mittwochs donnerstags freitags samstags/sonnabend/sonnabends sonntags",
    "French": "lundis mardis mercredis jeudis vendredis samedis dimanches",
    "Spanish": "lunes martes miércoles jueves viernes sábados domingos",
    "Italian": "lunedì martedì mercoledì giovedì venerdì sabato domenica",
    "Dutch": "maandag dinsdag woensdag donderdag vrijdag zaterdag zondag",
    "Portuguese": "segunda terça quarta quinta sexta sábados domingos",
    "Polish": "poniedziałek/pn wtorek środa czwartek piątek/pt sobota niedziela/nd",
    "Russian": "понедельник/пн вторник/вт среда/ср четверг/чт пятница/пт суббота/сб воскресенье/вс",
}
# "Mar-Oct" is months where the other names are of a language without such a day.
_MONTH = "mar"
_WORD = re.compile(r"[^\W\d_]+")
_NAMED = re.compile(r"([^\W\d_]+)\.?:?")
_NEIGHBOURS = re.compile(r"(?=\b([^\W\d_]+)\.?\s*[-,]\s*([^\W\d_]+))")

_TWENTY_FOUR = (
    r"24 ?(?:h\w*|std\.?|stunden)?(?: ?[/x×] ?(?:24 ?h?|7)|(?<=[^\d ]))(?: a day)?"
    r"(?: ?,? ?7 ?(?:j|d|days|tage)?(?: a week| ?[/x] ?7))?(?![\w:-])"
)
_OFF_FIRST = re.compile(rf'^({DAY}(?:[-,]{DAY})* off); ?([^;"]+)$')
# Signs, and words other than days; only where the specification's reader refuses a value as it is typed.
_WORDS: _Rules = (
    (re.compile("[‐‑‒–—−~〜]|[至到]"), "-"),
    (re.compile("、"), ","),
    (re.compile(r"\s+"), " "),
    (re.compile(rf"^ ?(?:open )?{_TWENTY_FOUR} ?$", re.I), "24/7"),
    (re.compile(r"(?<=\d)\s*(?:a\.?\s?m\b\.?|(?<=\d)a\b\.?)", re.I), "am"),
    (re.compile(r"(?<=\d)\s*(?:p\.?\s?m\b\.?|(?<=\d)p\b\.?)", re.I), "pm"),
    (re.compile("平日"), "Mo-Fr"),
    (re.compile("祝日?"), "PH"),
    (re.compile("[每毎][天日]"), "Mo-Su"),
    (re.compile("(?:周|星期)([一二三四五六日天])"), lambda found: DAYS[min(6, "一二三四五六日天".index(found[1]))]),
    (re.compile(r"(?<!\d)([月火水木金土日])(?:曜日?)?"), lambda found: DAYS["月火水木金土日".index(found[1])]),
    (re.compile(rf"({DAY})(?={DAY})"), r"\1,"),
    (re.compile(r"\b(?:daily|every ?day|7 days(?: a week)?|7 ?[jd]?/7)\b", re.I), "Mo-Su"),
    (re.compile(r"\b(?:täglich|tous les jours|ежедневно)\b", re.I), "Mo-Su"),
    (re.compile(r"\bweekdays\b", re.I), "Mo-Fr"),
    (re.compile(r"\bweekends?\b", re.I), "Sa-Su"),
    (re.compile(r"\b(?:ph|(?:public |bank )?holidays?|feiertage?s?|jours fériés)\b", re.I), "PH"),
    (re.compile(r"\bsh\b", re.I), "SH"),
    (re.compile(r"(?:\b(?:geschlossen|ruhetag|fermée?|cerrado|chiuso|gesloten|выходной)\b|定?休日?)", re.I), "off"),
    (re.compile(r"-\s*(?:late|close|closing|open end)\b", re.I), "+"),
    (re.compile(r"\b(?:midnight|mitternacht|minuit)(?=\s*(?:-|to\b|bis\b))", re.I), "0:00"),
    (re.compile(r"\b(?:midnight|mitternacht|minuit)\b", re.I), "24:00"),
    (re.compile(r"\b(?:noon|midday|midi)\b", re.I), "12:00"),
    (re.compile(r"-feira\b", re.I), ""),
    (re.compile(r"(?:^|(?<=[\s,;]))(?:from|von|van|de|du|le|el|il|dal|dalle|das) ", re.I), ""),
    (re.compile(r"\s*(?:\bto\b|\btill?\b|\buntil\b|\bbis\b|\bthrough\b|\bthru\b|\bt/m\b|\btot\b)\s*", re.I), "-"),
    (re.compile(r"\s(?:a|à|á|às|au|al|alle|до|по)\s", re.I), "-"),
    (re.compile(r"\s*(?:&|\band\b|\bund\b)\s*|\s(?:et|y|e|en|и|u\.)\s|(?<=[^\W\d]) ?\+ ?(?=[^\W\d])", re.I), ","),
    (re.compile(r"\s*-\s*"), "-"),
)  # fmt: skip

# "Jun 8-10" and "week 8-10" before days, hours or a closing are dates.
_MONTHS = "jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec"
_NO_DATES = rf"(?!(?<=(?:{_MONTHS}|eek) )\d{{1,2}}-\d{{1,2}}(?!\d):? ?(?:{DAY}|\d|off|closed))"
# A time with or without minutes and half of the day.
_TYPED_TIME = r"(\d{1,2})(?::(\d{2}))?([ap]m)?"
_TIMES: _Rules = (
    (re.compile(rf"({DAY}) ?{_TWENTY_FOUR}", re.I), r"\1 00:00-24:00"),
    (re.compile(r"\b(\d{1,2})h(\d{2})(?:h|min)?\b", re.I), r"\1:\2"),
    (re.compile(r"\b(\d{1,2}(?:[:.]\d{2})?)\s*(?:uhr|uur|hrs?|h|ч)\b\.?", re.I), r"\1"),
    (re.compile(r"\b(\d{1,2})\.(\d{2})(?=[-,;/ ]|$|[ap]m)"), r"\1:\2"),
    (re.compile(r"\b(?!20\d\d-20)(\d{1,2})([0-5]\d)(?=-\d)"), r"\1:\2"),
    (re.compile(r"(?<=\d-)(?!(?<=20\d\d-)20)(\d{1,2})([0-5]\d)\b"), r"\1:\2"),
    (
        re.compile(rf"(?<![\d:])\b{_NO_DATES}{_TYPED_TIME}-{_TYPED_TIME}(?![\w:])", re.I),
        lambda found: _span(*found.groups()),
    ),
    (re.compile(rf"(?<![\d:-])\b{_TYPED_TIME}(?=\+)"), lambda found: _time(*found.groups())),
    (re.compile(r"(\d:\d{2})-(?=\s*(?:[,;]|$))"), r"\1+"),
    (re.compile(r"\(((?:sunrise|sunset|dawn|dusk)-(?:sunrise|sunset|dawn|dusk))\)", re.I), r"\1"),
    (re.compile(rf"({DAY})(?=\d)"), r"\1 "),
    (re.compile(r"(\d:\d{2}\+?) ?[/ ] ?(?=\d{1,2}:\d{2}[-+])"), r"\1,"),
    (re.compile(rf"(\d:\d{{2}}\+?|off|closed) ?[|/] ?(?={DAY}\b)"), r"\1; "),
    (re.compile(r";(?:\s*;)+"), ";"),
    (re.compile(rf"(^|[;,]) ?off:? ?({DAY}(?:[-,]{DAY})*)(?= ?(?:$|[;,]))"), r"\1 \2 off"),
    (re.compile(rf"(\d:\d{{2}}\+?)[\s,.]+(?={DAY}\b)"), r"\1, "),
)  # fmt: skip


def _time(hour: str, minute: str | None, half: str | None) -> str:
    if half is not None:
        hour = f"{int(hour) % 12 + (12 if half == 'pm' else 0):02d}"
    return f"{hour}:{minute or '00'}"


def _span(
    hour: str, minute: str | None, half: str | None, to_hour: str, to_minute: str | None, to_half: str | None
) -> str:
    """Return a span as two times, or as it is typed where one time lacks the half of the day that it needs.

    "6-10pm" begins in the evening and "9-5pm" in the morning; "11-2am" might begin in either. "9-5" and "9:30-5"
    hardly mean until five at night, and are left.
    """
    typed = f"{hour}{':' + minute if minute else ''}{half or ''}-{to_hour}{':' + to_minute if to_minute else ''}"
    typed += to_half or ""
    first, last = int(hour) * 60 + int(minute or 0), int(to_hour) * 60 + int(to_minute or 0)
    if half is None and to_half is not None and int(hour) <= 12:
        same, end = (_minutes(hour, minute, to_half), _minutes(to_hour, to_minute, to_half))
        if same >= end and to_half == "am":
            return typed
        half = to_half if same < end else "am"
    elif half is not None and to_half is None and int(to_hour) <= 12:
        begin = _minutes(hour, minute, half)
        if half == "am" and begin < _minutes(to_hour, to_minute, "am"):
            return typed
        to_half = "pm" if begin < _minutes(to_hour, to_minute, "pm") else "am"
    elif half is to_half is to_minute is None and last <= first and int(hour) <= 12 and len(to_hour) == 1:
        return typed
    return f"{_time(hour, minute, half)}-{_time(to_hour, to_minute, to_half)}"


def _minutes(hour: str, minute: str | None, half: str) -> int:
    return (int(hour) % 12 + (12 if half == "pm" else 0)) * 60 + int(minute or 0)


def _plain(word: str) -> str:
    """Return a word in small letters without accents."""
    return "".join(sign for sign in unicodedata.normalize("NFKD", word.lower()) if not unicodedata.combining(sign))


def _days_by_word(names: str) -> dict[str, int]:
    found: dict[str, set[int]] = {}
    for day, forms in enumerate(names.split()):
        name, *others = _plain(forms).split("/")
        for form in (*(name[:n] for n in range(2, len(name) + 1)), *others):
            found.setdefault(form, set()).add(day)
    return {form: min(days) for form, days in found.items() if len(days) == 1}


_LANGUAGES = {language: _days_by_word(names) for language, names in _NAMES.items()}


def _is_in_order(text: str, days: Mapping[str, int]) -> bool:
    """Whether days follow each other as in a week wherever two are listed or joined: "Sa-Di" does in French only."""
    pairs = ((days.get(_plain(first)), days.get(_plain(second))) for first, second in _NEIGHBOURS.findall(text))
    return all(first < second for first, second in pairs if first is not None and second is not None)


def _days_named(text: str) -> Mapping[str, int]:
    """Return the days that a value's words name: in the language that knows all its names of days.

    English comes first, then what names the days in order, then German. Empty where other languages disagree.
    """
    words = {word for word in map(_plain, _WORD.findall(text)) if any(word in days for days in _LANGUAGES.values())}
    named = words - {_MONTH}
    if named <= _LANGUAGES["English"].keys():
        return _LANGUAGES["English"]
    known = {language: days for language, days in _LANGUAGES.items() if words <= days.keys()}
    known = known or {language: days for language, days in _LANGUAGES.items() if named <= days.keys()}
    if not known:
        return {}
    known = {language: days for language, days in known.items() if _is_in_order(text, days)} or known
    readings = {tuple(days.get(word) for word in sorted(words)) for days in known.values()}
    return known.get("German", next(iter(known.values())) if len(readings) == 1 else {})


def _apply_rules(text: str, rules: _Rules) -> str:
    for pattern, instead in rules:
        text = pattern.sub(instead, text)
    return text


def in_specification(text: str) -> str:
    """Return a value in the specification's spelling, as far as its parts are known words and times."""
    pieces = re.split(r'("[^"]*")', re.sub("[“”„«»]", '"', text))  # comments stay as they are
    pieces[::2] = [_apply_rules(unicodedata.normalize("NFKC", piece), _WORDS) for piece in pieces[::2]]
    named = _days_named(" ".join(pieces[::2]))

    def day_name(found: re.Match[str]) -> str:
        day = named.get(_plain(found[1]))
        return found[0] if day is None else DAYS[day]

    pieces[::2] = [_apply_rules(_NAMED.sub(day_name, piece), _TIMES) for piece in pieces[::2]]
    # A day off that is told first holds, too; in the specification later rules override it.
    return _OFF_FIRST.sub(r"\2; \1", "".join(pieces).strip(" ,.;"))


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
    """Return how a value of `opening_hours` is read: as typed, respelled as in the specification, or not at all."""
    readable = _readable(text)
    if readable is None:
        return "not read"
    return "as typed" if library.validate(text.strip()) else "respelled"


def standard_spelling(text: str) -> str:
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

    def rank_as_clock(found: re.Match[str]) -> str:
        return _clock(_NOON + order.index(int(found[1]) * 60 + int(found[2])))

    pieces[::2] = [_ONE_TIME.sub(rank_as_clock, piece) for piece in pieces[::2]]
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
    """Return when a place is open on a date, by its `opening_hours`.

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
