"""Street photos from a folder, with poses in one of three files.

``photos.json`` (ours)
    ::

        {"schema": "vico.photos", "version": 1, "attribution": "Jane Doe, CC BY 4.0",
         "photos": [{"file": "a.jpg", "lat": 60.169, "lon": 24.9435, "eye": 1.6, "heading": 75.0,
                     "pitch": 5.0, "roll": 0.0, "fov": 55.0, "k1": 0.0, "k2": 0.0, "captured": "2024-05-01T12:00:00Z"}]}

    `heading` is clockwise from north and `pitch` upwards, degrees; `fov` is the vertical field of view, degrees (or
    `focal`: over the longer side); `eye` is metres above the ground, or `altitude` metres above the world's zero.
    Only `file`, `lat`, `lon`, `heading` and one of `fov` and `focal` are needed. A panorama of the whole sphere says
    ``"projection": "equirectangular"`` instead of `fov` and `focal`; its `heading` is that of its middle column.
``reconstruction*.json`` (OpenSfM)
    Cameras, shots and ``reference_lla``; perspective and spherical cameras only.
``images.json`` (an answer of Mapillary's API)
    The pictures' addresses are names of files in the folder.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from vico.errors import EmptyInputError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.mapillary import EYE, images_in
from vico.geo.street_images import (
    KINDS,
    LONGER,
    LONGEST,
    StreetImage,
    camera_rotation,
    cut_panorama,
    decode_picture,
    heading_of,
    is_within,
    pinhole,
    rotation_from_axis_angle,
    select_spread,
    undistort,
)

_MOST_BYTES = 64 << 20
_MOST_JSON = 512 << 20

Number = Annotated[float, Field(allow_inf_nan=False)]
Latitude = Annotated[Number, Field(ge=-90, le=90)]
Longitude = Annotated[Number, Field(ge=-180, le=180)]
Bend = Annotated[Number, Field(ge=-2, le=2)]


class Photo(BaseModel):
    """One photo of ``photos.json``; see the module."""

    model_config = ConfigDict(extra="forbid")
    file: Annotated[str, Field(min_length=1, max_length=200)]
    lat: Latitude
    lon: Longitude
    heading: Number
    pitch: Annotated[Number, Field(ge=-89, le=89)] = 0.0
    roll: Number = 0.0
    projection: Literal["perspective", "equirectangular"] = "perspective"
    fov: Annotated[Number, Field(ge=5, le=160)] | None = None
    focal: Annotated[Number, Field(ge=0.1, le=10)] | None = None
    eye: Annotated[Number, Field(ge=0, le=200)] = 1.7
    altitude: Number | None = None
    k1: Bend = 0.0
    k2: Bend = 0.0
    captured: str | None = None

    @model_validator(mode="after")
    def _one_lens(self) -> Photo:
        if self.projection == "equirectangular":
            if not (self.fov is None and self.focal is None and self.k1 == self.k2 == 0.0):
                raise ValueError("an equirectangular panorama has no fov, focal, k1 and k2")
        elif (self.fov is None) == (self.focal is None):
            raise ValueError("give one of fov and focal")
        return self


class Photos(BaseModel):
    """``photos.json``."""

    model_config = ConfigDict(extra="forbid")
    schema_name: Annotated[Literal["vico.photos"], Field(alias="schema")]
    version: Literal[1]
    attribution: str
    photos: list[Photo]


class ReconstructedCamera(BaseModel):
    """A camera of an OpenSfM reconstruction."""

    model_config = ConfigDict(extra="ignore")
    projection_type: str
    focal: Annotated[Number, Field(ge=0.1, le=10)] | None = None
    k1: Bend = 0.0
    k2: Bend = 0.0


class OpenSfmShot(BaseModel):
    """A photo of an OpenSfM reconstruction."""

    model_config = ConfigDict(extra="ignore")
    rotation: tuple[Number, Number, Number]
    translation: tuple[Number, Number, Number]
    camera: str
    capture_time: Number | None = None


class Reference(BaseModel):
    """Origin of an OpenSfM reconstruction's coordinates."""

    model_config = ConfigDict(extra="ignore")
    latitude: Latitude
    longitude: Longitude


class Reconstruction(BaseModel):
    """A part of an OpenSfM ``reconstruction.json``."""

    model_config = ConfigDict(extra="ignore")
    cameras: dict[str, ReconstructedCamera]
    shots: dict[str, OpenSfmShot]
    reference_lla: Reference


class FolderImages:
    """Photos in a folder, with poses.

    Parameters
    ----------
    folder
        Holds the pictures and one of the pose files the module describes; they are tried in that order.
    attribution
        Whom to credit where the pose file does not say.
    longest
        Pixels of a photo's longer side.

    Raises
    ------
    MissingFileError
        If there is no such folder, or no pose file in it.
    """

    name = "photo folder"
    may_be_kept = True

    def __init__(self, folder: Path, *, attribution: str = "", longest: int = LONGEST) -> None:
        self.refused: list[tuple[str, str]] = []
        self._folder = Path(folder)
        self._attribution = attribution or f"photos in {self._folder.name}"
        self._longest = longest
        if not self._folder.is_dir():
            raise MissingFileError(f"{folder}: no such folder of photos")
        own, graph = self._folder / "photos.json", self._folder / "images.json"
        named = [own, *sorted(self._folder.glob("reconstruction*.json")), graph]
        self._found = [path for path in named if path.is_file()]
        if not self._found:
            raise MissingFileError(f"{folder}: no photos.json, reconstruction.json (OpenSfM) or images.json "
                                   "(Mapillary) there; photos need poses")  # fmt: skip
        self._poses = self._found[0]

    @property
    def files(self) -> list[Path]:
        """The pose files there are."""
        return list(self._found)

    def near(self, frame: LocalFrame, half: float, *, most: int) -> Iterator[StreetImage]:
        """Photos in the square of half side `half`; see `StreetImages.near`.

        Raises
        ------
        SchemaError
            If the pose file is damaged.
        EmptyInputError
            If none of its photos was taken in the square.
        """
        cameras: list[PhotoPose] = []
        # A folder may have several: the first that names pictures that are there.
        for path in self._found:
            cameras = self._read(path, frame)
            if any((self._folder / camera.file).is_file() for camera in cameras):
                break
        inside = [c for c in cameras if is_within(c.position, half)]
        if not inside:
            raise EmptyInputError(
                f"{self._poses}: none of its {len(cameras)} usable photos lies in the {2 * half:.0f} m square around "
                f"{frame.lat}, {frame.lon}; give photos of this place"
            )
        places = np.array([c.position[:2] for c in inside])
        taken = 0
        for k in select_spread(places, [heading_of(c.rotation) for c in inside], len(inside)):
            if taken == most:
                break
            try:
                photos = inside[k].photos(self._bytes(inside[k].file), self._longest, self.name)
            except (SchemaError, MissingFileError) as error:
                self.refused.append((inside[k].id, str(error)))
                continue
            for photo in photos[: most - taken]:
                taken += 1
                yield photo

    def poses(self, frame: LocalFrame) -> list[PhotoPose]:
        """Return where all photos of the folder's first pose file were taken; no picture is read or needed.

        Raises
        ------
        SchemaError
            If the pose file is damaged.
        """
        return self._read(self._found[0], frame)

    def _read(self, path: Path, frame: LocalFrame) -> list[PhotoPose]:
        self._poses, self.refused = path, []
        if path.name == "photos.json":
            return self._own(frame)
        return self._graph(frame) if path.name == "images.json" else self._reconstruction_poses(frame)

    def _bytes(self, name: str) -> bytes:
        """Return a file of the folder; names that lead out of it are refused."""
        path = (self._folder / name).resolve()
        if not path.is_relative_to(self._folder.resolve()):
            raise SchemaError(f"{self._poses}: {name!r} lies outside the folder; put the photo into it")
        if not path.is_file():
            raise MissingFileError(f"{path}: no such photo, though {self._poses.name} names it")
        if path.stat().st_size > _MOST_BYTES:
            raise SchemaError(f"{path}: {path.stat().st_size:,} bytes are more than a photo has")
        return path.read_bytes()

    def _text(self) -> bytes:
        if self._poses.stat().st_size > _MOST_JSON:
            raise SchemaError(f"{self._poses}: {self._poses.stat().st_size:,} bytes are too many for a pose file")
        return self._poses.read_bytes()

    def _own(self, frame: LocalFrame) -> list[PhotoPose]:
        try:
            record = Photos.model_validate_json(self._text())
        except ValidationError as error:
            raise self._invalid(error) from None
        cameras = []
        for photo in record.photos:
            x, y = frame.to_enu(photo.lat, photo.lon)
            z = photo.eye if photo.altitude is None else photo.altitude
            cameras.append(
                PhotoPose(
                    id=photo.file,
                    file=photo.file,
                    position=np.array([x, y, z]),
                    rotation=camera_rotation(photo.heading, photo.pitch, photo.roll),
                    focal=photo.focal,
                    fov=photo.fov,
                    bend=(photo.k1, photo.k2),
                    captured=photo.captured,
                    attribution=record.attribution,
                    eye=photo.eye if photo.altitude is None else None,
                    whole=photo.projection == "equirectangular",
                )
            )
        return cameras

    def _graph(self, frame: LocalFrame) -> list[PhotoPose]:
        images, broken, _ = images_in(self._text(), str(self._poses))
        self.refused += broken
        cameras = []
        for image in images:
            reason = image.unusable()
            if reason is not None:
                self.refused.append((image.id, reason))
                continue
            taken = None if image.captured_at is None else image.captured_at / 1000
            bend = (0.0, 0.0) if image.whole else (*image.camera_parameters[1:3], 0.0, 0.0)[:2]
            cameras.append(
                PhotoPose(
                    id=image.id,
                    file=image.url() or "",
                    position=np.array([*image.place(frame), EYE]),
                    rotation=image.rotation(),
                    focal=None if image.whole else image.camera_parameters[0],
                    fov=None,
                    bend=(bend[0], bend[1]),
                    captured=_iso(taken),
                    attribution=self._attribution,
                    eye=EYE,
                    whole=image.whole,
                )
            )
        return cameras

    def _reconstruction_poses(self, frame: LocalFrame) -> list[PhotoPose]:
        try:
            document = json.loads(self._text())
            parts = [Reconstruction.model_validate(part) for part in document]
        except ValidationError as error:
            raise self._invalid(error) from None
        except (ValueError, TypeError, RecursionError) as error:
            raise SchemaError(f"{self._poses}: no OpenSfM reconstruction ({error!r:.200}); export it anew") from None
        cameras = []
        for part in parts:
            here = LocalFrame(part.reference_lla.latitude, part.reference_lla.longitude)
            for name, shot in sorted(part.shots.items()):
                lens = part.cameras.get(shot.camera)
                whole = lens is not None and lens.projection_type in KINDS
                if lens is None or not (whole or (lens.projection_type == "perspective" and lens.focal is not None)):
                    kind = "an unknown" if lens is None else f"a {lens.projection_type}"
                    self.refused.append((name, f"{kind} camera; only perspective photos and panoramas are used"))
                    continue
                # Altitudes are the receiver's, ten metres off: only the place is taken.
                rotation = rotation_from_axis_angle(shot.rotation)
                centre = -rotation.T @ np.array(shot.translation)
                lat, lon = here.to_geodetic(centre[:2])
                x, y = frame.to_enu(lat, lon)
                cameras.append(
                    PhotoPose(
                        id=name,
                        file=name,
                        position=np.array([x, y, EYE]),
                        rotation=rotation,
                        focal=lens.focal,
                        fov=None,
                        bend=(lens.k1, lens.k2),
                        captured=_iso(shot.capture_time),
                        attribution=self._attribution,
                        eye=EYE,
                        whole=whole,
                    )
                )
        return cameras

    def _invalid(self, error: ValidationError) -> SchemaError:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "file"
        return SchemaError(f"{self._poses}: {where}: {first['msg']}; correct it")


@dataclass(frozen=True)
class PhotoPose:
    """Pose and camera of a photo, before its picture is read.

    Attributes
    ----------
    id, file
        Of the photo.
    position, rotation, captured, attribution, eye
        See `StreetImage`.
    focal
        Over the longer side; None where `fov` says it.
    fov
        Vertical field of view, degrees.
    bend
        Distortion k1 and k2; see `undistorted`.
    whole
        An equirectangular panorama.
    """

    id: str
    file: str
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    focal: float | None
    fov: float | None
    bend: tuple[float, float]
    captured: str | None
    attribution: str
    eye: float | None
    whole: bool = False

    def photos(self, data: bytes, longest: int, source: str) -> list[StreetImage]:
        """Return the photo, or those that the panorama is cut into."""
        picture = decode_picture(data, f"photo {self.file}", longest=longest * LONGER if self.whole else longest)
        height, width = picture.shape[:2]
        if self.fov is not None:
            focal = height / 2 / math.tan(math.radians(self.fov) / 2)
        else:
            focal = (self.focal or 1.0) * max(width, height)
        image = StreetImage(
            self.id,
            picture if self.whole else undistort(picture, focal, *self.bend),
            self.position,
            self.rotation,
            pinhole(width, height, focal),
            self.captured,
            source,
            self.attribution,
            self.eye,
        )
        return cut_panorama(image) if self.whole else [image]


def _iso(seconds: float | None) -> str | None:
    if seconds is None or not 0 < seconds < 1 << 32:
        return None
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")
