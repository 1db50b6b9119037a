"""Instances in a scene: prototypes with their levels of detail, their placements, and posed avatars.

Instances are joined, ordered along a curve, and grouped so that whole groups are culled at once. Posed bodies have room
in a scene's mesh behind all that never moves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.assets.vehicle_parts import Cabin
from vico.errors import InputError
from vico.render.arrays import ANYWHERE, INSTANCE_GROUP, InstanceGroups, Instances, PosedAvatars, Prototypes
from vico.render.compiled import kernel
from vico.render.geometry import Mesh, Soup, mesh_of, simplify_by_clustering
from vico.render.limbs import LIMBS
from vico.render.records import SPAN
from vico.render.shadows.casters import cabin_records

NO_GROUPS = InstanceGroups(
    np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros(0, np.uint8), np.zeros(0, np.float32)
)


def join_instances(a: Instances, b: Instances) -> Instances:
    """Return the things of both, grouped anew for culling."""
    where, sphere = np.concatenate([a.where, b.where]), np.concatenate([a.sphere, b.sphere])
    return Instances(
        np.concatenate([a.matrix, b.matrix]),
        np.concatenate([a.prototype, b.prototype]),
        np.concatenate([a.entity, b.entity]),
        where,
        sphere,
        _groups_of(where, sphere),
    )


def with_spare_capacity(a: Instances, spare: int) -> Instances:
    """Return a copy with room for more things behind these."""

    def wide(values: NDArray[Any]) -> NDArray[Any]:
        return np.concatenate([values, np.zeros((spare, *values.shape[1:]), values.dtype)])

    return Instances(wide(a.matrix), wide(a.prototype), wide(a.entity), wide(a.where), wide(a.sphere), a.groups)


def _groups_of(where: NDArray[np.uint8], sphere: NDArray[np.void]) -> InstanceGroups:
    if not len(where):
        return NO_GROUPS
    starts = np.arange(0, len(where), INSTANCE_GROUP)
    centre, radius = _centres(sphere), sphere["radius"]
    # A hair more than exact, for the rounding of sums in single precision.
    low = np.minimum.reduceat(centre - radius[:, None], starts) - np.float32(0.001)
    high = np.maximum.reduceat(centre + radius[:, None], starts) + np.float32(0.001)
    least, most = np.minimum.reduceat(where, starts), np.maximum.reduceat(where, starts)
    mixed = np.where(least == most, least, np.uint8(ANYWHERE)).astype(np.uint8)
    return InstanceGroups(low, high, mixed, np.maximum.reduceat(radius, starts))


def _centres(sphere: NDArray[np.void]) -> NDArray[np.float32]:
    return np.stack([sphere["x"], sphere["y"], sphere["z"]], axis=1)


def sort_by_locality(a: Instances) -> Instances:
    """Return the same things in another order: outdoors, then indoors, each along a curve that fills space."""
    if not len(a.entity):
        return a
    centre = _centres(a.sphere).astype(np.float64)
    cell = np.floor((centre - centre.min(axis=0)) / max(float(np.ptp(centre, axis=0).max()), 1e-6) * 1023.0)
    code = np.zeros(len(cell), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cell[:, axis].astype(np.int64) >> bit) & 1) << (3 * bit + axis)
    order = np.lexsort((np.arange(len(code)), code, a.where))
    return Instances(a.matrix[order], a.prototype[order], a.entity[order], a.where[order], a.sphere[order], a.groups)


def matrix_rows(transforms: ArrayLike, count: int) -> NDArray[np.float32]:
    """Return the upper three rows of transforms, shape ``(count, 3, 4)``.

    Raises
    ------
    InputError
        If they have another shape, or one is not finite.
    """
    matrices = np.asarray(transforms, np.float32)
    if matrices.shape != (count, 4, 4):
        raise InputError(f"scene: transforms of shape {matrices.shape}; expected ({count}, 4, 4)")
    if not np.isfinite(matrices).all():
        raise InputError("scene: a transform is not finite")
    return np.ascontiguousarray(matrices[:, :3])


def entities_of(values: ArrayLike, count: int) -> NDArray[np.int32]:
    """Return entities, shape ``(count,)``.

    Raises
    ------
    InputError
        If there are more or fewer.
    """
    entities = np.atleast_1d(np.asarray(values, np.int32))
    if entities.shape != (count,):
        raise InputError(f"scene: entities of shape {entities.shape}; expected ({count},)")
    return np.ascontiguousarray(entities)


# A level of detail is left for the next coarser one below these sizes on screen, pixels.
_LEVEL_PIXELS = (1e9, 48.0, 20.0)
_LEVEL_CELLS = (0.07, 0.16)


def prototypes_of(
    soups: Sequence[Soup], names: Sequence[str], cabins: Mapping[str, Cabin]
) -> tuple[Prototypes, list[Mesh]]:
    """Return models with their levels of detail, and the meshes of these one behind the other."""
    levels = np.zeros((len(soups), len(_LEVEL_PIXELS)), SPAN)
    bounds = np.zeros((2, len(soups), 3), np.float32)
    pixels = np.tile(np.array(_LEVEL_PIXELS, np.float32), (len(soups), 1))
    meshes: list[Mesh] = []
    triangles, vertices = 0, 0
    for k, soup in enumerate(soups):
        if not len(soup.triangles):
            continue
        bounds[:, k] = soup.position.min(axis=0), soup.position.max(axis=0)
        size = float(np.linalg.norm(bounds[1, k] - bounds[0, k]))
        for level in range(len(_LEVEL_PIXELS)):
            coarse = soup if level == 0 else simplify_by_clustering(soup, max(size * _LEVEL_CELLS[level - 1], 1e-6))
            if coarse is None:
                levels[k, level] = levels[k, level - 1]
                continue
            end_triangle, end_vertex = triangles + len(coarse.triangles), vertices + len(coarse.position)
            levels[k, level] = triangles, end_triangle, vertices, end_vertex
            triangles, vertices = end_triangle, end_vertex
            meshes.append(mesh_of(coarse))
    return Prototypes(bounds[0], bounds[1], levels, pixels, *cabin_records(names, cabins, *bounds)), meshes


def no_avatars() -> PosedAvatars:
    """Return nobody."""
    none = np.zeros((0, 3), np.float32)
    return PosedAvatars(none, none.copy(), np.zeros(0, SPAN), np.zeros((0, len(LIMBS), 7), np.float32))


def with_avatar_capacity(mesh: Mesh, used: tuple[int, int], vertices: int, triangles: int) -> Mesh:
    """Return a copy of the static part with space for avatars behind it."""
    t, v = used

    def grow(values: NDArray[Any], keep: int, extra: int) -> NDArray[Any]:
        return np.concatenate([values[:keep], np.zeros((extra, *values.shape[1:]), values.dtype)])

    return Mesh(
        grow(mesh.x, v, vertices),
        grow(mesh.y, v, vertices),
        grow(mesh.z, v, vertices),
        grow(mesh.vertex, v, vertices),
        grow(mesh.triangle, t, triangles),
        grow(mesh.entity, t, triangles),
    )


@kernel
def pose_avatars(
    mesh: Mesh,
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    first_vertex: int,
    span: NDArray[np.void],
    low: NDArray[np.float32],
    high: NDArray[np.float32],
) -> bool:
    """Write positions, normals and bounds; return False if a position is not finite."""
    xs, ys, zs, records = mesh.x, mesh.y, mesh.z, mesh.vertex
    total = np.float32(0.0)
    for body in range(len(span)):
        first, end = span[body].first_vertex, span[body].end_vertex
        for k in range(first, end):
            i = k - first_vertex
            x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
            xs[k], ys[k], zs[k] = x, y, z
            # Zero for finite numbers, else none.
            total += (x - x) + (y - y) + (z - z)
            position, normal = records[k].position, records[k].normal
            position[0], position[1], position[2] = x, y, z
            normal[0], normal[1], normal[2] = normals[i, 0], normals[i, 1], normals[i, 2]
        for axis in range(3):
            line = xs if axis == 0 else (ys if axis == 1 else zs)
            smallest = largest = line[first]
            for v in range(first, end):
                smallest, largest = min(smallest, line[v]), max(largest, line[v])
            low[body, axis], high[body, axis] = smallest, largest
    return bool(total == 0.0)
