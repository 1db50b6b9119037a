"""A city as one world: what its tiles have, in the frame of the city, and the streets that are the city's.

Rooms (there are hundreds of thousands) and names of entities (there are millions) are read from the tiles when they are
asked for.
"""

from __future__ import annotations

import mmap
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from hashlib import blake2b
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, overload

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from pydantic_core import from_json

from vico.errors import MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.io.arrays import drop_map, drop_pages, mapped_array
from vico.io.files import sha256_of
from vico.io.memory import LruCache
from vico.world.city import (
    CITY,
    COST,
    GATES,
    STEPS,
    WHOLE,
    City,
    CityTile,
    TileShift,
    release_pages,
    whole_ground,
    whole_walkable,
)
from vico.world.city_gates import Gates
from vico.world.city_routing import CityRouter, CityWalkLengths
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface
from vico.world.model import FIRST_ROOM, FIRST_STOP, Building, Entrance, Manifest, ParkingSpot, Place, Room
from vico.world.objects import Objects
from vico.world.transit import Transit
from vico.world.walk_lengths import CoarseWalkLengths, WalkLengths
from vico.world.walkable import WalkableMap
from vico.world.world import World, invalid, named_buildings, named_ground, named_rooms, named_stops

if TYPE_CHECKING:
    from vico.world.lanes import LaneGraph
# Tiles whose names are kept: some 60 bytes a thing, where a dictionary of dictionaries would take 400.
_TILES_KEPT = 32
_TEXT = np.dtypes.StringDType()


class CityEntities(Mapping[int, dict[str, str]]):
    """Kind and name of everything in a city that segmentation images can show, by entity.

    What a tile has is read when the first of its things is asked for, and kept as long as no others are used more.

    Parameters
    ----------
    city
        The city.
    of_all
        What is no tile's: kinds of ground, stops and stations.
    """

    def __init__(self, city: City, of_all: Mapping[int, dict[str, str]]) -> None:
        self._city = city
        self._of_all = of_all
        self._tiles: LruCache[tuple[int, int], _Named] = LruCache(_TILES_KEPT)

    def __getitem__(self, entity: int) -> dict[str, str]:
        known = self._of_all.get(entity)
        if known is not None:
            return known
        if FIRST_STOP <= entity < FIRST_ROOM:
            return self._at_stops[entity]
        tile = TileShift.tile_of(self._city, entity)
        if tile is None or tile not in self._city:
            raise KeyError(entity)
        return self._of_tile(tile)[entity]

    def __iter__(self) -> Iterator[int]:
        """Yield all entities; every tile is read for that."""
        tiles = (self._of_tile(tile).entity.tolist() for tile in self._places())
        return chain(self._of_all, self._at_stops, *tiles)

    def __len__(self) -> int:
        """Return how many there are; every tile is read for that."""
        return len(self._of_all) + len(self._at_stops) + sum(len(self._of_tile(t).entity) for t in self._places())

    def _places(self) -> list[tuple[int, int]]:
        return [(tile.column, tile.row) for tile in self._city.manifest.tiles]

    def _of_tile(self, tile: tuple[int, int]) -> _Named:
        known = self._tiles.get(tile)
        if known is None:
            known = _Named(self._city, tile)
            self._tiles.keep(tile, known)
        return known

    @cached_property
    def _at_stops(self) -> dict[int, dict[str, str]]:
        """Objects that have a number among those of stops, but are none: those of all tiles, the first of a number."""
        found: dict[int, dict[str, str]] = {}
        for tile in self._places():
            objects = self._city.world(tile).objects
            at_stops = np.flatnonzero((objects.entity >= FIRST_STOP) & (objects.entity < FIRST_ROOM))
            there = TileShift.of(self._city, tile).objects(objects.where(at_stops))
            for entity, kind, name in zip(there.entity.tolist(), there.kind, there.id, strict=True):
                if entity not in self._of_all:
                    found.setdefault(entity, {"kind": str(kind), "name": str(name)})
        return found


class _Named:
    """Identifiers and places of the things of one tile in their city.

    Parameters
    ----------
    city
        The city.
    tile
        Column and row.
    """

    def __init__(self, city: City, tile: tuple[int, int]) -> None:
        world, shift = city.world(tile), TileShift.of(city, tile)
        objects = shift.objects(world.objects)
        built = {
            shift.entity(n): one for n, one in (named_buildings(world.buildings) | named_rooms(world.rooms)).items()
        }
        entity = np.concatenate([np.array([*built], np.int32), objects.entity])
        kind = np.concatenate([np.array([one["kind"] for one in built.values()], _TEXT), objects.kind])
        name = np.concatenate([np.array([one["name"] for one in built.values()], _TEXT), objects.id])
        # The first of a number is taken; numbers that are not shifted are those of stops, which are the city's.
        self.entity, first = np.unique(entity, return_index=True)
        own = self.entity >= FIRST_ROOM
        self.entity, self._kind, self._name = self.entity[own], kind[first[own]], name[first[own]]

    def __getitem__(self, entity: int) -> dict[str, str]:
        row = int(np.searchsorted(self.entity, entity))
        if row == len(self.entity) or self.entity[row] != entity:
            raise KeyError(entity)
        return {"kind": str(self._kind[row]), "name": str(self._name[row])}


# Rooms that are kept: those that a community is in, and more.
_ROOMS_KEPT = 8192


class CityRooms(Sequence[Room]):
    """The rooms of all tiles, in the order of the tiles.

    Parameters
    ----------
    files
        Each tile's ``rooms.json``, one room a line, and how its things become the city's.

    Raises
    ------
    MissingFileError
        If one of the files is not there.
    """

    def __init__(self, files: Sequence[tuple[Path, TileShift]]) -> None:
        self._files = list(files)
        self._maps = [_map_file(path) for path, _ in files]
        self._ends = [np.flatnonzero(np.frombuffer(content, np.uint8) == ord("\n")) for content in self._maps]
        # A file has a room a line between its brackets, and an empty line where there is none.
        empty = [len(ends) < 3 or ends[1] - ends[0] == 1 for ends in self._ends]
        rooms = [0 if none else len(ends) - 2 for none, ends in zip(empty, self._ends, strict=True)]
        self._first = np.cumsum([0, *rooms])
        self._kept = lru_cache(maxsize=_ROOMS_KEPT)(self._read)

    def __len__(self) -> int:
        return int(self._first[-1])

    @overload
    def __getitem__(self, number: int) -> Room: ...

    @overload
    def __getitem__(self, number: slice) -> list[Room]: ...

    def __getitem__(self, number: int | slice) -> Room | list[Room]:
        if isinstance(number, slice):
            return [self[k] for k in range(*number.indices(len(self)))]
        k = int(number) + (len(self) if number < 0 else 0)
        if not 0 <= k < len(self):
            raise IndexError(f"room {number} of {len(self)}")
        return self._kept(k)

    def __iter__(self) -> Iterator[Room]:
        """Yield all rooms, without keeping them."""
        return map(self._read, range(len(self)))

    def numbers_in(self, files: Sequence[int]) -> NDArray[np.int64]:
        """Return the numbers of the rooms in some of the files, given by their places in the list."""
        ranges = [np.arange(*self._first[k : k + 2], dtype=np.int64) for k in files]
        return np.concatenate([np.zeros(0, np.int64), *ranges])

    def drop_pages(self) -> None:
        """Give back the memory that the files are read into; they are read again where somebody asks."""
        for content in self._maps:
            if isinstance(content, mmap.mmap):
                drop_map(content)

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Number of each room by its id."""
        return {name: k for k, name in enumerate(self._ids())}

    def _ids(self) -> Iterator[str]:
        for number in range(len(self)):
            tile, line = self._line(number)
            try:
                # Not the whole room: what it holds takes ten times as long to read.
                yield from_json(line)["id"]
            except (ValueError, TypeError, KeyError) as error:
                raise SchemaError(f"{self._files[tile][0]}: room {number}: {error}; build the city anew") from None

    def _line(self, number: int) -> tuple[int, bytes]:
        """Return the tile that a room is in, and what its file says of it."""
        tile = int(np.searchsorted(self._first, number, side="right")) - 1
        row = number - int(self._first[tile])
        start, end = self._ends[tile][row : row + 2].tolist()
        return tile, self._maps[tile][start + 1 : end].rstrip(b",")

    def _read(self, number: int) -> Room:
        tile, line = self._line(number)
        path, shift = self._files[tile]
        try:
            return shift.room(Room.model_validate_json(line))
        except ValidationError as error:
            raise invalid(path, error) from None


def numbers_of(rooms: Sequence[Room]) -> Mapping[str, int]:
    """Return the number of each of some rooms by its id."""
    return rooms.numbers if isinstance(rooms, CityRooms) else {room.id: k for k, room in enumerate(rooms)}


class RoomsById(Mapping[str, Room]):
    """Rooms of a city by their ids.

    Parameters
    ----------
    rooms
        The rooms.
    """

    def __init__(self, rooms: CityRooms) -> None:
        self._rooms = rooms
        self._numbers = rooms.numbers

    def __getitem__(self, key: str) -> Room:
        return self._rooms[self._numbers[key]]

    def __contains__(self, key: object) -> bool:
        """Whether there is such a room; it is not read for that."""
        return key in self._numbers

    def __iter__(self) -> Iterator[str]:
        return iter(self._numbers)

    def __len__(self) -> int:
        return len(self._numbers)


def _map_file(path: Path) -> bytes | mmap.mmap:
    try:
        with path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the city anew") from None


T = TypeVar("T")

# Counts of tiles that say nothing added up: a street is in several of them, and so are kinds of things.
_NOT_A_SUM = ("kinds", "roads", "walkways")


class CityWorld(World):
    """A city of tiles as one world.

    Entities of a tile's things are those it gave them, shifted by a number of its own (`vico.world.city`); ids that
    only a tile knew apart begin with its name.

    Parameters
    ----------
    city
        The city.
    """

    def __init__(self, city: City) -> None:
        self.city = city
        self._own = city.manifest.tiles
        self._materials = _Materials()
        super().__init__(_manifest(city), city.path)

    @property
    def edges(self) -> tuple[float, float, float, float] | None:
        """Return where a city ends whose tiles fill no square around its middle, metres."""
        known = self.city.manifest
        (west, south), (east, north) = (
            [(k + side) * known.size for k in corner] for corner, side in ((known.first, -0.5), (known.last, 0.5))
        )
        return None if {-west, -south, east, north} == {self.half} else (west, south, east, north)

    def file(self, name: str) -> Path:
        """Path of one of the files that the city has as a whole."""
        return self.city.path / WHOLE / name

    @cached_property
    def digest(self) -> str:
        """SHA-256 of ``city.json``, which holds the digests of all tiles: the city's identity."""
        return sha256_of(self.city.path / CITY)

    def _from_tiles(self, read: Callable[[World, TileShift], Iterable[T]]) -> list[T]:
        """Return what all tiles have, in their order."""
        return [one for tile in self._own for one in read(*self._tile(tile))]

    def _tile(self, tile: CityTile) -> tuple[World, TileShift]:
        place = tile.column, tile.row
        return self.city.world(place), TileShift.of(self.city, place)

    def part(self, tiles: Collection[tuple[int, int]]) -> CityPart:
        """Return what is in some of the tiles, as a world of its own in the city's frame."""
        return CityPart(self, tiles)

    def parts(self) -> Iterator[World]:
        """Yield the tiles one by one."""
        yield from (self.part([(tile.column, tile.row)]) for tile in self._own)

    @cached_property
    def height(self) -> HeightField:
        """Ground heights, read where they are looked at."""
        return whole_ground(self.city.path / WHOLE, self.half)

    @cached_property
    def buildings(self) -> list[Building]:
        """Buildings, tile by tile."""
        return self._from_tiles(lambda world, shift: map(shift.building, world.buildings))

    @cached_property
    def places(self) -> list[Place]:
        """Named places, tile by tile."""
        return self._from_tiles(lambda world, shift: map(shift.place, world.places))

    @cached_property
    def entrances(self) -> list[Entrance]:
        """Doors of the accessible buildings."""
        return self._from_tiles(lambda world, shift: map(shift.entrance, world.entrances))

    @cached_property
    def rooms(self) -> CityRooms:
        """Rooms of the places, each read when it is asked for."""
        parts = (self._tile(tile) for tile in self._own)
        return CityRooms([(world.file("rooms.json"), shift) for world, shift in parts])

    @cached_property
    def room_by_id(self) -> RoomsById:
        """Rooms by id."""
        return RoomsById(self.rooms)

    @cached_property
    def parking(self) -> list[ParkingSpot]:
        """Parking spots."""
        return self._from_tiles(lambda world, shift: map(shift.spot, world.parking))

    @cached_property
    def objects(self) -> Objects:
        """Things that stand outdoors and indoors."""
        parts = (self._tile(tile) for tile in self._own)
        return Objects.joined(shift.objects(world.objects) for world, shift in parts)

    @cached_property
    def entities(self) -> CityEntities:
        """Kind and name of everything that segmentation images can show, by entity; read tile by tile when asked."""
        return CityEntities(self.city, named_ground() | named_stops(self.transit))

    @cached_property
    def walkable(self) -> WalkableMap:
        """Return where people can walk, read where it is looked at."""
        return whole_walkable(self.city.path / WHOLE, self.half)

    @cached_property
    def router(self) -> CityRouter:
        """Finds ways on the walkable map: from gate to gate of the tiles."""
        gates = Gates.read(self.file(GATES), mapped_array(self.file(STEPS)))
        return CityRouter(self.walkable, mapped_array(self.file(COST)), gates, self._side)

    def forget(self) -> None:
        """Forget the things of all tiles, much of whose size is names: they are read anew where somebody asks."""
        self.__dict__.pop("objects", None)

    def drop_pages(self) -> None:
        """Give back the memory that files are read into: ground, walkable map, costs of walks, rooms."""
        opened = self.__dict__
        arrays: list[NDArray[Any]] = []
        if "height" in opened:
            release_pages(self.height)
        if "walkable" in opened:
            arrays.append(self.walkable.cls)
        if "router" in opened:
            # Ground that is closed for a walk is written into these: it is for the router to say when.
            self.router.drop_pages()
        elif "walkable" in opened:
            arrays += [self.walkable.clearance, self.walkable.connected]
        for array in arrays:
            drop_pages(array)
        if "rooms" in opened:
            self.rooms.drop_pages()

    @property
    def _side(self) -> int:
        """Cells of the walkable map along a tile's side."""
        return round(self.city.manifest.size / self.walkable.cell)

    def walk_lengths(self) -> WalkLengths:
        """Return what measures many walks: from gate to gate, too."""
        return CoarseWalkLengths(self.router) if self._side % 2 else CityWalkLengths(self.router, self._side)

    def surfaces(self, layer: str) -> list[Surface]:
        """Meshes of a layer of all tiles, ENU metres."""
        if layer not in self._layers:
            parts = (self._tile(tile) for tile in self._own)
            self._layers[layer] = [
                shift.surface(replace(one, material=self._materials.first_alike(one.material)))
                for world, shift in parts
                for one in world.surfaces(layer)
            ]
        return self._layers[layer]

    def geometry(self, layer: str, material: str) -> list[Surface]:
        """Return the meshes of a layer of all tiles that are of one material, without its texture."""
        parts = (self._tile(tile) for tile in self._own)
        return [shift.surface(one) for world, shift in parts for one in world.geometry(layer, material)]

    @cached_property
    def _models(self) -> dict[str, list[Surface]]:
        found: dict[str, list[Surface]] = {}
        for tile in self._own:
            for name, surfaces in self._tile(tile)[0].prototypes().items():
                if name not in found:
                    found[name] = [replace(one, material=self._materials.first_alike(one.material)) for one in surfaces]
        return dict(sorted(found.items()))


class CityPart(CityWorld):
    """Some tiles of a city: their things, under the city's numbers and names; ground and streets are the city's.

    Parameters
    ----------
    whole
        The city.
    tiles
        Columns and rows; those that the city does not have are left out.

    Attributes
    ----------
    whole
        The city.
    """

    def __init__(self, whole: CityWorld, tiles: Collection[tuple[int, int]]) -> None:
        self.whole = whole
        self.city = whole.city
        self._own = [tile for tile in whole.city.manifest.tiles if (tile.column, tile.row) in tiles]
        # Pictures that two parts have are in memory once.
        self._materials = whole._materials
        World.__init__(self, whole.manifest, whole.path)

    @cached_property
    def height(self) -> HeightField:
        """Ground heights of the city."""
        return self.whole.height

    @cached_property
    def walkable(self) -> WalkableMap:
        """Return where people can walk in the city."""
        return self.whole.walkable

    @cached_property
    def router(self) -> CityRouter:
        """Finds ways in the city."""
        return self.whole.router

    @cached_property
    def transit(self) -> Transit:
        """Stops, lines and stations of the city."""
        return self.whole.transit

    @cached_property
    def lanes(self) -> LaneGraph:
        """The lanes of the city."""
        return self.whole.lanes

    @property
    def entities(self) -> Mapping[int, dict[str, str]]:  # type: ignore[override]
        """Kind and name of everything in the city: parts show others from afar."""
        return self.whole.entities

    @cached_property
    def rooms(self) -> list[Room]:  # type: ignore[override]
        """Rooms of the places in these tiles."""
        parts = (self._tile(tile) for tile in self._own)
        return list(CityRooms([(world.file("rooms.json"), shift) for world, shift in parts]))

    @cached_property
    def room_by_id(self) -> dict[str, Room]:  # type: ignore[override]
        """Rooms by id."""
        return {room.id: room for room in self.rooms}

    def forget(self) -> None:
        """Forget what was read of the tiles: it is read anew where somebody asks."""
        self._layers.clear()
        for name in ("buildings", "places", "entrances", "rooms", "room_by_id", "parking", "objects", "_models"):
            self.__dict__.pop(name, None)

    @cached_property
    def room_numbers(self) -> NDArray[np.int64]:
        """Number of each room of `rooms` among those of the city."""
        return self.whole.rooms.numbers_in([self.city.manifest.tiles.index(tile) for tile in self._own])


class _Materials:
    """Makes materials one that look the same: every tile's files have pictures of their own of the same facades."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], Material] = {}

    def first_alike(self, material: Material) -> Material:
        """Return the first of the materials that look like this one."""
        picture = material.texture
        look = b"" if picture is None else blake2b(np.ascontiguousarray(picture).data).digest()
        shape = () if picture is None else picture.shape
        others = (getattr(material, name) for name in Material.__dataclass_fields__ if name != "texture")
        return self._known.setdefault((look, shape, *others), material)


def _manifest(city: City) -> Manifest:
    """Return what a world's manifest would say of a city."""
    known = city.manifest
    frame = LocalFrame(known.origin.lat, known.origin.lon)
    tiles = [city.world((tile.column, tile.row)).manifest for tile in known.tiles]
    counts: Counter[str] = Counter()
    by_type: Counter[str] = Counter()
    for tile in tiles:
        counts.update(tile.counts)
        by_type.update(tile.places_by_type)
    for name in _NOT_A_SUM:
        counts.pop(name, None)
    for report in known.reports:
        counts |= {name: number for name, number in report.counts.items() if name in ("roads", "lanes")}
    sources = {source.model_dump_json(): source for tile in tiles for source in tile.sources}
    return Manifest(
        producer=known.producer,
        name=city.path.name,
        origin=known.origin,
        half=city.half,
        bbox=frame.bbox(city.half),
        seed=known.seed,
        sources=[sources[key] for key in sorted(sources)],
        stages=known.reports,
        counts=dict(sorted(counts.items())),
        places_by_type=dict(sorted(by_type.items())),
        files={name.removeprefix(f"{WHOLE}/"): digest for name, digest in known.files.items()},
    )
