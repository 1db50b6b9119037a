"""Sites of city events: places, streets, lanes, barriers, stalls and crowds.

A record of an event names places, streets or lanes of a world. There are a barrier before each lane that is closed,
stalls over a square, or a stage; a gathering says how many people come, where each stands or strolls, and along what a
march goes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from vico.errors import InputError
from vico.sim.environment.city_events import CityEvent, Occurrence, kind_of_event
from vico.world.model import Category, Place, Point2, Road
from vico.world.walkable import CROSSING, ROADWAY
from vico.world.walkways import SIDEWALK, Walkways
from vico.world.world import World

#: Places that close when the power is cut: all but homes and open ground.
TRADE = (Category.FOOD, Category.STORE, Category.OFFICE, Category.ENTERTAINMENT)
# A lane's middle is this far from its street's kerb at the most, metres.
_LANE_BESIDE = 1.0
# Walkways lie within so many metres of the carriageway's edge.
_WALKWAY = 5.0
_SHOWN = 3


class EventSites:
    """Looks up where events are; what never changes of it is made when it is first asked for.

    Parameters
    ----------
    world
        Where they are.
    walks
        Gives the walkways that traffic has; None: the world's.
    """

    def __init__(self, world: World, walks: Callable[[], Walkways] | None = None) -> None:
        self._world = world
        self._walks = walks or (lambda: world.lanes.walks)

    def check(self, event: CityEvent) -> None:
        """Refuse an event that names what is not there.

        Raises
        ------
        InputError
            If there is no such place or street, or nothing of it within the region.
        """
        if event.place:
            self.place(event.place)
        if event.street and not self.street(event).length:
            raise InputError(f"events: {event.kind}: no part of {event.street!r} lies in its region; make that larger")
        if event.region is not None:
            half = self._world.half
            west, south, east, north = self._world.edges or (-half, -half, half, half)
            if not (west <= event.region[0] <= east and south <= event.region[1] <= north):
                raise InputError(
                    f"events: {event.kind}: region {list(event.region)} lies off the map, which reaches from "
                    f"x {west:g}, y {south:g} to x {east:g}, y {north:g}"
                )

    def place(self, wanted: str) -> Place:
        """Return a place by its id, or by its name if one alone has it.

        Raises
        ------
        InputError
            If there is none, or several.
        """
        found = self._by_id.get(wanted)
        if found is not None:
            return found
        named = [place for place in self._world.places if place.name == wanted]
        if len(named) == 1:
            return named[0]
        if named:
            ids = ", ".join(place.id for place in named[:_SHOWN])
            raise InputError(f"events: {len(named)} places are called {wanted!r}; give an id, such as {ids}")
        raise InputError(f"events: no place has the id or name {wanted!r}; the world's places.json lists them")

    def places_of(self, event: CityEvent) -> list[Place]:
        """Return the places an event shuts."""
        shuts = kind_of_event(event.kind).shuts
        if shuts == "nothing":
            return []
        if event.place:
            return [self.place(event.place)]
        ground = self.ground(event)
        return [
            place
            for place in self._world.places
            if place.category in TRADE and place.rooms and ground.covers(shapely.Point(place.position[:2]))
        ]

    def street(self, event: CityEvent) -> shapely.Geometry:
        """Return the centre lines of the street that an event is at, metres; empty if nothing of it is in its region.

        Raises
        ------
        InputError
            If there is no such street.
        """
        lines = [shapely.LineString(road.line) for road in self._roads_of(event.street)]
        street = shapely.union_all(lines)
        if event.region is not None:
            x, y, radius = event.region
            street = street.intersection(shapely.Point(x, y).buffer(radius))
        return street

    def lanes_of(self, event: CityEvent) -> NDArray[np.bool_]:
        """Return which lanes of the world cars keep off because of an event, shape ``(lanes,)``: of whole streets."""
        lanes = self._world.lanes
        closed = np.zeros(len(lanes), bool)
        if not event.street or not kind_of_event(event.kind).lanes:
            return closed
        # As wide as the widest road of it: a lane is where its middle is.
        half = max(road.width for road in self._roads_of(event.street)) / 2 + _LANE_BESIDE
        area = self.street(event).buffer(half, cap_style="flat")
        middles = lanes.at(np.arange(len(lanes)), lanes.length / 2)[:, :2]
        return np.asarray(shapely.contains_xy(area, middles)) & (lanes.inside < 0)

    def walkways_of(self, event: CityEvent) -> NDArray[np.bool_]:
        """Return which walkways of traffic lie along the street of an event, crossings and corners left open."""
        walks = self._walks()
        lines = [shapely.LineString(walks.line(k)) for k in range(len(walks))]
        middles = shapely.get_coordinates(shapely.line_interpolate_point(lines, 0.5, normalized=True)).reshape(-1, 2)
        return np.asarray(shapely.contains_xy(self.ground(event), middles)) & (walks.kind == SIDEWALK)

    def circles(self, event: CityEvent) -> list[tuple[float, float, float]]:
        """Return the ground of a street's event as circles, x, y and radius, that do not reach beyond its ends."""
        half = max(road.width for road in self._roads_of(event.street)) / 2 + _WALKWAY
        found = []
        for line in shapely.get_parts(shapely.line_merge(self.street(event))):
            count = max(1, math.ceil((line.length - 2 * half) / half) + 1)
            along = np.linspace(min(half, line.length / 2), max(line.length - half, line.length / 2), count)
            found += [
                (*xy, half) for xy in shapely.get_coordinates(shapely.line_interpolate_point(line, along)).tolist()
            ]
        return found

    def ground(self, event: CityEvent) -> shapely.Geometry:
        """Return the ground that an event takes up, metres."""
        if event.street:
            half = max(road.width for road in self._roads_of(event.street)) / 2
            return self.street(event).buffer(half + _WALKWAY, cap_style="flat")
        if event.region is not None:
            return shapely.Point(event.region[:2]).buffer(event.region[2])
        return shapely.Point(self.place(event.place).position[:2]).buffer(kind_of_event(event.kind).radius)

    def middle(self, event: CityEvent) -> NDArray[np.float64]:
        """Return the point that an event is at, ENU metres, shape ``(3,)``: a place's door, or its ground's middle."""
        if event.place:
            return np.array(self.place(event.place).position, np.float64)
        shape = self.street(event) if event.street else self.ground(event)
        if event.street:
            longest = max(shapely.get_parts(shapely.line_merge(shape)), key=lambda line: float(line.length))
            point = shapely.get_coordinates(shapely.line_interpolate_point(longest, 0.5, normalized=True))[0]
        else:
            point = shapely.get_coordinates(shape.centroid)[0]
        return np.array([*point, float(self._world.height(point))])

    @property
    def walks(self) -> Walkways:
        """The walkways that traffic has."""
        return self._walks()

    @property
    def world(self) -> World:
        """Where it is."""
        return self._world

    @cached_property
    def streets(self) -> list[str]:
        """Names of the streets that cars drive along, in the order of the road database."""
        return list(self._roads)

    @cached_property
    def _by_id(self) -> dict[str, Place]:
        return {place.id: place for place in self._world.places}

    @cached_property
    def _roads(self) -> dict[str, list[Road]]:
        found: dict[str, list[Road]] = {}
        for road in self._world.roads.roads:
            if road.name and road.lanes > 0 and road.closed is None:
                found.setdefault(road.name, []).append(road)
        return found

    def _roads_of(self, wanted: str) -> list[Road]:
        named = self._roads.get(wanted)
        roads = named or [road for road in self._world.roads.roads if road.id == wanted]
        if not roads:
            raise InputError(f"events: no street is called {wanted!r}; take one of {', '.join(self.streets[:5])}, ...")
        return roads


# A barrier stands so far within its lane, metres, or in its middle if that is nearer.
_INTO_LANE = 4.0
#: What stands across closed lanes.
BARRIER = "road_barrier"
_STALLS_APART = 5.0  # m between stalls
_STALL_ROOM = 2.2  # m of free ground around the middle of a stall
_STAGE_ROOM = 5.0  # m of free ground around the middle of a stage
# Directions in which it is asked what is there.
_AROUND = np.array([(np.cos(a), np.sin(a)) for a in np.arange(12) * np.pi / 6])
# Cars that have run into each other: metres between their middles, and radians that the one behind is askew.
_CAR_APART, _ASKEW = 5.6, 0.2


class Spot(NamedTuple):
    """Where a thing stands: its model, ENU metres, radians."""

    model: str
    x: float
    y: float
    yaw: float


def spots_of(one: Occurrence, sites: EventSites) -> list[Spot]:
    """Return where an event's things stand, always in the same order."""
    if not one.kind.lanes:
        return _over_ground(one, sites)
    models = list(one.kind.things)
    if models == [BARRIER]:
        return _before_lanes(BARRIER, one, sites)
    # One behind the other in the middle of the longest closed lane that no bus takes, askew.
    lanes, closed = sites.world.lanes, sites.lanes_of(one.event)
    usable = [k for k in np.flatnonzero(closed).tolist() if k not in _lanes_of_buses(sites)]
    if not usable or not models:
        return []
    lane = max(usable, key=lambda k: (float(lanes.length[k]), -k))
    found = []
    for k, model in enumerate(models):
        x, y, yaw = lanes.at(lane, max(float(lanes.length[lane]) / 2 - _CAR_APART * k, 0.0)).tolist()
        found.append(Spot(model, x, y, yaw + _ASKEW * k))
    return found


def _over_ground(one: Occurrence, sites: EventSites) -> list[Spot]:
    """Return spots on a grid round the middle, the nearest first, as many as there is open ground for."""
    models = [model for model, count in one.kind.things.items() for _ in range(count)]
    reach = one.kind.radius if one.event.region is None else one.event.region[2]
    # One thing alone may stand anywhere: lamps and trees leave few places with so much room.
    apart = _STALLS_APART if len(models) > 1 else _STALLS_APART / 4
    steps = np.arange(-np.floor(reach / apart), np.floor(reach / apart) + 1) * apart
    grid = np.array([(x, y) for x in steps for y in steps if x * x + y * y <= reach * reach]).reshape(-1, 2)
    grid = grid[np.lexsort((grid[:, 1], grid[:, 0], np.round(np.hypot(*grid.T), 3)))]
    points = grid + one.middle[:2]
    room = _STAGE_ROOM if len(models) == 1 else _STALL_ROOM
    walkable = sites.world.walkable
    free = walkable.is_connected(points) & (walkable.clearance_at(points) >= room)
    # Not even their edges stand in a street.
    around = points[:, None] + np.concatenate([np.zeros((1, 2)), room / 2 * _AROUND, room * _AROUND])
    free &= ~np.isin(walkable.class_at(around), (ROADWAY, CROSSING)).any(axis=1)
    chosen = points[free][: len(models)]
    return [Spot(model, float(x), float(y), 0.0) for model, (x, y) in zip(models, chosen, strict=False)]


def _lanes_of_buses(sites: EventSites) -> set[int]:
    index = sites.world.lanes.index
    return {index[lane] for line in sites.world.transit.lines for lane in line.lanes if lane in index}


def _before_lanes(model: str, one: Occurrence, sites: EventSites) -> list[Spot]:
    """Return a spot across each closed lane where cars could drive in; buses' lanes stay free."""
    lanes, closed = sites.world.lanes, sites.lanes_of(one.event)
    buses = _lanes_of_buses(sites)
    found = []
    for lane in np.flatnonzero(closed).tolist():
        through = [k for k in lanes.preceding(lane).tolist() if lanes.inside[k] < 0 and closed[k]]
        if lane not in buses and not through:
            x, y, yaw = lanes.at(lane, min(_INTO_LANE, float(lanes.length[lane]) / 2)).tolist()
            found.append(Spot(model, x, y, yaw))
    return found


Floats = NDArray[np.float64]

MARCH_SPEED = 0.6  # m/s of a march
ROW_APART = 1.4  # m between its rows
BESIDE_APART = 0.95  # m between two beside each other
_ROOM = 0.35  # m around who stands
_NEAREST = 5.5  # m from a stage to the first row before it
_ROWS = 7  # rows before a stage
_ROW_DEPTH = 1.2  # m from a row to the next
_VISITORS_APART = 1.1  # m between two of a row
_WIDEST = 1.3  # rad to either side that a row goes round a stage
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
        return _march(one, sites, shapely.get_coordinates(longest), _frequented_places(sites.walks, off))
    spots = spots_of(one, sites)
    places = _free(before_stage(spots) if manner == "watch" else _before_stalls(spots), sites)
    entry = _entry(places[:, :2], sites, _frequented_places(sites.walks, off)) if len(places) else None
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


def _frequented_places(walks: Walkways, off: NDArray[np.bool_] | None) -> NDArray[np.int64]:
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
            radius = _NEAREST + row * _ROW_DEPTH
            half = int(_WIDEST * radius / _VISITORS_APART)
            for angle in (np.arange(-half, half + 1) + 0.5 * (row % 2)) * _VISITORS_APART / radius:
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
