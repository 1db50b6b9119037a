"""The transit system: vehicles of lines by number, their timetable, who may board where, and what it costs.

Buses are vehicles of `Traffic` (they queue with the cars and take junctions like them); what is here sends them from
stop to stop. Trams have numbers from the number of buses on. The fare is 2, on boarding a stopped bus within 3 m of a
door. Bicycles to rent are `Bicycles`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.assets.transit_vehicles import (
    BUS_FLOOR,
    BUS_SIZE,
    TRAM_FLOOR,
    bus_door_leaves,
    bus_leaf,
    bus_places,
    tram_places,
)
from vico.assets.vehicles import vehicle_prototypes
from vico.errors import InputError
from vico.rules import BUS_CAPACITY, BUS_DOOR_REACH, BUS_DWELL, BUS_FARE, TRAM_SECTIONS
from vico.sim.bodies.arrays import Bodies, Drawn
from vico.sim.bodies.state_arrays import FIRST_TRAM
from vico.sim.traffic import Traffic
from vico.sim.traffic.state import PRESENT
from vico.sim.transit.bicycles import Bicycles
from vico.sim.transit.buses import BusPlan, Detours
from vico.sim.transit.passengers import DOOR_TIME, Passengers, leaf_transforms, step_doors
from vico.sim.transit.tram_network import TramNetwork
from vico.sim.transit.trams import AWAY, Trams
from vico.world.mesh import Surface
from vico.world.transit import Line, Transit, departure, next_departure
from vico.world.walkable import WalkableMap

_OUT_OF_SIGHT = -40.0  # metres above the ground
_TINY = 1e-6  # seconds by which clocks err
# Doors on a bus's right side, metres ahead of its centre.
DOORS = (4.65, -0.05, -3.55)


class TransitVehicles:
    """Buses and trams, by one row of numbers: buses first, trams from the number of buses on.

    Attributes
    ----------
    dwell
        Seconds each bus still stands at its stop.
    stop
        Index in its line of the stop each bus stands at or drives to.
    riders
        Who is at each place of each bus, seats first (`vico.assets.transit_vehicles.bus_places`), -1 for nobody, int32,
        shape ``(buses, BUS_CAPACITY)``; the caller's numbers.
    open
        How far each bus's doors are open, 0..1.
    trams
        What runs on rails.
    """

    def __init__(self, transit: Transit, traffic: Traffic, plan: BusPlan, trams: Trams) -> None:
        self.transit, self.traffic, self.trams = transit, traffic, trams
        self._plan = plan
        buses = traffic.buses
        self._vehicle = np.arange(traffic.cars, traffic.cars + buses)
        self.dwell = np.full(buses, BUS_DWELL / 2)
        self.stop = np.array(plan.first_stops, np.int32)
        self.riders = np.full((buses, BUS_CAPACITY), -1, np.int32)
        self.open = np.ones(buses)

    def stopped_at(self, bus: int) -> str | None:
        """Id of the stop at which a bus stands with its doors open, None while it drives."""
        tram = bus - self.traffic.buses
        if tram >= 0:
            return self.trams.stopped_at(tram)
        if not self.traffic.fleet.at_stop[self._vehicle[bus]]:
            return None
        return self.line_of(bus).stops[int(self.stop[bus])]

    def line_of(self, bus: int) -> Line:
        """Return the line a bus serves."""
        return self.transit.lines[self._plan.line_of_bus[bus]]

    def service_of(self, bus: int) -> tuple[str, str, str]:
        """Return what a vehicle is, bus, tram or train, and id and name of its line."""
        tram = bus - self.traffic.buses
        line = self.trams.lines[self.trams.line_of[tram]] if tram >= 0 else self.line_of(bus)
        return self.trams.kind(tram) if tram >= 0 else "bus", line.id, line.name

    def entity_of(self, bus: int) -> int:
        """Return a bus's entity; of a tram that of its first section."""
        tram = bus - self.traffic.buses
        if tram >= 0:
            return int(self.trams.entities()[tram * TRAM_SECTIONS])
        return int(self.traffic.first_entity + self._vehicle[bus])

    def with_entity(self, entity: int) -> int:
        """Return the number of the bus or tram that has an entity."""
        if entity >= self.trams.first_entity:
            return self.traffic.buses + (entity - self.trams.first_entity) // TRAM_SECTIONS
        return entity - self.traffic.first_entity - self.traffic.cars

    def bus_pose(self, bus: int) -> NDArray[np.float64]:
        """x, y, yaw of a bus's centre."""
        shapes, v = self.traffic.shapes, self._vehicle[bus]
        return np.array([shapes.x[v], shapes.y[v], shapes.yaw[v]])

    @property
    def _kerb(self) -> float:
        """1 where the kerb is on the right of a lane, -1 where traffic keeps left."""
        return -1.0 if self.traffic.lanes.lefthand else 1.0

    def doors(self, bus: int, out: float = 0.0) -> NDArray[np.float64]:
        """Where a bus's doors are, on the side of the kerb, or `out` metres before them, shape ``(doors, 2)``."""
        tram = bus - self.traffic.buses
        if tram >= 0:
            return self.trams.doors(tram, out)
        x, y, yaw = self.bus_pose(bus)[:3]
        c, s, right = math.cos(yaw), math.sin(yaw), (BUS_SIZE[1] / 2 + out) * self._kerb
        return np.array([[x + a * c + right * s, y + a * s - right * c] for a in DOORS])

    def exit_spots(self, bus: int) -> NDArray[np.float64]:
        """Points half a metre outside each door, where riders get off if they are free, shape ``(doors, 2)``."""
        return self.doors(bus, out=0.5)

    def seat(self, bus: int, rider: int) -> NDArray[np.float64]:
        """x, y, yaw of where a rider is; `rider` is the caller's number for them."""
        tram = bus - self.traffic.buses
        if tram >= 0:
            return self.trams.seat(tram, self._place_of(bus, rider))
        x, y, yaw = self.bus_pose(bus)
        ahead, left = bus_places()[0][self._place_of(bus, rider)]
        left *= self._kerb
        c, s = math.cos(yaw), math.sin(yaw)
        return np.array([x + ahead * c - left * s, y + ahead * s + left * c, yaw])

    def is_seated(self, bus: int, rider: int) -> bool:
        """Return whether a rider has a seat; the others stand."""
        seats = bus_places()[1] if bus < self.traffic.buses else tram_places()[1]
        return self._place_of(bus, rider) < seats

    def aboard(self, bus: int) -> int:
        """Return how many ride in a bus."""
        return int((self._riders_of(bus) >= 0).sum())

    def capacity(self, bus: int) -> int:
        """Return how many a bus takes."""
        return len(self._riders_of(bus))

    @property
    def services(self) -> int:
        """How many buses and trams there are, those in the depot or out of the city too."""
        return self.traffic.buses + len(self.trams)

    def boards_for(self, bus: int) -> float:
        """Return for how many seconds a bus keeps its doors open at the least; 0 while they are not wholly open."""
        tram = bus - self.traffic.buses
        share, left = (
            (self.trams.open[tram], self.trams.dwell[tram]) if tram >= 0 else (self.open[bus], self.dwell[bus])
        )
        # At its first stop a bus stands with open doors until its departure, its time to dwell long over.
        return max(float(left), _TINY) if share == 1.0 and self.stopped_at(bus) is not None else 0.0

    def will_stop(self, bus: int) -> bool:
        """Return whether a bus stands at a stop, or a tram is in the city and has yet to come to one."""
        tram = bus - self.traffic.buses
        return self.trams.will_stop(tram) if tram >= 0 else self.stopped_at(bus) is not None

    def floor(self, bus: int) -> float:
        """Return how high the floor that riders are on is above the ground, metres; far below it out of the city."""
        tram = bus - self.traffic.buses
        if tram < 0:
            return BUS_FLOOR
        return TRAM_FLOOR if self.trams.front[tram] > AWAY else _OUT_OF_SIGHT

    def _riders_of(self, bus: int) -> NDArray[np.int32]:
        tram = bus - self.traffic.buses
        return self.riders[bus] if tram < 0 else self.trams.riders[tram]

    def _place_of(self, bus: int, rider: int) -> int:
        return int(np.flatnonzero(self._riders_of(bus) == rider)[0])

    def bus_at(self, xy: ArrayLike, reach: float = BUS_DOOR_REACH) -> int | None:
        """Return the bus that stands at a stop with the nearest door within `reach` of a point; None without one."""
        point = np.asarray(xy, np.float64)[:2]
        best: tuple[float, int] | None = None
        standing = np.flatnonzero(self.traffic.fleet.at_stop[self._vehicle]).tolist()
        standing += (self.trams.standing + self.traffic.buses).tolist()
        for bus in standing:
            away = float(np.linalg.norm(self.doors(bus) - point, axis=1).min())
            if away <= reach and (best is None or away < best[0]):
                best = (away, bus)
        return None if best is None else best[1]

    def board(self, bus: int, rider: int) -> float:
        """Take a rider in, at the first free place; returns the fare.

        Raises
        ------
        InputError
            If the bus drives or is full.
        """
        if self.stopped_at(bus) is None:
            raise InputError("enter_bus: the bus is not at a stop")
        if self.aboard(bus) >= self.capacity(bus):
            raise InputError("enter_bus: the bus is full")
        self.take_in(bus, rider)
        return BUS_FARE

    def take_in(self, bus: int, rider: int) -> None:
        """Give a rider the first free place; there has to be one."""
        riders = self._riders_of(bus)
        riders[np.flatnonzero(riders < 0)[0]] = rider

    def alight(self, bus: int, rider: int) -> None:
        """Let a rider off.

        Raises
        ------
        InputError
            If the bus drives.
        """
        if self.stopped_at(bus) is None:
            raise InputError("exit_bus: the bus is moving")
        self._riders_of(bus)[self._place_of(bus, rider)] = -1


# Buses drive so fast as the timetable asks for, within these, m/s; starting and braking cost the seconds beside, and a
# share of the time is kept for what holds one up. It waits at the next stop if nothing does.
PACE = (2.5, 10.0)
_START_STOP, _KEPT = 10.0, 0.15
_LAST_CALL = 3.0  # seconds before a tram goes out of the city, or a bus to the depot, at which everybody gets off
#: A bus goes to the depot if its next departure is farther off, seconds, and comes back so long before it.
DEPOT_FROM, DEPOT_UNTIL = 300.0, 120.0


class TransitSystem(TransitVehicles):
    """Timetable and riders' rules, with the bicycles to rent; the buses and trams themselves are `Services`.

    Attributes
    ----------
    clock
        Second of the day (runs on past midnight), shape ``(1,)``.
    begun
        Second of the day at which each bus's round began by the timetable.
    taken
        Departures each line has begun since the first one of the first day.
    stops_served, late_total, late_most
        How often each bus has come to a stop, the sum of the seconds by which it was late there (earlier counts as
        less), and the most.
    detours
        The ways of buses round streets that events have shut.
    bicycles
        The bicycles to rent, and who rides them.
    """

    def __init__(
        self,
        transit: Transit,
        traffic: Traffic,
        plan: BusPlan,
        *,
        second: float,
        first_bike: int,
        first_tram: int = FIRST_TRAM,
        network: TramNetwork | None = None,
    ) -> None:
        trams = Trams(transit.tram_lines, traffic, second=float(second), first_entity=first_tram, network=network)
        super().__init__(transit, traffic, plan, trams)
        buses = traffic.buses
        self.clock = np.array([float(second)])
        self.begun = np.array(plan.begun)
        self.taken = np.array([next_departure(line, second) for line in transit.lines], np.int64)
        self.stops_served = np.zeros(buses, np.int64)
        self.late_total, self.late_most = np.zeros(buses), np.zeros(buses)
        self.detours = Detours(plan, traffic, self._vehicle)
        self.bicycles = Bicycles(transit.bike_stations, traffic, first_entity=first_bike)
        for bus in range(buses):
            gone, line = second - self.begun[bus], plan.line_of_bus[bus]
            if self.stop[bus] == 0 and 0.0 < gone < transit.lines[line].travel[1]:
                # It should be on its way to the second stop by now: the departure that is past is its own.
                self.taken[line] -= 1
            self._send(bus, int(self.stop[bus]))
            self._begin_in_depot(bus, gone)
            traffic.fleet.at_stop[self._vehicle[bus]] = not self.in_depot(bus)

        #: Pedestrians who ride; None where nobody said where they can get off.
        self.passengers: Passengers | None = None
        #: Walkways that lie on tracks, where nobody is to walk.
        self.on_tracks = self.trams.walkways_on_tracks()
        self._shut: tuple[NDArray[np.bool_] | None, NDArray[np.bool_] | None] = None, None

    def take_passengers(self, walkable: WalkableMap, seed: int) -> None:
        """Have pedestrians ride in buses, who get off where one can walk; `seed` decides who does at the start."""
        self.passengers = Passengers(self, walkable, seed)

    def shut_walkways(self, shut: NDArray[np.bool_] | None) -> NDArray[np.bool_] | None:
        """Return a mask of walkways nobody is to walk on with those added that lie on tracks; the same for the same."""
        if not self.on_tracks.any():
            return shut
        if self._shut[1] is None or shut is not self._shut[0]:
            self._shut = shut, self.on_tracks if shut is None else shut | self.on_tracks
        return self._shut[1]

    # -- the subsystem contract --------------------------------------------------------------------------------------

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future; the buses' own motion is among the traffic's."""
        found = {name: getattr(self, name).copy() for name in _STATE} | self.detours.arrays()
        return found | self.bicycles.arrays() | self.trams.arrays()

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        for name in _STATE:
            getattr(self, name)[...] = arrays[name]
        self.detours.restore(arrays)
        self.bicycles.restore(arrays)
        self.trams.restore(arrays)

    def advance(self, dt: float, obstacles: Bodies) -> None:
        """Advance the timetable by `dt` seconds; the buses themselves move with the traffic."""
        self.clock += dt
        fleet = self.traffic.fleet
        for bus in self.detours.follow(self.stop) if self.detours.are_due() else ():
            self._go_on(bus, int(self.stop[bus]))
        for tram in self.trams.advance(float(self.clock[0]), dt, obstacles):
            if self.passengers is not None:
                self.passengers.arrive(self.traffic.buses + tram)
        presence, at_stop = fleet.presence, fleet.at_stop
        for bus, v in enumerate(self._vehicle.tolist()):
            if presence[v] != PRESENT:
                self._mind_depot(bus, v)
                continue
            holds = bool(at_stop[v]) and self._holds_doors(bus)
            self.open[bus] = step_doors(float(self.open[bus]), holds, dt)
            if not at_stop[v]:
                self.dwell[bus] = BUS_DWELL
                continue
            if self.dwell[bus] == BUS_DWELL:
                self._note_arrival(bus)
                if self.passengers is not None:
                    self.passengers.arrive(bus)
            self.dwell[bus] = max(self.dwell[bus] - dt, 0.0)
            if self.may_leave_stop(bus):
                self._leave_stop(bus)
            elif self.dwell[bus] == 0.0 == self.open[bus] and self.ends_service(bus) and not self.aboard(bus):
                self.traffic.take_away(v)
        # Once a second.
        if self.passengers is not None and math.floor(self.clock[0] + _TINY) > math.floor(self.clock[0] - dt + _TINY):
            self.passengers.advance(obstacles)

    def _holds_doors(self, bus: int) -> bool:
        """Whether a bus at a stop wants its doors open: until shortly before it leaves."""
        if self.dwell[bus] > DOOR_TIME:
            return True
        if self.ends_service(bus):
            return bool(self.aboard(bus))
        return bool(self._departs(bus) - self.clock[0] > DOOR_TIME)

    # -- the depot ---------------------------------------------------------------------------------------------------

    def ends_service(self, bus: int) -> bool:
        """Return whether a bus at its line's first stop goes to the depot, as its next departure is far off.

        Of a tram whether it stands at its last stop in the city.
        """
        if bus >= self.traffic.buses:
            return self.trams.ends(bus - self.traffic.buses)
        return bool(self.stop[bus] == 0 and self._next_departure(bus) - self.clock[0] > DEPOT_FROM)

    def _begin_in_depot(self, bus: int, gone: float) -> None:
        """Have a bus begin the run in the depot: one whose round is over, or that has long to wait for its next."""
        over = gone >= self.line_of(bus).travel[-1]
        waits = self.stop[bus] == 0 and self.comes_from_depot(bus) - self.clock[0] > DEPOT_FROM
        if over or waits:
            self.stop[bus] = 0
            self._send(bus, 0)
            self.traffic.take_away(int(self._vehicle[bus]))

    def _mind_depot(self, bus: int, v: int) -> None:
        """Call a bus in the depot back shortly before the departure that it is to take."""
        self.dwell[bus], self.open[bus] = BUS_DWELL / 2, 0.0  # a stop there is no arrival
        soon = float(self.clock[0]) + DEPOT_UNTIL
        self.traffic.call_back(v, self._next_departure(bus) <= soon and self.comes_from_depot(bus) <= soon)

    def comes_from_depot(self, bus: int) -> int:
        """Return the departure that a bus in the depot is to take, seconds; those that wait already go before it."""
        line, fleet = self._plan.line_of_bus[bus], self.traffic.fleet
        before = 0
        for other, its_line in enumerate(self._plan.line_of_bus):
            if its_line == line and self.stop[other] == 0:
                v = self._vehicle[other]
                before += bool(fleet.at_stop[v]) if fleet.presence[v] == PRESENT else other < bus
        return departure(self.transit.lines[line], int(self.taken[line]) + before)

    def in_depot(self, bus: int) -> bool:
        """Return whether a bus is out of service, and nowhere in the world."""
        return bus < self.traffic.buses and bool(self.traffic.fleet.presence[self._vehicle[bus]] != PRESENT)

    def expected_from_depot(self, xy: ArrayLike, reach: float) -> tuple[str, int] | None:
        """Return line and departure of the next bus that comes out of the depot to a stop near a point; None if none.

        Parameters
        ----------
        xy
            ENU metres, shape ``(2,)``.
        reach
            Of the place to wait there, metres.
        """
        waits = {stop.id: stop.wait for stop in self.transit.stops}
        found: list[tuple[int, str]] = []
        for bus in filter(self.in_depot, range(self.traffic.buses)):
            line = self.line_of(bus)
            if math.dist(waits[line.stops[0]][:2], np.asarray(xy, np.float64)[:2]) <= reach:
                found.append((self.comes_from_depot(bus), line.name))
        return (min(found)[1], min(found)[0]) if found else None

    def _note_arrival(self, bus: int) -> None:
        late = float(self.clock[0]) - self._due(bus, int(self.stop[bus]))
        self.stops_served[bus] += 1
        self.late_total[bus] += late
        self.late_most[bus] = max(self.late_most[bus], late)

    def lateness(self) -> dict[str, float]:
        """Return how often buses came to a stop, the seconds they were late there (mean and most), and stops skipped.

        The latter, ``skipped``, are those that buses could not come by as they went round what was shut.
        """
        found = _lateness(self.stops_served, self.late_total, self.late_most)
        return found | {"skipped": int(self.detours.skipped.sum())}

    def goes_round(self, xy: ArrayLike, reach: float) -> str | None:
        """Return the name of a line whose buses do not come by a stop near a point, as all of them there do not.

        Parameters
        ----------
        xy
            ENU metres, shape ``(2,)``.
        reach
            Of the place to wait there, metres.
        """
        point = np.asarray(xy, np.float64)[:2]
        near = [stop.id for stop in self.transit.stops if math.dist(stop.wait[:2], point) <= reach]
        if not near or not self.detours.any:
            return None
        found = [
            (line.name, self.detours.is_skipped(number, k))
            for number, line in enumerate(self.transit.lines)
            for k, stop in enumerate(line.stops)
            if stop in near
        ]
        return found[0][0] if found and all(skipped for _, skipped in found) else None

    def tram_lateness(self) -> dict[str, float]:
        """Return the same of trams."""
        return _lateness(self.trams.stops_served, self.trams.late_total, self.trams.late_most)

    def may_leave_stop(self, bus: int) -> bool:
        """Return whether a bus that stands at a stop leaves it now.

        It dwells for `BUS_DWELL` seconds, and until the time that the timetable has it leave at, if that is not past.
        """
        return bool(self.dwell[bus] <= 0.0 and self.clock[0] >= self._departs(bus))

    def _departs(self, bus: int) -> float:
        """Return when a bus is to leave its stop, seconds: the first at the next departure that no other has taken."""
        stop = int(self.stop[bus])
        return self._due(bus, stop) + BUS_DWELL if stop else self._next_departure(bus)

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
        self._go_on(bus, (int(self.stop[bus]) + 1) % len(self._plan.places[line]))

    def _go_on(self, bus: int, stop: int) -> None:
        """Send a bus to a stop, or where it does not come by there, to the next one."""
        count = len(self._plan.places[self._plan.line_of_bus[bus]])
        while self.detours.place_of(bus, stop) < 0:
            self.detours.skipped[bus] += 1
            stop = (stop + 1) % count
        self.stop[bus] = stop
        self._send(bus, stop)

    def bodies(self) -> Bodies:
        """Return the bicycles left astray, and trams; buses are among the traffic's bodies."""
        trams = self.trams.bodies()
        return Bodies.joined([self.bicycles.bodies(), trams]) if len(trams) else self.bicycles.bodies()

    def draw(self) -> Drawn:
        """All bicycles, ridden ones too, trams, and doors; buses are drawn with the traffic."""
        bikes, trams = self.bicycles.draw(), self.trams.draw()
        leaves, width = bus_door_leaves()
        if self.traffic.lanes.lefthand:
            leaves = [(x, -y, way) for x, y, way in leaves]
        there = np.flatnonzero(self.traffic.fleet.presence[self._vehicle] == PRESENT)
        bases = self.traffic.vehicle_transforms()[self._vehicle[there]].astype(np.float64)
        doors = Drawn(
            ["bus_leaf"],
            np.zeros(len(leaves) * len(there), np.int32),
            leaf_transforms(bases, leaves, self.open[there], width).astype(np.float32),
            np.tile(self.traffic.first_entity + self._vehicle[there], len(leaves)).astype(np.int32),
        )
        names = [*bikes.prototypes, *doors.prototypes, *trams.prototypes]
        return Drawn(
            names,
            np.concatenate([bikes.index, doors.index + 1, trams.index + 2]),
            np.concatenate([bikes.transforms, doors.transforms, trams.transforms]),
            np.concatenate([bikes.entity, doors.entity, trams.entity]),
        )

    def prototypes(self) -> dict[str, list[Surface]]:
        """Return the shapes of bicycles, doors and trams."""
        shapes = {"bicycle": vehicle_prototypes()["bicycle"], "bus_leaf": [bus_leaf()]}
        return shapes | self.trams.prototypes()

    # -- buses -------------------------------------------------------------------------------------------------------

    def _send(self, bus: int, stop: int) -> None:
        line, fleet, v = self._plan.line_of_bus[bus], self.traffic.fleet, self._vehicle[bus]
        fleet.stop_route_index[v] = self.detours.place_of(bus, stop)
        fleet.stop_offset[v] = self._plan.offsets[line][stop]
        fleet.at_stop[v] = False
        left = max((self._due(bus, stop) - self.clock[0]) * (1.0 - _KEPT) - _START_STOP, 1.0)
        fleet.target_speed[v] = min(max(self._metres(bus, stop) / left, PACE[0]), PACE[1])

    def _due(self, bus: int, stop: int) -> float:
        """Return the second at which a bus that drives to a stop should be there."""
        timetable = self.line_of(bus)
        return float(self.begun[bus]) + timetable.travel[stop or len(timetable.stops)]

    def _metres(self, bus: int, stop: int) -> float:
        """How far a bus has to drive to a stop, metres."""
        line, fleet, v, lanes = self._plan.line_of_bus[bus], self.traffic.fleet, self._vehicle[bus], self.traffic.lanes
        route, place = self.detours.round_of(bus), int(fleet.route_index[v])
        metres = self._plan.offsets[line][stop] - float(fleet.offset[v])
        # A stop that lies behind the bus on the lane it is on comes after a whole round.
        going = metres < 0.0
        while going or place != self.detours.place_of(bus, stop):
            going = False
            here, place = route[place], (place + 1) % len(route)
            if route[place] not in (lanes.left[here], lanes.right[here]):
                metres += float(lanes.length[here])
        return metres

    def ends(self, bus: int) -> bool:
        """Return whether a tram or bus is about to leave for out of the city or the depot: it takes nobody there."""
        tram = bus - self.traffic.buses
        if tram < 0:
            return self.stopped_at(bus) is not None and bool(self.dwell[bus] <= _LAST_CALL) and self.ends_service(bus)
        return tram >= 0 and self.trams.ends(tram) and bool(self.trams.dwell[tram] <= _LAST_CALL)

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


_STATE = ("clock", "dwell", "stop", "begun", "riders", "taken", "stops_served", "late_total", "late_most", "open")


def _lateness(served: NDArray[np.int64], total: NDArray[np.float64], most: NDArray[np.float64]) -> dict[str, float]:
    arrivals = int(served.sum())
    return {
        "arrivals": arrivals,
        "late_mean": round(float(total.sum()) / max(arrivals, 1), 1),
        "late_most": round(float(most.max(initial=0.0)), 1),
    }
