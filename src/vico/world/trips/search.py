"""The search: least arrival, then price, then metres on foot, over stops, stations and the clock.

Labels are settled in the order of the least arrival at the goal that is left to them (A*, by the bee line and the top
speed); one is dropped where another at the same place is no worse in all three. Ways on the ground begin as lower
bounds. A trip that is best and consists of known ways alone is the best one; as long as it does not, its ways are found
and the search is done again, so few of the many ways are ever looked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.world.trips.labels import CENTS, Bounds, settle
from vico.world.trips.network import TripNetwork
from vico.world.trips.ways import Ways


class Step(NamedTuple):
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


def best_trips(question: Question, depart: float) -> list[list[Step]]:
    """Return the steps of the trips asked for, the best first; none if the goal can't be reached."""
    network, ways = question.network, question.ways
    top_speed = max(network.top_speed, ways.walk_speed)
    bounds = Bounds(ways.walk_speed, top_speed, question.cash, question.latest, question.direct, question.all_good)
    while True:
        found = _trips(*settle(network.timetable, ways.ground, bounds, float(depart)))
        if not question.all_good:
            found = found[:1]
        on_ground = ((step.origin, step.to) for steps in found for step in steps if step.line < 0)
        unknown = [(a, b) for a, b in on_ground if a != b and not ways.known(a, b)]
        if not unknown:
            return found
        for a, b in dict.fromkeys(unknown):
            ways.way(a, b)


def _trips(labels: NDArray[np.void], at_goal: NDArray[np.int64]) -> list[list[Step]]:
    """Return the steps to labels, the best first: equal ones in the order of how many steps, and of which."""
    found = []
    for label in at_goal.tolist():
        steps = _steps(labels, label)
        arrive, price, metres = labels[label][["arrive", "price", "metres"]].item()
        trace = [(step.to, step.line, step.first, step.last) for step in steps]
        found.append(((arrive, price, metres, len(steps), trace), steps))
    return [steps for _, steps in sorted(found, key=lambda pair: pair[0])]


def _steps(labels: NDArray[np.void], label: int) -> list[Step]:
    """Return the steps from the start to a label."""
    steps = []
    to = labels[label]
    while to["parent"] >= 0:
        before = labels[to["parent"]]
        steps.append(
            Step(
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
