"""Where trams drive in a city, and what is in their way there: all that never changes, made once a world."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.sim.transit.tram_crossings import CrossedStretch, crossed_stretches
from vico.sim.transit.tram_outlines import spots_near
from vico.sim.transit.tram_signals import TramSignal, signals_of
from vico.sim.transit.tram_zones import TramZone, zones_of
from vico.world.lanes import LaneGraph
from vico.world.rails import Track
from vico.world.transit_model import TramLine
from vico.world.walkways import CORNER, CROSSING, Walkways

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
    def crossed(self) -> tuple[NDArray[np.void], list[list[CrossedStretch]]]:
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
