"""Measured roofs made into parts of a building, one for each stretch of roof without a step in it.

A tower beside a hall, a house with a lower wing: each has eaves of its own, up to which its walls have windows. Small
pieces (dormers, lift houses, chimneys) stay with the roof they sit on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from vico.geo import overlay
from vico.geo.buildings import RoofFacet, form_of
from vico.geo.overlay import OverlayError
from vico.geo.quantities import quantity
from vico.worldgen.facts.outlines.heights import STOREY
from vico.worldgen.facts.outlines.plans import PartPlan
from vico.worldgen.facts.outlines.roof_cells import RoofCell, measured_solid, roof_cells
from vico.worldgen.facts.outlines.roof_shapes import Roof, rings_of

_STEP = 0.35  # metres between roofs that are two
_OWN_PART = 12.0  # square metres from which on a stretch of roof is a part of its own
_SHARE = 0.03  # and of the building
_TOLERANCE = 0.05
_LEAST_EAVES = 2.2
_PARAPET = 0.6  # metres, of level roofs as large as those that get one without a model
_WITH_PARAPET = 60.0  # square metres


def parts_of_roof(
    outline: Polygon | MultiPolygon, facets: Sequence[RoofFacet], tags: Mapping[str, str]
) -> list[PartPlan]:
    """Return the parts of a building under a measured roof.

    Parameters
    ----------
    outline
        Of the building, metres.
    facets
        The surfaces of its roof, heights above its ground.
    tags
        Of the building.

    Raises
    ------
    OverlayError
        If they can't be made; the building then needs a roof that is fitted.
    """
    parts: list[PartPlan] = []
    for piece in overlay.polygons_of(overlay.simplify(outline, _TOLERANCE), 2.0):
        cells = roof_cells(piece, facets)
        for members in _stretches(cells, piece.area):
            parts += _parts([cells[k] for k in members], facets, tags)
    if not parts:
        raise OverlayError("nothing of its outline lies under its roof")
    return parts


def _stretches(cells: Sequence[RoofCell], area: float) -> list[list[int]]:
    """Cells that are one stretch of roof; small stretches are joined to the one they have most edge in common with."""
    group = list(range(len(cells)))

    def root(k: int) -> int:
        while group[k] != k:
            group[k] = group[group[k]]
            k = group[k]
        return k

    shared: list[tuple[int, int, float]] = []
    for one, two, length, step in _common_edges(cells):
        if step < _STEP:
            group[max(root(one), root(two))] = min(root(one), root(two))
        else:
            shared.append((one, two, length))
    least = max(_OWN_PART, _SHARE * area)
    while True:
        size: dict[int, float] = {}
        for k, cell in enumerate(cells):
            size[root(k)] = size.get(root(k), 0.0) + cell.polygon.area
        lengths: dict[tuple[int, int], float] = {}
        for one, two, length in shared:
            a, b = root(one), root(two)
            if a != b:
                lengths[a, b] = lengths.get((a, b), 0.0) + length
                lengths[b, a] = lengths.get((b, a), 0.0) + length
        small = sorted((size[a], a) for a in size if size[a] < least and any(pair[0] == a for pair in lengths))
        if not small:
            break
        a = small[0][1]
        into = max((length, -b) for (x, b), length in lengths.items() if x == a)[1]
        group[max(a, -into)] = min(a, -into)
    made: dict[int, list[int]] = {}
    for k in range(len(cells)):
        made.setdefault(root(k), []).append(k)
    return list(made.values())


def _common_edges(cells: Sequence[RoofCell]) -> list[tuple[int, int, float, float]]:
    """Pairs of cells side by side: the length of each edge, metres, and the larger step in height along it."""
    seen: dict[tuple[float, ...], tuple[int, float, float]] = {}
    found: list[tuple[int, int, float, float]] = []
    for k, cell in enumerate(cells):
        for ring, heights in zip(rings_of(cell.polygon), cell.heights, strict=True):
            for i in range(len(ring)):
                j = (i + 1) % len(ring)
                a, b = (float(ring[i][0]), float(ring[i][1])), (float(ring[j][0]), float(ring[j][1]))
                other = seen.pop((*b, *a), None)
                if other is None:
                    seen[(*a, *b)] = (k, float(heights[i]), float(heights[j]))
                elif other[0] != k:
                    step = max(abs(other[1] - float(heights[j])), abs(other[2] - float(heights[i])))
                    found.append((other[0], k, float(np.hypot(a[0] - b[0], a[1] - b[1])), step))
    return found


def _parts(cells: Sequence[RoofCell], facets: Sequence[RoofFacet], tags: Mapping[str, str]) -> list[PartPlan]:
    """Return the parts under one stretch of roof."""
    under: dict[int, list[Polygon]] = {}
    for cell in cells:
        under.setdefault(cell.facet, []).append(cell.polygon)
    # Only what of each surface lies over this stretch decides its form.
    seen = [
        RoofFacet(piece, facets[k].plane) for k, shapes in under.items() for piece in overlay.polygons_of(
            overlay.union_all(shapes), 0.01)
    ]  # fmt: skip
    form = form_of(seen)
    whole = overlay.union_all([cell.polygon for cell in cells])
    made: list[PartPlan] = []
    for piece in overlay.polygons_of(overlay.simplify(whole, 0.02), 1.0):
        eaves = max(form.eaves, _LEAST_EAVES)
        levels = _levels(tags, eaves)
        level = form.shape == "flat" and _spread(seen) < 0.4
        parapet = _PARAPET if piece.area >= _WITH_PARAPET else 0.0
        plain = PartPlan(piece, 0.0, eaves, levels, Roof("flat", parapet if level else 0.0), dict(tags))
        if level:
            made.append(plain)
            continue
        over = tuple(facets[k].moved(up=-eaves) for k in sorted(under))
        solid = measured_solid(_near_origin(piece), -eaves, [_near(facet, piece) for facet in over])
        *_, top = solid.bounding_box()
        roof = Roof(form.shape, round(max(top, 0.0), 3), None, over)
        made.append(replace(plain, eaves=eaves, roof=roof))
    return made


def _spread(facets: Sequence[RoofFacet]) -> float:
    """Height between the lowest and the highest of level surfaces."""
    heights = np.concatenate([facet.height(np.asarray(facet.polygon.exterior.coords)[:, :2]) for facet in facets])
    return float(heights.max() - heights.min())


def _middle(polygon: Polygon) -> tuple[float, float]:
    x, y = (round(v) for v in polygon.centroid.coords[0])
    return float(x), float(y)


def _near_origin(polygon: Polygon) -> Polygon:
    x, y = _middle(polygon)
    return shapely.transform(polygon, lambda xy: xy - (x, y))


def _near(facet: RoofFacet, polygon: Polygon) -> RoofFacet:
    x, y = _middle(polygon)
    return facet.moved(east=-x, north=-y)


def _levels(tags: Mapping[str, str], eaves: float) -> int:
    """Storeys below the eaves: as said, where that can be; else by height."""
    said = quantity(tags, "building:levels")
    if said is not None and 1 <= said <= 150 and 2.2 <= eaves / said <= 6.5:
        return max(round(said), 1)
    return max(round((eaves - 0.6) / STOREY), 1)
