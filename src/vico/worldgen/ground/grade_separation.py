"""Grade separation: bridges above streets and tunnels of a place, decided once, drawn and kept clear of later.

Decks that can be driven and walked on are surfaces of the world. A tunnel that can't be used has dark mouths.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.exact import dot
from vico.geo import overlay
from vico.geo.osm import OsmData, OsmWay
from vico.geometry import distance
from vico.world.heights import HEADROOM, Decks, HeightField
from vico.world.mesh import Surface, merge_surfaces
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.site import ON_FOOT, SiteFacts, on_the_ground
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.ground.bridges import (
    PARAPET,
    TRACK_WIDTH,
    Deck,
    QuadMeshBuilder,
    bridge_surfaces,
    deck_sidewalk_width,
    deck_width,
    decks_of,
    left_normals,
    pier_feet,
    pier_free_area,
)
from vico.worldgen.ground.kerbs_and_banks import KERB
from vico.worldgen.ground.tunnels import Bore, bore_surfaces, bores_of, cuts_of, paved_of

Floats = NDArray[np.float64]

_DARK: tuple[int, int, int] = (26, 27, 29)
_LEAST_TUNNEL = 12.0  # metres: the mouths of a shorter one would stand back to back
_BEHIND = 7.0  # metres into a tunnel where the ground tells whether there is a hill
_FOOT_HEADROOM = 2.8  # metres, of the mouths of tunnels for walkers
_HEADROOM = 4.8  # and for vehicles


@dataclass(frozen=True)
class Portal:
    """The mouth of a tunnel (its way's id): its middle, the direction into it, its inner width and height, metres."""

    way: int

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
    paved = overlay.union_all([streets.carriageway, streets.sidewalk, streets.pedestrian, streets.cycleway], grid=None)
    shapely.prepare(paved)
    found: list[Portal] = []
    for way in osm.ways:
        if _is_tunnel(way):
            with drop_on_failure(f"w{way.id}"):
                found += _mouths(way, walked, built, paved)
    return found


def _is_tunnel(way: OsmWay) -> bool:
    """Whether a way goes under ground and is long enough for two mouths."""
    tags = way.tags
    if tags.get("tunnel", "no") in ("no", "building_passage", "culvert") or tags.get("highway") == "steps":
        return False
    if not ("highway" in tags or tags.get("railway") in ("rail", "light_rail", "tram")) or tags.get("indoor"):
        return False
    return bool(shapely.LineString(way.line).length >= _LEAST_TUNNEL)


def _mouths(
    way: OsmWay, walked: Mapping[int, Sequence[OsmWay]], built: shapely.STRtree, paved: BaseGeometry
) -> list[Portal]:
    """Return the mouths of a tunnel that lie in the open: streets lead to their nodes (`walked`), nothing is built."""
    foot = way.tags.get("highway") in ON_FOOT
    width = deck_width(way) - (1.0 if foot else 2.0) if "highway" in way.tags else TRACK_WIDTH
    width = max(width, 2.2)
    found: list[Portal] = []
    for end, beyond, node in ((0, 1, way.nodes[0]), (-1, -2, way.nodes[-1])):
        if node not in walked:
            continue
        here, inside = way.line[end], way.line[beyond]
        u = (inside - here) / max(distance(inside, here), 1e-9)
        across = np.array([-u[1], u[0]]) * (width / 2 + 0.6)
        face = shapely.LineString([here + u * 1.5 - across, here + u * 1.5 + across])
        # A wall across another street or into a house is worse than none; the street that leads in ends there. A
        # passage for walkers may lie on the ground whatever its tags say: no wall bars its way.
        if len(built.query(overlay.buffer(face, 0.8), predicate="intersects")):
            continue
        leading = [] if foot else walked[node]
        ends = overlay.union_all([_end_of(street, here, u) for street in leading])
        across_it = overlay.difference(overlay.buffer(face, 0.5, cap_style="flat"), ends)
        if overlay.common_area(across_it, paved) > 0.45 * (width + 1.2):
            continue
        place = here + u
        found.append(
            Portal(
                way.id,
                (float(place[0]), float(place[1])),
                (float(u[0]), float(u[1])),
                width,
                _FOOT_HEADROOM if foot else _HEADROOM,
            )
        )
    return found


def _end_of(way: OsmWay, here: Floats, inward: Floats) -> BaseGeometry:
    """Return what is paved about the end of a way that leads straight into a tunnel at `here`."""
    line = way.line if np.hypot(*(way.line[0] - here)) < 0.1 else way.line[::-1]
    out = line[1] - line[0]
    if float(dot(out, inward)) > -0.7 * float(np.hypot(*out)):
        return shapely.Point()
    return overlay.buffer(shapely.Point(here), (deck_width(way) if "highway" in way.tags else TRACK_WIDTH) / 2 + 3.0)


def portal_feet(portals: Sequence[Portal]) -> list[Polygon]:
    """Return the footprints of the mouths of tunnels, which block walking, metres."""
    return [Polygon([corner[:2] for corner in _mouth(portal)[0]]) for portal in portals]


def _mouth(portal: Portal) -> tuple[list[Floats], Floats, Floats]:
    """Return the foot of a mouth's body, counter-clockwise, the direction in and the one to the left of it."""
    u = np.array(portal.inward)
    left = np.array([-u[1], u[0]])
    c = np.array(portal.place)
    side = left * (portal.width / 2 + 0.6)
    deep = u * 3.0
    return [c - side, c + deep - side, c + deep + side, c + side], u, left


def _portal_surfaces(portals: Sequence[Portal], terrain: HeightField, window: Polygon) -> list[Surface]:
    """Draw the mouths of tunnels: a body of stone with a dark opening in its face."""
    stone = QuadMeshBuilder()
    for portal in portals:
        with drop_on_failure(f"w{portal.way}"):
            stone.take(_portal_mesh(portal, terrain, window))
    return merge_surfaces(stone.surfaces())


def _portal_mesh(portal: Portal, terrain: HeightField, window: Polygon) -> QuadMeshBuilder:
    """Draw one mouth, if it lies within the window."""
    stone = QuadMeshBuilder()
    foot, u, left = _mouth(portal)
    if not window.contains(Polygon([p[:2] for p in foot])):
        return stone
    ground = float(terrain(np.array(portal.place)))
    low = float(min(ground, terrain(np.array(foot)).min())) - 0.3
    if float(terrain(np.array(portal.place) + _BEHIND * u)) - ground < 0.4 * portal.height:
        _well(stone, foot, u, left, ground)
        return stone
    top = ground + portal.height + 0.9
    stone.box(foot, low, top, "wall")
    # The dark mouth and the lintel above it lie a hand's breadth before the face.
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
    return stone


def _well(stone: QuadMeshBuilder, foot: Sequence[Floats], u: Floats, left: Floats, ground: float) -> None:
    """Build the way down where no hill stands above a tunnel: a dark shaft with parapets, open towards the street."""
    stone.add([np.r_[p[:2], ground + 0.05] for p in foot], "kerb", _DARK)
    near_right, far_right, far_left, near_left = foot
    thick = 0.3
    right_in, left_in = left * thick, -left * thick
    for wall in (
        [near_right, far_right, far_right + right_in, near_right + right_in],
        [near_left + left_in, far_left + left_in, far_left, near_left],
        [far_right - u * thick, far_right, far_left, far_left - u * thick],
    ):
        stone.box(wall, ground - 0.3, ground + PARAPET + 0.1, "wall")


_LANDED = 0.35  # metres from the ground at which the end of a deck counts as down
_STEEPEST = 0.13  # slope of what can be driven up
_STEEPEST_ON_FOOT = 0.25  # slope of what can be walked up; stairs may be steeper
_STEEPEST_STAIRS = 1.1
_ON_THE_GROUND = 0.3  # metres


def _usable_decks(site: SiteFacts, decks: Sequence[Deck], terrain: HeightField) -> frozenset[int]:
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


def _low_parts(decks: Sequence[Deck], terrain: HeightField) -> list[Polygon]:
    """Return where decks lie too low for people to pass under them, and too high to be the ground, metres."""
    found: list[Polygon] = []
    for deck in decks:
        with drop_on_failure(f"w{deck.way.id}"):
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


@dataclass(frozen=True)
class Bridges:
    """Decks above streets, tunnels, and the mouths of those that nobody can use.

    Attributes
    ----------
    decks
        Pieces of decks with their heights.
    portals
        Mouths of tunnels that are closed.
    feet
        Where piers and mouths stand, for those who must not walk through them, metres.
    usable
        Ids of the ways whose decks can be driven or walked on.
    low
        Where decks lie too low for people to pass under them, metres.
    bores
        Pieces of the tunnels that can be used.
    cuts
        Where those are open to the sky, metres: the ground has holes there.
    """

    decks: list[Deck]
    portals: list[Portal]
    feet: list[Polygon]
    usable: frozenset[int] = frozenset()
    low: Sequence[Polygon] = ()
    bores: Sequence[Bore] = ()
    cuts: Sequence[Polygon] = ()

    @property
    def open_ways(self) -> frozenset[int]:
        """Ids of the ways on decks and in tunnels that can be used."""
        return self.usable.union(bore.way.id for bore in self.bores)

    def levels(self) -> Decks | None:
        """Return the decks and tunnels that can be used as surfaces of the world; None if there are none."""
        decks = [deck for deck in self.decks if deck.way.id in self.usable]
        strips: list[tuple[NDArray[np.float64], float, float, float]] = []
        for deck in decks:
            if "highway" in deck.way.tags:
                kind, half = deck.way.tags["highway"], deck.width / 2
                pavement = 0.0 if kind in ON_FOOT else half - deck_sidewalk_width(deck.way.tags)
                rise = 0.0 if kind == "steps" else KERB
                strips.append((np.c_[deck.line, deck.z], half, pavement if kind != "steps" else half, rise))
        for bore in self.bores:
            pavement = 0.0 if bore.on_foot else bore.width / 2 - bore.walk
            strips.append((np.c_[bore.line, bore.z], bore.width / 2, pavement, KERB))
        return Decks.of(strips) if strips else None

    def surfaces(
        self, site: SiteFacts, terrain: HeightField, streets: StreetPolygons, window: Polygon
    ) -> list[Surface]:
        """Draw them, and the railings of bridges that are the ground."""
        return [
            *bridge_surfaces(self.decks, site, terrain, streets, window),
            *_portal_surfaces(self.portals, terrain, window),
            *bore_surfaces(self.bores, terrain, window),
        ]


def bridges_of(
    site: SiteFacts, terrain: HeightField, streets: StreetPolygons, bores: Sequence[Bore] | None = None
) -> Bridges:
    """Decide the bridges above streets and the tunnels.

    Parameters
    ----------
    site
        The map.
    terrain
        The ground, graded to `streets`.
    streets
        The streets.
    bores
        The tunnels that can be used, where a whole city has decided; None: they are decided here.
    """
    decks = decks_of(site, terrain)
    if bores is None:
        reach = terrain.half - 1.0
        bores = bores_of(site, terrain, (-reach, -reach, reach, reach), paved_of(streets))
    used = {bore.way.id for bore in bores}
    portals = [portal for portal in portals_of(site.osm, streets) if portal.way not in used]
    feet = [*pier_feet(decks, terrain, pier_free_area(site.osm, streets)), *portal_feet(portals)]
    usable = _usable_decks(site, decks, terrain)
    return Bridges(decks, portals, feet, usable, _low_parts(decks, terrain), bores, cuts_of(bores))
