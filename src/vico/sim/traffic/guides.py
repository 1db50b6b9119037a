"""Ways to the goals of those whose route is given: which lane or walkway leads on, from wherever they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from vico.errors import InputError
from vico.sim.traffic.placed import Point
from vico.sim.traffic.records import NONE
from vico.sim.traffic.state import LaneNetwork, WalkwayNetwork
from vico.world.lanes import LaneGraph
from vico.world.walkways import SIDEWALK, Walkways

_REACH = 10.0  # m from a point to its lane or sidewalk


def lane_at(lanes: LaneGraph, net: LaneNetwork, point: Point, where: str) -> tuple[int, float]:
    """Return the street lane nearest to a point that cars use, and the metres along it.

    Raises
    ------
    InputError
        If there is none within reach.
    """
    found = lanes.nearest(point, (lanes.inside < 0) & ~net.lanes["closed"], _REACH)
    if found is None:
        raise InputError(f"{where}: no lane for cars within {_REACH:g} m of {list(point)}")
    return found[0], found[1]


def walkway_at(walks: Walkways, point: Point, where: str) -> tuple[int, float]:
    """Return the sidewalk nearest to a point, and the metres along it.

    Raises
    ------
    InputError
        If there is none within reach.
    """
    import shapely

    ways = np.flatnonzero(walks.kind == SIDEWALK)
    lines = [shapely.LineString(walks.line(int(way))) for way in ways]
    away = shapely.distance(lines, shapely.Point(point)) if lines else np.full(1, np.inf)
    best = int(np.argmin(away))
    if away[best] > _REACH:
        raise InputError(f"{where}: no sidewalk within {_REACH:g} m of {list(point)}")
    return int(ways[best]), float(shapely.line_locate_point(lines[best], shapely.Point(point)))


def guided_lanes(
    lanes: LaneGraph, net: LaneNetwork, starts: Sequence[int], routes: Sequence[Sequence[int]]
) -> LaneNetwork:
    """Return the network with the ways to the streets of some lanes, each along the shortest.

    Parameters
    ----------
    starts, routes
        Lane of each car, and lanes over whose streets it is to drive.

    Raises
    ------
    InputError
        If no way leads on from one to the next.
    """
    n = len(lanes)
    from_, to = np.repeat(np.arange(n), np.diff(lanes.next_first)), lanes.next
    open_ = ~(net.lanes["closed"][from_] | net.lanes["closed"][to])
    # Backwards: from a lane to those that lead into it.
    back = csr_matrix((lanes.length[from_[open_]] + 0.01, (to[open_], from_[open_])), shape=(n, n))
    lead: list[NDArray[np.int32]] = []
    for k, (start, route) in enumerate(zip(starts, routes, strict=True)):
        reaches = np.ones(n, np.bool_)
        ways: list[NDArray[np.int32]] = []
        for i in range(len(route) - 1, -1, -1):
            # Only lanes from which there is a way to the next goal, without changing lanes.
            ends = np.flatnonzero((lanes.edge == lanes.edge[route[i]]) & ~net.lanes["closed"] & reaches)
            if not len(ends):
                raise InputError(f"traffic: cars.{k}.route.{i + 1}: no way for cars leads there")
            away, onward, _ = dijkstra(back, indices=ends, min_only=True, return_predecessors=True)
            ways.insert(0, np.where(onward >= 0, onward, NONE).astype(np.int32))
            reaches = np.isfinite(away)
        if not reaches[start]:
            raise InputError(f"traffic: cars.{k}.route.0: no way for cars leads there")
        lead += ways
    edges = np.array([lanes.edge[goal] for route in routes for goal in route], np.int32)
    return net._replace(goal_edge=edges, goal_next=np.array(lead, np.int32).reshape(len(edges), n))


def guided_walks(
    walks: Walkways, paths: WalkwayNetwork, goals: Sequence[int], *, shut: NDArray[np.bool_] | None = None
) -> WalkwayNetwork:
    """Return the network with how far it is from each meeting point to some walkways, without those that are shut."""
    nodes = len(walks.meeting_first) - 1
    away = np.full((len(goals), max(nodes, 1)), np.inf)
    if goals:
        open_ = np.ones(len(walks), np.bool_) if shut is None else ~shut
        ends = walks.ends[open_]
        graph = csr_matrix((walks.length[open_] + 0.01, (ends[:, 0], ends[:, 1])), shape=(nodes, nodes))
        for k, goal in enumerate(goals):
            away[k] = dijkstra(graph, directed=False, indices=walks.ends[goal], min_only=True)
    return paths._replace(goal_walkway=np.asarray(goals, np.int32), goal_away=away)
