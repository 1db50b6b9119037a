"""Which signals trams obey: those of the lanes beside their tracks that go their way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.exact import dot
from vico.sim.traffic.records import DARK, GREEN
from vico.world.lanes import LaneGraph
from vico.world.rails import STEP, TRAM_BRAKING, Track

_BESIDE = 9.0  # m from a track within which lanes begin whose signals count for it
_SAME_WAY = 0.8  # rad between a lane and the track
_ENTRY = 15.0  # m along a track within which the stop lines of one junction lie that is entered
_BEFORE = 1.0  # m before its stop line that a tram stands


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
        ahead = signal.place - _BEFORE - front
        if ahead < -_BEFORE or light[signal.lane] in (DARK, GREEN):
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
