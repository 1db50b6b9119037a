"""Where events can be: the places, streets and lanes of a world that a record of an event names."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.errors import InputError
from vico.sim.environment.city_event import CityEvent
from vico.sim.environment.event_kinds import kind_of_event
from vico.world.model import Category, Place
from vico.world.street_model import Road
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
            point = shapely.get_coordinates(shapely.line_interpolate_point(_longest(shape), 0.5, normalized=True))[0]
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


def _longest(lines: shapely.Geometry) -> shapely.Geometry:
    """Return the longest line of several, joined where they meet."""
    return max(shapely.get_parts(shapely.line_merge(lines)), key=lambda line: float(line.length))
