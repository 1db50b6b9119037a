"""Streets of a tile as it and its neighbours have them: across a border they go on without a jog."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import shapely
from shapely import MultiPolygon, Polygon
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.seams.grid import HALO, STRIP, Tile, TileGrid

#: Fields of `StreetPolygons` that are polygons of one kind each.
KINDS = (
    "carriageway", "sidewalk", "crossing", "pedestrian", "path", "cycleway", "steps", "parking", "sunken",
)  # fmt: skip


def adopted(streets: Mapping[Tile, StreetPolygons], tile: Tile, grid: TileGrid) -> StreetPolygons:
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
    kinds = {kind: _joined({one: getattr(streets[one], kind) for one in zones}, zones, tile, grid) for kind in KINDS}
    names = sorted({name for one in zones for name in streets[one].paved})
    none = MultiPolygon()
    paved = {
        name: _joined({one: streets[one].paved.get(name, none) for one in zones}, zones, tile, grid) for name in names
    }
    return replace(own, **kinds, paved=paved)


def _zones(tile: Tile, grid: TileGrid) -> dict[Tile, BaseGeometry]:
    """Return where the streets are whose, in the tile's coordinates."""
    window = grid.box(tile, wider=HALO, seen_from=tile)
    claimed: BaseGeometry = Polygon()
    zones: dict[Tile, BaseGeometry] = {}
    around = grid.around(tile)
    for one in around:
        claim = _reaching(one, tile, grid)
        zones[one] = overlay.intersection(overlay.difference(claim, claimed), window)
        claimed = overlay.union(claimed, claim)
    rest = overlay.difference(window, claimed)
    zones[tile] = overlay.union(zones[tile], rest)
    return {one: zone for one, zone in zones.items() if zone.area > 0}


def _reaching(one: Tile, tile: Tile, grid: TileGrid) -> Polygon:
    """Return a tile's square with the strip, and beyond the city's edge all that lies before it."""
    west, south, east, north = grid.box(one, wider=STRIP, seen_from=tile).bounds
    far = 2 * grid.size
    return shapely.box(
        west - far * (one[0] == grid.first[0]),
        south - far * (one[1] == grid.first[1]),
        east + far * (one[0] == grid.last[0]),
        north + far * (one[1] == grid.last[1]),
    )


def _joined(
    shapes: Mapping[Tile, MultiPolygon], zones: Mapping[Tile, BaseGeometry], tile: Tile, grid: TileGrid
) -> MultiPolygon:
    parts: list[Polygon] = []
    for one, zone in zones.items():
        x, y = ((a - b) * grid.size for a, b in zip(one, tile, strict=True))
        there = translate(shapes[one], x, y)
        if not there.is_empty and there.intersects(zone):
            parts += polygons_of(overlay.intersection(there, zone))
    return MultiPolygon(polygons_of(overlay.union_all(parts))) if parts else MultiPolygon()
