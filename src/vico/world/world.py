"""A world: what one reads of it, and its folder on disk.

::

    world.json            manifest, written last: a folder that has it is whole
    build.json            seconds per stage and the machine; not hashed, differs every time
    report.html           what was built, for a person: map, views, counts, what was left out; not hashed
    .stages/              what the stages made, to run one again; no part of the world, may be deleted
    terrain.npz           height field
    buildings.json places.json entrances.json rooms.json roads.json transit.json
    objects.parquet       things that stand around, one row each; parked cars among them
    parking.json          parking spots, those with a car and free ones; older worlds have none
    detections.json       things that photos show, and what became of them; in worlds built with detections
    roads.net.xml roads.xodr
    walkable.npz
    meshes/{ground,buildings,roofs,rooms,collision,prototypes}.glb
    map.png previews/*.png

Records are JSON, one record a line; `read_records` and `write_records` know nothing of what they hold.
"""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from vico.errors import MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.io.arrays import npz_bytes, read_npz
from vico.io.files import (
    FolderKind,
    files_of_manifest,
    read_json,
    sha256_of,
    write_bytes,
    write_json,
    wrong_folder_sentence,
)
from vico.version import __version__
from vico.world import model
from vico.world.glb import glb_bounds, read_glb
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import Building, Entrance, Manifest, ParkingSpot, Place, Point2, Record, Roads, Room
from vico.world.objects import Objects, read_objects
from vico.world.routing import Router
from vico.world.transit import Transit
from vico.world.trips import Trips
from vico.world.walk_lengths import CoarseWalkLengths, WalkLengths
from vico.world.walkable import WalkableMap, read_walkable

if TYPE_CHECKING:
    from vico.world.lanes import LaneGraph
R = TypeVar("R", bound=Record)


def write_records(path: Path, records: Iterable[Record]) -> None:
    """Write a list of records as JSON, one record a line."""
    rows = [json.dumps(r.model_dump(mode="json"), ensure_ascii=False, separators=(",", ":")) for r in records]
    write_bytes(path, ("[\n" + ",\n".join(rows) + "\n]\n").encode())


def write_record(path: Path, record: Record) -> None:
    """Write one record as JSON: a line for every entry of its lists."""
    parts = []
    for key, value in record.model_dump(mode="json").items():
        if isinstance(value, list):
            rows = [json.dumps(v, ensure_ascii=False, separators=(",", ":")) for v in value]
            text = "[\n" + ",\n".join(rows) + "\n]" if rows else "[]"
        else:
            text = json.dumps(value, ensure_ascii=False, sort_keys=True)
        parts.append(f"{json.dumps(key)}: {text}")
    write_bytes(path, ("{\n" + ",\n".join(parts) + "\n}\n").encode())


def read_records(path: Path, kind: type[R]) -> list[R]:
    """Read what `write_records` wrote.

    Raises
    ------
    MissingFileError, SchemaError
        If the file is not there, or a record is not valid; the message gives the path within the file.
    """
    try:
        return TypeAdapter(list[kind]).validate_json(_text(path))  # type: ignore[valid-type]
    except ValidationError as error:
        raise invalid(path, error) from None


def read_record(path: Path, kind: type[R]) -> R:
    """Read what `write_record` wrote; errors as in `read_records`."""
    try:
        return kind.model_validate_json(_text(path))
    except ValidationError as error:
        raise invalid(path, error) from None


def _text(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the world anew") from None


def invalid(path: Path, error: ValidationError) -> SchemaError:
    """Return what is wrong with a file whose content does not fit a record."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"]) or "the whole file"
    return SchemaError(f"{path}: {where}: {first['msg']}; build the world anew")


def write_terrain(path: Path, height: HeightField) -> None:
    """Write a height field as ``.npz``."""
    write_bytes(path, npz_bytes(height.arrays()))


def read_terrain(path: Path) -> HeightField:
    """Read what `write_terrain` wrote."""
    try:
        return HeightField.from_arrays(read_npz(path.read_bytes()))
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the world anew") from None
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise SchemaError(f"{path}: not a readable height field ({error}); build the world anew") from None


def manifest_bytes(manifest: Manifest) -> bytes:
    """Return the bytes of ``world.json``."""
    return (json.dumps(manifest.model_dump(mode="json"), indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode()


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
        """Return where it ends, west, south, east and north, metres, if it is no square of `half`."""
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
        """Return where people can walk."""
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
        from vico.world.lanes import read_lanes

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


#: Files that are no part of a world's identity.
UNHASHED = ("world.json", "build.json", "report.html")
#: Folder of what the stages of a build made, so that one can be run again.
STAGES = ".stages"


def read_stored(path: Path) -> World:
    """Open a folder of one world.

    Raises
    ------
    MissingFileError
        If there is no finished world at `path`.
    SchemaError
        If its manifest is damaged, of another kind, or of another version.
    """
    folder = Path(path)
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: no such folder; make one with vico world build")
    if not (folder / "world.json").exists():
        raise MissingFileError(wrong_folder_sentence(folder, "world", "vico world build"))
    content = read_json(folder / "world.json")
    if not isinstance(content, dict) or content.get("schema_name") != model.SCHEMA:
        found = content.get("schema_name") if isinstance(content, dict) else type(content).__name__
        raise SchemaError(f"{folder}/world.json: schema {found!r} is not {model.SCHEMA!r}; give a world folder")
    if content.get("version") != model.VERSION:
        raise SchemaError(
            f"{folder}/world.json: version {content.get('version')!r} of {model.SCHEMA}, but vico {__version__} reads "
            f"version {model.VERSION}; build the world anew"
        )
    try:
        manifest = Manifest.model_validate_json(json.dumps(content))
    except ValidationError as error:
        raise invalid(folder / "world.json", error) from None
    return World(manifest, folder)


#: Files that every world has.
REQUIRED = (
    "terrain.npz",
    "walkable.npz",
    "buildings.json",
    "entrances.json",
    "places.json",
    "rooms.json",
    "objects.parquet",
    "roads.json",
    "roads.net.xml",
    "roads.xodr",
    "transit.json",
    "meshes/ground.glb",
    "meshes/buildings.glb",
    "meshes/roofs.glb",
    "meshes/rooms.glb",
    "meshes/collision.glb",
    "meshes/prototypes.glb",
    "map.png",
)


#: What a build makes.
WORLD_FOLDER = FolderKind(
    "world", "world.json", lambda folder: {*files_of_manifest("world.json")(folder), *UNHASHED, f"{STAGES}/**"}
)


def world_files(folder: Path) -> list[str]:
    """Files that belong to the world in `folder`, relative paths in order."""
    found = [p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()]
    return sorted(
        name for name in found if name not in UNHASHED and not any(part.startswith(".") for part in Path(name).parts)
    )


def seal(folder: Path, manifest: Manifest, *, seconds: dict[str, float], without: Collection[str] = ()) -> Manifest:
    """Finish a world: hash every file, then write ``build.json`` and, last, ``world.json``.

    Parameters
    ----------
    without
        Files that this one need not have.

    Raises
    ------
    MissingFileError
        If a file that every world has is not there: it was taken away while the others were written.
    """
    files = {name: sha256_of(folder / name) for name in world_files(folder)}
    if gone := [name for name in REQUIRED if name not in files and name not in without]:
        raise MissingFileError(f"{folder / gone[0]}: taken away while the world was built; build it anew")
    sealed = manifest.model_copy(update={"files": files})
    write_json(
        folder / "build.json",
        {
            "seconds": {k: round(v, 3) for k, v in seconds.items()},
            "processors": os.cpu_count(),
            "producer": __version__,
        },
    )
    write_bytes(folder / "world.json", manifest_bytes(sealed))
    return sealed


def stage_seconds(world: World) -> dict[str, float]:
    """Seconds each stage of the build took, from ``build.json``; empty if it is not there."""
    path = world.file("build.json")
    content: dict[str, float] = read_json(path)["seconds"] if path.exists() else {}
    return content


FILE = "detections.json"


class DetectedObject(Record):
    """A thing that photos show, and what became of it.

    Attributes
    ----------
    object
        Id of the object in the world.
    name
        Class of the detections.
    model
        Of the object; "" for what the map knows already.
    seen_at
        Where photos show it, ENU metres.
    photos
        Ids of the photos.
    score
        Mean of the detections.
    spread
        How far the photos' rays pass it, root of the mean square, metres; None where one photo or the file placed it.
    how
        ``triangulated``, ``on the ground`` (by one photo) or ``located`` (the file told its place).
    decision
        ``new``: the map lacks it; ``map wins``: it stands where the map has it; ``moved``: where photos show it.
    off_map
        How far the map has it from there, metres; None for a new one.
    """

    object: str
    name: str
    model: str
    seen_at: Point2
    photos: tuple[str, ...]
    score: float
    spread: float | None
    how: Literal["triangulated", "on the ground", "located"]
    decision: Literal["new", "map wins", "moved"]
    off_map: float | None


def detected_objects(world: World) -> list[DetectedObject]:
    """Return what detections placed in a world; nothing for a world that was built without.

    Raises
    ------
    SchemaError
        If the file is damaged.
    """
    path = world.file(FILE)
    return read_records(path, DetectedObject) if path.exists() else []
