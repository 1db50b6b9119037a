"""The height field of a world: robust, smooth and bilinear, from height samples or from a photogrammetry mesh; or flat.

In a mesh rays look down at streets and open ground, and what stands there is sorted out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator, RectBivariateSpline
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from vico.errors import EmptyInputError
from vico.geo import overlay
from vico.geo.elevation import HeightSamples
from vico.geo.osm import OsmData
from vico.geo.tiles3d import TileMesh
from vico.world.heights import HeightField
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.facts.site import on_the_ground

_STEP = 2.0  # metres between samples along a street
_ASIDE = (0.0, -1.8, 1.8)  # metres from a street's centre line: cars stand farther out
_GRID = 4.0  # metres between samples on open ground
_CLEAR = 2.5  # metres around buildings where a mesh's walls run into the ground
_MIN_WIDTH = {"footway", "path", "steps", "cycleway", "pedestrian", "corridor", "bridleway", "track"}

_NEAREST_SAMPLES = 48
_STICKS_OUT = 0.35  # metres over the ground around that are no noise
_SINKS = 1.0  # and under it
_MOST_STICKS_OUT = 1.2  # however uneven it is around
_BIN, _BIN_REACH = 10.0, 45.0
_BIN_OVER = 2.5  # metres that a whole bin may lie above the low ground around it


@dataclass(frozen=True)
class GroundSamples:
    """Heights of a mesh where ground is to be expected.

    Attributes
    ----------
    points
        ENU metres, float64, shape ``(n, 3)``; cars, trees and noise among them.
    street
        Whether each lies on a street, bool, shape ``(n,)``; else it lies on open ground.
    missed
        Places where the mesh has a hole.
    """

    points: NDArray[np.float64]
    street: NDArray[np.bool_]
    missed: int


def _ground_samples(sight: RayCaster, osm: OsmData, *, reach: float, top: float) -> GroundSamples:
    """Cast rays down at streets and open ground.

    Parameters
    ----------
    sight
        The photogrammetry mesh.
    osm
        Its streets and buildings; what lies on bridges, in tunnels or under roofs is left out.
    reach
        Half the side of the square to sample, metres.
    top
        Where the rays start: above everything, metres.
    """
    square = shapely.box(-reach, -reach, reach, reach)
    # Buildings, bridges, and water, whose surface no photo can place, hide the ground from above.
    covered: list[BaseGeometry] = []
    for area in osm.areas:
        tags = area.tags
        solid = tags.get("building", "no") != "no" or tags.get("building:part", "no") != "no"
        wet = tags.get("natural") == "water" or "water" in tags
        if (solid or wet or tags.get("man_made") == "bridge") and shapely.intersects(area.polygon, square):
            covered.append(area.polygon)
    for way in osm.ways:
        if way.tags.get("highway") and len(way.line) >= 2 and way.tags.get("bridge", "no") != "no":
            covered.append(overlay.buffer(shapely.LineString(way.line), 4.0, cap_style="flat"))
    places: list[NDArray[np.float64]] = []
    for way in osm.ways:
        kind = way.tags.get("highway")
        if not kind or not on_the_ground(way.tags) or _is_off_ground(way.tags):
            continue
        offsets: Sequence[float] = (0.0,) if kind in _MIN_WIDTH else _ASIDE
        places += _along(way.line, offsets)
    streets = np.concatenate(places) if places else np.zeros((0, 2))
    streets = streets[np.abs(streets).max(axis=1, initial=0.0) <= reach]
    side = np.arange(-reach + _GRID / 2, reach, _GRID)
    x, y = np.meshgrid(side, side)
    open_ground = np.stack([x.ravel(), y.ravel()], axis=1)
    spots = np.concatenate([streets, open_ground])
    street = np.arange(len(spots)) < len(streets)
    if covered:
        tree = shapely.STRtree(covered)
        # Streets keep closer to walls than open ground does, or narrow ones would have no samples at all.
        keep = np.ones(len(spots), bool)
        for chosen, clear in ((street, 0.6), (~street, _CLEAR)):
            index = np.flatnonzero(chosen)
            hit, _ = tree.query(shapely.points(spots[index]), predicate="dwithin", distance=clear)
            keep[index[hit]] = False
        spots, street = spots[keep], street[keep]
    hits = sight.first(np.c_[spots, np.full(len(spots), top)], np.array([0.0, 0.0, -1.0]))
    met = np.isfinite(hits.distance)
    points = np.c_[spots, top - hits.distance][met]
    return GroundSamples(points, street[met], int((~met).sum()))


def _is_off_ground(tags: dict[str, str]) -> bool:
    return (
        tags.get("bridge", "no") != "no"
        or tags.get("covered", "no") != "no"
        or tags.get("tunnel", "no") != "no"
        or tags.get("layer", "0") not in ("0", "")
    )


def _along(line: NDArray[np.float64], offsets: Sequence[float]) -> list[NDArray[np.float64]]:
    """Points along a line and beside it."""
    length = np.hypot(*np.diff(line, axis=0).T)
    line = line[np.concatenate([[True], length > 1e-6])]
    if len(line) < 2:
        return []
    step = np.diff(line, axis=0)
    length = np.hypot(*step.T)
    along = np.concatenate([[0.0], np.cumsum(length)])
    at = np.arange(_STEP / 2, along[-1], _STEP)
    k = np.minimum(np.searchsorted(along, at, "right") - 1, len(length) - 1)
    ahead = step[k] / length[k, None]
    middle = line[k] + ahead * (at - along[k])[:, None]
    return [middle + offset * np.stack([ahead[:, 1], -ahead[:, 0]], axis=1) for offset in offsets]


def on_ground(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell the ground from what stands on it.

    Twice the same idea, once near and once far: a plane through the low part of what is around (so slopes don't count),
    and a bound on how far a sample may lie above it. First sample by sample against the nearest ones, the bound from
    their own spread, which finds cars, kerbside things and single trees; then 10 m bins against those around, which
    finds rows of trees and roofs where the map has no building.

    Parameters
    ----------
    points
        Heights where ground is expected, ENU metres, shape ``(n, 3)``.

    Returns
    -------
    ndarray
        True for what is ground, shape ``(n,)``.

    Notes
    -----
    Paper, appendix A.1: "a rule-based filter to remove abnormal points". Ours: local low quantile and median absolute
    deviation.
    """
    good = np.ones(len(points), bool)
    if len(points) < 12:
        return good
    for _ in range(2):
        good = _near_low(points, good)
    cell = np.floor(points[:, :2] / _BIN).astype(np.int64)
    _, owner = np.unique(cell, axis=0, return_inverse=True)
    owner = owner.ravel()
    many = int(owner.max()) + 1
    bins = np.full((many, 3), np.nan)
    order = np.argsort(owner[good], kind="stable")
    rows = points[good][order]
    bounds = np.searchsorted(owner[good][order], np.arange(many + 1))
    for k in range(many):
        mine = rows[bounds[k] : bounds[k + 1]]
        if len(mine):
            bins[k] = np.median(mine, axis=0)
    filled = np.flatnonzero(np.isfinite(bins[:, 2]))
    if len(filled) >= 12:
        around = min(int((2 * _BIN_REACH / _BIN) ** 2 / 2), len(filled) - 1)
        base, spread = _low_plane(bins[filled], bins[filled], around)
        over = np.zeros(many, bool)
        over[filled] = bins[filled, 2] - base > np.maximum(4.0 * spread, _BIN_OVER)
        if (good & ~over[owner]).sum() >= 12:
            good &= ~over[owner]
    return _near_low(points, good)


def _near_low(points: NDArray[np.float64], good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the samples that lie on the low ground of the good ones around them."""
    base, spread = _low_plane(points[good], points, _NEAREST_SAMPLES)
    above = points[:, 2] - base
    over = above > np.clip(3.0 * spread, _STICKS_OUT, _MOST_STICKS_OUT)
    found = ~over & (above >= -np.maximum(6.0 * spread, _SINKS))
    return found if found.sum() >= 12 else good


def _low_plane(
    known: NDArray[np.float64], asked: NDArray[np.float64], neighbours: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Height of the plane through the low part of the nearest known points, and their spread about it."""
    count = min(neighbours, len(known))
    _, index = cKDTree(known[:, :2]).query(asked[:, :2], k=count)
    around = known[index] - np.c_[asked[:, :2], np.zeros(len(asked))][:, None, :]
    reach = np.maximum(np.abs(around[..., :2]).max(axis=(1, 2), keepdims=True), 1e-9)
    design = np.concatenate([around[..., :2] / reach, np.ones((*around.shape[:2], 1))], axis=-1)
    height = around[..., 2]
    weight = np.ones(height.shape)
    # A plane that is tilted by what sticks out is worse than a level one: slopes are held back a little.
    hold = np.diag([0.003, 0.003, 1e-9]) * count
    plane = np.zeros((len(asked), 3))
    spread = np.zeros(len(asked))
    for _ in range(6):
        middle = (weight * height).sum(axis=1) / weight.sum(axis=1)
        normal = np.einsum("nki,nk,nkj->nij", design, weight, design) + hold
        right = np.einsum("nki,nk,nk->ni", design, weight, height - middle[:, None])
        plane = np.linalg.solve(normal, right[..., None])[..., 0]
        plane[:, 2] += middle
        residual = height - np.einsum("nki,ni->nk", design, plane)
        # The spread of the lower part is noise; the upper half may be half full of cars.
        spread = np.maximum(-np.quantile(residual, 0.2, axis=1) / 0.84, 0.06)
        ratio = residual / spread[:, None]
        weight = 1.0 / (1.0 + np.where(ratio > 0, ratio / 2.0, ratio / 3.0) ** 2)
    return np.round(plane[:, 2], 4), np.round(spread, 4)  # the last bits differ from processor to processor


APRON = 60.0
"""Metres the height field goes on beyond the world's square, so that what crosses the edge stands on something."""

_CELL = 4.0
_OUTLIER_NEIGHBOURS = 25
_MOST_SAMPLES = 40_000
_TILE_BIN, _TILE_KNOT = 5.0, 8.0
_STEEPEST = 0.3


def is_outlier(points: NDArray[np.float64], neighbours: int = _OUTLIER_NEIGHBOURS) -> NDArray[np.bool_]:
    """Mark samples that do not lie on the ground around them.

    Each sample is held against a plane through its neighbours (so slopes are no outliers), fitted twice, the second
    time without the neighbours that stick out of the first; the scale is the median absolute residual of all samples.

    Parameters
    ----------
    points
        ENU metres, shape ``(n, 3)``.
    neighbours
        How many make up the surroundings, the sample itself not counted.

    Returns
    -------
    ndarray
        bool, shape ``(n,)``.
    """
    count = min(neighbours, len(points) - 1)
    if count < 8:
        return np.zeros(len(points), bool)
    _, index = cKDTree(points[:, :2]).query(points[:, :2], k=count + 1)
    around = points[index[:, 1:]] - points[:, None, :]
    reach = np.maximum(np.abs(around[..., :2]).max(axis=(1, 2), keepdims=True), 1e-9)
    design = np.concatenate([around[..., :2] / reach, np.ones((*around.shape[:2], 1))], axis=-1)
    weight = np.ones(around.shape[:2])
    offset = np.zeros(len(points))
    for _ in range(2):
        normal = np.einsum("nki,nk,nkj->nij", design, weight, design) + 1e-9 * np.eye(3)
        right = np.einsum("nki,nk,nk->ni", design, weight, around[..., 2])
        plane = np.linalg.solve(normal, right[..., None])[..., 0]
        residual = np.abs(around[..., 2] - np.einsum("nki,ni->nk", design, plane))
        weight = (residual <= 2.5 * np.median(residual, axis=1, keepdims=True) + 0.5).astype(np.float64)
        offset = plane[:, 2]
    scale = 1.4826 * float(np.median(np.abs(offset)))
    return np.abs(offset) > max(6.0 * scale, 4.0)


def terrain_from_dem(samples: HeightSamples, *, half: float, apron: float = APRON) -> HeightField:
    """Fit a regular height field to the samples of an elevation file.

    Parameters
    ----------
    samples
        Heights at points, a grid's or scattered ones; some may be buildings or trees.
    half
        Half side of the world's square, metres.
    apron
        How far the field goes beyond it, metres.

    Returns
    -------
    HeightField
        Cells of at most 4 m.

    Raises
    ------
    EmptyInputError
        If fewer than three samples survive the outlier filter.

    Notes
    -----
    Spec section 1, terrain: robust filter, then bilinear. Between them a smoothing thin-plate fit at the samples' own
    spacing and a bicubic refinement, so that 90 m SRTM cells do not show as facets.
    """
    points = samples.points
    ground = points[~is_outlier(points)]
    if len(ground) < 3:
        raise EmptyInputError(
            f"terrain: {len(ground)} of {len(points)} height samples of {samples.name} survive the outlier filter; "
            "give another elevation file, or leave it out for flat ground"
        )
    if len(ground) > _MOST_SAMPLES:
        ground = ground[:: math.ceil(len(ground) / _MOST_SAMPLES)]
    reach = half + apron
    coarse = max(samples.spacing / 2.0, 12.0)
    knots = np.linspace(-reach, reach, max(math.ceil(2 * reach / coarse), 4) + 1)
    x, y = np.meshgrid(knots, knots)
    fit = RBFInterpolator(
        ground[:, :2] / samples.spacing,
        ground[:, 2],
        neighbors=min(24, len(ground)),
        kernel="thin_plate_spline",
        smoothing=0.05,
        degree=1 if len(ground) >= 3 else 0,
    )
    rough = fit(np.stack([x.ravel(), y.ravel()], axis=1) / samples.spacing).reshape(x.shape)
    rough = np.clip(rough, ground[:, 2].min(), ground[:, 2].max())
    cells = math.ceil(2 * reach / _CELL)
    fine = np.linspace(-reach, reach, cells + 1)
    heights = RectBivariateSpline(knots, knots, rough, kx=3, ky=3)(fine, fine)
    return _field(np.clip(heights, rough.min(), rough.max()), reach)


def _field(heights: NDArray[np.float64], reach: float) -> HeightField:
    """To a tenth of a millimetre: the last bits of a solver differ from processor to processor."""
    return HeightField(np.round(heights, 4).astype(np.float32), reach)


def flat_terrain(*, half: float, apron: float = APRON) -> HeightField:
    """Make a level field at height 0."""
    return HeightField.flat(half + apron)


@dataclass(frozen=True)
class TileTerrain:
    """How the ground was found in a photogrammetry mesh.

    Attributes
    ----------
    samples
        Places on streets and open ground where the mesh has a height.
    outliers
        Those of them that lie on cars, trees, roofs or noise.
    missed
        Places where the mesh has a hole.
    residual
        Root mean square of the kept samples' distance to the height field, metres.
    """

    samples: int
    outliers: int
    missed: int
    residual: float


def terrain_from_tiles(
    mesh: TileMesh, osm: OsmData, *, half: float, apron: float = APRON, sight: RayCaster | None = None
) -> tuple[HeightField, TileTerrain]:
    """Fit a regular height field to the ground of a photogrammetry mesh.

    Parameters
    ----------
    mesh
        The city, buildings, trees, cars and all.
    osm
        Its map: the streets to sample along, the buildings to keep off.
    half
        Half side of the world's square, metres.
    apron
        How far the field goes beyond it, metres.
    sight
        Rays against `mesh`, if somebody has made them ready.

    Returns
    -------
    tuple
        The field, cells of at most 4 m; and how it was found.

    Raises
    ------
    EmptyInputError
        If the mesh has hardly any ground.
    MissingExtraError
        If embreex is not installed.

    Notes
    -----
    Paper, appendix A.1; spec section 1, terrain: rays along streets and ground, robust filter, medians of 5 m bins, a
    smoothing thin-plate fit over them (which goes on under buildings), bilinear look-up.
    """
    if not len(mesh.triangles):
        raise EmptyInputError("terrain: the tile mesh has no triangles; give a tileset of this place, or a DEM")
    reach = half + apron
    rays = sight or RayCaster(mesh.positions, mesh.triangles)
    found = _ground_samples(rays, osm, reach=reach, top=float(mesh.positions[:, 2].max()) + 10.0)
    ground = found.points[on_ground(found.points)] if len(found.points) else found.points
    if len(ground) < 12:
        raise EmptyInputError(
            f"terrain: only {len(ground)} of {len(found.points)} rays at the tile mesh meet ground; give a tileset "
            "with the ground in it, or an elevation file"
        )
    cell = np.floor(ground[:, :2] / _TILE_BIN).astype(np.int64)
    _, owner, many = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(owner.ravel(), kind="stable")
    bins = np.array([np.median(part, axis=0) for part in np.split(ground[order], np.cumsum(many)[:-1])])
    knots = np.linspace(-reach, reach, max(math.ceil(2 * reach / _TILE_KNOT), 4) + 1)
    x, y = np.meshgrid(knots, knots)
    fit = RBFInterpolator(
        bins[:, :2] / _TILE_BIN,
        bins[:, 2],
        neighbors=min(32, len(bins)),
        kernel="thin_plate_spline",
        smoothing=0.4,
        degree=1,
    )
    rough = fit(np.stack([x.ravel(), y.ravel()], axis=1) / _TILE_BIN).reshape(x.shape)
    # Far from any sample a plane through the last ones runs away: no steeper than ground is, from the nearest.
    away, nearest = cKDTree(bins[:, :2]).query(np.stack([x.ravel(), y.ravel()], axis=1))
    most = (_TILE_BIN + _STEEPEST * away).reshape(x.shape)
    level = bins[nearest, 2].reshape(x.shape)
    rough = np.clip(rough, level - most, level + most)
    fine = np.linspace(-reach, reach, math.ceil(2 * reach / _CELL) + 1)
    heights = RectBivariateSpline(knots, knots, rough, kx=3, ky=3)(fine, fine)
    field = _field(np.clip(heights, rough.min(), rough.max()), reach)
    off = field(ground[:, :2]) - ground[:, 2]
    report = TileTerrain(
        len(found.points), len(found.points) - len(ground), found.missed, float(np.sqrt((off**2).mean()))
    )
    return field, report
