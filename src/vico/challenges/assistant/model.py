"""Task files of the assistant challenge: everything one episode needs, in JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from vico.errors import SchemaError
from vico.io.files import read_json, write_json
from vico.world.model import Point2, Point3, Record

SCHEMA = "vico.task"
VERSION = 1


class Region(Record):
    """Where something is to be found or brought to.

    Attributes
    ----------
    kind
        ``place``: inside a place, any of its rooms; ``outdoor``: within `radius` of `centre`.
    place
        Place id; None outdoors.
    centre
        The place's entrance, or the middle of the outdoor region, metres.
    radius
        Metres; 0 for places, whose rooms are the bounds.
    """

    kind: Literal["place", "outdoor"]
    name: str
    place: str | None
    centre: Point3
    radius: float


class TaskObject(Record):
    """A thing of the task, where it lies at the start. Agents are told its name, never where it is."""

    id: str
    kind: str
    colour: str
    name: str
    position: Point3
    yaw: float
    room: str | None


class Subtask(Record):
    """One errand: what the agent is told, and what its choices were drawn from.

    Attributes
    ----------
    object_candidates, source_candidates, destination_candidates
        The nine each that object, source and destination were chosen from, as the chooser saw them.
    """

    index: int
    text: str
    objects: list[str]
    source: Region
    destination: Region
    object_candidates: list[str]
    source_candidates: list[str]
    destination_candidates: list[str]


class Start(Record):
    """Where an assistant begins, and which way it looks."""

    position: Point2
    yaw: float


class Task(Record):
    """One episode.

    Attributes
    ----------
    world_digest
        Identity of the world the task belongs to.
    """

    schema_name: str = SCHEMA
    version: int = VERSION
    category: Literal["delivery"]
    world: str
    world_digest: str
    seed: int
    steps: int
    assistants: list[Start]
    objects: list[TaskObject]
    subtasks: list[Subtask]

    def instructions(self) -> list[dict[str, Any]]:
        """Return what the assistants are told: no position of any object, no candidates."""
        names = {thing.id: thing.name for thing in self.objects}
        return [
            {
                "index": subtask.index,
                "text": subtask.text,
                "objects": [names[i] for i in subtask.objects],
                "source": subtask.source.model_dump(),
                "destination": subtask.destination.model_dump(),
            }
            for subtask in self.subtasks
        ]


class StateView(Protocol):
    """What an evaluator may look at: the truth, not any agent's view of it."""

    def object_position(self, name: str) -> NDArray[np.float64]:
        """Where the thing called `name` is, metres, shape ``(3,)``."""

    def object_room(self, name: str) -> str | None:
        """Id of the room it is in; None outdoors."""

    def object_holder(self, name: str) -> str | None:
        """Name of the agent that holds it; None if nobody does."""


def write_task(path: Path, task: Task) -> None:
    """Write a task file."""
    write_json(path, task.model_dump(mode="json"))


def read_task(path: Path, *, world_digest: str | None = None) -> Task:
    """Read a task file.

    Raises
    ------
    SchemaError
        If the file is damaged, of another version, or made for another world.
    """
    content = read_json(path)
    found = (content.get("schema_name"), content.get("version")) if isinstance(content, dict) else None
    if found != (SCHEMA, VERSION):
        raise SchemaError(f"{path}: not a task file of version {VERSION}; generate the task anew")
    try:
        task = Task.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise SchemaError(f"{path}: {where}: {first['msg']}; generate the task anew") from None
    if world_digest is not None and task.world_digest != world_digest:
        raise SchemaError(f"{path}: made for another world ({task.world}); generate the task for this one")
    return task
