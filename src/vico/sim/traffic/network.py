"""The network that traffic moves on, made from the lanes and walkways of a world, with its stop lines.

Stop lines are farther back where a bus that turns there sweeps over the end of a lane; real ones are set back for the
same reason. Without it a bus and the queue at the end of another lane stand head to head for good: the queue cannot
back up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.assets.vehicles import vehicle_size
from vico.sim.traffic.path import PATH_POINT
from vico.sim.traffic.state import LANE, SPOT, STOPPING_PLACE, TRACK_CROSSING, WALKWAY, LaneNetwork, WalkwayNetwork
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.objects import Objects
from vico.world.walkways import CROSSING, Walkways, walkways_past

Floats = NDArray[np.float64]

#: m before a junction at which a vehicle stops that may not enter it.
BEFORE_JUNCTION = 0.6
_FARTHEST, _STEP = 6.5, 0.5  # m a stop line is set back at most (vehicles ask for a junction 8 m before it), and by
_BESIDE, _AROUND = 0.95, 0.2  # half width of a car, m, and what a bus keeps from it
_CAR = 5.0  # m
_SAMPLE = 1.0  # m between places of a bus
_RUN = 14.0  # m of street before and after a junction that a bus's axles are still on while it turns


def stop_lines(lanes: LaneGraph, routes: Sequence[Sequence[int]]) -> Floats:
    """Find where vehicles stop before junctions.

    Parameters
    ----------
    routes
        Closed sequences of lane numbers that buses drive.

    Returns
    -------
    ndarray
        Metres before each lane's end, shape ``(lanes,)``.
    """
    found = np.full(len(lanes), BEFORE_JUNCTION)
    into: dict[int, set[int]] = {}
    for lane in np.flatnonzero(lanes.zone < 0).tolist():
        for after in lanes.following(lane):
            if lanes.zone[after] >= 0:
                into.setdefault(int(lanes.zone[after]), set()).add(lane)
    passages = {passage for route in routes for passage in _passages(lanes, route)}
    for passage in sorted(passages):
        swept = _swept(lanes, passage)
        for lane in sorted(into.get(int(lanes.zone[passage[1]]), ())):
            if lane != passage[0]:
                found[lane] = max(found[lane], _set_back(lanes, lane, swept))
    return found


def _passages(lanes: LaneGraph, route: Sequence[int]) -> list[tuple[int, ...]]:
    """Return the ways of a round through junctions: a street lane, the lanes of one junction, a street lane."""
    count, found = len(route), []
    for k, lane in enumerate(route):
        if lanes.zone[lane] >= 0 or lanes.zone[route[(k + 1) % count]] < 0:
            continue
        passage = [lane]
        while lanes.zone[route[(k + len(passage)) % count]] >= 0 and len(passage) < count:
            passage.append(route[(k + len(passage)) % count])
        found.append((*passage, route[(k + len(passage)) % count]))
    return found


def _swept(lanes: LaneGraph, passage: Sequence[int]) -> shapely.Geometry:
    """Return what a bus drives over on its way through a junction: its axles follow its lanes."""
    length, width, _, overhang, wheelbase = vehicle_size("bus")
    pieces = [lanes.line(passage[0]), *(lanes.line(k)[1:] for k in passage[1:])]
    line = shapely.LineString(np.concatenate(pieces))
    begin = float(lanes.length[passage[0]])
    inside = float(lanes.length[list(passage[1:-1])].sum())
    front = np.arange(begin, min(begin + inside + _RUN, line.length), _SAMPLE)
    axles = [shapely.get_coordinates(shapely.line_interpolate_point(line, np.maximum(front - overhang - back, 0.0)))
             for back in (0.0, wheelbase)]  # fmt: skip
    along = axles[0] - axles[1]
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-6)[:, None]
    bodies = shapely.linestrings(
        np.stack([axles[0] + overhang * along, axles[0] + (overhang - length) * along], axis=1)
    )
    return shapely.union_all(shapely.buffer(bodies, width / 2 + _AROUND, cap_style="flat"))


def _set_back(lanes: LaneGraph, lane: int, swept: shapely.Geometry) -> float:
    """Return the metres before a lane's end where a car stands clear of a bus; the usual ones if none are enough."""
    for back in np.arange(BEFORE_JUNCTION, _FARTHEST, _STEP).tolist():
        front = float(lanes.length[lane]) - back
        if front < _CAR + 1.0:
            break
        ends = lanes.at(np.array([lane, lane]), np.array([front, front - _CAR]))[:, :2]
        if not shapely.LineString(ends).buffer(_BESIDE, cap_style="flat").intersects(swept):
            return back
    return BEFORE_JUNCTION


#: Of a map: west, south, east, north, metres.
Edges = tuple[float, float, float, float]

_U_TURN, _TURN = 2.6, 0.6  # rad
_BORDER = 6.0  # how far from the outermost point of the streets the map's edge counts as reached, m
_LEAST_WALK = 60.0  # m of connected sidewalk that are worth walking along
_CONFLICT = 1.45  # m to each side of a lane's centre line that a turning car takes
_CAR_HALF_WIDTH = 0.9  # m of what a car takes of its lane
_CROSSING_MARGIN = 0.3  # m beside a crossing and beyond its ends that count as part of it
_PAST_CROSSING = 0.5  # m beyond a crossing at which a rear has left it


@dataclass(frozen=True)
class TrafficNetwork:
    """What all traffic of a world moves on; never changes.

    Attributes
    ----------
    lanes
        The world's lanes.
    walks
        Its walkways that can be walked along: clear of solids, without scraps.
    driven, walked
        Both as kernels take them; `driven` without routes of buses.
    starts, entries
        Lanes cars can stand on at the start, and those they come back in on.
    poles
        Objects of the world on which signals are seen.
    """

    lanes: LaneGraph
    walks: Walkways
    driven: LaneNetwork
    walked: WalkwayNetwork
    starts: NDArray[np.int64]
    entries: NDArray[np.int32]
    poles: Objects

    @classmethod
    def of(
        cls,
        lanes: LaneGraph,
        solids: Sequence[shapely.Polygon] = (),
        poles: Objects | None = None,
        ground: HeightField | None = None,
        edges: Edges | None = None,
        *,
        kept_as: str = "",
    ) -> TrafficNetwork:
        """Make the network of a world's lanes.

        Parameters
        ----------
        solids
            Footprints nobody walks through.
        poles
            Objects on which signals are seen.
        ground
            The ground with its kerbs, above whose edges people walk where they can; None for none.
        edges
            Where the map ends: west, south, east and north, metres; None for a square, which ends where the outermost
            of its streets do.
        kept_as
            Digest of the city that the ground is of: walkways are found once for it; empty where they are not kept.
        """
        walks = connected_walkways(walkways_past(lanes.walks, solids, ground, kept_as=kept_as))
        driven = _lane_network(lanes, walks, edges)
        starts = lanes_to_start_on(lanes, driven, edges)
        return cls(lanes, walks, driven, walkway_network(walks), *starts, poles or Objects.none())

    @cached_property
    def conflicts(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """`conflict_first` and `conflict` of `LaneNetwork`: which lanes of a junction cars cannot drive at once."""
        lanes = self.lanes
        inside = np.flatnonzero(lanes.zone >= 0)
        swept = shapely.buffer([shapely.LineString(lanes.line(int(i))) for i in inside], _CONFLICT, cap_style="flat")
        a, b = shapely.STRtree(swept).query(swept, predicate="intersects") if len(inside) else np.zeros((2, 0), int)
        a, b = np.concatenate([inside[a], inside]), np.concatenate([inside[b], inside])
        a, b = np.unique(np.stack([a, b])[:, lanes.zone[a] == lanes.zone[b]], axis=1)
        first = np.zeros(len(lanes) + 1, np.int32)
        first[1:] = np.cumsum(np.bincount(a, minlength=len(lanes)))
        return first, b.astype(np.int32)

    def with_routes(self, routes: Sequence[Sequence[int]], *, shared: bool = False) -> LaneNetwork:
        """Return the lanes as kernels take them, with the lane numbers of each bus route's round.

        Parameters
        ----------
        shared
            Whether several vehicles may be in a junction: which lanes are in each other's way counts only then.
        """
        conflicts = self.conflicts if shared else (self.driven.conflict_first, self.driven.conflict)
        first = np.zeros(len(routes) + 1, np.int32)
        first[1:] = np.cumsum([len(route) for route in routes])
        driven = self.driven.lanes.copy()
        driven["stop_line"] = stop_lines(self.lanes, routes)
        return self.driven._replace(
            lanes=driven,
            conflict_first=conflicts[0],
            conflict=conflicts[1],
            route_first=first,
            route=np.array([lane for route in routes for lane in route], np.int32),
        )


def _lane_network(lanes: LaneGraph, walks: Walkways, edges: Edges | None) -> LaneNetwork:
    """Return the lanes as kernels take them; `walks` have the crossings they run over."""
    crossings_first, crossings, cleared = _crossings_of_lanes(lanes, walks)
    leaves = (lanes.inside < 0) & _at_border(lanes, lanes.first[1:] - 1, edges)
    n = np.arange(len(lanes))
    turn = lanes.at(n, lanes.length)[:, 2] - lanes.at(n, 0.0)[:, 2]
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    u_turn = (lanes.inside >= 0) & (np.abs(turn) > _U_TURN)
    records = np.zeros(len(lanes), LANE)
    for name, values in {
        "first_point": lanes.first[:-1],
        "end_point": lanes.first[1:],
        "length": lanes.length,
        "speed": lanes.speed,
        "junction": lanes.zone,
        "inside": lanes.inside,
        "edge": lanes.edge,
        "closed": _closed_to_cars(lanes, leaves, u_turn),
        "left": lanes.left,
        "right": lanes.right,
        "first_next": lanes.next_first[:-1],
        "end_next": lanes.next_first[1:],
        "first_crossing": crossings_first[:-1],
        "end_crossing": crossings_first[1:],
        "u_turn": u_turn,
        "turn": np.where((lanes.inside >= 0) & (np.abs(turn) > _TURN), np.sign(turn), 0),
        "leaves": leaves,
        "stop_line": BEFORE_JUNCTION,
    }.items():
        records[name] = values
    return LaneNetwork(
        lanes=records,
        points=lanes.points,
        along=lanes.along,
        kerb_points=lanes.points,
        next=lanes.next,
        conflict_first=np.zeros(len(lanes) + 1, np.int32),
        conflict=np.zeros(0, np.int32),
        crossings=crossings,
        crossings_cleared=cleared,
        route_first=np.zeros(1, np.int32),
        route=np.zeros(0, np.int32),
        goal_edge=np.zeros(0, np.int32),
        goal_next=np.zeros((0, len(lanes)), np.int32),
        places=np.zeros(0, STOPPING_PLACE),
        way_points=np.zeros(0, PATH_POINT),
        tracks=np.zeros(0, TRACK_CROSSING),
    )


def walkway_network(walks: Walkways) -> WalkwayNetwork:
    """Return the walkways as kernels take them."""
    records = np.zeros(len(walks), WALKWAY)
    for name, values in {
        "length": walks.length,
        "kind": walks.kind,
        "start": walks.ends[:, 0],
        "end": walks.ends[:, 1],
    }.items():
        records[name] = values
    nodes = max(len(walks.meeting_first) - 1, 1)
    return WalkwayNetwork(
        walkways=records,
        first=walks.first,
        points=walks.points,
        along=walks.along,
        room=np.ascontiguousarray(np.concatenate([walks.room, walks.reach], axis=1)),
        meeting_first=walks.meeting_first,
        meeting=walks.meeting,
        goal_walkway=np.zeros(0, np.int32),
        goal_away=np.zeros((0, nodes)),
        spots=np.zeros(0, SPOT),
        spot_first=np.zeros(len(walks) + 1, np.int32),
    )


def connected_walkways(walks: Walkways) -> Walkways:
    """Return the walkways without the scraps of sidewalk too small to walk along."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    if not len(walks):
        return walks
    nodes = len(walks.meeting_first) - 1
    graph = csr_matrix((np.ones(len(walks), np.int8), (walks.ends[:, 0], walks.ends[:, 1])), shape=(nodes, nodes))
    _, part = connected_components(graph, directed=False)
    size = np.bincount(part[walks.ends[:, 0]], weights=walks.length)
    return walks.without(size[part[walks.ends[:, 0]]] < _LEAST_WALK)


def lanes_to_start_on(
    lanes: LaneGraph, net: LaneNetwork, edges: Edges | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return the lanes cars can stand on at the start, and those they come back in on: where the map begins."""
    usable = (lanes.inside < 0) & ~net.lanes["closed"] & (np.diff(lanes.next_first) > 0) & (lanes.length > 12.0)
    usable &= ~net.lanes["leaves"]
    starts = np.flatnonzero(usable & (lanes.zone < 0))
    entries = np.flatnonzero(usable & _at_border(lanes, lanes.first[:-1], edges)).astype(np.int32)
    return starts, entries if len(entries) else starts.astype(np.int32)


def _closed_to_cars(lanes: LaneGraph, leaves: NDArray[np.bool_], u_turn: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the lanes cars keep off: those of buses, and pockets that lead neither off the map nor back.

    Cars that found the way into such a pocket would gather there. That one could turn back in it does not count, unless
    there is nothing else to do: cars go on as long as they can.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    n = len(lanes)
    if not n:
        return np.zeros(0, bool)
    a, b = np.repeat(np.arange(n), np.diff(lanes.next_first)), lanes.next
    driven = ~(lanes.buses_only[a] | lanes.buses_only[b])
    a, b = a[driven], b[driven]
    onward = np.bincount(a, weights=~u_turn[b], minlength=n) > 0
    taken = ~(u_turn[b] & onward[a])
    a, b = a[taken], b[taken]
    _, part = connected_components(csr_matrix((np.ones(len(a)), (a, b)), shape=(n, n)), connection="strong")
    streets = part == np.argmax(np.bincount(part, weights=lanes.length * ~lanes.buses_only))
    # Backwards from one more node, which stands for having got out.
    out = np.flatnonzero((leaves | streets) & ~lanes.buses_only)
    starts, ends = np.concatenate([b, np.full(len(out), n)]), np.concatenate([a, out])
    back = csr_matrix((np.ones(len(starts)), (starts, ends)), shape=(n + 1, n + 1))
    closed = np.ones(n + 1, bool)
    closed[breadth_first_order(back, n, return_predecessors=False)] = False
    return closed[:n]


def _at_border(lanes: LaneGraph, point: NDArray[np.int32], edges: Edges | None) -> NDArray[np.bool_]:
    """Return which points (one a lane) lie where the map cuts the streets off."""
    x, y = lanes.points[point, 0], lanes.points[point, 1]
    if edges is None:
        reach = np.abs(lanes.points).max(initial=0.0)
        edges = -reach, -reach, reach, reach
    west, south, east, north = edges
    inside = (x >= west + _BORDER) & (y >= south + _BORDER) & (x <= east - _BORDER) & (y <= north - _BORDER)
    return np.asarray(~inside, np.bool_)


def _crossings_of_lanes(
    lanes: LaneGraph, walks: Walkways
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    """Return where each lane's crossings begin, and `crossings` and `crossings_cleared` of `LaneNetwork`."""
    crossings = np.flatnonzero(walks.kind == CROSSING)
    areas = [
        shapely.LineString(walks.line(int(c))).buffer(walks.width[c] / 2 + _CROSSING_MARGIN, cap_style="square")
        for c in crossings
    ]
    lines = [shapely.LineString(lanes.line(i)) for i in range(len(lanes))]
    rows: list[list[tuple[int, float]]] = [[] for _ in range(len(lanes))]
    if areas:
        tree = shapely.STRtree(areas)
        for i, line in enumerate(lines):
            swept = line.buffer(_CAR_HALF_WIDTH, cap_style="flat")
            for k in np.sort(tree.query(swept, predicate="intersects")).tolist():
                part = areas[k].intersection(line)
                ends = [line.project(shapely.Point(p)) for p in shapely.get_coordinates(part)] or [line.length]
                rows[i].append((int(crossings[k]), max(ends) + _PAST_CROSSING))
    first = np.zeros(len(lanes) + 1, np.int32)
    first[1:] = np.cumsum([len(row) for row in rows])
    flat = [pair for row in rows for pair in row]
    return first, np.array([c for c, _ in flat], np.int32), np.array([u for _, u in flat], np.float64)
