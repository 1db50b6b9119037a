"""Watertight building solids: an outline raised to its eaves under its roof.

Simple 3D Buildings' roofs are built three ways. Over an outline that about fills its box, ridged roofs are the prism
within one or two profiles drawn across the box (`roof_profiles`). Over wings and courtyards every edge cuts away what
lies above the plane that climbs from it (`roof_cuts`). Pyramids, domes and onions are rings drawn together towards a
point (`roof_vaults`). What comes out is closed, because it is made of closed solids, and as high as asked.
"""

from __future__ import annotations

import math
from dataclasses import replace

import manifold3d
import numpy as np
import shapely
from manifold3d import Manifold
from numpy.typing import NDArray
from shapely import Polygon

from vico.exact import dot
from vico.geo import overlay
from vico.worldgen.buildings.roofs.pointed import drawn_together
from vico.worldgen.buildings.roofs.ridged import BoxFrame, box_frame, profiled_solid
from vico.worldgen.buildings.roofs.sloped import sloped_solid
from vico.worldgen.facts.outlines.roof_cells import measured_solid
from vico.worldgen.facts.outlines.roof_shapes import Roof, prism, rings_of

_SPECK = 0.002  # metres: detail that the kernel makes and nobody sees


def building_solid(polygon: Polygon, low: float, eaves: float, roof: Roof) -> Manifold:
    """Return the closed solid of a building or a part of one.

    Parameters
    ----------
    polygon
        Outline, metres; valid, near the origin for precision.
    low, eaves
        Heights of its underside and of where the roof begins, metres.
    roof
        What covers it; a measured one's facets near the origin, too.

    Returns
    -------
    Manifold
        Watertight, normals outward; empty where the outline is.

    Notes
    -----
    OSM wiki, Simple 3D Buildings and Key:roof:shape.
    """
    if roof.facets:
        return measured_solid(polygon, low - eaves, roof.facets).translate((0.0, 0.0, eaves))
    rings = rings_of(polygon)
    if roof.shape == "flat":
        return _with_parapet(polygon, low, eaves, roof.height) if roof.height > 0.05 else prism(rings, low, eaves)
    if roof.height <= 0.05:
        return prism(rings, low, eaves)
    # The roof is made over eaves at 0: its highest point is then stretched to the height asked, exactly.
    if roof.shape == "skillion":
        solid = _skillion(rings, low - eaves, roof)
    elif roof.shape in ("dome", "onion", "pyramidal"):
        made = drawn_together(polygon, rings, low - eaves, roof)
        solid = made if made is not None else sloped_solid(polygon, rings, low - eaves, replace(roof, shape="hipped"))
    else:
        frame: BoxFrame = box_frame(polygon, roof.direction)
        if frame.suits(roof.shape, polygon, holes=len(rings) > 1):
            solid = profiled_solid(rings, low - eaves, roof, frame)
        else:
            solid = sloped_solid(polygon, rings, low - eaves, roof)
    solid = solid.simplify(_SPECK)
    if len(rings) == 1 or roof.shape not in ("dome", "onion", "pyramidal"):
        # A dome's or a pyramid's top may lie over a hole: what is left of it stays as it would be without.
        solid = _as_high_as(solid, roof.height)
    return solid.translate((0.0, 0.0, eaves))


def _as_high_as(solid: Manifold, height: float) -> Manifold:
    """Stretch what lies above 0 so that its top is at `height`."""
    *_, top = (0.0,) if solid.is_empty() else solid.bounding_box()
    if top < 0.01 or abs(top - height) < 0.002:
        return solid
    share = height / top

    def stretched(points: NDArray[np.float64]) -> NDArray[np.float64]:
        result = np.array(points, np.float64)
        result[:, 2] = np.where(result[:, 2] > 0.0, result[:, 2] * share, result[:, 2])
        return result

    return solid.warp_batch(stretched)


def _with_parapet(polygon: Polygon, low: float, eaves: float, height: float) -> Manifold:
    rings = rings_of(polygon)
    inner = overlay.buffer(polygon, -0.35, join_style="mitre", mitre_limit=2.0)
    pools = [part for part in shapely.get_parts(inner) if part.geom_type == "Polygon" and part.area > 4.0]
    if not pools:
        return prism(rings, low, eaves)
    hollow = [prism(rings_of(pool), eaves, eaves + height + 1.0) for pool in pools]
    return Manifold.batch_boolean([prism(rings, low, eaves + height), *hollow], manifold3d.OpType.Subtract)


def _skillion(rings: list[NDArray[np.float64]], low: float, roof: Roof) -> Manifold:
    yaw = roof.direction if roof.direction is not None else 0.0
    fall = np.array([math.cos(yaw), math.sin(yaw)])
    reach = [float(v) for ring in rings for v in dot(ring, fall)]
    first, last = min(reach), max(reach)
    body = prism(rings, low, roof.height)
    slope = roof.height / max(last - first, 0.1)
    normal = np.array([-fall[0] * slope, -fall[1] * slope, -1.0])
    # Kept is what lies under the plane z = (last - p.fall) * slope.
    return body.trim_by_plane(tuple(normal), -last * slope / math.hypot(*normal))
