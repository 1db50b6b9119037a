"""Roofs: which shapes there are, the prisms that all of them are cut from, and measured roofs as cells under planes.

The surfaces of a city model nearly fit: edges that should be one lie millimetres apart, corners of one lie on an edge
of another. So all outlines are cut by each other on a grid. Every cell of what comes out lies under one surface (the
highest of several; the nearest where there is none), cells share their corners exactly, and the corners' heights are
made one where they nearly agree. The solid is the union of prisms over the cells: closed, whatever the model was.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import manifold3d
import mapbox_earcut
import numpy as np
import shapely
from manifold3d import CrossSection, Error, Manifold, Mesh64, OpType
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.geo.buildings import RoofFacet
from vico.geo.overlay import OverlayError

SHAPES = (
    "flat",
    "gabled",
    "hipped",
    "half-hipped",
    "side_hipped",
    "side_half-hipped",
    "hipped-and-gabled",
    "pyramidal",
    "skillion",
    "mansard",
    "gambrel",
    "saltbox",
    "double_saltbox",
    "quadruple_saltbox",
    "crosspitched",
    "gabled_row",
    "sawtooth",
    "butterfly",
    "round",
    "dome",
    "onion",
)

# Other names that are in use, and the shape each stands for.
_NAMES = {
    "cone": "pyramidal",
    "conical": "pyramidal",
    "spire": "pyramidal",
    "helm": "pyramidal",
    "pyramid": "pyramidal",
    "tented": "pyramidal",
    "lean_to": "skillion",
    "lean-to": "skillion",
    "shed": "skillion",
    "pent": "skillion",
    "monopitch": "skillion",
    "single_pitched": "skillion",
    "barrel": "round",
    "barrel_vault": "round",
    "arched": "round",
    "curved": "round",
    "vaulted": "round",
    "gable": "gabled",
    "pitched": "gabled",
    "hip": "hipped",
    "half_hipped": "half-hipped",
    "half-hip": "half-hipped",
    "jerkinhead": "half-hipped",
    "side_halfhipped": "side_half-hipped",
    "side_half_hipped": "side_half-hipped",
    "gablet": "hipped-and-gabled",
    "dutch_gabled": "hipped-and-gabled",
    "hipped_and_gabled": "hipped-and-gabled",
    "cross_gabled": "crosspitched",
    "cross-gabled": "crosspitched",
    "cross_pitched": "crosspitched",
    "gabled_height_moved": "saltbox",
    "m-shaped": "gabled_row",
    "multi_gabled": "gabled_row",
    "saw_tooth": "sawtooth",
    "saw-tooth": "sawtooth",
    "v-shaped": "butterfly",
    "terrace": "flat",
    "dome-shaped": "dome",
    "spherical": "dome",
    "bulbous": "onion",
    "double_pitched_mansard": "mansard",
}


def shape_named(tag: str | None) -> str | None:
    """Name the roof shape built for a `roof:shape` tag; None where the tag is absent or says nothing usable."""
    if not tag:
        return None
    text = tag.split(";")[0].strip().lower().replace(" ", "_")
    return text if text in SHAPES else _NAMES.get(text)


@dataclass(frozen=True)
class Roof:
    """A roof over an outline.

    Attributes
    ----------
    shape
        One of `SHAPES`.
    height
        From the eaves to the highest point, metres; for a flat roof the parapet's height (0: none).
    direction
        Skillion: yaw towards which it falls, radians. Ridged roofs: yaw of the ridge; None: along the longer side.
        One-sided hips and saltboxes: the ridge's yaw points to the hip; the long slope lies left of it.
    facets
        The surfaces of a measured roof, heights above the eaves; `shape` is then the nearest that has a name.
    """

    shape: str
    height: float
    direction: float | None = None
    facets: tuple[RoofFacet, ...] = ()

    def transform(self, move: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Roof:
        """Return the roof over an outline that was moved, and perhaps scaled, by `move` (points, shape ``(n, 2)``)."""
        if not self.facets:
            return self
        return replace(self, facets=tuple(_transform_facet(facet, move) for facet in self.facets))

    def with_height(self, height: float) -> Roof:
        """Return the roof with another height, metres; a measured one is stretched."""
        if not self.facets or self.height <= 0.0:
            return replace(self, height=height)
        share = height / self.height
        stretched = tuple(
            RoofFacet(facet.polygon, (c * share, gx * share, gy * share))
            for facet in self.facets
            for c, gx, gy in (facet.plane,)
        )
        return replace(self, height=height, facets=stretched)


def _transform_facet(facet: RoofFacet, move: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> RoofFacet:
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]) + np.asarray(facet.polygon.centroid.coords[0])
    level = facet.height(corners)
    east, north = move(corners)[1:] - move(corners)[:1]
    turn = np.array([east, north])
    gx, gy = np.linalg.solve(turn, level[1:] - level[:1])
    x, y = move(corners)[0]
    return RoofFacet(shapely.transform(facet.polygon, move), (float(level[0] - gx * x - gy * y), float(gx), float(gy)))


def rings_of(polygon: Polygon) -> list[NDArray[np.float64]]:
    """Outer ring counter-clockwise, holes clockwise, not closed, each shape ``(n, 2)``."""
    oriented = shapely.orient_polygons(polygon)
    return [np.asarray(ring.coords)[:-1, :2] for ring in (oriented.exterior, *oriented.interiors)]


def prism(rings: list[NDArray[np.float64]], low: float, high: float) -> Manifold:
    """Extrude an outline between two heights."""
    return CrossSection(rings, manifold3d.FillRule.Positive).extrude(high - low).translate((0.0, 0.0, low))


def inradius(polygon: Polygon) -> float:
    """Distance from the outline to the point inside that is farthest from it, metres."""
    return float(shapely.length(shapely.maximum_inscribed_circle(polygon, tolerance=0.05)))


_GRID = 0.01  # metres
_SNAP = 0.04  # metres within which a surface's corners are moved onto the outline
_SPECK = 0.003  # square metres: cells that are left between edges that should be one
_SAME = 0.12  # metres of height between corners that are one
_MOST_CELLS = 4000


@dataclass(frozen=True)
class RoofCell:
    """A part of an outline under one surface of the roof.

    Attributes
    ----------
    polygon
        Metres; its corners are those of its neighbours where they touch.
    facet
        Which of the surfaces it lies under.
    heights
        Of the corners of its rings, as `rings_of` gives them, in the facets' own height; one array a ring.
    """

    polygon: Polygon
    facet: int
    heights: tuple[NDArray[np.float64], ...]


def roof_cells(outline: Polygon, facets: Sequence[RoofFacet]) -> list[RoofCell]:
    """Divide an outline by the surfaces of its roof.

    Raises
    ------
    OverlayError
        If the engine refuses the outlines, or they are too many.
    """
    reach = overlay.buffer(outline, 1.0)
    near = [k for k, facet in enumerate(facets) if facet.polygon.intersects(reach)]
    if not near:
        raise OverlayError("no surface of its roof lies over its outline")
    shapes = [shapely.snap(facets[k].polygon, outline, _SNAP) for k in near]
    faces = overlay.faces_between([outline.boundary, *(shape.boundary for shape in shapes)], grid=_GRID)
    shapely.prepare(outline)
    faces = [face for face in faces if outline.contains(face.representative_point())]
    if len(faces) > _MOST_CELLS:
        raise OverlayError(f"its roof has {len(faces):,} pieces")
    faces.sort(key=lambda face: face.bounds)
    tree = shapely.STRtree(shapes)
    owners = [_owner(face, [facets[k] for k in near], tree) for face in faces]
    faces, owners = _without_specks(faces, owners)
    return _cells_at_heights(faces, [near[k] for k in owners], facets)


def _owner(face: Polygon, facets: Sequence[RoofFacet], tree: shapely.STRtree) -> int:
    """Return the surface a face lies under: the highest there, or the nearest."""
    spot = face.representative_point()
    over = sorted(tree.query(spot, predicate="intersects").tolist())
    if not over:
        return int(tree.nearest(spot))
    at = np.asarray(spot.coords)
    return int(max(over, key=lambda k: (float(facets[k].height(at)[0]), -k)))


def _without_specks(faces: list[Polygon], owners: list[int]) -> tuple[list[Polygon], list[int]]:
    """Give slivers to the neighbour they have most edge in common with."""
    while True:
        small = [k for k, face in enumerate(faces) if face.area < _SPECK or face.area < 0.008 * face.length]
        beside = _edges_of(faces)
        for k in small:
            shared: dict[int, float] = {}
            for (a, b), cells in beside.items():
                if k in cells:
                    for other in cells - {k}:
                        shared[other] = shared.get(other, 0.0) + float(np.hypot(a[0] - b[0], a[1] - b[1]))
            if not shared:
                continue
            best = max(shared, key=lambda other: (shared[other], -other))
            merged = overlay.union(faces[k], faces[best])
            if isinstance(merged, Polygon):
                keep = best if faces[best].area >= faces[k].area else k
                faces[best], owners[best] = merged, owners[keep]
                del faces[k], owners[k]
                break
        else:
            return faces, owners


_Key = tuple[int, int]


def _key(point: NDArray[np.float64]) -> _Key:
    return round(float(point[0]) / 0.001), round(float(point[1]) / 0.001)


def _edges_of(faces: Sequence[Polygon]) -> dict[tuple[tuple[float, float], tuple[float, float]], set[int]]:
    """Edges, each with the faces beside it."""
    beside: dict[tuple[tuple[float, float], tuple[float, float]], set[int]] = {}
    for k, face in enumerate(faces):
        for ring in rings_of(face):
            points = [(float(x), float(y)) for x, y in ring]
            for a, b in zip(points, [*points[1:], points[0]], strict=True):
                beside.setdefault((min(a, b), max(a, b)), set()).add(k)
    return beside


def _cells_at_heights(faces: Sequence[Polygon], owners: Sequence[int], facets: Sequence[RoofFacet]) -> list[RoofCell]:
    """Return cells with their corners' heights, made one where those of neighbours nearly agree."""
    rows: dict[_Key, list[tuple[float, int, int, int]]] = {}
    heights: list[list[NDArray[np.float64]]] = []
    for k, face in enumerate(faces):
        facet = facets[owners[k]]
        own = np.asarray(facet.polygon.exterior.coords)[:, :2]
        low, high = float(facet.height(own).min()), float(facet.height(own).max())
        heights.append([])
        for r, ring in enumerate(rings_of(face)):
            z = np.clip(facet.height(ring), low, high)
            heights[k].append(z)
            for i, point in enumerate(ring):
                rows.setdefault(_key(point), []).append((float(z[i]), k, r, i))
    for row in rows.values():
        row.sort()
        start = 0
        for end in range(1, len(row) + 1):
            if end == len(row) or row[end][0] - row[end - 1][0] > _SAME:
                mean = sum(item[0] for item in row[start:end]) / (end - start)
                for _, k, r, i in row[start:end]:
                    heights[k][r][i] = mean
                start = end
    return [RoofCell(face, owners[k], tuple(heights[k])) for k, face in enumerate(faces)]


def measured_solid(outline: Polygon, low: float, facets: Sequence[RoofFacet]) -> Manifold:
    """Return the closed solid between a level and a measured roof.

    Parameters
    ----------
    outline
        Metres; near the origin for precision, like the facets.
    low
        Height of the underside, in the facets' own height; all of the roof must lie above it.
    facets
        The surfaces of the roof.

    Raises
    ------
    OverlayError
        If no solid comes of it.
    """
    prisms = [prism for cell in roof_cells(outline, facets) for prism in _prisms_under(cell, low)]
    solid = Manifold.batch_boolean(prisms, OpType.Add)
    if solid.status() != Error.NoError or solid.is_empty() or not solid.volume() > 0.0:
        raise OverlayError("nothing is left of the solid under its roof")
    return solid


def _prisms_under(cell: RoofCell, low: float) -> list[Manifold]:
    """Return the prism over a cell; where its outline touches itself, one over each of its triangles."""
    rings = rings_of(cell.polygon)
    plan, top = np.concatenate(rings), np.concatenate(cell.heights)
    if not top.min() > low + 0.01:
        raise OverlayError(f"its roof reaches {low - float(top.min()):.1f} m below its floor")
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    cap = mapbox_earcut.triangulate_float64(np.ascontiguousarray(plan), ends).reshape(-1, 3).astype(np.int64)
    a, b, c = (plan[cap[:, k]] for k in range(3))
    double_area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    cap[double_area < 0] = cap[double_area < 0][:, ::-1]
    first = np.concatenate([[0], ends[:-1]]).astype(np.int64)
    loops = [begin + np.arange(len(ring)) for begin, ring in zip(first, rings, strict=True)]
    whole = _prism(plan, top, low, cap, loops)
    if whole.status() == Error.NoError and whole.volume() > 0.0:
        return [whole]
    corners = np.arange(3)
    return [
        _prism(plan[triangle], top[triangle], low, corners[None], [corners])
        for triangle in cap[np.abs(double_area) > 1e-7]
    ]


def _prism(
    plan: NDArray[np.float64],
    top: NDArray[np.float64],
    low: float,
    cap: NDArray[np.int64],
    loops: Sequence[NDArray[np.int64]],
) -> Manifold:
    """Return the solid between a level and a cap of triangles; `loops` are the rings around it, by index."""
    n = len(plan)
    faces = [cap + n, cap[:, ::-1]]
    for i in loops:
        j = np.roll(i, -1)
        faces += [np.stack([i, j, j + n], axis=1), np.stack([i, j + n, i + n], axis=1)]
    points = np.concatenate([np.c_[plan, np.full(n, low)], np.c_[plan, top]])
    return Manifold(
        Mesh64(
            vert_properties=np.ascontiguousarray(points, np.float64),
            tri_verts=np.ascontiguousarray(np.concatenate(faces), np.uint64),
        )
    )
