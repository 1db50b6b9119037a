"""Where a building's storeys lie: what its facade shows and what hangs on it agree on that."""

from __future__ import annotations

from dataclasses import dataclass

from vico.worldgen.facades.textures.walls import STOREYS
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan

_HIGH_GROUND = ("retail", "commercial", "office", "civic", "hotel")


@dataclass(frozen=True)
class Storeys:
    """Storeys of a part, heights above the building's base.

    Attributes
    ----------
    bottom, top
        Between which its upper floors lie; the ground floor lies below `bottom`.
    count
        Upper floors, of one height each.
    """

    bottom: float
    top: float
    count: float

    def floor(self, k: int) -> float:
        """Floor of the k-th upper storey."""
        return self.bottom + (self.top - self.bottom) * k / self.count


def storeys_of(plan: BuildingPlan, part: PartPlan, *, hall: bool) -> Storeys:
    """Divide a part's height; a hall has one row of windows from a low base to the eaves."""
    if part.finish:
        return Storeys(part.eaves, part.eaves, float(max(part.levels, 1)))
    if hall:
        ground = min(2.4, 0.25 * part.eaves)
    else:
        ground = 4.0 if plan.use in _HIGH_GROUND or plan.shops > 0 else 3.5
    single = (part.levels <= 1 or part.eaves < 5.6) and not hall
    bottom = part.low if part.low > 0 else part.eaves if single else ground
    count = float(STOREYS) if hall else max(float(round((part.eaves - bottom) / 3.25)), 1.0)
    return Storeys(bottom, part.eaves, count)
