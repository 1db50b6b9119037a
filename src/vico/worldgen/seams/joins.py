"""The grid of a city's tiles, and how a tile's heights, streets and drawn ground are joined with its neighbours'.

Heights and streets at a spot are the same, whichever tile looks; across a border streets go on without a jog. What
one tile draws along a border, the other one meets point by point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.world.city import ABOVE, ALIKE, NEAR, SAME, Profile, Side, edges_on, profile_of
from vico.world.heights import HeightField, Steps
from vico.world.mesh import Surface
from vico.worldgen.facts.building_plans import BuildingPlans
from vico.worldgen.facts.streets import StreetPolygons

#: Column and row of a tile, east and north of the tile (0, 0) around the city's centre.
Tile = tuple[int, int]

HALO = 100.0
"""Metres around a tile of which its streets and heights are made, too: what is further away decides next to nothing."""

STRIP = 2.0
"""Metres on both sides of a border where streets are those of the tile that comes first."""

BLEND = 32.0
"""Metres on both sides of a border over which heights pass from one tile's to the other's."""


@dataclass(frozen=True)
class TileGrid:
    """Square tiles around a centre; the same spot is in the same tile however large the city is.

    Attributes
    ----------
    size
        Side of a tile, metres: a multiple of 8, so that the cells of all fields meet at borders.
    first, last
        The south-western and the north-eastern tile.
    """

    size: float
    first: Tile
    last: Tile

    def __iter__(self) -> Iterator[Tile]:
        """Row by row from the south, each from the west: the order in which tiles come first."""
        for row in range(self.first[1], self.last[1] + 1):
            for column in range(self.first[0], self.last[0] + 1):
                yield column, row

    def __len__(self) -> int:
        return (self.last[0] - self.first[0] + 1) * (self.last[1] - self.first[1] + 1)

    def __contains__(self, tile: object) -> bool:
        if not (isinstance(tile, tuple) and len(tile) == 2):
            return False
        return all(a <= k <= b for a, k, b in zip(self.first, tile, self.last, strict=True))

    @property
    def reach(self) -> int:
        """How many tiles there are from the middle one to the side that is farthest from it."""
        return max(abs(k) for k in (*self.first, *self.last))

    @property
    def half(self) -> float:
        """Half the side of the square around the middle tile that holds all tiles, metres."""
        return (self.reach + 0.5) * self.size

    @property
    def edges(self) -> tuple[float, float, float, float]:
        """West, south, east and north of all tiles, metres from the middle one's middle."""
        (west, south), (east, north) = self.first, self.last
        reach = self.size / 2
        return west * self.size - reach, south * self.size - reach, east * self.size + reach, north * self.size + reach

    def place(self, tile: Tile) -> Tile:
        """Return which column and row of that square a tile is, counted from its south-western corner."""
        return tile[0] + self.reach, tile[1] + self.reach

    def centre(self, tile: Tile) -> tuple[float, float]:
        """Return a tile's middle, metres east and north of the city's centre."""
        return tile[0] * self.size, tile[1] * self.size

    def around(self, tile: Tile) -> list[Tile]:
        """Return a tile and its neighbours, those across a corner among them, in the order of the grid."""
        found = [(tile[0] + dx, tile[1] + dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
        return [one for one in found if one in self]

    def nearest(self, tile: Tile) -> Tile:
        """Return a tile itself, or the one next to it where the city has ended."""
        column, row = (min(max(k, a), b) for a, k, b in zip(self.first, tile, self.last, strict=True))
        return column, row

    def box(self, tile: Tile, *, wider: float = 0.0, seen_from: Tile = (0, 0)) -> Polygon:
        """Return a tile's square, widened by some metres, in the coordinates of another tile."""
        x, y = ((a - b) * self.size for a, b in zip(tile, seen_from, strict=True))
        reach = self.size / 2 + wider
        return shapely.box(x - reach, y - reach, x + reach, y + reach)


def grid_of(extent: float, size: float) -> TileGrid:
    """Return the grid that covers a square around the centre, `extent` metres wide: 2 n + 1 tiles a side."""
    more = max(0, -int(-(extent / size - 1.0) // 2))
    return TileGrid(size, (-more, -more), (more, more))


def grid_over(low: tuple[float, float], high: tuple[float, float], size: float) -> TileGrid:
    """Return the grid that covers a rectangle, given by two corners in metres east and north of the centre in it."""
    first = [math.floor(k / size + 0.5) for k in low]
    last = [math.ceil(k / size + 0.5) - 1 for k in high]
    return TileGrid(size, (min(first[0], 0), min(first[1], 0)), (max(last[0], 0), max(last[1], 0)))


def tile_name(tile: Tile) -> str:
    """Return the name of a tile's folder."""
    return f"{tile[0]}_{tile[1]}"


Floats = NDArray[np.float64]


def crop_heights(field: HeightField, *, half: float, east: float = 0.0, north: float = 0.0) -> HeightField:
    """Cut a square out of a field along its cells.

    Parameters
    ----------
    field
        Any field without decks and stairs.
    half
        Half the side of the square, metres.
    east, north
        Its middle; the result is told from there.
    """
    if field.heights.size == 4 and not np.ptp(field.heights):
        heights = field.heights
    else:
        heights = _cut(field.heights, field.half, half, east, north)
    steps = field.steps
    if steps is not None:
        steps = Steps(*(_cut(part, field.half, half, east, north) for part in (steps.edge, steps.low, steps.high)))
    return replace(field, heights=heights, half=half, steps=steps)


def blend_heights(fields: Mapping[Tile, HeightField], tile: Tile, grid: TileGrid) -> HeightField:
    """Return a tile's heights, which pass to its neighbours' across its borders.

    Parameters
    ----------
    fields
        Of the tile and all its neighbours, each over its own square and what lies around that.
    tile, grid
        Which tile, of which grid.

    Returns
    -------
    HeightField
        Over the square of the tile's own field. Smooth heights are weighted by how far a spot is from the borders,
        edges are those of the tile that a spot lies in. A neighbour computes the very same numbers.
    """
    own = fields[tile]
    heights = own.heights
    if any(field.heights.size > 4 or float(field.heights[0, 0]) for field in fields.values()):
        n = max(field.heights.shape[0] for field in fields.values())
        axis = np.linspace(-own.half, own.half, n)
        total = np.zeros((len(axis), len(axis)))
        weights = np.zeros_like(total)
        for one, (wx, wy) in _weights(tile, grid, axis).items():
            weight = wy[:, None] * wx[None, :]
            rows, columns = np.nonzero(weight)
            if not len(rows):
                continue
            away = [(a - b) * grid.size for a, b in zip(tile, one, strict=True)]
            there = np.stack([axis[columns] + away[0], axis[rows] + away[1]], axis=1)
            total[rows, columns] += weight[rows, columns] * fields[one].smooth(there)
            weights += weight
        heights = (total / weights).astype(np.float32)
    return replace(own, heights=heights, steps=_edges(fields, tile, grid))


def _weights(tile: Tile, grid: TileGrid, axis: Floats) -> dict[Tile, tuple[Floats, Floats]]:
    """Return how much each tile around has to say along both axes; those beyond the city's edge speak for its edge."""

    def share(k: int) -> Floats:
        return np.clip((grid.size / 2 + BLEND - np.abs(axis - k * grid.size)) / (2 * BLEND), 0.0, 1.0)

    along: list[dict[int, Floats]] = []
    for which in (0, 1):
        found: dict[int, Floats] = {}
        for k in (-1, 0, 1):
            there = [tile[0], tile[1]]
            there[which] += k
            nearest = grid.nearest((there[0], there[1]))[which]
            found[nearest] = found.get(nearest, np.zeros(len(axis))) + share(k)
        along.append(found)
    return {(column, row): (along[0][column], along[1][row]) for row in sorted(along[1]) for column in sorted(along[0])}


def _edges(fields: Mapping[Tile, HeightField], tile: Tile, grid: TileGrid) -> Steps | None:
    own = fields[tile]
    there = {one: field.steps for one, field in fields.items()}
    n = max((len(steps.edge) for steps in there.values() if steps is not None), default=0)
    if not n:
        return None
    axis = np.linspace(-own.half, own.half, n)
    cell = axis[1] - axis[0]
    column, row = (np.floor(axis / grid.size + 0.5).astype(int) + k for k in tile)
    edge, low, high = np.full((n, n), 127, np.int8), np.zeros((n, n), np.int16), np.zeros((n, n), np.int16)
    for one in grid.around(tile):
        steps = there[one]
        if steps is None:
            continue
        mine = [
            np.flatnonzero([grid.nearest(_at(k, which, tile))[which] == one[which] for k in line])
            for which, line in ((0, column), (1, row))
        ]
        shift = [round((a - b) * grid.size / cell) for a, b in zip(tile, one, strict=True)]
        x, y = mine[0] + shift[0], mine[1] + shift[1]
        kept_x, kept_y = (x >= 0) & (x < n), (y >= 0) & (y < n)
        target = np.ix_(mine[1][kept_y], mine[0][kept_x])
        source = np.ix_(y[kept_y], x[kept_x])
        edge[target], low[target], high[target] = steps.edge[source], steps.low[source], steps.high[source]
    return Steps(edge, low, high)


def _at(k: int, which: int, tile: Tile) -> Tile:
    return (int(k), tile[1]) if which == 0 else (tile[0], int(k))


def _cut(values: NDArray[Any], whole: float, half: float, east: float, north: float) -> NDArray[Any]:
    n = len(values)
    cell = 2 * whole / (n - 1)
    count = round(2 * half / cell) + 1
    i, j = round((whole + east - half) / cell), round((whole + north - half) / cell)
    return np.ascontiguousarray(values[j : j + count, i : i + count])


#: Fields of `StreetPolygons` that are polygons of one kind each.
KINDS = (
    "carriageway", "sidewalk", "crossing", "pedestrian", "path", "cycleway", "steps", "parking", "sunken",
)  # fmt: skip


def _join_streets(streets: Mapping[Tile, StreetPolygons], tile: Tile, grid: TileGrid) -> StreetPolygons:
    """Return a tile's streets; near and beyond its borders they are its neighbours'.

    Within `STRIP` metres of a border they are those of the tile that comes first in the grid. So both sides cut the
    same polygons. Lines and crossings, of which polygons were made, stay the tile's own: they reach beyond it.

    Parameters
    ----------
    streets
        Of the tile and all its neighbours, each in its own coordinates.
    tile, grid
        Which tile, of which grid.
    """
    zones = _zones(tile, grid)
    own = streets[tile]
    kinds = {
        kind: _join_shapes({one: getattr(streets[one], kind) for one in zones}, zones, tile, grid) for kind in KINDS
    }
    names = sorted({name for one in zones for name in streets[one].paved})
    none = MultiPolygon()
    paved = {
        name: _join_shapes({one: streets[one].paved.get(name, none) for one in zones}, zones, tile, grid)
        for name in names
    }
    return replace(own, **kinds, paved=paved)


def _zones(tile: Tile, grid: TileGrid) -> dict[Tile, BaseGeometry]:
    """Return where the streets are whose, in the tile's coordinates."""
    window = grid.box(tile, wider=HALO, seen_from=tile)
    claimed: BaseGeometry = Polygon()
    zones: dict[Tile, BaseGeometry] = {}
    around = grid.around(tile)
    for one in around:
        # A tile claims its square with the strip, and beyond the city's edge all that lies before it.
        west, south, east, north = grid.box(one, wider=STRIP, seen_from=tile).bounds
        far = 2 * grid.size
        claim = shapely.box(
            west - far * (one[0] == grid.first[0]),
            south - far * (one[1] == grid.first[1]),
            east + far * (one[0] == grid.last[0]),
            north + far * (one[1] == grid.last[1]),
        )
        zones[one] = overlay.intersection(overlay.difference(claim, claimed), window)
        claimed = overlay.union(claimed, claim)
    rest = overlay.difference(window, claimed)
    zones[tile] = overlay.union(zones[tile], rest)
    return {one: zone for one, zone in zones.items() if zone.area > 0}


def _join_shapes(
    shapes: Mapping[Tile, MultiPolygon], zones: Mapping[Tile, BaseGeometry], tile: Tile, grid: TileGrid
) -> MultiPolygon:
    parts: list[Polygon] = []
    for one, zone in zones.items():
        x, y = ((a - b) * grid.size for a, b in zip(one, tile, strict=True))
        there = translate(shapes[one], x, y)
        if not there.is_empty and there.intersects(zone):
            parts += polygons_of(overlay.intersection(there, zone))
    return MultiPolygon(polygons_of(overlay.union_all(parts))) if parts else MultiPolygon()


#: Product of the city's streets that a tile is given: its part of them.
CUT = "cut"
#: Product with what of the map lies in a tile and around it.
MAP = "map"
#: Product with the city's bodies of water in a tile and around it, as the whole city has them.
WATERS = "waters"
#: Product with the city's tunnels in a tile and around it.
BORES = "near bores"
#: Product of a tile's own streets and ground made one with its neighbours'.
JOINED = "seams"


@dataclass(frozen=True)
class TilePlace:
    """Which tile of which city a world is.

    Attributes
    ----------
    grid, tile
        The grid, and the tile's column and row.
    plans
        Folder of the folders with what all tiles planned: streets and graded ground.
    """

    grid: TileGrid
    tile: Tile
    plans: Path

    @property
    def own(self) -> Path:
        """Folder of what this tile planned."""
        return self.folder(self.tile)

    def folder(self, tile: Tile) -> Path:
        """Return the folder of what a tile planned."""
        return self.plans / tile_name(tile)


@dataclass(frozen=True)
class JoinedTile:
    """Parts of a tile's plan that depend on its neighbours."""

    streets: StreetPolygons
    height: HeightField


def join_neighbours(
    grid: TileGrid, tile: Tile, streets: list[StreetPolygons], heights: list[HeightField], *, apron: float
) -> JoinedTile:
    """Make a tile's streets and heights one with its neighbours'.

    Parameters
    ----------
    grid, tile
        Which tile.
    streets, heights
        Of the tile and its neighbours, in the order of `TileGrid.around`.
    apron
        How far the heights go on beyond the tile, metres.
    """
    around = grid.around(tile)
    height = blend_heights(dict(zip(around, heights, strict=True)), tile, grid)
    return JoinedTile(
        _join_streets(dict(zip(around, streets, strict=True)), tile, grid),
        crop_heights(height, half=grid.size / 2 + apron),
    )


def split_buildings(plans: BuildingPlans, grid: TileGrid, tile: Tile) -> tuple[BuildingPlans, list[Polygon]]:
    """Return the buildings whose middle lies in a tile, and the footprints of those around it that other tiles have.

    What has its middle beyond the city stands in no tile: there is open ground.
    """
    square, (x, y) = grid.box(tile, seen_from=tile), grid.centre(tile)
    west, south, east, north = grid.edges
    city = shapely.box(west - x, south - y, east - x, north - y)
    middles = [plan.outline.centroid for plan in plans.plans]
    mine = [plan for plan, middle in zip(plans.plans, middles, strict=True) if square.contains(middle)]
    others = [
        plan
        for plan, middle in zip(plans.plans, middles, strict=True)
        if city.contains(middle) and not square.contains(middle)
    ]
    return BuildingPlans(mine, plans.dropped), [shape.shape for shape in BuildingPlans(others, []).standing()]


_HEIGHT_COUNTS = 0.01  # what a metre of height counts beside one along the border
_SLIP = 0.15  # metres along the border that both sides may disagree where one kind of ground ends


def fit_border(surfaces: Sequence[Surface], side: Side, first: Profile) -> list[Surface]:
    """Return surfaces that meet what the tile across a side draws.

    Points on the side come to lie on the other's edges, and edges get the other's corners: no gap, and no step but
    where both have one.

    Parameters
    ----------
    surfaces
        The ground.
    side
        Which of its sides.
    first
        What is drawn there by the tile that comes first.
    """
    return [surface if surface.material.name in ABOVE else _fit_surface(surface, side, first) for surface in surfaces]


def _fit_surface(surface: Surface, side: Side, first: Profile) -> Surface:
    positions = surface.positions.copy()
    on = np.flatnonzero(side.on(positions))
    if not len(on) or not len(first.start):
        return surface
    along = 1 - side.axis
    t, z = (positions[on, k].astype(np.float64) for k in (along, 2))
    stuff = surface.material.name
    wanted = first.heights(t, z, stuff)
    # Where a kind of ground ends a little earlier or later than across the border, it ends there, too.
    theirs = first.ends(stuff)
    for at, height in profile_of([surface], side).ends(stuff).tolist() if len(theirs) else []:
        # Of ends at one spot, of a drive and of the stone beside it, that at the same height.
        rise = np.abs(theirs[:, 1] - height)
        away = np.abs(theirs[:, 0] - at) + _HEIGHT_COUNTS * rise
        off = np.where(rise <= NEAR, away, np.inf)
        if not np.isfinite(off).any():
            off = np.where(rise <= ALIKE, away, np.inf)
        best = int(off.argmin())
        if off[best] <= _SLIP:
            here = (np.abs(t - at) < SAME) & (np.abs(z - height) < SAME)
            t[here], wanted[here] = theirs[best]
    known = np.isfinite(wanted)
    positions[on[known], along], positions[on[known], 2] = t[known], wanted[known]
    return _divide_edges(replace(surface, positions=positions), side, first)


def _divide_edges(surface: Surface, side: Side, first: Profile) -> Surface:
    """Put the other tile's corners into the edges on a side."""
    edges = edges_on(surface, side)
    corners = np.unique(np.r_[first.start, first.end])
    new: list[tuple[int, int, float, float]] = []  # the edge's ends, the share of the second, the height
    fans: dict[int, list[int]] = {}
    count = len(surface.positions)
    for a, b, face in edges.tolist():
        ends = surface.positions[[a, b]].astype(np.float64)
        t, z = ends[:, 1 - side.axis], ends[:, 2]
        between = corners[(corners > min(t) + SAME) & (corners < max(t) - SAME)]
        if not len(between):
            continue
        share = (between - t[0]) / (t[1] - t[0])
        height = first.heights(between, z[0] + share * (z[1] - z[0]), surface.material.name)
        order = np.argsort(share, kind="stable")
        chain = [a]
        for k in order[np.isfinite(height[order])].tolist():
            chain.append(count + len(new))
            new.append((a, b, float(share[k]), float(height[k])))
        if len(chain) > 1:
            fans[face] = [*chain, b]
    if not new:
        return surface
    triangles: list[list[int]] = []
    for face, triangle in enumerate(surface.triangles.tolist()):
        if face not in fans:
            triangles.append(triangle)
            continue
        corners_of = fans[face]
        apex = next(k for k in triangle if k not in (corners_of[0], corners_of[-1]))
        triangles += [[apex, one, two] for one, two in pairwise(corners_of)]
    a, b = (np.array([row[k] for row in new]) for k in (0, 1))
    share = np.array([row[2] for row in new])[:, None]

    def between_ends(values: NDArray[np.generic]) -> Floats:
        return np.asarray(values[a] * (1.0 - share) + values[b] * share, np.float64)

    added = between_ends(surface.positions)
    added[:, 2] = [row[3] for row in new]
    added[:, side.axis] = side.at
    normals = between_ends(surface.normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return replace(
        surface,
        positions=np.concatenate([surface.positions, added.astype(np.float32)]),
        normals=np.concatenate([surface.normals, normals.astype(np.float32)]),
        uv=np.concatenate([surface.uv, between_ends(surface.uv).astype(np.float32)]),
        colour=np.concatenate([surface.colour, np.round(between_ends(surface.colour)).astype(np.uint8)]),
        entity=np.concatenate([surface.entity, surface.entity[a]]),
        triangles=np.array(triangles, np.int32),
    )
