"""What the classes of detectors stand for, and the rules by which they are placed: data, read once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.worldgen.objects.kinds import thing_of

GUIDE = "docs/detections.md"
_ROOM, _KIND = "objects", "detections"

Length = Annotated[float, Field(gt=0.0, le=500.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Count = Annotated[int, Field(ge=1, le=100)]


class Rules(DataRecord):
    """How detections are placed; the file says what each number means."""

    least_score: Share
    reach: Length
    bearing: Annotated[float, Field(gt=0.0, le=20.0)]
    raised_photos: Count
    alone_score: Share
    alone_reach: Length
    apart: Length
    same: Length
    map_wins: Length
    photos_to_move: Count


class DetectedClass(DataRecord):
    """What a class stands for.

    Attributes
    ----------
    names
        As detectors call it, in small letters.
    tags
        What a map would say of it.
    raised
        The lower side of its box is not on the ground.
    """

    names: tuple[str, ...] = Field(min_length=1)
    tags: dict[str, str] = Field(min_length=1)
    raised: bool = False


class _ClassesFile(DataRecord):
    rules: Rules | None = None
    classes: tuple[DetectedClass, ...] = Field(default=(), alias="class")


@dataclass(frozen=True)
class Classes:
    """Classes by name, and the rules."""

    rules: Rules
    by_name: Mapping[str, DetectedClass]


@cached_data
def detected_classes() -> Classes:
    """Return the classes; of two entries for a name, and of two sets of rules, the user's counts.

    Raises
    ------
    SchemaError
        If a file can't be used, or the tags of a class are nothing that stands in streets.
    """
    rules: Rules | None = None
    by_name: dict[str, DetectedClass] = {}
    for path in data_files(_ROOM, _KIND):
        file = read_record(path, _ClassesFile, guide=GUIDE)
        rules = file.rules or rules
        for k, entry in enumerate(file.classes):
            if entry.tags.get("natural") != "tree" and thing_of(entry.tags) is None:
                raise SchemaError(f"{path}: class.{k}.tags: no model stands for them; see docs/adding_an_object.md")
            by_name |= dict.fromkeys((name.lower() for name in entry.names), entry)
    if rules is None:
        raise SchemaError(f"{_ROOM}/{_KIND}: no file has [rules]; see {GUIDE}")
    return Classes(rules, by_name)
