"""Which roof shapes there are, by what names they go, and the prisms that all of them are cut from."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
import shapely
from manifold3d import CrossSection, Manifold
from numpy.typing import NDArray
from shapely import Polygon

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
    """

    shape: str
    height: float
    direction: float | None = None


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
