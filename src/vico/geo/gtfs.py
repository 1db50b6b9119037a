"""Timetables: zipped GTFS feeds (https://gtfs.org/documentation/schedule/reference/), cut to a window.

A feed is read in streams, so that one of a whole country fits in memory; a hostile one is refused in bounded time and
space. Rows that can't be used are left out and named in `Feed.broken`.
"""

from __future__ import annotations

import math
import re
import zipfile
import zlib
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from datetime import date, timedelta
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.gtfs_feed import DAY, Feed, FeedTables, GtfsRoute, GtfsStop, Pattern
from vico.io.delimited import decimal
from vico.io.files import sha256_of

_MOST_STOPS = 400  # calls of one trip
_MOST_REPEATS = 2_000  # departures that one row of frequencies.txt may stand for
_MOST_DAYS = 3_660
_MOST_BROKEN = 200
_WEEK = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
_TIME = re.compile(r"\s*(\d{1,3}):([0-5]?\d)(?::([0-5]?\d)(?:\.\d*)?)?\s*(?P<half>[ap])?\.?(?:m\.?)?\s*", re.IGNORECASE)
_DATE = re.compile(r"(?P<year>\d{4})(?P<dash>-?)(?P<month>\d\d)(?P=dash)(?P<day>\d\d)")
_COLOUR = re.compile(r"[0-9a-fA-F]{6}")
_TRAMS = {0, 5, 12, *range(900, 907)}
_COACHES, _BUSES = range(200, 210), {*range(700, 717), 800}  # extended types
_KINDS = {"1": "underground", "2": "rail", "4": "ferry", "6": "cable car", "7": "funicular", "1100": "air"}
_STOP_KINDS = {"1": "stations", "2": "entrances", "3": "nodes", "4": "boarding areas"}


def read_gtfs(
    path: Path, frame: LocalFrame, half: float, *, day: date | None = None, as_of: date | None = None
) -> Feed:
    """Read the bus routes of a zipped GTFS feed that stop in a window.

    Parameters
    ----------
    path
        The feed, a zip.
    frame
        Local frame whose origin is the window's centre.
    half
        Half side of the window, metres.
    day
        Day of service; the weekday with the most trips in the window where not given (the first of several).
    as_of
        When the world is of, as its map says: a calendar that ended before then, or before the feed was packed, is told
        of in `Feed.broken`.

    Returns
    -------
    Feed
        Times are seconds of the service day.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is no readable feed, lacks a table it must have, or unpacks to an absurd size.
    InputError
        If nothing in the window runs on `day`.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path}: is a folder; zip the tables in it, and give the zip")
    if not path.is_file():
        raise MissingFileError(f"{path}: no such file; give a zipped GTFS feed")
    try:
        with zipfile.ZipFile(path) as archive:
            return _Reader(path, archive, frame, half).read(day, as_of)
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, NotImplementedError, ValueError) as error:
        if isinstance(error, SchemaError | InputError):
            raise
        reason = str(error).replace(str(path), "").strip(" :'") or type(error).__name__
        raise SchemaError(f"{path}: not a readable GTFS zip ({reason}); download it again") from None


def kind_of(route_type: str) -> str | None:
    """Return bus, tram or None for a route type, basic or extended."""
    number = decimal(route_type)
    if number in (3, 11) or number in _COACHES or number in _BUSES:
        return "bus"
    return "tram" if number in _TRAMS else None


def seconds_of(text: str) -> int | None:
    """Return a time (``25:10:00`` is ten past one the next day) as seconds of the service day, None if it is none.

    Seconds may be left out (``8:00``); a spreadsheet's ``8:00:00 PM`` is read too.
    """
    match = _TIME.fullmatch(text)
    if match is None:
        return None
    hours = int(match[1])
    if match["half"] is not None:
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + (12 if match["half"] in "pP" else 0)
    return hours * 3600 + int(match[2]) * 60 + int(match[3] or 0)


def _date_of(text: str) -> date | None:
    match = _DATE.fullmatch(text)
    try:
        return None if match is None else date(*(int(match[part]) for part in ("year", "month", "day")))
    except ValueError:
        return None


# stop_sequence, stop id, arrival, departure (None where not given)
Call = tuple[float, str, int | None, int | None]


@dataclass
class _Trip:
    """A trip and its calls."""

    route: str
    service: str
    direction: str
    shape: str
    calls: list[Call] = field(default_factory=list)
    unread: str = ""  # the first time that is none


class _Reader:
    def __init__(self, path: Path, archive: zipfile.ZipFile, frame: LocalFrame, half: float) -> None:
        self.path, self.frame, self.half = path, frame, half
        self._tables = FeedTables(path, archive)
        self._rows = self._tables.rows
        self.broken: list[tuple[str, str]] = []
        # What is passed over, and how often: the reason where nothing is left.
        self._stop_kinds: Counter[str] = Counter()
        self._route_kinds: Counter[str] = Counter()
        self._stop_ids: set[str] = set()
        self._elsewhere: set[str] = set()
        self._strays: Counter[str] = Counter()
        self._rows_of: Counter[str] = Counter()

    def read(self, day: date | None, as_of: date | None) -> Feed:
        self._tables.need("stops.txt", "routes.txt", "trips.txt", "stop_times.txt")
        if "calendar.txt" not in self._tables.members and "calendar_dates.txt" not in self._tables.members:
            raise SchemaError(f"{self.path}: has neither calendar.txt nor calendar_dates.txt; a GTFS feed has one")
        agencies = self._agencies()
        stops, parents = self._stops()
        routes = self._routes(agencies)
        known = self._trips(routes) if stops else {}
        trips = self._calling(known, stops) if stops else {}
        served = {trip.route for trip in trips.values()}
        chosen = self._day(trips, day)
        self._tell_of_calendar(chosen, as_of)
        patterns: list[Pattern] = []
        if chosen is not None:
            running = self._running(trips, chosen)
            patterns = self._patterns(running, stops)
        nothing = ""
        if all(len(pattern.stops) < 2 for pattern in patterns):
            nothing = self._why_nothing(stops, routes, known, trips, patterns)
        used = {s for p in patterns for s in p.stops} | {c[1] for t in trips.values() for c in t.calls if c[1] in stops}
        names = {stop: parents.get(stop, "") for stop in used}
        return Feed(
            name=self.path.name,
            sha256=sha256_of(self.path),
            day="" if chosen is None else chosen.isoformat(),
            stops=tuple(GtfsStop(k, names[k] or k, stops[k]) for k in sorted(used)),
            routes=tuple(routes[k] for k in sorted(served)),
            patterns=tuple(patterns),
            attribution=self._attribution(agencies, {routes[k].agency for k in served}),
            broken=(*sorted(self._tables.told.items()), *self.broken)[:_MOST_BROKEN],
            nothing=nothing,
        )

    def _why_nothing(
        self,
        stops: Collection[str],
        routes: Collection[str],
        known: Collection[str],
        trips: Collection[str],
        patterns: Collection[Pattern],
    ) -> str:
        """Return why no bus or tram of the feed runs here: the first step at which nothing is left."""
        if not stops:
            if not self._rows_of["stops.txt"]:
                return "stops.txt has no rows"
            if self._stop_kinds.total() == self._rows_of["stops.txt"]:
                kinds = _counts_in_words(self._stop_kinds, _STOP_KINDS, "location_type")
                return f"stops.txt has no stop where vehicles call (location_type 0 or empty), only {kinds}"
            return next((why for what, why in self.broken if what == "stops.txt"), "none of its stops has a place")
        if not routes:
            if not self._rows_of["routes.txt"]:
                return "routes.txt has no rows"
            kinds = _counts_in_words(self._route_kinds, _KINDS, "route_type")
            return f"routes.txt has no bus (route_type 3, 700-716) and no tram (0, 900-906), only {kinds}"
        if not known:
            if not self._rows_of["trips.txt"]:
                return "trips.txt has no rows"
            if self._strays:
                return f"no trip is of a bus or tram; {self._strays.total():,} are of routes that routes.txt has not"
            return "no trip in trips.txt is of a bus or tram"
        if not trips:
            told = [f"; {what}: {why}" for what, why in self.broken if what.startswith("trip ")]
            return f"no trip that can be read calls at a stop in the window{told[0] if told else ''}"
        if not any(self._days.values()):
            return "no day is a day of service of the trips that call here, by calendar.txt and calendar_dates.txt"
        if not patterns:
            return "no trip runs here on its busiest day; see what is said of its frequencies"
        return "no trip calls at two stops in the window, one after the other"

    def _fault(self, what: str, why: str) -> None:
        if len(self.broken) < _MOST_BROKEN:
            self.broken.append((what, why))

    def _agencies(self) -> dict[str, str]:
        return {key: name for name, key in self._rows("agency.txt", [], ["agency_name", "agency_id"]) if name}

    def _stops(self) -> tuple[dict[str, tuple[float, float]], dict[str, str]]:
        """Places and names of the stops in the window."""
        keys: list[str] = []
        names: list[str] = []
        degrees: list[tuple[float, float]] = []
        wanted = ["stop_name", "stop_lat", "stop_lon", "location_type"]
        for key, name, lat, lon, kind in self._rows("stops.txt", ["stop_id"], wanted):
            self._rows_of["stops.txt"] += 1
            self._stop_ids.add(key)
            if kind not in ("", "0"):
                self._stop_kinds[kind[:20]] += 1
                continue
            y, x = decimal(lat), decimal(lon)
            if y is None or x is None or not (abs(y) <= 90.0 and abs(x) <= 180.0):
                exchanged = y is not None and x is not None and abs(x) <= 90.0 < abs(y) <= 180.0
                why = "; latitude and longitude look exchanged" if exchanged else ""
                self._fault(f"stop {key[:60]}", f"no place on Earth ({lat[:20]}, {lon[:20]}){why}")
                continue
            keys.append(key)
            names.append(name)
            degrees.append((y, x))
        if not keys:
            return {}, {}
        table = np.array(degrees)
        inside, xy = self._in_window(table)
        if not len(inside):
            self._tell_of_elsewhere(table)
        chosen = {keys[i]: (round(float(x), 3), round(float(y), 3)) for i, (x, y) in zip(inside, xy, strict=True)}
        return chosen, {keys[i]: names[i] for i in inside}

    def _in_window(self, table: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return which places, degrees, lie in the window, and where in it, metres."""
        south, north = self.frame.bbox(self.half)[1::2]
        # Far away the projection has no bounds: only places of these latitudes are asked about.
        near = np.flatnonzero((table[:, 0] >= south) & (table[:, 0] <= north))
        xy = self.frame.to_enu(table[near, 0], table[near, 1]).reshape(-1, 2)
        inside = np.isfinite(xy).all(axis=1) & (np.abs(xy).max(axis=1, initial=0.0) <= self.half)
        return near[inside], xy[inside]

    def _tell_of_elsewhere(self, table: NDArray[np.float64]) -> None:
        """Report where stops lie when none is in the window, and whether they would be with coordinates exchanged."""
        (south, west), (north, east) = table.min(axis=0), table.max(axis=0)
        turned = table[:, ::-1][np.abs(table[:, 1]) <= 90.0]
        count = len(self._in_window(turned)[0]) if len(turned) else 0
        why = f"latitude and longitude look exchanged, the other way round {count:,} would; " if count else ""
        self._fault(
            "stops.txt",
            f"none of its {len(table):,} stops lies in the window; {why}they lie at latitudes {south:.4f}..{north:.4f} "
            f"and longitudes {west:.4f}..{east:.4f}",
        )

    def _routes(self, agencies: dict[str, str]) -> dict[str, GtfsRoute]:
        only = next(iter(agencies.values())) if len(agencies) == 1 else ""
        routes = {}
        wanted = ["route_short_name", "route_long_name", "route_color", "agency_id"]
        for key, kind, short, long, colour, agency in self._rows("routes.txt", ["route_id", "route_type"], wanted):
            self._rows_of["routes.txt"] += 1
            what = kind_of(kind)
            if what is None:
                self._route_kinds[kind[:20]] += 1
                self._elsewhere.add(key)
                if not kind.isdecimal():
                    self._fault(f"route {key[:60]}", f"route_type {kind[:20]!r} is no number; left out")
                continue
            shade = f"#{colour.removeprefix('#').lower()}" if _COLOUR.fullmatch(colour.removeprefix("#")) else ""
            routes[key] = GtfsRoute(key, short or long or key, long, what, shade, agencies.get(agency, only))
        return routes

    def _trips(self, routes: Collection[str]) -> dict[str, _Trip]:
        trips = {}
        rows = self._rows("trips.txt", ["route_id", "trip_id", "service_id"], ["direction_id", "shape_id"])
        for route, key, service, direction, shape in rows:
            self._rows_of["trips.txt"] += 1
            if route in routes:
                trips[key] = _Trip(route, service, direction, shape)
            elif route not in self._elsewhere:
                self._strays[route[:60]] += 1
        if self._strays:
            count, first = self._strays.total(), next(iter(self._strays))
            self._fault(
                "trips.txt",
                f"{count:,} of its trips are of routes that routes.txt has not ({first!r} for one); left out",
            )
        return trips

    def _calling(self, trips: dict[str, _Trip], stops: Collection[str]) -> dict[str, _Trip]:
        """Trips that call in the window, with all their calls. Two passes: most of a large feed never comes near."""
        near: set[str] = set()
        strays: Counter[str] = Counter()
        for key, stop in self._rows("stop_times.txt", ["trip_id", "stop_id"]):
            if stop in stops:
                near.add(key)
            elif stop not in self._stop_ids:
                strays[stop[:60]] += 1
        if strays:
            count, first = strays.total(), next(iter(strays))
            self._fault(
                "stop_times.txt", f"{count:,} of its calls are at stops that stops.txt has not ({first!r} for one)"
            )
        near &= trips.keys()
        if not near:
            return {}
        wanted = ["arrival_time", "departure_time"]
        for key, stop, place, arrival, departure in self._rows(
            "stop_times.txt", ["trip_id", "stop_id", "stop_sequence"], wanted
        ):
            if key not in near:
                continue
            order = decimal(place)
            if order is None:
                self._fault(f"trip {key[:60]}", f"stop_sequence {place[:20]!r} is no number; the call is left out")
                continue
            trip = trips[key]
            if len(trip.calls) < _MOST_STOPS:
                came, left = seconds_of(arrival), seconds_of(departure)
                if came is None and left is None and not trip.unread:
                    trip.unread = arrival or departure
                trip.calls.append((order, stop, came if came is not None else left, left if left is not None else came))
        kept = {}
        for key in sorted(near):
            trips[key].calls.sort(key=lambda call: call[0])
            fault = _interpolate_times(trips[key])
            if fault is None:
                kept[key] = trips[key]
            else:
                self._fault(f"trip {key[:60]}", fault)
        return kept

    # -- days --------------------------------------------------------------------------------------------------------

    def _services(self, wanted: Collection[str]) -> dict[str, set[date]]:
        """Days on which services run."""
        days: dict[str, set[date]] = defaultdict(set)
        for key, first, last, *week in self._rows("calendar.txt", ["service_id", "start_date", "end_date"], _WEEK):
            if key not in wanted:
                continue
            start, end = _date_of(first), _date_of(last)
            if start is None or end is None:
                self._fault(
                    f"service {key[:60]}", f"dates {first[:12]!r}, {last[:12]!r} are none (20260131 would be); left out"
                )
                continue
            for k in range(min((end - start).days + 1, _MOST_DAYS)):
                if week[(start.weekday() + k) % 7] == "1":
                    days[key].add(start + timedelta(days=k))
        for key, text, what in self._rows("calendar_dates.txt", ["service_id", "date", "exception_type"]):
            if key not in wanted:
                continue
            when = _date_of(text)
            if when is None:
                self._fault(f"service {key[:60]}", f"date {text[:12]!r} is none (20260131 would be); left out")
            elif what == "1":
                days[key].add(when)
            elif what == "2":
                days[key].discard(when)
        return days

    def _day(self, trips: dict[str, _Trip], day: date | None) -> date | None:
        """Return the day asked for, else the weekday with the most trips; None where there are no trips at all."""
        self._days = self._services({trip.service for trip in trips.values()})
        load: Counter[date] = Counter()
        for service, count in Counter(trip.service for trip in trips.values()).items():
            for when in self._days.get(service, ()):
                load[when] += count
        if day is not None and trips:
            if not load[day]:
                span = f"it runs from {min(load)} to {max(load)}" if load else "its calendar has no day"
                raise InputError(f"{self.path}: nothing in the window runs on {day}; {span}")
            return day
        weekdays = [when for when in load if when.weekday() < 5 and load[when]] or [w for w in load if load[w]]
        return min(weekdays, key=lambda when: (-load[when], when)) if weekdays else None

    def _tell_of_calendar(self, chosen: date | None, as_of: date | None) -> None:
        """Report a timetable that ended before the map's day or the day the feed was packed."""
        if chosen is None:
            return
        ended = max(day for days in self._days.values() for day in days)
        now = max(self._tables.packed, as_of or date.min)
        if ended < now:
            years = (now - ended).days // 365
            ago = f"{years} year{'s' * (years > 1)}" if years else f"{(now - ended).days} days"
            self._fault(
                "calendar",
                f"its services here ended on {ended}, {ago} before {now}, when the map or the feed was made; the "
                f"timetable of {chosen} is taken; download a newer feed to have today's",
            )

    def _running(self, trips: dict[str, _Trip], day: date) -> dict[str, _Trip]:
        """Trips of the day; those of frequencies.txt once for each departure."""
        running = {key: trip for key, trip in trips.items() if day in self._days.get(trip.service, ())}
        repeated: dict[str, list[_Trip]] = defaultdict(list)
        rows = self._rows("frequencies.txt", ["trip_id", "start_time", "end_time", "headway_secs"])
        for key, first, last, gap in rows:
            trip = running.get(key)
            if trip is None:
                continue
            start, end = seconds_of(first), seconds_of(last)
            step = decimal(gap) or 0.0
            if start is not None and end is not None and end < start <= DAY:
                end += DAY
                self._fault(
                    f"trip {key[:60]}",
                    f"frequency {first[:9]}-{last[:9]} ends before it begins; read as past midnight, "
                    f"{end // 3600}:{end % 3600 // 60:02d}",
                )
            # What repeats has no times of its own: those in stop_times.txt say how long it takes.
            runs = repeated[key]
            if (
                start is None
                or end is None
                or end <= start
                or not 1.0 <= step <= DAY
                or ((end - start) / step > _MOST_REPEATS)
            ):
                self._fault(
                    f"trip {key[:60]}", f"frequency {first[:9]}-{last[:9]} every {gap[:9]} s makes no timetable"
                )
                continue
            shift = trip.calls[0][3] or 0
            for k in range(math.ceil((end - start) / step)):
                if len(runs) >= _MOST_REPEATS:
                    break
                begin = start + round(k * step)
                calls: list[Call] = [
                    (n, s, (a or 0) - shift + begin, (d or 0) - shift + begin) for n, s, a, d in trip.calls
                ]
                runs.append(_Trip(trip.route, trip.service, trip.direction, trip.shape, calls))
        plain = {key: trip for key, trip in running.items() if key not in repeated}
        return plain | {f"{key} {k}": trip for key, runs in repeated.items() for k, trip in enumerate(runs)}

    # -- patterns ----------------------------------------------------------------------------------------------------

    def _patterns(self, trips: dict[str, _Trip], stops: Collection[str]) -> list[Pattern]:
        runs: dict[tuple[str, str, tuple[str, ...]], list[tuple[int, list[int], str]]] = defaultdict(list)
        for trip in trips.values():
            calls = _within(trip, stops)
            if calls:
                begin = calls[0][3] or 0
                gone = [0, *((call[2] or 0) - begin for call in calls[1:])]
                key = (trip.route, trip.direction, tuple(call[1] for call in calls))
                runs[key].append((begin, gone, trip.shape))
        lines = self._shapes({row[2] for rows in runs.values() for row in rows if row[2]})
        patterns = []
        for (route, direction, called), rows in sorted(runs.items()):
            shapes = Counter(shape for *_, shape in rows)
            shape = min(shapes, key=lambda s: (-shapes[s], s))
            travel = np.median(np.array([gone for _, gone, _ in rows]), axis=0)
            patterns.append(
                Pattern(
                    route=route,
                    direction=direction,
                    stops=called,
                    departures=tuple(sorted({begin for begin, *_ in rows})),
                    travel=tuple(int(t) for t in np.maximum.accumulate(travel)),
                    line=lines.get(shape, ()),
                )
            )
        return patterns

    def _shapes(self, wanted: Collection[str]) -> dict[str, tuple[tuple[float, float], ...]]:
        """Lines of shapes near the window."""
        rows: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
        if not wanted:
            return {}
        for key, lat, lon, order in self._rows(
            "shapes.txt", ["shape_id", "shape_pt_lat", "shape_pt_lon", "shape_pt_sequence"]
        ):
            if key in wanted:
                y, x, n = decimal(lat), decimal(lon), decimal(order)
                if y is None or x is None or n is None:
                    continue
                if abs(y - self.frame.lat) < 1.0 and abs((x - self.frame.lon + 180.0) % 360.0 - 180.0) <= 90.0:
                    rows[key].append((n, y, x))
        lines = {}
        for key in sorted(rows):
            table = np.array([(y, x) for _, y, x in sorted(rows[key])])
            xy = self.frame.to_enu(table[:, 0], table[:, 1])
            near = np.isfinite(xy).all(axis=1) & (np.abs(xy).max(axis=1) <= 2.0 * self.half + 200.0)
            lines[key] = tuple((round(float(x), 2), round(float(y), 2)) for x, y in xy[near])
        return lines

    def _attribution(self, agencies: dict[str, str], served: Collection[str]) -> str:
        """Return the publisher of feed_info.txt and attributions.txt, else the agencies that serve the window."""
        named = [name for (name,) in self._rows("feed_info.txt", [], ["feed_publisher_name"])]
        named += [name for (name,) in self._rows("attributions.txt", [], ["organization_name"])]
        named = [name for name in named if name] or sorted(name for name in served if name)
        named = named or list(agencies.values())
        return ", ".join(dict.fromkeys(name[:200] for name in named[:12])) or self.path.name


def _counts_in_words(kinds: Counter[str], names: Mapping[str, str], column: str) -> str:
    """Return counts by kind in words, the most frequent first."""
    words = {kind: f" ({name})" for kind, name in names.items()}
    shown = [f"{count:,} of {column} {kind or 'empty'}{words.get(kind, '')}" for kind, count in kinds.most_common(4)]
    more = [f"{len(kinds) - 4} more kinds"] if len(kinds) > 4 else []
    return ", ".join(shown + more)


def _interpolate_times(trip: _Trip) -> str | None:
    """Fill in the times of calls that have none, evenly between those that have; says why where that can't be done."""
    calls = trip.calls
    if len(calls) < 2:
        return "calls at fewer than two stops; left out"
    known = [k for k, call in enumerate(calls) if call[2] is not None]
    if not known or known[0] != 0 or known[-1] != len(calls) - 1:
        if trip.unread:
            return f"its time {trip.unread[:20]!r} is none (8:00 or 08:00:00 would be); left out"
        return "has no time at its first or last stop; left out"
    for a, b in pairwise(known):
        start, end = calls[a][3] or 0, calls[b][2] or 0
        if end < start:
            return f"its times go back at stop {calls[b][1][:40]}; left out"
        for k in range(a + 1, b):
            when = start + (end - start) * (k - a) // (b - a)
            calls[k] = (calls[k][0], calls[k][1], when, when)
    return None


def _within(trip: _Trip, stops: Collection[str]) -> list[Call]:
    """Return the longest run of calls in the window."""
    best: list[Call] = []
    run: list[Call] = []
    for call in [*trip.calls, None]:
        if call is not None and call[1] in stops:
            run.append(call)
        else:
            best = run if len(run) > len(best) else best
            run = []
    return best
