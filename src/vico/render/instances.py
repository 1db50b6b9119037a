"""Arrays of placed prototypes: joined, ordered along a curve, and grouped so that whole groups are culled at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.errors import InputError
from vico.render.arrays import ANYWHERE, INSTANCE_GROUP, InstanceGroups, Instances

NO_GROUPS = InstanceGroups(
    np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros(0, np.uint8), np.zeros(0, np.float32)
)


def joined_instances(a: Instances, b: Instances) -> Instances:
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


def with_spare(a: Instances, spare: int) -> Instances:
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


def neighbours_together(a: Instances) -> Instances:
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
