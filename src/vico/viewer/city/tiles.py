"""A city cut into tiles: nearby all its triangles, from farther away walls, roofs and a picture of the ground."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from shapely import contains_xy
from shapely.geometry import Polygon

from vico.viewer.city.pack import Blob, PackedMesh, packed
from vico.viewer.city.textures import PLAIN, TextureLayers
from vico.world.mesh import Surface
from vico.world.world import World

#: Side of a tile, metres.
TILE = 100.0
#: Pixels along the side of the picture of the ground; metres between the ground's points far away.
PICTURE, _GROUND_STEP = 2048, 12.5
# Roof triangles smaller than this (square metres) are not seen from another tile.
_SEEN_FROM_FAR = 3.0
# Walls of convex parts with more of their own building this far before them are within it, metres.
_BEFORE = 0.3
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
    for mesh in packed([s for layer in ("ground",) for s in world.surfaces(layer)], textures):
        _split(mesh, grid.tile_of(mesh.position[mesh.triangles].mean(axis=1)), found)
    tile_of_building = {b.entity: int(grid.tile_of(_middle(b.footprint)[None])[0]) for b in world.buildings}
    for mesh in packed([s for layer in ("buildings", "roofs") for s in world.surfaces(layer)], textures):
        first = mesh.triangles[:, 0]
        own = grid.tile_of(mesh.position[first])
        tiles = [tile_of_building.get(e, int(t)) for e, t in zip(mesh.entity[first].tolist(), own, strict=True)]
        _split(mesh, np.array(tiles, np.int64), found)
    return found


def _middle(footprint: Sequence[Any]) -> NDArray[np.float64]:
    outline = np.asarray(footprint[0], np.float64)
    return np.asarray((outline.min(axis=0) + outline.max(axis=0)) / 2)


def _split(mesh: PackedMesh, tiles: NDArray[np.int64], found: dict[int, list[PackedMesh]]) -> None:
    for tile in np.unique(tiles).tolist():
        found.setdefault(tile, []).append(mesh.chosen(tiles == tile))


def far_tiles(world: World, grid: Grid, textures: TextureLayers) -> dict[int, PackedMesh]:
    """Return what is seen of tiles from farther away: buildings in plain colours."""
    walls = _mean_colours(world.surfaces("buildings"), textures)
    roofs = world.surfaces("roofs")
    outlines = {b.entity: Polygon(b.footprint[0], b.footprint[1:]).buffer(0) for b in world.buildings}
    parts = [_plain(s, walls, outlines) for s in world.surfaces(_COLLISION)]
    parts += [_large(s, textures) for s in roofs]
    whole = packed(parts, textures)
    if not whole:
        return {}
    mesh = whole[0]
    first = mesh.triangles[:, 0]
    tile_of_building = {b.entity: int(grid.tile_of(_middle(b.footprint)[None])[0]) for b in world.buildings}
    own = grid.tile_of(mesh.position[first])
    tiles = np.array(
        [tile_of_building.get(e, int(t)) for e, t in zip(mesh.entity[first].tolist(), own, strict=True)], np.int64
    )
    return {tile: mesh.chosen(tiles == tile) for tile in np.unique(tiles).tolist()}


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


def _plain(surface: Surface, colours: dict[int, NDArray[np.float64]], outlines: Mapping[int, Any]) -> Surface:
    """Return what is seen of a convex part of a building from outside, in the colour of its walls."""
    corners = surface.positions[surface.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.maximum(np.linalg.norm(normal, axis=1), 1e-9)
    up = normal[:, 2]
    entity = int(surface.entity[0]) if len(surface.entity) else 0
    colour = np.clip(colours.get(entity, np.array([170.0, 165.0, 158.0])), 0, 255).astype(np.uint8)
    seen = up > -0.5 * size
    if entity in outlines:
        before = corners.mean(axis=1) + normal / size[:, None] * _BEFORE
        upright = np.abs(up) < 0.1 * size
        seen &= ~(upright & contains_xy(outlines[entity], before[:, 0], before[:, 1]))
    kept = surface.triangles[seen]
    return Surface.from_triangles(surface.positions, kept, colour=tuple(colour.tolist()), entity=entity)


def _large(surface: Surface, textures: TextureLayers) -> Surface:
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


__all__ = ["PLAIN", "TILE", "Grid", "far_tiles", "ground_grid", "ground_picture", "near_tiles"]
