"""A world on disk: the folder and its files.

::

    world.json            manifest, written last: a folder that has it is whole
    build.json            seconds per stage and the machine; not hashed, differs every time
    report.html           what was built, for a person: map, views, counts, what was left out; not hashed
    .stages/              what the stages made, to run one again; no part of the world, may be deleted
    terrain.npz           height field
    buildings.json places.json entrances.json rooms.json roads.json transit.json
    objects.parquet       things that stand around, one row each; parked cars among them
    parking.json          parking spots, those with a car and free ones; older worlds have none
    roads.net.xml roads.xodr
    walkable.npz
    meshes/{ground,buildings,roofs,rooms,collision,prototypes}.glb
    map.png previews/*.png
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection
from pathlib import Path

from pydantic import ValidationError

from vico.errors import MissingFileError, SchemaError
from vico.io.files import read_json, sha256_of, write_bytes, write_json
from vico.io.folders import FolderKind, listed_in, mistaken
from vico.version import __version__
from vico.world import model
from vico.world.model import Manifest
from vico.world.records import invalid, manifest_bytes
from vico.world.world import World

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
        raise MissingFileError(mistaken(folder, "world", "vico world build"))
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
    "world", "world.json", lambda folder: {*listed_in("world.json")(folder), *UNHASHED, f"{STAGES}/**"}
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
