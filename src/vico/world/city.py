"""A city on disk: tiles of a fixed grid, each a world folder of its own, and what the city has as a whole.

::

    city.json        what the city is: where, which tiles, what they were made of; written last
    tiles/C_R/       the world of the tile in column C and row R, east and north of the middle one
    whole/           what the city has as a whole: ground, streets, where people walk
    .plans/          what tiles planned: streets and ground, as their neighbours need them; no part of the city

The files of the whole are read where they are looked at. `TileShift` gives the things of a tile in the city's frame,
under numbers and names that no other tile uses. `Profile` is what a tile draws along a border; `border_findings` says
where two tiles do not draw the same.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from vico.errors import MissingFileError, SchemaError
from vico.geo import overlay
from vico.io.arrays import drop_pages, mapped_array, read_npz
from vico.io.files import read_json
from vico.world.heights import Decks, HeightField, Stairs, Steps
from vico.world.mesh import Surface
from vico.world.model import (
    FIRST_BUILDING,
    FIRST_ROOM,
    FIRST_STOP,
    Building,
    Container,
    Doorway,
    Entrance,
    Origin,
    ParkingSpot,
    Place,
    Point2,
    Point3,
    Record,
    Room,
    StageReport,
    WayIntoSpot,
    WaysOfSpot,
)
from vico.world.objects import Objects
from vico.world.walkable import WalkableMap
from vico.world.world import World, read_stored

VERSION = 3
#: Name of a city's manifest.
CITY = "city.json"
_AGAIN = "the vico city build that made the city makes it again"
#: Folder of the folders of the tiles' worlds.
TILES = "tiles"


class CityTile(Record):
    """A tile that is built."""

    column: int
    row: int
    name: str
    digest: str
    buildings: int
    places: int


class CityManifest(Record):
    """`city.json`.

    Attributes
    ----------
    origin
        Middle of the tile (0, 0), and of the projection that all tiles share.
    size
        Side of a tile, metres.
    first, last
        Column and row of the south-western and the north-eastern tile.
    tiles
        Those that are built, row by row from the south-west.
    failed
        Why others are not, by name.
    reports
        What the streets of the city as a whole have, and what was left out.
    files
        SHA-256 of what the city has as a whole, by path.
    """

    schema_name: Literal["vico.city"] = "vico.city"
    version: Literal[3] = 3
    producer: str
    origin: Origin
    size: Annotated[float, Field(gt=0)]
    first: tuple[int, int]
    last: tuple[int, int]
    seed: int
    tiles: list[CityTile]
    failed: dict[str, str] = Field(default_factory=dict)
    reports: list[StageReport] = Field(default_factory=list)
    files: dict[str, str] = Field(default_factory=dict)


class City:
    """A city of tiles.

    Parameters
    ----------
    manifest
        What it is.
    path
        Its folder.
    """

    def __init__(self, manifest: CityManifest, path: Path) -> None:
        self.manifest = manifest
        self.path = path
        self._tiles = {(tile.column, tile.row): tile for tile in manifest.tiles}

    def __contains__(self, tile: object) -> bool:
        return tile in self._tiles

    @property
    def half(self) -> float:
        """Half the side of the square around the middle of the tile (0, 0) that holds all tiles, metres."""
        return (max(abs(k) for k in (*self.manifest.first, *self.manifest.last)) + 0.5) * self.manifest.size

    def borders(self) -> list[tuple[tuple[int, int], tuple[int, int], int]]:
        """Return all pairs of tiles side by side, and along which axis the second follows: 0 east, 1 north."""
        found = []
        for column, row in self._tiles:
            for axis, after in ((0, (column + 1, row)), (1, (column, row + 1))):
                if after in self._tiles:
                    found.append(((column, row), after, axis))
        return found

    def world(self, tile: tuple[int, int]) -> World:
        """Open the world of a tile.

        Raises
        ------
        MissingFileError
            If the city has no such tile, or its folder is gone.
        SchemaError
            If the tile is not the one that the city was built of.
        """
        known = self._tiles.get(tile)
        if known is None:
            raise MissingFileError(f"{self.path}: has no tile {tile[0]}_{tile[1]}; vico city info lists its tiles")
        folder = self.path / TILES / known.name
        if not (folder / "world.json").exists():
            raise MissingFileError(f"tile {known.name}: {folder} is gone or not whole; {_AGAIN}")
        world = read_stored(folder)
        if world.digest != known.digest:
            raise SchemaError(f"tile {known.name}: {folder} is of another build than {self.path / CITY}; {_AGAIN}")
        return world


def read_city(path: Path) -> City:
    """Open a city folder.

    Raises
    ------
    MissingFileError
        If there is none at `path`.
    SchemaError
        If its manifest is damaged, or of another version.
    """
    file = Path(path) / CITY
    if not file.exists():
        raise MissingFileError(f"{path}: holds no city.json, so it is no city; make one with vico city build")
    content = read_json(file)
    if isinstance(content, dict) and content.get("version", VERSION) != VERSION:
        raise SchemaError(f"{file}: version {content['version']!r}, but this one reads {VERSION}; build the city anew")
    try:
        return City(CityManifest.model_validate(content), Path(path))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise SchemaError(f"{file}: {where}: {first['msg']}; build the city anew") from None


WHOLE = "whole"

#: Ground: smooth heights; edges of kerbs and their like with what lies below and above them; decks and stairs.
SMOOTH, EDGE, LOW, HIGH, LEVELS = "smooth.npy", "edge.npy", "low.npy", "high.npy", "levels.npz"
#: Streets: roads, lanes, transit.
ROADS, NET, XODR, TRANSIT = "roads.json", "roads.net.xml", "roads.xodr", "transit.json"
#: Where people walk: surfaces, room to walls, what can be reached, what it costs to walk there, gates between tiles,
#: the steps of the walks from gate to gate.
SURFACES, ROOM, REACHED, COST = "surfaces.npy", "room.npy", "reached.npy", "cost.npy"
GATES, STEPS = "gates.npz", "steps.npy"


def whole_ground(folder: Path, half: float) -> HeightField:
    """Open the heights of a city.

    Parameters
    ----------
    folder
        What the city has as a whole.
    half
        Half the side of the square they cover, metres.

    Raises
    ------
    MissingFileError, SchemaError
        If a file is not there, or damaged.
    """
    path = folder / LEVELS
    try:
        arrays = read_npz(path.read_bytes())
        decks, stairs = Decks.from_arrays(arrays), Stairs.from_arrays(arrays)
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the city anew") from None
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise SchemaError(f"{path}: not readable ({error}); build the city anew") from None
    steps = Steps(*(mapped_array(folder / name) for name in (EDGE, LOW, HIGH)))
    return HeightField(mapped_array(folder / SMOOTH), half, steps, decks, stairs)


def release_pages(ground: HeightField) -> None:
    """Give back the memory that the heights of a city were read into: they are read again where they are looked at."""
    drop_pages(ground.heights)
    if ground.steps is not None:
        for array in (ground.steps.edge, ground.steps.low, ground.steps.high):
            drop_pages(array)


def whole_walkable(folder: Path, half: float) -> WalkableMap:
    """Open where people walk in a city; raises as `whole_ground`."""
    surfaces, room, reached = (mapped_array(folder / name) for name in (SURFACES, ROOM, REACHED))
    walkable = WalkableMap(surfaces, half)
    walkable.__dict__.update(clearance=room, connected=reached)
    return walkable


#: Entities of the first tile's things begin here: above those of bodies and of what a simulation adds.
_FIRST = 2_000_000
_EACH = 500_000  # entities of a tile
# A city has millions of things: their names take a quarter of the room if each takes only what it needs.
_TEXT = np.dtypes.StringDType()
_OF_THE_CITY = ("stop_", "tram_stop_", "bikes_")


@dataclass(frozen=True)
class TileShift:
    """Shift of a tile's identifiers and coordinates to those of its city.

    Attributes
    ----------
    east, north
        The tile's middle in the city, metres.
    entities
        What is added to the entities of its things; not to those of stops and stations, which are the city's own, nor
        to those of the ground.
    name
        Of the tile; begins ids that are known in the tile alone.
    """

    east: float
    north: float
    entities: int
    name: str

    @classmethod
    def of(cls, city: City, tile: tuple[int, int]) -> TileShift:
        """Return that of one of a city's tiles."""
        manifest = city.manifest
        (column, row), (first_column, first_row) = tile, manifest.first
        number = (row - first_row) * (manifest.last[0] - first_column + 1) + column - first_column
        east, north = column * manifest.size, row * manifest.size
        return cls(east, north, _FIRST + number * _EACH, f"{column}_{row}")

    @staticmethod
    def tile_of(city: City, entity: int) -> tuple[int, int] | None:
        """Return the tile of whose things a number in the city may be one; None: those of no tile have such a one."""
        first, last = city.manifest.first, city.manifest.last
        row, column = divmod((entity - _FIRST) // _EACH, last[0] - first[0] + 1)
        row, column = row + first[1], column + first[0]
        return (column, row) if entity >= _FIRST and row <= last[1] else None

    def point(self, xy: Point2) -> Point2:
        """Move a point."""
        return round(xy[0] + self.east, 3), round(xy[1] + self.north, 3)

    def point3(self, xyz: Point3) -> Point3:
        """Move a point in space."""
        return round(xyz[0] + self.east, 3), round(xyz[1] + self.north, 3), xyz[2]

    def id(self, key: str) -> str:
        """Return an id that no other tile has; those of stops and stations are the city's."""
        return key if key.startswith(_OF_THE_CITY) else f"{self.name}.{key}"

    def entity(self, number: int) -> int:
        """Return an entity's number in the city."""
        self._check(number)
        return number + self.entities if self._is_own(number) else number

    def numbers(self, entities: NDArray[Any]) -> NDArray[np.int32]:
        """Return numbers of entities in the city, shaped as those in the tile."""
        self._check(int(entities.max(initial=0)))
        own = (entities >= FIRST_BUILDING) & ((entities < FIRST_STOP) | (entities >= FIRST_ROOM))
        return np.where(own, entities + self.entities, entities).astype(np.int32)

    def _check(self, number: int) -> None:
        if number >= _EACH:
            raise SchemaError(f"tile {self.name}: entity {number}; a tile of a city has fewer than {_EACH}")

    @staticmethod
    def _is_own(number: int) -> bool:
        return number >= FIRST_BUILDING and (number < FIRST_STOP or number >= FIRST_ROOM)

    def building(self, building: Building) -> Building:
        """Move a building."""
        rings = [[self.point(xy) for xy in ring] for ring in building.footprint]
        return building.model_copy(update={"footprint": rings, "entity": self.entity(building.entity)})

    def entrance(self, entrance: Entrance) -> Entrance:
        """Move a door."""
        return entrance.model_copy(
            update={
                "id": self.id(entrance.id),
                "position": self.point3(entrance.position),
                "approach": self.point(entrance.approach),
            }
        )

    def place(self, place: Place) -> Place:
        """Move a place."""
        door = None if place.entrance is None else self.id(place.entrance)
        return place.model_copy(update={"position": self.point3(place.position), "entrance": door})

    def room(self, room: Room) -> Room:
        """Move a room."""
        return room.model_copy(
            update={
                "entity": self.entity(room.entity),
                "centre": self.point3(room.centre),
                "door": self.point3(room.door),
                "inside": self.point3(room.inside),
                "containers": [self._container(one) for one in room.containers],
                "doors": [self._doorway(one) for one in room.doors],
            }
        )

    def _container(self, container: Container) -> Container:
        return container.model_copy(
            update={
                "entity": self.entity(container.entity),
                "centre": self.point3(container.centre),
                "reach": self.point(container.reach),
            }
        )

    def _doorway(self, doorway: Doorway) -> Doorway:
        return doorway.model_copy(
            update={"position": self.point3(doorway.position), "inside": self.point3(doorway.inside)}
        )

    def spot(self, spot: ParkingSpot) -> ParkingSpot:
        """Move a parking spot."""
        car = None if spot.car is None else self.entity(spot.car)
        ways = None
        if spot.ways is not None:
            into, out = (self._way(way) for way in (spot.ways.into, spot.ways.out))
            ways = WaysOfSpot(into=into, back=[self.point(xy) for xy in spot.ways.back], out=out)
        return spot.model_copy(
            update={"id": self.id(spot.id), "position": self.point3(spot.position), "car": car, "ways": ways}
        )

    def _way(self, way: WayIntoSpot) -> WayIntoSpot:
        return way.model_copy(update={"line": [self.point(xy) for xy in way.line]})

    def objects(self, objects: Objects) -> Objects:
        """Move things. Those indoors are named after a room, and that is in one tile; a street may lie in several."""
        ids = objects.id.astype(_TEXT)
        outdoors = np.flatnonzero(objects.room == "")
        ids[outdoors] = [self.id(key) for key in objects.id[outdoors].tolist()]
        return replace(
            objects,
            id=ids,
            kind=objects.kind.astype(_TEXT),
            group=objects.group.astype(_TEXT),
            prototype=objects.prototype.astype(_TEXT),
            room=objects.room.astype(_TEXT),
            entity=self.numbers(objects.entity),
            x=objects.x + self.east,
            y=objects.y + self.north,
        )

    def surface(self, surface: Surface) -> Surface:
        """Move a mesh."""
        shift = np.array([self.east, self.north, 0.0])
        positions = (surface.positions + shift).astype(np.float32)
        return replace(surface, positions=positions, entity=self.numbers(surface.entity))


Floats = NDArray[np.float64]

ON_LINE = 1e-3
"""Metres: a corner this close to the border is on it."""

SAME = 2e-3
"""Metres along the border between points that are one."""

ALIKE = 0.4
"""Metres in height within which the same stuff on both sides is one piece of ground: what lies under it is deeper."""

NEAR = 0.08
"""The same of any stuff: less than a kerb."""

ABOVE = ("wire", "paint")
"""Materials of what is not the ground but lies or hangs over it: broken lines begin where each tile's street does."""

_AT_ALL = 0.3  # and where there is nothing nearer
_MOST_STEP = 1e-3  # metres between heights of both sides
_LEAST = 0.03  # metres along the border: narrower pieces of ground are slivers between two kinds
_EVERY = 0.25  # metres between points at which fields are held against each other


@dataclass(frozen=True)
class Side:
    """One side of a tile's square.

    Attributes
    ----------
    axis
        Coordinate that is the same all along it: 0 for a western or eastern side, 1 for a southern or northern one.
    at
        Its value, metres.
    """

    axis: int
    at: float

    def on(self, positions: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Return which points lie on the side."""
        return np.abs(positions[:, self.axis].astype(np.float64) - self.at) < ON_LINE


@dataclass(frozen=True)
class Profile:
    """Edges of triangles that a tile draws along a side.

    Attributes
    ----------
    start, end
        Where they begin and end, metres along the side, ``start < end``, shape ``(n,)``.
    low, high
        Heights there, metres, shape ``(n,)``.
    stuff
        Names of their materials.
    """

    start: Floats
    end: Floats
    low: Floats
    high: Floats
    stuff: list[str]

    def heights(self, along: Floats, near: Floats, stuff: str) -> Floats:
        """Return heights of the edges that are nearest to points, of the same stuff if there are; NaN where none is.

        Parameters
        ----------
        along, near
            Metres along the side, and heights, shape ``(n,)``.
        stuff
            Name of the points' material.
        """
        within = (self.start[None] <= along[:, None] + SAME) & (along[:, None] <= self.end[None] + SAME)
        share = (along[:, None] - self.start[None]) / (self.end - self.start)[None]
        z = self.low[None] + np.clip(share, 0.0, 1.0) * (self.high - self.low)[None]
        off = np.where(within, np.abs(z - near[:, None]), np.inf)
        if not off.shape[1]:
            return np.full(len(along), np.nan)
        alike = np.array([name == stuff for name in self.stuff], np.bool_)
        found = np.full(len(along), np.nan)
        row = np.arange(len(along))
        anything = np.ones(len(alike), np.bool_)
        for chosen, reach in ((alike, NEAR), (anything, NEAR), (alike, ALIKE), (anything, _AT_ALL)):
            far = np.where(chosen[None], off, np.inf)
            best = far.argmin(axis=1)
            fits = np.isnan(found) & (far[row, best] <= reach)
            found[fits] = z[row, best][fits]
        return found

    def covers(self, along: Floats, above: Floats) -> NDArray[np.bool_]:
        """Return at which points, shape ``(n,)``, some edge lies well above a height."""
        within = (self.start[None] <= along[:, None] + SAME) & (along[:, None] <= self.end[None] + SAME)
        share = np.clip((along[:, None] - self.start[None]) / (self.end - self.start)[None], 0.0, 1.0)
        z = self.low[None] + share * (self.high - self.low)[None]
        return np.asarray((within & (z > above[:, None] + ALIKE)).any(axis=1))

    def ends(self, stuff: str) -> Floats:
        """Return where ground of one stuff begins and ends: metres along the side and heights, shape ``(m, 2)``."""
        own = np.array([name == stuff for name in self.stuff], np.bool_)
        points = np.column_stack([np.r_[self.start[own], self.end[own]], np.r_[self.low[own], self.high[own]]])
        _, first, many = np.unique(np.round(points, 3), axis=0, return_index=True, return_counts=True)
        return np.asarray(points[first[many % 2 == 1]], np.float64)


def profile_of(surfaces: Sequence[Surface], side: Side) -> Profile:
    """Return what surfaces of the ground draw along a side; upright faces on it are left out."""
    found: list[Floats] = []
    stuff: list[str] = []
    for surface in surfaces:
        if surface.material.name in ABOVE:
            continue
        edges = edges_on(surface, side)
        if len(edges):
            ends = surface.positions[edges[:, :2]].astype(np.float64)
            t, z = ends[:, :, 1 - side.axis], ends[:, :, 2]
            order = np.argsort(t, axis=1, kind="stable")
            t, z = np.take_along_axis(t, order, axis=1), np.take_along_axis(z, order, axis=1)
            found.append(np.column_stack([t, z])[t[:, 1] - t[:, 0] > SAME])
            stuff += [surface.material.name] * len(found[-1])
    start, end, low, high = np.ascontiguousarray((np.concatenate(found) if found else np.zeros((0, 4))).T)
    return Profile(start, end, low, high, stuff)


def edges_on(surface: Surface, side: Side) -> NDArray[np.int64]:
    """Return the edges on a side of triangles that do not stand on it: both ends in order, and the triangle."""
    on = side.on(surface.positions)[surface.triangles]
    faces = np.flatnonzero(on.sum(axis=1) == 2)
    if not len(faces):
        return np.zeros((0, 3), np.int64)
    off = (~on[faces]).argmax(axis=1)
    corner = surface.triangles[faces].astype(np.int64)
    row = np.arange(len(faces))
    return np.stack([corner[row, (off + 1) % 3], corner[row, (off + 2) % 3], faces], axis=1)


def border_findings(city: City, first: tuple[int, int], second: tuple[int, int], axis: int) -> list[str]:
    """Return what is wrong along the border of two tiles, a sentence each.

    Parameters
    ----------
    first, second
        The tiles; the second lies east (`axis` 0) or north (1) of the first.
    """
    half = city.manifest.size / 2
    name = f"border of {first[0]}_{first[1]} and {second[0]}_{second[1]}"
    worlds = city.world(first), city.world(second)
    along = np.arange(-half, half + _EVERY / 2, _EVERY)
    found: list[str] = []
    points = [np.empty((len(along), 2)) for _ in worlds]
    for one, at in zip(points, (half, -half), strict=True):
        one[:, axis], one[:, 1 - axis] = at, along
    for what in ("smooth", "lower", "upper"):
        a, b = (getattr(world.height, what)(one) for world, one in zip(worlds, points, strict=True))
        step = np.abs(a - b)
        if step.max() > 0.0:
            found.append(f"{name}: {what} heights differ by {step.max():.4f} m at {along[step.argmax()]:.2f} m")
    sides = Side(axis, half), Side(axis, -half)
    drawn = [profile_of(world.surfaces("ground"), side) for world, side in zip(worlds, sides, strict=True)]
    houses = _houses(city, first, axis)
    for a, b in (drawn, drawn[::-1]):
        found += [f"{name}: {sentence}" for sentence in _unmatched_edges(a, b, houses)]
    return found


def _houses(city: City, first: tuple[int, int], axis: int) -> NDArray[np.float64]:
    """Return where buildings stand across a tile's eastern or northern border, metres along it, shape ``(n, 2)``."""
    half = city.manifest.size / 2
    found: list[tuple[float, float]] = []
    # Houses may stand beyond the tile of their middle: of both tiles, and of those beside them.
    for across, aside in ((across, aside) for across in (0, 1) for aside in (-1, 0, 1)):
        dx, dy = (across, aside) if axis == 0 else (aside, across)
        tile = first[0] + dx, first[1] + dy
        if tile not in city:
            continue
        at, along = half - city.manifest.size * across, -city.manifest.size * aside
        ends = [(at, along - half), (at, along + half)]
        line = shapely.LineString(ends if axis == 0 else [end[::-1] for end in ends])
        for building in city.world(tile).buildings:
            for part in shapely.get_parts(overlay.intersection(line, shapely.Polygon(building.footprint[0]))):
                met = shapely.get_coordinates(part)[:, 1 - axis] - along
                if len(met):
                    found.append((float(met.min()), float(met.max())))
    return np.array(found).reshape(-1, 2)


def _unmatched_edges(one: Profile, other: Profile, houses: NDArray[np.float64]) -> list[str]:
    """Return where the edges of one side are not met by those of the other; what lies under others nobody sees."""
    found: list[str] = []
    # In the middle between any two ends, too: where a piece of the other side is missing none need end.
    ends = np.unique(np.r_[one.start, one.end, other.start, other.end])
    middles = ((ends[1:] + ends[:-1]) / 2)[np.diff(ends) >= _LEAST]
    for stuff in sorted(set(one.stuff)):
        own = np.array([name == stuff for name in one.stuff], np.bool_) & (one.end - one.start >= _LEAST)
        within, at = np.nonzero((one.start[own, None] < middles) & (middles < one.end[own, None]))
        share = (middles[at] - one.start[own][within]) / (one.end - one.start)[own][within]
        t = np.r_[one.start[own], one.end[own], middles[at]]
        z = np.r_[one.low[own], one.high[own], one.low[own][within] + share * (one.high - one.low)[own][within]]
        there = other.heights(t, z, stuff)
        under = ((houses[:, 0] <= t[:, None]) & (t[:, None] <= houses[:, 1])).any(axis=1)
        under |= one.covers(t, z) & other.covers(t, z)
        for k in np.flatnonzero(~(np.abs(there - z) <= _MOST_STEP) & ~under).tolist():
            what = "nothing meets" if np.isnan(there[k]) else f"{abs(there[k] - z[k]):.3f} m from"
            found.append(f"{what} {stuff} at {t[k]:.3f} m, {z[k]:.2f} m high")
    return found
