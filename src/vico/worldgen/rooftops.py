"""What sits on and juts out of buildings: cornices, chimneys, penthouses. Closed solids of their own."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo.osm import polygons_of
from vico.worldgen.outlines import BuildingPlan, PartPlan
from vico.worldgen.roofs import Roof

_CORNICE_WALLS = ("wall_classic", "wall_stone", "wall_brick", "wall_plain")


def rooftop_parts(plan: BuildingPlan, wall: str, random: np.random.Generator) -> list[PartPlan]:
    """Decide the small solids of a building's roof.

    Parameters
    ----------
    plan
        The building.
    wall
        Its facade material: old-fashioned ones get a cornice.
    random
        The building's own stream.

    Returns
    -------
    list of PartPlan
        Without storeys; `finish` says what they are.
    """
    made: list[PartPlan] = []
    for part in plan.parts:
        if part.low > 0 or part.eaves < 4.5 or part.polygon.area < 50.0:
            continue
        bare = part.roof.shape == "flat" and part.roof.height <= 0.0
        if wall in _CORNICE_WALLS and part.levels >= 2 and not bare:
            made += _cornice(part)
        if part.roof.shape == "flat" and not bare:
            made += _penthouses(part, random)
        elif part.roof.shape in ("hipped", "gabled", "mansard") and plan.use in (
            "residential",
            "hotel",
            "commercial",
            "civic",
        ):
            made += _chimneys(part, random)
    return made


def _cornice(part: PartPlan) -> list[PartPlan]:
    outline = shapely.simplify(part.polygon, 0.35)
    outer = shapely.buffer(outline, 0.32, join_style="mitre", mitre_limit=1.6)
    inner = shapely.buffer(outline, -0.25, join_style="mitre", mitre_limit=1.6)
    rings = polygons_of(shapely.simplify(shapely.difference(outer, inner), 0.03), 0.5)
    low, high = part.eaves - 0.42, part.eaves + 0.03
    return [_solid(ring, low, high, "cornice") for ring in rings]


def _penthouses(part: PartPlan, random: np.random.Generator) -> list[PartPlan]:
    """Lift and plant rooms: one for every 700 m2 of flat roof or so, well inside."""
    room = max(polygons_of(shapely.buffer(part.polygon, -4.0)), key=lambda shape: shape.area, default=None)
    if part.polygon.area < 180.0 or room is None:
        return []
    made: list[PartPlan] = []
    for size, turn, at in zip(random.uniform(2.2, 6.5, (4, 2)), [0] * 4, random.random((4, 2)), strict=True):
        if len(made) >= min(int(part.polygon.area / 700.0) + 1, 4):
            break
        box = _box(_spot(room, at), size, _main_direction(part.polygon) + turn)
        if part.polygon.contains(shapely.buffer(box, 1.0)) and not any(box.intersects(m.polygon) for m in made):
            made.append(_solid(box, part.eaves - 0.2, part.eaves + float(random.uniform(1.6, 3.0)), "penthouse"))
    return made


def _chimneys(part: PartPlan, random: np.random.Generator) -> list[PartPlan]:
    room = max(polygons_of(shapely.buffer(part.polygon, -2.2)), key=lambda shape: shape.area, default=None)
    if room is None:
        return []
    made: list[PartPlan] = []
    count = min(int(part.polygon.area / 130.0) + 1, 5)
    for at in random.random((count, 2)):
        box = _box(_spot(room, at), np.array([1.3, 0.65]), _main_direction(part.polygon))
        if part.polygon.contains(box) and not any(box.intersects(m.polygon) for m in made):
            made.append(_solid(box, part.eaves, part.top + float(random.uniform(0.5, 1.1)), "chimney"))
    return made


def _solid(polygon: Polygon, low: float, high: float, finish: str) -> PartPlan:
    return PartPlan(polygon, low, high, 0, Roof("flat", 0.0), {}, finish)


def _spot(room: Polygon, at: NDArray[np.float64]) -> NDArray[np.float64]:
    west, south, east, north = room.bounds
    return np.array([west + (east - west) * at[0], south + (north - south) * at[1]])


def _main_direction(polygon: Polygon) -> float:
    box = np.asarray(shapely.minimum_rotated_rectangle(polygon).exterior.coords)
    side = box[1] - box[0]
    return float(np.arctan2(side[1], side[0]))


def _box(centre: NDArray[np.float64], size: NDArray[np.float64], yaw: float) -> Polygon:
    c, s = np.cos(yaw), np.sin(yaw)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size / 2
    return Polygon(corners @ np.array([[c, s], [-s, c]]) + centre)
