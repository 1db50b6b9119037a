"""Planned buildings fitted to a photogrammetry mesh.

Rays from above and from the side measure how far planned roofs and walls lie from the mesh. Roofs move to where it has
them; so do walls, where buildings that touch are moved and scaled together. Whatever does not bring a building nearer
to the mesh is taken back.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from shapely import Polygon

from vico.errors import EmptyInputError
from vico.geo import overlay
from vico.geo.quantities import quantity
from vico.geo.tiles3d import TileMesh
from vico.world.heights import HeightField
from vico.world.model import Dropped
from vico.worldgen.buildings.solids import seat_of, solid_meshes
from vico.worldgen.facts.building_heights import STOREY
from vico.worldgen.facts.building_plans import BuildingPlan, BuildingPlans, PartPlan
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.ray_casting import RayCaster

LEAST_POINTS = 6  # of a part or a building, to say anything about it
GAIN = 0.02  # metres that a change must bring
_INSET = 1.2  # metres from a roof's edge, where photogrammetry rounds it off
_SPACING = 1.3
_MOST_POINTS = 600  # a part
_ROOF_CLIP = 4.0  # metres: a roof farther off is something else
_WALL_CLIP = 3.0  # metres: a wall farther off is something else
_DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class RoofSamples:
    """Points on the planned roofs, and the mesh above or below them."""

    plan: NDArray[np.int64]
    part: NDArray[np.int64]  # index among the plan's parts
    model: NDArray[np.float64]
    seen: NDArray[np.float64]

    def off(self, k: int) -> NDArray[np.float64]:
        """Distances at the points of a plan."""
        mine = self.plan == k
        return np.minimum(np.abs(self.seen[mine] - self.model[mine]), _ROOF_CLIP)


@dataclass(frozen=True)
class WallSamples:
    """Points on the planned walls, and how far outward of them the mesh lies."""

    plan: NDArray[np.int64]
    place: NDArray[np.float64]
    normal: NDArray[np.float64]
    outward: NDArray[np.float64]

    def off(self, k: int) -> NDArray[np.float64]:
        """Distances at the points of a plan."""
        return np.minimum(np.abs(self.outward[self.plan == k]), _WALL_CLIP)


class Measure:
    """Holds plans against the mesh."""

    def __init__(self, rays: RayCaster, mesh: TileMesh, height: HeightField) -> None:
        self.rays = rays
        self.height = height
        self.top = float(mesh.positions[:, 2].max()) + 10.0
        corner = mesh.positions[mesh.triangles]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        self.normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)

    def roofs(self, plans: list[BuildingPlan]) -> RoofSamples:
        """Rays from above at the model and at the mesh, at the same places."""
        bare = [replace(plan, rooftop=[]) for plan in plans]
        seats = [seat_of(plan, self.height) for plan in plans]
        solid = solid_meshes(bare, seats)
        first = np.cumsum([0, *(len(plan.parts) for plan in plans)])
        spots = np.concatenate([np.zeros((0, 2)), *(_inside(part.polygon) for plan in plans for part in plan.parts)])
        if not len(spots) or not len(solid.faces):
            none = np.zeros(0, np.int64)
            return RoofSamples(none, none, np.zeros(0), np.zeros(0))
        top = max(self.top, float(solid.points[:, 2].max()) + 10.0)
        start = np.c_[spots, np.full(len(spots), top)]
        model = RayCaster(solid.points, solid.faces).first(start, _DOWN)
        seen = self.rays.first(start, _DOWN)
        good = np.isfinite(model.distance) & np.isfinite(seen.distance)
        number_ = solid.part[model.triangle[good]]
        plan = solid.plan_of_part[number_]
        return RoofSamples(plan, number_ - first[plan], top - model.distance[good], top - seen.distance[good])

    def walls(self, plans: list[BuildingPlan]) -> WallSamples:
        """Rays from outside at the walls that nothing stands before."""
        parts = [
            (k, part) for k, plan in enumerate(plans) for part in plan.parts if part.low <= 0.5 and part.levels > 0
        ]
        owner, place, normal, floor, tall = [], [], [], [], []
        for k, part in parts:
            spots, outward = _along_walls(part.polygon)
            owner.append(np.full(len(spots), k))
            place.append(spots)
            normal.append(outward)
            base = seat_of(plans[k], self.height).base
            floor.append(np.full(len(spots), base))
            tall.append(np.full(len(spots), part.eaves))
        if not owner or not sum(map(len, owner)):
            return WallSamples(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
        who, spot, out = np.concatenate(owner), np.concatenate(place), np.concatenate(normal)
        base_, high = np.concatenate(floor), np.concatenate(tall)
        tree = shapely.STRtree([part.polygon for _, part in parts])
        free = np.ones(len(spot), bool)
        for reach in (0.4, _WALL_CLIP):
            hit, _ = tree.query(shapely.points(spot + reach * out), predicate="intersects")
            free[hit] = False
        who, spot, out, base_, high = who[free], spot[free], out[free], base_[free], high[free]
        layers = []
        for share in (0.4, 0.6, 0.8):
            start = np.c_[spot + _WALL_CLIP * out, base_ + share * high]
            hits = self.rays.first(start, np.c_[-out, np.zeros(len(out))], most=2 * _WALL_CLIP)
            facing = np.einsum("nk,nk->n", self.normal[hits.triangle][:, :2], out)
            good = np.isfinite(hits.distance) & (hits.distance > 0.05) & (facing > 0.5)
            layers.append(np.where(good, _WALL_CLIP - hits.distance, np.nan))
        outward = np.concatenate(layers)
        good = np.isfinite(outward)
        return WallSamples(
            np.tile(who, 3)[good], np.tile(spot, (3, 1))[good], np.tile(out, (3, 1))[good], outward[good]
        )


def _inside(polygon: Polygon) -> NDArray[np.float64]:
    """Points all over a polygon, away from its edge, shape ``(n, 2)``."""
    shape = next((s for inset in (_INSET, 0.6, 0.25) if (s := overlay.buffer(polygon, -inset)).area > 4.0), polygon)
    spacing = max(_SPACING, (shape.area / _MOST_POINTS) ** 0.5)
    west, south, east, north = shape.bounds
    x, y = np.meshgrid(
        np.arange(west + 0.31 * spacing, east, spacing), np.arange(south + 0.37 * spacing, north, spacing)
    )
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    return points[shapely.contains_xy(shape, points[:, 0], points[:, 1])]


def _along_walls(polygon: Polygon) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points along a polygon's outer walls, and where outward is."""
    ring = np.asarray(shapely.orient_polygons(polygon).exterior.coords)[:, :2]
    spots, normals = [np.zeros((0, 2))], [np.zeros((0, 2))]
    for a, b in pairwise(ring):
        length = float(np.hypot(*(b - a)))
        if length < 3.0:
            continue
        many = max(int(length / 2.0), 1)
        along = (np.arange(many) + 0.5) / many
        # Corners melt: keep a metre off them.
        along = along[(along * length > 1.0) & ((1 - along) * length > 1.0)]
        spots.append(a + along[:, None] * (b - a))
        normals.append(np.broadcast_to(np.array([b[1] - a[1], a[0] - b[0]]) / length, (len(along), 2)))
    return np.concatenate(spots), np.concatenate(normals)


def mean_of(values: NDArray[np.float64]) -> float:
    """Return the mean of what is known; NaN where nothing is."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


_LEAST_EAVES = 2.2
_ABSENT = 1.5  # metres over the ground floor under which the mesh shows no building


def raised_to_mesh(plan: BuildingPlan, roofs: RoofSamples, k: int, base: float) -> tuple[BuildingPlan, str]:
    """Return the plan with eaves and roofs where the mesh has them; or itself, and why, where no heights are known."""
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
    parts = _restack_parts(plan.parts, parts)
    return replace(plan, parts=parts, levels=max(part.levels for part in parts)), ""


def _raised_part(part: PartPlan, model: NDArray[np.float64], seen: NDArray[np.float64]) -> PartPlan | None:
    rise = part.roof.height
    new_rise = rise
    if part.roof.shape != "flat" and rise > 0.3:
        share = (model - part.eaves) / rise
        if float(share.std()) > 0.12:
            level, slope = _robust_line(share, seen)
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
    return replace(part, eaves=eaves, levels=levels, roof=part.roof.with_height(round(new_rise, 3)))


def _robust_line(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
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


def _restack_parts(old: list[PartPlan], new: list[PartPlan]) -> list[PartPlan]:
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


MOST_SHIFT = 2.0
"""Metres a footprint may be moved."""

_MOST_SCALE = 0.04


#: Metres east and north, and the factor on the footprint.
Move = tuple[tuple[float, float], float]


def _moved_to_mesh(
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
        with drop_on_failure(f"{plans[own[0]].id} fit", failed):
            # Where many touch, stretching one would tear it from its neighbours.
            pivot = np.asarray(overlay.union_all([shapes[k] for k in own]).centroid.coords[0])
            shift, scale = _best_move(walls.place[mine] - pivot, walls.normal[mine], walls.outward[mine], len(own) == 1)
            near = shapely.STRtree([shapes[k] for k in range(len(plans)) if group[k] != g])
            for _ in range(4):
                new = [_move_building(plans[k], shift, scale, pivot) for k in own]
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


def _move_building(
    plan: BuildingPlan, shift: NDArray[np.float64], scale: float, pivot: NDArray[np.float64]
) -> BuildingPlan:
    def move(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(pivot + scale * (xy - pivot) + shift, np.float64)

    def place(polygon: Polygon) -> Polygon:
        return shapely.transform(polygon, move)

    return replace(
        plan,
        outline=place(plan.outline),
        parts=[replace(part, polygon=place(part.polygon), roof=part.roof.transform(move)) for part in plan.parts],
        rooftop=[replace(part, polygon=place(part.polygon)) for part in plan.rooftop],
    )


@dataclass(frozen=True)
class Fit:
    """Result of fitting a building.

    Attributes
    ----------
    id
        The building's.
    before, after
        Mean distance of roof and walls to the mesh, metres; each place counts for at most 4 m. NaN where nothing could
        be measured.
    raised
        How far its highest eaves were raised, metres.
    shift
        How far it was moved east and north, metres.
    scale
        Factor on its footprint.
    reason
        Why it was left as it was, if it was.
    """

    id: str
    before: float
    after: float
    raised: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)
    scale: float = 1.0
    reason: str = ""


@dataclass(frozen=True)
class FitReport:
    """Results of fitting all buildings.

    Attributes
    ----------
    fits
        One a building, in the order of the plans.
    failed
        Buildings whose outline can't be cut, with the reason; they stay as planned.
    """

    fits: tuple[Fit, ...]
    failed: tuple[Dropped, ...] = ()

    @property
    def before(self) -> float:
        """Mean distance to the mesh of all buildings that could be measured, as planned, metres."""
        return mean_of(np.array([fit.before for fit in self.fits]))

    @property
    def after(self) -> float:
        """The same, fitted."""
        return mean_of(np.array([fit.after for fit in self.fits]))

    def counts(self) -> dict[str, int]:
        """How many were changed, and why the others were not."""
        kinds = Counter(fit.reason or "fitted" for fit in self.fits)
        return {
            "fitted": kinds.pop("fitted", 0),
            "heights": sum(bool(abs(fit.raised) > 0.005) for fit in self.fits),
            "shifted": sum(fit.shift != (0.0, 0.0) or fit.scale != 1.0 for fit in self.fits),
            **dict(sorted(kinds.items())),
        }


def plans_on_tiles(decided: BuildingPlans, mesh: TileMesh, terrain: HeightField) -> tuple[BuildingPlans, FitReport]:
    """Nudge the buildings of a place to a photogrammetry mesh; `terrain` should come from it (`terrain_from_tiles`)."""
    plans, report = fit_to_tiles(decided.plans, mesh, terrain)
    return replace(decided, plans=plans, dropped=[*decided.dropped, *report.failed]), report


def fit_to_tiles(
    plans: list[BuildingPlan], mesh: TileMesh, height: HeightField, *, sight: RayCaster | None = None
) -> tuple[list[BuildingPlan], FitReport]:
    """Nudge planned buildings to a photogrammetry mesh.

    Parameters
    ----------
    plans
        Buildings as the map and the rules have them.
    mesh
        The city as photographed, in the same frame.
    height
        The terrain they will stand on; its heights must be the mesh's.
    sight
        Rays against `mesh`, if somebody has made them ready.

    Returns
    -------
    tuple
        Plans in the same order, with the same ids and parts; and how near they were and are.

    Raises
    ------
    MissingExtraError
        If embreex is not installed.

    Notes
    -----
    Buildings that touch are moved together, so that no gap opens and no wall is doubled; a move into another building
    is halved until it fits, or left. Paper, section 3.1: "each building mesh is automatically adjusted to better match
    the Google 3D Tiles geometry".
    """
    if not plans or not len(mesh.triangles):
        return plans, FitReport(tuple(Fit(p.id, np.nan, np.nan, reason="no tiles") for p in plans))
    rays = sight or RayCaster(mesh.positions, mesh.triangles)
    measure = Measure(rays, mesh, height)
    roofs, walls = measure.roofs(plans), measure.walls(plans)
    failed: list[Dropped] = []
    raised: list[tuple[BuildingPlan, str]] = [(plan, "can't be raised") for plan in plans]
    for k, plan in enumerate(plans):
        with drop_on_failure(f"{plan.id} fit", failed):
            raised[k] = raised_to_mesh(plan, roofs, k, seat_of(plan, height).base)
    higher = measure.roofs([plan for plan, _ in raised])
    kept: list[BuildingPlan] = []
    reasons: list[str] = []
    for k, (plan, (new, reason)) in enumerate(zip(plans, raised, strict=True)):
        better = new is not plan and mean_of(higher.off(k)) < mean_of(roofs.off(k)) - GAIN
        kept.append(new if better else plan)
        reasons.append("" if better else reason or "already fits")
    moved, moves = _moved_to_mesh(kept, measure, failed)
    final_roofs, final_walls = measure.roofs(moved), measure.walls(moved)
    fits = []
    for k, (plan, new) in enumerate(zip(plans, moved, strict=True)):
        shift, scale = moves[k]
        changed = new is not plan
        fits.append(
            Fit(
                plan.id,
                mean_of(np.concatenate([roofs.off(k), walls.off(k)])),
                mean_of(np.concatenate([final_roofs.off(k), final_walls.off(k)])),
                round(max(p.eaves for p in new.parts) - max(p.eaves for p in plan.parts), 3),
                shift,
                scale,
                "" if changed else reasons[k],
            )
        )
    return moved, FitReport(tuple(fits), tuple(failed))


def lower_onto_terrain(mesh: TileMesh, plans: list[BuildingPlan], height: HeightField) -> tuple[TileMesh, float]:
    """Lower a mesh of buildings alone onto a terrain that comes from elsewhere.

    Tilesets of city models have no ground, and count heights from the ellipsoid where elevation files count from the
    sea: between the two lie up to 100 m.

    Parameters
    ----------
    mesh
        The city model, in the plans' frame.
    plans
        The same city from the map.
    height
        What the buildings shall stand on.

    Returns
    -------
    tuple
        The mesh with its buildings' feet on the terrain, and by how much it was raised, metres.

    Raises
    ------
    EmptyInputError
        If no planned building has anything of the mesh in it.
    """
    tree = shapely.STRtree([overlay.buffer(plan.outline, 0.5) for plan in plans])
    points = mesh.positions
    vertex, plan = tree.query(shapely.points(points[:, :2]), predicate="intersects") if plans else ((), ())
    owner = np.asarray(plan, np.int64)
    feet = np.full(len(plans), np.inf)
    np.minimum.at(feet, owner, points[np.asarray(vertex, np.int64), 2])
    # A planned building that only a corner of another reaches into has no foot in the mesh.
    stand = np.flatnonzero(np.bincount(owner, minlength=len(plans)) >= LEAST_POINTS)
    if not len(stand):
        raise EmptyInputError(
            "tiles: not one building of the map has anything of the tileset in it; check the tileset's place and crs"
        )
    by = float(np.median([seat_of(plans[k], height).base - feet[k] for k in stand.tolist()]))
    return replace(mesh, positions=points + np.array([0.0, 0.0, by])), by
