"""A public map to plan commutes on: an open square with two bicycle stations and a bus from one end to the other."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.world.heights import HeightField
from vico.world.public import PublicMap
from vico.world.transit import BikeStation, Line, Stop
from vico.world.walkable import SIDEWALK, WalkableMap

HALF = 400.0
#: Stops and stations lie on the line y = 0, stops at its ends.
WEST, EAST = (-300.0, 0.0), (300.0, 0.0)
RACK_WEST, RACK_EAST = (-200.0, 0.0), (200.0, 0.0)


def commute_map(*, stations: bool = True, departures: tuple[int, ...] = (32_500, 33_400, 34_300)) -> PublicMap:
    """Return the map; the bus takes 90 s from west to east, and as long back."""
    stops = [
        Stop(id="west", entity=1, name="West", wait=(*WEST, 0.0), lane="a", offset=1.0),
        Stop(id="east", entity=2, name="East", wait=(*EAST, 0.0), lane="b", offset=1.0),
    ]
    line = Line(
        id="line_1", name="1", colour="#000000", stops=["west", "east"], lanes=["a", "b"],
        departures=list(departures), travel=[0.0, 90.0, 210.0],
    )  # fmt: skip
    racks = [
        BikeStation(id="rack_west", entity=3, name="Rack W", position=(*RACK_WEST, 0.0), capacity=8, bikes=4),
        BikeStation(id="rack_east", entity=4, name="Rack E", position=(*RACK_EAST, 0.0), capacity=8, bikes=4),
    ]
    n = int(4 * HALF)
    ground = WalkableMap(np.full((n, n), SIDEWALK, np.uint8), HALF)
    height = HeightField(np.zeros((2, 2), np.float32), HALF)
    return PublicMap(HALF, ground, height, [], [], stops, [line], racks if stations else [])


def instructions(*positions: tuple[float, float], stay: int = 600, slack: int = 900) -> list[dict[str, Any]]:
    """What an agent is told of a day with appointments at some points; the first stay ends at 9:00."""
    day, end = [], 32_400
    for k, (x, y) in enumerate(positions):
        start = end + slack if k else end - 600
        end = start + stay if k else end
        day.append(
            {"place": f"p{k}", "name": f"Place {k}", "kind": "shop", "position": [x, y], "start": start, "end": end}
        )
    resident = {
        "id": "resident_0",
        "name": "Ada",
        "age": 30,
        "occupation": "baker",
        "lifestyle": "Early.",
        "cash": 60.0,
    }
    return [{"resident": resident, "appointments": day}]
