"""What people call each other: first names, "Ms Berg" by children, "Mum" in the family; and whom a text calls."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from vico.agents.talk.acquaintance import Acquaintance
from vico.agents.talk.grammar import read_grammar
from vico.english import split_name

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
_OF = frozenset([
    "about", "after", "and", "as", "ask", "at", "before", "bring", "by", "called", "fetch", "find", "follow",
    "for", "from", "have", "help", "helping", "if", "is", "joined", "know", "like", "love", "meet", "meeting",
    "met", "near", "of", "or", "saw", "see", "seeing", "seen", "tell", "than", "that", "to", "told", "visit",
    "visiting", "was", "when", "where", "with",
])  # fmt: skip
_DOES = frozenset([
    "and", "comes", "does", "goes", "had", "has", "is", "isn't", "knows", "likes", "lives", "looks", "said",
    "says", "sits", "stands", "takes", "told", "usually", "wants", "was", "went", "will", "works", "would",
])  # fmt: skip
# A sentence may begin after a name without a comma.
_BEGINS = frozenset([
    "a", "and", "are", "can", "come", "could", "did", "do", "good", "hello", "hi", "how", "i", "i'm", "is", "it",
    "my", "nice", "please", "thanks", "the", "we", "what", "when", "where", "who", "why", "would", "you",
])  # fmt: skip
# "Bo and Ann, come!"
_BOTH = re.compile(r"(?:^|[.!?]\s)(?:\w+,? )?\w+,? and$")
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


def called_by(speaker: Acquaintance, *, name: str, age: int, gender: str, household: str) -> str:
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
    return any(_calls(text, one, surname(name)) for one in names)


def _calls(text: str, name: str, last: str) -> bool:
    words = re.escape(name).replace(r"\ ", r"\.?\s+")
    for match in re.finditer(rf"(?<![\w-]){words}(?![\w-])(?!['’]s\b)", text, re.I):
        before, after = text[: match.start()].rstrip(), text[match.end() :]
        follows = _WORD.match(after.strip()) if after[:1].isspace() else None
        word = "" if follows is None else follows[0]
        # The whole name is another form, and other surnames are other people's.
        another = _is_last(after, last) or (word[:1].isupper() and word.casefold() not in _BEGINS)
        if another or word.casefold() in _DOES:
            continue
        apart = not before or not (before[-1].isalnum() or before[-1] in "'’")
        lead = "" if apart else _WORD.findall(before)[-1].casefold()
        if apart or (lead not in _OF and (not word or _is_greeting(before))) or _BOTH.search(before):
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


__all__ = [
    "GROWN_UP",
    "address_of",
    "called_by",
    "calls_somebody_nearer",
    "first_name",
    "is_called",
    "names_of",
    "surname",
]
