"""Writes what a browser draws of a world, once, into the user's cache."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from vico.assets.models.library import placards, umbrellas
from vico.io.cache import cache_folder
from vico.io.files import new_folder, write_bytes, write_json
from vico.render.world_scene import LAMP_KINDS, with_lit_heads
from vico.version import __version__
from vico.viewer.city.doors import door_entries
from vico.viewer.city.models import moving_models, write_instances, write_models
from vico.viewer.city.pack import Blob, PackedMesh, array_entries
from vico.viewer.city.robots import write_robots
from vico.viewer.city.rooms import write_rooms
from vico.viewer.city.textures import TextureLayers
from vico.viewer.city.tiles import TILE, Grid, far_tiles, ground_grid, ground_picture, near_tiles
from vico.world.world import World

#: Of the files' layout; another number, and they are written anew.
CITY_FORMAT = 6
MANIFEST = "manifest.json"


def city_folder(world: World, *, making: Callable[[], None] = lambda: None) -> Path:
    """Return the folder of what a browser draws of a world; where it is not there, call `making` and write it."""
    folder = cache_folder() / "viewer" / "cities" / f"{world.digest[:24]}-{CITY_FORMAT}-{__version__}"
    if not (folder / MANIFEST).exists():
        making()
        folder.parent.mkdir(parents=True, exist_ok=True)
        with new_folder(folder, force=True) as members:
            write_city(world, members)
    return folder


def write_city(world: World, folder: Path) -> None:
    """Write the files of a world for the browser; ``manifest.json`` last."""
    textures, grid = TextureLayers(), Grid.over(world.half)
    near, far = near_tiles(world, grid, textures), far_tiles(world, grid, textures)
    outlook = Blob()
    ground = ground_grid(world, grid, outlook)
    outdoors = world.objects.room == ""
    instances = write_instances(world, outdoors, outlook)
    tiles = [
        _tile(folder, tile, grid, near.get(tile, []), far.get(tile), outlook)
        for tile in range(grid.count * grid.count)
        if tile in near or tile in far
    ]
    shapes = Blob()
    standing = world.prototypes()
    used = {entry["prototype"] for entry in instances}
    lamps = lamps_of(world)
    models = {
        name: with_lit_heads(standing[name]) if name in lamps else standing[name] for name in used
    } | moving_models()
    doors, leaves = door_entries(world)
    models |= leaves
    written = write_models(models, textures, shapes)
    robots = write_robots(textures, shapes)
    write_json(folder / "rooms.json", write_rooms(world, textures, folder))
    write_bytes(folder / "outlook.bin", outlook.bytes())
    write_bytes(folder / "models.bin", shapes.bytes())
    write_bytes(folder / "ground.jpg", _jpeg(ground_picture(world, textures)))
    write_json(
        folder / MANIFEST,
        {
            "schema": "vico.city",
            "version": CITY_FORMAT,
            "name": world.manifest.name,
            "half": world.half,
            "tile": TILE,
            "count": grid.count,
            "attribution": [source.attribution for source in world.manifest.sources if source.attribution],
            "arrays": array_entries(),
            "textures": _write_textures(folder, textures),
            "ground": ground,
            "tiles": tiles,
            "instances": instances,
            "lamps": sorted(lamps),
            "models": written,
            "doors": doors,
            "umbrellas": umbrellas(),
            "placards": placards(),
            "robots": robots,
            "buildings": [
                {"entity": b.entity, "name": b.name, "use": b.use, "ring": np.round(b.footprint[0], 1).tolist()}
                for b in world.buildings
            ],
        },
    )


def lamps_of(world: World) -> set[str]:
    """Return the prototypes that shine at night."""
    is_lamp = np.isin(world.objects.kind, LAMP_KINDS) & (world.objects.room == "")
    return set(world.objects.prototype[is_lamp].tolist())


def _tile(
    folder: Path, tile: int, grid: Grid, near: list[PackedMesh], far: PackedMesh | None, outlook: Blob
) -> dict[str, Any]:
    x, y = grid.corner(tile)
    entry: dict[str, Any] = {"index": tile, "x": x, "y": y, "file": f"tile_{tile}.bin"}
    blob = Blob()
    entry["near"] = [blob.mesh(mesh) for mesh in near]
    entry["far"] = outlook.mesh(far) if far is not None else None
    write_bytes(folder / entry["file"], blob.bytes())
    return entry


def _write_textures(folder: Path, textures: TextureLayers) -> list[dict[str, Any]]:
    blob, entries = Blob(), []
    for entry, content in textures.files():
        entries.append(entry | {"offset": blob.add(content), "size": len(content)})
    write_bytes(folder / "textures.bin", blob.bytes())
    return entries


def _jpeg(image: Image.Image) -> bytes:
    out = io.BytesIO()
    image.save(out, "JPEG", quality=88)
    return out.getvalue()
