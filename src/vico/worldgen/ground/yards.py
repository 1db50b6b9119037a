"""Which yards are gardens: the open ground among small houses that stand by themselves."""

from __future__ import annotations

import numpy as np
import shapely
from scipy import ndimage
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData, polygons_of
from vico.worldgen.facts.expendable import NamedShape, united
from vico.worldgen.facts.tags import on_the_ground
from vico.worldgen.ground.contours import region_above
from vico.worldgen.ground.kerbs import filled

_SMALL = 320.0  # square metres of houses, wall to wall, up to which they have gardens
_MOSTLY = 0.55  # share of the built ground near by that such houses have, at least
_DENSE, _BARE = 0.36, 0.015  # shares of built ground from which nothing is green, and below which nobody lives
_AROUND = 20.0  # metres, spread of what counts as near by
_CELL = 4.0


def gardens_of(osm: OsmData, reach: float) -> BaseGeometry:
    """Return where yards are gardens within a square of half side `reach`: a region with round borders."""
    built = [
        NamedShape(area.id, area.polygon)
        for area in osm.areas
        if area.tags.get("building", "no") not in ("no", "roof", "carport", "bridge", "ruins")
        and on_the_ground(area.tags)
    ]
    if not built:
        return shapely.MultiPolygon()
    houses = polygons_of(united(built, grid=0.01))
    n = round(2 * reach / _CELL)
    cell = 2 * reach / n
    half = reach - cell / 2
    spread = _AROUND / cell

    def share(shapes: list[shapely.Polygon]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        mask = filled(shapes, n, half, cell).astype(np.float64)
        return np.asarray(ndimage.gaussian_filter(mask, spread, mode="nearest"), np.float64)

    total = share(houses)
    small = share([house for house in houses if house.area <= _SMALL])
    fit = np.minimum(small - _MOSTLY * np.maximum(total, _BARE), _DENSE - total)
    region = overlay.simplify(region_above(fit, 0.0, low=-half, cell=cell), 0.4)
    return overlay.on_grid(region, grid=0.001)
