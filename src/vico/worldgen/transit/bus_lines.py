"""Bus lines on the lane graph: where buses can stop, how they drive, planned rounds, and timetables.

Where the map and the timetables have no stops, they are planned: k-means over the places people go to.

A tenth of a round, `BUS_LAYOVER` seconds at the least, is waited for at the first stop: a bus that comes late leaves
on time all the same. But one that stands at a stop until its time holds up everybody behind it. What a round leaves
over beyond that is therefore driven: first by a way about (in truth the bus would be beyond the window's edge), then
by driving slower between stops; only what still remains is waited for, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from vico.geo.gtfs_feed import DAY
from vico.geo.osm import OsmData
from vico.geometry import distances
from vico.rules import BUS_DWELL, BUS_LAYOVER
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.transit import Line, Stop
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.site import SiteFacts
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
            berth = merge_berth(Berth(f"{key}@{self.lanes.ids[lane]}", name, lane, offset), known)
            if berth not in berths:
                berths.append(berth)
        return berths[:_MOST_CHOICES]


def merge_berth(berth: Berth, known: Iterable[Berth]) -> Berth:
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
        return self.round(loop) - (_U_TURN_COST * self.lanes_and_turns(loop)[1] if len(loop) > 1 else 0.0)

    def lanes_and_turns(self, loop: Sequence[Berth]) -> tuple[set[int], int]:
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


MIN_STOPS, MAX_STOPS = 4, 12
MAX_LOOP = 4500.0
_DISTRICT = 1200.0  # metres: the side of the largest window that these suit

_PLANNED = 8
_FEW = 12  # fewer named places than this say little about where people go: buildings count too
_APART = 60.0  # metres between two stops of a planned line


def width_in_districts(osm: OsmData) -> float:
    """Return how many times as wide as a district a place is, at least 1: so much longer may its lines be."""
    return max(1.0, max(osm.sides) / _DISTRICT)


def scaled_by_area(each: int, osm: OsmData) -> int:
    """Return how many lines a place may have, of so many in a district: by its area."""
    wide, high = osm.sides
    times = max(1.0, math.sqrt(wide * high) / _DISTRICT)
    return round(each * times * times)


def destinations(site: SiteFacts) -> NDArray[np.float64]:
    """Places that people go to, metres, shape ``(n, 2)``: the named ones; every building where these are few."""
    points = [named.xy for named in site.named]
    if len(points) < _FEW:
        for area in site.osm.areas:
            if area.tags.get("building", "no") != "no" and not area.polygon.is_empty:
                with drop_on_failure(area.id):
                    points.append(np.array(area.polygon.representative_point().coords[0]))
    xy = np.array(points).reshape(-1, 2)
    return xy[site.osm.holds(xy, edge=False)]


def k_means(xy: NDArray[np.float64], count: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Centres of `count` clusters of points, spread out from the start (k-means++), shape ``(k, 2)``."""
    count = min(count, len(np.unique(xy, axis=0)))
    if not count:
        return np.zeros((0, 2))
    centres = [xy[int(random.integers(len(xy)))]]
    while len(centres) < count:
        away = np.min([((xy - c) ** 2).sum(axis=1) for c in centres], axis=0)
        centres.append(xy[int(random.choice(len(xy), p=away / away.sum()))])
    middles = np.array(centres)
    for _ in range(25):
        nearest = np.argmin(((xy[:, None] - middles[None]) ** 2).sum(axis=2), axis=1)
        middles = np.array([xy[nearest == k].mean(axis=0) if (nearest == k).any() else middles[k]
                            for k in range(count)])  # fmt: skip
    return middles


def planned_berths(site: SiteFacts, kerbs: Kerbs, seed: int) -> list[Berth]:
    """Eight stops: k-means over where people go, each at the nearest kerb that buses can reach."""
    lanes = kerbs.lanes
    spots = [
        (lane, float(offset))
        for lane in kerbs.numbers.tolist()
        for offset in np.arange(BUS_LENGTH + 2.0, lanes.length[lane] - 3.0, 10.0)
        if kerbs.has_room(lane, float(offset))
    ]
    if not spots:
        return []
    xy = lanes.at([lane for lane, _ in spots], [offset for _, offset in spots])[:, :2]
    wanted = destinations(site)
    if len(wanted) < _PLANNED:
        wanted = xy
    centres = k_means(wanted, _PLANNED, rng(seed, "transit", "stops"))
    chosen: list[int] = []
    for centre in centres:
        away = ((xy - centre) ** 2).sum(axis=1)
        for taken in chosen:
            away = np.where(distances(xy, xy[taken]) < _APART, np.inf, away)
        if np.isfinite(away).any():
            chosen.append(int(np.argmin(away)))
    return [Berth(f"planned{k}", f"Stop {k + 1}", *spots[i]) for k, i in enumerate(sorted(chosen))]


def planned_loop(drive: Drive, berths: Sequence[Berth], *, least: int = MIN_STOPS) -> list[Berth]:
    """One loop: the cheapest insertion of stops into a round, from the best pair of stops on; empty if none.

    Parameters
    ----------
    least
        How few stops it may have; below `MIN_STOPS` they may lie nearer to one another, too.
    """
    n = len(berths)
    if n < least:
        return []
    drive.prepare(berths)
    metres = np.array([[drive.metres(a, b) for b in berths] for a in berths])
    both = metres + metres.T
    np.fill_diagonal(both, np.inf)
    # A first pair some way apart: two poles across the street make no line.
    spots = drive.lanes.at([b.lane for b in berths], [b.offset for b in berths])[:, :2]
    apart = np.linalg.norm(spots[:, None] - spots[None], axis=2)
    for away in (150.0, 80.0) if least >= MIN_STOPS else (150.0, 80.0, 40.0):
        score = np.where(apart > away, both / np.maximum(apart, 1.0), np.inf)
        if np.isfinite(score).any():
            break
    else:
        return []
    loop = [int(v) for v in np.unravel_index(int(np.argmin(score)), score.shape)]

    def around() -> float:
        return float(sum(metres[a, b] for a, b in zip(loop, loop[1:] + loop[:1], strict=True)))

    while len(loop) < MAX_STOPS:
        best = (math.inf, -1, -1)
        for new in range(n):
            if new in loop or apart[new, loop].min() < _APART:
                continue
            for k in range(len(loop)):
                a, b = loop[k], loop[(k + 1) % len(loop)]
                best = min(best, (float(metres[a, new] + metres[new, b] - metres[a, b]), new, k))
        if best[1] < 0 or not math.isfinite(best[0]):
            break
        if len(loop) >= least and (best[0] > 350.0 or around() + best[0] > MAX_LOOP):
            break
        loop.insert(best[2] + 1, best[1])
    if len(loop) < least or not math.isfinite(around()):
        return []
    return [berths[i] for i in loop]


BUS_SPEED = 10.0
DWELL = BUS_DWELL
FIRST_DEPARTURE, LAST_DEPARTURE = 5 * 3600, 23 * 3600
HEADWAY = (360.0, 600.0)

# Share of a round kept at the first stop to make up for what was lost on the way, and the most seconds of it: longer
# no vehicle is held up behind a bus that waits for its time.
_LAYOVER_SHARE = 0.1  # of a round, waited at its end
_MOST_LAYOVER = 60.0  # seconds
_BUSY = 1.17  # times as long a round takes with 60 cars in central Helsinki: so much time our own plans give it
_JUNCTION_SECONDS = 6.0
_SIGNAL_SECONDS = 12.0  # that a junction with signals costs
_STOP_SECONDS = 10.0  # that braking for a stop and starting from it cost
_SLOWEST = 4.8  # m/s between stops; buses that have time drive no slower than a little below it
_SMALL = 25.0  # seconds over that are not worth a way about
_LONGEST_WAY_ABOUT = 600.0  # seconds: none drives about for longer, however rare its buses are
_MOST_BENDS = 4
_TRIALS = 24
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


@dataclass(frozen=True)
class Timing:
    """A round and its times.

    Attributes
    ----------
    loop
        Berths in the order they are served.
    legs
        Lanes after each berth's up to and including the next one's.
    departures
        From the first berth, seconds of the day.
    travel
        Seconds from leaving the first berth to arriving at each, then back at the first.
    idle
        Seconds a bus waits at the first berth, beyond the time that people board in.
    """

    loop: tuple[Berth, ...]
    legs: tuple[tuple[int, ...], ...]
    departures: tuple[int, ...]
    travel: tuple[float, ...]
    idle: float


def timing(
    loop: Sequence[Berth],
    drive: Drive,
    *,
    departures: Sequence[int] = (),
    interval: int | None = None,
    hours: tuple[int, int] | None = None,
    later: int = 0,
) -> Timing:
    """Drive a loop and time it.

    Parameters
    ----------
    loop
        Berths in the order they are served.
    departures
        From the first stop, seconds of the day, where a timetable gives them.
    interval, hours
        Seconds between buses and the first and last of the day, where the map says; planned otherwise: as many buses
        as make it six to ten minutes.
    later
        Seconds by which the first bus of a plan leaves after that hour.
    """
    for _ in loop:
        # The round must not begin in the middle of a lane that an earlier stop is on: it would drive the lane twice.
        if loop[-1].lane != loop[0].lane or loop[0].offset <= loop[-1].offset + BUS_LENGTH:
            break
        early = DWELL + (loop[0].offset - loop[-1].offset) / BUS_SPEED
        departures = sorted(round(when - early) % DAY for when in departures)
        loop = [loop[-1], *loop[:-1]]
    legs = [drive.lanes_between(a, b) for a, b in zip(loop, [*loop[1:], loop[0]], strict=True)]
    clock = sum(_seconds(drive, a, leg, b) + DWELL for a, leg, b in _rows(loop, legs))
    if departures:
        times = list(departures)
        gaps = sorted(b - a for a, b in pairwise(times))
        headway = float(gaps[len(gaps) // 2]) if gaps else clock
    else:
        first, last = hours or (FIRST_DEPARTURE, LAST_DEPARTURE)
        whole = clock * _BUSY + _layover(clock)
        headway = float(interval or max(whole / max(1, math.ceil(whole / HEADWAY[1])), HEADWAY[0]))
        # Whole minutes, so that the timetable can be read.
        headway = math.ceil(headway / 60.0) * 60.0
        times = list(range(first + later % int(headway), last + 1, int(headway)))
    legs[-1] = _detour(drive, loop[-1], legs[-1], loop[0], min(_spare(clock, headway), _LONGEST_WAY_ABOUT))
    travel = [0.0]
    clock = slowest = 0.0
    for start, leg, end in _rows(loop, legs):
        clock += _seconds(drive, start, leg, end)
        slowest += _metres(drive, start, leg, end) / _SLOWEST + _waits(drive, start, leg) + _STOP_SECONDS + DWELL
        travel.append(round(clock, 1))
        clock += DWELL
    spare = min(_spare(clock, headway), max(slowest - clock, 0.0))
    rest = _rounds(clock, headway) * headway - clock
    under_way = [t - DWELL * max(i - 1, 0) for i, t in enumerate(travel)]
    travel = [round(t + spare * share / max(under_way[-1], 1.0), 1) for t, share in zip(travel, under_way, strict=True)]
    return Timing(tuple(loop), tuple(tuple(leg) for leg in legs), tuple(times), tuple(travel), rest - spare)


def line_record(number: int, name: str, times: Timing, drive: Drive, stops: Mapping[Berth, Stop], colour: str) -> Line:
    """Record a timed round.

    Parameters
    ----------
    number
        Of the line in its world.
    stops
        Record of each berth's stop.
    colour
        ``#rrggbb``; one of ours where empty.
    """
    chain = [times.loop[0].lane, *(lane for leg in times.legs for lane in leg)][:-1]
    return Line(
        id=f"line_{number}",
        name=name,
        colour=colour or COLOURS[number % len(COLOURS)],
        stops=[stops[berth].id for berth in times.loop],
        lanes=[drive.lanes.ids[i] for i in chain],
        departures=list(times.departures),
        travel=list(times.travel),
    )


def _layover(clock: float) -> float:
    """Return how long a bus whose round takes `clock` seconds is to wait at the first stop."""
    return min(max(_LAYOVER_SHARE * clock, BUS_LAYOVER), _MOST_LAYOVER)


def _rounds(clock: float, headway: float) -> int:
    """Return how many departures there are in the time of a round and its layover."""
    return max(1, math.ceil((clock + _layover(clock)) / headway))


def _spare(clock: float, headway: float) -> float:
    """Return the seconds of a round that are neither driven nor waited for."""
    return _rounds(clock, headway) * headway - clock - _layover(clock)


def _rows(loop: Sequence[Berth], legs: Sequence[Sequence[int]]) -> list[tuple[Berth, Sequence[int], Berth]]:
    return list(zip(loop, legs, [*loop[1:], loop[0]], strict=True))


def _seconds(drive: Drive, start: Berth, leg: Sequence[int], end: Berth) -> float:
    """How long a leg takes."""
    lanes = drive.lanes
    driven = [start.lane, *leg]
    seconds = sum(float(lanes.length[i] / min(lanes.speed[i], BUS_SPEED)) for i in driven)
    seconds -= start.offset / min(float(lanes.speed[start.lane]), BUS_SPEED)
    seconds -= float(lanes.length[end.lane] - end.offset) / min(float(lanes.speed[end.lane]), BUS_SPEED)
    # Drives in traffic take a quarter longer than at the limit.
    return max(seconds, 0.0) * 1.25 + _waits(drive, start, leg) + 4.0


def _waits(drive: Drive, start: Berth, leg: Sequence[int]) -> float:
    """How long the junctions of a leg are waited for."""
    lanes = drive.lanes
    driven = [start.lane, *leg]
    # Every passage of a junction counts, also of one that is passed again; its lanes follow one another.
    zones = [int(z) for z in lanes.zone[driven]]
    entered = [lane for lane, a, b in zip(driven, [-1, *zones], zones, strict=False) if b >= 0 and a != b]
    signalled = [lane for lane in entered if lanes.inside[lane] >= 0 and lanes.signals[lanes.inside[lane]]]
    return _JUNCTION_SECONDS * (len(entered) - len(signalled)) + _SIGNAL_SECONDS * len(signalled)


def _metres(drive: Drive, start: Berth, leg: Sequence[int], end: Berth) -> float:
    length = drive.lanes.length
    return float(length[[start.lane, *leg]].sum()) - start.offset - float(length[end.lane]) + end.offset


def _detour(drive: Drive, start: Berth, leg: list[int], end: Berth, rest: float) -> list[int]:
    """Return the leg from the last stop to the first, longer by nearly `rest` seconds where the streets allow it."""
    base = _seconds(drive, start, leg, end)
    bends: list[Berth] = []
    best = leg
    for _ in range(_MOST_BENDS):
        left = base + rest - _seconds(drive, start, best, end)
        if left < _SMALL:
            break
        last = bends[-1] if bends else start
        done = best[: len(best) - len(drive.lanes_between(last, end))]
        found: tuple[float, list[int], Berth] | None = None
        for bend in _lanes_for_detour(drive, last, end, left):
            trial = [*done, *drive.lanes_between(last, bend), *drive.lanes_between(bend, end)]
            longer = _seconds(drive, start, trial, end) - base
            turns = int(drive.uturn[trial].sum()) > int(drive.uturn[leg].sum())
            if longer <= rest and not turns and (found is None or longer > found[0] + 1.0):
                found = longer, trial, bend
        if found is None or found[0] <= rest - left + 1.0:
            break
        best = found[1]
        bends.append(found[2])
    return best


def _lanes_for_detour(drive: Drive, start: Berth, end: Berth, seconds: float) -> list[Berth]:
    """Lanes to drive by on the way to a stop that make it longer by up to so many seconds, spread over the lengths."""
    lanes = drive.lanes
    drive.prepare([start])
    extra = drive.costs_from(start.lane) + drive.costs_to(end.lane)
    extra = extra - (drive.costs_from(start.lane)[end.lane] if start.lane != end.lane else 0.0)
    usable = (lanes.inside < 0) & np.isfinite(extra) & (extra > 40.0) & (extra < seconds * BUS_SPEED)
    usable[[start.lane, end.lane]] = False
    found = np.flatnonzero(usable)
    found = found[np.argsort(extra[found], kind="stable")]
    if len(found) > _TRIALS:
        found = found[np.unique(np.linspace(0, len(found) - 1, _TRIALS).round().astype(int))]
    bends = [Berth("", "", int(lane), float(lanes.length[lane]) / 2) for lane in found]
    # Where there is but one way to go round, it is gone once more, past the stop.
    return [*bends, end]
