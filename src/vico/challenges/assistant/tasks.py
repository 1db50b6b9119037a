"""Task files of the assistant challenge, in JSON, and every number that tasks are judged and drawn by.

A task file holds everything that one episode needs. The numbers are those of the spec, section 4.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from vico.agents.requester import CALL_DISTANCE, HAND_OVER_DISTANCE, WAITS_FOR
from vico.assets.models.movable import movable_colours, movable_kinds
from vico.errors import SchemaError
from vico.io.files import read_json, write_json
from vico.world.model import Point2, Point3, Record
from vico.world.world import World

__all__ = [
    "ADVANCED",
    "APART",
    "BLOCKED_DISTANCE",
    "BLOCKED_STEPS",
    "CALL_DISTANCE",
    "CANDIDATES",
    "CARRY_REACH",
    "CATEGORIES",
    "FOLLOW_DISTANCE",
    "FREQUENTED_PLACES",
    "HAND_OVER_DISTANCE",
    "OFF_MIDDLE",
    "REACH",
    "RESIDENTS",
    "SCHEMA",
    "SEARCH_RADIUS",
    "SEEN_DISTANCE",
    "SEEN_PIXELS",
    "SOURCE_RADIUS",
    "STANDARD",
    "STEPS",
    "SUBTASKS",
    "VERSION",
    "WAITS_FOR",
    "Category",
    "Person",
    "Region",
    "Start",
    "Subtask",
    "Surface",
    "Task",
    "TaskObject",
    "Thresholds",
    "read_task",
    "thresholds",
    "write_task",
]
#: Subtasks of an episode, and its longest duration, steps of one second.
SUBTASKS = 6
STEPS = 1500

#: People who live in the world: for Carry more, for six of them are to be out, near by and not far from home.
RESIDENTS = {"carry": 45, "delivery": 15, "search": 15}

#: Candidates that each object and place is chosen from.
CANDIDATES = 9

#: Regions lie no farther than this walk from the start, metres: so that six subtasks can be done in time by who plans
#: well. Who is to be helped with carrying moves about, and lives and is found within the second.
REACH = 160.0
CARRY_REACH = 350.0

#: How far outdoor things may lie from the middle of the region that is named, metres: with Delivery what one sees from
#: there at a glance, with Search an area to look through.
SOURCE_RADIUS = 8.0
SEARCH_RADIUS = 15.0

#: Middles of regions are told, positions of things are not: none lies nearer to a middle, metres.
OFF_MIDDLE = 0.4

#: A destination lies at least so far from the source, metres.
APART = 20.0

#: Places where somebody who is to be helped is often seen: so many are told, one of them right.
FREQUENTED_PLACES = 3

#: Nearer than this to the person one follows them, metres.
FOLLOW_DISTANCE = 5.0

#: A thing is seen, as causes of failure count it, with so many pixels within so many metres.
SEEN_PIXELS = 20
SEEN_DISTANCE = 10.0

#: Who moves less than the first, metres, over so many steps although it tries to is blocked.
BLOCKED_DISTANCE = 1.0
BLOCKED_STEPS = 45


@dataclass(frozen=True)
class Thresholds:
    """When a subtask is done.

    Attributes
    ----------
    destination_radius
        Delivery outdoors: things lie within this distance of the spot, metres.
    home_radius
        Carry: things lie within this distance of the home's entrance, metres, or inside.
    search_pixels, search_distance
        Search: at `task_complete` so many pixels of the thing are in view within this distance, metres.
    surface_distance
        Indoors: things lie within this distance of the surface that is named, metres, over the ground; None: anywhere
        in the place.
    regions
        Source regions that are told, times so many.
    """

    destination_radius: float = 3.0
    home_radius: float = 3.0
    search_pixels: int = 20
    search_distance: float = 10.0
    surface_distance: float | None = None
    regions: int = 1


STANDARD = Thresholds()
ADVANCED = Thresholds(destination_radius=1.5, home_radius=1.5, search_distance=5.0, surface_distance=1.5, regions=3)


def thresholds(*, advanced: bool) -> Thresholds:
    """Return the thresholds of a setting."""
    return ADVANCED if advanced else STANDARD


SCHEMA = "vico.task"
VERSION = 2

Category = Literal["carry", "delivery", "search"]
CATEGORIES: tuple[Category, ...] = ("carry", "delivery", "search")


class Surface(Record):
    """A surface things can be put on, as it is named to agents: what, in which room, and its entity."""

    room: str
    kind: str
    entity: int


class Region(Record):
    """Where something or somebody is to be found, or things are brought to.

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
    surface
        In the advanced setting, the surface beside which things are to lie; else None.
    """

    kind: Literal["place", "outdoor"]
    name: str
    place: str | None
    centre: Point3
    radius: Annotated[float, Field(ge=0.0)]
    surface: Surface | None = None

    @model_validator(mode="after")
    def _place_if_inside(self) -> Self:
        if (self.place is not None) != (self.kind == "place"):
            raise ValueError(f"a region of kind {self.kind} {'has no' if self.place else 'needs a'} place")
        return self


class TaskObject(Record):
    """A thing of the task, where it is at the start. Agents are told its name, never where it is.

    Attributes
    ----------
    holder
        Agent name of the person who has it in hand; None: it lies at `position`.
    """

    id: str
    kind: str
    colour: str
    name: str
    position: Point3
    yaw: float
    room: str | None
    holder: str | None = None


class Person(Record):
    """Who asks: what agents are told of them.

    Attributes
    ----------
    agent
        Name of the resident in the simulation; pictures name people by `name`.
    looks
        What they wear and look like, in words.
    """

    agent: str
    name: str
    looks: str


class Subtask(Record):
    """One thing to do: what the agent is told, and what its choices were drawn from.

    Attributes
    ----------
    person
        Who asks; with Carry who is to be found and followed.
    sources
        Regions in which the thing lies, or where the person is often seen; one of them is right.
    source
        Which of them is; agents are not told.
    destination
        Where things are to be at the end; with Carry the person's home; None with Search.
    candidates
        What was chosen from, by question, as the chooser saw it.
    """

    index: Annotated[int, Field(ge=0)]
    text: str
    person: Person
    objects: Annotated[list[str], Field(min_length=1)]
    sources: Annotated[list[Region], Field(min_length=1)]
    source: Annotated[int, Field(ge=0)]
    destination: Region | None
    candidates: dict[str, list[str]]

    @model_validator(mode="after")
    def _source_is_one_of_them(self) -> Self:
        if self.source >= len(self.sources):
            raise ValueError(f"source {self.source} of {len(self.sources)} sources")
        return self

    @property
    def true_source(self) -> Region:
        """The region in which the things are, or the person is expected."""
        return self.sources[self.source]


class Start(Record):
    """Where an assistant begins, and which way it looks."""

    position: Point2
    yaw: float


class Task(Record):
    """One episode.

    Attributes
    ----------
    world_digest, community_digest
        Identity of the world and of the community the task belongs to.
    start
        Time of day at which it begins, ``HH:MM``.
    """

    schema_name: str = SCHEMA
    version: int = VERSION
    category: Category
    advanced: bool
    world: str
    world_digest: str
    community_digest: str
    seed: int
    start: Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d$")]
    steps: Annotated[int, Field(ge=1)]
    assistants: Annotated[list[Start], Field(min_length=1, max_length=2)]
    objects: list[TaskObject]
    subtasks: Annotated[list[Subtask], Field(min_length=1)]

    @model_validator(mode="after")
    def _objects_are_known(self) -> Self:
        known = {thing.id for thing in self.objects}
        for subtask in self.subtasks:
            if missing := [i for i in subtask.objects if i not in known]:
                raise ValueError(f"subtask {subtask.index}: no object is called {missing[0]!r}")
            if (subtask.destination is None) != (self.category == "search"):
                raise ValueError(f"subtask {subtask.index}: {self.category} and its destination do not go together")
        if [s.index for s in self.subtasks] != list(range(len(self.subtasks))):
            raise ValueError("subtasks are not numbered 0, 1, 2, ...")
        return self

    @model_validator(mode="after")
    def _objects_can_be_told_apart(self) -> Self:
        for field in ("id", "name"):
            values = [getattr(thing, field) for thing in self.objects]
            if twice := sorted({value for value in values if values.count(value) > 1}):
                raise ValueError(f"objects: two have the {field} {twice[0]!r}")
        people = {subtask.person.agent for subtask in self.subtasks} if self.category == "carry" else set()
        for thing in self.objects:
            if thing.holder is not None and thing.holder not in people:
                raise ValueError(f"objects: {thing.id}: {thing.holder!r}, who holds it, asks for no help with carrying")
        return self

    def instructions(self) -> list[dict[str, Any]]:
        """Return what the assistants are told: no position of any object or person, no candidates."""
        names = {thing.id: thing.name for thing in self.objects}
        return [
            {
                "index": subtask.index,
                "category": self.category,
                "text": subtask.text,
                "person": subtask.person.model_dump(),
                "objects": [names[i] for i in subtask.objects],
                "sources": [region.model_dump() for region in subtask.sources],
                "destination": None if subtask.destination is None else subtask.destination.model_dump(),
            }
            for subtask in self.subtasks
        ]


def write_task(path: Path, task: Task) -> None:
    """Write a task file."""
    write_json(path, task.model_dump(mode="json"))


def read_task(path: Path, *, world: World | None = None) -> Task:
    """Read a task file.

    Raises
    ------
    SchemaError
        If the file is damaged, of another version, made for another world, or names what the world does not have.
    """
    content = read_json(path)
    found = (content.get("schema_name"), content.get("version")) if isinstance(content, dict) else None
    if found != (SCHEMA, VERSION):
        raise SchemaError(f"{path}: not a task file of version {VERSION}; generate the task anew")
    try:
        task = Task.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "task"
        raise SchemaError(f"{path}: {where}: {first['msg']}; generate the task anew") from None
    if world is not None:
        _check_against(task, world, path)
    return task


def _check_against(task: Task, world: World, path: Path) -> None:
    """Refuse a task whose world is another one, or lacks what it names."""
    if task.world_digest != world.digest:
        raise SchemaError(f"{path}: made for another world ({task.world}); generate the task for this one")
    for subtask in task.subtasks:
        for region in (*subtask.sources, *([subtask.destination] if subtask.destination else [])):
            if missing := _missing(region, world):
                raise SchemaError(
                    f"{path}: subtasks.{subtask.index}: the world has no {missing}; generate the task anew"
                )
    for thing in task.objects:
        if thing.kind not in movable_kinds() or thing.colour not in movable_colours():
            raise SchemaError(
                f"{path}: objects: {thing.id}: there is no {thing.colour} {thing.kind}; add it to the movable things, "
                "or generate the task anew"
            )
        if thing.room is not None and thing.room not in world.room_by_id:
            raise SchemaError(f"{path}: objects: {thing.id}: the world has no room {thing.room!r}; generate it anew")


def _missing(region: Region, world: World) -> str:
    """Say what a region names that a world does not have; empty if it has all of it."""
    if region.place is None:
        return "" if region.surface is None else f"surface outdoors ({region.surface.kind})"
    if region.place not in world.place_by_id:
        return f"place {region.place!r}"
    if region.surface is None:
        return ""
    if region.surface.room not in world.place_by_id[region.place].rooms:
        return f"room {region.surface.room!r} in {region.place!r}"
    entities = {one.entity for one in world.room_by_id[region.surface.room].containers}
    return "" if region.surface.entity in entities else f"surface {region.surface.entity} in {region.surface.room!r}"
