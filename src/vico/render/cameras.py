"""Cameras and lenses: where pictures are taken from, and which direction every pixel looks in.

A batch of pinhole cameras has one size. Other lenses look up their pixels in pictures of a cube's faces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.errors import InputError
from vico.exact import apply_matrix


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


PROJECTIONS = ("pinhole", "fisheye", "panorama")
SMALLEST, LARGEST = 16, 4096
#: Degrees from top to bottom where nothing else is said, and the largest that make sense.
_USUAL = {"pinhole": 90.0, "fisheye": 180.0, "panorama": 180.0}
_MOST = {"pinhole": 170.0, "fisheye": 360.0, "panorama": 180.0}


@dataclass(frozen=True)
class Lens:
    """How directions become pixels.

    In the camera's axes (x right, y down, z forward), with focal lengths ``fx, fy`` and the middle of the picture
    ``cx, cy`` as `intrinsics` has them:

    - ``pinhole``: ``column = cx + fx x / z``, ``row = cy + fy y / z``. Depth is measured along the optical axis.
    - ``fisheye`` (equidistant): the distance from the middle is ``fx`` times the angle to the axis, radians; what is
      more than half the field of view off the axis is not seen. Depth is measured along the ray.
    - ``panorama`` (equirectangular, all around): ``column = cx + fx longitude``, ``row = cy + fy latitude``, with
      ``longitude = atan2(x, z)`` and ``latitude = asin(y)`` of the unit vector. Depth is measured along the ray.

    The centre of pixel ``[row, column]`` lies at ``(column + 0.5, row + 0.5)``.

    Attributes
    ----------
    projection
        One of `PROJECTIONS`.
    width, height
        Pixels.
    fov
        Degrees from the upper to the lower edge of a pinhole's picture; across the circle that a fish-eye's shorter
        side spans. A panorama always has 360 by 180.
    """

    projection: str = "pinhole"
    width: int = 256
    height: int = 256
    fov: float = 90.0

    def __post_init__(self) -> None:
        if self.projection not in PROJECTIONS:
            raise InputError(f"camera: projection {self.projection!r}; it has to be one of {', '.join(PROJECTIONS)}")
        for name in ("width", "height"):
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool) or not SMALLEST <= value <= LARGEST:
                raise InputError(f"camera: {name} is {value!r}; it has to be {SMALLEST}..{LARGEST} pixels")
        if not isinstance(self.fov, (int, float)) or not 1.0 <= self.fov <= _MOST[self.projection]:
            raise InputError(
                f"camera: fov is {self.fov!r}; a {self.projection} has 1..{_MOST[self.projection]:.0f} degrees"
            )
        if self.projection == "panorama" and self.fov != _MOST["panorama"]:
            raise InputError(f"camera: fov is {self.fov!r}; a panorama shows all there is, leave fov out")

    @classmethod
    def of(cls, record: Mapping[str, Any], *, side: int = 256) -> Lens:
        """Make a lens of a record with any of its fields; width and height default to each other, or to `side`.

        Raises
        ------
        InputError
            If a field is unknown or its value makes no sense.
        """
        if not isinstance(record, Mapping):
            raise InputError(f"camera: {record!r}; it has to be a record such as {{'projection': 'fisheye'}}")
        known = [field.name for field in fields(cls)]
        unknown = [name for name in record if name not in known]
        if unknown:
            raise InputError(f"camera: there is no setting {unknown[0]!r}; settings are {', '.join(known)}")
        projection = record.get("projection", "pinhole")
        width, height = record.get("width"), record.get("height")
        if projection == "panorama":
            height = height or (width // 2 if isinstance(width, int) else side)
            width = width or (2 * height if isinstance(height, int) else side)
        return cls(
            projection,
            width or height or side,
            height or width or side,
            record.get("fov", _USUAL.get(projection, 90.0)),
        )

    @property
    def is_pinhole(self) -> bool:
        """Whether straight lines stay straight."""
        return self.projection == "pinhole"

    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """Focal lengths and middle, pixels, as a matrix of shape ``(3, 3)``; see the class for what they mean."""
        half = np.radians(self.fov) / 2
        if self.projection == "pinhole":
            fx = fy = self.height / 2 / math.tan(half)
        elif self.projection == "fisheye":
            fx = fy = min(self.width, self.height) / 2 / half
        else:
            fx, fy = self.width / (2 * np.pi), self.height / np.pi
        return np.array([[fx, 0, self.width / 2], [0, fy, self.height / 2], [0, 0, 1]])

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the column and row of points in the camera's axes, shape ``(..., 2)``; NaN where there is none."""
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        k = self.intrinsics
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.projection == "pinhole":
                ahead = np.where(z > 1e-6, z, np.nan)
                a, b = x / ahead, y / ahead
            elif self.projection == "fisheye":
                across = np.hypot(x, y)
                angle = np.arctan2(across, z)
                share = np.where(across > 1e-12, angle / across, 1.0 / np.maximum(z, 1e-12))
                a, b = share * x, share * y
            else:
                a, b = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
        return np.stack([k[0, 2] + k[0, 0] * a, k[1, 2] + k[1, 1] * b], axis=-1)


def directions(lens: Lens) -> NDArray[np.float64]:
    """Return the unit vector that each pixel looks along, camera's axes, shape ``(h, w, 3)``; NaN: it sees nothing."""
    k = lens.intrinsics
    column, row = np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5)
    a, b = (column - k[0, 2]) / k[0, 0], (row - k[1, 2]) / k[1, 1]
    if lens.projection == "pinhole":
        rays = np.stack([a, b, np.ones_like(a)], axis=-1)
        return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))
    if lens.projection == "fisheye":
        angle = np.hypot(a, b)
        share = np.sinc(angle / np.pi)  # sin(angle) / angle
        rays = np.stack([share * a, share * b, np.cos(angle)], axis=-1)
        rays[angle > np.radians(lens.fov) / 2] = np.nan
        return np.asarray(rays)
    return np.stack([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)], axis=-1)


#: Faces of a cube around the camera: what is ahead and what is up in each, camera's axes.
_AHEAD = np.array([[0, 0, 1], [1, 0, 0], [0, 0, -1], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], np.float64)
_UP = np.array([[0, -1, 0], [0, -1, 0], [0, -1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)


@dataclass(frozen=True)
class CubeMap:
    """How a lens looks pixels up in square pictures that look along the faces of a cube around the camera.

    Attributes
    ----------
    faces
        Rows of what is ahead and what is up, camera's axes, shape ``(f, 2, 3)``; only faces that the lens sees.
    side
        Pixels along a face.
    nearest
        Pixel of the stacked faces nearest to each pixel's ray, int64, shape ``(h, w)``; -1 where the lens sees nothing.
    stretch
        Distance along the ray for a depth of 1 there, float32, shape ``(h, w)``.
    pixel
        Column and row of the nearest pixel's ray in the lens's picture, shape ``(h, w, 2)``: within half a pixel.
    corners, shares
        The four pixels around each ray and their weights, shape ``(4, h, w)``.
    """

    faces: NDArray[np.float64]
    side: int
    nearest: NDArray[np.int64]
    stretch: NDArray[np.float32]
    pixel: NDArray[np.float64]
    corners: NDArray[np.int64]
    shares: NDArray[np.float32]

    def sample_nearest(self, pictures: NDArray[Any]) -> NDArray[Any]:
        """Return what the lens sees of pictures of the faces, shape ``(f, side, side, ...)``: nearest pixel, else 0."""
        flat = pictures.reshape(-1, *pictures.shape[3:])
        out = flat[np.maximum(self.nearest, 0)]
        out[self.nearest < 0] = 0
        return out

    def sample_bilinear(self, pictures: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return colours that the lens sees, of the four pixels around each ray."""
        flat = pictures.reshape(-1, pictures.shape[-1])
        mixed = np.zeros((*self.nearest.shape, pictures.shape[-1]), np.float32)
        for corner, share in zip(self.corners, self.shares, strict=True):
            mixed += flat[corner] * share[..., None]
        mixed[self.nearest < 0] = 0
        return np.round(mixed).astype(np.uint8)


@lru_cache(maxsize=8)
def cube_map(lens: Lens) -> CubeMap:
    """Return how a fish-eye or panorama is put together."""
    rays = directions(lens)
    seen = np.isfinite(rays[..., 0])
    rays = np.where(seen[..., None], rays, _AHEAD[0])
    face = apply_matrix(rays, _AHEAD).argmax(axis=-1)
    used, number = np.unique(face[seen], return_inverse=True)
    compact = np.zeros(face.shape, np.int64)
    compact[seen] = number
    # A face's pixels are finest in its corners: in its middle they are as fine as the picture's.
    side = int(np.clip(np.ceil(2 * lens.intrinsics[0, 0]), SMALLEST, LARGEST))
    ahead, up = _AHEAD[face], _UP[face]
    right = np.cross(ahead, up)
    depth = (rays * ahead).sum(axis=-1)
    x = ((rays * right).sum(axis=-1) / depth + 1) * side / 2
    y = (1 - (rays * up).sum(axis=-1) / depth) * side / 2
    start = compact * side * side

    def pixel(column: NDArray[np.int64], row: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.asarray(start + np.clip(row, 0, side - 1) * side + np.clip(column, 0, side - 1))

    near_x, near_y = np.clip(x.astype(np.int64), 0, side - 1), np.clip(y.astype(np.int64), 0, side - 1)
    nearest = np.where(seen, pixel(near_x, near_y), -1)
    a, b = (near_x + 0.5) * 2 / side - 1, (near_y + 0.5) * 2 / side - 1
    low_x, low_y = np.floor(x - 0.5).astype(np.int64), np.floor(y - 0.5).astype(np.int64)
    s, t = x - 0.5 - low_x, y - 0.5 - low_y
    corners = np.stack([pixel(low_x + i, low_y + j) for j in (0, 1) for i in (0, 1)])
    shares = np.stack([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t]).astype(np.float32)
    return CubeMap(
        np.stack([_AHEAD[used], _UP[used]], axis=1),
        side,
        nearest,
        np.sqrt(1 + a * a + b * b).astype(np.float32),
        lens.project(ahead + a[..., None] * right - b[..., None] * up),
        corners,
        shares,
    )
