"""Tiles of a city from afar: ground, houses and trees, of a few triangles each.

A city has more triangles and pictures of facades than fit into memory, and from a few hundred metres nobody sees them.
So a house becomes the walls of its simplified outline and a plain roof, the ground a coarse grid, a tree two pyramids.
Every colour is the mean of what the tile's own meshes show there, in linear light: the windows darken a wall as they
do near by, and a city does not change its colours where near tiles end and far ones begin. Silhouettes are made once a
tile, and kept in the cache folder.

Beyond the city's edge nothing is known. There its outermost tiles are seen once more, mirrored at the edge: streets go
on straight, ground and water meet theirs, houses are like those near by. It is of the entity `ENTITY_BACKDROP`, for
nothing of it is a record of the city.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError, OutputError
from vico.io.cache import cache_folder
from vico.io.files import new_file
from vico.world.city import City, CityTile, TileShift
from vico.world.far_colours import LINEAR, WINDOWS, coloured_triangles, spread_points, srgb, sums_by
from vico.world.far_houses import far_houses
from vico.world.mesh import Material, Surface, merge_surfaces, quad_triangles, surface_of_quads
from vico.world.model import ENTITY_BACKDROP, ENTITY_GREEN, ENTITY_GROUND, ENTITY_ROAD, ENTITY_WATER
from vico.world.world import World

#: Name of the material that silhouettes are of, but for walls with windows.
FAR = "far"

_MATERIAL = Material(FAR)
_GRID = 12.5  # metres; cells of the ground
_SKIRT = 1.0  # metres that the ground's edge hangs down, for the finer ground of a neighbour may lie lower
_FINE = 8  # parts of a cell's side in which the topmost ground is looked for
_LAYER = 0.1  # metres that it is thick
_GROUNDS = np.array([ENTITY_GROUND, ENTITY_ROAD, ENTITY_WATER, ENTITY_GREEN])
# Leaves face all ways, and some of them the sun: a crown is lighter than the side of a pyramid. Measured in pictures.
_CROWN_LIGHT = 1.2
_FULLER = 1.2  # times as wide as a crown, for two pyramids are slimmer than it
_TWO_PYRAMIDS = np.array(
    [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 1, 4), (1, 2, 5), (2, 3, 5), (3, 4, 5), (4, 1, 5)], np.int32
)


def silhouette_of(world: World) -> list[Surface]:
    """Make what a tile looks like from afar.

    Parameters
    ----------
    world
        The tile, or any world in one piece.

    Returns
    -------
    list of Surface
        In the tile's own frame, of the material `FAR`, which has no texture, and where walls have windows of
        `vico.world.far_colours.WINDOWS`, one small picture for all. Vertices have the entities that the
        tile's own meshes have: of buildings, of trees, of kinds of ground.

    Raises
    ------
    InputError
        If the world has no size.
    """
    if not world.half > 0.0:
        raise InputError(f"world {world.manifest.name!r} has a half side of {world.half} m; a silhouette needs some")
    parts = [*_ground(world), *far_houses(world, _MATERIAL), *_trees(world)]
    return merge_surfaces(parts)


def _ground(world: World) -> Iterator[Surface]:
    """Make the terrain: quads that meet a neighbour's at the same heights."""
    half = world.half
    n = max(round(2.0 * half / _GRID), 1)
    line = np.linspace(-half, half, n + 1)
    x, y = np.meshgrid(line, line)
    z = world.height(np.stack([x, y], axis=-1))
    colour, entity = _ground_looks(world, n)
    grid = np.stack([x, y, z], axis=-1)
    corners = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4, 3)
    rise_y, rise_x = np.gradient(z, line, line)
    slopes = np.stack([-rise_x, -rise_y, np.ones_like(z)], axis=-1)
    slopes /= np.linalg.norm(slopes, axis=-1, keepdims=True)
    normals = np.stack([slopes[:-1, :-1], slopes[:-1, 1:], slopes[1:, 1:], slopes[1:, :-1]], axis=2)
    yield Surface(
        corners.reshape(-1, 3).astype(np.float32),
        normals.reshape(-1, 3).astype(np.float32),
        np.zeros((4 * n * n, 2), np.float32),
        np.repeat(srgb(colour), 4, axis=0),
        np.repeat(entity, 4).astype(np.int32),
        quad_triangles(4 * np.arange(n * n, dtype=np.int32)),
        _MATERIAL,
    )
    cell = np.arange(n * n).reshape(n, n)
    for edge, cells, out in (
        (grid[0], cell[0], (0.0, -1.0, 0.0)),
        (grid[:, -1], cell[:, -1], (1.0, 0.0, 0.0)),
        (grid[-1, ::-1], cell[-1, ::-1], (0.0, 1.0, 0.0)),
        (grid[::-1, 0], cell[::-1, 0], (-1.0, 0.0, 0.0)),
    ):
        low = edge - (0.0, 0.0, _SKIRT)
        yield surface_of_quads(
            np.stack([low[:-1], low[1:], edge[1:], edge[:-1]], axis=1),
            np.broadcast_to(np.array(out), (n, 3)),
            np.zeros((n, 4, 2)),
            colour=srgb(colour[cells]),
            entity=entity[cells],
            material=_MATERIAL,
        )


def _ground_looks(world: World, n: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return colours in linear light and entities of the cells of a grid, row by row from the south-west."""
    looks = coloured_triangles(world.surfaces("ground"))
    looks = looks.where(np.isin(looks.entity, _GROUNDS) & (looks.normals[:, 2] > 0.0))
    # Seen from above: a quay's wall colours nothing, and neither does what lies below something else.
    triangle, place, weight = spread_points(looks.corners, looks.normals[:, 2], 1.0)
    fine = n * _FINE
    spot = np.floor((place[:, :2] + world.half) * fine / (2.0 * world.half)).astype(np.int64)
    inside = ((spot >= 0) & (spot < fine)).all(axis=1)
    spot, triangle, weight = spot[inside], triangle[inside], weight[inside]
    above = place[inside, 2] - world.height(place[inside])
    highest = np.full(fine * fine, -np.inf)
    key = spot[:, 1] * fine + spot[:, 0]
    np.maximum.at(highest, key, above)
    shown = above > highest[key] - _LAYER
    cell = (spot[:, 1] // _FINE * n + spot[:, 0] // _FINE)[shown]
    triangle, weight = triangle[shown], weight[shown]
    sums = sums_by(cell, weight, looks.colour[triangle], n * n).reshape(n, n, 4)
    kind = np.searchsorted(np.sort(_GROUNDS), looks.entity[triangle])
    kinds = np.bincount(4 * cell + kind, weight, minlength=4 * n * n).reshape(n, n, 4)
    both = np.concatenate([sums, kinds], axis=2)
    if not both[..., 3].any():
        return np.broadcast_to(LINEAR[[150, 148, 142]], (n * n, 3)).copy(), np.full(n * n, ENTITY_GROUND)
    while (empty := both[..., 3] <= 0.0).any():  # under houses, mostly: what is around them
        wide = np.pad(both, ((1, 1), (1, 1), (0, 0)))
        around = sum(wide[j : j + n, i : i + n] for j in range(3) for i in range(3))
        both[empty] = np.asarray(around)[empty]
    both = both.reshape(n * n, 8)
    return both[:, :3] / both[:, 3:4], np.sort(_GROUNDS)[both[:, 4:].argmax(axis=1)]


def _trees(world: World) -> Iterator[Surface]:
    """Make the trees: two pyramids each, base to base, shaded as if they were round."""
    objects = world.objects
    chosen = np.flatnonzero((objects.kind == "tree") & objects.outdoors)
    models = world.prototypes() if len(chosen) else {}
    names = objects.prototype[chosen]
    for name in np.unique(names).tolist():
        if not models.get(name):
            continue
        trees = objects.where(chosen[names == name])
        points, normals, colour = _crown(models[name])
        moves = trees.transforms().astype(np.float64)
        places = _transform_points(points, moves) + moves[:, None, :3, 3]
        count = len(trees)
        first = len(points) * np.arange(count, dtype=np.int32)
        yield Surface(
            places.reshape(-1, 3).astype(np.float32),
            (_transform_points(normals, moves) / trees.scale[:, None, None]).reshape(-1, 3).astype(np.float32),
            np.zeros((count * len(points), 2), np.float32),
            np.broadcast_to(srgb(colour), (count * len(points), 3)).copy(),
            np.repeat(trees.entity, len(points)),
            (first[:, None, None] + _TWO_PYRAMIDS).reshape(-1, 3),
            _MATERIAL,
        )


def _crown(surfaces: Sequence[Surface]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return corners and normals of a tree from afar, foot first and tip last, and its colour in linear light."""
    leaves = [s for s in surfaces if s.material.cutout] or surfaces
    looks = coloured_triangles(leaves)
    weight = np.linalg.norm(looks.normals, axis=1) * looks.cover
    colour = _CROWN_LIGHT * (weight[:, None] * looks.colour).sum(axis=0) / max(float(weight.sum()), 1e-9)
    points = np.concatenate([s.positions for s in leaves]).astype(np.float64)
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    middle = points[:, :2].mean(axis=0)
    radius = _FULLER * float(np.quantile(np.linalg.norm(points[:, :2] - middle, axis=1), 0.9))
    around = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
    widest = low + 0.5 * (high - low)
    ring = np.c_[radius * around + middle, np.full(4, widest)]
    down, up = np.array([(0.0, 0.0, -1.0)]), np.array([(0.0, 0.0, 1.0)])
    normals = np.concatenate([down, np.c_[around, np.full(4, 0.3)] / np.hypot(1.0, 0.3), up])
    return np.concatenate([[np.r_[middle, 0.0]], ring, [np.r_[middle, high]]]), normals, colour


def _transform_points(points: NDArray[np.float64], moves: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points ``(p, 3)`` turned and scaled by matrices ``(n, 4, 4)``, shape ``(n, p, 3)``."""
    return sum(moves[:, None, :3, k] * points[None, :, k, None] for k in range(3))  # type: ignore[return-value]


_log = logging.getLogger(__name__)

# Of the files: another number has all made anew.
_VERSION = 3
_ARRAYS = ("positions", "normals", "uv", "colour", "entity", "triangles")
# Tiles beyond the edge that are drawn.
_BEYOND = 2
_REACH_IN = 0.5  # metres that a leaf of a tree there may reach into the city
_MATERIALS = {material.name: material for material in (Material(FAR), WINDOWS)}


class CitySilhouettes:
    """The silhouettes of a city's tiles, in its frame.

    Parameters
    ----------
    city
        The city.
    """

    def __init__(self, city: City) -> None:
        self._city = city
        self._known: dict[tuple[int, int], list[Surface]] = {}
        self._pictures: list[NDArray[np.uint8]] = []

    def beyond(self, tiles: Collection[tuple[int, int]], reach: int) -> list[Surface]:
        """Return the silhouettes of all tiles but some, so many columns or rows beyond these at most.

        And what is seen beyond the city's edge.
        """
        columns, rows = zip(*tiles, strict=True)

        def is_seen(column: int, row: int) -> bool:
            off = max(min(columns) - column, column - max(columns), min(rows) - row, row - max(rows))
            return off <= reach

        found: list[Surface] = []
        for tile in self._city.manifest.tiles:
            if (tile.column, tile.row) not in tiles and is_seen(tile.column, tile.row):
                found += self._of(tile)
        for place in self._around:
            if is_seen(*place):
                found += self._beyond_edge(place)
        self._pictures.clear()
        return found

    @cached_property
    def _around(self) -> dict[tuple[int, int], tuple[CityTile, tuple[float, float]]]:
        """Places beyond the edge, the tile that is seen there, and which of its axes are turned round, -1 each or 1."""
        tiles = {(tile.column, tile.row): tile for tile in self._city.manifest.tiles}
        columns, rows = ((min(numbers), max(numbers)) for numbers in zip(*tiles, strict=True))
        places = itertools.product(
            range(columns[0] - _BEYOND, columns[1] + _BEYOND + 1), range(rows[0] - _BEYOND, rows[1] + _BEYOND + 1)
        )
        found: dict[tuple[int, int], tuple[CityTile, tuple[float, float]]] = {}
        for column, row in places:
            (east, turned_east), (north, turned_north) = _mirror_tile(column, *columns), _mirror_tile(row, *rows)
            # A tile that is missing within the city stays bare.
            if (east, north) != (column, row) and (east, north) in tiles:
                found[column, row] = tiles[east, north], (turned_east, turned_north)
        return found

    def _beyond_edge(self, place: tuple[int, int]) -> list[Surface]:
        """Return the silhouette of a tile as it is seen mirrored at a place beyond the edge."""
        if place not in self._known:
            tile, turned = self._around[place]
            at, source = np.array(place), np.array([tile.column, tile.row])
            moved = (at - np.array(turned) * source) * self._city.manifest.size
            found = [
                _mirror_surface(surface, np.array([*turned, 1.0]), np.array([*moved, 0.0]))
                for surface in self._of(tile)
            ]
            self._known[place] = [
                replace(surface, entity=np.full_like(surface.entity, ENTITY_BACKDROP))
                for surface in self._without_overhang(found)
            ]
        return self._known[place]

    def _without_overhang(self, surfaces: Sequence[Surface]) -> list[Surface]:
        """Return surfaces without what reaches into the city: the mirror image of a house that stands across the edge.

        The house itself is drawn, on both sides of the edge.
        """
        tiles = np.array([(tile.column, tile.row) for tile in self._city.manifest.tiles])
        size = self._city.manifest.size
        low, high = (tiles.min(axis=0) - 0.5) * size + _REACH_IN, (tiles.max(axis=0) + 0.5) * size - _REACH_IN
        gone = np.unique(
            np.concatenate(
                [s.entity[((s.positions[:, :2] > low) & (s.positions[:, :2] < high)).all(axis=1)] for s in surfaces]
            )
        )
        return [replace(s, triangles=s.triangles[~np.isin(s.entity[s.triangles[:, 0]], gone)]) for s in surfaces]

    def _of(self, tile: CityTile) -> list[Surface]:
        place = tile.column, tile.row
        if place not in self._known:
            shift = TileShift.of(self._city, place)
            self._known[place] = [shift.surface(surface) for surface in self._load_or_make(tile)]
        return self._known[place]

    def _load_or_make(self, tile: CityTile) -> list[Surface]:
        """Return a tile's silhouette in its own frame: the kept one, or a new one that is kept."""
        path = cache_folder() / "silhouettes" / f"{tile.digest[:32]}.{_VERSION}.npz"
        known = _read(path)
        if known is None:
            world = self._city.world((tile.column, tile.row))
            known = silhouette_of(world)
            # The next tile has most of these, too: as long as they are here they need not be decoded again.
            self._pictures = world.textures()
            try:
                _write(path, known)
            except OutputError as error:
                _log.warning("silhouettes are not kept: %s", error)
        return known


def _mirror_tile(k: int, first: int, last: int) -> tuple[int, float]:
    """Return the column or row within a city that one beyond its edge mirrors; -1.0 if that turns it round, or 1.0."""
    turned = 1.0
    while not first <= k <= last:
        k = 2 * first - 1 - k if k < first else 2 * last + 1 - k
        turned = -turned
    return k, turned


def _mirror_surface(surface: Surface, turns: NDArray[np.float64], moved: NDArray[np.float64]) -> Surface:
    """Return a surface with axes turned round, -1 each or 1, and moved, metres."""
    turned = turns.astype(np.float32)
    return replace(
        surface,
        positions=surface.positions * turned + moved.astype(np.float32),
        normals=surface.normals * turned,
        # Still counter-clockwise seen from outside.
        triangles=surface.triangles[:, ::-1] if turns.prod() < 0.0 else surface.triangles,
    )


def _read(path: Path) -> list[Surface] | None:
    """Return the surfaces of a file; None where there is none, or none that can be read."""
    try:
        with np.load(path, allow_pickle=False) as file:
            parts = [{name: file[f"{k}.{name}"] for name in _ARRAYS} for k in range(len(file["materials"]))]
            materials = [_MATERIALS[name] for name in file["materials"].tolist()]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None
    return [Surface(**arrays, material=material) for arrays, material in zip(parts, materials, strict=True)]


def _write(path: Path, surfaces: list[Surface]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = {f"{k}.{name}": getattr(surface, name) for k, surface in enumerate(surfaces) for name in _ARRAYS}
    with new_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, materials=[surface.material.name for surface in surfaces], **arrays)
