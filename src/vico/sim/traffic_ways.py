"""The way ahead of a vehicle, its footprint along it, and whom it would meet there; kernels.

A vehicle's way is laid once a step as a small array; following it, sweeping the footprint along it and testing it
against the bodies near by then needs nothing else.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vico.sim.traffic_shapes import boxes_overlap, disc_gap_to_box

TRAIL = 32  # lanes behind a vehicle that are remembered
VEHICLE_AIR, PERSON_AIR = 0.1, 0.3  # sideways distance kept from what is passed, m
TOUCH = 0.04  # no move may leave less than this between bodies, m


@njit(cache=True)
def lay_way(first, points, along, length, lane, trail, plan, planned, back, ahead, way):  # type: ignore[no-untyped-def]
    """Write a vehicle's way, from `back` metres behind its lane's start to `ahead` metres past it, into `way`.

    Rows are x, y and metres from the start of `lane`; returns their number. Laid once a step: following it is then a
    matter of one small array.
    """
    k = 0
    base = 0.0
    while k < TRAIL and trail[k] >= 0 and -base < back:
        base -= length[trail[k]]
        k += 1
    count = 0
    last = -1e18
    for step in range(-k, planned + 1):
        if step < 0:
            here = trail[-step - 1]
        elif step == 0:
            here = lane
            base = 0.0
        else:
            here = plan[step - 1]
        for p in range(first[here], first[here + 1]):
            at = base + along[p]
            if at > last + 1e-6 and count < len(way):
                way[count, 0], way[count, 1], way[count, 2] = points[p, 0], points[p, 1], at
                count += 1
                last = at
        base += length[here]
        if base > ahead:
            break
    return count


@njit(cache=True)
def follow(way, count, x):  # type: ignore[no-untyped-def]
    """Position and direction on a laid way; beyond its ends, straight on."""
    a, b = 0, count - 1
    while b - a > 1:
        middle = (a + b) // 2
        if way[middle, 2] <= x:
            a = middle
        else:
            b = middle
    dx, dy, size = way[b, 0] - way[a, 0], way[b, 1] - way[a, 1], way[b, 2] - way[a, 2]
    share = (x - way[a, 2]) / size
    return way[a, 0] + dx * share, way[a, 1] + dy * share, dx, dy


@njit(cache=True)
def _sideways(shift, done, length):  # type: ignore[no-untyped-def]
    """Metres to the left of its lane that a vehicle is, `done` metres into the swerve of a lane change."""
    share = min(max(done / (12.0 + length), 0.0), 1.0)
    return shift * (1.0 - share * share * (3.0 - 2.0 * share))


@njit(cache=True)
def footprint(way, count, frame, x):  # type: ignore[no-untyped-def]
    """Centre x, y and heading cosine, sine of a vehicle whose front is at x on its way.

    `frame` holds length, half width, front overhang, wheelbase, shift, the swerve's metres done at x = 0, and the
    distance kept from people beside.
    """
    a = x - frame[2]
    b = a - frame[3]
    ax, ay, adx, ady = follow(way, count, a)
    bx, by, bdx, bdy = follow(way, count, b)
    if frame[4] != 0.0:
        size = np.sqrt(adx * adx + ady * ady)
        off = _sideways(frame[4], frame[5] + a, frame[0]) / size
        ax, ay = ax - ady * off, ay + adx * off
        size = np.sqrt(bdx * bdx + bdy * bdy)
        off = _sideways(frame[4], frame[5] + b, frame[0]) / size
        bx, by = bx - bdy * off, by + bdx * off
    dx, dy = ax - bx, ay - by
    size = np.sqrt(dx * dx + dy * dy)
    if size < 1e-6:
        dx, dy = adx, ady
        size = np.sqrt(dx * dx + dy * dy)
    c, s = dx / size, dy / size
    middle = frame[2] - frame[0] / 2
    return ax + c * middle, ay + s * middle, c, s


@njit(cache=True)
def set_frame(makes, fleet, v, frame):  # type: ignore[no-untyped-def]
    """Write what `footprint` has to know of vehicle v into `frame`, shape ``(7,)``."""
    frame[0], frame[1] = makes.length[v], makes.half_width[v]
    frame[2], frame[3] = makes.overhang[v], makes.wheelbase[v]
    frame[4], frame[5] = fleet.shift[v], fleet.changed[v] - fleet.offset[v]
    # Who has stood for a while squeezes past people at the kerb.
    frame[6] = PERSON_AIR if fleet.still[v] < 6.0 else 0.05


@njit(cache=True)
def gather_near(shapes, v, reach, table):  # type: ignore[no-untyped-def]
    """Write the bodies within `reach` of body v into `table`: x, y, cosine, sine, half length, half width, disc,
    number, radius.
    """
    sx, sy, half = shapes.x, shapes.y, shapes.half_length
    x, y = sx[v], sy[v]
    n = 0
    for j in range(len(sx)):
        dx = sx[j] - x
        r = reach + half[j]
        if dx > r or dx < -r or j == v:
            continue
        dy = sy[j] - y
        if dx * dx + dy * dy < r * r:
            table[n, 0], table[n, 1] = sx[j], sy[j]
            table[n, 2], table[n, 3] = np.cos(shapes.yaw[j]), np.sin(shapes.yaw[j])
            table[n, 4], table[n, 5] = half[j], shapes.half_width[j]
            table[n, 6], table[n, 7] = 1.0 if shapes.disc[j] else 0.0, float(j)
            table[n, 8] = half[j] if shapes.disc[j] else np.sqrt(half[j] ** 2 + shapes.half_width[j] ** 2)
            n += 1
    return n


@njit(cache=True)
def touches(table, k, cx, cy, c, s, length, width):  # type: ignore[no-untyped-def]
    """Whether a rectangle touches body k of the table."""
    if table[k, 6] > 0.0:
        return disc_gap_to_box(table[k, 0], table[k, 1], cx, cy, c, s, length, width) <= table[k, 4]
    return boxes_overlap(
        cx, cy, c, s, length, width, table[k, 0], table[k, 1], table[k, 2], table[k, 3], table[k, 4], table[k, 5]
    )


@njit(cache=True)
def blocked(way, count, frame, x, table, n, air, person_air, before):  # type: ignore[no-untyped-def]
    """Row of the first body, numbered below `before`, that a vehicle with its front at x would touch; or -1."""
    cx, cy, c, s = footprint(way, count, frame, x)
    length, width = frame[0] / 2, frame[1]
    reach = length + width + 0.5
    for k in range(n):
        if table[k, 7] >= before:
            continue
        dx, dy = table[k, 0] - cx, table[k, 1] - cy
        r = reach + table[k, 8]
        if dx * dx + dy * dy > r * r:
            continue
        side = person_air if table[k, 6] > 0.0 else air
        if touches(table, k, cx, cy, c, s, length + 0.02, width + side):
            return k
    return -1


@njit(cache=True)
def first_ahead(way, count, frame, front, table, n, reach, picked):  # type: ignore[no-untyped-def]
    """Gap to the first body on the way and its row of the table; 1e9 and -1 where none is within reach."""
    length, width = frame[0] / 2, frame[1]
    m = 0
    start = 1e18
    for k in range(n):
        # Only who is near the way counts; 1.5 m is more than a bus's corners leave it in a bend.
        close = width + table[k, 8] + 1.5
        close2 = close * close
        x, y = table[k, 0], table[k, 1]
        for p in range(count - 1):
            if way[p + 1, 2] < front - 2.0:
                continue
            if way[p, 2] > front + reach + 2.0:
                break
            ax, ay = way[p, 0], way[p, 1]
            dx, dy = way[p + 1, 0] - ax, way[p + 1, 1] - ay
            t = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)
            # The last stretch goes straight on.
            t = max(t, 0.0) if p == count - 2 else min(max(t, 0.0), 1.0)
            ex, ey = x - ax - t * dx, y - ay - t * dy
            if ex * ex + ey * ey < close2:
                picked[m] = table[k]
                start = min(start, way[p, 2] + t * (way[p + 1, 2] - way[p, 2]) - close - table[k, 8] - 2.0)
                m += 1
                break
    if m == 0:
        return 1e9, -1
    # Who is beside already is no reason to stand: towards them only touching counts.
    cx, cy, c, s = footprint(way, count, frame, front)
    fresh = 0
    for k in range(m):
        side = frame[6] if picked[k, 6] > 0.0 else VEHICLE_AIR
        if not touches(picked, k, cx, cy, c, s, length + 0.02, width + side):
            if k != fresh:
                for q in range(9):
                    picked[fresh, q], picked[k, q] = picked[k, q], picked[fresh, q]
            fresh += 1
    beside = picked[fresh:]
    step = 1.0
    x = max(0.0, np.floor(start - front))
    while x < reach:
        if x >= 8.0:
            step = 2.0
        x += step
        hit = blocked(way, count, frame, front + x, picked, fresh, VEHICLE_AIR, frame[6], 1e9)
        if hit < 0 and m > fresh:
            hit = blocked(way, count, frame, front + x, beside, m - fresh, TOUCH, TOUCH, 1e9)
            if hit >= 0:
                hit += fresh
        if hit >= 0:
            low, high = x - step, x
            one = picked[hit : hit + 1]
            air = VEHICLE_AIR if hit < fresh else TOUCH
            person = frame[6] if hit < fresh else TOUCH
            for _ in range(4):
                middle = (low + high) / 2
                if blocked(way, count, frame, front + middle, one, 1, air, person, 1e9) >= 0:
                    high = middle
                else:
                    low = middle
            return low, int(picked[hit, 7])
    return 1e9, -1


@njit(cache=True)
def project(first, points, along, lane, x, y):  # type: ignore[no-untyped-def]
    """Metres along a lane of the point nearest to (x, y), and how far to the left of the lane that is."""
    best, offset, side = 1e18, 0.0, 0.0
    for p in range(first[lane], first[lane + 1] - 1):
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
