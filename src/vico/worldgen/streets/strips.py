"""Strips of ground that ways and areas of a map take, by what they are for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmArea, OsmWay, means_area
from vico.geo.quantities import quantity
from vico.worldgen.facts.fault_isolation import NamedShape, drop_on_failure, named_parts
from vico.worldgen.facts.site import SiteFacts, is_bridge, on_the_ground
from vico.worldgen.facts.streets import DRIVABLE, PAVINGS, Street, carriageway_width, is_oneway, lane_count

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


def strips_of(site: SiteFacts) -> Strips:
    """Gather the strips of a map, without what lies under the ground or above a street."""
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
    return strips


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
    sides = _sidewalks(line, width, tags)
    if _is_kerbed(tags, sidewalks=bool(sides)):
        strips.kerbed.append(strip)
    strips.streets.append(_street(way, width, tracks))
    strips.walk += named_parts(name, sides)
    if is_bridge(tags):
        strips.walk.append(NamedShape(name, overlay.buffer(line, width / 2 + _LEDGE, cap_style="flat")))


def _is_kerbed(tags: Mapping[str, str], *, sidewalks: bool) -> bool:
    """Whether a carriageway lies between kerbs."""
    kind = tags["highway"]
    bordered = sidewalks or _said_sidewalk(tags) or kind in ("primary", "trunk", "secondary", "busway")
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


def _said_sidewalk(tags: Mapping[str, str]) -> bool:
    """Whether the map says that there is a sidewalk, drawn as a way of its own perhaps."""
    keys = ("sidewalk", "sidewalk:both", "sidewalk:left", "sidewalk:right")
    return any(tags.get(key, "no") not in ("no", "none") for key in keys)


_STANDING = {"parallel": 2.0, "lane": 2.0, "street_side": 2.2, "diagonal": 4.2, "perpendicular": 4.8}


def _street(way: OsmWay, width: float, tracks: bool) -> Street:
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


def _sidewalks(line: LineString, width: float, tags: Mapping[str, str]) -> list[BaseGeometry]:
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
