"""A film of several shots: who or what is looked at, from where, when, and how fast time goes; one file says so."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from vico.errors import SchemaError
from vico.io.files import read_json
from vico.viewer.follow import Angle, View
from vico.world.model import Record

SCHEMA, VERSION = "vico.shots", 1


class Shot(Record):
    """One shot of a film.

    Attributes
    ----------
    start, stop
        HH:MM:SS, or seconds since the run began.
    follow
        Name of an agent, of a thing, or of something in traffic.
    view
        From where.
    angle
        Instead of the view's own place: metres away from what is followed, degrees round it (0 is behind, 90 to its
        right) and degrees up.
    speed
        Seconds of the run in a second of the film.
    """

    start: str
    stop: str
    follow: str
    view: View = "behind"
    angle: Angle | None = None
    speed: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0


class ShotList(Record):
    """The shots of a film, one after the other."""

    schema_name: Literal["vico.shots"]
    version: Literal[1]
    shots: Annotated[list[Shot], Field(min_length=1)]


def read_shots(path: Path) -> Sequence[Shot]:
    """Read the shots of a film.

    Raises
    ------
    SchemaError
        If the file is damaged, or has a field that is unknown or makes no sense.
    """
    try:
        return ShotList.model_validate(read_json(path)).shots
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "shots"
        raise SchemaError(f"{path}: {where}: {first['msg']}; docs/pictures.md shows a list of shots") from None
