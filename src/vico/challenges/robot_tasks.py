"""Robot tasks: their files, the robots' bodies and reachable ground, and how they are drawn.

Task files are read and checked the same way in all challenges of robots. A task is drawn only where its robots can
go: somebody, free ground, a thing, each choice out of nine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from vico.agents.robot.body import ArmBody
from vico.agents.robot.carrier import Deck, Team
from vico.assets.models.movable import MovableKind, movable_colours, movable_kinds
from vico.assets.people.model import describe_appearance
from vico.assets.robots import DeckModel, MobileManipulator, RobotModel
from vico.assets.robots.traversability import untraversable_cells
from vico.challenges.assistant.candidates import ChoiceQuestion, Chooser, choose
from vico.challenges.assistant.placement import Neighbourhood
from vico.challenges.assistant.tasks import Person, Region, Start, TaskObject
from vico.community.folder import digest_of
from vico.community.model import Community, Resident
from vico.errors import InputError, SchemaError
from vico.geometry import distance
from vico.io.files import read_json, write_json
from vico.kinematics.arm import Chain, Jaw
from vico.world.model import Record
from vico.world.walkable import OPEN, SIDEWALK
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


class WorldTask(Protocol):
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


def check_world(path: Path, task: WorldTask, world: World, regions: Iterable[Region]) -> None:
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


def check_made_for(task: WorldTask, world: World, community: Community) -> None:
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


# The ground is looked at so far to either side of a point, metres.
_ASIDE = 0.5

Array = NDArray[np.float64]
Grid = NDArray[np.bool_]


@dataclass
class RobotReachability:
    """Ways of robots on a world's ground."""

    world: World
    _narrow: dict[str, Grid] = field(default_factory=dict)

    def stands(self, model: RobotModel, at: Sequence[float] | Array) -> bool:
        """Return whether a robot can begin at a point, ENU metres."""
        walkable = self.world.walkable
        ix, iy = walkable.cell_of(np.asarray(at, np.float64)[:2])
        return bool(walkable.connected[iy, ix] and not self._kept_off(model)[iy, ix])

    def rise(self, at: Sequence[float] | Array) -> float:
        """Return how much the ground rises a metre at a point, ENU metres."""
        x, y = float(at[0]), float(at[1])
        east, west, north, south = self.world.height.smooth(
            [[x + _ASIDE, y], [x - _ASIDE, y], [x, y + _ASIDE], [x, y - _ASIDE]]
        ).tolist()
        return math.hypot(east - west, north - south) / (2.0 * _ASIDE)

    def lead(
        self, model: RobotModel, start: Sequence[float] | Array, points: Sequence[tuple[Array, float]], *, within: float
    ) -> bool:
        """Return whether a robot can go near each of some points.

        Parameters
        ----------
        start
            Where it begins, ENU metres.
        points
            ENU metres, and how near to each it has to come, metres.
        within
            Longest way from the start, in metres of pavement.
        """
        blocked = self._kept_off(model)
        way = self.world.router.distance_field(np.asarray(start, np.float64)[:2], blocked=blocked)
        return all(self._comes(way, point, near, within) for point, near in points)

    def _comes(self, way: NDArray[np.float32], point: Array, near: float, within: float) -> bool:
        walkable = self.world.walkable
        low, high = walkable.cell_of([point[:2] - near, point[:2] + near])
        i0, j0 = np.maximum(low, 0)
        i1, j1 = np.minimum(high, walkable.n - 1)
        yy, xx = np.mgrid[j0 : j1 + 1, i0 : i1 + 1]
        away = np.hypot(*(walkable.centre_of(np.stack([xx, yy], axis=-1)) - point[:2]).transpose(2, 0, 1))
        return bool((way[j0 : j1 + 1, i0 : i1 + 1][away <= near] <= within).any())

    def _kept_off(self, model: RobotModel) -> Grid:
        if model.name not in self._narrow:
            self._narrow[model.name] = untraversable_cells(self.world, model)
        return self._narrow[model.name]


# As in the model's geometry: links, and the base, column and mast that they must not touch (x, y, radius, top).
_RADII = (0.06, 0.06, 0.045, 0.045, 0.045, 0.045, 0.045)
_POSTS = ((0.0, 0.0, 0.27, 0.17), (-0.02, 0.0, 0.12, 0.57), (-0.1, 0.05, 0.035, 1.1))
# Of joints, rad/s, and fingers, m/s.
_JOINT_SPEED, _FINGER_SPEED = 0.9, 0.12


def arm_body(model: RobotModel) -> ArmBody:
    """Return what a mobile manipulator knows of its arm.

    Raises
    ------
    InputError
        If the model has no arm on a base that drives.
    """
    settings = model.controller
    if not isinstance(settings, MobileManipulator):
        raise InputError(f"{model.title} has no arm on a base that drives; take manipulator")
    return ArmBody(
        chain=Chain(settings.places, settings.axes, settings.low, settings.high, settings.grip),
        radii=np.array(_RADII),
        jaw=Jaw(),
        posts=np.array(_POSTS),
        rest=model.rest[:7].copy(),
        opening=settings.opening,
        fastest=np.array([_JOINT_SPEED] * 7 + [_FINGER_SPEED] * 2),
        stand=model.stand,
        radius=model.half_width,
    )


def team_of(manipulator: RobotModel, carrier: RobotModel) -> Team:
    """Return what two robots know of each other's bodies.

    Raises
    ------
    InputError
        If the first has no arm, or the second no deck.
    """
    deck = carrier.deck
    if deck is None:
        raise InputError(f"{carrier.title} has no deck; take husky")
    return Team(arm_body(manipulator), _deck(deck))


def _deck(deck: DeckModel) -> Deck:
    recess = None if deck.recess is None else _deck(deck.recess)
    return Deck(np.array(deck.centre), deck.length, deck.width, recess)


#: Free ground that robots and things need around them, metres.
ROOM = 1.0
# Points that are tried; so far off a place that somebody knows it begins, metres.
_TRIES, _ABOUT = 40, 40.0
# Share of the world in which tasks begin: nothing is known of what lies beyond it.
_INNER = 0.8
_HOURS = tuple(range(9, 18))


@dataclass
class Draw:
    """One episode as it is drawn."""

    world: World
    community: Community
    category: str
    chance: np.random.Generator
    chooser: Chooser
    candidates: dict[str, list[str]] = field(default_factory=dict)
    ways: RobotReachability = field(init=False)

    def __post_init__(self) -> None:
        self.ways = RobotReachability(self.world)

    def pick(self, question: str, names: list[str], who: Resident | None) -> int:
        """Have one of nine chosen, and note what it was chosen from."""
        choice = choose(ChoiceQuestion(question, self.category, who), names, self.chooser)
        self.candidates[question] = choice.candidates
        return choice.chosen

    def people(self, age: int) -> list[Resident]:
        """Return those who are of an age at least, years."""
        return [who for who in self.community.residents if who.age >= age]

    def asker(self, people: Sequence[Resident], *, reach: float) -> tuple[Resident, Neighbourhood]:
        """Return one of some people, and what lies within a walk about a start near a place that they know."""
        who = people[self.pick("Who asks?", [one.name for one in people], None)]
        places = [self.world.place_by_id[place] for place in dict.fromkeys((who.home, *who.known_places))]
        inner = [xy for place in places if max(map(abs, xy := place.position[:2])) < _INNER * self.world.half]
        near = inner[int(self.chance.integers(len(inner)))] if inner else (0.0, 0.0)
        start = self.world.walkable.random_point(self.chance, near=near, radius=_ABOUT, clearance=ROOM)
        return who, Neighbourhood(self.world, self.world.router, start, reach=reach)

    def spot(
        self, near: Array, low: float, high: float, *, suits: Callable[[Array], bool] | None = None
    ) -> Array | None:
        """Return free ground so far from a point that suits; None if there is none."""
        for _ in range(_TRIES):
            try:
                found = self.world.walkable.random_point(
                    self.chance, classes=(OPEN, SIDEWALK), near=near, radius=high, clearance=ROOM
                )
            except InputError:
                return None
            if low <= distance(found, near) and (suits is None or suits(found)):
                return found
        return None

    def stands(self, at: Array, *, towards: Array | None = None) -> Start:
        """Return a start at a point that looks somewhere, or towards another point."""
        if towards is None:
            yaw = float(self.chance.uniform(-np.pi, np.pi))
        else:
            yaw = math.atan2(towards[1] - at[1], towards[0] - at[0])
        return Start(position=(float(at[0]), float(at[1])), yaw=yaw)

    def thing(
        self, question: str, kinds: Sequence[MovableKind], who: Resident, at: Array, *, holder: str | None = None
    ) -> TaskObject:
        """Return a thing of one of some kinds that lies at a point, or is held."""
        order = [kinds[int(k)] for k in self.chance.permutation(len(kinds))]
        kind = order[self.pick(question, [one.kind for one in order], who)]
        colours = list(movable_colours())
        colour = colours[int(self.chance.integers(len(colours)))]
        return TaskObject(
            id="object",
            kind=kind.kind,
            colour=colour,
            name=f"{colour} {kind.kind}",
            position=(float(at[0]), float(at[1]), float(self.world.height(at))),
            yaw=float(self.chance.uniform(-np.pi, np.pi)),
            room=None,
            holder=holder,
        )

    def hour(self) -> str:
        """Return the time of day at which it begins."""
        return f"{int(self.chance.choice(_HOURS)):02d}:00"


def object_description(thing: TaskObject) -> str:
    """Return what a thing is, in words."""
    return movable_kinds()[thing.kind].described(thing.colour)


def person_of(who: Resident) -> Person:
    """Return what robots are told of somebody."""
    return Person(agent=who.id, name=who.name, looks=describe_appearance(who.appearance))
