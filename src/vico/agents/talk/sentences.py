"""The sentences of answers: saying them, reading them back, and directions in words.

Sentences are data, ``vico/data/agents/talk/answers.toml``; they are said by filling them in, and read by their words:
who was where and when, and how far a place is. Whoever asked reads them by the same file, so that a planner need not
know its words. What a language model says in words of its own is not read. Directions tell a way from the public map
alone: along which streets, how far, and where to turn.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vico.agents.talk.grammar import DATA_FOLDER, GUIDE
from vico.clock import seconds_of_day
from vico.errors import InputError, SchemaError
from vico.io.data_files import PACKAGED, DataRecord, cached_data, own_files, read_record
from vico.world.public import PublicMap, PublicPlace

__all__ = [
    "MOST_LEGS",
    "SENTENCES",
    "STEPS",
    "WHEREABOUTS",
    "Claim",
    "Sentences",
    "StreetLeg",
    "claims_in",
    "describe_way",
    "legs_of",
    "place_named",
    "read_sentences",
    "round_distance",
    "turn_between",
    "whereabouts",
]
#: Fields that each sentence has.
SENTENCES: Mapping[str, frozenset[str]] = {
    name: frozenset(fields.split())
    for name, fields in {
        "see": "person metres direction",
        "saw_in": "person place time",
        "saw_near": "person place time",
        "saw_away": "person time",
        "told": "source person place time",
        "usual": "person place",
        "usual_way": "person place",
        "lives": "person place",
        "not_seen": "person",
        "unknown_person": "",
        "which_person": "",
        "myself": "person",
        "place": "place metres direction",
        "here": "place",
        "way": "place steps metres",
        "no_way": "place",
        "unknown_place": "",
        "doing": "errand",
        "did": "place time until activity",
        "did_nothing": "",
        "since": "place time activity",
        "plan": "place time until activity",
        "no_plans": "",
        "who": "person occupation",
        "who_only": "person",
        "busy": "",
    }.items()
}
STEPS: Mapping[str, frozenset[str]] = {
    "start": frozenset({"direction", "street", "metres"}),
    **{turn: frozenset({"street", "metres"}) for turn in ("left", "right", "straight", "back")},
    **{door: frozenset() for door in ("door_left", "door_right", "door_ahead", "further")},
}
#: How each field is read; what is not listed may be any words.
_READ = {
    "time": r"\d\d:\d\d",
    "until": r"\d\d:\d\d",
    "metres": r"\d{1,6}",
    "person": r"[^.!?:,\d]{1,60}?",
    "source": r"[^.!?:,]{1,60}?",
    "place": r".{1,120}?",
}
_OTHER = r".{1,600}?"
_FIELD = re.compile(r"\{(\w+)\}")


class _SentenceFile(DataRecord):
    compass: Annotated[list[str], Field(min_length=8, max_length=8)]
    unnamed: Annotated[str, Field(min_length=1)]
    sentence: dict[str, str]
    step: dict[str, str]


@dataclass(frozen=True)
class Sentences:
    """What can be said; see `read_sentences`."""

    compass: tuple[str, ...]
    unnamed: str
    sentences: Mapping[str, str]
    steps: Mapping[str, str]

    def say(self, sentence: str, **fields: str | int) -> str:
        """Fill a sentence in, in one pass."""
        return _fill(self.sentences[sentence], fields)

    def step(self, step: str, **fields: str | int) -> str:
        """Fill a part of a way in."""
        return _fill(self.steps[step], fields)

    def direction(self, east: float, north: float) -> str:
        """Return the nearest of the eight directions."""
        return self.compass[round(math.atan2(north, east) / (math.pi / 4)) % 8]

    @cached_property
    def patterns(self) -> list[tuple[str, re.Pattern[str]]]:
        """What each sentence with fields is known by."""
        return [(name, _sentence_pattern(text)) for name, text in self.sentences.items() if "{" in text]


def _fill(text: str, fields: Mapping[str, str | int]) -> str:
    return _FIELD.sub(lambda match: str(fields[match[1]]), text)


def _sentence_pattern(text: str) -> re.Pattern[str]:
    parts = _FIELD.split(text)  # words and fields by turns
    read = [f"(?P<{part}>{_READ.get(part, _OTHER)})" if k % 2 else re.escape(part) for k, part in enumerate(parts)]
    return re.compile(r"(?:^|(?<=[.!?] ))" + "".join(read))


@cached_data
def read_sentences() -> Sentences:
    """Read the sentences: a user's own ``$VICO_DATA/agents/talk/answers.toml`` if there is one, else the package's.

    Raises
    ------
    SchemaError
        If the file is damaged, or a sentence is missing, unknown, or has other fields than it must.
    """
    own = [path for path in own_files(DATA_FOLDER, "answers") if path.name == "answers.toml"]
    path = own[0] if own else PACKAGED / DATA_FOLDER / "answers.toml"
    file = read_record(path, _SentenceFile, guide=GUIDE)
    for table, said, wanted in (("sentence", file.sentence, SENTENCES), ("step", file.step, STEPS)):
        if said.keys() != wanted.keys():
            odd = sorted(said.keys() ^ wanted.keys())[0]
            raise SchemaError(f"{path}: {table}.{odd}: {'missing' if odd in wanted else 'unknown'}; see {GUIDE}")
        for name, text in said.items():
            if fault := _sentence_fault(text, wanted[name], reads=table == "sentence"):
                raise SchemaError(f"{path}: {table}.{name}: {fault}; see {GUIDE}")
    return Sentences(tuple(file.compass), file.unnamed, file.sentence, file.step)


def _sentence_fault(text: str, wanted: frozenset[str], *, reads: bool) -> str:
    """Return what is wrong with a sentence; empty if nothing is."""
    fields = _FIELD.findall(text)
    if sorted(fields) != sorted(wanted):
        return f"its fields are {', '.join(sorted(wanted)) or 'none'}, each once, not {', '.join(fields) or 'none'}"
    if "?" in text:
        return "answers hold no question mark"
    if reads and fields and (re.search(r"\}\s*\{", text) or text.endswith("}") or text[-1] not in ".!"):
        return "words stand between fields and a full stop at the end, so that it can be read back"
    return ""


# Longer texts are not read, characters.
_MAX_TEXT = 2000
#: Sentences that tell where somebody is, the surest first.
WHEREABOUTS = ("see", "myself", "saw_in", "saw_near", "saw_away", "told", "usual", "usual_way", "lives")


@dataclass(frozen=True)
class Claim:
    """What a sentence says; what it doesn't say is empty or None.

    Attributes
    ----------
    kind
        The sentence's name in ``answers.toml``.
    person
        Whom it is about; empty: who says it.
    place
        Name of a place.
    time, until
        Seconds of the day.
    metres, direction
        How far, and in which of the eight directions.
    source
        Who said so to the speaker.
    text
        Anything else it tells: steps of a way, an activity, an errand.
    """

    kind: str
    person: str = ""
    place: str = ""
    time: float | None = None
    until: float | None = None
    metres: int | None = None
    direction: str = ""
    source: str = ""
    text: str = ""


def claims_in(text: str) -> list[Claim]:
    """Return what a text says in the sentences that residents use, in order."""
    said = " ".join(text[:_MAX_TEXT].split())
    found: list[tuple[int, Claim]] = []
    for kind, pattern in read_sentences().patterns:
        for match in pattern.finditer(said):
            claim = _claim_from_fields(kind, match.groupdict())
            if claim is not None:
                found.append((match.start(), claim))
    return [claim for _, claim in sorted(found, key=lambda one: one[0])]


def _claim_from_fields(kind: str, fields: dict[str, str]) -> Claim | None:
    try:
        times = {name: float(seconds_of_day(fields.pop(name))) for name in ("time", "until") if name in fields}
    except InputError:
        return None
    metres = int(fields.pop("metres")) if "metres" in fields else None
    person, place = fields.pop("person", ""), fields.pop("place", "")
    direction, source = fields.pop("direction", ""), fields.pop("source", "")
    text = "; ".join(fields.values())
    return Claim(kind, person, place, times.get("time"), times.get("until"), metres, direction, source, text)


def whereabouts(text: str, person: str) -> list[Claim]:
    """Return what a text says of where somebody is or was, the surest and latest first.

    Parameters
    ----------
    person
        Full name.
    """
    found = [one for one in claims_in(text) if one.kind in WHEREABOUTS and one.person.lower() == person.lower()]
    return sorted(found, key=lambda one: (WHEREABOUTS.index(one.kind), -(one.time or 0.0)))


def place_named(places: Iterable[PublicPlace] | PublicMap, name: str) -> PublicPlace | None:
    """Return the place of a name, as maps and answers have it; None if there is none, the first of several."""
    listed = places.places if isinstance(places, PublicMap) else places
    wanted = name.strip().lower()
    return next((place for place in listed if place.name.lower() == wanted), None)


# A way is looked at every so many metres; what is shorter than the second belongs to the leg before it.
_SAMPLE, _SHORTEST = 4.0, 16.0
_COURSE_LENGTH = 12.0  # metres of the way before and after a turn from which it is told
_TURN_ANGLE = 35.0  # degrees from which on it is a turn
_U_TURN_ANGLE = 150.0  # degrees from which on one turns round
# Most legs that are told of: nobody remembers more.
MOST_LEGS = 6


@dataclass(frozen=True)
class StreetLeg:
    """A part of a way along one street.

    Attributes
    ----------
    street
        Its name; empty where it has none.
    metres
        How far.
    begins, ends
        Unit vectors that one walks along at its beginning and end, east and north.
    """

    street: str
    metres: float
    begins: tuple[float, float]
    ends: tuple[float, float]


def round_distance(metres: float) -> int:
    """Return a distance as one says it: to 10 m, from 300 m on to 50 m."""
    step = 10 if metres < 300 else 50
    return max(step, round(metres / step) * step)


def legs_of(path: NDArray[np.float64], public_map: PublicMap) -> list[StreetLeg]:
    """Split a way where it leaves a street.

    Parameters
    ----------
    path
        ENU metres, shape ``(n, 2)``, at least two points.
    """
    reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    total = float(reached[-1])
    at = np.linspace(0.0, total, max(2, math.ceil(total / _SAMPLE) + 1))
    points = np.column_stack([np.interp(at, reached, path[:, k]) for k in range(2)])
    streets = public_map.street_index.streets_at(points)
    cuts = _leg_starts(streets, at)
    found = []
    for first, last in zip(cuts, [*cuts[1:], len(at) - 1], strict=True):
        middle = streets[first + 1 : last] or streets[first : last + 1]
        most = max(sorted(set(middle)), key=middle.count)
        found.append(
            StreetLeg(most, float(at[last] - at[first]), _course(points, at, first, 1), _course(points, at, last, -1))
        )
    return found


def _leg_starts(streets: list[str], at: NDArray[np.float64]) -> list[int]:
    """Return where legs begin: where a street lasts long enough to be told of."""
    runs: list[tuple[int, int]] = []
    for k, street in enumerate(streets):
        if runs and streets[runs[-1][0]] == street:
            runs[-1] = runs[-1][0], k
        else:
            runs.append((k, k))
    long = [run for run in runs if at[min(run[1] + 1, len(at) - 1)] - at[run[0]] >= _SHORTEST]
    cuts = [0]
    before = streets[long[0][0]] if long else ""
    for first, _ in long[1:]:
        if streets[first] != before:
            cuts.append(first)
            before = streets[first]
    return cuts


def _course(points: NDArray[np.float64], at: NDArray[np.float64], k: int, sign: int) -> tuple[float, float]:
    """Return the direction one walks in just after (1) or before (-1) a point of the way."""
    there = float(np.clip(at[k] + sign * _COURSE_LENGTH, 0.0, at[-1]))
    other = np.array([np.interp(there, at, points[:, axis]) for axis in range(2)])
    ahead = (other - points[k]) * sign
    length = float(np.linalg.norm(ahead)) or 1.0
    return float(ahead[0] / length), float(ahead[1] / length)


def turn_between(before: tuple[float, float], after: tuple[float, float]) -> str:
    """Return how one turns from a direction into another: left, right, straight or back."""
    cross = before[0] * after[1] - before[1] * after[0]
    angle = math.degrees(math.atan2(cross, before[0] * after[0] + before[1] * after[1]))
    if abs(angle) >= _U_TURN_ANGLE:
        return "back"
    if abs(angle) < _TURN_ANGLE:
        return "straight"
    return "left" if angle > 0 else "right"


def describe_way(
    public_map: PublicMap, start: tuple[float, float], place: PublicPlace, sentences: Sentences
) -> tuple[str, float] | None:
    """Tell the way on foot to a place.

    Parameters
    ----------
    start
        ENU metres.

    Returns
    -------
    tuple or None
        The steps in words, and metres in all; None if there is no way.
    """
    path = public_map.router.path(start, place.position[:2])
    if path is None:
        return None
    points = np.asarray(path, np.float64).reshape(-1, 2)
    metres = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if len(points) < 2 or metres < 1.0:
        return sentences.steps["door_ahead"].removeprefix("and "), metres
    legs = legs_of(points, public_map)
    first = legs[0]
    said = [sentences.step("start", direction=sentences.direction(*first.begins), **_leg_fields(first, sentences))]
    told = legs[:MOST_LEGS]
    said += [
        sentences.step(turn_between(before.ends, leg.begins), **_leg_fields(leg, sentences))
        for before, leg in pairwise(told)
    ]
    whole = len(legs) == len(told)
    said.append(sentences.steps[_door_side(place, points[-1], legs[-1].ends) if whole else "further"])
    return ", ".join(said), metres


def _leg_fields(leg: StreetLeg, sentences: Sentences) -> dict[str, str | int]:
    return {"street": leg.street or sentences.unnamed, "metres": round_distance(leg.metres)}


def _door_side(place: PublicPlace, end: NDArray[np.float64], course: tuple[float, float]) -> str:
    """Return on which side the door is for who comes along a way."""
    if place.entrance is None:
        return "door_ahead"
    to = place.entrance[0] - float(end[0]), place.entrance[1] - float(end[1])
    if math.hypot(*to) < 0.1:
        return "door_ahead"
    side = turn_between(course, to)
    return f"door_{side}" if side in ("left", "right") else "door_ahead"
