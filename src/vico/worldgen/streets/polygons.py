"""Street polygons from OpenStreetMap ways: carriageways, sidewalks, crossings and squares.

OpenStreetMap draws streets as lines. Their widths come from `width`, else from lanes, class and parking lanes. Ways
and areas take strips of ground, by what they are for; crossings are drawn as ways, or are points. The polygons are
what the ground is painted by, what walkers may walk on, and where crossings lie, so that all agree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmArea, OsmData, OsmWay, means_area
from vico.geo.overlay import polygons_of
from vico.geo.quantities import quantity
from vico.geometry import distances
from vico.worldgen.facts.fault_isolation import NamedShape, drop_on_failure, named_parts, overlay_named, union_named
from vico.worldgen.facts.site import SiteFacts, is_bridge, on_the_ground
from vico.worldgen.facts.street_habits import street_habits
from vico.worldgen.facts.streets import (
    DRIVABLE,
    PAVINGS,
    Crossing,
    Street,
    StreetPolygons,
    carriageway_width,
    is_oneway,
    lane_count,
)

_CROSSING_WIDTH = 3.6


def crossings_of(
    osm: OsmData, carriageway: BaseGeometry, streets: list[Street], marked: list[OsmWay]
) -> list[Crossing]:
    """Crossings drawn as ways, cut at the kerbs; then those that are points only, square to their street."""
    kinds = {node.id: node.tags for node in osm.nodes if node.tags.get("highway") == "crossing"}
    found: list[Crossing] = []
    with_signals = street_habits(osm).markings.signal_crossing
    shapely.prepare(carriageway)
    for way in marked:
        node_tags = next((kinds[n] for n in way.nodes if n in kinds), {})
        look = _marking({**node_tags, **way.tags}, "unmarked", with_signals)
        width = min(max(quantity(way.tags, "width") or _CROSSING_WIDTH, 2.0), 8.0)
        with drop_on_failure(f"w{way.id}"):
            for piece in shapely.get_parts(overlay.intersection(LineString(way.line), carriageway)):
                if isinstance(piece, LineString) and 2.0 < piece.length < 40.0:
                    (ax, ay), (bx, by) = piece.coords[0], piece.coords[-1]
                    found.append(Crossing((ax, ay), (bx, by), width, *look, id=f"w{way.id}"))
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
        if len(middles) and distances(middles, node.xy).min() < 6.0:
            continue
        street = by_node[node.id]
        k = int(distances(street.line, node.xy).argmin())
        along = street.line[min(k + 1, len(street.line) - 1)] - street.line[max(k - 1, 0)]
        along = along / max(float(np.hypot(*along)), 1e-9)
        across = np.array([-along[1], along[0]]) * (street.width / 2)
        a, b = node.xy - across, node.xy + across
        look = _marking(kinds[node.id], "zebra", with_signals)
        start, end = (float(a[0]), float(a[1])), (float(b[0]), float(b[1]))
        found.append(Crossing(start, end, _CROSSING_WIDTH, *look, id=f"n{node.id}"))
    return found


_MARKINGS = {
    **dict.fromkeys(("lines", "lines:paired", "lines:rainbow"), "lines"),
    **dict.fromkeys(("dashes", "dashes:paired"), "dashes"),
    **dict.fromkeys(("dots", "dots:paired", "pictograms"), "dots"),
    **dict.fromkeys(("ladder", "ladder:skewed", "ladder:paired"), "ladder"),
}


def _marking(tags: Mapping[str, str], usual: str, with_signals: str) -> tuple[bool, str, bool]:
    """Whether a crossing is painted, how (`with_signals` if it has some and the map is silent), and whether it has."""
    said, kind = tags.get("crossing:markings"), tags.get("crossing", usual)
    signals = kind == "traffic_signals" or tags.get("crossing:signals", "no") != "no"
    painted = said != "no" if said is not None else kind not in ("unmarked", "no", "informal")
    silent = said in (None, "yes") and tags.get("crossing_ref") != "zebra"
    return painted, with_signals if signals and silent else _MARKINGS.get(said or "", "zebra"), signals


_SIDEWALK_WIDTH = 2.6
_TRAM_REACH = 3.0  # metres from a street's centre line within which tram tracks run in it
_SQUARES = ("pedestrian", "footway", "platform", "living_street")
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


@dataclass
class Strips:
    """Ground that a map gives to vehicles, walkers and others, each strip under the id of its way or area.

    Strips of one kind overlap, and kinds each other.

    Attributes
    ----------
    drive
        Carriageways; `kerbed` those between kerbs, `through` those that lead through buildings.
    walk, loose, cycle, stairs
        Sidewalks and paved footways, unpaved ones, tracks for bicycles, stairs.
    square, car_park
        Squares and pedestrian streets, open car parks.
    paved
        Strips by what the map says they are paved with, across kinds.
    streets
        Drivable ways and what is painted on them.
    rails
        Centre lines of tram tracks, metres.
    crossings
        Ways that are crossings.
    """

    drive: list[NamedShape] = field(default_factory=list)
    kerbed: list[NamedShape] = field(default_factory=list)
    through: list[NamedShape] = field(default_factory=list)
    walk: list[NamedShape] = field(default_factory=list)
    loose: list[NamedShape] = field(default_factory=list)
    cycle: list[NamedShape] = field(default_factory=list)
    stairs: list[NamedShape] = field(default_factory=list)
    square: list[NamedShape] = field(default_factory=list)
    car_park: list[NamedShape] = field(default_factory=list)
    paved: dict[str, list[NamedShape]] = field(default_factory=dict)
    streets: list[Street] = field(default_factory=list)
    rails: list[NDArray[np.float64]] = field(default_factory=list)
    crossings: list[OsmWay] = field(default_factory=list)

    def add(self, other: Strips) -> None:
        """Add the strips of another."""
        for name in (one.name for one in fields(self) if one.name != "paved"):
            getattr(self, name).extend(getattr(other, name))
        for paving, shapes in other.paved.items():
            self.paved.setdefault(paving, []).extend(shapes)


def _strips_of_way(way: OsmWay, trams: shapely.STRtree) -> Strips:
    """Return the strips of a way at ground level."""
    strips = Strips()
    if way.tags.get("railway") == "tram":
        strips.rails.append(way.line)
    kind = way.tags.get("highway")
    if kind is None:
        return strips
    line = LineString(way.line)
    if kind in DRIVABLE:
        _add_carriageway(strips, way, line, tracks=bool(len(trams.query(line, "dwithin", _TRAM_REACH))))
    elif kind in ("pedestrian", "platform"):
        wide = max(quantity(way.tags, "width") or 5.0, 2.0)
        strip = NamedShape(f"w{way.id}", overlay.buffer(line, wide / 2, quad_segs=4))
        strips.square.append(strip)
        _note_paving(strips.paved, way.tags, strip)
    elif kind in _FOOT_WIDTH:
        _add_footway(strips, way, line)
    return strips


def _add_carriageway(strips: Strips, way: OsmWay, line: LineString, *, tracks: bool) -> None:
    """Add a drivable way with the sidewalks beside it."""
    tags, name = way.tags, f"w{way.id}"
    width = carriageway_width(tags)
    strip = NamedShape(name, overlay.buffer(line, width / 2, quad_segs=4))
    strips.drive.append(strip)
    _note_paving(strips.paved, tags, strip)
    if tags.get("tunnel") == "building_passage" or tags.get("covered", "no") != "no":
        strips.through.append(strip)
    sides = _sidewalk_strips(line, width, tags)
    if _is_kerbed(tags, sidewalks=bool(sides)):
        strips.kerbed.append(strip)
    strips.streets.append(_street_of_way(way, width, tracks))
    strips.walk += named_parts(name, sides)
    if is_bridge(tags):
        strips.walk.append(NamedShape(name, overlay.buffer(line, width / 2 + _LEDGE, cap_style="flat")))


def _is_kerbed(tags: Mapping[str, str], *, sidewalks: bool) -> bool:
    """Whether a carriageway lies between kerbs."""
    kind = tags["highway"]
    bordered = sidewalks or _has_mapped_sidewalk(tags) or kind in ("primary", "trunk", "secondary", "busway")
    return bordered and tags.get("surface") not in _LOOSE and kind not in ("service", "living_street")


def _add_footway(strips: Strips, way: OsmWay, line: LineString) -> None:
    """Add a way for walkers or bicycles; crossings are cut at the kerbs later."""
    tags, kind = way.tags, way.tags["highway"]
    if tags.get("footway") == "crossing" or tags.get("cycleway") == "crossing":
        strips.crossings.append(way)
        return
    width = quantity(tags, "width") or (2.6 if tags.get("footway") == "sidewalk" else _FOOT_WIDTH[kind])
    strip = NamedShape(f"w{way.id}", overlay.buffer(line, min(max(width, 1.4), 12.0) / 2, quad_segs=3))
    unpaved = tags.get("surface") in _LOOSE or (kind in ("path", "track") and "surface" not in tags)
    _note_paving(strips.paved, tags, strip)
    others = {"steps": strips.stairs, "cycleway": strips.cycle}
    others.get(kind, strips.loose if unpaved else strips.walk).append(strip)


def _strips_of_area(area: OsmArea) -> Strips:
    """Return the strips of an area at ground level that is no building."""
    strips, shape = Strips(), NamedShape(area.id, area.polygon)
    tags = area.tags
    kind = tags.get("highway") or tags.get("area:highway")
    if kind in _SQUARES or (kind is None and _is_square(tags)):
        strips.square.append(shape)
    elif kind in DRIVABLE:
        strips.drive.append(shape)
    elif kind == "steps":
        strips.stairs.append(shape)
    elif tags.get("amenity") == "parking" and tags.get("parking", "surface") in ("surface", "lane", "street_side"):
        strips.car_park.append(shape)
    else:
        return strips
    _note_paving(strips.paved, tags, shape)
    return strips


def _is_square(tags: Mapping[str, str]) -> bool:
    """Whether an area is a square or a platform, though no `highway` says so."""
    return tags.get("place") == "square" or "platform" in (tags.get("railway"), tags.get("public_transport"))


def _note_paving(paved: dict[str, list[NamedShape]], tags: Mapping[str, str], shape: NamedShape) -> None:
    """Remember where the map says what the ground is paved with."""
    name = _paving(tags)
    if name is not None:
        paved.setdefault(name, []).append(shape)


def _paving(tags: Mapping[str, str]) -> str | None:
    """Return what the map says that the ground is paved with."""
    return PAVINGS.get(tags.get("surface", "").split(";")[0])


def _has_mapped_sidewalk(tags: Mapping[str, str]) -> bool:
    """Whether the map says that there is a sidewalk, drawn as a way of its own perhaps."""
    keys = ("sidewalk", "sidewalk:both", "sidewalk:left", "sidewalk:right")
    return any(tags.get(key, "no") not in ("no", "none") for key in keys)


_STANDING = {"parallel": 2.0, "lane": 2.0, "street_side": 2.2, "diagonal": 4.2, "perpendicular": 4.8}


def _street_of_way(way: OsmWay, width: float, tracks: bool) -> Street:
    """Make a street with what is painted along it, turned round where traffic runs against the way."""
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
        setts=_paving(tags) == "setts",
    )


def _sidewalk_strips(line: LineString, width: float, tags: Mapping[str, str]) -> list[BaseGeometry]:
    """Make strips beside a carriageway; where OSM says nothing, on both sides of classes that have them in towns."""
    usual = DRIVABLE[tags["highway"]].sidewalks
    said = tags.get("sidewalk", tags.get("sidewalk:both"))
    left = tags.get("sidewalk:left", "no") not in ("no", "separate", "none")
    right = tags.get("sidewalk:right", "no") not in ("no", "separate", "none")
    if said in ("both", "yes") or (said is None and usual and not (left or right) and "sidewalk:left" not in tags):
        left = right = True
    elif said in ("left", "right"):
        left, right = said == "left", said == "right"
    if left and right:
        return [overlay.buffer(line, width / 2 + _SIDEWALK_WIDTH, quad_segs=4)]
    distance = width / 2 + _SIDEWALK_WIDTH
    strips: list[BaseGeometry] = []
    if left:
        strips.append(overlay.buffer(line, distance, single_sided=True))
    if right:
        strips.append(overlay.buffer(line, -distance, single_sided=True))
    return [strip for strip in strips if strip.is_valid and not strip.is_empty]


_KERB_RADIUS = 2.0
#: Ground between paved surfaces that is narrower than this is paved, metres: lines that were drawn one by one leave it,
#: and it would end in knives' points.
_NARROW = 1.0
_LEAST_GAP = 0.02  # square metres
_LEAST_CORNER = 0.05  # square metres
_BESIDE = 0.05  # metres from a strip within which an outline is its edge
#: How its outline is offset: right angles stay, what is more pointed is cut off.
_BLUNT = {"join_style": "mitre", "mitre_limit": 1.5}
_GRID = 0.001  # metres: overlays on a grid are robust where free ones fail on nearly coincident outlines


def road_polygons(site: SiteFacts, obstacles: Sequence[NamedShape] = ()) -> StreetPolygons:
    """Turn the streets of an OSM extract into polygons.

    Parameters
    ----------
    site
        The extract, local metres, and which of its ways pass above others.
    obstacles
        Footprints of buildings that stand on the ground, under their ids: no sidewalk or square runs under them, and
        carriageways only where a way leads through.

    Returns
    -------
    StreetPolygons
        Clipped to the extract's window and margin.
    """
    reach = site.osm.half + site.osm.margin
    window = shapely.box(-reach, -reach, reach, reach)
    solid = union_named(overlay_named(obstacles, overlay.make_valid), grid=_GRID) if len(obstacles) else MultiPolygon()
    # What lies under the ground or above a street has no strips.
    strips = Strips()
    trams = [
        LineString(way.line) for way in site.osm.ways if way.tags.get("railway") == "tram" and on_the_ground(way.tags)
    ]
    tram_tree = shapely.STRtree(trams)
    for way in site.osm.ways:
        if on_the_ground(way.tags) and not (way.closed and means_area(way.tags)) and way.id not in site.levels.above:
            with drop_on_failure(f"w{way.id}"):
                strips.add(_strips_of_way(way, tram_tree))
    for area in site.osm.areas:
        if on_the_ground(area.tags) and area.tags.get("building", "no") == "no":
            with drop_on_failure(area.id):
                strips.add(_strips_of_area(area))
    driven = union_named(strips.drive, grid=_GRID)
    carriageway = _carriageway(driven, strips.through, solid, window)
    crossings = crossings_of(site.osm, carriageway, strips.streets, strips.crossings)
    left = _Unclaimed(overlay.union(carriageway, solid, grid=_GRID), window)
    steps = left.claim(strips.stairs)
    # A square that is mapped as an area wins over the sidewalks drawn across it.
    pedestrian = left.claim(strips.square)
    cycleway = left.claim(strips.cycle)
    sidewalk = left.claim(strips.walk)
    path = left.claim(strips.loose)
    parking = left.claim(strips.car_park)
    sidewalk = left.claim_gaps(sidewalk)
    return StreetPolygons(
        carriageway=_multi(carriageway),
        sidewalk=sidewalk,
        crossing=_multi(
            overlay.intersection(union_named([NamedShape(c.id, c.polygon) for c in crossings]), carriageway)
        ),
        pedestrian=pedestrian,
        path=path,
        cycleway=cycleway,
        steps=steps,
        parking=parking,
        streets=strips.streets,
        crossings=crossings,
        rails=strips.rails,
        sunken=_sunken(strips.kerbed, carriageway),
        paved={
            name: _multi(overlay.intersection(_multi(union_named(shapes, grid=_GRID)), window))
            for name, shapes in sorted(_with_corners(strips, driven, carriageway).items())
        },
    )


def _carriageway(driven: BaseGeometry, through: list[NamedShape], solid: BaseGeometry, window: Polygon) -> MultiPolygon:
    """Carriageways in one, without what lies under buildings except where a way leads `through`."""
    # Closing the outline rounds the inner corners of junctions the way kerbs do.
    carriageway = overlay.buffer(overlay.buffer(driven, _KERB_RADIUS, quad_segs=4), -_KERB_RADIUS, quad_segs=4)
    carriageway = overlay.on_grid(overlay.simplify(carriageway, 0.08), grid=_GRID)
    if not solid.is_empty:
        under = overlay.difference(solid, union_named(through, grid=_GRID), grid=_GRID)
        carriageway = overlay.difference(carriageway, under, grid=_GRID)
    return _multi(overlay.intersection(_multi(carriageway), window, grid=_GRID))


def _with_corners(strips: Strips, driven: BaseGeometry, carriageway: BaseGeometry) -> dict[str, list[NamedShape]]:
    """Return strips by paving; what of carriageways is of no street is paved as most of the streets around it are."""
    corners = polygons_of(overlay.difference(carriageway, driven, grid=_GRID), _LEAST_CORNER)
    if not strips.paved or not corners:
        return strips.paved
    said = {id(strip): name for name, shapes in strips.paved.items() for strip in shapes}
    pavings = ["", *sorted(strips.paved)]
    paving = np.array([pavings.index(said.get(id(strip), "")) for strip in strips.drive])
    # A point each half metre of outlines counts for each strip that it lies beside.
    points, owner = shapely.get_coordinates(shapely.segmentize(shapely.boundary(corners), 0.5), return_index=True)
    tree = shapely.STRtree([strip.shape for strip in strips.drive])
    at, beside = tree.query(shapely.points(points), predicate="dwithin", distance=_BESIDE)
    counts = np.zeros((len(corners), len(pavings)), np.int64)
    np.add.at(counts, (owner[at], paving[beside]), 1)
    found = {name: list(shapes) for name, shapes in strips.paved.items()}
    for corner, most in zip(corners, counts.argmax(axis=1).tolist(), strict=True):
        if most:
            found[pavings[most]].append(NamedShape("carriageway", corner))
    return found


class _Unclaimed:
    """Ground that no kind of surface has claimed yet."""

    def __init__(self, taken: BaseGeometry, window: Polygon) -> None:
        self._taken, self._window = taken, window

    def claim(self, shapes: list[NamedShape]) -> MultiPolygon:
        """Claim what is left of `shapes` beside what was claimed before."""
        shape = overlay.simplify(union_named(shapes, grid=_GRID), 0.08)
        shape = overlay.intersection(overlay.on_grid(shape, grid=_GRID), self._window, grid=_GRID)
        left = _multi(overlay.difference(_multi(shape), self._taken, grid=_GRID), 0.3)
        self._taken = overlay.union(self._taken, left, grid=_GRID)
        return left

    def claim_gaps(self, walk: MultiPolygon) -> MultiPolygon:
        """Claim what is narrow between all that was claimed and lies beside a walk; return the walk with it."""
        closed = overlay.buffer(overlay.buffer(self._taken, _NARROW / 2, **_BLUNT), -_NARROW / 2, **_BLUNT)
        inside = overlay.intersection(_multi(closed), self._window, grid=_GRID)
        gaps = np.array(polygons_of(overlay.difference(inside, self._taken, grid=_GRID), _LEAST_GAP), object)
        shapely.prepare(walk)
        beside = gaps[shapely.dwithin(walk, gaps, 2 * _GRID)] if len(gaps) else gaps
        if not len(beside):
            return walk
        self._taken = overlay.union_all([self._taken, *beside], grid=_GRID)
        return _multi(overlay.union_all([walk, *beside], grid=_GRID))


def _sunken(kerbed: list[NamedShape], carriageway: BaseGeometry) -> MultiPolygon:
    """Return the kerbed part of the carriageways, the rounded corners of their junctions with it."""
    if not kerbed:
        return MultiPolygon()
    shape = union_named(kerbed, grid=_GRID)
    shape = overlay.buffer(overlay.buffer(shape, 2 * _KERB_RADIUS, quad_segs=3), -2 * _KERB_RADIUS + 0.1, quad_segs=3)
    return _multi(overlay.intersection(_multi(overlay.on_grid(shape, grid=_GRID)), carriageway, grid=_GRID))


def _multi(shape: BaseGeometry, least: float = 0.05) -> MultiPolygon:
    return MultiPolygon(polygons_of(shape, least))
