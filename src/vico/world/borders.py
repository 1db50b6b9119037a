"""Where two tiles of a city meet: what each draws along the border, and whether both draw the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.world.city import City
from vico.world.mesh import Surface

Floats = NDArray[np.float64]

ON_LINE = 1e-3
"""Metres: a corner this close to the border is on it."""

SAME = 2e-3
"""Metres along the border between points that are one."""

ALIKE = 0.4
"""Metres in height within which the same stuff on both sides is one piece of ground: what lies under it is deeper."""

NEAR = 0.08
"""The same of any stuff: less than a kerb."""

ABOVE = ("wire", "paint")
"""Materials of what is not the ground but lies or hangs over it: broken lines begin where each tile's street does."""

_AT_ALL = 0.3  # and where there is nothing nearer
_MOST_STEP = 1e-3  # metres between heights of both sides
_LEAST = 0.03  # metres along the border: narrower pieces of ground are slivers between two kinds
_EVERY = 0.25  # metres between points at which fields are held against each other


@dataclass(frozen=True)
class Side:
    """One side of a tile's square.

    Attributes
    ----------
    axis
        Coordinate that is the same all along it: 0 for a western or eastern side, 1 for a southern or northern one.
    at
        Its value, metres.
    """

    axis: int
    at: float

    def on(self, positions: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Return which points lie on the side."""
        return np.abs(positions[:, self.axis].astype(np.float64) - self.at) < ON_LINE


@dataclass(frozen=True)
class Profile:
    """What a tile draws along a side: edges of triangles.

    Attributes
    ----------
    start, end
        Where they begin and end, metres along the side, ``start < end``, shape ``(n,)``.
    low, high
        Heights there, metres, shape ``(n,)``.
    stuff
        Names of their materials.
    """

    start: Floats
    end: Floats
    low: Floats
    high: Floats
    stuff: list[str]

    def heights(self, along: Floats, near: Floats, stuff: str) -> Floats:
        """Return heights of the edges that are nearest to points, of the same stuff if there are; NaN where none is.

        Parameters
        ----------
        along, near
            Metres along the side, and heights, shape ``(n,)``.
        stuff
            Name of the points' material.
        """
        within = (self.start[None] <= along[:, None] + SAME) & (along[:, None] <= self.end[None] + SAME)
        share = (along[:, None] - self.start[None]) / (self.end - self.start)[None]
        z = self.low[None] + np.clip(share, 0.0, 1.0) * (self.high - self.low)[None]
        off = np.where(within, np.abs(z - near[:, None]), np.inf)
        if not off.shape[1]:
            return np.full(len(along), np.nan)
        alike = np.array([name == stuff for name in self.stuff], np.bool_)
        found = np.full(len(along), np.nan)
        row = np.arange(len(along))
        anything = np.ones(len(alike), np.bool_)
        for chosen, reach in ((alike, NEAR), (anything, NEAR), (alike, ALIKE), (anything, _AT_ALL)):
            far = np.where(chosen[None], off, np.inf)
            best = far.argmin(axis=1)
            fits = np.isnan(found) & (far[row, best] <= reach)
            found[fits] = z[row, best][fits]
        return found

    def covers(self, along: Floats, above: Floats) -> NDArray[np.bool_]:
        """Return at which points, shape ``(n,)``, some edge lies well above a height."""
        within = (self.start[None] <= along[:, None] + SAME) & (along[:, None] <= self.end[None] + SAME)
        share = np.clip((along[:, None] - self.start[None]) / (self.end - self.start)[None], 0.0, 1.0)
        z = self.low[None] + share * (self.high - self.low)[None]
        return np.asarray((within & (z > above[:, None] + ALIKE)).any(axis=1))

    def ends(self, stuff: str) -> Floats:
        """Return where ground of one stuff begins and ends: metres along the side and heights, shape ``(m, 2)``."""
        own = np.array([name == stuff for name in self.stuff], np.bool_)
        points = np.column_stack([np.r_[self.start[own], self.end[own]], np.r_[self.low[own], self.high[own]]])
        _, first, many = np.unique(np.round(points, 3), axis=0, return_index=True, return_counts=True)
        return np.asarray(points[first[many % 2 == 1]], np.float64)


def profile_of(surfaces: Sequence[Surface], side: Side) -> Profile:
    """Return what surfaces of the ground draw along a side; upright faces on it are left out."""
    found: list[Floats] = []
    stuff: list[str] = []
    for surface in surfaces:
        if surface.material.name in ABOVE:
            continue
        edges = edges_on(surface, side)
        if len(edges):
            ends = surface.positions[edges[:, :2]].astype(np.float64)
            t, z = ends[:, :, 1 - side.axis], ends[:, :, 2]
            order = np.argsort(t, axis=1, kind="stable")
            t, z = np.take_along_axis(t, order, axis=1), np.take_along_axis(z, order, axis=1)
            found.append(np.column_stack([t, z])[t[:, 1] - t[:, 0] > SAME])
            stuff += [surface.material.name] * len(found[-1])
    start, end, low, high = np.ascontiguousarray((np.concatenate(found) if found else np.zeros((0, 4))).T)
    return Profile(start, end, low, high, stuff)


def edges_on(surface: Surface, side: Side) -> NDArray[np.int64]:
    """Return the edges on a side of triangles that do not stand on it: both ends in order, and the triangle."""
    on = side.on(surface.positions)[surface.triangles]
    faces = np.flatnonzero(on.sum(axis=1) == 2)
    if not len(faces):
        return np.zeros((0, 3), np.int64)
    off = (~on[faces]).argmax(axis=1)
    corner = surface.triangles[faces].astype(np.int64)
    row = np.arange(len(faces))
    return np.stack([corner[row, (off + 1) % 3], corner[row, (off + 2) % 3], faces], axis=1)


def border_findings(city: City, first: tuple[int, int], second: tuple[int, int], axis: int) -> list[str]:
    """Return what is wrong along the border of two tiles, a sentence each.

    Parameters
    ----------
    first, second
        The tiles; the second lies east (`axis` 0) or north (1) of the first.
    """
    half = city.manifest.size / 2
    name = f"border of {first[0]}_{first[1]} and {second[0]}_{second[1]}"
    worlds = city.world(first), city.world(second)
    along = np.arange(-half, half + _EVERY / 2, _EVERY)
    found: list[str] = []
    points = [np.empty((len(along), 2)) for _ in worlds]
    for one, at in zip(points, (half, -half), strict=True):
        one[:, axis], one[:, 1 - axis] = at, along
    for what in ("smooth", "lower", "upper"):
        a, b = (getattr(world.height, what)(one) for world, one in zip(worlds, points, strict=True))
        step = np.abs(a - b)
        if step.max() > 0.0:
            found.append(f"{name}: {what} heights differ by {step.max():.4f} m at {along[step.argmax()]:.2f} m")
    sides = Side(axis, half), Side(axis, -half)
    drawn = [profile_of(world.surfaces("ground"), side) for world, side in zip(worlds, sides, strict=True)]
    houses = _houses(city, first, axis)
    for a, b in (drawn, drawn[::-1]):
        found += [f"{name}: {sentence}" for sentence in _unmatched(a, b, houses)]
    return found


def _houses(city: City, first: tuple[int, int], axis: int) -> NDArray[np.float64]:
    """Return where buildings stand across a tile's eastern or northern border, metres along it, shape ``(n, 2)``."""
    half = city.manifest.size / 2
    found: list[tuple[float, float]] = []
    # Houses may stand beyond the tile of their middle: of both tiles, and of those beside them.
    for across, aside in ((across, aside) for across in (0, 1) for aside in (-1, 0, 1)):
        dx, dy = (across, aside) if axis == 0 else (aside, across)
        tile = first[0] + dx, first[1] + dy
        if tile not in city:
            continue
        at, along = half - city.manifest.size * across, -city.manifest.size * aside
        ends = [(at, along - half), (at, along + half)]
        line = shapely.LineString(ends if axis == 0 else [end[::-1] for end in ends])
        for building in city.world(tile).buildings:
            for part in shapely.get_parts(overlay.intersection(line, shapely.Polygon(building.footprint[0]))):
                met = shapely.get_coordinates(part)[:, 1 - axis] - along
                if len(met):
                    found.append((float(met.min()), float(met.max())))
    return np.array(found).reshape(-1, 2)


def _unmatched(one: Profile, other: Profile, houses: NDArray[np.float64]) -> list[str]:
    """Say where the edges of one side are not met by those of the other; what lies under others nobody sees."""
    found: list[str] = []
    # In the middle between any two ends, too: where a piece of the other side is missing none need end.
    ends = np.unique(np.r_[one.start, one.end, other.start, other.end])
    middles = ((ends[1:] + ends[:-1]) / 2)[np.diff(ends) >= _LEAST]
    for stuff in sorted(set(one.stuff)):
        own = np.array([name == stuff for name in one.stuff], np.bool_) & (one.end - one.start >= _LEAST)
        within, at = np.nonzero((one.start[own, None] < middles) & (middles < one.end[own, None]))
        share = (middles[at] - one.start[own][within]) / (one.end - one.start)[own][within]
        t = np.r_[one.start[own], one.end[own], middles[at]]
        z = np.r_[one.low[own], one.high[own], one.low[own][within] + share * (one.high - one.low)[own][within]]
        there = other.heights(t, z, stuff)
        under = ((houses[:, 0] <= t[:, None]) & (t[:, None] <= houses[:, 1])).any(axis=1)
        under |= one.covers(t, z) & other.covers(t, z)
        for k in np.flatnonzero(~(np.abs(there - z) <= _MOST_STEP) & ~under).tolist():
            what = "nothing meets" if np.isnan(there[k]) else f"{abs(there[k] - z[k]):.3f} m from"
            found.append(f"{what} {stuff} at {t[k]:.3f} m, {z[k]:.2f} m high")
    return found
