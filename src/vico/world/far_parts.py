"""Parts of a building from afar: prisms over outlines of few corners, divided by the heights of its roofs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.world.model import OPEN_KINDS, Building
from vico.world.world import World

CELL = 2.0
"""Metres; the side of the cells in which a roof's height is looked at."""

_HIDDEN = 4.0  # metres; how far below a roof floors are hidden
_FOOT = 0.6  # metres that walls reach below the ground
_TOLERANCES = (1.5, 3.0, 4.5)  # metres; the first after which an outline has few enough corners
_CORNERS, _PER_CORNER = 6, 1000.0  # corners that an outline may have, and square metres for each one more
_YARD = 150.0  # square metres; smaller yards are roofed over
_SLAB = 0.6  # metres; of roofs that are open below
_LEAST = 24.0  # square metres of what is drawn higher than the rest
_HUT = 50.0  # square metres; smaller outlines have four corners
_STEP, _PITCHED_STEP = 3.0, 5.0  # metres between the heights of roofs that are drawn as two
_TALL, _TOWER = 8.0, 6  # ... between those of a tower and the rest; cells that it has at least
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
    return _with_few_corners(_largest(overlay.mended(Polygon(rings[0], holes))))


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
    """Tell which heights are those of the higher of two roofs; none where one roof explains them."""
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
