"""Buses on their timetable and bicycles to rent: who may board what, where, and what it costs.

Buses are vehicles of `Traffic` (they queue with the cars and take junctions like them); what is here sends them from
stop to stop. Rules and prices: fare 2 on boarding a stopped bus within 3 m of a door; bicycles within 2 m, 0.2 per
started minute, 20 more where one is left farther than 5 m from a station with a free place.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from vico.assets.vehicles import BICYCLE_SIZE, BUS_SIZE, vehicle_prototypes
from vico.errors import InputError
from vico.sim.bodies import BICYCLE, Bodies, Drawn
from vico.sim.traffic import Traffic
from vico.sim.transit.bus_plan import BusPlan, departure, next_departure
from vico.world.mesh import Surface
from vico.world.model import Line, Transit

DWELL = 30.0
# Buses drive so fast as the timetable asks for, within these, m/s; starting and braking cost the seconds beside.
PACE = (5.0, 10.0)
_START_STOP = 10.0
FARE = 2.0
DOOR_REACH = 3.0
CAPACITY = 60
BIKE_REACH = 2.0
BIKE_RATE = 0.2
BIKE_ASTRAY = 20.0
STATION_REACH = 5.0
_SLOT = 0.75  # metres between bicycles in a station
# Doors on a bus's right side, metres ahead of its centre.
DOORS = (4.65, -0.05, -3.55)


class TransitSystem:
    """Timetable, riders' rules, bicycles.

    Attributes
    ----------
    clock
        Second of the day (runs on past midnight), shape ``(1,)``.
    dwell
        Seconds each bus still stands at its stop.
    stop
        Index in its line of the stop each bus stands at or drives to.
    begun
        Second of the day at which each bus's round began by the timetable.
    aboard
        Riders in each bus.
    taken
        Departures each line has begun since the first one of the first day.
    bike_xy, bike_yaw
        Where each bicycle is.
    bike_rider
        Who rides it, -1 for nobody; the caller's numbers.
    bike_since
        Clock at which the ride began.
    """

    def __init__(self, transit: Transit, traffic: Traffic, plan: BusPlan, *, second: float, first_bike: int) -> None:
        self.transit, self.traffic = transit, traffic
        self.first_bike = first_bike
        self._plan = plan
        self._vehicle = np.arange(traffic.cars, traffic.cars + traffic.buses)
        buses = traffic.buses
        self.clock = np.array([float(second)])
        self.dwell = np.full(buses, DWELL / 2)
        self.stop = np.array(plan.first_stops, np.int32)
        self.begun = np.array(plan.begun)
        self.aboard = np.zeros(buses, np.int32)
        self.taken = np.array([next_departure(line, second) for line in transit.lines], np.int64)
        stations = transit.bike_stations
        self._station_xy = np.array([s.position[:2] for s in stations]).reshape(-1, 2)
        self._station_capacity = np.array([s.capacity for s in stations], np.int32)
        self._station_yaw = _rack_yaws(traffic, self._station_xy)
        self.bike_station = np.repeat(np.arange(len(stations), dtype=np.int32), [s.bikes for s in stations])
        n = len(self.bike_station)
        self.bike_slot = (
            np.concatenate([np.arange(s.bikes, dtype=np.int32) for s in stations]) if n else np.zeros(0, np.int32)
        )
        self.bike_xy, self.bike_yaw = np.zeros((n, 2)), np.zeros(n)
        for bike in range(n):
            self._dock(bike, int(self.bike_station[bike]), int(self.bike_slot[bike]))
        self.bike_rider = np.full(n, -1, np.int32)
        self.bike_since = np.zeros(n)
        for bus in range(buses):
            self._send(bus, int(self.stop[bus]))
            traffic.fleet.at_stop[self._vehicle[bus]] = True

    # -- the subsystem contract --------------------------------------------------------------------------------------

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future; the buses' own motion is among the traffic's."""
        return {name: getattr(self, name).copy() for name in _STATE}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        for name in _STATE:
            getattr(self, name)[...] = arrays[name]

    def advance(self, dt: float, obstacles: Bodies) -> None:
        """Advance the timetable by `dt` seconds; the buses themselves move with the traffic."""
        self.clock += dt
        fleet = self.traffic.fleet
        for bus, v in enumerate(self._vehicle.tolist()):
            if not fleet.at_stop[v]:
                self.dwell[bus] = DWELL
                continue
            self.dwell[bus] = max(self.dwell[bus] - dt, 0.0)
            if self.may_leave_stop(bus):
                self._leave_stop(bus)

    def may_leave_stop(self, bus: int) -> bool:
        """Return whether a bus that stands at a stop leaves it now.

        It dwells for `DWELL` seconds. From its line's first stop it leaves at the next departure that no other bus has
        taken, or at once if that is past.
        """
        if self.dwell[bus] > 0.0:
            return False
        return bool(self.stop[bus] != 0 or self.clock[0] >= self._next_departure(bus))

    def _next_departure(self, bus: int) -> int:
        """Return the departure a bus at its first stop is to take, seconds."""
        line = self._plan.line_of_bus[bus]
        return departure(self.transit.lines[line], int(self.taken[line]))

    def _leave_stop(self, bus: int) -> None:
        """Send a bus to its next stop; from the first one it begins a round."""
        line = self._plan.line_of_bus[bus]
        if self.stop[bus] == 0:
            self.begun[bus] = self._next_departure(bus)
            self.taken[line] += 1
        self.stop[bus] = (self.stop[bus] + 1) % len(self._plan.places[line])
        self._send(bus, int(self.stop[bus]))

    def bodies(self) -> Bodies:
        """Return the bicycles left astray.

        Racks are street furniture, buses are among the traffic's bodies, and ridden bicycles among their riders'.
        """
        free = np.flatnonzero((self.bike_rider < 0) & (self.bike_station < 0))
        n = len(free)
        if not n:
            return Bodies.none()
        return Bodies(
            entity=(self.first_bike + free).astype(np.int32),
            kind=np.full(n, BICYCLE, np.int8),
            position=np.column_stack([self.bike_xy[free], self.traffic.height(self.bike_xy[free])]),
            yaw=self.bike_yaw[free],
            half_length=np.full(n, BICYCLE_SIZE[0] / 2),
            half_width=np.full(n, BICYCLE_SIZE[1] / 2),
            height=np.full(n, BICYCLE_SIZE[2]),
            velocity=np.zeros((n, 2)),
        )

    def draw(self) -> Drawn:
        """All bicycles, ridden ones too."""
        n = len(self.bike_yaw)
        c, s = np.cos(self.bike_yaw), np.sin(self.bike_yaw)
        transforms = np.tile(np.eye(4, dtype=np.float32), (n, 1, 1))
        transforms[:, 0, 0], transforms[:, 0, 1], transforms[:, 1, 0], transforms[:, 1, 1] = c, -s, s, c
        transforms[:, :2, 3], transforms[:, 2, 3] = self.bike_xy, self.traffic.height(self.bike_xy)
        entity = np.arange(self.first_bike, self.first_bike + n, dtype=np.int32)
        return Drawn(["bicycle"], np.zeros(n, np.int32), transforms, entity)

    def prototypes(self) -> dict[str, list[Surface]]:
        """Return the shape of a bicycle."""
        return {"bicycle": vehicle_prototypes()["bicycle"]}

    # -- buses -------------------------------------------------------------------------------------------------------

    def _send(self, bus: int, stop: int) -> None:
        line, fleet, v = self._plan.line_of_bus[bus], self.traffic.fleet, self._vehicle[bus]
        fleet.stop_route_index[v] = self._plan.places[line][stop]
        fleet.stop_offset[v] = self._plan.offsets[line][stop]
        fleet.at_stop[v] = False
        timetable = self.line_of(bus)
        due = self.begun[bus] + timetable.travel[stop or len(timetable.stops)]
        left = max(due - self.clock[0] - _START_STOP, 1.0)
        fleet.target_speed[v] = min(max(self._metres(bus, stop) / left, PACE[0]), PACE[1])

    def _metres(self, bus: int, stop: int) -> float:
        """How far a bus has to drive to a stop, metres."""
        line, fleet, v, lanes = self._plan.line_of_bus[bus], self.traffic.fleet, self._vehicle[bus], self.traffic.lanes
        route, place = self._plan.routes[line], int(fleet.route_index[v])
        metres = self._plan.offsets[line][stop] - float(fleet.offset[v])
        # A stop that lies behind the bus on the lane it is on comes after a whole round.
        going = metres < 0.0
        while going or place != self._plan.places[line][stop]:
            going = False
            here, place = route[place], (place + 1) % len(route)
            if route[place] not in (lanes.left[here], lanes.right[here]):
                metres += float(lanes.length[here])
        return metres

    def stopped_at(self, bus: int) -> str | None:
        """Id of the stop at which a bus stands with its doors open, None while it drives."""
        if not self.traffic.fleet.at_stop[self._vehicle[bus]]:
            return None
        return self.line_of(bus).stops[int(self.stop[bus])]

    def line_of(self, bus: int) -> Line:
        """Return the line a bus serves."""
        return self.transit.lines[self._plan.line_of_bus[bus]]

    def entity_of(self, bus: int) -> int:
        """Return a bus's entity."""
        return int(self.traffic.first_entity + self._vehicle[bus])

    def bus_pose(self, bus: int) -> NDArray[np.float64]:
        """x, y, yaw of a bus's centre."""
        shapes, v = self.traffic.shapes, self._vehicle[bus]
        return np.array([shapes.x[v], shapes.y[v], shapes.yaw[v]])

    @property
    def _kerb(self) -> float:
        """1 where the kerb is on the right of a lane, -1 where traffic keeps left."""
        return -1.0 if self.traffic.lanes.lefthand else 1.0

    def doors(self, bus: int) -> NDArray[np.float64]:
        """Where a bus's doors are, on the side of the kerb, metres, shape ``(3, 2)``."""
        return _beside(self.bus_pose(bus), DOORS, BUS_SIZE[1] / 2 * self._kerb)

    def exit_spots(self, bus: int) -> NDArray[np.float64]:
        """Points half a metre outside each door, where riders get off if they are free, shape ``(3, 2)``."""
        return _beside(self.bus_pose(bus), DOORS, (BUS_SIZE[1] / 2 + 0.5) * self._kerb)

    def seat(self, bus: int, rider: int) -> NDArray[np.float64]:
        """x, y, yaw of a rider's seat; `rider` is the caller's number for them."""
        x, y, yaw = self.bus_pose(bus)
        row, side = divmod(rider % 20, 2)
        ahead, left = 3.2 - 0.85 * row, 0.75 if side == 0 else -0.75
        c, s = math.cos(yaw), math.sin(yaw)
        return np.array([x + ahead * c - left * s, y + ahead * s + left * c, yaw])

    def bus_at(self, xy: ArrayLike, reach: float = DOOR_REACH) -> int | None:
        """Return the bus that stands at a stop with the nearest door within `reach` of a point; None without one."""
        point = np.asarray(xy, np.float64)[:2]
        best: tuple[float, int] | None = None
        for bus in range(self.traffic.buses):
            if self.traffic.fleet.at_stop[self._vehicle[bus]]:
                away = float(np.linalg.norm(self.doors(bus) - point, axis=1).min())
                if away <= reach and (best is None or away < best[0]):
                    best = (away, bus)
        return None if best is None else best[1]

    def board(self, bus: int) -> float:
        """Take a rider in; returns the fare.

        Raises
        ------
        InputError
            If the bus drives or is full.
        """
        if self.stopped_at(bus) is None:
            raise InputError("enter_bus: the bus is not at a stop")
        if self.aboard[bus] >= CAPACITY:
            raise InputError("enter_bus: the bus is full")
        self.aboard[bus] += 1
        return FARE

    def alight(self, bus: int) -> None:
        """Let a rider off.

        Raises
        ------
        InputError
            If the bus drives.
        """
        if self.stopped_at(bus) is None:
            raise InputError("exit_bus: the bus is moving")
        self.aboard[bus] -= 1

    def arrivals(self, stop: str) -> list[tuple[str, float]]:
        """Scheduled buses at a stop from now on: line name and seconds from now, the next three of each line."""
        rows: list[tuple[str, float]] = []
        for line in self.transit.lines:
            for k, name in enumerate(line.stops):
                if name == stop:
                    now = float(self.clock[0]) - line.travel[k]
                    first = next_departure(line, now)
                    rows += [(line.name, departure(line, first + i) - now) for i in range(3)]
        return sorted(rows, key=lambda row: row[1])

    # -- bicycles ----------------------------------------------------------------------------------------------------

    def bike_at(self, xy: ArrayLike, reach: float = BIKE_REACH) -> int | None:
        """Return the nearest bicycle nobody rides within `reach` of a point, None if there is none."""
        if not len(self.bike_rider):
            return None
        away = np.linalg.norm(self.bike_xy - np.asarray(xy, np.float64)[:2], axis=1)
        away[self.bike_rider >= 0] = np.inf
        best = int(np.argmin(away))
        return best if away[best] <= reach else None

    def free_bikes(self) -> NDArray[np.int32]:
        """Bicycles that stand in each station."""
        docked = self.bike_station[(self.bike_rider < 0) & (self.bike_station >= 0)]
        return np.bincount(docked, minlength=len(self._station_capacity)).astype(np.int32)

    def mount(self, bike: int, rider: int) -> None:
        """Begin a ride.

        Raises
        ------
        InputError
            If somebody rides it.
        """
        if self.bike_rider[bike] >= 0:
            raise InputError("enter_bike: somebody rides it")
        self.bike_rider[bike], self.bike_since[bike] = rider, self.clock[0]
        self.bike_station[bike] = self.bike_slot[bike] = -1

    def carry(self, bike: int, x: float, y: float, yaw: float) -> None:
        """Take a ridden bicycle along with its rider."""
        self.bike_xy[bike], self.bike_yaw[bike] = (x, y), yaw

    def dismount(self, bike: int) -> float:
        """End a ride where the bicycle is; returns the price.

        Within 5 m of a station with a free place the bicycle goes into it. Elsewhere it stays, and that costs more.
        """
        station = self._station_near(self.bike_xy[bike])
        price = ride_price(self.clock[0] - self.bike_since[bike], returned=station >= 0)
        self.bike_rider[bike] = -1
        if station >= 0:
            used = set(self.bike_slot[self.bike_station == station].tolist())
            self._dock(bike, station, next(k for k in range(len(used) + 1) if k not in used))
        return price

    def _station_near(self, xy: NDArray[np.float64]) -> int:
        """Return the nearest station within reach that has a free place, -1 for none."""
        if not len(self._station_xy):
            return -1
        away = np.linalg.norm(self._station_xy - xy, axis=1)
        away[self.free_bikes() >= self._station_capacity] = np.inf
        best = int(np.argmin(away))
        return best if away[best] <= STATION_REACH else -1

    def _dock(self, bike: int, station: int, slot: int) -> None:
        """Stand a bicycle in its place: side by side along the rack, from its middle outwards."""
        yaw = self._station_yaw[station]
        aside = _SLOT * ((slot + 1) // 2) * (1 if slot % 2 else -1)
        self.bike_station[bike], self.bike_slot[bike] = station, slot
        self.bike_xy[bike] = self._station_xy[station] + aside * np.array([np.cos(yaw), np.sin(yaw)])
        self.bike_yaw[bike] = yaw + np.pi / 2


_STATE = (
    "clock", "dwell", "stop", "begun", "aboard", "taken", "bike_station", "bike_slot", "bike_xy", "bike_yaw",
    "bike_rider", "bike_since",
)  # fmt: skip


def ride_price(seconds: float, *, returned: bool) -> float:
    """Price of a bicycle ride: 0.2 per started minute, 20 more if it was not brought to a station."""
    return BIKE_RATE * math.ceil(max(seconds, 1e-9) / 60.0) + (0.0 if returned else BIKE_ASTRAY)


def _beside(pose: NDArray[np.float64], ahead: Sequence[float], right: float) -> NDArray[np.float64]:
    """Points `ahead` of a pose and `right` of it."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([[pose[0] + a * c + right * s, pose[1] + a * s - right * c] for a in ahead])


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
