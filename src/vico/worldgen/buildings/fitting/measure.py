"""How far planned roofs and walls lie from a photogrammetry mesh: rays from above, and from the side."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.geo.tiles3d import TileMesh
from vico.world.heights import HeightField
from vico.worldgen.buildings.solids import seat_of, solid_meshes
from vico.worldgen.facts.outlines.plans import BuildingPlan
from vico.worldgen.facts.sight import Sight

LEAST_POINTS = 6  # of a part or a building, to say anything about it
GAIN = 0.02  # metres that a change must bring
_INSET = 1.2  # metres from a roof's edge, where photogrammetry rounds it off
_SPACING = 1.3
_MOST_POINTS = 600  # a part
_ROOF_CLIP, _WALL_CLIP = 4.0, 3.0  # metres: what is farther off is something else
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

    def __init__(self, rays: Sight, mesh: TileMesh, height: HeightField) -> None:
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
        model = Sight(solid.points, solid.faces).first(start, _DOWN)
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
