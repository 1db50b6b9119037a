"""Planned buildings nudged to a photogrammetry mesh.

Roofs move to where rays from above meet it, walls to where rays from the side do. Whatever does not bring a building
nearer to the mesh is taken back.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
import shapely

from vico.errors import EmptyInputError
from vico.geo import overlay
from vico.geo.tiles3d import TileMesh
from vico.world.heights import HeightField
from vico.world.model import Dropped
from vico.worldgen.buildings.fitting.heights import raised_to_mesh
from vico.worldgen.buildings.fitting.measure import GAIN, LEAST_POINTS, Measure, mean_of
from vico.worldgen.buildings.fitting.moves import moved_to_mesh
from vico.worldgen.buildings.solids import seat_of
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.outlines.plans import BuildingPlan, BuildingPlans
from vico.worldgen.facts.sight import Sight


@dataclass(frozen=True)
class Fit:
    """What became of a building.

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
    """What became of all buildings.

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
    plans: list[BuildingPlan], mesh: TileMesh, height: HeightField, *, sight: Sight | None = None
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
    rays = sight or Sight(mesh.positions, mesh.triangles)
    measure = Measure(rays, mesh, height)
    roofs, walls = measure.roofs(plans), measure.walls(plans)
    failed: list[Dropped] = []
    raised: list[tuple[BuildingPlan, str]] = [(plan, "can't be raised") for plan in plans]
    for k, plan in enumerate(plans):
        with expendable(f"{plan.id} fit", failed):
            raised[k] = raised_to_mesh(plan, roofs, k, seat_of(plan, height).base)
    higher = measure.roofs([plan for plan, _ in raised])
    kept: list[BuildingPlan] = []
    reasons: list[str] = []
    for k, (plan, (new, reason)) in enumerate(zip(plans, raised, strict=True)):
        better = new is not plan and mean_of(higher.off(k)) < mean_of(roofs.off(k)) - GAIN
        kept.append(new if better else plan)
        reasons.append("" if better else reason or "already fits")
    moved, moves = moved_to_mesh(kept, measure, failed)
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


def settled(mesh: TileMesh, plans: list[BuildingPlan], height: HeightField) -> tuple[TileMesh, float]:
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
