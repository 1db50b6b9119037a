"""Eaves and roofs where the mesh has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vico.geo import overlay
from vico.geo.quantities import quantity
from vico.worldgen.buildings.fitting.measure import LEAST_POINTS, RoofSamples
from vico.worldgen.facts.outlines.heights import STOREY
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan

_LEAST_EAVES = 2.2
_ABSENT = 1.5  # metres over the ground floor under which the mesh shows no building


def raised_to_mesh(plan: BuildingPlan, roofs: RoofSamples, k: int, base: float) -> tuple[BuildingPlan, str]:
    """Return the plan with eaves and roofs where the mesh has them; or itself, and why, where nothing tells."""
    mine = np.flatnonzero(roofs.plan == k)
    if len(mine) < LEAST_POINTS:
        return plan, "too small or outside the tiles"
    if float(np.median(roofs.seen[mine])) < base + _ABSENT:
        return plan, "the tiles show no building"
    parts: list[PartPlan] = []
    changed = False
    for index, part in enumerate(plan.parts):
        own = mine[roofs.part[mine] == index]
        new = _raised_part(part, roofs.model[own] - base, roofs.seen[own] - base) if len(own) >= LEAST_POINTS else None
        changed |= new is not None
        parts.append(new or part)
    if not changed:
        return plan, "no roof to go by"
    parts = _stacked(plan.parts, parts)
    return replace(plan, parts=parts, levels=max(part.levels for part in parts)), ""


def _raised_part(part: PartPlan, model: NDArray[np.float64], seen: NDArray[np.float64]) -> PartPlan | None:
    rise = part.roof.height
    new_rise = rise
    if part.roof.shape != "flat" and rise > 0.3:
        share = (model - part.eaves) / rise
        if float(share.std()) > 0.12:
            level, slope = _line(share, seen)
            new_rise = float(np.clip(slope, 0.5 * rise, 2.0 * rise))
            eaves = float(np.median(seen - new_rise * share)) if new_rise != slope else level
        else:
            eaves = part.eaves + float(np.median(seen - model))
    else:
        eaves = part.eaves + float(np.median(seen - model))
    eaves = round(eaves, 3)
    if eaves < part.low + (_LEAST_EAVES if part.levels else 0.3):
        return None
    levels = part.levels
    if levels and quantity(part.tags, "building:levels") is None:
        levels = max(round((eaves - part.low - 0.6) / STOREY), 1)
    return replace(part, eaves=eaves, levels=levels, roof=part.roof.risen(round(new_rise, 3)))


def _line(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Offset and slope of a line through points of which some are something else."""
    weight = np.ones(len(x))
    level, slope = float(np.median(y)), 0.0
    for _ in range(12):
        mx, my = np.average(x, weights=weight), np.average(y, weights=weight)
        slope = float((weight * (x - mx) * (y - my)).sum() / max(float((weight * (x - mx) ** 2).sum()), 1e-9))
        level = float(my - slope * mx)
        residual = np.abs(y - level - slope * x)
        weight = 1.0 / np.maximum(residual, 0.15 + 0.5 * float(np.median(residual)))
    return level, slope


def _stacked(old: list[PartPlan], new: list[PartPlan]) -> list[PartPlan]:
    """Parts that stood on others still do: their underside follows the eaves below."""
    result = list(new)
    for k in sorted(range(len(old)), key=lambda i: old[i].low):
        if old[k].low <= 0.0:
            continue
        under = [
            i
            for i in range(len(old))
            if i != k
            and abs(old[i].eaves - old[k].low) < 1.0
            and overlay.common_area(old[i].polygon, old[k].polygon) > 1.0
        ]
        if under:
            low = min(result[i].eaves for i in under)
            if low < result[k].eaves - 0.5:
                result[k] = replace(result[k], low=round(low, 3))
    return result
