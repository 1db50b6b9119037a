"""Tunnels as people see them: cuts between walls, portals, and lit tubes behind them.

What lies side by side or meets is drawn as one: walls follow the union of the tunnels' plans, and of floors that
overlap the first one's is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.geometry import arc_lengths
from vico.world.heights import HeightField
from vico.world.mesh import Surface, merge_surfaces
from vico.worldgen.ground.bridges.decks import left_normals
from vico.worldgen.ground.bridges.masonry import PARAPET, Masonry
from vico.worldgen.ground.bridges.tunnels import WALL, Bore
from vico.worldgen.ground.drape import triangulated
from vico.worldgen.ground.kerbs import KERB

Floats = NDArray[np.float64]
Rgb = tuple[int, int, int]

_PIECE = 3.0  # metres
_LAMPS_EVERY = 9.0  # metres
_CONCRETE: Rgb = (188, 186, 180)
_TILES: Rgb = (214, 212, 204)
_CEILING: Rgb = (120, 119, 116)
_LAMP: Rgb = (255, 246, 222)
_FOOT = 0.3  # metres that walls go on below the ground
_AT = 0.05  # metres within which a point is on an edge


@dataclass(frozen=True)
class _Floors:
    """Heights along tunnels, looked up by the nearest piece."""

    tree: shapely.STRtree
    ends: Floats
    z: Floats
    headroom: Floats

    @classmethod
    def of(cls, bores: Sequence[Bore]) -> _Floors:
        ends = np.concatenate([np.stack([bore.line[:-1], bore.line[1:]], axis=1) for bore in bores])
        z = np.concatenate([np.stack([bore.z[:-1], bore.z[1:]], axis=1) for bore in bores])
        headroom = np.concatenate([np.full(len(bore.line) - 1, bore.headroom) for bore in bores])
        return cls(shapely.STRtree(shapely.linestrings(ends)), ends, z, headroom)

    def at(self, xy: Floats) -> tuple[Floats, Floats]:
        """Return heights of the floor and clear heights at points, metres, shape ``(n,)`` each."""
        piece = self.tree.nearest(shapely.points(xy))
        start, run = self.ends[piece, 0], self.ends[piece, 1] - self.ends[piece, 0]
        share = ((xy - start) * run).sum(axis=1) / np.maximum((run**2).sum(axis=1), 1e-9)
        share = np.clip(share, 0.0, 1.0)
        return self.z[piece, 0] + share * (self.z[piece, 1] - self.z[piece, 0]), self.headroom[piece]


@dataclass(frozen=True)
class _Piece:
    """A piece of a tunnel between two points of its line; `headroom` 0: without a roof."""

    plan: BaseGeometry
    start: Floats
    run: Floats
    z: Floats
    headroom: float

    def heights(self, xy: Floats) -> Floats:
        """Return how high its floor is at points, metres, shape ``(n,)``."""
        share = ((xy - self.start) * self.run).sum(axis=1) / max(float((self.run**2).sum()), 1e-9)
        return np.asarray(self.z[0] + np.clip(share, 0.0, 1.0) * (self.z[1] - self.z[0]))


def bore_surfaces(bores: Sequence[Bore], terrain: HeightField, window: Polygon) -> list[Surface]:
    """Draw tunnels; what of them lies outside the window, a square around the middle, is left out."""
    if not bores:
        return []
    stone, floors = Masonry(), _Floors.of(bores)
    reach = min(terrain.half - 0.5, float(window.bounds[2]))
    window = shapely.box(-reach, -reach, reach, reach)
    plan = overlay.intersection(overlay.union_all([bore.plan() for bore in bores]), window)
    roofed = overlay.intersection(overlay.union_all([bore.roofed() for bore in bores]), plan)
    driven = overlay.intersection(overlay.union_all([bore.driven() for bore in bores]), plan)
    raised = overlay.difference(plan, driven)
    for piece in _pieces(bores):
        _lay(stone, overlay.intersection(piece.plan, driven), piece, 0.0, "carriageway")
        _lay(stone, overlay.intersection(piece.plan, raised), piece, KERB, "sidewalk")
        if piece.headroom:
            _roof(stone, overlay.intersection(piece.plan, roofed), piece)
    _kerbs(stone, driven, plan, floors)
    # Mouths stay open, and so do tubes where they leave the window.
    mouths = overlay.union_all([shapely.LineString(end) for bore in bores for end in bore.end_lines()])
    ways_in = overlay.buffer(mouths, _AT, cap_style="flat")
    for a, b in _edges(plan):
        middle = shapely.Point((a + b) / 2)
        if ways_in.intersects(middle) or np.abs((a + b) / 2).max() > reach - _AT:
            continue
        if roofed.distance(middle) < _AT:
            _tube_wall(stone, a, b, floors)
        else:
            _cut_wall(stone, a, b, floors, terrain)
    inner = overlay.buffer(plan, -4 * _AT)
    for a, b in _edges(roofed):
        if inner.contains(shapely.Point((a + b) / 2)):
            _portal(stone, a, b, floors, terrain)
    for bore in bores:
        _lamps(stone, bore, reach)
    return merge_surfaces(stone.surfaces())


def _edges(area: BaseGeometry) -> Iterator[tuple[Floats, Floats]]:
    """Yield the pieces of an area's border, the area on their left."""
    for shape in polygons_of(area, 0.02):
        whole = shapely.segmentize(shapely.geometry.polygon.orient(shape), _PIECE)
        for ring in (whole.exterior, *whole.interiors):
            yield from pairwise(np.asarray(ring.coords, np.float64)[:, :2])


def _pieces(bores: Sequence[Bore]) -> Iterator[_Piece]:
    """Yield the pieces of tunnels, each without what another tunnel's have taken before."""
    taken: list[BaseGeometry] = []
    for bore in bores:
        side = left_normals(bore.line) * bore.width / 2
        before = [shape for shape in taken if shape.intersects(bore.plan())]
        for k in range(len(bore.line) - 1):
            corners = np.concatenate([(bore.line + side)[k : k + 2], (bore.line - side)[k : k + 2][::-1]])
            plan: BaseGeometry = overlay.make_valid(Polygon(corners))
            for other in before:
                plan = overlay.difference(plan, other)
            headroom = bore.headroom if bore.covered[k] and bore.covered[k + 1] else 0.0
            yield _Piece(plan, bore.line[k], bore.line[k + 1] - bore.line[k], bore.z[k : k + 2], headroom)
        taken.append(bore.plan())


def _lay(stone: Masonry, area: BaseGeometry, piece: _Piece, lift: float, look: str) -> None:
    """Lay a part of a piece's floor."""
    flat, faces = triangulated(polygons_of(area, 0.005))
    for a, b, c in np.c_[flat, piece.heights(flat) + lift][faces]:
        stone.add([a, b, c, c], look)


def _kerbs(stone: Masonry, driven: BaseGeometry, plan: BaseGeometry, floors: _Floors) -> None:
    """Build the faces between carriageways and what is raised beside them."""
    inside = overlay.buffer(plan, -_AT)
    for a, b in _edges(driven):
        if inside.contains(shapely.Point((a + b) / 2)):
            (low_a, low_b), _ = floors.at(np.stack([a, b]))
            stone.add([np.r_[a, low_a], np.r_[b, low_b], np.r_[b, low_b + KERB], np.r_[a, low_a + KERB]][::-1], "kerb")


def _upright(stone: Masonry, a: Floats, b: Floats, low: Floats, high: Floats, tint: Rgb, look: str = "kerb") -> None:
    """Build an upright face from `a` to `b` that is seen from the left of that way."""
    stone.add([np.r_[b, low[1]], np.r_[a, low[0]], np.r_[a, high[0]], np.r_[b, high[1]]], look, tint)


def _tube_wall(stone: Masonry, a: Floats, b: Floats, floors: _Floors) -> None:
    low, headroom = floors.at(np.stack([a, b]))
    _upright(stone, a, b, low, low + headroom, _TILES)


def _cut_wall(stone: Masonry, a: Floats, b: Floats, floors: _Floors, terrain: HeightField) -> None:
    """Build a wall that holds the ground beside a cut, with a parapet on it."""
    ends = np.stack([a, b])
    run = b - a
    out = np.array([run[1], -run[0]]) / max(float(np.hypot(*run)), 1e-9) * WALL
    low, _ = floors.at(ends)
    ground = np.maximum(terrain.upper(ends), terrain.upper(ends + out))
    high = np.maximum(ground, low + KERB) + PARAPET
    foot = np.minimum(ground, low) - _FOOT
    _upright(stone, a, b, low, high, _CONCRETE)
    _upright(stone, b + out, a + out, foot[::-1], high[::-1], _CONCRETE)
    stone.add([np.r_[a, high[0]], np.r_[a + out, high[0]], np.r_[b + out, high[1]], np.r_[b, high[1]]], "kerb")


def _roof(stone: Masonry, area: BaseGeometry, piece: _Piece) -> None:
    """Build a part of a piece's ceiling."""
    flat, faces = triangulated(polygons_of(area, 0.005))
    for a, b, c in np.c_[flat, piece.heights(flat) + piece.headroom][faces]:
        stone.add([a, c, b, b], "kerb", _CEILING)


def _portal(stone: Masonry, a: Floats, b: Floats, floors: _Floors, terrain: HeightField) -> None:
    """Build the wall above the mouth of a tube, from the ceiling to a parapet above the ground."""
    ends = np.stack([a, b])
    low, headroom = floors.at(ends)
    low = low + headroom
    high = np.maximum(terrain.upper(ends), low) + PARAPET
    # The tube is on the left of the way from a to b.
    run = b - a
    back = np.array([-run[1], run[0]]) / max(float(np.hypot(*run)), 1e-9) * WALL
    _upright(stone, b, a, low[::-1], high[::-1], (255, 255, 255), "wall")
    _upright(stone, a + back, b + back, low, high, (255, 255, 255), "wall")
    stone.add([np.r_[a, high[0]], np.r_[b, high[1]], np.r_[b + back, high[1]], np.r_[a + back, high[0]]], "wall")


def _lamps(stone: Masonry, bore: Bore, reach: float) -> None:
    """Hang lamps below the ceiling."""
    line = shapely.LineString(bore.line)
    along = arc_lengths(bore.line)
    for place in np.arange(_LAMPS_EVERY / 2, line.length, _LAMPS_EVERY).tolist():
        k = min(int(np.searchsorted(along, place)), len(along) - 1)
        middle = np.array(line.interpolate(place).coords[0])
        if not (bore.covered[k] and bore.covered[k - 1]) or np.abs(middle).max() > reach:
            continue
        u = bore.line[k] - bore.line[k - 1]
        u = u / max(float(np.hypot(*u)), 1e-9)
        across, ahead = np.array([-u[1], u[0]]) * 0.15, u * 0.8
        top = float(np.interp(place, along, bore.z)) + bore.headroom - 0.04
        corners = [middle - ahead + across, middle + ahead + across, middle + ahead - across, middle - ahead - across]
        stone.add([np.r_[corner, top] for corner in corners], "kerb", _LAMP)
