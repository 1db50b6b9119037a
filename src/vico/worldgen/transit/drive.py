"""Where buses can stop and how they drive from stop to stop over the lane graph."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.worldgen.transit.waiting import can_wait

BUS_LENGTH = 12.0

_U_TURN_COST = 3000.0  # no bus turns on the spot where a round exists
_LANE_CHANGE_COST = 120.0
_LEAST_CHANGE = 80.0  # metres of lane that a bus needs to find a gap in the one beside, with others waiting there
_ASTRAY = 1.7  # how much longer a metre off a route's mapped way counts
_ON_WAY = 8.0  # metres from a route's mapped way within which a lane is on it
_MOST_CHOICES = 6
_LEAST_ROUND = 250.0  # metres of lanes that lead back to one another, below which there is nowhere to go
# Where people can't wait beside a bus, it stops so far before or behind that place, metres, the nearest first.
_SHIFTS = tuple(sign * 2.0 * k for k in range(9) for sign in ((1.0, -1.0) if k else (1.0,)))
_BERTH_GAP = BUS_LENGTH + 6.0


@dataclass(frozen=True)
class Berth:
    """Where a bus can stop: a lane, the metres along it at which its front comes to rest, and the name on the pole."""

    key: str
    name: str
    lane: int
    offset: float


class Kerbs:
    """Lanes along a kerb, long enough for a bus to stand clear of both junctions, from where one can come back.

    Lanes on decks above other streets are none: who waits for a bus stands on the ground.

    Parameters
    ----------
    solids
        What nobody stands in: no bus stops where there is no room to wait beside it.

    Attributes
    ----------
    numbers
        The lanes.
    """

    def __init__(self, lanes: LaneGraph, height: HeightField, solids: Sequence[shapely.Polygon] = ()) -> None:
        self.lanes = lanes
        self._walls = shapely.STRtree(list(solids))
        round_metres = np.bincount(lanes.component, weights=lanes.length, minlength=1)
        goes_round = round_metres[lanes.component] > _LEAST_ROUND
        usable = (lanes.inside < 0) & (lanes.right < 0) & (lanes.length > BUS_LENGTH + 8.0) & goes_round
        if height.decks is not None:
            off = np.abs(lanes.z - height(lanes.points)) > 1.0
            usable[np.repeat(np.arange(len(lanes)), np.diff(lanes.first))[off]] = False
        self.numbers = np.flatnonzero(usable)
        self.lines = np.array([shapely.LineString(lanes.line(int(i))) for i in self.numbers], object)

    def offset_on(self, lane: int, offset: float) -> float:
        """Return the nearest resting place at which the whole bus stands on the lane."""
        return float(np.clip(offset, BUS_LENGTH + 2.0, self.lanes.length[lane] - 3.0))

    def has_room(self, lane: int, offset: float) -> bool:
        """Return whether people can wait beside a bus that stands on a lane."""
        return can_wait(self.lanes, lane, offset, self._walls)

    def with_room(self, lane: int, offset: float) -> float | None:
        """Return the resting place nearest to an offset beside which people can wait; None if there is none near."""
        for shift in _SHIFTS:
            at = self.offset_on(lane, offset + shift)
            if self.has_room(lane, at):
                return at
        return None

    def near(self, xy: ArrayLike, reach: float) -> list[tuple[float, int, float]]:
        """Lanes within `reach` metres of a pole, the best first: how ill each suits, its number, metres along it.

        A lane that has the pole on the side away from its kerb suits 10 m worse. Lanes beside which nobody can wait
        near the pole are left out.
        """
        if not len(self.numbers):
            return []
        point = shapely.Point(xy)
        away = shapely.distance(self.lines, point)
        found = []
        for k in np.flatnonzero(away < reach).tolist():
            lane, along = int(self.numbers[k]), float(self.lines[k].project(point))
            x, y, yaw = self.lanes.at(lane, along)
            right = (point.x - x) * math.sin(yaw) - (point.y - y) * math.cos(yaw) > 0
            kerb = right != self.lanes.lefthand
            at = self.with_room(lane, along)
            if at is not None:
                found.append((float(away[k]) + (0.0 if kerb else 10.0), lane, at))
        return sorted(found)

    def passes(self, xy: ArrayLike, reach: float) -> bool:
        """Return whether a lane comes within `reach` metres of a pole, with room to wait or without."""
        return bool((shapely.distance(self.lines, shapely.Point(xy)) < reach).any()) if len(self.lines) else False

    def choices(self, key: str, name: str, xy: ArrayLike, known: Sequence[Berth], reach: float) -> list[Berth]:
        """Berths at which a bus may serve a pole, the best first; known ones stand for those beside them."""
        berths: list[Berth] = []
        for _, lane, offset in self.near(xy, reach):
            berth = merged(Berth(f"{key}@{self.lanes.ids[lane]}", name, lane, offset), known)
            if berth not in berths:
                berths.append(berth)
        return berths[:_MOST_CHOICES]


def merged(berth: Berth, known: Iterable[Berth]) -> Berth:
    """Return the known berth that this one would overlap, else this one: two poles that share a berth are one stop."""
    for other in known:
        if other.lane == berth.lane and abs(other.offset - berth.offset) <= _BERTH_GAP:
            return other
    return berth


class Drive:
    """Cheapest drives between berths.

    Parameters
    ----------
    lanes
        The lane network.
    way
        Lines a route is mapped on, metres: lanes off them cost more.
    """

    def __init__(self, lanes: LaneGraph, way: shapely.Geometry | None = None) -> None:
        self.lanes = lanes
        n = len(lanes)
        rows = np.repeat(np.arange(n), np.diff(lanes.next_first))
        turn = np.abs((lanes.at(np.arange(n), lanes.length)[:, 2] - lanes.at(np.arange(n), 0.0)[:, 2] + np.pi)
                      % (2 * np.pi) - np.pi)  # fmt: skip
        self.uturn = (lanes.inside >= 0) & (turn > 2.6)
        self.cost = lanes.length + np.where(self.uturn, _U_TURN_COST, 0.0)
        if way is not None and not way.is_empty and n:
            middle = shapely.points(lanes.at(np.arange(n), lanes.length / 2)[:, :2])
            shapely.prepare(way)
            self.cost = self.cost * np.where(shapely.dwithin(way, middle, _ON_WAY), 1.0, _ASTRAY)
        sources, targets, weights = [rows], [lanes.next], [self.cost[rows]]
        for side in (lanes.left, lanes.right):
            have = np.flatnonzero((side >= 0) & (lanes.length > _LEAST_CHANGE))
            sources.append(have)
            targets.append(side[have])
            weights.append(np.full(len(have), _LANE_CHANGE_COST))
        self._graph = csr_matrix(
            (np.concatenate(weights) + 1e-6, (np.concatenate(sources), np.concatenate(targets))), shape=(n, n)
        )
        self._reach: dict[int, NDArray[np.float64]] = {}
        self._before: dict[int, NDArray[np.int32]] = {}
        self._towards: dict[int, NDArray[np.float64]] = {}

    def prepare(self, berths: Iterable[Berth]) -> None:
        """Look up the drives from these berths in one go."""
        new = sorted({berth.lane for berth in berths} - self._reach.keys())
        if new:
            reach, before = dijkstra(self._graph, indices=new, return_predecessors=True)
            for k, lane in enumerate(new):
                self._reach[lane], self._before[lane] = reach[k], before[k]

    def costs_from(self, lane: int) -> NDArray[np.float64]:
        """Return what it costs to come from the start of a lane to the start of each other one."""
        if lane not in self._reach:
            self.prepare([Berth("", "", lane, 0.0)])
        return self._reach[lane]

    def costs_to(self, lane: int) -> NDArray[np.float64]:
        """Return what it costs to come to the start of a lane from the start of each other one."""
        if lane not in self._towards:
            self._towards[lane] = np.asarray(dijkstra(self._graph.T, indices=lane))
        return self._towards[lane]

    def metres(self, a: Berth, b: Berth) -> float:
        """Cost of the drive from a to b (round a block where b is a or lies behind it on its lane)."""
        self.prepare([a])
        if a.lane != b.lane:
            return float(self._reach[a.lane][b.lane]) - a.offset + b.offset
        if b.offset > a.offset + BUS_LENGTH:
            return b.offset - a.offset
        last = self._last(a.lane)
        return math.inf if last < 0 else float(self._reach[a.lane][last] + self.cost[last]) - a.offset + b.offset

    def _last(self, lane: int) -> int:
        """Find the best lane to come back to a lane from, -1 if there is no way back."""
        before = self.lanes.preceding(lane)
        if not len(before):
            return -1
        costs = self._reach[lane][before] + self.cost[before]
        return int(before[int(np.argmin(costs))]) if np.isfinite(costs).any() else -1

    def lanes_between(self, a: Berth, b: Berth) -> list[int]:
        """Lanes after a's up to and including b's; empty where b lies further on the same lane."""
        self.prepare([a])
        if a.lane == b.lane and b.offset > a.offset + BUS_LENGTH:
            return []
        chain = [b.lane]
        lane = self._last(a.lane) if a.lane == b.lane else int(self._before[a.lane][b.lane])
        while lane != a.lane:
            chain.append(lane)
            lane = int(self._before[a.lane][lane])
        return chain[::-1]

    def round(self, loop: Sequence[Berth]) -> float:
        """Cost of a closed drive past berths."""
        if len(loop) < 2:
            return math.inf
        return float(sum(self.metres(a, b) for a, b in zip(loop, [*loop[1:], loop[0]], strict=True)))

    def metres_round(self, loop: Sequence[Berth]) -> float:
        """Cost of a closed drive past berths but for turns on the spot, which are as long as they are."""
        return self.round(loop) - (_U_TURN_COST * self.driven(loop)[1] if len(loop) > 1 else 0.0)

    def driven(self, loop: Sequence[Berth]) -> tuple[set[int], int]:
        """Lanes of a closed drive, and how often it turns on the spot."""
        lanes = [i for a, b in zip(loop, [*loop[1:], loop[0]], strict=True) for i in self.lanes_between(a, b)]
        return {berth.lane for berth in loop} | set(lanes), int(self.uturn[lanes].sum())

    def best_round(self, choices: Sequence[Sequence[tuple[float, Berth]]]) -> tuple[float, list[Berth]]:
        """Find the cheapest closed drive that serves one berth of each choice, in order.

        Parameters
        ----------
        choices
            For each stop, berths with what each costs by itself.

        Returns
        -------
        tuple of float, list of Berth
            What it costs (infinite where there is no such drive), and a berth for each choice.
        """
        if len(choices) < 2 or not all(choices):
            return math.inf, []
        self.prepare(berth for row in choices for _, berth in row)
        steps = []
        for here, there in zip(choices, [*choices[1:], choices[0]], strict=True):
            step = np.array([[self.metres(a, b) if a != b else math.inf for _, b in there] for _, a in here])
            steps.append(step + np.array([own for own, _ in there]))
        best: tuple[float, list[Berth]] = (math.inf, [])
        for first in range(len(choices[0])):
            cost = np.where(np.arange(len(choices[0])) == first, 0.0, math.inf)
            back: list[NDArray[np.intp]] = []
            for step in steps:
                total = cost[:, None] + step
                back.append(np.argmin(total, axis=0))
                cost = np.min(total, axis=0)
            if cost[first] < best[0]:
                at, picked = first, []
                for pointer, row in zip(reversed(back), reversed(choices), strict=True):
                    at = int(pointer[at])
                    picked.append(row[at][1])
                best = (float(cost[first]), picked[::-1])
        return best
