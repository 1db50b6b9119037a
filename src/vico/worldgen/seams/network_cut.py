"""The road network of a city, cut to its tiles: whole streets near a tile, in the tile's own coordinates."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any
from xml.etree.ElementTree import Element, tostring

import numpy as np
from defusedxml.ElementTree import fromstring

_POINT = re.compile(r"(-?\d+\.?\d*),(-?\d+\.?\d*)")


class NetworkCutter:
    """Cuts SUMO networks out of a larger one.

    Parameters
    ----------
    net
        The bytes of its ``roads.net.xml``, local metres.
    """

    def __init__(self, net: bytes) -> None:
        root = fromstring(net)
        self._attributes = dict(root.attrib)
        self._by_tag: dict[str, list[Element]] = {}
        for element in root:
            self._by_tag.setdefault(element.tag, []).append(element)
        self._streets = [edge for edge in self._of("edge") if not edge.get("function")]
        self._boxes = np.array([_box(edge) for edge in self._streets]).reshape(-1, 4)

    def _of(self, tag: str) -> list[Element]:
        return self._by_tag.get(tag, [])

    def within(self, *, half: float, east: float, north: float) -> bytes:
        """Return the streets that reach into a square, and what of their junctions joins them.

        Parameters
        ----------
        half
            Half its side, metres.
        east, north
            Its middle; what is found is told from there.
        """
        west, south, right, top = self._boxes.T if len(self._boxes) else np.zeros((4, 0))
        near = (west <= east + half) & (right >= east - half) & (south <= north + half) & (top >= north - half)
        edges = {self._streets[k].get("id") for k in np.flatnonzero(near)}
        junctions = {self._streets[k].get(end) for k in np.flatnonzero(near) for end in ("from", "to")}
        edges |= self._through(edges, junctions)
        lanes = {lane.get("id") for edge in self._of("edge") if edge.get("id") in edges for lane in edge}
        links = [link for link in self._of("connection") if {link.get("from"), link.get("to")} <= edges]
        programs = {link.get("tl") for link in links}
        root = Element("net", self._attributes)
        root.extend(self._of("location"))
        root.extend(self._of("type"))
        root.extend(_moved(edge, east, north) for edge in self._of("edge") if edge.get("id") in edges)
        root.extend(program for program in self._of("tlLogic") if program.get("id") in programs)
        root.extend(
            _joining(_moved(junction, east, north), lanes)
            for junction in self._of("junction")
            if junction.get("id") in junctions or junction.get("id") in lanes
        )
        root.extend(links)
        return b'<?xml version="1.0" encoding="UTF-8"?>\n' + bytes(tostring(root)) + b"\n"

    def _through(self, streets: Iterable[Any], junctions: Iterable[Any]) -> set[Any]:
        """Return the parts of junctions that lead from one of some streets to another, and where people cross them."""
        kept, known = set(streets), set(junctions)
        inside: set[Any] = set()
        links = [link for link in self._of("connection") if link.get("to") in kept and link.get("via")]
        found = {_edge(str(link.get("via"))) for link in links if link.get("from") in kept}
        while found:
            inside |= found
            found = {_edge(str(link.get("via"))) for link in links if link.get("from") in found} - inside
        walked = (edge for edge in self._of("edge") if edge.get("function") in ("walkingarea", "crossing"))
        return inside | {edge.get("id") for edge in walked if str(edge.get("id"))[1:].rpartition("_")[0] in known}


def _edge(lane: str) -> str:
    return lane.rpartition("_")[0]


def _box(edge: Element) -> tuple[float, float, float, float]:
    points = [found for lane in edge for found in _POINT.findall(lane.get("shape", ""))]
    xy = np.array(points, np.float64).reshape(-1, 2)
    (west, south), (east, north) = xy.min(axis=0), xy.max(axis=0)
    return float(west), float(south), float(east), float(north)


def _moved(element: Element, east: float, north: float) -> Element:
    """Return a copy of an element and its children, told from another origin."""
    moved = Element(element.tag, dict(element.attrib))
    if "shape" in moved.attrib:
        moved.set(
            "shape", _POINT.sub(lambda p: f"{float(p[1]) - east:.3f},{float(p[2]) - north:.3f}", moved.attrib["shape"])
        )
    for axis, shift in (("x", east), ("y", north)):
        if axis in moved.attrib:
            moved.set(axis, f"{float(moved.attrib[axis]) - shift:.3f}")
    moved.extend(_moved(child, east, north) for child in element)
    return moved


def _joining(junction: Element, lanes: set[Any]) -> Element:
    """Return a junction that knows of some lanes alone."""
    for key in ("incLanes", "intLanes"):
        junction.set(key, " ".join(lane for lane in junction.get(key, "").split() if lane in lanes))
    return junction
