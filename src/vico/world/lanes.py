"""The road network as arrays: lanes that vehicles drive, and the sidewalks, crossings and corners that people walk.

Read from SUMO's `roads.net.xml` (https://sumo.dlr.de/docs/Networks/SUMO_Road_Networks.html). Metres, local ENU.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from vico.io.compiled import compiled
from vico.world.signals import Signals
from vico.world.walkways import Walkways

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class LaneGraph:
    """Lanes that vehicles drive, the lanes through junctions among them.

    Attributes
    ----------
    ids
        SUMO lane ids; index in this list = lane number everywhere else.
    edge
        Number of the street (one direction) a lane belongs to, int32, shape ``(n,)``; names in `edges`.
    first, points, along
        Lane ``i``'s centre line is ``points[first[i]:first[i + 1]]``, shape ``(p, 2)``; `along` holds the metres from
        the lane's start at each of its points.
    z
        How high the lanes' points lie, metres, shape ``(p,)``: on the ground, on a deck or in a tunnel.
    length, width, speed
        Metres and metres a second, shape ``(n,)``.
    inside
        Number of the junction a lane lies in, -1 for street lanes, int32.
    zone
        Number of the junction cluster whose single occupant a vehicle on the lane must be, -1 elsewhere, int32.
    buses_only
        True where cars may not drive.
    left, right
        Neighbour lanes in the same direction, towards the middle of the street and towards its kerb, -1 for none,
        int32; where traffic keeps left the sides are the other way round.
    lefthand
        Whether traffic keeps left.
    lights
        What signals let vehicles and people into junctions, and by which programs.
    next_first, next, previous_first, previous
        Lanes that follow and precede lane ``i``: ``next[next_first[i]:next_first[i + 1]]``.
    junctions, junction_position, signals
        Junction ids, their places, shape ``(m, 2)``, and whether they have signals.
    zones
        Number of junction clusters.
    walks
        Where people walk.
    """

    ids: list[str]
    edges: list[str]
    edge: Ints
    first: Ints
    points: Floats
    along: Floats
    z: Floats
    length: Floats
    width: Floats
    speed: Floats
    inside: Ints
    zone: Ints
    buses_only: NDArray[np.bool_]
    left: Ints
    right: Ints
    next_first: Ints
    next: Ints
    previous_first: Ints
    previous: Ints
    junctions: list[str]
    junction_position: Floats
    signals: NDArray[np.bool_]
    zones: int
    walks: Walkways
    lefthand: bool = False
    lights: Signals = field(default_factory=Signals.none)

    def __len__(self) -> int:
        return len(self.ids)

    @cached_property
    def index(self) -> dict[str, int]:
        """Lane number by id."""
        return {lane: i for i, lane in enumerate(self.ids)}

    def line(self, lane: int) -> Floats:
        """Centre line of a lane, metres, shape ``(k, 2)``."""
        return self.points[self.first[lane] : self.first[lane + 1]]

    def following(self, lane: int) -> Ints:
        """Lanes that follow a lane."""
        return self.next[self.next_first[lane] : self.next_first[lane + 1]]

    def preceding(self, lane: int) -> Ints:
        """Lanes that lead into a lane."""
        return self.previous[self.previous_first[lane] : self.previous_first[lane + 1]]

    def at(self, lane: ArrayLike, offset: ArrayLike) -> Floats:
        """Poses along lanes.

        Parameters
        ----------
        lane, offset
            Lane numbers and metres from their starts, shape ``(n,)`` (or scalars).

        Returns
        -------
        ndarray
            x, y, yaw, shape ``(n, 3)`` (or ``(3,)``).
        """
        lanes, offsets = np.broadcast_arrays(np.asarray(lane, np.int32), np.asarray(offset, np.float64))
        out = _poses(self.first, self.points, self.along, np.atleast_1d(lanes).copy(), np.atleast_1d(offsets).copy())
        return out if lanes.ndim else out[0]

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree([shapely.LineString(self.line(i)) for i in range(len(self))])

    def nearest(
        self, xy: ArrayLike, among: NDArray[np.bool_] | None = None, reach: float = 60.0
    ) -> tuple[int, float, float] | None:
        """Return the street lane whose centre line is nearest to a point.

        Parameters
        ----------
        xy
            A point, metres.
        among
            Which lanes count, bool, shape ``(n,)``; street lanes that are not inside a junction where not given.
        reach
            Metres beyond which nothing is found.

        Returns
        -------
        tuple of int, float, float, or None
            Lane, metres along it, metres away from it.
        """
        allowed = self.inside < 0 if among is None else among
        point = shapely.Point(float(np.asarray(xy)[0]), float(np.asarray(xy)[1]))
        hits = np.sort(self._tree.query(point, predicate="dwithin", distance=reach))
        hits = hits[allowed[hits]]
        if not len(hits):
            return None
        lines = self._tree.geometries[hits]
        away = shapely.distance(lines, point)
        best = int(np.argmin(away))
        return int(hits[best]), float(shapely.line_locate_point(lines[best], point)), float(away[best])

    @cached_property
    def component(self) -> Ints:
        """Number of the strongly connected part each lane belongs to, int32; 0 = the longest. Bus lanes count too."""
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import connected_components

        n = len(self)
        graph = csr_matrix((np.ones(len(self.next), np.int8), self.next, self.next_first), shape=(n, n))
        _, labels = connected_components(graph, directed=True, connection="strong")
        sizes = np.bincount(labels, weights=self.length)
        rank = np.argsort(-sizes, kind="stable")
        renamed = np.empty(len(rank), np.int32)
        renamed[rank] = np.arange(len(rank), dtype=np.int32)
        return renamed[labels]


@compiled
def lane_pose(first, points, along, lane, offset):  # type: ignore[no-untyped-def]
    """x, y, yaw at `offset` metres along a lane; beyond its ends, on along the end's direction."""
    low, high = first[lane], first[lane + 1] - 1
    a, b = low, high
    while b - a > 1:
        middle = (a + b) // 2
        if along[middle] <= offset:
            a = middle
        else:
            b = middle
    dx, dy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    length = along[b] - along[a]
    share = (offset - along[a]) / length
    return points[a, 0] + dx * share, points[a, 1] + dy * share, np.arctan2(dy, dx)


@compiled
def _poses(first, points, along, lane, offset):  # type: ignore[no-untyped-def]
    out = np.empty((len(lane), 3))
    for i in range(len(lane)):
        out[i, 0], out[i, 1], out[i, 2] = lane_pose(first, points, along, lane[i], offset[i])
    return out
