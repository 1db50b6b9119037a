"""Which ways pass above a street and can't share the ground's one height with it.

A bridge over water, a railway or nothing mapped is the ground there. A bridge over a street is not: the street keeps
the ground, and the deck above it is a surface of its own, which is used where it comes down to the ground.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
import shapely

from vico.geo import overlay
from vico.geo.osm import OsmData, OsmWay
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.tags import is_bridge, level_of

OVER_A_STREET = "a bridge over another street that comes down to the ground nowhere, or too steeply"
"""Why a road that `overpasses` names is left out of the traffic, if it is."""

_THROUGH = {
    f"{kind}{link}"
    for kind in ("motorway", "trunk", "primary", "secondary", "tertiary", "unclassified", "residential")
    for link in ("", "_link")
} | {"living_street", "busway"}
_FLIGHTS = 4  # of stairs one after the other that lead to a deck
_RAILS = ("rail", "light_rail", "tram", "narrow_gauge", "subway", "monorail")


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


def street_levels(osm: OsmData) -> StreetLevels:
    """Decide which ways of a map pass above a street."""
    above = overpasses(osm)
    return StreetLevels(above, passages(osm, above))


def crossed(way: OsmWay, others: list[OsmWay], tree: shapely.STRtree) -> list[tuple[OsmWay, shapely.Point]]:
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
        and ("highway" in way.tags or way.tags.get("railway") in _RAILS)
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
        with expendable(f"w{way.id}"):
            if any(level_of(other.tags) < level_of(way.tags) for other, _ in crossed(way, below, tree)):
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
        with expendable(f"w{way.id}"):
            for other, place in crossed(way, below, tree):
                if level_of(other.tags) < level_of(way.tags):
                    found.append(Passage(way.id, (place.x, place.y), 9.0, CLEARANCE + slab))
    return found
