"""Decks above streets as people see them, with parapets and piers; railings of bridges that are the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmWay
from vico.geo.overlay import polygons_of
from vico.geometry import arc_lengths
from vico.world.heights import HeightField
from vico.world.mesh import Surface, merge_surfaces
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.levels import ON_FOOT
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.facts.tags import is_bridge, on_the_ground
from vico.worldgen.ground.bridges.decks import FILLED, Deck, deck_walk, deck_width, kept_clear, left_normals, pier_boxes
from vico.worldgen.ground.bridges.masonry import PARAPET, Masonry
from vico.worldgen.ground.drape import triangulated
from vico.worldgen.ground.kerbs import KERB
from vico.worldgen.ground.stairs import RISE

Floats = NDArray[np.float64]

_SEAM, _STEP_BETWEEN = 1.2, 0.8  # metres beside and above a deck where another counts as the same bridge
_WIDEST = 25.0  # metres: no deck is twice as wide
_RAIL_STEEL: tuple[int, int, int] = (96, 102, 104)


def bridge_surfaces(
    decks: list[Deck], site: SiteFacts, terrain: HeightField, streets: StreetPolygons, window: Polygon
) -> list[Surface]:
    """Draw the decks above streets with parapets and piers, and the rails of bridges that are the ground."""
    stone = Masonry()
    keep_clear = kept_clear(site.osm, streets)
    shapely.prepare(keep_clear)
    beside = _Beside.of(decks)
    for own, deck in enumerate(decks):
        with expendable(f"w{deck.way.id}"):
            drawn = Masonry()
            _draw_deck(drawn, deck, terrain, window, keep_clear, beside, own)
            stone.take(drawn)
    _draw_rails(stone, site, terrain, window)
    return merge_surfaces(stone.surfaces())


@dataclass(frozen=True)
class _Beside:
    """All decks, to tell where one borders on another: no parapet stands between two decks of one bridge."""

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
                found.append(overlay.make_valid(_driven(deck)))
        return overlay.union_all(found)


def _driven(deck: Deck) -> Polygon:
    """Return where a deck's carriageway lies, metres."""
    side = left_normals(deck.line) * (deck.width / 2 - deck_walk(deck.way.tags))
    return Polygon(np.concatenate([deck.line + side, (deck.line - side)[::-1]]))


def _draw_deck(
    stone: Masonry,
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
    _piers(stone, deck, left, terrain, keep_clear, reach)


def _road_top(stone: Masonry, deck: Deck, ends: tuple[int, int], left: Floats, driven: BaseGeometry) -> None:
    """Build the carriageway of a piece of a deck between its raised pavements, or between ledges where it has none.

    Where other decks are `driven` on there is neither.
    """
    k, m = ends
    walk = deck_walk(deck.way.tags)
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


def _cut_pavement(stone: Masonry, corners: Sequence[Floats], driven: BaseGeometry, look: str) -> None:
    """Build what is left of a raised quadrilateral beside what is `driven` on, with the faces of all its edges."""
    start, end = corners[0], corners[1]
    run = end[:2] - start[:2]

    def lifted(xy: Floats, by: float) -> Floats:
        share = np.clip((np.asarray(xy)[:2] - start[:2]) @ run / max(float(run @ run), 1e-9), 0.0, 1.0)
        return np.r_[np.asarray(xy)[:2], start[2] + share * (end[2] - start[2]) + by]

    left = overlay.difference(Polygon([corner[:2] for corner in corners]), driven)
    for shape in polygons_of(left, 0.02):
        flat, faces = triangulated([shape])
        for a, b, c in flat[faces]:
            stone.add([lifted(a, KERB), lifted(b, KERB), lifted(c, KERB), lifted(c, KERB)], look)
        ring = np.asarray(shapely.geometry.polygon.orient(shape).exterior.coords)
        for a, b in pairwise(ring):
            stone.add([lifted(a, 0.0), lifted(b, 0.0), lifted(b, KERB), lifted(a, KERB)], "kerb")


def _on_foot(tags: dict[str, str]) -> bool:
    return tags.get("highway") in ON_FOOT


def _treads(stone: Masonry, ra: Floats, rb: Floats, lb: Floats, la: Floats) -> None:
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


def _parapet(stone: Masonry, start: Floats, end: Floats, out: Floats, *, solid: bool) -> None:
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


def _draw_lines(stone: Masonry, line: Floats, z: Floats) -> None:
    """Draw a dashed line along the middle of a deck."""
    left = left_normals(line) * 0.07
    for k in range(0, len(line) - 1, 2):
        p, q = np.r_[line[k], z[k] + 0.03], np.r_[line[k + 1], z[k + 1] + 0.03]
        l0, l1 = np.r_[left[k], 0.0], np.r_[left[k + 1], 0.0]
        stone.add([p - l0, q - l1, q + l1, p + l0], "kerb", (232, 232, 228))


def _abutment(stone: Masonry, a: Floats, b: Floats, top: float, ground: float, far: bool) -> None:
    """Build a wall across the free end of a deck."""
    corner = [np.r_[b, ground - 0.3], np.r_[a, ground - 0.3], np.r_[a, top], np.r_[b, top]]
    stone.add(corner if far else corner[::-1], "quay")


def _piers(
    stone: Masonry, deck: Deck, left: Floats, terrain: HeightField, keep_clear: BaseGeometry, reach: float
) -> None:
    for foot, low, high in pier_boxes(deck, left, terrain, keep_clear, reach):
        stone.box(foot, low, high, "kerb", (178, 175, 170))


def _draw_rails(stone: Masonry, site: SiteFacts, terrain: HeightField, window: Polygon) -> None:
    """Railings along bridges that are the ground."""
    osm, above = site.osm, site.levels.above
    ids: list[int] = []
    others: list[BaseGeometry] = []
    for way in osm.ways:
        if "highway" in way.tags and way.id not in above and on_the_ground(way.tags):
            with expendable(f"w{way.id}"):
                strip = overlay.buffer(shapely.LineString(way.line), deck_width(way) / 2 + 0.5, cap_style="flat")
                others.append(strip)
                ids.append(way.id)
    tree = shapely.STRtree(others)
    for way in osm.ways:
        if not is_bridge(way.tags) or way.id in above or "highway" not in way.tags or not on_the_ground(way.tags):
            continue
        with expendable(f"w{way.id}"):
            drawn = Masonry()
            _draw_rail(drawn, way, terrain, window, tree, ids)
            stone.take(drawn)


def _draw_rail(
    stone: Masonry, way: OsmWay, terrain: HeightField, window: Polygon, others: shapely.STRtree, ids: list[int]
) -> None:
    """Railings along one bridge, but not where other ways (`others`, with these ids) go on beside it."""
    line = np.asarray(shapely.segmentize(shapely.LineString(way.line), 4.0).coords)
    left = left_normals(line)
    width = deck_width(way) + (1.2 if way.tags["highway"] not in ON_FOOT else 0.0)
    for side in (1.0, -1.0):
        edge = line + side * left * (width / 2 - 0.1)
        z = terrain.upper(edge)
        for k in range(len(edge) - 1):
            middle = shapely.Point((edge[k] + edge[k + 1]) / 2)
            crowded = [j for j in others.query(middle, predicate="intersects") if ids[int(j)] != way.id]
            if crowded or not window.contains(middle):
                continue
            p, q = np.r_[edge[k], z[k]], np.r_[edge[k + 1], z[k + 1]]
            out = side * np.r_[left[k], 0.0]
            if side > 0:
                p, q = q, p
            _parapet(stone, p, q, out, solid=False)
