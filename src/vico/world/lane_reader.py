"""Lanes, junctions, signals and walkways read from SUMO's `roads.net.xml`.

The format: https://sumo.dlr.de/docs/Networks/SUMO_Road_Networks.html. Metres, local ENU.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import ParseError, iterparse
from numpy.typing import NDArray

from vico.errors import MissingFileError, SchemaError
from vico.world.disjoint import DisjointSets
from vico.world.lanes import Floats, Ints, LaneGraph
from vico.world.signals import SignalProgram, Signals, signal_program
from vico.world.walkways import Walkways, walkways_of

_Attributes = dict[str, str]

# Junctions joined by a street shorter than a car and its gap can't be left one by one: they count as one.
CLUSTER_GAP = 8.0


@dataclass
class _Lane:
    """A lane as the file has it."""

    id: str
    edge: str
    function: str
    index: int
    line: Floats
    z: Floats
    width: float
    speed: float
    walkers: bool
    cars: bool
    buses: bool


def read_lanes(path: Path) -> LaneGraph:
    """Read a SUMO network; a place without streets gives a graph of no lanes.

    Raises
    ------
    MissingFileError, SchemaError
        If there is no such file, or it is no SUMO network.
    """
    path = Path(path)
    if not path.is_file():
        raise MissingFileError(f"{path}: no such file; build the world anew")
    try:
        lanes, junctions, links, programs, lefthand = _parsed(path)
        driven = [lane for lane in lanes if (lane.cars or lane.buses) and lane.function in ("normal", "internal")]
        lights = Signals.of(programs, links, {lane.id: i for i, lane in enumerate(driven)})
    except (ParseError, DefusedXmlException, KeyError, ValueError) as error:
        raise SchemaError(f"{path}: not a readable SUMO network ({error}); build the world anew") from None
    return replace(_assembled(driven, lanes, junctions, links, lefthand=lefthand), lights=lights)


def _clean_line(text: str) -> tuple[Floats, Floats]:
    """Return a shape without doubled points, and heights; a lane of no length gets a centimetre along x: a direction.

    Networks without heights are flat.
    """
    line = np.array([[*map(float, point.split(",")), 0.0][:3] for point in text.split()])
    keep = np.concatenate([[True], np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1) > 1e-6])
    line = line[keep]
    line = line if len(line) > 1 else np.array([line[0], line[0] + (0.01, 0.0, 0.0)])
    return np.ascontiguousarray(line[:, :2]), np.ascontiguousarray(line[:, 2])


def _allows(attributes: dict[str, str], who: str) -> bool:
    if "allow" in attributes:
        return who in attributes["allow"].split() or attributes["allow"] == "all"
    return who not in attributes.get("disallow", "").split() and attributes.get("disallow") != "all"


def _parsed(path: Path) -> tuple[list[_Lane], list[_Attributes], list[_Attributes], list[SignalProgram], bool]:
    lanes: list[_Lane] = []
    junctions: list[_Attributes] = []
    links: list[_Attributes] = []
    programs: list[SignalProgram] = []
    root: Any = None
    lefthand = False
    for event, element in iterparse(path, events=("start", "end"), forbid_dtd=True):
        if root is None:
            root = element
            if element.tag != "net":
                raise ValueError(f"root element is <{element.tag}>, not <net>")
            lefthand = element.get("lefthand") == "true"
        if event != "end":
            continue
        if element.tag == "edge":
            function = element.get("function", "normal")
            for child in element.findall("lane"):
                attributes = dict(child.attrib)
                line, z = _clean_line(attributes["shape"])
                lanes.append(
                    _Lane(
                        id=attributes["id"],
                        edge=element.get("id"),
                        function=function,
                        index=int(attributes["index"]),
                        line=line,
                        z=z,
                        width=float(attributes.get("width", 3.2)),
                        speed=float(attributes["speed"]),
                        walkers=_allows(attributes, "pedestrian"),
                        cars=_allows(attributes, "passenger"),
                        buses=_allows(attributes, "bus"),
                    )
                )
        elif element.tag == "junction":
            junctions.append(dict(element.attrib))
        elif element.tag == "connection":
            links.append(dict(element.attrib))
        elif element.tag == "tlLogic":
            programs.append(signal_program(element.attrib, [dict(phase.attrib) for phase in element.findall("phase")]))
        if element.tag in ("edge", "junction", "connection", "tlLogic"):
            root.clear()
    return lanes, [j for j in junctions if j.get("type") != "internal"], links, programs, lefthand


def _csr(pairs: list[tuple[int, int]], n: int) -> tuple[Ints, Ints]:
    rows: list[list[int]] = [[] for _ in range(n)]
    for a, b in pairs:
        if b not in rows[a]:
            rows[a].append(b)
    first = np.zeros(n + 1, np.int32)
    first[1:] = np.cumsum([len(row) for row in rows])
    return first, np.array([b for row in rows for b in row], np.int32)


def _junction_of(lane: _Lane, junctions: dict[str, int]) -> int:
    """Return the number of the junction whose part a lane is: edges inside junction J are called ":J_k"."""
    return junctions[lane.edge[1:].rsplit("_", 1)[0]]


def _linked(driven: list[_Lane], links: list[dict[str, str]]) -> list[tuple[int, int]]:
    """Return which lanes lead into which, by number."""
    index = {lane.id: i for i, lane in enumerate(driven)}
    ends = [
        (
            index.get(f"{link['from']}_{link['fromLane']}"),
            index.get(link.get("via") or f"{link['to']}_{link['toLane']}"),
        )
        for link in links
    ]
    return [(start, end) for start, end in ends if start is not None and end is not None]


def _beside(driven: list[_Lane], step: int) -> Ints:
    """Return the lane beside each, -1 for none; lanes inside junctions have none."""
    by_place = {(lane.edge, lane.index): i for i, lane in enumerate(driven)}
    found = [-1 if lane.function == "internal" else by_place.get((lane.edge, lane.index + step), -1) for lane in driven]
    return np.array(found, np.int32)


def _assembled(
    driven: list[_Lane],
    lanes: list[_Lane],
    junctions: list[dict[str, str]],
    links: list[dict[str, str]],
    *,
    lefthand: bool,
) -> LaneGraph:
    n = len(driven)
    edges = list(dict.fromkeys(lane.edge for lane in driven))
    edge_number = {edge: i for i, edge in enumerate(edges)}
    pairs = _linked(driven, links)
    junction_number = {j["id"]: i for i, j in enumerate(junctions)}
    inside = np.array(
        [_junction_of(lane, junction_number) if lane.function == "internal" else -1 for lane in driven],
        np.int32,
    )
    next_first, following = _csr(pairs, n)
    previous_first, preceding = _csr([(b, a) for a, b in pairs], n)
    first = np.zeros(n + 1, np.int32)
    first[1:] = np.cumsum([len(lane.line) for lane in driven])
    steps = [np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lane.line, axis=0), axis=1))]) for lane in driven]
    length = np.array([s[-1] for s in steps])
    crossed = {_junction_of(lane, junction_number) for lane in lanes if lane.function == "crossing"}
    zone = _zones(driven, inside, length, pairs, len(junctions), crossed)
    return LaneGraph(
        ids=[lane.id for lane in driven],
        edges=edges,
        edge=np.array([edge_number[lane.edge] for lane in driven], np.int32),
        first=first,
        points=np.concatenate([np.zeros((0, 2)), *(lane.line for lane in driven)]),
        along=np.concatenate([np.zeros(0), *steps]),
        z=np.concatenate([np.zeros(0), *(lane.z for lane in driven)]),
        length=length,
        width=np.array([lane.width for lane in driven]),
        speed=np.array([lane.speed for lane in driven]),
        inside=inside,
        zone=zone,
        buses_only=np.array([not lane.cars for lane in driven], bool),
        left=_beside(driven, 1),
        right=_beside(driven, -1),
        next_first=next_first,
        next=following,
        previous_first=previous_first,
        previous=preceding,
        junctions=[j["id"] for j in junctions],
        junction_position=np.array([[float(j["x"]), float(j["y"])] for j in junctions]).reshape(-1, 2),
        signals=np.array([j.get("type", "").startswith("traffic_light") for j in junctions], bool),
        zones=int(zone.max(initial=-1)) + 1,
        walks=_walks(lanes, links, junction_number),
        lefthand=lefthand,
    )


def _zones(
    driven: list[_Lane],
    inside: Ints,
    length: Floats,
    pairs: list[tuple[int, int]],
    junctions: int,
    crossed: set[int],
) -> Ints:
    """Return the cluster of every lane that needs a junction's token, -1 for the others, int32, shape ``(n,)``.

    Bends and lane drops without crossings need none. Controlled junctions joined by a street shorter than
    `CLUSTER_GAP` are one cluster, and that street is part of it.
    """
    controlled = _controlled_junctions(driven, inside, pairs, junctions, crossed)
    clusters = DisjointSets(junctions)
    comes = {b: int(inside[a]) for a, b in pairs if inside[a] >= 0}
    goes = {a: int(inside[b]) for a, b in pairs if inside[b] >= 0}
    bridges: list[tuple[int, int]] = []
    for i in range(len(driven)):
        start, end = comes.get(i, -1), goes.get(i, -1)
        between = inside[i] < 0 and start >= 0 and end >= 0
        if between and length[i] < CLUSTER_GAP and controlled[start] and controlled[end]:
            clusters.join(start, end)
            bridges.append((i, start))
    roots = sorted({clusters.root(j) for j in range(junctions) if controlled[j]})
    number = {r: k for k, r in enumerate(roots)}
    zone = np.full(len(driven), -1, np.int32)
    for i, j in enumerate(inside):
        if j >= 0 and controlled[j]:
            zone[i] = number[clusters.root(int(j))]
    for i, j in bridges:
        zone[i] = number[clusters.root(j)]
    return zone


def _controlled_junctions(
    driven: list[_Lane], inside: Ints, pairs: list[tuple[int, int]], junctions: int, crossed: set[int]
) -> NDArray[np.bool_]:
    """Return which junctions need a token: those with crossings, three arms, or lanes that conflict."""
    within: dict[int, list[int]] = defaultdict(list)
    for i, j in enumerate(inside):
        if j >= 0:
            within[int(j)].append(i)
    enters: dict[int, set[int]] = defaultdict(set)
    # The edges of a street's two directions are "123" and "-123" (with "#k" for its parts).
    arms: dict[int, set[str]] = defaultdict(set)
    for a, b in pairs:
        if inside[b] >= 0 and inside[a] < 0:
            enters[b].add(a)
        for lane, other in ((a, b), (b, a)):
            if inside[lane] >= 0 and inside[other] < 0:
                arms[int(inside[lane])].add(driven[other].edge.lstrip("-"))
    controlled = np.zeros(junctions, bool)
    for j, members in within.items():
        controlled[j] = j in crossed or len(arms[j]) >= 3 or _have_conflict(driven, members, enters)
    return controlled


def _have_conflict(driven: list[_Lane], members: list[int], enters: dict[int, set[int]]) -> bool:
    """Return whether two of a junction's lanes come from different lanes and pass closer than a car is wide."""
    lines = [shapely.LineString(driven[i].line) for i in members]
    return any(
        enters[a] != enters[b] and shapely.distance(lines[k], lines[k + 1 + m]) < 1.9
        for k, a in enumerate(members)
        for m, b in enumerate(members[k + 1 :])
    )


def _walks(lanes: list[_Lane], links: list[dict[str, str]], junctions: dict[str, int]) -> Walkways:
    """Hand the pedestrian lanes and the areas that join them to `walkways_of`."""
    walked = {lane.id: lane for lane in lanes if lane.walkers and lane.function in ("normal", "crossing")}
    areas = {lane.edge: lane.line for lane in lanes if lane.function == "walkingarea"}
    touching: dict[str, list[tuple[str, int]]] = {area: [] for area in areas}
    for link in links:
        start, end = f"{link['from']}_{link['fromLane']}", f"{link['to']}_{link['toLane']}"
        if link["from"] in areas and end in walked:
            touching[link["from"]].append((end, 0))
        if link["to"] in areas and start in walked:
            touching[link["to"]].append((start, 1))
    ways = [
        (
            lane.id,
            lane.function == "crossing",
            lane.line,
            lane.z,
            lane.width,
            _junction_of(lane, junctions) if lane.function == "crossing" else -1,
        )
        for lane in walked.values()
    ]
    corners = [
        (junctions[area[1:].rsplit("_", 1)[0]], areas[area], sorted(set(ends))) for area, ends in touching.items()
    ]
    return walkways_of(ways, corners)
