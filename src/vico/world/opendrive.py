"""Roads of OpenDRIVE files: reference lines, cross-sections and profiles, and the rules that a file has to keep.

The format: ASAM OpenDRIVE, https://www.asam.net/standards/detail/opendrive/. Metres, local ENU, radians. Of its kinds
of geometry these are read that roads of a world have: ``line`` and ``paramPoly3``. The rules are those of ASAM
OpenDRIVE 1.4 and of its checker that roads of one lane section can break: what strict readers refuse, or drive
through wrongly.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from xml.etree.ElementTree import Element

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import ParseError, fromstring
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.geometry import direction, rotate, wrap_angle
from vico.world.city import XODR
from vico.world.model import WorldFinding
from vico.world.world import World

Floats = NDArray[np.float64]

# Gauss's nodes and weights on each of some parts of a curve: lengths to a micrometre.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_PARTS = 16
_AT = ((np.arange(_PARTS)[:, None] + (_NODES + 1) / 2) / _PARTS).ravel()
_SHARE = np.tile(_WEIGHTS / (2 * _PARTS), _PARTS)


@dataclass(frozen=True)
class Curve:
    """A piece of a reference line: a cubic polynomial of a parameter that goes from 0 to 1.

    Attributes
    ----------
    coefficients
        Of 1, p, p² and p³, east and north, metres, shape ``(4, 2)``; the last two are nought of a straight line.
    """

    coefficients: Floats

    @classmethod
    def straight(cls, start: Floats, heading: float, length: float) -> Curve:
        """Return a straight line."""
        step = length * direction(heading)
        return cls(np.array([start, step, (0.0, 0.0), (0.0, 0.0)], np.float64))

    @classmethod
    def between(cls, start: Floats, heading: float, end: Floats, heading_there: float) -> Curve:
        """Return the curve that leaves and arrives in the directions given; nearly an arc where there is one."""
        chord = end - start
        distance = math.hypot(*chord)
        across = math.atan2(chord[1], chord[0])
        tangents = []
        for yaw in (heading, heading_there):
            bend = min(abs(wrap_angle(across - yaw)), math.radians(110.0))
            reach = distance / math.cos(bend / 2) ** 2
            tangents.append(reach * direction(yaw))
        leaving, arriving = tangents
        return cls(np.array([start, leaving, 3 * chord - 2 * leaving - arriving, leaving + arriving - 2 * chord]))

    @classmethod
    def of(cls, geometry: Element) -> Curve:
        """Read a ``geometry`` element.

        Raises
        ------
        SchemaError
            If it is neither a line nor a parametric cubic.
        """
        x, y, heading, length = (float(geometry.get(name, "nan")) for name in ("x", "y", "hdg", "length"))
        cubic = geometry.find("paramPoly3")
        if geometry.find("line") is not None:
            return cls.straight(np.array([x, y]), heading, length)
        if cubic is None:
            kind = geometry[0].tag if len(geometry) else "nothing"
            raise SchemaError(f"OpenDRIVE: geometry of the kind {kind}; there are line and paramPoly3")
        local = np.array([[float(cubic.get(f"{name}{axis}", "nan")) for axis in "UV"] for name in "abcd"])
        if cubic.get("pRange") != "normalized":
            local = local * (length ** np.arange(4))[:, None]
        return cls(rotate(local, heading) + np.array([[x, y], [0, 0], [0, 0], [0, 0]]))

    @property
    def is_straight(self) -> bool:
        """Whether it is a line."""
        return not self.coefficients[2:].any()

    def points(self, p: Floats) -> Floats:
        """Points at parameters, shape ``(n, 2)``."""
        powers = p[:, None] ** np.arange(4)
        return np.asarray((powers[:, :, None] * self.coefficients).sum(axis=1))

    def end(self, p: float) -> tuple[Floats, float]:
        """Point and heading at a parameter."""
        a, b, c, d = self.coefficients
        along = b + 2 * c * p + 3 * d * p**2
        return a + b * p + c * p**2 + d * p**3, math.atan2(along[1], along[0])

    @cached_property
    def length(self) -> float:
        """Metres along it."""
        _, b, c, d = self.coefficients
        if self.is_straight:
            return math.hypot(*b)
        along = b + 2 * c * _AT[:, None] + 3 * d * _AT[:, None] ** 2
        return float((np.hypot(*along.T) * _SHARE).sum())

    def part(self, low: float, high: float) -> Curve:
        """Return what lies between two parameters."""
        a, b, c, d = self.coefficients
        size = high - low
        return Curve(
            np.array(
                [
                    a + b * low + c * low**2 + d * low**3,
                    (b + 2 * c * low + 3 * d * low**2) * size,
                    (c + 3 * d * low) * size**2,
                    d * size**3,
                ]
            )
        )

    def parameter(self, along: float) -> float:
        """Return the parameter so many metres from the start, at most 1."""
        if along >= self.length:
            return 1.0
        if self.is_straight:
            return along / self.length
        low, high = 0.0, 1.0
        for _ in range(30):
            middle = (low + high) / 2
            low, high = (middle, high) if self.part(0.0, middle).length < along else (low, middle)
        return (low + high) / 2


def reference_line(road: Element) -> list[Curve]:
    """Return the curves of a road's reference line, in order.

    Raises
    ------
    SchemaError
        If it has none, or one of a kind that is not read.
    """
    curves = [Curve.of(geometry) for geometry in road.iterfind("planView/geometry")]
    if not curves:
        raise SchemaError(f"OpenDRIVE: road {road.get('id')} has no geometry")
    return curves


def polynomial(entries: Iterable[Element], at: float, *, offset: str = "sOffset") -> float:
    """Return the value at `at` of cubic polynomials that hold from their `offset` on; 0 before the first."""
    value = 0.0
    for entry in entries:
        ds = at - float(entry.get(offset, "nan"))
        if ds < -1e-9:
            break
        a, b, c, d = (float(entry.get(name, "nan")) for name in "abcd")
        value = a + b * ds + c * ds**2 + d * ds**3
    return value


def lanes_of(section: Element) -> dict[int, Element]:
    """Return the lanes beside the middle of a lane section, by id."""
    return {int(lane.get("id", "0")): lane for side in ("left", "right") for lane in section.iterfind(f"{side}/lane")}


def end_section(road: Element, *, at_end: bool) -> Element:
    """Return a road's first or last lane section.

    Raises
    ------
    SchemaError
        If it has none.
    """
    sections = road.findall("lanes/laneSection")
    if not sections:
        raise SchemaError(f"OpenDRIVE: road {road.get('id')} has no lane section")
    return sections[-1 if at_end else 0]


def lane_borders(road: Element, *, at_end: bool) -> dict[int, tuple[float, float]]:
    """Return how far left of the reference line each lane's inner and outer border is at an end of a road, metres."""
    length = float(road.get("length", "nan"))
    section = end_section(road, at_end=at_end)
    along = length if at_end else 0.0
    middle = polynomial(road.iterfind("lanes/laneOffset"), along, offset="s")
    within = along - float(section.get("s", "nan")) if at_end else 0.0
    found: dict[int, tuple[float, float]] = {}
    for sign in (1, -1):
        border = middle
        chosen = [lane for lane in lanes_of(section).items() if lane[0] * sign > 0]
        for number, lane in sorted(chosen, key=lambda lane: abs(lane[0])):
            outer = border + sign * polynomial(lane.iterfind("width"), within)
            found[number] = (border, outer)
            border = outer
    return found


def elevation(road: Element, at: float) -> float:
    """Return the height of a road's reference line, metres."""
    return polynomial(road.iterfind("elevationProfile/elevation"), at, offset="s")


def offset_point(point: Floats, heading: float, left: float) -> Floats:
    """Return the point so many metres left of another."""
    return point + left * np.array([-math.sin(heading), math.cos(heading)])


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
        broken = list(_line_findings(road))
        yield from broken
        if not broken:
            yield from _lanes(road)
            yield from _profile_findings(road)
            yield from _things(road)
    yield from _links(root, roads)
    signals = {signal.get("id") for signal in root.iter("signal")}
    for controller in root.findall("controller"):
        if any(control.get("signalId") not in signals for control in controller.findall("control")):
            yield WorldFinding("opendrive signals", f"controller {controller.get('id')}", "a signal of it is not there")


def _finding(rule: str, road: Element, what: str) -> WorldFinding:
    start = road.find("planView/geometry")
    at = None if start is None else (float(start.get("x", "nan")), float(start.get("y", "nan")))
    return WorldFinding(f"opendrive {rule}", f"road {road.get('id')}", what, at)


def _is_ordered(element: Element, order: list[str]) -> bool:
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
    if not _is_ordered(root, _TOP):
        yield WorldFinding("opendrive order", XODR, f"its elements are not in the order {', '.join(_TOP)}")


def _line_findings(road: Element) -> Iterator[WorldFinding]:
    """Check a road's reference line: as long as it says, in one piece, without kinks."""
    length = float(road.get("length", "nan"))
    if not length >= _SHORTEST:
        yield _finding("length", road, f"it is {length:.2f} m long")
    if not _is_ordered(road, _ORDER):
        yield _finding("order", road, f"its elements are not in the order {', '.join(_ORDER)}")
    curves, along = reference_line(road), 0.0
    for curve, geometry in zip(curves, road.iterfind("planView/geometry"), strict=True):
        own = float(geometry.get("length", "nan"))
        if not (own > 0.0 and abs(curve.length - own) < _ALONG):
            yield _finding("length", road, f"a curve of {curve.length:.2f} m says that it is {own:.2f} m long")
        if not abs(float(geometry.get("s", "nan")) - along) < _ALONG:
            yield _finding("length", road, f"a curve that begins at {along:.2f} m says {geometry.get('s')}")
        along += own
    if not abs(along - length) < _ALONG:
        yield _finding("length", road, f"its curves are {along:.2f} m long, and it says {length:.2f}")
    for a, b in pairwise(curves):
        (end, heading), (start, there) = a.end(1.0), b.end(0.0)
        if math.hypot(*(start - end)) > _APART or abs(wrap_angle(there - heading)) > _KINK:
            yield _finding("line", road, "two of its curves do not meet, or meet at an angle")


def _lanes(road: Element) -> Iterator[WorldFinding]:
    """Check the lanes of a road: numbered from the middle, each with a width."""
    length = float(road.get("length", "nan"))
    sections = road.findall("lanes/laneSection")
    if not sections or float(sections[0].get("s", "nan")) != 0.0:
        yield _finding("lanes", road, "no lane section begins where it begins")
        return
    for section in sections:
        if section.find("center/lane") is None:
            yield _finding("lanes", road, "a lane section has no lane in the middle")
        for side, sign in (("left", 1), ("right", -1)):
            lanes = section.findall(f"{side}/lane")
            numbers = sorted(int(lane.get("id", "0")) * sign for lane in lanes)
            if numbers != list(range(1, len(lanes) + 1)):
                yield _finding("lanes", road, f"its lanes on the {side} are numbered {[n * sign for n in numbers]}")
            for lane in lanes:
                ends = [polynomial(lane.iterfind("width"), at) for at in (0.0, length)]
                if lane.find("width") is None or not min(ends) >= 0.0:
                    yield _finding("lanes", road, f"lane {lane.get('id')} has no width")


def _profile_findings(road: Element) -> Iterator[WorldFinding]:
    """Check the heights along a road: numbers, in order, without steps."""
    length, entries = float(road.get("length", "nan")), road.findall("elevationProfile/elevation")
    places = [float(entry.get("s", "nan")) for entry in entries]
    if not entries or places[0] != 0.0 or places != sorted(set(places)) or places[-1] >= length:
        yield _finding("heights", road, "heights do not begin at its start, or are not in order")
    elif not all(math.isfinite(float(entry.get(name, "nan"))) for entry in entries for name in "abcd"):
        yield _finding("heights", road, "a height is not a number")
    else:
        for k in range(1, len(entries)):
            step = abs(polynomial(entries[:k], places[k], offset="s") - float(entries[k].get("a", "nan")))
            if step > _APART:
                yield _finding("heights", road, f"it has a step of {step:.2f} m at {places[k]:.1f} m")


def _things(road: Element) -> Iterator[WorldFinding]:
    """Check that objects and signals stand on the road, and signals before lanes that it has."""
    length, lanes = float(road.get("length", "nan")), lanes_of(end_section(road, at_end=True))
    for thing in [*road.iterfind("objects/object"), *road.iterfind("signals/signal")]:
        if not 0.0 <= float(thing.get("s", "nan")) <= length:
            yield _finding("things", road, f"{thing.get('id')} stands beyond its end")
        for valid in thing.iterfind("validity"):
            if not {int(valid.get("fromLane", "0")), int(valid.get("toLane", "0"))} <= {0, *lanes}:
                yield _finding("things", road, f"{thing.get('id')} is for a lane that is not there")


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
                yield _finding("link", road, f"its {way} is the {kind} {name}, which is not there")
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
        yield _finding("link", road, f"it ends {abs(level - level_there):.2f} m above or below road {other.get('id')}")
    for number, lane in lanes_of(end_section(road, at_end=own)).items():
        for joined in lane.iterfind(f"link/{way}"):
            target = int(joined.get("id", "0"))
            if target not in their:
                yield _finding("link", road, f"lane {number} leads to lane {target} of {other.get('id')}, not there")
                continue
            # The other's left is this one's right where they meet head to head.
            borders = their[target] if own != theirs else their[target][::-1]
            gaps = [
                math.hypot(*(offset_point(here, heading, a) - offset_point(there, heading_there, b)))
                for a, b in zip(mine[number], borders, strict=True)
            ]
            if max(gaps) > _APART:
                yield _finding("link", road, f"lane {number} ends {max(gaps):.2f} m beside lane {target}")


def _end(road: Element, *, last: bool) -> tuple[np.ndarray, float, float]:
    """Return where a road begins or ends, its heading there and its height."""
    curves = reference_line(road)
    point, heading = curves[-1].end(1.0) if last else curves[0].end(0.0)
    return point, heading, elevation(road, float(road.get("length", "nan")) if last else 0.0)
