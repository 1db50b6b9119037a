"""Whom a resident knows, what of them, and what people call each other.

A resident knows the days of friends, colleagues' working hours and neighbours' homes. Forms of address are first names,
"Ms Berg" by children, "Mum" in the family; `is_called` says whom a text calls.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from vico.agents.talk.grammar import read_grammar
from vico.clock import seconds_of_day
from vico.english import split_name

__all__ = [
    "GROWN_UP",
    "Acquaintance",
    "Habit",
    "acquaintance_of",
    "acquaintances_of",
    "address_of",
    "calls_somebody_nearer",
    "day_of",
    "first_name",
    "form_of_address_by",
    "is_called",
    "names_of",
    "surname",
]
# What one knows of somebody's day, by what ties one to them.
_DAY_TIES, _WORK_TIES, _HOME_TIES = ("family", "friend"), ("colleague",), ("family", "friend", "neighbour")


@dataclass(frozen=True)
class Habit:
    """Where somebody usually is for a part of the day.

    Attributes
    ----------
    start, end
        Seconds of the day.
    place
        Id; on the way, of where they go.
    travels
        Whether they are on the way.
    """

    start: float
    end: float
    place: str
    travels: bool = False


@dataclass(frozen=True)
class Acquaintance:
    """Somebody a resident knows.

    Attributes
    ----------
    agent, name
        Name of the agent, and of the person.
    kind, note
        What ties them (friend, colleague, ...), and that in words.
    age
        Years.
    home
        Id of the place; empty if one doesn't know it.
    habits
        What one knows of their usual day.
    gender
        ``female`` or ``male``; empty if one doesn't know.
    household
        Id, the same for those who live together; empty if nobody said.
    """

    agent: str
    name: str
    kind: str
    note: str
    age: int = 35
    home: str = ""
    habits: tuple[Habit, ...] = ()
    gender: str = ""
    household: str = ""

    @property
    def first_name(self) -> str:
        """What one calls them."""
        return split_name(self.name)[1]

    def usual_at(self, second: float) -> Habit | None:
        """Return where they usually are at a second of the day, as far as one knows."""
        return next((habit for habit in reversed(self.habits) if habit.start <= second < habit.end), None)


def acquaintance_of(resident: Any, kind: str, note: str, *, day: tuple[Habit, ...] | None = None) -> Acquaintance:
    """Return what somebody knows of a resident to whom they are tied.

    Parameters
    ----------
    resident
        As `vico.community.model.Resident`; what it lacks is not known.
    kind
        As `vico.community.model.RelationKind`.
    day
        What `day_of` returns of the resident's schedule, where it was asked before.
    """
    habits: tuple[Habit, ...] = ()
    if kind in _DAY_TIES or kind in _WORK_TIES:
        habits = day_of(getattr(resident, "schedule", ())) if day is None else day
    if kind not in _DAY_TIES:
        work = getattr(resident, "workplace", None)
        habits = tuple(one for one in habits if one.place == work and not one.travels)
    home = str(getattr(resident, "home", "") or "") if kind in _HOME_TIES else ""
    gender, household = (str(getattr(resident, field, None) or "") for field in ("gender", "household"))
    return Acquaintance(resident.id, resident.name, kind, note, resident.age, home, habits, gender, household)


def acquaintances_of(residents: Mapping[str, Any], relations: Iterable[Any]) -> dict[str, list[Acquaintance]]:
    """Return whom each resident knows, by agent's name.

    Parameters
    ----------
    residents
        By agent's name.
    relations
        As `vico.community.model.Relation`; ties to people who are not among the residents are left out.
    """
    known: dict[str, list[Acquaintance]] = {name: [] for name in residents}
    # All who know a day know the same one.
    days = {name: day_of(getattr(resident, "schedule", ())) for name, resident in residents.items()}
    for relation in relations:
        first, second = relation.between
        for me, other in ((first, second), (second, first)):
            if me in residents and other in residents:
                kind, note = str(relation.kind), relation.note
                known[me].append(acquaintance_of(residents[other], kind, note, day=days[other]))
    return known


def day_of(schedule: Sequence[Any]) -> tuple[Habit, ...]:
    """Return where a schedule has somebody, and when; ways lead to where they are next."""
    found: list[Habit] = []
    for k, item in enumerate(schedule):
        travels = item.place is None
        place = item.place or next((later.place for later in schedule[k + 1 :] if later.place), None)
        if place is not None:
            found.append(Habit(seconds_of_day(item.start), seconds_of_day(item.end), place, travels))
    return tuple(found)


#: Who is younger calls grown-ups of other families by title and surname, years.
GROWN_UP = 18
_TITLE = {"female": "Ms", "male": "Mr"}
_TITLES = {"female": ("Ms", "Mrs", "Miss"), "male": ("Mr",), "": ("Ms", "Mrs", "Miss", "Mr", "Mx")}
# What those of one family are to each other in the words of a note, how much older the elder is at least, years, and
# what the younger one says to them.
_KIN = (
    (r"grand(?:parents?|mother|father|ma|pa|mum|dad)", 30, {"female": "Grandma", "male": "Grandpa"}),
    (r"(?:parents?|mother|father|mum|dad)(?!-in-law)", 14, {"female": "Mum", "male": "Dad"}),
    (r"(?:aunt|uncle)", 8, {"female": "Aunt {first}", "male": "Uncle {first}"}),
)
# After these somebody is spoken of, and before those: "with Ada", "Ada is at home".
_OF_WORDS = frozenset([
    "about", "after", "and", "as", "ask", "at", "before", "bring", "by", "called", "fetch", "find", "follow",
    "for", "from", "have", "help", "helping", "if", "is", "joined", "know", "like", "love", "meet", "meeting",
    "met", "near", "of", "or", "saw", "see", "seeing", "seen", "tell", "than", "that", "to", "told", "visit",
    "visiting", "was", "when", "where", "with",
])  # fmt: skip
_VERB_WORDS = frozenset([
    "and", "comes", "does", "goes", "had", "has", "is", "isn't", "knows", "likes", "lives", "looks", "said",
    "says", "sits", "stands", "takes", "told", "usually", "wants", "was", "went", "will", "works", "would",
])  # fmt: skip
# A sentence may begin after a name without a comma.
_OPENING_WORDS = frozenset([
    "a", "and", "are", "can", "come", "could", "did", "do", "good", "hello", "hi", "how", "i", "i'm", "is", "it",
    "my", "nice", "please", "thanks", "the", "we", "what", "when", "where", "who", "why", "would", "you",
])  # fmt: skip
# "Bo and Ann, come!"
_PAIR_PATTERN = re.compile(r"(?:^|[.!?]\s)(?:\w+,? )?\w+,? and$")
_WORD = re.compile(r"[\w'’-]+")


def first_name(name: str) -> str:
    """Return what somebody is called by, in small letters."""
    return split_name(name)[1].casefold()


def surname(name: str) -> str:
    """Return the last name, with what belongs to it: van der Berg; empty for a single name."""
    rest = split_name(name)[2].split()
    k = len(rest) - 1
    while k > 0 and rest[k - 1].islower():
        k -= 1
    return " ".join(rest[k:])


def names_of(name: str, gender: str | None = "") -> tuple[str, ...]:
    """Return what somebody may be called: the whole name, the first, and titles with the surname.

    Parameters
    ----------
    gender
        ``female``, ``male``, empty for any title, or None for no title.
    """
    last = "" if gender is None else surname(name)
    title, first, rest = split_name(name)
    titles = [*_TITLES.get(gender or "", ()), *([title] if title else [])]
    return tuple(dict.fromkeys([f"{first} {rest}".strip(), first, *(f"{one} {last}" for one in titles if last)]))


def address_of(person: Acquaintance, *, age: int, household: str = "") -> str:
    """Return what somebody calls a person they know.

    Parameters
    ----------
    age, household
        Of who speaks: years, and the id of their household, empty if nobody said.
    """
    if person.kind == "family":
        return _kin(person, age) or person.first_name
    if age >= GROWN_UP or person.age < GROWN_UP or (household and household == person.household):
        return person.first_name
    last, title = surname(person.name), split_name(person.name)[0] or _TITLE.get(person.gender)
    return f"{title} {last}" if title and last else person.name


def _kin(person: Acquaintance, age: int) -> str:
    """Return what one calls an elder of the family, where the note says what they are and their gender is known."""
    for pattern, years, words in _KIN:
        if (
            re.search(rf"(?<!-)\b{pattern}\b", person.note, re.I)
            and person.age - age >= years
            and person.gender in words
        ):
            return words[person.gender].format(first=person.first_name)
    return ""


def form_of_address_by(speaker: Acquaintance, *, name: str, age: int, gender: str, household: str) -> str:
    """Return what a person one knows calls oneself."""
    me = replace(speaker, name=name, age=age, gender=gender, household=household)
    return address_of(me, age=speaker.age, household=speaker.household)


def is_called(name: str, text: str, *, gender: str | None = "", also: Iterable[str] = ()) -> bool:
    """Whether a text calls somebody, and does not only speak of them.

    A name is a word of its own: Ida is not called by "Aida!", nor Ida Roth by "Have you seen Ida Roth?", "I'm having
    lunch with Ida" or "Ida Holm, wait". Titles go with the surname: "Ms Roth".

    Parameters
    ----------
    also
        Further names, as "Mum".
    """
    names = (*names_of(name, gender), *also)
    folded = text.casefold()
    if not any(
        part in folded for part in (first_name(name), surname(name).casefold(), *map(str.casefold, also)) if part
    ):
        return False
    question = read_grammar().question_in(text, names=names)
    first = first_name(name)
    if question is not None and any(one.casefold() in question.what.casefold() for one in (first, *names[2:])):
        return question.to.casefold() in {one.casefold() for one in names} or first in question.to.casefold().split()
    return any(_calls_by_name(text, one, surname(name)) for one in names)


def _calls_by_name(text: str, name: str, last: str) -> bool:
    words = re.escape(name).replace(r"\ ", r"\.?\s+")
    for match in re.finditer(rf"(?<![\w-]){words}(?![\w-])(?!['’]s\b)", text, re.I):
        before, after = text[: match.start()].rstrip(), text[match.end() :]
        follows = _WORD.match(after.strip()) if after[:1].isspace() else None
        word = "" if follows is None else follows[0]
        # The whole name is another form, and other surnames are other people's.
        another = _is_last(after, last) or (word[:1].isupper() and word.casefold() not in _OPENING_WORDS)
        if another or word.casefold() in _VERB_WORDS:
            continue
        apart = not before or not (before[-1].isalnum() or before[-1] in "'’")
        lead = "" if apart else _WORD.findall(before)[-1].casefold()
        if apart or (lead not in _OF_WORDS and (not word or _is_greeting(before))) or _PAIR_PATTERN.search(before):
            return True
    return False


def _is_last(after: str, last: str) -> bool:
    """Whether a surname follows."""
    return bool(last) and re.match(rf"\s+{re.escape(last)}(?![\w-])", after, re.I) is not None


def _is_greeting(before: str) -> bool:
    """Whether words end in a greeting or another courtesy."""
    low = before.casefold()
    return any(low == one or low.endswith(f" {one}") for one in (*read_grammar().courtesies, "you", "dear", "bye"))


def calls_somebody_nearer(
    message: Mapping[str, Any],
    stands: tuple[float, float],
    bodies: Iterable[Any],
    name_and_gender: Callable[[str], tuple[str, str | None] | None],
) -> bool:
    """Whether somebody who stands nearer to who speaks is called by the same words: two of one name don't both answer.

    Parameters
    ----------
    message
        As in an observation's events.
    stands
        Where one stands oneself, ENU metres.
    bodies
        In view, as `vico.sim.perception.InView` has them.
    name_and_gender
        Of an agent; None for one whose name, or gender, one doesn't know.
    """
    x, y = (float(value) for value in message["position"][:2])
    away = math.hypot(x - stands[0], y - stands[1])
    for body in bodies:
        who = None if body.agent in ("", message["speaker"]) else name_and_gender(body.agent)
        nearer = who is not None and math.hypot(x - body.position[0], y - body.position[1]) < away
        if who is not None and nearer and is_called(who[0], str(message["text"]), gender=who[1]):
            return True
    return False
