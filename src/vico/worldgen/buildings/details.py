"""Small solids on buildings: chimneys, penthouses, cornices, posts, balconies, oriels, fire escapes, water tanks.

Each is closed. Chimneys stand by the ridge, or as stacks with pots on the walls between houses; no higher than they
have to be.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.exact import apply_matrix, dot
from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.world.model import Dropped
from vico.worldgen.buildings.roof_details import Edges, edges_of
from vico.worldgen.buildings.solids import Mesh
from vico.worldgen.buildings.walls import Storeys, storeys_of
from vico.worldgen.facades.facade_styles import FacadeStyle, styles
from vico.worldgen.facades.records import RegionalStyle
from vico.worldgen.facts.building_plans import BuildingPlan, PartPlan
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.roofs import Roof, rings_of

_SIZE = (0.85, 0.5)  # metres
_STACK = 1.7  # metres of a chimney along a wall between houses
_THICK = 0.5  # and across it
_POTS = 0.38  # metres, height of a row of pots
_POT = 0.2  # metres, its width
_CLEAR = 0.75  # metres by which a chimney stands above the roof around it, at least
_OVER_RIDGE = 0.5  # metres beyond which no chimney stands above its roof's ridge, unless it stands at it
_LEAST_WALL = 5.0  # metres of a wall that carries a stack


def ridge_chimneys(
    part: PartPlan, free: BaseGeometry, mesh: Mesh, base: float, random: np.random.Generator
) -> list[PartPlan]:
    """Return chimneys near a roof's ridge, one for every 210 m2 or so.

    Parameters
    ----------
    part, free
        What is roofed, and which of its outline nothing higher stands on.
    mesh, base
        Its solid, ENU metres, and the height of the building's ground floor: a chimney is as high as the roof asks
        where it stands.
    random
        The building's own stream.
    """
    # Towards the ridge: a chimney at the eaves would have to stand free as high as the roof.
    inset = max(1.2, 0.8 * part.polygon.area / part.polygon.exterior.length)
    pieces = polygons_of(overlay.buffer(free, -inset)) or polygons_of(overlay.buffer(free, -1.2))
    room = max(pieces, key=lambda shape: shape.area, default=None)
    count = min(int(part.polygon.area / 210.0) + 1, 4)
    draws = random.random((count, 3))
    if room is None:
        return []
    made: list[PartPlan] = []
    west, south, east, north = room.bounds
    for at in draws:
        centre = np.array([west + (east - west) * at[0], south + (north - south) * at[1]])
        box = _box(centre, np.array(_SIZE), _longest_edge_direction(part.polygon))
        if free.contains(box) and not any(box.intersects(m.polygon) for m in made):
            made.append(_chimney(part, box, mesh, base, 0.3 * float(at[2])))
    return made


def party_wall_stacks(
    part: PartPlan, free: BaseGeometry, mesh: Mesh, base: float, front: NDArray[np.bool_], random: np.random.Generator
) -> list[PartPlan]:
    """Return stacks of flues with rows of pots: inside the walls that run back from the street, at most two.

    Parameters
    ----------
    part, free, mesh, base, random
        As of `ridge_chimneys`.
    front
        Edges of the outline that face a street, shape ``(n,)``.
    """
    edges = edges_of(part.polygon)
    draws = random.random((2, 2))
    if not front.any():
        return ridge_chimneys(part, free, mesh, base, random)
    street = edges.along[int(np.where(front, edges.length, 0.0).argmax())]
    square = np.abs(dot(edges.along, street)) < 0.5
    sides = np.flatnonzero(square & ~front & (edges.length > _LEAST_WALL))
    longest = sides[np.argsort(-edges.length[sides], kind="stable")][:2]
    made: list[PartPlan] = []
    for k, (place, grow) in zip(longest.tolist(), draws.tolist(), strict=False):
        middle = edges.start[k] + edges.along[k] * edges.length[k] * (0.38 + 0.24 * place)
        centre = middle - edges.out[k] * (_THICK / 2 + 0.06)
        yaw = math.atan2(edges.along[k][1], edges.along[k][0])
        box = _box(centre, np.array([_STACK, _THICK]), yaw)
        if free.contains(box) and not any(box.intersects(m.polygon) for m in made):
            stack = _chimney(part, box, mesh, base, 0.35 * grow)
            pots = _box(centre, np.array([0.84 * _STACK, _POT]), yaw)
            made += [stack, PartPlan(pots, stack.eaves, stack.eaves + _POTS, 0, Roof("flat", 0.0), {}, "pots")]
    return made


def _chimney(part: PartPlan, box: Polygon, mesh: Mesh, base: float, more: float) -> PartPlan:
    around = max(height_of(mesh, xy) for xy in np.asarray(box.exterior.coords)[:4, :2]) - base
    top = max(min(around + _CLEAR + 0.8, part.top + _OVER_RIDGE), around + _CLEAR) + more
    # Its foot lies a little under the eaves: on them it would share a plane with other solids' tops.
    return PartPlan(box, part.eaves - 0.07, top, 0, Roof("flat", 0.0), {}, "chimney")


def height_of(mesh: Mesh, xy: NDArray[np.float64]) -> float:
    """Return how high a solid reaches at a point of its outline, metres; its top where no face is over the point."""
    points, faces = mesh
    a, b, c = (points[faces[:, k]] for k in range(3))
    # Barycentric coordinates in plan; faces seen from above only.
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    up = area > 1e-9
    a, b, c, area = a[up], b[up], c[up], area[up]
    v = ((xy[0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (xy[1] - a[:, 1]) * (c[:, 0] - a[:, 0])) / area
    w = ((b[:, 0] - a[:, 0]) * (xy[1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (xy[0] - a[:, 0])) / area
    inside = (v >= -1e-6) & (w >= -1e-6) & (v + w <= 1 + 1e-6)
    if not inside.any():
        return float(points[:, 2].max())
    height = a[:, 2] + v * (b[:, 2] - a[:, 2]) + w * (c[:, 2] - a[:, 2])
    return float(height[inside].max())


def _longest_edge_direction(polygon: Polygon) -> float:
    corners = edges_of(polygon)
    along = corners.along[int(corners.length.argmax())]
    return math.atan2(along[1], along[0])


def _box(centre: NDArray[np.float64], size: NDArray[np.float64], yaw: float) -> Polygon:
    c, s = np.cos(yaw), np.sin(yaw)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size / 2
    return Polygon(apply_matrix(corners, [[c, -s], [s, c]]) + centre)


_CHIMNEYED = ("hipped", "gabled", "half-hipped", "mansard", "gambrel", "hipped-and-gabled")
_CORNICE_ABOVE = 0.03
_POST = 0.24  # metres: side of a post
_POST_EVERY = 6.0
_ROADWAY = 3.6  # metres from a street's centre line that stay free of posts


def rooftop_parts(
    plan: BuildingPlan,
    meshes: Sequence[Mesh],
    base: float,
    fronts: Sequence[NDArray[np.bool_]],
    random: np.random.Generator,
    *,
    region: str,
) -> list[PartPlan]:
    """Decide the small solids of a building's roof: penthouses and chimneys.

    Parameters
    ----------
    plan
        The building.
    meshes, fronts
        Of each part its solid, ENU metres, and the edges that show a front.
    base
        Height of the ground floor.
    random
        The building's own stream.
    region
        As `facades.facade_styles.region_of` says.

    Returns
    -------
    list of PartPlan
        Without storeys; `finish` says what they are.
    """
    made: list[PartPlan] = []
    stacked = styles().region(region).chimneys == "on_party_walls"
    for part, mesh, front in zip(plan.parts, meshes, fronts, strict=True):
        if part.levels == 0 or part.eaves < 4.5 or part.polygon.area < 50.0:
            continue
        bare = part.roof.shape == "flat" and part.roof.height <= 0.0
        if bare or (part.low > 0.0 and part.roof.shape != "flat"):
            continue
        above = [other.polygon for other in plan.parts if other is not part and other.top > part.eaves + 0.3]
        free = overlay.difference(part.polygon, overlay.union_all(above)) if above else part.polygon
        if part.roof.shape == "flat":
            made += _penthouses(part, free, random)
        elif part.roof.shape in _CHIMNEYED and plan.use in ("residential", "hotel", "commercial", "civic"):
            if stacked:
                made += party_wall_stacks(part, free, mesh, base, front, random)
            else:
                made += ridge_chimneys(part, free, mesh, base, random)
    return made


def cornices(
    plans: Sequence[BuildingPlan],
    walls: Sequence[str],
    bases: Sequence[float],
    fronts: Sequence[Sequence[NDArray[np.bool_]] | None] | None = None,
    *,
    dropped: list[Dropped],
) -> list[list[PartPlan]]:
    """Ledges under the eaves of old-fashioned walls, cut where neighbours stand or have theirs.

    Parameters
    ----------
    plans
        All buildings, solids apart from each other.
    walls
        Facade material of each.
    bases
        Height of each one's ground floor, metres.
    fronts
        Of each part the edges that have one; None, for a building or for all: every edge.
    dropped
        Where it is told whose can't be made.

    Returns
    -------
    list of list of PartPlan
        One list a building.
    """
    rows = [(part, p) for p, plan in enumerate(plans) for part in plan.parts]
    shown = [None if fronts is None or (f := fronts[p]) is None else f[i]
             for p, plan in enumerate(plans) for i in range(len(plan.parts))]  # fmt: skip
    made: list[list[PartPlan]] = [[] for _ in plans]
    if not rows:
        return made
    tree = shapely.STRtree([part.polygon for part, _ in rows])
    of_part: dict[int, list[tuple[BaseGeometry, float, float]]] = {}
    for k, (part, p) in enumerate(rows):
        bare = part.roof.shape == "flat" and part.roof.height <= 0.0
        family = styles().families[walls[p]]
        if family.cornice == "none" or part.levels < 2 or bare or part.polygon.area < 50.0 or part.eaves < 4.5:
            continue
        if family.cornice == "under_flat_roofs" and part.roof.shape != "flat":
            continue
        with drop_on_failure(f"{plans[p].id} cornice", dropped):
            deep, out = family.cornice_size
            low, high = bases[p] + part.eaves - deep, bases[p] + part.eaves + _CORNICE_ABOVE
            outline = overlay.simplify(part.polygon, 0.2)
            outer = overlay.buffer(outline, out, join_style="mitre", mitre_limit=1.6)
            # Against the wall, not into it: an inner face would come to lie in the plane of some other wall.
            shape: BaseGeometry = overlay.difference(outer, part.polygon)
            edges = shown[k]
            if edges is not None and not edges.all():
                shape = overlay.intersection(shape, _before(part.polygon, edges, out + 0.01))
                if shape.is_empty:
                    continue
            taken: list[BaseGeometry] = []
            for j in sorted(tree.query(outer, predicate="dwithin", distance=out + 0.08).tolist()):
                other, q = rows[j]
                if j != k and bases[q] + other.top > low - 0.1 and bases[q] + other.low < high:
                    taken.append(other.polygon)
                taken += [
                    ledge for ledge, bottom, top in of_part.get(j, []) if top > low - 0.02 and bottom < high + 0.02
                ]
            if taken:
                # A finger's breadth clear of them, so that no two faces lie in one plane.
                shape = overlay.difference(shape, overlay.buffer(overlay.union_all(taken), 0.012, join_style="mitre"))
            # An opening takes away what is thinner than a hand.
            core = overlay.buffer(shape, -0.04, join_style="mitre")
            shape = overlay.intersection(overlay.buffer(core, 0.045, join_style="mitre", mitre_limit=2.0), shape)
            kept = polygons_of(shape, 0.12)
            finish = family.cornice_finishes[zlib.crc32(plans[p].id.encode()) % len(family.cornice_finishes)]
            of_part[k] = [(ledge, low, high) for ledge in kept]
            made[p] += [_solid(ledge, low - bases[p], high - bases[p], finish) for ledge in kept]
    return made


def _before(polygon: Polygon, chosen: NDArray[np.bool_], out: float) -> BaseGeometry:
    """Return what lies before the chosen edges of an outline."""
    rings = rings_of(polygon)
    start = np.concatenate(rings)
    end = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    lines = shapely.linestrings(np.stack([start[chosen], end[chosen]], axis=1))
    merged = shapely.line_merge(overlay.union_all(lines))
    return overlay.buffer(merged, out, cap_style="flat", join_style="mitre", mitre_limit=1.7)


def posts(plan: BuildingPlan, streets: shapely.STRtree) -> list[PartPlan]:
    """Return what holds up the canopies of a building: posts inside their corners and along their edges.

    Parameters
    ----------
    plan
        The building; a part without storeys that begins above the ground is a canopy.
    streets
        Centre lines that posts keep clear of.

    Returns
    -------
    list of PartPlan
        From the ground up into the canopy.
    """
    made: list[PartPlan] = []
    for part in plan.parts:
        if part.levels > 0 or part.low < 1.5 or part.polygon.area < 4.0:
            continue
        others = [other.polygon for other in plan.parts if other is not part and other.low < part.low - 0.5]
        standing = overlay.union_all(others) if others else None
        inside = polygons_of(overlay.buffer(part.polygon, -0.5, join_style="mitre"), 0.01)
        for shape in inside or [part.polygon]:
            ring = shapely.segmentize(overlay.simplify(shape, 0.4).exterior, _POST_EVERY)
            for x, y in rings_of(Polygon(ring))[0]:
                foot = shapely.box(x - _POST / 2, y - _POST / 2, x + _POST / 2, y + _POST / 2)
                if standing is not None and standing.distance(foot) < 1.0:
                    continue
                if len(streets.query(foot, predicate="dwithin", distance=_ROADWAY)) or not part.polygon.contains(foot):
                    continue
                if any(foot.distance(post.polygon) < 1.5 for post in made):
                    continue
                made.append(_solid(foot, 0.0, part.low + 0.06, "post"))
    return made


def _penthouses(part: PartPlan, free: BaseGeometry, random: np.random.Generator) -> list[PartPlan]:
    """Lift and plant rooms: one for every 700 m2 of flat roof or so, well inside."""
    room = max(polygons_of(overlay.buffer(free, -4.0)), key=lambda shape: shape.area, default=None)
    if part.polygon.area < 180.0 or room is None:
        return []
    made: list[PartPlan] = []
    for size, at in zip(random.uniform(2.2, 6.5, (4, 2)), random.random((4, 2)), strict=True):
        if len(made) >= min(int(part.polygon.area / 700.0) + 1, 4):
            break
        west, south, east, north = room.bounds
        middle = np.array([west + (east - west) * at[0], south + (north - south) * at[1]])
        around = np.asarray(shapely.minimum_rotated_rectangle(part.polygon).exterior.coords)
        side = around[1] - around[0]
        box = _box(middle, size, math.atan2(side[1], side[0]))
        if free.contains(overlay.buffer(box, 1.0)) and not any(box.intersects(m.polygon) for m in made):
            made.append(_solid(box, part.eaves - 0.2, part.eaves + float(random.uniform(1.6, 3.0)), "penthouse"))
    return made


def _solid(polygon: Polygon, low: float, high: float, finish: str) -> PartPlan:
    return PartPlan(polygon, low, high, 0, Roof("flat", 0.0), {}, finish)


_LEAST_HEIGHT = 2.9  # metres under whatever hangs over a pavement
_MOST = 40  # pieces a building
_STOREY = 3.25  # metres: of an oriel


@dataclass(frozen=True)
class _Wall:
    """A wall to hang things on, `s` along it."""

    edges: Edges
    k: int
    storeys: Storeys
    bay: float

    @property
    def length(self) -> float:
        return float(self.edges.length[self.k])

    def box(self, s0: float, s1: float, d0: float, d1: float) -> Polygon:
        """Return a rectangle before the wall; side, front and side come first, the edge at the wall last."""
        start, along, out = self.edges.start[self.k], self.edges.along[self.k], self.edges.out[self.k]
        corners = [(s0, d0), (s0, d1), (s1, d1), (s1, d0)]
        return Polygon([start + along * s + out * d for s, d in corners])

    def bay_window(self, s0: float, s1: float) -> Polygon:
        """Return the canted outline of an oriel; its corners come in the order of a box's."""
        start, along, out = self.edges.start[self.k], self.edges.along[self.k], self.edges.out[self.k]
        corners = [(s0, 0.0), (s0 + _CANT, _ORIEL), (s1 - _CANT, _ORIEL), (s1, 0.0)]
        return Polygon([start + along * s + out * d for s, d in corners])


def projections(
    plan: BuildingPlan,
    look: FacadeStyle,
    fronts: list[NDArray[np.bool_]],
    free: Callable[[Polygon, float, float], bool],
    region: str,
    random: np.random.Generator,
) -> list[PartPlan]:
    """Balconies and fire escapes of a building, by the family of its facade.

    Parameters
    ----------
    plan, look
        The building and what it wears.
    fronts
        Of each part the edges that show a front, shape ``(n,)``.
    free
        Whether nothing stands in an outline between two heights above the building's base.
    region
        As `facades.facade_styles.region_of` says.
    random
        The building's own stream.

    Returns
    -------
    list of PartPlan
        Heights above the building's base.
    """
    customs = styles().region(region)
    maker = _MAKERS.get(styles().families[look.wall].hangs)
    share = float(random.random())
    if maker is None or plan.use in ("garage", "industrial", "religious"):
        return []
    made: list[PartPlan] = []
    for part, shown in zip(plan.parts, fronts, strict=True):
        if part.low > 0.0 or part.levels < 2:
            continue
        edges = edges_of(part.polygon)
        storeys = storeys_of(plan, part, hall=look.hall)
        if storeys.bottom >= storeys.top - 2.0:
            continue
        for k in np.flatnonzero(shown).tolist():
            count = max(round(float(edges.length[k]) / look.bay), 1)
            wall = _Wall(edges, k, storeys, float(edges.length[k]) / count)
            hung = list(made)  # pieces of one wall belong together; those of others are in the way
            for pieces in maker(wall, share, customs, random):
                box, low, high = pieces[0][0], pieces[0][1], max(piece[2] for piece in pieces)
                crossed = any(
                    low < other.eaves + 0.3 and high + 0.3 > other.low and other.polygon.distance(box) < 0.2
                    for other in hung
                )
                if len(made) < _MOST and low > _LEAST_HEIGHT and not crossed and free(box, low, high):
                    made += [_part_plan(*piece) for piece in pieces]
    return made


_Pieces = list[tuple[Polygon, float, float, str]]
"""What stands or falls together: outlines, heights and finishes; the first is the lowest and the widest."""


def _part_plan(box: Polygon, low: float, high: float, finish: str) -> PartPlan:
    if finish == "oriel":
        return PartPlan(box, low, high, max(round((high - low) / _STOREY), 1), Roof("flat", 0.0), {}, finish)
    if finish != "steps":
        return PartPlan(box, low, high, 0, Roof("flat", 0.0), {}, finish)
    # A flight of steps is a sheet seen from both sides: closed, but without the edges of a board.
    a, b = (np.asarray(box.exterior.coords)[k, :2] for k in (1, 2))
    points = np.array([(*a, low), (*b, low), (*b, high), (*a, high)])
    faces = np.array([(0, 1, 2), (0, 2, 3), (1, 0, 3), (1, 3, 2)], np.int64)
    return PartPlan(box, low, high, 0, Roof("flat", 0.0), {}, finish, (points, faces))


def _balcony(wall: _Wall, s0: float, s1: float, floor: float, deep: float, rail: str) -> _Pieces:
    """One box: its sides show the slab's edge and the railing on it, its underside is the slab's, its top is open."""
    # No canopy over a door is so deep: their fronts never lie in one plane.
    return [(wall.box(s0, s1, 0.0, deep + 0.017), floor - 0.2, floor + 1.05, rail)]


def _running(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Homes of the last decades: balconies in every other bay, or right along where the sun shines."""
    rail = "rail_glass" if share < 0.55 else "rail_iron"
    made: list[_Pieces] = []
    if wall.length < 4.0:
        return made
    bays = round(wall.length / wall.bay)
    right_along = region.balconies_right_along or share < 0.3
    for k in range(int(wall.storeys.count)):
        floor = wall.storeys.floor(k)
        if right_along:
            made.append(_balcony(wall, 0.5, wall.length - 0.5, floor, 1.3, rail))
            continue
        for i in range(1, bays, 2):
            made.append(_balcony(wall, i * wall.bay + 0.06, (i + 1) * wall.bay - 0.06, floor, 1.2, rail))
    return made


def _iron(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Return the balconies of a Paris house: one running balcony on the second and one on the last floor."""
    count = int(wall.storeys.count)
    if wall.length < 4.0 or count < 3:
        return []
    return [
        _balcony(wall, 0.3, wall.length - 0.3, wall.storeys.floor(k), 0.7, "rail_iron") for k in sorted({1, count - 1})
    ]


def _southern(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Return a small iron balcony before a window here and there."""
    made: list[_Pieces] = []
    if not region.small_balconies or wall.length < 4.0:
        return made
    for k in range(int(wall.storeys.count)):
        for i in range(round(wall.length / wall.bay)):
            if random.random() < 0.4 and (i + k) % 2 == 0:
                middle = (i + 0.5) * wall.bay
                made.append(
                    _balcony(wall, middle - 0.85, middle + 0.85, wall.storeys.floor(k) + 0.06, 0.75, "rail_iron")
                )
    return made


def _alpine(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Return a wooden balcony along the whole front, on every upper floor or the highest."""
    count = int(wall.storeys.count)
    if not 5.0 < wall.length < 26.0:
        return []
    made: list[_Pieces] = []
    for k in range(count) if share < 0.4 else range(count - 1, count):
        floor = wall.storeys.floor(k)
        made.append(_balcony(wall, 0.35, wall.length - 0.35, floor, 1.1, "rail_wood"))
    return made


_ORIEL = 0.85  # metres that an oriel juts out
_CANT = 0.3  # metres by which its front is narrower


def _oriels(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Return oriels: closed bays before one axis in four, from the first floor up to below the last, or none."""
    count, bays = int(wall.storeys.count), round(wall.length / wall.bay)
    if share > 0.62 or count < 2 or bays < 2 or wall.length < 4.6:
        return []
    half = min(max(0.46 * wall.bay, 0.95), 1.5)
    made: list[_Pieces] = []
    for i in range(bays // 2 if bays < 6 else 1, bays, 4):
        middle = (i + 0.5) * wall.bay
        low, high = wall.storeys.floor(0) - 0.12, wall.storeys.floor(count - 1 if count > 2 else count) - 0.12
        if middle - half > 0.5 and middle + half < wall.length - 0.5:
            made.append([(wall.bay_window(middle - half, middle + half), low, high, "oriel")])
    return made


def _oriels_and_balconies(
    wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator
) -> list[_Pieces]:
    """Return oriels, or an iron balcony before the middle axis of every floor where a house has none."""
    made = _oriels(wall, share * 1.2, region, random)
    count, bays = int(wall.storeys.count), round(wall.length / wall.bay)
    if made or bays < 3 or wall.length < 6.0:
        return made
    half = min(0.8 * wall.bay, 1.6)
    for k in range(count):
        for i in range(bays // 2 if bays < 7 else 1, bays, 4):
            middle = (i + 0.5) * wall.bay
            if middle - half > 0.3 and middle + half < wall.length - 0.3:
                made.append(_balcony(wall, middle - half, middle + half, wall.storeys.floor(k), 1.0, "rail_iron"))
    return made


def _escape(wall: _Wall, share: float, region: RegionalStyle, random: np.random.Generator) -> list[_Pieces]:
    """Return iron fire escapes as in New York: a landing at every floor before two windows, steps between."""
    count = int(wall.storeys.count)
    if not region.fire_escapes or not 3 <= count <= 7 or wall.length < 5.0 or share > 0.85:
        return []
    made: list[_Pieces] = []
    towers = 1 if wall.length < 18.0 else 2 if wall.length < 36.0 else 3
    bays = max(round(wall.length / wall.bay), 1)
    for t in range(towers):
        middle = (min(int(bays * (t + 0.5) / towers), bays - 1) + 0.5) * wall.bay
        half = min(1.75, middle - 0.3, wall.length - middle - 0.3)
        if half < 1.2:
            continue
        for k in range(count):
            floor = wall.storeys.floor(k) + 0.35
            pieces = [(wall.box(middle - half, middle + half, 0.03, 1.05), floor - 0.1, floor + 0.95, "rail_landing")]
            if k < count - 1:
                above = wall.storeys.floor(k + 1) + 0.25
                pieces.append((wall.box(middle - half + 0.2, middle + half - 0.2, 0.7, 0.72), floor, above, "steps"))
            made.append(pieces)
    return made


_MAKERS: dict[str, Callable[[_Wall, float, RegionalStyle, np.random.Generator], list[_Pieces]]] = {
    "balconies": _running,
    "french_balconies": _iron,
    "small_balconies": _southern,
    "wooden_balconies": _alpine,
    "fire_escapes": _escape,
    "oriels": _oriels,
    "oriels_and_balconies": _oriels_and_balconies,
}


def water_tank(plan: BuildingPlan, region: str, random: np.random.Generator) -> list[PartPlan]:
    """Return a wooden water tank on four legs, on flat roofs of American houses of five storeys and more."""
    draw = random.random(4)
    if not styles().region(region).water_tanks or plan.use in ("garage", "religious", "industrial"):
        return []
    part = max(plan.parts, key=lambda part: part.top)
    if part.roof.shape != "flat" or not 6 <= plan.levels <= 22 or part.polygon.area < 200.0 or draw[0] > 0.6:
        return []
    inner = overlay.buffer(part.polygon, -3.2)
    if inner.is_empty:
        return []
    west, south, east, north = inner.bounds
    x, y = west + (east - west) * draw[1], south + (north - south) * draw[2]
    if not inner.contains(shapely.Point(x, y)):
        x, y = inner.representative_point().coords[0]
    radius = 1.35 + 0.5 * float(draw[3])
    angles = np.arange(9) / 9 * 2 * np.pi
    barrel = Polygon(np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1))
    foot, side = part.eaves + 1.9, 0.72 * radius
    frame = shapely.box(x - side, y - side, x + side, y + side)
    return [
        PartPlan(frame, part.eaves - 0.15, foot + 0.05, 0, Roof("flat", 0.0), {}, "trestle"),
        PartPlan(barrel, foot, foot + 3.2, 0, Roof("pyramidal", 1.1), {}, "tank"),
    ]
