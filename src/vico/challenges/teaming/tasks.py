"""Task files of the teaming challenge, in JSON, and every number that tasks are judged and drawn by."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from vico.assets.robots import robot_names
from vico.challenges.assistant.tasks import Person, Region, Start, TaskObject
from vico.challenges.robot_tasks import PlacedTask, check_thing, check_world, read_task_file
from vico.errors import SchemaError
from vico.world.model import Record
from vico.world.world import World

#: Longest duration of an episode, seconds; how often robots act, seconds, and bounds of that.
STEPS, PERIOD, PERIODS = 600, 0.5, (0.02, 1.0)

#: Walks that tasks ask for, metres: at least, at most.
LEAST_WALK, MOST_WALK = 15.0, 45.0
#: The person waits so far from the robot at the start, metres; robots of a team stand so far apart.
WAITS_WITHIN, BESIDE = (3.0, 8.0), (2.0, 6.0)
#: Walking pace of the people, metres a second (the old are slower, as they are else).
PACES = (0.5, 0.8)

#: Cosine of the angle that an upright robot leans, at most.
UPRIGHT = 0.9
#: Speed below which it stands, m/s.
STILL = 0.15
#: Seconds for which it has to.
STANDS_FOR = 2.0

#: Accompany: nearer than this to the person one walks with them, metres; for this share of the way at least.
WITH_DISTANCE, WITH_SHARE = 4.0, 0.8
#: Metres from the door at which one waits at it.
DOOR_DISTANCE = 4.0
#: Seconds after the person went in until one has to be there.
DOOR_GRACE = 20.0
#: Share of the time from then until they come out for which one has to.
DOOR_SHARE = 0.9
#: Who comes out again stays inside for so long, seconds.
STAYS = (25.0, 45.0)

#: Guide: the person follows a robot that is nearer than this and in sight, metres; who has had none in sight for so
#: many seconds gives up.
FOLLOWS_WITHIN, GIVES_UP = 7.0, 60.0
#: Both are there within this of the destination, metres, and no farther apart than the second.
ARRIVED, TOGETHER = 4.0, 4.0
#: How often the person stops on the way to look at something, at most, and for how long, seconds.
MOST_PAUSES, PAUSES = 2, (6.0, 14.0)

#: Spot: radius of the area in which the thing lies, metres; the robots begin so far from its middle.
AREA, AREA_WITHIN = 15.0, (20.0, 35.0)
#: The robot on the ground stands beside the thing within this distance, metres.
BESIDE_THING = 2.0
#: A thing was in view once so many pixels of it were, within so many metres.
SEEN_PIXELS, SEEN_DISTANCE = 4, 30.0
#: Robots on the ground that the thing may be brought to, by chance.
GROUND_ROBOTS = ("go2", "husky")
#: Things are so large that they are seen from above: their two largest sides, multiplied, square metres.
LEAST_AREA = 0.06

#: People who live in the world.
RESIDENTS = 15


SCHEMA, VERSION = "vico.teaming_task", 1

Category = Literal["accompany", "guide", "spot"]
CATEGORIES: tuple[Category, ...] = ("accompany", "guide", "spot")


class Member(Record):
    """A robot of the team: its model, and where it begins. Robot ``i`` is the agent ``robot_i``."""

    model: str
    start: Start


class Pause(Record):
    """A stop on the way: after so many metres of walking, for so many seconds."""

    after: Annotated[float, Field(ge=0.0)]
    seconds: Annotated[float, Field(gt=0.0)]


class Walk(Record):
    """What the person does who is walked with; robots are told none of it but where they wait.

    Attributes
    ----------
    waits_at
        Where they wait to be called.
    pace
        Metres a second.
    stay
        With accompany: seconds until they come out again; None: they stay inside.
    pauses
        With guide: stops on the way.
    """

    waits_at: Start
    pace: Annotated[float, Field(gt=0.0)]
    stay: Annotated[float, Field(gt=0.0)] | None = None
    pauses: tuple[Pause, ...] = ()


class TeamingTask(PlacedTask):
    """One episode.

    Attributes
    ----------
    team
        The robots.
    text
        What they are told.
    person
        Who asks; with accompany and guide who is walked with.
    walk
        What that person does; None with spot.
    thing
        With spot what is looked for; robots are told its name, never where it lies. Else None.
    destination
        With accompany the place at whose door it ends; with guide where to; with spot the area to look in.
    candidates
        What was chosen from, by question, as the chooser saw it.
    """

    schema_name: str = SCHEMA
    version: int = VERSION
    category: Category
    team: Annotated[list[Member], Field(min_length=1, max_length=2)]
    text: str
    person: Person
    walk: Walk | None
    thing: TaskObject | None
    destination: Region
    candidates: dict[str, list[str]]

    @model_validator(mode="after")
    def _parts_fit_the_category(self) -> Self:
        spots = self.category == "spot"
        if len(self.team) != (2 if spots else 1):
            raise ValueError(f"{self.category}: a team of {len(self.team)}; it takes {2 if spots else 1}")
        if (self.walk is None) != spots:
            raise ValueError(f"{self.category}: {'somebody' if self.walk else 'nobody'} walks along")
        if (self.thing is not None) != spots:
            raise ValueError(f"{self.category}: {'a' if self.thing else 'no'} thing to look for")
        if self.category == "accompany" and self.destination.place is None:
            raise ValueError("accompany: the destination has no door; it has to be a place")
        return self

    def instruction(self) -> dict[str, Any]:
        """Return what the robots are told: no position of the thing, nothing of the person's pace and stops."""
        walk = self.walk
        return {
            "category": self.category,
            "text": self.text,
            "team": [member.model for member in self.team],
            "person": None if walk is None else self.person.model_dump(),
            "waits_at": None if walk is None else list(walk.waits_at.position),
            "comes_out": walk is not None and walk.stay is not None,
            "object": None if self.thing is None else self.thing.name,
            "destination": self.destination.model_dump(),
            "seconds": self.steps,
        }


def read_teaming_task(path: Path, *, world: World | None = None) -> TeamingTask:
    """Read a task file.

    Raises
    ------
    SchemaError
        If the file is damaged, of another version, made for another world, or names what there is not.
    """
    task = read_task_file(path, TeamingTask, schema=SCHEMA, version=VERSION, what="teaming task")
    if task.thing is not None:
        check_thing(path, task.thing)
    for member in task.team:
        if member.model not in robot_names():
            known = ", ".join(robot_names())
            raise SchemaError(f"{path}: team: there is no robot {member.model!r}; there are {known}")
    if world is not None:
        check_world(path, task, world, [task.destination])
    return task
