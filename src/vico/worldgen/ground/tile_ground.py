"""The ground under a photogrammetry mesh: rays down at streets and open ground, what stands there sorted out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData
from vico.worldgen.facts.sight import Sight
from vico.worldgen.facts.tags import on_the_ground

_STEP = 2.0  # metres between samples along a street
_ASIDE = (0.0, -1.8, 1.8)  # metres from a street's centre line: cars stand farther out
_GRID = 4.0  # metres between samples on open ground
_CLEAR = 2.5  # metres around buildings where a mesh's walls run into the ground
_MIN_WIDTH = {"footway", "path", "steps", "cycleway", "pedestrian", "corridor", "bridleway", "track"}

_NEIGHBOURS = 48
_STICKS_OUT, _SINKS = 0.35, 1.0  # metres over and under the ground around that are no noise
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


def ground_samples(sight: Sight, osm: OsmData, *, reach: float, top: float) -> GroundSamples:
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
    covered = _covered(osm, square)
    places: list[NDArray[np.float64]] = []
    for way in osm.ways:
        kind = way.tags.get("highway")
        if not kind or not on_the_ground(way.tags) or _raised(way.tags):
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


def _raised(tags: dict[str, str]) -> bool:
    return (
        tags.get("bridge", "no") != "no"
        or tags.get("covered", "no") != "no"
        or tags.get("tunnel", "no") != "no"
        or tags.get("layer", "0") not in ("0", "")
    )


def _covered(osm: OsmData, square: BaseGeometry) -> list[BaseGeometry]:
    """Find what hides the ground from above: buildings, bridges, and water, whose surface no photo can place."""
    hiding: list[BaseGeometry] = []
    for area in osm.areas:
        tags = area.tags
        solid = tags.get("building", "no") != "no" or tags.get("building:part", "no") != "no"
        wet = tags.get("natural") == "water" or "water" in tags
        if (solid or wet or tags.get("man_made") == "bridge") and shapely.intersects(area.polygon, square):
            hiding.append(area.polygon)
    for way in osm.ways:
        if way.tags.get("highway") and len(way.line) >= 2 and way.tags.get("bridge", "no") != "no":
            hiding.append(overlay.buffer(shapely.LineString(way.line), 4.0, cap_style="flat"))
    return hiding


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
    base, spread = _low_plane(points[good], points, _NEIGHBOURS)
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
        # The spread of the lower part tells noise; the upper half may be half full of cars.
        spread = np.maximum(-np.quantile(residual, 0.2, axis=1) / 0.84, 0.06)
        ratio = residual / spread[:, None]
        weight = 1.0 / (1.0 + np.where(ratio > 0, ratio / 2.0, ratio / 3.0) ** 2)
    return np.round(plane[:, 2], 4), np.round(spread, 4)  # the last bits differ from processor to processor
