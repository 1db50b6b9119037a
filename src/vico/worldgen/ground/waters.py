"""Open water: which bodies there are, how high their surfaces lie, and the pieces of them that are seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.geo.osm import OsmData
from vico.geo.overlay import polygons_of
from vico.world.heights import HeightField
from vico.worldgen.facts.expendable import NamedShape, changed, named_parts, united
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.facts.tags import on_the_ground
from vico.worldgen.facts.waters import WaterBody

Floats = NDArray[np.float64]

_FREEBOARD, _FREEBOARD_SMALL, _BRIM = 1.3, 0.4, 0.12  # metres from banks down to waters, ponds, basins
_SMALL, _BASIN = 2500.0, 150.0  # square metres
_PARTED = 24.0  # metres between pieces that only a bridge parts
_CORNER = 1.0  # metres
_MOST = 400  # points of a body's banks
_MOST_OF_CITY = 1000


@dataclass(frozen=True)
class Water:
    """A piece of open water.

    Attributes
    ----------
    polygon
        Where it is seen, metres.
    body
        What it is a piece of.
    """

    polygon: Polygon
    body: WaterBody

    def level(self, xy: Floats) -> Floats:
        """Height of the surface at points, shape ``(n, 2)``, metres."""
        return self.body.level(xy)


def piped_waters(osm: OsmData) -> list[NamedShape]:
    """Waters that the map has under the ground: under bridges too, where what flows on is the same water."""
    return [
        NamedShape(area.id, area.polygon)
        for area in osm.areas
        if area.tags.get("natural") == "water" and not on_the_ground(area.tags)
    ]


def open_water(site: SiteFacts, height: HeightField, pieces: Sequence[Polygon]) -> list[Water]:
    """Return the waters of a map with their surfaces: level, or as gently sloped as their banks.

    Parameters
    ----------
    site
        The map. Of a part of a city it knows the bodies of water of all the city: theirs the pieces are.
    height
        The smooth ground counts, for what no known body holds.
    pieces
        `ground_partition`'s waters. Pieces that only a bridge parts belong together.
    """
    if not pieces:
        return []
    known = list(site.waters or [])
    outlines = [body.outline for body in known] or _outlines([*named_parts("water", pieces), *piped_waters(site.osm)])
    bodies = dict(enumerate(known))
    tree = shapely.STRtree(outlines)
    waters = []
    for piece in pieces:
        # Sharp corners reach a little out of the outlines, which are rounded.
        hits = tree.query_nearest(piece.representative_point(), max_distance=_CORNER)
        if not len(hits):
            waters.append(Water(piece, _body(height, piece, _MOST)))
            continue
        number = int(hits.min())
        if number not in bodies:
            bodies[number] = _body(height, outlines[number], _MOST)
        waters.append(Water(piece, bodies[number]))
    return waters


def water_bodies(height: HeightField, waters: Sequence[NamedShape]) -> list[WaterBody]:
    """Return the bodies that mapped waters are, those under the ground among them; their banks lie on `height`."""
    return [_body(height, outline, _MOST_OF_CITY) for outline in _outlines(waters)]


def _outlines(waters: Sequence[NamedShape]) -> list[Polygon]:
    wide = changed(waters, lambda shapes: overlay.buffer(shapes, _PARTED / 2, quad_segs=2))
    return polygons_of(overlay.buffer(united(wide), 0.5 - _PARTED / 2, quad_segs=2))


def _body(height: HeightField, outline: Polygon, most: int) -> WaterBody:
    """Find how high a body's banks lie, at so many points, and how far below them its surface."""
    reach = height.half - 1.0
    inside = overlay.intersection(outline, shapely.box(-reach, -reach, reach, reach))
    spacing = min(max(outline.exterior.length / 200.0, 2.0), 12.0)
    shore = shapely.get_coordinates(
        shapely.segmentize(inside.boundary if not inside.is_empty else outline.boundary, spacing)
    )
    levels = height.smooth(shore)
    drop = _FREEBOARD if outline.area > _SMALL else _FREEBOARD_SMALL if outline.area > _BASIN else _BRIM
    if float(np.ptp(levels)) < 2.0 or outline.area < _SMALL:
        lowest = levels.min(keepdims=True) if outline.area < _SMALL else np.percentile(levels, [15.0])
        return WaterBody(outline, shore[:1], lowest, drop)
    step = max(len(shore) // most, 1)
    return WaterBody(outline, shore[::step], levels[::step], drop)
