"""Everything small that is built on plans: cornices, eaves, dormers, chimneys, balconies, fire escapes and the like."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.seeds import rng
from vico.worldgen.buildings.projections import projections, water_tank
from vico.worldgen.buildings.roofs.dormers import dormers
from vico.worldgen.buildings.roofs.eaves import eaves
from vico.worldgen.buildings.rooftops import cornices, posts, rooftop_parts
from vico.worldgen.buildings.solids import Mesh
from vico.worldgen.facades.looks import FacadeStyle
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan

_LANE = 3.2  # metres from a street's centre line over which nothing hangs


def detailed(
    plans: Sequence[BuildingPlan],
    meshes: Sequence[list[Mesh]],
    looks: Sequence[FacadeStyle],
    bases: Sequence[float],
    fronts: Sequence[list[NDArray[np.bool_]]],
    streets: shapely.STRtree,
    *,
    region: str,
    seed: int,
) -> list[BuildingPlan]:
    """Add the small solids to plans.

    Parameters
    ----------
    plans
        All buildings, solids apart from each other.
    meshes
        The solid of each part of each, ENU metres.
    looks
        What they wear.
    bases
        Heights of their ground floors, metres.
    fronts
        Of each part the edges that show a front.
    streets
        Centre lines of streets.
    region
        As `facades.catalogue.region_of` says.
    seed
        Decides what is there; each building's draws are its own.
    """
    # A cornice goes round a house whose back is like its front, and else along the street.
    streetward = [None if look.back == look.wall else shown for look, shown in zip(looks, fronts, strict=True)]
    ledges = cornices(plans, [look.wall for look in looks], bases, streetward)
    fringes = eaves(plans, meshes, bases, [look.reach for look in looks], [look.eaves for look in looks], streets)
    rows = [(part, p) for p, plan in enumerate(plans) for part in (*plan.parts, *ledges[p], *fringes[p])]
    tree = shapely.STRtree([part.polygon for part, _ in rows])
    outlines = shapely.STRtree([plan.outline for plan in plans])
    hanging: list[list[PartPlan]] = [[] for _ in plans]
    made = []
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

        sitting = rooftop_parts(plan, rng(seed, "rooftop", plan.id))
        tanks = water_tank(plan, region, rng(seed, "tank", plan.id))
        sitting = [solid for solid in sitting if not any(solid.polygon.distance(t.polygon) < 0.5 for t in tanks)]
        sitting += tanks
        windows = dormers(plan, meshes[p], base, sitting, region, rng(seed, "dormers", plan.id))
        hanging[p] = projections(plan, looks[p], fronts[p], free, region, rng(seed, "projections", plan.id))
        rooftop = [*ledges[p], *fringes[p], *sitting, *windows, *hanging[p], *posts(plan, streets)]
        made.append(replace(plan, rooftop=rooftop))
    return made
