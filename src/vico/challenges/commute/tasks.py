"""Tasks of the commute challenge: a resident's day of appointments, in JSON, and all numbers of the challenge.

docs/commute.md explains the numbers.
"""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from vico.clock import clock_of
from vico.errors import SchemaError
from vico.io.files import read_json, write_json
from vico.rules import BIKE_SPEED, WALK_SPEED
from vico.world.model import Point2, Record
from vico.world.world import World

#: Who is this near to the point of an appointment, on foot or on a bicycle (at the day's last one on foot), is there,
#: metres.
ARRIVAL = 3.0
#: Who is this far from where a commute began has left, metres.
LEFT = 5.0

#: Places of a day, and how far one lies from the next at least, metres as the crow flies.
LEAST_PLACES, MOST_PLACES = 4, 8
LEAST_LEG = 250.0
#: Places of which each is chosen.
CANDIDATES = 9

#: Between the end of a stay and the start of the next there are the metres as the crow flies at `WALK_SPEED`, and a
#: share of that time more, drawn from this range.
SLACK = (0.3, 1.1)

#: A stay takes so long at least, and the last one so long exactly: who is not there by then does not arrive; seconds.
LEAST_STAY = 300
LAST_STAY = 900

#: From the end of the first stay to the end of the last, hours, unless a job's setting says otherwise; and its bounds.
#: A day that does not fit is longer: with the least of them stays take no longer than they must, and nearly all that is
#: simulated are ways.
HOURS = 1.0
LEAST_HOURS, MOST_HOURS = 1.0, 14.0
#: The first stay ends in the hour from here on; bounds of all times; seconds of the day.
MORNING = 8 * 3600
EARLIEST, LATEST_END = 5 * 3600, 86_399

#: What an agent may do; `wait` is doing nothing.
LEGAL = ("move_forward", "turn_left", "turn_right", "enter_bus", "exit_bus", "enter_bike", "exit_bike", "wait")
#: Metres a step on foot, and on a bicycle; nobody runs.
MOST_ON_FOOT, MOST_ON_BIKE = WALK_SPEED, BIKE_SPEED

#: In a window of 800 m; smaller ones have as many for their size.
CARS, PEDESTRIANS = 30, 30


SCHEMA = "vico.commute"
VERSION = 1


class Appointment(Record):
    """A stay of the day.

    Attributes
    ----------
    place, name, kind
        Id, name and kind of the place.
    position
        Where one is there: a reachable point before the place, ENU metres.
    start, end
        Seconds of the day: by when to be there, and until when one stays.
    candidates
        Ids of the places of which this one was chosen, nine at most; of home and of the first one the place alone.
    """

    place: str = Field(min_length=1)
    name: str = Field(min_length=1)
    kind: str = Field(min_length=1)
    position: Point2
    start: int = Field(ge=EARLIEST, le=LATEST_END)
    end: int = Field(ge=EARLIEST, le=LATEST_END)
    candidates: list[str] = Field(min_length=1, max_length=9)

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if not all(math.isfinite(v) for v in self.position):
            raise ValueError("position: give two finite numbers, ENU metres")
        if self.end - self.start < LEAST_STAY:
            raise ValueError(f"end: {self.end - self.start} s after the start; a stay takes {LEAST_STAY} s or more")
        if self.place not in self.candidates:
            raise ValueError(f"candidates: {self.place!r} is not among them")
        return self


class Commuter(Record):
    """Whose day it is.

    Attributes
    ----------
    cash
        Money at the start.
    """

    id: str
    name: str
    age: int = Field(ge=0, le=110)
    occupation: str
    lifestyle: str
    cash: float = Field(ge=0, le=1e6, allow_inf_nan=False)


class CommuteTask(Record):
    """One episode: every appointment after the first asks for a commute.

    Attributes
    ----------
    world_digest
        Identity of the world the task belongs to.
    community
        Seed of the community the resident is of.
    """

    schema_name: Literal["vico.commute"] = "vico.commute"
    version: Literal[1] = 1
    world: str
    world_digest: str
    seed: int = Field(ge=0)
    community: int = Field(ge=0)
    resident: Commuter
    appointments: list[Appointment] = Field(min_length=2, max_length=MOST_PLACES + 1)

    @model_validator(mode="after")
    def _is_a_day(self) -> Self:
        for k, (before, after) in enumerate(pairwise(self.appointments)):
            if after.start <= before.end:
                raise ValueError(
                    f"appointments.{k + 1}.start: {clock_of(after.start)} is not after {clock_of(before.end)}, when "
                    "the one before ends"
                )
            away = math.dist(before.position, after.position)
            if away < LEAST_LEG:
                raise ValueError(
                    f"appointments.{k + 1}.position: {away:.0f} m from the one before; it has to be {LEAST_LEG:g} m "
                    "or more"
                )
        return self

    @property
    def commutes(self) -> int:
        """How many commutes it asks for."""
        return len(self.appointments) - 1

    @property
    def seconds(self) -> int:
        """From the end of the first stay to the end of the last."""
        return self.appointments[-1].end - self.appointments[0].end

    @property
    def metres(self) -> float:
        """All legs as the crow flies."""
        return sum(math.dist(a.position, b.position) for a, b in pairwise(self.appointments))

    def instructions(self) -> list[dict[str, Any]]:
        """Return what the agent is told: the day and whose it is; no candidates."""
        told = [item.model_dump(mode="json", exclude={"candidates"}) for item in self.appointments]
        return [{"resident": self.resident.model_dump(mode="json"), "appointments": told}]


def write_task(path: Path, task: CommuteTask) -> None:
    """Write a task file."""
    write_json(path, task.model_dump(mode="json"))


def read_task(path: Path, *, world: World | None = None) -> CommuteTask:
    """Read a task file.

    Parameters
    ----------
    world
        The task has to be of this world, and its places where the world has them.

    Raises
    ------
    SchemaError
        If the file is damaged, of another version or world, or asks for nonsense; the message names the field.
    """
    content = read_json(path)
    if not isinstance(content, dict) or (content.get("schema_name"), content.get("version")) != (SCHEMA, VERSION):
        raise SchemaError(f"{path}: not a commute task of version {VERSION}; generate the task anew")
    try:
        task = CommuteTask.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        said = first["msg"].removeprefix("Value error, ")
        raise SchemaError(f"{path}: {f'{where}: ' if where else ''}{said}; generate the task anew") from None
    if world is not None:
        _check_world(path, task, world)
    return task


def _check_world(path: Path, task: CommuteTask, world: World) -> None:
    if task.world_digest != world.digest:
        raise SchemaError(
            f"{path}: world_digest: made for another world ({task.world}); generate the task for this one"
        )
    places = {place.id: place for place in world.places}
    for k, item in enumerate(task.appointments):
        where = f"{path}: appointments.{k}"
        if item.place not in places:
            raise SchemaError(f"{where}.place: the world has no place {item.place!r}; generate the task anew")
        if math.dist(item.position, places[item.place].position[:2]) > 1e-6:
            raise SchemaError(f"{where}.position: {item.place} is elsewhere; generate the task anew")
