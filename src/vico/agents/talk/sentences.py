"""The sentences of answers, as data: ``vico/data/talk/answers.toml``; said by filling them in, read by their words."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

from pydantic import Field

from vico.agents.talk.grammar import GUIDE, ROOM
from vico.errors import SchemaError
from vico.io.data_files import PACKAGED, DataRecord, cached_data, own_files, read_record

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


class _File(DataRecord):
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
        return _filled(self.sentences[sentence], fields)

    def step(self, step: str, **fields: str | int) -> str:
        """Fill a part of a way in."""
        return _filled(self.steps[step], fields)

    def direction(self, east: float, north: float) -> str:
        """Return the nearest of the eight directions."""
        return self.compass[round(math.atan2(north, east) / (math.pi / 4)) % 8]

    @cached_property
    def patterns(self) -> list[tuple[str, re.Pattern[str]]]:
        """What each sentence with fields is known by."""
        return [(name, _pattern(text)) for name, text in self.sentences.items() if "{" in text]


def _filled(text: str, fields: Mapping[str, str | int]) -> str:
    return _FIELD.sub(lambda match: str(fields[match[1]]), text)


def _pattern(text: str) -> re.Pattern[str]:
    parts = _FIELD.split(text)  # words and fields by turns
    read = [f"(?P<{part}>{_READ.get(part, _OTHER)})" if k % 2 else re.escape(part) for k, part in enumerate(parts)]
    return re.compile(r"(?:^|(?<=[.!?] ))" + "".join(read))


@cached_data
def read_sentences() -> Sentences:
    """Read the sentences: a user's own ``$VICO_DATA/talk/answers.toml`` if there is one, else the package's.

    Raises
    ------
    SchemaError
        If the file is damaged, or a sentence is missing, unknown, or has other fields than it must.
    """
    own = [path for path in own_files(ROOM, "answers") if path.name == "answers.toml"]
    path = own[0] if own else PACKAGED / ROOM / "answers.toml"
    file = read_record(path, _File, guide=GUIDE)
    for table, said, wanted in (("sentence", file.sentence, SENTENCES), ("step", file.step, STEPS)):
        if said.keys() != wanted.keys():
            odd = sorted(said.keys() ^ wanted.keys())[0]
            raise SchemaError(f"{path}: {table}.{odd}: {'missing' if odd in wanted else 'unknown'}; see {GUIDE}")
        for name, text in said.items():
            if fault := _fault(text, wanted[name], reads=table == "sentence"):
                raise SchemaError(f"{path}: {table}.{name}: {fault}; see {GUIDE}")
    return Sentences(tuple(file.compass), file.unnamed, file.sentence, file.step)


def _fault(text: str, wanted: frozenset[str], *, reads: bool) -> str:
    """Return what is wrong with a sentence; empty if nothing is."""
    fields = _FIELD.findall(text)
    if sorted(fields) != sorted(wanted):
        return f"its fields are {', '.join(sorted(wanted)) or 'none'}, each once, not {', '.join(fields) or 'none'}"
    if "?" in text:
        return "answers hold no question mark"
    if reads and fields and (re.search(r"\}\s*\{", text) or text.endswith("}") or text[-1] not in ".!"):
        return "words stand between fields and a full stop at the end, so that it can be read back"
    return ""


__all__ = ["SENTENCES", "STEPS", "Sentences", "read_sentences"]
