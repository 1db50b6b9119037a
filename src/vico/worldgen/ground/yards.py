"""Kinds of open ground between houses that no map knows: gardens, lawns, lots of asphalt; else it is paved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmArea, OsmData
from vico.geo.overlay import polygons_of
from vico.worldgen.facts.fault_isolation import NamedShape, union_named
from vico.worldgen.facts.land_cover import mapped_areas
from vico.worldgen.facts.site import SiteFacts, on_the_ground
from vico.worldgen.ground.kerbs_and_banks import nodes_in_polygons
from vico.worldgen.ground.polygons import region_above

_SMALL = 320.0  # square metres of houses, wall to wall, up to which they have gardens
_MOSTLY = 0.55  # share of the built ground near by that such houses have, at least
_DENSE = 0.36  # share of built ground from which nothing is green
_BARE = 0.015  # share of built ground below which there are no homes
_LONELY = 0.002  # share of built ground up to which open ground is a field
_OPEN = 0.2  # share of built ground up to which yards are lawns: between slabs, not within blocks
_AROUND = 20.0  # metres, spread of what counts as near by
_BEYOND = 80.0  # metres beyond the square that are looked at, where the map has them: four spreads
_CELL = 4.0
_PAVED = 3.0  # metres along walls and kerbs that stay paved
_NARROW = 6.0  # metres of width up to which a lawn is none
_WORK = 15.0  # metres round a shed that belong to it
_SHEDS = {"industrial", "warehouse", "supermarket", "garages", "manufacture", "hangar", "depot", "factory", "silo"}
_WORKED, _TRADED = {"industrial", "garages", "port", "depot", "harbour"}, {"commercial", "retail"}


@dataclass(frozen=True)
class Yards:
    """Regions in which unmapped open ground is not paved as yards usually are; they don't overlap.

    Attributes
    ----------
    reach
        Half the side of the square they lie in, metres.
    gardens
        Among small houses that stand by themselves.
    lawns
        Where little is built: between slabs, round villas, on vacant land.
    lots
        Where land is used for work, round large sheds, and where little is built on land of trade: asphalt.
    mapped
        Areas of which the map says what the ground is, water among them: whatever lies there is no yard.
    """

    reach: float
    gardens: BaseGeometry = field(default_factory=shapely.MultiPolygon)
    lawns: BaseGeometry = field(default_factory=shapely.MultiPolygon)
    lots: BaseGeometry = field(default_factory=shapely.MultiPolygon)
    mapped: list[BaseGeometry] = field(default_factory=list)

    def by_look(self) -> dict[str, BaseGeometry]:
        """Return those that there are, by the kind of ground they look like."""
        regions = {"garden": self.gardens, "grass": self.lawns, "parking": self.lots}
        return {kind: region for kind, region in regions.items() if not region.is_empty}

    def green(self) -> BaseGeometry:
        """Return what is green."""
        return overlay.union(self.gardens, self.lawns)


def yards_of(site: SiteFacts, carriageway: BaseGeometry, *, reach: float) -> Yards:
    """Decide what yards are within a square of half side `reach`: regions with round borders.

    Parameters
    ----------
    site
        The map: its houses, what land is used for, and what the ground is where it says so.
    carriageway
        Where vehicles drive: yards are paved beside it.
    reach
        Metres.
    """
    osm = site.osm
    built = [area for area in osm.areas if _is_house(area)]
    if not built:
        return Yards(reach)
    houses = polygons_of(union_named([NamedShape(area.id, area.polygon) for area in built], grid=0.01))
    beyond = min(_BEYOND, max(osm.half + osm.margin - reach, 0.0) // _CELL * _CELL)
    n = round(2 * (reach + beyond) / _CELL)
    cell = 2 * (reach + beyond) / n
    # What a lawn is at the edge of the square is decided by what lies beyond it, too: a neighbour goes on with it.
    outer = reach + min(beyond, 3 * _CELL)
    around, window = shapely.box(-outer, -outer, outer, outer), shapely.box(-reach, -reach, reach, reach)
    total = _share(houses, n, cell)
    small = _share([house for house in houses if house.area <= _SMALL], n, cell)
    gardens = _region(np.minimum(small - _MOSTLY * np.maximum(total, _BARE), _DENSE - total), cell, around)
    kept = [overlay.buffer(shape, _PAVED) for shape in (*houses, *polygons_of(carriageway)) if shape.intersects(around)]
    lived_in = _region(np.minimum(_OPEN - total, total - _LONELY), cell, around)
    free = overlay.difference(overlay.difference(lived_in, overlay.union_all(kept)), gardens)
    wide = overlay.buffer(overlay.buffer(free, -_NARROW / 2, quad_segs=2), _NARROW / 2, quad_segs=2)
    wide = overlay.difference(overlay.on_grid(overlay.simplify(wide, 0.2), grid=0.001), gardens)
    traded = overlay.intersection(wide, _land(osm, _TRADED, around))
    lots = overlay.difference(
        overlay.union_all([_land(osm, _WORKED, around), _round_sheds(built, around), traded]), gardens
    )
    parts = (gardens, overlay.difference(wide, lots), lots)
    mapped = [named.shape for areas in mapped_areas(site, window).values() for named in areas]
    gardens, lawns, lots = (overlay.areas_of(overlay.intersection(part, window)) for part in parts)
    return Yards(reach, gardens, lawns, lots, mapped)


def _is_house(area: OsmArea) -> bool:
    kind = area.tags.get("building", "no")
    return kind not in ("no", "roof", "carport", "bridge", "ruins") and on_the_ground(area.tags)


def _share(shapes: Sequence[shapely.Polygon], n: int, cell: float) -> NDArray[np.float64]:
    """Return what share of the ground near by shapes cover, at the middles of the cells of a grid."""
    mask = nodes_in_polygons(shapes, n, (n - 1) * cell / 2, cell).astype(np.float64)
    return np.asarray(ndimage.gaussian_filter(mask, _AROUND / cell, mode="nearest"), np.float64)


def _region(values: NDArray[np.float64], cell: float, window: shapely.Polygon) -> BaseGeometry:
    """Return where values are positive, within a window."""
    bent = overlay.simplify(region_above(values, 0.0, low=-(len(values) - 1) * cell / 2, cell=cell), 0.4)
    return overlay.on_grid(overlay.areas_of(overlay.intersection(bent, window)), grid=0.001)


def _land(osm: OsmData, uses: set[str], window: shapely.Polygon) -> BaseGeometry:
    """Return the land that is mapped as used for something."""
    found = [NamedShape(area.id, area.polygon) for area in osm.areas if area.tags.get("landuse") in uses]
    return union_named([area for area in found if area.shape.intersects(window)], grid=0.01)


def _round_sheds(built: Sequence[OsmArea], window: shapely.Polygon) -> BaseGeometry:
    """Return the land round large sheds."""
    found = [
        NamedShape(area.id, overlay.buffer(area.polygon, _WORK, quad_segs=2))
        for area in built
        if area.tags["building"] in _SHEDS and area.polygon.area > _SMALL and area.polygon.intersects(window)
    ]
    return union_named(found, grid=0.01)
