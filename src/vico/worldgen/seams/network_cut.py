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
        # Where things of a tag stand in the file: a tile looks at those that are near alone.
        self._edge_at = {edge.get("id"): k for k, edge in enumerate(self._of("edge"))}
        self._junction_at = {junction.get("id"): k for k, junction in enumerate(self._of("junction"))}
        self._links_from: dict[Any, list[int]] = {}
        for k, link in enumerate(self._of("connection")):
            self._links_from.setdefault(link.get("from"), []).append(k)
        self._walked: dict[str, list[Any]] = {}
        for edge in self._of("edge"):
            if edge.get("function") in ("walkingarea", "crossing"):
                self._walked.setdefault(str(edge.get("id"))[1:].rpartition("_")[0], []).append(edge.get("id"))

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
        kept = [self._of("edge")[k] for k in sorted(self._edge_at[name] for name in edges if name in self._edge_at)]
        lanes = {lane.get("id") for edge in kept for lane in edge}
        links = [link for link in self._leaving(edges) if link.get("to") in edges]
        programs = {link.get("tl") for link in links}
        root = Element("net", self._attributes)
        root.extend(self._of("location"))
        root.extend(self._of("type"))
        root.extend(_moved(edge, east, north) for edge in kept)
        root.extend(program for program in self._of("tlLogic") if program.get("id") in programs)
        at = sorted(self._junction_at[name] for name in junctions | lanes if name in self._junction_at)
        root.extend(_joining(_moved(self._of("junction")[k], east, north), lanes) for k in at)
        root.extend(links)
        return b'<?xml version="1.0" encoding="UTF-8"?>\n' + bytes(tostring(root)) + b"\n"

    def _through(self, streets: Iterable[Any], junctions: Iterable[Any]) -> set[Any]:
        """Return the parts of junctions that lead from one of some streets to another, and where people cross them."""
        kept, known = set(streets), set(junctions)
        inside: set[Any] = set()
        found = kept
        while found:
            links = (link for link in self._leaving(found) if link.get("to") in kept and link.get("via"))
            found = {_edge(str(link.get("via"))) for link in links} - inside
            inside |= found
        return inside | {edge for junction in known for edge in self._walked.get(str(junction), ())}

    def _leaving(self, edges: Iterable[Any]) -> list[Element]:
        """Return the connections that leave some edges, in the order of the file."""
        return [self._of("connection")[k] for k in sorted(k for name in edges for k in self._links_from.get(name, ()))]


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
