"""Writes what a browser draws of a world, once, into the user's cache: tiles, doors, models, robots, rooms, textures.

A city is cut into tiles: nearby all its triangles, from farther away walls, roofs and a picture of the ground. Doors
of houses that can be drawn open have their place, their leaves and the halls behind them.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from shapely import contains_xy
from shapely.geometry import Polygon

from vico.assets.house_doors import (
    DOOR_MATERIAL,
    hall_name,
    hall_surface,
    house_doors,
    is_gate,
    leaf_names,
    leaf_surfaces,
)
from vico.assets.models.library import placards, umbrellas
from vico.io.cache import cache_folder
from vico.io.files import new_folder, write_bytes, write_json
from vico.render.world_scene import LAMP_KINDS, with_lit_heads
from vico.sim.pictures.buildings import hall_size
from vico.version import __version__
from vico.viewer.city.models import (
    PLAIN,
    SHAPES,
    Blob,
    PackedMesh,
    TextureLayers,
    model_entry,
    moving_models,
    pack_surfaces,
    write_instances,
    write_robots,
    write_rooms,
)
from vico.world.mesh import Surface
from vico.world.world import World

__all__ = [
    "CITY_FORMAT",
    "MANIFEST",
    "PLAIN",
    "TILE",
    "Grid",
    "city_folder",
    "door_entries",
    "far_tiles",
    "ground_grid",
    "ground_picture",
    "near_tiles",
    "write_city",
]
#: Side of a tile, metres.
TILE = 100.0
#: Pixels along the side of the picture of the ground; metres between the ground's points far away.
PICTURE, _GROUND_STEP = 2048, 12.5
# Roof triangles smaller than this (square metres) are not seen from another tile.
_SEEN_FROM_FAR = 3.0
# Walls of convex parts with more of their own building this far before them are within it, metres.
_WITHIN_BUILDING = 0.3
_COLLISION = "collision"


@dataclass(frozen=True)
class Grid:
    """Tiles over a square of half side `half`: `count` each way."""

    half: float
    count: int

    @classmethod
    def over(cls, half: float) -> Grid:
        """Return the grid that covers a world."""
        return cls(half, max(1, int(np.ceil(2 * half / TILE))))

    def tile_of(self, xy: NDArray[Any]) -> NDArray[np.int64]:
        """Return the tile of points, ``iy * count + ix``; those beyond the edge belong to the nearest."""
        cell = np.clip(np.floor((xy[:, :2] + self.half) / TILE).astype(np.int64), 0, self.count - 1)
        return np.asarray(cell[:, 1] * self.count + cell[:, 0])

    def corner(self, tile: int) -> tuple[float, float]:
        """Return the south-western corner of a tile."""
        return (tile % self.count) * TILE - self.half, (tile // self.count) * TILE - self.half


def near_tiles(world: World, grid: Grid, textures: TextureLayers) -> dict[int, list[PackedMesh]]:
    """Return the whole geometry by tile: ground where it lies, buildings in the tile of their middle."""
    found: dict[int, list[PackedMesh]] = {}
    for mesh in pack_surfaces([s for layer in ("ground",) for s in world.surfaces(layer)], textures):
        _split_mesh(mesh, grid.tile_of(mesh.position[mesh.triangles].mean(axis=1)), found)
    tile_of_building = {b.entity: int(grid.tile_of(_middle(b.footprint)[None])[0]) for b in world.buildings}
    for mesh in pack_surfaces([s for layer in ("buildings", "roofs") for s in world.surfaces(layer)], textures):
        first = mesh.triangles[:, 0]
        own = grid.tile_of(mesh.position[first])
        tiles = [tile_of_building.get(e, int(t)) for e, t in zip(mesh.entity[first].tolist(), own, strict=True)]
        _split_mesh(mesh, np.array(tiles, np.int64), found)
    return found


def _middle(footprint: Sequence[Any]) -> NDArray[np.float64]:
    outline = np.asarray(footprint[0], np.float64)
    return np.asarray((outline.min(axis=0) + outline.max(axis=0)) / 2)


def _split_mesh(mesh: PackedMesh, tiles: NDArray[np.int64], found: dict[int, list[PackedMesh]]) -> None:
    for tile in np.unique(tiles).tolist():
        found.setdefault(tile, []).append(mesh.select(tiles == tile))


def far_tiles(world: World, grid: Grid, textures: TextureLayers) -> dict[int, PackedMesh]:
    """Return what is seen of tiles from farther away: buildings in plain colours."""
    walls = _mean_colours(world.surfaces("buildings"), textures)
    roofs = world.surfaces("roofs")
    outlines = {b.entity: Polygon(b.footprint[0], b.footprint[1:]).buffer(0) for b in world.buildings}
    parts = [_plain_walls(s, walls, outlines) for s in world.surfaces(_COLLISION)]
    parts += [_large_roofs(s, textures) for s in roofs]
    whole = pack_surfaces(parts, textures)
    if not whole:
        return {}
    mesh = whole[0]
    first = mesh.triangles[:, 0]
    tile_of_building = {b.entity: int(grid.tile_of(_middle(b.footprint)[None])[0]) for b in world.buildings}
    own = grid.tile_of(mesh.position[first])
    tiles = np.array(
        [tile_of_building.get(e, int(t)) for e, t in zip(mesh.entity[first].tolist(), own, strict=True)], np.int64
    )
    return {tile: mesh.select(tiles == tile) for tile in np.unique(tiles).tolist()}


def _mean_colours(surfaces: list[Surface], textures: TextureLayers) -> dict[int, NDArray[np.float64]]:
    """Return the mean colour of each building's walls, weighted by area."""
    sums: dict[int, NDArray[np.float64]] = {}
    for surface in surfaces:
        mean = textures.layer_of(surface.material).colour
        corners = surface.positions[surface.triangles].astype(np.float64)
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        tint = surface.colour[surface.triangles[:, 0], :3] * (mean / 255.0)
        weighted = np.column_stack([tint * area[:, None], area])
        owner = surface.entity[surface.triangles[:, 0]]
        for entity in np.unique(owner).tolist():
            sums[entity] = sums.get(entity, np.zeros(4)) + weighted[owner == entity].sum(axis=0)
    return {entity: total[:3] / max(total[3], 1e-9) for entity, total in sums.items()}


def _plain_walls(surface: Surface, colours: dict[int, NDArray[np.float64]], outlines: Mapping[int, Any]) -> Surface:
    """Return what is seen of a convex part of a building from outside, in the colour of its walls."""
    corners = surface.positions[surface.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.maximum(np.linalg.norm(normal, axis=1), 1e-9)
    up = normal[:, 2]
    entity = int(surface.entity[0]) if len(surface.entity) else 0
    colour = np.clip(colours.get(entity, np.array([170.0, 165.0, 158.0])), 0, 255).astype(np.uint8)
    seen = up > -0.5 * size
    if entity in outlines:
        before = corners.mean(axis=1) + normal / size[:, None] * _WITHIN_BUILDING
        upright = np.abs(up) < 0.1 * size
        seen &= ~(upright & contains_xy(outlines[entity], before[:, 0], before[:, 1]))
    kept = surface.triangles[seen]
    return Surface.from_triangles(surface.positions, kept, colour=tuple(colour.tolist()), entity=entity)


def _large_roofs(surface: Surface, textures: TextureLayers) -> Surface:
    """Return the large triangles of roofs, in plain colours."""
    corners = surface.positions[surface.triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    mean = textures.layer_of(surface.material).colour / 255.0
    used, faces = np.unique(surface.triangles[area > _SEEN_FROM_FAR], return_inverse=True)
    return Surface(
        surface.positions[used],
        surface.normals[used],
        np.zeros((len(used), 2), np.float32),
        (surface.colour[used, :3] * mean).astype(np.uint8),
        surface.entity[used],
        faces.reshape(-1, 3).astype(np.int32),
    )


def ground_picture(world: World, textures: TextureLayers) -> Image.Image:
    """Paint the ground from above, north up, in the mean colours of what it is made of.

    What lies higher over the terrain covers the rest: below streets and squares lies a bed that is everywhere.
    """
    image = Image.new("RGB", (PICTURE, PICTURE), (122, 122, 118))
    draw = ImageDraw.Draw(image)
    scale = PICTURE / (2 * world.half)
    outlines, colours, heights = [], [], []
    for surface in world.surfaces("ground"):
        tint = textures.layer_of(surface.material).colour / 255.0
        corners = surface.positions[surface.triangles].astype(np.float64)
        outlines.append(((corners[:, :, :2] * [1, -1] + world.half) * scale).reshape(-1, 6))
        colours.append((surface.colour[surface.triangles[:, 0], :3] * tint).astype(np.uint8))
        middle = corners.mean(axis=1)
        heights.append(middle[:, 2] - world.height(np.clip(middle[:, :2], -world.half, world.half)))
    if outlines:
        # To the centimetre: among equals the order of the surfaces decides, as everywhere.
        order = np.argsort(np.round(np.concatenate(heights), 2), kind="stable")
        outline, colour = np.concatenate(outlines)[order], np.concatenate(colours)[order]
        for corners_of, colour_of in zip(outline.tolist(), colour.tolist(), strict=True):
            draw.polygon(corners_of, fill=tuple(colour_of))
    return image


def ground_grid(world: World, grid: Grid, blob: Blob) -> dict[str, Any]:
    """Write the coarse ground of each tile: heights on a regular grid; return its entry."""
    points = round(TILE / _GROUND_STEP) + 1
    heights = np.empty((grid.count * grid.count, points, points), np.float32)
    step = np.arange(points) * _GROUND_STEP
    for tile in range(len(heights)):
        x, y = grid.corner(tile)
        at = np.stack(np.meshgrid(x + step, y + step), axis=-1).reshape(-1, 2)
        inside = np.clip(at, -world.half, world.half)
        heights[tile] = world.height(inside).reshape(points, points)
    return {"offset": blob.add(heights), "points": points, "step": _GROUND_STEP}


def door_entries(world: World) -> tuple[list[dict[str, Any]], dict[str, Sequence[Surface]]]:
    """Return the doors that can be drawn open, and the shapes of their leaves and halls by name.

    An entry tells the row of the entrance in ``world.entrances``, the middle of the sill (`at`) and the way in
    (`inward`), half the width and the height, the leaves from left to right as seen from outside, the hall, and
    whether it is a gate, which goes up and does not swing.
    """
    doors = house_doors(world.geometry("buildings", DOOR_MATERIAL), world.entrances)
    material = next((s.material for s in world.surfaces("buildings") if s.material.name == DOOR_MATERIAL), None)
    footprints = {building.id: building.footprint for building in world.buildings}
    entries: list[dict[str, Any]] = []
    shapes: dict[str, Sequence[Surface]] = {}
    for number in np.flatnonzero(doors["kind"] >= 0).tolist() if material is not None else []:
        door = doors[number]
        names = leaf_names(door)
        size = hall_size(door, footprints[world.entrances[number].building])
        hall = hall_name(door, size, lit=True)
        if names[0] not in shapes:
            assert material is not None
            shapes |= dict(zip(names, leaf_surfaces(door, material), strict=True))
        shapes.setdefault(hall, [hall_surface(door, size, lit=True)])
        entries.append(
            {
                "entrance": number,
                "at": [round(float(door[axis]), 3) for axis in ("x", "y", "z")],
                "inward": [round(float(door[axis]), 5) for axis in ("inward_x", "inward_y")],
                "half_width": round(float(door["half_width"]), 3),
                "height": round(float(door["height"]), 3),
                "leaves": names,
                "hall": hall,
                "gate": is_gate(door),
            }
        )
    return entries, shapes


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
    # What shines at night.
    is_lamp = np.isin(world.objects.kind, LAMP_KINDS) & (world.objects.room == "")
    lamps = set(world.objects.prototype[is_lamp].tolist())
    models = {
        name: with_lit_heads(standing[name]) if name in lamps else standing[name] for name in used
    } | moving_models()
    doors, leaves = door_entries(world)
    models |= leaves
    written = {name: model_entry(list(models[name]), textures, shapes) for name in sorted(models)}
    robots = write_robots(textures, shapes)
    write_json(folder / "rooms.json", write_rooms(world, textures, folder))
    write_bytes(folder / "outlook.bin", outlook.bytes())
    write_bytes(folder / "models.bin", shapes.bytes())
    jpeg = io.BytesIO()
    ground_picture(world, textures).save(jpeg, "JPEG", quality=88)
    write_bytes(folder / "ground.jpg", jpeg.getvalue())
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
            "arrays": [{"height": height, "width": width} for height, width in SHAPES],
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
