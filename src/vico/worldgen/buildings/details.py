"""Everything small that is built on plans: cornices, eaves, dormers, chimneys, balconies, fire escapes and the like."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.seeds import rng
from vico.world.model import Dropped
from vico.worldgen.buildings.drafts import Draft
from vico.worldgen.buildings.gables import stepped_gables
from vico.worldgen.buildings.projections import projections, water_tank
from vico.worldgen.buildings.roofs.dormers import dormers
from vico.worldgen.buildings.roofs.eaves import eaves
from vico.worldgen.buildings.rooftops import cornices, posts, rooftop_parts
from vico.worldgen.facades.catalogue import styles
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.outlines.plans import PartPlan

_LANE = 3.2  # metres from a street's centre line over which nothing hangs


def details_of(
    drafts: Sequence[Draft],
    fronts: Sequence[list[NDArray[np.bool_]]],
    streets: shapely.STRtree,
    dropped: list[Dropped],
    *,
    region: str,
    seed: int,
) -> list[list[PartPlan]]:
    """Decide the small solids of buildings.

    Parameters
    ----------
    drafts
        All buildings, solids apart from each other.
    fronts
        Of each part the edges that show a front.
    streets
        Centre lines of streets.
    dropped
        Where it is told whose details can't be made.
    region
        As `facades.catalogue.region_of` says.
    seed
        Decides what is there; each building's draws are its own.

    Returns
    -------
    list of list of PartPlan
        One list a building.
    """
    plans, bases = [draft.plan for draft in drafts], [draft.seat.base for draft in drafts]
    looks, meshes = [draft.look for draft in drafts], [draft.meshes for draft in drafts]
    # A cornice goes round a house whose back is like its front, and else along the street.
    streetward = [None if look.back == look.wall else shown for look, shown in zip(looks, fronts, strict=True)]
    ledges = cornices(plans, [look.wall for look in looks], bases, streetward, dropped=dropped)
    reaches, finishes = [look.reach for look in looks], [look.eaves for look in looks]
    fringes = eaves(plans, meshes, bases, reaches, finishes, streets, dropped=dropped)
    rows = [(part, p) for p, plan in enumerate(plans) for part in (*plan.parts, *ledges[p], *fringes[p])]
    tree = shapely.STRtree([part.polygon for part, _ in rows])
    outlines = shapely.STRtree([plan.outline for plan in plans])
    hanging: list[list[PartPlan]] = [[] for _ in plans]
    made: list[list[PartPlan]] = []
    families = styles().families
    for p, plan in enumerate(plans):
        base = bases[p]
        beside = outlines.query(plan.outline, predicate="dwithin", distance=3.0).tolist()
        theirs = [(piece, q) for q in sorted(beside) if q < p for piece in hanging[q]]

        def free(
            box: Polygon,
            low: float,
            high: float,
            base: float = base,
            theirs: list[tuple[PartPlan, int]] = theirs,
        ) -> bool:
            inner = overlay.buffer(box, -0.06, join_style="mitre")
            if len(streets.query(inner, predicate="dwithin", distance=_LANE)):
                return False
            near = [rows[j] for j in tree.query(box, predicate="dwithin", distance=0.3).tolist()]
            for part, q in (*near, *theirs):
                stands = bases[q] + part.low < base + high + 0.2 and bases[q] + part.top > base + low - 0.2
                if stands and part.polygon.distance(inner) < 0.02:
                    return False
            return True

        made.append([*ledges[p], *fringes[p]])
        with expendable(f"{plan.id} details", dropped):
            sitting = rooftop_parts(plan, meshes[p], base, fronts[p], rng(seed, "rooftop", plan.id), region=region)
            tanks = water_tank(plan, region, rng(seed, "tank", plan.id))
            sitting = [solid for solid in sitting if not any(solid.polygon.distance(t.polygon) < 0.5 for t in tanks)]
            sitting += tanks
            windows = dormers(plan, meshes[p], base, sitting, region, rng(seed, "dormers", plan.id))
            hanging[p] = projections(plan, looks[p], fronts[p], free, region, rng(seed, "projections", plan.id))
            gables = stepped_gables(plan, fronts[p]) if families[looks[p].wall].gable else []
            made[p] += [*sitting, *windows, *gables, *hanging[p], *posts(plan, streets)]
    return made
