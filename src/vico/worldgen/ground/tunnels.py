"""Tunnels that can be driven and walked through: which, how deep, where they are open cuts, and how they look.

From its mouths, at the ground, the floor of a tunnel leads straight on where a hill rises over it; where none does, it
dives on a slope that can be driven. Where too little ground lies above it for a roof it is an open cut between walls;
from there on it is covered. A tunnel is used if all its cuts begin at mouths, are short, and keep clear of houses and
of other streets.

People see cuts between walls, portals, and lit tubes behind them. What lies side by side or meets is drawn as one:
walls follow the union of the tunnels' plans, and of floors that overlap the first one's is drawn.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData, OsmWay
from vico.geo.overlay import polygons_of
from vico.geometry import arc_lengths, distance, distances
from vico.world.heights import HeightField
from vico.world.mesh import Surface, merge_surfaces
from vico.worldgen.facts.site import ON_FOOT, SiteFacts, on_the_ground
from vico.worldgen.facts.streets import StreetPolygons, carriageway_width
from vico.worldgen.ground.bridges import PARAPET, QuadMeshBuilder, deck_sidewalk_width, deck_width, left_normals
from vico.worldgen.ground.grading import Network
from vico.worldgen.ground.kerbs_and_banks import KERB
from vico.worldgen.ground.mesh import triangulate

Floats = NDArray[np.float64]
#: West, south, east and north, metres.
Box = tuple[float, float, float, float]

HEADROOM, HEADROOM_ON_FOOT = 4.5, 2.6
"""Clear height of tunnels for vehicles and of those for walkers, metres."""

WALL = 0.35
"""Thickness of the walls of cuts, metres."""

_ROOF = 0.4  # metres of ground above the clear height where a tunnel is covered
_STEEPEST = 0.11  # slope of what can be driven up
_STEEPEST_ON_FOOT = 0.12  # slope of what can be walked up
_LONGEST_CUT = 62.0  # metres
_SHORT_CUT = 30.0  # metres of cut up to which a straight tunnel is preferred to a dive
_LEAST = 12.0  # metres, length of a tunnel
_SPACING = 3.0  # metres between the points of floors
_SAME_FLOOR = 0.4  # metres by which floors that meet may differ where they overlap
_LEDGE = 0.6  # metres, too narrow to be walked on
_JOINT = 5.0  # metres at a mouth where a cut meets the street that leads in
_MOST_PAVED = 6.0  # m2 that a cut may take of other streets: corners that overlap
_TAPER = 8.0  # metres in which the floor comes down by a kerb where the street at the mouth has none
_DRIVEN = {"motorway", "trunk", "primary", "secondary", "tertiary", "unclassified", "residential", "living_street"}
_PRIVATE = {"no", "private", "permit", "delivery", "agricultural", "forestry", "military", "customers"}


class Ground(Protocol):
    """Ground above tunnels: with streets graded into it, of one place or of all tiles of a city."""

    def smooth(self, xy: Floats, /) -> Floats:
        """Return heights without kerbs at points, metres, shape ``(n, 2)`` or ``(2,)``."""

    def __call__(self, xy: Floats, /) -> Floats:
        """Return heights with kerbs at points, metres."""


@dataclass(frozen=True)
class Bore:
    """A piece of a tunnel.

    Attributes
    ----------
    way
        Of the map.
    line, z
        Points along its middle every few metres, shape ``(n, 2)``, and heights of its floor there, metres.
    width, walk, headroom
        Between its walls, and of each of its pavements, or ledges, and clear height, metres; no pavements where
        nothing drives.
    covered
        Which points lie under a roof; at the others it is an open cut.
    """

    way: OsmWay
    line: Floats
    z: Floats
    width: float
    walk: float
    headroom: float
    covered: NDArray[np.bool_]

    @property
    def on_foot(self) -> bool:
        """Whether nothing drives in it."""
        return self.way.tags["highway"] in ON_FOOT

    def cut(self) -> BaseGeometry:
        """Return where it is open to the sky, between the outsides of its walls, metres."""
        return _strip(self.line, ~self.covered, self.width / 2 + WALL)

    def plan(self) -> BaseGeometry:
        """Return where it lies, between its walls, metres."""
        return _strip(self.line, np.ones(len(self.line), bool), self.width / 2)

    def roofed_area(self) -> BaseGeometry:
        """Return where it lies under a roof, metres."""
        return _strip(self.line, self.covered, self.width / 2, both=True)

    def carriageway(self) -> BaseGeometry:
        """Return where its carriageway lies, metres; nowhere if nothing drives in it."""
        inner = 0.0 if self.on_foot else self.width / 2 - self.walk
        return _strip(self.line, np.full(len(self.line), inner > 0.0), inner)

    def end_lines(self) -> Floats:
        """Return the lines across its two ends, wall to wall, metres, shape ``(2, 2, 2)``."""
        side = left_normals(self.line)[[0, -1]] * (self.width / 2 + WALL)
        return np.stack([self.line[[0, -1]] - side, self.line[[0, -1]] + side], axis=1)


def bores_of(site: SiteFacts, ground: Ground, window: Box, paved: BaseGeometry) -> list[Bore]:
    """Return the tunnels that can be used.

    Parameters
    ----------
    site
        The map.
    ground
        Graded to the streets; known within the window.
    window
        Beyond it the ground is not known.
    paved
        Where people and vehicles move on the ground: see `paved_of`.
    """
    ways = tunnel_ways(site.osm, window)
    if not ways:
        return []
    built = shapely.STRtree(
        [area.polygon for area in site.osm.areas if area.tags.get("building", "no") not in ("no", "roof")]
    )
    shapely.prepare(paved)
    open_nodes = {
        node
        for way in site.osm.ways
        if "highway" in way.tags and on_the_ground(way.tags) and way.id not in site.levels.above
        for node in way.nodes
    }
    # Of the floors that were laid together some may be refused; the others stay as they lie.
    bores, mouths = _bores(ways, ground, window, open_nodes)
    bores = [bore for bore in bores if _is_usable(bore, mouths, built, paved, window)]
    while refused := _crossing(bores) | _blind(bores, mouths, window):
        bores = [bore for bore in bores if bore.way.id not in refused]
    return bores


def tunnel_ways(osm: OsmData, window: Box) -> list[OsmWay]:
    """Return the ways that are tunnels to use, if nothing is in their way."""
    return [way for way in osm.ways if _is_bore(way, window)]


def paved_of(streets: StreetPolygons) -> BaseGeometry:
    """Return where people and vehicles move on the ground."""
    parts = [streets.carriageway, streets.sidewalk, streets.pedestrian, streets.cycleway, streets.parking]
    return overlay.union_all(parts, grid=None)


def _within(points: Floats, box: Box) -> NDArray[np.bool_]:
    """Tell which points, shape ``(n, 2)``, lie in a box."""
    low, high = np.array(box[:2]), np.array(box[2:])
    return np.asarray(((points > low) & (points < high)).all(axis=-1))


def cuts_of(bores: Sequence[Bore]) -> list[Polygon]:
    """Return where tunnels are open to the sky, metres: nobody walks over there."""
    whole = overlay.union_all([bore.cut() for bore in bores])
    return [part for part in shapely.get_parts(whole) if part.geom_type == "Polygon" and part.area > 0.05]


def _strip(line: Floats, chosen: NDArray[np.bool_], half: float, *, both: bool = False) -> BaseGeometry:
    """Return the strip along the pieces of a line that have a chosen end, or with `both` two."""
    side = left_normals(line) * half
    pieces = [
        Polygon(np.concatenate([(line + side)[k : k + 2], (line - side)[k : k + 2][::-1]]))
        for k in range(len(line) - 1)
        if int(chosen[k]) + int(chosen[k + 1]) > both
    ]
    return overlay.union_all([overlay.make_valid(piece) for piece in pieces])


def _is_bore(way: OsmWay, window: Box) -> bool:
    """Whether a way is a public tunnel outdoors, long enough for two mouths, within the window."""
    tags = way.tags
    kind = tags.get("highway", "").removesuffix("_link")
    if tags.get("tunnel", "no") in ("no", "building_passage", "culvert") or tags.get("indoor", "no") != "no":
        return False
    if kind not in _DRIVEN and (kind not in ON_FOOT or kind in ("steps", "corridor", "elevator")):
        return False
    allowing = ("foot", "access") if kind in ON_FOOT else ("motorcar", "motor_vehicle", "vehicle", "access")
    if next((tags[key] for key in allowing if key in tags), "yes") in _PRIVATE or way.closed:
        return False
    wide, high = window[2] - window[0], window[3] - window[1]
    middle = np.array([window[0] + window[2], window[1] + window[3]]) / 2
    inside = np.abs(way.line - middle).max() < 2 * max(wide, high) and bool(_within(way.line, window).any())
    return inside and bool(shapely.LineString(way.line).length >= _LEAST)


def _bores(
    ways: Sequence[OsmWay], terrain: Ground, window: Box, open_nodes: Collection[int]
) -> tuple[list[Bore], Floats]:
    """Lay the floors of tunnels; returns them, and their mouths, metres, shape ``(m, 2)``."""
    network = Network.of([way.line for way in ways], spacing=_SPACING)
    is_mouth = np.zeros(len(network.points), bool)
    for way, row in zip(ways, network.rows, strict=True):
        for node, k in ((way.nodes[0], int(row[0])), (way.nodes[-1], int(row[-1]))):
            is_mouth[k] |= node in open_nodes
    ground = terrain.smooth(network.points)
    # Beyond the window the ground is not known: tunnels go on level.
    is_known = _within(network.points, window)
    roof = np.zeros(len(ground))
    for way, row in zip(ways, network.rows, strict=True):
        headroom = HEADROOM_ON_FOOT if way.tags["highway"] in ON_FOOT else HEADROOM
        roof[row] = np.maximum(roof[row], headroom + _ROOF)
    z = _floor(network, [_steepest(way) for way in ways], ground, is_mouth, is_known, roof)
    # A floor that dives lies a roof below the ground to within rounding.
    is_covered = (ground - z >= roof - _ROOF / 2) | ~is_known
    mouths = network.points[is_mouth & is_known]
    bores = []
    for way, row in zip(ways, network.rows, strict=True):
        if len(row) > 1:
            line = network.points[row]
            if way.tags["highway"] in ON_FOOT:
                bores.append(Bore(way, line, z[row], max(deck_width(way), 2.2), 0.0, HEADROOM_ON_FOOT, is_covered[row]))
                continue
            walk = deck_sidewalk_width(way.tags) if way.tags.get("foot") != "no" else _LEDGE
            width = carriageway_width(way.tags) + 2 * walk
            lowered = _lower_floor_by_kerb(line, z[row], is_mouth[row[[0, -1]]], terrain)
            bores.append(Bore(way, line, lowered, width, walk, HEADROOM, is_covered[row]))
    return bores, mouths


def _steepest(way: OsmWay) -> float:
    return _STEEPEST_ON_FOOT if way.tags["highway"] in ON_FOOT else _STEEPEST


def _floor(
    network: Network,
    slopes: Sequence[float],
    ground: Floats,
    is_mouth: NDArray[np.bool_],
    is_known: NDArray[np.bool_],
    roof: Floats,
) -> Floats:
    """Return how high the floors lie, metres: straight from mouth to mouth where hills cover them soon, else dived."""
    weight = np.where(is_mouth & is_known, 30.0, 0.0)
    if not weight.any():
        return np.asarray(ground - roof)
    straight = network.fit_heights(ground, weight, length=25.0, spacing=_SPACING)
    straight[is_mouth & is_known] = ground[is_mouth & is_known]
    # How low the floor can be at each point, coming down from the mouths, and how low it has to be for what is ahead.
    everywhere, unbounded = np.arange(len(ground)), np.full(len(ground), -np.inf)
    mouths = np.flatnonzero(is_mouth & is_known)
    lowest = network.ramps(mouths, ground[mouths], slopes, unbounded)
    wanted = np.where(is_known, np.minimum(straight, ground - roof), straight)
    dived = np.maximum(lowest, -network.ramps(everywhere, -wanted, slopes, unbounded))
    found = straight.copy()
    for rows in _systems(network):
        if _open_length(network, rows, ground - straight < roof, is_known) > _SHORT_CUT:
            every = np.unique(np.concatenate([network.rows[k] for k in rows]))
            found[every] = dived[every]
    return found


def _systems(network: Network) -> list[list[int]]:
    """Return the lines (numbers of rows) that hang together."""
    owner: dict[int, int] = {}
    group = list(range(len(network.rows)))

    def root(k: int) -> int:
        while group[k] != k:
            group[k] = group[group[k]]
            k = group[k]
        return k

    for k, row in enumerate(network.rows):
        for point in (int(row[0]), int(row[-1])):
            other = root(owner.setdefault(point, k))
            group[max(root(k), other)] = min(root(k), other)
    found: dict[int, list[int]] = defaultdict(list)
    for k in range(len(network.rows)):
        found[root(k)].append(k)
    return list(found.values())


def _open_length(network: Network, rows: Sequence[int], is_open: NDArray[np.bool_], known: NDArray[np.bool_]) -> float:
    """Return the length of the longest stretch without a roof, metres."""
    longest = 0.0
    for k in rows:
        row, run = network.rows[k], 0.0
        for a, b in pairwise(row.tolist()):
            both = is_open[a] and is_open[b] and known[a] and known[b]
            run = run + distance(network.points[b], network.points[a]) if both else 0.0
            longest = max(longest, run)
    return longest


def _lower_floor_by_kerb(line: Floats, z: Floats, is_mouth: NDArray[np.bool_], terrain: Ground) -> Floats:
    """Lower a floor by a kerb, as the street's is that leads in; where that has none, little by little."""
    along = arc_lengths(line)
    drop = np.full(len(line), KERB)
    for mouth, away, k in ((is_mouth[0], along, 0), (is_mouth[1], along[-1] - along, -1)):
        if mouth and float(terrain.smooth(line[k]) - terrain(line[k])) < KERB / 2:
            drop = np.minimum(drop, KERB * away / _TAPER)
    return z - drop


def _is_usable(bore: Bore, mouths: Floats, built: shapely.STRtree, paved: BaseGeometry, window: Box) -> bool:
    """Whether nothing of a tunnel is too steep, and its cuts begin at mouths, are short and in the open."""
    run = np.maximum(np.hypot(*np.diff(bore.line, axis=0).T), 0.3)
    if float((np.abs(np.diff(bore.z)) / run).max()) > 1.35 * _steepest(bore.way):
        return False
    along = np.concatenate([[0.0], np.cumsum(run)])
    inside = _within(bore.line, window)
    is_open = ~bore.covered & inside
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_open, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2).tolist():
        ends = bore.line[first], bore.line[last - 1]
        begins = [len(mouths) > 0 and float(distances(mouths, end).min()) < 0.1 for end in ends]
        at_end = first == 0, last == len(bore.line)
        if not any(begin and end for begin, end in zip(begins, at_end, strict=True)):
            return False
        if all(begins) or along[last - 1] - along[first] > _LONGEST_CUT:
            return False
    cut = bore.cut()
    joint = bore.width / 2 + _JOINT
    near = mouths[shapely.dwithin(shapely.points(mouths), cut, joint)] if len(mouths) else mouths
    near_mouths = overlay.union_all([overlay.buffer(shapely.Point(p), joint) for p in near])
    if len(built.query(cut, predicate="intersects")):
        return False
    return overlay.common_area(overlay.difference(cut, near_mouths), paved) <= _MOST_PAVED


def _crossing(bores: Sequence[Bore]) -> set[int]:
    """Return ways that cross another tunnel without meeting it, or lie partly above one: of each two the shorter."""
    found: set[int] = set()
    lines = [shapely.LineString(bore.line) for bore in bores]
    tree = shapely.STRtree([bore.plan() for bore in bores])
    for k, own in enumerate(bores):
        for other in np.sort(tree.query(tree.geometries[k], predicate="intersects")).tolist():
            if other <= k or {own.way.id, bores[other].way.id} & found:
                continue
            meet = bool(set(own.way.nodes).intersection(bores[other].way.nodes))
            if (not meet and lines[k].intersects(lines[other])) or _one_above(own, bores[other], lines[other]):
                found.add((own if lines[k].length < lines[other].length else bores[other]).way.id)
    return found


def _one_above(first: Bore, second: Bore, line: shapely.LineString) -> bool:
    """Whether two tunnels overlap at heights that differ; `line`: the second's."""
    places = shapely.points(first.line)
    near = np.flatnonzero(shapely.distance(line, places) < (first.width + second.width) / 2)
    along = arc_lengths(second.line)
    z = np.interp(shapely.line_locate_point(line, places[near]), along, second.z)
    return bool((np.abs(first.z[near] - z) > _SAME_FLOOR).any())


def _blind(bores: Sequence[Bore], mouths: Floats, window: Box) -> set[int]:
    """Return ways of which one end is neither a mouth, nor in another tunnel, nor outside the window."""
    at: dict[int, int] = defaultdict(int)
    for bore in bores:
        for node in {bore.way.nodes[0], bore.way.nodes[-1]}:
            at[node] += 1
    inner = {node for bore in bores for node in bore.way.nodes[1:-1]}
    found: set[int] = set()
    for bore in bores:
        for node, point in ((bore.way.nodes[0], bore.line[0]), (bore.way.nodes[-1], bore.line[-1])):
            is_mouth = len(mouths) > 0 and float(distances(mouths, point).min()) < 0.1
            if at[node] < 2 and node not in inner and not is_mouth and _within(point, window):
                found.add(bore.way.id)
    return found


Rgb = tuple[int, int, int]

_PIECE = 3.0  # metres
_LAMPS_EVERY = 9.0  # metres
_CONCRETE: Rgb = (188, 186, 180)
_TILES: Rgb = (214, 212, 204)
_CEILING: Rgb = (120, 119, 116)
_LAMP: Rgb = (255, 246, 222)
_FOOT = 0.3  # metres that walls go on below the ground
_AT = 0.05  # metres within which a point is on an edge


@dataclass(frozen=True)
class _Floors:
    """Heights along tunnels, looked up by the nearest piece."""

    tree: shapely.STRtree
    ends: Floats
    z: Floats
    headroom: Floats

    @classmethod
    def of(cls, bores: Sequence[Bore]) -> _Floors:
        ends = np.concatenate([np.stack([bore.line[:-1], bore.line[1:]], axis=1) for bore in bores])
        z = np.concatenate([np.stack([bore.z[:-1], bore.z[1:]], axis=1) for bore in bores])
        headroom = np.concatenate([np.full(len(bore.line) - 1, bore.headroom) for bore in bores])
        return cls(shapely.STRtree(shapely.linestrings(ends)), ends, z, headroom)

    def at(self, xy: Floats) -> tuple[Floats, Floats]:
        """Return heights of the floor and clear heights at points, metres, shape ``(n,)`` each."""
        piece = self.tree.nearest(shapely.points(xy))
        start, run = self.ends[piece, 0], self.ends[piece, 1] - self.ends[piece, 0]
        share = ((xy - start) * run).sum(axis=1) / np.maximum((run**2).sum(axis=1), 1e-9)
        share = np.clip(share, 0.0, 1.0)
        return self.z[piece, 0] + share * (self.z[piece, 1] - self.z[piece, 0]), self.headroom[piece]


@dataclass(frozen=True)
class _Piece:
    """A piece of a tunnel between two points of its line; `headroom` 0: without a roof."""

    plan: BaseGeometry
    start: Floats
    run: Floats
    z: Floats
    headroom: float

    def heights(self, xy: Floats) -> Floats:
        """Return how high its floor is at points, metres, shape ``(n,)``."""
        share = ((xy - self.start) * self.run).sum(axis=1) / max(float((self.run**2).sum()), 1e-9)
        return np.asarray(self.z[0] + np.clip(share, 0.0, 1.0) * (self.z[1] - self.z[0]))


def bore_surfaces(bores: Sequence[Bore], terrain: HeightField, window: Polygon) -> list[Surface]:
    """Draw tunnels; what of them lies outside the window, a square around the middle, is left out."""
    if not bores:
        return []
    stone, floors = QuadMeshBuilder(), _Floors.of(bores)
    reach = min(terrain.half - 0.5, float(window.bounds[2]))
    window = shapely.box(-reach, -reach, reach, reach)
    plan = overlay.intersection(overlay.union_all([bore.plan() for bore in bores]), window)
    roofed = overlay.intersection(overlay.union_all([bore.roofed_area() for bore in bores]), plan)
    driven = overlay.intersection(overlay.union_all([bore.carriageway() for bore in bores]), plan)
    raised = overlay.difference(plan, driven)
    for piece in _pieces(bores):
        _lay(stone, overlay.intersection(piece.plan, driven), piece, 0.0, "carriageway")
        _lay(stone, overlay.intersection(piece.plan, raised), piece, KERB, "sidewalk")
        if piece.headroom:
            flat, faces = triangulate(polygons_of(overlay.intersection(piece.plan, roofed), 0.005))
            for a, b, c in np.c_[flat, piece.heights(flat) + piece.headroom][faces]:
                stone.add([a, c, b, b], "kerb", _CEILING)
    # Kerbs stand between carriageways and what is raised beside them.
    unbroken = overlay.buffer(plan, -_AT)
    for a, b in _edges(driven):
        if unbroken.contains(shapely.Point((a + b) / 2)):
            (low_a, low_b), _ = floors.at(np.stack([a, b]))
            stone.add([np.r_[a, low_a], np.r_[b, low_b], np.r_[b, low_b + KERB], np.r_[a, low_a + KERB]][::-1], "kerb")
    # Mouths stay open, and so do tubes where they leave the window.
    mouths = overlay.union_all([shapely.LineString(end) for bore in bores for end in bore.end_lines()])
    ways_in = overlay.buffer(mouths, _AT, cap_style="flat")
    for a, b in _edges(plan):
        middle = shapely.Point((a + b) / 2)
        if ways_in.intersects(middle) or np.abs((a + b) / 2).max() > reach - _AT:
            continue
        if roofed.distance(middle) < _AT:
            low, headroom = floors.at(np.stack([a, b]))
            _upright(stone, a, b, low, low + headroom, _TILES)
        else:
            _cut_wall(stone, a, b, floors, terrain)
    inner = overlay.buffer(plan, -4 * _AT)
    for a, b in _edges(roofed):
        if inner.contains(shapely.Point((a + b) / 2)):
            _portal(stone, a, b, floors, terrain)
    for bore in bores:
        _lamps(stone, bore, reach)
    return merge_surfaces(stone.surfaces())


def _edges(area: BaseGeometry) -> Iterator[tuple[Floats, Floats]]:
    """Yield the pieces of an area's border, the area on their left."""
    for shape in polygons_of(area, 0.02):
        whole = shapely.segmentize(shapely.geometry.polygon.orient(shape), _PIECE)
        for ring in (whole.exterior, *whole.interiors):
            yield from pairwise(np.asarray(ring.coords, np.float64)[:, :2])


def _pieces(bores: Sequence[Bore]) -> Iterator[_Piece]:
    """Yield the pieces of tunnels, each without what another tunnel's have taken before."""
    taken: list[BaseGeometry] = []
    for bore in bores:
        side = left_normals(bore.line) * bore.width / 2
        before = [shape for shape in taken if shape.intersects(bore.plan())]
        for k in range(len(bore.line) - 1):
            corners = np.concatenate([(bore.line + side)[k : k + 2], (bore.line - side)[k : k + 2][::-1]])
            plan: BaseGeometry = overlay.make_valid(Polygon(corners))
            for other in before:
                plan = overlay.difference(plan, other)
            headroom = bore.headroom if bore.covered[k] and bore.covered[k + 1] else 0.0
            yield _Piece(plan, bore.line[k], bore.line[k + 1] - bore.line[k], bore.z[k : k + 2], headroom)
        taken.append(bore.plan())


def _lay(stone: QuadMeshBuilder, area: BaseGeometry, piece: _Piece, lift: float, look: str) -> None:
    """Lay a part of a piece's floor."""
    flat, faces = triangulate(polygons_of(area, 0.005))
    for a, b, c in np.c_[flat, piece.heights(flat) + lift][faces]:
        stone.add([a, b, c, c], look)


def _upright(
    stone: QuadMeshBuilder, a: Floats, b: Floats, low: Floats, high: Floats, tint: Rgb, look: str = "kerb"
) -> None:
    """Build an upright face from `a` to `b` that is seen from the left of that way."""
    stone.add([np.r_[b, low[1]], np.r_[a, low[0]], np.r_[a, high[0]], np.r_[b, high[1]]], look, tint)


def _cut_wall(stone: QuadMeshBuilder, a: Floats, b: Floats, floors: _Floors, terrain: HeightField) -> None:
    """Build a wall that holds the ground beside a cut, with a parapet on it."""
    ends = np.stack([a, b])
    run = b - a
    out = np.array([run[1], -run[0]]) / max(float(np.hypot(*run)), 1e-9) * WALL
    low, _ = floors.at(ends)
    ground = np.maximum(terrain.upper(ends), terrain.upper(ends + out))
    high = np.maximum(ground, low + KERB) + PARAPET
    foot = np.minimum(ground, low) - _FOOT
    _upright(stone, a, b, low, high, _CONCRETE)
    _upright(stone, b + out, a + out, foot[::-1], high[::-1], _CONCRETE)
    stone.add([np.r_[a, high[0]], np.r_[a + out, high[0]], np.r_[b + out, high[1]], np.r_[b, high[1]]], "kerb")


def _portal(stone: QuadMeshBuilder, a: Floats, b: Floats, floors: _Floors, terrain: HeightField) -> None:
    """Build the wall above the mouth of a tube, from the ceiling to a parapet above the ground."""
    ends = np.stack([a, b])
    low, headroom = floors.at(ends)
    low = low + headroom
    high = np.maximum(terrain.upper(ends), low) + PARAPET
    # The tube is on the left of the way from a to b.
    run = b - a
    back = np.array([-run[1], run[0]]) / max(float(np.hypot(*run)), 1e-9) * WALL
    _upright(stone, b, a, low[::-1], high[::-1], (255, 255, 255), "wall")
    _upright(stone, a + back, b + back, low, high, (255, 255, 255), "wall")
    stone.add([np.r_[a, high[0]], np.r_[b, high[1]], np.r_[b + back, high[1]], np.r_[a + back, high[0]]], "wall")


def _lamps(stone: QuadMeshBuilder, bore: Bore, reach: float) -> None:
    """Hang lamps below the ceiling."""
    line = shapely.LineString(bore.line)
    along = arc_lengths(bore.line)
    for place in np.arange(_LAMPS_EVERY / 2, line.length, _LAMPS_EVERY).tolist():
        k = min(int(np.searchsorted(along, place)), len(along) - 1)
        middle = np.array(line.interpolate(place).coords[0])
        if not (bore.covered[k] and bore.covered[k - 1]) or np.abs(middle).max() > reach:
            continue
        u = bore.line[k] - bore.line[k - 1]
        u = u / max(float(np.hypot(*u)), 1e-9)
        across, ahead = np.array([-u[1], u[0]]) * 0.15, u * 0.8
        top = float(np.interp(place, along, bore.z)) + bore.headroom - 0.04
        corners = [middle - ahead + across, middle + ahead + across, middle + ahead - across, middle - ahead - across]
        stone.add([np.r_[corner, top] for corner in corners], "kerb", _LAMP)
