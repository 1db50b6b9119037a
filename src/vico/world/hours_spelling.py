"""Opening hours as people type them, put into the spelling of OSM's specification.

Days have names in languages: which one a value is written in is decided by all its names together. A value that could
mean several things is left as it is.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping

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
_TIME = r"(\d{1,2})(?::(\d{2}))?([ap]m)?"
_TIMES: _Rules = (
    (re.compile(rf"({DAY}) ?{_TWENTY_FOUR}", re.I), r"\1 00:00-24:00"),
    (re.compile(r"\b(\d{1,2})h(\d{2})(?:h|min)?\b", re.I), r"\1:\2"),
    (re.compile(r"\b(\d{1,2}(?:[:.]\d{2})?)\s*(?:uhr|uur|hrs?|h|ч)\b\.?", re.I), r"\1"),
    (re.compile(r"\b(\d{1,2})\.(\d{2})(?=[-,;/ ]|$|[ap]m)"), r"\1:\2"),
    (re.compile(r"\b(?!20\d\d-20)(\d{1,2})([0-5]\d)(?=-\d)"), r"\1:\2"),
    (re.compile(r"(?<=\d-)(?!(?<=20\d\d-)20)(\d{1,2})([0-5]\d)\b"), r"\1:\2"),
    (re.compile(rf"(?<![\d:])\b{_NO_DATES}{_TIME}-{_TIME}(?![\w:])", re.I), lambda found: _span(*found.groups())),
    (re.compile(rf"(?<![\d:-])\b{_TIME}(?=\+)"), lambda found: _time(*found.groups())),
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


def _replaced(text: str, rules: _Rules) -> str:
    for pattern, instead in rules:
        text = pattern.sub(instead, text)
    return text


def in_specification(text: str) -> str:
    """Return a value in the specification's spelling, as far as its parts are known words and times."""
    pieces = re.split(r'("[^"]*")', re.sub("[“”„«»]", '"', text))  # comments stay as they are
    pieces[::2] = [_replaced(unicodedata.normalize("NFKC", piece), _WORDS) for piece in pieces[::2]]
    named = _days_named(" ".join(pieces[::2]))

    def day_name(found: re.Match[str]) -> str:
        day = named.get(_plain(found[1]))
        return found[0] if day is None else DAYS[day]

    pieces[::2] = [_replaced(_NAMED.sub(day_name, piece), _TIMES) for piece in pieces[::2]]
    # A day off that is told first holds, too; in the specification later rules override it.
    return _OFF_FIRST.sub(r"\2; \1", "".join(pieces).strip(" ,.;"))
