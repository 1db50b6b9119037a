"""Further places than the map's: what a source of places gives, and Google's Places API.

Google's API, legacy and new, is opt-in, with the user's own key, and never written to disk. Its terms allow to store
one thing of an answer, the place id. Names, types, positions and opening times are Google's content: they may steer a
decision while the process runs (which map place is confirmed, that a building has a restaurant) and are then
forgotten. `FoundPlace.may_be_kept` is false for them, answers never enter the cache, and who puts them into a world
has to see to it that only ids and own decisions are written (`vico.worldgen.places.stage`). Places of Overture are
read by `vico.geo.overture`.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vico.errors import InputError, SchemaError, SourceError
from vico.geo.frame import LocalFrame
from vico.io.http import HttpClient


@dataclass(frozen=True)
class FoundPlace:
    """Something with a name that a source says people go to.

    Attributes
    ----------
    id
        The source's id, with the source's name before it: ``overture:08f1...``, ``google:ChIJ...``.
    name
        As it is called there.
    kind
        The source's own word for it, ``cafe``; `kinds` are further, wider ones, the nearest first.
    xy
        East and north, metres.
    source, attribution
        Who says so, and what their licence asks to be shown.
    open
        False where the source says that it is closed, for good or for now.
    may_be_kept
        False where the source's terms forbid to store what it says (Google): then only `id`, and what is decided here
        from the rest, may go into a world's files.
    """

    id: str
    name: str
    kind: str
    xy: tuple[float, float]
    source: str
    attribution: str
    kinds: tuple[str, ...] = ()
    open: bool = True
    may_be_kept: bool = True


def one_line(text: str, most: int = 120) -> str:
    """Return a name without line breaks, control characters and endless length."""
    return " ".join("".join(c if c.isprintable() else " " for c in text[: 4 * most]).split())[:most].strip()


KEY = "GOOGLE_MAPS_API_KEY"
ATTRIBUTION = "Google Maps"

_LEGACY = "https://maps.googleapis.com/maps/api/place/nearbysearch/json"
_NEW = "https://places.googleapis.com/v1/places:searchNearby"
_FIELDS = "places.id,places.displayName,places.types,places.primaryType,places.location,places.businessStatus"
_PAGES = 3  # a search gives 60 at most, on three pages
_TOKEN_READY = 2.0  # seconds until a page token is good
_FULL = 60  # answers of a full search, legacy API
_FULL_NEW = 20  # answers of a full search, new API
_LEAST_RADIUS = 20.0  # metres: a full circle is not parted below this
_MOST_CALLS = 400
_MOST_ANSWER = 4 << 20
_SPENT = ("REQUEST_DENIED", "OVER_QUERY_LIMIT", "OVER_DAILY_LIMIT")


def google_key(environment: Mapping[str, str] | None = None) -> str:
    """Return the user's key from the environment.

    Raises
    ------
    InputError
        If there is none.
    """
    key = (os.environ if environment is None else environment).get(KEY, "").strip()
    if not key:
        raise InputError(f"google places: no API key; set {KEY} to your own, or leave google out of --places")
    return key


class GooglePlaces:
    """Places by nearby search.

    Parameters
    ----------
    key
        The user's API key; calls are billed to it.
    web
        The client to ask with; nothing is kept in its cache.
    api
        ``new`` (searchNearby) or ``legacy`` (nearbysearch, with pages).
    address
        Of the service.
    calls
        Most calls made for one window: circles that are full are parted in four until none is, or these are spent.
    sleep
        Waits for a page token to become good; tests replace it.

    Attributes
    ----------
    refused
        Id and reason of answers that were left out.
    partial
        True where the calls did not suffice for the whole window.

    Raises
    ------
    InputError
        If the key is empty or the API unknown.
    """

    name = "google"
    may_be_kept = False

    def __init__(
        self,
        key: str,
        web: HttpClient,
        *,
        api: str = "new",
        address: str | None = None,
        calls: int = _MOST_CALLS,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        if not key.strip():
            raise InputError(f"google places: no API key; set {KEY}")
        if api not in ("new", "legacy"):
            raise InputError(f"google places: api {api!r}; it must be new or legacy")
        self.refused: list[tuple[str, str]] = []
        self.partial = False
        self._key, self._web, self._api = key.strip(), web, api
        self._address = address or (_NEW if api == "new" else _LEGACY)
        self._most, self._left, self._sleep = calls, calls, sleep

    def near(self, frame: LocalFrame, half: float) -> list[FoundPlace]:
        """Every place in the square of half side `half` metres around the frame's origin, sorted by id.

        Raises
        ------
        SourceError
            If the service refuses or fails.
        SchemaError
            If it answers something else than it documents.
        """
        self.refused.clear()
        self.partial, self._left = False, self._most
        found: dict[str, FoundPlace] = {}
        squares = [(0.0, 0.0, half)]
        while squares:
            x, y, side = squares.pop(0)
            if self._left <= 0:
                self.partial = True
                break
            rows = list(self._search(frame, x, y, side * math.sqrt(2.0)))
            for row in rows:
                place = self._place(row, frame, half)
                if place is not None:
                    found[place.id] = place
            if len(rows) >= (_FULL_NEW if self._api == "new" else _FULL) and side > _LEAST_RADIUS:
                quarter = side / 2
                squares += [(x + a * quarter, y + b * quarter, quarter) for a in (-1, 1) for b in (-1, 1)]
        return [found[key] for key in sorted(found)]

    def _search(self, frame: LocalFrame, x: float, y: float, radius: float) -> Iterator[dict[str, Any]]:
        lat, lon = (float(v) for v in frame.to_geodetic(np.array([x, y])))
        if self._api == "new":
            circle = {"center": {"latitude": round(lat, 7), "longitude": round(lon, 7)}, "radius": round(radius, 1)}
            body = {
                "maxResultCount": _FULL_NEW,
                "rankPreference": "DISTANCE",
                "locationRestriction": {"circle": circle},
            }
            headers = {"X-Goog-Api-Key": self._key, "X-Goog-FieldMask": _FIELDS, "Content-Type": "application/json"}
            self._left -= 1
            answer = self._web.post(
                self._address, data=json.dumps(body).encode(), headers=headers, cached=False, max_bytes=_MOST_ANSWER
            )
            yield from self._rows(self._json(answer), "places")
            return
        asked = {"location": f"{lat:.7f},{lon:.7f}", "radius": f"{radius:.1f}"}
        for _ in range(_PAGES):
            if self._left <= 0:
                self.partial = True
                return
            self._left -= 1
            params = {**asked, "key": self._key}
            page = self._json(self._web.get(self._address, params=params, cached=False, max_bytes=_MOST_ANSWER))
            status = page.get("status")
            if status not in ("OK", "ZERO_RESULTS"):
                told = one_line(str(page.get("error_message") or "no reason given")).replace(self._key, "***")
                mend = "check the key and its quota" if status in _SPENT else "try again later"
                raise SourceError(f"google places: {one_line(str(status), 40)} ({told}); {mend}")
            yield from self._rows(page, "results")
            token = page.get("next_page_token")
            if not isinstance(token, str) or not token:
                return
            asked = {"pagetoken": token}
            self._sleep(_TOKEN_READY)

    def _json(self, answer: bytes) -> dict[str, Any]:
        try:
            content = json.loads(answer)
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            raise SchemaError("google places: the answer is not the JSON object it documents; try again later")
        return content

    def _rows(self, page: dict[str, Any], name: str) -> list[dict[str, Any]]:
        rows = page.get(name, [])
        if not isinstance(rows, list):
            raise SchemaError(f"google places: {name} in the answer is no list; try again later")
        return [row for row in rows if isinstance(row, dict)]

    def _place(self, row: dict[str, Any], frame: LocalFrame, half: float) -> FoundPlace | None:
        """Return a place of either API's answer; None where it is none, or outside."""
        key = row.get("id") if self._api == "new" else row.get("place_id")
        if not isinstance(key, str) or not key:
            return None
        label = f"google:{one_line(key, 120)}"
        try:
            if self._api == "new":
                spot = row["location"]
                lat, lon = float(spot["latitude"]), float(spot["longitude"])
                name, status = str(row["displayName"]["text"]), row.get("businessStatus")
            else:
                spot = row["geometry"]["location"]
                lat, lon = float(spot["lat"]), float(spot["lng"])
                name, status = str(row["name"]), row.get("business_status")
        except (KeyError, TypeError, ValueError):
            self.refused.append((label, "has no name or no position"))
            return None
        if not (abs(lat) <= 90.0 and abs(lon) <= 180.0):
            self.refused.append((label, "its position is not on Earth"))
            return None
        xy = frame.to_enu(lat, lon)
        if not (abs(xy[0]) <= half and abs(xy[1]) <= half):
            return None
        types = row.get("types")
        kinds = [k for k in types if isinstance(k, str)][:20] if isinstance(types, list) else []
        first = row.get("primaryType")
        kind = first if isinstance(first, str) and first else (kinds[0] if kinds else "")
        return FoundPlace(
            id=label,
            name=one_line(name),
            kind=one_line(kind, 60),
            xy=(float(xy[0]), float(xy[1])),
            source=self.name,
            attribution=ATTRIBUTION,
            kinds=tuple(one_line(k, 60) for k in kinds if k != kind),
            open=status in (None, "OPERATIONAL", "BUSINESS_STATUS_UNSPECIFIED"),
            may_be_kept=False,
        )
