"""The height field of a world: robust, smooth and bilinear, from height samples; or flat."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator, RectBivariateSpline
from scipy.spatial import cKDTree

from vico.errors import EmptyInputError
from vico.geo.elevation import HeightSamples
from vico.geo.osm import OsmData
from vico.geo.tiles3d import TileMesh
from vico.world.heights import HeightField
from vico.worldgen.facts.sight import Sight
from vico.worldgen.ground.tile_ground import ground_samples, on_ground

APRON = 60.0
"""Metres the height field goes on beyond the world's square, so that what crosses the edge stands on something."""

_CELL = 4.0
_NEIGHBOURS = 25
_MOST_SAMPLES = 40_000
_TILE_BIN, _TILE_KNOT = 5.0, 8.0
_STEEPEST = 0.3


def is_outlier(points: NDArray[np.float64], neighbours: int = _NEIGHBOURS) -> NDArray[np.bool_]:
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
    mesh: TileMesh, osm: OsmData, *, half: float, apron: float = APRON, sight: Sight | None = None
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
    rays = sight or Sight(mesh.positions, mesh.triangles)
    found = ground_samples(rays, osm, reach=reach, top=float(mesh.positions[:, 2].max()) + 10.0)
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
