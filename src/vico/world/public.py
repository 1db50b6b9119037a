"""The public map of a world: streets, buildings, named places, transit. No rooms, no objects.

`StreetIndex` finds streets by name, and the street that a point lies in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.world.heights import HeightField
from vico.world.model import Category, Point2, Point3, Ring
from vico.world.routing import Router
from vico.world.transit import BikeStation, Line, Stop, TramLine, TramStop, Transit
from vico.world.trips import Trips
from vico.world.walkable import WalkableMap
from vico.world.world import World


@dataclass(frozen=True)
class PublicStreet:
    """A piece of a street that has a name.

    Attributes
    ----------
    line
        Centre line, ENU metres.
    width
        Of its carriageway, metres.
    """

    name: str
    line: list[Point2]
    width: float


class StreetIndex:
    """Streets as arrays of stretches between two points.

    Parameters
    ----------
    streets
        By their pieces.
    """

    def __init__(self, streets: Sequence[PublicStreet]) -> None:
        lines = [np.asarray(street.line, np.float64) for street in streets]
        self.names = sorted({street.name for street in streets})
        number = {name: k for k, name in enumerate(self.names)}
        pairs = [np.concatenate([line[:-1], line[1:]], axis=1) for line in lines]
        self._ends = np.concatenate([np.zeros((0, 4)), *pairs])
        self._half = np.repeat([street.width / 2 for street in streets], [len(one) for one in pairs])
        self._number = np.repeat(
            np.array([number[street.name] for street in streets], np.int64), [len(one) for one in pairs]
        )

    def streets_at(self, points: ArrayLike, *, beside: float = 8.0) -> list[str]:
        """Return the street that each point lies in: the nearest, up to `beside` metres from its carriageway; "" else.

        Parameters
        ----------
        points
            ENU metres, shape ``(n, 2)``.
        """
        found = np.asarray(points, np.float64).reshape(-1, 2)
        if not len(self._ends) or not len(found):
            return [""] * len(found)
        away = self._distances(found) - self._half
        nearest = away.argmin(axis=1)
        near = away[np.arange(len(found)), nearest] <= beside
        return [
            self.names[self._number[k]] if ok else "" for k, ok in zip(nearest.tolist(), near.tolist(), strict=True)
        ]

    def _distances(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of each point to each stretch, metres, shape ``(points, stretches)``."""
        start, along = self._ends[:, :2], self._ends[:, 2:] - self._ends[:, :2]
        to = points[:, None] - start
        share = np.clip((to * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-12), 0.0, 1.0)
        return np.linalg.norm(to - share[..., None] * along, axis=2)


@dataclass(frozen=True)
class PublicPlace:
    """A place as a city map shows it.

    Attributes
    ----------
    position
        A reachable point before it, on the ground.
    entrance
        The door, on the building's outline; None for open places.
    """

    id: str
    name: str
    category: Category
    kind: str
    building: str | None
    position: Point3
    entrance: Point3 | None


@dataclass(frozen=True)
class PublicBuilding:
    """A building's name and outline (outer ring, then holes), metres."""

    id: str
    name: str | None
    footprint: list[Ring]


@dataclass(frozen=True)
class PublicMap:
    """The map that agents are given.

    Attributes
    ----------
    half
        Half the side of the square world, metres.
    shared_router
        The world's router: what it learns about ways serves all who ask. None: the map has one of its own.
    streets
        Those that have a name; a street may come in several pieces.
    """

    half: float
    walkable: WalkableMap
    height: HeightField
    places: list[PublicPlace]
    buildings: list[PublicBuilding]
    stops: list[Stop]
    lines: list[Line]
    bike_stations: list[BikeStation] = field(default_factory=list)
    shared_router: Router | None = field(default=None, repr=False, compare=False)
    tram_stops: list[TramStop] = field(default_factory=list)
    tram_lines: list[TramLine] = field(default_factory=list)
    streets: list[PublicStreet] = field(default_factory=list)

    def __repr__(self) -> str:
        told = f"{len(self.places):,} places, {len(self.buildings):,} buildings, {len(self.streets):,} named streets"
        return f"PublicMap({2 * self.half:g} m square: {told}, {len(self.lines) + len(self.tram_lines)} lines)"

    @classmethod
    def from_world(cls, world: World) -> PublicMap:
        """Copy the public part of `world`."""
        doors = {entrance.id: entrance.position for entrance in world.entrances}
        places = [
            PublicPlace(
                p.id, p.name, p.category, p.kind, p.building, p.position, doors[p.entrance] if p.entrance else None
            )
            for p in world.places
        ]
        buildings = [PublicBuilding(b.id, b.name, b.footprint) for b in world.buildings]
        transit = world.transit
        return cls(
            world.half,
            world.walkable,
            world.height,
            places,
            buildings,
            transit.stops,
            transit.lines,
            transit.bike_stations,
            world.router,
            transit.tram_stops,
            transit.tram_lines,
            [
                PublicStreet(r.name, r.line, r.width)
                for r in world.roads.roads
                if r.name and not r.closed and len(r.line) > 1
            ],
        )

    @cached_property
    def router(self) -> Router:
        """Finds walks on the map."""
        return self.shared_router or Router(self.walkable)

    @cached_property
    def street_index(self) -> StreetIndex:
        """Tells which street a point lies in."""
        return StreetIndex(self.streets)

    @cached_property
    def transit(self) -> Transit:
        """Stops, lines with their timetables, on rails too, and bicycle stations."""
        return Transit(
            stops=self.stops,
            lines=self.lines,
            bike_stations=self.bike_stations,
            origin={},
            tram_stops=self.tram_stops,
            tram_lines=self.tram_lines,
        )

    @cached_property
    def trips(self) -> Trips:
        """Plans trips on foot, by bus, by tram and by bicycle."""
        return Trips(self)

    @cached_property
    def place_by_id(self) -> dict[str, PublicPlace]:
        """Places by id."""
        return {place.id: place for place in self.places}

    @cached_property
    def place_ids(self) -> list[str]:
        """Ids of places, in their order."""
        return [place.id for place in self.places]

    @cached_property
    def _positions(self) -> NDArray[np.float64]:
        return np.array([place.position for place in self.places], np.float64).reshape(-1, 3)

    def places_near(self, xy: ArrayLike, radius: float) -> list[PublicPlace]:
        """Places whose position is within `radius` metres, nearest first."""
        away = np.linalg.norm(self._positions[:, :2] - np.asarray(xy, np.float64)[:2], axis=1)
        order = np.argsort(away, kind="stable")
        return [self.places[i] for i in order if away[i] <= radius]
