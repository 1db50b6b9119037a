"""Bicycles to rent: who may take one, where it goes back to, and what a ride costs.

One within 2 m can be taken. A ride costs 0.2 per started minute, and 20 more where the bicycle is left farther than 5 m
from a station with a free place.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from vico.assets.vehicles import BICYCLE_SIZE
from vico.errors import InputError
from vico.rules import BIKE_REACH, STATION_REACH, ride_price
from vico.sim.bodies.arrays import BICYCLE, Bodies, Drawn
from vico.sim.bodies.state_arrays import RADIUS, RIDER_REACH
from vico.sim.traffic import Traffic
from vico.world.transit import BikeStation

_SLOT = 0.75  # metres between bicycles in a station


class Bicycles:
    """All bicycles of a run, in their stations, ridden, or left astray.

    Attributes
    ----------
    station, slot
        Station and place in it where each bicycle stands, -1 for none, int32.
    xy, yaw
        Where each is, ENU metres, ``(n, 2)``, and the direction it points in, radians.
    rider
        Who rides it, -1 for nobody, int32; the caller's numbers.
    since
        Second of the day at which the ride began.
    """

    def __init__(self, stations: Sequence[BikeStation], traffic: Traffic, *, first_entity: int) -> None:
        self.first_entity = first_entity
        self._height = traffic.height
        self._station_xy = np.array([s.position[:2] for s in stations]).reshape(-1, 2)
        self._station_capacity = np.array([s.capacity for s in stations], np.int32)
        self._station_yaw = _rack_yaws(traffic, self._station_xy)
        self.station = np.repeat(np.arange(len(stations), dtype=np.int32), [s.bikes for s in stations])
        n = len(self.station)
        self.slot = (
            np.concatenate([np.arange(s.bikes, dtype=np.int32) for s in stations]) if n else np.zeros(0, np.int32)
        )
        self.xy, self.yaw = np.zeros((n, 2)), np.zeros(n)
        for bike in range(n):
            self._dock(bike, int(self.station[bike]), int(self.slot[bike]))
        self.rider = np.full(n, -1, np.int32)
        self.since = np.zeros(n)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future."""
        return {f"bike_{name}": getattr(self, name).copy() for name in _STATE}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        for name in _STATE:
            getattr(self, name)[...] = arrays[f"bike_{name}"]

    def bodies(self) -> Bodies:
        """Return the bicycles left astray.

        Racks are street furniture, buses are among the traffic's bodies, and ridden bicycles among their riders'.
        """
        return self.standing_bodies(np.flatnonzero((self.rider < 0) & (self.station < 0)))

    def standing_bodies(self, bikes: NDArray[np.int64]) -> Bodies:
        """Return the bodies some bicycles have, or would have, standing where they are.

        They keep the footprint they had with their riders: who could ride there has room to leave the bicycle there.
        """
        n = len(bikes)
        if not n:
            return Bodies.none()
        return Bodies(
            entity=(self.first_entity + bikes).astype(np.int32),
            kind=np.full(n, BICYCLE, np.int8),
            position=np.column_stack([self.xy[bikes], self._height(self.xy[bikes])]),
            yaw=self.yaw[bikes],
            half_length=np.full(n, RIDER_REACH + RADIUS),
            half_width=np.full(n, RADIUS),
            height=np.full(n, BICYCLE_SIZE[2]),
            velocity=np.zeros((n, 2)),
        )

    def draw(self) -> Drawn:
        """All bicycles, ridden ones too."""
        n = len(self.yaw)
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        transforms = np.tile(np.eye(4, dtype=np.float32), (n, 1, 1))
        transforms[:, 0, 0], transforms[:, 0, 1], transforms[:, 1, 0], transforms[:, 1, 1] = c, -s, s, c
        transforms[:, :2, 3], transforms[:, 2, 3] = self.xy, self._height(self.xy)
        entity = np.arange(self.first_entity, self.first_entity + n, dtype=np.int32)
        return Drawn(["bicycle"], np.zeros(n, np.int32), transforms, entity)

    def at(self, xy: ArrayLike, reach: float = BIKE_REACH) -> int | None:
        """Return the nearest bicycle nobody rides within `reach` of a point, None if there is none."""
        if not len(self.rider):
            return None
        away = np.linalg.norm(self.xy - np.asarray(xy, np.float64)[:2], axis=1)
        away[self.rider >= 0] = np.inf
        best = int(np.argmin(away))
        return best if away[best] <= reach else None

    def free(self) -> NDArray[np.int32]:
        """Bicycles that stand in each station."""
        docked = self.station[(self.rider < 0) & (self.station >= 0)]
        return np.bincount(docked, minlength=len(self._station_capacity)).astype(np.int32)

    def mount(self, bike: int, rider: int, now: float) -> None:
        """Begin a ride at a second of the day.

        Raises
        ------
        InputError
            If somebody rides it.
        """
        if self.rider[bike] >= 0:
            raise InputError("enter_bike: somebody rides it")
        self.rider[bike], self.since[bike] = rider, now
        self.station[bike] = self.slot[bike] = -1

    def carry(self, bike: int, x: float, y: float, yaw: float) -> None:
        """Take a ridden bicycle along with its rider."""
        self.xy[bike], self.yaw[bike] = (x, y), yaw

    def dismount(self, bike: int, now: float) -> float:
        """End a ride where the bicycle is; returns the price.

        Within 5 m of a station with a free place the bicycle goes into it. Elsewhere it stays, and that costs more.
        """
        station = self._station_near(self.xy[bike])
        price = ride_price(now - self.since[bike], returned=station >= 0)
        self.rider[bike] = -1
        if station >= 0:
            used = set(self.slot[self.station == station].tolist())
            self._dock(bike, station, next(k for k in range(len(used) + 1) if k not in used))
        return price

    def is_at_station(self, bike: int) -> bool:
        """Return whether a bicycle left where it is would go into a station."""
        return self._station_near(self.xy[bike]) >= 0

    def entities(self) -> NDArray[np.int32]:
        """Return the entities of all bicycles, whether or not anybody could bump into them."""
        return np.arange(self.first_entity, self.first_entity + len(self.rider)).astype(np.int32)

    def _station_near(self, xy: NDArray[np.float64]) -> int:
        """Return the nearest station within reach that has a free place, -1 for none."""
        if not len(self._station_xy):
            return -1
        away = np.linalg.norm(self._station_xy - xy, axis=1)
        away[self.free() >= self._station_capacity] = np.inf
        best = int(np.argmin(away))
        return best if away[best] <= STATION_REACH else -1

    def _dock(self, bike: int, station: int, slot: int) -> None:
        """Stand a bicycle in its place: side by side along the rack, from its middle outwards."""
        yaw = self._station_yaw[station]
        aside = _SLOT * ((slot + 1) // 2) * (1 if slot % 2 else -1)
        self.station[bike], self.slot[bike] = station, slot
        self.xy[bike] = self._station_xy[station] + aside * np.array([np.cos(yaw), np.sin(yaw)])
        self.yaw[bike] = yaw + np.pi / 2


_STATE = ("station", "slot", "xy", "yaw", "rider", "since")


def _rack_yaws(traffic: Traffic, spots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Racks stand along the nearest sidewalk or street."""
    lanes, walks = traffic.lanes, traffic.walks
    lines = [shapely.LineString(walks.line(i)) for i in range(len(walks)) if walks.kind[i] == 0]
    lines = lines or [shapely.LineString(lanes.line(i)) for i in range(len(lanes))]
    if not lines:
        return np.zeros(len(spots))
    yaws = []
    for spot in spots:
        point = shapely.Point(spot)
        line = lines[int(np.argmin(shapely.distance(lines, point)))]
        at = line.project(point)
        a, b = line.interpolate(max(at - 1.0, 0.0)), line.interpolate(min(at + 1.0, line.length))
        yaws.append(math.atan2(b.y - a.y, b.x - a.x))
    return np.array(yaws)
