"""Decks above streets: how wide, how high, and on what piers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData, OsmWay
from vico.geo.quantities import quantity
from vico.geometry import arc_lengths
from vico.world.heights import HeightField
from vico.worldgen.facts.expendable import NamedShape, expendable, united
from vico.worldgen.facts.levels import ON_FOOT, SLAB, SLAB_ON_FOOT
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.facts.streets import StreetPolygons, carriageway_width
from vico.worldgen.facts.tags import is_bridge, on_the_ground
from vico.worldgen.ground.grading import raised, ramp_slope
from vico.worldgen.ground.kerbs import KERB
from vico.worldgen.ground.profiles import Network

Floats = NDArray[np.float64]

_SPACING = 3.0
_ABREAST = 2.5  # metres between decks that lie as high as each other
_PIER_EVERY = 22.0
_KERBED_END, _TAPER = 3.5, 8.0  # metres: a street's kerbs go on under a deck, and run out where it has none
FILLED = 2.6
"""Metres: a ramp lower than this is an embankment between walls."""

_RAILS = ("rail", "light_rail", "tram", "narrow_gauge", "subway", "monorail")
_TRACK_WIDTH = 4.6


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
        return _TRACK_WIDTH
    if kind in ON_FOOT:
        return min(max(quantity(way.tags, "width") or 2.6, 1.6), 10.0)
    return carriageway_width(way.tags) + 2 * deck_walk(way.tags)


def deck_walk(tags: Mapping[str, str]) -> float:
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
            with expendable(f"w{way.id}"):
                strip = overlay.buffer(shapely.LineString(way.line), width / 2, cap_style="flat")
                strips.append(NamedShape(f"w{way.id}", strip))
    strips += [NamedShape(area.id, area.polygon) for area in osm.areas if area.tags.get("man_made") == "bridge"]
    return united(strips, grid=0.001) if strips else shapely.MultiPolygon()


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
    found = network.levelled(ground, weight, length=15.0, spacing=_SPACING, abreast=beside)
    high, least = raised(network.points, np.arange(len(found)), found, site.levels.passages, terrain)
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
            z = found[row]
            if "highway" in way.tags and way.tags["highway"] != "steps":
                z = _kerbed(network.points[row], z, ground[row], ends, terrain)
            decks.append(Deck(way, network.points[row], z, deck_width(way), slab, ends))
    return decks


def _kerbed(line: Floats, z: Floats, ground: Floats, ends: tuple[bool, bool], terrain: HeightField) -> Floats:
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


def kept_clear(osm: OsmData, streets: StreetPolygons) -> BaseGeometry:
    """Return where no pier may stand: streets and railways at ground level, with a metre beside them."""
    kept = [NamedShape("carriageways", streets.carriageway)]
    for way in osm.ways:
        if way.tags.get("railway") in _RAILS and on_the_ground(way.tags) and not is_bridge(way.tags):
            with expendable(f"w{way.id}"):
                kept.append(NamedShape(f"w{way.id}", overlay.buffer(shapely.LineString(way.line), 1.8)))
    return overlay.buffer(united(kept), 1.0, quad_segs=2)


def left_normals(line: Floats) -> Floats:
    """Return unit vectors to the left at the points of a line, lengthened at bends."""
    along = np.diff(line, axis=0)
    along /= np.maximum(np.hypot(*along.T)[:, None], 1e-9)
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    at = np.concatenate([left[:1], left[:-1] + left[1:], left[-1:]])
    at[1:-1] /= np.maximum((at[1:-1] ** 2).sum(axis=1, keepdims=True) / 2, 0.5)
    return at


def pier_feet(decks: Sequence[Deck], terrain: HeightField, keep_clear: BaseGeometry) -> list[Polygon]:
    """Return where the piers of decks stand, for those who must not walk through them, metres."""
    feet: list[Polygon] = []
    for deck in decks:
        with expendable(f"w{deck.way.id}"):
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
