"""Where tracks cross, meet or lie too close for two trams: stretches that one tram at a time may be on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.exact import each
from vico.io.compiled import compiled
from vico.world.rails import STEP, TRAM_LENGTH, Track

#: Tracks nearer than this to one another, metres, are one where they lead the same way.
_SAME = 0.6
_ALIGNED = 0.5  # radians
#: Between two zones of a track there has to be room for a tram and this much more, metres, or they are one.
_ROOM = 6.0
# Points of a track that are looked at together: most of two tracks are far from each other.
_BLOCK = 64


@dataclass(frozen=True)
class TramZone:
    """A stretch of a track, metres along it, that is part of the zone with a number."""

    number: int
    start: float
    end: float


def zones_of(tracks: Sequence[Track]) -> tuple[list[list[TramZone]], int]:
    """Find the zones of several tracks.

    Returns
    -------
    tuple
        Zones of each track in the order they come, and how many there are in all.
    """
    contested = _contested(tracks)
    runs: list[tuple[int, int, int]] = []
    for k, mask in enumerate(contested):
        runs += [(k, a, b) for a, b in _runs(mask)]
    joined = _joined(tracks, runs)
    names = sorted(set(joined))
    number = {name: k for k, name in enumerate(names)}
    found: list[list[TramZone]] = [[] for _ in tracks]
    for (k, a, b), name in zip(runs, joined, strict=True):
        found[k].append(TramZone(number[name], a * STEP, b * STEP))
    return found, len(names)


def _contested(tracks: Sequence[Track]) -> list[NDArray[np.bool_]]:
    """Mark the points of each track where a tram on another one could be in the way, other than ahead of it."""
    marks = [np.zeros(len(track.xy), np.bool_) for track in tracks]
    headings, boxes = [_heading(track) for track in tracks], [_boxes(track.xy, track.half_width) for track in tracks]
    for i, one in enumerate(tracks):
        for j, other in enumerate(tracks):
            if i == j:
                continue
            nearest, away, meets = _look_across(one.xy, one.half_width, other.xy, other.half_width, boxes[j])
            k = np.flatnonzero(meets)
            turn = np.abs((headings[i][k] - headings[j][nearest[k]] + np.pi) % (2 * np.pi) - np.pi)
            marks[i][k] |= ~((away[k] < _SAME) & (turn < _ALIGNED))
    return marks


def _boxes(xy: NDArray[np.float64], half_width: NDArray[np.float64]) -> NDArray[np.float64]:
    """Boxes around each so many points: west, south, east, north, and the largest half width there and a little."""
    first = np.arange(0, len(xy), _BLOCK)
    low, high = np.minimum.reduceat(xy, first), np.maximum.reduceat(xy, first)
    return np.column_stack([low, high, np.maximum.reduceat(half_width, first) + 1e-6])


def _heading(track: Track) -> NDArray[np.float64]:
    way = np.gradient(track.xy, axis=0)
    return each(math.atan2, way[:, 1], way[:, 0])


@compiled
def _look_across(one, one_half, other, other_half, boxes):  # type: ignore[no-untyped-def]
    """Return the nearest point of another track to each one of a track, its distance, and whether trams could touch.

    `boxes` are those of the other track. Of where trams could not touch the first two say nothing.
    """
    n = len(one)
    nearest, away, meets = np.zeros(n, np.int64), np.full(n, np.inf), np.zeros(n, np.bool_)
    for i in range(n):
        best = np.inf
        x, y = one[i, 0], one[i, 1]
        for b in range(len(boxes)):
            reach = one_half[i] + boxes[b, 4]
            if x < boxes[b, 0] - reach or x > boxes[b, 2] + reach or y < boxes[b, 1] - reach or y > boxes[b, 3] + reach:
                continue
            for j in range(b * _BLOCK, min((b + 1) * _BLOCK, len(other))):
                dx, dy = x - other[j, 0], y - other[j, 1]
                square = dx * dx + dy * dy
                if square < best:
                    best, nearest[i] = square, j
                reach = one_half[i] + other_half[j]
                meets[i] |= square < reach * reach
        away[i] = np.sqrt(best)
    return nearest, away, meets


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last point of each run of marks; runs without room for a tram between them are one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    room = int((TRAM_LENGTH + _ROOM) / STEP)
    found: list[tuple[int, int]] = []
    for a, b in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
        if found and a - found[-1][1] < room:
            found[-1] = found[-1][0], b
        else:
            found.append((a, b))
    return found


def _joined(tracks: Sequence[Track], runs: Sequence[tuple[int, int, int]]) -> list[int]:
    """Give runs of several tracks that are in each other's way one name."""
    name = list(range(len(runs)))
    for p, (i, a, b) in enumerate(runs):
        for q in range(p):
            j, c, d = runs[q]
            one, other = slice(a, b + 1), slice(c, d + 1)
            here, there = tracks[i], tracks[j]
            xy, half_width = there.xy[other], there.half_width[other]
            boxes = _boxes(xy, half_width)
            _, _, meets = _look_across(here.xy[one], here.half_width[one], xy, half_width, boxes)
            if bool(meets.any()) and name[p] != name[q]:
                old, new = max(name[p], name[q]), min(name[p], name[q])
                name = [new if n == old else n for n in name]
    return name
