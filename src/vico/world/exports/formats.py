"""Which formats there are, and the one call that writes any of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from vico.errors import InputError
from vico.io.files import write_bytes, write_json
from vico.io.folders import FolderKind, listed_in, new_folder
from vico.version import __version__
from vico.world.city import City
from vico.world.city_world import CityWorld
from vico.world.exports.geojson import write_geojson
from vico.world.exports.gltf import write_gltf
from vico.world.exports.mjcf import write_mjcf
from vico.world.exports.usd import write_usd
from vico.world.world import World

Writer = Callable[..., dict[str, int]]

#: Lists what an export wrote.
EXPORT_MANIFEST = "export.json"
EXPORT_FOLDER = FolderKind("export", EXPORT_MANIFEST, listed_in(EXPORT_MANIFEST))


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
