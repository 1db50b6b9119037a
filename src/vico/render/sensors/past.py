"""Where things were when somebody last looked: what optical flow is measured from."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.scene import Scene


class PastPlaces(NamedTuple):
    """Where what moves was, in the order of a scene as it is now.

    Attributes
    ----------
    matrix
        Upper rows of the model-to-world transforms of moving instances, float32, shape ``(n, 3, 4)``.
    known
        Whether each of them was there, bool, shape ``(n,)``.
    x, y, z
        Vertices of the avatars, world metres, float32; of who was not there in the same shape, where they are now.
    eye
        Where the camera was, world metres, float64, shape ``(3,)``.
    """

    matrix: NDArray[np.float32]
    known: NDArray[np.bool_]
    x: NDArray[np.float32]
    y: NDArray[np.float32]
    z: NDArray[np.float32]
    eye: NDArray[np.float64]


_NONE = np.zeros(0, np.float32)
#: For pictures that nobody asks the past of.
NO_PAST = PastPlaces(np.zeros((0, 3, 4), np.float32), np.zeros(0, np.bool_), _NONE, _NONE, _NONE, np.zeros(3))


class PlacedInstances(NamedTuple):
    """Where everything that moves is at one moment.

    Attributes
    ----------
    entity, prototype
        Of moving instances, int32, shape ``(n,)``.
    matrix
        float32, shape ``(n, 3, 4)``.
    x, y, z
        Vertices of the avatars, world metres, float32.
    owner
        Entity and first vertex of each avatar, int64, shape ``(a, 2)``.
    """

    entity: NDArray[np.int32]
    prototype: NDArray[np.int32]
    matrix: NDArray[np.float32]
    x: NDArray[np.float32]
    y: NDArray[np.float32]
    z: NDArray[np.float32]
    owner: NDArray[np.int64]


def placement_of(scene: Scene) -> PlacedInstances:
    """Return a copy of where everything that moves is in a scene."""
    arrays = scene.arrays
    moving = slice(int(arrays.counts["static_instances"]), int(arrays.counts["instances"]))
    instances, mesh, spans = arrays.instances, arrays.mesh, arrays.avatars.span
    first = int(spans["first_vertex"].min()) if len(spans) else 0
    vertices = slice(first, int(spans["end_vertex"].max(initial=0)))
    owner = np.column_stack([mesh.entity[spans["first_triangle"]], spans["first_vertex"]]).astype(np.int64)
    return PlacedInstances(
        instances.entity[moving].copy(),
        instances.prototype[moving].copy(),
        instances.matrix[moving].copy(),
        mesh.x[vertices].copy(),
        mesh.y[vertices].copy(),
        mesh.z[vertices].copy(),
        owner,
    )


def past_places(before: PlacedInstances, now: PlacedInstances, eye: NDArray[np.float64]) -> PastPlaces:
    """Return where what is there `now` was `before`, seen from an eye that was at `eye` then.

    Things are told by entity and prototype, several of one kind by their order.
    """
    place, known = matched(before, now)
    matrix = before.matrix[place] if len(before.matrix) else now.matrix
    was = vertices_before(before, now)
    x, y, z = (as_before(old, new, was) for old, new in zip(before[3:6], now[3:6], strict=True))
    return PastPlaces(np.ascontiguousarray(matrix), known, x, y, z, eye)


def vertices_before(before: PlacedInstances, now: PlacedInstances) -> NDArray[np.int64] | None:
    """Return which vertex of `before` each avatar's vertex of `now` was, -1 for other shapes'; None: all the same."""
    if len(before.x) == len(now.x) and np.array_equal(before.owner, now.owner):
        return None
    spans = {entity: (start, count) for entity, start, count in _spans(before)}
    was = np.full(len(now.x), -1, np.int64)
    for entity, start, count in _spans(now):
        then, as_many = spans.get(entity, (0, -1))
        if as_many == count:
            was[start : start + count] = np.arange(then, then + count)
    return was


def as_before(old: NDArray[Any], new: NDArray[Any], was: NDArray[np.int64] | None) -> NDArray[Any]:
    """Return values of vertices as they were before, and as they are now where these were not there."""
    if was is None:
        return old
    out = new.copy()
    out[was >= 0] = old[was[was >= 0]]
    return out


def _spans(placement: PlacedInstances) -> list[tuple[int, int, int]]:
    """Return entity, first vertex from the first avatar's on, and number of vertices of each avatar."""
    if not len(placement.owner):
        return []
    entity, start = placement.owner[:, 0], placement.owner[:, 1] - placement.owner[:, 1].min()
    order = np.argsort(start, kind="stable")
    count = np.diff([*start[order].tolist(), len(placement.x)])
    return list(zip(entity[order].tolist(), start[order].tolist(), count.tolist(), strict=True))


def matched(before: PlacedInstances, now: PlacedInstances) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the row of `before` for each moving instance of `now`, and whether there is one (else it is 0)."""
    old, new = _keys(before), _keys(now)
    order = np.lexsort(old.T[::-1])
    rows = {tuple(old[k]): int(k) for k in order.tolist()}
    place = np.array([rows.get(tuple(key), -1) for key in new], np.int64).reshape(-1)
    return np.maximum(place, 0), place >= 0


def _keys(placement: PlacedInstances) -> NDArray[np.int64]:
    """Return entity, prototype and how many such came before, of each moving instance; shape ``(n, 3)``."""
    pair = placement.entity.astype(np.int64) << 32 | placement.prototype.astype(np.int64)
    order = np.argsort(pair, kind="stable")
    ranked = pair[order]
    first = np.searchsorted(ranked, ranked, side="left")
    turn = np.empty(len(pair), np.int64)
    turn[order] = np.arange(len(pair)) - first
    return np.column_stack([placement.entity, placement.prototype, turn]).astype(np.int64)
