"""Gables that stand before their roofs: steps of brick above the eaves of a front, as in the Low Countries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from vico.exact import dot
from vico.worldgen.buildings.roofs.eaves import edges_of
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan
from vico.worldgen.facts.outlines.roof_shapes import Roof

_STEPS = 4
_BEHIND, _BEFORE = 0.3, 0.05  # metres that a gable reaches into the roof, and before the wall's plane
_COPING = 0.3  # metres by which each step stands above the slope behind it
_LEAST, _MOST = 3.0, 12.0  # metres of front that have one
_LOWEST = 1.5  # metres of roof


def stepped_gables(plan: BuildingPlan, fronts: list[NDArray[np.bool_]]) -> list[PartPlan]:
    """Return the stepped gables of a building: before every gable end of its roof that faces a street.

    Parameters
    ----------
    plan
        The building; roofs other than gabled ones have none.
    fronts
        Of each part the edges that show a front, shape ``(n,)``.

    Returns
    -------
    list of PartPlan
        Steps from the lowest up, heights above the building's base.
    """
    made: list[PartPlan] = []
    for part, shown in zip(plan.parts, fronts, strict=True):
        roof = part.roof
        if roof.shape != "gabled" or roof.height < _LOWEST or roof.direction is None:
            continue
        edges = edges_of(part.polygon)
        ridge = np.array([np.cos(roof.direction), np.sin(roof.direction)])
        for k in np.flatnonzero(shown).tolist():
            length = float(edges.length[k])
            if _LEAST < length < _MOST and abs(float(dot(edges.out[k], ridge))) > 0.9:
                made += _steps(part, edges.start[k], edges.along[k], edges.out[k], length)
    return made


def _steps(
    part: PartPlan, start: NDArray[np.float64], along: NDArray[np.float64], out: NDArray[np.float64], length: float
) -> list[PartPlan]:
    made: list[PartPlan] = []
    low = part.eaves
    for k in range(_STEPS):
        half = length / 2 * (1.0 - k / _STEPS) - 0.02
        top = part.eaves + part.roof.height * (k + 1) / _STEPS + _COPING
        corners = [(-half, _BEFORE), (half, _BEFORE), (half, -_BEHIND), (-half, -_BEHIND)]
        outline = Polygon([start + along * (length / 2 + s) + out * d for s, d in corners])
        finish = "gable_window" if k == 1 and half > 1.2 else "gable_step"
        made.append(PartPlan(outline, low, top, 0, Roof("flat", 0.0), {}, finish))
        low = top
    return made
