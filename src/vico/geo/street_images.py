"""Photos taken in the street: what one is, what all sources share, and panoramas cut into photos.

Sources are `vico.geo.mapillary`, `vico.geo.google_street_view` and `vico.geo.street_image_folder`; each has a `near`.

Panoramas follow OpenSfM's convention of ``spherical`` cameras, which Mapillary shares: an equirectangular picture
twice as wide as high, whose middle column looks along the camera's forward axis, its right half to the camera's
right, its upper half up.
"""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, UnidentifiedImageError

from vico.errors import SchemaError
from vico.geo.frame import LocalFrame

LONGEST = 1600
"""Pixels of a photo's longer side, by default: 3 cm a pixel on a wall 40 m away, finer than any wall's texels."""

_MOST_PIXELS = 120_000_000
_ACROSS_HEADINGS = 12.0  # metres that looking the opposite way is worth when photos are thinned out


@dataclass(frozen=True)
class StreetImage:
    """A photo and the camera it was taken with, lens distortion removed.

    Attributes
    ----------
    id
        Unique within its source.
    picture
        sRGB, uint8, shape ``(h, w, 3)``.
    position
        Optical centre, ENU metres, shape ``(3,)``.
    rotation
        World to camera (rows are the camera's right, down and forward), shape ``(3, 3)``.
    intrinsics
        Camera matrix in pixels, shape ``(3, 3)``: square pixels, principal point in the middle of the picture, pixel
        ``[row, column]`` has its centre at ``(column + 0.5, row + 0.5)``.
    captured
        When, ISO 8601, if it is told.
    source, attribution
        Name of the source, and whom to credit.
    eye
        Metres above the ground below it, where that is all that is known of its height: ``position[2]`` is the same
        number then, and the camera must be lifted on the terrain. None: ``position[2]`` counts from the world's zero.
    """

    id: str
    picture: NDArray[np.uint8]
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    intrinsics: NDArray[np.float64]
    captured: str | None
    source: str
    attribution: str
    eye: float | None = None


class StreetImages(Protocol):
    """A source of street photos.

    Attributes
    ----------
    name
        The source's name.
    refused
        Id and reason of each photo that the last `near` found and could not use; grows while it runs.
    may_be_kept
        Whether the terms allow to write photos, or textures made from them, to disk.
    """

    name: str
    refused: list[tuple[str, str]]
    may_be_kept: bool

    def near(self, frame: LocalFrame, half: float, *, most: int) -> Iterator[StreetImage]:
        """Photos taken in the square of half side `half` around the origin: at most `most`, spread over it.

        One photo that is missing or broken is left out and told in `refused`.

        Raises
        ------
        SourceError, SchemaError, MissingFileError
            If the source as a whole gives no usable answer.
        """
        ...


def decode_picture(data: bytes, what: str, *, longest: int = LONGEST) -> NDArray[np.uint8]:
    """Return the picture in a JPEG, PNG or WebP file, at most `longest` pixels a side; turned as it is stored.

    Raises
    ------
    SchemaError
        If it is no such file, is damaged, or claims more pixels than a camera has.
    """
    try:
        with warnings.catch_warnings():
            # Its warning about huge pictures has a lower limit than ours.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data), formats=("JPEG", "PNG", "WEBP")) as file:
                width, height = file.size
                if width * height > _MOST_PIXELS:
                    raise SchemaError(f"{what}: {width} x {height} pixels are more than a photo has; leave it out")
                share = min(longest / max(width, height), 1.0)
                size = max(round(width * share), 1), max(round(height * share), 1)
                file.draft("RGB", (size[0] * 2, size[1] * 2))
                picture = file.convert("RGB").resize(size, Image.Resampling.LANCZOS, reducing_gap=3.0)
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        if isinstance(error, SchemaError):
            raise
        raise SchemaError(f"{what}: not a readable photo ({error}); download it again, or leave it out") from None
    return np.asarray(picture, np.uint8)


def pinhole(width: int, height: int, focal: float) -> NDArray[np.float64]:
    """Camera matrix of a picture whose principal point is its middle; `focal` in pixels."""
    return np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])


def undistort(picture: NDArray[np.uint8], focal: float, k1: float, k2: float) -> NDArray[np.uint8]:
    """Return the picture as a pinhole camera of the same focal length (pixels) and size would have taken it.

    Notes
    -----
    OpenSfM's perspective camera: a direction ``(x, y, 1)`` lands at ``focal * (1 + r2 (k1 + k2 r2)) * (x, y)`` from
    the middle, with ``r2 = x^2 + y^2``.
    """
    if k1 == 0.0 and k2 == 0.0:
        return picture
    height, width = picture.shape[:2]
    x = ((np.arange(width) + 0.5 - width / 2) / focal).astype(np.float32)[None, :]
    y = ((np.arange(height) + 0.5 - height / 2) / focal).astype(np.float32)[:, None]
    square = x * x + y * y
    bend = 1.0 + square * (np.float32(k1) + np.float32(k2) * square)
    return sample_picture(picture, x * bend * focal + (width / 2 - 0.5), y * bend * focal + (height / 2 - 0.5))


def sample_picture(
    picture: NDArray[np.uint8], column: NDArray[np.float32], row: NDArray[np.float32]
) -> NDArray[np.uint8]:
    """Return the picture's colours at places between its pixels (0 is the first one's centre), between its edges.

    `column` and `row` have the shape ``(h, w)`` of the picture that is made, which has shape ``(h, w, 3)``.
    """
    height, width = picture.shape[:2]
    column, row = np.clip(column, 0, width - 1.001), np.clip(row, 0, height - 1.001)
    c, r = column.astype(np.int32), row.astype(np.int32)
    right, low = (column - c)[..., None], (row - r)[..., None]
    next_c, next_r = np.minimum(c + 1, width - 1), np.minimum(r + 1, height - 1)
    upper = picture[r, c] * (1 - right) + picture[r, next_c] * right
    lower = picture[next_r, c] * (1 - right) + picture[next_r, next_c] * right
    return np.asarray(np.round(upper * (1 - low) + lower * low), np.uint8)


def rotation_from_axis_angle(angle_axis: ArrayLike) -> NDArray[np.float64]:
    """Return the rotation matrix of an angle-axis vector (radians times unit axis): Rodrigues' formula."""
    vector = np.asarray(angle_axis, np.float64)
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross)


def camera_rotation(heading: float, pitch: float = 0.0, roll: float = 0.0) -> NDArray[np.float64]:
    """World-to-camera rotation from a compass heading (clockwise from north), pitch (up) and roll (clockwise), degrees.

    Roll is the camera's own, seen from behind it: a camera rolled clockwise shows the horizon turned the other way.
    """
    h, p, r = math.radians(heading), math.radians(pitch), math.radians(roll)
    forward = np.array([math.sin(h) * math.cos(p), math.cos(h) * math.cos(p), math.sin(p)])
    right = np.array([math.cos(h), -math.sin(h), 0.0])
    down = np.cross(forward, right)
    return np.stack([right * math.cos(r) + down * math.sin(r), down * math.cos(r) - right * math.sin(r), forward])


def heading_of(rotation: NDArray[np.float64]) -> float:
    """Compass heading of a world-to-camera rotation, degrees in 0..360."""
    return math.degrees(math.atan2(rotation[2, 0], rotation[2, 1])) % 360.0


def select_spread(places: NDArray[np.float64], headings: Sequence[float], most: int) -> list[int]:
    """Which photos to take when there are more than `most`: far from each other, and looking different ways.

    Parameters
    ----------
    places
        ENU metres, shape ``(n, 2)``.
    headings
        Degrees, ``n`` of them.

    Returns
    -------
    list of int
        Indices, the most central first, each next one the farthest from all before it.
    """
    if len(places) == 0 or most < 1:
        return []
    angle = np.radians(np.asarray(headings, np.float64))
    points = np.column_stack([places, np.sin(angle) * _ACROSS_HEADINGS / 2, np.cos(angle) * _ACROSS_HEADINGS / 2])
    chosen = [int(np.argmin(np.hypot(*places.T)))]
    gap = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(most, len(points)):
        gap[chosen[-1]] = -1.0
        chosen.append(int(np.argmax(gap)))
        gap = np.minimum(gap, np.linalg.norm(points - points[chosen[-1]], axis=1))
        gap[chosen] = -1.0
    return chosen


def is_within(xy: ArrayLike, half: float) -> bool:
    """Whether a point lies in the square of half side `half`."""
    return bool(np.abs(np.asarray(xy)[:2]).max() <= half)


KINDS = ("spherical", "equirectangular")
"""Names of cameras of such pictures."""

VIEWS = 6
LONGER = 4
"""A panorama of this many times a photo's width has as many pixels to the degree."""

_ACROSS = 76.0  # degrees that a view is wide: each overlaps its neighbours by 16
_TALL = 0.75  # height of a view over its width
_PITCH = 12.0  # degrees that views look up: the lower half of a panorama is road, and the car it was taken from
_UNEVEN = 0.02  # of the proportion of 2 to 1


def cut_panorama(panorama: StreetImage) -> list[StreetImage]:
    """Cut a panorama into level pictures all around.

    Parameters
    ----------
    panorama
        Its `picture` is equirectangular; `rotation` is of the camera whose forward axis is the middle of it;
        `intrinsics` are ignored.

    Returns
    -------
    list of StreetImage
        `VIEWS` pictures, the first towards the panorama's heading and the others clockwise, with as many pixels to the
        degree as it has; their ids end in ``/0``, ``/60``, ...: degrees clockwise from that heading.

    Raises
    ------
    SchemaError
        If the picture does not show the whole sphere.
    """
    height, width = panorama.picture.shape[:2]
    if abs(width / (2 * height) - 1) > _UNEVEN:
        raise SchemaError(
            f"photo {panorama.id}: {width} x {height} pixels are no whole panorama, which is twice as wide as high; "
            "stitch it anew, or leave it out"
        )
    focal = width / (2 * math.pi)
    wide = max(round(2 * focal * math.tan(math.radians(_ACROSS) / 2)), 2)
    lens = pinhole(wide, max(round(_TALL * wide), 2), focal)
    # The seam at the back is no edge: the columns beside it are neighbours.
    round_about = np.concatenate([panorama.picture, panorama.picture[:, :2]], axis=1)
    heading = heading_of(panorama.rotation)
    views = []
    for k in range(VIEWS):
        turn = 360.0 * k / VIEWS
        rotation = camera_rotation(heading + turn, _PITCH)
        column, row = _whence(panorama.rotation @ rotation.T, lens, width, height)
        picture = sample_picture(round_about, column, row)
        views.append(
            replace(panorama, id=f"{panorama.id}/{turn:.0f}", picture=picture, rotation=rotation, intrinsics=lens)
        )
    return views


def _whence(
    turn: NDArray[np.float64], lens: NDArray[np.float64], width: int, height: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return where in the panorama each pixel of a view lies; `turn` takes the view's axes to the panorama's."""
    wide, tall = round(2 * lens[0, 2]), round(2 * lens[1, 2])
    x = (np.arange(wide) + 0.5 - lens[0, 2]) / lens[0, 0]
    y = (np.arange(tall) + 0.5 - lens[1, 2]) / lens[1, 1]
    ray = np.stack(np.broadcast_arrays(x[None, :], y[:, None], 1.0), axis=-1) @ turn.T
    longitude = np.arctan2(ray[..., 0], ray[..., 2])
    latitude = np.arctan2(-ray[..., 1], np.hypot(ray[..., 0], ray[..., 2]))
    column = (longitude / (2 * np.pi) + 0.5) * width - 0.5
    row = (0.5 - latitude / np.pi) * height - 0.5
    return (column % width).astype(np.float32), row.astype(np.float32)
