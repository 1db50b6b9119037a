"""What a tile of a city looks like from afar: its ground, houses and trees, of a few triangles each.

A city has more triangles and pictures of facades than fit into memory, and from a few hundred metres nobody sees them.
So a house becomes the walls of its simplified outline and a plain roof, the ground a coarse grid, a tree two pyramids.
Every colour is the mean of what the tile's own meshes show there, in linear light: the windows darken a wall as they
do near by, and a city does not change its colours where near tiles end and far ones begin.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.world.far_houses import far_houses
from vico.world.mean_colours import LINEAR, looks_from_afar, spread_points, srgb, sums_by
from vico.world.mesh import Material, Surface, joined, quad_triangles, surface_of_quads
from vico.world.model import ENTITY_GREEN, ENTITY_GROUND, ENTITY_ROAD, ENTITY_WATER
from vico.world.world import World

#: Name of the material that silhouettes are of, but for walls with windows.
FAR = "far"

_MATERIAL = Material(FAR)
_GRID = 12.5  # metres; cells of the ground
_SKIRT = 1.0  # metres that the ground's edge hangs down, for the finer ground of a neighbour may lie lower
_FINE, _LAYER = 8, 0.1  # parts of its side in which the topmost ground is looked for; metres that it is thick
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
        `vico.world.far_windows.WINDOWS`, one small picture for all. Vertices have the entities that the
        tile's own meshes have: of buildings, of trees, of kinds of ground.

    Raises
    ------
    InputError
        If the world has no size.
    """
    if not world.half > 0.0:
        raise InputError(f"world {world.manifest.name!r} has a half side of {world.half} m; a silhouette needs some")
    parts = [*_ground(world), *far_houses(world, _MATERIAL), *_trees(world)]
    return joined(parts)


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
    looks = looks_from_afar(world.surfaces("ground"))
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
        places = _turned(points, moves) + moves[:, None, :3, 3]
        count = len(trees)
        first = len(points) * np.arange(count, dtype=np.int32)
        yield Surface(
            places.reshape(-1, 3).astype(np.float32),
            (_turned(normals, moves) / trees.scale[:, None, None]).reshape(-1, 3).astype(np.float32),
            np.zeros((count * len(points), 2), np.float32),
            np.broadcast_to(srgb(colour), (count * len(points), 3)).copy(),
            np.repeat(trees.entity, len(points)),
            (first[:, None, None] + _TWO_PYRAMIDS).reshape(-1, 3),
            _MATERIAL,
        )


def _crown(surfaces: Sequence[Surface]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return corners and normals of a tree from afar, foot first and tip last, and its colour in linear light."""
    leaves = [s for s in surfaces if s.material.cutout] or surfaces
    looks = looks_from_afar(leaves)
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


def _turned(points: NDArray[np.float64], moves: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points ``(p, 3)`` turned and scaled by matrices ``(n, 4, 4)``, shape ``(n, p, 3)``."""
    return sum(moves[:, None, :3, k] * points[None, :, k, None] for k in range(3))  # type: ignore[return-value]
