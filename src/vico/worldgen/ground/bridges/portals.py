"""The mouths of tunnels: where they are, where they stand, and how they look."""

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
from vico.world.heights import HeightField
from vico.world.mesh import Surface, merge_surfaces
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.levels import ON_FOOT
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.facts.tags import on_the_ground
from vico.worldgen.ground.bridges.decks import deck_width
from vico.worldgen.ground.bridges.masonry import PARAPET, Masonry

Floats = NDArray[np.float64]

_DARK: tuple[int, int, int] = (26, 27, 29)
_LEAST_TUNNEL = 12.0  # metres: the mouths of a shorter one would stand back to back
_BEHIND = 7.0  # metres into a tunnel where the ground tells whether there is a hill
_FOOT_HEADROOM, _HEADROOM = 2.8, 4.8
_TRACK_WIDTH = 4.6  # metres


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
            with expendable(f"w{way.id}"):
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
    width = deck_width(way) - (1.0 if foot else 2.0) if "highway" in way.tags else _TRACK_WIDTH
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
    return overlay.buffer(shapely.Point(here), (deck_width(way) if "highway" in way.tags else _TRACK_WIDTH) / 2 + 3.0)


def portal_feet(portals: Sequence[Portal]) -> list[Polygon]:
    """Where the mouths of tunnels stand, for those who must not walk through them, metres."""
    return [Polygon([corner[:2] for corner in _mouth(portal)[0]]) for portal in portals]


def _mouth(portal: Portal) -> tuple[list[Floats], Floats, Floats]:
    """Return the foot of a mouth's body, counter-clockwise, the direction in and the one to the left of it."""
    u = np.array(portal.inward)
    left = np.array([-u[1], u[0]])
    c = np.array(portal.place)
    side = left * (portal.width / 2 + 0.6)
    deep = u * 3.0
    return [c - side, c + deep - side, c + deep + side, c + side], u, left


def portal_surfaces(portals: Sequence[Portal], terrain: HeightField, window: Polygon) -> list[Surface]:
    """Draw the mouths of tunnels: a body of stone with a dark opening in its face."""
    stone = Masonry()
    for portal in portals:
        with expendable(f"w{portal.way}"):
            stone.take(_drawn(portal, terrain, window))
    return merge_surfaces(stone.surfaces())


def _drawn(portal: Portal, terrain: HeightField, window: Polygon) -> Masonry:
    """Draw one mouth, if it lies within the window."""
    stone = Masonry()
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
    _opening(stone, portal, ground, u, left)
    return stone


def _well(stone: Masonry, foot: Sequence[Floats], u: Floats, left: Floats, ground: float) -> None:
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


def _opening(stone: Masonry, portal: Portal, ground: float, u: Floats, left: Floats) -> None:
    """Build the dark mouth and the lintel above it, a hand's breadth before the face."""
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
