"""Which triangles and instances a camera may see: ranges and numbers to draw."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import ANYWHERE, INDOORS, OUTDOORS, SceneArrays
from vico.render.compiled import inlined, kernel
from vico.render.uniforms import Record

# Smaller than this across is not drawn, pixels; as the other renderer has it.
_LEAST_PIXELS = 0.8
_LEVELS = 3


def cluster_ranges(arrays: SceneArrays, camera: Record) -> list[tuple[int, int]]:
    """Return ranges of triangles of the clusters in view, neighbours joined."""
    clusters = arrays.clusters
    if not len(clusters.low):
        return []
    seen = np.empty(len(clusters.low), np.bool_)
    where = INDOORS if camera["indoors"] else OUTDOORS
    _find_clusters(clusters.low, clusters.high, arrays.cluster_where, where, camera, seen)
    first, end = clusters.span["first_triangle"][seen], clusters.span["end_triangle"][seen]
    if not len(first):
        return []
    return joined_ranges(first, end)


def joined_ranges(first: NDArray[np.int32], end: NDArray[np.int32]) -> list[tuple[int, int]]:
    """Return ranges with those joined that follow each other."""
    breaks = np.flatnonzero(first[1:] != end[:-1]) + 1
    starts, ends = np.concatenate([[0], breaks]), np.append(breaks, len(first)) - 1
    return list(zip(first[starts].tolist(), end[ends].tolist(), strict=True))


def instances_in_view(
    arrays: SceneArrays, camera: Record, *, moving: bool
) -> tuple[NDArray[np.int32], list[tuple[int, int]]]:
    """Return the instances in view, those of one mesh beside each other, and how many there are of each mesh.

    Returns
    -------
    numbers
        Of the instances.
    groups
        For each mesh that is seen three times its prototype plus the level of detail, and how many follow.
    """
    count = int(arrays.counts["instances" if moving else "static_instances"])
    if not count:
        return np.zeros(0, np.int32), []
    prototypes, instances = arrays.prototypes, arrays.instances
    code, numbers = np.empty(count, np.int32), np.empty(count, np.int32)
    each = np.zeros(_LEVELS * len(prototypes.low), np.int64)
    found = _find_instances(instances, prototypes, camera, code, each)
    _group(code, each, numbers)
    seen = np.flatnonzero(each)
    return numbers[:found], list(zip(seen.tolist(), each[seen].tolist(), strict=True))


@kernel
def _find_clusters(low: Any, high: Any, where: Any, wanted: int, camera: Any, seen: Any) -> None:
    for k in range(len(seen)):
        radius, middle = 0.0, np.empty(3, np.float64)
        for axis in range(3):
            middle[axis] = (np.float64(low[k, axis]) + np.float64(high[k, axis])) / 2.0
            half = (np.float64(high[k, axis]) - np.float64(low[k, axis])) / 2.0
            radius += half * half
        seen[k] = where[k] == wanted and _is_in_view(middle[0], middle[1], middle[2], np.sqrt(radius), camera)


@kernel
def _find_instances(instances: Any, prototypes: Any, camera: Any, code: Any, each: Any) -> int:
    """Write three times the prototype plus the level of detail of what is in view, -1 of the rest; count them."""
    found = 0
    for k in range(len(code)):
        code[k] = -1
        where, sphere = instances.where[k], instances.sphere[k]
        if where != ANYWHERE and (where == INDOORS) != (camera.indoors != 0):
            continue
        x, y, z, radius = np.float64(sphere.x), np.float64(sphere.y), np.float64(sphere.z), np.float64(sphere.radius)
        ahead = _ahead(x, y, z, camera)
        if 2.0 * radius * camera.focal < _LEAST_PIXELS * ahead or not _is_in_view(x, y, z, radius, camera):
            continue
        model = instances.prototype[k]
        extent, scale = 0.0, 0.0
        for axis in range(3):
            side = np.float64(prototypes.high[model, axis]) - np.float64(prototypes.low[model, axis])
            along = np.float64(instances.matrix[k, axis, 0])
            extent, scale = extent + side * side, scale + along * along
        pixels = np.sqrt(extent * scale) * camera.focal / max(ahead, camera.near)
        level = 0
        if pixels < prototypes.pixels[model, 1]:
            level = 2 if pixels < prototypes.pixels[model, 2] else 1
        code[k] = _LEVELS * model + level
        each[code[k]] += 1
        found += 1
    return found


@kernel
def _group(code: Any, each: Any, numbers: Any) -> None:
    """Write the numbers of what has a code, one code after the other."""
    place = np.zeros(len(each), np.int64)
    for k in range(1, len(each)):
        place[k] = place[k - 1] + each[k - 1]
    for k in range(len(code)):
        if code[k] >= 0:
            numbers[place[code[k]]] = k
            place[code[k]] += 1


@inlined
def _ahead(x: float, y: float, z: float, camera: Any) -> float:
    dx, dy, dz = x - camera.x, y - camera.y, z - camera.z
    return dx * camera.forward_x + dy * camera.forward_y + dz * camera.forward_z


@inlined
def _is_in_view(x: float, y: float, z: float, radius: float, camera: Any) -> bool:
    """Return whether a camera may see a sphere."""
    dx, dy, dz = x - camera.x, y - camera.y, z - camera.z
    ahead = dx * camera.forward_x + dy * camera.forward_y + dz * camera.forward_z
    if ahead + radius <= camera.near or ahead - radius >= camera.far:
        return False
    across = abs(dx * camera.right_x + dy * camera.right_y + dz * camera.right_z)
    down = abs(dx * camera.down_x + dy * camera.down_y + dz * camera.down_z)
    wide = max(camera.centre_x, camera.width - camera.centre_x) / camera.focal
    tall = max(camera.centre_y, camera.height - camera.centre_y) / camera.focal
    return across - ahead * wide <= radius * np.sqrt(1.0 + wide * wide) and down - ahead * tall <= radius * np.sqrt(
        1.0 + tall * tall
    )
