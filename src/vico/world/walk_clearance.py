"""Room of walkways beside solids and above the edges of kerbs, and bends of their lines to get past.

Lines are led past solids in compiled code: a city has thousands of them. Free intervals come as `Gaps`: those of
place k are ``low[first[k]:first[k + 1]]`` to ``high[...]``, metres to the left of the line, rising.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.geometry import arc_lengths, points_along
from vico.io.compiled import compiled
from vico.world.heights import HeightField

Floats = NDArray[np.float64]
Interval = tuple[float, float]

GRID = 0.1
"""Metres between the lines that are tried."""
WIDER = 0.4
"""Metres beyond its room that a line has on one side for what a kerb takes on the other."""

_ASIDE = 0.01  # what it costs to be a metre aside at a place
_NARROW = 0.05  # ... to have a metre too little room
_MOVES = np.array([0.0, 0.1, 0.6, 1.5])  # what it costs to move by so many lines from one place to the next
_APART = 0.56  # metres of room that two need to pass each other
_EACH_WAY = 2.0  # metres before and after a narrow place that are as narrow: walkers look so far ahead
_LEAST = 0.05
_BELOW = 0.1  # what it costs at a place to be too near to an edge or below
_DEEPER = 0.4  # and what it costs more by metre
_DEEPEST = 0.5  # metres; what is deeper costs no more
_NEARER = 0.2  # metres that they come nearer to an edge where they have little room
_ROUND = 0.05  # metres to which room is rounded that a kerb leaves


class Gaps(NamedTuple):
    """Free intervals at places along a line.

    Attributes
    ----------
    first
        Where those of each place begin, int64, shape ``(places + 1,)``.
    low, high
        Metres to the left, float64, shape ``(intervals,)``.
    is_cut
        Whether an edge has a say in those of a place, shape ``(places,)``.
    """

    first: NDArray[np.int64]
    low: Floats
    high: Floats
    is_cut: NDArray[np.bool_]

    @classmethod
    def of(cls, free: Sequence[Sequence[Interval]]) -> Gaps:
        """Return lists of intervals, one a place, as arrays."""
        first = np.zeros(len(free) + 1, np.int64)
        np.cumsum([len(gaps) for gaps in free], out=first[1:])
        both = np.array([gap for gaps in free for gap in gaps], np.float64).reshape(-1, 2)
        return cls(first, both[:, 0].copy(), both[:, 1].copy(), np.zeros(len(free), np.bool_))

    def above_edges(self, depth: Floats, columns: Floats, room: float) -> Gaps:
        """Return the parts that are above edges and far enough from them, within what a line may take.

        Parameters
        ----------
        depth
            By how many metres each place across is too near to an edge, or below it, shape ``(places, columns)``.
        columns
            Where these are, metres to the left, `GRID` apart.
        room
            How far to each side the line may be.
        """
        return Gaps(*_above_edges(self, np.ascontiguousarray(depth), columns, room))


def columns_within(room: float) -> Floats:
    """Return how far to the left of a line it is looked at, metres: a little beyond its room."""
    steps = max(round((room + WIDER) / GRID), 1)
    return np.asarray(np.arange(-steps, steps + 1) * GRID, np.float64)


def ways_through(free: Gaps, good: Gaps, room: float, bend: float, depth: Floats | None) -> list[tuple[int, Floats]]:
    """Choose how far to the left of a line to go at each place: for each piece, its first place and those metres.

    The way with the least cost: to go aside, to move sideways, to be where nobody can pass and below a kerb costs. Off
    its own room it leads above edges alone.

    Parameters
    ----------
    free, good
        What is free of solids, and what of it is above edges.
    room, bend
        How far aside the line belongs, and how far it may go.
    depth
        As for `Gaps.above_edges` with the columns within `bend`; None where no edge is near.
    """
    most = bend if depth is None else bend + WIDER
    if _is_straight(good, most):
        return [(0, np.zeros(len(free.is_cut)))]
    steps = max(round(bend / GRID), 1)
    aside = np.linspace(-bend, bend, 2 * steps + 1)
    costs = _costs(free, aside, bend)
    if depth is not None:
        _above_rather(costs, _costs(good, aside, most), np.ascontiguousarray(depth), columns_within(bend), aside, room)
    begins, chosen = _cheapest(costs)
    ends = [*begins[1:].tolist(), len(costs)]
    parts = [(int(a), chosen[a:b]) for a, b in zip(begins.tolist(), ends, strict=True)]
    return [(a, aside[part[part >= 0]]) for a, part in parts if (part >= 0).any()]


@compiled
def _above_edges(free, depth, columns, room):
    places, count = depth.shape
    first = np.zeros(places + 1, np.int64)
    is_cut = np.zeros(places, np.bool_)
    # A place has no more parts than intervals and stretches of columns that are good.
    most = len(free.low) * (count // 2 + 1)
    low, high = np.empty(most), np.empty(most)
    n = 0
    for k in range(places):
        row = depth[k]
        begin, end = free.first[k], free.first[k + 1]
        is_cut[k] = (row > 0.0).any()
        if not is_cut[k]:
            for j in range(begin, end):
                low[n], high[n] = free.low[j], free.high[j]
                n += 1
            first[k + 1] = n
            continue
        a = 0
        while a < count:
            if not row[a] <= 0.0:
                a += 1
                continue
            b = a
            while b + 1 < count and row[b + 1] <= 0.0:
                b += 1
            left = -np.inf if a == 0 else columns[a] - GRID * row[a] / (row[a] - row[a - 1])
            right = np.inf if b == count - 1 else columns[b] + GRID * row[b] / (row[b] - row[b + 1])
            # What a kerb takes on one side a walkway may have on the other.
            least = -room - min(max(room - right, 0.0), WIDER)
            most_left = room + min(max(room + left, 0.0), WIDER)
            for j in range(begin, end):
                start, stop = max(left, free.low[j], least), min(right, free.high[j], most_left)
                if start < stop:
                    low[n], high[n] = start, stop
                    n += 1
            a = b + 1
        first[k + 1] = n
    return first, low[:n].copy(), high[:n].copy(), is_cut


@compiled
def _is_straight(good, most):
    """Return whether the line itself is good, and wide enough, at all places."""
    for k in range(len(good.first) - 1):
        fits = False
        for j in range(good.first[k], good.first[k + 1]):
            low, high = good.low[j], good.high[j]
            if low <= 0.0 <= high and min(high, most) - max(low, -most) >= _APART:
                fits = True
                break
        if not fits:
            return False
    return True


@compiled
def _costs(free, aside, room):
    """Return what it costs to be so far aside at each place, inf in solids, shape ``(places, len(aside))``."""
    places, count = len(free.first) - 1, len(aside)
    costs = np.full((places, count), np.inf)
    for k in range(places):
        for j in range(free.first[k], free.first[k + 1]):
            low, high = free.low[j], free.high[j]
            narrow = max(0.0, _APART - (min(high, room) - max(low, -room)))
            for c in range(count):
                if low <= aside[c] <= high:
                    costs[k, c] = min(costs[k, c], _ASIDE * abs(aside[c]) + _NARROW * narrow)
    return costs


@compiled
def _above_rather(costs, good, depth, columns, aside, room):
    """Make dearer what is not above edges; where there is room above one, how narrow it is there is the room's."""
    last = len(columns) - 1
    for k in range(len(costs)):
        row, j = depth[k], 0
        for c in range(len(aside)):
            x = aside[c]
            while j < last and columns[j + 1] <= x:
                j += 1
            if x <= columns[0]:
                deep = row[0]
            elif j == last or columns[j] == x:
                deep = row[j]
            else:
                deep = (row[j + 1] - row[j]) / (columns[j + 1] - columns[j]) * (x - columns[j]) + row[j]
            dearer = costs[k, c] + (_BELOW + _DEEPER * min(max(deep, 0.0), _DEEPEST))
            if not deep > 0.0:
                costs[k, c] = min(good[k, c], dearer)
            elif abs(x) > room + 1e-9:
                costs[k, c] = np.inf
            else:
                costs[k, c] = dearer


@compiled
def _cheapest(costs):
    """Return the places at which pieces begin, and the column of each place, -1 where no piece leads past."""
    places, count = costs.shape
    came = np.zeros((places, count), np.int64)
    chosen = np.full(places, -1)
    begins = [np.int64(0)]
    total, onward = costs[0].copy(), np.empty(count)
    widest = len(_MOVES) - 1
    for place in range(1, places + 1):
        goes_on = False
        for c in range(count):
            best, least = c, np.inf
            for other in range(max(c - widest, 0), min(c + widest, count - 1) + 1):
                way = total[other] + _MOVES[abs(other - c)]
                if way < least:
                    best, least = other, way
            onward[c] = np.inf
            if place < places:
                onward[c] = least + costs[place, c]
                came[place, c] = best
            goes_on |= np.isfinite(onward[c])
        if goes_on:
            total[:] = onward
            continue
        column = np.argmin(total)
        if np.isfinite(total[column]):
            for back in range(place - 1, begins[-1] - 1, -1):
                chosen[back] = column
                column = came[back, column]
        if place < places:
            begins.append(np.int64(place))
            total[:] = costs[place]
    return np.array(begins), chosen


@compiled
def _sides_along(free, good, along, aside, begin, room):
    count = len(aside)
    each = np.empty((count, 4))
    for k in range(count):
        each[k] = _sides(free, good, begin + k, room, aside[k])
    found = np.full((count, 4), np.inf)
    first = 0
    for k in range(count):
        here = along[begin + k]
        while here - along[begin + first] > _EACH_WAY:
            first += 1
        j = first
        while j < count and abs(along[begin + j] - here) <= _EACH_WAY:
            for side in range(4):
                found[k, side] = min(found[k, side], each[j, side])
            j += 1
    for k in range(count):
        for side in range(4):
            found[k, side] = max(found[k, side], _LEAST)
    for k in range(count - 1):
        for side in range(4):
            found[k, side] = min(found[k, side], found[k + 1, side])
    return found


@compiled
def _sides(free, good, place, room, aside):
    """Return the room to the left and to the right of a line that is so far aside, and the same in need."""
    low, high = np.nan, np.nan
    for j in range(free.first[place], free.first[place + 1]):
        if free.low[j] <= aside <= free.high[j]:
            low, high = free.low[j], free.high[j]
            break
    if good.is_cut[place]:
        for j in range(good.first[place], good.first[place + 1]):
            if good.low[j] <= aside <= good.high[j]:
                # On a strip too narrow to pass on walkers come nearer to its edges.
                more = _NEARER if good.high[j] - good.low[j] < _APART else 0.0
                left = min(good.high[j] + more, high) - aside
                right = aside - max(good.low[j] - more, low)
                left = math.floor((left + 1e-9) / _ROUND) * _ROUND
                right = math.floor((right + 1e-9) / _ROUND) * _ROUND
                return left, right, high - aside, aside - low
    return min(high, room) - aside, aside - max(low, -room), high - aside, aside - low


BODY = 0.3
"""A walker's radius and a little air, metres."""

_AIR = 0.06  # metres more from lines to solids
_STEP = 0.5  # metres between the places at which a line is looked at
_AROUND = 0.6  # metres left out of a line that leads through a solid
_TRIES = 4  # times that this is done
_SAME = 0.02
_OFF_EDGE = 0.3  # metres that walkers' middles stay from the edges of kerbs and quays, above them


@dataclass(frozen=True, eq=False)
class ClearCourse:
    """A line that leads past all solids, or a piece of one.

    Attributes
    ----------
    offsets
        Metres along the line as it was, shape ``(k,)``.
    points
        Metres, shape ``(k, 2)``.
    room, reach
        How far a walker may be to the left and to the right from each point to the next, metres, shape ``(k, 2)``.
    is_whole
        Whether it leads from one end of the line to the other.
    """

    offsets: Floats
    points: Floats
    room: Floats
    reach: Floats
    is_whole: bool


def courses_past(
    lines: Sequence[Floats],
    room: Floats,
    reach: Floats,
    solids: Sequence[shapely.Polygon],
    ground: Sequence[HeightField | None] | None = None,
) -> dict[int, list[ClearCourse]]:
    """Lead lines past solids, and along kerbs above their edges.

    Parameters
    ----------
    lines
        Centre lines of walkways, metres, each of shape ``(k, 2)``.
    room, reach
        How far to each side of its line a walker may be, and may be in need, metres, shape ``(n,)``. Lines bend no
        farther than `room`.
    solids
        Footprints nobody can walk through, metres.
    ground
        Of each line, the ground with the edges it keeps off; None for none.

    Returns
    -------
    dict
        By index, the pieces that are left of each line that has a solid within `reach`, or an edge to keep off.
    """
    grown = overlay.buffer(np.asarray(solids, object), BODY + _AIR, quad_segs=4)
    tree = shapely.STRtree(grown)
    paths = [shapely.LineString(line) for line in lines]
    near = tree.query(paths, predicate="dwithin", distance=float(reach.max()))[0]
    kept_off = [i for i, field in enumerate(ground or ()) if field is not None and field.steps is not None]
    which = np.union1d(near, np.array(kept_off, np.int64))
    offsets = [_offsets(lines[i]) for i in which]
    counts = np.array([len(o) for o in offsets], np.int64)
    if not len(counts):
        return {}
    rows = [_places(lines[i], o) for i, o in zip(which, offsets, strict=True)]
    points, normals = np.concatenate([r[0] for r in rows]), np.concatenate([r[1] for r in rows])
    blocked = _blocked_intervals(points, normals, np.repeat(reach[which], counts), tree)
    found: dict[int, list[ClearCourse]] = {}
    first = 0
    for i, along, count in zip(which.tolist(), offsets, counts.tolist(), strict=True):
        here = slice(first, first + count)
        # What is in the way at a place is so at those beside it, too: a line runs between them.
        solid = [blocked.get(k, []) for k in range(first, first + count)]
        solid = [[*b, *a, *c] for b, a, c in zip([[], *solid[:-1]], solid, [*solid[1:], []], strict=True)]
        free = [_free(gaps, float(reach[i])) for gaps in solid]
        line = _Line(along, points[here], normals[here], float(room[i]), None if ground is None else ground[i])
        first += count
        if not line.has_edges and not any(solid):
            continue
        found[i] = _led_past(line, list(free), line.room, tree)
        if not any(course.is_whole for course in found[i]):
            # Rather than end at what stands in the way, it leads round it off its own room, where that is above edges.
            beside = _led_past(line, free, float(reach[i]), tree)
            found[i] = beside if any(course.is_whole for course in beside) else found[i]
    return found


@dataclass(frozen=True)
class _Line:
    """A line to lead past solids: places along it, directions to the left there, its room, and ground with edges."""

    along: Floats
    points: Floats
    normals: Floats
    room: float
    ground: HeightField | None

    @cached_property
    def has_edges(self) -> bool:
        """Whether an edge is to be kept off within its room."""
        return self.depth(self.room) is not None

    def depth(self, bend: float) -> Floats | None:
        """Return by how many metres each place across it is too near to an edge, or below it; None: none is.

        Shape ``(places, columns)``; the columns are those of `columns_within`.
        """
        if self.ground is None or self.ground.steps is None:
            return None
        across = self.points[:, None, :] + columns_within(bend)[None, :, None] * self.normals[:, None, :]
        depth = _OFF_EDGE - self.ground.edge_distance(across)
        return depth if (depth > 0.0).any() else None


def _led_past(line: _Line, free: list[list[Interval]], bend: float, tree: shapely.STRtree) -> list[ClearCourse]:
    """Lead a line past solids, no more than `bend` metres aside; `free` is changed in place."""
    depth = line.depth(bend)
    found: list[ClearCourse] = []
    for _ in range(_TRIES):
        found = _courses(line, free, bend, depth)
        touched = _contact_distances(found, tree)
        if not len(touched):
            break
        # A kink may lead between two cross-sections, through a solid that is in neither.
        for k in np.flatnonzero((np.abs(line.along[:, None] - touched) < _AROUND).any(axis=1)).tolist():
            free[k] = []
    return found


def _contact_distances(courses: Sequence[ClearCourse], grown: shapely.STRtree) -> Floats:
    """Metres along the line as it was at which courses are in grown solids for more than their air."""
    found: list[float] = []
    for course in courses:
        path = shapely.LineString(course.points)
        along = arc_lengths(course.points)
        for solid in np.sort(grown.query(path, predicate="intersects")).tolist():
            part = overlay.crossing(path, grown.geometries[solid], grid=None)
            if part.length > _AROUND / 2:
                middle = float(path.project(part.centroid))
                found.append(float(np.interp(middle, along, course.offsets)))
    return np.array(found)


def _offsets(line: Floats) -> Floats:
    """Metres along a line of its points and of places between them."""
    along = arc_lengths(line)
    between = np.linspace(0.0, along[-1], max(int(np.ceil(along[-1] / _STEP)), 1) + 1)
    apart = np.abs(between[:, None] - along[None, :]).min(axis=1) > 0.05
    return np.sort(np.concatenate([along, between[apart]]))


def _places(line: Floats, offsets: Floats) -> tuple[Floats, Floats]:
    """Return the points at so many metres along a line, and the unit vectors to the left there."""
    along = arc_lengths(line)

    def at(metres: Floats) -> Floats:
        metres = np.clip(metres, 0.0, along[-1])
        return points_along(line, metres, along)

    way = at(offsets + 0.25) - at(offsets - 0.25)
    way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
    return at(offsets), np.stack([-way[:, 1], way[:, 0]], axis=1)


def _blocked_intervals(
    points: Floats, normals: Floats, reach: Floats, tree: shapely.STRtree
) -> dict[int, list[Interval]]:
    """Return what of the cross-sections at some points lies in solids: metres to the left, by the point's index."""
    across = shapely.linestrings(
        np.stack([points - reach[:, None] * normals, points + reach[:, None] * normals], axis=1)
    )
    section, solid = tree.query(across, predicate="intersects")
    parts = overlay.crossing(across[section], tree.geometries[solid], grid=None)
    at, pair = shapely.get_coordinates(parts, return_index=True)
    aside = ((at - points[section[pair]]) * normals[section[pair]]).sum(axis=1)
    low, high = np.full(len(section), np.inf), np.full(len(section), -np.inf)
    np.minimum.at(low, pair, aside)
    np.maximum.at(high, pair, aside)
    found: dict[int, list[Interval]] = {}
    for k, a, b in zip(section.tolist(), low.tolist(), high.tolist(), strict=True):
        if a <= b:
            found.setdefault(k, []).append((a, b))
    return found


def _free(blocked: list[Interval], reach: float) -> list[Interval]:
    """Return what is left between solids, metres to the left."""
    free, begin = [], -reach
    for low, high in sorted(blocked):
        if low > begin:
            free.append((begin, low))
        begin = max(begin, high)
    if begin < reach:
        free.append((begin, reach))
    return free


def _courses(line: _Line, free: list[list[Interval]], bend: float, depth: Floats | None) -> list[ClearCourse]:
    """Lead one line past its solids, no more than `bend` metres aside: in pieces, where there is no way."""
    along, room = line.along, line.room
    good = sides_good = gaps = Gaps.of(free)
    if depth is not None:
        good = gaps.above_edges(depth, columns_within(bend), bend)
        # Walkers keep to the line's own room, however far it bends.
        own = columns_within(room)
        more = (depth.shape[1] - len(own)) // 2
        sides_good = gaps.above_edges(depth[:, more : more + len(own)], own, room)
    found: list[ClearCourse] = []
    for begin, aside in ways_through(gaps, good, room, bend, depth):
        here = slice(begin, begin + len(aside))
        sides = np.asarray(_sides_along(gaps, sides_good, along, aside, begin, room), np.float64)
        moved = line.points[here] + aside[:, None] * line.normals[here]
        kept = _needed_points(aside, sides, line.normals[here])
        is_whole = len(aside) == len(along)
        found.append(ClearCourse(along[here][kept], moved[kept], sides[kept, :2], sides[kept, 2:], is_whole))
    return [course for course in found if len(course.points) > 1]


def _needed_points(aside: Floats, sides: Floats, normals: Floats) -> NDArray[np.bool_]:
    """Return the points that are needed: at ends, in bends, and where the room changes."""
    kept = np.ones(len(aside), np.bool_)
    if len(aside) > 2:
        straight = np.abs(aside[1:-1] - (aside[:-2] + aside[2:]) / 2) < 0.002
        straight &= (np.abs(normals[2:] - normals[:-2]) < 1e-6).all(axis=1)
        kept[1:-1] = ~straight | (np.abs(sides[1:-1] - sides[:-2]) > _SAME).any(axis=1)
    return kept
