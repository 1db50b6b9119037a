"""Street photos from Google's Street View Static API: opt-in, with the user's own key, and never written to disk.

Its terms forbid to cache, store, or derive lasting content from the pictures: textures made from them may be looked at
in the running process only, so `GoogleStreetView.may_be_kept` is false and a world made with them must not be saved.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError, SchemaError, SourceError
from vico.geo.frame import LocalFrame
from vico.geo.street_images import LONGEST, StreetImage, camera_rotation, decode_picture, is_within, pinhole
from vico.io.http import HttpClient

_MAPS = "https://maps.googleapis.com/maps/api/streetview"
_SIDE = 640  # pixels: the most the API gives
_EYE = 2.5  # metres: the height of the cars' cameras
_STEP = 40.0
_SPENT = ("REQUEST_DENIED", "OVER_QUERY_LIMIT", "OVER_DAILY_LIMIT")


class GoogleStreetView:
    """Views cut from the panoramas nearest to given points.

    Parameters
    ----------
    key
        The user's API key; pictures are billed to it (looking for panoramas is free).
    web
        The client to ask with; nothing is kept in its cache.
    points
        Where to look for panoramas, ENU metres, shape ``(n, 2)``; by default a grid of 40 m. Points along the roads
        are better.
    headings, pitch, fov
        Compass headings of the views of each panorama, their pitch, and their field of view, degrees.
    address
        Root of the API.

    Raises
    ------
    InputError
        If the key is empty or the field of view is not in 20..120.
    """

    name = "google street view"
    may_be_kept = False

    def __init__(
        self,
        key: str,
        web: HttpClient,
        *,
        points: NDArray[np.float64] | None = None,
        headings: Sequence[float] = (0.0, 90.0, 180.0, 270.0),
        pitch: float = 12.0,
        fov: float = 90.0,
        address: str = _MAPS,
        longest: int = LONGEST,
    ) -> None:
        if not key.strip():
            raise InputError("google street view: no API key; set GOOGLE_MAPS_API_KEY")
        if not 20.0 <= fov <= 120.0:
            raise InputError(f"google street view: field of view {fov:g} degrees; it must lie within 20..120")
        self.refused: list[tuple[str, str]] = []
        self._key = key.strip()
        self._web = web
        self._points = points
        self._headings = tuple(headings)
        self._pitch, self._fov = pitch, fov
        self._address = address.rstrip("/")
        self._longest = longest

    def near(self, frame: LocalFrame, half: float, *, most: int) -> Iterator[StreetImage]:
        """Yield views in the square of half side `half`; see `StreetImages.near`."""
        self.refused = []
        points = _grid(half) if self._points is None else np.asarray(self._points, np.float64).reshape(-1, 2)
        seen: set[str] = set()
        taken = 0
        for point in points[np.abs(points).max(axis=1) <= half] if len(points) else points:
            if taken >= most:
                return
            panorama = self._panorama(frame, point)
            if panorama is None or panorama["pano_id"] in seen:
                continue
            seen.add(panorama["pano_id"])
            if not is_within(panorama["place"], half):
                continue
            for heading in self._headings:
                if taken >= most:
                    return
                view = self._view(panorama, heading)
                if view is not None:
                    taken += 1
                    yield view

    def _panorama(self, frame: LocalFrame, point: NDArray[np.float64]) -> dict[str, Any] | None:
        """Id, place, date and copyright of the panorama nearest to a point, if one lies within the grid's step."""
        lat, lon = frame.to_geodetic(point)
        params = {
            "location": f"{float(lat):.7f},{float(lon):.7f}",
            "radius": f"{_STEP / math.sqrt(2):.0f}",
            "source": "outdoor",
            "key": self._key,
        }
        what = "google street view"
        answer = self._web.get(f"{self._address}/metadata", params=params, cached=False)
        try:
            document = json.loads(answer)
            status = str(document["status"])
            if status in _SPENT:
                raise SourceError(f"{what}: {status} ({str(document.get('error_message', 'no reason given'))[:200]}); "
                                  "check the key, its billing and its quota")  # fmt: skip
            if status != "OK":
                if status not in ("ZERO_RESULTS", "NOT_FOUND"):
                    self.refused.append((params["location"], status))
                return None
            where = document["location"]
            north, east = float(where["lat"]), float(where["lng"])
            if not (math.isfinite(north) and math.isfinite(east) and abs(north) <= 90 and abs(east) <= 180):
                raise ValueError("location out of range")
            return {
                "pano_id": str(document["pano_id"]),
                "place": frame.to_enu(north, east),
                "date": str(document["date"]) if "date" in document else None,
                "copyright": str(document.get("copyright", "© Google")),
            }
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise SchemaError(f"{what}: metadata of an unknown shape ({error!r:.200}); try later") from None

    def _view(self, panorama: dict[str, Any], heading: float) -> StreetImage | None:
        name = f"{panorama['pano_id']}@{heading:g}"
        params = {
            "size": f"{_SIDE}x{_SIDE}",
            "pano": panorama["pano_id"],
            "heading": f"{heading:g}",
            "pitch": f"{self._pitch:g}",
            "fov": f"{self._fov:g}",
            # Otherwise a missing picture is a grey one that says sorry.
            "return_error_code": "true",
            "key": self._key,
        }
        try:
            data = self._web.get(self._address, params=params, cached=False)
            picture = decode_picture(data, f"{self.name} {name}", longest=self._longest)
        except (SourceError, SchemaError) as error:
            self.refused.append((name, str(error)))
            return None
        height, width = picture.shape[:2]
        focal = width / 2 / math.tan(math.radians(self._fov) / 2)
        return StreetImage(
            name,
            picture,
            np.array([*panorama["place"], _EYE]),
            camera_rotation(heading, self._pitch),
            pinhole(width, height, focal),
            panorama["date"],
            self.name,
            panorama["copyright"],
            eye=_EYE,
        )


def _grid(half: float) -> NDArray[np.float64]:
    """Points 40 m apart over the square, the most central first."""
    side = np.arange(_STEP / 2, half, _STEP)
    axis = np.concatenate([-side[::-1], side])
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    return points[np.lexsort((points[:, 1], points[:, 0], np.hypot(*points.T)))]
