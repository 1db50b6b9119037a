"""What a detector found: rays through its boxes, and places that were located already."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.geo.street_images.folder import PhotoPose

_ROUNDS = 12  # of the inversion of a lens's distortion


@dataclass(frozen=True)
class PhotoBox:
    """A box in a photo, as a file has it.

    Attributes
    ----------
    id
        Of the detection, unique in its file.
    name
        Its class, as the detector calls it.
    score
        How sure the detector is, 0..1.
    photo
        Id or file name of the photo.
    box
        Left, top, width and height, pixels.
    size
        Width and height of the photo, pixels.
    """

    id: str
    name: str
    score: float
    photo: str
    box: tuple[float, float, float, float]
    size: tuple[int, int]


@dataclass(frozen=True)
class Sighting:
    """A thing in a posed photo.

    Attributes
    ----------
    id, name, score, photo
        See `PhotoBox`.
    position
        Optical centre, ENU metres, shape ``(3,)``.
    eye
        Metres above the ground, where that is all that is known of its height; see `StreetImage`.
    foot, middle
        Unit rays, ENU, through the middle of the box's lower side, and through its middle, shape ``(3,)``.
    """

    id: str
    name: str
    score: float
    photo: str
    position: NDArray[np.float64]
    eye: float | None
    foot: NDArray[np.float64]
    middle: NDArray[np.float64]


@dataclass(frozen=True)
class Located:
    """A thing whose place is told.

    Attributes
    ----------
    id, name, score
        See `PhotoBox`.
    xy
        ENU metres, shape ``(2,)``.
    photos
        Ids of the photos that it was located by, if they are told.
    """

    id: str
    name: str
    score: float
    xy: NDArray[np.float64]
    photos: tuple[str, ...]


@dataclass(frozen=True)
class Detections:
    """What a file of detections gives.

    Attributes
    ----------
    sightings
        Boxes in posed photos.
    located
        Things whose place is told.
    refused
        Id and reason of what can't be used.
    attribution
        Whom to credit for the photos.
    sha256
        Of the file and of the poses.
    """

    sightings: tuple[Sighting, ...]
    located: tuple[Located, ...]
    refused: tuple[tuple[str, str], ...]
    attribution: str
    sha256: str


def rays_of(pose: PhotoPose, pixels: ArrayLike, width: int, height: int) -> NDArray[np.float64]:
    """Return the directions that pixels of a photo look to.

    Parameters
    ----------
    pose
        Of the photo, which may be distorted or an equirectangular panorama.
    pixels
        Columns and rows, from the picture's upper left corner, shape ``(n, 2)``.
    width, height
        Of the photo, pixels.

    Returns
    -------
    ndarray
        Unit vectors, ENU, shape ``(n, 3)``.
    """
    at = np.asarray(pixels, np.float64).reshape(-1, 2)
    if pose.whole:
        longitude, latitude = (at[:, 0] / width - 0.5) * 2 * np.pi, (0.5 - at[:, 1] / height) * np.pi
        level = np.cos(latitude)
        seen = np.column_stack([np.sin(longitude) * level, -np.sin(latitude), np.cos(longitude) * level])
    else:
        if pose.fov is not None:
            focal = height / 2 / math.tan(math.radians(pose.fov) / 2)
        else:
            focal = (pose.focal or 1.0) * max(width, height)
        bent = (at - (width / 2, height / 2)) / focal
        straight = bent.copy()
        for _ in range(_ROUNDS):
            square = (straight**2).sum(axis=1, keepdims=True)
            straight = bent / np.maximum(1.0 + square * (pose.bend[0] + pose.bend[1] * square), 0.1)
        seen = np.column_stack([straight, np.ones(len(straight))])
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    return np.asarray(seen @ pose.rotation, np.float64)


def sightings_of(
    boxes: Iterable[PhotoBox], poses: Iterable[PhotoPose], reach: float
) -> tuple[list[Sighting], list[tuple[str, str]]]:
    """Return boxes as rays, and the id and reason of each that is none.

    Parameters
    ----------
    boxes
        What was found.
    poses
        Of the photos; one is known by its id, its file's name, and that without suffix.
    reach
        Half the side of the square around the origin in which photos are used, metres.
    """
    known: dict[str, PhotoPose] = {}
    for pose in poses:
        name = pose.file.rsplit("/", 1)[-1]
        for key in (pose.id, pose.file, name, name.rsplit(".", 1)[0]):
            known.setdefault(key, pose)
    found: list[Sighting] = []
    refused: list[tuple[str, str]] = []
    for one in boxes:
        name = one.photo.rsplit("/", 1)[-1]
        seen_from = known.get(one.photo) or known.get(name) or known.get(name.rsplit(".", 1)[0])
        reason = _unusable(one, seen_from, reach)
        if reason is not None or seen_from is None:
            refused.append((one.id, reason or "no pose"))
            continue
        left, top, wide, tall = one.box
        middle = left + wide / 2
        foot, centre = rays_of(seen_from, [(middle, top + tall), (middle, top + tall / 2)], *one.size)
        found.append(
            Sighting(one.id, one.name, one.score, seen_from.id, seen_from.position, seen_from.eye, foot, centre)
        )
    return found, refused


def _unusable(one: PhotoBox, pose: PhotoPose | None, reach: float) -> str | None:
    """Say why a box can't be used, if it can't."""
    left, top, wide, tall = one.box
    if pose is None:
        return f"photo {one.photo} has no pose"
    if not np.isfinite(one.box).all() or wide <= 0 or tall <= 0:
        return f"its box in {one.photo} has no area"
    if left < -1 or top < -1 or left + wide > one.size[0] + 1 or top + tall > one.size[1] + 1:
        return f"its box leaves photo {one.photo}, which is {one.size[0]} x {one.size[1]}"
    if np.abs(pose.position[:2]).max() > reach:
        return f"photo {one.photo} was taken outside the window"
    return None
