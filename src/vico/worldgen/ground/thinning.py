"""Fewer triangles: corners that their neighbours' heights foretell are taken out of a conforming plan."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vico.worldgen.ground.conform import Heights, Plan

_STRAIGHT = 0.004  # metres that a border may bend
_LONGEST = 14.0  # metres: corners carry the large patches of colour
_MOST_ABOUT = 40  # triangles about one corner
_PASSES = (0.2, 0.5, 1.0)  # the smoothest corners go first


def thinned(plan: Plan, heights: Sequence[Heights], used: NDArray[np.int64], tolerance: NDArray[np.float64]) -> Plan:
    """Take corners out of a plan.

    Parameters
    ----------
    plan
        As `conforming` made it, with every edge parted.
    heights
        Kinds of heights that pieces lie at.
    used
        The kind each piece lies at, shape ``(pieces,)``.
    tolerance
        Metres by which a piece may come to lie off its heights, shape ``(pieces,)``.

    Returns
    -------
    Plan
        The same pieces with the same outlines (to four millimetres), corners numbered as before.
    """
    if not len(plan.triangles):
        return plan
    z = np.stack([height(plan.corners) for height in heights], axis=1)
    triangles = plan.triangles.copy()
    alive = np.ones(len(triangles), np.bool_)
    order = np.argsort(triangles.ravel(), kind="stable")
    first = np.searchsorted(triangles.ravel()[order], np.arange(len(plan.corners) + 1))
    # A fixed mixed order: one from west to east would make fans.
    turn = np.argsort((np.arange(len(plan.corners)) * 2654435761) % 4294967291, kind="stable")
    error = np.zeros(len(triangles))
    chain = np.full(len(plan.corners), -1, np.int64)
    end = np.arange(len(plan.corners))
    gone = np.zeros(len(plan.corners), np.bool_)
    for share in _PASSES:
        _thin(
            plan.corners, z, triangles, plan.piece, used, tolerance * share, alive, order // 3, first, turn, error,
            chain, end, gone,
        )  # fmt: skip
    return Plan(plan.corners, triangles[alive], plan.piece[alive])


@njit(cache=True)
def _thin(  # type: ignore[no-untyped-def]
    xy, z, triangles, piece, used, tolerance, alive, owner, first, turn, error, chain, end, gone
):
    """Collapse corners into neighbours where no triangle's height changes by more than its tolerance."""
    star = np.empty(_MOST_ABOUT, np.int64)
    near = np.empty(_MOST_ABOUT + 2, np.int64)
    sides = np.empty(_MOST_ABOUT + 2, np.int64)
    kind = np.empty((_MOST_ABOUT + 2, 2), np.int64)
    for v in turn:
        if gone[v]:
            continue
        count, link, full = 0, v, False
        while link >= 0 and not full:
            for k in range(first[link], first[link + 1]):
                t = owner[k]
                if alive[t] and (triangles[t, 0] == v or triangles[t, 1] == v or triangles[t, 2] == v):
                    if count == _MOST_ABOUT:
                        full = True
                        break
                    star[count] = t
                    count += 1
            link = chain[link]
        if full or count < 2:
            continue
        # The neighbours, and the pieces on both sides of the edge to each.
        ring = 0
        for k in range(count):
            t = star[k]
            for m in range(3):
                n = triangles[t, m]
                if n == v:
                    continue
                at = -1
                for j in range(ring):
                    if near[j] == n:
                        at = j
                        break
                if at < 0 and ring == _MOST_ABOUT + 2:
                    full = True
                    break
                if at < 0:
                    near[ring], sides[ring] = n, 1
                    kind[ring, 0], kind[ring, 1] = piece[t], -1
                    ring += 1
                else:
                    sides[at] += 1
                    kind[at, 1] = piece[t]
        if full:
            continue
        borders, one, two, odd = 0, -1, -1, False
        for j in range(ring):
            if sides[j] > 2:
                odd = True
            if kind[j, 0] != kind[j, 1]:
                borders += 1
                one, two = (near[j], two) if one < 0 else (one, near[j])
        if odd or (borders != 0 and borders != 2):
            continue
        if borders == 2:
            length = np.hypot(xy[two, 0] - xy[one, 0], xy[two, 1] - xy[one, 1])
            cross = (xy[two, 0] - xy[one, 0]) * (xy[v, 1] - xy[one, 1]) - (xy[two, 1] - xy[one, 1]) * (
                xy[v, 0] - xy[one, 0]
            )
            if length == 0.0 or abs(cross) > _STRAIGHT * length:
                continue
        before = 0.0
        for k in range(count):
            before = max(before, error[star[k]])
        best, least = -1, 1e9
        for j in range(ring):
            u = near[j]
            if borders == 2 and u != one and u != two:
                continue
            off = _change(xy, z, triangles, piece, used, tolerance, star, count, v, u, before)
            if off >= 0.0 and off < least:
                best, least = u, off
        if best < 0:
            continue
        for k in range(count):
            t = star[k]
            if triangles[t, 0] == best or triangles[t, 1] == best or triangles[t, 2] == best:
                alive[t] = False
                continue
            for m in range(3):
                if triangles[t, m] == v:
                    triangles[t, m] = best
            error[t] = least
        gone[v] = True
        chain[end[best]] = v
        end[best] = end[v]


@njit(cache=True)
def _change(xy, z, triangles, piece, used, tolerance, star, count, v, u, before):  # type: ignore[no-untyped-def]
    """The error once `v` lies in `u`, or -1 where that can't be."""
    worst = 0.0
    for k in range(count):
        t = star[k]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if a == u or b == u or c == u:
            if tolerance[piece[t]] < before:
                return -1.0
            continue
        if b == v:
            a, b, c = b, c, a
        elif c == v:
            a, b, c = c, a, b
        # The triangle u b c, with v within or beyond it.
        ux, uy = xy[u, 0], xy[u, 1]
        area = (xy[b, 0] - ux) * (xy[c, 1] - uy) - (xy[b, 1] - uy) * (xy[c, 0] - ux)
        x0, x1 = np.hypot(xy[b, 0] - ux, xy[b, 1] - uy), np.hypot(xy[c, 0] - ux, xy[c, 1] - uy)
        if area <= 0.002 * max(x0, x1) or x0 > _LONGEST or x1 > _LONGEST:
            return -1.0
        sb = ((xy[v, 0] - ux) * (xy[c, 1] - uy) - (xy[v, 1] - uy) * (xy[c, 0] - ux)) / area
        sc = ((xy[b, 0] - ux) * (xy[v, 1] - uy) - (xy[b, 1] - uy) * (xy[v, 0] - ux)) / area
        h = used[piece[t]]
        off = 0.0
        if sb >= -1e-3 and sc >= -1e-3 and sb + sc <= 1.001:
            off = abs(z[v, h] - z[u, h] - sb * (z[b, h] - z[u, h]) - sc * (z[c, h] - z[u, h]))
        if off + before > tolerance[piece[t]]:
            return -1.0
        worst = max(worst, off)
    return worst + before
