"""How much room a walkway has beside solids and above the edges of kerbs, and where its line bends to get past."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.geometry import arc_lengths, points_along
from vico.world.clear_lines import Floats, Gaps, Interval, columns_within, sides_along, ways_through
from vico.world.heights import HeightField

BODY = 0.3
"""A walker's radius and a little air, metres."""

_AIR = 0.06  # metres more from lines to solids
_STEP = 0.5  # metres between the places at which a line is looked at
_AROUND, _TRIES = 0.6, 4  # metres left out of a line that leads through a solid, and how often that is tried
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

    Shape ``(places, columns)``; the columns are those of `columns_within`.
    """
    if ground is None or ground.steps is None:
        return None
    across = points[:, None, :] + columns_within(room)[None, :, None] * normals[:, None, :]
    depth = _OFF_EDGE - ground.edge_distance(across)
    return depth if (depth > 0.0).any() else None


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
        sides = sides_along(gaps, sides_good, along, aside, begin, room)
        moved = line.points[here] + aside[:, None] * line.normals[here]
        kept = _kept(aside, sides, line.normals[here])
        is_whole = len(aside) == len(along)
        found.append(ClearCourse(along[here][kept], moved[kept], sides[kept, :2], sides[kept, 2:], is_whole))
    return [course for course in found if len(course.points) > 1]


def _kept(aside: Floats, sides: Floats, normals: Floats) -> NDArray[np.bool_]:
    """Return the points that are needed: at ends, in bends, and where the room changes."""
    kept = np.ones(len(aside), np.bool_)
    if len(aside) > 2:
        straight = np.abs(aside[1:-1] - (aside[:-2] + aside[2:]) / 2) < 0.002
        straight &= (np.abs(normals[2:] - normals[:-2]) < 1e-6).all(axis=1)
        kept[1:-1] = ~straight | (np.abs(sides[1:-1] - sides[:-2]) > _SAME).any(axis=1)
    return kept
