"""Where a line goes between solids and above the edges of kerbs, in compiled code: a city has thousands of lines.

Free intervals come as `Gaps`: those of place k are ``low[first[k]:first[k + 1]]`` to ``high[...]``, metres to the left
of the line, rising.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

Floats = NDArray[np.float64]
Interval = tuple[float, float]

GRID = 0.1
"""Metres between the lines that are tried."""
WIDER = 0.4
"""Metres beyond its room that a line has on one side for what a kerb takes on the other."""

_ASIDE, _NARROW = 0.01, 0.05  # what it costs to be a metre aside at a place, and to have a metre too little room
_MOVES = np.array([0.0, 0.1, 0.6, 1.5])  # what it costs to move by so many lines from one place to the next
_APART = 0.56  # metres of room that two need to pass each other
_EACH_WAY = 2.0  # metres before and after a narrow place that are as narrow: walkers look so far ahead
_LEAST = 0.05
# What it costs at a place to be too near to an edge or below, by metre, and metres.
_BELOW, _DEEPER, _DEEPEST = 0.1, 0.4, 0.5
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


def sides_along(free: Gaps, good: Gaps, along: Floats, aside: Floats, begin: int, room: float) -> Floats:
    """Return the room to the left and to the right of a piece of a line, and the same in need, metres.

    Parameters
    ----------
    free, good
        As for `ways_through`, `good` within the line's own room.
    along, aside
        Metres along and to the left of the line at its places.
    begin
        Place of the line that is the piece's first.

    Returns
    -------
    ndarray
        From each of its places to the next, float64, shape ``(places, 4)``.
    """
    return np.asarray(_sides_along(free, good, along, aside, begin, room), np.float64)


@compiled
def _above_edges(free, depth, columns, room):  # type: ignore[no-untyped-def]
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
def _is_straight(good, most):  # type: ignore[no-untyped-def]
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
def _costs(free, aside, room):  # type: ignore[no-untyped-def]
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
def _above_rather(costs, good, depth, columns, aside, room):  # type: ignore[no-untyped-def]
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
def _cheapest(costs):  # type: ignore[no-untyped-def]
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
def _sides_along(free, good, along, aside, begin, room):  # type: ignore[no-untyped-def]
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
def _sides(free, good, place, room, aside):  # type: ignore[no-untyped-def]
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
