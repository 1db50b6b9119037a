"""Triangles as the rasteriser wants them: small compact clusters, each with its own vertices and bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.render.records import NEVER_CULLED, NORMAL_CONE, SPAN, TRIANGLE, VERTEX
from vico.world.mesh import Surface

CLUSTER = 160
# Clusters that follow each other are neighbours: so many share a bounding box that is tested first.
CLUSTER_GROUP = 16
_NORMAL_METRES = 10.0
# Columns of `Soup.attributes`.
_NORMAL, _U, _V, _COLOUR = slice(0, 3), 3, 4, slice(5, 8)


class Mesh(NamedTuple):
    """Vertices and triangles of everything in a scene.

    Attributes
    ----------
    x, y, z
        Positions, metres (world, or a prototype's own frame), float32, shape ``(v,)``: one array an axis so that
        transforming them is straight-line vector code.
    vertex
        The same positions with everything else of a vertex beside them, `VERTEX`, shape ``(v,)``.
    triangle
        `TRIANGLE`, shape ``(t,)``.
    entity
        Id of a triangle in segmentation images; 0: the instance's. int32, shape ``(t,)``.
    """

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    z: NDArray[np.float32]
    vertex: NDArray[np.void]
    triangle: NDArray[np.void]
    entity: NDArray[np.int32]


@dataclass(frozen=True)
class Soup:
    """Surfaces put together: a `Mesh` before clustering.

    Attributes
    ----------
    position
        Metres, float32, shape ``(v, 3)``.
    attributes
        Normal, uv and linear colour, float32, shape ``(v, 8)``.
    triangles
        Vertex numbers, int32, shape ``(t, 3)``.
    material, entity
        Of each triangle, int32, shape ``(t,)``.
    """

    position: NDArray[np.float32]
    attributes: NDArray[np.float32]
    triangles: NDArray[np.int32]
    material: NDArray[np.int32]
    entity: NDArray[np.int32]

    @property
    def corners(self) -> NDArray[np.float32]:
        """Corner positions, shape ``(t, 3, 3)``."""
        return self.position[self.triangles]


class Clusters(NamedTuple):
    """Triangles that lie together and are culled together.

    Attributes
    ----------
    low, high
        Corners of their bounding boxes, world metres, float32, shape ``(c, 3)``.
    cone
        Where their faces look, `NORMAL_CONE`, shape ``(c,)``.
    span
        `SPAN`, shape ``(c,)``.
    group_low, group_high
        Corners of a box around each `CLUSTER_GROUP` of them, world metres, float32.
    """

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    cone: NDArray[np.void]
    span: NDArray[np.void]
    group_low: NDArray[np.float32]
    group_high: NDArray[np.float32]


def soup_of(surfaces: Sequence[Surface], materials: Sequence[int], linear: NDArray[np.float32]) -> Soup:
    """Join surfaces; `materials` holds each one's material number, `linear` the light of sRGB bytes."""
    positions, attributes, triangles, numbers, entities = [], [], [], [], []
    first = 0
    for surface, number in zip(surfaces, materials, strict=True):
        count = len(surface.positions)
        if not len(surface.triangles):
            continue
        if surface.triangles.min() < 0 or surface.triangles.max() >= count:
            raise InputError(f"surface {surface.material.name}: a triangle names a vertex that is not there")
        if not np.isfinite(surface.positions).all():
            raise InputError(f"surface {surface.material.name}: a position is not finite")
        positions.append(surface.positions.astype(np.float32))
        attributes.append(np.concatenate([surface.normals, surface.uv, linear[surface.colour]], axis=1))
        triangles.append(surface.triangles + np.int32(first))
        numbers.append(np.full(len(surface.triangles), number, np.int32))
        entities.append(surface.entity[surface.triangles[:, 0]].astype(np.int32))
        first += count
    if not positions:
        return Soup(
            np.zeros((0, 3), np.float32),
            np.zeros((0, 8), np.float32),
            np.zeros((0, 3), np.int32),
            np.zeros(0, np.int32),
            np.zeros(0, np.int32),
        )
    return Soup(
        np.concatenate(positions),
        np.concatenate(attributes).astype(np.float32),
        np.concatenate(triangles).astype(np.int32),
        np.concatenate(numbers),
        np.concatenate(entities),
    )


def mesh_of(soup: Soup) -> Mesh:
    """Return the arrays of a soup, in its order."""
    vertex = np.zeros(len(soup.position), VERTEX)
    vertex["position"], vertex["normal"] = soup.position, soup.attributes[:, _NORMAL]
    vertex["u"], vertex["v"] = soup.attributes[:, _U], soup.attributes[:, _V]
    vertex["colour"] = soup.attributes[:, _COLOUR]
    x, y, z = (np.ascontiguousarray(soup.position[:, k]) for k in range(3))
    triangle = np.zeros(len(soup.triangles), TRIANGLE)
    triangle["vertices"], triangle["material"] = soup.triangles, soup.material
    return Mesh(x, y, z, vertex, triangle, soup.entity)


def join_meshes(parts: Sequence[Mesh]) -> Mesh:
    """Return one mesh of several, vertex numbers shifted."""
    shifts = np.cumsum([0, *(len(part.x) for part in parts[:-1])])
    triangles = []
    for part, shift in zip(parts, shifts, strict=True):
        triangle = part.triangle.copy()
        triangle["vertices"] += np.int32(shift)
        triangles.append(triangle)
    return Mesh(
        np.concatenate([part.x for part in parts]),
        np.concatenate([part.y for part in parts]),
        np.concatenate([part.z for part in parts]),
        np.concatenate([part.vertex for part in parts]),
        np.concatenate(triangles),
        np.concatenate([part.entity for part in parts]),
    )


def cluster_triangles(soup: Soup, double_sided: NDArray[np.bool_]) -> tuple[Soup, Clusters]:
    """Sort triangles into clusters of at most `CLUSTER` that are small in space and, below 20 m, in direction.

    A k-d split over centroids and scaled normals, one level of all clusters at a time.
    """
    count = len(soup.triangles)
    corners = soup.corners
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    features = np.concatenate([corners.mean(axis=1), normal * _NORMAL_METRES], axis=1)
    order = np.arange(count)
    bounds = np.array([0, count]) if count else np.array([0])
    while len(bounds) > 1 and np.diff(bounds).max() > CLUSTER:
        sizes = np.diff(bounds)
        segment = np.repeat(np.arange(len(sizes)), sizes)
        values = features[order]
        extent = np.maximum.reduceat(values, bounds[:-1]) - np.minimum.reduceat(values, bounds[:-1])
        axis = extent.argmax(axis=1)
        order = order[np.lexsort((values[np.arange(count), axis[segment]], segment))]
        middle = bounds[:-1] + sizes // 2
        bounds = np.unique(np.concatenate([bounds, middle[sizes > CLUSTER]]))
    number = len(bounds) - 1
    starts = bounds[:-1].astype(np.int64)
    cluster = np.repeat(np.arange(number), np.diff(bounds))
    # Every cluster gets vertices of its own, numbered in a row.
    keys = cluster[:, None] * np.int64(max(len(soup.position), 1)) + soup.triangles[order]
    unique, inverse = np.unique(keys.ravel(), return_inverse=True)
    vertices = unique % max(len(soup.position), 1)
    owner = unique // max(len(soup.position), 1)
    vertex_bounds = np.searchsorted(owner, np.arange(number + 1))
    sorted_soup = Soup(
        soup.position[vertices],
        soup.attributes[vertices],
        inverse.reshape(-1, 3).astype(np.int32),
        soup.material[order],
        soup.entity[order],
    )
    span = spans(bounds[:-1], bounds[1:], vertex_bounds[:-1], vertex_bounds[1:])
    if not number:
        none = np.zeros((0, 3), np.float32)
        return sorted_soup, group_clusters(none, none, np.zeros(0, NORMAL_CONE), span)
    low = np.minimum.reduceat(sorted_soup.position, vertex_bounds[:-1])
    high = np.maximum.reduceat(sorted_soup.position, vertex_bounds[:-1])
    turned = normal[order]
    axis_sum = np.add.reduceat(turned, starts)
    length = np.linalg.norm(axis_sum, axis=1, keepdims=True)
    mean = axis_sum / np.maximum(length, 1e-9)
    spread = np.minimum.reduceat((turned * mean[cluster]).sum(axis=1), starts)
    both = np.logical_or.reduceat(double_sided[soup.material[order]], starts)
    usable = (spread > 0.1) & ~both
    # A cluster faces away if the view direction lies within 90 degrees minus the cone's half angle of its axis.
    cone = np.zeros(number, NORMAL_CONE)
    cone["x"], cone["y"], cone["z"] = mean.T
    cone["limit"] = np.where(usable, np.sqrt(np.maximum(1 - spread * spread, 0)) + 1e-3, NEVER_CULLED)
    return sorted_soup, group_clusters(low, high, cone, span)


def spans(first_triangle: Any, end_triangle: Any, first_vertex: Any, end_vertex: Any) -> NDArray[np.void]:
    """Return a `SPAN` array of its columns."""
    span = np.zeros(len(first_triangle), SPAN)
    span["first_triangle"], span["end_triangle"] = first_triangle, end_triangle
    span["first_vertex"], span["end_vertex"] = first_vertex, end_vertex
    return span


def group_clusters(
    low: NDArray[np.float32], high: NDArray[np.float32], cone: NDArray[np.void], span: NDArray[np.void]
) -> Clusters:
    """Return clusters with the bounds of their groups."""
    if not len(low):
        return Clusters(low.copy(), high.copy(), cone, span, low.copy(), high.copy())
    starts = np.arange(0, len(low), CLUSTER_GROUP)
    return Clusters(low, high, cone, span, np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts))


def simplify_by_clustering(soup: Soup, cell: float) -> Soup | None:
    """Return a coarser copy by vertex clustering on a grid; None where it would lose too much of the shape.

    Thin parts (poles, frames) collapse under clustering: a copy that keeps less than 70 % of the area is refused.
    """
    grid = np.floor((soup.position - soup.position.min(axis=0)) / cell).astype(np.int64)
    key = (grid[:, 0] << 40) + (grid[:, 1] << 20) + grid[:, 2]
    # Vertices on the two sides of a sharp edge stay apart, or their normals would cancel.
    facing = np.round(soup.attributes[:, _NORMAL]).astype(np.int64) + 1
    key = key * 27 + facing[:, 0] * 9 + facing[:, 1] * 3 + facing[:, 2]
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    _, place = np.unique(key // 27, return_inverse=True)
    # All vertices of a cell move to one point, so that no cracks open between them.
    sums = np.zeros((place.max() + 1, 3))
    np.add.at(sums, place, soup.position.astype(np.float64))
    centre = (sums / np.bincount(place)[:, None])[place[first]].astype(np.float32)
    triangles = inverse[soup.triangles].astype(np.int32)
    cells = place[first][triangles]
    keep = (cells[:, 0] != cells[:, 1]) & (cells[:, 1] != cells[:, 2]) & (cells[:, 0] != cells[:, 2])
    triangles = triangles[keep]
    if not len(triangles) or len(triangles) > 0.7 * len(soup.triangles):
        return None
    result = Soup(centre, soup.attributes[first], triangles, soup.material[keep], soup.entity[keep])
    return result if _area(result) >= 0.7 * _area(soup) else None


def _area(soup: Soup) -> float:
    corners = soup.corners
    return float(np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum())
