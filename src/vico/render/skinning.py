"""Posed bodies as one mesh: linear blend skinning of many avatars in one call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import PARENTS, J, SkinnedBody
from vico.io.compiled import compiled
from vico.render.limbs import HEAD, LIMB_JOINTS, LIMB_RADIUS, LIMB_WAYS, LIMBS, LimbSizes, limb_sizes
from vico.threads import for_each


@dataclass(frozen=True)
class BodyBatch:
    """Bodies laid end to end; index = the avatar's stable order. Made once by `batch_bodies`.

    Attributes
    ----------
    starts
        First vertex of each avatar and the total, int32, shape ``(n + 1,)``.
    triangle_starts
        The same for triangles.
    vertices, normals, weight_joints, weights, colour
        As in `SkinnedBody`, concatenated.
    triangles
        int32, indices into the concatenation.
    entity
        Of each vertex, int32.
    rest_joints, joints, frames
        As in `SkinnedBody`, stacked, shape ``(n, 55, ...)``.
    limbs
        How large the capsules are that throw their shadows.
    """

    starts: NDArray[np.int32]
    triangle_starts: NDArray[np.int32]
    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    weight_joints: NDArray[np.int32]
    weights: NDArray[np.float32]
    colour: NDArray[np.uint8]
    triangles: NDArray[np.int32]
    entity: NDArray[np.int32]
    rest_joints: NDArray[np.float32]
    joints: NDArray[np.float32]
    frames: NDArray[np.float32]
    limbs: LimbSizes

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def nbytes(self) -> int:
        """Bytes of its arrays."""
        arrays = [getattr(self, field.name) for field in fields(self) if field.name != "limbs"]
        return sum(array.nbytes for array in arrays)

    def body(self, number: int, whole: SkinnedBody) -> SkinnedBody:
        """Return one of the bodies as it was given, but with its vertices in the batch's arrays, without a copy."""
        part = slice(self.starts[number], self.starts[number + 1])
        return replace(
            whole,
            vertices=self.vertices[part],
            normals=self.normals[part],
            weight_joints=self.weight_joints[part],
            weights=self.weights[part],
            colour=self.colour[part],
        )


def batch_bodies(bodies: Sequence[SkinnedBody], entities: Sequence[int]) -> BodyBatch:
    """Lay bodies end to end for `skin`; `entities` are their ids in segmentation images."""
    starts = np.cumsum([0, *(len(body.vertices) for body in bodies)]).astype(np.int32)
    triangle_starts = np.cumsum([0, *(len(body.triangles) for body in bodies)]).astype(np.int32)

    def together(name: str, width: int, dtype: Any) -> NDArray[Any]:
        parts = [getattr(body, name) for body in bodies]
        return np.ascontiguousarray(np.concatenate(parts) if parts else np.zeros((0, width)), dtype)

    def stack(name: str, *shape: int) -> NDArray[np.float32]:
        parts = [getattr(body, name) for body in bodies]
        return np.ascontiguousarray(np.stack(parts) if parts else np.zeros((0, 55, *shape)), np.float32)

    triangles = [body.triangles + start for body, start in zip(bodies, starts[:-1], strict=True)]
    return BodyBatch(
        starts,
        triangle_starts,
        together("vertices", 3, np.float32),
        together("normals", 3, np.float32),
        together("weight_joints", 4, np.int32),
        together("weights", 4, np.float32),
        together("colour", 3, np.uint8),
        np.ascontiguousarray(np.concatenate(triangles) if triangles else np.zeros((0, 3)), np.int32),
        np.repeat(np.asarray(entities, np.int32), np.diff(starts)),
        stack("rest_joints", 3),
        stack("joints", 3),
        stack("frames", 3, 3),
        limb_sizes(list(bodies)),
    )


def skin(
    batch: BodyBatch,
    rotations: NDArray[np.float32],
    offsets: NDArray[np.float32],
    positions: NDArray[np.float64],
    yaws: NDArray[np.float64],
    *,
    drawn: NDArray[np.int64] | None = None,
    limbs: NDArray[np.float32] | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Pose every avatar and place it in the world.

    Parameters
    ----------
    batch
        The bodies; of n people, or after these the bodies of the same n people once more, in another shape.
    rotations
        Axis-angle of each joint relative to its parent, T-pose = 0, radians, float32, shape ``(n, 55, 3)``.
    offsets
        Shift of the pelvis from its T-pose place, in the body's frame, metres, float32, shape ``(n, 3)``.
    positions
        Points on the ground, world metres, float64, shape ``(n, 3)``.
    yaws
        Headings, radians, float64, shape ``(n,)``.
    drawn
        Which bodies of the batch; the vertices of the others are left undefined. None: every one.
    limbs
        Written, where given: the capsules of each body's limbs, both ends and radius, world metres, float32, shape
        ``(len(batch), len(LIMBS), 7)``.

    Returns
    -------
    vertices, normals
        World, float32, shape ``(batch.starts[-1], 3)``.
    """
    vertices = np.empty_like(batch.vertices)
    normals = np.empty_like(batch.normals)
    bodies = _Bodies(
        batch.starts,
        batch.vertices,
        batch.normals,
        batch.weight_joints,
        batch.weights,
        batch.rest_joints,
        batch.joints,
        batch.frames,
        batch.limbs.radius,
        batch.limbs.head,
    )
    poses = _Poses(
        np.ascontiguousarray(rotations, np.float32),
        np.ascontiguousarray(offsets, np.float32),
        np.ascontiguousarray(positions, np.float64),
        np.ascontiguousarray(yaws, np.float64),
    )
    # Each thread some of the bodies, which is the same as one thread all of them.
    rows = np.arange(len(batch)) if drawn is None else np.asarray(drawn, np.int64)
    bounds = np.linspace(0, len(rows), min(_PARTS, max(len(rows) // _LEAST, 1)) + 1).astype(np.int64)
    capsules = _NO_LIMBS if limbs is None else limbs
    for_each(
        lambda k: _skin(bodies, poses, PARENTS, rows[bounds[k] : bounds[k + 1]], (vertices, normals, capsules)),
        range(len(bounds) - 1),
    )
    return vertices, normals


@compiled
def rotation_matrix(axis_angle: NDArray[Any], out: NDArray[Any]) -> None:
    """Write the rotation matrix of an axis-angle vector (Rodrigues' formula)."""
    x, y, z = axis_angle[0], axis_angle[1], axis_angle[2]
    square = x * x + y * y + z * z
    if square < 1e-12:
        a, b = 1.0, 0.5
    else:
        angle = np.sqrt(square)
        a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / square
    out[0, 0], out[0, 1], out[0, 2] = 1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y
    out[1, 0], out[1, 1], out[1, 2] = b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x
    out[2, 0], out[2, 1], out[2, 2] = b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)


@compiled
def forward_kinematics(
    rotations: NDArray[Any],
    joints: NDArray[Any],
    parents: NDArray[Any],
    offset: NDArray[Any],
    turned: NDArray[Any],
    placed: NDArray[Any],
) -> None:
    """Write the joints' rotations (55, 3, 3) and positions (55, 3) in the body's frame."""
    local = np.empty((3, 3), np.float64)
    for j in range(len(parents)):
        rotation_matrix(rotations[j], local)
        p = parents[j]
        if p < 0:
            for r in range(3):
                placed[j, r] = joints[j, r] + offset[r]
                for c in range(3):
                    turned[j, r, c] = local[r, c]
            continue
        for r in range(3):
            placed[j, r] = placed[p, r]
            for c in range(3):
                placed[j, r] += turned[p, r, c] * (joints[j, c] - joints[p, c])
                turned[j, r, c] = (
                    turned[p, r, 0] * local[0, c] + turned[p, r, 1] * local[1, c] + turned[p, r, 2] * local[2, c]
                )


class _Bodies(NamedTuple):
    """Arrays of a `BodyBatch` that skinning reads."""

    starts: NDArray[np.int32]
    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    weight_joints: NDArray[np.int32]
    weights: NDArray[np.float32]
    rest_joints: NDArray[np.float32]
    joints: NDArray[np.float32]
    frames: NDArray[np.float32]
    limb_radius: NDArray[np.float32]
    head: NDArray[np.float32]


class _Poses(NamedTuple):
    """How everybody stands, and where; see `skin`."""

    rotations: NDArray[np.float32]
    offsets: NDArray[np.float32]
    positions: NDArray[np.float64]
    yaws: NDArray[np.float64]


# Bodies are shared out among threads in so many parts, of so many at least.
_PARTS, _LEAST = 4, 4
_NO_LIMBS = np.zeros((0, len(LIMBS), 7), np.float32)

_HEAD_JOINT = J["head"]

# fastmath is safe here: pictures come of it, never state.
_fast: Any = compiled(nogil=True, fastmath=True, error_model="numpy")
_fast_inlined: Any = compiled(nogil=True, fastmath=True, error_model="numpy", forceinline=True)


@_fast
def _skin(bodies: Any, poses: Any, parents: Any, which: Any, out: Any) -> None:
    """Write vertices and normals of the bodies `which`."""
    count, starts = len(parents), bodies.starts
    out_vertices, out_normals, limbs = out
    for body in which:
        i = body % len(poses.rotations)
        turned = np.empty((count, 3, 3), np.float64)
        placed = np.empty((count, 3), np.float64)
        forward_kinematics(poses.rotations[i], bodies.joints[body], parents, poses.offsets[i], turned, placed)
        bones = np.empty((count, 3, 4), np.float32)
        rest_joints, frames, position = bodies.rest_joints[body], bodies.frames[body], poses.positions[i]
        cosine, sine = np.cos(poses.yaws[i]), np.sin(poses.yaws[i])
        for j in range(count):
            _set_bone(turned[j], frames[j], cosine, sine, bones[j])
            _set_origin(bones[j], placed[j], rest_joints[j], position, cosine, sine)
        _blend_vertices(bodies, bones, starts[body], starts[body + 1], out_vertices, out_normals)
        if len(limbs):
            _set_limbs(placed, turned[_HEAD_JOINT], bodies.head[body], limbs[body])
            for k in range(len(LIMB_WAYS)):
                limbs[body, k, LIMB_RADIUS] = bodies.limb_radius[body, k]
                for end in range(2):
                    x, y = limbs[body, k, 3 * end], limbs[body, k, 3 * end + 1]
                    limbs[body, k, 3 * end] = cosine * x - sine * y + position[0]
                    limbs[body, k, 3 * end + 1] = sine * x + cosine * y + position[1]
                    limbs[body, k, 3 * end + 2] += position[2]


@_fast_inlined
def _set_bone(turned: Any, frame: Any, cosine: float, sine: float, bone: Any) -> None:
    """Write the rotation of a joint from the mesh's rest pose straight to the world."""
    for c in range(3):
        x = turned[0, 0] * frame[0, c] + turned[0, 1] * frame[1, c]
        x += turned[0, 2] * frame[2, c]
        y = turned[1, 0] * frame[0, c] + turned[1, 1] * frame[1, c]
        y += turned[1, 2] * frame[2, c]
        z = turned[2, 0] * frame[0, c] + turned[2, 1] * frame[1, c]
        z += turned[2, 2] * frame[2, c]
        bone[0, c] = cosine * x - sine * y
        bone[1, c] = sine * x + cosine * y
        bone[2, c] = z


@_fast_inlined
def _set_origin(bone: Any, placed: Any, rest: Any, position: Any, cosine: float, sine: float) -> None:
    """Write the translation of a joint, so that its rest position comes to where it is `placed`."""
    px, py, pz = placed[0], placed[1], placed[2]
    x0, y0, z0 = rest[0], rest[1], rest[2]
    bone[0, 3] = cosine * px - sine * py + position[0] - (bone[0, 0] * x0 + bone[0, 1] * y0 + bone[0, 2] * z0)
    bone[1, 3] = sine * px + cosine * py + position[1] - (bone[1, 0] * x0 + bone[1, 1] * y0 + bone[1, 2] * z0)
    bone[2, 3] = pz + position[2] - (bone[2, 0] * x0 + bone[2, 1] * y0 + bone[2, 2] * z0)


@_fast_inlined
def _set_limbs(placed: Any, head_turned: Any, head: Any, limbs: Any) -> None:
    """Write both ends of a body's limbs, in its frame."""
    for k in range(len(LIMB_WAYS)):
        for end in range(2):
            a, b, way = LIMB_JOINTS[k, end, 0], LIMB_JOINTS[k, end, 1], LIMB_WAYS[k, end]
            for axis in range(3):
                limbs[k, 3 * end + axis] = placed[a, axis] + way * (placed[b, axis] - placed[a, axis])
    for axis in range(3):
        m = head_turned[axis]
        limbs[HEAD, 3 + axis] += m[0] * head[0] + m[1] * head[1] + m[2] * head[2]


@_fast_inlined
def _blend_vertices(bodies: Any, bones: Any, first: int, end: int, out_vertices: Any, out_normals: Any) -> None:
    """Move one person's vertices and normals, each by the mean of its joints' transforms."""
    weights, weight_joints, vertices, normals = bodies.weights, bodies.weight_joints, bodies.vertices, bodies.normals
    m = np.empty((3, 4), np.float32)
    for v in range(first, end):
        w, j = weights[v, 0], weight_joints[v, 0]
        for r in range(3):
            for c in range(4):
                m[r, c] = w * bones[j, r, c]
        for s in range(1, 4):
            w = weights[v, s]
            if w == 0:
                break
            j = weight_joints[v, s]
            for r in range(3):
                for c in range(4):
                    m[r, c] += w * bones[j, r, c]
        x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        out_vertices[v, 0] = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3]
        out_vertices[v, 1] = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3]
        out_vertices[v, 2] = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3]
        x, y, z = normals[v, 0], normals[v, 1], normals[v, 2]
        nx = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
        ny = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
        nz = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
        scale = np.float32(1) / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-20))
        out_normals[v, 0], out_normals[v, 1], out_normals[v, 2] = nx * scale, ny * scale, nz * scale
