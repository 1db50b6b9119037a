"""Who comes to an event: how many, where each of them stands or strolls, and along what a march goes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from vico.sim.environment.event_sites import EventSites
from vico.sim.environment.event_spots import Spot, spots_of
from vico.sim.environment.occurrence import Occurrence
from vico.world.model import Point2
from vico.world.walkable import CROSSING, ROADWAY
from vico.world.walkways import SIDEWALK, Walkways

Floats = NDArray[np.float64]

#: Metres that a march goes a second, between its rows, and between two beside each other.
MARCH_SPEED, ROW_APART, BESIDE_APART = 0.6, 1.4, 0.95
_ROOM = 0.35  # m around who stands
_NEAREST, _ROWS, _ROW, _APART, _WIDEST = 5.5, 7, 1.2, 1.1, 1.3  # m, rows, m, m and rad of a half circle
_BEFORE_STALL = 2.0  # m from a stall's middle to who looks at it
_ENTRY_WITHIN, _ENTRY_EVERY = 70.0, 3.0  # m from the middle to where people come from, and between points tried
_NO_PLACES: Floats = np.zeros((0, 3))
_ALONG = 0.5  # m between points of a way that are looked at


@dataclass(frozen=True, eq=False)
class Gathering:
    """The crowd of an event.

    Attributes
    ----------
    id
        The event's.
    manner
        ``watch``, ``stroll`` or ``march``.
    count
        How many come, if there are so many.
    begin
        Second at which the event began.
    walkway, offset, entry
        Sidewalk on which they come, metres along it, and that point, ENU metres.
    places
        Where they stand: x, y and yaw, shape ``(n, 3)``; none for a march.
    route
        What a march goes along and back, ENU metres, shape ``(k, 2)``.
    abreast
        How many of a march go beside each other.
    """

    id: int
    manner: str
    count: int
    begin: float
    walkway: int
    offset: float
    entry: Point2
    places: Floats
    route: Floats
    abreast: int = 1

    @property
    def length(self) -> float:
        """How long the way of a march is, metres."""
        return float(np.hypot(*np.diff(self.route, axis=0).T).sum()) if len(self.route) else 0.0

    def place(self, number: int, second: float) -> Floats:
        """Return where the one with a number is to be at a second: x, y and yaw."""
        return self.places[number] if self.manner != "march" else self._in_march(number, second)

    def _in_march(self, number: int, second: float) -> Floats:
        row, column = divmod(number, self.abreast)
        deep = ROW_APART * (-(-self.count // self.abreast) - 1)
        way = max(self.length - deep, 1e-3)
        gone = (MARCH_SPEED * max(second - self.begin, 0.0)) % (2 * way)
        along = deep + (gone if gone <= way else 2 * way - gone) - ROW_APART * row
        line = shapely.LineString(self.route)
        x, y = line.interpolate(along).coords[0]
        a, b = line.interpolate(max(along - 0.5, 0.0)).coords[0], line.interpolate(along + 0.5).coords[0]
        yaw = math.atan2(b[1] - a[1], b[0] - a[0])
        aside = BESIDE_APART * (column - (self.abreast - 1) / 2)
        facing = yaw if gone <= way else yaw + np.pi
        return np.array([x - np.sin(yaw) * aside, y + np.cos(yaw) * aside, facing])


def gathering_of(one: Occurrence, sites: EventSites, off: NDArray[np.bool_] | None = None) -> Gathering | None:
    """Return the crowd of an event; None if none comes, or there is no sidewalk from where one gets there.

    Nobody comes along the walkways of the mask `off`.
    """
    manner = one.kind.crowd_manner
    if not one.kind.crowd or not len(sites.walks):
        return None
    if manner == "march":
        lines = shapely.get_parts(shapely.line_merge(sites.street(one.event)))
        longest = max(lines, key=lambda line: float(line.length))
        return _march(one, sites, shapely.get_coordinates(longest), _frequented(sites.walks, off))
    spots = spots_of(one, sites)
    places = _free(before_stage(spots) if manner == "watch" else _before_stalls(spots), sites)
    entry = _entry(places[:, :2], sites, _frequented(sites.walks, off)) if len(places) else None
    if entry is None:
        return None
    walkway, offset, point, seen = entry
    places, route = places[seen], np.zeros((0, 2))
    count = min(one.kind.crowd, len(places))
    return Gathering(one.id, manner, count, one.event.begin, walkway, offset, point, places, route)


def _march(one: Occurrence, sites: EventSites, route: Floats, sidewalks: NDArray[np.int64]) -> Gathering | None:
    """Return a march along a way: from the end to which people come the nearest; None if they come to neither."""
    found: list[tuple[float, Gathering]] = []
    for way in (route, route[::-1].copy()):
        entry = _entry(way[:1], sites, sidewalks, across_streets=True)
        if entry is not None:
            walkway, offset, point, _ = entry
            away = float(np.hypot(*(way[0] - np.asarray(point))))
            begin, count = one.event.begin, one.kind.crowd
            found.append((away, Gathering(one.id, "march", count, begin, walkway, offset, point, _NO_PLACES, way, 4)))
    return min(found, key=lambda each: each[0])[1] if found else None


def _frequented(walks: Walkways, off: NDArray[np.bool_] | None) -> NDArray[np.int64]:
    """Return the sidewalks of the largest part of the network that hangs together: from there most people come."""
    is_open = np.ones(len(walks), np.bool_) if off is None else ~off
    nodes, ends = len(walks.meeting_first) - 1, walks.ends
    graph = csr_matrix((is_open[is_open], (ends[is_open, 0], ends[is_open, 1])), shape=(nodes, nodes))
    part = connected_components(graph, directed=False)[1][ends[:, 0]]
    length = np.bincount(part[is_open], weights=walks.length[is_open])
    return np.flatnonzero(is_open & (part == int(np.argmax(length))) & (walks.kind == SIDEWALK))


def before_stage(spots: list[Spot]) -> Floats:
    """Return places in half circles before a stage, the nearest first, looking at it."""
    found = []
    for spot in spots[:1]:
        for row in range(_ROWS):
            radius = _NEAREST + row * _ROW
            half = int(_WIDEST * radius / _APART)
            for angle in (np.arange(-half, half + 1) + 0.5 * (row % 2)) * _APART / radius:
                x, y = spot.x + radius * np.cos(spot.yaw + angle), spot.y + radius * np.sin(spot.yaw + angle)
                found.append((x, y, spot.yaw + angle + np.pi))
    return np.array(found).reshape(-1, 3)


def _before_stalls(spots: list[Spot]) -> Floats:
    """Return places on four sides of each stall, looking at it."""
    found = []
    for k in range(4):
        for spot in spots:
            yaw = spot.yaw + k * np.pi / 2
            side = 0.6 if k % 2 else -0.6
            x = spot.x + _BEFORE_STALL * np.cos(yaw) - side * np.sin(yaw)
            y = spot.y + _BEFORE_STALL * np.sin(yaw) + side * np.cos(yaw)
            found.append((x, y, yaw + np.pi))
    return np.array(found).reshape(-1, 3)


def _free(places: Floats, sites: EventSites) -> Floats:
    """Return the places on open ground, clear of streets."""
    walkable = sites.world.walkable
    points = places[:, :2]
    free = walkable.is_connected(points) & (walkable.clearance_at(points) >= _ROOM)
    return places[free & ~np.isin(walkable.class_at(points), (ROADWAY, CROSSING))]


def _entry(
    towards: Floats, sites: EventSites, sidewalks: NDArray[np.int64], *, across_streets: bool = False
) -> tuple[int, float, Point2, NDArray[np.bool_]] | None:
    """Return the point of a sidewalk from which most of some points are reached straight on; of equals the nearest.

    Returns
    -------
    tuple or None
        Sidewalk, metres along it, the point, and which of `towards` are reached.
    """
    walks, middle = sites.walks, towards.mean(axis=0)
    best: tuple[int, float] | None = None
    found: tuple[int, float, Point2, NDArray[np.bool_]] | None = None
    for walkway in sidewalks.tolist():
        line = shapely.LineString(walks.line(walkway))
        if line.distance(shapely.Point(middle)) > _ENTRY_WITHIN:
            continue
        for offset in np.arange(2.0, line.length - 1.0, _ENTRY_EVERY).tolist():
            point = line.interpolate(offset).coords[0]
            away = float(np.hypot(point[0] - middle[0], point[1] - middle[1]))
            seen = np.array([_is_open(point, goal, sites, across_streets) for goal in towards])
            score = int(seen.sum()), -away
            if seen.any() and (best is None or score > best):
                best, found = score, (walkway, offset, (float(point[0]), float(point[1])), seen)
    return found


def _is_open(start: Point2, goal: Floats, sites: EventSites, across_streets: bool) -> bool:
    """Return whether one can walk straight from one point to another."""
    away = float(np.hypot(goal[0] - start[0], goal[1] - start[1]))
    if away > _ENTRY_WITHIN:
        return False
    share = np.linspace(0.0, 1.0, 2 + int(away / _ALONG))[:, None]
    points = np.asarray(start) * (1 - share) + goal * share
    walkable = sites.world.walkable
    if float(walkable.clearance_at(points[1:]).min()) < _ROOM - 0.05:
        return False
    return across_streets or not bool(np.isin(walkable.class_at(points), (ROADWAY, CROSSING)).any())
