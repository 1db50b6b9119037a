"""When pedestrians are off the crossing that they walked over: vehicles wait for who is on it."""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled
from vico.sim.traffic.follow_point import room_at
from vico.sim.traffic.path import project_on_polyline
from vico.sim.traffic.records import NONE

#: Of a pedestrian's body, m.
RADIUS = 0.25
_OFF_CROSSING = 1.3  # m walked after which the body is off the crossing
_AT_END = 0.3  # m from the end of a crossing from which on one stands at the kerb


@compiled
def project_on_walkway(paths, walkway, x, y):  # type: ignore[no-untyped-def]
    """Return the metres along a walkway of its point nearest to (x, y), and how far left of it that is."""
    begin, end = paths.first[walkway], paths.first[walkway + 1]
    return project_on_polyline(paths.points, paths.along, begin, end, x, y)


@compiled
def _is_off_crossing(paths, crossing, x, y):  # type: ignore[no-untyped-def]
    """Return whether (x, y) is at an end of a crossing, or beside it."""
    along, aside = project_on_walkway(paths, crossing, x, y)
    way = paths.walkways[crossing]
    is_at_end = min(along, way.length - along) < _AT_END
    room = room_at(paths, crossing, along)
    return is_at_end or not -room[3] - RADIUS < aside < room[2] + RADIUS


@compiled
def _metres_beyond(paths, end, before, x, y):  # type: ignore[no-untyped-def]
    """Return how far (x, y) is beyond the line's point number `end`, as seen from the one `before`."""
    dx, dy = paths.points[end, 0] - paths.points[before, 0], paths.points[end, 1] - paths.points[before, 1]
    along = (x - paths.points[end, 0]) * dx + (y - paths.points[end, 1]) * dy
    return along / np.sqrt(dx * dx + dy * dy)


@compiled
def _is_past_end(paths, crossing, x, y):  # type: ignore[no-untyped-def]
    """Return whether who is at (x, y) is beyond an end of a crossing, clear of it."""
    first, last = paths.first[crossing], paths.first[crossing + 1] - 1
    return max(_metres_beyond(paths, first, first + 1, x, y), _metres_beyond(paths, last, last - 1, x, y)) > RADIUS


@compiled
def leave_crossing(paths, walker, junctions, x, y):  # type: ignore[no-untyped-def]
    """Note who is off the crossing it was on: the metres alone do not tell, as one may walk to and fro there.

    Nor is who stands beyond its end on it: vehicles would wait for a companion who waits there for them.
    """
    left = walker.leaving_crossing
    if left < 0:
        return
    has_walked = walker.distance_walked - walker.leaving_since > _OFF_CROSSING
    if (has_walked or _is_past_end(paths, left, x, y)) and _is_off_crossing(paths, left, x, y):
        junctions.walkers_on[left] -= 1
        walker.leaving_crossing = NONE
