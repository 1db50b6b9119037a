"""Synthetic photogrammetry: a known world, turned into the bumpy textured mesh that aerial photos would give of it.

What reads 3D tiles can so be held against a truth, without any tiles that may not be kept. As in real ones, everything
is one skin: edges are melted, trees and parked cars are blobs on the ground, facades are blurred and have the morning's
shadows in them, buildings stand a little off their outlines on the map, and narrow alleys have holes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from photogrammetry.scene import BUILDING, Seen, seen_world
from photogrammetry.surface_net import surface_net
from photogrammetry.tileset import leaf_cells
from vico.errors import InputError
from vico.geo.tiles3d import TileMesh
from vico.seeds import rng
from vico.world.world import World

_STEEP = 0.55  # normals with a smaller z are walls
_SECTORS = 8
_GUTTER = 2
_FILL = 40.0  # metres below the lowest ground that count as solid


@dataclass(frozen=True)
class Photogrammetry:
    """How good the photos and their evaluation are.

    Attributes
    ----------
    seed
        Decides noise, holes, parked cars and how far each building is off.
    cell
        Spacing of the mesh, metres.
    texel
        Metres a pixel of the photos.
    melt
        How far edges run, metres (the spread of the blur).
    noise
        How far vertices are off, metres (standard deviation).
    height_error, shift
        How far a building's top and place are off at most, metres.
    cars
        Share of the kerb's parking lots that are taken.
    alley
        Alleys narrower than this have holes, metres.
    holes
        Share of their surface that is missing.
    cast
        What the camera makes of white: red, green, blue.
    sun
        Azimuth from north over east, and height over the horizon, degrees, when the photos were taken.
    levels
        Of the quadtree that the mesh is textured for: one picture a leaf.
    """

    seed: int = 0
    cell: float = 1.0
    texel: float = 0.12
    melt: float = 0.6
    noise: float = 0.12
    height_error: float = 0.5
    shift: float = 0.5
    cars: float = 0.35
    alley: float = 4.0
    holes: float = 0.4
    cast: tuple[float, float, float] = (1.05, 1.0, 0.92)
    sun: tuple[float, float] = (140.0, 42.0)
    levels: int = 3


@dataclass(frozen=True)
class _Chart:
    """A plane piece of a picture: texel (i, j) looks along ``-normal`` from ``i * right + j * down``."""

    triangles: NDArray[np.int64]
    corner: NDArray[np.float64]  # along right and down, metres
    size: tuple[int, int]  # texels
    right: NDArray[np.float64]
    down: NDArray[np.float64]
    normal: NDArray[np.float64]


def photogrammetry(world: World, config: Photogrammetry = Photogrammetry(), *, half: float | None = None) -> TileMesh:
    """Make the mesh that aerial photos would give of a world.

    Parameters
    ----------
    world
        The known world.
    config
        How good the photos are.
    half
        Half the side of the square to do, metres; by default the world's.

    Returns
    -------
    TileMesh
        One connected skin, with one texture for every leaf of a quadtree of `config.levels` levels; ready for
        `photogrammetry.tileset.write_tileset`. The same world and configuration give the same mesh.

    Raises
    ------
    InputError
        If the configuration makes no sense.
    MissingExtraError
        If embreex is not installed.
    """
    if not (0.2 <= config.cell <= 10.0 and 0.02 <= config.texel <= 5.0 and config.melt >= 0.0):
        raise InputError(
            f"photogrammetry: cell {config.cell:g} m, texel {config.texel:g} m, melt {config.melt:g} m; "
            "give 0.2 to 10, 0.02 to 5, and nothing negative"
        )
    reach = world.half if half is None else half
    seen = seen_world(
        world,
        seed=config.seed,
        texel=config.texel,
        height_error=config.height_error,
        shift=config.shift,
        cars=config.cars,
        reach=reach,
    )
    positions, triangles = _skin(seen, reach, config)
    textures: list[NDArray[np.uint8]] = []
    parts: list[tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]] = []
    normals = _normals(positions, triangles)
    cells = leaf_cells(positions, triangles, config.levels)
    across = 2 ** (config.levels - 1)
    leaf = cells[:, 1] * across + cells[:, 0]
    for tile in np.unique(leaf).tolist():
        charts = _charts(positions, triangles, normals, np.flatnonzero(leaf == tile), config.texel)
        picture, part = _painted(positions, triangles, charts, seen, config)
        textures.append(picture)
        parts.append(part)
    first = np.cumsum([0, *(len(p) for p, _, _ in parts)])
    points = np.concatenate([p for p, _, _ in parts])
    return TileMesh(
        points,
        np.concatenate([t + n for (_, t, _), n in zip(parts, first, strict=False)]).astype(np.int32),
        np.concatenate([uv for _, _, uv in parts]).astype(np.float32),
        np.repeat(np.arange(len(parts)), [len(t) for _, t, _ in parts]).astype(np.int32),
        tuple(textures),
        np.full((len(points), 3), 255, np.uint8),
        tuple(s.attribution for s in world.manifest.sources if s.attribution),
    )


def _skin(seen: Seen, reach: float, config: Photogrammetry) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the bumpy surface: vertices, ENU metres, and triangles."""
    cell = config.cell
    n = 2 * math.ceil(reach / cell) + 1
    fine = (np.arange(2 * n) - n + 0.5) * cell / 2
    x, y = np.meshgrid(fine, fine, indexing="ij")
    above = 5000.0
    hits = seen.sight.first(np.stack([x.ravel(), y.ravel(), np.full(x.size, above)], axis=1), np.array([0, 0, -1.0]))
    height = (above - hits.distance).reshape(x.shape)
    lacking = ~np.isfinite(height)
    if lacking.all():
        raise InputError("photogrammetry: the world has no surfaces in this square; build it anew")
    if lacking.any():  # beyond the world's edge: as high as the nearest that is seen
        near = ndimage.distance_transform_edt(lacking, return_distances=False, return_indices=True)
        height = height[tuple(near)]
    building = (np.where(hits.triangle >= 0, seen.kind[hits.triangle], 0) == BUILDING).reshape(x.shape)
    low = float(height.min()) - 4 * cell
    levels = np.arange(low, float(height.max()) + 4 * cell, cell)
    density = np.zeros((n, n, len(levels)), np.float32)
    for i in (0, 1):
        for j in (0, 1):
            column = (height[i::2, j::2, None] - levels[None, None, :]).astype(np.float32) / np.float32(cell)
            density += np.clip(column + np.float32(0.5), 0.0, 1.0) / np.float32(4.0)
    if config.melt > 0:
        density = ndimage.gaussian_filter(density, config.melt / cell, mode="nearest", truncate=3.0)
    vertices, triangles = surface_net(density)
    points = vertices * cell + (fine[:2].mean(), fine[:2].mean(), low)
    points += _bumps(points, config) * _vertex_normals(points, triangles)
    alley = ndimage.binary_closing(building, _disc(config.alley / cell)) & ~building
    middle = points[triangles].mean(axis=1)
    place = np.clip(np.round((middle[:, :2] - fine[0]) / (cell / 2)).astype(int), 0, 2 * n - 1)
    patchy = _wave(middle, 5.0, rng(config.seed, "holes"))
    gap = alley[place[:, 0], place[:, 1]] & (patchy < np.quantile(patchy, config.holes))
    triangles = triangles[~gap]
    used, local = np.unique(triangles, return_inverse=True)
    return points[used], local.reshape(-1, 3).astype(np.int32)


def _disc(radius: float) -> NDArray[np.bool_]:
    """Return a disc on the fine grid (two steps a cell), `radius` in cells; closing fills gaps as wide as `radius`."""
    reach = max(round(radius), 1)
    x, y = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return np.asarray(x * x + y * y <= reach * reach)


def _wave(points: NDArray[np.float64], length: float, random: np.random.Generator) -> NDArray[np.float64]:
    """Smooth noise of unit spread: random values on a grid, interpolated."""
    low = points.min(axis=0)
    shape = np.ceil((points.max(axis=0) - low) / length).astype(int) + 4
    grid = random.standard_normal(shape)
    values = ndimage.map_coordinates(grid, ((points - low) / length + 1.0).T, order=1)
    return np.asarray(values / max(float(values.std()), 1e-9))


def _bumps(points: NDArray[np.float64], config: Photogrammetry) -> NDArray[np.float64]:
    """How far each vertex is off along its normal, shape ``(n, 1)``."""
    random = rng(config.seed, "bumps")
    total = (
        0.7 * _wave(points, 9.0, random) + 0.6 * _wave(points, 3.0, random) + 0.4 * random.standard_normal(len(points))
    )
    return (config.noise * total)[:, None]


def _normals(positions: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    """Directions of the triangles with those around them: of their corners' mean normals."""
    smooth = _vertex_normals(positions, triangles)[triangles].sum(axis=1)
    return np.asarray(smooth / np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), 1e-12))


def _vertex_normals(positions: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    corner = positions[triangles]
    flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    total = np.stack(
        [np.bincount(triangles.ravel(), np.repeat(flat[:, k], 3), minlength=len(positions)) for k in range(3)], axis=1
    )
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12))


def _charts(
    positions: NDArray[np.float64],
    triangles: NDArray[np.int32],
    normals: NDArray[np.float64],
    mine: NDArray[np.int64],
    texel: float,
) -> list[_Chart]:
    """Divide a tile's triangles into plane pieces: all that looks up is one, walls are pieces by direction."""
    up = np.array([0.0, 0.0, 1.0])
    steep = normals[mine, 2] < _STEEP
    turn = np.arctan2(normals[mine, 1], normals[mine, 0])
    sector = np.where(steep, np.round(turn / (2 * math.pi) * _SECTORS).astype(int) % _SECTORS, -1)
    charts = []
    if (~steep).any():
        east, south = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
        charts.append(_chart(positions, triangles, mine[~steep], east, south, up, texel))
    for k in range(_SECTORS):
        faces = mine[sector == k]
        if not len(faces):
            continue
        angle = 2 * math.pi * k / _SECTORS
        normal = np.array([math.cos(angle), math.sin(angle), 0.0])
        right = np.array([-normal[1], normal[0], 0.0])
        edges = np.sort(triangles[faces][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        owner = np.repeat(np.arange(len(faces)), 3)
        order = np.lexsort((edges[:, 1], edges[:, 0]))
        same = np.flatnonzero((edges[order][1:] == edges[order][:-1]).all(axis=1))
        a, b = owner[order[same]], owner[order[same + 1]]
        graph = coo_matrix((np.ones(len(a), bool), (a, b)), shape=(len(faces), len(faces)))
        many, piece = connected_components(graph, directed=False)
        by_piece = np.argsort(piece, kind="stable")
        bounds = np.searchsorted(piece[by_piece], np.arange(many + 1))
        for p in range(many):
            own = faces[by_piece[bounds[p] : bounds[p + 1]]]
            charts.append(_chart(positions, triangles, own, right, -up, normal, texel))
    return charts


def _chart(
    positions: NDArray[np.float64],
    triangles: NDArray[np.int32],
    faces: NDArray[np.int64],
    right: NDArray[np.float64],
    down: NDArray[np.float64],
    normal: NDArray[np.float64],
    texel: float,
) -> _Chart:
    points = positions[triangles[faces].ravel()]
    along = np.stack([points @ right, points @ down], axis=1)
    low = along.min(axis=0) - _GUTTER * texel
    size = np.ceil((along.max(axis=0) - low) / texel).astype(int) + _GUTTER
    return _Chart(faces, low, (int(size[0]), int(size[1])), right, down, normal)


def _packed(charts: list[_Chart]) -> tuple[NDArray[np.int64], int, int]:
    """Where each chart lies on the picture, and its width and height: shelves, the tallest first."""
    sizes = np.array([chart.size for chart in charts])
    width = max(int(sizes[:, 0].max()), math.ceil(math.sqrt(float(sizes.prod(axis=1).sum()) * 1.05)))
    places = np.zeros((len(charts), 2), np.int64)
    x = y = tall = 0
    for k in np.lexsort((np.arange(len(charts)), -sizes[:, 0], -sizes[:, 1])).tolist():
        w, h = sizes[k].tolist()
        if x + w > width:
            x, y, tall = 0, y + tall, 0
        places[k] = x, y
        x, tall = x + w, max(tall, h)
    return places, width, y + tall


def _painted(
    positions: NDArray[np.float64],
    triangles: NDArray[np.int32],
    charts: list[_Chart],
    seen: Seen,
    config: Photogrammetry,
) -> tuple[NDArray[np.uint8], tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]]:
    """Return a tile's picture; and its own vertices, triangles and texture coordinates."""
    places, width, height = _packed(charts)
    picture = np.zeros((height, width, 3), np.float32)
    known = np.zeros((height, width), bool)
    points, faces, uvs, count = [], [], [], 0
    rows: list[tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]] = []
    for chart, (left, top) in zip(charts, places.tolist(), strict=True):
        used, local = np.unique(triangles[chart.triangles], return_inverse=True)
        spots = positions[used]
        along = np.stack([spots @ chart.right, spots @ chart.down], axis=1)
        pixel = (along - chart.corner) / config.texel + (left, top)
        points.append(spots)
        faces.append(local.reshape(-1, 3) + count)
        uvs.append(pixel / (width, height))
        count += len(used)
        rows.append(_views(chart, spots, (along - chart.corner) / config.texel, left, top, width, config.texel))
    address = np.concatenate([row[0] for row in rows])
    origin = np.concatenate([row[1] for row in rows])
    direction = np.concatenate([row[2] for row in rows])
    colour, met = _photo(seen, origin, direction, config)
    flat, flag = picture.reshape(-1, 3), known.reshape(-1)
    flat[address[met]] = colour[met]
    flag[address[met]] = True
    return _developed(picture, known, config), (np.concatenate(points), np.concatenate(faces), np.concatenate(uvs))


def _views(
    chart: _Chart, spots: NDArray[np.float64], pixel: NDArray[np.float64], left: int, top: int, width: int, texel: float
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """For the texels of a chart: their address on the picture, and the ray that their colour comes along."""
    w, h = chart.size
    # Only texels within reach of the chart's own vertices, on a coarse grid: walls leave most of a rectangle bare.
    step = max(round(1.5 / texel), 1)
    shape = (h // step + 1, w // step + 1)
    depth = np.full(shape, -np.inf)
    at = np.minimum((pixel[:, ::-1] / step).astype(int), np.array(shape) - 1)
    np.maximum.at(depth, (at[:, 0], at[:, 1]), spots @ chart.normal)
    depth = ndimage.grey_dilation(depth, size=(3, 3))
    j, i = np.mgrid[0:h, 0:w]
    near = depth[j // step, i // step]
    good = np.isfinite(near)
    i, j, near = i[good], j[good], near[good]
    along = chart.corner + (np.stack([i, j], axis=1) + 0.5) * texel
    start = along[:, :1] * chart.right + along[:, 1:] * chart.down + (near[:, None] + 1.2) * chart.normal
    return (top + j) * width + left + i, start, np.broadcast_to(-chart.normal, start.shape)


def _photo(
    seen: Seen, origin: NDArray[np.float64], direction: NDArray[np.float64], config: Photogrammetry
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return what is seen along rays: colours with the sun's light and shadow in them, and whether anything is."""
    hits = seen.sight.first(origin, direction, most=6.0)
    met = hits.triangle >= 0
    colour = seen.colours(hits)
    azimuth, height = np.radians(config.sun)
    sun = np.array([math.sin(azimuth) * math.cos(height), math.cos(azimuth) * math.cos(height), math.sin(height)])
    normal = seen.normal[hits.triangle]
    normal = np.where((np.einsum("nk,nk->n", normal, direction) > 0)[:, None], -normal, normal)
    facing = np.maximum(normal @ sun.astype(np.float32), 0.0)
    lit = np.flatnonzero(met & (facing > 0))
    spot = origin[lit] + direction[lit] * hits.distance[lit, None] + 0.06 * normal[lit]
    shaded = seen.sight.first(spot, sun, most=400.0).triangle >= 0
    facing[lit[shaded]] = 0.0
    sky = 0.5 + 0.12 * np.maximum(normal[:, 2], 0.0)
    light = (sky[:, None] * np.array([0.94, 0.99, 1.08]) + 0.62 * facing[:, None] * np.array([1.05, 1.0, 0.9])) ** 0.8
    return (colour * light * np.array(config.cast)).astype(np.float32), met


def _developed(picture: NDArray[np.float32], known: NDArray[np.bool_], config: Photogrammetry) -> NDArray[np.uint8]:
    """Return the picture blurred as photos from far away are, with every gap filled from what is nearest."""
    spread = 0.75
    weight = ndimage.gaussian_filter(known.astype(np.float32), spread)
    soft = (
        np.stack([ndimage.gaussian_filter(np.where(known, picture[..., k], 0), spread) for k in range(3)], axis=-1)
        / np.maximum(weight, 1e-6)[..., None]
    )
    empty = weight < 0.02
    if empty.any() and not empty.all():
        near = ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True)
        soft = soft[tuple(near)]
    return np.round(np.clip(soft, 0.0, 1.0) * 255).astype(np.uint8)
