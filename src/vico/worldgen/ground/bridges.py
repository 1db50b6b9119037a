"""Bridges above streets, the rails of bridges that are the ground, and the mouths of tunnels."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo.osm import OsmData, OsmWay
from vico.world.heights import HeightField
from vico.world.mesh import Surface, joined
from vico.world.products import dot
from vico.worldgen.ground.grading import raised, ramp_slope
from vico.worldgen.ground.kerbs import KERB
from vico.worldgen.ground.pavings import LOOKS, Look, coloured, ground_material
from vico.worldgen.ground.profiles import Network
from vico.worldgen.ground.stairs import RISE
from vico.worldgen.streets.levels import ON_FOOT, SLAB, SLAB_ON_FOOT, is_bridge, overpasses, passages
from vico.worldgen.streets.streets import StreetPolygons, carriageway_width, number, on_the_ground

Floats = NDArray[np.float64]

_SPACING = 3.0
_ABREAST = 2.5  # metres between decks that lie as high as each other
_SEAM, _STEP_BETWEEN = 1.2, 0.8  # metres beside and above a deck where another counts as the same bridge
_WIDEST = 25.0  # metres: no deck is twice as wide
_PARAPET = 1.0
_RAIL_STEEL: tuple[int, int, int] = (96, 102, 104)
_PIER_EVERY = 22.0
_FILLED = 2.6  # metres: a ramp lower than this is an embankment between walls
_RAILS = ("rail", "light_rail", "tram", "narrow_gauge", "subway", "monorail")
_DARK: tuple[int, int, int] = (26, 27, 29)
_LEAST_TUNNEL = 12.0  # metres: the mouths of a shorter one would stand back to back
_BEHIND = 7.0  # metres into a tunnel where the ground tells whether there is a hill
_FOOT_HEADROOM, _HEADROOM = 2.8, 4.8


@dataclass
class Masonry:
    """Quads that pile up by look; each knows its own flat normal."""

    quads: dict[str, list[Floats]] = field(default_factory=dict)
    tints: dict[str, tuple[Look, tuple[int, int, int] | None]] = field(default_factory=dict)

    def add(self, quad: Sequence[Floats], look: str, tint: tuple[int, int, int] | None = None) -> None:
        """Add a quadrilateral, counter-clockwise seen from its face."""
        key = look if tint is None else f"{look}/{tint}"
        self.quads.setdefault(key, []).append(np.asarray(quad, np.float64))
        self.tints[key] = (LOOKS[look], tint)

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
            n = len(corners)
            normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
            size = np.linalg.norm(normal, axis=1, keepdims=True)
            normal = np.repeat(normal / np.maximum(size, 1e-12), 4, axis=0)
            positions = corners.reshape(-1, 3)
            first = 4 * np.arange(n)[:, None]
            level = np.abs(normal[:, 2:]) > 0.5
            upright = np.stack(
                [positions[:, 0] * -normal[:, 1] + positions[:, 1] * normal[:, 0], positions[:, 2]], axis=1
            )
            uv = np.where(level, positions[:, :2], upright)
            colour = coloured(look, positions[:, :2]) if tint is None else np.asarray(tint, np.uint8)
            found.append(
                Surface.from_triangles(
                    positions,
                    np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])]),
                    colour=colour,
                    entity=look.entity,
                    uv=uv / look.tile,
                    normals=normal,
                    material=ground_material(look.material),
                )
            )
        return found


def _deck_width(way: OsmWay) -> float:
    """Of a deck, its sidewalks included, metres."""
    kind = way.tags.get("highway")
    if kind is None:
        return 4.6
    if kind in ON_FOOT:
        return min(max(number(way.tags.get("width")) or 2.6, 1.6), 10.0)
    return carriageway_width(way.tags) + 2 * _deck_walk(way.tags)


def _deck_walk(tags: Mapping[str, str]) -> float:
    """Width of the pavements of a deck for vehicles, metres; of its ledges where it has none or they lie apart."""
    none = ("no", "none", "separate")
    return 1.8 if tags.get("sidewalk", tags.get("sidewalk:both", "both")) not in none else 0.6


def spans_over_water(osm: OsmData) -> BaseGeometry:
    """Where bridges are the ground: their decks, over whatever lies below."""
    above = overpasses(osm)
    strips: list[BaseGeometry] = []
    for way in osm.ways:
        if is_bridge(way.tags) and way.id not in above and ("highway" in way.tags or "railway" in way.tags):
            width = _deck_width(way) + (1.6 if way.tags.get("highway") not in ON_FOOT else 0.0)
            strips.append(shapely.buffer(shapely.LineString(way.line), width / 2, cap_style="flat"))
    strips += [area.polygon for area in osm.areas if area.tags.get("man_made") == "bridge"]
    return shapely.union_all(strips, grid_size=0.001) if strips else shapely.MultiPolygon()


@dataclass(frozen=True)
class Deck:
    """A piece of a deck: its way, points along it every few metres with heights, its width and thickness, metres."""

    way: OsmWay
    line: Floats
    z: Floats
    width: float
    slab: float
    ends: tuple[bool, bool]


def decks_of(osm: OsmData, terrain: HeightField) -> list[Deck]:
    """The decks above streets, high enough over each, their ends on the graded ground."""
    above = overpasses(osm)
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
        wide[row] = np.maximum(wide[row], _deck_width(way) / 2)
    level = [row for way, row in zip(ways, network.rows, strict=True) if way.tags.get("highway") != "steps"]
    beside = network.abreast(wide, level, _ABREAST)
    found = network.levelled(ground, weight, length=15.0, spacing=_SPACING, abreast=beside)
    high, least = raised(network.points, np.arange(len(found)), found, passages(osm, above), terrain)
    if len(high):
        bound = network.ramps(high, least, [ramp_slope(way.tags) for way in ways], ground)
        wanted = ground.copy()
        wanted[high], weight[high] = least, 30.0
        for _ in range(2):
            found = network.levelled(wanted, weight, length=10.0, spacing=_SPACING, abreast=beside)
            low = (found < bound - 0.02) & (weight < 1.0)
            wanted[low], weight[low] = bound[low], 10.0
        found[high] = np.maximum(found[high], least)
    found = np.maximum(found, ground + 0.02)
    decks = []
    for way, row in zip(ways, network.rows, strict=True):
        if len(row) > 1:
            slab = SLAB_ON_FOOT if way.tags.get("highway") in ON_FOOT else SLAB
            ends = (times[int(row[0])] == 1, times[int(row[-1])] == 1)
            decks.append(Deck(way, network.points[row], found[row], _deck_width(way), slab, ends))
    return decks


def bridge_surfaces(osm: OsmData, terrain: HeightField, streets: StreetPolygons, window: Polygon) -> list[Surface]:
    """Draw the decks above streets with parapets and piers, and the rails of bridges that are the ground."""
    stone = Masonry()
    keep_clear = shapely.buffer(shapely.union_all([streets.carriageway, *_rail_strips(osm)]), 1.0, quad_segs=2)
    shapely.prepare(keep_clear)
    decks = decks_of(osm, terrain)
    beside = _Beside.of(decks)
    for own, deck in enumerate(decks):
        _draw_deck(stone, deck, terrain, window, keep_clear, partial(beside.reaches, own))
    _draw_rails(stone, osm, terrain, window)
    return joined(stone.surfaces())


def _rail_strips(osm: OsmData) -> list[BaseGeometry]:
    return [
        shapely.buffer(shapely.LineString(way.line), 1.8)
        for way in osm.ways
        if way.tags.get("railway") in _RAILS and on_the_ground(way.tags) and not is_bridge(way.tags)
    ]


def _offsets(line: Floats) -> Floats:
    """Unit vectors to the left at the points of a line, lengthened at bends."""
    along = np.diff(line, axis=0)
    along /= np.maximum(np.hypot(*along.T)[:, None], 1e-9)
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    at = np.concatenate([left[:1], left[:-1] + left[1:], left[-1:]])
    at[1:-1] /= np.maximum((at[1:-1] ** 2).sum(axis=1, keepdims=True) / 2, 0.5)
    return at


@dataclass(frozen=True)
class _Beside:
    """All decks, to tell where one borders on another: no parapet stands between two decks of one bridge."""

    decks: list[Deck]
    tree: shapely.STRtree

    @classmethod
    def of(cls, decks: list[Deck]) -> _Beside:
        """The decks, those of stairs without a reach of their own."""
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
            along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(deck.line, axis=0).T))])
            if abs(float(np.interp(place, along, deck.z)) - middle[2]) < _STEP_BETWEEN:
                return True
        return False


def _draw_deck(
    stone: Masonry,
    deck: Deck,
    terrain: HeightField,
    window: Polygon,
    keep_clear: BaseGeometry,
    beside: Callable[[Floats, Floats], bool],
) -> None:
    line, z = deck.line, deck.z
    left = _offsets(line)
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
            _road_top(stone, deck, (k, m), left)
        else:
            up = np.array([0.0, 0.0, KERB if top == "sidewalk" else 0.0])
            stone.add([ra + up, rb + up, lb + up, la + up], top)
        stone.add([la - deep, lb - deep, rb - deep, ra - deep], "kerb", (150, 148, 144))
        # A low ramp stands on walls, a high one is open below.
        low = max(z[k] - min(ground_a[k], ground_b[k]), z[m] - min(ground_a[m], ground_b[m])) < _FILLED
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
    _piers(stone, deck, left, terrain, keep_clear, reach)


def _road_top(stone: Masonry, deck: Deck, ends: tuple[int, int], left: Floats) -> None:
    """The carriageway of a piece of a deck between its raised pavements, or between ledges where it has none."""
    k, m = ends
    walk = _deck_walk(deck.way.tags)
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
        stone.add([at[k, right] + up, at[m, right] + up, at[m, far] + up, at[k, far] + up], look)
    stone.add([at[m, -inner], at[k, -inner], at[k, -inner] + up, at[m, -inner] + up], "kerb")
    stone.add([at[k, inner], at[m, inner], at[m, inner] + up, at[k, inner] + up], "kerb")


def _on_foot(tags: dict[str, str]) -> bool:
    return tags.get("highway") in ON_FOOT


def _treads(stone: Masonry, ra: Floats, rb: Floats, lb: Floats, la: Floats) -> None:
    """A piece of a flight of stairs instead of a slope."""
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


def _parapet(stone: Masonry, start: Floats, end: Floats, out: Floats, *, solid: bool) -> None:
    """A wall or a railing along the edge from `start` to `end`; `out` points away from the deck."""
    inner = -out * 0.18
    if solid:
        up = np.array([0.0, 0.0, _PARAPET])
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
        stone.box(foot, float(p[2]), float(p[2]) + _PARAPET, "kerb", _RAIL_STEEL)


def _draw_lines(stone: Masonry, line: Floats, z: Floats) -> None:
    """A dashed line along the middle of a deck."""
    left = _offsets(line) * 0.07
    for k in range(0, len(line) - 1, 2):
        p, q = np.r_[line[k], z[k] + 0.03], np.r_[line[k + 1], z[k + 1] + 0.03]
        l0, l1 = np.r_[left[k], 0.0], np.r_[left[k + 1], 0.0]
        stone.add([p - l0, q - l1, q + l1, p + l0], "kerb", (232, 232, 228))


def _abutment(stone: Masonry, a: Floats, b: Floats, top: float, ground: float, far: bool) -> None:
    """A wall across the free end of a deck."""
    corner = [np.r_[b, ground - 0.3], np.r_[a, ground - 0.3], np.r_[a, top], np.r_[b, top]]
    stone.add(corner if far else corner[::-1], "quay")


def pier_feet(osm: OsmData, terrain: HeightField, streets: StreetPolygons) -> list[Polygon]:
    """Where the piers of decks stand, for those who must not walk through them, metres."""
    keep_clear = shapely.buffer(shapely.union_all([streets.carriageway, *_rail_strips(osm)]), 1.0, quad_segs=2)
    return [
        Polygon([corner[:2] for corner in foot])
        for deck in decks_of(osm, terrain)
        for foot, _, _ in _pier_boxes(deck, _offsets(deck.line), terrain, keep_clear, terrain.half)
    ]


def _pier_boxes(
    deck: Deck, left: Floats, terrain: HeightField, keep_clear: BaseGeometry, reach: float
) -> list[tuple[list[Floats], float, float]]:
    """Feet, lower and upper ends of a deck's piers: beside streets and rails, where it is high enough."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(deck.line, axis=0).T))])
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
        if deck.z[k] - deck.slab - ground < _FILLED or keep_clear.intersects(Polygon(foot)):
            continue
        found.append((foot, ground - 0.5, float(deck.z[k]) - deck.slab))
        last = float(along[k])
    return found


def _piers(
    stone: Masonry, deck: Deck, left: Floats, terrain: HeightField, keep_clear: BaseGeometry, reach: float
) -> None:
    for foot, low, high in _pier_boxes(deck, left, terrain, keep_clear, reach):
        stone.box(foot, low, high, "kerb", (178, 175, 170))


def _draw_rails(stone: Masonry, osm: OsmData, terrain: HeightField, window: Polygon) -> None:
    """Railings along bridges that are the ground."""
    above = overpasses(osm)
    others = [
        shapely.buffer(shapely.LineString(way.line), _deck_width(way) / 2 + 0.5, cap_style="flat")
        for way in osm.ways
        if "highway" in way.tags and way.id not in above and on_the_ground(way.tags)
    ]
    tree = shapely.STRtree(others)
    ids = [way.id for way in osm.ways if "highway" in way.tags and way.id not in above and on_the_ground(way.tags)]
    for way in osm.ways:
        if not is_bridge(way.tags) or way.id in above or "highway" not in way.tags or not on_the_ground(way.tags):
            continue
        line = np.asarray(shapely.segmentize(shapely.LineString(way.line), 4.0).coords)
        left = _offsets(line)
        width = _deck_width(way) + (1.2 if way.tags["highway"] not in ON_FOOT else 0.0)
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
                _parapet(stone, p, q, out, solid=False)


@dataclass(frozen=True)
class Portal:
    """The mouth of a tunnel: its middle, the direction into it, its inner width and height, metres."""

    place: tuple[float, float]
    inward: tuple[float, float]
    width: float
    height: float


def portals_of(osm: OsmData, streets: StreetPolygons) -> list[Portal]:
    """Where streets go under ground in the open: not in buildings, nor where another tunnel goes on."""
    walked: dict[int, list[OsmWay]] = defaultdict(list)
    for way in osm.ways:
        if ("highway" in way.tags or "railway" in way.tags) and on_the_ground(way.tags):
            for node in (way.nodes[0], way.nodes[-1]):
                walked[node].append(way)
    built = shapely.STRtree(
        [area.polygon for area in osm.areas if area.tags.get("building", "no") not in ("no", "roof")]
    )
    paved = shapely.union_all([streets.carriageway, streets.sidewalk, streets.pedestrian, streets.cycleway])
    shapely.prepare(paved)
    found = []
    for way in osm.ways:
        tags = way.tags
        if tags.get("tunnel", "no") in ("no", "building_passage", "culvert") or tags.get("highway") == "steps":
            continue
        foot = tags.get("highway") in ON_FOOT
        if not ("highway" in tags or tags.get("railway") in ("rail", "light_rail", "tram")) or tags.get("indoor"):
            continue
        if shapely.LineString(way.line).length < _LEAST_TUNNEL:
            continue
        width = _deck_width(way) - (1.0 if foot else 2.0) if "highway" in tags else 4.6
        width = max(width, 2.2)
        for end, beyond, node in ((0, 1, way.nodes[0]), (-1, -2, way.nodes[-1])):
            if node not in walked:
                continue
            here, inside = way.line[end], way.line[beyond]
            u = (inside - here) / max(float(np.hypot(*(inside - here))), 1e-9)
            across = np.array([-u[1], u[0]]) * (width / 2 + 0.6)
            face = shapely.LineString([here + u * 1.5 - across, here + u * 1.5 + across])
            # A wall across another street or into a house is worse than none; the street that leads in ends there. A
            # passage for walkers may lie on the ground whatever its tags say: no wall bars its way.
            if len(built.query(shapely.buffer(face, 0.8), predicate="intersects")):
                continue
            leading = [] if foot else walked[node]
            ends = shapely.union_all([_end_of(street, here, u) for street in leading])
            across_it = shapely.difference(shapely.buffer(face, 0.5, cap_style="flat"), ends)
            if shapely.intersection(across_it, paved).area > 0.45 * (width + 1.2):
                continue
            place = here + u
            found.append(
                Portal(
                    (float(place[0]), float(place[1])),
                    (float(u[0]), float(u[1])),
                    width,
                    _FOOT_HEADROOM if foot else _HEADROOM,
                )
            )
    return found


def _end_of(way: OsmWay, here: Floats, inward: Floats) -> BaseGeometry:
    """What is paved about the end of a way that leads straight into a tunnel at `here`."""
    line = way.line if np.hypot(*(way.line[0] - here)) < 0.1 else way.line[::-1]
    out = line[1] - line[0]
    if float(dot(out, inward)) > -0.7 * float(np.hypot(*out)):
        return shapely.Point()
    return shapely.Point(here).buffer((_deck_width(way) if "highway" in way.tags else 4.6) / 2 + 3.0)


def portal_feet(portals: Sequence[Portal]) -> list[Polygon]:
    """Where the mouths of tunnels stand, for those who must not walk through them, metres."""
    return [Polygon([corner[:2] for corner in _mouth(portal)[0]]) for portal in portals]


def _mouth(portal: Portal) -> tuple[list[Floats], Floats, Floats]:
    """The foot of a mouth's body, counter-clockwise, the direction in and the one to the left of it."""
    u = np.array(portal.inward)
    left = np.array([-u[1], u[0]])
    c = np.array(portal.place)
    side = left * (portal.width / 2 + 0.6)
    deep = u * 3.0
    return [c - side, c + deep - side, c + deep + side, c + side], u, left


def portal_surfaces(osm: OsmData, terrain: HeightField, streets: StreetPolygons, window: Polygon) -> list[Surface]:
    """Draw the mouths of tunnels: a body of stone with a dark opening in its face."""
    stone = Masonry()
    for portal in portals_of(osm, streets):
        foot, u, left = _mouth(portal)
        if not window.contains(Polygon([p[:2] for p in foot])):
            continue
        ground = float(terrain(np.array(portal.place)))
        low = float(min(ground, terrain(np.array(foot)).min())) - 0.3
        if float(terrain(np.array(portal.place) + _BEHIND * u)) - ground < 0.4 * portal.height:
            _well(stone, foot, u, left, ground)
            continue
        top = ground + portal.height + 0.9
        stone.box(foot, low, top, "wall")
        _opening(stone, portal, ground, u, left)
    return joined(stone.surfaces())


def _well(stone: Masonry, foot: Sequence[Floats], u: Floats, left: Floats, ground: float) -> None:
    """The way down where no hill stands above a tunnel: a dark shaft between parapets, open towards the street."""
    stone.add([np.r_[p[:2], ground + 0.05] for p in foot], "kerb", _DARK)
    near_right, far_right, far_left, near_left = foot
    thick = 0.3
    right_in, left_in = left * thick, -left * thick
    for wall in (
        [near_right, far_right, far_right + right_in, near_right + right_in],
        [near_left + left_in, far_left + left_in, far_left, near_left],
        [far_right - u * thick, far_right, far_left, far_left - u * thick],
    ):
        stone.box(wall, ground - 0.3, ground + _PARAPET + 0.1, "wall")


def _opening(stone: Masonry, portal: Portal, ground: float, u: Floats, left: Floats) -> None:
    """The dark mouth and the lintel above it, a hand's breadth before the face."""
    middle = np.array(portal.place) - u * 0.04
    side = left * portal.width / 2
    rise = portal.height
    profile: list[tuple[float, float]] = [(-1.0, rise * 0.72), (-0.8, rise * 0.88), (-0.4, rise), (0.4, rise)]
    profile += [(0.8, rise * 0.88), (1.0, rise * 0.72)]
    corner: Callable[[float, float], Floats] = lambda s, z: np.r_[middle + side * s, ground + z]  # noqa: E731
    for (s0, z0), (s1, z1) in pairwise(profile):
        # Seen from outside, looking in, left is to the left.
        stone.add([corner(s1, 0.0), corner(s0, 0.0), corner(s0, z0), corner(s1, z1)], "kerb", _DARK)
    before = middle - u * 0.12
    lintel = [
        np.r_[before + side * s * 1.08, ground + portal.height + z]
        for s, z in ((1, 0.1), (-1, 0.1), (-1, 0.5), (1, 0.5))
    ]
    stone.add(lintel, "kerb")
