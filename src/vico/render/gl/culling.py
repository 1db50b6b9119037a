"""Which triangles and instances a camera may see: ranges and numbers to draw."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import ANYWHERE, INDOORS, OUTDOORS, SceneArrays
from vico.render.uniforms import Record

# Smaller than this across is not drawn, pixels; as the other renderer has it.
_LEAST_PIXELS = 0.8


def _axes(camera: Record) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where a camera is, and its axes as rows."""
    place = np.array([camera["x"], camera["y"], camera["z"]], np.float64)
    return place, np.array(
        [[camera[f"{name}_{part}"] for part in "xyz"] for name in ("right", "down", "forward")], np.float64
    )


def _are_in_view(centre: NDArray[Any], radius: NDArray[Any], camera: Record) -> NDArray[np.bool_]:
    """Return which spheres a camera may see."""
    place, axes = _axes(camera)
    across, down, ahead = ((centre - place) @ axes.T).T
    sides = (float(camera["width"]), float(camera["centre_x"])), (float(camera["height"]), float(camera["centre_y"]))
    tangents = (max(centre, size - centre) / float(camera["focal"]) for size, centre in sides)
    seen = (ahead + radius > camera["near"]) & (ahead - radius < camera["far"])
    for aside, tangent in zip((np.abs(across), np.abs(down)), tangents, strict=True):
        seen &= aside - ahead * tangent <= radius * np.sqrt(1.0 + tangent * tangent)
    return np.asarray(seen)


def cluster_ranges(arrays: SceneArrays, camera: Record) -> list[tuple[int, int]]:
    """Return ranges of triangles of the clusters in view, neighbours joined."""
    clusters = arrays.clusters
    if not len(clusters.low):
        return []
    low, high = clusters.low.astype(np.float64), clusters.high.astype(np.float64)
    radius = np.linalg.norm(high - low, axis=1) / 2
    seen = _are_in_view((low + high) / 2, radius, camera)
    seen &= arrays.cluster_where == (INDOORS if camera["indoors"] else OUTDOORS)
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
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return three times the prototype plus the level of detail, and the number, of each instance in view."""
    count = int(arrays.counts["instances" if moving else "static_instances"])
    instances, prototypes = arrays.instances, arrays.prototypes
    sphere = instances.sphere[:count]
    centre = np.stack([sphere["x"], sphere["y"], sphere["z"]], axis=1).astype(np.float64)
    radius = sphere["radius"].astype(np.float64)
    seen = _are_in_view(centre, radius, camera)
    where = instances.where[:count]
    seen &= (where == ANYWHERE) | ((where == INDOORS) == bool(camera["indoors"]))
    place, axes = _axes(camera)
    ahead = (centre - place) @ axes[2]
    seen &= ~(2.0 * radius * float(camera["focal"]) < _LEAST_PIXELS * ahead)
    number = np.flatnonzero(seen)
    model = instances.prototype[number].astype(np.int64)
    extent = (prototypes.high[model] - prototypes.low[model]).astype(np.float64)
    scale = np.linalg.norm(instances.matrix[number][:, :, 0], axis=1)
    pixels = np.linalg.norm(extent, axis=1) * scale * float(camera["focal"]) / np.maximum(ahead[number], camera["near"])
    limits = prototypes.pixels[model]
    level = np.where(pixels < limits[:, 1], np.where(pixels < limits[:, 2], 2, 1), 0)
    return 3 * model + level, number
