"""Buses and trams by their numbers: what they are, where their doors and seats are, and who rides in them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.assets.bus import BUS_FLOOR, BUS_SIZE, bus_places
from vico.assets.tram import TRAM_FLOOR, tram_places
from vico.errors import InputError
from vico.rules import BUS_CAPACITY, BUS_DOOR_REACH, BUS_DWELL, BUS_FARE, TRAM_SECTIONS
from vico.sim.traffic import Traffic
from vico.sim.transit.bus_plan import BusPlan
from vico.sim.transit.trams import AWAY, Trams
from vico.world.transit_model import Line, Transit

_OUT_OF_SIGHT = -40.0  # metres above the ground
_TINY = 1e-6  # seconds by which clocks err
# Doors on a bus's right side, metres ahead of its centre.
DOORS = (4.65, -0.05, -3.55)


class Services:
    """Buses and trams, by one row of numbers: buses first, trams from the number of buses on.

    Attributes
    ----------
    dwell
        Seconds each bus still stands at its stop.
    stop
        Index in its line of the stop each bus stands at or drives to.
    riders
        Who is at each place of each bus, seats first (`vico.assets.bus.bus_places`), -1 for nobody, int32, shape
        ``(buses, BUS_CAPACITY)``; the caller's numbers.
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
        return _beside(self.bus_pose(bus), DOORS, (BUS_SIZE[1] / 2 + out) * self._kerb)

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


def _beside(pose: NDArray[np.float64], ahead: Sequence[float], right: float) -> NDArray[np.float64]:
    """Points `ahead` of a pose and `right` of it."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([[pose[0] + a * c + right * s, pose[1] + a * s - right * c] for a in ahead])
