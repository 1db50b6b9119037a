"""Task files of the community robot challenge: everything one episode needs, in JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, Self

from pydantic import model_validator

from vico.challenges.assistant.model import Person, Region, Start, TaskObject
from vico.challenges.task_files import PlacedTask, check_thing, check_world, read_task_file
from vico.world.world import World

SCHEMA, VERSION = "vico.robot_task", 1

Category = Literal["carry", "deliver"]
CATEGORIES: tuple[Category, ...] = ("carry", "deliver")


class RobotTask(PlacedTask):
    """One episode: one thing that two robots bring to its destination.

    Attributes
    ----------
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


def read_robot_task(path: Path, *, world: World | None = None) -> RobotTask:
    """Read a task file.

    Raises
    ------
    SchemaError
        If the file is damaged, of another version, made for another world, or names what the world does not have.
    """
    task = read_task_file(path, RobotTask, schema=SCHEMA, version=VERSION, what="robot task")
    check_thing(path, task.thing)
    if world is not None:
        check_world(path, task, world, (task.source, task.destination))
    return task
