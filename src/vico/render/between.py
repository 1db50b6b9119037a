"""A scene between two moments: everything that moves, part of the way from where it was to where it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.scene import Scene
from vico.render.sensors.past import PlacedInstances, as_before, matched, placement_of, vertices_before

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


def show_between(before: SceneMoment, after: SceneMoment, share: float) -> Scene:
    """Put everything `share` (0..1) of the way from one moment to a later one; return the scene.

    What came, went, or leapt in between is where it was until the later moment has come.
    """
    scene = after.scene
    scene.moment = before.second + share * (after.second - before.second)
    if before.scene is not scene or share >= 1.0:
        _show(after)
        return scene
    a, b = before.placement, after.placement
    place, known = matched(a, b)
    matrix = b.matrix.copy()
    if len(a.matrix):
        start = a.matrix[place]
        leaps = np.linalg.norm(b.matrix[:, :, 3] - start[:, :, 3], axis=1) > LEAP
        matrix[known] = start[known]
        moves = known & ~leaps
        matrix[moves] = between(start[moves], b.matrix[moves], share)
    _set_rigid(after, matrix)
    if not len(b.x):
        _set_avatars(after)
    else:
        was, new = vertices_before(a, b), np.stack([b.x, b.y, b.z], axis=1)
        old = as_before(np.stack([a.x, a.y, a.z], axis=1), new, was)
        starts = b.owner[:, 1] - b.owner[0, 1]
        counts = np.diff([*starts.tolist(), len(new)])
        leap = np.abs(new[starts] - old[starts]).max(axis=1) > LEAP
        part = np.repeat(np.where(leap, 0.0, share), counts)[:, None].astype(np.float32)
        normals = as_before(before.normals, after.normals, was)
        limbs = after.limbs
        if len(before.limbs) == len(limbs) == len(leap) and np.array_equal(a.owner[:, 0], b.owner[:, 0]):
            limbs = before.limbs + np.where(leap, 0.0, share)[:, None, None] * (limbs - before.limbs)
        scene.repose(old + part * (new - old), normals + part * (after.normals - normals), limbs, span=after.span)
    return scene


def between(a: NDArray[np.float32], b: NDArray[np.float32], share: float) -> NDArray[np.float32]:
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


def _show(moment: SceneMoment) -> None:
    _set_rigid(moment, moment.placement.matrix)
    _set_avatars(moment)


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
