"""Transit of a world: stops, lines and bicycle stations as records, tram tracks, and timetables.

The records are those of ``transit.json``; see `vico.world.model` for frame and numbers. `Track` says where the
sections of a tram stand, how fast bends allow, and how long a run takes. `LineTimes` and `TramTimes` say when buses
and trams go: departures day after day, how many vehicles a line has, and the times that those vehicles can keep.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from vico.clock import DAY
from vico.exact import each
from vico.geometry import arc_lengths, points_along
from vico.io.compiled import compiled
from vico.rules import BUS_DWELL, BUS_LAYOVER, TRAM_SECTION, TRAM_SECTIONS, TRAM_WIDTH
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


#: Metres between the points a track is known at.
STEP = 0.5
#: Metres around each of the points across a track that a tram sweeps.
ACROSS_REACH = 0.36
#: Length of a tram, metres.
TRAM_LENGTH = TRAM_SECTIONS * TRAM_SECTION
#: Speed of trams in a street at most, m/s.
TRAM_SPEED = 9.0
#: What trams speed up with, m/s².
TRAM_ACCELERATION = 1.0
#: What trams brake with, m/s².
TRAM_BRAKING = 1.1
_SIDEWAYS = 0.9  # m/s² that who stands in a tram is to feel at most in a bend
_SLOWEST = 2.5  # m/s, however tight the bend
#: Doors on both sides of a section, metres ahead of its middle.
TRAM_DOORS = (2.3, -2.3)
#: Metres from a section's middle to where it rests on the track, ahead and behind.
_PIVOT = 2.9
_AIR = 0.12  # metres kept on either side


class Track:
    """The track of a tram line, known every `STEP` metres.

    Parameters
    ----------
    line
        Its centre line, ENU metres, shape ``(n, 2)``.

    Attributes
    ----------
    length
        Metres.
    xy
        Points every `STEP` metres, shape ``(m, 2)``.
    half_width
        How far from each of them a tram reaches to the sides that passes it, with some air, metres, shape ``(m,)``.
    across
        Points from side to side at each of them, each `ACROSS_REACH` from the next one's reach, shape ``(m, 4, 2)``.
    speed
        How fast trams drive there, m/s, shape ``(m,)``: they brake ahead of bends.
    """

    def __init__(self, line: Sequence[Point2] | NDArray[np.float64]) -> None:
        points = np.asarray(line, np.float64).reshape(-1, 2)
        steps = np.hypot(*np.diff(points, axis=0).T)
        keep = np.concatenate([[True], steps > 1e-6])
        points = points[keep]
        self._along = arc_lengths(points)
        self._points = points
        self.length = float(self._along[-1])
        s = np.arange(math.floor(self.length / STEP) + 1) * STEP
        self.xy = self.at(s)
        reach = TRAM_SECTION / 2
        before, here, after = self.at(s - reach), self.xy, self.at(s + reach)
        into, out_of = here - before, after - here
        cross = into[:, 0] * out_of[:, 1] - into[:, 1] * out_of[:, 0]
        turn = each(math.atan2, cross, (into * out_of).sum(axis=1))
        bend = np.abs(turn) / reach
        self.half_width = TRAM_WIDTH / 2 + _AIR + np.minimum(TRAM_SECTION**2 / 8 * bend, 1.0)
        way = np.gradient(self.xy, axis=0) if len(self.xy) > 1 else np.ones((1, 2))
        way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        share = np.linspace(-1.0, 1.0, 4)[None, :] * (self.half_width - ACROSS_REACH)[:, None]
        self.across = self.xy[:, None] + share[..., None] * np.column_stack([-way[:, 1], way[:, 0]])[:, None]
        fast = np.clip(np.sqrt(_SIDEWAYS / np.maximum(bend, 1e-3)), _SLOWEST, TRAM_SPEED)
        # A bend counts for as long as any part of the tram is in it.
        wide = int(TRAM_LENGTH / STEP)
        self.speed = np.array([fast[max(0, k - wide) : k + 1].min() for k in range(len(fast))])
        for k in range(len(self.speed) - 2, -1, -1):
            self.speed[k] = min(self.speed[k], math.sqrt(self.speed[k + 1] ** 2 + 2 * TRAM_BRAKING * STEP))

    def at(self, s: ArrayLike) -> NDArray[np.float64]:
        """Points at distances along the track, metres, straight on beyond its ends; shape ``(..., 2)``."""
        s = np.asarray(s, np.float64)
        inside = np.clip(s, 0.0, self.length)
        xy = points_along(self._points, inside, self._along)
        over = (s - inside)[..., None]
        first, last = self._ends
        return np.asarray(xy + np.where(over < 0, first, last) * over, np.float64)

    @cached_property
    def _ends(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Directions in which the track begins and ends."""
        first, last = self._points[1] - self._points[0], self._points[-1] - self._points[-2]
        return first / np.hypot(*first), last / np.hypot(*last)

    def section(self, front: ArrayLike) -> NDArray[np.float64]:
        """x, y, yaw of the middle of a section whose front is at a distance along the track; shape ``(..., 3)``."""
        front = np.asarray(front, np.float64)
        found = np.empty((front.size, 3))
        _stand(front.ravel() - TRAM_SECTION / 2, self._along, self._points, *self._ends, found)
        return found.reshape(*front.shape, 3)

    def seconds(self, start: float, end: float, *, standing: bool = True) -> float:
        """Return the seconds of a tram between two distances along the track, braking to a stand there if need be."""
        s = np.arange(start, max(end, start + STEP), STEP)
        limit = np.interp(s, np.arange(len(self.speed)) * STEP, self.speed)
        speed = np.minimum(limit, np.sqrt(0.25 + 2 * TRAM_ACCELERATION * (s - start)))
        if standing:
            speed = np.minimum(speed, np.sqrt(0.25 + 2 * TRAM_BRAKING * (end - s)))
        return float((STEP / np.maximum(speed, 0.5)).sum())


@compiled
def _point(s, along, points, first, last):
    """Return the point at a distance along a track."""
    if s <= 0.0:
        return points[0, 0] + first[0] * s, points[0, 1] + first[1] * s
    end = along[-1]
    if s >= end:
        return points[-1, 0] + last[0] * (s - end), points[-1, 1] + last[1] * (s - end)
    k = np.searchsorted(along, s, side="right") - 1
    share = (s - along[k]) / (along[k + 1] - along[k])
    x = points[k, 0] + share * (points[k + 1, 0] - points[k, 0])
    return x, points[k, 1] + share * (points[k + 1, 1] - points[k, 1])


@compiled
def _stand(middles, along, points, first, last, found):
    """Write x, y, yaw of sections whose middles are at distances along a track, shape ``(n, 3)``."""
    for i in range(len(middles)):
        ax, ay = _point(middles[i] - _PIVOT, along, points, first, last)
        bx, by = _point(middles[i] + _PIVOT, along, points, first, last)
        found[i, 0], found[i, 1] = (ax + bx) / 2, (ay + by) / 2
        found[i, 2] = np.arctan2(by - ay, bx - ax)


def tram_door(track: Track, offset: float, door: int, side: float) -> tuple[Point2, Point2]:
    """Return where a door of a tram that stands with its front at `offset` is, and where its middle line is there.

    Parameters
    ----------
    door
        Counted from the front, two a section.
    side
        1 for the right side, -1 for the left one.
    """
    section, which = divmod(door, len(TRAM_DOORS))
    x, y, yaw = track.section(offset - section * TRAM_SECTION)
    x, y = x + math.cos(yaw) * TRAM_DOORS[which], y + math.sin(yaw) * TRAM_DOORS[which]
    aside = side * TRAM_WIDTH / 2
    return (float(x + math.sin(yaw) * aside), float(y - math.cos(yaw) * aside)), (float(x), float(y))


def departure(line: Line | TramLine, number: int) -> int:
    """Return when a departure of a line is, seconds from the midnight before the first; all days are alike."""
    days, of_the_day = divmod(number, len(line.departures))
    return line.departures[of_the_day] + DAY * days


def next_departure(line: Line, second: float) -> int:
    """Return the number of the first departure at a time or after it."""
    days, of_the_day = divmod(second, DAY)
    return bisect_left(line.departures, of_the_day) + len(line.departures) * int(days)


def buses_needed(line: Line) -> int:
    """Buses under way when most are: departures within the time of a round and its layover, but no more than stops."""
    n = len(line.departures)
    whole = line.travel[-1] + BUS_DWELL + BUS_LAYOVER
    ahead = 0
    most = 1
    for k in range(n):
        while departure(line, ahead + 1) < line.departures[k] + whole:
            ahead += 1
        most = max(most, ahead - k + 1)
    return min(most, len(line.stops))


@dataclass(frozen=True)
class LineTimes:
    """The times a line's buses keep, rounds by number from the first of the first day on.

    A line has `buses_needed` buses and no more. Where its timetable asks for more, a round begins when a bus is back.

    Attributes
    ----------
    line
        Whose times they are.
    buses
        How many there are; the bus of round ``k`` drives round ``k + buses`` next.
    departures
        When the rounds of a day leave the first stop, seconds of the day.
    """

    line: Line
    buses: int
    departures: tuple[float, ...]
    #: Whether who stays in comes round again.
    round: ClassVar[bool] = True

    @classmethod
    def of(cls, line: Line) -> LineTimes:
        """Work out the times of a line that has a departure and two stops at least."""
        buses, back = buses_needed(line), line.travel[-1] + BUS_DWELL
        kept: list[float] = []
        for k, due in enumerate(line.departures):
            kept.append(max(float(due), kept[k - buses] + back) if k >= buses else float(due))
        return cls(line, buses, tuple(kept))

    def begins(self, number: int) -> float:
        """Return when a round leaves the first stop, seconds from the midnight before the first."""
        days, of_the_day = divmod(number, len(self.departures))
        return self.departures[of_the_day] + DAY * days

    def arrives(self, number: int, stop: int) -> float:
        """Return when the bus of a round comes to a stop; ``len(stops)`` is the first one again, at the end."""
        return self.begins(number) + self.line.travel[stop]

    def leaves(self, number: int, stop: int) -> float:
        """Return when the bus of a round leaves a stop; from ``len(stops)`` it goes on with its next round."""
        if stop == len(self.line.stops):
            return max(self.begins(number + self.buses), self.arrives(number, stop) + BUS_DWELL)
        return self.begins(number) if stop == 0 else self.arrives(number, stop) + BUS_DWELL

    def next_round(self, stop: int, second: float) -> int:
        """Return the number of the first round that leaves a stop at a time or after it."""
        before = self.leaves(0, stop) - self.begins(0)
        days, of_the_day = divmod(second - before, DAY)
        return bisect_left(self.departures, of_the_day) + len(self.departures) * int(days)


@dataclass(frozen=True)
class TramTimes:
    """The times that a tram line keeps in one direction, trams by number from the first of the first day on.

    Attributes
    ----------
    line
        Whose times they are; it has a departure.
    """

    line: TramLine
    round: ClassVar[bool] = False

    def begins(self, number: int) -> float:
        """Return when a tram comes in where the track begins, seconds from the midnight before the first."""
        return departure(self.line, number)

    def arrives(self, number: int, stop: int) -> float:
        """Return when a tram comes to a stop of its line."""
        return self.begins(number) + self.line.travel[stop]

    def leaves(self, number: int, stop: int) -> float:
        """Return when a tram leaves a stop of its line."""
        return self.arrives(number, stop) + BUS_DWELL

    def next_round(self, stop: int, second: float) -> int:
        """Return the number of the first tram that leaves a stop at a time or after it."""
        days, of_the_day = divmod(second - self.line.travel[stop] - BUS_DWELL, DAY)
        return bisect_left(self.line.departures, of_the_day) + len(self.line.departures) * int(days)
