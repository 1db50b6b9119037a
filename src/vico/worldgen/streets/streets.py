"""Where streets lie: carriageways, sidewalks, crossings and squares as polygons, from OpenStreetMap ways.

OpenStreetMap draws streets as lines. Their widths come from `width`, else from lanes, class and parking lanes. The
polygons are what the ground is painted by, what walkers may walk on, and where crossings lie, so that all agree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo.osm import OsmData, OsmWay, means_area, polygons_of
from vico.worldgen.streets.levels import is_bridge, overpasses

LANE_WIDTH = 3.2
"""Metres; netconvert's default too, so that its lanes lie within the painted carriageway."""

_GUTTER = 0.35
_SIDEWALK_WIDTH = 2.6
_KERB_RADIUS = 2.0
_GRID = 0.001  # metres: overlays on a grid are robust where free ones fail on nearly coincident outlines
_CROSSING_WIDTH = 3.6

# Lanes where OSM names none: per direction, and whether sidewalks are usual in a town.
_CLASSES: dict[str, tuple[int, bool]] = {
    "motorway": (2, False),
    "trunk": (2, False),
    "primary": (2, True),
    "secondary": (1, True),
    "tertiary": (1, True),
    "unclassified": (1, True),
    "residential": (1, True),
    "living_street": (1, True),
    "road": (1, True),
    "busway": (1, False),
    "bus_guideway": (1, False),
    "motorway_link": (1, False),
    "trunk_link": (1, False),
    "primary_link": (1, True),
    "secondary_link": (1, True),
    "tertiary_link": (1, True),
    "service": (1, False),
}
_SERVICE_WIDTH = {"driveway": 3.0, "parking_aisle": 5.5, "alley": 3.2, "drive-through": 3.0}
_FOOT_WIDTH = {"footway": 2.2, "path": 1.8, "steps": 2.4, "bridleway": 2.0, "cycleway": 2.2, "track": 2.6}
_LOOSE = {
    "gravel",
    "fine_gravel",
    "compacted",
    "ground",
    "dirt",
    "earth",
    "sand",
    "unpaved",
    "grass",
    "pebblestone",
    "woodchips",
}
_LEDGE = 0.5  # metres of a bridge's edge beside its carriageway

PAVINGS: dict[str, str] = {
    **dict.fromkeys(("sett", "cobblestone", "unhewn_cobblestone", "cobblestone:flattened"), "setts"),
    **dict.fromkeys(("paving_stones", "paving_stones:lanes", "bricks", "brick"), "stones"),
    **dict.fromkeys(("concrete", "concrete:plates", "concrete:lanes"), "concrete"),
    **dict.fromkeys(("asphalt", "chipseal", "tartan", "rubber"), "asphalt"),
    **dict.fromkeys(("gravel", "fine_gravel", "compacted", "pebblestone", "unpaved"), "gravel"),
    **dict.fromkeys(("ground", "dirt", "earth", "mud", "woodchips"), "earth"),
    **dict.fromkeys(("grass", "grass_paver"), "grass"),
    **dict.fromkeys(("wood", "metal_grid"), "wood"),
    "sand": "sand",
}
"""What a way or area is paved with, by its `surface`; what is not here looks as its kind usually does."""


@dataclass(frozen=True)
class Street:
    """A drivable way and what is painted on it.

    Attributes
    ----------
    line
        Metres, shape ``(n, 2)``, in the direction of the way (and of traffic where `oneway`).
    width
        Of the carriageway, kerb to kerb, metres.
    kerbed
        Whether it lies below its surroundings, between kerbs.
    cycle_left, cycle_right
        Whether a lane for bicycles is painted on that side, seen along `line`.
    parking_left, parking_right
        Widths of the parking lanes at the kerbs, metres; `slanted` if cars stand across the street in them.
    tracks
        Whether trams run in it.
    """

    way: int
    kind: str
    line: NDArray[np.float64]
    width: float
    lanes: int
    oneway: bool
    kerbed: bool = True
    cycle_left: bool = False
    cycle_right: bool = False
    parking_left: float = 0.0
    parking_right: float = 0.0
    slanted: bool = False
    tracks: bool = False


@dataclass(frozen=True)
class Crossing:
    """Where walkers cross a carriageway.

    Attributes
    ----------
    start, end
        On the two kerbs, metres.
    width
        Across the walking direction, metres.
    painted
        Whether it is marked.
    marking
        How: zebra, lines, dashes, ladder or dots.
    signals
        Whether lights stop the traffic there.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    width: float
    painted: bool
    marking: str = "zebra"
    signals: bool = False

    @property
    def polygon(self) -> Polygon:
        """The strip between the kerbs."""
        return shapely.buffer(LineString([self.start, self.end]), self.width / 2, cap_style="flat")


@dataclass(frozen=True)
class StreetPolygons:
    """Street surfaces, metres; pieces of one kind do not overlap, nor do kinds except as said.

    Attributes
    ----------
    carriageway
        Where vehicles drive, kerb to kerb, tunnels left out.
    sidewalk
        Paved ways for walkers beside carriageways or by themselves.
    crossing
        Parts of `carriageway` where walkers cross.
    pedestrian
        Squares and pedestrian streets.
    path
        Unpaved footways, in parks mostly.
    cycleway
        Tracks of their own for bicycles.
    steps
        Stairs outdoors.
    parking
        Open car parks.
    streets, crossings
        The lines and stripes the polygons came from.
    rails
        Centre lines of tram tracks in the street, metres.
    sunken
        Part of `carriageway` between kerbs: streets, without drives and yards.
    paved
        What the map says ways and squares are paved with: polygons by the names in `PAVINGS`, across kinds.
    """

    carriageway: MultiPolygon
    sidewalk: MultiPolygon
    crossing: MultiPolygon
    pedestrian: MultiPolygon
    path: MultiPolygon
    cycleway: MultiPolygon
    steps: MultiPolygon
    parking: MultiPolygon
    streets: list[Street]
    crossings: list[Crossing]
    rails: list[NDArray[np.float64]]
    sunken: MultiPolygon = field(default_factory=MultiPolygon)
    paved: dict[str, MultiPolygon] = field(default_factory=dict)


def number(text: str | None) -> float | None:
    """The first number of a tag value in metres (``12 m``, ``12,5``, ``40'``, ``40 ft``); None if there is none."""
    if not text:
        return None
    cleaned = text.strip().split(";")[0].replace(",", ".").lower()
    scale = 1.0
    for unit, factor in (("ft", 0.3048), ("'", 0.3048), ("m", 1.0)):
        if cleaned.endswith(unit):
            cleaned, scale = cleaned[: -len(unit)].strip(), factor
            break
    try:
        value = float(cleaned) * scale
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def on_the_ground(tags: Mapping[str, str]) -> bool:
    """Whether a way or area lies at ground level outdoors: not in a tunnel, indoors or on a lower layer."""
    if tags.get("tunnel", "no") not in ("no", "building_passage") or tags.get("indoor", "no") != "no":
        return False
    if tags.get("location") == "underground" or tags.get("highway") == "corridor":
        return False
    layer = number(tags.get("layer"))
    level = number(tags.get("level"))
    return (layer is None or layer >= 0) and (level is None or level >= 0 or layer is not None)


def lane_count(tags: Mapping[str, str]) -> int:
    """Lanes of a drivable way, both directions together."""
    said = number(tags.get("lanes"))
    if said is not None and 1 <= said <= 12:
        return int(said)
    per_direction = _CLASSES.get(tags.get("highway", ""), (1, False))[0]
    return per_direction if is_oneway(tags) else 2 * per_direction


def is_oneway(tags: Mapping[str, str]) -> bool:
    """Whether vehicles use a way in one direction only."""
    said = tags.get("oneway")
    if said in ("yes", "true", "1", "-1"):
        return True
    return said is None and (tags.get("junction") in ("roundabout", "circular") or tags.get("highway") == "motorway")


def carriageway_width(tags: Mapping[str, str]) -> float:
    """Kerb-to-kerb width of a drivable way, metres: `width` where believable, else lanes, class and parking lanes."""
    said = number(tags.get("width"))
    if said is not None and 2.0 <= said <= 40.0:
        return said
    kind = tags.get("highway", "")
    if kind == "service" and "lanes" not in tags:
        return _SERVICE_WIDTH.get(tags.get("service", ""), 4.0)
    if kind == "living_street" and "lanes" not in tags:
        return 5.0
    width = lane_count(tags) * LANE_WIDTH + 2 * _GUTTER
    for side in ("left", "right", "both"):
        lane = tags.get(f"parking:lane:{side}", tags.get(f"parking:{side}", ""))
        metres = {"parallel": 2.0, "lane": 2.0, "street_side": 2.2, "diagonal": 4.2, "perpendicular": 4.8}.get(
            lane, 0.0
        )
        width += metres * (2 if side == "both" else 1)
    return width


def road_polygons(osm: OsmData, obstacles: Sequence[BaseGeometry] = ()) -> StreetPolygons:
    """Turn the streets of an OSM extract into polygons.

    Parameters
    ----------
    osm
        The extract, local metres.
    obstacles
        Footprints of buildings that stand on the ground: no sidewalk or square runs under them, and carriageways
        only where a way leads through.

    Returns
    -------
    StreetPolygons
        Clipped to the extract's window and margin.
    """
    reach = osm.half + osm.margin
    window = shapely.box(-reach, -reach, reach, reach)
    solid = (
        shapely.union_all(shapely.make_valid(list(obstacles)), grid_size=_GRID) if len(obstacles) else MultiPolygon()
    )
    drive: list[BaseGeometry] = []
    through: list[BaseGeometry] = []
    walk: list[BaseGeometry] = []
    loose: list[BaseGeometry] = []
    cycle: list[BaseGeometry] = []
    stairs: list[BaseGeometry] = []
    square: list[BaseGeometry] = []
    car_park: list[BaseGeometry] = []
    streets: list[Street] = []
    rails: list[NDArray[np.float64]] = []
    marked: list[OsmWay] = []
    kerbed: list[BaseGeometry] = []
    paved: dict[str, list[BaseGeometry]] = {}
    above = overpasses(osm)
    trams = [LineString(way.line) for way in osm.ways if way.tags.get("railway") == "tram" and on_the_ground(way.tags)]
    tram_tree = shapely.STRtree(trams)
    for way in osm.ways:
        tags = way.tags
        if not on_the_ground(tags) or (way.closed and means_area(tags)) or way.id in above:
            continue
        if tags.get("railway") == "tram":
            rails.append(way.line)
        kind = tags.get("highway")
        if kind is None:
            continue
        line = LineString(way.line)
        if kind in _CLASSES:
            width = carriageway_width(tags)
            strip = shapely.buffer(line, width / 2, quad_segs=4)
            drive.append(strip)
            _note_paving(paved, tags, strip)
            if tags.get("tunnel") == "building_passage" or tags.get("covered", "no") != "no":
                through.append(strip)
            sides = _sidewalks(line, width, tags)
            bordered = bool(sides) or _said_sidewalk(tags) or kind in ("primary", "trunk", "secondary", "busway")
            if bordered and tags.get("surface") not in _LOOSE and kind not in ("service", "living_street"):
                kerbed.append(strip)
            streets.append(_street(way, width, bool(len(tram_tree.query(line, "dwithin", 3.0)))))
            walk += sides
            if is_bridge(tags):
                walk.append(shapely.buffer(line, width / 2 + _LEDGE, cap_style="flat"))
        elif kind in ("pedestrian", "platform"):
            square.append(shapely.buffer(line, max(number(tags.get("width")) or 5.0, 2.0) / 2, quad_segs=4))
            _note_paving(paved, tags, square[-1])
        elif kind in _FOOT_WIDTH:
            if tags.get("footway") == "crossing" or tags.get("cycleway") == "crossing":
                marked.append(way)
                continue
            width = number(tags.get("width")) or (2.6 if tags.get("footway") == "sidewalk" else _FOOT_WIDTH[kind])
            strip = shapely.buffer(line, min(max(width, 1.4), 12.0) / 2, quad_segs=3)
            unpaved = tags.get("surface") in _LOOSE or (kind in ("path", "track") and "surface" not in tags)
            _note_paving(paved, tags, strip)
            {"steps": stairs, "cycleway": cycle}.get(kind, loose if unpaved else walk).append(strip)
    for area in osm.areas:
        tags = area.tags
        if not on_the_ground(tags) or tags.get("building", "no") != "no":
            continue
        kind = tags.get("highway") or tags.get("area:highway")
        if kind in ("pedestrian", "footway", "platform", "living_street") or (
            kind is None
            and (tags.get("place") == "square" or "platform" in (tags.get("railway"), tags.get("public_transport")))
        ):
            square.append(area.polygon)
        elif kind in _CLASSES:
            drive.append(area.polygon)
        elif kind == "steps":
            stairs.append(area.polygon)
        elif tags.get("amenity") == "parking" and tags.get("parking", "surface") in ("surface", "lane", "street_side"):
            car_park.append(area.polygon)
        else:
            continue
        _note_paving(paved, tags, area.polygon)
    # Closing the outline rounds the inner corners of junctions the way kerbs do.
    carriageway = shapely.union_all(drive, grid_size=_GRID)
    carriageway = shapely.buffer(shapely.buffer(carriageway, _KERB_RADIUS, quad_segs=4), -_KERB_RADIUS, quad_segs=4)
    carriageway = shapely.set_precision(shapely.simplify(carriageway, 0.08), _GRID)
    if not solid.is_empty:
        under = shapely.difference(solid, shapely.union_all(through, grid_size=_GRID), grid_size=_GRID)
        carriageway = shapely.difference(carriageway, under, grid_size=_GRID)
    carriageway = _multi(shapely.intersection(_multi(carriageway), window, grid_size=_GRID))
    crossings = _crossings(osm, carriageway, streets, marked)
    taken: list[BaseGeometry] = [shapely.union(carriageway, solid, grid_size=_GRID)]

    def free(shapes: list[BaseGeometry]) -> MultiPolygon:
        """What is left of `shapes` beside what was claimed before, then claimed too."""
        shape = shapely.simplify(shapely.union_all(shapes, grid_size=_GRID), 0.08)
        shape = shapely.intersection(shapely.set_precision(shape, _GRID), window, grid_size=_GRID)
        left = _multi(shapely.difference(_multi(shape), taken[0], grid_size=_GRID), 0.3)
        taken[0] = shapely.union(taken[0], left, grid_size=_GRID)
        return left

    steps = free(stairs)
    # A square that is mapped as an area wins over the sidewalks drawn across it.
    pedestrian = free(square)
    cycleway = free(cycle)
    sidewalk = free(walk)
    path = free(loose)
    parking = free(car_park)
    return StreetPolygons(
        carriageway=_multi(carriageway),
        sidewalk=sidewalk,
        crossing=_multi(shapely.intersection(shapely.union_all([c.polygon for c in crossings]), carriageway)),
        pedestrian=pedestrian,
        path=path,
        cycleway=cycleway,
        steps=steps,
        parking=parking,
        streets=streets,
        crossings=crossings,
        rails=rails,
        sunken=_sunken(kerbed, carriageway),
        paved={
            name: _multi(shapely.intersection(_multi(shapely.union_all(paved[name], grid_size=_GRID)), window))
            for name in sorted(paved)
        },
    )


def _sunken(kerbed: list[BaseGeometry], carriageway: BaseGeometry) -> MultiPolygon:
    """The kerbed part of the carriageways, the rounded corners of their junctions with it."""
    if not kerbed:
        return MultiPolygon()
    shape = shapely.union_all(kerbed, grid_size=_GRID)
    shape = shapely.buffer(shapely.buffer(shape, 2 * _KERB_RADIUS, quad_segs=3), -2 * _KERB_RADIUS + 0.1, quad_segs=3)
    return _multi(shapely.intersection(_multi(shapely.set_precision(shape, _GRID)), carriageway, grid_size=_GRID))


def _note_paving(paved: dict[str, list[BaseGeometry]], tags: Mapping[str, str], shape: BaseGeometry) -> None:
    """Remember where the map says what the ground is paved with."""
    name = PAVINGS.get(tags.get("surface", "").split(";")[0])
    if name is not None:
        paved.setdefault(name, []).append(shape)


def _said_sidewalk(tags: Mapping[str, str]) -> bool:
    """Whether the map says that there is a sidewalk, drawn as a way of its own perhaps."""
    keys = ("sidewalk", "sidewalk:both", "sidewalk:left", "sidewalk:right")
    return any(tags.get(key, "no") not in ("no", "none") for key in keys)


_STANDING = {"parallel": 2.0, "lane": 2.0, "street_side": 2.2, "diagonal": 4.2, "perpendicular": 4.8}


def _street(way: OsmWay, width: float, tracks: bool) -> Street:
    """A street with what is painted along it, turned round where traffic runs against the way."""
    tags = way.tags
    oneway = is_oneway(tags)

    def cycles(side: str) -> bool:
        own = tags.get(f"cycleway:{side}", tags.get("cycleway:both"))
        if own is None and tags.get("cycleway") == "lane":
            return side == "right" or not oneway
        return own == "lane"

    parking, slanted = {}, False
    for side in ("left", "right"):
        said = tags.get(f"parking:{side}", tags.get(f"parking:lane:{side}"))
        said = said or tags.get("parking:both", tags.get("parking:lane:both", ""))
        kind = tags.get(f"parking:{side}:orientation", said) if said in ("lane", "street_side") else said
        parking[side] = _STANDING.get(said, 0.0)
        slanted = slanted or kind in ("diagonal", "perpendicular")
    turned = tags.get("oneway") == "-1"
    left, right = ("right", "left") if turned else ("left", "right")
    return Street(
        way.id,
        tags["highway"],
        way.line[::-1] if turned else way.line,
        width,
        lane_count(tags),
        oneway,
        kerbed=tags["highway"] not in ("service", "living_street") and tags.get("surface") not in _LOOSE,
        cycle_left=cycles(left),
        cycle_right=cycles(right),
        parking_left=parking[left],
        parking_right=parking[right],
        slanted=slanted,
        tracks=tracks,
    )


def _multi(shape: BaseGeometry, least: float = 0.05) -> MultiPolygon:
    return MultiPolygon(polygons_of(shape, least))


def _sidewalks(line: LineString, width: float, tags: Mapping[str, str]) -> list[BaseGeometry]:
    """Strips beside a carriageway; where OSM says nothing, both sides of the classes that have them in towns."""
    usual = _CLASSES[tags["highway"]][1]
    said = tags.get("sidewalk", tags.get("sidewalk:both"))
    left = tags.get("sidewalk:left", "no") not in ("no", "separate", "none")
    right = tags.get("sidewalk:right", "no") not in ("no", "separate", "none")
    if said in ("both", "yes") or (said is None and usual and not (left or right) and "sidewalk:left" not in tags):
        left = right = True
    elif said in ("left", "right"):
        left, right = said == "left", said == "right"
    if left and right:
        return [shapely.buffer(line, width / 2 + _SIDEWALK_WIDTH, quad_segs=4)]
    distance = width / 2 + _SIDEWALK_WIDTH
    strips: list[BaseGeometry] = []
    if left:
        strips.append(shapely.buffer(line, distance, single_sided=True))
    if right:
        strips.append(shapely.buffer(line, -distance, single_sided=True))
    return [strip for strip in strips if strip.is_valid and not strip.is_empty]


def _crossings(osm: OsmData, carriageway: BaseGeometry, streets: list[Street], marked: list[OsmWay]) -> list[Crossing]:
    """Crossings drawn as ways, cut at the kerbs; then those that are points only, square to their street."""
    kinds = {node.id: node.tags for node in osm.nodes if node.tags.get("highway") == "crossing"}
    found: list[Crossing] = []
    shapely.prepare(carriageway)
    for way in marked:
        node_tags = next((kinds[n] for n in way.nodes if n in kinds), {})
        look = _marking({**node_tags, **way.tags}, "unmarked")
        width = min(max(number(way.tags.get("width")) or _CROSSING_WIDTH, 2.0), 8.0)
        for piece in shapely.get_parts(shapely.intersection(LineString(way.line), carriageway)):
            if isinstance(piece, LineString) and 2.0 < piece.length < 40.0:
                (ax, ay), (bx, by) = piece.coords[0], piece.coords[-1]
                found.append(Crossing((ax, ay), (bx, by), width, *look))
    middles = np.array([((c.start[0] + c.end[0]) / 2, (c.start[1] + c.end[1]) / 2) for c in found]).reshape(-1, 2)
    by_node: dict[int, Street] = {}
    lines = {street.way: street for street in streets}
    for way in osm.ways:
        if way.id in lines:
            for ref in way.nodes:
                by_node.setdefault(ref, lines[way.id])
    for node in osm.nodes:
        if node.id not in kinds or node.id not in by_node:
            continue
        if len(middles) and np.hypot(*(middles - node.xy).T).min() < 6.0:
            continue
        street = by_node[node.id]
        k = int(np.hypot(*(street.line - node.xy).T).argmin())
        along = street.line[min(k + 1, len(street.line) - 1)] - street.line[max(k - 1, 0)]
        along = along / max(float(np.hypot(*along)), 1e-9)
        across = np.array([-along[1], along[0]]) * (street.width / 2)
        a, b = node.xy - across, node.xy + across
        look = _marking(kinds[node.id], "zebra")
        found.append(Crossing((float(a[0]), float(a[1])), (float(b[0]), float(b[1])), _CROSSING_WIDTH, *look))
    return found


_MARKINGS = {
    **dict.fromkeys(("lines", "lines:paired", "lines:rainbow"), "lines"),
    **dict.fromkeys(("dashes", "dashes:paired"), "dashes"),
    **dict.fromkeys(("dots", "dots:paired", "pictograms"), "dots"),
    **dict.fromkeys(("ladder", "ladder:skewed", "ladder:paired"), "ladder"),
}


def _marking(tags: Mapping[str, str], usual: str) -> tuple[bool, str, bool]:
    """Whether a crossing is painted, how, and whether it has signals."""
    said, kind = tags.get("crossing:markings"), tags.get("crossing", usual)
    signals = kind == "traffic_signals" or tags.get("crossing:signals", "no") != "no"
    painted = said != "no" if said is not None else kind not in ("unmarked", "no", "informal")
    return painted, _MARKINGS.get(said or "", "zebra"), signals
