"""Posed bodies as one mesh: linear blend skinning of many avatars in one call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vico.assets.people import PARENTS, Body


@dataclass(frozen=True)
class Crowd:
    """Bodies laid end to end; index = the avatar's stable order. Made once by `crowd_of`.

    Attributes
    ----------
    starts
        First vertex of each avatar and the total, int32, shape ``(n + 1,)``.
    triangle_starts
        The same for triangles.
    vertices, normals, weight_joints, weights, colour
        As in `Body`, concatenated.
    triangles
        int32, indices into the concatenation.
    entity
        Of each vertex, int32.
    rest_joints, joints, frames
        As in `Body`, stacked, shape ``(n, 55, ...)``.
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

    def __len__(self) -> int:
        return len(self.starts) - 1


def crowd_of(bodies: Sequence[Body], entities: Sequence[int]) -> Crowd:
    """Lay bodies end to end for `skin`; `entities` are their ids in segmentation images."""
    starts = np.cumsum([0, *(len(body.vertices) for body in bodies)]).astype(np.int32)
    triangle_starts = np.cumsum([0, *(len(body.triangles) for body in bodies)]).astype(np.int32)

    def together(name: str, width: int, dtype: Any) -> NDArray[Any]:
        parts = [getattr(body, name) for body in bodies]
        return np.ascontiguousarray(np.concatenate(parts) if parts else np.zeros((0, width)), dtype)

    def stacked(name: str, *shape: int) -> NDArray[np.float32]:
        parts = [getattr(body, name) for body in bodies]
        return np.ascontiguousarray(np.stack(parts) if parts else np.zeros((0, 55, *shape)), np.float32)

    triangles = [body.triangles + start for body, start in zip(bodies, starts[:-1], strict=True)]
    return Crowd(
        starts,
        triangle_starts,
        together("vertices", 3, np.float32),
        together("normals", 3, np.float32),
        together("weight_joints", 4, np.int32),
        together("weights", 4, np.float32),
        together("colour", 3, np.uint8),
        np.ascontiguousarray(np.concatenate(triangles) if triangles else np.zeros((0, 3)), np.int32),
        np.repeat(np.asarray(entities, np.int32), np.diff(starts)),
        stacked("rest_joints", 3),
        stacked("joints", 3),
        stacked("frames", 3, 3),
    )


def skin(
    crowd: Crowd,
    rotations: NDArray[np.float32],
    offsets: NDArray[np.float32],
    positions: NDArray[np.float64],
    yaws: NDArray[np.float64],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Pose every avatar and place it in the world.

    Parameters
    ----------
    crowd
        The bodies.
    rotations
        Axis-angle of each joint relative to its parent, T-pose = 0, radians, float32, shape ``(n, 55, 3)``.
    offsets
        Shift of the pelvis from its T-pose place, in the body's frame, metres, float32, shape ``(n, 3)``.
    positions
        Points on the ground, world metres, float64, shape ``(n, 3)``.
    yaws
        Headings, radians, float64, shape ``(n,)``.

    Returns
    -------
    vertices, normals
        World, float32, shape ``(crowd.starts[-1], 3)``.
    """
    vertices = np.empty_like(crowd.vertices)
    normals = np.empty_like(crowd.normals)
    _skin(
        crowd.starts,
        crowd.vertices,
        crowd.normals,
        crowd.weight_joints,
        crowd.weights,
        crowd.rest_joints,
        crowd.joints,
        crowd.frames,
        PARENTS,
        np.ascontiguousarray(rotations, np.float32),
        np.ascontiguousarray(offsets, np.float32),
        np.ascontiguousarray(positions, np.float64),
        np.ascontiguousarray(yaws, np.float64),
        vertices,
        normals,
    )
    return vertices, normals


@njit(cache=True)
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


@njit(cache=True)
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


# fastmath is safe here: pictures come of it, never state.
@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _skin(
    starts: NDArray[Any],
    vertices: NDArray[Any],
    normals: NDArray[Any],
    weight_joints: NDArray[Any],
    weights: NDArray[Any],
    rest_joints: NDArray[Any],
    joints: NDArray[Any],
    frames: NDArray[Any],
    parents: NDArray[Any],
    rotations: NDArray[Any],
    offsets: NDArray[Any],
    positions: NDArray[Any],
    yaws: NDArray[Any],
    out_vertices: NDArray[Any],
    out_normals: NDArray[Any],
) -> None:
    for i in range(len(yaws)):
        count = len(parents)
        turned = np.empty((count, 3, 3), np.float64)
        placed = np.empty((count, 3), np.float64)
        forward_kinematics(rotations[i], joints[i], parents, offsets[i], turned, placed)
        # One 3x4 matrix a joint, from the mesh's rest pose straight to the world.
        bones = np.empty((count, 12), np.float32)
        cosine, sine = np.cos(yaws[i]), np.sin(yaws[i])
        for j in range(count):
            for c in range(3):
                x = turned[j, 0, 0] * frames[i, j, 0, c] + turned[j, 0, 1] * frames[i, j, 1, c]
                x += turned[j, 0, 2] * frames[i, j, 2, c]
                y = turned[j, 1, 0] * frames[i, j, 0, c] + turned[j, 1, 1] * frames[i, j, 1, c]
                y += turned[j, 1, 2] * frames[i, j, 2, c]
                z = turned[j, 2, 0] * frames[i, j, 0, c] + turned[j, 2, 1] * frames[i, j, 1, c]
                z += turned[j, 2, 2] * frames[i, j, 2, c]
                bones[j, c] = cosine * x - sine * y
                bones[j, 4 + c] = sine * x + cosine * y
                bones[j, 8 + c] = z
            px, py, pz = placed[j, 0], placed[j, 1], placed[j, 2]
            x0, y0, z0 = rest_joints[i, j, 0], rest_joints[i, j, 1], rest_joints[i, j, 2]
            bones[j, 3] = (
                cosine * px - sine * py + positions[i, 0] - (bones[j, 0] * x0 + bones[j, 1] * y0 + bones[j, 2] * z0)
            )
            bones[j, 7] = (
                sine * px + cosine * py + positions[i, 1] - (bones[j, 4] * x0 + bones[j, 5] * y0 + bones[j, 6] * z0)
            )
            bones[j, 11] = pz + positions[i, 2] - (bones[j, 8] * x0 + bones[j, 9] * y0 + bones[j, 10] * z0)
        m = np.empty(12, np.float32)
        for v in range(starts[i], starts[i + 1]):
            w = weights[v, 0]
            j = weight_joints[v, 0]
            for k in range(12):
                m[k] = w * bones[j, k]
            for s in range(1, 4):
                w = weights[v, s]
                if w == 0:
                    break
                j = weight_joints[v, s]
                for k in range(12):
                    m[k] += w * bones[j, k]
            x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
            out_vertices[v, 0] = m[0] * x + m[1] * y + m[2] * z + m[3]
            out_vertices[v, 1] = m[4] * x + m[5] * y + m[6] * z + m[7]
            out_vertices[v, 2] = m[8] * x + m[9] * y + m[10] * z + m[11]
            x, y, z = normals[v, 0], normals[v, 1], normals[v, 2]
            nx = m[0] * x + m[1] * y + m[2] * z
            ny = m[4] * x + m[5] * y + m[6] * z
            nz = m[8] * x + m[9] * y + m[10] * z
            scale = np.float32(1) / np.sqrt(nx * nx + ny * ny + nz * nz + np.float32(1e-20))
            out_normals[v, 0], out_normals[v, 1], out_normals[v, 2] = nx * scale, ny * scale, nz * scale
