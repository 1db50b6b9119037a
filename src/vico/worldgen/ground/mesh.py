"""Meshes of the ground: polygons draped on heights, joined without cracks, and upright faces between them.

Polygons are cut where the ground bends, so that few triangles stay close to the height field. Triangles of neighbouring
pieces get each other's corners, so that no crack opens between them. Where two kinds of ground meet at different
heights an upright face hangs from the line between them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

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
from vico.world.mesh import Surface, quad_triangles
from vico.worldgen.ground.kerbs_and_banks import nodes_in_polygons
from vico.worldgen.ground.pavings import GroundStyle, ground_material, vertex_colours
from vico.worldgen.ground.polygons import split_polygons

Floats = NDArray[np.float64]

#: Heights at points, shape ``(n, 2)`` -> ``(n,)``.
Heights = Callable[[Floats], Floats]

# Metres by which the middle of an uncut square may lie off its heights.
CLOSE = 0.03  # of streets
NEAR = 0.15  # of other ground
ROUGH = 2.5  # out of sight

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
                polygons, place, lot = self._halve(polygons, place, lot, axis, side)
        every, owner = (np.concatenate(parts) for parts in zip(*done, strict=True))
        return [every[owner == number].tolist() for number in range(len(own))]

    def _halve(
        self, polygons: NDArray[np.object_], place: NDArray[np.int64], lot: NDArray[np.int64], axis: int, side: float
    ) -> tuple[NDArray[np.object_], NDArray[np.int64], NDArray[np.int64]]:
        """Part polygons at the middles of their squares; along the second axis the columns are halved already."""
        middle = np.asarray(self.low + (place[:, axis] + 0.5) * side, np.float64)
        box = shapely.bounds(polygons)
        below, beyond = box[:, 2 + axis] <= middle + 1e-9, box[:, axis] >= middle - 1e-9
        both = np.flatnonzero(~(below | beyond))
        pieces, upper = [polygons[below], polygons[beyond & ~below]], (0, 1, 0, 1)
        origin = [np.flatnonzero(below), np.flatnonzero(beyond & ~below)]
        for clipped in split_polygons(polygons[both], middle[both], axis):
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
    return nodes_in_polygons(
        [polygon for shape in shapes for polygon in polygons_of(shape)], n, -(low + cell / 2), cell
    )


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


def triangulate(polygons: Sequence[Polygon]) -> tuple[Floats, NDArray[np.int64]]:
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


Ints = NDArray[np.int64]

_WELD = 1000.0  # corners within a millimetre are one
_ON_EDGE = 0.0015  # metres from an edge within which a corner lies on it


@dataclass(frozen=True)
class PlanMesh:
    """Triangles in plan that share their corners.

    Attributes
    ----------
    corners
        Metres, shape ``(n, 2)``.
    triangles
        Counter-clockwise, shape ``(m, 3)``.
    piece
        The piece each triangle belongs to, shape ``(m,)``.
    """

    corners: Floats
    triangles: Ints
    piece: Ints

    def border(self, pieces: Ints, outline: BaseGeometry) -> Ints:
        """Edges of some pieces that lie on an outline, the pieces to their left, shape ``(k, 2)``."""
        mine = _edges(self.triangles[np.isin(self.piece, pieces)])
        mine = mine[~np.isin(_keys(mine), _keys(mine[:, ::-1]))]
        lines, line = shapely.get_coordinates(shapely.get_parts(shapely.get_parts([outline])), return_index=True)
        if not len(mine) or not len(line):
            return mine[:0]
        first = np.flatnonzero(line[1:] == line[:-1])
        tree = shapely.STRtree(shapely.linestrings(np.stack([lines[first], lines[first + 1]], axis=1)))
        middle = shapely.points(self.corners[mine].mean(axis=1))
        return mine[np.unique(tree.query(middle, predicate="dwithin", distance=2 * _ON_EDGE)[0])]


def conforming_mesh(parts: list[tuple[Floats, Ints]], extra: Floats | None = None) -> PlanMesh:
    """Join triangulated pieces that lie side by side.

    Parameters
    ----------
    parts
        Corners and triangles of each piece; the pieces don't overlap.
    extra
        Further points that edges on pieces' borders are to be parted at, shape ``(n, 2)``.

    Returns
    -------
    PlanMesh
        Where a corner of one triangle lies on another's edge, that one is parted there.
    """
    offsets = np.cumsum([0, *(len(flat) for flat, _ in parts)])
    flat = np.concatenate([flat for flat, _ in parts]) if parts else np.zeros((0, 2))
    faces = [np.asarray(faces, np.int64) + start for (_, faces), start in zip(parts, offsets[:-1], strict=True)]
    triangles = np.concatenate(faces) if faces else np.zeros((0, 3), np.int64)
    piece = np.repeat(np.arange(len(parts)), [len(own) for own in faces]) if faces else np.zeros(0, np.int64)
    if extra is not None:
        flat = np.concatenate([flat, extra])
    grid = np.round(flat * _WELD).astype(np.int64)
    order = np.lexsort((grid[:, 1], grid[:, 0]))
    fresh = np.r_[True, (np.diff(grid[order], axis=0) != 0).any(axis=1)] if len(order) else np.zeros(0, bool)
    number = np.empty(len(flat), np.int64)
    number[order] = np.cumsum(fresh) - 1
    corners = flat[order[fresh]]
    triangles = number[triangles]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    triangles, piece = triangles[whole], piece[whole]
    added = number[len(flat) - len(extra) :] if extra is not None else np.zeros(0, np.int64)
    triangles, piece = _split_triangles(corners, triangles, piece, added)
    turn = _turn(corners, triangles)
    kept = turn > 1e-9
    return PlanMesh(corners, triangles[kept], piece[kept])


def _turn(corners: Floats, triangles: Ints) -> Floats:
    """Twice the areas of triangles."""
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    return np.asarray((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def _edges(triangles: Ints) -> Ints:
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def _keys(edges: Ints) -> Ints:
    return np.asarray(edges[:, 0] << 32 | edges[:, 1])


def _split_triangles(corners: Floats, triangles: Ints, piece: Ints, added: Ints) -> tuple[Ints, Ints]:
    """Part triangles at corners that lie on their edges."""
    edges = _edges(triangles)
    alone = edges[~np.isin(_keys(edges), _keys(edges[:, ::-1]))]
    ends = np.unique(np.r_[alone.ravel(), added])
    if not len(alone):
        return triangles, piece
    tree = shapely.STRtree(shapely.points(corners[ends]))
    edge, point = tree.query(shapely.linestrings(corners[alone]), predicate="dwithin", distance=_ON_EDGE)
    point = ends[point]
    a, b = corners[alone[edge, 0]], corners[alone[edge, 1]]
    along = ((corners[point] - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1)
    margin = 0.5 / _WELD / distances(b, a)
    inside = (along > margin) & (along < 1.0 - margin) & (point != alone[edge, 0]) & (point != alone[edge, 1])
    edge, point, along = edge[inside], point[inside], along[inside]
    order = np.lexsort((along, edge))
    edge, point = edge[order], point[order]
    # Edges with corners on them, and where their corners begin in `point`.
    busy, start, count = np.unique(edge, return_index=True, return_counts=True)
    keys = _keys(alone[busy])
    by_key = np.argsort(keys)
    keys, start, count = keys[by_key], start[by_key], count[by_key]
    for _ in range(3):
        if not len(keys):
            break
        own = np.stack([_keys(triangles[:, [k, (k + 1) % 3]]) for k in range(3)], axis=1)
        place = np.minimum(np.searchsorted(keys, own), len(keys) - 1)
        hit = keys[place] == own
        chosen = np.flatnonzero(hit.any(axis=1))
        if not len(chosen):
            break
        side = hit[chosen].argmax(axis=1)
        turned = triangles[chosen[:, None], (side[:, None] + np.arange(3)) % 3]
        which = place[chosen, side]
        pieces = count[which] + 1
        row = np.repeat(np.arange(len(chosen)), pieces)
        step = np.arange(len(row)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        at = start[which][row] + step
        first = np.where(step == 0, turned[row, 0], point[np.maximum(at - 1, 0)])
        last = np.where(step == pieces[row] - 1, turned[row, 1], point[np.minimum(at, len(point) - 1)])
        fan = np.stack([first, last, turned[row, 2]], axis=1)
        rest = np.ones(len(triangles), bool)
        rest[chosen] = False
        triangles = np.concatenate([triangles[rest], fan])
        piece = np.concatenate([piece[rest], piece[chosen][row]])
    return triangles, piece


_LONG = 12.0  # metres between points of a straight line


def curtain_surface(found: Curtain, look: GroundStyle, tile: float | None = None) -> list[Surface]:
    """Return the surface of a curtain in a style, none if it is empty."""
    if not len(found.triangles):
        return []
    return [
        Surface.from_triangles(
            found.positions,
            found.triangles,
            colour=vertex_colours(look, found.positions[:, :2]),
            entity=look.entity,
            uv=found.uv / (tile or look.tile),
            normals=found.normals,
            material=ground_material(look.material),
        )
    ]


def oriented_outlines(
    shapes: Iterable[BaseGeometry], low: Heights, high: Heights, spacing: float
) -> list[BaseGeometry]:
    """Outlines with the inside to their right, with as many points as their heights need."""
    rings = [
        ring
        for shape in shapes
        for polygon in polygons_of(shape, 0.05)
        for ring in (polygon.normalize().exterior, *polygon.normalize().interiors)
    ]
    if not rings:
        return []
    dense = shapely.segmentize(np.array(rings, object), spacing)
    points, owner = shapely.get_coordinates(dense, return_index=True)
    corner = np.zeros(len(points), bool)
    own = shapely.get_coordinates(rings)
    # Points of the rings themselves stay; of those between only where heights bend, and every few metres.
    keys = {(round(x, 6), round(y, 6)) for x, y in own.tolist()}
    corner[:] = [(round(x, 6), round(y, 6)) in keys for x, y in points.tolist()]
    bend = np.zeros(len(points))
    for heights in (low, high):
        z = heights(points)
        bend[1:-1] = np.maximum(bend[1:-1], np.abs(z[:-2] - 2 * z[1:-1] + z[2:]))
    kept = corner | (bend > 0.002)
    kept[1:] |= bend[:-1] > 0.002
    kept[:-1] |= bend[1:] > 0.002
    kept |= np.arange(len(points)) % max(round(_LONG / spacing), 1) == 0
    lines = []
    borders = [0, *(np.flatnonzero(owner[1:] != owner[:-1]) + 1).tolist(), len(owner)]
    for start, end in pairwise(borders):
        chosen = points[start:end][kept[start:end]]
        if len(chosen) > 1:
            lines.append(shapely.LineString(chosen))
    return lines


def border_chains(plan: PlanMesh, edges: NDArray[np.int64], reach: float) -> list[BaseGeometry]:
    """Edges of the plan joined to lines; those on the rim of what is drawn are left out."""
    pieces = plan.corners[edges]
    rim = np.abs(pieces).max(axis=2).min(axis=1) > reach - 0.01
    if rim.all():
        return []
    lines = shapely.multilinestrings([shapely.linestrings(pieces[~rim])])[0]
    return list(shapely.get_parts(shapely.line_merge(lines, directed=True)))


def lowered_heights(heights: Heights, depth: float) -> Heights:
    """Return heights that lie so many metres below others."""
    return lambda xy: heights(xy) - depth


def split_by_area(lines: Sequence[BaseGeometry], area: BaseGeometry) -> tuple[list[BaseGeometry], list[BaseGeometry]]:
    """Segments of lines that lie within an area, and the rest; directions kept."""
    if not len(lines):
        return [], []
    points, line = shapely.get_coordinates(list(lines), return_index=True)
    first = np.flatnonzero(line[:-1] == line[1:])
    shapely.prepare(area)
    inside = np.ones(len(first), bool)
    for share in (0.0, 0.5, 1.0):
        at = points[first] + share * (points[first + 1] - points[first])
        inside &= shapely.contains_xy(area, at[:, 0], at[:, 1])
    pieces = np.stack([points[first], points[first + 1]], axis=1)
    return list(shapely.linestrings(pieces[inside])), list(shapely.linestrings(pieces[~inside]))
