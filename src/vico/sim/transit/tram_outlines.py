"""What a tram takes up: outlines of its sections, and whether anybody is on a stretch of track."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.rules import TRAM_SECTION, TRAM_WIDTH
from vico.sim.bodies import Bodies

_NOWHERE = 1e9  # metres, x of who is not there
# Points on a section's sides and ends, 0.25 m apart: nobody of 0.25 m reaches in between them, `_TOUCH` kept, unseen.
_ALONG, _ACROSS = 35, 11


def packed(bodies: Bodies) -> NDArray[np.float64]:
    """Return footprints as `first_taken` reads them.

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


def nobody(n: int) -> NDArray[np.float64]:
    """Return the footprints of `n` who are not there, for `stand` to fill; as from `packed`."""
    found = np.zeros((n, 9))
    found[:, 0] = _NOWHERE
    return found


@compiled
def stand(poses, inside, half_length, half_width, speed, footprints):  # type: ignore[no-untyped-def]
    """Write the footprints of a tram's sections, shape ``(n, 9)``; those out of the city are nowhere."""
    for k in range(len(poses)):
        c, s = np.cos(poses[k, 2]), np.sin(poses[k, 2])
        footprints[k, 0] = poses[k, 0] if inside[k] else _NOWHERE
        footprints[k, 1] = poses[k, 1]
        footprints[k, 2], footprints[k, 3] = c, s
        footprints[k, 4], footprints[k, 5], footprints[k, 6] = half_length, half_width, 0.0
        footprints[k, 7], footprints[k, 8] = speed * c, speed * s


@compiled
def inside_city(poses, half):  # type: ignore[no-untyped-def]
    """Return which sections reach into a city `half` metres to each side, by x, y, yaw of middles."""
    found = np.zeros(len(poses), np.bool_)
    reach = TRAM_SECTION / 2
    for k in range(len(poses)):
        u, v = reach * np.cos(poses[k, 2]), reach * np.sin(poses[k, 2])
        x, y = poses[k, 0], poses[k, 1]
        found[k] = max(abs(x + u), abs(y + v)) < half or max(abs(x - u), abs(y - v)) < half
    return found


@compiled
def outlines(poses, inside):  # type: ignore[no-untyped-def]
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
def first_taken(points, bodies, skip, skipped, within, soon):  # type: ignore[no-untyped-def]
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
def spots_near(line, points, reach):  # type: ignore[no-untyped-def]
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


def in_way(points: NDArray[np.float64], people: NDArray[np.float64], within: float) -> NDArray[np.bool_]:
    """Return who of people, by x and y of each, is near one of `points`, shape ``(n, k, 2)``."""
    near = points.reshape(-1, 2)
    away = np.hypot(people[:, 0, None] - near[:, 0], people[:, 1, None] - near[:, 1])
    return np.asarray((away < within).any(axis=1), np.bool_)
