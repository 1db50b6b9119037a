"""Footprints of all bodies in a step of traffic, exact tests between them, and the level that each body is on.

A body stays on the surface it came by, so its height is part of the state where a world has decks or tunnels. Kernels
compare extents in height that tell levels apart, but not the ups and downs of one street: a body on the ground has
the extent above it; a body high on a deck is above all that passes below, and a body deep in a tunnel is below all
that passes above. A body where the ground goes over into a deck or a tunnel, or on a street that leads to one, is on
both levels.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.bodies.arrays import Bodies
from vico.sim.bodies.footprints import Rectangle, point_gap, rectangle_gap, separation
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.walkways import Walkways

Floats = NDArray[np.float64]


class Shapes(NamedTuple):
    """Every body that counts in a step: vehicles, then pedestrians, then the others, arrays of shape ``(n,)``.

    Attributes
    ----------
    x, y
        Centre, ENU metres.
    yaw
        Heading, radians counter-clockwise from east.
    half_length, half_width
        Half the footprint's extents, metres.
    rounding
        Radius of a footprint's round ends, metres; 0 for rectangles: see `vico.sim.bodies.arrays.Bodies`.
    bottom, top
        Extent in height above the ground beneath it, metres.
    vx, vy
        Velocity, ENU, m/s.
    """

    x: Floats
    y: Floats
    yaw: Floats
    half_length: Floats
    half_width: Floats
    rounding: Floats
    bottom: Floats
    top: Floats
    vx: Floats
    vy: Floats


@compiled
def footprint_core(shapes, j):
    """Return the core of body j's footprint."""
    r = shapes.rounding[j]
    return Rectangle(
        shapes.x[j], shapes.y[j], np.cos(shapes.yaw[j]), np.sin(shapes.yaw[j]),
        shapes.half_length[j] - r, shapes.half_width[j] - r,
    )  # fmt: skip


@compiled
def is_disc(shapes, j):
    """Return whether body j's footprint is a disc."""
    return shapes.half_length[j] == shapes.rounding[j] == shapes.half_width[j]


@compiled
def share_level(shapes, i, j):
    """Return whether the extents in height of bodies i and j overlap."""
    return shapes.bottom[i] < shapes.top[j] and shapes.bottom[j] < shapes.top[i]


@compiled
def is_within_reach(a, b, reach):
    """Return whether two rectangles come as near to each other as `reach` metres."""
    apart = separation(a, b)
    return apart <= 0.0 or (apart <= reach and rectangle_gap(a, b) <= reach)


@compiled
def distance_to(x, y, shapes, j):
    """Return the metres from a point to the core of body j's footprint: to a disc's middle; negative inside."""
    if is_disc(shapes, j):
        dx, dy = x - shapes.x[j], y - shapes.y[j]
        return np.sqrt(dx * dx + dy * dy)
    return point_gap(x, y, footprint_core(shapes, j))


@compiled
def disc_touches(x, y, radius, shapes, j):
    """Return whether a disc touches body j."""
    reach = radius + shapes.rounding[j]
    if is_disc(shapes, j):
        dx, dy = x - shapes.x[j], y - shapes.y[j]
        return dx * dx + dy * dy <= reach * reach
    return point_gap(x, y, footprint_core(shapes, j)) <= reach


_ABOVE_ALL = 1e5  # metres
_OFF = 0.05  # metres from the ground at which somebody is on another surface
_APART = 3.3  # metres above the ground from which on a deck lets pass whatever drives below it
_REACH = 12.0  # metres: as high as extents on a deck reach, and as low as those in a tunnel
_APPROACH = 60.0  # metres before a deck or tunnel, and after it, where lanes and walkways count as part of both levels
_JUMP = 5.0  # metres: who is so far away after a step was put there


class _LevelApproaches(NamedTuple):
    """Which lanes, walkways or bodies lie on a deck or near one, and which in a tunnel or near one."""

    up: NDArray[np.bool_]
    down: NDArray[np.bool_]


class _Surfaces(NamedTuple):
    """Where bodies are (to be written to), shape ``(n, 3)``; how high ground and surface are there, shape ``(n,)``."""

    points: Floats
    ground: Floats
    z: Floats


class TrafficLevels:
    """Heights and extents of traffic's bodies, vehicles before pedestrians.

    Parameters
    ----------
    height
        The ground and its decks.
    lanes, walks
        Where traffic moves.
    heights
        Of the bodies, metres, shape ``(n,)``.
    bottoms
        How far above what it stands on each body begins, metres, shape ``(n,)``.
    """

    def __init__(
        self, height: HeightField, lanes: LaneGraph, walks: Walkways, heights: Floats, bottoms: Floats
    ) -> None:
        self._height, self._lanes, self._walks = height, lanes, walks
        self._heights, self._bottoms = heights, bottoms
        self.any = height.decks is not None
        self._has_tunnels = self.any and bool((lanes.z < height(lanes.points) - 1.0).any())
        self.z = np.zeros(len(heights) if self.any else 0)
        if self.any:
            starts, pairs = np.repeat(np.arange(len(lanes)), np.diff(lanes.next_first)), _meetings(walks)
            self._lane_leads = _level_approaches(height, lanes, starts, lanes.next)
            self._walk_leads = _level_approaches(height, walks, pairs[:, 0], pairs[:, 1])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return how high everybody is, where a world has decks: part of the state."""
        return {"levels.z": self.z} if self.any else {}

    def heights(self, xy: Floats) -> Floats:
        """Return how high bodies at their places are, metres, shape ``(n,)``."""
        return self._height.near(_points(xy, self.z)) if self.any else self._height(xy)

    def at(self, xy: Floats, who: slice) -> Floats:
        """Return how high points near some bodies are, metres: of the surface those are on."""
        return self._height.near(_points(xy, self.z[who])) if self.any else self._height(xy)

    def follow(
        self,
        before: tuple[Floats, Floats],
        xy: Floats,
        lane: tuple[NDArray[Any], NDArray[Any]],
        walkway: tuple[NDArray[Any], NDArray[Any]],
        extents: tuple[Floats, Floats],
    ) -> None:
        """Take everybody along the surface they are on, and write their extents.

        Parameters
        ----------
        before
            x and y before the step, metres, shape ``(n,)``.
        xy
            Now, metres, shape ``(n, 2)``.
        lane, walkway
            Where vehicles and pedestrians are: lanes and offsets, walkways and offsets.
        extents
            `bottom` and `top` to write, metres, shape ``(n,)``.
        """
        if not self.any:
            return
        vehicles = len(lane[0])
        jumped = np.hypot(xy[:, 0] - before[0], xy[:, 1] - before[1]) > _JUMP
        for k in jumped.nonzero()[0].tolist():
            graph, (row, offset), i = (self._lanes, lane, k) if k < vehicles else (self._walks, walkway, k - vehicles)
            own = slice(int(graph.first[row[i]]), int(graph.first[row[i] + 1]))
            self.z[k] = np.interp(offset[i], graph.along[own], graph.z[own])
        ground, points = self._height(xy), _points(xy, self.z)
        self.z[:] = self._surface(points, ground)
        on_lanes, on_walks = self._lane_leads, self._walk_leads
        leads = _LevelApproaches(
            np.concatenate([on_lanes.up[lane[0]], on_walks.up[walkway[0]]]),
            np.concatenate([on_lanes.down[lane[0]], on_walks.down[walkway[0]]]),
        )
        surfaces = _Surfaces(points, ground, self.z)
        extents[0][:], extents[1][:] = self._extents(surfaces, self._bottoms, self._heights, leads)

    def extents_of(self, bodies: Bodies) -> tuple[Floats, Floats]:
        """Return the extents of other bodies as kernels compare them, metres."""
        if not self.any or not len(bodies):
            return bodies.levels(self._height)
        points = np.array(bodies.position)
        ground = self._height(points)
        surface = self._surface(points, ground)
        bottom, top = bodies.bottom - surface, bodies.top - surface
        # Who stands is seen from both levels wherever it is not below a deck, or above a tunnel.
        leads = _LevelApproaches(bottom < _APART, np.full(len(bodies), self._has_tunnels))
        return self._extents(_Surfaces(points, ground, surface), bottom, top, leads)

    def clear(self, who: NDArray[np.int64], extents: tuple[Floats, Floats]) -> None:
        """Have some count as on every level: those that are put elsewhere in a step."""
        if self.any:
            extents[0][who], extents[1][who] = -_REACH if self._has_tunnels else 0.0, _REACH

    def _surface(self, points: Floats, ground: Floats) -> Floats:
        """Return how high the surfaces are that are nearest to points, metres, as `HeightField.near`."""
        found = ground.copy()
        if self._height.decks is not None:
            self._height.decks.heights(points, found)
        return found

    def _extents(
        self, surfaces: _Surfaces, bottom: Floats, top: Floats, leads: _LevelApproaches
    ) -> tuple[Floats, Floats]:
        points, ground, z = surfaces
        points[:, 2] = _ABOVE_ALL
        above = self._surface(points, ground) > ground + _OFF
        rise = z - ground
        on_deck = rise > _OFF
        high = on_deck & (rise >= _APART)
        both = (on_deck & ~high) | (~on_deck & leads.up & ~above)
        low, upper = np.where(high, _APART, bottom), np.where(high | both, np.maximum(_REACH, top), top)
        if not self._has_tunnels:
            return low, upper
        points[:, 2] = -_ABOVE_ALL
        below = self._surface(points, ground) < ground - _OFF
        in_tunnel = rise < -_OFF
        deep = in_tunnel & (rise <= -_APART)
        down = (in_tunnel & ~deep) | (~in_tunnel & ~on_deck & leads.down & ~below)
        return np.where(deep | down, -_REACH, low), np.where(deep, -_OFF, upper)


def _points(xy: Floats, z: Floats) -> Floats:
    """Return points of places and heights, shape ``(n, 3)``."""
    found = np.empty((len(xy), 3))
    found[:, :2], found[:, 2] = xy, z
    return found


def _level_approaches(
    height: HeightField, graph: LaneGraph | Walkways, start: NDArray[Any], end: NDArray[Any]
) -> _LevelApproaches:
    """Return which lanes or walkways count as part of a second level; `start` and `end`: which meet."""
    up, down = (_near_raised(_leaves_ground(height, graph, side), graph.length, start, end) for side in (1, -1))
    return _LevelApproaches(up, down)


def _leaves_ground(height: HeightField, graph: LaneGraph | Walkways, side: int) -> NDArray[np.bool_]:
    """Return which lanes or walkways leave the ground somewhere: upwards, or with `side` -1 downwards."""
    off = side * (graph.z - height(graph.points)) > 1.0
    rows = np.repeat(np.arange(len(graph)), np.diff(graph.first))
    return np.bincount(rows, weights=off, minlength=len(graph)) > 0


def _meetings(walks: Walkways) -> NDArray[np.int64]:
    """Return the pairs of walkways that meet, shape ``(k, 2)``."""
    pairs = [
        (a, b)
        for k in range(len(walks.meeting_first) - 1)
        for a in walks.meeting[walks.meeting_first[k] : walks.meeting_first[k + 1]].tolist()
        for b in walks.meeting[walks.meeting_first[k] : walks.meeting_first[k + 1]].tolist()
        if a != b
    ]
    return np.array(pairs, np.int64).reshape(-1, 2)


def _near_raised(
    raised: NDArray[np.bool_], length: Floats, start: NDArray[Any], end: NDArray[Any]
) -> NDArray[np.bool_]:
    """Return which lanes or walkways are raised, or lead to such in less than `_APPROACH` metres, or away from them."""
    ahead, behind = np.where(raised, 0.0, np.inf), np.where(raised, 0.0, np.inf)
    for _ in range(32):
        before = ahead.copy(), behind.copy()
        # Of the metres to a raised one, those of the ones between count.
        np.minimum.at(ahead, start, before[0][end] + np.where(raised[end], 0.0, length[end]))
        np.minimum.at(behind, end, before[1][start] + np.where(raised[start], 0.0, length[start]))
        if np.array_equal(ahead, before[0]) and np.array_equal(behind, before[1]):
            break
    return np.minimum(ahead, behind) < _APPROACH


def shapes_of(bodies: Bodies, levels: TrafficLevels) -> Shapes:
    """Return bodies as the kernels take them, their extents in height as `levels` compares them."""
    bottom, top = levels.extents_of(bodies)
    return Shapes(
        x=np.ascontiguousarray(bodies.position[:, 0]),
        y=np.ascontiguousarray(bodies.position[:, 1]),
        yaw=bodies.yaw,
        half_length=bodies.half_length,
        half_width=bodies.half_width,
        rounding=bodies.rounding,
        bottom=bottom,
        top=top,
        vx=np.ascontiguousarray(bodies.velocity[:, 0]),
        vy=np.ascontiguousarray(bodies.velocity[:, 1]),
    )
