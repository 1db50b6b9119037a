"""How many buses each line has, and where the timetable puts them at the start."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

from vico.assets.bus import BUS_SIZE
from vico.clock import DAY
from vico.errors import InputError
from vico.sim.traffic.state import BusRoutes
from vico.world.lanes import LaneGraph
from vico.world.timetable import buses_needed, departure
from vico.world.transit_model import Transit


@dataclass(frozen=True)
class BusPlan:
    """Where buses drive and start.

    Attributes
    ----------
    routes
        Lane numbers of each line's round.
    places, offsets
        Index in the route of the lane of each of the line's stops, and the stop's distance along it, metres.
    line_of_bus
        Line of each bus.
    starts
        Place in the route and metres along its lane of each bus at the start: the stop the timetable puts it at.
    first_stops
        That stop's index in the line.
    begun
        Second of the day at which each bus should have left its first stop.
    """

    routes: list[list[int]] = field(default_factory=list)
    places: list[list[int]] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    line_of_bus: list[int] = field(default_factory=list)
    starts: list[tuple[int, float]] = field(default_factory=list)
    first_stops: list[int] = field(default_factory=list)
    begun: list[float] = field(default_factory=list)

    @property
    def bus_routes(self) -> BusRoutes:
        """What traffic has to know of it."""
        return BusRoutes(self.routes, self.line_of_bus, self.starts)


def plan_buses(transit: Transit, lanes: LaneGraph, second: float) -> BusPlan:
    """As many buses on each line as its headway asks for, each at the stop it should last have reached.

    Parameters
    ----------
    second
        Of the day, when the simulation starts.

    Raises
    ------
    InputError
        If a line names a lane or a stop the world has not.
    """
    stops = {stop.id: stop for stop in transit.stops}
    plan = BusPlan()
    standing: list[tuple[int, float]] = []
    for number, line in enumerate(transit.lines):
        unknown = [x for x in line.lanes if x not in lanes.index] + [x for x in line.stops if x not in stops]
        if unknown:
            raise InputError(f"transit: line {line.id} uses {unknown[0]}, which the world has not; build it anew")
        route = [lanes.index[lane] for lane in line.lanes]
        places: list[int] = []
        offsets: list[float] = []
        k = 0
        for stop in (stops[i] for i in line.stops):
            lane = lanes.index[stop.lane]
            # The same lane again, further on, needs no step; otherwise the next time the round comes by.
            if not (places and route[k] == lane and stop.offset > offsets[-1]):
                k = next((i for i in range(k + bool(places), len(route)) if route[i] == lane), -1)
                if k < 0:
                    raise InputError(f"transit: line {line.id} never comes by {stop.id}; build the world anew")
            places.append(k)
            offsets.append(stop.offset)
        plan.routes.append(route)
        plan.places.append(places)
        plan.offsets.append(offsets)
        last = bisect_right(line.departures, second % DAY) - 1 + len(line.departures) * int(second // DAY)
        for bus in range(buses_needed(line)):
            gone = second - departure(line, last - bus)
            at = max(i for i, when in enumerate(line.travel[:-1]) if when <= gone)
            later = ((at + i) % len(places) for i in range(len(places)))
            at = next((i for i in later if not _stands(route[places[i]], offsets[i], standing)), -1)
            if at < 0:
                break
            standing.append((route[places[at]], offsets[at]))
            plan.line_of_bus.append(number)
            plan.starts.append((places[at], offsets[at]))
            plan.first_stops.append(at)
            plan.begun.append(second - gone)
    return plan


def _stands(lane: int, offset: float, standing: Sequence[tuple[int, float]]) -> bool:
    """Whether one of the buses that stand already is in the way of another; lines share stops."""
    return any(lane == other and abs(offset - where) < BUS_SIZE[0] + 2.0 for other, where in standing)
