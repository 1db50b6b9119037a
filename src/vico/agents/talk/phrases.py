"""Activities and occupations as one says them of oneself: "I'm having dinner", "to have dinner", "I am an engineer".

Schedules say an activity as in a diary: "Have dinner", "Chess table: play chess", "Wash, dress and brush teeth". The
verbs are data, ``vico/data/talk/verbs.toml``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

from pydantic import Field

from vico.agents.talk.grammar import GUIDE, ROOM
from vico.english import participle, uncapitalized, with_article
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

# More of an activity is not said, characters.
_MOST = 80
# Before the second of two verbs: "wash and dress", "wash, dress", "open up, then serve".
_JOINS = re.compile(r"(,? (?:and then|and|or|then|&) |, )")
_PARTICLES = frozenset([
    "about", "after", "ahead", "along", "around", "at", "away", "back", "by", "down", "for", "from", "in", "into",
    "off", "on", "onto", "out", "over", "past", "round", "through", "to", "together", "towards", "under", "up",
    "upon", "with", "without",
])  # fmt: skip
_DETERMINERS = frozenset([
    "a", "an", "another", "my", "one's", "our", "some", "that", "the", "this",
])  # fmt: skip
# Meals that take an article.
_KINDS = frozenset(["big", "brief", "early", "hearty", "late", "light", "long", "packed", "quick", "short", "simple"])
# After these two things may be named: "have a meal and rest", "study music and dance".
_TAKES = frozenset(["attend", "discuss", "enjoy", "have", "study", "take", "watch"])
_ADVERBS = frozenset([
    "also", "always", "just", "now", "often", "still",
])  # fmt: skip
# Schedules speak of anybody; of oneself one says it in the first person, and of those one is with as of others.
_OF_ONESELF = (
    (re.compile(r"\bof one's own\b"), "of my own"),
    (re.compile(r"\bone's\b"), "my"),
    (re.compile(r"\boneself\b"), "myself"),
    (re.compile(r"\byour\b"), "my"),
    (re.compile(r"\byourself\b"), "myself"),
    (re.compile(r"\b(?:each other|one another)'s\b"), "the others'"),
    (re.compile(r"\b(?:each other|one another)\b"), "the others"),
    (re.compile(r"\btogether with\b"), "with"),
    (re.compile(r"(?<=\w) together(?=$| (?:after|at|before|for|in|on|over)\b)"), " with the others"),
    (re.compile(r"\b(?:himself|herself|themselves|themself)\b"), "myself"),
)
# Right after the verb it is one's own: "walk their dog", but "help neighbours with their shopping".
_THEIRS = re.compile(
    rf"^(\S+(?: (?:{'|'.join(sorted(_PARTICLES))}))*) (?:his|her|their) (?!(?:{'|'.join(sorted(_PARTICLES))})\b)"
)
_INFINITIVE = re.compile(r"\bto ([a-z-]+)")
# Occupations that take no article.
_STATES = re.compile(
    r"(?:semi-|early )?retired(?:$| from\b|,)|(?:un|self-)employed$|freelance$|freelancing|between |looking |on |in |"
    r"at |out of |not |studying |working |(?:a|an|the|my|one of) ",
    re.IGNORECASE,
)


_Word = Annotated[str, Field(pattern=r"^[a-z]+(-[a-z]+)*$")]


class _File(DataRecord):
    verbs: list[_Word] = Field(default_factory=list)
    nouns: list[_Word] = Field(default_factory=list)
    dishes: list[_Word] = Field(default_factory=list)
    occasions: list[_Word] = Field(default_factory=list)


@dataclass(frozen=True)
class Verbs:
    """The words of ``verbs.toml``; see `read_verbs`.

    Attributes
    ----------
    verbs
        That activities begin with.
    nouns, dishes
        Those of them that are nouns, too, at the end of a list; of these, those that are nouns before "with" as well.
    occasions
        Words that make a noun of such a verb before them.
    """

    verbs: frozenset[str]
    nouns: frozenset[str]
    dishes: frozenset[str]
    occasions: frozenset[str]

    @cached_property
    def participles(self) -> Mapping[str, str]:
        """Verbs by their participles."""
        return {participle(verb): verb for verb in sorted(self.verbs)}


@cached_data
def read_verbs() -> Verbs:
    """Read the verbs: the package's, then those of a user's own ``$VICO_DATA/talk/verbs*.toml``.

    Raises
    ------
    SchemaError
        If a file is damaged, or a word is not written in small letters.
    """
    files = [read_record(path, _File, guide=GUIDE) for path in data_files(ROOM, "verbs")]
    fields = ("verbs", "nouns", "dishes", "occasions")
    verbs, nouns, dishes, occasions = (frozenset(w for file in files for w in getattr(file, field)) for field in fields)
    return Verbs(verbs, nouns | dishes, dishes, occasions)


@dataclass(frozen=True)
class Activity:
    """An activity in words for a sentence of one's own.

    Attributes
    ----------
    doing
        What follows "I'm" for who is there: "having dinner", "out and about", "here for the team meeting".
    going
        What follows "I'm on my way to PLACE, ": "to have dinner", "for the team meeting".
    """

    doing: str
    going: str

    @property
    def about(self) -> str:
        """What it is, without "I'm": "having dinner", "team meeting"."""
        return self.doing.removeprefix("here for ")


def activity_of(words: str) -> Activity:
    """Return a schedule's activity as one says it of oneself.

    Parameters
    ----------
    words
        "Have dinner", "Chess table: play chess", "Team meeting", "Shopping".
    """
    verbs = read_verbs()
    plain = uncapitalized(_bare(words, verbs)) or "something"
    for pattern, mine in _OF_ONESELF:
        plain = pattern.sub(mine, plain)
    parts = _JOINS.split(plain)
    if parts[0].split(" ", 1)[0] in verbs.participles:
        parts[::2] = [_infinitive(part, verbs) for part in parts[::2]]
    if not _begins_with_verb(parts[0], verbs):
        occasion = _occasion("".join(parts), verbs)
        return Activity(f"here for {occasion}", f"for {occasion}")
    doing, going, infinitive = "", "", False
    for k, part in enumerate(parts):
        follows = k > 0 and k % 2 == 0 and not infinitive
        if k == 0 or (follows and ("then" in parts[k - 1] or _is_verb(part, parts[k - 2], verbs))):
            part = _THEIRS.sub(r"\1 my ", part)
            # "Get ready to go out and play": what follows an infinitive is one.
            found = _INFINITIVE.search(part)
            infinitive = found is not None and found[1] in verbs.verbs
            doing += _turned(part, verbs)
        else:
            doing += part
        going += part
    return Activity(doing.removeprefix("being "), f"to {going}")


def _infinitive(part: str, verbs: Verbs) -> str:
    first, space, rest = part.partition(" ")
    return f"{verbs.participles.get(first, first)}{space}{rest}"


def _occasion(words: str, verbs: Verbs) -> str:
    """Return an activity without a verb as one says it: "the team meeting", "a quick lunch", "breakfast"."""
    first, *_ = listed = words.split(" ")
    if first in _DETERMINERS:
        return words
    if first in _KINDS and not words.endswith("s"):
        return with_article(words)
    upto = next((k for k, word in enumerate(listed) if word in _PARTICLES or word == "and"), len(listed))
    return f"the {words}" if listed[max(0, upto - 1)] in verbs.occasions else words


def vocation_of(occupation: str) -> str:
    """Return what follows "I am": "an engineer", "a UX designer", "retired"; empty where there is none to say."""
    plain = " ".join(occupation.split()).strip(" .!,;:").replace("?", "")
    if not plain or _STATES.match(plain):
        return uncapitalized(plain)
    return with_article(uncapitalized(plain))


def _bare(words: str, verbs: Verbs) -> str:
    """Return an activity without the name of the group that does it, and without what would break a sentence's form."""
    plain = re.sub(r"^(?:I am|I'm|I) (?=\w)", "", " ".join(words.split()))
    head, colon, tail = plain.rpartition(": ")
    # "Chess table: play chess"; but not "Enjoy a cake at Cafe Engel: the new one", nor "Work at M. A. D: Micro Design".
    if colon and (_begins_with_verb(tail, verbs) or not _begins_with_verb(head, verbs)):
        plain = tail
    plain = re.sub(r"\s*\([^)]*\)|[?()]", "", plain)
    plain = re.split(r"[!;:] |(?<=[a-z]{4})\. ", plain)[0].strip().rstrip(".!,;:")
    return plain if len(plain) <= _MOST else plain[:_MOST].rsplit(" ", 1)[0].rstrip(" ,;")


def _begins_with_verb(words: str, verbs: Verbs) -> bool:
    """Whether an activity begins with a verb, or with an adverb and a verb."""
    first, second = [*(word.strip(",.").lower() for word in words.split(" ", 2)), "", ""][:2]
    if first in verbs.verbs:
        return not (first in verbs.nouns and second in verbs.occasions) and (first, second) != (
            "visit",
            "to",
        )
    if _is_adverb(first, verbs):
        return second in verbs.verbs
    # Any other word before an article is a verb: "Untangle the nets".
    return first.isalpha() and second in _DETERMINERS and first not in _PARTICLES | _DETERMINERS


def _is_adverb(word: str, verbs: Verbs) -> bool:
    return word in _ADVERBS or (word.endswith("ly") and word not in verbs.verbs)


def _is_verb(part: str, before: str, verbs: Verbs) -> bool:
    """Whether what follows "and" begins with a verb; `before` is what comes before."""
    first, second, *_ = [*part.split(" "), "", ""]
    if _is_adverb(first, verbs) and second in verbs.verbs:
        return True
    if first not in verbs.verbs:
        return False
    # After verbs without an object: "wash and dress", "get up and walk".
    bare = all(word in verbs.verbs or word in _PARTICLES for word in before.split(" "))
    if bare or first not in verbs.nouns or second in _DETERMINERS:
        return True
    if first in verbs.dishes:
        return bool(second) and second not in _PARTICLES
    return bool(second) or before.split(" ", 1)[0] not in _TAKES


def _turned(part: str, verbs: Verbs) -> str:
    """Put the verb that words begin with into its participle."""
    first, space, rest = part.partition(" ")
    if _is_adverb(first, verbs):
        return f"{first} {_turned(rest, verbs)}"
    return f"{participle(first)}{space}{rest}"


__all__ = ["Activity", "Verbs", "activity_of", "read_verbs", "vocation_of"]
