"""Lenses: which direction every pixel of a picture looks in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.exact import apply_matrix

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

    def taken(self, pictures: NDArray[Any]) -> NDArray[Any]:
        """Return what the lens sees of pictures of the faces, shape ``(f, side, side, ...)``: nearest pixel, else 0."""
        flat = pictures.reshape(-1, *pictures.shape[3:])
        out = flat[np.maximum(self.nearest, 0)]
        out[self.nearest < 0] = 0
        return out

    def blended(self, pictures: NDArray[np.uint8]) -> NDArray[np.uint8]:
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
