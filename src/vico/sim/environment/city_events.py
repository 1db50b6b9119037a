"""Events of a city: kinds of them as data files name them, records of what, where and when, and files of such.

An `Occurrence` is an event of a run, with what its kind and place make of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field

from vico.clock import DAY, seconds_of_day
from vico.errors import InputError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record, record_of

_GUIDE = "docs/events.md"

#: What an event can be at.
Where = Literal["place", "street", "region"]
NotNegative = Annotated[float, Field(ge=0)]
_Hour = Annotated[float, Field(ge=0, le=24)]


class EventKind(DataRecord):
    """What events of a kind do; `data/sim/environment/events.toml` tells each field.

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
    for path in data_files("sim/environment", "events"):
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


_LOUDEST = 130.0  # dB

Region = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class CityEvent:
    """An event in the city.

    Attributes
    ----------
    kind
        As `vico.sim.environment.city_events` names it.
    place, street
        Id or name of a place; name of a street, or id of one of its roads. At least one of these and `region`.
    region
        x, y and radius, ENU metres: the event's ground; of a street, the part within.
    begin, end
        Seconds after the first midnight; it goes on from `begin` to before `end`.
    name
        What it is called.
    noise
        dB at 10 m; None: as its kind says.
    walkways
        Whether the street's walkways are closed; None: as its kind says.
    """

    kind: str
    begin: float
    end: float
    place: str = ""
    street: str = ""
    region: Region | None = None
    name: str = ""
    noise: float | None = None
    walkways: bool | None = None

    def __post_init__(self) -> None:
        kind = kind_of_event(self.kind)
        given = [name for name in ("place", "street", "region") if getattr(self, name)]
        if not [name for name in given if name in kind.where]:
            raise InputError(f"events: {self.kind}: where is it? give {' or '.join(kind.where)}")
        unfit = [name for name in given if name not in kind.where and not (name == "region" and self.street)]
        if unfit:
            raise InputError(f"events: {self.kind} can't be at a {unfit[0]}; give {' or '.join(kind.where)}")
        if not (math.isfinite(self.begin) and self.end >= self.begin >= 0):
            raise InputError(
                f"events: {self.kind}: from {self.begin:g} s to {self.end:g} s; it can't end before it begins"
            )
        if self.region is not None and (not all(map(math.isfinite, self.region)) or not self.region[2] > 0):
            raise InputError(f"events: {self.kind}: region {list(self.region)}; give x, y and a radius above 0, metres")
        if self.noise is not None and not 0 <= self.noise <= _LOUDEST:
            raise InputError(f"events: {self.kind}: noise of {self.noise:g} dB; it has to be 0..{_LOUDEST:g}")

    def goes_on(self, second: float) -> bool:
        """Return whether it goes on at a moment, seconds after the first midnight."""
        return self.begin <= second < self.end

    @property
    def title(self) -> str:
        """What to call it: its name, or else its kind."""
        return self.name or self.kind.replace("_", " ")

    def record(self) -> dict[str, Any]:
        """Return the event as JSON has it; an end that nobody knows is None."""
        region = list(self.region) if self.region else None
        return asdict(self) | {"region": region, "end": self.end if math.isfinite(self.end) else None}

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> CityEvent:
        """Return the event that `record` described."""
        region, end = record["region"], record["end"]
        parsed = {"region": tuple(region) if region else None, "end": math.inf if end is None else end}
        return cls(**(dict(record) | parsed))


class _Line(DataRecord):
    """An event in a file of events."""

    model_config = ConfigDict(allow_inf_nan=False)

    kind: str
    begin: str
    end: str | None = None
    day: int = Field(default=0, ge=0, le=10_000)
    place: str = ""
    street: str = ""
    region: tuple[float, float, float] | None = None
    name: str = Field(default="", max_length=200)
    noise: float | None = None
    walkways: bool | None = None


class _File(DataRecord):
    events: tuple[_Line, ...] = Field(max_length=1000)


def planned_events(record: Mapping[str, Any], *, source: str = "events") -> list[CityEvent]:
    """Return the events that a file of events lists; docs/events.md describes it.

    Raises
    ------
    SchemaError
        If it is not of that form.
    InputError
        If it names a kind that is not known, or a number is out of range.
    """
    lines = record_of(record, _File, source=source, guide=_GUIDE).events
    return [_event(line, f"{source}: events.{k}") for k, line in enumerate(lines)]


def _event(line: _Line, where: str) -> CityEvent:
    try:
        begin = float(line.day * DAY + seconds_of_day(line.begin))
        end = math.inf if line.end is None else float(line.day * DAY + seconds_of_day(line.end))
        # One that ends at an earlier hour than it begins goes on past midnight.
        end += DAY if end <= begin else 0
        given = line.model_dump(exclude={"begin", "end", "day"})
        return CityEvent(begin=begin, end=end, **given)
    except InputError as error:
        raise InputError(f"{where}: {str(error).removeprefix('events: ')}") from None


@dataclass(frozen=True)
class Occurrence:
    """An event of a run.

    Attributes
    ----------
    id
        Counts from 1; an event keeps it.
    middle
        The point it is at, ENU metres.
    circles
        Ground that it closes to people: x, y and radius, ENU metres.
    """

    id: int
    event: CityEvent
    kind: EventKind
    middle: NDArray[np.float64]
    circles: tuple[tuple[float, float, float], ...]

    @property
    def noise(self) -> float:
        """How loud it is 10 m from its middle, dB; 0 for not at all."""
        return self.kind.noise if self.event.noise is None else self.event.noise
