"""A world: what one reads of it, whichever way it is stored."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from vico.errors import MissingFileError
from vico.geo.frame import LocalFrame
from vico.io.files import sha256_of
from vico.world import model
from vico.world.glb import glb_bounds, read_glb
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import Building, Entrance, Manifest, Place, Room
from vico.world.objects import Objects, read_objects
from vico.world.records import manifest_bytes, read_record, read_records, read_terrain
from vico.world.routing import Router
from vico.world.street_model import ParkingSpot, Roads
from vico.world.transit_model import Transit
from vico.world.trips import Trips
from vico.world.walk_lengths import CoarseWalkLengths, WalkLengths
from vico.world.walkable import WalkableMap, read_walkable

if TYPE_CHECKING:
    from vico.world.lanes import LaneGraph

T = TypeVar("T")

LAYERS = ("ground", "buildings", "roofs", "rooms", "collision")


class World:
    """A generated place. Its parts are read from the folder the first time they are used, and kept.

    Parameters
    ----------
    manifest
        What the world is.
    path
        Its folder; None for a world that lives in memory only.
    parts
        Parts by attribute name, instead of the folder's (for worlds in memory): ``height``, ``buildings``, ``places``,
        ``entrances``, ``rooms``, ``objects``, ``roads``, ``transit``, ``walkable``, ``lanes``, ``parking``, ``layers``
        (surfaces by layer) and ``models`` (surfaces by prototype).

    Attributes
    ----------
    manifest, frame, half
        The manifest, the local frame, and half the side of the square, metres.
    """

    def __init__(self, manifest: Manifest, path: Path | None = None, **parts: Any) -> None:
        self.manifest = manifest
        self.path = path
        self.half = manifest.half
        self.frame = LocalFrame(**manifest.origin.model_dump())
        self._derived: dict[object, object] = {}
        self._layers: dict[str, list[Surface]] = dict(parts.pop("layers", {}))
        known = {"height", "buildings", "places", "entrances", "rooms", "objects", "roads", "transit", "walkable"}
        if unknown := set(parts) - known - {"lanes", "models", "parking"}:
            raise TypeError(f"World: unknown parts {sorted(unknown)}")
        for name, value in parts.items():
            self.__dict__["_models" if name == "models" else name] = value

    def __repr__(self) -> str:
        counts, origin = self.manifest.counts, self.manifest.origin
        size = ", ".join(f"{counts[name]:,} {name}" for name in ("buildings", "places", "roads") if name in counts)
        where = "in memory" if self.path is None else str(self.path)
        return (
            f"{type(self).__name__}({self.manifest.name!r}, {2 * self.half:g} m square at {origin.lat:.5f}, "
            f"{origin.lon:.5f}: {size}; {where})"
        )

    def shared(self, kind: type[T], make: Callable[[], T]) -> T:
        """Return what others have made of the world and share, made the first time that it is asked for."""
        known = self._derived.get(kind)
        if not isinstance(known, kind):
            self._derived[kind] = known = make()
        return known

    @property
    def edges(self) -> tuple[float, float, float, float] | None:
        """Where it ends, west, south, east and north, metres, if it is no square of `half`."""
        return None

    def file(self, name: str) -> Path:
        """Path of one of the world's files."""
        if self.path is None:
            raise MissingFileError(f"world {self.manifest.name!r} lives in memory and has no {name}; write it first")
        return self.path / name

    @cached_property
    def digest(self) -> str:
        """SHA-256 of ``world.json``, which holds the hashes of all other files: the world's identity."""
        if self.path is None:
            return hashlib.sha256(manifest_bytes(self.manifest)).hexdigest()
        return sha256_of(self.path / "world.json")

    @cached_property
    def height(self) -> HeightField:
        """Ground heights."""
        return read_terrain(self.file("terrain.npz"))

    @cached_property
    def buildings(self) -> list[Building]:
        """Buildings, in the order of their entities."""
        return read_records(self.file("buildings.json"), Building)

    @cached_property
    def places(self) -> list[Place]:
        """Named places."""
        return read_records(self.file("places.json"), Place)

    @cached_property
    def entrances(self) -> list[Entrance]:
        """Doors of the accessible buildings."""
        return read_records(self.file("entrances.json"), Entrance)

    @cached_property
    def rooms(self) -> Sequence[Room]:
        """Rooms of the places, below ground."""
        return read_records(self.file("rooms.json"), Room)

    @cached_property
    def objects(self) -> Objects:
        """Things that stand outdoors and indoors."""
        return read_objects(self.file("objects.parquet"))

    @cached_property
    def roads(self) -> Roads:
        """The road database."""
        return read_record(self.file("roads.json"), Roads)

    @cached_property
    def transit(self) -> Transit:
        """Stops, lines, bicycle stations."""
        return read_record(self.file("transit.json"), Transit)

    @cached_property
    def parking(self) -> list[ParkingSpot]:
        """Parking spots; none in worlds that were built before there were any."""
        if self.path is None or not (self.path / "parking.json").exists():
            return []
        return read_records(self.path / "parking.json", ParkingSpot)

    @cached_property
    def walkable(self) -> WalkableMap:
        """Where people can walk."""
        return read_walkable(self.file("walkable.npz"))

    @cached_property
    def router(self) -> Router:
        """Finds ways on the walkable map."""
        return Router(self.walkable)

    def forget(self) -> None:
        """Forget what is easily read anew; a world of one tile keeps all it has read."""

    def drop_pages(self) -> None:
        """Give back memory whose content is read again where it is looked at; a world of one tile has none."""

    def walk_lengths(self) -> WalkLengths:
        """Return what measures many walks; who made it keeps it, for it takes some memory."""
        return CoarseWalkLengths(self.router)

    @cached_property
    def trips(self) -> Trips:
        """Plans trips on foot, by bus, by tram and by bicycle."""
        return Trips(self)

    @cached_property
    def lanes(self) -> LaneGraph:
        """The lane graph of the road network."""
        from vico.world.lane_reader import read_lanes

        return read_lanes(self.file("roads.net.xml"))

    def parts(self) -> Iterator[World]:
        """Yield worlds that have all things of this one together, in its frame: itself, or tile by tile of a city.

        Nobody keeps what is read of a part.
        """
        yield self

    def surfaces(self, layer: str) -> list[Surface]:
        """Meshes of a layer (one of `LAYERS`), ENU metres."""
        if layer not in self._layers:
            if layer not in LAYERS:
                raise KeyError(f"world has no layer {layer!r}; layers are {', '.join(LAYERS)}")
            nodes = read_glb(self._mesh(layer))
            self._layers[layer] = [surface for surfaces in nodes.values() for surface in surfaces]
        return self._layers[layer]

    def bounds(self, layer: str) -> NDArray[np.float64] | None:
        """Lowest and highest corner of a box around a layer, ENU metres, shape ``(2, 3)``; None where it is empty."""
        return glb_bounds(self._mesh(layer))

    def textures(self) -> list[NDArray[np.uint8]]:
        """Return the textures of the layers that were read so far."""
        pictures = (surface.material.texture for layer in self._layers.values() for surface in layer)
        return [picture for picture in pictures if picture is not None]

    def geometry(self, layer: str, material: str) -> list[Surface]:
        """Return the meshes of a layer that are of one material, without its texture; none of a world without any."""
        known = self._layers.get(layer)
        if known is None and self.path is not None and self.file(f"meshes/{layer}.glb").exists():
            nodes = read_glb(self._mesh(layer), only=material)
            known = [surface for surfaces in nodes.values() for surface in surfaces]
        return [surface for surface in known or () if surface.material.name == material]

    def prototypes(self) -> dict[str, list[Surface]]:
        """Models that the objects are instances of, by name; at the origin, z up, +x forward."""
        return self._models

    @cached_property
    def _models(self) -> dict[str, list[Surface]]:
        return read_glb(self._mesh("prototypes"))

    def _mesh(self, name: str) -> Path:
        path = self.file(f"meshes/{name}.glb")
        if not path.exists():
            raise MissingFileError(f"{path}: no such file; build the world anew")
        return path

    @cached_property
    def entities(self) -> Mapping[int, dict[str, str]]:
        """Kind and name of everything that segmentation images can show, by entity."""
        found = named_ground() | named_buildings(self.buildings) | named_rooms(self.rooms) | named_stops(self.transit)
        objects = self.objects
        for entity, kind, name in zip(objects.entity.tolist(), objects.kind, objects.id, strict=True):
            found.setdefault(entity, {"kind": str(kind), "name": str(name)})
        return found

    @cached_property
    def building_by_id(self) -> dict[str, Building]:
        """Buildings by id."""
        return {b.id: b for b in self.buildings}

    @cached_property
    def place_by_id(self) -> dict[str, Place]:
        """Places by id."""
        return {p.id: p for p in self.places}

    @cached_property
    def entrance_by_id(self) -> dict[str, Entrance]:
        """Entrances by id."""
        return {e.id: e for e in self.entrances}

    @cached_property
    def room_by_id(self) -> Mapping[str, Room]:
        """Rooms by id."""
        return {r.id: r for r in self.rooms}


def named_ground() -> dict[int, dict[str, str]]:
    """Return kind and name of what is drawn in every world, by entity."""
    return {
        model.ENTITY_GROUND: {"kind": "ground", "name": "ground"},
        model.ENTITY_ROAD: {"kind": "road", "name": "road"},
        model.ENTITY_WATER: {"kind": "water", "name": "water"},
        model.ENTITY_GREEN: {"kind": "green", "name": "green"},
        model.ENTITY_BACKDROP: {"kind": "backdrop", "name": "backdrop"},
        model.ENTITY_WIRE: {"kind": "wire", "name": "contact wire"},
    }


def named_buildings(buildings: Iterable[Building]) -> dict[int, dict[str, str]]:
    """Return kind and name of buildings, by entity."""
    return {one.entity: {"kind": "building", "name": one.name or one.id} for one in buildings}


def named_rooms(rooms: Iterable[Room]) -> dict[int, dict[str, str]]:
    """Return kind and name of rooms, by entity."""
    return {one.entity: {"kind": "room", "name": f"{one.kind} {one.id}"} for one in rooms}


def named_stops(transit: Transit) -> dict[int, dict[str, str]]:
    """Return kind and name of stops and stations, by entity."""
    found = {stop.entity: {"kind": "bus_stop", "name": stop.name} for stop in transit.stops}
    found |= {stop.entity: {"kind": "tram_stop", "name": stop.name} for stop in transit.tram_stops}
    return found | {station.entity: {"kind": "bike_station", "name": station.name} for station in transit.bike_stations}
