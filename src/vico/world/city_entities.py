"""Kind and name of a city's things by entity, looked up in their tiles: there are millions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import chain

import numpy as np

from vico.io.recent import Recent
from vico.world.city import City
from vico.world.model import FIRST_ROOM, FIRST_STOP
from vico.world.moving import Shift
from vico.world.world import named_buildings, named_rooms

# Tiles whose names are kept: some 60 bytes a thing, where a dictionary of dictionaries would take 400.
_KEPT = 32
_TEXT = np.dtypes.StringDType()


class CityEntities(Mapping[int, dict[str, str]]):
    """Kind and name of everything in a city that segmentation images can show, by entity.

    What a tile has is read when the first of its things is asked for, and kept as long as no others are used more.

    Parameters
    ----------
    city
        The city.
    of_all
        What is no tile's: kinds of ground, stops and stations.
    """

    def __init__(self, city: City, of_all: Mapping[int, dict[str, str]]) -> None:
        self._city = city
        self._of_all = of_all
        self._tiles: Recent[tuple[int, int], _Named] = Recent(_KEPT)

    def __getitem__(self, entity: int) -> dict[str, str]:
        known = self._of_all.get(entity)
        if known is not None:
            return known
        if FIRST_STOP <= entity < FIRST_ROOM:
            return self._at_stops[entity]
        tile = Shift.tile_of(self._city, entity)
        if tile is None or tile not in self._city:
            raise KeyError(entity)
        return self._of_tile(tile)[entity]

    def __iter__(self) -> Iterator[int]:
        """Yield all entities; every tile is read for that."""
        tiles = (self._of_tile(tile).entity.tolist() for tile in self._places())
        return chain(self._of_all, self._at_stops, *tiles)

    def __len__(self) -> int:
        """How many there are; every tile is read for that."""
        return len(self._of_all) + len(self._at_stops) + sum(len(self._of_tile(t).entity) for t in self._places())

    def _places(self) -> list[tuple[int, int]]:
        return [(tile.column, tile.row) for tile in self._city.manifest.tiles]

    def _of_tile(self, tile: tuple[int, int]) -> _Named:
        known = self._tiles.get(tile)
        if known is None:
            known = _Named(self._city, tile)
            self._tiles.keep(tile, known)
        return known

    @cached_property
    def _at_stops(self) -> dict[int, dict[str, str]]:
        """Objects that have a number among those of stops, but are none: those of all tiles, the first of a number."""
        found: dict[int, dict[str, str]] = {}
        for tile in self._places():
            objects = self._city.world(tile).objects
            at_stops = np.flatnonzero((objects.entity >= FIRST_STOP) & (objects.entity < FIRST_ROOM))
            there = Shift.of(self._city, tile).objects(objects.where(at_stops))
            for entity, kind, name in zip(there.entity.tolist(), there.kind, there.id, strict=True):
                if entity not in self._of_all:
                    found.setdefault(entity, {"kind": str(kind), "name": str(name)})
        return found


class _Named:
    """What the things of one tile are.

    Parameters
    ----------
    city
        The city.
    tile
        Column and row.
    """

    def __init__(self, city: City, tile: tuple[int, int]) -> None:
        world, shift = city.world(tile), Shift.of(city, tile)
        objects = shift.objects(world.objects)
        built = {
            shift.entity(n): one for n, one in (named_buildings(world.buildings) | named_rooms(world.rooms)).items()
        }
        entity = np.concatenate([np.array([*built], np.int32), objects.entity])
        kind = np.concatenate([np.array([one["kind"] for one in built.values()], _TEXT), objects.kind])
        name = np.concatenate([np.array([one["name"] for one in built.values()], _TEXT), objects.id])
        # The first of a number is taken; numbers that are not shifted are those of stops, which are the city's.
        self.entity, first = np.unique(entity, return_index=True)
        own = self.entity >= FIRST_ROOM
        self.entity, self._kind, self._name = self.entity[own], kind[first[own]], name[first[own]]

    def __getitem__(self, entity: int) -> dict[str, str]:
        row = int(np.searchsorted(self.entity, entity))
        if row == len(self.entity) or self.entity[row] != entity:
            raise KeyError(entity)
        return {"kind": str(self._kind[row]), "name": str(self._name[row])}
