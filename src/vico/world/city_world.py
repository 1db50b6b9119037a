"""A city as one world: what its tiles have, told in its own frame, and the streets that are the city's."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from vico.geo.frame import LocalFrame
from vico.io.arrays import drop_pages, mapped_array
from vico.io.files import sha256_of
from vico.world.city import CITY, City, CityTile
from vico.world.city_entities import CityEntities
from vico.world.city_files import COST, GATES, STEPS, WHOLE
from vico.world.city_gates import Gates
from vico.world.city_ground import give_back, whole_ground, whole_walkable
from vico.world.city_rooms import CityRooms, RoomsById
from vico.world.city_routing import CityRouter
from vico.world.city_walk_lengths import CityWalkLengths
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface
from vico.world.model import Building, Entrance, Manifest, Place, Room
from vico.world.moving import Shift
from vico.world.objects import Objects
from vico.world.street_model import ParkingSpot
from vico.world.transit_model import Transit
from vico.world.walk_lengths import CoarseWalkLengths, WalkLengths
from vico.world.walkable import WalkableMap
from vico.world.world import World, named_ground, named_stops

if TYPE_CHECKING:
    from vico.world.lanes import LaneGraph

T = TypeVar("T")

# Counts of tiles that say nothing added up: a street is in several of them, and so are kinds of things.
_NOT_A_SUM = ("kinds", "roads", "walkways")


class CityWorld(World):
    """A city of tiles as one world.

    Entities of a tile's things are those it gave them, shifted by a number of its own (`vico.world.moving`); ids that
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
        """Where a city ends whose tiles fill no square around its middle, metres."""
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

    def _joined(self, read: Callable[[World, Shift], Iterable[T]]) -> list[T]:
        """Return what all tiles have, in their order."""
        return [one for tile in self._own for one in read(*self._tile(tile))]

    def _tile(self, tile: CityTile) -> tuple[World, Shift]:
        place = tile.column, tile.row
        return self.city.world(place), Shift.of(self.city, place)

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
        return self._joined(lambda world, shift: map(shift.building, world.buildings))

    @cached_property
    def places(self) -> list[Place]:
        """Named places, tile by tile."""
        return self._joined(lambda world, shift: map(shift.place, world.places))

    @cached_property
    def entrances(self) -> list[Entrance]:
        """Doors of the accessible buildings."""
        return self._joined(lambda world, shift: map(shift.entrance, world.entrances))

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
        return self._joined(lambda world, shift: map(shift.spot, world.parking))

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
        """Where people can walk, read where it is looked at."""
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
            give_back(self.height)
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
                shift.surface(replace(one, material=self._materials.shared(one.material)))
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
                    found[name] = [replace(one, material=self._materials.shared(one.material)) for one in surfaces]
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
        """Where people can walk in the city."""
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

    def shared(self, material: Material) -> Material:
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
