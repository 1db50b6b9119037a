"""OpenStreetMap data of any place on Earth, asked of an Overpass server and kept as an extract."""

from __future__ import annotations

import json
import math
import os
import re
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol

import osmium

from vico.errors import EmptyInputError, InputError, SourceError
from vico.geo.frame import LocalFrame
from vico.io.cache import cache_folder
from vico.io.files import new_file
from vico.io.http import Backoff, HttpClient

#: Where to ask unless `VICO_OVERPASS` or an argument says otherwise.
ENDPOINT = "https://overpass-api.de/api/interpreter"
#: Map data reach this far beyond the window, metres: as far as `read_osm` keeps them, and one for a rounded radius.
MARGIN = 61.0

# Limits of a query on the server; its own defaults.
_SECONDS = 180
_MEMORY = 512 << 20  # bytes
_MOST_HALF = 10_000.0
_MOST_ANSWER = 512 << 20
_DEEPEST = 3  # splits: 64 pieces at most
_BACKOFF = Backoff(retries=3, first=5.0)
_MOST_QUEUE = 300.0
_TOO_MUCH = re.compile(r"timed out|out of memory|run out|maxsize", re.IGNORECASE)
_BUSY = re.compile(r"too busy|dispatcher|rate_limited|try again", re.IGNORECASE)
# The public servers give each address two slots.
_SLOTS = threading.BoundedSemaphore(2)

Box = tuple[float, float, float, float]
Element = dict[str, Any]


class MapSource(Protocol):
    """Whatever can get map data of a place as a file that `read_osm` takes."""

    def fetch(self, lat: float, lon: float, half: float) -> Path:
        """Return an OSM extract that covers the square of half side `half` metres around a point."""
        ...


class _TooMuchError(Exception):
    """The server ran out of time or memory: a smaller area may do."""


class _BusyError(Exception):
    """The server has no time, or its answer broke off: later may do."""


@dataclass(frozen=True)
class _Answer:
    """Elements, and the time of the data they are from (ISO 8601)."""

    elements: list[Element]
    timestamp: str


class Overpass:
    """An Overpass server, and the extracts it gave.

    Parameters
    ----------
    endpoint
        Address of the server's interpreter; ``$VICO_OVERPASS`` or the public server without.
    cache
        Folder for the extracts; the user's cache without.
    web
        HTTP client; a polite one of its own without.
    refresh
        Ask again even where an extract of the same square is kept.
    sleep
        Waits; tests replace it.
    """

    def __init__(
        self,
        endpoint: str | None = None,
        *,
        cache: Path | None = None,
        web: HttpClient | None = None,
        refresh: bool = False,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        chosen = (endpoint or os.environ.get("VICO_OVERPASS") or ENDPOINT).rstrip("/")
        self.endpoint = chosen if chosen.endswith("/interpreter") else f"{chosen}/interpreter"
        self.cache = cache_folder() / "maps" if cache is None else Path(cache)
        self.refresh = refresh
        self._web = web or HttpClient(timeout=_SECONDS + 20.0, pause=1.0, sleep=sleep)
        self._sleep = sleep

    def fetch(self, lat: float, lon: float, half: float) -> Path:
        """Return an extract (``.osm.pbf``) that covers a square, from the cache or from the server.

        Parameters
        ----------
        lat, lon
            The square's centre, degrees.
        half
            Half its side, metres; `MARGIN` is added.

        Returns
        -------
        Path
            In the cache, named by place, size, query and the time of the data. Nodes before ways before relations,
            each by id, so that equal data are equal bytes. Names of mappers are not asked for.

        Raises
        ------
        InputError
            If the place is none, or the square is larger than an Overpass server should be asked for.
        SourceError
            If the server can't be reached, refuses, or answers with something else than map data.
        EmptyInputError
            If nothing is mapped there.
        """
        if not (math.isfinite(half) and 0 < half <= _MOST_HALF):
            raise InputError(
                f"radius: {half:g} m; Overpass is asked for at most {_MOST_HALF:g} m: clip a planet extract instead"
            )
        boxes = [_round_box(box) for box in LocalFrame(lat, lon).boxes(half + MARGIN)]
        digest = sha256(f"{self.endpoint}\n{query(boxes)}".encode()).hexdigest()[:12]
        stem = f"overpass_{lat:.5f}_{lon:.5f}_{half:.0f}m_{digest}_"
        kept = sorted(path for path in self.cache.glob(f"{stem}*.osm.pbf") if path.is_file())
        if kept and not self.refresh:
            return kept[-1]
        answers = self._ask(boxes, 0)
        elements = merge_answers(answers)
        if not elements:
            raise EmptyInputError(
                f"{self.endpoint}: nothing is mapped in the {2 * half:.0f} m square around {lat}, {lon}; "
                "check the coordinates (latitude comes first)"
            )
        # Of several answers the oldest tells which changes all of them hold.
        timestamp = min(answer.timestamp for answer in answers)
        path = self.cache / f"{stem}{re.sub('[^0-9TZ]', '', timestamp)}.osm.pbf"
        write_extract(path, elements, boxes=boxes, timestamp=timestamp)
        return path

    def _ask(self, boxes: list[Box], depth: int) -> list[_Answer]:
        """Ask for an area; for its quarters where it is too much at once."""
        try:
            return [self._answer(boxes)]
        except _TooMuchError as reason:
            if depth == _DEEPEST:
                raise SourceError(
                    f"{self.endpoint}: the area is too much for the server even in small pieces ({reason}); "
                    "use a smaller radius, or another server with VICO_OVERPASS"
                ) from None
        return [answer for box in boxes for quarter in quarters(box) for answer in self._ask([quarter], depth + 1)]

    def _answer(self, boxes: list[Box]) -> _Answer:
        """One query's answer, asked for again where the server was busy."""
        for attempt in range(_BACKOFF.retries + 1):
            with _SLOTS:
                self._wait_for_a_slot()
                try:
                    body = self._web.post(
                        self.endpoint, data={"data": query(boxes)}, cached=False, max_bytes=_MOST_ANSWER
                    )
                    return parse_answer(body)
                except _BusyError as error:
                    if attempt == _BACKOFF.retries:
                        raise SourceError(f"{self.endpoint}: {error}, {attempt + 1} times; try again later") from None
                except InputError as error:
                    raise SourceError(f"{self.endpoint}: {error}; is it the interpreter of Overpass?") from None
            self._sleep(_BACKOFF.wait(attempt))
        raise AssertionError("the last try returns or raises")

    def _wait_for_a_slot(self) -> None:
        """Wait as long as the server's status page says that this address has to."""
        waited = 0.0
        while True:
            try:
                page = self._web.get(
                    f"{self.endpoint.removesuffix('interpreter')}status", cached=False, max_bytes=1 << 20
                )
            except SourceError as error:
                if error.status is None:
                    raise  # no such host, or nobody there: the query would fare no better
                return  # a server of one's own may have no such page
            seconds = seconds_to_a_slot(page.decode("utf-8", "replace"))
            if seconds <= 0:
                return
            if waited + seconds > _MOST_QUEUE:
                raise SourceError(
                    f"{self.endpoint}: no slot is free for {seconds:.0f} s; try again later, "
                    "or use another server with VICO_OVERPASS"
                )
            self._sleep(seconds)
            waited += seconds


def query(boxes: Iterable[Box]) -> str:
    """Return the query, in Overpass QL, for everything mapped in boxes of (west, south, east, north) degrees.

    Nodes, ways and relations in the boxes; of multipolygons all rings, of all ways all nodes. Other relations (a bus
    line through the whole country) come as they are, without members from elsewhere.
    """
    around = [f"({south!r},{west!r},{north!r},{east!r})" for west, south, east, north in boxes]

    def kind(name: str) -> str:
        return "(" + "".join(f"{name}{box};" for box in around) + ")"

    return (
        f"[out:json][timeout:{_SECONDS}][maxsize:{_MEMORY}];"
        f"{kind('node')}->.near;{kind('way')}->.crossing;{kind('rel')}->.relations;"
        'rel.relations["type"="multipolygon"]->.areas;way(r.areas)->.rings;(.crossing;.rings;)->.ways;'
        "node(w.ways)->.corners;(.near;.corners;.ways;.relations;);out body;"
    )


def quarters(box: Box) -> list[Box]:
    """Return the four quarters of a box of (west, south, east, north) degrees."""
    west, south, east, north = box
    x, y = round((west + east) / 2, 7), round((south + north) / 2, 7)
    return [(west, south, x, y), (x, south, east, y), (west, y, x, north), (x, y, east, north)]


def seconds_to_a_slot(page: str) -> float:
    """Return how long to wait, as a server's status page says; 0 where a slot is free, or the page says nothing."""
    if re.search(r"Rate limit: 0\b|\b[1-9]\d* slots? available now", page):
        return 0.0
    waits = [int(found) for found in re.findall(r"Slot available after:[^\n]*?in (-?\d{1,9}) seconds", page)]
    return max(1.0, min(waits) + 1.0) if waits else 0.0


def parse_answer(body: bytes) -> _Answer:
    """Read an answer; its elements are checked one by one.

    Raises
    ------
    InputError
        If it is no answer of Overpass.
    """
    start = body[:1000].lstrip()
    if start.startswith(b"<"):
        words = " ".join(
            re.sub(rb"(?s)<(head|style)\b.*?</\1>|<[^>]*>", b" ", body[:4000]).decode("utf-8", "replace").split()
        )
        if _BUSY.search(words):
            raise _BusyError("the server is too busy")
        raise InputError(f"answers with a page instead of map data ({words[:200]})")
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        if start.startswith(b"{"):
            raise _BusyError(f"the answer breaks off or is garbled ({len(body):,} bytes)") from None
        raise InputError("answers with something that is no map data") from None
    if not isinstance(content, dict):
        raise InputError("answers with something that is no map data")
    remark = content.get("remark")
    if remark is not None:
        said = " ".join(str(remark).split())[:200]
        if _TOO_MUCH.search(said):
            raise _TooMuchError(said)
        if _BUSY.search(said):
            raise _BusyError(f"the server is busy ({said})")
        raise InputError(f"could not answer the query ({said})")
    elements, about = content.get("elements"), content.get("osm3s")
    if not isinstance(elements, list) or not isinstance(about, dict):
        raise InputError("answers with JSON that is no map data (no elements)")
    timestamp = about.get("timestamp_osm_base")
    if not isinstance(timestamp, str) or not re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", timestamp):
        raise InputError(f"does not say of when its data are (timestamp_osm_base {str(timestamp)[:40]!r})")
    for place, element in enumerate(elements):
        fault = _fault(element)
        if fault is not None:
            raise InputError(f"sends a broken element, number {place} of the answer: {fault}")
    return _Answer(elements, timestamp)


def _whole(value: object) -> bool:
    return type(value) is int and -(2**62) < value < 2**62


def _fault(element: Any) -> str | None:
    """Return what is wrong with an element, if anything."""
    if not isinstance(element, dict):
        return "it is no object"
    kind, number = element.get("type"), element.get("id")
    if kind not in ("node", "way", "relation") or not _whole(number):
        return f"it is no node, way or relation with an id (type {str(kind)[:20]!r}, id {str(number)[:20]!r})"
    tags = element.get("tags", {})
    if not isinstance(tags, dict) or not all(isinstance(value, str) for value in tags.values()):
        return f"{kind} {number} has tags that are no words"
    if kind == "node":
        for name, most in (("lat", 90.0), ("lon", 180.0)):
            value = element.get(name)
            if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) <= most:
                return f"node {number} has no usable {name} ({str(value)[:20]!r})"
    elif kind == "way":
        nodes = element.get("nodes")
        if not isinstance(nodes, list) or not all(map(_whole, nodes)):
            return f"way {number} has no list of nodes"
    else:
        members = element.get("members", [])
        if not isinstance(members, list) or not all(
            isinstance(m, dict)
            and m.get("type") in ("node", "way", "relation")
            and _whole(m.get("ref"))
            and isinstance(m.get("role", ""), str)
            for m in members
        ):
            return f"relation {number} has a broken list of members"
    return None


def merge_answers(answers: Iterable[_Answer]) -> list[Element]:
    """All elements, each once, sorted by kind and id; of two the one from newer data."""
    found: dict[tuple[int, int], Element] = {}
    order = {"node": 0, "way": 1, "relation": 2}
    for answer in sorted(answers, key=lambda a: a.timestamp):
        for element in answer.elements:
            found[order[element["type"]], element["id"]] = element
    return [found[key] for key in sorted(found)]


def write_extract(path: Path, elements: Iterable[Mapping[str, Any]], *, boxes: Iterable[Box], timestamp: str) -> None:
    """Write elements, which are in order, as ``.osm.pbf``; whole or not at all.

    Raises
    ------
    SourceError
        If the format can't hold them (a tag longer than OpenStreetMap allows).
    OutputError
        If the folder can't be written.
    """
    header = osmium.io.Header()
    header.set("generator", "vico")
    header.set("osmosis_replication_timestamp", timestamp)
    for west, south, east, north in boxes:
        header.add_box(osmium.osm.Box(west, south, east, north))
    try:
        with new_file(path) as temporary:
            writer = osmium.SimpleWriter(str(temporary), header=header, overwrite=True)
            try:
                for element in elements:
                    _write(writer, element)
            finally:
                writer.close()
    except (RuntimeError, ValueError) as error:
        raise SourceError(f"{path}: the map data can't be written ({error})") from None


def _write(writer: osmium.SimpleWriter, element: Mapping[str, Any]) -> None:
    number, tags, kind = element["id"], dict(sorted(element.get("tags", {}).items())), element["type"]
    if kind == "node":
        place = (float(element["lon"]), float(element["lat"]))
        writer.add_node(osmium.osm.mutable.Node(id=number, tags=tags, location=place))
    elif kind == "way":
        writer.add_way(osmium.osm.mutable.Way(id=number, tags=tags, nodes=element["nodes"]))
    else:
        members = [(m["type"][0], m["ref"], m.get("role", "")) for m in element.get("members", [])]
        writer.add_relation(osmium.osm.mutable.Relation(id=number, tags=tags, members=members))


def _round_box(box: Box) -> Box:
    """Return the box in OpenStreetMap's own steps of 1e-7 degrees, grown to them."""
    west, south, east, north = (value * 1e7 for value in box)
    return math.floor(west) / 1e7, math.floor(south) / 1e7, math.ceil(east) / 1e7, math.ceil(north) / 1e7
