"""What happens in a city beside the everyday: a record of what, where and when, and the file that lists such."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from pydantic import ConfigDict, Field

from vico.clock import DAY, seconds_of_day
from vico.errors import InputError
from vico.io.data_files import DataRecord, record_of
from vico.sim.environment.event_kinds import kind_of_event

_GUIDE = "docs/events.md"
_LOUDEST = 130.0  # dB

Region = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class CityEvent:
    """An event in the city.

    Attributes
    ----------
    kind
        As `vico.sim.environment.event_kinds` names it.
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
        found = asdict(self)
        return found | {"region": list(self.region) if self.region else None, "end": _finite(self.end)}

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


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
