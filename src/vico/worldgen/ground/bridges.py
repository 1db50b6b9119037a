"""Bridges: decks above streets, how wide, how high and on what piers; and how they look, with parapets and railings.

Bridges that are the ground have railings only.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData, OsmWay
from vico.geo.overlay import polygons_of
from vico.geo.quantities import quantity
from vico.geometry import arc_lengths
from vico.world.heights import HeightField
from vico.world.mesh import Surface, merge_surfaces, surface_of_quads
from vico.worldgen.facts.fault_isolation import NamedShape, drop_on_failure, union_named
from vico.worldgen.facts.site import ON_FOOT, RAILS, SLAB, SLAB_ON_FOOT, SiteFacts, is_bridge, on_the_ground
from vico.worldgen.facts.streets import StreetPolygons, carriageway_width
from vico.worldgen.ground.grading import Network, deck_clearance_constraints, ramp_slope
from vico.worldgen.ground.kerbs_and_banks import KERB
from vico.worldgen.ground.mesh import triangulate
from vico.worldgen.ground.pavings import LOOKS, GroundStyle, ground_material, vertex_colours
from vico.worldgen.ground.stairs import RISE

Floats = NDArray[np.float64]

PARAPET = 1.0
"""Height of a parapet, metres."""


@dataclass
class QuadMeshBuilder:
    """Quads that pile up by look; each knows its own flat normal."""

    quads: dict[str, list[Floats]] = field(default_factory=dict)
    tints: dict[str, tuple[GroundStyle, tuple[int, int, int] | None]] = field(default_factory=dict)

    def add(self, quad: Sequence[Floats], look: str, tint: tuple[int, int, int] | None = None) -> None:
        """Add a quadrilateral, counter-clockwise seen from its face."""
        key = look if tint is None else f"{look}/{tint}"
        self.quads.setdefault(key, []).append(np.asarray(quad, np.float64))
        self.tints[key] = (LOOKS[look], tint)

    def take(self, other: QuadMeshBuilder) -> None:
        """Add the quadrilaterals of another."""
        for key, quads in other.quads.items():
            self.quads.setdefault(key, []).extend(quads)
            self.tints[key] = other.tints[key]

    def box(
        self, foot: Sequence[Floats], low: float, high: float, look: str, tint: tuple[int, int, int] | None = None
    ) -> None:
        """Add an upright prism over a quadrilateral given counter-clockwise."""
        lower = [np.r_[p[:2], low] for p in foot]
        upper = [np.r_[p[:2], high] for p in foot]
        self.add(upper, look, tint)
        for k in range(4):
            m = (k + 1) % 4
            self.add([lower[k], lower[m], upper[m], upper[k]], look, tint)

    def surfaces(self) -> list[Surface]:
        """One surface a look."""
        found = []
        for key, quads in self.quads.items():
            look, tint = self.tints[key]
            corners = np.stack(quads)
            normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
            x, y, z = corners[..., 0], corners[..., 1], corners[..., 2]
            level = np.abs(normal[:, None, 2:]) > 0.5
            upright = np.stack([x * -normal[:, None, 1] + y * normal[:, None, 0], z], axis=2)
            uv = np.where(level, corners[..., :2], upright)
            plan = corners.reshape(-1, 3)[:, :2]
            found.append(
                surface_of_quads(
                    corners,
                    normal,
                    uv / look.tile,
                    colour=vertex_colours(look, plan) if tint is None else tint,
                    entity=look.entity,
                    material=ground_material(look.material),
                    by_halves=True,
                )
            )
        return found


_SPACING = 3.0
_ABREAST = 2.5  # metres between decks that lie as high as each other
_PIER_EVERY = 22.0
_KERBED_END = 3.5  # metres that a street's kerbs go on under a deck
_TAPER = 8.0  # metres over which kerbs run out where a street has none
FILLED = 2.6
"""Metres: a ramp lower than this is an embankment between walls."""

TRACK_WIDTH = 4.6  # metres


@dataclass(frozen=True)
class Deck:
    """A piece of a deck: its way, points along it every few metres with heights, its width and thickness, metres."""

    way: OsmWay
    line: Floats
    z: Floats
    width: float
    slab: float
    ends: tuple[bool, bool]


def deck_width(way: OsmWay) -> float:
    """Of a deck, its sidewalks included, metres."""
    kind = way.tags.get("highway")
    if kind is None:
        return TRACK_WIDTH
    if kind in ON_FOOT:
        return min(max(quantity(way.tags, "width") or 2.6, 1.6), 10.0)
    return carriageway_width(way.tags) + 2 * deck_sidewalk_width(way.tags)


def deck_sidewalk_width(tags: Mapping[str, str]) -> float:
    """Width of the pavements of a deck for vehicles, metres; of its ledges where it has none or they lie apart."""
    none = ("no", "none", "separate")
    return 1.8 if tags.get("sidewalk", tags.get("sidewalk:both", "both")) not in none else 0.6


def spans_over_water(site: SiteFacts) -> BaseGeometry:
    """Return where bridges are the ground: their decks, over whatever lies below."""
    osm, above = site.osm, site.levels.above
    strips: list[NamedShape] = []
    for way in osm.ways:
        if is_bridge(way.tags) and way.id not in above and ("highway" in way.tags or "railway" in way.tags):
            width = deck_width(way) + (1.6 if way.tags.get("highway") not in ON_FOOT else 0.0)
            with drop_on_failure(f"w{way.id}"):
                strip = overlay.buffer(shapely.LineString(way.line), width / 2, cap_style="flat")
                strips.append(NamedShape(f"w{way.id}", strip))
    strips += [NamedShape(area.id, area.polygon) for area in osm.areas if area.tags.get("man_made") == "bridge"]
    return union_named(strips, grid=0.001) if strips else shapely.MultiPolygon()


def decks_of(site: SiteFacts, terrain: HeightField) -> list[Deck]:
    """Return the decks above streets, high enough over each, their ends on the graded ground."""
    osm, above = site.osm, site.levels.above
    reach = terrain.half - 1.0
    ways = [way for way in osm.ways if way.id in above and np.abs(way.line).max() < 4 * reach]
    if not ways:
        return []
    network = Network.of([way.line for way in ways], spacing=_SPACING)
    ground = terrain.smooth(network.points)
    weight = np.zeros(len(ground))
    times: Counter[int] = Counter()
    for row in network.rows:
        times.update((int(row[0]), int(row[-1])))
    # A deck that nothing goes on from ends in a house or at a station: it need not come down. Nor do railways, whose
    # embankments are not part of the ground.
    used = {node for way in osm.ways if way.id not in above and "highway" in way.tags for node in way.nodes}
    for way, row in zip(ways, network.rows, strict=True):
        for node, k in ((way.nodes[0], int(row[0])), (way.nodes[-1], int(row[-1]))):
            if node in used and "highway" in way.tags:
                weight[k] = 30.0
    weight[np.abs(network.points).max(axis=1) > reach] = 0.0
    if not weight.any():
        weight[:] = 0.05
    wide = np.zeros(len(ground))
    for way, row in zip(ways, network.rows, strict=True):
        wide[row] = np.maximum(wide[row], deck_width(way) / 2)
    level = [row for way, row in zip(ways, network.rows, strict=True) if way.tags.get("highway") != "steps"]
    beside = network.abreast(wide, level, _ABREAST)
    found = network.fit_heights(ground, weight, length=15.0, spacing=_SPACING, abreast=beside)
    high, least = deck_clearance_constraints(
        network.points, np.arange(len(found)), found, site.levels.passages, terrain
    )
    if len(high):
        bound = network.ramps(high, least, [ramp_slope(way.tags) for way in ways], ground)
        wanted = ground.copy()
        wanted[high], weight[high] = least, 30.0
        for _ in range(2):
            found = network.fit_heights(wanted, weight, length=10.0, spacing=_SPACING, abreast=beside)
            low = (found < bound - 0.02) & (weight < 1.0)
            wanted[low], weight[low] = bound[low], 10.0
        found[high] = np.maximum(found[high], least)
    found = np.maximum(found, ground + 0.02)
    decks = []
    for way, row in zip(ways, network.rows, strict=True):
        if len(row) > 1:
            slab = SLAB_ON_FOOT if way.tags.get("highway") in ON_FOOT else SLAB
            ends = (times[int(row[0])] == 1, times[int(row[-1])] == 1)
            z = found[row]
            if "highway" in way.tags and way.tags["highway"] != "steps":
                z = _lower_deck_by_kerb(network.points[row], z, ground[row], ends, terrain)
            decks.append(Deck(way, network.points[row], z, deck_width(way), slab, ends))
    return decks


def _lower_deck_by_kerb(
    line: Floats, z: Floats, ground: Floats, ends: tuple[bool, bool], terrain: HeightField
) -> Floats:
    """Lower the middle of a deck by a kerb, as the street's is that leads onto it, pavements staying as high."""
    along = arc_lengths(line)
    drop = np.full(len(line), KERB)
    within = np.ones(len(line), bool)
    for end, away, k in ((ends[0], along, 0), (ends[1], along[-1] - along, -1)):
        within &= away > _KERBED_END
        if end and float(terrain.smooth(line[k]) - terrain(line[k])) < KERB / 2:
            drop = np.minimum(drop, KERB * away / _TAPER)
    lowered = z - drop
    return np.where(within, np.maximum(lowered, ground + 0.02), lowered)


def pier_free_area(osm: OsmData, streets: StreetPolygons) -> BaseGeometry:
    """Return where no pier may stand: streets and railways at ground level, with a metre beside them."""
    kept = [NamedShape("carriageways", streets.carriageway)]
    for way in osm.ways:
        if way.tags.get("railway") in RAILS and on_the_ground(way.tags) and not is_bridge(way.tags):
            with drop_on_failure(f"w{way.id}"):
                kept.append(NamedShape(f"w{way.id}", overlay.buffer(shapely.LineString(way.line), 1.8)))
    return overlay.buffer(union_named(kept), 1.0, quad_segs=2)


def left_normals(line: Floats) -> Floats:
    """Return unit vectors to the left at the points of a line, lengthened at bends."""
    along = np.diff(line, axis=0)
    along /= np.maximum(np.hypot(*along.T)[:, None], 1e-9)
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    at = np.concatenate([left[:1], left[:-1] + left[1:], left[-1:]])
    at[1:-1] /= np.maximum((at[1:-1] ** 2).sum(axis=1, keepdims=True) / 2, 0.5)
    return at


def pier_feet(decks: Sequence[Deck], terrain: HeightField, keep_clear: BaseGeometry) -> list[Polygon]:
    """Return the footprints of the piers of decks, which block walking, metres."""
    feet: list[Polygon] = []
    for deck in decks:
        with drop_on_failure(f"w{deck.way.id}"):
            boxes = pier_boxes(deck, left_normals(deck.line), terrain, keep_clear, terrain.half)
            feet += [Polygon([corner[:2] for corner in foot]) for foot, _, _ in boxes]
    return feet


def pier_boxes(
    deck: Deck, left: Floats, terrain: HeightField, keep_clear: BaseGeometry, reach: float
) -> list[tuple[list[Floats], float, float]]:
    """Feet, lower and upper ends of a deck's piers: beside streets and rails, where it is high enough."""
    along = arc_lengths(deck.line)
    found: list[tuple[list[Floats], float, float]] = []
    last = -_PIER_EVERY
    for k in range(1, len(deck.line) - 1):
        if along[k] - last < (_PIER_EVERY if found else 6.0) or np.abs(deck.line[k]).max() > reach:
            continue
        ground = float(terrain(deck.line[k]))
        u = np.array([left[k][1], -left[k][0]])
        wide, thick = deck.width * 0.3, 0.45
        c = deck.line[k]
        foot = [c - u * thick - left[k] * wide, c + u * thick - left[k] * wide]
        foot += [c + u * thick + left[k] * wide, c - u * thick + left[k] * wide]
        if deck.z[k] - deck.slab - ground < FILLED or keep_clear.intersects(Polygon(foot)):
            continue
        found.append((foot, ground - 0.5, float(deck.z[k]) - deck.slab))
        last = float(along[k])
    return found


_SEAM = 1.2  # metres beside a deck where another counts as the same bridge
_STEP_BETWEEN = 0.8  # and metres above or below it
_WIDEST = 25.0  # metres: no deck is twice as wide
_RAIL_STEEL: tuple[int, int, int] = (96, 102, 104)


def bridge_surfaces(
    decks: list[Deck], site: SiteFacts, terrain: HeightField, streets: StreetPolygons, window: Polygon
) -> list[Surface]:
    """Draw the decks above streets with parapets and piers, and the rails of bridges that are the ground."""
    stone = QuadMeshBuilder()
    keep_clear = pier_free_area(site.osm, streets)
    shapely.prepare(keep_clear)
    beside = _Beside.of(decks)
    for own, deck in enumerate(decks):
        with drop_on_failure(f"w{deck.way.id}"):
            drawn = QuadMeshBuilder()
            _draw_deck(drawn, deck, terrain, window, keep_clear, beside, own)
            stone.take(drawn)
    _draw_rails(stone, site, terrain, window)
    return merge_surfaces(stone.surfaces())


@dataclass(frozen=True)
class _Beside:
    """All decks, to find where one borders on another: no parapet stands between two decks of one bridge."""

    decks: list[Deck]
    tree: shapely.STRtree

    @classmethod
    def of(cls, decks: list[Deck]) -> _Beside:
        """Make an index of the decks, those of stairs without a reach of their own."""
        return cls(decks, shapely.STRtree([shapely.LineString(deck.line) for deck in decks]))

    def reaches(self, own: int, start: Floats, end: Floats) -> bool:
        """Whether another deck, as high, lies at the edge from `start` to `end`, metres, shape ``(3,)`` each."""
        middle = (start + end) / 2
        point = shapely.Point(middle[:2])
        for k in np.sort(self.tree.query(point, predicate="dwithin", distance=_WIDEST)).tolist():
            deck = self.decks[k]
            line = self.tree.geometries[k]
            if k == own or line.distance(point) > deck.width / 2 + _SEAM:
                continue
            place = line.project(point)
            # Beyond its ends a deck has no edge.
            if not 0.01 < place < line.length - 0.01:
                continue
            along = arc_lengths(deck.line)
            if abs(float(np.interp(place, along, deck.z)) - middle[2]) < _STEP_BETWEEN:
                return True
        return False

    def driven_beside(self, own: int) -> BaseGeometry:
        """Return the carriageways of other decks that meet a deck at its height, metres."""
        mine = self.decks[own]
        found = []
        for k in np.sort(self.tree.query(self.tree.geometries[own], predicate="dwithin", distance=_WIDEST)).tolist():
            deck = self.decks[k]
            if k == own or "highway" not in deck.way.tags or _on_foot(deck.way.tags):
                continue
            apart = np.hypot(*(mine.line[:, None] - deck.line[None]).transpose(2, 0, 1))
            i, j = np.unravel_index(int(apart.argmin()), apart.shape)
            if abs(float(mine.z[i] - deck.z[j])) < _STEP_BETWEEN:
                side = left_normals(deck.line) * (deck.width / 2 - deck_sidewalk_width(deck.way.tags))
                found.append(overlay.make_valid(Polygon(np.concatenate([deck.line + side, (deck.line - side)[::-1]]))))
        return overlay.union_all(found)


def _draw_deck(
    stone: QuadMeshBuilder,
    deck: Deck,
    terrain: HeightField,
    window: Polygon,
    keep_clear: BaseGeometry,
    decks: _Beside,
    own: int,
) -> None:
    line, z = deck.line, deck.z
    beside = partial(decks.reaches, own)
    driven = decks.driven_beside(own)
    left = left_normals(line)
    tags = deck.way.tags
    top = "sidewalk" if tags.get("highway") in ON_FOOT else "ballast" if "highway" not in tags else "carriageway"
    stairs = tags.get("highway") == "steps"
    reach = window.bounds[2]
    a, b = line + left * deck.width / 2, line - left * deck.width / 2
    ground_a, ground_b = terrain(a), terrain(b)
    for k in range(len(line) - 1):
        if np.abs(line[k : k + 2]).max() > reach:
            continue
        m = k + 1
        la, lb, ra, rb = np.r_[a[k], z[k]], np.r_[a[m], z[m]], np.r_[b[k], z[k]], np.r_[b[m], z[m]]
        deep = np.array([0.0, 0.0, deck.slab])
        if stairs:
            _treads(stone, ra, rb, lb, la)
        elif top == "carriageway":
            _road_top(stone, deck, (k, m), left, driven)
        else:
            up = np.array([0.0, 0.0, KERB if top == "sidewalk" else 0.0])
            stone.add([ra + up, rb + up, lb + up, la + up], top)
        stone.add([la - deep, lb - deep, rb - deep, ra - deep], "kerb", (150, 148, 144))
        # A low ramp stands on walls, a high one is open below.
        low = max(z[k] - min(ground_a[k], ground_b[k]), z[m] - min(ground_a[m], ground_b[m])) < FILLED
        foot = [ground_b[k], ground_b[m], ground_a[m], ground_a[k]]
        corner = [ra, rb, lb, la]
        drop = [np.r_[p[:2], g - 0.3 if low else p[2] - deck.slab] for p, g in zip(corner, foot, strict=True)]
        look = "quay" if low else "kerb"
        stone.add([drop[0], drop[1], rb, ra], look)
        stone.add([drop[2], drop[3], la, lb], look)
        for start, end, out in ((ra, rb, -1.0), (lb, la, 1.0)):
            if beside(start, end):
                continue
            _parapet(stone, start, end, out * np.r_[left[k], 0.0], solid="highway" in tags and not _on_foot(tags))
    if "highway" in tags and not _on_foot(tags):
        _draw_lines(stone, line, z)
    for end, at in ((0, deck.ends[0]), (len(line) - 1, deck.ends[1])):
        if at and z[end] - terrain(line[end]) > 0.3:
            _abutment(stone, a[end], b[end], float(z[end]), float(min(ground_a[end], ground_b[end])), end > 0)
    for pier, bottom, head in pier_boxes(deck, left, terrain, keep_clear, reach):
        stone.box(pier, bottom, head, "kerb", (178, 175, 170))


def _road_top(stone: QuadMeshBuilder, deck: Deck, ends: tuple[int, int], left: Floats, driven: BaseGeometry) -> None:
    """Build the carriageway of a piece of a deck between its raised pavements, or between ledges where it has none.

    Where other decks are `driven` on there is neither.
    """
    k, m = ends
    walk = deck_sidewalk_width(deck.way.tags)
    look = "sidewalk" if walk > 1.0 else "kerb"
    inner = deck.width / 2 - walk
    at = {
        (end, place): np.r_[deck.line[end] + left[end] * place, deck.z[end]]
        for end in ends
        for place in (-deck.width / 2, -inner, inner, deck.width / 2)
    }
    stone.add([at[k, -inner], at[m, -inner], at[m, inner], at[k, inner]], "carriageway")
    up = np.array([0.0, 0.0, KERB])
    for right, far in ((-deck.width / 2, -inner), (inner, deck.width / 2)):
        corners = [at[k, right], at[m, right], at[m, far], at[k, far]]
        kerb = [corners[2], corners[3]] if right < 0.0 else corners[:2]
        if driven.intersects(Polygon([corner[:2] for corner in corners])):
            _cut_pavement(stone, corners, driven, look)
            continue
        stone.add([corner + up for corner in corners], look)
        stone.add([*kerb, kerb[1] + up, kerb[0] + up], "kerb")


def _cut_pavement(stone: QuadMeshBuilder, corners: Sequence[Floats], driven: BaseGeometry, look: str) -> None:
    """Build what is left of a raised quadrilateral beside what is `driven` on, with the faces of all its edges."""
    start, end = corners[0], corners[1]
    run = end[:2] - start[:2]

    def lift(xy: Floats, by: float) -> Floats:
        share = np.clip((np.asarray(xy)[:2] - start[:2]) @ run / max(float(run @ run), 1e-9), 0.0, 1.0)
        return np.r_[np.asarray(xy)[:2], start[2] + share * (end[2] - start[2]) + by]

    left = overlay.difference(Polygon([corner[:2] for corner in corners]), driven)
    for shape in polygons_of(left, 0.02):
        flat, faces = triangulate([shape])
        for a, b, c in flat[faces]:
            stone.add([lift(a, KERB), lift(b, KERB), lift(c, KERB), lift(c, KERB)], look)
        ring = np.asarray(shapely.geometry.polygon.orient(shape).exterior.coords)
        for a, b in pairwise(ring):
            stone.add([lift(a, 0.0), lift(b, 0.0), lift(b, KERB), lift(a, KERB)], "kerb")


def _on_foot(tags: dict[str, str]) -> bool:
    return tags.get("highway") in ON_FOOT


def _treads(stone: QuadMeshBuilder, ra: Floats, rb: Floats, lb: Floats, la: Floats) -> None:
    """Build a piece of a flight of stairs instead of a slope."""
    count = max(round(abs(float(rb[2] - ra[2])) / RISE), 1)
    rising = rb[2] >= ra[2]
    for k in range(count):
        s, t = k / count, (k + 1) / count
        level = float(ra[2] + (rb[2] - ra[2]) * (t if rising else s))
        r0, r1, l0, l1 = (
            np.r_[(p + (q - p) * v)[:2], level] for p, q, v in ((ra, rb, s), (ra, rb, t), (la, lb, s), (la, lb, t))
        )
        stone.add([r0, r1, l1, l0], "steps")
        down = np.array([0.0, 0.0, abs(float(rb[2] - ra[2])) / count])
        if rising:
            stone.add([l0 - down, r0 - down, r0, l0], "steps", (176, 170, 162))
        else:
            stone.add([r1 - down, l1 - down, l1, r1], "steps", (176, 170, 162))


def _parapet(stone: QuadMeshBuilder, start: Floats, end: Floats, out: Floats, *, solid: bool) -> None:
    """Build a wall or a railing along the edge from `start` to `end`; `out` points away from the deck."""
    inner = -out * 0.18
    if solid:
        up = np.array([0.0, 0.0, PARAPET])
        stone.add([start, end, end + up, start + up], "kerb")
        stone.add([end + inner, start + inner, start + inner + up, end + inner + up], "kerb")
        stone.add([start + up, end + up, end + inner + up, start + inner + up], "kerb")
        return
    for height in (0.35, 0.65, 1.0):
        lift = np.array([0.0, 0.0, height])
        thick = np.array([0.0, 0.0, 0.05])
        s, e = start + lift + inner / 2, end + lift + inner / 2
        stone.add([s, e, e + thick, s + thick], "kerb", _RAIL_STEEL)
        stone.add([e, s, s + thick, e + thick], "kerb", _RAIL_STEEL)
        stone.add([s + thick, e + thick, e + thick + inner / 4, s + thick + inner / 4], "kerb", _RAIL_STEEL)
    length = float(np.hypot(*(end - start)[:2]))
    u = (end - start) / max(length, 1e-9)
    for place in np.arange(0.0, length, 1.6):
        p = start + u * place + inner / 2
        side = np.r_[u[:2] * 0.03, 0.0]
        back = inner / 6
        foot = [p - side, p + side, p + side + back, p - side + back]
        stone.box(foot, float(p[2]), float(p[2]) + PARAPET, "kerb", _RAIL_STEEL)


def _draw_lines(stone: QuadMeshBuilder, line: Floats, z: Floats) -> None:
    """Draw a dashed line along the middle of a deck."""
    left = left_normals(line) * 0.07
    for k in range(0, len(line) - 1, 2):
        p, q = np.r_[line[k], z[k] + 0.03], np.r_[line[k + 1], z[k + 1] + 0.03]
        l0, l1 = np.r_[left[k], 0.0], np.r_[left[k + 1], 0.0]
        stone.add([p - l0, q - l1, q + l1, p + l0], "kerb", (232, 232, 228))


def _abutment(stone: QuadMeshBuilder, a: Floats, b: Floats, top: float, ground: float, far: bool) -> None:
    """Build a wall across the free end of a deck."""
    corner = [np.r_[b, ground - 0.3], np.r_[a, ground - 0.3], np.r_[a, top], np.r_[b, top]]
    stone.add(corner if far else corner[::-1], "quay")


def _draw_rails(stone: QuadMeshBuilder, site: SiteFacts, terrain: HeightField, window: Polygon) -> None:
    """Railings along bridges that are the ground."""
    osm, above = site.osm, site.levels.above
    ids: list[int] = []
    others: list[BaseGeometry] = []
    for way in osm.ways:
        if "highway" in way.tags and way.id not in above and on_the_ground(way.tags):
            with drop_on_failure(f"w{way.id}"):
                strip = overlay.buffer(shapely.LineString(way.line), deck_width(way) / 2 + 0.5, cap_style="flat")
                others.append(strip)
                ids.append(way.id)
    tree = shapely.STRtree(others)
    for way in osm.ways:
        if not is_bridge(way.tags) or way.id in above or "highway" not in way.tags or not on_the_ground(way.tags):
            continue
        with drop_on_failure(f"w{way.id}"):
            drawn = QuadMeshBuilder()
            # No railing stands where other ways go on beside the bridge.
            line = np.asarray(shapely.segmentize(shapely.LineString(way.line), 4.0).coords)
            left = left_normals(line)
            width = deck_width(way) + (1.2 if way.tags["highway"] not in ON_FOOT else 0.0)
            for side in (1.0, -1.0):
                edge = line + side * left * (width / 2 - 0.1)
                z = terrain.upper(edge)
                for k in range(len(edge) - 1):
                    middle = shapely.Point((edge[k] + edge[k + 1]) / 2)
                    crowded = [j for j in tree.query(middle, predicate="intersects") if ids[int(j)] != way.id]
                    if crowded or not window.contains(middle):
                        continue
                    p, q = np.r_[edge[k], z[k]], np.r_[edge[k + 1], z[k + 1]]
                    out = side * np.r_[left[k], 0.0]
                    if side > 0:
                        p, q = q, p
                    _parapet(drawn, p, q, out, solid=False)
            stone.take(drawn)
