"""What a tile has, as its city has it: in the city's frame, under numbers and names that no other tile uses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.world.mesh import Surface
from vico.world.model import (
    FIRST_BUILDING,
    FIRST_ROOM,
    FIRST_STOP,
    Building,
    Container,
    Doorway,
    Entrance,
    Place,
    Point2,
    Point3,
    Room,
)
from vico.world.objects import Objects
from vico.world.street_model import ParkingSpot, WayIntoSpot, WaysOfSpot

if TYPE_CHECKING:
    from vico.world.city import City

#: Entities of the first tile's things begin here: above those of bodies and of what a simulation adds.
_FIRST, _EACH = 2_000_000, 500_000
# A city has millions of things: their names take a quarter of the room if each takes only what it needs.
_TEXT = np.dtypes.StringDType()
_OF_THE_CITY = ("stop_", "tram_stop_", "bikes_")


@dataclass(frozen=True)
class Shift:
    """How a tile's things become its city's.

    Attributes
    ----------
    east, north
        The tile's middle in the city, metres.
    entities
        What is added to the entities of its things; not to those of stops and stations, which are the city's own, nor
        to those of the ground.
    name
        Of the tile; begins ids that are known in the tile alone.
    """

    east: float
    north: float
    entities: int
    name: str

    @classmethod
    def of(cls, city: City, tile: tuple[int, int]) -> Shift:
        """Return that of one of a city's tiles."""
        manifest = city.manifest
        (column, row), (first_column, first_row) = tile, manifest.first
        number = (row - first_row) * (manifest.last[0] - first_column + 1) + column - first_column
        east, north = column * manifest.size, row * manifest.size
        return cls(east, north, _FIRST + number * _EACH, f"{column}_{row}")

    @staticmethod
    def tile_of(city: City, entity: int) -> tuple[int, int] | None:
        """Return the tile of whose things a number in the city may be one; None: those of no tile have such a one."""
        first, last = city.manifest.first, city.manifest.last
        row, column = divmod((entity - _FIRST) // _EACH, last[0] - first[0] + 1)
        row, column = row + first[1], column + first[0]
        return (column, row) if entity >= _FIRST and row <= last[1] else None

    def point(self, xy: Point2) -> Point2:
        """Move a point."""
        return round(xy[0] + self.east, 3), round(xy[1] + self.north, 3)

    def point3(self, xyz: Point3) -> Point3:
        """Move a point in space."""
        return round(xyz[0] + self.east, 3), round(xyz[1] + self.north, 3), xyz[2]

    def id(self, key: str) -> str:
        """Return an id that no other tile has; those of stops and stations are the city's."""
        return key if key.startswith(_OF_THE_CITY) else f"{self.name}.{key}"

    def entity(self, number: int) -> int:
        """Return an entity's number in the city."""
        self._check(number)
        return number + self.entities if self._is_own(number) else number

    def numbers(self, entities: NDArray[Any]) -> NDArray[np.int32]:
        """Return numbers of entities in the city, shaped as those in the tile."""
        self._check(int(entities.max(initial=0)))
        own = (entities >= FIRST_BUILDING) & ((entities < FIRST_STOP) | (entities >= FIRST_ROOM))
        return np.where(own, entities + self.entities, entities).astype(np.int32)

    def _check(self, number: int) -> None:
        if number >= _EACH:
            raise SchemaError(f"tile {self.name}: entity {number}; a tile of a city has fewer than {_EACH}")

    @staticmethod
    def _is_own(number: int) -> bool:
        return number >= FIRST_BUILDING and (number < FIRST_STOP or number >= FIRST_ROOM)

    def building(self, building: Building) -> Building:
        """Move a building."""
        rings = [[self.point(xy) for xy in ring] for ring in building.footprint]
        return building.model_copy(update={"footprint": rings, "entity": self.entity(building.entity)})

    def entrance(self, entrance: Entrance) -> Entrance:
        """Move a door."""
        return entrance.model_copy(
            update={
                "id": self.id(entrance.id),
                "position": self.point3(entrance.position),
                "approach": self.point(entrance.approach),
            }
        )

    def place(self, place: Place) -> Place:
        """Move a place."""
        door = None if place.entrance is None else self.id(place.entrance)
        return place.model_copy(update={"position": self.point3(place.position), "entrance": door})

    def room(self, room: Room) -> Room:
        """Move a room."""
        return room.model_copy(
            update={
                "entity": self.entity(room.entity),
                "centre": self.point3(room.centre),
                "door": self.point3(room.door),
                "inside": self.point3(room.inside),
                "containers": [self._container(one) for one in room.containers],
                "doors": [self._doorway(one) for one in room.doors],
            }
        )

    def _container(self, container: Container) -> Container:
        return container.model_copy(
            update={
                "entity": self.entity(container.entity),
                "centre": self.point3(container.centre),
                "reach": self.point(container.reach),
            }
        )

    def _doorway(self, doorway: Doorway) -> Doorway:
        return doorway.model_copy(
            update={"position": self.point3(doorway.position), "inside": self.point3(doorway.inside)}
        )

    def spot(self, spot: ParkingSpot) -> ParkingSpot:
        """Move a parking spot."""
        car = None if spot.car is None else self.entity(spot.car)
        ways = None
        if spot.ways is not None:
            into, out = (self._way(way) for way in (spot.ways.into, spot.ways.out))
            ways = WaysOfSpot(into=into, back=[self.point(xy) for xy in spot.ways.back], out=out)
        return spot.model_copy(
            update={"id": self.id(spot.id), "position": self.point3(spot.position), "car": car, "ways": ways}
        )

    def _way(self, way: WayIntoSpot) -> WayIntoSpot:
        return way.model_copy(update={"line": [self.point(xy) for xy in way.line]})

    def objects(self, objects: Objects) -> Objects:
        """Move things. Those indoors are named after a room, and that is in one tile; a street may lie in several."""
        ids = objects.id.astype(_TEXT)
        outdoors = np.flatnonzero(objects.room == "")
        ids[outdoors] = [self.id(key) for key in objects.id[outdoors].tolist()]
        return replace(
            objects,
            id=ids,
            kind=objects.kind.astype(_TEXT),
            group=objects.group.astype(_TEXT),
            prototype=objects.prototype.astype(_TEXT),
            room=objects.room.astype(_TEXT),
            entity=self.numbers(objects.entity),
            x=objects.x + self.east,
            y=objects.y + self.north,
        )

    def surface(self, surface: Surface) -> Surface:
        """Move a mesh."""
        shift = np.array([self.east, self.north, 0.0])
        positions = (surface.positions + shift).astype(np.float32)
        return replace(surface, positions=positions, entity=self.numbers(surface.entity))
