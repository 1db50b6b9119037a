"""A map that is read once, and cut to squares that lie side by side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData
from vico.geo.overlay import polygons_of


class OsmParts:
    """Cuts squares out of a map.

    Parameters
    ----------
    data
        The whole map.
    """

    def __init__(self, data: OsmData) -> None:
        self._data = data
        self._nodes = np.array([node.xy for node in data.nodes]).reshape(-1, 2)
        self._ways = shapely.STRtree([shapely.LineString(way.line) for way in data.ways])
        self._areas = shapely.STRtree([area.polygon for area in data.areas])
        # A closed way that is an area is there if the area is, not its outline alone.
        filled = {area.id for area in data.areas}
        self._outlines = {f"w{way.id}": k for k, way in enumerate(data.ways) if f"w{way.id}" in filled}

    def within(self, *, half: float, margin: float, east: float, north: float) -> OsmData:
        """Return what lies in a square or touches it, as `read_osm` would read it there.

        Parameters
        ----------
        half, margin
            Half the side of the square, and how far around it things are kept, metres.
        east, north
            Its middle, metres from that of the whole map; what is found is told from there.
        """
        whole, shift, reach = self._data, np.array([east, north]), half + margin
        frame = LocalFrame(whole.frame.lat, whole.frame.lon, whole.frame.east + east, whole.frame.north + north)
        window = shapely.box(east - reach, north - reach, east + reach, north + reach)
        inside = np.flatnonzero(np.abs(self._nodes - shift).max(axis=1, initial=0.0) <= reach)
        nodes = [replace(whole.nodes[k], xy=whole.nodes[k].xy - shift) for k in inside.tolist()]
        areas = [
            replace(whole.areas[k], polygon=_translate(whole.areas[k].polygon, shift))
            for k in _touching_shapes(self._areas, window)
        ]
        here = {area.id for area in areas}
        lines = set(_touching_shapes(self._ways, window)).difference(self._outlines.values())
        lines.update(self._outlines[key] for key in here if key in self._outlines)
        ways = [replace(whole.ways[k], line=whole.ways[k].line - shift) for k in sorted(lines)]
        kept = {("w", way.id) for way in ways} | {("n", node.id) for node in nodes}
        relations = [one for one in whole.relations if any((kind, ref) in kept for kind, ref, _ in one.members)]
        ids = {f"w{way.id}" for way in ways} | here
        broken = [(key, reason) for key, reason in whole.broken if key in ids]
        return replace(
            whole,
            frame=frame,
            half=half,
            margin=margin,
            nodes=nodes,
            ways=ways,
            areas=areas,
            relations=relations,
            broken=broken,
            covered=None,
            sea=None
            if whole.sea is None
            else [
                _translate(part, shift)
                for shape in whole.sea
                for part in polygons_of(overlay.intersection(shape, window))
            ],
        )


def _touching_shapes(tree: shapely.STRtree, window: Polygon) -> list[int]:
    """Return the numbers of the shapes that touch a window, in their order."""
    return sorted(tree.query(window, predicate="intersects").tolist())


def _translate(shape: BaseGeometry, shift: NDArray[np.float64]) -> BaseGeometry:
    return shapely.transform(shape, lambda points: points - shift)
