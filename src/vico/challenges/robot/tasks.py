"""Task files of the community robot challenge, in JSON, and every number that tasks are judged by.

The numbers decide how tasks are judged and drawn (spec, section 4.3).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, Self

from pydantic import model_validator

from vico.challenges.assistant.tasks import Person, Region, Start, TaskObject
from vico.challenges.robot_tasks import PlacedTask, check_thing, check_world, read_task_file
from vico.world.world import World

#: Longest duration of an episode, seconds, and how often robots act, seconds: 20 Hz unless a setting says otherwise.
STEPS, PERIOD = 1500, 0.05

#: Deliver: the thing lies within this distance of the spot, metres. Carry: of the home's entrance, or inside.
DESTINATION_RADIUS = HOME_RADIUS = 3.0

#: A thing that moves less than this in a second is at rest, metres; for so long it has to be, seconds.
AT_REST, RESTS_FOR = 0.02, 1.0

#: Nearer than this to the person one goes along with them, metres (the paper's Carry).
FOLLOW_DISTANCE = 5.0

#: Walks from the start that tasks ask for, metres: robots drive at 0.8 m/s at most.
REACH, CARRY_REACH = 120.0, 200.0
#: Things lie within this distance of the middle of the region that is told, metres.
SOURCE_RADIUS = 6.0
#: The thing and the destination, or the start and the home, are so far from each other at least, metres.
APART = 20.0

#: The person walks home so fast, metres a second, and waits so long beside what they put down, seconds.
PACE_HOME, WAITS = 0.6, 60.0

#: A thing was found once so many pixels of it were in view of a robot within so many metres.
SEEN_PIXELS, SEEN_DISTANCE = 20, 10.0
#: A robot with an arm came to the thing within this distance, metres.
REACHED = 1.2
#: Tasks are drawn where the manipulator can come so near to the thing, metres.
ARM_COMES = 0.6
#: ... and so near to where the thing is to be, metres.
GOAL_COMES = 2.0
#: ... and where the carrier can come so near to both, metres.
CARRIER_COMES = 4.0

#: Things lie, and are put down, on ground that rises by so much a metre at most.
LEVEL = 0.1

#: People who live in the world.
RESIDENTS = 15

#: Metres that the jaw is wider than a thing, on each side.
JAW_ROOM = 0.025
#: Heights of things, at least and at most, metres.
LOWEST = 0.05
HIGHEST = 0.6


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
