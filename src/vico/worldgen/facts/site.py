"""Facts of a map that several stages need, decided once: levels, bridges over streets, bodies of water.

A bridge over water, a railway or nothing mapped is the ground there. A bridge over a street is not: the street keeps
the ground, and the deck above it is a surface of its own, which is used where it comes down to the ground. A river, a
lake or the sea is one body of water, whatever bridges and streets part it on the map.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Set
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.geo.osm import OsmData, OsmWay
from vico.geo.quantities import number, quantity
from vico.io.compiled import compiled
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.named_places import NamedPlace, named_places
from vico.worldgen.facts.street_habits import keeps_left


def is_underground(tags: Mapping[str, str]) -> bool:
    """Whether a building lies below the ground, all of it.

    `location`, `tunnel` and `level` say so. `layer` alone does not: it says what is drawn over what, as of a house
    under a viaduct; beside ``parking=underground`` it does.
    """
    if tags.get("location") == "underground" or tags.get("tunnel") == "yes":
        return True
    if tags.get("parking") == "underground" and tags.get("layer", "").startswith("-"):
        return True
    # All of its levels are below the ground: -1;-2 is, -1;0;1 is not, nor is the range -1-2.
    highest = number(tags.get("level"))
    return highest is not None and highest < 0.0


def on_the_ground(tags: Mapping[str, str]) -> bool:
    """Whether a way or area lies at ground level outdoors: not in a tunnel, indoors or on a level below the ground.

    A layer below 0 alone does not say so: a stream or a street under a bridge has one. A level below the ground does,
    unless the layer says that it is not below.
    """
    if tags.get("tunnel", "no") not in ("no", "building_passage") or tags.get("indoor", "no") != "no":
        return False
    if tags.get("location") == "underground" or tags.get("highway") == "corridor":
        return False
    layer, level = quantity(tags, "layer"), number(tags.get("level"))
    return level is None or level >= 0 or (layer is not None and layer >= 0)


def level_of(tags: Mapping[str, str]) -> int:
    """Return the layer a way lies on: as mapped, else 1 for bridges, -1 for tunnels, 0 for the rest."""
    if (layer := quantity(tags, "layer")) is not None:
        return round(layer)
    return 1 if is_bridge(tags) else -1 if tags.get("tunnel", "no") not in ("no", "building_passage") else 0


def is_bridge(tags: Mapping[str, str]) -> bool:
    """Whether a way leads over a bridge."""
    return tags.get("bridge", "no") != "no"


OVER_A_STREET = "a bridge over another street that comes down to the ground nowhere, or too steeply"
"""Why a road that `overpasses` names is left out of the traffic, if it is."""

_THROUGH = {
    f"{kind}{link}"
    for kind in ("motorway", "trunk", "primary", "secondary", "tertiary", "unclassified", "residential")
    for link in ("", "_link")
} | {"living_street", "busway"}
_FLIGHTS = 4  # of stairs one after the other that lead to a deck
RAILS = ("rail", "light_rail", "tram", "narrow_gauge", "subway", "monorail")


CLEARANCE = 4.7
"""Metres between a street and the deck of a bridge above it."""

SLAB = 0.7
SLAB_ON_FOOT = 0.35
"""Thickness of a deck for vehicles, and of one for walkers, metres."""

ON_FOOT = ("footway", "path", "steps", "pedestrian", "cycleway", "corridor", "elevator")


@dataclass(frozen=True)
class Passage:
    """Where a deck passes over a street: the place, how far from it the deck is wanted high, and how high."""

    way: int
    place: tuple[float, float]
    reach: float
    clearance: float


@dataclass(frozen=True)
class StreetLevels:
    """Which ways pass above a street.

    Attributes
    ----------
    above
        Ids of the ways whose bridges pass over a street, whole chains of bridges and the stairs to them (`overpasses`).
    passages
        Every place where one of them does.
    """

    above: frozenset[int]
    passages: list[Passage]


def ways_over_or_under(way: OsmWay, others: list[OsmWay], tree: shapely.STRtree) -> list[tuple[OsmWay, shapely.Point]]:
    """Ways among `others` (the tree's lines, in order) that a way passes over or under, each with the place."""
    line = shapely.LineString(way.line)
    found: list[tuple[OsmWay, shapely.Point]] = []
    shared = set(way.nodes)
    for k in np.sort(tree.query(line, predicate="intersects")):
        other = others[int(k)]
        if other.id == way.id or shared.intersection(other.nodes):
            continue
        for part in shapely.get_parts(overlay.crossing(line, tree.geometries[int(k)])):
            found.append((other, part.centroid))
    return found


def streets_below(osm: OsmData) -> list[OsmWay]:
    """Streets at ground level that a deck may pass over."""
    kept = []
    for way in osm.ways:
        tags = way.tags
        if tags.get("highway") in _THROUGH and tags.get("tunnel", "no") in ("no", "building_passage"):
            kept.append(way)
    return kept


def overpasses(osm: OsmData) -> frozenset[int]:
    """Ids of the ways (streets, footways and railways) whose bridges pass over a street, whole chains of bridges."""
    bridges = [
        way
        for way in osm.ways
        if is_bridge(way.tags)
        and ("highway" in way.tags or way.tags.get("railway") in RAILS)
        and level_of(way.tags) > 0
        and not (way.closed and way.tags.get("area") == "yes")
    ]
    below = streets_below(osm)
    if not bridges or not below:
        return frozenset()
    tree = shapely.STRtree([shapely.LineString(way.line) for way in below])
    parent = {way.id: way.id for way in bridges}

    def root(way: int) -> int:
        while parent[way] != way:
            parent[way] = parent[parent[way]]
            way = parent[way]
        return way

    at: dict[int, list[int]] = defaultdict(list)
    for way in bridges:
        for node in dict.fromkeys(way.nodes):
            at[node].append(way.id)
    for ways in at.values():
        for other in ways[1:]:
            parent[max(root(ways[0]), root(other))] = min(root(ways[0]), root(other))
    over: set[int] = set()
    for way in bridges:
        with drop_on_failure(f"w{way.id}"):
            if any(level_of(other.tags) < level_of(way.tags) for other, _ in ways_over_or_under(way, below, tree)):
                over.add(root(way.id))
    decks = {way.id for way in bridges if root(way.id) in over}
    return frozenset(decks).union(_stairs_to(osm, decks))


def _stairs_to(osm: OsmData, decks: set[int]) -> set[int]:
    """Stairs that lead to decks, flight after flight until a way of another kind meets them on the ground."""
    landings = {node for way in osm.ways if way.id in decks for node in way.nodes}
    ground = {
        node for way in osm.ways if "highway" in way.tags and way.tags["highway"] != "steps" for node in way.nodes
    }
    flights = [way for way in osm.ways if way.tags.get("highway") == "steps" and way.id not in decks]
    found: set[int] = set()
    for _ in range(_FLIGHTS):
        new = [way for way in flights if way.id not in found and landings.intersection(way.nodes)]
        found.update(way.id for way in new)
        landings = {node for way in new for node in (way.nodes[0], way.nodes[-1])} - ground
    return found


def passages(osm: OsmData, above: frozenset[int]) -> list[Passage]:
    """Every place where one of the decks `above` passes over a street, in the order of the map."""
    below = [way for way in streets_below(osm) if way.id not in above]
    if not below or not above:
        return []
    tree = shapely.STRtree([shapely.LineString(way.line) for way in below])
    found = []
    for way in osm.ways:
        if way.id not in above or way.tags.get("highway") == "steps":
            continue
        slab = SLAB_ON_FOOT if way.tags.get("highway") in ON_FOOT else SLAB
        with drop_on_failure(f"w{way.id}"):
            for other, place in ways_over_or_under(way, below, tree):
                if level_of(other.tags) < level_of(way.tags):
                    found.append(Passage(way.id, (place.x, place.y), 9.0, CLEARANCE + slab))
    return found


_REACH = 30.0  # metres along which a surface follows its banks
_WIDER = 0.75  # of the distance to the nearest bank, where that is more
_SOFT = 0.7  # metres by which the banks near a point may differ and still count


@dataclass(frozen=True)
class WaterBody:
    """A body of open water and how high its surface lies.

    Attributes
    ----------
    outline
        Where it is, what only bridges hide among it, metres.
    shore, banks
        Points of its banks and their heights, metres, shapes ``(n, 2)`` and ``(n,)``; one point for a level surface.
    drop
        How far the surface lies below the lowest banks nearby, metres.
    """

    outline: Polygon
    shore: NDArray[np.float64]
    banks: NDArray[np.float64]
    drop: float

    def level(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the surface at points, shape ``(n, 2)``, metres."""
        if len(self.shore) == 1:
            return np.full(len(xy), float(self.banks[0]) - self.drop)
        out = np.empty(len(xy))
        _soft_least(np.ascontiguousarray(xy, np.float64), self.shore, self.banks, out)
        return out - self.drop


@compiled
def _soft_least(xy, shore, banks, out):
    """About the lowest bank near each point, smooth from point to point.

    What counts as near ends: a river falls, and far down it every bank is lower. On wide water it reaches further.
    """
    away = np.empty(len(shore))
    for k in range(len(xy)):
        nearest = np.inf
        for i in range(len(shore)):
            away[i] = (xy[k, 0] - shore[i, 0]) ** 2 + (xy[k, 1] - shore[i, 1]) ** 2
            nearest = min(nearest, away[i])
        wide = 8.0 * max(_REACH**2, _WIDER**2 * nearest)
        lowest = np.inf
        for i in range(len(shore)):
            if away[i] - nearest < wide:
                lowest = min(lowest, banks[i])
        total, weight = 0.0, 0.0
        for i in range(len(shore)):
            share = 1.0 - (away[i] - nearest) / wide
            if share > 0.0:
                weight += share**4
                total += share**4 * np.exp(-(banks[i] - lowest) / _SOFT)
        out[k] = lowest - _SOFT * np.log(max(total / weight, 1e-300))


@dataclass(frozen=True)
class SiteFacts:
    """A map and what follows from it alone.

    Attributes
    ----------
    osm
        The map, local metres.
    levels
        Which ways pass above a street, and where.
    left_driving
        Whether traffic keeps left.
    named
        Named places people go to, in the order of the map.
    waters
        Of a part of a city: the bodies of water in it as the whole city has them; None: this map is all there is.
    """

    osm: OsmData
    levels: StreetLevels
    left_driving: bool
    named: list[NamedPlace]
    waters: list[WaterBody] | None = None

    def without(self, ids: Set[str]) -> SiteFacts:
        """Return the site without objects of these ids: what one stage can't make, no later stage is to see."""
        osm = replace(
            self.osm,
            nodes=[node for node in self.osm.nodes if f"n{node.id}" not in ids],
            ways=[way for way in self.osm.ways if f"w{way.id}" not in ids],
            areas=[area for area in self.osm.areas if area.id not in ids],
        )
        return replace(self, osm=osm, named=[named for named in self.named if named.id not in ids])


def site_facts(osm: OsmData, waters: list[WaterBody] | None = None) -> SiteFacts:
    """Read the facts of a site off its map; see `SiteFacts` for its waters."""
    above = overpasses(osm)
    return SiteFacts(osm, StreetLevels(above, passages(osm, above)), keeps_left(osm), named_places(osm), waters)
