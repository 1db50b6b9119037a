"""Buses on the road network: how many each line has, where they start, and ways round streets that an event has shut.

The timetable puts buses at the start. A bus leaves its line before a shut street, and comes back onto it behind.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from vico.assets.transit_vehicles import BUS_SIZE
from vico.clock import DAY
from vico.errors import InputError
from vico.sim.traffic import Traffic
from vico.sim.traffic.state import PRESENT, BusRoutes
from vico.world.lanes import LaneGraph
from vico.world.transit import Transit, buses_needed, departure


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


_BEFORE, _BEHIND = 24, 48  # lanes of the line before and behind what is shut between which a way is looked for
_PASSED_OVER = 2.0  # times as long count the metres of open line that a bus does not come by
_CHANGE, _LONG = 60.0, 45.0  # m that a lane change counts, and that a lane has to be long for one
_TIGHT, _TIGHT_COUNTS = 9.0, 40.0  # m of lane through a junction below which a bend is tight, and that it counts
_LONGEST = 2500.0  # m that a way round may be
_MOST_LANES = 128  # that a way round may have more than the usual round
_UNKNOWN = object()
_BACK = 2.6  # rad: who turns so much turns back, which no bus does


class LineRound(NamedTuple):
    """A round of a line.

    Attributes
    ----------
    lanes
        Lane numbers, in the order they are driven.
    origin
        Position in the usual round of each of them, -1 on the way round what is shut.
    """

    lanes: tuple[int, ...]
    origin: tuple[int, ...]


class Detours:
    """Which lines go round something now, and which of their buses do.

    A bus leaves the line, and comes back onto it, wherever it is on a lane of both rounds: one that is already in a
    street that is shut drives on until it is out. A line has one way round at a time; another one is taken when all its
    buses are back.

    Parameters
    ----------
    plan
        The lines' usual rounds.
    traffic
        Whose vehicles the buses are.
    vehicles
        Their numbers there.

    Attributes
    ----------
    on
        Which buses go round something, bool, shape ``(buses,)``.
    skipped
        How many stops each bus has passed over, int64.
    """

    def __init__(self, plan: BusPlan, traffic: Traffic, vehicles: NDArray[np.int64]) -> None:
        self._plan, self._traffic, self._vehicles = plan, traffic, vehicles
        lines = len(plan.routes)
        room = max((len(route) for route in plan.routes), default=0) + _MOST_LANES
        self.on, self.skipped = np.zeros(len(vehicles), np.bool_), np.zeros(len(vehicles), np.int64)
        # The ways round that buses are on: lanes, and the origin of each, -1 behind the last.
        self._lanes, self._origin = np.full((lines, room), -1, np.int32), np.full((lines, room), -1, np.int32)
        self._size = np.zeros(lines, np.int32)
        self._shut: Any = None  # for which lanes the ways round that are wanted were looked for
        self._wanted: list[LineRound | None] = [None] * lines
        self._busy = False

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future."""
        return {name: array.copy() for name, array in self._state().items()}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        for name, array in self._state().items():
            array[...] = arrays[name]
        self._shut, self._busy = _UNKNOWN, True
        self._set_rounds()

    def _state(self) -> dict[str, NDArray[Any]]:
        return {
            "detour_on": self.on,
            "detour_skipped": self.skipped,
            "detour_lanes": self._lanes,
            "detour_origin": self._origin,
            "detour_size": self._size,
        }

    @property
    def any(self) -> bool:
        """Whether a line goes round something."""
        return bool(self._size.any())

    def are_due(self) -> bool:
        """Return whether `follow` may have something to do."""
        return self._busy or self._traffic.shut_lanes is not self._shut

    def is_skipped(self, line: int, stop: int) -> bool:
        """Return whether a line does not come by one of its stops now."""
        return bool(self._size[line]) and self._plan.places[line][stop] not in self._origin[line, : self._size[line]]

    def place_of(self, bus: int, stop: int) -> int:
        """Return the position in a bus's round of the lane with a stop, -1 where it does not come by there."""
        line = self._plan.line_of_bus[bus]
        place = self._plan.places[line][stop]
        if not self.on[bus]:
            return place
        found = np.flatnonzero(self._origin[line, : self._size[line]] == place)
        return int(found[0]) if len(found) else -1

    def round_of(self, bus: int) -> list[int]:
        """Return the lane numbers of a bus's round."""
        line = self._plan.line_of_bus[bus]
        lanes: list[int] = self._lanes[line, : self._size[line]].tolist()
        return lanes if self.on[bus] else self._plan.routes[line]

    def follow(self, stop: NDArray[np.int32]) -> list[int]:
        """Have buses leave their lines and come back onto them; return those on the way, to be sent to their stops.

        Parameters
        ----------
        stop
            Index of the stop that each bus stands at or drives to.
        """
        shut = self._traffic.shut_lanes
        if shut is not self._shut:
            self._shut = shut
            self._wanted = [self._way_round(line) for line in range(len(self._wanted))]
        busy = np.bincount(np.array(self._plan.line_of_bus, np.int64)[self.on], minlength=len(self._wanted)) > 0
        late = [line for line, is_busy in enumerate(busy) if not is_busy and not self._is_as_wanted(line)]
        for line in late:
            self._take(line)
        if late:
            self._set_rounds()
        sent = []
        for bus, line in enumerate(self._plan.line_of_bus):
            wants = bool(self._size[line]) and self._is_as_wanted(line)
            if wants != self.on[bus] and self._switch(bus):
                fleet, v = self._traffic.fleet, self._vehicles[bus]
                if fleet.presence[v] == PRESENT and not fleet.at_stop[v]:
                    sent.append(bus)
                else:
                    fleet.stop_route_index[v] = self.place_of(bus, int(stop[bus]))
        self._busy = self.any or any(wanted is not None for wanted in self._wanted)
        return sent

    def _way_round(self, line: int) -> LineRound | None:
        """Return the way round that a line should take, None for its usual round: half of its stops have to be left."""
        places = self._plan.places[line]
        if self._shut is None or len(places) < 2:
            return None
        found = round_past_closures(self._plan.routes[line], places[0], self._shut, self._traffic.lanes)
        if found is None or len(found.lanes) > self._lanes.shape[1]:
            return None
        served = sum(place in found.origin for place in places)
        return found if served >= max(2, len(places) / 2) else None

    def _is_as_wanted(self, line: int) -> bool:
        wanted, size = self._wanted[line], int(self._size[line])
        if wanted is None:
            return size == 0
        return wanted.lanes == tuple(self._lanes[line, :size].tolist())

    def _take(self, line: int) -> None:
        """Have the way round that is wanted be that of a line."""
        wanted = self._wanted[line] or LineRound((), ())
        size = len(wanted.lanes)
        self._lanes[line], self._origin[line], self._size[line] = -1, -1, size
        self._lanes[line, :size], self._origin[line, :size] = wanted.lanes, wanted.origin

    def _set_rounds(self) -> None:
        """Tell the traffic all rounds, the usual ones first, and which each bus is on."""
        usual = self._plan.routes
        round_ = [self._lanes[line, : self._size[line]].tolist() or route for line, route in enumerate(usual)]
        self._traffic.set_rounds([*usual, *round_])
        for bus in range(len(self.on)):
            self._tell_round(bus)

    def _tell_round(self, bus: int) -> None:
        line = self._plan.line_of_bus[bus]
        self._traffic.fleet.route[self._vehicles[bus]] = line + len(self._plan.routes) * int(self.on[bus])

    def _switch(self, bus: int) -> bool:
        """Put a bus on the other of its line's rounds if its lane, and those it was let onto, are the same there."""
        line, fleet, v = self._plan.line_of_bus[bus], self._traffic.fleet, self._vehicles[bus]
        origin = self._origin[line, : self._size[line]]
        usual = np.full(len(self._plan.routes[line]), -1)
        usual[origin[origin >= 0]] = np.flatnonzero(origin >= 0)
        other, counterpart = (len(usual), origin) if self.on[bus] else (len(origin), usual)
        here, granted = int(fleet.route_index[v]), int(fleet.granted_count[v])
        there = int(counterpart[here])
        ahead = np.arange(granted + 1)
        if there < 0 or (counterpart[(here + ahead) % len(counterpart)] != (there + ahead) % other).any():
            return False
        self.on[bus] = not self.on[bus]
        fleet.route_index[v], fleet.planned_count[v] = there, granted
        self._tell_round(bus)
        return True


def round_past_closures(
    route: Sequence[int], first: int, shut: NDArray[np.bool_], lanes: LaneGraph
) -> LineRound | None:
    """Return a line's round past what is shut.

    Parameters
    ----------
    route
        Lane numbers of the usual round.
    first
        Position in it of the lane with the first stop, which has to be reached.
    shut
        Which lanes are shut.

    Returns
    -------
    Round or None
        None where nothing of the round is shut, or there is no way round it of a reasonable length.
    """
    n = len(route)
    order = [(first + k) % n for k in range(n)]
    bad = [bool(shut[route[k]]) for k in order]
    if not any(bad) or bad[0]:
        return None
    graph = _graph(lanes, shut)
    street = [not bad[k] and lanes.inside[route[order[k]]] < 0 for k in range(n)] + [True]
    length = np.append(lanes.length[[route[k] for k in order]], 0.0)
    kept: list[tuple[int, int]] = []
    k = begin = 0
    while k < n:
        if not bad[k]:
            kept.append((route[order[k]], order[k]))
            k += 1
            continue
        leaves = [j for j in range(max(begin, k - _BEFORE), k) if street[j]]
        comes_back = [j for j in range(k + 1, min(k + _BEHIND, n) + 1) if street[j]]
        found = _way_round(graph, [route[order[j]] for j in leaves], [route[order[j % n]] for j in comes_back])
        # What is not driven any more between both counts, too.
        best, cost = None, np.inf
        for a, leave in enumerate(leaves):
            for b, back in enumerate(comes_back):
                total = found[0][a, b] + _PASSED_OVER * length[leave + 1 : back].sum()
                if total < cost and found[0][a, b] < _LONGEST:
                    best, cost = (a, b), total
        if best is None:
            return None
        leave, begin = leaves[best[0]], comes_back[best[1]]
        while kept and order.index(kept[-1][1]) > leave:
            kept.pop()
        kept += [(lane, -1) for lane in found[1](*best)]
        k = begin
    return LineRound(tuple(lane for lane, _ in kept), tuple(at for _, at in kept))


def _graph(lanes: LaneGraph, shut: NDArray[np.bool_]) -> csr_matrix:
    """Return what it costs to come from a lane onto another one, metres; shut ones are not come onto."""
    n = np.arange(len(lanes))
    start, end = np.repeat(n, np.diff(lanes.next_first)), lanes.next
    turn = lanes.at(n, lanes.length)[:, 2] - lanes.at(n, 0.0)[:, 2]
    turn = np.abs((turn + np.pi) % (2 * np.pi) - np.pi)
    back = (lanes.inside >= 0) & (turn > _BACK)
    tight = (lanes.inside >= 0) & (turn > 0.6) & (lanes.length < _TIGHT)
    cost = lanes.length[end] + _TIGHT_COUNTS * tight[end]
    parts = [(start, end, cost)]
    for beside in (lanes.left, lanes.right):
        rows = np.flatnonzero((beside >= 0) & (lanes.inside < 0) & (lanes.length > _LONG))
        parts.append((rows, beside[rows], np.full(len(rows), _CHANGE)))
    start, end, cost = (np.concatenate(column) for column in zip(*parts, strict=True))
    open_ = ~(shut[end] | shut[start] | back[end])
    return csr_matrix((cost[open_] + 0.01, (start[open_], end[open_])), shape=(len(lanes), len(lanes)))


def _way_round(
    graph: csr_matrix, starts: list[int], ends: list[int]
) -> tuple[NDArray[np.float64], Callable[[int, int], list[int]]]:
    """Return the metres from each start to each end, and a function of the lanes between two of them."""
    if not starts or not ends:
        return np.full((len(starts), len(ends)), np.inf), lambda a, b: []
    metres, before = dijkstra(graph, indices=starts, return_predecessors=True)

    def lanes_between(a: int, b: int) -> list[int]:
        way, lane = [], int(before[a, ends[b]])
        while lane != starts[a]:
            way.append(lane)
            lane = int(before[a, lane])
        return way[::-1]

    return np.where(np.equal.outer(starts, ends), np.inf, metres[:, ends]), lanes_between
