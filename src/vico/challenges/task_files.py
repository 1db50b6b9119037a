"""What task files of several challenges have in common: how they are read, and what is refused in them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Protocol, TypeVar

from pydantic import BaseModel, Field, ValidationError

from vico.assets.models.movable import movable_colours, movable_kinds
from vico.challenges.assistant.model import Region, TaskObject
from vico.community.folder import digest_of
from vico.community.model import Community
from vico.errors import SchemaError
from vico.io.files import read_json, write_json
from vico.world.model import Record
from vico.world.world import World

Model = TypeVar("Model", bound=BaseModel)


class PlacedTask(Record):
    """One episode's task in a world, among people.

    Attributes
    ----------
    world_digest, community_digest
        Identity of the world and of the community the task belongs to.
    start
        Time of day at which it begins, ``HH:MM``.
    steps
        Seconds at most.
    """

    schema_name: str
    version: int
    category: str
    world: str
    world_digest: str
    community_digest: str
    seed: int
    start: Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d$")]
    steps: Annotated[int, Field(ge=1)]


def frame_of(world: World, community: Community, category: str, *, seed: int, steps: int) -> dict[str, Any]:
    """Return what a `PlacedTask` is begun with, whatever is drawn."""
    return {
        "category": category,
        "world": world.manifest.name,
        "world_digest": world.digest,
        "community_digest": digest_of(community),
        "seed": seed,
        "steps": steps,
    }


class OfWorld(Protocol):
    """A task that belongs to a world and its people."""

    @property
    def world(self) -> str:
        """Name of the world."""

    @property
    def world_digest(self) -> str:
        """Identity of the world."""

    @property
    def community_digest(self) -> str:
        """Identity of the people."""


def write_task_file(path: Path, task: PlacedTask) -> None:
    """Write a task file."""
    write_json(path, task.model_dump(mode="json"))


def read_task_file(path: Path, model: type[Model], *, schema: str, version: int, what: str) -> Model:
    """Read a task file strictly.

    Parameters
    ----------
    what
        What the file should be, in words: "robot task".

    Raises
    ------
    SchemaError
        If the file is damaged, of another version, or has a field that is unknown or makes no sense.
    """
    content = read_json(path)
    found = (content.get("schema_name"), content.get("version")) if isinstance(content, dict) else None
    if found != (schema, version):
        raise SchemaError(f"{path}: not a {what} file of version {version}; generate the task anew")
    try:
        return model.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "task"
        raise SchemaError(f"{path}: {where}: {first['msg']}; generate the task anew") from None


def check_thing(path: Path, thing: TaskObject) -> None:
    """Refuse a task about a kind of thing, or a colour, that there is not.

    Raises
    ------
    SchemaError
        If so.
    """
    if thing.kind not in movable_kinds() or thing.colour not in movable_colours():
        raise SchemaError(
            f"{path}: thing: there is no {thing.colour} {thing.kind}; add it to the movable things, or "
            "generate the task anew"
        )


def check_world(path: Path, task: OfWorld, world: World, regions: Iterable[Region]) -> None:
    """Refuse a task that was made for another world, or names a place that this one does not have.

    Raises
    ------
    SchemaError
        If so.
    """
    if task.world_digest != world.digest:
        raise SchemaError(f"{path}: made for another world ({task.world}); generate the task for this one")
    for region in regions:
        if region.place is not None and region.place not in world.place_by_id:
            raise SchemaError(f"{path}: the world has no place {region.place!r}; generate the task anew")


def check_made_for(task: OfWorld, world: World, community: Community) -> None:
    """Refuse to play a task among others than it was made for: whom it names would be somebody else.

    Raises
    ------
    SchemaError
        If it was made for another world, or for other people.
    """
    if task.world_digest != world.digest:
        raise SchemaError(
            f"task: made for another world ({task.world!r}, {task.world_digest[:12]}) than {world.manifest.name!r} "
            f"({world.digest[:12]}); give that world, or generate the task for this one"
        )
    if task.community_digest != (digest := digest_of(community)):
        raise SchemaError(
            f"task: made for another community ({task.community_digest[:12]}) than this one ({digest[:12]}); give that "
            "community, or generate the task for this one"
        )
