"""Kinds of city events, as data files name them: where each can be, and what it does."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vico.errors import InputError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

_GUIDE = "docs/events.md"

#: What an event can be at.
Where = Literal["place", "street", "region"]
NotNegative = Annotated[float, Field(ge=0)]
_Hour = Annotated[float, Field(ge=0, le=24)]


class EventKind(DataRecord):
    """What events of a kind do; `data/environment/events.toml` tells each field.

    Attributes
    ----------
    shuts
        Who is closed: nobody, the places it is at, or all trade in its region.
    lanes, walkways
        Whether cars keep off the street, and people off its walkways.
    noise
        dB at 10 m; 0 for none.
    hours, lasts
        Between which hours of the day it begins, and for how many minutes it lasts, when nobody says so.
    radius
        Of its region when nobody says so, metres.
    crowd, crowd_manner
        How many pedestrians come, and whether they watch, stroll between its things, or march along its street.
    often
        How many there are on a day of changing events, on average.
    """

    where: Annotated[list[Where], Field(min_length=1)]
    shuts: Literal["nothing", "places", "trade"] = "nothing"
    lanes: bool = False
    walkways: bool = False
    dark: bool = False
    noise: Annotated[float, Field(ge=0, le=130)] = 0.0
    announced: bool = False
    things: dict[str, Annotated[int, Field(ge=1, le=100)]] = Field(default_factory=dict)
    hours: tuple[_Hour, _Hour] = (8.0, 18.0)
    lasts: tuple[NotNegative, NotNegative] = (60.0, 240.0)
    radius: Annotated[float, Field(gt=0)] = 30.0
    crowd: Annotated[int, Field(ge=0, le=200)] = 0
    crowd_manner: Literal["watch", "stroll", "march"] = "watch"
    often: NotNegative = 0.0


class _Kinds(DataRecord):
    event: dict[str, EventKind]


@cached_data
def event_kinds() -> dict[str, EventKind]:
    """Return the kinds of events by name, in the order of their data files.

    Raises
    ------
    SchemaError
        If a data file is not as docs/events.md says.
    """
    found: dict[str, EventKind] = {}
    for path in data_files("environment", "events"):
        found |= read_record(path, _Kinds, guide=_GUIDE).event
    return found


def kind_of_event(name: str) -> EventKind:
    """Return a kind of event by its name.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    kind = event_kinds().get(name)
    if kind is None:
        raise InputError(f"events: {name!r} is no kind of event; there are {', '.join(event_kinds())}")
    return kind
