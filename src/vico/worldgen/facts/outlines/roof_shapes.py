"""Which roof shapes there are, by what names they go, and the prisms that all of them are cut from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import manifold3d
import numpy as np
import shapely
from manifold3d import CrossSection, Manifold
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo.buildings import RoofFacet

SHAPES = (
    "flat",
    "gabled",
    "hipped",
    "half-hipped",
    "side_hipped",
    "side_half-hipped",
    "hipped-and-gabled",
    "pyramidal",
    "skillion",
    "mansard",
    "gambrel",
    "saltbox",
    "double_saltbox",
    "quadruple_saltbox",
    "crosspitched",
    "gabled_row",
    "sawtooth",
    "butterfly",
    "round",
    "dome",
    "onion",
)

# Other names that are in use, and the shape each stands for.
_NAMES = {
    "cone": "pyramidal",
    "conical": "pyramidal",
    "spire": "pyramidal",
    "helm": "pyramidal",
    "pyramid": "pyramidal",
    "tented": "pyramidal",
    "lean_to": "skillion",
    "lean-to": "skillion",
    "shed": "skillion",
    "pent": "skillion",
    "monopitch": "skillion",
    "single_pitched": "skillion",
    "barrel": "round",
    "barrel_vault": "round",
    "arched": "round",
    "curved": "round",
    "vaulted": "round",
    "gable": "gabled",
    "pitched": "gabled",
    "hip": "hipped",
    "half_hipped": "half-hipped",
    "half-hip": "half-hipped",
    "jerkinhead": "half-hipped",
    "side_halfhipped": "side_half-hipped",
    "side_half_hipped": "side_half-hipped",
    "gablet": "hipped-and-gabled",
    "dutch_gabled": "hipped-and-gabled",
    "hipped_and_gabled": "hipped-and-gabled",
    "cross_gabled": "crosspitched",
    "cross-gabled": "crosspitched",
    "cross_pitched": "crosspitched",
    "gabled_height_moved": "saltbox",
    "m-shaped": "gabled_row",
    "multi_gabled": "gabled_row",
    "saw_tooth": "sawtooth",
    "saw-tooth": "sawtooth",
    "v-shaped": "butterfly",
    "terrace": "flat",
    "dome-shaped": "dome",
    "spherical": "dome",
    "bulbous": "onion",
    "double_pitched_mansard": "mansard",
}


def shape_named(tag: str | None) -> str | None:
    """Name the roof shape built for a `roof:shape` tag; None where the tag is absent or says nothing usable."""
    if not tag:
        return None
    text = tag.split(";")[0].strip().lower().replace(" ", "_")
    return text if text in SHAPES else _NAMES.get(text)


@dataclass(frozen=True)
class Roof:
    """A roof over an outline.

    Attributes
    ----------
    shape
        One of `SHAPES`.
    height
        From the eaves to the highest point, metres; for a flat roof the parapet's height (0: none).
    direction
        Skillion: yaw towards which it falls, radians. Ridged roofs: yaw of the ridge; None: along the longer side.
        One-sided hips and saltboxes: the ridge's yaw points to the hip; the long slope lies left of it.
    facets
        The surfaces of a measured roof, heights above the eaves; `shape` is then the nearest that has a name.
    """

    shape: str
    height: float
    direction: float | None = None
    facets: tuple[RoofFacet, ...] = ()

    def moved(self, move: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Roof:
        """Return the roof over an outline that was moved, and perhaps scaled, by `move` (points, shape ``(n, 2)``)."""
        if not self.facets:
            return self
        return replace(self, facets=tuple(_moved(facet, move) for facet in self.facets))

    def risen(self, height: float) -> Roof:
        """Return the roof with another height, metres; a measured one is stretched."""
        if not self.facets or self.height <= 0.0:
            return replace(self, height=height)
        share = height / self.height
        stretched = tuple(
            RoofFacet(facet.polygon, (c * share, gx * share, gy * share))
            for facet in self.facets
            for c, gx, gy in (facet.plane,)
        )
        return replace(self, height=height, facets=stretched)


def _moved(facet: RoofFacet, move: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> RoofFacet:
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]) + np.asarray(facet.polygon.centroid.coords[0])
    level = facet.height(corners)
    east, north = move(corners)[1:] - move(corners)[:1]
    turn = np.array([east, north])
    gx, gy = np.linalg.solve(turn, level[1:] - level[:1])
    x, y = move(corners)[0]
    return RoofFacet(shapely.transform(facet.polygon, move), (float(level[0] - gx * x - gy * y), float(gx), float(gy)))


def rings_of(polygon: Polygon) -> list[NDArray[np.float64]]:
    """Outer ring counter-clockwise, holes clockwise, not closed, each shape ``(n, 2)``."""
    oriented = shapely.orient_polygons(polygon)
    return [np.asarray(ring.coords)[:-1, :2] for ring in (oriented.exterior, *oriented.interiors)]


def prism(rings: list[NDArray[np.float64]], low: float, high: float) -> Manifold:
    """Extrude an outline between two heights."""
    return CrossSection(rings, manifold3d.FillRule.Positive).extrude(high - low).translate((0.0, 0.0, low))


def inradius(polygon: Polygon) -> float:
    """Distance from the outline to the point inside that is farthest from it, metres."""
    return float(shapely.length(shapely.maximum_inscribed_circle(polygon, tolerance=0.05)))
