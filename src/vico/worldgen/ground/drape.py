"""Polygons laid on the ground: cut where the ground bends, so that few triangles stay close to the height field."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import mapbox_earcut
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.geometry import distances
from vico.world.heights import HeightField
from vico.world.mesh import quad_triangles
from vico.worldgen.ground.halving import halved
from vico.worldgen.ground.kerbs import filled

Floats = NDArray[np.float64]

#: Heights at points, shape ``(n, 2)`` -> ``(n,)``.
Heights = Callable[[Floats], Floats]

CLOSE, NEAR, ROUGH = 0.03, 0.15, 2.5
"""Metres by which the middle of an uncut square may lie off its heights: of streets, of other ground, out of sight."""

_USUAL = 1.75  # metres: cells where the field has none
_WIDEST = 14.0  # metres: vertices carry the large patches of colour
_DRAWN_LOW = 1.0  # metres beyond a carriageway's border at which its height may count


@dataclass(frozen=True)
class Grid:
    """Squares of sides ``finest * 2**level`` from the corner ``(low, low)`` on, and which of them need no cutting."""

    low: float
    side: float
    even: list[NDArray[np.bool_]]

    @classmethod
    def of(
        cls,
        field: HeightField,
        reach: float,
        tolerance: float,
        *,
        exact: Sequence[BaseGeometry] = (),
        sunken: Sequence[BaseGeometry] = (),
        free: Sequence[BaseGeometry] = (),
    ) -> Grid:
        """Find where heights are as good as planar, on squares that halve or double the field's own.

        Parameters
        ----------
        field
            The ground; its smooth part bends only along the borders of its cells.
        reach
            Half the side of what is to be cut, metres.
        tolerance
            Metres, where nothing else is said.
        exact
            Where `CLOSE` is; within `sunken` the lower side of the field counts, elsewhere the upper.
        free
            Where heights don't matter.
        """
        cell = field.cell if field.heights.shape[0] > 2 else _USUAL
        low = -field.half + cell * math.floor(max(field.half - reach, 0.0) / cell)
        depth = max(math.ceil(math.log2(2 * -low / cell)), 0) + 1
        n, side = 2**depth, cell * 2 ** (depth - 1)
        fine = side / n
        axis = np.linspace(low, low + side, n + 1)
        at = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
        smooth = field.smooth(at).reshape(n + 1, n + 1)
        drawn = smooth
        if len(exact):
            drawn = field.upper(at).reshape(n + 1, n + 1)
        most = np.full((n, n), tolerance)
        for areas, own in ((free, np.inf), (exact, CLOSE)):
            # Squares are judged by their middles: a free one lies well within, an exact one may only touch.
            most[_within(areas, -1.5 * fine if own > tolerance else 0.8 * fine, n, low, fine)] = own
        even = [np.ones((n, n), bool)]
        sides = [(drawn, most)] if np.isfinite(tolerance) else []
        if len(sunken):
            here = _within(sunken, _DRAWN_LOW, n, low, fine)
            sides.append((field.lower(at).reshape(n + 1, n + 1), np.where(here, CLOSE, np.inf)))
        for level in range(1, depth + 1):
            size = 2**level
            below = even[-1]
            calm = below[::2, ::2] & below[1::2, ::2] & below[::2, 1::2] & below[1::2, 1::2]
            for k, (whole, least) in enumerate(sides):
                least = np.minimum(
                    np.minimum(least[::2, ::2], least[1::2, ::2]), np.minimum(least[::2, 1::2], least[1::2, 1::2])
                )
                sides[k] = (whole, least)
                calm &= _off(whole - smooth if level == 1 else whole, size) <= least
            even.append(calm)
        return cls(low, side, even)

    def cut(self, shapes: Iterable[BaseGeometry]) -> list[Polygon]:
        """Cut polygons along the squares as far as the heights ask for."""
        return self.cut_each([shapes])[0]

    def cut_each(self, lots: Sequence[Iterable[BaseGeometry]]) -> list[list[Polygon]]:
        """Cut several lots of polygons, each by itself."""
        depth = len(self.even) - 1
        own = [[polygon for shape in shapes for polygon in polygons_of(shape, 1e-4)] for shapes in lots]
        polygons = np.array([polygon for lot in own for polygon in lot], object)
        lot = np.repeat(np.arange(len(own)), [len(lot) for lot in own])
        place = np.zeros((len(polygons), 2), np.int64)
        done: list[tuple[NDArray[np.object_], NDArray[np.int64]]] = []
        for level in range(depth, -1, -1):
            side = self.side / 2 ** (depth - level)
            whole = self.even[level][place[:, 1], place[:, 0]] & ((side <= _WIDEST) | (level == 0))
            done.append((polygons[whole], lot[whole]))
            polygons, place, lot = polygons[~whole], place[~whole], lot[~whole]
            if level == 0 or not len(polygons):
                break
            for axis in (0, 1):
                polygons, place, lot = self._halved(polygons, place, lot, axis, side)
        every, owner = (np.concatenate(parts) for parts in zip(*done, strict=True))
        return [every[owner == number].tolist() for number in range(len(own))]

    def _halved(
        self, polygons: NDArray[np.object_], place: NDArray[np.int64], lot: NDArray[np.int64], axis: int, side: float
    ) -> tuple[NDArray[np.object_], NDArray[np.int64], NDArray[np.int64]]:
        """Part polygons at the middles of their squares; along the second axis the columns are halved already."""
        middle = np.asarray(self.low + (place[:, axis] + 0.5) * side, np.float64)
        box = shapely.bounds(polygons)
        below, beyond = box[:, 2 + axis] <= middle + 1e-9, box[:, axis] >= middle - 1e-9
        both = np.flatnonzero(~(below | beyond))
        pieces, upper = [polygons[below], polygons[beyond & ~below]], (0, 1, 0, 1)
        origin = [np.flatnonzero(below), np.flatnonzero(beyond & ~below)]
        for clipped in halved(polygons[both], middle[both], axis):
            parts, owner = shapely.get_parts(clipped, return_index=True)
            kept = (shapely.get_type_id(parts) == 3) & (shapely.area(parts) > 1e-4)
            pieces.append(parts[kept])
            origin.append(both[owner[kept]])
        every = np.concatenate(origin)
        new = place[every]
        new[:, axis] = 2 * new[:, axis] + np.repeat(upper, [len(part) for part in pieces])
        return np.concatenate(pieces), new, lot[every]


def _within(areas: Sequence[BaseGeometry], grown: float, n: int, low: float, cell: float) -> NDArray[np.bool_]:
    """Which of a grid's squares have their middles within areas that are grown (or shrunk)."""
    shapes = overlay.buffer(np.array(list(areas), object), grown, quad_segs=1)
    return filled([polygon for shape in shapes for polygon in polygons_of(shape)], n, -(low + cell / 2), cell)


def _off(z: Floats, size: int) -> Floats:
    """How far the middles of squares and of their sides lie off what their corners say, metres."""
    half = size // 2
    corner, mid = z[::size, ::size], z[half::size, half::size]
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    across, up = z[::size, half::size], z[half::size, ::size]
    off = np.maximum(np.abs(mid - (a + b + c + d) / 4), np.abs(a + d - b - c) / 4)
    for found, expected in (
        (across[:-1], (a + b) / 2),
        (across[1:], (c + d) / 2),
        (up[:, :-1], (a + c) / 2),
        (up[:, 1:], (b + d) / 2),
    ):
        off = np.maximum(off, np.abs(found - expected))
    return np.asarray(off)


def triangulated(polygons: Sequence[Polygon]) -> tuple[Floats, NDArray[np.int64]]:
    """Corners, shape ``(n, 2)``, and triangles, counter-clockwise from above, shape ``(m, 3)``, of polygons."""
    if not len(polygons):
        return np.zeros((0, 2)), np.zeros((0, 3), np.int64)
    every = np.array(polygons, object)
    rings, owner = shapely.get_rings(every, return_index=True)
    coordinates, ring = shapely.get_coordinates(rings, return_index=True)
    # Rings end where they begin: the doubled point goes.
    last = np.r_[ring[1:] != ring[:-1], True]
    flat, ring = coordinates[~last], ring[~last]
    size = np.bincount(ring, minlength=len(rings))
    ring_end = np.cumsum(size)
    ring_start = ring_end - size
    first_ring = np.searchsorted(owner, np.arange(len(every)))
    last_ring = np.searchsorted(owner, np.arange(len(every)), "right") - 1
    simple = first_ring == last_ring
    corners = size[first_ring]
    three = ring_start[first_ring[simple & (corners == 3)]]
    triangles: list[NDArray[np.int64]] = [three[:, None] + np.arange(3)]
    fours = np.flatnonzero(simple & (corners == 4))
    start = ring_start[first_ring[fours]]
    quad = flat[start[:, None] + np.arange(4)]
    edge = np.roll(quad, -1, axis=1) - quad
    after = np.roll(edge, -1, axis=1)
    turn = edge[..., 0] * after[..., 1] - edge[..., 1] * after[..., 0]
    convex = (turn > 1e-9).all(axis=1) | (turn < -1e-9).all(axis=1)
    start = start[convex]
    triangles.append(quad_triangles(start, by_halves=True))
    rest = np.ones(len(every), bool)
    rest[simple & (corners == 3)] = False
    rest[fours[convex]] = False
    for k in np.flatnonzero(rest).tolist():
        a, b = int(ring_start[first_ring[k]]), int(ring_end[last_ring[k]])
        ends = (ring_end[first_ring[k] : last_ring[k] + 1] - a).astype(np.uint32)
        triangles.append(mapbox_earcut.triangulate_float64(flat[a:b], ends).reshape(-1, 3).astype(np.int64) + a)
    faces = np.concatenate(triangles)
    ux, uy = (flat[faces[:, 1]] - flat[faces[:, 0]]).T
    vx, vy = (flat[faces[:, 2]] - flat[faces[:, 0]]).T
    turn = ux * vy - uy * vx
    return flat, np.where((turn < 0)[:, None], faces[:, [0, 2, 1]], faces)[np.abs(turn) > 1e-9]


@dataclass(frozen=True)
class Curtain:
    """Upright faces along lines.

    Attributes
    ----------
    positions, normals
        Metres, shape ``(4 n, 3)``; the faces look to the right of the lines.
    uv
        Metres along the line and up, shape ``(4 n, 2)``.
    triangles
        Shape ``(2 n, 3)``.
    """

    positions: Floats
    normals: Floats
    uv: Floats
    triangles: NDArray[np.int64]


def curtain(lines: Sequence[BaseGeometry], bottom: Heights, top: Heights, *, least: float = 0.01) -> Curtain:
    """Hang faces between two heights along lines (whose points are taken as they are)."""
    points, line = shapely.get_coordinates(list(lines), return_index=True)
    first = np.flatnonzero(line[:-1] == line[1:]) if len(line) else np.zeros(0, np.int64)
    a, b = points[first], points[first + 1]
    length = distances(b, a)
    along = np.cumsum(length) - length
    low = np.stack([bottom(a), bottom(b)], axis=1) if len(first) else np.zeros((0, 2))
    high = np.stack([top(a), top(b)], axis=1) if len(first) else np.zeros((0, 2))
    kept = ((high - low).max(axis=1) > least) & (length > 1e-6)
    a, b, low, length, along = a[kept], b[kept], low[kept], length[kept], along[kept]
    high = np.maximum(high[kept], low)
    n = len(a)
    positions = np.empty((n, 4, 3))
    positions[:, 0, :2] = positions[:, 3, :2] = a
    positions[:, 1, :2] = positions[:, 2, :2] = b
    positions[:, 0, 2], positions[:, 1, 2] = low.T
    positions[:, 3, 2], positions[:, 2, 2] = high.T
    right = np.stack([(b - a)[:, 1], -(b - a)[:, 0], np.zeros(n)], axis=1) / np.maximum(length, 1e-9)[:, None]
    uv = np.stack(
        [np.stack([along, along + length, along + length, along], axis=1), positions[..., 2]], axis=-1
    ).reshape(-1, 2)
    # Seen from the right of a line, its start lies at the right hand.
    triangles = quad_triangles(4 * np.arange(n), by_halves=True)
    return Curtain(positions.reshape(-1, 3), np.repeat(right, 4, axis=0), uv, triangles)
