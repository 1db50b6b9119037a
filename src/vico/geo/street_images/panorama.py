"""Panoramas of the whole sphere, cut into pictures as a pinhole camera takes them.

The convention is OpenSfM's of ``spherical`` cameras, which Mapillary shares: an equirectangular picture twice as wide
as high, whose middle column looks along the camera's forward axis, its right half to the camera's right, its upper half
up.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.geo.street_images.model import StreetImage, heading_of, looking, pinhole, sampled

KINDS = ("spherical", "equirectangular")
"""What cameras of such pictures are called."""

VIEWS = 6
LONGER = 4
"""A panorama of this many times a photo's width has as many pixels to the degree."""

_ACROSS = 76.0  # degrees that a view is wide: each overlaps its neighbours by 16
_TALL = 0.75  # height of a view over its width
_PITCH = 12.0  # degrees that views look up: the lower half of a panorama is road, and the car it was taken from
_UNEVEN = 0.02  # of the proportion of 2 to 1


def cut(panorama: StreetImage) -> list[StreetImage]:
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
        rotation = looking(heading + turn, _PITCH)
        column, row = _whence(panorama.rotation @ rotation.T, lens, width, height)
        picture = sampled(round_about, column, row)
        views.append(
            replace(panorama, id=f"{panorama.id}/{turn:.0f}", picture=picture, rotation=rotation, intrinsics=lens)
        )
    return views


def _whence(
    turn: NDArray[np.float64], lens: NDArray[np.float64], width: int, height: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where in the panorama each pixel of a view lies; `turn` takes the view's axes to the panorama's."""
    wide, tall = round(2 * lens[0, 2]), round(2 * lens[1, 2])
    x = (np.arange(wide) + 0.5 - lens[0, 2]) / lens[0, 0]
    y = (np.arange(tall) + 0.5 - lens[1, 2]) / lens[1, 1]
    ray = np.stack(np.broadcast_arrays(x[None, :], y[:, None], 1.0), axis=-1) @ turn.T
    longitude = np.arctan2(ray[..., 0], ray[..., 2])
    latitude = np.arctan2(-ray[..., 1], np.hypot(ray[..., 0], ray[..., 2]))
    column = (longitude / (2 * np.pi) + 0.5) * width - 0.5
    row = (0.5 - latitude / np.pi) * height - 0.5
    return (column % width).astype(np.float32), row.astype(np.float32)
