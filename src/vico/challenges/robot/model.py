"""Task files of the community robot challenge: everything one episode needs, in JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from vico.assets.models.movable import movable_colours, movable_kinds
from vico.challenges.assistant.model import Person, Region, Start, TaskObject
from vico.errors import SchemaError
from vico.io.files import read_json, write_json
from vico.world.folder import World
from vico.world.model import Record

SCHEMA, VERSION = "vico.robot_task", 1

Category = Literal["carry", "deliver"]
CATEGORIES: tuple[Category, ...] = ("carry", "deliver")


class RobotTask(Record):
    """One episode: one thing that two robots bring to its destination.

    Attributes
    ----------
    world_digest, community_digest
        Identity of the world and of the community the task belongs to.
    start
        Time of day at which it begins, ``HH:MM``.
    steps
        Seconds at most.
    manipulator, carrier
        Where the robots begin.
    text
        What they are told.
    person
        Who asks; with Carry whose thing it is, and who is to be gone along with.
    waits_at
        With Carry where the person waits with the thing in hand; else None.
    thing
        What is to be brought; agents are told its name, never where it is.
    source
        Where it lies about, or with Carry where the person waits.
    destination
        Where it is to be at the end; with Carry the person's home.
    candidates
        What was chosen from, by question, as the chooser saw it.
    """

    schema_name: str = SCHEMA
    version: int = VERSION
    category: Category
    world: str
    world_digest: str
    community_digest: str
    seed: int
    start: Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d$")]
    steps: Annotated[int, Field(ge=1)]
    manipulator: Start
    carrier: Start
    text: str
    person: Person
    waits_at: Start | None
    thing: TaskObject
    source: Region
    destination: Region
    candidates: dict[str, list[str]]

    @model_validator(mode="after")
    def _person_waits_with_the_thing(self) -> Self:
        if (self.waits_at is not None) != (self.category == "carry"):
            raise ValueError(f"{self.category}: {'nobody waits' if self.waits_at else 'somebody waits'} with the thing")
        holder = self.person.agent if self.category == "carry" else None
        if self.thing.holder != holder:
            raise ValueError(f"{self.category}: the thing is held by {self.thing.holder!r}; it has to be {holder!r}")
        return self

    def instruction(self) -> dict[str, Any]:
        """Return what the robots are told: no position of the thing, no candidates."""
        return {
            "category": self.category,
            "text": self.text,
            "object": self.thing.name,
            "person": self.person.model_dump(),
            "source": self.source.model_dump(),
            "destination": self.destination.model_dump(),
            "seconds": self.steps,
        }


def write_robot_task(path: Path, task: RobotTask) -> None:
    """Write a task file."""
    write_json(path, task.model_dump(mode="json"))


def read_robot_task(path: Path, *, world: World | None = None) -> RobotTask:
    """Read a task file.

    Raises
    ------
    SchemaError
        If the file is damaged, of another version, made for another world, or names what the world does not have.
    """
    content = read_json(path)
    found = (content.get("schema_name"), content.get("version")) if isinstance(content, dict) else None
    if found != (SCHEMA, VERSION):
        raise SchemaError(f"{path}: not a robot task file of version {VERSION}; generate the task anew")
    try:
        task = RobotTask.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "task"
        raise SchemaError(f"{path}: {where}: {first['msg']}; generate the task anew") from None
    if task.thing.kind not in movable_kinds() or task.thing.colour not in movable_colours():
        raise SchemaError(
            f"{path}: thing: there is no {task.thing.colour} {task.thing.kind}; add it to the movable things, or "
            "generate the task anew"
        )
    if world is not None:
        _check_against(task, world, path)
    return task


def _check_against(task: RobotTask, world: World, path: Path) -> None:
    if task.world_digest != world.digest:
        raise SchemaError(f"{path}: made for another world ({task.world}); generate the task for this one")
    for region in (task.source, task.destination):
        if region.place is not None and region.place not in world.place_by_id:
            raise SchemaError(f"{path}: the world has no place {region.place!r}; generate the task anew")
