"""A world in other people's formats: glTF, OpenUSD, MuJoCo's MJCF, GeoJSON, OpenDRIVE; one call writes any of them.

GeoJSON (RFC 7946) is written here: what is where, for maps, longitude and latitude in degrees (WGS 84), heights in
metres. `vico.world.scene_exports` writes what can be seen and collided with.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.geo.frame import LocalFrame
from vico.io.files import FolderKind, files_of_manifest, new_folder, write_bytes, write_json
from vico.version import __version__
from vico.world.city import City
from vico.world.city_world import CityWorld
from vico.world.scene_exports import write_gltf, write_mjcf, write_usd
from vico.world.world import World

Feature = dict[str, Any]


def write_geojson(world: World, folder: Path, *, rooms: bool) -> dict[str, int]:
    """Write one feature collection a kind: buildings, places, entrances, roads, transit, objects (and rooms)."""
    kinds = {
        "buildings": _buildings(world),
        "places": _places(world),
        "entrances": _entrances(world),
        "roads": _roads(world),
        "transit": _transit(world),
        "objects": _objects(world, rooms),
    }
    if rooms:
        kinds["rooms"] = _rooms(world)
    counts = {}
    for name, features in kinds.items():
        rows = [json.dumps(f, ensure_ascii=False, separators=(",", ":")) for f in features]
        text = '{"type":"FeatureCollection","features":[\n' + ",\n".join(rows) + "\n]}\n"
        write_bytes(folder / f"{name}.geojson", text.encode())
        counts[name] = len(rows)
    return counts


def _feature(shape: str, coordinates: Any, key: str, /, **properties: Any) -> Feature:
    return {
        "type": "Feature",
        "id": key,
        "geometry": {"type": shape, "coordinates": coordinates},
        "properties": {name: value for name, value in properties.items() if value is not None},
    }


def _point(frame: LocalFrame, xyz: Sequence[float]) -> list[float]:
    lat, lon = frame.to_geodetic(np.asarray(xyz[:2], np.float64))
    return [round(float(lon), 7), round(float(lat), 7), *([round(float(xyz[2]), 2)] if len(xyz) > 2 else [])]


def _line(frame: LocalFrame, points: Sequence[Sequence[float]] | NDArray[Any]) -> list[list[float]]:
    xy = np.asarray(points, np.float64)
    lat, lon = frame.to_geodetic(xy[:, :2])
    return np.round(np.column_stack([lon, lat]), 7).tolist()


def _buildings(world: World) -> Iterator[Feature]:
    for b in world.buildings:
        rings = [_line(world.frame, [*ring, ring[0]]) for ring in b.footprint]
        yield _feature(
            "Polygon",
            rings,
            b.id,
            name=b.name,
            use=b.use,
            height=round(b.height, 2),
            base=round(b.base, 2),
            levels=b.levels,
            roof=b.roof_shape,
            colour=b.colour,
            accessible=b.accessible,
        )


def _places(world: World) -> Iterator[Feature]:
    for p in world.places:
        yield _feature(
            "Point",
            _point(world.frame, p.position),
            p.id,
            name=p.name,
            category=p.category.value,
            kind=p.kind,
            building=p.building,
            opening_hours=p.opening_hours,
        )


def _entrances(world: World) -> Iterator[Feature]:
    for e in world.entrances:
        yield _feature("Point", _point(world.frame, e.position), e.id, building=e.building, facing=round(e.facing, 4))


def _roads(world: World) -> Iterator[Feature]:
    for r in world.roads.roads:
        yield _feature(
            "LineString",
            _line(world.frame, r.line),
            r.id,
            name=r.name,
            kind=r.kind,
            width=r.width,
            lanes=r.lanes,
            oneway=r.oneway,
            sidewalk=r.sidewalk,
            speed=round(r.speed, 2),
            layer=r.layer,
        )


def _transit(world: World) -> Iterator[Feature]:
    transit = world.transit
    for s in transit.stops:
        yield _feature("Point", _point(world.frame, s.wait), s.id, name=s.name, kind="bus_stop")
    for b in transit.bike_stations:
        place = _point(world.frame, b.position)
        yield _feature("Point", place, b.id, name=b.name, kind="bike_station", capacity=b.capacity)
    for line in transit.lines:
        path = np.concatenate([world.lanes.line(world.lanes.index[lane])[:, :2] for lane in line.lanes])
        yield _feature(
            "LineString", _line(world.frame, path), line.id, name=line.name, kind="bus_line", stops=line.stops
        )


def _objects(world: World, rooms: bool) -> Iterator[Feature]:
    objects = world.objects if rooms else world.objects.where(world.objects.outdoors)
    for k in range(len(objects)):
        yield _feature(
            "Point",
            _point(world.frame, (objects.x[k], objects.y[k], objects.z[k])),
            str(objects.id[k]),
            kind=str(objects.kind[k]),
            group=str(objects.group[k]),
            height=round(float(objects.size_z[k]), 2),
            room=str(objects.room[k]) or None,
        )


def _rooms(world: World) -> Iterator[Feature]:
    for r in world.rooms:
        c, s = np.cos(r.yaw), np.sin(r.yaw)
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * np.array(r.size[:2]) / 2
        ring = corners @ np.array([[c, s], [-s, c]]) + np.array(r.centre[:2])
        yield _feature(
            "Polygon", [_line(world.frame, ring.tolist())], r.id, kind=r.kind, place=r.place, floor=r.centre[2]
        )


Writer = Callable[..., dict[str, int]]

#: Lists what an export wrote.
EXPORT_MANIFEST = "export.json"
EXPORT_FOLDER = FolderKind("export", EXPORT_MANIFEST, files_of_manifest(EXPORT_MANIFEST))


def _write_xodr(world: World, folder: Path, *, rooms: bool) -> dict[str, int]:
    """OpenDRIVE, with SUMO's network beside it: the world's own road files."""
    del rooms  # roads lie outdoors
    for name in ("roads.xodr", "roads.net.xml"):
        write_bytes(folder / name, world.file(name).read_bytes())
    return {"roads": len([road for road in world.roads.roads if road.lanes > 0]), "lanes": len(world.lanes)}


#: Writers by format. Each takes the world, an empty folder and ``rooms`` and returns what it wrote, counted.
FORMATS: dict[str, Writer] = {
    "gltf": write_gltf,
    "usd": write_usd,
    "mjcf": write_mjcf,
    "geojson": write_geojson,
    "xodr": _write_xodr,
}


def export_world(world: World, to: str, out: Path, *, rooms: bool = False, force: bool = False) -> dict[str, int]:
    """Write a world in another format.

    Parameters
    ----------
    world
        As read from its folder.
    to
        One of `FORMATS`.
    out
        Folder to make; whole or not at all.
    rooms
        With what lies indoors (rooms below the ground, furniture).
    force
        Replace what is at `out`.

    Returns
    -------
    dict
        What was written, counted.

    Raises
    ------
    InputError
        If there is no such format.
    OutputExistsError
        If `out` holds something and `force` is false.
    MissingExtraError
        If the format needs a library that is not installed.
    """
    with _export_folder(to, out, force=force) as folder:
        counts = FORMATS[to](world, folder, rooms=rooms)
        _write_credits(world, folder)
    return counts


#: Formats of a city as a whole; in the others each tile is a folder of its own.
_WHOLE = ("geojson", "xodr")


def export_city(city: City, to: str, out: Path, *, rooms: bool = False, force: bool = False) -> dict[str, int]:
    """Write a city in another format: streets and places as one, meshes tile by tile.

    Parameters
    ----------
    city
        As read from its folder.
    to, out, rooms, force
        As of `export_world`. Where tiles are folders of their own, ``tiles.json`` says how many metres east and north
        of the city's origin each one's is.

    Returns
    -------
    dict
        What was written, counted over all tiles.

    Raises
    ------
    InputError, OutputExistsError, MissingExtraError
        As `export_world`.
    """
    with _export_folder(to, out, force=force) as folder:
        whole = CityWorld(city)
        _write_credits(whole, folder)
        if to in _WHOLE:
            return FORMATS[to](whole, folder, rooms=rooms)
        counts: Counter[str] = Counter()
        places: dict[str, dict[str, float]] = {}
        for tile in city.manifest.tiles:
            (folder / tile.name).mkdir()
            counts.update(FORMATS[to](city.world((tile.column, tile.row)), folder / tile.name, rooms=rooms))
            size = city.manifest.size
            places[tile.name] = {"east": tile.column * size, "north": tile.row * size}
        write_json(folder / "tiles.json", places)
        return dict(counts)


@contextmanager
def _export_folder(to: str, out: Path, *, force: bool) -> Iterator[Path]:
    if to not in FORMATS:
        raise InputError(f"export: no format {to!r}; there are {', '.join(FORMATS)}")
    with new_folder(Path(out), force=force, kind=EXPORT_FOLDER) as folder:
        yield folder
        files = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
        write_json(folder / EXPORT_MANIFEST, {"format": to, "producer": f"vico {__version__}", "files": files})


def _write_credits(world: World, folder: Path) -> None:
    lines = [f"{source.attribution} ({source.licence})" for source in world.manifest.sources]
    write_bytes(folder / "CREDITS.txt", ("\n".join(lines) + "\n").encode())
