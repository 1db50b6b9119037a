"""Houses from afar: prisms over simplified outlines with plain roofs, in the mean colours of what their meshes show.

A building is divided by the heights of its roofs. Roofs are flat, have a ridge, or slope to all sides.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.exact import each
from vico.geo import overlay
from vico.world.far_colours import (
    LINEAR,
    WINDOWS,
    WINDOWS_MEAN,
    ColouredTriangles,
    coloured_triangles,
    has_windows,
    spread_points,
    srgb,
    sums_by,
    window_uv,
)
from vico.world.mesh import Material, Surface
from vico.world.model import OPEN_KINDS, Building
from vico.world.world import World

CELL = 2.0
"""Metres; the side of the cells in which a roof's height is looked at."""

_HIDDEN = 4.0  # metres; how far below a roof floors are hidden
_FOOT = 0.6  # metres that walls reach below the ground
_TOLERANCES = (1.5, 3.0, 4.5)  # metres; the first after which an outline has few enough corners
_CORNERS = 6  # that an outline may have
_PER_CORNER = 1000.0  # square metres for each corner more
_YARD = 150.0  # square metres; smaller yards are roofed over
_SLAB = 0.6  # metres; of roofs that are open below
_LEAST = 24.0  # square metres of what is drawn higher than the rest
_HUT = 50.0  # square metres; smaller outlines have four corners
_STEP, _PITCHED_STEP = 3.0, 5.0  # metres between the heights of roofs that are drawn as two
_TALL = 8.0  # ... between those of a tower and the rest
_TOWER = 6  # cells that a tower has at least
_BLUNT = frozenset({"flat", "dome"})  # shapes of roofs that have no eaves


class FarPart(NamedTuple):
    """A prism of a building, and what is known of the roof on it.

    Attributes
    ----------
    outline
        Metres; counter-clockwise, yards clockwise.
    foot
        Height of the walls' lower edge, metres.
    cells
        Middles of the roof's cells, `CELL` wide, metres, shape ``(n, 2)``.
    heights, lows
        Of the highest and the lowest points of the roof in each cell, metres, shape ``(n,)``.
    """

    outline: Polygon
    foot: float
    cells: NDArray[np.float64]
    heights: NDArray[np.float64]
    lows: NDArray[np.float64]

    def cut(self, outline: Polygon, foot: float, chosen: NDArray[np.bool_]) -> FarPart:
        """Return a prism with some of the cells: a mask, shape ``(n,)``."""
        return FarPart(outline, foot, self.cells[chosen], self.heights[chosen], self.lows[chosen])


def far_outline(building: Building) -> Polygon:
    """Return a building's outline with few corners, without its small yards.

    Parameters
    ----------
    building
        Any; its footprint may cross itself.

    Returns
    -------
    Polygon
        Metres; counter-clockwise, yards clockwise. Empty where the footprint has no area.
    """
    rings = [ring for ring in building.footprint if len(ring) >= 3]
    if not rings:
        return Polygon()
    holes = [ring for ring in rings[1:] if Polygon(ring).area > _YARD]
    return _with_few_corners(_largest(overlay.make_valid(Polygon(rings[0], holes))))


def parts_by_height(world: World, building: Building, outline: Polygon, places: NDArray[np.float64]) -> list[FarPart]:
    """Divide a building by the heights of its roofs: a house with a tower is not as high as that everywhere.

    Parameters
    ----------
    world
        The world that it stands in, for the height of the ground.
    building
        The building.
    outline
        Its outline, as `far_outline` returns it; not empty.
    places
        Points on its roofs, a square metre apart or so, metres, shape ``(p, 3)``.

    Returns
    -------
    list of FarPart
        The lower ones first.
    """
    corners = shapely.get_coordinates(outline)
    foot = min(float(world.height(corners).min()), building.base) - _FOOT
    part = FarPart(outline, foot, *_roof_cells(outline, places))
    if not len(part.cells):
        top = np.array([building.base + building.height])
        part = FarPart(outline, foot, np.array([outline.representative_point().coords[0]]), top, top)
    if building.tags.get("building") in OPEN_KINDS:
        return [part._replace(foot=max(foot, float(np.median(part.heights)) - _SLAB))]
    return list(_levels(part, _STEP if building.roof_shape in _BLUNT else _PITCHED_STEP, 3))


def _with_few_corners(shape: Polygon) -> Polygon:
    most = _CORNERS + int(shape.area / _PER_CORNER)
    if shape.area < _HUT and shapely.get_num_coordinates(shape) > 5:
        return shapely.orient_polygons(shape.oriented_envelope)
    simple = shape
    for tolerance in _TOLERANCES:
        candidate = _largest(overlay.simplify(shape, tolerance))
        if candidate.area < 0.8 * shape.area:
            break
        simple = candidate
        if shapely.get_num_coordinates(simple) <= most:
            break
    return shapely.orient_polygons(simple)


def _largest(shape: Any) -> Polygon:
    pieces = [piece for piece in shapely.get_parts(shape).tolist() if isinstance(piece, Polygon)]
    return max(pieces, key=lambda piece: piece.area, default=Polygon())


def _roof_cells(
    outline: Polygon, places: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the middles of cells within an outline, and the heights of what is highest and lowest there.

    Floors far below another roof are not seen, and not counted.
    """
    cell = np.floor(places[:, :2] / CELL).astype(np.int64)
    keys, which = np.unique(cell[:, 0] * 1_000_003 + cell[:, 1], return_inverse=True)
    heights, lows = np.full(len(keys), -np.inf), np.full(len(keys), np.inf)
    np.maximum.at(heights, which, places[:, 2])
    seen = places[:, 2] > heights[which] - _HIDDEN
    np.minimum.at(lows, which[seen], places[seen, 2])
    first = np.zeros(len(keys), np.int64)
    first[which] = np.arange(len(which))
    middles = (cell[first] + 0.5) * CELL
    inside = shapely.contains_xy(outline, middles[:, 0], middles[:, 1])
    return middles[inside], heights[inside], lows[inside]


def _levels(part: FarPart, step: float, more: int) -> Iterator[FarPart]:
    """Yield a part, or the lower one and the higher ones on it where its roof has two heights."""
    high = _is_high(part.heights, step) if more else np.zeros(len(part.heights), bool)
    above: list[Polygon] = []
    if high.any():
        middles = part.cells[high]
        boxes = shapely.box(*(middles - CELL / 2.0).T, *(middles + CELL / 2.0).T)
        shape: Any = overlay.union_all(boxes, grid=None)
        # Together across gaps of a cell, and without what is thinner than one.
        for wider in (CELL, -1.5 * CELL, 0.5 * CELL):
            shape = overlay.buffer(shape, wider, join_style="mitre")
        shape = overlay.intersection(shape, part.outline, grid=None)
        above = [p for p in shapely.get_parts(shape).tolist() if isinstance(p, Polygon) and p.area > _LEAST]
    if not above:
        yield part
        return
    yield part.cut(part.outline, part.foot, ~high)
    floor = float(np.median(part.heights[~high])) - 0.5
    for shape in above:
        outline = _with_few_corners(Polygon(shape.exterior, [h for h in shape.interiors if Polygon(h).area > _YARD]))
        inside = high & shapely.contains_xy(outline, part.cells[:, 0], part.cells[:, 1])
        if not outline.is_empty and inside.any():
            yield from _levels(part.cut(outline, floor, inside), step, more - 1)


def _is_high(heights: NDArray[np.float64], step: float) -> NDArray[np.bool_]:
    """Return which heights are those of the higher of two roofs; none where one roof explains them."""
    n = len(heights)
    if n < 8:
        return np.zeros(n, bool)
    ordered = np.sort(heights)
    count = np.arange(1, n)
    sums = np.cumsum(ordered)
    low, high = sums[:-1] / count, (sums[-1] - sums[:-1]) / (n - count)
    best = int(np.argmax(count * (n - count) * (high - low) ** 2))
    share, apart = (best + 1) / n, high[best] - low[best]
    usual = apart > step and 0.1 < share < 0.9
    if not (usual or (apart > _TALL and n - best - 1 >= _TOWER)):
        return np.zeros(n, bool)
    return heights > (ordered[best] + ordered[best + 1]) / 2.0


_PARAPET = 0.6  # metres of a flat roof's rim above it, where the building is as high as that


def roof_over(building: Building, part: FarPart) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Make the roof over a part of a building.

    Parameters
    ----------
    building
        The building, for the shape of its roof and its height.
    part
        The part.

    Returns
    -------
    eaves, roof, gables
        How high the walls end, metres; the roof's triangles, and those of the walls between its slopes, which face
        outward, metres, shape ``(n, 3, 3)`` each.
    """
    limit = building.base + building.height
    none = np.zeros((0, 3, 3))
    level = min(float(np.median(part.heights)), limit)
    depth = shapely.distance(part.outline.boundary, shapely.points(part.cells))
    near = part.lows[depth < 0.75 * CELL]
    eaves = float(np.quantile(near, 0.25)) if len(near) else level
    ridge = min(float(np.quantile(part.heights, 0.95)), limit)
    if building.roof_shape == "flat" or ridge - eaves < 1.0 or len(part.cells) < 4:
        level = min(level + _PARAPET, limit)
        return level, _lying(part.outline, level), none
    corners = shapely.get_coordinates(part.outline.exterior)[:-1]
    if len(corners) == 4 and not part.outline.interiors and building.roof_shape not in ("mansard", "dome"):
        ridge = min(float(np.quantile(part.heights, 0.99)) + 0.2, limit)
        return eaves, *_ridge_roof(corners, eaves, ridge, hipped=building.roof_shape not in ("gabled", "gambrel"))
    widest = float(depth.max())
    inset = min(0.45 * widest, 3.0) if building.roof_shape in ("mansard", "dome") else 0.8 * widest
    flat = overlay.simplify(overlay.buffer(part.outline, -inset, join_style="mitre", mitre_limit=2.0), 0.5 * inset)
    deep = part.heights[depth >= inset]
    top = min(float(np.median(deep)), limit) if len(deep) else ridge
    if flat.is_empty or top - eaves < 0.5:
        level = min(level, limit)
        return level, _lying(part.outline, level), none
    slopes = _lying(overlay.difference(part.outline, flat, grid=None), eaves)
    inner = shapely.distance(part.outline.boundary, shapely.points(slopes[..., :2])) > 0.35 * inset
    slopes[..., 2] = np.where(inner, top, eaves)
    return eaves, np.concatenate([slopes, _lying(flat, top)]), none


def _lying(shape: Any, height: float) -> NDArray[np.float64]:
    """Return triangles that cover a shape at a height, counter-clockwise from above."""
    flat = shapely.get_coordinates(shapely.get_parts(shapely.constrained_delaunay_triangles(shape)))
    corners = np.full((len(flat) // 4, 3, 3), height)
    corners[..., :2] = flat.reshape(-1, 4, 2)[:, :3]
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T[:2], (corners[:, 2] - corners[:, 0]).T[:2]
    clockwise = ax * by - ay * bx < 0.0
    corners[clockwise] = corners[clockwise][:, ::-1]
    return corners


def _ridge_roof(
    corners: NDArray[np.float64], eaves: float, ridge: float, *, hipped: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the roof over four corners with a ridge along the longer sides, and its gables."""
    if np.linalg.norm(corners[1] - corners[0]) > np.linalg.norm(corners[2] - corners[1]):
        corners = np.roll(corners, -1, axis=0)  # the first side is a short one
    a, b, c, d = np.c_[corners, np.full(4, eaves)]
    first, last = np.r_[(a + b)[:2] / 2.0, ridge], np.r_[(c + d)[:2] / 2.0, ridge]
    if hipped:
        length = np.linalg.norm((last - first)[:2])
        pulled = min(float(np.linalg.norm(b - a)) / 2.0 / max(float(length), 1e-9), 0.49) * (last - first)
        first, last = first + pulled, last - pulled
    slopes = np.array([(b, c, last), (b, last, first), (d, a, first), (d, first, last)])
    ends = np.array([(a, b, first), (c, d, last)])
    return (np.concatenate([slopes, ends]), ends[:0]) if hipped else (slopes, ends)


_SECTORS = 8  # of directions that a building's walls have colours of their own for
_GLAZED = 0.01  # share of its light that a wall with windows gives of its own by night, at least
_LOWEST = 0.2  # metres; lower walls, and the roof over them, are left out


def far_houses(world: World, material: Material) -> Iterator[Surface]:
    """Make the houses of a world.

    Parameters
    ----------
    world
        The world.
    material
        What they are of where they have no windows; it has no texture.

    Returns
    -------
    iterator of Surface
        One of all roofs and blind walls, one of all walls with windows (`vico.world.far_colours`), flat-shaded, in the
        world's frame; vertices have the entities of their buildings. None where there are no houses.
    """
    buildings = world.buildings
    if not buildings:
        return
    walls, roofs = coloured_triangles(world.surfaces("buildings")), coloured_triangles(world.surfaces("roofs"))
    known = np.array([b.entity for b in buildings])
    order = np.argsort(known)

    def number(entity: NDArray[np.int32]) -> NDArray[np.int64]:
        """Return which building each one is of; -1 for none."""
        at = np.minimum(np.searchsorted(known, entity, sorter=order), len(known) - 1)
        return np.where(known[order[at]] == entity, order[at], -1)

    own = LINEAR[np.array([_rgb(b.colour) for b in buildings])]
    facades, shines = _wall_colours(walls, number(walls.entity), own, buildings)
    tops = _roof_colours(roofs, number(roofs.entity), 0.6 * own)
    up = roofs.where(roofs.normals[:, 2] > 0.2 * np.linalg.norm(roofs.normals, axis=1))
    triangle, place, _ = spread_points(up.corners, up.normals[:, 2], 1.0)
    of = number(up.entity)[triangle]
    by_building = np.argsort(of, kind="stable")
    place, starts = place[by_building], np.searchsorted(of[by_building], np.arange(len(known) + 1))
    pieces, windows = _Pieces(), _Pieces()
    for k, building in enumerate(buildings):
        outline = far_outline(building)
        if not outline.is_empty:
            parts = parts_by_height(world, building, outline, place[starts[k] : starts[k + 1]])
            for part in parts:
                eaves, *roof = roof_over(building, part)
                if eaves - part.foot >= _LOWEST:
                    _add_walls((pieces, windows), building, part, eaves, (facades[k], shines[k]))
                    _add_roof(pieces, building, roof, facades[k], tops[k])
    yield from pieces.surfaces(material)
    yield from windows.surfaces(WINDOWS)


class _Pieces:
    """Collects triangles: corners, colours in linear light, places in a picture, entities."""

    def __init__(self) -> None:
        self._corners: list[NDArray[np.float64]] = []
        self._colours: list[NDArray[np.float64]] = []
        self._places: list[NDArray[np.float64]] = []
        self._entities: list[NDArray[np.int32]] = []

    def add(
        self,
        corners: NDArray[np.float64],
        colour: NDArray[np.float64],
        entity: int,
        places: NDArray[np.float64] | None = None,
    ) -> None:
        """Add triangles ``(n, 3, 3)`` of an entity, of colours ``(n, 3, 3)`` or broadcast, at places ``(n, 3, 2)``."""
        count = len(corners)
        self._places.append(np.zeros((count, 3, 2)) if places is None else places)
        self._corners.append(corners)
        self._colours.append(np.broadcast_to(colour, (count, 3, 3)))
        self._entities.append(np.full(count, entity, np.int32))

    def surfaces(self, material: Material) -> list[Surface]:
        """Return them as one surface, flat-shaded; none where there are none."""
        if not self._corners:
            return []
        corners = np.concatenate(self._corners)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=1)
        seen = length > 1e-6
        corners, normals = corners[seen], normals[seen] / length[seen, None]
        count = 3 * len(corners)
        return [
            Surface(
                corners.reshape(-1, 3).astype(np.float32),
                np.repeat(normals, 3, axis=0).astype(np.float32),
                np.concatenate(self._places)[seen].reshape(-1, 2).astype(np.float32),
                srgb(np.concatenate(self._colours)[seen].reshape(-1, 3)),
                np.repeat(np.concatenate(self._entities)[seen], 3),
                np.arange(count, dtype=np.int32).reshape(-1, 3),
                material,
            )
        ]


def _rgb(colour: str) -> tuple[int, int, int]:
    text = colour.lstrip("#")
    try:
        return int(text[:2], 16), int(text[2:4], 16), int(text[4:6], 16)
    except ValueError:
        return 200, 196, 188


def _wall_colours(
    walls: ColouredTriangles, of: NDArray[np.int64], own: NDArray[np.float64], buildings: Sequence[Building]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return colours of walls at their foot and at their head, by building and direction, ``(n, _SECTORS, 2, 3)``.

    And how much of their light they give of their own by night, ``(n, _SECTORS)``. A fire wall is not like a front, and
    shops below are darker than the storeys above: of each a straight line is fitted to the colours over the height.
    """
    area = np.linalg.norm(walls.normals, axis=1)
    upright = (np.abs(walls.normals[:, 2]) < 0.5 * area) & (of >= 0)
    walls, of, area = walls.where(upright), of[upright], area[upright] * walls.cover[upright]
    base, tall = np.array([(b.base, max(b.height, 1.0)) for b in buildings]).T
    rise = (walls.corners[..., 2] - base[of, None]) / tall[of, None]
    at = rise.mean(axis=1)
    # Over a triangle: the square of its middle's height and how far its corners lie from that.
    square = at**2 + ((rise - at[:, None]) ** 2).sum(axis=1) / 12.0
    values = np.column_stack([walls.colour, at[:, None] * walls.colour, at, square, walls.shine])
    sums = sums_by(_SECTORS * of + _sector(walls.normals), area, values, _SECTORS * len(own)).reshape(-1, _SECTORS, 10)
    total = sums.sum(axis=1, keepdims=True)
    weight = np.maximum(total[..., 9:], 1e-9)
    mean = np.where(total[..., 9:] > 0.0, total[..., :3] / weight, 0.7 * own[:, None])
    # What few square metres of reveals face is no wall.
    enough = sums[..., 9:] > np.maximum(0.04 * total[..., 9:], 1e-9)
    weight = np.where(enough, sums[..., 9:], 1.0)
    middle, centre = np.where(enough, sums[..., :3] / weight, mean), sums[..., 6:7] / weight
    spread = sums[..., 7:8] / weight - centre**2
    slope = (sums[..., 3:6] / weight - centre * middle) / np.maximum(spread, 0.02)
    slope = np.where(enough, slope, 0.0)
    foot, head = (middle + slope * (end - centre) for end in (0.0, 1.0))
    colours = np.clip(np.stack([foot, head], axis=2), 0.6 * middle[:, :, None], 1.3 * middle[:, :, None])
    return colours, np.where(enough, sums[..., 8:9] / weight, 0.0)[..., 0]


def _sector(normals: NDArray[np.float64]) -> NDArray[np.int64]:
    turn = each(math.atan2, normals[..., 1], normals[..., 0]) / (2.0 * np.pi) * _SECTORS
    return np.round(turn).astype(np.int64) % _SECTORS


def _roof_colours(roofs: ColouredTriangles, of: NDArray[np.int64], own: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return colours of what lies and of what slopes, ``(n, 2, 3)``: slates around gravel are not both grey."""
    count = len(own)
    upward = (roofs.normals[:, 2] > 0.0) & (of >= 0)
    roofs, of = roofs.where(upward), of[upward]
    slopes = roofs.normals[:, 2] < 0.99 * np.linalg.norm(roofs.normals, axis=1)
    sums = sums_by(2 * of + slopes, roofs.normals[:, 2] * roofs.cover, roofs.colour, 2 * count).reshape(count, 2, 4)
    total = sums.sum(axis=1, keepdims=True)
    mean = np.where(total[..., 3:] > 0.0, total[..., :3] / np.maximum(total[..., 3:], 1e-9), own[:, None])
    enough = sums[..., 3:] > 0.1 * total[..., 3:]
    return np.where(enough, sums[..., :3] / np.maximum(sums[..., 3:], 1e-9), mean)


def _add_walls(
    pieces: tuple[_Pieces, _Pieces],
    building: Building,
    part: FarPart,
    eaves: float,
    looks: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Add the walls of a part of a building: blind ones to the first pieces, those with windows to the second."""
    facades, shines = looks
    for number, ring in enumerate((part.outline.exterior, *part.outline.interiors)):
        p = shapely.get_coordinates(ring)
        p, q = p[:-1], p[1:]
        along = q - p
        sector = _sector(np.column_stack([along[:, 1], -along[:, 0]]))
        low, high = np.full(len(p), part.foot), np.full(len(p), eaves)
        quads = np.stack([np.c_[p, low], np.c_[q, low], np.c_[q, high], np.c_[p, high]], axis=1)
        colours = facades[sector][:, [0, 0, 1, 1]]
        length, base = np.hypot(*along.T), max(part.foot, building.base)
        glazed = has_windows(length, eaves - base) & (shines[sector] > _GLAZED)
        places = window_uv(length, part.foot, min(base, eaves - 0.1), eaves, building.entity + number)
        for chosen, into, shown in ((~glazed, pieces[0], 1.0), (glazed, pieces[1], WINDOWS_MEAN)):
            for corners in ([0, 1, 2], [0, 2, 3]):
                found = quads[chosen][:, corners], colours[chosen][:, corners] / shown
                into.add(*found, building.entity, places[chosen][:, corners] if into is pieces[1] else None)


def _add_roof(
    pieces: _Pieces,
    building: Building,
    roof_and_gables: Sequence[NDArray[np.float64]],
    facades: NDArray[np.float64],
    tops: NDArray[np.float64],
) -> None:
    """Add the roof of a part of a building, with its gables."""
    roof, gables = roof_and_gables
    turn = np.cross(roof[:, 1] - roof[:, 0], roof[:, 2] - roof[:, 0])
    slopes = turn[:, 2] < 0.99 * np.linalg.norm(turn, axis=1)
    pieces.add(roof, tops[slopes.astype(np.int64)][:, None], building.entity)
    if len(gables):
        normals = np.cross(gables[:, 1] - gables[:, 0], gables[:, 2] - gables[:, 0])
        pieces.add(gables, facades[_sector(normals), 1][:, None], building.entity)
