"""Buses, trams and bicycle stations, as records of a world folder; see `vico.world.model` for frame and numbers."""

from __future__ import annotations

from pydantic import Field

from vico.world.model import Dropped, Point2, Point3, Record


class Stop(Record):
    """A bus stop. `wait` is where people stand; `lane`, `offset` where the bus's front door comes to rest."""

    id: str
    entity: int
    name: str
    wait: Point3
    lane: str
    offset: float


class Line(Record):
    """A bus line: a closed drive over lanes.

    Attributes
    ----------
    stops
        Stop ids in the order they are served.
    lanes
        Lane ids (junction lanes among them) of one round trip, starting at the first stop's lane.
    departures
        Seconds of the day at which a bus leaves the first stop.
    travel
        Scheduled seconds from leaving the first stop to arriving at each stop (first: 0), then back at the first.
    """

    id: str
    name: str
    colour: str
    stops: list[str]
    lanes: list[str]
    departures: list[int]
    travel: list[float]


class BikeStation(Record):
    """A bicycle station."""

    id: str
    entity: int
    name: str
    position: Point3
    capacity: int
    bikes: int


class TramStop(Record):
    """A stop of trams. `wait` is where people stand."""

    id: str
    entity: int
    name: str
    wait: Point3


class TramLine(Record):
    """A line on rails in one direction: trams come in where its track begins and go out where it ends.

    Attributes
    ----------
    kind
        tram, light_rail or rail.
    track
        Centre line of the track in the direction it is driven, ENU metres.
    stops
        Stop ids in the order they are served; none where trams only pass.
    offsets
        Metres along the track at which a tram's front comes to rest at each stop.
    departures
        Seconds of the day at which a tram's front is where the track begins.
    travel
        Scheduled seconds from then to its arrival at each stop, then to its front being where the track ends.
    """

    id: str
    name: str
    kind: str
    colour: str
    track: list[Point2]
    stops: list[str]
    offsets: list[float]
    departures: list[int]
    travel: list[float]


class Transit(Record):
    """`transit.json`: stops, lines, bicycle stations, and where each came from (osm, gtfs, planned).

    Attributes
    ----------
    left_out
        Routes of the sources that no line drives, with the reason.
    tram_stops, tram_lines
        What runs on rails; none in worlds built before there were any.
    """

    stops: list[Stop]
    lines: list[Line]
    bike_stations: list[BikeStation]
    origin: dict[str, str]
    left_out: list[Dropped] = Field(default_factory=list)
    tram_stops: list[TramStop] = Field(default_factory=list)
    tram_lines: list[TramLine] = Field(default_factory=list)
