"""The search: least arrival, then price, then metres on foot, over stops, stations and the clock.

Labels are settled in the order of the least arrival at the goal that is left to them (A*, by the bee line and the top
speed); one is dropped where another at the same place is no worse in all three. Ways on the ground begin as lower
bounds. A trip that is best and consists of known ways alone is the best one; as long as it does not, its ways are found
and the search is done again, so few of the many ways are ever looked for.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from vico.world.trips.network import Ride, TripNetwork
from vico.world.trips.ways import Ways

# Seconds: arrivals that rounding tells apart may be one and the same.
_ALIKE = 1e-6
_ON_FOOT = Ride(-1, 0.0, 0.0, 0.0, -2)
_Step = tuple[int, int, int, int]
_Key = tuple[float, float, float, int, tuple[_Step, ...]]


@dataclass(frozen=True, eq=False)
class Label:
    """A way to be somewhere.

    Attributes
    ----------
    arrive, price, metres
        When, at what cost so far, and after how many metres on foot.
    node
        Where.
    walked
        Whether one came there on foot, to board or at the goal; else one has just got off (or not yet set out).
    parent
        Where one came from; None at the start.
    step
        How: a ride; `line` is -2 for a walk.
    trace
        All steps, to choose among equals: to, line, first, last.
    """

    arrive: float
    price: float
    metres: float
    node: int
    walked: bool
    parent: Label | None
    step: Ride
    trace: tuple[_Step, ...]

    @property
    def key(self) -> _Key:
        """What labels at one place are ordered by: no two that differ are equal in it."""
        return self.arrive, self.price, self.metres, len(self.trace), self.trace

    def chain(self) -> list[Label]:
        """Return the labels from the first step to this one."""
        found: list[Label] = []
        label: Label = self
        while label.parent is not None:
            found.append(label)
            label = label.parent
        return found[::-1]


@dataclass(frozen=True)
class Question:
    """What is asked: all that a search depends on.

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

    @property
    def start(self) -> int:
        """Number of the start."""
        return len(self.network)

    @property
    def goal(self) -> int:
        """Number of the goal."""
        return len(self.network) + 1


def best_trips(question: Question, depart: float) -> list[Label]:
    """Return the trips asked for, the best first; none if the goal can't be reached."""
    ways = question.ways
    while True:
        found = _settle(question, depart)
        unknown = [
            (a, b)
            for label in found
            for step in label.chain()
            for a, b in ([_ground(step)] if step.step.line < 0 else [])
            if a != b and not ways.known(a, b)
        ]
        if not unknown:
            return found
        for a, b in dict.fromkeys(unknown):
            ways.way(a, b)


def _ground(label: Label) -> tuple[int, int]:
    assert label.parent is not None
    return label.parent.node, label.node


def _settle(question: Question, depart: float) -> list[Label]:
    """Search with what is known of the ways."""
    goal = question.goal
    settled: dict[tuple[int, bool], list[Label]] = {}
    first = Label(depart, 0.0, 0.0, question.start, False, None, _ON_FOOT, ())
    queue: list[tuple[float, _Key, Label]] = [(depart, first.key, first)]
    waiting: dict[tuple[int, bool], list[Label]] = {}
    at_goal = settled.setdefault((goal, True), [])
    limit = question.latest
    while queue:
        least, _, label = heapq.heappop(queue)
        if at_goal and not question.all_good and least > at_goal[0].arrive + _ALIKE:
            break
        others = settled.setdefault((label.node, label.walked), [])
        if _is_no_better(label.arrive, label.price, label.metres, others):
            continue
        others.append(label)
        if label.node == goal:
            continue
        for after, left in _steps(question, label, limit):
            if after.price > question.cash or after.arrive + left > limit:
                continue
            place = after.node, after.walked
            if _is_no_better(after.arrive, after.price, after.metres, settled.get(place, ())):
                continue
            if question.all_good:
                if _is_no_better(after.arrive + left, after.price, after.metres, at_goal):
                    continue
            elif after.node == goal:
                limit = min(limit, after.arrive)
            ahead = waiting.setdefault(place, [])
            if _is_worse(after, ahead):
                continue
            ahead.append(after)
            heapq.heappush(queue, (after.arrive + left, after.key, after))
    return at_goal if question.all_good else sorted(at_goal, key=lambda label: label.key)[:1]


def _is_worse(label: Label, others: list[Label]) -> bool:
    """Return whether one of the labels is at least as good in everything, and better in something."""
    return any(
        o.arrive <= label.arrive
        and o.price <= label.price
        and o.metres <= label.metres
        and (o.arrive < label.arrive or o.price < label.price or o.metres < label.metres)
        for o in others
    )


def _is_no_better(arrive: float, price: float, metres: float, others: Sequence[Label]) -> bool:
    """Return whether one of the labels is at least as good in everything."""
    return any(o.arrive <= arrive and o.price <= price and o.metres <= metres for o in others)


def _steps(question: Question, label: Label, limit: float) -> Iterator[tuple[Label, float]]:
    """Yield what may come after a label and be at the goal by `limit`, each with the least that is left, seconds."""
    network, ways, node = question.network, question.ways, label.node
    top = max(network.top_speed, ways.walk_speed)
    if label.walked:
        for ride in _rides(question, label, limit):
            if ride.arrive + ways.bee_line[ride.to] / top > limit:
                continue
            price = round(label.price + ride.price, 2)
            trace = (*label.trace, (ride.to, ride.line, ride.first, ride.last))
            after = Label(ride.arrive, price, label.metres, ride.to, False, label, ride, trace)
            yield after, ways.bee_line[ride.to] / top
        return
    metres, seconds, _ = ways.leaving(node)
    if seconds[question.goal] < math.inf and (question.direct or label.parent is not None):
        straight = _on_foot(label, question.goal, float(seconds[question.goal]), float(metres[question.goal]))
        yield straight, 0.0
        if not question.all_good:
            limit = min(limit, straight.arrive)
    for to in ways.reached(node, network.boardable, limit - label.arrive, top):
        left = ways.bee_line[to] / top
        if to == node:
            # Changing where one got off costs no way.
            yield _on_foot(label, to, 0.0, 0.0), left
        elif label.arrive + seconds[to] + left <= limit and seconds[to] < math.inf:
            yield _on_foot(label, to, float(seconds[to]), float(metres[to])), left


def _rides(question: Question, label: Label, limit: float) -> Iterator[Ride]:
    """Yield the rides from where one has come on foot; bicycles only as far as one may be at the goal by `limit`."""
    network, ways, node = question.network, question.ways, label.node
    yield from network.bus_rides(node, label.arrive)
    if node in network.stations and network.stations[node].gives:
        seconds, top = ways.leaving(node).ride, max(network.top_speed, ways.walk_speed)
        for to in ways.reached(node, network.returnable, limit - label.arrive, top, by_bicycle=True):
            if to == node or seconds[to] == math.inf:
                continue
            if label.arrive + seconds[to] + ways.bee_line[to] / top <= limit:
                yield network.bike_ride(to, label.arrive, float(seconds[to]))


def _on_foot(label: Label, to: int, seconds: float, metres: float) -> Label:
    arrive = label.arrive + seconds
    return Label(arrive, label.price, label.metres + metres, to, True, label, _ON_FOOT, (*label.trace, (to, -2, 0, 0)))
