"""Dormers: small gabled boxes with a window, in a row on a long steep slope."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import Polygon

from vico.exact import dot
from vico.worldgen.buildings.roofs.eaves import Edges, Slope, edges_of, slopes_of
from vico.worldgen.buildings.solids import Mesh
from vico.worldgen.facades.catalogue import styles
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan
from vico.worldgen.facts.outlines.roof_shapes import Roof

_SHAPES = ("gabled", "hipped", "half-hipped", "mansard", "gambrel")
_FACES = np.array(
    [
        (0, 1, 2), (0, 2, 3), (3, 2, 4),
        (2, 5, 7), (2, 7, 4), (3, 4, 7), (3, 7, 6),
        (1, 5, 2), (0, 3, 6),
        (0, 6, 5), (0, 5, 1), (5, 6, 7),
    ],
    np.int64,
)  # fmt: skip
_USES = ("residential", "hotel", "commercial", "retail", "office", "other", "civic", "education")
_WIDE = 1.4
_EVERY = 6.0  # metres from one to the next
_GENTLEST = 0.62  # rise per metre
_MOST = 8  # a building


def dormers(
    plan: BuildingPlan,
    meshes: list[Mesh],
    base: float,
    others: list[PartPlan],
    region: str,
    random: np.random.Generator,
) -> list[PartPlan]:
    """Put dormers on a building's roofs.

    Parameters
    ----------
    plan
        The building.
    meshes
        The solid of each of its parts, ENU metres.
    base
        Height of its ground floor.
    others
        What else sits on its roofs; dormers keep clear of it.
    region
        As `facades.catalogue.region_of` says.
    random
        The building's own stream.

    Returns
    -------
    list of PartPlan
        The first edge of each one's outline is its window's.
    """
    made: list[PartPlan] = []
    wanted = random.random() < styles().region(region).dormers
    if plan.use not in _USES:
        return made
    for part, mesh in zip(plan.parts, meshes, strict=True):
        if not (wanted or part.roof.shape == "mansard"):
            continue
        if part.roof.shape not in _SHAPES or part.roof.height < 2.2 or part.levels < 1 or part.polygon.area < 55.0:
            continue
        edges = edges_of(part.polygon)
        above = [other for other in plan.parts if other is not part and other.top > part.eaves + 0.5]
        kept_off = [other.polygon for other in (*above, *others)]
        for slope in slopes_of(mesh, edges, base + part.eaves):
            for box in _row(part, slope, edges, base):
                if len(made) < _MOST and not any(box.polygon.distance(shape) < 0.3 for shape in kept_off):
                    made.append(box)
                    kept_off.append(box.polygon)
    return made


def _row(part: PartPlan, slope: Slope, edges: Edges, base: float) -> list[PartPlan]:
    out, along = edges.out[slope.edge], edges.along[slope.edge]
    rise = -float(dot(slope.gradient, out))
    sideways = abs(float(dot(slope.gradient, along)))
    if rise < _GENTLEST or sideways > 0.1 * rise:
        return []
    steep = part.roof.shape in ("mansard", "gambrel") and rise > 1.2
    inset = 0.3 if steep else 0.55
    room = (0.62 if steep else 1.0) * part.roof.height - rise * inset - 0.25
    gable = 0.42
    tall = min(1.4, room - gable)
    if tall < 0.95:
        return []
    deep = (tall + gable) / rise + 0.15 if not steep else 1.7
    margin = 1.3 if part.roof.shape == "gabled" else 1.3 + inset + deep
    first, last = slope.start + margin, slope.end - margin
    if last - first < 0.2:
        return []
    count = max(1, round((last - first) / _EVERY))
    made = []
    for k in range(count):
        middle = edges.start[slope.edge] + along * (first + (last - first) * (k + 0.5) / count) - out * inset
        left, right = middle - along * _WIDE / 2, middle + along * _WIDE / 2
        box = Polygon([left, right, right - out * deep, left - out * deep])
        if not shapely.contains(part.polygon, box):
            continue
        foot = float(slope.height(middle[None])[0]) - base
        low, eaves = foot - 0.3, foot + tall
        # Its lower edges end in the slope, where they meet it; so it needs neither a back nor much of an underside.
        back = -out * min((tall + 0.06) / rise, deep)
        points = np.array(
            [
                (*left, low), (*right, low), (*right, eaves), (*left, eaves), (*middle, eaves + gable),
                (*(right + back), eaves), (*(left + back), eaves), (*(middle - out * deep), eaves + gable),
            ]
        )  # fmt: skip
        mesh = (points, _FACES)
        made.append(PartPlan(box, low, eaves, 0, Roof("flat", gable), part.tags, "dormer", mesh))
    return made
