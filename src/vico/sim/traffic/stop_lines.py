"""Where vehicles stop before junctions: farther back where a bus that turns there sweeps over the end of their lane.

Real stop lines are set back for the same reason. Without it a bus and the queue at the end of another lane stand head
to head for good: the queue cannot back up.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.assets.vehicles import vehicle_size
from vico.world.lanes import LaneGraph

Floats = NDArray[np.float64]

#: m before a junction at which a vehicle stops that may not enter it.
BEFORE_JUNCTION = 0.6
_FARTHEST, _STEP = 6.5, 0.5  # m a stop line is set back at most (vehicles ask for a junction 8 m before it), and by
_BESIDE, _AROUND = 0.95, 0.2  # half width of a car, m, and what a bus keeps from it
_CAR = 5.0  # m
_SAMPLE = 1.0  # m between places of a bus
_RUN = 14.0  # m of street before and after a junction that a bus's axles are still on while it turns


def stop_lines(lanes: LaneGraph, routes: Sequence[Sequence[int]]) -> Floats:
    """Find where vehicles stop before junctions.

    Parameters
    ----------
    routes
        Closed sequences of lane numbers that buses drive.

    Returns
    -------
    ndarray
        Metres before each lane's end, shape ``(lanes,)``.
    """
    found = np.full(len(lanes), BEFORE_JUNCTION)
    into: dict[int, set[int]] = {}
    for lane in np.flatnonzero(lanes.zone < 0).tolist():
        for after in lanes.following(lane):
            if lanes.zone[after] >= 0:
                into.setdefault(int(lanes.zone[after]), set()).add(lane)
    passages = {passage for route in routes for passage in _passages(lanes, route)}
    for passage in sorted(passages):
        swept = _swept(lanes, passage)
        for lane in sorted(into.get(int(lanes.zone[passage[1]]), ())):
            if lane != passage[0]:
                found[lane] = max(found[lane], _set_back(lanes, lane, swept))
    return found


def _passages(lanes: LaneGraph, route: Sequence[int]) -> list[tuple[int, ...]]:
    """Return the ways of a round through junctions: a street lane, the lanes of one junction, a street lane."""
    count, found = len(route), []
    for k, lane in enumerate(route):
        if lanes.zone[lane] >= 0 or lanes.zone[route[(k + 1) % count]] < 0:
            continue
        passage = [lane]
        while lanes.zone[route[(k + len(passage)) % count]] >= 0 and len(passage) < count:
            passage.append(route[(k + len(passage)) % count])
        found.append((*passage, route[(k + len(passage)) % count]))
    return found


def _swept(lanes: LaneGraph, passage: Sequence[int]) -> shapely.Geometry:
    """Return what a bus drives over on its way through a junction: its axles follow its lanes."""
    length, width, _, overhang, wheelbase = vehicle_size("bus")
    pieces = [lanes.line(passage[0]), *(lanes.line(k)[1:] for k in passage[1:])]
    line = shapely.LineString(np.concatenate(pieces))
    begin = float(lanes.length[passage[0]])
    inside = float(lanes.length[list(passage[1:-1])].sum())
    front = np.arange(begin, min(begin + inside + _RUN, line.length), _SAMPLE)
    axles = [shapely.get_coordinates(shapely.line_interpolate_point(line, np.maximum(front - overhang - back, 0.0)))
             for back in (0.0, wheelbase)]  # fmt: skip
    along = axles[0] - axles[1]
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-6)[:, None]
    bodies = shapely.linestrings(
        np.stack([axles[0] + overhang * along, axles[0] + (overhang - length) * along], axis=1)
    )
    return shapely.union_all(shapely.buffer(bodies, width / 2 + _AROUND, cap_style="flat"))


def _set_back(lanes: LaneGraph, lane: int, swept: shapely.Geometry) -> float:
    """Return the metres before a lane's end where a car stands clear of a bus; the usual ones if none are enough."""
    for back in np.arange(BEFORE_JUNCTION, _FARTHEST, _STEP).tolist():
        front = float(lanes.length[lane]) - back
        if front < _CAR + 1.0:
            break
        ends = lanes.at(np.array([lane, lane]), np.array([front, front - _CAR]))[:, :2]
        if not shapely.LineString(ends).buffer(_BESIDE, cap_style="flat").intersects(swept):
            return back
    return BEFORE_JUNCTION
