"""Flat pieces set before a wall: panels and slabs in the wall's own coordinates, gathered into few surfaces."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray

from vico.world.mesh import Material, Surface, surface_of_quads
from vico.world.model import Entrance
from vico.worldgen.facades.textures.doors import CELLS
from vico.worldgen.facades.textures.ground_floors import BARE, PIER, PIER_ELSE
from vico.worldgen.facades.textures.materials import material
from vico.worldgen.facades.textures.walls import BAYS
from vico.worldgen.facades.walls import Wall

Rgb = tuple[int, int, int]
Uv = tuple[float, float, float, float]


@cache
def cell_uv(name: str, share: float = 1.0) -> Uv:
    """Texture coordinates of a cell of the doors' sheet, or of a share of its width."""
    left, bottom, right, top = CELLS[name].uv()
    return left, bottom, left + (right - left) * share, top


@cache
def _stuff(name: str) -> Material:
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
                    material=self.materials.get(name) or _stuff(name),
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


def bare(face: Face, wall: Wall, a: float, b: float) -> None:
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


def is_bare(wall: Wall, a: float, b: float) -> bool:
    """Whether a stretch lies between windows already."""
    share = PIER.get(wall.material, PIER_ELSE)
    left, right = wall.first + a / wall.bay, wall.first + b / wall.bay
    nearest = round((left + right) / 2)
    return left >= nearest - share and right <= nearest + share
