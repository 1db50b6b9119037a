"""Streets from OpenStreetMap: the road database, and the cleaned streets the road network is made of."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.exact import dot
from vico.geo import overlay
from vico.geo.osm import OsmData, OsmWay
from vico.geo.quantities import quantity
from vico.world.model import Dropped, Junction, Road, Roads
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.site import OVER_A_STREET, SiteFacts, on_the_ground

UNDERGROUND = "under the ground: no way in leads down gently and in the open, or it is not for everybody"
THROUGH_A_BUILDING = "leads through a building that stands across it"
"""Why a road is closed, beside `levels.OVER_A_STREET`."""

_ACROSS = 1.0  # metres of a passage that may lie in walls

# Lanes each way, lane width (m) and speed (m/s) where the map says nothing: urban defaults by class of road.
DEFAULTS: dict[str, tuple[int, float, float]] = {
    "motorway": (2, 3.5, 22.2),
    "trunk": (2, 3.3, 16.7),
    "primary": (1, 3.2, 13.9),
    "secondary": (1, 3.2, 13.9),
    "tertiary": (1, 3.1, 11.1),
    "unclassified": (1, 3.0, 11.1),
    "residential": (1, 3.0, 8.3),
    "living_street": (1, 2.9, 5.6),
    "busway": (1, 3.2, 11.1),
    "service": (1, 2.7, 5.6),
}
WALKING = {"pedestrian": 4.0, "footway": 2.0, "path": 1.8, "steps": 2.0, "cycleway": 2.5, "track": 2.5}
SIDEWALK_WIDTH = 2.0
MAX_LANES_EACH_WAY = 3
_NO_SIDEWALK = {"motorway", "trunk", "service", "busway"}
_PRIVATE = {"no", "private", "agricultural", "forestry", "military"}


@dataclass(frozen=True)
class NetworkStreet:
    """A drivable or walkable OSM way with everything the map leaves open decided.

    Attributes
    ----------
    nodes
        Node ids along `line`; a new, negative id where the window's edge cuts the way.
    line
        Centre line in the direction of travel (reversed ways are turned round), metres, shape ``(n, 2)``.
    forward, backward
        Lanes each way; 0 backward on a one-way street, both 0 on a walkway.
    width
        Of the carriageway (or of the walkway), metres, without sidewalks.
    sidewalk
        none, left, right or both.
    access
        all, bus (buses only) or private.
    closed
        Why neither traffic nor walkers use it; None for the rest. A way under a roof or through a house
        (`covered`, `tunnel=building_passage`) lies on the ground and is open, unless the house as built stands across.
    deck
        Whether it lies on a deck above another street, or in a tunnel.
    """

    way: int
    part: int
    nodes: list[int]
    line: NDArray[np.float64]
    kind: str
    name: str | None
    forward: int
    backward: int
    width: float
    speed: float
    sidewalk: str
    access: str
    layer: int
    tags: dict[str, str]
    closed: str | None = None
    deck: bool = False

    @property
    def below(self) -> bool:
        """Whether it lies in a tunnel that can be used."""
        return self.deck and not on_the_ground(self.tags)

    @property
    def drivable(self) -> bool:
        """Whether vehicles may use it."""
        return self.forward > 0


def _speed(tags: dict[str, str], default: float) -> float:
    """Speed limit, m/s."""
    said = quantity(tags, "maxspeed")
    return round(said, 2) if said else default


def _lanes(tags: dict[str, str], kind: str, oneway: bool) -> tuple[int, int]:
    """Lanes forward and backward."""
    each = DEFAULTS[kind][0]
    total = quantity(tags, "lanes")
    forward, backward = quantity(tags, "lanes:forward"), quantity(tags, "lanes:backward")
    if oneway:
        return int(min(max(total or forward or each, 1), MAX_LANES_EACH_WAY + 1)), 0
    if forward is None or backward is None:
        total = total or 2 * each
        forward, backward = math.ceil(total / 2), max(math.floor(total / 2), 1)
    return int(min(max(forward, 1), MAX_LANES_EACH_WAY)), int(min(max(backward, 1), MAX_LANES_EACH_WAY))


def _sidewalk(tags: dict[str, str], kind: str) -> str:
    """Sides with a sidewalk: as mapped, else both in streets people live and shop along."""
    said = tags.get("sidewalk") or tags.get("sidewalk:both")
    if said in ("no", "none"):
        return "none"
    if said in ("both", "left", "right"):
        return said
    sides = [side for side in ("left", "right") if tags.get(f"sidewalk:{side}") in ("yes", "separate")]
    if sides:
        return "both" if len(sides) == 2 else sides[0]
    return "none" if kind in _NO_SIDEWALK else "both"


def _access(tags: dict[str, str]) -> str:
    for key in ("motorcar", "motor_vehicle", "vehicle", "access"):
        if key in tags:
            if tags[key] not in _PRIVATE:
                return "all"
            return "bus" if tags.get("bus", tags.get("psv")) in ("yes", "designated") else "private"
    return "all"


def _street(way: OsmWay, part: int, nodes: list[int], line: NDArray[np.float64]) -> NetworkStreet | None:
    """Decide one way's lanes, width, sidewalks and access; None if it is no street."""
    tags = way.tags
    kind = tags.get("highway", "").removesuffix("_link")
    if tags.get("area") == "yes" or (kind not in DEFAULTS and kind not in WALKING):
        return None
    layer = round(quantity(tags, "layer") or 0)
    closed = None if on_the_ground(tags) else UNDERGROUND
    name = tags.get("name")
    if kind in WALKING:
        width = min(quantity(tags, "width") or WALKING[kind], 8.0)
        return NetworkStreet(
            way.id, part, nodes, line, kind, name, 0, 0, width, 1.4, "none", "all", layer, tags, closed
        )
    oneway = tags.get("oneway") in ("yes", "true", "1", "-1") or (
        tags.get("oneway") != "no" and (kind == "motorway" or tags.get("junction") in ("roundabout", "circular"))
    )
    if tags.get("oneway") == "-1":
        nodes, line = nodes[::-1], line[::-1]
    _, lane_width, default_speed = DEFAULTS[kind]
    forward, backward = _lanes(tags, kind, oneway)
    access = "bus" if kind == "busway" else _access(tags)
    return NetworkStreet(
        way=way.id,
        part=part,
        nodes=nodes,
        line=line,
        kind=kind,
        name=name,
        forward=forward,
        backward=backward,
        width=round((forward + backward) * lane_width, 2),
        speed=_speed(tags, default_speed),
        sidewalk=_sidewalk(tags, kind),
        access=access,
        layer=layer,
        tags=tags,
        closed=closed,
    )


def _cut(way: OsmWay, osm: OsmData, new_id: int) -> tuple[list[tuple[list[int], NDArray[np.float64]]], int]:
    """Cut a way to its pieces inside the window; where the edge cuts a segment a new node replaces the rest."""
    inside = osm.holds(way.line)
    if inside.all():
        return [(list(way.nodes), way.line)], new_id
    pieces: list[tuple[list[int], NDArray[np.float64]]] = []
    nodes: list[int] = []
    points: list[NDArray[np.float64]] = []

    def close() -> None:
        nonlocal nodes, points
        if len(nodes) > 1:
            pieces.append((nodes, np.array(points)))
        nodes, points = [], []

    for i in range(len(way.nodes)):
        if inside[i]:
            if not nodes and i > 0:
                nodes, points = [new_id], [_crossing(way.line[i], way.line[i - 1], osm.box)]
                new_id -= 1
            nodes.append(way.nodes[i])
            points.append(way.line[i])
        elif nodes:
            nodes.append(new_id)
            points.append(_crossing(way.line[i - 1], way.line[i], osm.box))
            new_id -= 1
            close()
        elif i > 0:
            # A long segment may lead through the window without a node in it.
            through = shapely.clip_by_rect(shapely.LineString(way.line[i - 1 : i + 1]), *osm.box)
            if through.length > 0.0:
                pieces.append(([new_id, new_id - 1], np.array(through.coords)))
                new_id -= 2
    close()
    return pieces, new_id


def _crossing(
    inner: NDArray[np.float64], outer: NDArray[np.float64], box: tuple[float, float, float, float]
) -> NDArray[np.float64]:
    """Where the segment from a point inside a box to one outside leaves it."""
    step, low, high = outer - inner, np.array(box[:2]), np.array(box[2:])
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(step > 0, (high - inner) / step, np.where(step < 0, (low - inner) / step, np.inf))
    return np.asarray(inner + step * float(shares.min()))


def streets_from_osm(
    site: SiteFacts, solids: Sequence[BaseGeometry] = (), usable: Set[int] = frozenset()
) -> list[NetworkStreet]:
    """Return the streets and walkways of a window, cut at its edge.

    Parameters
    ----------
    site
        The map and its facts.
    solids
        What stands on the ground, metres.
    usable
        Ids of the ways above others and in tunnels that can be used: those are open.

    Returns
    -------
    list of Street
        In the order of the file; a way that leaves the window and comes back gives several parts.
    """
    streets: list[NetworkStreet] = []
    new_id = -1
    standing = shapely.STRtree(solids)
    for way in site.osm.ways:
        if "highway" not in way.tags:
            continue
        pieces, new_id = _cut(way, site.osm, new_id)
        with drop_on_failure(f"w{way.id}"):
            found = _parts(way, pieces, site, standing)
            streets += [_open_street(street) if way.id in usable else street for street in found]
    return _medians_cleared(streets, lefthand=site.left_driving)


def _open_street(street: NetworkStreet) -> NetworkStreet:
    """Return a street on a deck or in a tunnel that can be used; tunnels that are not for walkers have no sidewalks."""
    street = replace(street, deck=True, closed=None)
    return replace(street, sidewalk="none") if street.below and street.tags.get("foot") == "no" else street


def _parts(
    way: OsmWay, pieces: list[tuple[list[int], NDArray[np.float64]]], site: SiteFacts, standing: shapely.STRtree
) -> list[NetworkStreet]:
    """Return the streets that the pieces of a way are, those that nobody can use closed."""
    found: list[NetworkStreet] = []
    for part, (nodes, line) in enumerate(pieces):
        street = _street(way, part, nodes, line)
        if street is not None and np.linalg.norm(line[1:] - line[:-1], axis=1).sum() > 0.5:
            if way.id in site.levels.above:
                street = replace(street, closed=OVER_A_STREET)
            elif street.closed is None and _is_passage(way.tags) and _is_blocked(line, standing):
                street = replace(street, closed=THROUGH_A_BUILDING)
            found.append(street)
    return found


def _is_passage(tags: Mapping[str, str]) -> bool:
    """Whether a way leads under a roof or through a house."""
    return tags.get("tunnel") == "building_passage" or tags.get("covered", "no") != "no"


def _is_blocked(line: NDArray[np.float64], standing: shapely.STRtree) -> bool:
    """Whether something stands across a line, by more than the edges of a passage that is drawn a little off."""
    path = shapely.LineString(line)
    across = standing.geometries[standing.query(path, predicate="intersects")]
    return bool(len(across)) and overlay.common_length(overlay.union_all(across), path) > _ACROSS


def _medians_cleared(streets: list[NetworkStreet], *, lefthand: bool) -> list[NetworkStreet]:
    """Take the unmapped inner sidewalk from the two carriageways of a divided street: between them nobody walks."""
    oneway = [i for i, s in enumerate(streets) if s.drivable and not s.backward and s.sidewalk == "both"]
    oneway = [i for i in oneway if not any(key.startswith("sidewalk") for key in streets[i].tags)]
    if not oneway:
        return streets
    lines = [shapely.LineString(streets[i].line) for i in oneway]
    tree = shapely.STRtree(lines)
    cleared = list(streets)
    for i, line in zip(oneway, lines, strict=True):
        street = streets[i]
        middle, ahead = line.interpolate(0.5, normalized=True), street.line[-1] - street.line[0]
        for k in np.sort(tree.query(middle, predicate="dwithin", distance=30.0)):
            other = streets[oneway[int(k)]]
            back = other.line[-1] - other.line[0]
            opposite = float(dot(ahead, back)) < -0.8 * math.hypot(*ahead) * math.hypot(*back)
            if opposite and other.name == street.name and other.kind == street.kind:
                cleared[i] = replace(street, sidewalk="left" if lefthand else "right")
                break
    return cleared


def is_traffic_street(street: NetworkStreet) -> bool:
    """Whether public traffic uses a street: what the road network is made of."""
    if not street.drivable or street.access == "private" or street.closed is not None:
        return False
    if street.kind == "service":
        return street.access == "bus" or street.tags.get("bus", street.tags.get("psv")) in ("yes", "designated")
    return True


def roads_from_osm(site: SiteFacts, streets: Sequence[NetworkStreet]) -> Roads:
    """Build the road database: streets and walkways split at junctions, with widths, lanes and sidewalks.

    Parameters
    ----------
    site
        The map and its facts.
    streets
        `streets_from_osm` of the same site.

    Returns
    -------
    Roads
        Junctions are where three or more drivable roads meet; crossings are mapped crossing points on carriageways.
    """
    osm = site.osm
    streets = [s for s in streets if not (s.kind == "service" and s.access == "private")]
    meeting: Counter[int] = Counter()
    for street in streets:
        meeting.update(street.nodes)
        if street.nodes[0] == street.nodes[-1]:
            meeting[street.nodes[0]] += 1
    roads: list[Road] = []
    ends: dict[int, list[str]] = defaultdict(list)
    places: dict[int, tuple[float, float]] = {}
    for street in streets:
        start, count = 0, 0
        for i in range(1, len(street.nodes)):
            if i < len(street.nodes) - 1 and meeting[street.nodes[i]] < 2:
                continue
            road = Road(
                id=f"w{street.way}.{street.part}.{count}",
                osm_id=street.way,
                name=street.name,
                kind=street.kind,
                line=[_point(p) for p in street.line[start : i + 1]],
                width=street.width,
                lanes=street.forward + street.backward,
                oneway=street.drivable and street.backward == 0,
                sidewalk=street.sidewalk,
                speed=street.speed,
                layer=-1 if street.closed == UNDERGROUND and street.layer >= 0 else street.layer,
                closed=street.closed,
            )
            roads.append(road)
            for k in (start, i):
                places[street.nodes[k]] = _point(street.line[k])
                if street.drivable:
                    ends[street.nodes[k]].append(road.id)
            start, count = i, count + 1
    signals = {
        node.id for node in osm.nodes if node.tags.get("highway") == "traffic_signals" or "traffic_signals" in node.tags
    }
    junctions = [
        Junction(
            id=f"j{node}", position=places[node], roads=meet, signals=_has_signals(places[node], node, signals, osm)
        )
        for node, meet in ends.items()
        if len(meet) >= 3
    ]
    return Roads(roads=roads, junctions=junctions, crossings=_crossings(osm, streets))


def closed_roads(roads: Roads) -> list[Dropped]:
    """Return the ways that are closed to traffic and walkers, each once, and why."""
    reasons = {road.osm_id: road.closed for road in roads.roads if road.closed is not None}
    return [Dropped(id=f"w{way}", reason=reason) for way, reason in sorted(reasons.items())]


def _point(xy: NDArray[np.float64] | Sequence[float]) -> tuple[float, float]:
    return round(float(xy[0]), 3), round(float(xy[1]), 3)


def _has_signals(place: tuple[float, float], node: int, signals: set[int], osm: OsmData) -> bool:
    """Whether a junction has signals: on its node, or on an approach within 20 m (as Europe maps them)."""
    if node in signals:
        return True
    return any(math.hypot(n.xy[0] - place[0], n.xy[1] - place[1]) < 20 for n in osm.nodes if n.id in signals)


def _crossings(osm: OsmData, streets: list[NetworkStreet]) -> list[tuple[float, float]]:
    """Find mapped crossing points that lie on a carriageway."""
    roads = [shapely.LineString(s.line) for s in streets if s.drivable]
    points = [
        node.xy
        for node in osm.nodes
        if (node.tags.get("highway") == "crossing" or "crossing" in node.tags)
        and node.tags.get("crossing") != "no"
        and osm.holds(node.xy)
    ]
    if not roads or not points:
        return []
    tree = shapely.STRtree(roads)
    near = tree.query(shapely.points(np.array(points)), predicate="dwithin", distance=1.0)[0]
    return [_point(points[i]) for i in sorted(set(near.tolist()))]
