"""What is indoors at the places of a world, in numbers: a city has hundreds of thousands of rooms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.rules import BED_WIDTH
from vico.world.indoor_ways import IndoorWays
from vico.world.model import Room
from vico.world.world import World

# Rooms that one only passes through.
_WAYS = frozenset({"corridor", "stairs", "lift", "lobby", "hall"})


class PlaceRooms:
    """Of each place, in the order of the world's.

    Attributes
    ----------
    inside
        Seconds on foot from the street to the farthest room; 0 in the open. float64, shape ``(places,)``.
    beds
        How many people can lie in the beds, which are for two where they are wide. int64, shape ``(places,)``.
    area
        Square metres of the rooms, without corridors, stairs and lifts. float64, shape ``(places,)``.
    """

    def __init__(self, world: World) -> None:
        places = world.places
        self.inside, self.area = np.zeros(len(places)), np.zeros(len(places))
        self.beds: NDArray[np.int64] = np.zeros(len(places), np.int64)
        by_id = world.room_by_id if any(place.rooms for place in places) else {}
        ways = IndoorWays(by_id)
        for k, place in enumerate(places):
            self.inside[k] = ways.seconds(place.rooms)
            rooms = [by_id[name] for name in place.rooms]
            self.beds[k] = sum(map(_beds, rooms))
            self.area[k] = sum(room.size[0] * room.size[1] for room in rooms if room.kind not in _WAYS)

    @classmethod
    def of(cls, world: World) -> PlaceRooms:
        """Return those of a world, counted once."""
        return world.shared(cls, lambda: cls(world))


def _beds(room: Room) -> int:
    return sum(max(1, int(top.size[1] / BED_WIDTH + 1e-9)) for top in room.containers if top.kind == "bed")
