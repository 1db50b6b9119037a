"""Where doors and signs go: the ground-floor wall at a point, with its bays, read off the dressed surfaces.

A wall's texture coordinates are linear along it and up it, and whole numbers of bays: so the surfaces alone say where a
wall begins and ends, where its bays are, and how its picture continues. Nothing else has to be handed on, and a world
that was read back from its folder serves as well as one that was just built.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.exact import dot
from vico.world.mesh import Surface
from vico.worldgen.facades.textures.walls import BAYS

_U, _V = 3, 4  # columns of a corner after its position: texture coordinates
_BEHIND = 0.02  # metres from which on a wall lies behind another


@dataclass(frozen=True)
class Wall:
    """A straight stretch of a ground-floor wall.

    Attributes
    ----------
    material, colour
        What it wears: the name of its material, and its tint.
    start
        Its left end as seen from outside, level, metres.
    right, out
        Level unit vectors along it (to the right as seen from outside) and away from it.
    length
        Metres.
    low, high
        Heights between which its picture runs once from bottom to top.
    bays
        Bays it holds.
    first
        Texture coordinate u at its start, in bays.
    """

    material: str
    colour: tuple[int, int, int]
    start: tuple[float, float]
    right: tuple[float, float]
    out: tuple[float, float]
    length: float
    low: float
    high: float
    bays: float
    first: float

    @property
    def bay(self) -> float:
        """Width of a bay, metres."""
        return self.length / max(self.bays, 1e-6)

    def along(self, x: float, y: float) -> float:
        """Metres from the start to the foot of a point's perpendicular."""
        return (x - self.start[0]) * self.right[0] + (y - self.start[1]) * self.right[1]

    def u(self, s: float) -> float:
        """Texture coordinate at a distance from the start."""
        return (self.first + s / self.bay) / BAYS

    def v(self, z: float) -> float:
        """Texture coordinate at a height."""
        return min(max((z - self.low) / max(self.high - self.low, 1e-6), 0.004), 0.996)

    def bay_edges(self, a: float, b: float) -> tuple[float, float]:
        """Return the stretch grown to whole bays, kept on the wall."""
        phase = self.first - math.floor(self.first)
        left = (math.floor(a / self.bay + phase + 0.02) - phase) * self.bay
        right = (math.ceil(b / self.bay + phase - 0.02) - phase) * self.bay
        return max(left, 0.0), min(right, self.length)


class GroundFloors:
    """Finds ground-floor walls of dressed surfaces.

    Parameters
    ----------
    surfaces
        The layer "buildings"; only materials whose name begins with ``ground_`` count.
    """

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        taken = [s for s in surfaces if s.material.name.startswith("ground_") and len(s.triangles)]
        self._names = [s.material.name for s in taken]
        nothing: list[NDArray[np.float64]] = [np.zeros((0, 3, 5))]
        corners = [
            np.concatenate([s.positions[s.triangles], s.uv[s.triangles]], axis=2).astype(np.float64) for s in taken
        ]
        self._corner = np.concatenate(nothing + corners)
        self._name = np.concatenate([[], *[np.full(len(s.triangles), k) for k, s in enumerate(taken)]]).astype(int)
        first = [s.triangles[:, 0] for s in taken]
        pick = list(zip(taken, first, strict=True))
        self._normal = np.concatenate([np.zeros((0, 3)), *[s.normals[i] for s, i in pick]]).astype(np.float64)
        self._colour = np.concatenate([np.zeros((0, 3), np.uint8), *[s.colour[i] for s, i in pick]])
        entity = np.concatenate([[], *[s.entity[i] for s, i in pick]]).astype(np.int64)
        self._order = np.argsort(entity, kind="stable")
        self._entity = entity[self._order]

    def at(self, entity: int, x: float, y: float, facing: float) -> Wall | None:
        """Return the wall of a building on which a point lies; None where no ground floor has a picture there.

        Of walls close before one another it is the outermost, which is the one that is seen.
        """
        low, high = np.searchsorted(self._entity, [entity, entity + 1])
        mine = self._order[low:high]
        if not len(mine):
            return None
        out = np.array([math.cos(facing), math.sin(facing)])
        mine = mine[dot(self._normal[mine][:, :2], out) > 0.94]
        if not len(mine):
            return None
        normal = self._normal[mine][:, :2]
        normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        before = ((self._corner[mine, 0, :2] - np.array([x, y])) * normal).sum(axis=1)
        away = np.abs(before)
        right = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        s = np.einsum("nki,ni->nk", self._corner[mine][:, :, :2] - np.array([x, y]), right)
        beside = np.maximum(np.maximum(s.min(axis=1), -s.max(axis=1)), 0.0)
        best = int(np.argmin(away + beside))
        if away[best] > 0.35 or beside[best] > 0.3:
            return None
        seen = np.flatnonzero((away <= 0.35) & (beside <= beside[best]) & (before > before[best] + _BEHIND))
        if len(seen):
            best = int(seen[np.argmax(before[seen])])
        n, r = normal[best], right[best]
        same = (dot(normal, n) > 0.9995) & (self._name[mine] == self._name[mine[best]])
        same &= np.abs(dot(self._corner[mine][:, :, :2] - self._corner[mine[best], 0, :2], n)).max(axis=1) < 0.04
        mine = mine[same]
        corner = self._corner[mine]
        along = dot(corner[:, :, :2] - np.array([x, y]), r)
        return self._joined(mine, corner, along, self._name[mine[0]], n, r, np.array([x, y]))

    def _joined(
        self,
        mine: NDArray[np.int64],
        corner: NDArray[np.float64],
        along: NDArray[np.float64],
        name: int,
        n: NDArray[np.float64],
        r: NDArray[np.float64],
        point: NDArray[np.float64],
    ) -> Wall | None:
        """Neighbouring triangles of one plane and one phase of bays, around the point."""
        # u = a + b s on a triangle: its two corners farthest apart along the wall tell b.
        i, j = along.argmin(axis=1), along.argmax(axis=1)
        rows = np.arange(len(along))
        span = along[rows, j] - along[rows, i]
        rate = (corner[rows, j, _U] - corner[rows, i, _U]) / np.maximum(span, 1e-9) * BAYS
        phase = corner[rows, i, _U] * BAYS - rate * along[rows, i]
        reach = np.maximum(np.maximum(along.min(axis=1), -along.max(axis=1)), 0.0)
        seed = int(np.lexsort((-span, reach > 0.3))[0])
        if span[seed] < 0.3 or rate[seed] <= 1e-3:
            return None
        shift = phase - phase[seed]
        alike = (np.abs(rate - rate[seed]) < 0.02 * rate[seed] + 0.002) & (np.abs(shift - np.round(shift)) < 0.03)
        low, high = float(along[seed].min()), float(along[seed].max())
        chosen = np.zeros(len(mine), bool)
        chosen[seed] = True
        for _ in range(len(mine)):
            touching = alike & ~chosen & (along.min(axis=1) < high + 0.03) & (along.max(axis=1) > low - 0.03)
            if not touching.any():
                break
            chosen |= touching
            low, high = min(low, float(along[touching].min())), max(high, float(along[touching].max()))
        z, v = corner[chosen][:, :, 2], corner[chosen][:, :, _V]
        bottom, top = float(z.min()), float(z.max())
        if top - bottom < 1.8:
            return None
        # The height at which v is 0 and 1, from the lowest and the highest corner.
        v0, v1 = float(v.ravel()[z.argmin()]), float(v.ravel()[z.argmax()])
        rise = (top - bottom) / max(v1 - v0, 0.05)
        start = point + r * low + n * float(dot(corner[seed, 0, :2] - point, n))
        return Wall(
            material=self._names[name],
            colour=(
                int(self._colour[mine[seed]][0]),
                int(self._colour[mine[seed]][1]),
                int(self._colour[mine[seed]][2]),
            ),
            start=(float(start[0]), float(start[1])),
            right=(float(r[0]), float(r[1])),
            out=(float(n[0]), float(n[1])),
            length=high - low,
            low=bottom - v0 * rise,
            high=bottom + (1.0 - v0) * rise,
            bays=float(rate[seed]) * (high - low),
            first=float(phase[seed] + rate[seed] * low),
        )
