"""How much room a walkway has beside solids and above the edges of kerbs, and where its line bends to get past."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.world.heights import HeightField

Floats = NDArray[np.float64]
Interval = tuple[float, float]

BODY = 0.3
"""A walker's radius and a little air, metres."""

_AIR = 0.06  # metres more from lines to solids
_STEP = 0.5  # metres between the places at which a line is looked at
_GRID = 0.1  # metres between the lines that are tried
_ASIDE, _NARROW = 0.01, 0.05  # what it costs to be a metre aside at a place, and to have a metre too little room
_MOVES = (0.0, 0.1, 0.6, 1.5)  # what it costs to move by so many lines from one place to the next
_APART = 0.56  # metres of room that two need to pass each other
_EACH_WAY = 2.0  # metres before and after a narrow place that are as narrow: walkers look so far ahead
_AROUND, _TRIES = 0.6, 4  # metres left out of a line that leads through a solid, and how often that is tried
_LEAST = 0.05
_SAME = 0.02
_OFF_EDGE = 0.3  # metres that walkers' middles stay from the edges of kerbs and quays, above them
_WIDER = 0.4  # metres beyond its room that a line has on one side for what a kerb takes on the other
_BELOW, _DEEPER, _DEEPEST = (
    0.1,
    0.4,
    0.5,
)  # what it costs at a place to be too near to an edge or below, by metre, and m
_NEARER = 0.2  # metres that they come nearer to an edge where they have little room
_ROUND = 0.05  # metres to which room is rounded that a kerb leaves


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
    blocked = _blocked(points, normals, np.repeat(reach[which], counts), tree)
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
        """Return by how many metres each place across it is too near to an edge, or below it; None: none is."""
        return _depth(self.points, self.normals, bend, self.ground)


def _led_past(line: _Line, free: list[list[Interval]], bend: float, tree: shapely.STRtree) -> list[ClearCourse]:
    """Lead a line past solids, no more than `bend` metres aside; `free` is changed in place."""
    depth = line.depth(bend)
    found: list[ClearCourse] = []
    for _ in range(_TRIES):
        found = _courses(line, free, bend, depth)
        touched = _touched(found, tree)
        if not len(touched):
            break
        # A kink may lead between two cross-sections, through a solid that is in neither.
        for k in np.flatnonzero((np.abs(line.along[:, None] - touched) < _AROUND).any(axis=1)).tolist():
            free[k] = []
    return found


def _touched(courses: Sequence[ClearCourse], grown: shapely.STRtree) -> Floats:
    """Metres along the line as it was at which courses are in grown solids for more than their air."""
    found: list[float] = []
    for course in courses:
        path = shapely.LineString(course.points)
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(course.points, axis=0).T))])
        for solid in np.sort(grown.query(path, predicate="intersects")).tolist():
            part = overlay.crossing(path, grown.geometries[solid], grid=None)
            if part.length > _AROUND / 2:
                middle = float(path.project(part.centroid))
                found.append(float(np.interp(middle, along, course.offsets)))
    return np.array(found)


def _offsets(line: Floats) -> Floats:
    """Metres along a line of its points and of places between them."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    between = np.linspace(0.0, along[-1], max(int(np.ceil(along[-1] / _STEP)), 1) + 1)
    apart = np.abs(between[:, None] - along[None, :]).min(axis=1) > 0.05
    return np.sort(np.concatenate([along, between[apart]]))


def _places(line: Floats, offsets: Floats) -> tuple[Floats, Floats]:
    """Return the points at so many metres along a line, and the unit vectors to the left there."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])

    def at(metres: Floats) -> Floats:
        metres = np.clip(metres, 0.0, along[-1])
        return np.stack([np.interp(metres, along, line[:, 0]), np.interp(metres, along, line[:, 1])], axis=1)

    way = at(offsets + 0.25) - at(offsets - 0.25)
    way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
    return at(offsets), np.stack([-way[:, 1], way[:, 0]], axis=1)


def _blocked(points: Floats, normals: Floats, reach: Floats, tree: shapely.STRtree) -> dict[int, list[Interval]]:
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


def _depth(points: Floats, normals: Floats, room: float, ground: HeightField | None) -> Floats | None:
    """Return by how many metres each place across a line is too near to an edge, or below it; None: none is.

    Shape ``(places, columns)``; the columns are those of `_columns`.
    """
    if ground is None or ground.steps is None:
        return None
    across = points[:, None, :] + _columns(room)[None, :, None] * normals[:, None, :]
    depth = _OFF_EDGE - ground.edge_distance(across)
    return depth if (depth > 0.0).any() else None


def _columns(room: float) -> Floats:
    """Return how far to the left of a line it is looked at, metres: a little beyond its room."""
    steps = max(round((room + _WIDER) / _GRID), 1)
    return np.asarray(np.arange(-steps, steps + 1) * _GRID, np.float64)


def _above_edges(free: list[Interval], depth: Floats, columns: Floats, room: float) -> list[Interval]:
    """Return the parts of free intervals that are above edges and far enough from them, within what a line may take."""
    if not (depth > 0.0).any():
        return free
    good = np.concatenate([[False], depth <= 0.0, [False]])
    begins, ends = np.flatnonzero(~good[:-1] & good[1:]), np.flatnonzero(good[:-1] & ~good[1:]) - 1
    found = []
    for a, b in zip(begins.tolist(), ends.tolist(), strict=True):
        low = -np.inf if a == 0 else columns[a] - _GRID * depth[a] / (depth[a] - depth[a - 1])
        high = np.inf if b == len(columns) - 1 else columns[b] + _GRID * depth[b] / (depth[b] - depth[b + 1])
        # What a kerb takes on one side a walkway may have on the other.
        least = -room - min(max(room - high, 0.0), _WIDER)
        most = room + min(max(room + low, 0.0), _WIDER)
        for begin, end in free:
            part = max(low, begin, least), min(high, end, most)
            if part[0] < part[1]:
                found.append(part)
    return found


def _courses(line: _Line, free: list[list[Interval]], bend: float, depth: Floats | None) -> list[ClearCourse]:
    """Lead one line past its solids, no more than `bend` metres aside: in pieces, where there is no way."""
    along, room = line.along, line.room
    good = sides_good = free
    if depth is not None:
        good = [_above_edges(gaps, row, _columns(bend), bend) for gaps, row in zip(free, depth, strict=True)]
        # Walkers keep to the line's own room, however far it bends.
        own, more = _columns(room), (depth.shape[1] - len(_columns(room))) // 2
        inner = depth[:, more : more + len(own)]
        sides_good = [_above_edges(gaps, row, own, room) for gaps, row in zip(free, inner, strict=True)]
    found: list[ClearCourse] = []
    for begin, aside in _ways_through(free, good, room, bend, depth):
        here = slice(begin, begin + len(aside))
        sides = np.array(
            [_sides(free[begin + j], sides_good[begin + j], room, a) for j, a in enumerate(aside.tolist())]
        )
        near = np.abs(along[here][:, None] - along[here][None, :]) <= _EACH_WAY
        sides = np.maximum(np.where(near[:, :, None], sides[None, :, :], np.inf).min(axis=1), _LEAST)
        sides[:-1] = np.minimum(sides[:-1], sides[1:])  # from each point to the next
        moved = line.points[here] + aside[:, None] * line.normals[here]
        kept = _kept(aside, sides, line.normals[here])
        is_whole = len(aside) == len(along)
        found.append(ClearCourse(along[here][kept], moved[kept], sides[kept, :2], sides[kept, 2:], is_whole))
    return [course for course in found if len(course.points) > 1]


def _sides(free: list[Interval], good: list[Interval], room: float, aside: float) -> tuple[float, float, float, float]:
    """Return the room to the left and to the right of a line that is so far aside, and the same in need."""
    low, high = next(gap for gap in free if gap[0] <= aside <= gap[1])
    above = next((gap for gap in good if gap[0] <= aside <= gap[1]), None) if good is not free else None
    if above is None:
        return min(high, room) - aside, aside - max(low, -room), high - aside, aside - low
    # On a strip too narrow to pass on walkers come nearer to its edges.
    more = _NEARER if above[1] - above[0] < _APART else 0.0
    left, right = min(above[1] + more, high) - aside, aside - max(above[0] - more, low)
    left, right = (math.floor((side + 1e-9) / _ROUND) * _ROUND for side in (left, right))
    return left, right, high - aside, aside - low


def _ways_through(
    free: list[list[Interval]], good: list[list[Interval]], room: float, bend: float, depth: Floats | None
) -> list[tuple[int, Floats]]:
    """Choose how far to the left of a line to go at each place: for each piece, its first place and those metres.

    The way with the least cost: to go aside, to move sideways, to be where nobody can pass and below a kerb costs. Off
    its own room it leads above edges alone.
    """
    most = bend if depth is None else bend + _WIDER
    if all(any(low <= 0.0 <= high and min(high, most) - max(low, -most) >= _APART for low, high in g) for g in good):
        return [(0, np.zeros(len(free)))]
    steps = max(round(bend / _GRID), 1)
    aside = np.linspace(-bend, bend, 2 * steps + 1)
    costs = _costs(free, aside, bend)
    if depth is not None:
        # Where there is room above an edge, what is not above it costs, and how narrow it is there is the room's.
        deep = np.stack([np.interp(aside, _columns(bend), row) for row in depth])
        below = _BELOW + _DEEPER * np.clip(deep, 0.0, _DEEPEST)
        costs = np.where(deep > 0.0, costs + below, np.minimum(_costs(good, aside, most), costs + below))
        costs[(deep > 0.0) & (np.abs(aside) > room + 1e-9)] = np.inf
    moves = np.arange(-(len(_MOVES) - 1), len(_MOVES))
    prices = np.array(_MOVES)[np.abs(moves)][:, None]
    columns = np.arange(len(aside))
    beside = columns[None, :] + moves[:, None] + len(_MOVES) - 1
    padded = np.full(len(aside) + 2 * len(_MOVES) - 2, np.inf)
    pieces: list[tuple[int, Floats]] = []
    begin, came = 0, [columns]
    total = costs[0]
    for place in range(1, len(costs) + 1):
        padded[len(_MOVES) - 1 : len(_MOVES) - 1 + len(aside)] = total
        ways = padded[beside] + prices
        best = ways.argmin(axis=0)
        onward = ways[best, columns] + costs[place] if place < len(costs) else np.full(len(aside), np.inf)
        if np.isfinite(onward).any():
            total = onward
            came.append(columns + moves[best])
            continue
        if np.isfinite(total).any():
            chain = [int(np.argmin(total))]
            for back in came[:0:-1]:
                chain.append(int(back[chain[-1]]))
            pieces.append((begin, aside[chain[::-1]]))
        if place < len(costs):
            begin, came, total = place, [columns], costs[place]
    return pieces


def _costs(free: list[list[Interval]], aside: Floats, room: float) -> Floats:
    """Return what it costs to be so far aside at each place, inf in solids, shape ``(places, len(aside))``."""
    costs = np.full((len(free), len(aside)), np.inf)
    place = np.repeat(np.arange(len(free)), [len(gaps) for gaps in free])
    if not len(place):
        return costs
    low, high = np.array([gap for gaps in free for gap in gaps]).reshape(-1, 2).T[:, :, None]
    narrow = np.maximum(0.0, _APART - (np.minimum(high, room) - np.maximum(low, -room)))
    each = np.where((aside >= low) & (aside <= high), _ASIDE * np.abs(aside) + _NARROW * narrow, np.inf)
    np.minimum.at(costs, place, each)
    return costs


def _kept(aside: Floats, sides: Floats, normals: Floats) -> NDArray[np.bool_]:
    """Return the points that are needed: at ends, in bends, and where the room changes."""
    kept = np.ones(len(aside), np.bool_)
    if len(aside) > 2:
        straight = np.abs(aside[1:-1] - (aside[:-2] + aside[2:]) / 2) < 0.002
        straight &= (np.abs(normals[2:] - normals[:-2]) < 1e-6).all(axis=1)
        kept[1:-1] = ~straight | (np.abs(sides[1:-1] - sides[:-2]) > _SAME).any(axis=1)
    return kept
