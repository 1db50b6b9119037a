"""Parts of a roof beside its slopes: eaves, stepped gables and dormers; closed solids each.

Eaves: roofs reach out over the walls, each slope in its own plane, cut where a neighbour stands. What is built is the
fringe outside the walls alone: along every edge of an outline the slopes that end there go on outwards and down (at
eaves) or outwards and level (at gables), a hand thick. Slopes that meet at a corner meet at its mitre. A fringe is a
closed solid of its own; its inner face lies against the wall and is never seen.

Stepped gables stand before their roofs, as in the Low Countries. Dormers are small gabled boxes with a window, in a row
on a long steep slope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import manifold3d
import numpy as np
import shapely
from manifold3d import CrossSection, Manifold
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.exact import dot
from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.world.model import Dropped
from vico.worldgen.buildings.solids import Mesh
from vico.worldgen.facades.facade_styles import styles
from vico.worldgen.facts.building_plans import BuildingPlan, PartPlan
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.roofs import Roof, rings_of

_WITH_EAVES = (
    "gabled",
    "hipped",
    "half-hipped",
    "side_hipped",
    "side_half-hipped",
    "hipped-and-gabled",
    "gambrel",
    "saltbox",
    "double_saltbox",
    "skillion",
    "pyramidal",
)
_ON_EDGE = 0.03  # metres within which a corner of the mesh lies on an outline's edge
_APART = 0.012  # metres kept free of neighbours, so that no two faces lie in one plane
_HEADROOM = 2.3  # metres under the lowest edge
_LANE = 4.0  # metres from a street's centre line within which more headroom is asked for
_LANE_HEADROOM = 3.2  # metres
_SPECK = 0.004  # metres: detail that the kernel makes and that is too small to be seen
_SHORTEST = 0.9  # metres of an edge that is worth a fringe
_STEEPEST = 1.9  # rise per metre beyond which a roof is a spire and has none


@dataclass(frozen=True)
class Slope:
    """A stretch of a roof's border: along the edge from `a` to `b` (plan), in the plane ``z = c + gx x + gy y``."""

    edge: int
    start: float
    end: float
    plane: tuple[float, float, float]

    def height(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the slope's plane at points, shape ``(n, 2)``."""
        c, gx, gy = self.plane
        return np.asarray(c + xy[:, 0] * gx + xy[:, 1] * gy, np.float64)

    @property
    def gradient(self) -> NDArray[np.float64]:
        """Rise per metre east and north."""
        return np.array(self.plane[1:])


@dataclass(frozen=True)
class Edges:
    """Edges of an outline, walls to the left: `start`, `along` and `out` (unit vectors), `length`."""

    start: NDArray[np.float64]
    along: NDArray[np.float64]
    out: NDArray[np.float64]
    length: NDArray[np.float64]
    before: NDArray[np.int64]
    after: NDArray[np.int64]


def edges_of(polygon: Polygon) -> Edges:
    """Return the edges of all rings of an outline."""
    rings = rings_of(polygon)
    start = np.concatenate(rings)
    step = np.concatenate([np.roll(ring, -1, axis=0) - ring for ring in rings])
    length = np.maximum(np.hypot(*step.T), 1e-9)
    along = step / length[:, None]
    before, after, first = [], [], 0
    for ring in rings:
        n = len(ring)
        index = np.arange(n)
        before.append(first + (index - 1) % n)
        after.append(first + (index + 1) % n)
        first += n
    out = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return Edges(start, along, out, length, np.concatenate(before), np.concatenate(after))


def slopes_of(mesh: Mesh, edges: Edges, eaves: float) -> list[Slope]:
    """Where a roof's slopes end above the outline's edges.

    Parameters
    ----------
    mesh
        The closed solid under its roof.
    edges
        Of its outline, in the same frame.
    eaves
        Height at which its roof begins.

    Returns
    -------
    list of Slope
        One a slope and edge, in the order of the edges.
    """
    points, faces = mesh
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    slanting = np.flatnonzero((normal[:, 2] > 0.2) & (corner[..., 2].max(axis=1) > eaves + 0.05))
    a = corner[slanting].reshape(-1, 3)
    b = np.roll(corner[slanting], -1, axis=1).reshape(-1, 3)
    n = np.repeat(normal[slanting], 3, axis=0)
    # Both ends of a mesh edge on one edge of the outline: it is where this slope ends.
    found: dict[tuple[int, float, float, float], list[float]] = {}
    size = np.hypot(*(b - a)[:, :2].T)
    for k in range(len(edges.start)):
        s = dot(a[:, :2] - edges.start[k], edges.along[k])
        t = dot(b[:, :2] - edges.start[k], edges.along[k])
        on = (np.abs(dot(a[:, :2] - edges.start[k], edges.out[k])) < _ON_EDGE) & (
            np.abs(dot(b[:, :2] - edges.start[k], edges.out[k])) < _ON_EDGE
        )
        on &= (np.minimum(s, t) > -_ON_EDGE) & (np.maximum(s, t) < edges.length[k] + _ON_EDGE)
        on &= (size > 0.02) & (np.minimum(a[:, 2], b[:, 2]) > eaves - 0.03)
        for j in np.flatnonzero(on).tolist():
            gx, gy = -n[j, 0] / n[j, 2], -n[j, 1] / n[j, 2]
            c = float(a[j, 2] - gx * a[j, 0] - gy * a[j, 1])
            key = (k, round(float(gx), 2), round(float(gy), 2), round(float(dot(n[j], a[j])), 1))
            low, high = sorted((float(s[j]), float(t[j])))
            row = found.setdefault(key, [low, high, c, float(gx), float(gy)])
            row[0], row[1] = min(row[0], low), max(row[1], high)
    made = [Slope(k, low, high, (c, gx, gy)) for (k, *_), (low, high, c, gx, gy) in found.items()]
    return sorted(made, key=lambda slope: (slope.edge, slope.start, slope.end))


def eaves(
    plans: Sequence[BuildingPlan],
    meshes: Sequence[Sequence[Mesh]],
    bases: Sequence[float],
    reaches: Sequence[float],
    finishes: Sequence[str],
    streets: shapely.STRtree,
    *,
    dropped: list[Dropped],
) -> list[list[PartPlan]]:
    """Return the fringes of all pitched roofs.

    Parameters
    ----------
    plans
        All buildings, solids apart from each other.
    meshes
        The solid of each part of each building, ENU metres.
    bases
        Height of each one's ground floor, metres.
    reaches
        How far each one's roof reaches out, metres; 0: not at all.
    finishes
        The fringe's finish, by building.
    streets
        Centre lines of streets: over them more headroom is kept.
    dropped
        Where it is told whose can't be made.

    Returns
    -------
    list of list of PartPlan
        One list a building; each with a mesh of its own.
    """
    rows = [(part, p, mesh) for p, plan in enumerate(plans) for part, mesh in zip(plan.parts, meshes[p], strict=True)]
    made: list[list[PartPlan]] = [[] for _ in plans]
    if not rows:
        return made
    tree = shapely.STRtree([part.polygon for part, _, _ in rows])
    standing: dict[int, tuple[BaseGeometry, float, float]] = {}
    for k, (part, p, mesh) in enumerate(rows):
        reach = min(reaches[p], 0.12 * part.polygon.area / max(part.polygon.length / 4.0, 0.1))
        if reach < 0.1 or part.roof.shape not in _WITH_EAVES or part.roof.height < 0.4 or part.polygon.area < 20.0:
            continue
        with drop_on_failure(f"{plans[p].id} eaves", dropped):
            top, level = bases[p] + part.top, bases[p] + part.eaves
            edges = edges_of(part.polygon)
            slopes = slopes_of(mesh, edges, level)
            if not slopes or max(float(np.hypot(*slope.gradient)) for slope in slopes) > _STEEPEST:
                continue
            near = [
                j for j in sorted(tree.query(part.polygon, predicate="dwithin", distance=2 * reach).tolist()) if j != k
            ]
            taken: list[BaseGeometry] = []
            walls: list[BaseGeometry] = []
            for j in near:
                other, q, _ = rows[j]
                if bases[q] + other.top > level - 1.2 and bases[q] + other.low < top:
                    taken.append(other.polygon)
                    walls.append(other.polygon)
                if j in standing and standing[j][2] > level - 1.5 and standing[j][1] < top:
                    taken.append(standing[j][0])
            shared = _edges_at_neighbours(edges, walls)
            thick = 0.13 if reach < 0.5 else 0.2
            pieces = _pieces(
                slopes, edges, np.where(shared | (edges.length < _SHORTEST), 0.0, reach), bases[p], streets, thick
            )
            solid, outline, lowest = _fringe(pieces, taken, thick)
            if solid is None:
                continue
            standing[k] = (outline, lowest, top)
            body = solid.to_mesh64()
            points = np.asarray(body.vert_properties, np.float64)[:, :3] + (*_middle(outline), -bases[p])
            plan = PartPlan(
                max(polygons_of(outline), key=lambda shape: shape.area), lowest - bases[p], part.eaves, 0,
                Roof("flat", 0.0), part.tags, finishes[p],
            )  # fmt: skip
            made[p].append(replace(plan, mesh=(points, np.asarray(body.tri_verts, np.int64))))
    return made


def _middle(outline: BaseGeometry) -> tuple[float, float]:
    x, y = outline.centroid.coords[0]
    return float(round(x)), float(round(y))


def _edges_at_neighbours(edges: Edges, walls: list[BaseGeometry]) -> NDArray[np.bool_]:
    """Edges with a neighbour's wall at their face, shape ``(n,)``."""
    result = np.zeros(len(edges.start), bool)
    if walls:
        tree = shapely.STRtree(walls)
        for share in (0.1, 0.5, 0.9):
            probes = edges.start + edges.along * (edges.length * share)[:, None] + edges.out * 0.2
            result[tree.query(shapely.points(probes), predicate="intersects")[0]] = True
    return result


def _pieces(
    slopes: list[Slope],
    edges: Edges,
    reach: NDArray[np.float64],
    base: float,
    streets: shapely.STRtree,
    thick: float,
) -> list[tuple[Polygon, Slope]]:
    """Return the stretch of every slope outside the walls, from above."""
    made = []
    for slope in slopes:
        k = slope.edge
        if reach[k] <= 0.0:
            continue
        ends = []
        for s, near, other in (
            (slope.start, slope.start < _ON_EDGE, edges.before[k]),
            (slope.end, slope.end > edges.length[k] - _ON_EDGE, edges.after[k]),
        ):
            foot = edges.start[k] + edges.along[k] * min(max(s, 0.0), edges.length[k])
            ends.append((foot, foot + (_mitre(edges, reach, k, int(other)) if near else edges.out[k] * reach[k])))
        (p, p_out), (q, q_out) = ends
        piece = Polygon([p, p_out, q_out, q])
        # A corner that turns inwards more than the edge is long would turn the piece over.
        if dot(q_out - p_out, edges.along[k]) < 0.05 or not piece.is_valid or piece.area < 0.01:
            continue
        lowest = float(slope.height(np.array([p_out, q_out])).min()) - thick - base
        over_lane = lowest < _LANE_HEADROOM and len(streets.query(piece, predicate="dwithin", distance=_LANE)) > 0
        if lowest >= _HEADROOM - 0.3 and not over_lane:
            made.append((piece, slope))
    return made


def _mitre(edges: Edges, reach: NDArray[np.float64], k: int, other: int) -> NDArray[np.float64]:
    """From a corner to where the outer lines of its two edges meet; straight out where that is far away."""
    both = np.stack([edges.out[k], edges.out[other]])
    determinant = both[0, 0] * both[1, 1] - both[0, 1] * both[1, 0]
    straight = edges.out[k] * reach[k]
    if abs(determinant) < 0.3:
        return straight
    near, far = reach[k], reach[other]
    meeting = np.array([near * both[1, 1] - far * both[0, 1], far * both[0, 0] - near * both[1, 0]]) / determinant
    return meeting if np.hypot(*meeting) < 2.2 * reach[k] else straight


def _fringe(
    pieces: list[tuple[Polygon, Slope]], taken: list[BaseGeometry], thick: float
) -> tuple[Manifold | None, BaseGeometry, float]:
    """Return the solid of all pieces about the whole metre nearest their middle, its cover, and its lowest point."""
    blocked = overlay.buffer(overlay.union_all(taken), _APART, join_style="mitre") if taken else None
    shapes: list[tuple[Polygon, Slope]] = []
    for piece, slope in pieces:
        rest: BaseGeometry = piece if blocked is None else overlay.difference(piece, blocked)
        shapes += [(shape, slope) for shape in polygons_of(rest, 0.03)]
    outline = overlay.union_all([shape for shape, _ in shapes])
    if not shapes or outline.is_empty:
        return None, outline, 0.0
    centre = np.array(_middle(outline))
    solids, lowest = [], np.inf
    for shape, slope in shapes:
        rings = [ring - centre for ring in rings_of(shape)]

        def lift(
            points: NDArray[np.float64], slope: Slope = slope, centre: NDArray[np.float64] = centre
        ) -> NDArray[np.float64]:
            moved = np.array(points, np.float64)
            moved[:, 2] = slope.height(moved[:, :2] + centre) - np.where(moved[:, 2] > 0.5, 0.0, thick)
            return moved

        solid = CrossSection(rings, manifold3d.FillRule.Positive).extrude(1.0).warp_batch(lift)
        if solid.is_empty():
            continue
        solids.append(solid)
        lowest = min(lowest, float(solid.bounding_box()[2]))
    if not solids:
        return None, outline, 0.0
    whole = Manifold.batch_boolean(solids, manifold3d.OpType.Add).simplify(_SPECK)
    return (None if whole.is_empty() or whole.volume() <= 0 else whole), outline, lowest


_STEPS = 4
_BEHIND = 0.3  # metres that a gable reaches into the roof
_BEFORE = 0.05  # metres that it stands before the wall's plane
_COPING = 0.3  # metres by which each step stands above the slope behind it
_NARROWEST_GABLE = 3.0  # metres of front that have one, at least
_WIDEST_GABLE = 12.0  # and at most
_LOWEST_GABLE = 1.5  # metres of roof


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
        if roof.shape != "gabled" or roof.height < _LOWEST_GABLE or roof.direction is None:
            continue
        edges = edges_of(part.polygon)
        ridge = np.array([np.cos(roof.direction), np.sin(roof.direction)])
        for k in np.flatnonzero(shown).tolist():
            length = float(edges.length[k])
            if _NARROWEST_GABLE < length < _WIDEST_GABLE and abs(float(dot(edges.out[k], ridge))) > 0.9:
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


_WITH_DORMERS = ("gabled", "hipped", "half-hipped", "mansard", "gambrel")
_DORMER_FACES = np.array(
    [
        (0, 1, 2), (0, 2, 3), (3, 2, 4),
        (2, 5, 7), (2, 7, 4), (3, 4, 7), (3, 7, 6),
        (1, 5, 2), (0, 3, 6),
        (0, 6, 5), (0, 5, 1), (5, 6, 7),
    ],
    np.int64,
)  # fmt: skip
_DORMER_USES = ("residential", "hotel", "commercial", "retail", "office", "other", "civic", "education")
_DORMER_WIDTH = 1.4
_DORMER_EVERY = 6.0  # metres from one to the next
_GENTLEST = 0.62  # rise per metre
_MOST_DORMERS = 8  # a building


def dormers(
    plan: BuildingPlan,
    meshes: list[Mesh],
    base: float,
    others: list[PartPlan],
    region: str,
    random: np.random.Generator,
) -> list[PartPlan]:
    """Put dormers on a building's roofs.

    Parameters
    ----------
    plan
        The building.
    meshes
        The solid of each of its parts, ENU metres.
    base
        Height of its ground floor.
    others
        What else sits on its roofs; dormers keep clear of it.
    region
        As `facades.facade_styles.region_of` says.
    random
        The building's own stream.

    Returns
    -------
    list of PartPlan
        The first edge of each one's outline is its window's.
    """
    made: list[PartPlan] = []
    wanted = random.random() < styles().region(region).dormers
    if plan.use not in _DORMER_USES:
        return made
    for part, mesh in zip(plan.parts, meshes, strict=True):
        if not (wanted or part.roof.shape == "mansard"):
            continue
        if (
            part.roof.shape not in _WITH_DORMERS
            or part.roof.height < 2.2
            or part.levels < 1
            or part.polygon.area < 55.0
        ):
            continue
        edges = edges_of(part.polygon)
        above = [other for other in plan.parts if other is not part and other.top > part.eaves + 0.5]
        kept_off = [other.polygon for other in (*above, *others)]
        for slope in slopes_of(mesh, edges, base + part.eaves):
            for box in _dormer_row(part, slope, edges, base):
                if len(made) < _MOST_DORMERS and not any(box.polygon.distance(shape) < 0.3 for shape in kept_off):
                    made.append(box)
                    kept_off.append(box.polygon)
    return made


def _dormer_row(part: PartPlan, slope: Slope, edges: Edges, base: float) -> list[PartPlan]:
    out, along = edges.out[slope.edge], edges.along[slope.edge]
    rise = -float(dot(slope.gradient, out))
    sideways = abs(float(dot(slope.gradient, along)))
    if rise < _GENTLEST or sideways > 0.1 * rise:
        return []
    steep = part.roof.shape in ("mansard", "gambrel") and rise > 1.2
    inset = 0.3 if steep else 0.55
    room = (0.62 if steep else 1.0) * part.roof.height - rise * inset - 0.25
    gable = 0.42
    tall = min(1.4, room - gable)
    if tall < 0.95:
        return []
    deep = (tall + gable) / rise + 0.15 if not steep else 1.7
    margin = 1.3 if part.roof.shape == "gabled" else 1.3 + inset + deep
    first, last = slope.start + margin, slope.end - margin
    if last - first < 0.2:
        return []
    count = max(1, round((last - first) / _DORMER_EVERY))
    made = []
    for k in range(count):
        middle = edges.start[slope.edge] + along * (first + (last - first) * (k + 0.5) / count) - out * inset
        left, right = middle - along * _DORMER_WIDTH / 2, middle + along * _DORMER_WIDTH / 2
        box = Polygon([left, right, right - out * deep, left - out * deep])
        if not shapely.contains(part.polygon, box):
            continue
        foot = float(slope.height(middle[None])[0]) - base
        low, eaves = foot - 0.3, foot + tall
        # Its lower edges end in the slope, where they meet it; so it needs neither a back nor much of an underside.
        back = -out * min((tall + 0.06) / rise, deep)
        points = np.array(
            [
                (*left, low), (*right, low), (*right, eaves), (*left, eaves), (*middle, eaves + gable),
                (*(right + back), eaves), (*(left + back), eaves), (*(middle - out * deep), eaves + gable),
            ]
        )  # fmt: skip
        mesh = (points, _DORMER_FACES)
        made.append(PartPlan(box, low, eaves, 0, Roof("flat", gable), part.tags, "dormer", mesh))
    return made
