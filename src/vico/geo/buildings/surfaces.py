"""A building made of the surfaces that a city model draws it with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mapbox_earcut
import numpy as np
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.buildings.forms import form_of
from vico.geo.buildings.model import FoundBuilding, RoofFacet
from vico.geo.outlines import joined, mended

_UPRIGHT = 0.08  # of a unit normal's height: what is steeper is a wall, whatever it is called
_FLAT_WITHIN = 0.25  # metres that the corners of a plane surface may lie off it
_ABOVE_GROUND = 1.5  # metres above the ground from which on an unnamed level surface is a roof
_SPECK = 0.02  # square metres
_CLOSING = 0.03  # metres of gap between surfaces that are one
_COVERED = 0.85  # share of the footprint that a roof must cover
_LEAST_AREA = 2.0
_LOWEST, _HIGHEST = 1.0, 900.0


@dataclass(frozen=True)
class Surface3:
    """A surface of a city model: `kind` (roof, wall, ground, or empty where unsaid); rings, ENU x, y and height."""

    kind: str
    rings: tuple[NDArray[np.float64], ...]


def building_of_surfaces(
    surfaces: Sequence[Surface3], *, key: str, kind: str, file: str, facts: Mapping[str, str]
) -> FoundBuilding | str:
    """Return the building that surfaces enclose; or in a phrase why there is none.

    Parameters
    ----------
    surfaces
        All of one building, at one level of detail.
    key, kind, file
        Its id without the kind, and where it comes from.
    facts
        What its attributes say, in OpenStreetMap's words; a roof's height and shape are told from the surfaces.
    """
    if not surfaces:
        return "has no surfaces at a level of detail of 1 to 3"
    points = np.concatenate([surface.rings[0] for surface in surfaces])
    if not np.isfinite(points).all():
        return "has points that lie nowhere on Earth"
    floors = [surface for surface in surfaces if surface.kind == "ground"]
    low = np.concatenate([s.rings[0] for s in floors]) if floors else points
    ground = float(low[:, 2].min())
    named = any(surface.kind == "roof" for surface in surfaces)
    facets: list[RoofFacet] = []
    for surface in surfaces:
        if surface.kind == "roof" or (not named and surface.kind == ""):
            facets += _facets(surface, ground, floor=0.0 if named else _ABOVE_GROUND)
    footprint = _footprint(floors, facets)
    if footprint.area < _LEAST_AREA:
        return f"covers {footprint.area:.1f} m2 of ground"
    tags = dict(facts)
    fault = _fault(facets, footprint)
    if facets and not fault:
        form = form_of(facets)
        tags["height"] = f"{form.top:.2f}"
        tags["roof:shape"] = form.shape
        if form.shape != "flat":
            tags["roof:height"] = f"{form.top - form.eaves:.2f}"
    elif "height" not in tags and (top := float(points[:, 2].max()) - ground) > _LOWEST:
        tags["height"] = f"{top:.2f}"
    return FoundBuilding(
        f"{kind}:{key}", kind, file, footprint, tags, () if fault else tuple(facets), fault if facets else ""
    )


def _fault(facets: Sequence[RoofFacet], footprint: BaseGeometry) -> str:
    """Say why a roof can't be built of these surfaces; empty if it can."""
    if not facets:
        return "no roof surfaces"
    tops = np.concatenate([facet.height(np.asarray(facet.polygon.exterior.coords)[:, :2]) for facet in facets])
    if not (tops.min() > 0.0 and _LOWEST < tops.max() < _HIGHEST):
        return f"roof surfaces lie {tops.min():.1f} to {tops.max():.1f} m above its ground"
    roof = overlay.union_all([facet.polygon for facet in facets])
    covered = overlay.common_area(roof, footprint) / footprint.area
    if covered < _COVERED:
        return f"roof surfaces cover {100 * covered:.0f} % of its footprint"
    return ""


def _footprint(floors: Sequence[Surface3], facets: Sequence[RoofFacet]) -> Polygon | MultiPolygon:
    """Return what a building covers: its ground surfaces seen from above, or else its roof's."""
    shapes = [shape for floor in floors if (shape := _outline(floor.rings)) is not None]
    if not shapes:
        shapes = [facet.polygon for facet in facets]
    if not shapes:
        return Polygon()
    return joined(shapes, gap=_CLOSING, least=_LEAST_AREA)


def _outline(rings: Sequence[NDArray[np.float64]]) -> Polygon | MultiPolygon | None:
    """Return the outline of a surface seen from above; None where it has no extent."""
    outer, *inner = [ring[:, :2] for ring in rings if len(ring) >= 3] or [np.zeros((0, 2))]
    if len(outer) < 3:
        return None
    shape = mended(Polygon(outer, inner))[0]
    return shape if shape.area > _SPECK else None


def _facets(surface: Surface3, ground: float, *, floor: float) -> list[RoofFacet]:
    """Return the plane pieces of a roof surface, heights above the ground; none where it is upright."""
    made: list[RoofFacet] = []
    for rings in _plane_pieces(surface.rings):
        plane = _plane(rings[0])
        if plane is None:
            continue
        shape = _outline(rings)
        if shape is None or float(rings[0][:, 2].mean()) - ground < floor:
            continue
        c, gx, gy = plane
        made += [RoofFacet(piece, (c - ground, gx, gy)) for piece in overlay.polygons_of(shape, _SPECK)]
    return made


def _plane_pieces(rings: Sequence[NDArray[np.float64]]) -> list[tuple[NDArray[np.float64], ...]]:
    """Return a surface as it is if it is plane, else its triangles."""
    ring = rings[0]
    plane = _plane(ring)
    if len(ring) <= 3 or plane is None:
        return [tuple(rings)]
    c, gx, gy = plane
    off = np.abs(ring[:, 2] - (c + gx * ring[:, 0] + gy * ring[:, 1]))
    if off.max() <= _FLAT_WITHIN:
        return [tuple(rings)]
    corners = np.concatenate(rings)
    ends = np.cumsum([len(part) for part in rings]).astype(np.uint32)
    flat = np.ascontiguousarray(corners[:, :2] - corners[0, :2])
    triangles = mapbox_earcut.triangulate_float64(flat, ends).reshape(-1, 3).astype(int)
    return [(corners[triangle],) for triangle in triangles]


def _plane(ring: NDArray[np.float64]) -> tuple[float, float, float] | None:
    """Return the plane through a ring (Newell's normal through its middle); None where it is upright or a line."""
    if len(ring) < 3:
        return None
    middle = ring.mean(axis=0)
    near = ring - middle
    after = np.roll(near, -1, axis=0)
    normal = np.cross(near, after).sum(axis=0)
    size = float(np.linalg.norm(normal))
    if size < 1e-6 or abs(normal[2]) < _UPRIGHT * size:
        return None
    gx, gy = -normal[0] / normal[2], -normal[1] / normal[2]
    return float(middle[2] - gx * middle[0] - gy * middle[1]), float(gx), float(gy)
