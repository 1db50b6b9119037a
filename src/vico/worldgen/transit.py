"""Public transport: stops and bicycle stations from the map, bus lines planned over lanes that buses can drive."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from vico.geo.osm import OsmData
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.model import BikeStation, Line, Stop, Transit
from vico.world.seeds import rng
from vico.world.walkways import SIDEWALK, Walkways

# Entities of stops and stations, at the upper end of the numbers for objects.
FIRST_STOP = 90_000
FIRST_STATION = 95_000

BUS_LENGTH = 12.0
BUS_SPEED = 10.0
DWELL = 30.0
DOOR_BEHIND_FRONT = 1.3  # metres from a bus's front to the middle of its front door
FIRST_DEPARTURE, LAST_DEPARTURE = 5 * 3600, 23 * 3600
HEADWAY = (360.0, 600.0)

_REACH = 18.0  # a stop's pole stands this near to the lane it serves, metres
_U_TURN_COST = 3000.0  # no bus turns on the spot where a round exists
_LANE_CHANGE_COST = 120.0
_JUNCTION_SECONDS = 6.0
_MIN_STOPS, _MAX_STOPS = 4, 12
_MAX_LOOP = 4500.0
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


@dataclass(frozen=True)
class _Berth:
    """Where a bus can stop: a lane, the metres along it at which its front comes to rest, and the name on the pole."""

    key: str
    name: str
    lane: int
    offset: float


class _Drive:
    """Shortest drives between berths over the lane graph."""

    def __init__(self, lanes: LaneGraph, berths: list[_Berth]) -> None:
        self.lanes = lanes
        self.berths = berths
        n = len(lanes)
        rows = np.repeat(np.arange(n), np.diff(lanes.next_first))
        ends = lanes.at(np.arange(n), lanes.length)[:, 2]
        starts = lanes.at(np.arange(n), 0.0)[:, 2]
        turn = np.abs((ends - starts + np.pi) % (2 * np.pi) - np.pi)
        uturn = (lanes.inside >= 0) & (turn > 2.6)
        cost = lanes.length + np.where(uturn, _U_TURN_COST, 0.0)
        sources, targets, weights = [rows], [lanes.next], [cost[rows]]
        for side in (lanes.left, lanes.right):
            have = np.flatnonzero((side >= 0) & (lanes.length > 40.0))
            sources.append(have)
            targets.append(side[have])
            weights.append(np.full(len(have), _LANE_CHANGE_COST))
        graph = csr_matrix(
            (np.concatenate(weights) + 1e-6, (np.concatenate(sources), np.concatenate(targets))), shape=(n, n)
        )
        at = np.array([b.lane for b in berths], np.int32)
        self.reach, self.before = dijkstra(graph, indices=at, return_predecessors=True)
        self.cost = cost
        self.metres = np.array([[self._metres(i, j) for j in range(len(berths))] for i in range(len(berths))])

    def _metres(self, i: int, j: int) -> float:
        """Cost of the drive from berth i to berth j (round a block where j is i or lies behind it on its lane)."""
        a, b = self.berths[i], self.berths[j]
        if a.lane != b.lane:
            return float(self.reach[i, b.lane]) - a.offset + b.offset
        if b.offset > a.offset + BUS_LENGTH:
            return b.offset - a.offset
        last = self._last(i, b.lane)
        return math.inf if last < 0 else float(self.reach[i, last] + self.cost[last]) - a.offset + b.offset

    def _last(self, i: int, lane: int) -> int:
        """The best lane to come back to a lane from, -1 if there is no way back."""
        before = self.lanes.preceding(lane)
        if not len(before):
            return -1
        costs = self.reach[i, before] + self.cost[before]
        return int(before[int(np.argmin(costs))]) if np.isfinite(costs).any() else -1

    def lanes_between(self, i: int, j: int) -> list[int]:
        """Lanes after berth i's up to and including berth j's; empty where j lies further on the same lane."""
        a, b = self.berths[i], self.berths[j]
        if a.lane == b.lane and b.offset > a.offset + BUS_LENGTH:
            return []
        chain = [b.lane]
        lane = self._last(i, b.lane) if a.lane == b.lane else int(self.before[i, b.lane])
        while lane != a.lane:
            chain.append(lane)
            lane = int(self.before[i, lane])
        return chain[::-1]


def transit_from_osm(
    osm: OsmData,
    lanes: LaneGraph,
    height: HeightField,
    *,
    half: float | None = None,
    solids: list[shapely.Polygon] | None = None,
    seed: int = 0,
) -> Transit:
    """Stops, bus lines with a timetable, and bicycle stations of a window.

    Parameters
    ----------
    osm
        Map data in local metres: stops, bus routes, bicycle rental.
    lanes
        The lane network of the same window.
    height
        Ground heights.
    half
        Half side of the window, metres; the data's own where not given.
    solids
        Building footprints, so that nobody is told to wait inside one.
    seed
        Decides what the map leaves open: planned stops, bikes in a station.

    Returns
    -------
    Transit
        Lines are closed drives over at least four stops; none where the streets allow no such loop.
    """
    half = half or osm.half
    berths, names = _mapped_berths(osm, lanes, half), "osm"
    drive = _Drive(lanes, berths)
    loops = _mapped_loops(osm, drive, half)
    if not loops:
        loops = _planned_loops(drive)
    if not loops:
        berths, names = berths + _planned_berths(lanes, seed), "osm and planned" if berths else "planned"
        drive = _Drive(lanes, berths)
        loops = _planned_loops(drive)
    walks = lanes.walks.clear_of(solids or [])
    served = sorted({i for _, loop in loops for i in loop})
    kept = sorted(set(served) | {i for i, b in enumerate(berths) if not b.key.startswith("planned")})
    stops = {
        i: Stop(
            id=f"stop_{k}",
            entity=FIRST_STOP + k,
            name=berths[i].name,
            wait=_waiting_place(lanes, walks, height, berths[i]),
            lane=lanes.ids[berths[i].lane],
            offset=round(berths[i].offset, 2),
        )
        for k, i in enumerate(kept)
    }
    lines = [_line(k, name, loop, drive, stops) for k, (name, loop) in enumerate(loops)]
    stations, from_where = _bike_stations(osm, lanes, walks, height, half, seed)
    mapped = loops and not loops[0][0].startswith("Loop")
    origin = {"stops": names, "lines": "osm" if mapped else "planned", "bike_stations": from_where}
    return Transit(stops=list(stops.values()), lines=lines, bike_stations=stations, origin=origin)


def _usable(lanes: LaneGraph) -> NDArray[np.bool_]:
    """Lanes along a kerb, long enough for a bus to stand clear of both junctions, from where one can come back."""
    return (lanes.inside < 0) & (lanes.right < 0) & (lanes.length > BUS_LENGTH + 8.0) & (lanes.component == 0)


def _offset_on(lanes: LaneGraph, lane: int, offset: float) -> float:
    """The nearest resting place at which the whole bus stands on the lane."""
    return float(np.clip(offset, BUS_LENGTH + 2.0, lanes.length[lane] - 3.0))


def _mapped_berths(osm: OsmData, lanes: LaneGraph, half: float) -> list[_Berth]:
    """Berths of the mapped bus stops; two poles that share a berth give one."""
    usable = _usable(lanes)
    numbers = np.flatnonzero(usable)
    lines = [shapely.LineString(lanes.line(int(i))) for i in numbers]
    places = [(f"n{node.id}", node.xy, node.tags) for node in osm.nodes]
    places += [
        (area.id, np.array(area.polygon.centroid.coords[0]), area.tags)
        for area in osm.areas
        if area.tags.get("public_transport") == "platform" and not area.polygon.is_empty
    ]
    berths: list[_Berth] = []
    for key, xy, tags in places:
        stop = tags.get("highway") == "bus_stop" or (
            tags.get("public_transport") == "platform"
            and tags.get("tram", "no") == "no"
            and (tags.get("bus") == "yes" or key[0] == "n")
            and "railway" not in tags
        )
        if not stop or np.abs(xy).max() > half or not lines:
            continue
        point = shapely.Point(xy)
        away = shapely.distance(lines, point)
        best, lane, offset = math.inf, -1, 0.0
        for k in np.flatnonzero(away < _REACH):
            along = float(lines[k].project(point))
            x, y, yaw = lanes.at(int(numbers[k]), along)
            right = (xy[0] - x) * math.sin(yaw) - (xy[1] - y) * math.cos(yaw) > 0
            if away[k] + (0.0 if right else 10.0) < best:
                best, lane, offset = float(away[k]) + (0.0 if right else 10.0), int(numbers[k]), along
        if lane < 0:
            continue
        berth = _Berth(key, tags.get("name") or f"Stop {len(berths) + 1}", lane, _offset_on(lanes, lane, offset))
        if all(b.lane != lane or abs(b.offset - berth.offset) > BUS_LENGTH + 6.0 for b in berths):
            berths.append(berth)
    return berths


def _mapped_loops(osm: OsmData, drive: _Drive, half: float) -> list[tuple[str, list[int]]]:
    """Loops of mapped bus routes: a route's stops there, then its stops back, in the relations' own order."""
    by_key = {berth.key: i for i, berth in enumerate(drive.berths)}
    # A platform and the pole beside it are two members of one stop: members near a berth count as the berth.
    place = {f"n{node.id}": node.xy for node in osm.nodes}
    spots = [drive.lanes.at(b.lane, b.offset)[:2] for b in drive.berths]
    routes: dict[str, list[list[int]]] = {}
    for relation in sorted(osm.relations, key=lambda r: r.id):
        if relation.tags.get("route") not in ("bus", "trolleybus") or "ref" not in relation.tags:
            continue
        order: list[int] = []
        for kind, member, role in relation.members:
            key = f"{kind}{member}"
            found = by_key.get(key, -1)
            if found < 0 and "platform" in role and key in place and spots:
                away = [float(np.linalg.norm(place[key] - spot)) for spot in spots]
                found = int(np.argmin(away)) if min(away) < 12.0 else -1
            if found >= 0 and found not in order:
                order.append(found)
        if order:
            routes.setdefault(relation.tags["ref"], []).append(order)
    ranked: list[tuple[float, str, list[int]]] = []
    for ref, orders in routes.items():
        orders = sorted(orders, key=len, reverse=True)
        there = orders[0]
        back = next((o for o in orders[1:] if not set(o) & set(there)), [])
        for loop in ([*there, *back], there):
            metres = _round(drive, loop)
            if _MIN_STOPS <= len(loop) <= _MAX_STOPS and metres < _MAX_LOOP:
                ranked.append((metres / len(loop), ref, loop))
                break
    ranked.sort(key=lambda row: (row[0], row[1]))
    chosen: list[tuple[str, list[int]]] = []
    taken: set[int] = set()
    for _, ref, loop in ranked:
        if len(chosen) < 3 and len(set(loop) - taken) >= _MIN_STOPS:
            chosen.append((ref, loop))
            taken |= set(loop)
    return chosen


def _round(drive: _Drive, loop: list[int]) -> float:
    if len(loop) < 2:
        return math.inf
    return float(sum(drive.metres[a, b] for a, b in zip(loop, loop[1:] + loop[:1], strict=True)))


def _planned_loops(drive: _Drive) -> list[tuple[str, list[int]]]:
    """One loop: the cheapest insertion of stops into a round, from the best pair of stops on."""
    n = len(drive.berths)
    if n < _MIN_STOPS:
        return []
    both = drive.metres + drive.metres.T
    np.fill_diagonal(both, np.inf)
    # A first pair some way apart: two poles across the street make no line.
    spots = np.array([drive.lanes.at(b.lane, b.offset)[:2] for b in drive.berths])
    apart = np.linalg.norm(spots[:, None] - spots[None], axis=2)
    score = np.where(apart > 150.0, both / np.maximum(apart, 1.0), np.inf)
    if not np.isfinite(score).any():
        return []
    loop = [int(v) for v in np.unravel_index(int(np.argmin(score)), score.shape)]
    while len(loop) < _MAX_STOPS:
        best = (math.inf, -1, -1)
        for new in range(n):
            if new in loop or apart[new, loop].min() < 60.0:
                continue
            for k in range(len(loop)):
                a, b = loop[k], loop[(k + 1) % len(loop)]
                extra = float(drive.metres[a, new] + drive.metres[new, b] - drive.metres[a, b])
                best = min(best, (extra, new, k))
        if best[1] < 0 or not math.isfinite(best[0]):
            break
        if len(loop) >= _MIN_STOPS and (best[0] > 350.0 or _round(drive, loop) + best[0] > _MAX_LOOP):
            break
        loop.insert(best[2] + 1, best[1])
    if len(loop) < _MIN_STOPS or not math.isfinite(_round(drive, loop)):
        return []
    return [("Loop 1", loop)]


def _planned_berths(lanes: LaneGraph, seed: int) -> list[_Berth]:
    """Eight stops spread by k-means over the kerbs buses can reach (the paper's rule where no line is mapped)."""
    usable = np.flatnonzero(_usable(lanes))
    spots: list[tuple[int, float]] = []
    for lane in usable.tolist():
        for offset in np.arange(BUS_LENGTH + 2.0, lanes.length[lane] - 3.0, 10.0):
            spots.append((lane, float(offset)))
    if not spots:
        return []
    xy = lanes.at([lane for lane, _ in spots], [offset for _, offset in spots])[:, :2]
    count = min(8, len(spots))
    centres = xy[rng(seed, "transit", "stops").choice(len(xy), count, replace=False)]
    for _ in range(25):
        nearest = np.argmin(((xy[:, None] - centres[None]) ** 2).sum(2), axis=1)
        centres = np.array([xy[nearest == k].mean(0) if (nearest == k).any() else centres[k] for k in range(count)])
    chosen = sorted({int(np.argmin(((xy - centre) ** 2).sum(1))) for centre in centres})
    return [_Berth(f"planned{k}", f"Stop {k + 1}", *spots[i]) for k, i in enumerate(chosen)]


def _waiting_place(lanes: LaneGraph, walks: Walkways, height: HeightField, berth: _Berth) -> tuple[float, float, float]:
    """Where people wait: on the sidewalk beside the front door."""
    x, y, yaw = lanes.at(berth.lane, berth.offset - DOOR_BEHIND_FRONT)
    kerb = lanes.width[berth.lane] / 2 + 1.0
    xy = np.array([x + math.sin(yaw) * kerb, y - math.cos(yaw) * kerb])
    sidewalks = np.flatnonzero(walks.kind == SIDEWALK).tolist()
    lines = [shapely.LineString(walks.line(i)) for i in sidewalks]
    if lines:
        away = shapely.distance(lines, shapely.Point(xy))
        best = int(np.argmin(away))
        if 0.3 < away[best] < 4.0:
            xy = np.array(lines[best].interpolate(lines[best].project(shapely.Point(xy))).coords[0])
    return round(float(xy[0]), 3), round(float(xy[1]), 3), round(float(height(xy)), 3)


def _line(number: int, name: str, loop: list[int], drive: _Drive, stops: dict[int, Stop]) -> Line:
    lanes = drive.lanes
    chain = [drive.berths[loop[0]].lane]
    travel = [0.0]
    clock = 0.0
    for k, (a, b) in enumerate(zip(loop, loop[1:] + loop[:1], strict=True)):
        leg = drive.lanes_between(a, b)
        start, end = drive.berths[a], drive.berths[b]
        driven = [start.lane, *leg]
        seconds = sum(float(lanes.length[i] / min(lanes.speed[i], BUS_SPEED)) for i in driven)
        seconds -= start.offset / min(float(lanes.speed[start.lane]), BUS_SPEED)
        seconds -= float(lanes.length[end.lane] - end.offset) / min(float(lanes.speed[end.lane]), BUS_SPEED)
        junctions = len({int(z) for z in lanes.zone[driven] if z >= 0})
        # Drives in traffic take a quarter longer than at the limit, and every junction is waited for a little.
        clock += max(seconds, 0.0) * 1.25 + _JUNCTION_SECONDS * junctions + 4.0
        travel.append(round(clock, 1))
        clock += DWELL
        chain += leg if k < len(loop) - 1 else leg[:-1]
    around = clock
    buses = max(1, math.ceil(around / HEADWAY[1]))
    # Whole minutes, so that the timetable can be read, and little waiting at the first stop, where a bus is in the way.
    headway = int(math.ceil(max(around / buses, HEADWAY[0]) / 60.0) * 60)
    # What whole minutes leave over is spread over the drives: a bus that waits it out at one stop is in others' way.
    rest = buses * headway - around
    under_way = [t - DWELL * max(i - 1, 0) for i, t in enumerate(travel)]
    travel = [round(t + rest * share / max(under_way[-1], 1.0), 1) for t, share in zip(travel, under_way, strict=True)]
    return Line(
        id=f"line_{number}",
        name=name,
        colour=_COLOURS[number % len(_COLOURS)],
        stops=[stops[i].id for i in loop],
        lanes=[lanes.ids[i] for i in chain],
        departures=list(range(FIRST_DEPARTURE, LAST_DEPARTURE + 1, headway)),
        travel=travel,
    )


def _off_the_lanes(lanes: LaneGraph, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """A rack's place, moved from the carriageway onto the kerb where the map has it on the street."""
    for _ in range(6):
        near = lanes.nearest(xy, among=np.ones(len(lanes), bool), reach=8.0)
        if near is None:
            break
        lane, offset, away = near
        least = float(lanes.width[lane]) / 2 + 1.0
        if away >= least:
            break
        x, y, yaw = lanes.at(lane, offset)
        aside = xy - (x, y)
        # To the side it is on already; to the right of the lane where it is on its middle.
        right = np.array([math.sin(yaw), -math.cos(yaw)])
        step = aside / away if away > 0.3 else right
        xy = np.array([x, y]) + step * (least + 0.05)
    return xy


def _bike_stations(
    osm: OsmData, lanes: LaneGraph, walks: Walkways, height: HeightField, half: float, seed: int
) -> tuple[list[BikeStation], str]:
    """Mapped rental stations; where there are none, three planned ones spread along the sidewalks."""
    random = rng(seed, "transit", "bikes")
    found: list[tuple[NDArray[np.float64], str, int]] = []
    places = [(n.xy, n.tags) for n in osm.nodes]
    places += [(np.array(a.polygon.centroid.coords[0]), a.tags) for a in osm.areas if not a.polygon.is_empty]
    for xy, tags in places:
        if tags.get("amenity") == "bicycle_rental" and np.abs(xy).max() <= half - 5.0:
            size = re.match(r"\d+", tags.get("capacity", ""))
            capacity = int(np.clip(int(size.group()) if size else 12, 2, 60))
            found.append((_off_the_lanes(lanes, xy), tags.get("name") or f"Bike station {len(found) + 1}", capacity))
    origin = "osm"
    if not found:
        origin = "planned"
        sides = np.flatnonzero((walks.kind == SIDEWALK) & (walks.length > 15.0)).tolist()
        spots = np.array([shapely.LineString(walks.line(i)).interpolate(0.5, normalized=True).coords[0] for i in sides])
        if len(spots):
            chosen = [int(np.argmin((spots**2).sum(1)))]
            for _ in range(min(2, len(spots) - 1)):
                away = np.min(((spots[:, None] - spots[chosen][None]) ** 2).sum(2), axis=1)
                chosen.append(int(np.argmin(np.abs(np.sqrt(away) - half * 0.6))))
            found = [(spots[i], f"Bike station {k + 1}", 12) for k, i in enumerate(dict.fromkeys(chosen))]
    stations = [
        BikeStation(
            id=f"bikes_{k}",
            entity=FIRST_STATION + k,
            name=name,
            position=(round(float(xy[0]), 3), round(float(xy[1]), 3), round(float(height(xy)), 3)),
            capacity=capacity,
            bikes=max(1, int(capacity * random.uniform(0.4, 0.8))),
        )
        for k, (xy, name, capacity) in enumerate(found)
    ]
    return stations, origin
