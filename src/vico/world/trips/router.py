"""Planning trips: one router for everybody, on foot, by bus, by tram and by bicycle."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from vico.errors import InputError
from vico.rules import WALK_SPEED
from vico.world.model import Point2
from vico.world.routing import Router
from vico.world.transit_model import Transit
from vico.world.trips.labels import BY_BICYCLE, ON_FOOT
from vico.world.trips.model import MODES, Closure, Leg, Trip
from vico.world.trips.network import TripNetwork
from vico.world.trips.search import Question, Step, best_trips
from vico.world.trips.ways import KnownWays, Ways


class TripEnd(Protocol):
    """What trips are planned on: a `World`, or a `PublicMap`."""

    @property
    def router(self) -> Router:
        """Finds ways on the ground."""

    @property
    def transit(self) -> Transit:
        """Stops, lines and bicycle stations."""


class Trips:
    """Plans trips; threads may share it.

    A trip is the one that arrives first; of those the cheapest, then the one with the least to walk. Buses keep the
    timetable (`vico.world.timetable`), bicycles go from station to station. The same question has the same answer in
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
    ) -> Question:
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
        return Question(network, ways, "walk" in modes, math.inf if cash is None else cash, all_good=all_good)

    def _network(self, closed: set[str], *, buses: bool, bikes: bool, trams: bool) -> TripNetwork:
        if closed:
            return TripNetwork(self.transit, closed, buses=buses, bikes=bikes, trams=trams)
        if (buses, bikes, trams) not in self._networks:
            self._networks[buses, bikes, trams] = TripNetwork(self.transit, buses=buses, bikes=bikes, trams=trams)
        return self._networks[buses, bikes, trams]

    def _trip(self, question: Question, steps: list[Step], depart: float) -> Trip:
        return Trip(depart, tuple(self._leg(question, step) for step in steps if step.origin != step.to))

    def _leg(self, question: Question, step: Step) -> Leg:
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
            metres, line = float(np.hypot(*np.diff(path, axis=0).T).sum()), times.line.id
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
