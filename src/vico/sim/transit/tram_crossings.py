"""Where tracks cross lanes: trams go first there, take a stretch of crossings as a whole, and do not stand on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vico.exact import each
from vico.geometry import distances
from vico.sim.traffic import Traffic
from vico.sim.traffic.records import TRACK_CROSSING
from vico.sim.transit.tram_outlines import first_taken
from vico.world.lanes import LaneGraph
from vico.world.rails import ACROSS_REACH, STEP, TRAM_BRAKING, TRAM_LENGTH, Track

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_HALF_WIDTH = 1.3  # m to each side of a lane that vehicles take
_FARTHEST = 4.5  # m from a track beyond which no lane is in its way
_ALONG = 0.35  # rad: vehicles on lanes that lead the track's way drive before trams or behind them
_BEFORE, _PASSED = 1.2, 0.05  # m kept before a stretch where a tram waits; beyond that place it is on its way
_AT_BEGIN = 1.0  # m of a stretch on which somebody stands before it
_CALLS_FOR, _CALLS_FROM = 2.0, 8.0  # s, and m, beyond its braking distance from which on vehicles let a tram go first
_CREEPS, _VEHICLE = 1.0, 1.2  # m/s below which a vehicle may come to stand; half length of one at least, m
_SAMPLE = 0.5  # m between places of a lane that are looked at
_LANE_GAP, _TRACK_GAP = 6.0, 2.0  # m of lane, and of track, less than which between two crossings make them one


@dataclass(frozen=True)
class CrossedStretch:
    """A stretch of a track that lanes cross: metres along it, and the rows of its crossings."""

    start: float
    end: float
    rows: NDArray[np.int64]


class TramCrossings:
    """Has vehicles let trams go first where tracks cross lanes.

    Attributes
    ----------
    called
        Of each crossing whether a tram is there or comes: part of the state, bool, shape ``(crossings,)``.
    """

    def __init__(
        self,
        tracks: Sequence[Track],
        traffic: Traffic,
        crossed: tuple[NDArray[np.void], list[list[CrossedStretch]]] | None = None,
    ) -> None:
        crossings, self._stretches = crossed_stretches(tracks, traffic.lanes) if crossed is None else crossed
        self.called = traffic.put_tracks(crossings)
        self._tracks, self._traffic = tracks, traffic
        self._taken: NDArray[np.bool_] | None = None
        self._others = np.zeros((0, 9))

    def begin_step(self, others: NDArray[np.float64]) -> None:
        """Let nobody go first until `call_under` and `metres_to_wait` have been asked of each tram.

        Parameters
        ----------
        others
            Footprints of everybody but trams, as `first_taken` reads them.
        """
        self.called[:] = False
        self._taken, self._others = None, others

    def call_under(self, line: int, front: float, ahead: float = 0.0) -> None:
        """Keep vehicles off the stretches that a tram is on with its front at a distance along its line's track.

        Those that begin up to `ahead` metres before it are among them.
        """
        for stretch in self._stretches[line]:
            if stretch.start < front + ahead and stretch.end > front - TRAM_LENGTH:
                self.called[stretch.rows] = True

    def metres_to_wait(self, line: int, front: float, speed: float, free: float) -> float:
        """Return the metres to where a tram waits before lanes that cross its track, infinite if it need not.

        Vehicles let it go first; it waits for those that are there already, and until there is room for it beyond.

        Parameters
        ----------
        line, front, speed
            Of the tram: its line's number, metres along the track, m/s.
        free
            Metres that nobody else is on.
        """
        self.call_under(line, front, _BEFORE - _PASSED)
        reach = min(speed * speed / (2 * TRAM_BRAKING) + _CALLS_FOR * speed + _CALLS_FROM, free)
        for stretch in self._stretches[line]:
            ahead = stretch.start - _BEFORE - front
            if ahead < -_PASSED:
                continue
            if ahead > reach:
                break
            # Who stands before the tram, and would wait for it to go over the stretch first, would wait for ever.
            if self._stands(line, front, stretch.start + _AT_BEGIN) or not self._has_room(line, stretch):
                return max(ahead, 0.0)
            if self._taken is None:
                self._taken = self._traffic.crossed_tracks()
            is_taken = bool(self._taken[stretch.rows].any())
            # Who stands on one of its crossings may have to drive over the next one to leave it.
            self.called[stretch.rows] |= not (is_taken and self._stands(line, stretch.start, stretch.end))
            if is_taken:
                return max(ahead, 0.0)
        return np.inf

    def _has_room(self, line: int, stretch: CrossedStretch) -> bool:
        """Return whether no vehicle stands where a tram would stand clear of a stretch, behind it."""
        return not self._stands(line, stretch.end, stretch.end + TRAM_LENGTH + STEP)

    def _stands(self, line: int, start: float, end: float) -> bool:
        """Return whether a vehicle stands in the way of trams between two distances along a track, metres."""
        points = self._tracks[line].across[int(start / STEP) : int(end / STEP) + 1]
        stands = np.hypot(self._others[:, 7], self._others[:, 8]) < _CREEPS
        standing = self._others[stands & (self._others[:, 4] > _VEHICLE)]
        return int(first_taken(points, standing, 0, 0, ACROSS_REACH, 0.0)) < len(points)


def crossed_stretches(tracks: Sequence[Track], lanes: LaneGraph) -> tuple[NDArray[np.void], list[list[CrossedStretch]]]:
    """Find where tracks cross lanes.

    Returns
    -------
    tuple
        Crossings in the order of lanes, dtype `TRACK_CROSSING`, and the stretches of each track in the order they come.
    """
    from scipy.spatial import cKDTree

    if not len(tracks) or not len(lanes):
        return np.zeros(0, TRACK_CROSSING), [[] for _ in tracks]
    counts = np.maximum(np.ceil(lanes.length / _SAMPLE).astype(np.int64), 1) + 1
    lane = np.repeat(np.arange(len(lanes)), counts)
    step = np.arange(len(lane)) - np.repeat(np.cumsum(counts) - counts, counts)
    offset = np.minimum(step * _SAMPLE, lanes.length[lane])
    place = lanes.at(lane, offset)
    tree = cKDTree(place[:, :2])
    met = [_met(track, place, tree) for track in tracks]
    near = np.any([mask for mask, _, _ in met], axis=0)
    rows: list[tuple[int, float, float]] = []
    row_of = np.full(len(lane), -1)
    for k in np.flatnonzero(near).tolist():
        if rows and rows[-1][0] == lane[k] and offset[k] - rows[-1][2] < _LANE_GAP:
            rows[-1] = (rows[-1][0], rows[-1][1], float(offset[k]))
        else:
            rows.append((int(lane[k]), float(offset[k]), float(offset[k])))
        row_of[k] = len(rows) - 1
    crossings = np.zeros(len(rows), TRACK_CROSSING)
    for name, column in zip(("lane", "start", "end"), zip(*rows, strict=True), strict=False):
        crossings[name] = column
    return crossings, [_stretches(mask, first, last, row_of) for mask, first, last in met]


def _met(
    track: Track, place: NDArray[np.float64], tree: cKDTree
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
    """Mark the places on lanes, x, y, yaw, that are in a track's way; from where to where they are, metres along it.

    `tree` holds the places.
    """
    from scipy.spatial import cKDTree

    found = np.zeros(len(place), np.bool_)
    first, last = np.zeros(len(place)), np.zeros(len(place))
    if len(track.xy) < 2:
        return found, first, last
    way = np.gradient(track.xy, axis=0)
    yaw = each(math.atan2, way[:, 1], way[:, 0])
    # Few of a city's lanes are near the track: they are found by some of its points.
    around = tree.query_ball_point(track.xy[:: int(_FARTHEST / STEP)], 2.0 * _FARTHEST)
    near = np.unique(np.concatenate([np.asarray(part, np.int64) for part in around]))
    away, nearest = cKDTree(track.xy).query(place[near, :2], distance_upper_bound=_FARTHEST)
    near, nearest, away = (part[np.isfinite(away)] for part in (near, nearest, away))
    turn = np.abs((yaw[nearest] - place[near, 2] + np.pi) % (2 * np.pi) - np.pi)
    crosses = (turn > _ALONG) & (away <= track.half_width[nearest] + _HALF_WIDTH)
    for k, here in zip(near[crosses].tolist(), nearest[crosses].tolist(), strict=True):
        beside = slice(max(here - int(_FARTHEST / STEP), 0), here + int(_FARTHEST / STEP) + 1)
        apart = distances(track.xy[beside], place[k, :2])
        close = np.flatnonzero(apart <= track.half_width[beside] + _HALF_WIDTH) + beside.start
        found[k], first[k], last[k] = True, close[0] * STEP, close[-1] * STEP
    return found, first, last


def _stretches(
    mask: NDArray[np.bool_], first: NDArray[np.float64], last: NDArray[np.float64], row_of: NDArray[np.int64]
) -> list[CrossedStretch]:
    """Join the places in a track's way to stretches of it."""
    found: list[tuple[float, float, set[int]]] = []
    for k in sorted(np.flatnonzero(mask).tolist(), key=lambda k: (first[k], k)):
        if found and first[k] < found[-1][1] + _TRACK_GAP:
            start, end, rows = found[-1]
            found[-1] = start, max(end, float(last[k])), rows | {int(row_of[k])}
        else:
            found.append((float(first[k]), float(last[k]), {int(row_of[k])}))
    return [CrossedStretch(start, end, np.array(sorted(rows))) for start, end, rows in found]
