"""Reading a message: which topics it brings up and which appeals it makes, by a list of words that anybody may add to.

The same rules read the words of templates, of language models and of people: nothing but the text counts.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

from pydantic import Field

from vico.agents.influence.situation import BIG_FIVE
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.rules import LONGEST_TEXT

GUIDE = "docs/influence.md"
_WORD = re.compile(r"[^\W_]+(?:['\u2019-][^\W_]+)*")
# Left out where a hobby or group is found by its name.
_SMALL_WORDS = frozenset({"the", "a", "an", "at", "in", "of", "to", "and"})


class Theme(DataRecord):
    """A value or a hobby, with the terms that bring it up; `opposed` names values that contradict it."""

    name: str
    terms: tuple[str, ...]
    opposed: tuple[str, ...] = ()


class Appeal(DataRecord):
    """What a message does beside its topics; `base` and `appetite` say who likes it (see the file)."""

    name: str
    terms: tuple[str, ...]
    base: Annotated[float, Field(ge=-1.0, le=1.0)]
    appetite: dict[str, Annotated[float, Field(ge=-1.0, le=1.0)]] = Field(default_factory=dict)


class TermList(DataRecord):
    """Words without a name of their own."""

    terms: tuple[str, ...]


class LexiconFile(DataRecord):
    """A file of words; those of a user add to those of the package."""

    value: tuple[Theme, ...] = ()
    hobby: tuple[Theme, ...] = ()
    appeal: tuple[Appeal, ...] = ()
    flattery: TermList = TermList(terms=())
    pressure: TermList = TermList(terms=())
    boasting: TermList = TermList(terms=())


@dataclass(frozen=True)
class Topic:
    """Something a message brings up: ``value``, ``hobby`` or ``group``, and its name."""

    kind: str
    name: str


@dataclass(frozen=True)
class Reading:
    """What a message says, to who knows the words.

    Attributes
    ----------
    topics
        Each once, in the order of the lexicon.
    appeals
        Names of the appeals it makes.
    flattery, pressure, boasting
        Whether it does that.
    words
        How many it has.
    vocabulary
        The different words in it.
    """

    topics: tuple[Topic, ...]
    appeals: tuple[str, ...]
    flattery: bool
    pressure: bool
    boasting: bool
    words: int
    vocabulary: frozenset[str]


class Lexicon:
    """Reads messages.

    Parameters
    ----------
    files
        Words, by topic and appeal.
    hobbies, groups
        What else there is in a community: found by the words of its name.

    Raises
    ------
    SchemaError
        If an appeal hangs on a trait, or a value is opposed to one, that nobody knows.
    """

    def __init__(
        self, files: Sequence[LexiconFile], *, hobbies: Iterable[str] = (), groups: Iterable[str] = ()
    ) -> None:
        values = [one for file in files for one in file.value]
        self.opposed = {value.name: frozenset(value.opposed) for value in values}
        self.appeals = {appeal.name: appeal for file in files for appeal in file.appeal}
        _check(self.opposed, self.appeals)
        terms: dict[Topic, list[str]] = {}
        for value in values:
            terms.setdefault(Topic("value", value.name), [value.name]).extend(value.terms)
        for hobby in (one for file in files for one in file.hobby):
            terms.setdefault(Topic("hobby", hobby.name), [hobby.name]).extend(hobby.terms)
        for name in sorted(set(hobbies)):
            terms.setdefault(Topic("hobby", name), [name])
        for name in sorted(set(groups)):
            terms.setdefault(Topic("group", name), [_circle(name)])
        self._topics = {topic: _TermMatcher(words) for topic, words in terms.items()}
        self._appeals = {appeal.name: _TermMatcher(appeal.terms) for appeal in self.appeals.values()}
        manners = ("flattery", "pressure", "boasting")
        self._manners = [_TermMatcher([t for file in files for t in getattr(file, name).terms]) for name in manners]
        self._read = lru_cache(maxsize=4096)(self._reading)

    def read(self, text: str) -> Reading:
        """Return what a message says; of one that is longer than can be said, the beginning."""
        return self._read(text[:LONGEST_TEXT])

    def _reading(self, text: str) -> Reading:
        words = words_of(text)
        flattery, pressure, boasting = (terms.occur_in(words) for terms in self._manners)
        return Reading(
            topics=tuple(topic for topic, terms in self._topics.items() if terms.occur_in(words)),
            appeals=tuple(name for name, terms in self._appeals.items() if terms.occur_in(words)),
            flattery=flattery,
            pressure=pressure,
            boasting=boasting,
            words=len(words),
            vocabulary=frozenset(words),
        )


class _TermMatcher:
    """Terms of one or more words, each looked for as a whole; a word may end in ``*``."""

    def __init__(self, terms: Iterable[str]) -> None:
        self._terms = [term for term in (tuple(_pieces(text)) for text in terms) if term]

    def occur_in(self, words: Sequence[str]) -> bool:
        present = frozenset(words)
        return any(_occurs(term, words, present) for term in self._terms)


def _occurs(term: Sequence[str], words: Sequence[str], present: frozenset[str]) -> bool:
    """Return whether a term's words stand one after another; most are told by their first word not being there."""
    if not term[0].endswith("*") and term[0] not in present:
        return False
    last = len(words) - len(term) + 1
    return any(all(_fits(piece, words[k + i]) for i, piece in enumerate(term)) for k in range(last))


def words_of(text: str) -> list[str]:
    """Return the words of a text in lower case; compatibility forms and typographic apostrophes made plain."""
    plain = unicodedata.normalize("NFKC", text).replace("\u2019", "'").lower()
    return [part for word in _WORD.findall(plain) for part in word.split("-")]


def _pieces(term: str) -> list[str]:
    return [piece for part in term.lower().replace("-", " ").split() for piece in [part.strip(",.!?")] if piece]


def _fits(piece: str, word: str) -> bool:
    return word.startswith(piece[:-1]) if piece.endswith("*") else word == piece


def _circle(group: str) -> str:
    """Return the words by which a group is known: its name up to the place, without articles."""
    words = group.split(" at ")[0].split()
    return " ".join([w for w in words if w.lower() not in _SMALL_WORDS] or words)


def _check(opposed: dict[str, frozenset[str]], appeals: dict[str, Appeal]) -> None:
    for name, others in opposed.items():
        for other in sorted(others - opposed.keys()):
            raise SchemaError(f"lexicon: value {name!r} is opposed to {other!r}, which is none of them; see {GUIDE}")
    for appeal in appeals.values():
        for trait in sorted(appeal.appetite.keys() - set(BIG_FIVE)):
            raise SchemaError(f"lexicon: appeal {appeal.name!r}: no trait {trait!r}; use {', '.join(BIG_FIVE)}")


@cached_data
def lexicon_files() -> tuple[LexiconFile, ...]:
    """Return the words there are: the package's, then the user's.

    Raises
    ------
    SchemaError
        If a file is not as it should be.
    """
    return tuple(read_record(path, LexiconFile, guide=GUIDE) for path in data_files("challenges/influence", "lexicon"))
