"""The network of trams: outlines of trams, crossings of tracks with lanes, signals, and zones of one tram at a time.

All that never changes is made once a world (`TramNetwork`). Trams go first where tracks cross lanes, take a stretch of
crossings as a whole, and do not stand on it. They obey the signals of the lanes beside their tracks that go their way.
Where tracks cross, meet or lie too close for two trams, one tram at a time is let in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.exact import dot, each
from vico.geometry import distances
from vico.io.compiled import compiled
from vico.rules import TRAM_SECTION, TRAM_WIDTH
from vico.sim.bodies.arrays import Bodies
from vico.sim.traffic import Traffic
from vico.sim.traffic.state import DARK, GREEN, TRACK_CROSSING
from vico.world.lanes import LaneGraph
from vico.world.transit import ACROSS_REACH, STEP, TRAM_BRAKING, TRAM_LENGTH, Track, TramLine
from vico.world.walkways import CORNER, CROSSING, Walkways

if TYPE_CHECKING:
    from scipy.spatial import cKDTree
_BESIDE = 9.0  # m from a track within which lanes begin whose signals count for it
_SAME_WAY = 0.8  # rad between a lane and the track
_ENTRY = 15.0  # m along a track within which the stop lines of one junction lie that is entered
_BEFORE_STOP_LINE = 1.0  # m before its stop line that a tram stands


class TramSignal(NamedTuple):
    """A signal that trams on a track obey: metres along it to the stop line, and the lane whose signal it is."""

    place: float
    lane: int


def signals_of(tracks: Sequence[Track], lanes: LaneGraph) -> list[list[TramSignal]]:
    """Find the signals of several tracks, in the order they come; none where no lane goes their way.

    Of a junction, or of several that count as one, the first signal counts: who is in it clears it.
    """
    return [_signals_beside(track, lanes) for track in tracks]


def metres_to_signal(signals: Sequence[TramSignal], front: float, speed: float, light: NDArray[np.uint8]) -> float:
    """Return the metres a tram may go before the next signal that stops it; infinite without one.

    Who could not stop before it any more, as gently as trams do, drives on.

    Parameters
    ----------
    signals
        Of its track.
    front, speed
        Metres along the track, m/s.
    light
        What the signal of each lane shows.
    """
    for signal in signals:
        ahead = signal.place - _BEFORE_STOP_LINE - front
        if ahead < -_BEFORE_STOP_LINE or light[signal.lane] in (DARK, GREEN):
            continue
        if speed * speed / (2 * TRAM_BRAKING) <= ahead + 0.3 + 0.1 * speed:
            return max(ahead, 0.0)
    return np.inf


def _signals_beside(track: Track, lanes: LaneGraph) -> list[TramSignal]:
    if len(track.xy) < 2:
        return []
    heading = np.gradient(track.xy, axis=0)
    # By junction: place, whether the lane leaves the track again, metres between both, lane.
    found: dict[int, list[tuple[float, bool, float, int]]] = {}
    for lane in np.unique(lanes.lights.lane).tolist():
        line = lanes.line(lane)
        near, away, turn = _beside(track.xy, heading, line[0], line[1] - line[0])
        if away > _BESIDE or turn > _SAME_WAY or near in (0, len(track.xy) - 1):
            continue
        _, leaves, end_turn = _beside(track.xy, heading, line[-1], line[-1] - line[-2])
        parts = leaves > _BESIDE or end_turn > _SAME_WAY
        found.setdefault(int(lanes.zone[lane]), []).append((near * STEP, parts, away, lane))
    chosen = []
    for entries in found.values():
        first = min(entries)[0]
        place, _, _, lane = min((e for e in entries if e[0] < first + _ENTRY), key=lambda e: e[1:])
        chosen.append(TramSignal(place, lane))
    return sorted(chosen)


def _beside(
    xy: NDArray[np.float64], heading: NDArray[np.float64], point: NDArray[np.float64], way: NDArray[np.float64]
) -> tuple[int, float, float]:
    """Return the point of a track that is nearest to another one, its distance, and the angle to a way there, rad."""
    apart = np.hypot(*(xy - point).T)
    k = int(np.argmin(apart))
    across, along = heading[k, 0] * way[1] - heading[k, 1] * way[0], float(dot(heading[k], way))
    return k, float(apart[k]), abs(math.atan2(across, along))


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
    contested = _conflict_marks(tracks)
    runs: list[tuple[int, int, int]] = []
    for k, mask in enumerate(contested):
        runs += [(k, a, b) for a, b in _runs(mask)]
    joined = _zones_of_runs(tracks, runs)
    names = sorted(set(joined))
    number = {name: k for k, name in enumerate(names)}
    found: list[list[TramZone]] = [[] for _ in tracks]
    for (k, a, b), name in zip(runs, joined, strict=True):
        found[k].append(TramZone(number[name], a * STEP, b * STEP))
    return found, len(names)


def _conflict_marks(tracks: Sequence[Track]) -> list[NDArray[np.bool_]]:
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
def _look_across(one, one_half, other, other_half, boxes):
    """Return the nearest point of another track to each one of a track, its distance, and whether trams could touch.

    `boxes` are those of the other track. Of where trams could not touch the first two say nothing.
    """
    n = len(one)
    nearest, away, meets = np.zeros(n, np.int64), np.full(n, np.inf), np.zeros(n, np.bool_)
    for i in range(n):
        best = np.inf
        x, y = one[i, 0], one[i, 1]
        for b in range(len(boxes)):
            west, south, east, north, widest = boxes[b]
            reach = one_half[i] + widest
            if x < west - reach or x > east + reach or y < south - reach or y > north + reach:
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


def _zones_of_runs(tracks: Sequence[Track], runs: Sequence[tuple[int, int, int]]) -> list[int]:
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


_NOWHERE = 1e9  # metres, x of who is not there
# Columns of footprints, as `footprint_rows` has them.
_HALF_LENGTH = 4
_VELOCITY = slice(7, 9)
# Points on a section's sides and ends, 0.25 m apart: nobody of 0.25 m reaches in between them, `_TOUCH` kept, unseen.
_ALONG, _ACROSS = 35, 11


def footprint_rows(bodies: Bodies) -> NDArray[np.float64]:
    """Return footprints as `first_obstructed` reads them.

    Returns
    -------
    ndarray
        x, y, cosine and sine of yaw, half length and half width of the core, rounding, and velocity to the east and to
        the north, shape ``(n, 9)``.
    """
    round_off = bodies.rounding
    columns = (
        bodies.position[:, 0], bodies.position[:, 1], np.cos(bodies.yaw), np.sin(bodies.yaw),
        bodies.half_length - round_off, bodies.half_width - round_off, round_off,
    )  # fmt: skip
    return np.column_stack([*columns, bodies.velocity])


def absent_footprints(n: int) -> NDArray[np.float64]:
    """Return the footprints of `n` who are not there, for `stand` to fill; as from `packed`."""
    found = np.zeros((n, 9))
    found[:, 0] = _NOWHERE
    return found


@compiled
def place_sections(poses, inside, half_length, half_width, speed, footprints):
    """Write the footprints of a tram's sections, shape ``(n, 9)``; those out of the city are nowhere."""
    for k in range(len(poses)):
        c, s = np.cos(poses[k, 2]), np.sin(poses[k, 2])
        x = poses[k, 0] if inside[k] else _NOWHERE
        footprints[k] = x, poses[k, 1], c, s, half_length, half_width, 0.0, speed * c, speed * s


@compiled
def inside_city(poses, half):
    """Return which sections reach into a city `half` metres to each side, by x, y, yaw of middles."""
    found = np.zeros(len(poses), np.bool_)
    reach = TRAM_SECTION / 2
    for k in range(len(poses)):
        u, v = reach * np.cos(poses[k, 2]), reach * np.sin(poses[k, 2])
        x, y = poses[k, 0], poses[k, 1]
        found[k] = max(abs(x + u), abs(y + v)) < half or max(abs(x - u), abs(y - v)) < half
    return found


@compiled
def section_outlines(poses, inside):
    """Return points around each section that is in the city, shape ``(n, points, 2)``."""
    half, wide = TRAM_SECTION / 2, TRAM_WIDTH / 2
    found = np.empty((inside.sum(), 2 * (_ALONG + _ACROSS), 2))
    row = 0
    for k in range(len(poses)):
        if not inside[k]:
            continue
        c, s = np.cos(poses[k, 2]), np.sin(poses[k, 2])
        for i in range(2 * (_ALONG + _ACROSS)):
            if i < 2 * _ALONG:
                u = -half + 2 * half * (i % _ALONG) / (_ALONG - 1)
                v = -wide if i < _ALONG else wide
            else:
                j = i - 2 * _ALONG
                u = -half if j < _ACROSS else half
                v = -wide + 2 * wide * (j % _ACROSS) / (_ACROSS - 1)
            found[row, i, 0] = poses[k, 0] + c * u - s * v
            found[row, i, 1] = poses[k, 1] + s * u + c * v
        row += 1
    return found


def holds_somebody(poses: NDArray[np.float64], footprints: NDArray[np.float64]) -> bool:
    """Return whether the middle of a footprint lies in a section, by x, y, yaw: who is wholly in it touches no edge."""
    dx, dy = footprints[:, 0, None] - poses[:, 0], footprints[:, 1, None] - poses[:, 1]
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    within = (np.abs(dx * c + dy * s) < TRAM_SECTION / 2) & (np.abs(dy * c - dx * s) < TRAM_WIDTH / 2)
    return bool(within.any())


@compiled
def first_obstructed(points, bodies, skip, skipped, within, soon):
    """Return the first row of `points`, shape ``(n, k, 2)``, near a footprint now or in `soon` seconds; n for none.

    Bodies from `skip` on, `skipped` of them, are left out.
    """
    found, n = len(points), len(points)
    if n == 0:
        return found
    reach = 0.0
    for i in (0, n - 1):
        for k in range(points.shape[1]):
            reach = max(reach, abs(points[i, k, 0] - points[0, 0, 0]) + abs(points[i, k, 1] - points[0, 0, 1]))
    reach = 1.5 * reach + 16.0
    for j in range(len(bodies)):
        if skip <= j < skip + skipped:
            continue
        x, y, c, s, half, wide, rounding, vx, vy = bodies[j]
        if abs(x - points[0, 0, 0]) > reach + half or abs(y - points[0, 0, 1]) > reach + half:
            continue
        for moment in range(2):
            if moment == 1 and (soon == 0.0 or vx * vx + vy * vy < 0.09):
                break
            bx, by = x + moment * soon * vx, y + moment * soon * vy
            for i in range(found):
                for k in range(points.shape[1]):
                    dx, dy = points[i, k, 0] - bx, points[i, k, 1] - by
                    u = max(abs(dx * c + dy * s) - half, 0.0)
                    v = max(abs(dy * c - dx * s) - wide, 0.0)
                    if u * u + v * v < (within + rounding) ** 2:
                        found = i
                        break
                if found == i:
                    break
    return found


@compiled
def spots_near(line, points, reach):
    """Return how many spots along a line, at every metre, are within reach of one of the points."""
    found, begins = 0, 0.0
    spot = 0.5
    for k in range(len(line) - 1):
        dx, dy = line[k + 1, 0] - line[k, 0], line[k + 1, 1] - line[k, 1]
        length = np.sqrt(dx * dx + dy * dy)
        while spot < begins + length:
            x = line[k, 0] + dx * (spot - begins) / length
            y = line[k, 1] + dy * (spot - begins) / length
            for i in range(len(points)):
                if (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 < reach[i] * reach[i]:
                    found += 1
                    break
            spot += 1.0
        begins += length
    return found


def people_in_way(points: NDArray[np.float64], people: NDArray[np.float64], within: float) -> NDArray[np.bool_]:
    """Return who of people, by x and y of each, is near one of `points`, shape ``(n, k, 2)``."""
    near = points.reshape(-1, 2)
    away = np.hypot(people[:, 0, None] - near[:, 0], people[:, 1, None] - near[:, 1])
    return np.asarray((away < within).any(axis=1), np.bool_)


_HALF_WIDTH = 1.3  # m to each side of a lane that vehicles take
_FARTHEST = 4.5  # m from a track beyond which no lane is in its way
_PARALLEL_ANGLE = 0.35  # rad: vehicles on lanes that lead the track's way drive before trams or behind them
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
            Footprints of everybody but trams, as `first_obstructed` reads them.
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
        stands = np.hypot(*self._others[:, _VELOCITY].T) < _CREEPS
        standing = self._others[stands & (self._others[:, _HALF_LENGTH] > _VEHICLE)]
        return int(first_obstructed(points, standing, 0, 0, ACROSS_REACH, 0.0)) < len(points)


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
    met = [_conflict_points(track, place, tree) for track in tracks]
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


def _conflict_points(
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
    crosses = (turn > _PARALLEL_ANGLE) & (away <= track.half_width[nearest] + _HALF_WIDTH)
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


_WALKER = 0.25  # m beside a tram that walkers keep
_ON_TRACK, _CORNER_ON_TRACK = 6, 10  # metres on a track that make a sidewalk part of it; corners lead over two tracks


class TramNetwork:
    """What never changes about the trams of a city. Its parts are made the first time somebody asks for them.

    Parameters
    ----------
    lines
        In their order.
    lanes, walks
        What traffic moves on.
    """

    def __init__(self, lines: Sequence[TramLine], lanes: LaneGraph, walks: Walkways) -> None:
        self.lines = list(lines)
        self._lanes, self._walks = lanes, walks

    @cached_property
    def tracks(self) -> list[Track]:
        """The track of each line."""
        return [Track(line.track) for line in self.lines]

    @cached_property
    def zones(self) -> tuple[list[list[TramZone]], int]:
        """Zones of each track, and how many there are in all; see `zones_of`."""
        return zones_of(self.tracks)

    @cached_property
    def crossings(self) -> tuple[NDArray[np.void], list[list[CrossedStretch]]]:
        """Where tracks cross lanes; see `crossed_stretches`."""
        return crossed_stretches(self.tracks, self._lanes)

    @cached_property
    def signals(self) -> list[list[TramSignal]]:
        """Signals of each track; see `signals_of`."""
        return signals_of(self.tracks, self._lanes)

    @cached_property
    def walkways_on_tracks(self) -> NDArray[np.bool_]:
        """The walkways, other than crossings, that lie on a track, bool; nobody may write to it."""
        walks = self._walks
        found = np.zeros(len(walks), np.bool_)
        if self.tracks:
            points = np.concatenate([track.xy for track in self.tracks])
            reach = np.concatenate([track.half_width for track in self.tracks]) + _WALKER
            ways = np.flatnonzero(walks.kind != CROSSING).tolist()
            lines = [np.ascontiguousarray(walks.line(k), np.float64) for k in ways]
            for k, line, near in zip(ways, lines, _points_around(lines, points, float(reach.max())), strict=True):
                most = _CORNER_ON_TRACK if walks.kind[k] == CORNER else _ON_TRACK
                found[k] = len(near) > 0 and spots_near(line, points[near], reach[near]) >= most
        found.setflags(write=False)
        return found


def _points_around(
    lines: Sequence[NDArray[np.float64]], points: NDArray[np.float64], within: float
) -> list[NDArray[np.int64]]:
    """Return which points lie in the rectangle around each line, rising, and some metres beyond."""
    low = np.array([line[:, :2].min(axis=0) for line in lines]).reshape(-1, 2) - within
    high = np.array([line[:, :2].max(axis=0) for line in lines]).reshape(-1, 2) + within
    which, near = shapely.STRtree(shapely.points(points[:, :2])).query(shapely.box(*low.T, *high.T))
    order = np.lexsort((near, which))
    starts = np.searchsorted(which[order], np.arange(len(lines) + 1))
    return [near[order[a:b]] for a, b in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)]
