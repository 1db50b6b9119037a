"""Motion between two moments: where things were when somebody last looked, and a scene part of the way in between.

Optical flow is measured from the former; films of runs are drawn from the latter.
"""

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
    place, known = match_instances(before, now)
    matrix = before.matrix[place] if len(before.matrix) else now.matrix
    was = vertices_before(before, now)
    x, y, z = (vertex_values_before(old, new, was) for old, new in zip(before[3:6], now[3:6], strict=True))
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


def vertex_values_before(old: NDArray[Any], new: NDArray[Any], was: NDArray[np.int64] | None) -> NDArray[Any]:
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


def match_instances(before: PlacedInstances, now: PlacedInstances) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
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


#: What is farther from where it was than this has not moved, but come or gone through a door; metres.
LEAP = 4.0


class SceneMoment(NamedTuple):
    """Where everything that moves is.

    Attributes
    ----------
    scene
        It moves in.
    second
        Of the clock.
    placement
        Where everything is.
    normals
        Of the avatars' vertices, float32, shape ``(V, 3)``.
    limbs, span
        Of the avatars that are there, as `PosedAvatars` has them.
    openings
        Doors that are not closed, as `SceneArrays` has them.
    shadowless
        How many of the last moving instances throw no shadow.
    """

    scene: Scene
    second: float
    placement: PlacedInstances
    normals: NDArray[np.float32]
    limbs: NDArray[np.float32]
    span: NDArray[np.void]
    openings: NDArray[np.void]
    shadowless: int


def moment_of(scene: Scene, second: float) -> SceneMoment:
    """Return a copy of where everything is now."""
    spans = scene.arrays.avatars.span
    first = int(spans["first_vertex"].min()) if len(spans) else 0
    vertices = slice(first, int(spans["end_vertex"].max(initial=0)))
    normals = scene.arrays.mesh.vertex["normal"][vertices].copy()
    openings, shadowless = scene.arrays.openings, scene.shadowless
    limbs, span = scene.arrays.avatars.limbs, scene.arrays.avatars.span.copy()
    return SceneMoment(scene, second, placement_of(scene), normals, limbs, span, openings, shadowless)


def show_interpolated(before: SceneMoment, after: SceneMoment, share: float) -> Scene:
    """Put everything `share` (0..1) of the way from one moment to a later one; return the scene.

    What came, went, or leapt in between is where it was until the later moment has come.
    """
    scene = after.scene
    scene.moment = before.second + share * (after.second - before.second)
    if before.scene is not scene or share >= 1.0:
        _set_rigid(after, after.placement.matrix)
        _set_avatars(after)
        return scene
    a, b = before.placement, after.placement
    place, known = match_instances(a, b)
    matrix = b.matrix.copy()
    if len(a.matrix):
        start = a.matrix[place]
        leaps = np.linalg.norm(b.matrix[:, :, 3] - start[:, :, 3], axis=1) > LEAP
        matrix[known] = start[known]
        moves = known & ~leaps
        matrix[moves] = interpolate_transforms(start[moves], b.matrix[moves], share)
    _set_rigid(after, matrix)
    if not len(b.x):
        _set_avatars(after)
    else:
        was, new = vertices_before(a, b), np.stack([b.x, b.y, b.z], axis=1)
        old = vertex_values_before(np.stack([a.x, a.y, a.z], axis=1), new, was)
        starts = b.owner[:, 1] - b.owner[0, 1]
        counts = np.diff([*starts.tolist(), len(new)])
        leap = np.abs(new[starts] - old[starts]).max(axis=1) > LEAP
        part = np.repeat(np.where(leap, 0.0, share), counts)[:, None].astype(np.float32)
        normals = vertex_values_before(before.normals, after.normals, was)
        limbs = after.limbs
        if len(before.limbs) == len(limbs) == len(leap) and np.array_equal(a.owner[:, 0], b.owner[:, 0]):
            limbs = before.limbs + np.where(leap, 0.0, share)[:, None, None] * (limbs - before.limbs)
        scene.repose(old + part * (new - old), normals + part * (after.normals - normals), limbs, span=after.span)
    return scene


def interpolate_transforms(a: NDArray[np.float32], b: NDArray[np.float32], share: float) -> NDArray[np.float32]:
    """Return transforms part of the way: turned about one axis, sizes kept; float32, shape ``(n, 3, 4)``.

    Two that are more than a quarter turn apart stay as the nearer one is: wheels turn faster than they are told.
    """
    size = np.linalg.norm(a[:, :, :3], axis=1, keepdims=True)
    first, second = a[:, :, :3] / np.maximum(size, 1e-9), b[:, :, :3] / np.maximum(size, 1e-9)
    turn = np.einsum("nij,nkj->nik", second, first)  # what takes the first to the second
    cosine = np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1, 1)
    mixed = first + np.float32(share) * (second - first)
    # Columns are made square to each other again.
    x = mixed[:, :, 0] / np.maximum(np.linalg.norm(mixed[:, :, 0], axis=1, keepdims=True), 1e-9)
    y = mixed[:, :, 1] - (mixed[:, :, 1] * x).sum(1, keepdims=True) * x
    y /= np.maximum(np.linalg.norm(y, axis=1, keepdims=True), 1e-9)
    turned = np.stack([x, y, np.cross(x, y)], axis=2)
    turned[cosine < 0] = (first if share < 0.5 else second)[cosine < 0]
    out = a + np.float32(share) * (b - a)
    out[:, :, :3] = turned * size
    return np.asarray(out, np.float32)


def _set_avatars(moment: SceneMoment) -> None:
    now = moment.placement
    vertices = np.stack([now.x, now.y, now.z], axis=1)
    moment.scene.repose(vertices, moment.normals, moment.limbs, span=moment.span)


def _set_rigid(moment: SceneMoment, matrix: NDArray[np.float32]) -> None:
    placement = moment.placement
    transforms = np.zeros((len(matrix), 4, 4), np.float32)
    transforms[:, :3], transforms[:, 3, 3] = matrix, 1.0
    things = placement.prototype, transforms, placement.entity
    moment.scene.set_rigid(*things, shadowless=moment.shadowless)
    moment.scene.set_openings(moment.openings)
