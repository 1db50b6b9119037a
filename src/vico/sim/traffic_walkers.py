"""How pedestrians walk: both ways on sidewalks, round each other, over crossings when they are clear; kernels.

Each walker follows a point that runs a little ahead of it along its stretch, on the right-hand side of the way. Of a
few headings around that point it takes the one that leads furthest, and makes no step that would touch another body.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vico.sim.traffic_shapes import disc_gap_to_box, disc_hits, next_random
from vico.sim.traffic_ways import project
from vico.world.lanes import lane_pose
from vico.world.walkways import CORNER as _CORNER
from vico.world.walkways import CROSSING as _CROSSING

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

RADIUS = 0.25
_LEAD = 0.7  # how far ahead the point runs, m
_LEAD_ROUND = 2.0  # and for who gets nowhere: past a vehicle that stands on the point, m
_HINDERED = 3.0  # who has got nowhere for so long looks that far ahead, s
_SEE = 2.2  # how far ahead others are avoided, m
_TOUCH = 0.03
_ASK = 1.5  # a vehicle that has stood so long before somebody is waiting for them to go, s
_JAMMED = 6.0  # who has got nowhere for so long squeezes past, s
_ANGLES = np.array([0.0, -0.35, 0.35, -0.7, 0.7, -1.1, 1.1, -1.6, 1.6, -2.3, 2.3, 3.1])
_FORWARD = 9  # the first so many are taken unless nothing has helped for a while
_CORNER_K, _CROSSING_K = int(_CORNER), int(_CROSSING)


class Paths(NamedTuple):
    """The walkways, as `Walkways` has them."""

    first: Ints
    points: Floats
    along: Floats
    length: Floats
    room: Floats
    reach: Floats
    kind: NDArray[np.uint8]
    ends: Ints
    meeting_first: Ints
    meeting: Ints


class Crowd(NamedTuple):
    """What changes about each walker; `way` is +1 or -1 along the stretch, `side` the share of the room kept right."""

    stretch: Ints
    offset: Floats
    way: Ints
    side: Floats
    pace: Floats
    speed: Floats
    walked: Floats
    stuck: Floats
    jammed: Floats
    anchor: Floats
    waited: Floats
    leaving: Ints
    since: Floats
    random: NDArray[np.uint64]


@njit(cache=True)
def _point(paths, crowd, i):  # type: ignore[no-untyped-def]
    """The point walker i follows, and the unit vector to the left of its stretch there."""
    stretch = crowd.stretch[i]
    offset = min(max(crowd.offset[i], 0.0), paths.length[stretch])
    x, y, yaw = lane_pose(paths.first, paths.points, paths.along, stretch, offset)
    nx, ny = -np.sin(yaw), np.cos(yaw)
    left, right = paths.room[stretch, 0], paths.room[stretch, 1]
    aside = (left - right) / 2 - crowd.way[i] * crowd.side[i] * (left + right) / 2
    return x + nx * aside, y + ny * aside, x, y, nx, ny


@njit(cache=True)
def _turn_round(paths, crowd, i, x, y):  # type: ignore[no-untyped-def]
    """Go the other way from here on: the followed point comes back to where the walker is, or it would lead on."""
    crowd.way[i] = -crowd.way[i]
    crowd.offset[i], _ = project(paths.first, paths.points, paths.along, crowd.stretch[i], x, y)
    crowd.waited[i] = crowd.stuck[i] = 0.0


@njit(cache=True)
def _next_stretch(paths, crowd, i, node):  # type: ignore[no-untyped-def]
    """Where to go on at a meeting point, -1 for nowhere: crossings are taken less often than corners."""
    here = crowd.stretch[i]
    total = 0.0
    for sweep in range(2):
        pick = next_random(crowd.random, i) * total if sweep else 0.0
        for k in range(paths.meeting_first[node], paths.meeting_first[node + 1]):
            option = paths.meeting[k]
            if option == here or (paths.kind[option] == _CORNER_K and paths.kind[here] == _CORNER_K):
                continue
            weight = 1.0
            if paths.kind[option] == _CORNER_K:
                far = paths.ends[option, 0] + paths.ends[option, 1] - node
                for m in range(paths.meeting_first[far], paths.meeting_first[far + 1]):
                    if paths.kind[paths.meeting[m]] == _CROSSING_K:
                        weight = 0.5
            if not sweep:
                total += weight
            else:
                pick -= weight
                if pick <= 0.0:
                    return option
        if total == 0.0:
            return -1
    return -1


@njit(cache=True)
def _run_ahead(paths, crowd, gates, asked, i, x, y, dt):  # type: ignore[no-untyped-def]
    """Move the followed point on until it is far enough ahead; True if a crossing has to be waited for.

    Nobody waits for the vehicle that stands waiting for them: who is `asked` to go goes.
    """
    lead = _LEAD_ROUND if crowd.jammed[i] > _HINDERED else _LEAD
    for _ in range(12):
        px, py, _, _, _, _ = _point(paths, crowd, i)
        if (px - x) ** 2 + (py - y) ** 2 >= lead * lead:
            return False
        stretch = crowd.stretch[i]
        offset = crowd.offset[i] + crowd.way[i] * 0.12
        if 0.0 < offset < paths.length[stretch]:
            crowd.offset[i] = offset
            continue
        node = paths.ends[stretch, 1 if crowd.way[i] > 0 else 0]
        following = _next_stretch(paths, crowd, i, node)
        if following < 0:
            crowd.way[i] = -crowd.way[i]
            crowd.offset[i] = min(max(offset, 0.0), paths.length[stretch])
            continue
        if paths.kind[following] == _CROSSING_K:
            first = gates.vehicle_wait[following] > 10.0 and crowd.waited[i] < 12.0
            if (gates.busy[following] or first) and not asked:
                crowd.waited[i] += dt
                if crowd.waited[i] > 20.0 + 10.0 * crowd.side[i]:
                    _turn_round(paths, crowd, i, x, y)  # not today
                gates.walker_wait[following] = max(gates.walker_wait[following], crowd.waited[i])
                return True
            crowd.waited[i] = 0.0
            gates.walkers_on[following] += 1
        if paths.kind[stretch] == _CROSSING_K:
            if crowd.leaving[i] >= 0:
                gates.walkers_on[crowd.leaving[i]] -= 1
            crowd.leaving[i], crowd.since[i] = stretch, crowd.walked[i]
        crowd.stretch[i] = following
        if paths.ends[following, 0] == node:
            crowd.way[i], crowd.offset[i] = 1, 0.0
        else:
            crowd.way[i], crowd.offset[i] = -1, paths.length[following]
    return False


@njit(cache=True)
def _free_way(x, y, c, s, shapes, near, n, air):  # type: ignore[no-untyped-def]
    """Metres a walker can go along a heading before it touches somebody, at most `_SEE`."""
    free = _SEE
    for k in range(n):
        j = near[k]
        dx, dy = shapes.x[j] - x, shapes.y[j] - y
        if shapes.disc[j]:
            reach = RADIUS + shapes.half_length[j] + air
            ahead = dx * c + dy * s
            if ahead <= 0.0:
                continue
            aside2 = dx * dx + dy * dy - ahead * ahead
            if aside2 < reach * reach:
                free = min(free, max(ahead - np.sqrt(reach * reach - aside2), 0.0))
        else:
            d = 0.25
            while d < free:
                if disc_hits(x + c * d, y + s * d, RADIUS + air, shapes, j):
                    free = min(free, d - 0.25)
                d += 0.25
    return free


@njit(cache=True)
def _distance(x, y, shapes, j):  # type: ignore[no-untyped-def]
    """Metres from a point to body j: to a disc's middle, to a rectangle's edge."""
    if shapes.disc[j]:
        return np.hypot(x - shapes.x[j], y - shapes.y[j])
    c, s = np.cos(shapes.yaw[j]), np.sin(shapes.yaw[j])
    return disc_gap_to_box(x, y, shapes.x[j], shapes.y[j], c, s, shapes.half_length[j], shapes.half_width[j])


@njit(cache=True)
def advance_walkers(paths, crowd, gates, blocker, still, shapes, first, dt):  # type: ignore[no-untyped-def]
    """Move every walker by one step; walker i is body ``first + i`` of `shapes`.

    `blocker` is the body that each vehicle stands before (-1 for none), `still` the seconds it has stood.
    """
    asked = np.zeros(len(crowd.stretch), np.bool_)
    for v in range(len(blocker)):
        if blocker[v] >= first and blocker[v] < first + len(asked) and still[v] > _ASK:
            asked[blocker[v] - first] = True
    near = np.empty(len(shapes.x), np.int64)
    gates.walker_wait[:] = 0.0
    for i in range(len(crowd.stretch)):
        b = first + i
        x, y = shapes.x[b], shapes.y[b]
        n = 0
        for j in range(len(shapes.x)):
            dx, dy = shapes.x[j] - x, shapes.y[j] - y
            r = _SEE + 1.0 + shapes.half_length[j] + shapes.half_width[j]
            if j != b and dx * dx + dy * dy < r * r:
                near[n] = j
                n += 1
        waiting = _run_ahead(paths, crowd, gates, asked[i], i, x, y, dt)
        if crowd.leaving[i] >= 0 and crowd.walked[i] - crowd.since[i] > 1.3:
            gates.walkers_on[crowd.leaving[i]] -= 1
            crowd.leaving[i] = -1
        if asked[i] and crowd.stuck[i] > 2.5:
            _turn_round(paths, crowd, i, x, y)  # it waits for us, and is in our way
        jammed = crowd.jammed[i] > _JAMMED
        air = 0.04 if jammed else 0.1
        px, py, qx, qy, nx, ny = _point(paths, crowd, i)
        dx, dy = px - x, py - y
        away = np.sqrt(dx * dx + dy * dy)
        step = 0.0
        if not (waiting and away < 0.2) and away > 1e-6:
            heading = np.arctan2(dy, dx)
            stretch = crowd.stretch[i]
            room = paths.reach[stretch] if jammed else paths.room[stretch]
            aside = (x - qx) * nx + (y - qy) * ny
            best, best_score, best_free = 0.0, -1.0, 0.0
            for k in range(len(_ANGLES) if jammed else _FORWARD):
                angle = heading + _ANGLES[k]
                c, s = np.cos(angle), np.sin(angle)
                there = aside + 0.4 * (c * nx + s * ny)
                most = room[0] if there > 0.0 else room[1]
                if k > 0 and abs(there) > most + 0.1 and abs(there) >= abs(aside):
                    continue
                free = _free_way(x, y, c, s, shapes, near, n, air)
                score = free * ((1.2 if jammed else 0.35) + np.cos(_ANGLES[k])) - 0.01 * k
                if score > best_score:
                    best, best_score, best_free = angle, score, free
            speed = crowd.pace[i] * min(1.0, best_free / 0.6)
            step = min(speed * dt, away if waiting else speed * dt)
            if step > 0.004:
                tx, ty = x + np.cos(best) * step, y + np.sin(best) * step
                for k in range(n):
                    if disc_hits(tx, ty, RADIUS + _TOUCH, shapes, near[k]):
                        # Who is too near already may still go away from the other.
                        j = near[k]
                        away_too = _distance(tx, ty, shapes, j) > _distance(x, y, shapes, j)
                        if not away_too or disc_hits(tx, ty, RADIUS + 0.005, shapes, j):
                            step = 0.0
                            break
            else:
                step = 0.0
            if step > 0.0:
                shapes.x[b], shapes.y[b] = tx, ty
                turn = (best - shapes.yaw[b] + np.pi) % (2 * np.pi) - np.pi
                shapes.yaw[b] += min(max(turn, -4.0 * dt), 4.0 * dt)
                shapes.vx[b], shapes.vy[b] = (tx - x) / dt, (ty - y) / dt
        if step == 0.0:
            shapes.vx[b] = shapes.vy[b] = 0.0
        crowd.speed[i] = step / dt
        crowd.walked[i] += step
        # Getting nowhere, on the spot or to and fro, is a reason to turn round.
        ex, ey = shapes.x[b] - crowd.anchor[i, 0], shapes.y[b] - crowd.anchor[i, 1]
        if waiting or ex * ex + ey * ey > 1.0:
            crowd.anchor[i, 0], crowd.anchor[i, 1] = shapes.x[b], shapes.y[b]
            crowd.stuck[i] = crowd.jammed[i] = 0.0
        else:
            crowd.stuck[i] += dt
            crowd.jammed[i] += dt
            if crowd.stuck[i] > 3.5 and crowd.stuck[i] - 3.5 > 3.0 * next_random(crowd.random, i):
                _turn_round(paths, crowd, i, shapes.x[b], shapes.y[b])


@njit(cache=True)
def place_walker(paths, crowd, i, stretch, offset, way, shapes, b):  # type: ignore[no-untyped-def]
    """Put walker i on a stretch if nobody is within half a metre; True if it now stands there."""
    crowd.stretch[i], crowd.offset[i], crowd.way[i] = stretch, offset, way
    x, y, _, _, nx, ny = _point(paths, crowd, i)
    for j in range(len(shapes.x)):
        if j != b and disc_hits(x, y, RADIUS + 0.5, shapes, j):
            return False
    shapes.x[b], shapes.y[b] = x, y
    shapes.yaw[b] = np.arctan2(ny, nx) - np.pi / 2 if way > 0 else np.arctan2(ny, nx) + np.pi / 2
    return True
