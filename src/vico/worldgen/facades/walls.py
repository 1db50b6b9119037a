"""Ground-floor walls read off the dressed surfaces, with their bays; and flat pieces that are set before them.

A wall's texture coordinates are linear along it and up it, whole bays along and whole storeys up: so the surfaces alone
say where a wall begins and ends, where its bays are, and how its picture continues. Nothing else has to be handed on,
and a world that was read back from its folder serves as well as one that was just built. Pieces (panels and slabs) are
placed in the wall's own coordinates and gathered into few surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray

from vico.exact import dot
from vico.world.mesh import Material, Surface, surface_of_quads
from vico.world.model import Entrance
from vico.worldgen.facades.textures.ground_floors import BARE, CELLS, PIER, PIER_ELSE
from vico.worldgen.facades.textures.materials import material
from vico.worldgen.facades.textures.walls import BAYS, STOREYS


def bays(length: NDArray[np.float64], wished: NDArray[np.float64]) -> NDArray[np.float64]:
    """How many bays walls of these lengths get: whole numbers, at least one."""
    return np.maximum(np.round(length / wished), 1.0)


def bay_coordinates(
    along: NDArray[np.float64], length: NDArray[np.float64], count: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Horizontal texture coordinate at a distance along a wall, in sheets of `BAYS` bays."""
    return along / length * count / BAYS


def storey_coordinates(
    z: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], count: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vertical texture coordinate of upper floors between two heights, in sheets of `STOREYS` storeys."""
    return (z - low) / (high - low) * count / STOREYS


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
        return self._join(mine, corner, along, self._name[mine[0]], n, r, np.array([x, y]))

    def _join(
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


Rgb = tuple[int, int, int]
Uv = tuple[float, float, float, float]


@cache
def cell_uv(name: str, share: float = 1.0) -> Uv:
    """Texture coordinates of a cell of the doors' sheet, or of a share of its width."""
    left, bottom, right, top = CELLS[name].uv()
    return left, bottom, left + (right - left) * share, top


@cache
def _shared_material(name: str) -> Material:
    """Materials that no wall brought along: the sheet of doors above all, painted once a process."""
    return material(name)


@dataclass
class Pieces:
    """Quads by material while they are gathered."""

    materials: dict[str, Material] = field(default_factory=dict)
    _corners: dict[str, list[list[tuple[float, float, float]]]] = field(default_factory=dict)
    _normals: dict[str, list[tuple[float, float, float]]] = field(default_factory=dict)
    _uv: dict[str, list[Uv]] = field(default_factory=dict)
    _colours: dict[str, list[Rgb]] = field(default_factory=dict)
    _entities: dict[str, list[int]] = field(default_factory=dict)

    def add(
        self,
        name: str,
        corners: list[tuple[float, float, float]],
        normal: tuple[float, float, float],
        uv: Uv,
        colour: Rgb,
        entity: int,
    ) -> None:
        """Add a quad: corners lower left, lower right, upper right, upper left as seen from outside."""
        self._corners.setdefault(name, []).append(corners)
        self._normals.setdefault(name, []).append(normal)
        self._uv.setdefault(name, []).append(uv)
        self._colours.setdefault(name, []).append(colour)
        self._entities.setdefault(name, []).append(entity)

    def absorb(self, other: Pieces) -> None:
        """Take over all pieces of another."""
        for name in other._corners:
            self._corners.setdefault(name, []).extend(other._corners[name])
            self._normals.setdefault(name, []).extend(other._normals[name])
            self._uv.setdefault(name, []).extend(other._uv[name])
            self._colours.setdefault(name, []).extend(other._colours[name])
            self._entities.setdefault(name, []).extend(other._entities[name])

    def triangles(self) -> NDArray[np.float32]:
        """Corners of all triangles, ENU metres, shape ``(n, 3, 3)``."""
        quads = [corners for name in sorted(self._corners) for corners in self._corners[name]]
        corners = np.asarray(quads, np.float32).reshape(-1, 4, 3)
        return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])

    def surfaces(self) -> list[Surface]:
        """One surface a material, by name."""
        made = []
        for name in sorted(self._corners):
            uv = np.asarray(self._uv[name], np.float32)
            made.append(
                surface_of_quads(
                    np.asarray(self._corners[name], np.float32),
                    np.asarray(self._normals[name], np.float32),
                    np.stack([uv[:, [0, 1]], uv[:, [2, 1]], uv[:, [2, 3]], uv[:, [0, 3]]], axis=1),
                    colour=np.asarray(self._colours[name], np.uint8),
                    entity=np.asarray(self._entities[name], np.int32),
                    material=self.materials.get(name) or _shared_material(name),
                )
            )
        return made


@dataclass(frozen=True)
class Face:
    """Where pieces are set: `s` runs to the right along the wall, `d` away from it, metres."""

    pieces: Pieces
    entity: int
    start: tuple[float, float]
    right: tuple[float, float]
    out: tuple[float, float]

    @classmethod
    def on(cls, pieces: Pieces, entity: int, wall: Wall) -> Face:
        """Before a wall, from its start."""
        return cls(pieces, entity, wall.start, wall.right, wall.out)

    @classmethod
    def before(cls, pieces: Pieces, entity: int, entrance: Entrance) -> Face:
        """Before an entrance, from its threshold's middle."""
        c, s = math.cos(entrance.facing), math.sin(entrance.facing)
        return cls(pieces, entity, (entrance.position[0], entrance.position[1]), (-s, c), (c, s))

    def at(self, s: float, z: float, d: float) -> tuple[float, float, float]:
        """Return the point in world coordinates."""
        return (
            self.start[0] + self.right[0] * s + self.out[0] * d,
            self.start[1] + self.right[1] * s + self.out[1] * d,
            z,
        )

    def panel(
        self, s0: float, s1: float, z0: float, z1: float, d: float, *, uv: Uv, colour: Rgb, stuff: str = "doors"
    ) -> None:
        """Add an upright quad that faces away from the wall."""
        corners = [self.at(s0, z0, d), self.at(s1, z0, d), self.at(s1, z1, d), self.at(s0, z1, d)]
        self.pieces.add(stuff, corners, (*self.out, 0.0), uv, colour, self.entity)

    def slab(
        self,
        s0: float,
        s1: float,
        z0: float,
        z1: float,
        d: float,
        *,
        colour: Rgb,
        cell: str = "paint",
        under: bool = True,
    ) -> None:
        """Add a box that stands out of the wall by `d`: front, sides, top and, if asked for, underside."""
        uv, rx, ry = cell_uv(cell), *self.right
        self.panel(s0, s1, z0, z1, d, uv=uv, colour=colour)
        for s, sign in ((s0, -1.0), (s1, 1.0)):
            near, far = (0.0, d) if sign < 0 else (d, 0.0)
            corners = [self.at(s, z0, near), self.at(s, z0, far), self.at(s, z1, far), self.at(s, z1, near)]
            self.pieces.add("doors", corners, (rx * sign, ry * sign, 0.0), uv, colour, self.entity)
        top = [self.at(s0, z1, d), self.at(s1, z1, d), self.at(s1, z1, 0.0), self.at(s0, z1, 0.0)]
        self.pieces.add("doors", top, (0.0, 0.0, 1.0), uv, colour, self.entity)
        if under:
            low = [self.at(s0, z0, 0.0), self.at(s1, z0, 0.0), self.at(s1, z0, d), self.at(s0, z0, d)]
            self.pieces.add("doors", low, (0.0, 0.0, -1.0), uv, colour, self.entity)

    def slope(
        self, s0: float, s1: float, low: tuple[float, float], high: tuple[float, float], *, uv: Uv, colour: Rgb
    ) -> None:
        """Add a slanting cloth with both its faces; `low` and `high` are height and distance of its edges."""
        corners = [self.at(s0, *low), self.at(s1, *low), self.at(s1, *high), self.at(s0, *high)]
        rise, depth = high[0] - low[0], low[1] - high[1]
        size = math.hypot(rise, depth)
        normal = (self.out[0] * rise / size, self.out[1] * rise / size, depth / size)
        self.pieces.add("doors", corners, normal, uv, colour, self.entity)
        below = (-normal[0], -normal[1], -normal[2])
        self.pieces.add("doors", [corners[1], corners[0], corners[3], corners[2]], below, uv, colour, self.entity)

    def plate(self, s: float, z0: float, z1: float, d0: float, d1: float, *, uv: Uv, stuff: str) -> None:
        """Add a board that sticks out of the wall at a right angle, readable from both sides."""
        rx, ry = self.right
        for sign in (1.0, -1.0):
            near, far = (d1, d0) if sign > 0 else (d0, d1)
            e = s + 0.03 * sign
            corners = [self.at(e, z0, near), self.at(e, z0, far), self.at(e, z1, far), self.at(e, z1, near)]
            self.pieces.add(stuff, corners, (rx * sign, ry * sign, 0.0), uv, (255, 255, 255), self.entity)


def cover_with_blank_wall(face: Face, wall: Wall, a: float, b: float) -> None:
    """Cover a stretch of a wall with what it shows between its windows: the same picture, drawn from its piers."""
    stuff = BARE.get(wall.material, wall.material)
    share = PIER.get(stuff, PIER_ELSE)
    bay, colour = (wall.bay, wall.colour) if stuff == wall.material else (3.0, (208, 204, 198))
    count = max(1, math.ceil((b - a) / (2 * share * bay) - 0.25))
    step = (b - a) / count
    half = min(step / bay / 2, share)
    for k in range(count):
        n = math.floor(wall.first) + k
        uv = ((n - half) / BAYS, wall.v(wall.low), (n + half) / BAYS, wall.v(wall.high))
        face.panel(a + k * step, a + (k + 1) * step, wall.low, wall.high, 0.02, uv=uv, colour=colour, stuff=stuff)


def is_blank_wall(wall: Wall, a: float, b: float) -> bool:
    """Whether a stretch lies between windows already."""
    share = PIER.get(wall.material, PIER_ELSE)
    left, right = wall.first + a / wall.bay, wall.first + b / wall.bay
    nearest = round((left + right) / 2)
    return left >= nearest - share and right <= nearest + share
