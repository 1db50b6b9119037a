"""Tracks as trams drive them: where a section stands, how fast bends allow, and how long a run takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.exact import each
from vico.geometry import arc_lengths, points_along
from vico.io.compiled import compiled
from vico.rules import TRAM_SECTION, TRAM_SECTIONS, TRAM_WIDTH
from vico.world.model import Point2

#: Metres between the points a track is known at.
STEP = 0.5
#: Metres around each of the points across a track that a tram sweeps.
ACROSS_REACH = 0.36
#: Length of a tram, metres.
TRAM_LENGTH = TRAM_SECTIONS * TRAM_SECTION
#: Metres a second at most in a street, and metres a second squared that trams speed up and brake with, and that
#: who stands in one is to feel at most in a bend.
TRAM_SPEED, TRAM_ACCELERATION, TRAM_BRAKING = 9.0, 1.0, 1.1
_SIDEWAYS = 0.9
_SLOWEST = 2.5  # m/s, however tight the bend
#: Doors on both sides of a section, metres ahead of its middle.
TRAM_DOORS = (2.3, -2.3)
#: Metres from a section's middle to where it rests on the track, ahead and behind.
_PIVOT = 2.9
_AIR = 0.12  # metres kept on either side


class Track:
    """The track of a tram line, known every `STEP` metres.

    Parameters
    ----------
    line
        Its centre line, ENU metres, shape ``(n, 2)``.

    Attributes
    ----------
    length
        Metres.
    xy
        Points every `STEP` metres, shape ``(m, 2)``.
    half_width
        How far from each of them a tram reaches to the sides that passes it, with some air, metres, shape ``(m,)``.
    across
        Points from side to side at each of them, each `ACROSS_REACH` from the next one's reach, shape ``(m, 4, 2)``.
    speed
        How fast trams drive there, m/s, shape ``(m,)``: they brake ahead of bends.
    """

    def __init__(self, line: Sequence[Point2] | NDArray[np.float64]) -> None:
        points = np.asarray(line, np.float64).reshape(-1, 2)
        steps = np.hypot(*np.diff(points, axis=0).T)
        keep = np.concatenate([[True], steps > 1e-6])
        points = points[keep]
        self._along = arc_lengths(points)
        self._points = points
        self.length = float(self._along[-1])
        s = np.arange(math.floor(self.length / STEP) + 1) * STEP
        self.xy = self.at(s)
        reach = TRAM_SECTION / 2
        before, here, after = self.at(s - reach), self.xy, self.at(s + reach)
        turn = _angle(here - before, after - here)
        bend = np.abs(turn) / reach
        self.half_width = TRAM_WIDTH / 2 + _AIR + np.minimum(TRAM_SECTION**2 / 8 * bend, 1.0)
        way = np.gradient(self.xy, axis=0) if len(self.xy) > 1 else np.ones((1, 2))
        way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        share = np.linspace(-1.0, 1.0, 4)[None, :] * (self.half_width - ACROSS_REACH)[:, None]
        self.across = self.xy[:, None] + share[..., None] * np.column_stack([-way[:, 1], way[:, 0]])[:, None]
        fast = np.clip(np.sqrt(_SIDEWAYS / np.maximum(bend, 1e-3)), _SLOWEST, TRAM_SPEED)
        # A bend counts for as long as any part of the tram is in it.
        wide = int(TRAM_LENGTH / STEP)
        self.speed = np.array([fast[max(0, k - wide) : k + 1].min() for k in range(len(fast))])
        for k in range(len(self.speed) - 2, -1, -1):
            self.speed[k] = min(self.speed[k], math.sqrt(self.speed[k + 1] ** 2 + 2 * TRAM_BRAKING * STEP))

    def at(self, s: ArrayLike) -> NDArray[np.float64]:
        """Points at distances along the track, metres, straight on beyond its ends; shape ``(..., 2)``."""
        s = np.asarray(s, np.float64)
        inside = np.clip(s, 0.0, self.length)
        xy = points_along(self._points, inside, self._along)
        over = (s - inside)[..., None]
        first, last = self._ends
        return np.asarray(xy + np.where(over < 0, first, last) * over, np.float64)

    @cached_property
    def _ends(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Directions in which the track begins and ends."""
        first, last = self._points[1] - self._points[0], self._points[-1] - self._points[-2]
        return first / np.hypot(*first), last / np.hypot(*last)

    def section(self, front: ArrayLike) -> NDArray[np.float64]:
        """x, y, yaw of the middle of a section whose front is at a distance along the track; shape ``(..., 3)``."""
        front = np.asarray(front, np.float64)
        found = np.empty((front.size, 3))
        _stand(front.ravel() - TRAM_SECTION / 2, self._along, self._points, *self._ends, found)
        return found.reshape(*front.shape, 3)

    def seconds(self, start: float, end: float, *, standing: bool = True) -> float:
        """How long a tram takes from one distance along the track to another, braking to a stand there if need be."""
        s = np.arange(start, max(end, start + STEP), STEP)
        limit = np.interp(s, np.arange(len(self.speed)) * STEP, self.speed)
        speed = np.minimum(limit, np.sqrt(0.25 + 2 * TRAM_ACCELERATION * (s - start)))
        if standing:
            speed = np.minimum(speed, np.sqrt(0.25 + 2 * TRAM_BRAKING * (end - s)))
        return float((STEP / np.maximum(speed, 0.5)).sum())


@compiled
def _point(s, along, points, first, last):  # type: ignore[no-untyped-def]
    """Return the point at a distance along a track."""
    if s <= 0.0:
        return points[0, 0] + first[0] * s, points[0, 1] + first[1] * s
    end = along[-1]
    if s >= end:
        return points[-1, 0] + last[0] * (s - end), points[-1, 1] + last[1] * (s - end)
    k = np.searchsorted(along, s, side="right") - 1
    share = (s - along[k]) / (along[k + 1] - along[k])
    x = points[k, 0] + share * (points[k + 1, 0] - points[k, 0])
    return x, points[k, 1] + share * (points[k + 1, 1] - points[k, 1])


@compiled
def _stand(middles, along, points, first, last, found):  # type: ignore[no-untyped-def]
    """Write x, y, yaw of sections whose middles are at distances along a track, shape ``(n, 3)``."""
    for i in range(len(middles)):
        ax, ay = _point(middles[i] - _PIVOT, along, points, first, last)
        bx, by = _point(middles[i] + _PIVOT, along, points, first, last)
        found[i, 0], found[i, 1] = (ax + bx) / 2, (ay + by) / 2
        found[i, 2] = np.arctan2(by - ay, bx - ax)


def tram_door(track: Track, offset: float, door: int, side: float) -> tuple[Point2, Point2]:
    """Where a door of a tram that stands with its front at `offset` is, and where its middle line is there.

    Parameters
    ----------
    door
        Counted from the front, two a section.
    side
        1 for the right side, -1 for the left one.
    """
    section, which = divmod(door, len(TRAM_DOORS))
    x, y, yaw = track.section(offset - section * TRAM_SECTION)
    x, y = x + math.cos(yaw) * TRAM_DOORS[which], y + math.sin(yaw) * TRAM_DOORS[which]
    aside = side * TRAM_WIDTH / 2
    return (float(x + math.sin(yaw) * aside), float(y - math.cos(yaw) * aside)), (float(x), float(y))


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return each(math.atan2, a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
