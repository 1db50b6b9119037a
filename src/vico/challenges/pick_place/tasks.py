"""Tasks of pick and place: one thing, where it lies, where it is to go, in words; drawn by a seed.

They take place in a world, or on a level square under the sky, with a table or without, where pick and place is
taught.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from vico.agents.robot.grasps import JAW_ROOM
from vico.assets.models.movable import MovableKind, kinds_for, movable_colours, movable_kinds
from vico.assets.robots import MobileManipulator, robot_model
from vico.assets.shapes import box, cylinder
from vico.errors import EmptyInputError, InputError
from vico.seeds import rng
from vico.version import __version__
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import ENTITY_GROUND, ENTITY_ROAD, Manifest, Origin, Point3, Roads
from vico.world.objects import Objects
from vico.world.transit import Transit
from vico.world.walkable import BLOCKED, OPEN, SIDEWALK, WalkableMap
from vico.world.world import World

#: Half the side, metres; name of such worlds.
HALF, NAME = 20.0, "field"
#: Of a table's top, along x and y, and how thick it is, metres.
TABLE, TOP = (0.5, 0.9), 0.04
_CELLS, _SLABS = 0.5, 60
#: Entity of the table.
ENTITY_TABLE = 1000


def level_field(seed: int, *, table: tuple[float, float, float] | None = None) -> World:
    """Return a level field whose ground looks as a seed says.

    Parameters
    ----------
    table
        Middle of a table's top, ENU metres; None for no table.
    """
    manifest = Manifest(
        producer=f"vico {__version__}",
        name=NAME,
        origin=Origin(lat=60.0, lon=25.0),
        half=HALF,
        bbox=(24.99, 59.99, 25.01, 60.01),
        seed=0,  # how the ground looks makes no other world of it
        sources=[],
        stages=[],
        counts={},
        places_by_type={},
        files={},
    )
    cells = round(2 * HALF / _CELLS)
    classes = np.full((cells, cells), SIDEWALK, np.uint8)
    surfaces = [] if table is None else _table_surfaces(table)
    if table is not None:
        middles = (np.arange(cells) + 0.5) * _CELLS - HALF
        x, y = np.meshgrid(middles, middles)
        classes[(np.abs(x - table[0]) < TABLE[0] / 2 + 0.3) & (np.abs(y - table[1]) < TABLE[1] / 2 + 0.3)] = BLOCKED
    return World(
        manifest,
        height=HeightField.flat(HALF),
        objects=Objects.none(),
        walkable=WalkableMap(classes, HALF),
        buildings=[],
        places=[],
        entrances=[],
        rooms=[],
        roads=Roads(roads=[], junctions=[], crossings=[]),
        transit=Transit(stops=[], lines=[], bike_stations=[], origin={}),
        models={},
        layers={
            "collision": surfaces,
            "buildings": [],
            "roofs": [],
            "rooms": [],
            "ground": [*_ground_surfaces(seed), *surfaces],
        },
    )


def _ground_surfaces(seed: int) -> list[Surface]:
    """Return ground of some shade with slabs of others on it: what moves over it can see that it moves."""
    chance = rng(seed, "pick place", "ground")
    shade = chance.uniform(70.0, 190.0) + chance.uniform(-18.0, 18.0, 3)
    found = [box((2 * HALF, 2 * HALF, 1.0), (0.0, 0.0, -0.5), colour=_colour(shade)).of_entity(ENTITY_GROUND)]
    for _ in range(_SLABS):
        x, y = chance.uniform(-6.0, 6.0, 2)
        size = chance.uniform(0.3, 1.5, 2)
        colour = _colour(shade + chance.normal(0.0, 14.0) + chance.uniform(-6.0, 6.0, 3))
        slab = box((float(size[0]), float(size[1]), 0.002), (float(x), float(y), 0.0), colour=colour)
        found.append(slab.of_entity(ENTITY_ROAD))
    return found


def _table_surfaces(middle: tuple[float, float, float]) -> list[Surface]:
    x, y, top = middle
    found = [box((*TABLE, TOP), (x, y, top - TOP / 2), colour=(176, 140, 98))]
    for across in (-1.0, 1.0):
        for along in (-1.0, 1.0):
            at = (x + across * (TABLE[0] / 2 - 0.05), y + along * (TABLE[1] / 2 - 0.05), 0.0)
            found.append(cylinder(0.02, top - TOP, sides=8, colour=(70, 70, 76), centre=at))
    return [surface.of_entity(ENTITY_TABLE) for surface in found]


def _colour(shade: NDArray[np.float64]) -> tuple[int, int, int]:
    red, green, blue = (int(value) for value in np.clip(shade, 20.0, 235.0))
    return red, green, blue


#: Where the thing comes from and goes to.
SurfaceKind = Literal["ground", "table"]
#: Seconds that an episode may last, unless told.
SECONDS = 120
#: A thing is put down next to another one if their middles are no farther apart than that, metres.
NEXT_TO = 0.6
# Things that stand by themselves and that an arm lifts over others, metres.
_TALLEST = 0.5
# The robot's heading is off its thing by as much at most, rad: what it is told of is in its picture.
_OFF = 0.6
_ROOM = 2.6  # metres of room all round, of ground on streets
_RISE = 0.04  # metres that it may rise
_TRIES = 200  # how often a place is tried
_DAYLIGHT, _WEATHER = (9 * 3600, 17 * 3600), ("clear", "fair", "overcast")


class TaskThing(BaseModel):
    """A thing as it lies when the episode begins; ENU metres, radians."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    kind: str
    colour: str
    position: Point3
    yaw: float

    @property
    def name(self) -> str:
        """What it is called in words: red helmet."""
        return f"{self.colour} {self.kind}"

    @property
    def size(self) -> Point3:
        """Extents at rest, metres."""
        return movable_kinds()[self.kind].size


class PickPlaceTask(BaseModel):
    """Take one thing and put it down somewhere else.

    Task: the instruction, in words, names the thing by kind and colour, and where it is to be put: next to another
    thing on the ground, or on a table.
    Randomisation: both things, their colours, where they lie and how they are turned; ground or table; where the robot
    stands and looks; the time of day and the weather; in a field the look of the ground, in a world the street.
    Success: within the time the thing lies still in nobody's jaw: next to the other one, their middles no farther apart
    than 0.6 m, at the ground's height; or within the table's edges, at its height (5 cm either way).

    Attributes
    ----------
    seed
        That it was drawn by.
    world
        Name of the world; ``"field"`` for a level one of our own.
    robot
        Where the manipulator starts: x, y, ENU metres, and yaw, radians.
    thing, landmark
        What is to be taken, and the thing beside which it is to be put; that one is there in any case.
    table
        Middle of the table's top, ENU metres; None without one.
    source, destination
        What the thing lies on, and what it is to be put on.
    spot
        Where the demonstrator puts it, ENU metres; any place that counts as success is as good.
    start, weather
        Second of the day; a kind of weather.
    seconds
        That the episode may last.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    seed: int
    world: str
    robot: Point3
    thing: TaskThing
    landmark: TaskThing
    table: Point3 | None
    source: SurfaceKind
    destination: SurfaceKind
    spot: Point3
    start: int
    weather: str
    seconds: int = SECONDS

    @property
    def instruction(self) -> str:
        """What the robot is told."""
        taken = f"Pick up the {self.thing.name}" + (" from the table" if self.source == "table" else "")
        where = "on the table" if self.destination == "table" else f"down next to the {self.landmark.name}"
        return f"{taken} and put it {where}."


def fitting_kinds() -> dict[str, MovableKind]:
    """Return the kinds of movable things that fit between a manipulator's fingers, ours and the user's, by name."""
    settings = robot_model("manipulator").controller
    assert isinstance(settings, MobileManipulator)
    widest = 2.0 * (settings.opening - JAW_ROOM)
    return {
        name: kind
        for name, kind in kinds_for("robot").items()
        if min(kind.size[:2]) < widest and kind.size[2] <= _TALLEST and max(kind.size) <= 2.0 * _TALLEST
    }


def draw_task(seed: int, world: World | None = None, *, seconds: int = SECONDS) -> PickPlaceTask:
    """Return the task of a seed.

    Parameters
    ----------
    world
        Whose streets it is set in; None for a level field.
    seconds
        That an episode may last.

    Raises
    ------
    EmptyInputError
        If no kind of thing fits the jaw, or the world has no open, level ground.
    InputError
        If an episode is to last less than a second.
    """
    if seconds < 1:
        raise InputError(f"pick_place: an episode of {seconds} s; give 1 s or more")
    chance = rng(seed, "pick place", "task")
    kinds, colours = sorted(fitting_kinds()), list(movable_colours())
    if not kinds:
        raise EmptyInputError("pick_place: no movable thing fits the manipulator's jaw; see docs/adding_a_model.md")
    source, destination = "ground", "ground"
    if world is None:
        source, destination = _SURFACES[int(chance.integers(len(_SURFACES)))]
    kind, other = (kinds[int(chance.integers(len(kinds)))] for _ in range(2))
    colour, second = (colours[int(k)] for k in chance.choice(len(colours), 2, replace=False))
    sizes = [movable_kinds()[name].size for name in (kind, other)]
    apart = 0.10 + sum(math.hypot(*size[:2]) / 2 for size in sizes)
    laid = _laid_out(chance, apart=min(apart, NEXT_TO - 0.08), source=source, destination=destination)
    place = (-1.8, 0.0, 0.0) if world is None else _open_place(chance, world)
    ground = 0.0 if world is None else float(world.height(np.array(place[:2])))
    top = laid["top"][2]

    def outside(point: tuple[float, ...], height: float) -> Point3:
        c, s = math.cos(place[2]), math.sin(place[2])
        x, y = place[0] + c * point[0] - s * point[1], place[1] + s * point[0] + c * point[1]
        below = ground if world is None else float(world.height(np.array([x, y])))
        return (x, y, below + height)

    yaws = chance.uniform(-math.pi, math.pi, 2)
    return PickPlaceTask(
        seed=seed,
        world="field" if world is None else world.manifest.name,
        robot=(place[0], place[1], place[2] + laid["robot"][2]),
        thing=TaskThing(
            kind=kind,
            colour=colour,
            position=outside(laid["thing"], top if source == "table" else 0.0),
            yaw=float(yaws[0]),
        ),
        landmark=TaskThing(kind=other, colour=second, position=outside(laid["landmark"], 0.0), yaw=float(yaws[1])),
        table=outside(laid["top"], top) if "table" in (source, destination) else None,
        source=source,
        destination=destination,
        spot=outside(laid["spot"], top if destination == "table" else 0.0),
        start=int(chance.integers(*_DAYLIGHT)),
        weather=_WEATHER[int(chance.integers(len(_WEATHER)))],
        seconds=seconds,
    )


#: Three of four episodes begin on the ground, two of four end there beside a thing.
_SURFACES: tuple[tuple[SurfaceKind, SurfaceKind], ...] = (
    ("ground", "ground"),
    ("ground", "ground"),
    ("table", "ground"),
    ("ground", "table"),
)


def _laid_out(
    chance: np.random.Generator, *, apart: float, source: str, destination: str
) -> dict[str, tuple[float, float, float]]:
    """Return where all is, in the frame of who stands at the origin and looks along x: metres, and the robot's yaw."""
    side = 1.0 if chance.random() < 0.5 else -1.0
    top = (float(chance.uniform(1.5, 1.8)), float(-side * chance.uniform(0.0, 0.25)), float(chance.uniform(0.4, 0.7)))
    on_table = (top[0] - TABLE[0] / 2 + 0.16, top[1] + float(chance.uniform(-0.2, 0.2)), 0.0)
    if "table" in (source, destination):
        bearing = side * chance.uniform(0.85, 1.1)
        beside = _polar(float(chance.uniform(1.1, 1.5)), bearing)
        thing, landmark = (on_table, beside) if source == "table" else (_polar(chance.uniform(0.9, 1.2), bearing), None)
        landmark = landmark or _polar(float(chance.uniform(1.1, 1.5)), -side * chance.uniform(1.0, 1.2))
    else:
        thing = _polar(chance.uniform(0.9, 1.8), side * chance.uniform(0.15, 0.5))
        landmark = _polar(chance.uniform(1.1, 1.8), -side * chance.uniform(0.25, 0.6))
    towards = math.atan2(-landmark[1], -landmark[0]) + float(chance.uniform(-0.3, 0.3))
    spot = (landmark[0] + apart * math.cos(towards), landmark[1] + apart * math.sin(towards), 0.0)
    yaw = math.atan2(thing[1], thing[0]) + float(chance.uniform(-_OFF, _OFF))
    return {
        "robot": (0.0, 0.0, yaw),
        "thing": thing,
        "landmark": landmark,
        "spot": on_table if destination == "table" else spot,
        "top": top,
    }


def _polar(distance: float, bearing: float) -> tuple[float, float, float]:
    return (float(distance) * math.cos(bearing), float(distance) * math.sin(bearing), 0.0)


def _open_place(chance: np.random.Generator, world: World) -> tuple[float, float, float]:
    """Return a place of a street with open, level ground round it: x, y and a yaw.

    Raises
    ------
    EmptyInputError
        If there is none.
    """
    round_it = np.array([[math.cos(a), math.sin(a)] for a in np.arange(8) * math.pi / 4])
    for _ in range(_TRIES):
        try:
            at = world.walkable.random_point(chance, classes=(OPEN, SIDEWALK), clearance=_ROOM)
        except InputError:
            break
        heights = np.concatenate([world.height(at + r * round_it) for r in (0.7, 1.4, 2.1)])
        if float(np.ptp(heights)) < _RISE * 3.0:
            return (float(at[0]), float(at[1]), float(chance.uniform(-math.pi, math.pi)))
    raise EmptyInputError(
        f"pick_place: {world.manifest.name} has no level street with {_ROOM:g} m of room; use another world, or a field"
    )
