"""What a GTFS feed says about a window on one day of service."""

from __future__ import annotations

from dataclasses import dataclass

DAY = 86_400
#: How a build's report begins where a feed gives nothing to drive.
NO_TIMETABLE = "gives no bus"


@dataclass(frozen=True)
class GtfsStop:
    """A stop in the window; `xy` metres, ENU."""

    id: str
    name: str
    xy: tuple[float, float]


@dataclass(frozen=True)
class GtfsRoute:
    """A route that stops in the window; `kind` is bus or tram, `colour` ``#rrggbb`` or empty."""

    id: str
    name: str
    title: str
    kind: str
    colour: str
    agency: str


@dataclass(frozen=True)
class Pattern:
    """Trips of a route that call at the same stops of the window in the same order.

    Attributes
    ----------
    route
        Id of the route.
    direction
        ``0`` or ``1`` as the feed says, else empty.
    stops
        Ids of the calls in the window: the longest run of a trip between two of its calls outside.
    departures
        Seconds of the service day at which a bus leaves the first of them, sorted; beyond 86,400 after midnight.
    travel
        Seconds from then to each of them, in the median of the trips; the first is 0.
    line
        The way driven in the window's surroundings, ENU metres, shape ``(n, 2)`` as tuples; empty where no shape says.
    """

    route: str
    direction: str
    stops: tuple[str, ...]
    departures: tuple[int, ...]
    travel: tuple[int, ...]
    line: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Feed:
    """What a GTFS feed says about a window on one day of service.

    Attributes
    ----------
    name, sha256
        Of the file.
    day
        The day whose timetable it is, ISO 8601; empty where nothing runs in the window.
    stops, routes, patterns
        Those of buses and trams that stop in the window, sorted by id.
    attribution
        Who publishes it, as the feed says.
    broken
        Id and fault of rows that were left out (the first 200).
    nothing
        Why no bus or tram of it calls at two stops in the window; empty where one does.
    """

    name: str
    sha256: str
    day: str
    stops: tuple[GtfsStop, ...]
    routes: tuple[GtfsRoute, ...]
    patterns: tuple[Pattern, ...]
    attribution: str
    broken: tuple[tuple[str, str], ...] = ()
    nothing: str = ""
