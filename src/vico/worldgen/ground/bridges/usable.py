"""Which decks above streets can be driven and walked on, and what they and tunnels are as surfaces of the world."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo.osm import OsmWay
from vico.world.heights import HEADROOM, Decks, HeightField
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.levels import ON_FOOT
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.ground.bridges.decks import Deck, deck_walk, left_normals
from vico.worldgen.ground.bridges.tunnels import Bore
from vico.worldgen.ground.kerbs import KERB

_LANDED = 0.35  # metres from the ground at which the end of a deck counts as down
_STEEPEST, _STEEPEST_ON_FOOT = 0.13, 0.25  # slopes of what can be driven and walked up; stairs may be steeper
_STEEPEST_STAIRS = 1.1
_ON_THE_GROUND = 0.3  # metres


def usable_decks(site: SiteFacts, decks: Sequence[Deck], terrain: HeightField) -> frozenset[int]:
    """Return the ways above streets that lead from the ground to the ground on slopes that can be used.

    Decks that meet are one bridge. Of each, streets are usable if those of its ends that streets on the ground go on
    from have come down to it, at one end at least, and no street of it is too steep; footways likewise.
    """
    ways = {deck.way.id: deck.way for deck in decks if "highway" in deck.way.tags}
    pieces: dict[int, list[Deck]] = defaultdict(list)
    for deck in decks:
        pieces[deck.way.id].append(deck)
    above = site.levels.above
    found: set[int] = set()
    for on_foot in (False, True):
        own = {number: way for number, way in ways.items() if (way.tags["highway"] in ON_FOOT) == on_foot}
        ground = {
            node
            for way in site.osm.ways
            if way.id not in above and "highway" in way.tags and (on_foot or way.tags["highway"] not in ON_FOOT)
            for node in way.nodes
        }
        # Footways may start from decks of streets that are usable.
        ground |= {node for number in found for node in ways[number].nodes}
        for bridge in _bridges(own):
            parts = [piece for number in bridge for piece in pieces[number]]
            if all(_is_gentle(piece) for piece in parts) and _lands(parts, ground, terrain, found, ways):
                found.update(bridge)
    return frozenset(found)


def deck_surfaces(decks: Sequence[Deck], bores: Sequence[Bore]) -> Decks | None:
    """Return usable decks and tunnels as surfaces of the world; None if there are none."""
    strips: list[tuple[NDArray[np.float64], float, float, float]] = []
    for deck in decks:
        if "highway" in deck.way.tags:
            kind, half = deck.way.tags["highway"], deck.width / 2
            pavement = 0.0 if kind in ON_FOOT else half - deck_walk(deck.way.tags)
            rise = 0.0 if kind == "steps" else KERB
            strips.append((np.c_[deck.line, deck.z], half, pavement if kind != "steps" else half, rise))
    for bore in bores:
        pavement = 0.0 if bore.on_foot else bore.width / 2 - bore.walk
        strips.append((np.c_[bore.line, bore.z], bore.width / 2, pavement, KERB))
    return Decks.of(strips) if strips else None


def low_parts(decks: Sequence[Deck], terrain: HeightField) -> list[Polygon]:
    """Return where decks lie too low for people to pass under them, and too high to be the ground, metres."""
    found: list[Polygon] = []
    for deck in decks:
        with expendable(f"w{deck.way.id}"):
            side = left_normals(deck.line) * deck.width / 2
            rise = deck.z - terrain(deck.line)
            low = (rise > _ON_THE_GROUND) & (rise - deck.slab < HEADROOM)
            for k in np.flatnonzero(low[:-1] & low[1:]).tolist():
                ends = deck.line[k : k + 2]
                found.append(Polygon(np.concatenate([ends + side[k : k + 2], (ends - side[k : k + 2])[::-1]])))
    return [shape for shape in found if shape.is_valid]


def _bridges(ways: dict[int, OsmWay]) -> list[list[int]]:
    """Return the ways that hang together by their nodes, in the order of the map."""
    group = {number: number for number in ways}
    at: dict[int, int] = {}
    for number, way in ways.items():
        for node in way.nodes:
            other = group[at.setdefault(node, number)]
            mine = group[number]
            if other != mine:
                group = {k: min(other, mine) if v in (other, mine) else v for k, v in group.items()}
    found: dict[int, list[int]] = defaultdict(list)
    for number in ways:
        found[group[number]].append(number)
    return list(found.values())


def _is_gentle(deck: Deck) -> bool:
    """Whether nothing of a deck is too steep."""
    kind = deck.way.tags["highway"]
    most = _STEEPEST_STAIRS if kind == "steps" else _STEEPEST_ON_FOOT if kind in ON_FOOT else _STEEPEST
    run = np.maximum(np.hypot(*np.diff(deck.line, axis=0).T), 0.3)
    return bool((np.abs(np.diff(deck.z)) / run).max(initial=0.0) <= most)


def _lands(
    parts: Sequence[Deck], ground: set[int], terrain: HeightField, usable: set[int], ways: dict[int, OsmWay]
) -> bool:
    """Whether all ends of a bridge that something on the ground goes on from are down, one at least."""
    decks = {node for number in usable for node in ways[number].nodes}
    down = 0
    for part in parts:
        nodes, reach = part.way.nodes, terrain.half - 1.0
        for node, k in ((nodes[0], 0), (nodes[-1], -1)):
            if node not in ground or np.abs(part.line[k]).max() > reach:
                continue
            if node not in decks and abs(float(part.z[k] - terrain.smooth(part.line[k]))) > _LANDED:
                return False
            down += 1
    return down > 0
