"""Maps as nobody should draw them: what careless editing, imports and cut extracts do to OpenStreetMap data.

A map is read into plain objects (`read_map`), damaged in one or several ways (`DAMAGES`, seeded), and written again as
a file that the product reads (`write_map`), so that the whole path from file to world is tried.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import osmium
import shapely
from numpy.typing import NDArray
from shapely.ops import nearest_points

from vico.geo.frame import LocalFrame

Random = np.random.Generator
_AREAS = ("building", "building:part", "landuse", "leisure", "natural", "amenity", "water", "area:highway")


@dataclass
class DrawnWay:
    """A way: its nodes' ids and its tags."""

    refs: list[int]
    tags: dict[str, str]

    @property
    def closed(self) -> bool:
        return len(self.refs) > 3 and self.refs[0] == self.refs[-1]


@dataclass
class DrawnMap:
    """What a map file holds near a window; places in metres east and north of its centre."""

    frame: LocalFrame
    places: dict[int, tuple[float, float]]
    node_tags: dict[int, dict[str, str]]
    ways: dict[int, DrawnWay]
    relations: dict[int, tuple[list[tuple[str, int, str]], dict[str, str]]]
    free: int = field(default=0)

    def new_id(self) -> int:
        """An id that nothing has."""
        self.free = max(self.free, 10**12) + 1
        return self.free

    def node(self, x: float, y: float) -> int:
        """Add a point; return its id."""
        number = self.new_id()
        self.places[number] = (float(x), float(y))
        return number

    def line(self, way: DrawnWay) -> NDArray[np.float64]:
        """The way's points, metres, shape ``(n, 2)``; those that are missing are left out."""
        return np.array([self.places[ref] for ref in way.refs if ref in self.places], float).reshape(-1, 2)

    def outlines(self, *keys: str) -> list[int]:
        """Ids of closed ways with one of these keys."""
        return [number for number, way in self.ways.items() if way.closed and any(key in way.tags for key in keys)]


def read_map(path: Path, frame: LocalFrame, reach: float) -> DrawnMap:
    """Read the surroundings of the frame's origin: what touches a square of half side `reach`, whole."""
    west, south, east, north = frame.bbox(reach)
    rows: dict[int, tuple[float, float]] = {}
    tagged: dict[int, dict[str, str]] = {}
    ways: dict[int, DrawnWay] = {}
    relations: dict[int, tuple[list[tuple[str, int, str]], dict[str, str]]] = {}
    for thing in osmium.FileProcessor(str(path)):
        if thing.is_node():
            rows[thing.id] = (thing.lat, thing.lon)
            if len(thing.tags):
                tagged[thing.id] = dict(thing.tags)
        elif thing.is_way():
            ways[thing.id] = DrawnWay([node.ref for node in thing.nodes], dict(thing.tags))
        elif thing.is_relation():
            relations[thing.id] = ([(m.type, m.ref, m.role) for m in thing.members], dict(thing.tags))
    inside = {n for n, (lat, lon) in rows.items() if south <= lat <= north and west <= lon <= east}
    near = {number for number, way in ways.items() if not inside.isdisjoint(way.refs)}
    kept = {
        number: relation
        for number, relation in relations.items()
        if any((kind == "w" and ref in near) or (kind == "n" and ref in inside) for kind, ref, _ in relation[0])
    }
    for members, tags in kept.values():
        if tags.get("type") == "multipolygon":
            near.update(ref for kind, ref, _ in members if kind == "w" and ref in ways)
    chosen = {number: ways[number] for number in sorted(near)}
    numbers = sorted(inside.union(*(way.refs for way in chosen.values())) & rows.keys())
    xy = frame.to_enu([rows[n][0] for n in numbers], [rows[n][1] for n in numbers]).reshape(-1, 2)
    places = {n: (float(x), float(y)) for n, (x, y) in zip(numbers, xy, strict=True)}
    return DrawnMap(frame, places, {n: tagged[n] for n in numbers if n in tagged}, chosen, kept)


def write_map(drawn: DrawnMap, path: Path) -> Path:
    """Write a map file, ``.osm`` or ``.osm.pbf``."""
    numbers = sorted(drawn.places)
    lats, lons = drawn.frame.to_geodetic(np.array([drawn.places[n] for n in numbers]).reshape(-1, 2))
    mutable = osmium.osm.mutable
    with osmium.SimpleWriter(str(path), overwrite=True) as writer:
        for number, lat, lon in zip(numbers, lats.tolist(), lons.tolist(), strict=True):
            writer.add_node(mutable.Node(id=number, location=(lon, lat), tags=drawn.node_tags.get(number, {})))
        for number, way in sorted(drawn.ways.items()):
            writer.add_way(mutable.Way(id=number, nodes=way.refs, tags=way.tags))
        for number, (members, tags) in sorted(drawn.relations.items()):
            writer.add_relation(mutable.Relation(id=number, members=members, tags=tags))
    return path


def _some(items: list[int], share: float, random: Random) -> Iterator[int]:
    """A share of the items, at least one, in their order."""
    if items:
        count = max(1, round(share * len(items)))
        yield from (items[k] for k in sorted(random.choice(len(items), min(count, len(items)), replace=False)))


def jitter(drawn: DrawnMap, random: Random) -> None:
    """Points a little off: by millimetres as after a reprojection, or by more than a wall's thickness."""
    spread = float(random.choice([0.005, 0.03, 0.2, 0.8]))
    for number in _some(list(drawn.places), float(random.choice([0.2, 1.0])), random):
        x, y = drawn.places[number]
        dx, dy = random.normal(0.0, spread, 2)
        drawn.places[number] = (x + float(dx), y + float(dy))


def snap_to_walls(drawn: DrawnMap, random: Random) -> None:
    """Corners drawn onto the neighbour's wall without sharing its points, so that walls coincide but for rounding."""
    numbers = drawn.outlines("building", "building:part")
    lines = [shapely.LineString(drawn.line(drawn.ways[n])) for n in numbers if len(drawn.line(drawn.ways[n])) > 1]
    tree = shapely.STRtree(lines)
    own = {ref for n in numbers for ref in drawn.ways[n].refs if ref in drawn.places}
    for ref in _some(sorted(own), 0.5, random):
        point = shapely.Point(drawn.places[ref])
        hits = [k for k in tree.query(point, "dwithin", 1.5).tolist() if lines[k].distance(point) > 1e-9]
        if hits:
            there = nearest_points(lines[int(random.choice(hits))], point)[0]
            drawn.places[ref] = (there.x, there.y)


def share_corners(drawn: DrawnMap, random: Random) -> None:
    """Outlines pulled onto a neighbour's corners, some exactly and some by a hair."""
    numbers = drawn.outlines("building", "building:part")
    own = sorted({ref for n in numbers for ref in drawn.ways[n].refs if ref in drawn.places})
    if not own:
        return
    spots = np.array([drawn.places[ref] for ref in own])
    tree = shapely.STRtree(shapely.points(spots))
    for ref in _some(own, 0.4, random):
        near = tree.query(shapely.Point(drawn.places[ref]), "dwithin", 3.0).tolist()
        x, y = spots[int(random.choice(near))] if near else drawn.places[ref]
        off = random.normal(0.0, 0.01, 2) * random.integers(0, 2)
        drawn.places[ref] = (float(x + off[0]), float(y + off[1]))


def duplicate(drawn: DrawnMap, random: Random) -> None:
    """Corners drawn twice, and whole buildings and streets imported twice, the second by centimetres off."""
    for number in _some(drawn.outlines(*_AREAS), 0.3, random):
        refs = drawn.ways[number].refs
        k = int(random.integers(0, len(refs) - 1))
        x, y = drawn.places.get(refs[k], (0.0, 0.0))
        refs.insert(k, refs[k] if random.random() < 0.5 else drawn.node(x, y))
    streets = [number for number, way in drawn.ways.items() if "highway" in way.tags]
    for number in [*_some(drawn.outlines("building"), 0.15, random), *_some(streets, 0.1, random)]:
        way, off = drawn.ways[number], random.normal(0.0, float(random.choice([0.0, 0.02, 0.5])), 2)
        copies = {ref: drawn.node(*(np.array(drawn.places[ref]) + off)) for ref in way.refs if ref in drawn.places}
        drawn.ways[drawn.new_id()] = DrawnWay([copies[ref] for ref in way.refs if ref in copies], dict(way.tags))


def cross(drawn: DrawnMap, random: Random) -> None:
    """Rings that cross themselves: corners in the wrong order."""
    for number in _some(drawn.outlines(*_AREAS), 0.25, random):
        refs = drawn.ways[number].refs
        if len(refs) > 4:
            i, j = random.choice(np.arange(1, len(refs) - 1), 2, replace=False).tolist()
            refs[i], refs[j] = refs[j], refs[i]


def spike(drawn: DrawnMap, random: Random) -> None:
    """Outlines and streets that run out to a point and back, within a hair of the same line."""
    for number in _some([n for n, way in drawn.ways.items() if len(way.refs) > 1], 0.2, random):
        refs = drawn.ways[number].refs
        k = int(random.integers(0, len(refs)))
        if refs[k] not in drawn.places:
            continue
        here, angle = np.array(drawn.places[refs[k]]), random.uniform(0, 2 * np.pi)
        tip = here + float(random.choice([0.02, 1.0, 30.0])) * np.array([np.cos(angle), np.sin(angle)])
        refs[k + 1 : k + 1] = [drawn.node(*tip), drawn.node(*(here + random.normal(0, 0.004, 2)))]


def bend(drawn: DrawnMap, random: Random) -> None:
    """Many points on one wall, none quite on the line."""
    for number in _some([n for n, way in drawn.ways.items() if len(way.refs) > 1], 0.3, random):
        way = drawn.ways[number]
        refs: list[int] = []
        for one, two in zip(way.refs, way.refs[1:], strict=False):
            refs.append(one)
            if one in drawn.places and two in drawn.places and random.random() < 0.6:
                a, b = np.array(drawn.places[one]), np.array(drawn.places[two])
                for share in np.sort(random.uniform(0, 1, int(random.integers(1, 6)))):
                    refs.append(drawn.node(*(a + share * (b - a) + random.normal(0.0, 0.006, 2))))
        way.refs = [*refs, way.refs[-1]]


def pierce(drawn: DrawnMap, random: Random) -> None:
    """Buildings with tiny courtyards, some that touch the outline, lie across it or outside."""
    for number in _some(drawn.outlines("building", "natural", "landuse"), 0.2, random):
        way = drawn.ways[number]
        line = drawn.line(way)
        if len(line) < 3:
            continue
        middle = line[:-1].mean(axis=0) if random.random() < 0.5 else line[int(random.integers(0, len(line)))]
        size = float(random.choice([0.01, 0.1, 0.6, 4.0]))
        ring = [drawn.node(*(middle + size * np.array(c))) for c in ((0, 0), (1, 0.1), (0.9, 1), (-0.1, 0.8))]
        inner = drawn.new_id()
        drawn.ways[inner] = DrawnWay([*ring, ring[0]], {})
        tags = {**way.tags, "type": "multipolygon"}
        drawn.relations[drawn.new_id()] = ([("w", number, "outer"), ("w", inner, "inner")], tags)
        way.tags = {}


def pile(drawn: DrawnMap, random: Random) -> None:
    """Parts of buildings that overlap each other and stick out, with heights that contradict."""
    for number in _some(drawn.outlines("building"), 0.3, random):
        line = drawn.line(drawn.ways[number])
        if len(line) < 4:
            continue
        middle = line[:-1].mean(axis=0)
        for _ in range(int(random.integers(1, 5))):
            scale = float(random.choice([0.3, 0.7, 0.999, 1.0, 1.001, 1.2]))
            off = random.normal(0.0, float(random.choice([0.0, 0.01, 2.0])), 2)
            refs = [drawn.node(*(middle + scale * (point - middle) + off)) for point in line[:-1]]
            high = float(random.choice([2.0, 6.0, 6.01, 14.0]))
            tags = {"building:part": "yes", "height": f"{high}", "min_height": f"{random.choice([0, 0, 3.0, 6.0])}"}
            tags["roof:shape"] = str(random.choice(["flat", "gabled", "hipped", "pyramidal", "dome", "skillion"]))
            drawn.ways[drawn.new_id()] = DrawnWay([*refs, refs[0]], tags)


def reverse(drawn: DrawnMap, random: Random) -> None:
    """Rings and streets drawn the other way round."""
    for number in _some(list(drawn.ways), 0.5, random):
        drawn.ways[number].refs.reverse()


def unclose(drawn: DrawnMap, random: Random) -> None:
    """Rings whose last point is missing, or lies beside the first."""
    for number in _some(drawn.outlines(*_AREAS), 0.2, random):
        refs = drawn.ways[number].refs
        last = refs.pop()
        if random.random() < 0.5 and last in drawn.places:
            refs.append(drawn.node(*(np.array(drawn.places[last]) + random.normal(0.0, 0.02, 2))))


def lose(drawn: DrawnMap, random: Random) -> None:
    """Points and ways that the extract lacks."""
    for number in list(_some(list(drawn.places), 0.05, random)):
        del drawn.places[number]
        drawn.node_tags.pop(number, None)
    for number in list(_some(list(drawn.ways), 0.03, random)):
        del drawn.ways[number]


def shrink(drawn: DrawnMap, random: Random) -> None:
    """Outlines without extent: drawn in a line, or within a hand's breadth."""
    for number in _some(drawn.outlines(*_AREAS), 0.15, random):
        way = drawn.ways[number]
        line = drawn.line(way)
        if len(line) < 4:
            continue
        flat = np.array([1.0, float(random.choice([0.0, 0.001, 0.02]))])
        scale = float(random.choice([0.003, 0.05, 1.0]))
        middle = line.mean(axis=0)
        refs = [drawn.node(*(middle + scale * flat * (point - middle))) for point in line[:-1]]
        way.refs = [*refs, refs[0]]


def misspeak(drawn: DrawnMap, random: Random) -> None:
    """Tags that say what can't be."""
    said = ["-3", "0", "0.001", "1e6", "abc", "12;3", "nan", "inf", "7,5 m", "40'", "", "999999999999", "٣"]
    keys = ["height", "min_height", "building:levels", "building:min_level", "roof:height", "roof:levels", "layer"]
    keys += ["roof:direction", "roof:angle", "width", "lanes", "level", "ele", "direction", "step_count", "maxspeed"]
    for number in _some([n for n, way in drawn.ways.items() if way.tags], 0.4, random):
        for key in random.choice(keys, 3, replace=False).tolist():
            drawn.ways[number].tags[key] = str(random.choice(said))


Damage = Callable[[DrawnMap, Random], None]

DAMAGES: dict[str, Damage] = {
    damage.__name__: damage
    for damage in (
        jitter,
        snap_to_walls,
        share_corners,
        duplicate,
        cross,
        spike,
        bend,
        pierce,
        pile,
        reverse,
        unclose,
        lose,
        shrink,
        misspeak,
    )
}
