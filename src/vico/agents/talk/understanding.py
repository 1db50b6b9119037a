"""What an answer says, read back from its words: who was where and when, and how far a place is.

Residents answer in the sentences of ``vico/data/talk/answers.toml``; whoever asked reads them by the same file, so that
a planner need not know its words. What a language model says in words of its own is not read.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from vico.agents.talk.sentences import read_sentences
from vico.clock import seconds_of_day
from vico.errors import InputError
from vico.world.public import PublicMap, PublicPlace

# Longer texts are not read, characters.
_MOST = 2000
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
    said = " ".join(text[:_MOST].split())
    found: list[tuple[int, Claim]] = []
    for kind, pattern in read_sentences().patterns:
        for match in pattern.finditer(said):
            claim = _claim(kind, match.groupdict())
            if claim is not None:
                found.append((match.start(), claim))
    return [claim for _, claim in sorted(found, key=lambda one: one[0])]


def _claim(kind: str, fields: dict[str, str]) -> Claim | None:
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


__all__ = ["WHEREABOUTS", "Claim", "claims_in", "place_named", "whereabouts"]
