"""The one height look-up used by everybody: a smooth bilinear field, with the sharp edges of kerbs and quays on it.

A step of the ground would be smeared over a whole cell by any field of heights. So edges are kept as a field of
signed distances beside the heights of their lower and their upper side, all three smooth: a look-up finds the edge
to a few centimetres though cells are half a metre wide.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.io.compiled import compiled
from vico.world.decks import Decks
from vico.world.stairs import Stairs

EDGE_RANGE = 1.0
"""Metres of distance to an edge that a `Steps` field can tell; int8 127 stands for it."""

EDGE_WIDTH = 0.1
"""Metres over which the ground goes from the lower to the upper side of an edge."""


@dataclass(frozen=True)
class Steps:
    """Where the ground steps down, over the same square as its height field.

    Attributes
    ----------
    edge
        Distance to the nearest edge, negative on the lower side, in units of ``EDGE_RANGE / 127``; int8, ``(m, m)``.
    low, high
        What to add to the smooth height on the lower and the upper side of the edges, millimetres, int16, ``(m, m)``.
    """

    edge: NDArray[np.int8]
    low: NDArray[np.int16]
    high: NDArray[np.int16]


@dataclass(frozen=True)
class HeightField:
    """Ground heights over the square world.

    Attributes
    ----------
    heights
        Smooth heights, metres, float32, shape ``(n, n)``, indexed ``[iy, ix]``; corner ``[0, 0]`` is the south-west
        one.
    half
        Half the side of the square covered, metres; the square is centred on the origin.
    steps
        Kerbs, quays and their like; None where there are none.
    decks
        Surfaces above and below the ground that people and vehicles use, too; None where there are none.
    stairs
        Treads that feet stand on, where the heights are a slope; None where there are none.
    """

    heights: NDArray[np.float32]
    half: float
    steps: Steps | None = None
    decks: Decks | None = None
    stairs: Stairs | None = None

    @property
    def cell(self) -> float:
        """Spacing of the smooth heights, metres."""
        return 2.0 * self.half / (self.heights.shape[0] - 1)

    @classmethod
    def flat(cls, half: float, height: float = 0.0) -> HeightField:
        """Return a level field."""
        return cls(np.full((2, 2), height, np.float32), half)

    def __call__(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Heights at points; points outside take the nearest edge's height.

        Parameters
        ----------
        xy
            ENU metres, shape ``(..., 2)`` (further columns are ignored).

        Returns
        -------
        ndarray
            Metres, shape ``(...)``.
        """
        return self._look_up(xy, 0)

    def near(self, xyz: ArrayLike) -> NDArray[np.float64]:
        """Heights of the surfaces that bodies are on: of the ground, or of a deck or a tunnel that is nearer in height.

        Parameters
        ----------
        xyz
            ENU metres, shape ``(..., 3)``.

        Returns
        -------
        ndarray
            Metres, shape ``(...)``; those of the ground where there are no decks.
        """
        points = np.asarray(xyz, np.float64)
        found = self._look_up(points, 0)
        if self.decks is not None:
            self.decks.heights(points.reshape(-1, 3), found.reshape(-1))
        return found

    def footing(self, xyz: ArrayLike) -> NDArray[np.float64]:
        """Heights of what feet stand on: as `near`, and of treads on stairs; shaped as those of `near`."""
        found = self.near(xyz)
        if self.stairs is not None:
            flat = found.reshape(-1)
            self.stairs.stand_on(np.asarray(xyz, np.float64).reshape(-1, 3), flat)
        return found

    def going_at(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """How deep the treads are that one climbs at points ``(n, 3)``, metres, shape ``(n,)``; 0 off stairs."""
        return np.zeros(len(xyz)) if self.stairs is None else self.stairs.going_at(xyz)

    def smooth(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Heights without kerbs and their like, shaped as those of a call."""
        return self._look_up(xy, 1)

    def lower(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Heights of the lower side near an edge, wherever the points lie: of the carriageway, of the water."""
        return self._look_up(xy, 2)

    def upper(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Heights of the upper side near an edge, wherever the points lie: of the sidewalk, of the quay."""
        return self._look_up(xy, 3)

    def edge_distance(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Metres to the nearest edge of a kerb, a quay or their like, negative below it; at most `EDGE_RANGE`.

        Parameters
        ----------
        xy
            ENU metres, shape ``(..., 2)`` (further columns are ignored).

        Returns
        -------
        ndarray
            Metres, shape ``(...)``; `EDGE_RANGE` where there are no edges.
        """
        points = np.asarray(xy, np.float64)
        if self.steps is None:
            return np.full(points.shape[:-1], EDGE_RANGE)
        edge, n = self.steps.edge, self.steps.edge.shape[0]
        u, v = (np.clip((points[..., k] + self.half) * (n - 1) / (2.0 * self.half), 0.0, n - 1.0) for k in (0, 1))
        i, j = np.minimum(u.astype(np.int64), n - 2), np.minimum(v.astype(np.int64), n - 2)
        fu, fv = u - i, v - j
        south = edge[j, i] * (1.0 - fu) + edge[j, i + 1] * fu
        north = edge[j + 1, i] * (1.0 - fu) + edge[j + 1, i + 1] * fu
        return np.asarray((south * (1.0 - fv) + north * fv) * (EDGE_RANGE / 127.0), np.float64)

    def _look_up(self, xy: ArrayLike, which: int) -> NDArray[np.float64]:
        points = np.ascontiguousarray(xy, np.float64)
        flat = points.reshape(-1, points.shape[-1])
        found = np.empty(len(flat))
        _smooth(self.heights, self.half, flat, found)
        if self.steps is not None and which != 1:
            _stepped(self.steps.edge, self.steps.low, self.steps.high, self.half, flat, which, found)
        return found.reshape(points.shape[:-1])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the field as named arrays, for a file."""
        found: dict[str, NDArray[Any]] = {"heights": self.heights, "half": np.array(self.half, np.float64)}
        if self.steps is not None:
            found |= {"edge": self.steps.edge, "low": self.steps.low, "high": self.steps.high}
        for more in (self.decks, self.stairs):
            found |= {} if more is None else more.arrays()
        return found

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> HeightField:
        """Return the field of `arrays`; ValueError or KeyError where they make none."""
        heights = np.ascontiguousarray(arrays["heights"], np.float32)
        if heights.ndim != 2 or heights.shape[0] != heights.shape[1] or heights.shape[0] < 2:
            raise ValueError(f"heights of shape {heights.shape}, not square")
        steps, half = cls._steps_from(arrays), float(arrays["half"])
        return cls(heights, half, steps, Decks.from_arrays(arrays), Stairs.from_arrays(arrays))

    @staticmethod
    def _steps_from(arrays: Mapping[str, NDArray[Any]]) -> Steps | None:
        if "edge" not in arrays:
            return None
        edge = np.ascontiguousarray(arrays["edge"], np.int8)
        low, high = (np.ascontiguousarray(arrays[name], np.int16) for name in ("low", "high"))
        if edge.ndim != 2 or edge.shape[0] != edge.shape[1] or not edge.shape == low.shape == high.shape:
            raise ValueError(f"steps of shapes {edge.shape}, {low.shape}, {high.shape}")
        return Steps(edge, low, high)


@compiled
def _smooth(heights, half, places, out):  # type: ignore[no-untyped-def]
    n = heights.shape[0]
    scale = (n - 1) / (2.0 * half)
    for k in range(len(places)):
        u = min(max((places[k, 0] + half) * scale, 0.0), n - 1.0)
        v = min(max((places[k, 1] + half) * scale, 0.0), n - 1.0)
        i, j = min(int(u), n - 2), min(int(v), n - 2)
        fu, fv = u - i, v - j
        south = np.float64(heights[j, i]) * (1.0 - fu) + np.float64(heights[j, i + 1]) * fu
        north = np.float64(heights[j + 1, i]) * (1.0 - fu) + np.float64(heights[j + 1, i + 1]) * fu
        out[k] = south * (1.0 - fv) + north * fv


@compiled
def _stepped(edge, low, high, half, places, which, out):  # type: ignore[no-untyped-def]
    """Add the steps: at the point itself (0), or as if it lay on the lower (2) or upper (3) side."""
    n = edge.shape[0]
    scale = (n - 1) / (2.0 * half)
    for k in range(len(places)):
        u = min(max((places[k, 0] + half) * scale, 0.0), n - 1.0)
        v = min(max((places[k, 1] + half) * scale, 0.0), n - 1.0)
        i, j = min(int(u), n - 2), min(int(v), n - 2)
        fu, fv = u - i, v - j
        a, b, c, d = (1.0 - fu) * (1.0 - fv), fu * (1.0 - fv), (1.0 - fu) * fv, fu * fv
        share = 0.0
        if which == 3:
            share = 1.0
        elif which == 0:
            away = a * edge[j, i] + b * edge[j, i + 1] + c * edge[j + 1, i] + d * edge[j + 1, i + 1]
            share = min(max(0.5 + away * (EDGE_RANGE / 127.0 / EDGE_WIDTH), 0.0), 1.0)
        if share < 1.0:
            out[k] += (
                (1.0 - share) * 0.001 * (a * low[j, i] + b * low[j, i + 1] + c * low[j + 1, i] + d * low[j + 1, i + 1])
            )
        if share > 0.0:
            out[k] += (
                share * 0.001 * (a * high[j, i] + b * high[j, i + 1] + c * high[j + 1, i] + d * high[j + 1, i + 1])
            )
