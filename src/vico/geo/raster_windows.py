"""The part of a raster of heights that lies around a window, as points and as a surface, without what no ground has.

Outliers are single pixels and small groups of them, far above or below all around them. Untagged voids are patches of
one repeated value, far from the ground at their border.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vico.errors import SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.rasters import Raster

# Each rule leaves out a group of at most so many pixels (the first number) that stands on every side so many metres
# (the second), and so many times the distance between pixels (the third), above its neighbours, or lies below them. A
# cliff, a peak or a pass has neighbours of nearly its own height on some side, whatever the slope. What stands alone
# is held against the steepest ground there is: Devils Tower rises 265 m from a foot of 300 m, the Old Man of Hoy
# 137 m from one of 30 m, Ball's Pyramid 560 m from one of 300 m by 1,100 m. Holes with steep walls all round are wider.
_ABOVE = ((9, 200.0, 4.0), (400, 1000.0, 20.0))
_BELOW = ((9, 60.0, 3.0), (400, 500.0, 10.0))
_LEAST_AROUND = 3  # neighbours that are known
_MOST_ROUNDS = 8
# Large grids are gone through in overlapping tiles, pixels: a group wider than the overlap is none.
_STRIDE = 512
_OVERLAP = 128


def without_outliers(
    heights: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], list[tuple[int, int, float]]]:
    """Leave out heights that no ground has.

    Parameters
    ----------
    heights
        Metres on a grid, NaN where unknown, shape ``(rows, columns)``.
    spacing
        Distance between neighbours, metres.

    Returns
    -------
    tuple
        The heights, NaN where one was left out; and row, column and height of each of these.
    """
    found: list[tuple[int, int, float]] = []
    rows, columns = heights.shape
    least = min(max(step, slope * spacing) for _, step, slope in (*_ABOVE, *_BELOW))
    for top in range(0, max(rows - _OVERLAP, 1), _STRIDE):
        for left in range(0, max(columns - _OVERLAP, 1), _STRIDE):
            tile = np.s_[top : top + _STRIDE + _OVERLAP, left : left + _STRIDE + _OVERLAP]
            # What is left out may have hidden another beside it.
            for _ in range(_MOST_ROUNDS):
                part = heights[tile]
                steps = [np.abs(np.diff(part, axis=axis)) for axis in (0, 1)]
                if not any(np.max(step, initial=0.0, where=np.isfinite(step)) >= least for step in steps):
                    break
                ends = (top == 0, top + len(part) == rows, left == 0, left + part.shape[1] == columns)
                bad = _outlying(part, spacing, ends)
                if not bad.any():
                    break
                down, across = np.nonzero(bad)
                found += zip((down + top).tolist(), (across + left).tolist(), part[bad].tolist(), strict=True)
                heights = heights.copy()
                heights[tile][bad] = np.nan
    return heights, found


def _outlying(heights: NDArray[np.float64], spacing: float, ends: tuple[bool, ...]) -> NDArray[np.bool_]:
    """Whether heights are such that no ground has; `ends` tells whether the grid ends at top, bottom, left, right."""
    pairs = _neighbours(heights.shape)
    pairs = pairs[:, np.isfinite(heights.ravel()[pairs]).all(axis=0)]
    bad = np.zeros(heights.shape, bool)
    for sign, rules in ((1.0, _ABOVE), (-1.0, _BELOW)):
        for most, step, slope in rules:
            group, alone = _groups_alone(sign * heights.ravel(), pairs, max(step, slope * spacing), most)
            group = group.reshape(heights.shape)
            sides = (group[0], group[-1], group[:, 0], group[:, -1])
            for side, is_end in zip(sides, ends, strict=True):
                if not is_end:  # there it may go on
                    alone[side] = False
            bad |= alone[group]
    return bad & np.isfinite(heights)


def _groups_alone(
    heights: NDArray[np.float64], pairs: NDArray[np.int64], step: float, most: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Find groups of pixels between which there is no step.

    Parameters
    ----------
    heights
        Metres, shape ``(n,)``.
    pairs
        Numbers of pixels that touch each other, shape ``(2, m)``.
    step
        Metres that part two groups.
    most
        Pixels of a group that may be alone.

    Returns
    -------
    tuple
        The group of each pixel, shape ``(n,)``; and of each group, whether all pixels around it lie a step below it.
    """
    apart = np.abs(heights[pairs[0]] - heights[pairs[1]]) >= step
    joined = pairs[:, ~apart]
    links = coo_array((np.ones(joined.shape[1], bool), (joined[0], joined[1])), shape=(len(heights), len(heights)))
    count, group = connected_components(links, directed=False)
    one, two = pairs[:, apart]
    higher = np.where(heights[one] > heights[two], one, two)
    # Two pixels of one group may be as far apart, if a slope joins them: then it is no plain step.
    lower_of = np.bincount(group[one + two - higher], minlength=count)
    higher_of = np.bincount(group[higher], minlength=count)
    size = np.bincount(group, minlength=count)
    return group, (size <= most) & (lower_of == 0) & (higher_of >= _LEAST_AROUND)


def _neighbours(shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Return numbers of pixels that touch each other by a side or a corner, shape ``(2, n)``."""
    number = np.arange(shape[0] * shape[1]).reshape(shape)
    return np.concatenate(
        [
            np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()]),
            np.stack([number[:-1].ravel(), number[1:].ravel()]),
            np.stack([number[:-1, :-1].ravel(), number[1:, 1:].ravel()]),
            np.stack([number[:-1, 1:].ravel(), number[1:, :-1].ravel()]),
        ],
        axis=1,
    )


_LEAST = 10  # pixels; fewer are judged as outliers
_MOST_VALUES = 8  # repeated values that are looked at
_RING = 3  # pixels from a patch to the ground that it is held against: resampling mixes the two in between
_LEAST_RING = 8
_SEA_LEVEL = 2.0  # metres around 0: geoids differ
_NEARLY_ALL = 0.95
_MIXED = 0.8  # share of the step below which a pixel beside a void is a mixture
_MANY_MIXED = 0.1  # share of the pixels beside a void that are mixtures where all are left out
# What nearly all of the ring stands above the patch or below it, metres and times the distance between pixels: where
# the patch is left out, and where it is told of and kept. No lake has walls of 69 degrees along its whole shore. At 0
# there is the sea, with cliffs of 214 m over kilometres (Moher). Stacks and towers have a flat top on a coarse grid.
_LAKE = (100.0, 8.0), (100.0, 8.0)
_SEA = (250.0, 8.0), (30.0, 3.0)
_TOP = (300.0, 8.0), (100.0, 8.0)
_TOUCHING = np.ones((3, 3), bool)


@dataclass(frozen=True)
class Patch:
    """Pixels of one value in one piece.

    Attributes
    ----------
    row, column
        One of them, near the middle.
    value
        Their height, metres.
    pixels
        How many they are.
    step
        By how much the ground around is higher, metres, in the median; negative where it is lower.
    """

    row: int
    column: int
    value: float
    pixels: int
    step: float


def without_voids(heights: NDArray[np.float64], spacing: float) -> tuple[NDArray[np.float64], list[Patch], list[Patch]]:
    """Leave out patches of one value, 0 or another, that stand far above or below nearly everything around them.

    Files lose the word for no data when they are reprojected or cut; what is left is a number like any other. A patch
    of most of the grid is kept: then it is the rest that stands out, as islands do.

    Parameters
    ----------
    heights
        Metres on a grid, NaN where unknown, shape ``(rows, columns)``.
    spacing
        Distance between neighbours, metres.

    Returns
    -------
    tuple
        The heights, NaN where a patch was left out, also where resampling mixed it with the ground; the patches left
        out; and patches that may be a void, or a sea below cliffs or the top of a tower, and were kept.
    """
    voids: list[Patch] = []
    doubtful: list[Patch] = []
    known = int(np.isfinite(heights).sum())
    given = heights
    for value in _repeated_values(given, spacing):
        labels, _ = ndimage.label(given == value, _TOUCHING)
        sizes = np.bincount(labels.ravel())
        for number, box in enumerate(ndimage.find_objects(labels), 1):
            if not _LEAST <= sizes[number] <= known / 2:
                continue
            reach = tuple(slice(max(side.start - _RING, 0), side.stop + _RING) for side in box)
            patch = labels[reach] == number
            steps = _steps(given[reach], patch, value)
            if steps is None:
                continue
            places = np.argwhere(patch)
            middle = np.argmin(((places - places.mean(axis=0)) ** 2).sum(axis=1))
            row, column = places[middle].tolist()
            found = Patch(
                row + reach[0].start, column + reach[1].start, value, int(sizes[number]), float(np.median(steps))
            )
            left_out, told = _TOP if found.step < 0.0 else _SEA if abs(value) <= _SEA_LEVEL else _LAKE
            if _far(steps, left_out, spacing):
                heights = heights.copy() if heights is given else heights
                heights[reach][_with_mixed(given[reach], patch, value)] = np.nan
                voids.append(found)
            elif _far(steps, told, spacing):
                doubtful.append(found)
    return heights, voids, doubtful


def _repeated_values(heights: NDArray[np.float64], spacing: float) -> list[float]:
    """Return values that pixels beside a step have in common with a neighbour, the most frequent first."""
    least = max(_SEA[1][0], _SEA[1][1] * spacing) / _RING
    found = []
    for grid in (heights, heights.T):
        steep = np.abs(np.diff(grid, axis=0)) >= least  # NaN is not
        same = np.diff(grid, axis=1) == 0.0
        level = np.zeros(grid.shape, bool)
        level[:, 1:] |= same
        level[:, :-1] |= same
        found += [grid[:-1][steep & level[:-1]], grid[1:][steep & level[1:]]]
    values, counts = np.unique(np.concatenate(found), return_counts=True)
    order = np.argsort(-counts, kind="stable")[:_MOST_VALUES]
    return [float(value) for value in values[order]]


def _steps(heights: NDArray[np.float64], patch: NDArray[np.bool_], value: float) -> NDArray[np.float64] | None:
    """Return how much higher the ring around a patch is, metres; None where too little of it is known."""
    outside = ndimage.binary_dilation(patch, _TOUCHING, _RING) & ~ndimage.binary_dilation(patch, _TOUCHING, _RING - 1)
    steps = heights[outside] - value
    steps = steps[np.isfinite(steps)]
    return steps if len(steps) >= _LEAST_RING else None


def _far(steps: NDArray[np.float64], least: tuple[float, float], spacing: float) -> bool:
    """Whether nearly all of the ring is on one side, and so far."""
    bound = max(least[0], least[1] * spacing)
    return max(float(np.mean(steps >= bound)), float(np.mean(steps <= -bound))) >= _NEARLY_ALL


def _with_mixed(heights: NDArray[np.float64], patch: NDArray[np.bool_], value: float) -> NDArray[np.bool_]:
    """Return a patch, with all pixels beside it if many of them lie between it and the ground behind them."""
    away = np.where(np.isfinite(heights), np.abs(heights - value), 0.0)
    ground = ndimage.maximum_filter(away, 2 * _RING - 1)
    near = ndimage.binary_dilation(patch, _TOUCHING, _RING - 1)
    beside = near & ~patch & np.isfinite(heights)
    mixed = beside & (away < _MIXED * ground)
    return near if mixed.sum() > _MANY_MIXED * beside.sum() else patch


_LOWEST, _HIGHEST = -1000.0, 9000.0  # SRTM's void is -32768, others use -9999; no dry land lies under -430 m
_MOST_CUT = 100_000_000  # pixels
_MOST_POINTS = 160_000
FINEST = 2.0
"""Metres between points below which they are averaged: the terrain's own cells are 4 m."""


@dataclass(frozen=True)
class RasterCut:
    """The part of a raster around the window.

    Attributes
    ----------
    xy
        Its pixels' centres, metres, shape ``(rows, columns, 2)``.
    spacing
        Distance between neighbouring pixels, metres.
    outliers
        Latitude, longitude and metres of heights that no ground has, and that were left out.
    voids, doubtful
        Latitude and longitude of patches of one value: those left out as voids, and those that may be some.
    """

    path: Path
    raster: Raster
    to_raster: Transformer
    affine: NDArray[np.float64]
    heights: NDArray[np.float64]
    xy: NDArray[np.float64]
    spacing: float
    outliers: tuple[tuple[float, float, float], ...] = ()
    voids: tuple[tuple[float, float, Patch], ...] = ()
    doubtful: tuple[tuple[float, float, Patch], ...] = ()

    def _holds(self, pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
        # The outermost pixels reach half a pixel beyond their centres.
        size = np.array(self.heights.shape[::-1])
        return np.asarray(((pixels > -0.501) & (pixels < size - 0.499)).all(axis=1), np.bool_)

    def holds(self, frame: LocalFrame, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points lie on the raster, void or not."""
        lat, lon = frame.to_geodetic(xy)
        return self._holds(pixels_of(self.raster, self.to_raster, self.affine, lat, lon))

    def at(self, frame: LocalFrame, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights at points, bilinear; NaN off the raster and where it is void."""
        lat, lon = frame.to_geodetic(xy)
        pixels = pixels_of(self.raster, self.to_raster, self.affine, lat, lon)
        rows, columns = self.heights.shape
        on = self._holds(pixels)
        place = np.where(on[:, None], pixels, 0.0)
        low = np.clip(np.floor(place + 1e-6).astype(int), 0, np.maximum(np.array([columns, rows]) - 2, 0))
        part = place - low  # linear beyond the outermost centres, too
        part[np.abs(part) < 1e-6] = 0.0
        part[np.abs(part - 1.0) < 1e-6] = 1.0
        total = np.zeros(len(xy))
        for across, x_weight in ((0, 1.0 - part[:, 0]), (1, part[:, 0])):
            for down, y_weight in ((0, 1.0 - part[:, 1]), (1, part[:, 1])):
                weight = x_weight * y_weight
                row, column = np.minimum(low[:, 1] + down, rows - 1), np.minimum(low[:, 0] + across, columns - 1)
                total += np.where(weight != 0.0, weight * self.heights[row, column], 0.0)
        return np.where(on, total, np.nan)


def pixels_of(
    raster: Raster,
    to_raster: Transformer,
    affine: NDArray[np.float64],
    lat: NDArray[np.float64],
    lon: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Columns and rows of geodetic points, shape ``(n, 2)``."""
    x, y = to_raster.transform(lon, lat)
    if raster.crs.is_geographic:
        # A raster may count longitudes from 0 to 360, and a window may lie over the date line.
        middle = raster.affine[0] @ np.array([raster.pixels.shape[1] / 2, raster.pixels.shape[0] / 2, 1.0])
        x = x + 360.0 * np.round((middle - x) / 360.0)
    inverse = np.linalg.inv(affine[:, :2])
    return (np.stack([x, y], axis=1) - affine[:, 2]) @ inverse.T


def cut_of(path: Path, raster: Raster, frame: LocalFrame, reach: float) -> RasterCut | None:
    """Return the part of a raster that lies in the window, its heights checked; None where there is none."""
    to_raster = Transformer.from_crs("EPSG:4326", raster.crs, always_xy=True)
    side = np.linspace(-reach, reach, 9)
    lat, lon = frame.to_geodetic(np.array([(x, y) for x in side for y in side]))
    pixels = pixels_of(raster, to_raster, raster.affine, lat, lon)
    if not np.isfinite(pixels).all() or np.abs(pixels).max() > 1e9:
        return None
    rows, columns = raster.pixels.shape
    c0, r0 = np.maximum(np.floor(pixels.min(0)).astype(int) - 2, 0).tolist()
    c1, r1 = np.minimum(np.ceil(pixels.max(0)).astype(int) + 3, [columns, rows]).tolist()
    if c0 >= c1 or r0 >= r1:
        return None
    if (r1 - r0) * (c1 - c0) > _MOST_CUT:
        raise SchemaError(f"{path}: {c1 - c0} x {r1 - r0} pixels in the window are too many; save it anew, coarser")
    try:
        heights = raster.pixels.read(r0, r1, c0, c1)
    except SchemaError:
        raise
    except Exception as error:  # the unpackers meet broken blocks with errors of many kinds
        words = " ".join(str(error).split())[:200]
        raise SchemaError(f"{path}: broken data ({type(error).__name__}: {words}); download it again") from None
    with np.errstate(invalid="ignore"):
        heights[~((heights > _LOWEST) & (heights < _HIGHEST))] = np.nan
    affine = raster.affine.copy()
    affine[:, 2] += affine[:, :2] @ np.array([c0, r0])
    xy = _centres(frame, to_raster, affine, heights.shape)
    spacing = _spacing(xy, path)
    heights, *patches = without_voids(heights, spacing)
    heights, odd = without_outliers(heights, spacing)

    def degrees(row: int, column: int) -> tuple[float, float]:
        lat, lon = frame.to_geodetic(xy[row, column])
        return float(lat), float(lon)

    outliers = tuple((*degrees(row, column), height) for row, column, height in odd)
    voids, doubtful = (tuple((*degrees(patch.row, patch.column), patch) for patch in some) for some in patches)
    # Finer than the terrain can show, or too many to fit: averaged in blocks.
    step = max(round(FINEST / spacing), math.ceil(math.sqrt(heights.size / _MOST_POINTS)), 1)
    if step > 1 and min(heights.shape) >= 2 * step:
        heights = _block_means(heights, step)
        affine[:, 2] += affine[:, :2] @ np.full(2, (step - 1) / 2)
        affine[:, :2] *= step
        xy = _centres(frame, to_raster, affine, heights.shape)
        spacing = _spacing(xy, path)
    return RasterCut(path, raster, to_raster, affine, heights, xy, spacing, outliers, voids, doubtful)


def _centres(
    frame: LocalFrame, to_raster: Transformer, affine: NDArray[np.float64], shape: tuple[int, ...]
) -> NDArray[np.float64]:
    grid = np.stack(np.meshgrid(np.arange(shape[1]), np.arange(shape[0])), axis=-1).reshape(-1, 2)
    places = grid @ affine[:, :2].T + affine[:, 2]
    lon, lat = to_raster.transform(places[:, 0], places[:, 1], direction="INVERSE")
    return frame.to_enu(lat, lon).reshape(shape[0], shape[1], 2)


def _spacing(xy: NDArray[np.float64], path: Path) -> float:
    """Distance between neighbouring pixels, metres."""
    if not np.isfinite(xy).all():
        raise SchemaError(f"{path}: some of its pixels lie nowhere on Earth; check its georeferencing")
    steps = [np.hypot(*np.diff(xy, axis=axis).reshape(-1, 2).T) for axis in (0, 1)]
    medians = [float(np.median(step)) for step in steps if len(step)]
    spacing = max(medians, default=0.0)
    if not (math.isfinite(spacing) and spacing > 1e-3):
        raise SchemaError(f"{path}: its pixels have no extent here ({spacing:g} m); check its georeferencing")
    return spacing


def _block_means(heights: NDArray[np.float64], step: int) -> NDArray[np.float64]:
    rows, columns = heights.shape[0] // step, heights.shape[1] // step
    blocks = heights[: rows * step, : columns * step].reshape(rows, step, columns, step)
    known = np.isfinite(blocks)
    count = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0.0).sum(axis=(1, 3))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
