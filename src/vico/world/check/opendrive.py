"""Rules of OpenDRIVE files: what strict readers refuse, or drive through wrongly.

The rules are those of ASAM OpenDRIVE 1.4 and of its checker that roads of one lane section can break.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import pairwise
from xml.etree.ElementTree import Element

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import ParseError, fromstring

from vico.errors import SchemaError
from vico.world.check.finding import WorldFinding
from vico.world.city_files import XODR
from vico.world.opendrive import (
    beside,
    elevation,
    end_section,
    lane_borders,
    lanes_of,
    polynomial,
    reference_line,
    wrapped,
)
from vico.world.world import World

_SHORTEST = 0.1  # metres of a road
_ALONG = 1e-3  # metres that lengths may differ
_APART = 0.02  # metres that ends which meet may be apart
_KINK = 0.05  # radians between curves that follow one another
_ORDER = ["link", "type", "planView", "elevationProfile", "lateralProfile", "lanes", "objects", "signals"]
_TOP = ["header", "road", "controller", "junction", "junctionGroup", "station"]

_Roads = Mapping[str, Element]


def check_opendrive(world: World) -> Iterator[WorldFinding]:
    """Check that the world's OpenDRIVE file keeps the rules of the standard."""
    try:
        root = fromstring(world.file(XODR).read_bytes(), forbid_dtd=True)
    except (ParseError, DefusedXmlException, OSError) as error:
        raise SchemaError(f"{XODR}: not readable ({error}); build the world anew") from None
    yield from opendrive_findings(root)


def opendrive_findings(root: Element) -> Iterator[WorldFinding]:
    """Check an OpenDRIVE file.

    Parameters
    ----------
    root
        Its outermost element.

    Yields
    ------
    WorldFinding
        Each rule that is broken, with the road, junction or controller.

    Raises
    ------
    SchemaError
        If a road has a geometry that is neither a line nor a parametric cubic, or lacks its lanes.
    """
    yield from _header(root)
    for kind in ("road", "junction", "controller"):
        names = Counter(element.get("id") for element in root.findall(kind))
        for name in (name for name, many in names.items() if many > 1):
            yield WorldFinding("opendrive ids", f"{kind} {name}", "its id is there more than once")
    roads = {str(road.get("id")): road for road in root.findall("road")}
    for road in roads.values():
        broken = list(_line(road))
        yield from broken
        if not broken:
            yield from _lanes(road)
            yield from _profile(road)
            yield from _things(road)
    yield from _links(root, roads)
    signals = {signal.get("id") for signal in root.iter("signal")}
    for controller in root.findall("controller"):
        if any(control.get("signalId") not in signals for control in controller.findall("control")):
            yield WorldFinding("opendrive signals", f"controller {controller.get('id')}", "a signal of it is not there")


def _found(rule: str, road: Element, what: str) -> WorldFinding:
    start = road.find("planView/geometry")
    at = None if start is None else (float(start.get("x", "nan")), float(start.get("y", "nan")))
    return WorldFinding(f"opendrive {rule}", f"road {road.get('id')}", what, at)


def _ordered(element: Element, order: list[str]) -> bool:
    places = [order.index(child.tag) if child.tag in order else -1 for child in element]
    return -1 not in places and places == sorted(places)


def _header(root: Element) -> Iterator[WorldFinding]:
    header = root.find("header")
    if header is None:
        yield WorldFinding("opendrive header", XODR, "it has no header")
        return
    names = ("north", "south", "east", "west", "revMajor", "revMinor")
    if missing := [name for name in names if name not in header.attrib]:
        yield WorldFinding("opendrive header", XODR, f"it lacks {', '.join(missing)}")
    elif float(header.get("north", 0)) <= float(header.get("south", 0)) or float(header.get("east", 0)) <= float(
        header.get("west", 0)
    ):
        yield WorldFinding("opendrive header", XODR, "its bounds are empty")
    if "+proj" not in (header.findtext("geoReference") or ""):
        yield WorldFinding("opendrive header", XODR, "it does not say where on Earth it lies (geoReference)")
    if not _ordered(root, _TOP):
        yield WorldFinding("opendrive order", XODR, f"its elements are not in the order {', '.join(_TOP)}")


def _line(road: Element) -> Iterator[WorldFinding]:
    """Check a road's reference line: as long as it says, in one piece, without kinks."""
    length = float(road.get("length", "nan"))
    if not length >= _SHORTEST:
        yield _found("length", road, f"it is {length:.2f} m long")
    if not _ordered(road, _ORDER):
        yield _found("order", road, f"its elements are not in the order {', '.join(_ORDER)}")
    curves, along = reference_line(road), 0.0
    for curve, geometry in zip(curves, road.iterfind("planView/geometry"), strict=True):
        own = float(geometry.get("length", "nan"))
        if not (own > 0.0 and abs(curve.length - own) < _ALONG):
            yield _found("length", road, f"a curve of {curve.length:.2f} m says that it is {own:.2f} m long")
        if not abs(float(geometry.get("s", "nan")) - along) < _ALONG:
            yield _found("length", road, f"a curve that begins at {along:.2f} m says {geometry.get('s')}")
        along += own
    if not abs(along - length) < _ALONG:
        yield _found("length", road, f"its curves are {along:.2f} m long, and it says {length:.2f}")
    for a, b in pairwise(curves):
        (end, heading), (start, there) = a.end(1.0), b.end(0.0)
        if math.hypot(*(start - end)) > _APART or abs(wrapped(there - heading)) > _KINK:
            yield _found("line", road, "two of its curves do not meet, or meet at an angle")


def _lanes(road: Element) -> Iterator[WorldFinding]:
    """Check the lanes of a road: numbered from the middle, each with a width."""
    length = float(road.get("length", "nan"))
    sections = road.findall("lanes/laneSection")
    if not sections or float(sections[0].get("s", "nan")) != 0.0:
        yield _found("lanes", road, "no lane section begins where it begins")
        return
    for section in sections:
        if section.find("center/lane") is None:
            yield _found("lanes", road, "a lane section has no lane in the middle")
        for side, sign in (("left", 1), ("right", -1)):
            lanes = section.findall(f"{side}/lane")
            numbers = sorted(int(lane.get("id", "0")) * sign for lane in lanes)
            if numbers != list(range(1, len(lanes) + 1)):
                yield _found("lanes", road, f"its lanes on the {side} are numbered {[n * sign for n in numbers]}")
            for lane in lanes:
                ends = [polynomial(lane.iterfind("width"), at) for at in (0.0, length)]
                if lane.find("width") is None or not min(ends) >= 0.0:
                    yield _found("lanes", road, f"lane {lane.get('id')} has no width")


def _profile(road: Element) -> Iterator[WorldFinding]:
    """Check the heights along a road: numbers, in order, without steps."""
    length, entries = float(road.get("length", "nan")), road.findall("elevationProfile/elevation")
    places = [float(entry.get("s", "nan")) for entry in entries]
    if not entries or places[0] != 0.0 or places != sorted(set(places)) or places[-1] >= length:
        yield _found("heights", road, "heights do not begin at its start, or are not in order")
    elif not all(math.isfinite(float(entry.get(name, "nan"))) for entry in entries for name in "abcd"):
        yield _found("heights", road, "a height is not a number")
    else:
        for k in range(1, len(entries)):
            step = abs(polynomial(entries[:k], places[k], offset="s") - float(entries[k].get("a", "nan")))
            if step > _APART:
                yield _found("heights", road, f"it has a step of {step:.2f} m at {places[k]:.1f} m")


def _things(road: Element) -> Iterator[WorldFinding]:
    """Check that objects and signals stand on the road, and signals before lanes that it has."""
    length, lanes = float(road.get("length", "nan")), lanes_of(end_section(road, at_end=True))
    for thing in [*road.iterfind("objects/object"), *road.iterfind("signals/signal")]:
        if not 0.0 <= float(thing.get("s", "nan")) <= length:
            yield _found("things", road, f"{thing.get('id')} stands beyond its end")
        for valid in thing.iterfind("validity"):
            if not {int(valid.get("fromLane", "0")), int(valid.get("toLane", "0"))} <= {0, *lanes}:
                yield _found("things", road, f"{thing.get('id')} is for a lane that is not there")


def _links(root: Element, roads: _Roads) -> Iterator[WorldFinding]:
    """Check that what roads and junctions name is there, and that lanes which are linked meet."""
    junctions = {str(junction.get("id")) for junction in root.findall("junction")}
    for road in roads.values():
        for way in ("predecessor", "successor"):
            link = road.find(f"link/{way}")
            if link is None:
                continue
            kind, name = str(link.get("elementType")), str(link.get("elementId"))
            if name not in (roads if kind == "road" else junctions):
                yield _found("link", road, f"its {way} is the {kind} {name}, which is not there")
            elif kind == "road":
                yield from _meets(road, way, roads[name], link)
    for junction in root.findall("junction"):
        name, connections = str(junction.get("id")), junction.findall("connection")
        if not connections:
            yield WorldFinding("opendrive link", f"junction {name}", "it has no connection")
        for connection in connections:
            if fault := _connection(name, connection, roads):
                yield WorldFinding("opendrive link", f"junction {name}", f"connection {connection.get('id')}: {fault}")


def _connection(junction: str, connection: Element, roads: _Roads) -> str | None:
    """Return what is wrong with a connection of a junction."""
    road, inside = (roads.get(str(connection.get(name))) for name in ("incomingRoad", "connectingRoad"))
    if road is None or inside is None:
        return "a road of it is not there"
    if inside.get("junction") != junction:
        return "its connecting road is of another junction"
    ends = [road.find(f"link/{way}") for way in ("predecessor", "successor")]
    if not any(end is not None and end.get("elementId") == junction for end in ends):
        return "the road that leads to it does not name the junction"
    links, at_end = connection.findall("laneLink"), connection.get("contactPoint") == "end"
    here = lanes_of(end_section(inside, at_end=at_end))
    there = {lane for last in (False, True) for lane in lanes_of(end_section(road, at_end=last))}
    if not links or any(int(k.get("from", "0")) not in there or int(k.get("to", "0")) not in here for k in links):
        return "it links no lanes, or lanes that are not there"
    return None


def _meets(road: Element, way: str, other: Element, link: Element) -> Iterator[WorldFinding]:
    """Check that a road's lanes end where those begin that they are linked to in another road."""
    own, theirs = way == "successor", link.get("contactPoint") == "end"
    mine, their = lane_borders(road, at_end=own), lane_borders(other, at_end=theirs)
    (here, heading, level), (there, heading_there, level_there) = (_end(road, last=own), _end(other, last=theirs))
    if abs(level - level_there) > _APART:
        yield _found("link", road, f"it ends {abs(level - level_there):.2f} m above or below road {other.get('id')}")
    for number, lane in lanes_of(end_section(road, at_end=own)).items():
        for joined in lane.iterfind(f"link/{way}"):
            target = int(joined.get("id", "0"))
            if target not in their:
                yield _found("link", road, f"lane {number} leads to lane {target} of {other.get('id')}, not there")
                continue
            # The other's left is this one's right where they meet head to head.
            borders = their[target] if own != theirs else their[target][::-1]
            gaps = [
                math.hypot(*(beside(here, heading, a) - beside(there, heading_there, b)))
                for a, b in zip(mine[number], borders, strict=True)
            ]
            if max(gaps) > _APART:
                yield _found("link", road, f"lane {number} ends {max(gaps):.2f} m beside lane {target}")


def _end(road: Element, *, last: bool) -> tuple[np.ndarray, float, float]:
    """Return where a road begins or ends, its heading there and its height."""
    curves = reference_line(road)
    point, heading = curves[-1].end(1.0) if last else curves[0].end(0.0)
    return point, heading, elevation(road, float(road.get("length", "nan")) if last else 0.0)
