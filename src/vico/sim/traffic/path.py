"""The path ahead of a vehicle, its outline along that path, and its motion on it.

A vehicle's path is laid once a step as a small polyline. Following it and sweeping the outline along it then needs
nothing else.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vico.io.compiled import compiled, inlined
from vico.sim.traffic.state import BACKING_IN, NONE, PREVIOUS_LANES

#: A point of a path: x, y (ENU metres) and `s`, metres from the start of the lane the vehicle is on.
PATH_POINT = np.dtype([("x", np.float64), ("y", np.float64), ("s", np.float64)])
PATH_POINTS = 768  # points a path can have
LANE_CHANGE = 12.0  # metres a lane change takes, and the vehicle's length more
STRAIGHT = 2.0  # metres that all of a vehicle drives straight between two lane changes

_SQUEEZE_AFTER = 6.0  # s stood after which a vehicle squeezes past people at the kerb
_PERSON_GAP, _SQUEEZE_GAP = 0.3, 0.05  # m kept sideways from people


class Outline(NamedTuple):
    """A vehicle's outline and where it is across its path; metres.

    Attributes
    ----------
    length, half_width, overhang, wheelbase
        As in `VehicleParameters`.
    lateral_offset
        Where a lane change under way began, to the left of the path; 0 without one.
    change_done
        Metres of that lane change that were done at s = 0 of the path.
    change_length
        Metres it takes; less than 0: the lane is left for a place beside it, and `change_done` is less so many metres.
    person_gap
        Distance kept sideways from people.
    """

    length: float
    half_width: float
    overhang: float
    wheelbase: float
    lateral_offset: float
    change_done: float
    change_length: float
    person_gap: float


@compiled
def vehicle_outline(vehicle):
    """Return a vehicle's outline on its path."""
    return Outline(
        vehicle.length,
        vehicle.half_width,
        vehicle.overhang,
        vehicle.wheelbase,
        vehicle.lateral_offset,
        vehicle.lane_change_distance - vehicle.offset,
        vehicle.lane_change_length,
        _PERSON_GAP if vehicle.stopped_time < _SQUEEZE_AFTER else _SQUEEZE_GAP,
    )


@compiled
def end_of_lane_change(vehicle):
    """Return the metres a vehicle drives from where it begins to change lanes until it may change again."""
    return vehicle.lane_change_length + STRAIGHT + vehicle.length


@compiled
def changing_lane(outline, lateral_offset, change_done):
    """Return the outline of the same vehicle with another lane change (none: 0, 0)."""
    return Outline(
        outline.length, outline.half_width, outline.overhang, outline.wheelbase,
        lateral_offset, change_done, LANE_CHANGE + outline.length, outline.person_gap,
    )  # fmt: skip


@compiled
def line_points(net, vehicle):
    """Return the points of the lines that a vehicle follows, shape ``(p, 2)``: the lanes' middles, or at the kerb."""
    return net.kerb_points if vehicle.is_bicycle else net.points


@compiled
def _append_lane(net, points, lane, base, path, count):
    """Add a lane that starts at s = `base` to the first `count` points of a path; return their number then."""
    last = path[count - 1].s if count > 0 else -1e18
    for p in range(net.lanes[lane].first_point, net.lanes[lane].end_point):
        s = base + net.along[p]
        if s > last + 1e-6 and count < len(path):
            path[count].x, path[count].y, path[count].s = points[p, 0], points[p, 1], s
            count += 1
            last = s
    return count


@compiled
def lane_polyline(net, points, lane, buffer):
    """Lay the path along one lane's `line_points` into `buffer` and return the part of it that is used."""
    return buffer[: _append_lane(net, points, lane, 0.0, buffer, 0)]


@inlined
def path_polyline(net, vehicle, behind, ahead, buffer):
    """Lay a vehicle's path, from `behind` metres before its lane's start to `ahead` metres after it, into `buffer`.

    Returns
    -------
    ndarray
        The part of `buffer` that is used, dtype `PATH_POINT`.
    """
    points = line_points(net, vehicle)
    k = 0
    base = 0.0
    while k < PREVIOUS_LANES and vehicle.previous_lanes[k] != NONE and -base < behind:
        base -= net.lanes[vehicle.previous_lanes[k]].length
        k += 1
    count = 0
    for back in range(k - 1, -1, -1):
        lane = vehicle.previous_lanes[back]
        count = _append_lane(net, points, lane, base, buffer, count)
        base += net.lanes[lane].length
    count = _append_lane(net, points, vehicle.lane, 0.0, buffer, count)
    base = net.lanes[vehicle.lane].length
    for k in range(vehicle.planned_count):
        if base > ahead:
            break
        lane = vehicle.planned_lanes[k]
        count = _append_lane(net, points, lane, base, buffer, count)
        base += net.lanes[lane].length
    return buffer[:count]


@compiled
def point_on_path(path, s):
    """Return x, y and the direction (not of unit length) at `s` on a path; beyond its ends, straight on."""
    return _point_between(path, _stretch_at(path, s, 0), s)


@compiled
def _point_between(path, a, s):
    """As `point_on_path`, where the stretch from point a of the path to the next is that of `s`."""
    b = a + 1
    dx, dy, size = path[b].x - path[a].x, path[b].y - path[a].y, path[b].s - path[a].s
    share = (s - path[a].s) / size
    return path[a].x + dx * share, path[a].y + dy * share, dx, dy


@compiled
def _stretch_at(path, s, a):
    """Return the stretch of a path on which `s` is, by its first point; it is no farther back than stretch a."""
    while a + 2 < len(path) and path[a + 1].s <= s:
        a += 1
    return a


@compiled
def _lateral_offset(outline, s):
    """Return the metres to the left of its path that a vehicle's point at `s` is, during a lane change."""
    share = min(max((outline.change_done + s) / outline.change_length, 0.0), 1.0)
    return outline.lateral_offset * (1.0 - share * share * (3.0 - 2.0 * share))


@compiled
def footprint(path, outline, front):
    """Return centre x, y and heading cosine, sine of a vehicle whose front is at s = `front`: its axles follow."""
    return footprint_between(path, outline, front, axles_at(path, outline, front, (0, 0)))


@compiled
def axles_at(path, outline, front, before):
    """Return on which stretches of the path its axles are, front then rear; where it was `before`, or farther on."""
    a = front - outline.overhang
    return _stretch_at(path, a, before[0]), _stretch_at(path, a - outline.wheelbase, before[1])


@compiled
def footprint_between(path, outline, front, at):
    """As `footprint`, with its axles on stretches that are known: see `axles_at`."""
    a = front - outline.overhang
    b = a - outline.wheelbase
    ax, ay, adx, ady = _point_between(path, at[0], a)
    bx, by, bdx, bdy = _point_between(path, at[1], b)
    if outline.lateral_offset != 0.0:
        size = np.sqrt(adx * adx + ady * ady)
        off = _lateral_offset(outline, a) / size
        ax, ay = ax - ady * off, ay + adx * off
        size = np.sqrt(bdx * bdx + bdy * bdy)
        off = _lateral_offset(outline, b) / size
        bx, by = bx - bdy * off, by + bdx * off
    dx, dy = ax - bx, ay - by
    size = np.sqrt(dx * dx + dy * dy)
    if size < 1e-6:
        dx, dy = adx, ady
        size = np.sqrt(dx * dx + dy * dy)
    c, s = dx / size, dy / size
    middle = outline.overhang - outline.length / 2
    return ax + c * middle, ay + s * middle, c, s


@compiled
def project_on_polyline(points, along, begin, end, x, y):
    """Return where on the line ``points[begin:end]`` (x, y) is: metres along it, and metres to the left of it."""
    best, offset, side = 1e18, 0.0, 0.0
    for p in range(begin, end - 1):
        ax, ay = points[p, 0], points[p, 1]
        dx, dy = points[p + 1, 0] - ax, points[p + 1, 1] - ay
        size2 = dx * dx + dy * dy
        t = min(max(((x - ax) * dx + (y - ay) * dy) / size2, 0.0), 1.0)
        ex, ey = x - ax - t * dx, y - ay - t * dy
        away = ex * ex + ey * ey
        if away < best:
            best = away
            size = np.sqrt(size2)
            offset = along[p] + t * size
            side = (dx * (y - ay) - dy * (x - ax)) / size
    return offset, side


@inlined
def move_vehicle(vehicle, shapes, view, move, dt):
    """Move a vehicle along its path, metres, in `dt` seconds, and put its body there."""
    x, y, c, s = footprint(view.path, view.outline, vehicle.offset + move)
    vehicle.offset += move
    if vehicle.lateral_offset != 0.0 and (move > 0.0 or vehicle.stopping == BACKING_IN):
        # The front's own metres: `outline` keeps what a point of the path had done when the change began.
        vehicle.lane_change_distance += move
    v = vehicle.index
    shapes.vx[v], shapes.vy[v] = (x - shapes.x[v]) / dt, (y - shapes.y[v]) / dt
    shapes.x[v], shapes.y[v], shapes.yaw[v] = x, y, np.arctan2(s, c)
    if vehicle.lane_change_length > 0.0 and vehicle.lane_change_distance > end_of_lane_change(vehicle):
        vehicle.lateral_offset = 0.0
