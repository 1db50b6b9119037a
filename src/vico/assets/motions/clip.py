"""A recorded motion of a person on the 55 joints of SMPL-X, whatever file it came from, set on the ground.

Feet stand on the ground where they are lowest. Rotations of many frames at once are matrices of shape ``(..., 3, 3)``
and axis-angle vectors of shape ``(..., 3)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vico.assets.people import JOINTS, PARENTS, Appearance, J, body_of
from vico.errors import InputError, SchemaError
from vico.io.plain_data import read_plain, write_plain

#: Motions are scaled to a body whose hips stand so high in the T-pose, metres.
HIP_HEIGHT = 0.92
#: Longest motion, frames; and fastest, frames a second.
MOST_FRAMES, MOST_RATE = 200_000, 1000.0

_SCHEMA = "vico.motion.1"


@dataclass(frozen=True)
class MotionClip:
    """A recorded motion.

    Attributes
    ----------
    name
        For people to read.
    rate
        Frames a second.
    position
        Of the pelvis, metres for a body whose hips are `HIP_HEIGHT` high, z up, float32, shape ``(t, 3)``.
    orientation
        Of the pelvis, axis-angle, radians: it turns a body in the T-pose that faces along x, float32, shape ``(t, 3)``.
    pose
        Of the other 54 joints in the order of `vico.assets.people.JOINTS`, axis-angle relative to the parent, radians,
        about axes that are the body's in the T-pose (x forward, y left, z up), float32, shape ``(t, 54, 3)``: the 162
        pose numbers of SMPL-X, its axes renamed.
    notes
        What of its file was read otherwise than it is written, a sentence each; not kept in files.

    Raises
    ------
    InputError
        If shapes do not fit each other, or a number is not finite.
    """

    name: str
    rate: float
    position: NDArray[np.float32]
    orientation: NDArray[np.float32]
    pose: NDArray[np.float32]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        t = len(self.position)
        if not 1 <= t <= MOST_FRAMES:
            raise InputError(f"motion {self.name!r}: {t} frames; it has to be 1..{MOST_FRAMES}")
        if not 0 < self.rate <= MOST_RATE:
            raise InputError(
                f"motion {self.name!r}: {self.rate} frames a second; it has to be above 0, to {MOST_RATE:g}"
            )
        shapes = {"position": (t, 3), "orientation": (t, 3), "pose": (t, len(JOINTS) - 1, 3)}
        for field, shape in shapes.items():
            array = getattr(self, field)
            if array.shape != shape:
                raise InputError(f"motion {self.name!r}: {field} has shape {array.shape}; it has to be {shape}")
            if not np.isfinite(array).all():
                raise InputError(f"motion {self.name!r}: {field} holds numbers that are not finite; repair the file")

    def __len__(self) -> int:
        return len(self.position)

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return len(self) / self.rate

    def rotations(self, frame: int) -> NDArray[np.float32]:
        """Return the joints of a frame as `vico.render.skinning` takes them, the pelvis first, shape ``(55, 3)``."""
        return np.concatenate([self.orientation[frame, None], self.pose[frame]])

    def offset(self, frame: int, pelvis: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return how far a body's pelvis is from its place in the T-pose, for a body standing where the motion begins.

        Parameters
        ----------
        pelvis
            Where the body's pelvis is in the T-pose, metres, shape ``(3,)``.
        """
        scale = float(pelvis[2]) / HIP_HEIGHT
        moved = self.position[frame].astype(np.float64) * scale
        moved[:2] -= self.position[0, :2].astype(np.float64) * scale
        return np.asarray(moved - [0.0, 0.0, pelvis[2]], np.float32)

    def write(self, path: Path) -> None:
        """Write it to a file, whole or not at all."""
        fields = {name: getattr(self, name) for name in ("name", "rate", "position", "orientation", "pose")}
        write_plain(path, {"schema": _SCHEMA, **fields})


def read_motion(path: Path) -> MotionClip:
    """Read what `MotionClip.write` wrote.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is damaged, or no motion.
    """
    record = read_plain(path)
    if not isinstance(record, dict) or record.pop("schema", None) != _SCHEMA:
        raise SchemaError(f"{path}: no motion of this version; import it anew with vico motion import")
    try:
        return MotionClip(**record)
    except (TypeError, AttributeError, InputError) as error:
        raise SchemaError(f"{path}: {error}; import it anew with vico motion import") from None


Matrices = NDArray[np.float64]


def rotation_matrices(vectors: NDArray[Any]) -> Matrices:
    """Return rotation matrices of axis-angle vectors, radians."""
    flat = Rotation.from_rotvec(np.asarray(vectors, np.float64).reshape(-1, 3)).as_matrix()
    return flat.reshape(*vectors.shape[:-1], 3, 3)


def rotation_vectors(matrices: Matrices) -> NDArray[np.float32]:
    """Return axis-angle vectors of rotation matrices, radians, the shorter way."""
    flat = Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_rotvec()
    return np.asarray(flat, np.float32).reshape(*matrices.shape[:-2], 3)


def matrices_from_quaternions(quaternions: NDArray[Any]) -> Matrices:
    """Return rotation matrices of quaternions x, y, z, w, shape ``(..., 4)``."""
    flat = Rotation.from_quat(np.asarray(quaternions, np.float64).reshape(-1, 4)).as_matrix()
    return flat.reshape(*quaternions.shape[:-1], 3, 3)


def matrices_from_angles(angles: NDArray[np.float64], axes: Sequence[str]) -> Matrices:
    """Return the product of rotations about axes in the order they are named.

    Parameters
    ----------
    angles
        Degrees, shape ``(t, k)``.
    axes
        ``"X"``, ``"Y"`` or ``"Z"`` for each column.
    """
    found = np.broadcast_to(np.eye(3), (len(angles), 3, 3))
    for k, axis in enumerate(axes):
        found = found @ Rotation.from_euler(axis.lower(), angles[:, k : k + 1], degrees=True).as_matrix()
    return np.asarray(found)


def rotation_between(a: NDArray[np.float64], b: NDArray[np.float64]) -> Matrices:
    """Return the smallest rotation that turns one direction into another, shape ``(3, 3)``."""
    u, v = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(u, v), float(u @ v)
    if cosine < -0.999999:  # any axis across it
        across = np.cross(u, [1.0, 0.0, 0.0] if abs(u[0]) < 0.9 else [0.0, 1.0, 0.0])
        return np.asarray(Rotation.from_rotvec(np.pi * across / np.linalg.norm(across)).as_matrix())
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + cosine)


_FEET = tuple(J[f"{side}_{part}"] for side in ("left", "right") for part in ("ankle", "foot"))
# Of all frames so many have a foot on the ground, at least, percent.
_STANDING = 4.0


def joint_positions(clip: MotionClip, joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where a body's joints are in every frame, metres, shape ``(t, 55, 3)``.

    Parameters
    ----------
    joints
        Of the body in the T-pose, the soles at z = 0, metres, shape ``(55, 3)``.
    """
    turned = np.concatenate([clip.orientation[:, None], clip.pose], axis=1).astype(np.float64)
    world = rotation_matrices(turned)
    placed = np.empty((len(clip), len(joints), 3))
    placed[:, 0] = clip.position.astype(np.float64) * (joints[0, 2] / HIP_HEIGHT)
    for k in range(1, len(joints)):
        parent = PARENTS[k]
        placed[:, k] = placed[:, parent] + world[:, parent] @ (joints[k] - joints[parent])
        world[:, k] = world[:, parent] @ world[:, k]
    return placed


def ground_motion(clip: MotionClip) -> MotionClip:
    """Return a motion moved up or down so that feet stand on the ground where they are lowest.

    Files tell neither how high the soles are below the ankles nor, some of them, where the ground is.
    """
    joints = _ground_reference()
    feet = list(_FEET)
    above = joint_positions(clip, joints)[:, feet, 2] - joints[feet, 2]
    sunk = float(np.percentile(above.min(axis=1), _STANDING)) * HIP_HEIGHT / float(joints[0, 2])
    return replace(clip, position=clip.position - np.array([0.0, 0.0, sunk], np.float32))


@cache
def _ground_reference() -> NDArray[np.float64]:
    """Return the joints of an average body in the T-pose, shape ``(55, 3)``."""
    return body_of(Appearance(), source="procedural").joints.astype(np.float64)
