"""Things that a detector found in street photos, or that somebody else located: COCO and GeoJSON files.

Boxes in photos become rays; places that were located already are taken as they are.

COCO
    ``images`` (id, file_name, width, height), ``annotations`` (image_id, category_id, bbox, and score where a detector
    made them) and ``categories`` (id, name); what else they hold is not looked at.
GeoJSON
    A FeatureCollection. A feature with `bbox` and `photo` among its properties is a box in a photo (`width` and
    `height` of the photo, `class`, `score`); any other is a thing at its point (`class`, `score`, `photos`).
    Mapillary's map features are read alike: `object_value` is the class.

Poses are those of a folder of street photos (`vico.geo.street_image_folder`); the pictures need not be there.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AliasChoices, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from vico.errors import MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.street_image_folder import FolderImages, PhotoPose
from vico.geo.street_images import is_within
from vico.io.files import read_json, sha256_of

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
    """Content of a file of detections.

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
    """Return why a box can't be used, if it can't."""
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


_MOST_BYTES = 256 << 20
_MARGIN = 60.0  # metres outside the window from which photos show what is in it

Finite = Annotated[float, Field(allow_inf_nan=False)]
Score = Annotated[Finite, Field(ge=0.0, le=1.0)]
Pixels = Annotated[int, Field(ge=1, le=200_000)]
Box = tuple[Finite, Finite, Finite, Finite]
Id = int | str


class _Foreign(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class CocoImage(_Foreign):
    """A photo of a COCO file."""

    id: Id
    file_name: Annotated[str, Field(min_length=1, max_length=400)]
    width: Pixels
    height: Pixels


class CocoAnnotation(_Foreign):
    """A box of a COCO file."""

    id: Id | None = None
    image_id: Id
    category_id: Id
    bbox: Box
    score: Score = 1.0


class CocoCategory(_Foreign):
    """A class of a COCO file."""

    id: Id
    name: Annotated[str, Field(min_length=1, max_length=200)]


class CocoFile(_Foreign):
    """The parts of a COCO file that are looked at."""

    images: list[CocoImage]
    annotations: list[CocoAnnotation]
    categories: list[CocoCategory]


class FeatureProperties(_Foreign):
    """Properties of a feature of a GeoJSON file."""

    name: Annotated[str, Field(min_length=1, max_length=200, validation_alias=AliasChoices("class", "object_value"))]
    score: Score = 1.0
    photo: str | None = None
    photos: list[str] = Field(default_factory=list)
    bbox: Box | None = None
    width: Pixels | None = None
    height: Pixels | None = None


class PointGeometry(_Foreign):
    """A point: longitude, latitude, and a height that is not looked at."""

    type: Literal["Point"]
    coordinates: Annotated[list[Finite], Field(min_length=2, max_length=3)]


class Feature(_Foreign):
    """A feature of a GeoJSON file."""

    type: Literal["Feature"]
    id: Id | None = None
    properties: FeatureProperties
    geometry: PointGeometry | None = None


class FeatureFile(_Foreign):
    """A GeoJSON file."""

    type: Literal["FeatureCollection"]
    features: list[Feature]


def read_detections(path: Path, frame: LocalFrame, half: float, *, photos: Path | None = None) -> Detections:
    """Read a file of detections.

    Parameters
    ----------
    path
        The file.
    frame, half
        The window.
    photos
        Folder with the poses, if they do not lie in the file's own.

    Raises
    ------
    MissingFileError, SchemaError
        If the file or the poses are not there, or damaged; the message names the field.
    """
    path = Path(path)
    if not path.is_file():
        raise MissingFileError(f"{path}: no such file of detections; give COCO's JSON or GeoJSON")
    if path.stat().st_size > _MOST_BYTES:
        raise SchemaError(f"{path}: larger than {_MOST_BYTES >> 20} MB; cut it to the window")
    content = read_json(path)
    boxes, points, refused = _parse_detections(content, path)
    poses: list[PhotoPose] = []
    attributions: list[str] = []
    digest = hashlib.sha256(sha256_of(path).encode())
    if boxes:
        folder = _folder_of_poses(path, photos)
        poses = folder.poses(frame)
        attributions = list(dict.fromkeys(pose.attribution for pose in poses))
        digest.update(sha256_of(folder.files[0]).encode())
    sightings, unseen = sightings_of(boxes, poses, half + _MARGIN)
    located: list[Located] = []
    for key, properties, (lon, lat) in points:
        xy = frame.to_enu(lat, lon)
        if is_within(xy, half):
            seen_in = [*properties.photos, *([] if properties.photo is None else [properties.photo])]
            located.append(Located(key, properties.name, properties.score, xy, tuple(dict.fromkeys(seen_in))))
        else:
            refused.append((key, "it lies outside the window"))
    return Detections(
        tuple(sightings), tuple(located), (*refused, *unseen), "; ".join(attributions), digest.hexdigest()
    )


_Point = tuple[str, FeatureProperties, tuple[float, float]]


def _parse_detections(content: Any, path: Path) -> tuple[list[PhotoBox], list[_Point], list[tuple[str, str]]]:
    """Return boxes, points (with longitude and latitude), and what is neither."""
    if isinstance(content, list):
        raise SchemaError(
            f"{path}: a bare list, as COCO's results are, names neither photos nor classes; put it under annotations "
            "of a file that has images and categories too"
        )
    kind = content.get("type") if isinstance(content, dict) else None
    if kind == "FeatureCollection":
        return _from_geojson(_valid(FeatureFile, content, path).features)
    if isinstance(content, dict) and "annotations" in content:
        boxes, refused = _from_coco(_valid(CocoFile, content, path), path)
        return boxes, [], refused
    raise SchemaError(f"{path}: neither COCO (annotations) nor GeoJSON (FeatureCollection); export it as one of them")


def _valid(kind: type[Any], content: Any, path: Path) -> Any:
    try:
        return TypeAdapter(kind).validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole file"
        raise SchemaError(f"{path}: {where}: {first['msg'].lower()}; correct it") from None


def _from_coco(file: CocoFile, path: Path) -> tuple[list[PhotoBox], list[tuple[str, str]]]:
    images = {image.id: image for image in file.images}
    classes = {category.id: category.name for category in file.categories}
    boxes: list[PhotoBox] = []
    refused: list[tuple[str, str]] = []
    # Keys are ids, or the numbers of all where one has no id.
    ids = [one.id for one in file.annotations]
    numbered = any(one is None for one in ids)
    keys = [f"d{number if numbered else one}" for number, one in enumerate(ids)]
    doubled = next((key for key in keys if keys.count(key) > 1), None) if len(set(keys)) < len(keys) else None
    if doubled is not None:
        raise SchemaError(f"{path}: annotations: id {doubled[1:]} twice; give each its own")
    for key, one in zip(keys, file.annotations, strict=True):
        image, name = images.get(one.image_id), classes.get(one.category_id)
        if image is None or name is None:
            what = f"image {one.image_id}" if image is None else f"category {one.category_id}"
            refused.append((key, f"the file has no {what}"))
            continue
        boxes.append(PhotoBox(key, name, one.score, image.file_name, one.bbox, (image.width, image.height)))
    return boxes, refused


def _from_geojson(features: Sequence[Feature]) -> tuple[list[PhotoBox], list[_Point], list[tuple[str, str]]]:
    boxes: list[PhotoBox] = []
    points: list[_Point] = []
    refused: list[tuple[str, str]] = []
    for number, feature in enumerate(features):
        key = f"d{number if feature.id is None else feature.id}"
        said = feature.properties
        if said.bbox is not None and said.photo is not None:
            if said.width is None or said.height is None:
                refused.append((key, "width and height of its photo are not said"))
            else:
                boxes.append(PhotoBox(key, said.name, said.score, said.photo, said.bbox, (said.width, said.height)))
        elif said.bbox is None and feature.geometry is not None:
            lon, lat = feature.geometry.coordinates[:2]
            if abs(lon) > 180.0 or abs(lat) > 90.0:
                refused.append((key, f"{lat}, {lon} is not on Earth"))
            else:
                points.append((key, said, (lon, lat)))
        else:
            refused.append((key, "neither a box in a photo nor a point"))
    return boxes, points, refused


def _folder_of_poses(path: Path, photos: Path | None) -> FolderImages:
    try:
        return FolderImages(path.parent)
    except MissingFileError:
        if photos is None:
            raise MissingFileError(
                f"{path}: its boxes need the poses of their photos: put photos.json (docs/own_city.md) beside it, or "
                "give the folder with --photos"
            ) from None
        return FolderImages(photos)
