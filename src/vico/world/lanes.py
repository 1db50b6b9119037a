"""The road network as arrays: lanes that vehicles drive, their junctions, and the programs of traffic signals.

Read from SUMO's `roads.net.xml` (https://sumo.dlr.de/docs/Networks/SUMO_Road_Networks.html and
https://sumo.dlr.de/docs/Simulation/Traffic_Lights.html), whose signal programs netconvert makes where the map has
signals. The sidewalks, crossings and corners of the same file become `vico.world.walkways`. Metres, local ENU.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import ParseError, iterparse
from numpy.typing import ArrayLike, NDArray

from vico.errors import MissingFileError, SchemaError
from vico.io.compiled import compiled
from vico.world.walkways import Walkways, walkways_of

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class SignalProgram:
    """A fixed-time program of the signals of a junction, or of several that are controlled together.

    Attributes
    ----------
    id
        SUMO's name.
    seconds
        Length of each phase.
    states
        What each phase shows, a letter a link as SUMO has them: ``G`` and ``g`` green (``g``: others go first), ``y``
        amber, ``r`` red.
    """

    id: str
    seconds: tuple[int, ...]
    states: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Signals:
    """The signals of a road network.

    Attributes
    ----------
    programs
        Of all signals.
    lane, lane_program, lane_link
        Lanes inside junctions that a signal lets vehicles onto, whose program that is, and which of its links, int32,
        shape ``(k,)`` each.
    crossing, crossing_program, crossing_link
        The same of crossings, by their SUMO lane ids.
    """

    programs: tuple[SignalProgram, ...]
    lane: Ints
    lane_program: Ints
    lane_link: Ints
    crossing: tuple[str, ...]
    crossing_program: Ints
    crossing_link: Ints

    @classmethod
    def none(cls) -> Signals:
        """Return those of a network without signals."""
        empty = np.zeros(0, np.int32)
        return cls((), empty, empty, empty, (), empty, empty)

    @classmethod
    def of(
        cls, programs: Sequence[SignalProgram], links: Sequence[Mapping[str, str]], lanes: Mapping[str, int]
    ) -> Signals:
        """Join programs to what they control.

        Parameters
        ----------
        programs
            Of the network; of several with one name the first counts.
        links
            Attributes of the network's ``connection`` elements.
        lanes
            Numbers of the lanes that vehicles drive, by id.

        Raises
        ------
        ValueError
            If a link is no number, or its program has no such link.
        """
        number: dict[str, int] = {}
        kept: list[SignalProgram] = []
        for program in programs:
            if program.id not in number:
                number[program.id] = len(kept)
                kept.append(program)
        driven: list[tuple[int, int, int]] = []
        walked: list[tuple[str, int, int]] = []
        for attributes in links:
            if attributes.get("tl", "") not in number:
                continue
            k, link = number[attributes["tl"]], int(attributes["linkIndex"])
            if not 0 <= link < len(kept[k].states[0]):
                raise ValueError(f"signal program {kept[k].id!r} has no link {link}")
            onto = attributes.get("via") or f"{attributes['to']}_{attributes['toLane']}"
            if onto in lanes:
                driven.append((lanes[onto], k, link))
            else:
                walked.append((onto, k, link))
        by_lane = np.array(sorted(driven), np.int32).reshape(-1, 3)
        walked.sort()
        return cls(
            programs=tuple(kept),
            lane=by_lane[:, 0].copy(),
            lane_program=by_lane[:, 1].copy(),
            lane_link=by_lane[:, 2].copy(),
            crossing=tuple(name for name, _, _ in walked),
            crossing_program=np.array([k for _, k, _ in walked], np.int32),
            crossing_link=np.array([link for _, _, link in walked], np.int32),
        )


def signal_program(attributes: Mapping[str, str], phases: Sequence[Mapping[str, str]]) -> SignalProgram:
    """Return a ``tlLogic`` element and its phases as a program.

    Raises
    ------
    KeyError, ValueError
        If something is missing, or a phase is not of whole seconds, of at least one, with a letter for each link.
    """
    seconds = tuple(int(float(phase["duration"])) for phase in phases)
    states = tuple(phase["state"] for phase in phases)
    if not phases or min(seconds) < 1 or len({len(state) for state in states}) != 1:
        raise ValueError(f"signal program {attributes['id']!r} has no phases of equal links and at least a second")
    return SignalProgram(attributes["id"], seconds, states)


Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LaneGraph:
    """Lanes that vehicles drive, the lanes through junctions among them.

    Attributes
    ----------
    ids
        SUMO lane ids; index in this list = lane number everywhere else.
    edge
        Number of the street (one direction) a lane belongs to, int32, shape ``(n,)``; names in `edges`.
    first, points, along
        Lane ``i``'s centre line is ``points[first[i]:first[i + 1]]``, shape ``(p, 2)``; `along` holds the metres from
        the lane's start at each of its points.
    z
        How high the lanes' points lie, metres, shape ``(p,)``: on the ground, on a deck or in a tunnel.
    length, width, speed
        Metres and metres a second, shape ``(n,)``.
    inside
        Number of the junction a lane lies in, -1 for street lanes, int32.
    zone
        Number of the junction cluster whose single occupant a vehicle on the lane must be, -1 elsewhere, int32.
    buses_only
        True where cars may not drive.
    left, right
        Neighbour lanes in the same direction, towards the middle of the street and towards its kerb, -1 for none,
        int32; where traffic keeps left the sides are the other way round.
    lefthand
        Whether traffic keeps left.
    lights
        What signals let vehicles and people into junctions, and by which programs.
    next_first, next, previous_first, previous
        Lanes that follow and precede lane ``i``: ``next[next_first[i]:next_first[i + 1]]``.
    junctions, junction_position, signals
        Junction ids, their places, shape ``(m, 2)``, and whether they have signals.
    zones
        Number of junction clusters.
    walks
        Where people walk.
    """

    ids: list[str]
    edges: list[str]
    edge: Ints
    first: Ints
    points: Floats
    along: Floats
    z: Floats
    length: Floats
    width: Floats
    speed: Floats
    inside: Ints
    zone: Ints
    buses_only: NDArray[np.bool_]
    left: Ints
    right: Ints
    next_first: Ints
    next: Ints
    previous_first: Ints
    previous: Ints
    junctions: list[str]
    junction_position: Floats
    signals: NDArray[np.bool_]
    zones: int
    walks: Walkways
    lefthand: bool = False
    lights: Signals = field(default_factory=Signals.none)

    def __len__(self) -> int:
        return len(self.ids)

    @cached_property
    def index(self) -> dict[str, int]:
        """Lane number by id."""
        return {lane: i for i, lane in enumerate(self.ids)}

    def line(self, lane: int) -> Floats:
        """Centre line of a lane, metres, shape ``(k, 2)``."""
        return self.points[self.first[lane] : self.first[lane + 1]]

    def following(self, lane: int) -> Ints:
        """Lanes that follow a lane."""
        return self.next[self.next_first[lane] : self.next_first[lane + 1]]

    def preceding(self, lane: int) -> Ints:
        """Lanes that lead into a lane."""
        return self.previous[self.previous_first[lane] : self.previous_first[lane + 1]]

    def at(self, lane: ArrayLike, offset: ArrayLike) -> Floats:
        """Poses along lanes.

        Parameters
        ----------
        lane, offset
            Lane numbers and metres from their starts, shape ``(n,)`` (or scalars).

        Returns
        -------
        ndarray
            x, y, yaw, shape ``(n, 3)`` (or ``(3,)``).
        """
        lanes, offsets = np.broadcast_arrays(np.asarray(lane, np.int32), np.asarray(offset, np.float64))
        out = _poses(self.first, self.points, self.along, np.atleast_1d(lanes).copy(), np.atleast_1d(offsets).copy())
        return out if lanes.ndim else out[0]

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree([shapely.LineString(self.line(i)) for i in range(len(self))])

    def nearest(
        self, xy: ArrayLike, among: NDArray[np.bool_] | None = None, reach: float = 60.0
    ) -> tuple[int, float, float] | None:
        """Return the street lane whose centre line is nearest to a point.

        Parameters
        ----------
        xy
            A point, metres.
        among
            Which lanes count, bool, shape ``(n,)``; street lanes that are not inside a junction where not given.
        reach
            Metres beyond which nothing is found.

        Returns
        -------
        tuple of int, float, float, or None
            Lane, metres along it, metres away from it.
        """
        allowed = self.inside < 0 if among is None else among
        point = shapely.Point(float(np.asarray(xy)[0]), float(np.asarray(xy)[1]))
        hits = np.sort(self._tree.query(point, predicate="dwithin", distance=reach))
        hits = hits[allowed[hits]]
        if not len(hits):
            return None
        lines = self._tree.geometries[hits]
        away = shapely.distance(lines, point)
        best = int(np.argmin(away))
        return int(hits[best]), float(shapely.line_locate_point(lines[best], point)), float(away[best])

    @cached_property
    def component(self) -> Ints:
        """Number of the strongly connected part each lane belongs to, int32; 0 = the longest. Bus lanes count too."""
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import connected_components

        n = len(self)
        graph = csr_matrix((np.ones(len(self.next), np.int8), self.next, self.next_first), shape=(n, n))
        _, labels = connected_components(graph, directed=True, connection="strong")
        sizes = np.bincount(labels, weights=self.length)
        rank = np.argsort(-sizes, kind="stable")
        renamed = np.empty(len(rank), np.int32)
        renamed[rank] = np.arange(len(rank), dtype=np.int32)
        return renamed[labels]


@compiled
def lane_pose(first, points, along, lane, offset):
    """x, y, yaw at `offset` metres along a lane; beyond its ends, on along the end's direction."""
    low, high = first[lane], first[lane + 1] - 1
    a, b = low, high
    while b - a > 1:
        middle = (a + b) // 2
        if along[middle] <= offset:
            a = middle
        else:
            b = middle
    dx, dy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    length = along[b] - along[a]
    share = (offset - along[a]) / length
    return points[a, 0] + dx * share, points[a, 1] + dy * share, np.arctan2(dy, dx)


@compiled
def _poses(first, points, along, lane, offset):
    out = np.empty((len(lane), 3))
    for i in range(len(lane)):
        out[i, 0], out[i, 1], out[i, 2] = lane_pose(first, points, along, lane[i], offset[i])
    return out


class DisjointSets:
    """Numbers in sets that can be joined; the least number stands for its set."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))

    def root(self, j: int) -> int:
        """Return the number that stands for the set of `j`."""
        parent = self._parent
        while parent[j] != j:
            parent[j] = parent[parent[j]]
            j = parent[j]
        return j

    def join(self, a: int, b: int) -> None:
        """Make the sets of two numbers one."""
        a, b = self.root(a), self.root(b)
        self._parent[max(a, b)] = min(a, b)


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
        lanes, junctions, links, programs, lefthand = _parse_network(path)
        driven = [lane for lane in lanes if (lane.cars or lane.buses) and lane.function in ("normal", "internal")]
        lights = Signals.of(programs, links, {lane.id: i for i, lane in enumerate(driven)})
    except (ParseError, DefusedXmlException, KeyError, ValueError) as error:
        raise SchemaError(f"{path}: not a readable SUMO network ({error}); build the world anew") from None
    return replace(_build_graph(driven, lanes, junctions, links, lefthand=lefthand), lights=lights)


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


def _parse_network(path: Path) -> tuple[list[_Lane], list[_Attributes], list[_Attributes], list[SignalProgram], bool]:
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


def _adjacent_lanes(driven: list[_Lane], step: int) -> Ints:
    """Return the lane beside each, -1 for none; lanes inside junctions have none."""
    by_place = {(lane.edge, lane.index): i for i, lane in enumerate(driven)}
    found = [-1 if lane.function == "internal" else by_place.get((lane.edge, lane.index + step), -1) for lane in driven]
    return np.array(found, np.int32)


def _build_graph(
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
    index = {lane.id: i for i, lane in enumerate(driven)}
    ends = [
        (
            index.get(f"{link['from']}_{link['fromLane']}"),
            index.get(link.get("via") or f"{link['to']}_{link['toLane']}"),
        )
        for link in links
    ]
    pairs = [(start, end) for start, end in ends if start is not None and end is not None]
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
        left=_adjacent_lanes(driven, 1),
        right=_adjacent_lanes(driven, -1),
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
