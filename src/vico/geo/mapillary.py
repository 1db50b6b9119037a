"""Street photos from Mapillary's graph API (version 4), and from files of its answers.

The images' poses are those of its own reconstruction (``computed_geometry``, ``computed_rotation``), which follow
OpenSfM's convention: the rotation is an angle-axis vector that takes east-north-up to the camera's right-down-forward;
``camera_parameters`` are focal length over the longer side, k1 and k2. Panoramas are cut into photos.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vico.errors import InputError, SchemaError, SourceError
from vico.geo.frame import LocalFrame
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
from vico.io.http import HttpClient

FIELDS = (
    "id,captured_at,camera_type,camera_parameters,width,height,geometry,computed_geometry,"
    "computed_compass_angle,compass_angle,computed_rotation,is_pano,thumb_2048_url,thumb_original_url"
)
EYE = 1.9
"""Metres above the ground that a camera in a hand, on a helmet or behind a windscreen has, about."""
ATTRIBUTION = "Mapillary contributors (CC BY-SA 4.0)"

_GRAPH = "https://graph.mapillary.com"
_MOST_SIDE = 0.01  # degrees: the API refuses larger boxes
_PAGE = 500
_MOST_PIECES = 1000
_MOST_PAGES = 200
_LEAST_SIDE = 0.0006  # degrees: a box is not quartered below this, however full
_MOST_PHOTO = 64 << 20

Number = Annotated[float, Field(allow_inf_nan=False)]


class Point(BaseModel):
    """A GeoJSON point: longitude, latitude, degrees."""

    model_config = ConfigDict(extra="ignore")
    type: Literal["Point"]
    coordinates: tuple[Annotated[Number, Field(ge=-180, le=180)], Annotated[Number, Field(ge=-90, le=90)]]


class MapillaryImage(BaseModel):
    """Fields of one photo as the API gives them; those that were not asked for are ignored."""

    model_config = ConfigDict(extra="ignore", coerce_numbers_to_str=True)
    id: Annotated[str, Field(min_length=1, max_length=80)]
    captured_at: int | None = None
    camera_type: str | None = None
    camera_parameters: list[Number] = []
    width: Annotated[int, Field(gt=0)] | None = None
    height: Annotated[int, Field(gt=0)] | None = None
    geometry: Point | None = None
    computed_geometry: Point | None = None
    compass_angle: Number | None = None
    computed_compass_angle: Number | None = None
    computed_rotation: tuple[Number, Number, Number] | None = None
    is_pano: bool = False
    thumb_2048_url: str | None = None
    thumb_original_url: str | None = None

    def unusable(self) -> str | None:
        """Why this photo can't be used, or None."""
        if not self.whole and (self.is_pano or self.camera_type not in (None, "perspective")):
            return f"a {self.camera_type} camera; only perspective photos and whole panoramas are used"
        if self.computed_geometry is None and self.geometry is None:
            return "no position"
        if self.computed_rotation is None and self._compass() is None:
            return "no orientation"
        if not self.whole and (not self.camera_parameters or not 0.2 <= self.camera_parameters[0] <= 5.0):
            return "no focal length"
        if not self.whole and any(abs(k) > 2.0 for k in self.camera_parameters[1:3]):
            return f"lens distortion {self.camera_parameters[1:3]} is out of range"
        if not self.url():
            return "no picture"
        return None

    @property
    def whole(self) -> bool:
        """Whether it is a panorama of the whole sphere."""
        return self.camera_type in KINDS or (self.is_pano and self.camera_type is None)

    def url(self) -> str | None:
        """Address of the picture: 2,048 pixels wide where there is one, of panoramas the largest."""
        if self.whole:
            return self.thumb_original_url or self.thumb_2048_url
        return self.thumb_2048_url or self.thumb_original_url

    def _compass(self) -> float | None:
        return self.compass_angle if self.computed_compass_angle is None else self.computed_compass_angle

    def heading(self) -> float:
        """Compass heading, degrees."""
        return heading_of(self.rotation())

    def rotation(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """World-to-camera rotation: the reconstruction's, else level towards the compass angle."""
        if self.computed_rotation is not None:
            return rotation_from_axis_angle(self.computed_rotation)
        return camera_rotation(self._compass() or 0.0)

    def place(self, frame: LocalFrame) -> np.ndarray[Any, np.dtype[np.float64]]:
        """ENU metres, shape ``(2,)``."""
        point = self.computed_geometry or self.geometry
        assert point is not None
        lon, lat = point.coordinates
        return frame.to_enu(lat, lon)

    def photos(
        self, frame: LocalFrame, data: bytes, *, source: str, attribution: str, longest: int
    ) -> list[StreetImage]:
        """Return the photo with its camera, undistorted; of a panorama the pictures it is cut into.

        Raises
        ------
        SchemaError
            If `data` is no readable picture, or no whole panorama.
        """
        picture = decode_picture(data, f"{source} photo {self.id}", longest=longest * LONGER if self.whole else longest)
        height, width = picture.shape[:2]
        taken = None
        if self.captured_at is not None and 0 < self.captured_at < 1 << 42:
            taken = datetime.fromtimestamp(self.captured_at / 1000, UTC).isoformat(timespec="seconds")
        focal, k1, k2 = (*self.camera_parameters[:3], 0.0, 0.0, 0.0)[:3]
        if self.whole:
            focal, k1, k2 = 1.0, 0.0, 0.0
        focal *= max(width, height)
        # Altitudes are the receiver's, ten metres off and above another zero than the terrain's.
        image = StreetImage(
            self.id,
            undistort(picture, focal, k1, k2),
            np.array([*self.place(frame), EYE]),
            self.rotation(),
            pinhole(width, height, focal),
            taken,
            source,
            attribution,
            eye=EYE,
        )
        return cut_panorama(image) if self.whole else [image]


def images_in(answer: bytes, what: str) -> tuple[list[MapillaryImage], list[tuple[str, str]], str | None]:
    """Return an answer's photos, those it lists wrongly (id, reason), and the cursor of its next page.

    Raises
    ------
    SchemaError
        If it is no list of images.
    """
    try:
        document = json.loads(answer)
        if not isinstance(document, dict):
            raise ValueError("no object")
        if isinstance(document.get("error"), dict):
            raise SchemaError(f"{what}: the service answers {str(document['error'].get('message'))[:200]!r}; try later")
        rows = document["data"]
        if not isinstance(rows, list):
            raise ValueError("data is no list")
    except SchemaError:
        raise
    except (ValueError, KeyError, RecursionError) as error:
        raise SchemaError(f"{what}: not a list of images ({error!r:.200}); ask for it anew") from None
    images, broken = [], []
    for number, row in enumerate(rows):
        try:
            images.append(MapillaryImage.model_validate(row))
        except ValidationError as error:
            name = str(row.get("id", number)) if isinstance(row, dict) else str(number)
            first = error.errors()[0]
            broken.append((name[:80], f"{'.'.join(str(p) for p in first['loc'])}: {first['msg']}"))
    paging = document.get("paging")
    after = None
    # The last page has a cursor too, but no next.
    if isinstance(paging, dict) and paging.get("next") and isinstance(paging.get("cursors"), dict):
        cursor = paging["cursors"].get("after")
        after = cursor if isinstance(cursor, str) else None
    return images, broken, after


class Mapillary:
    """Photos and panoramas of Mapillary around a place.

    Parameters
    ----------
    token
        Access token of the user (``MAPILLARY_TOKEN``); made at https://www.mapillary.com/dashboard/developers.
    web
        The client to ask with; its cache may keep the answers.
    address
        Root of the API.
    longest
        Pixels of a photo's longer side.

    Raises
    ------
    InputError
        If the token is empty.
    """

    name = "mapillary"
    may_be_kept = True

    def __init__(self, token: str, web: HttpClient, *, address: str = _GRAPH, longest: int = LONGEST) -> None:
        if not token.strip():
            raise InputError("mapillary: no access token; make one at mapillary.com/dashboard/developers and set "
                             "MAPILLARY_TOKEN")  # fmt: skip
        self.refused: list[tuple[str, str]] = []
        self._token = token.strip()
        self._web = web
        self._address = address.rstrip("/")
        self._longest = longest

    def near(self, frame: LocalFrame, half: float, *, most: int) -> Iterator[StreetImage]:
        """Photos in the square of half side `half`; see `StreetImages.near`."""
        self.refused = []
        found: dict[str, MapillaryImage] = {}
        pieces = [piece for box in frame.boxes(half) for piece in split_box(box)]
        if len(pieces) > _MOST_PIECES:
            raise InputError(f"mapillary: the place takes {len(pieces):,} requests, it is too large or lies at a pole")
        for piece in pieces:
            for image in self._images_in(piece):
                found.setdefault(image.id, image)
        usable = []
        for image in sorted(found.values(), key=lambda i: i.id):
            reason = image.unusable()
            if reason is not None:
                self.refused.append((image.id, reason))
            elif is_within(image.place(frame), half):
                usable.append(image)
        places = np.array([image.place(frame) for image in usable]).reshape(-1, 2)
        order = select_spread(places, [image.heading() for image in usable], len(usable))
        taken = 0
        for k in order:  # a photo that fails makes room for the next one
            if taken == most:
                break
            image = usable[k]
            try:
                data = self._web.get(image.url() or "", max_bytes=_MOST_PHOTO)
                photos = image.photos(frame, data, source=self.name, attribution=ATTRIBUTION, longest=self._longest)
            except (SourceError, SchemaError) as error:
                self.refused.append((image.id, str(error)))
                continue
            for photo in photos[: most - taken]:
                taken += 1
                yield photo

    def _images_in(self, box: tuple[float, float, float, float]) -> Iterator[MapillaryImage]:
        """Everything in a box: page by page, or quarter by quarter where a full page has no next one."""
        after: str | None = None
        for _ in range(_MOST_PAGES):
            images, broken, following = self._page(box, after)
            self.refused += broken
            yield from images
            if following is None or following == after:
                break
            after = following
        west, south, east, north = box
        if len(images) >= _PAGE and following is None and max(east - west, north - south) > _LEAST_SIDE:
            middle = (west + east) / 2, (south + north) / 2
            for x in ((west, middle[0]), (middle[0], east)):
                for y in ((south, middle[1]), (middle[1], north)):
                    yield from self._images_in((x[0], y[0], x[1], y[1]))

    def _page(
        self, box: tuple[float, float, float, float], after: str | None
    ) -> tuple[list[MapillaryImage], list[tuple[str, str]], str | None]:
        params = {"bbox": ",".join(f"{v:.7f}" for v in box), "fields": FIELDS, "limit": str(_PAGE)}
        if after is not None:
            params["after"] = after
        try:
            answer = self._web.get(
                f"{self._address}/images", params=params, headers={"Authorization": f"OAuth {self._token}"}
            )
        except SourceError as error:
            if getattr(error, "status", None) in (400, 401, 403):
                raise SourceError(
                    "mapillary: the access token is refused (wrong, expired, or not allowed to read images); "
                    "make a new one at mapillary.com/dashboard/developers and set MAPILLARY_TOKEN"
                ) from None
            raise
        return images_in(answer, "mapillary")


def split_box(bbox: tuple[float, float, float, float]) -> Iterator[tuple[float, float, float, float]]:
    """Return the box (west, south, east, north) in pieces no larger than the API answers."""
    west, south, east, north = bbox
    across, up = (max(math.ceil((b - a) / _MOST_SIDE - 1e-9), 1) for a, b in ((west, east), (south, north)))
    for row in range(up):
        for column in range(across):
            yield (
                west + (east - west) * column / across,
                south + (north - south) * row / up,
                west + (east - west) * (column + 1) / across,
                south + (north - south) * (row + 1) / up,
            )
