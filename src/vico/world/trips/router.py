"""Planning trips: one router for everybody, on foot, by bus, by tram and by bicycle.

The search is for the least arrival, then price, then metres on foot, over stops, stations and the clock. Labels are
settled in the order of the least arrival at the goal that is left to them (A*, by the straight line and the top
speed); one is dropped where another at the same place is no worse in all three. Ways on the ground begin as lower
bounds. A trip that is best and consists of known ways alone is the best one; as long as it does not, its ways are
found and the search is done again, so few of the many ways are ever looked for.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.errors import InputError
from vico.geometry import polyline_length
from vico.rules import WALK_SPEED
from vico.world.model import Point2
from vico.world.routing import Router
from vico.world.transit import Transit
from vico.world.trips.label_setting import BY_BICYCLE, CENTS, ON_FOOT, Bounds, settle
from vico.world.trips.model import MODES, Closure, Leg, Trip
from vico.world.trips.network import KnownWays, TripNetwork, Ways


class TripStep(NamedTuple):
    """A step of a way to the goal.

    Attributes
    ----------
    origin, to
        Nodes.
    depart, arrive
        When one sets out, or the bus leaves, and when one is there.
    price
        What it costs.
    line
        Number of the bus or tram line, `labels.BY_BICYCLE` or `labels.ON_FOOT`.
    first, last
        Of a bus ride the indices among the line's stops where it begins and ends (counted on past the last stop).
    """

    origin: int
    to: int
    depart: float
    arrive: float
    price: float
    line: int
    first: int
    last: int


@dataclass(frozen=True)
class TripQuery:
    """A question to the router: all that a search depends on.

    Attributes
    ----------
    network, ways
        Its points are the network's, then the start, then the goal.
    direct
        Whether one may walk all the way.
    cash
        What rides may cost together.
    latest
        Second by which one has to be there; trips that arrive later are not looked for.
    all_good
        Whether all trips are wanted than which none is better in arrival, price and metres on foot; else the best one.
    """

    network: TripNetwork
    ways: Ways
    direct: bool = True
    cash: float = math.inf
    latest: float = math.inf
    all_good: bool = False


def best_trips(question: TripQuery, depart: float) -> list[list[TripStep]]:
    """Return the steps of the trips asked for, the best first; none if the goal can't be reached."""
    network, ways = question.network, question.ways
    top_speed = max(network.top_speed, ways.walk_speed)
    bounds = Bounds(ways.walk_speed, top_speed, question.cash, question.latest, question.direct, question.all_good)
    while True:
        found = _trips(*settle(network.timetable, ways.ground, bounds, float(depart)))
        if not question.all_good:
            found = found[:1]
        on_ground = ((step.origin, step.to) for steps in found for step in steps if step.line < 0)
        unknown = [(a, b) for a, b in on_ground if a != b and not ways.is_known(a, b)]
        if not unknown:
            return found
        for a, b in dict.fromkeys(unknown):
            ways.way(a, b)


def _trips(labels: NDArray[np.void], at_goal: NDArray[np.int64]) -> list[list[TripStep]]:
    """Return the steps to labels, the best first: equal ones in the order of how many steps, and of which."""
    found = []
    for label in at_goal.tolist():
        steps = _steps(labels, label)
        arrive, price, metres = labels[label][["arrive", "price", "metres"]].item()
        trace = [(step.to, step.line, step.first, step.last) for step in steps]
        found.append(((arrive, price, metres, len(steps), trace), steps))
    return [steps for _, steps in sorted(found, key=lambda pair: pair[0])]


def _steps(labels: NDArray[np.void], label: int) -> list[TripStep]:
    """Return the steps from the start to a label."""
    steps = []
    to = labels[label]
    while to["parent"] >= 0:
        before = labels[to["parent"]]
        steps.append(
            TripStep(
                origin=int(before["node"]),
                to=int(to["node"]),
                depart=float(to["depart"]),
                arrive=float(to["arrive"]),
                price=int(to["price"] - before["price"]) / CENTS,
                line=int(to["line"]),
                first=int(to["first"]),
                last=int(to["last"]),
            )
        )
        to = before
    return steps[::-1]


class TripEnd(Protocol):
    """A map that trips are planned on: a `World`, or a `PublicMap`."""

    @property
    def router(self) -> Router:
        """Finds ways on the ground."""

    @property
    def transit(self) -> Transit:
        """Stops, lines and bicycle stations."""


class Trips:
    """Plans trips; threads may share it.

    A trip is the one that arrives first; of those the cheapest, then the one with the least to walk. Buses keep the
    timetable (`vico.world.transit`), bicycles go from station to station. The same question has the same answer in
    every process, whatever was asked before.

    Parameters
    ----------
    place
        Where.
    walk_speed
        Metres a second on foot.
    """

    def __init__(self, place: TripEnd, *, walk_speed: float = WALK_SPEED) -> None:
        self.router = place.router
        self.transit = place.transit
        self.walk_speed = walk_speed
        self._networks: dict[tuple[bool, bool, bool], TripNetwork] = {}
        t = self.transit
        self._ends = [record.id for part in (t.stops, t.tram_stops, t.bike_stations) for record in part]
        self._lines = {line.id for part in (t.lines, t.tram_lines) for line in part}
        self._ways = KnownWays(self._ends, walk_speed)

    def plan(
        self,
        start: ArrayLike,
        goal: ArrayLike,
        depart: float,
        *,
        modes: Collection[str] = MODES,
        cash: float | None = None,
        arrive_by: float | None = None,
        closed: Iterable[Closure] = (),
    ) -> Trip | None:
        """Plan the trip that arrives first.

        Parameters
        ----------
        start, goal
            ENU metres, up to 6 m off what can be walked on.
        depart
            Second of the day at which one sets out, or, with `arrive_by`, before which one does not.
        modes
            Of `MODES`. To and from stops and stations one walks in any case; without ``walk`` not all the way.
        cash
            What the rides may cost together; as much as they do if None.
        arrive_by
            Then it is the trip that sets out last, to the second, of those that arrive by this second of the day.
        closed
            What is out of use.

        Returns
        -------
        Trip or None
            None if there is no such trip.

        Raises
        ------
        InputError
            If a mode or an id of `closed` is not known.
        """
        question = self._question(start, goal, modes, cash, tuple(closed))
        if arrive_by is not None:
            question = replace(question, latest=arrive_by)
        found = best_trips(question, depart)
        if arrive_by is None or not found:
            return self._trip(question, found[0], depart) if found else None
        # Who leaves later arrives no earlier: the last second to leave is found by halving.
        low, high = 0, math.floor(arrive_by - depart)
        best = found[0]
        if not question.network.lines:
            # Without buses all trips take as long whenever one leaves.
            low = max(0, math.floor(arrive_by - best[-1].arrive) - 1)
            high = min(high, low + 2)
            best = best_trips(question, depart + low)[0]
        while low < high:
            middle = (low + high + 1) // 2
            found = best_trips(question, depart + middle)
            if found:
                low, best = middle, found[0]
            else:
                high = middle - 1
        return self._trip(question, best, depart + low)

    def alternatives(
        self,
        start: ArrayLike,
        goal: ArrayLike,
        depart: float,
        *,
        modes: Collection[str] = MODES,
        cash: float | None = None,
        closed: Iterable[Closure] = (),
    ) -> list[Trip]:
        """Return all trips than which none is as good in arrival, price and metres on foot at once.

        In the order of arrival; parameters are those of `plan`.
        """
        question = self._question(start, goal, modes, cash, tuple(closed), all_good=True)
        return [self._trip(question, label, depart) for label in best_trips(question, depart)]

    def seconds(self, start: ArrayLike, goal: ArrayLike, depart: float, *, modes: Collection[str] = MODES) -> float:
        """Seconds from setting out to arriving; infinite if there is no trip. Parameters are those of `plan`."""
        trip = self.plan(start, goal, depart, modes=modes)
        return math.inf if trip is None else trip.seconds

    def _question(
        self,
        start: ArrayLike,
        goal: ArrayLike,
        modes: Collection[str],
        cash: float | None,
        closed: Sequence[Closure],
        *,
        all_good: bool = False,
    ) -> TripQuery:
        if unknown := set(modes) - set(MODES):
            raise InputError(f"trips: mode {sorted(unknown)[0]!r} is not known; there are {', '.join(MODES)}")
        ids = {closure for closure in closed if isinstance(closure, str)}
        if unknown := ids - self._lines - set(self._ends):
            raise InputError(
                f"trips: nothing is called {sorted(unknown)[0]!r}; close a line, a stop or a station by its id"
            )
        network = self._network(ids, buses="bus" in modes, bikes="bike" in modes, trams="tram" in modes)
        circles = [closure for closure in closed if not isinstance(closure, str)]
        ends = [_point(start), _point(goal)]
        blocked = self.router.walkable.cells_within(circles) if circles else None
        # Ways around what is closed are those of this question alone.
        known = self._ways if blocked is None else KnownWays(self._ends, self.walk_speed)
        place = np.array([known.number[name] for name in network.ids], np.int64)
        ways = Ways(self.router, [*network.points, *ends], place, known, blocked=blocked)
        return TripQuery(network, ways, "walk" in modes, math.inf if cash is None else cash, all_good=all_good)

    def _network(self, closed: set[str], *, buses: bool, bikes: bool, trams: bool) -> TripNetwork:
        if closed:
            return TripNetwork(self.transit, closed, buses=buses, bikes=bikes, trams=trams)
        if (buses, bikes, trams) not in self._networks:
            self._networks[buses, bikes, trams] = TripNetwork(self.transit, buses=buses, bikes=bikes, trams=trams)
        return self._networks[buses, bikes, trams]

    def _trip(self, question: TripQuery, steps: list[TripStep], depart: float) -> Trip:
        return Trip(depart, tuple(self._leg(question, step) for step in steps if step.origin != step.to))

    def _leg(self, question: TripQuery, step: TripStep) -> Leg:
        network, ways = question.network, question.ways
        start, end = ways.points[step.origin], ways.points[step.to]
        if step.line == ON_FOOT:
            way = ways.way(step.origin, step.to)
            return Leg("walk", start, end, way.path, step.depart, step.arrive, way.metres)
        if step.line == BY_BICYCLE:
            way = ways.way(step.origin, step.to)
            path, metres, line, mode = way.path, way.metres, None, "bike"
        else:
            path = np.array(network.bus_stops_between(step.line, step.first, step.last), np.float64)
            times = network.lines[step.line]
            metres, line = polyline_length(path), times.line.id
            mode = "bus" if times.round else "tram"
        return Leg(
            mode,
            start,
            end,
            path,
            step.depart,
            step.arrive,
            metres,
            price=step.price,
            line=line,
            origin=network.ids[step.origin],
            destination=network.ids[step.to],
        )


def _point(xy: ArrayLike) -> Point2:
    x, y = np.asarray(xy, np.float64)[:2].tolist()
    return x, y
