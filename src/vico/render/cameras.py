"""Where pictures are taken from: a batch of pinhole cameras of one size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.errors import InputError


@dataclass(frozen=True)
class Cameras:
    """Pinhole cameras in the world frame (ENU metres).

    Attributes
    ----------
    position
        Optical centres, shape ``(k, 3)``.
    forward
        Directions of the optical axes, any length but zero, shape ``(k, 3)``.
    up
        What is up in the pictures, shape ``(3,)`` or ``(k, 3)``. Where it is parallel to `forward`, north is taken.
    fov_y
        Vertical field of view, radians.
    width, height
        Pixels.
    near, far
        Depths between which things are seen, metres.
    hidden_entity
        Entity that a camera does not see (the body that carries it), 0 for none, int32, one value or shape ``(k,)``.

    Notes
    -----
    The centre of pixel ``[row, column]`` lies at ``(column + 0.5, row + 0.5)`` on the image plane, whose principal
    point is the middle of the picture: the pixel looks along ``((column + 0.5 - cx) / fx, (row + 0.5 - cy) / fy, 1)``
    in the camera's axes (x right, y down, z forward).
    """

    position: NDArray[np.float64]
    forward: NDArray[np.float64]
    up: ArrayLike = (0.0, 0.0, 1.0)
    fov_y: float = float(np.pi / 2)
    width: int = 256
    height: int = 256
    near: float = 0.05
    far: float = 600.0
    hidden_entity: ArrayLike = 0

    def __post_init__(self) -> None:
        position = np.atleast_2d(np.asarray(self.position, np.float64))
        forward = np.atleast_2d(np.asarray(self.forward, np.float64))
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "forward", forward)
        if position.shape != forward.shape or position.shape[1:] != (3,):
            raise InputError(
                f"cameras: position {position.shape} and forward {forward.shape} differ; both must be (k, 3)"
            )
        hidden = np.broadcast_to(np.asarray(self.hidden_entity, np.int32), len(position))
        object.__setattr__(self, "hidden_entity", hidden)
        if not (np.isfinite(position).all() and np.isfinite(forward).all()):
            raise InputError("cameras: a position or forward vector is not finite")
        if not (np.linalg.norm(forward, axis=1) > 1e-9).all():
            raise InputError("cameras: a forward vector has no length")
        if not 0 < self.fov_y < np.pi or not 0 < self.near < self.far:
            raise InputError("cameras: need 0 < fov_y < pi and 0 < near < far")
        if not (1 <= self.width <= 16384 and 1 <= self.height <= 16384):
            raise InputError(f"cameras: pictures of {self.width} x {self.height} pixels; each side must be 1 to 16384")

    def __len__(self) -> int:
        return len(self.position)

    def of(self, rows: Sequence[int]) -> Cameras:
        """Return some of the cameras."""
        up, hidden = np.asarray(self.up, np.float64), np.asarray(self.hidden_entity)
        return replace(
            self,
            position=self.position[rows],
            forward=self.forward[rows],
            up=up if up.ndim == 1 else up[rows],
            hidden_entity=hidden[rows],
        )

    @cached_property
    def rotation(self) -> NDArray[np.float64]:
        """Rows are the cameras' right, down and forward unit vectors; shape ``(k, 3, 3)``."""
        ahead = self.forward / np.linalg.norm(self.forward, axis=1, keepdims=True)
        up = np.broadcast_to(np.asarray(self.up, np.float64), ahead.shape)
        right = np.cross(ahead, up)
        length = np.linalg.norm(right, axis=1, keepdims=True)
        vertical = length[:, 0] < 1e-6
        if vertical.any():
            right[vertical] = np.cross(ahead[vertical], np.array([0.0, 1.0, 0.0]))
            length = np.linalg.norm(right, axis=1, keepdims=True)
        right = right / length
        return np.stack([right, np.cross(ahead, right), ahead], axis=1)

    @cached_property
    def extrinsics(self) -> NDArray[np.float64]:
        """World-to-camera transforms (OpenCV axes: x right, y down, z forward); shape ``(k, 4, 4)``."""
        matrix = np.zeros((len(self), 4, 4))
        matrix[:, :3, :3] = self.rotation
        matrix[:, :3, 3] = -np.einsum("kij,kj->ki", self.rotation, self.position)
        matrix[:, 3, 3] = 1.0
        return matrix

    @cached_property
    def intrinsics(self) -> NDArray[np.float64]:
        """Camera matrix in pixels, shape ``(3, 3)``; square pixels, principal point in the middle."""
        focal = self.height / 2 / math.tan(self.fov_y / 2)
        return np.array([[focal, 0, self.width / 2], [0, focal, self.height / 2], [0, 0, 1]])
