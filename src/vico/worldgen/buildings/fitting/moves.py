"""Footprints where the mesh has them: buildings that touch are moved and scaled together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from shapely import Polygon

from vico.geo import overlay
from vico.world.model import Dropped
from vico.worldgen.buildings.fitting.measure import GAIN, LEAST_POINTS, Measure, mean_of
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.outlines.plans import BuildingPlan

MOST_SHIFT = 2.0
"""Metres a footprint may be moved."""

_MOST_SCALE = 0.04


#: Metres east and north, and the factor on the footprint.
Move = tuple[tuple[float, float], float]


def moved_to_mesh(
    plans: list[BuildingPlan], measure: Measure, failed: list[Dropped]
) -> tuple[list[BuildingPlan], list[Move]]:
    """Plans with their footprints where the mesh has its walls; and each one's shift and scale.

    Buildings that touch and can't be moved together stay, and are told in `failed`.
    """
    still: Move = ((0.0, 0.0), 1.0)
    walls = measure.walls(plans)
    group = _touching(plans)
    tried = list(plans)
    moves: list[Move] = [still] * len(plans)
    shapes = [overlay.union_all([plan.outline, *(part.polygon for part in plan.parts)]) for plan in plans]
    order = np.argsort(group[walls.plan], kind="stable")
    many = int(group.max()) + 1
    bounds = np.searchsorted(group[walls.plan][order], np.arange(many + 1))
    members: list[list[int]] = [[] for _ in range(many)]
    for k, g in enumerate(group.tolist()):
        members[g].append(k)
    for g in range(many):
        mine = order[bounds[g] : bounds[g + 1]]
        if len(mine) < 2 * LEAST_POINTS:
            continue
        own = members[g]
        with expendable(f"{plans[own[0]].id} fit", failed):
            # Where many touch, stretching one would tear it from its neighbours.
            pivot = np.asarray(overlay.union_all([shapes[k] for k in own]).centroid.coords[0])
            shift, scale = _best_move(walls.place[mine] - pivot, walls.normal[mine], walls.outward[mine], len(own) == 1)
            near = shapely.STRtree([shapes[k] for k in range(len(plans)) if group[k] != g])
            for _ in range(4):
                new = [_displaced(plans[k], shift, scale, pivot) for k in own]
                outlines = [overlay.union_all([plan.outline, *(part.polygon for part in plan.parts)]) for plan in new]
                grown = sum(
                    float(overlay.common_area(shape, near.geometries[i]))
                    for shape in outlines
                    for i in near.query(shape, predicate="intersects").tolist()
                )
                if grown < 0.02:
                    break
                shift, scale = 0.5 * shift, 1.0 + 0.5 * (scale - 1.0)
            else:
                continue
            if float(np.hypot(*shift)) < 0.03 and abs(scale - 1.0) < 0.001:
                continue
            for k, plan, shape in zip(own, new, outlines, strict=True):
                tried[k], shapes[k] = plan, shape
                moves[k] = (round(float(shift[0]), 3), round(float(shift[1]), 3)), round(float(scale), 4)
    after = measure.walls(tried)
    for g in range(many):
        if all(tried[k] is plans[k] for k in members[g]):
            continue
        was = mean_of(np.concatenate([walls.off(k) for k in members[g]]))
        is_ = mean_of(np.concatenate([after.off(k) for k in members[g]]))
        if not is_ < was - GAIN:
            for k in members[g]:
                tried[k], moves[k] = plans[k], still
    return _without_new_overlaps(plans, tried, moves, members)


def _without_new_overlaps(
    plans: list[BuildingPlan], tried: list[BuildingPlan], moves: list[Move], members: list[list[int]]
) -> tuple[list[BuildingPlan], list[Move]]:
    """Take back moves into a building whose own move out of the way was taken back, until there are none."""
    group = {k: g for g, own in enumerate(members) for k in own}
    while True:
        tree = shapely.STRtree([plan.outline for plan in tried])
        bad: set[int] = set()
        for k, plan in enumerate(tried):
            if plan is plans[k]:
                continue
            for i in tree.query(plan.outline, predicate="intersects").tolist():
                if group[i] != group[k] and overlay.common_area(plan.outline, tried[i].outline) > 0.02:
                    bad.add(group[k])
        bad = {g for g in bad if any(moves[k] != ((0.0, 0.0), 1.0) for k in members[g])}
        if not bad:
            return tried, moves
        for k in (k for g in sorted(bad) for k in members[g]):
            tried[k], moves[k] = plans[k], ((0.0, 0.0), 1.0)


def _touching(plans: list[BuildingPlan]) -> NDArray[np.int64]:
    """Return the number of the group of touching buildings that each belongs to."""
    rows = [(k, shape) for k, plan in enumerate(plans) for shape in (plan.outline, *(p.polygon for p in plan.parts))]
    owner = np.array([k for k, _ in rows])
    shapes = np.array([shape for _, shape in rows])
    left, right = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=0.3)
    graph = coo_matrix((np.ones(len(left), bool), (owner[left], owner[right])), shape=(len(plans), len(plans)))
    _, group = connected_components(graph, directed=False)
    return np.asarray(group, np.int64)


def _best_move(
    place: NDArray[np.float64], normal: NDArray[np.float64], outward: NDArray[np.float64], scalable: bool
) -> tuple[NDArray[np.float64], float]:
    """Return the shift and scale that bring walls to the mesh with least absolute distances along the normals."""
    reach = np.einsum("nk,nk->n", place, normal)
    design = np.c_[normal, reach] if scalable else normal
    # Pulls towards no change, so that a street front alone says nothing about moves along it.
    hold = np.diag([1.0, 1.0, 200.0][: design.shape[1]])
    weight = np.ones(len(outward))
    best = np.zeros(design.shape[1])
    for _ in range(15):
        best = np.linalg.solve(design.T @ (weight[:, None] * design) + hold, design.T @ (weight * outward))
        residual = np.abs(outward - design @ best)
        weight = 1.0 / np.maximum(residual / 0.15, 1.0)
    shift = best[:2] * min(1.0, MOST_SHIFT / max(float(np.hypot(*best[:2])), 1e-9))
    scale = 1.0 + float(np.clip(best[2], -_MOST_SCALE, _MOST_SCALE)) if scalable else 1.0
    return shift, scale


def _displaced(
    plan: BuildingPlan, shift: NDArray[np.float64], scale: float, pivot: NDArray[np.float64]
) -> BuildingPlan:
    def move(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(pivot + scale * (xy - pivot) + shift, np.float64)

    def moved(polygon: Polygon) -> Polygon:
        return shapely.transform(polygon, move)

    return replace(
        plan,
        outline=moved(plan.outline),
        parts=[replace(part, polygon=moved(part.polygon), roof=part.roof.moved(move)) for part in plan.parts],
        rooftop=[replace(part, polygon=moved(part.polygon)) for part in plan.rooftop],
    )
