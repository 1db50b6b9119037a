"""OpenDRIVE as strict readers want it: what netconvert writes, mended.

netconvert names junctions that it does not write, leaves gaps between the lanes of streets and those of junctions, puts
lanes of junctions on the wrong side where traffic keeps left, and mixes versions of the standard. Its streets are kept:
their hooks and corners are rounded, they get the heights of the ground, and all roads through junctions are drawn anew
from the ends of the lanes that they join.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import count, pairwise
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from defusedxml.ElementTree import fromstring
from numpy.typing import NDArray

from vico.geometry import wrap_angle
from vico.world.heights import HeightField
from vico.world.opendrive import Curve, elevation, lane_borders, offset_point, reference_line

Floats = NDArray[np.float64]

SHORTEST = 0.5
"""Metres of the shortest street; shorter ones are lengthened, or left out where nothing leads there."""

_ROOM = 0.3  # metres that a road through a junction has at least
_TINY = 0.05  # metres of a curve that is left out
_HOOK = 0.6  # metres: a last piece so short that turns back is no part of a street
_TURNS_BACK = 1.5  # radians
_CORNER = 0.02  # radians at which two curves meet in a corner
_CUT = 2.0  # metres of each that rounding takes
_U_TURN = 2.0  # radians: from there on a road through a junction is drawn along its outer side
_STATION = 5.0  # metres between heights
_LEVEL = 0.02  # metres that a height may be off the line between others

_End = tuple[str, bool]  # id of a street, and whether its end (else its start) is meant


@dataclass
class _Street:
    """A road between junctions while it is mended: its reference line, and heights along it, from 0 to 1."""

    element: Element
    curves: list[Curve]
    borders: dict[int, tuple[float, float]]
    length: float = 0.0
    elevations: list[tuple[float, float]] = field(default_factory=list)

    def end(self, *, last: bool) -> tuple[Floats, float]:
        """Point and heading at its end, or at its start."""
        return self.curves[-1].end(1.0) if last else self.curves[0].end(0.0)


@dataclass(frozen=True)
class _Turn:
    """Lanes side by side that lead through a junction: of a street, of the next, and as netconvert wrote them."""

    junction: str
    road: Element
    before: str
    after: str
    lanes: list[tuple[int, int, Element]]


def repair_opendrive(content: bytes, height: HeightField | None = None) -> bytes:
    """Return an OpenDRIVE file of netconvert's that keeps the standard's rules (version 1.4).

    Parameters
    ----------
    content
        As netconvert wrote it: each direction of a street is a road of its own, with lanes on its right.
    height
        The ground and the decks above it, which streets then lie on.

    Returns
    -------
    bytes
        Equal input gives equal bytes. `vico.world.opendrive` says what holds of it.
    """
    root = fromstring(content, forbid_dtd=True)
    roads = {str(road.get("id")): road for road in root.findall("road")}
    streets = {
        name: _Street(road, reference_line(road), lane_borders(road, at_end=False))
        for name, road in roads.items()
        if road.get("junction") == "-1"
    }
    turns = [turn for junction in root.findall("junction") for turn in _turns(junction, roads, streets)]
    joined = {end for turn in turns for end in ((turn.before, True), (turn.after, False))}
    for name, street in list(streets.items()):
        if _length(street.curves) < SHORTEST and not {(name, True), (name, False)} & joined:
            del streets[name]
    for street in streets.values():
        street.curves = _smooth(street.curves)
    _make_room(streets, turns)
    for street in streets.values():
        street.length = round(_length(street.curves), 8)
    _lay(streets.values(), height)
    fresh = count(max((int(n) for n in [*roads, *(str(j.get("id")) for j in root.iter("junction"))]), default=0) + 1)
    ways: dict[str, list[Element]] = defaultdict(list)
    connections: dict[str, list[Element]] = defaultdict(list)
    used: set[str] = set()
    for turn in turns:
        name = str(turn.road.get("id"))
        number = str(next(fresh)) if name in used else name
        used.add(number)
        ways[turn.junction].append(_way(turn, number, streets))
        own = connections[turn.junction]
        connection = Element(
            "connection", id=str(len(own)), incomingRoad=turn.before, connectingRoad=number, contactPoint="start"
        )
        for at, (one, _, _) in enumerate(turn.lanes):
            connection.append(Element("laneLink", {"from": str(one), "to": str(-1 - at)}))
        own.append(connection)
    _write_streets(streets, turns)
    for junction in root.findall("junction"):
        junction[:] = connections[str(junction.get("id"))]
    return _write_file(root, [s.element for s in streets.values()], [way for listed in ways.values() for way in listed])


def _length(curves: Iterable[Curve]) -> float:
    return sum(curve.length for curve in curves)


def _turns(junction: Element, roads: Mapping[str, Element], streets: Mapping[str, _Street]) -> Iterator[_Turn]:
    """Split the connections of a junction into lanes that lie side by side in both streets."""
    for connection in junction.findall("connection"):
        before, road = str(connection.get("incomingRoad")), roads.get(str(connection.get("connectingRoad")))
        target = None if road is None else road.find("link/successor")
        after = "" if target is None else str(target.get("elementId"))
        if road is None or before not in streets or after not in streets:
            continue
        lanes = {int(str(lane.get("id"))): lane for lane in road.iter("lane")}
        found: list[tuple[int, int, Element]] = []
        for link in connection.findall("laneLink"):
            lane, start = lanes.get(int(link.get("to", "0"))), int(link.get("from", "0"))
            end = None if lane is None else lane.find("link/successor")
            if lane is not None and end is not None:
                found.append((start, int(end.get("id", "0")), lane))
        found.sort(key=lambda joined: -joined[0])
        run: list[tuple[int, int, Element]] = []
        for start, there, lane in found:
            if start not in streets[before].borders or there not in streets[after].borders:
                continue
            if run and (start, there) != (run[-1][0] - 1, run[-1][1] - 1):
                yield _Turn(str(junction.get("id")), road, before, after, run)
                run = []
            run = [*run, (start, there, lane)]
        if run:
            yield _Turn(str(junction.get("id")), road, before, after, run)


def _smooth(curves: list[Curve]) -> list[Curve]:
    """Return a reference line without hooks at its ends, and with curves in place of its corners; not too short."""
    kept = [curve for curve in curves if curve.length >= _TINY] or curves[:1]
    while len(kept) > 1 and kept[-1].length < _HOOK and _corner(kept[-2], kept[-1]) > _TURNS_BACK:
        kept = kept[:-1]
    while len(kept) > 1 and kept[0].length < _HOOK and _corner(kept[0], kept[1]) > _TURNS_BACK:
        kept = kept[1:]
    if _length(kept) < SHORTEST:
        start, heading = kept[0].end(0.0)
        end, _ = kept[-1].end(1.0)
        middle, along = (start + end) / 2, np.array([math.cos(heading), math.sin(heading)])
        return [Curve.straight(middle - along * SHORTEST / 2, heading, SHORTEST)]
    cuts = [0.0]
    for a, b in pairwise(kept):
        gap = math.hypot(*(b.end(0.0)[0] - a.end(1.0)[0]))
        sharp = _corner(a, b) > _CORNER or gap > 1e-4
        cuts.append(min(_CUT, 0.4 * a.length, 0.4 * b.length) if sharp else 0.0)
    cuts.append(0.0)
    found: list[Curve] = []
    for curve, low, high in zip(kept, cuts, cuts[1:], strict=False):
        part = _within(curve, low, high)
        if low > 0.0:
            found.append(Curve.between(*found[-1].end(1.0), *part.end(0.0)))
        found.append(part)
    return found


def _corner(a: Curve, b: Curve) -> float:
    return abs(wrap_angle(b.end(0.0)[1] - a.end(1.0)[1]))


def _within(curve: Curve, low: float, high: float) -> Curve:
    """Return a curve without so many metres at its start and at its end."""
    if low == high == 0.0:
        return curve
    return curve.part(curve.parameter(low) if low > 0.0 else 0.0, curve.parameter(curve.length - high))


def _edge(street: _Street, lane: int, *, last: bool, outer: bool = False) -> tuple[Floats, float]:
    """Return where a border of a lane is at an end of a street, and the heading there."""
    point, heading = street.end(last=last)
    return offset_point(point, heading, street.borders[lane][outer]), heading


def _make_room(streets: Mapping[str, _Street], turns: Sequence[_Turn]) -> None:
    """Cut streets back where those they lead to begin at once, or before they end."""
    cut: dict[_End, float] = defaultdict(float)
    for turn in turns:
        before, after = streets[turn.before], streets[turn.after]
        (a, heading), (b, there) = (
            _edge(before, turn.lanes[0][0], last=True),
            _edge(after, turn.lanes[0][1], last=False),
        )
        ahead = float((b - a) @ np.array([math.cos(heading), math.sin(heading)]))
        turned = abs(wrap_angle(there - heading))
        if turned > _U_TURN:
            continue
        lacking = _ROOM - (ahead if turned < math.pi / 4 else math.hypot(*(b - a)))
        if lacking > 0.0:
            own = min(lacking, _length(before.curves) - SHORTEST)
            for end, size in (((turn.before, True), own), ((turn.after, False), lacking - own)):
                cut[end] = max(cut[end], size)
    for (name, last), size in cut.items():
        street = streets[name]
        size = min(size, _length(street.curves) - SHORTEST)
        while size > 0.0:
            curve = street.curves.pop(-1 if last else 0)
            left = size - curve.length
            if left < -_TINY or not street.curves:
                part = _within(curve, 0.0, size) if last else _within(curve, size, 0.0)
                street.curves.insert(len(street.curves) if last else 0, part)
            size = left


def _lay(streets: Iterable[_Street], height: HeightField | None) -> None:
    """Give streets their heights: those that netconvert wrote, or of the surface that is nearest to them."""
    listed = list(streets)
    stations, places = [], []
    for street in listed:
        own = float(street.element.get("length", "0"))
        along = np.linspace(0.0, street.length, max(math.ceil(street.length / _STATION), 1) + 1)
        starts = np.concatenate([[0.0], np.cumsum([curve.length for curve in street.curves])])
        which = np.clip(np.searchsorted(starts, along, side="right") - 1, 0, len(street.curves) - 1)
        points = [
            street.curves[k].points(np.array([min((s - starts[k]) / street.curves[k].length, 1.0)]))[0]
            for k, s in zip(which.tolist(), along.tolist(), strict=True)
        ]
        guess = [elevation(street.element, own * s / street.length) for s in along.tolist()]
        stations.append(along)
        places.append(np.column_stack([points, guess]))
    if not listed:
        return
    every = np.concatenate(places)
    found = every[:, 2] if height is None else height.near(every)
    first = 0
    for street, along in zip(listed, stations, strict=True):
        levels = np.round(found[first : first + len(along)], 2)
        first += len(along)
        street.elevations = [(float(along[k]), float(levels[k])) for k in _simplify_profile(along, levels)]


def _simplify_profile(along: Floats, levels: Floats) -> list[int]:
    """Return the points of a profile between which straight lines come near the others (Douglas and Peucker)."""
    kept, open_ = {0, len(along) - 1}, [(0, len(along) - 1)]
    while open_:
        low, high = open_.pop()
        if high - low < 2:
            continue
        inner = slice(low + 1, high)
        off = np.abs(levels[inner] - np.interp(along[inner], along[[low, high]], levels[[low, high]]))
        if off.max() > _LEVEL:
            middle = low + 1 + int(off.argmax())
            kept.add(middle)
            open_ += [(low, middle), (middle, high)]
    return sorted(kept)


def _way(turn: _Turn, number: str, streets: Mapping[str, _Street]) -> Element:
    """Draw the road of a turn: from the borders of the lanes it comes from to those of the lanes it leads to."""
    before, after = streets[turn.before], streets[turn.after]
    # Along the left border, or along the right one where one turns back around the left.
    first, last = turn.lanes[0], turn.lanes[-1]
    left = [_edge(before, first[0], last=True), _edge(after, first[1], last=False)]
    right = [_edge(before, last[0], last=True, outer=True), _edge(after, last[1], last=False, outer=True)]
    size = [math.hypot(*(end[0] - start[0])) for start, end in (left, right)]
    outer = abs(wrap_angle(left[1][1] - left[0][1])) > _U_TURN and size[1] > size[0]
    start, end = right if outer else left
    curve = Curve.between(*start, *end)
    length = round(curve.length, 8)
    wide = [(_width(before, one), _width(after, other)) for one, other, _ in turn.lanes]
    road = Element("road", name=str(turn.road.get("name")), length=f"{length:.8f}", id=number, junction=turn.junction)
    link = SubElement(road, "link")
    SubElement(link, "predecessor", elementType="road", elementId=turn.before, contactPoint="end")
    SubElement(link, "successor", elementType="road", elementId=turn.after, contactPoint="start")
    road.extend(deepcopy(turn.road.findall("type")))
    _plan(SubElement(road, "planView"), [curve])
    _profile(SubElement(road, "elevationProfile"), [(0.0, before.elevations[-1][1]), (length, after.elevations[0][1])])
    SubElement(road, "lateralProfile")
    lanes = SubElement(road, "lanes")
    if outer:
        offset = [sum(side) for side in zip(*wide, strict=True)]
        SubElement(lanes, "laneOffset", {"s": "0", **_blend(offset[0], offset[1], length)})
    section = SubElement(lanes, "laneSection", s="0")
    section.append(deepcopy(_find_element(turn.road, "lanes/laneSection/center")))
    side = SubElement(section, "right")
    for k, (one, other, old) in enumerate(turn.lanes):
        lane = deepcopy(old)
        lane.set("id", str(-1 - k))
        joins = _find_element(lane, "link")
        joins[:] = [Element("predecessor", id=str(one)), Element("successor", id=str(other))]
        for width in lane.findall("width"):
            lane.remove(width)
        lane.insert(1, Element("width", {"sOffset": "0", **_blend(*wide[k], length)}))
        side.append(lane)
    road.extend([Element("objects"), Element("signals")])
    return road


def _width(street: _Street, lane: int) -> float:
    inner, outer = street.borders[lane]
    return abs(outer - inner)


def _find_element(element: Element, path: str) -> Element:
    found = element.find(path)
    assert found is not None, f"netconvert always writes {path}"
    return found


def _blend(start: float, end: float, length: float) -> dict[str, str]:
    """Return the polynomial that goes smoothly from one value to another along a road."""
    c, d = 3 * (end - start) / length**2, -2 * (end - start) / length**3
    return {"a": f"{start:.3f}", "b": "0", "c": f"{c:.12g}", "d": f"{d:.12g}"}


def _plan(plan: Element, curves: Sequence[Curve]) -> None:
    """Write a reference line."""
    plan[:] = []
    s = 0.0
    for curve in curves:
        (x, y), heading = curve.end(0.0)
        length = round(curve.length, 8)
        row = {"s": s, "x": x, "y": y, "hdg": heading, "length": length}
        geometry = SubElement(plan, "geometry", {name: f"{value:.8f}" for name, value in row.items()})
        s += length
        if curve.is_straight:
            SubElement(geometry, "line")
            continue
        c, sine = math.cos(heading), math.sin(heading)
        local = curve.coefficients @ np.array([[c, -sine], [sine, c]])
        local[0], local[1, 1] = 0.0, 0.0  # it begins here and along the heading
        names = [f"{name}{axis}" for axis in "UV" for name in "abcd"]
        values = dict(zip(names, local.T.ravel().tolist(), strict=True))
        SubElement(
            geometry, "paramPoly3", {name: f"{value:.10f}" for name, value in values.items()} | {"pRange": "normalized"}
        )


def _profile(profile: Element, points: Sequence[tuple[float, float]]) -> None:
    """Write heights along a road, straight between points."""
    profile[:] = []
    for (s, z), (later, there) in pairwise(points):
        slope = (there - z) / (later - s)
        SubElement(profile, "elevation", {"s": f"{s:.8f}", "a": f"{z:.2f}", "b": f"{slope:.12g}", "c": "0", "d": "0"})


def _write_streets(streets: Mapping[str, _Street], turns: Sequence[_Turn]) -> None:
    """Write what has changed of streets into their elements."""
    leads: dict[str, dict[str, str]] = defaultdict(dict)
    for turn in turns:
        leads[turn.before]["successor"] = turn.junction
        leads[turn.after]["predecessor"] = turn.junction
    for name, street in streets.items():
        road = street.element
        lengths = [round(curve.length, 8) for curve in street.curves]
        road.set("length", f"{sum(lengths):.8f}")
        for link in road.findall("link"):
            road.remove(link)
        if leads[name]:
            link = Element("link")
            for way in ("predecessor", "successor"):
                if way in leads[name]:
                    SubElement(link, way, elementType="junction", elementId=leads[name][way])
            road.insert(0, link)
        _plan(_find_element(road, "planView"), street.curves)
        _profile(_find_element(road, "elevationProfile"), street.elevations)
        for thing in [*road.iter("object"), *road.iter("signal")]:
            thing.set("s", f"{min(max(float(thing.get('s', '0')), 0.0), math.floor(sum(lengths) * 1e6) / 1e6):.8f}")
        # Version 1.4, which all readers know, has none of these.
        for outline in road.iter("outline"):
            outline.attrib.clear()
            for corner in outline:
                corner.attrib.pop("id", None)


def _write_file(root: Element, streets: Sequence[Element], ways: Sequence[Element]) -> bytes:
    """Return the file: the header, roads, controllers and junctions that have something in them."""
    header = _find_element(root, "header")
    roads = [*streets, *ways]
    signals = {signal.get("id") for road in roads for signal in road.iter("signal")}
    # netconvert writes the controller of signals that it joined once for each junction that they stand at.
    controllers: dict[str, Element] = {}
    for given in root.findall("controller"):
        controller = controllers.setdefault(str(given.get("id")), Element("controller", id=str(given.get("id"))))
        known = {control.get("signalId") for control in controller}
        controller.extend(one for one in given if one.get("signalId") in signals - known)
    kept = [*controllers.values(), *root.findall("junction")]
    root[:] = [header, *roads, *(element for element in kept if len(element))]
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for road in roads:
        reach = max((abs(t) for pair in lane_borders(road, at_end=False).values() for t in pair), default=0.0)
        for curve in reference_line(road):
            points = curve.points(np.linspace(0.0, 1.0, 9))
            low, high = np.minimum(low, points.min(axis=0) - reach), np.maximum(high, points.max(axis=0) + reach)
    if np.isfinite(low).all():
        for name, value in zip(("west", "south", "east", "north"), (*low, *high), strict=True):
            header.set(name, f"{value:.3f}")
    geo = header.find("geoReference")
    where = "" if geo is None else str(geo.text).strip()
    if geo is not None:
        geo.text = None
    indent(root, "    ")
    text = tostring(root, encoding="unicode")
    text = text.replace("<geoReference />", f"<geoReference><![CDATA[{where}]]></geoReference>", 1)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()
