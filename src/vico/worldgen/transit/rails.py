"""Trams and trains: the map's routes on rails above ground, as tracks through the window with a timetable."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo.gtfs_feed import DAY, Feed, Pattern
from vico.geo.osm import OsmData, OsmRelation, OsmWay
from vico.geometry import arc_lengths, points_along
from vico.rules import BUS_DWELL, TRAM_WIDTH
from vico.world.heights import HeightField
from vico.world.model import Dropped
from vico.world.transit import TRAM_LENGTH, Track, TramLine, TramStop, tram_door
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.site import SiteFacts, is_bridge, on_the_ground
from vico.worldgen.transit.plan import as_many
from vico.worldgen.transit.routes import interval_of

_ROUTES = {"tram": "tram", "light_rail": "light_rail", "train": "rail"}
_RAILS = ("tram", "light_rail", "rail")
_LEAST_TRACK = 90.0  # metres of track through the window worth a line
_MOST_LINES = 3  # lines of a district, both ways each: with more, streets stand full of trams
_STOP_REACH = 6.0  # metres between a track and a pole or platform of its own
_FEED_REACH = 30.0
_STOPS_APART = 60.0
_SAME_TRACK = 4.0
_EDGE = 3.0  # metres from the window's edge within which tracks lead out of it
_FIRST, _LAST, _HEADWAY = 5 * 3600, 23 * 3600 + 1800, 600
_STAGGER = 130  # seconds between the first trams of two lines
_RUN_SHARE, _RUN_MORE = 1.15, 4.0  # what streets cost, a share and seconds a stretch
_COLOURS = {"tram": "#00985f", "light_rail": "#0098a1", "rail": "#8c4799"}
_GAP = 1.0  # metres between where a tram's door is and where one waits
_HEX = re.compile(r"#[0-9a-fA-F]{6}")


@dataclass
class _Route:
    """A route in one direction through the window."""

    id: str
    name: str
    kind: str
    colour: str
    track: Track
    line: NDArray[np.float64]
    interval: int | None
    relation: OsmRelation
    stops: list[tuple[str, str, float]] = field(default_factory=list)  # key, name, metres along
    departures: list[int] = field(default_factory=list)


def trams_from_osm(
    site: SiteFacts,
    height: HeightField,
    *,
    solids: Sequence[shapely.Polygon] = (),
    feeds: Sequence[Feed] = (),
    first_entity: int,
) -> tuple[list[TramStop], list[TramLine], list[Dropped]]:
    """Lay the map's tram and train routes through the window.

    Parameters
    ----------
    site
        The map and its facts.
    height
        Ground heights.
    solids
        What nobody waits in.
    feeds
        Timetables of the same window: what runs on rails leaves by them where they name the line.
    first_entity
        Of the stops.

    Returns
    -------
    tuple
        Stops, lines (one a direction), and routes on rails above ground that no line drives.
    """
    left_out: list[Dropped] = []
    routes = _routes(site, left_out)
    chosen = _chosen(routes, site.osm, left_out)
    stops: dict[str, TramStop] = {}
    lines: list[TramLine] = []
    for number, route in enumerate(chosen):
        with drop_on_failure(route.id):
            _find_stops(route, site.osm, feeds)
            travel = _travel(route)
            route.departures = _departures(route, feeds, travel, number)
            ids = []
            for key, name, offset in route.stops:
                if key not in stops:
                    wait = _wait(route.track, offset, site.left_driving, solids)
                    entity = first_entity + len(stops)
                    z = round(float(height(wait)), 3)
                    stops[key] = TramStop(
                        id=f"tram_stop_{len(stops)}",
                        entity=entity,
                        name=name,
                        wait=(round(wait[0], 3), round(wait[1], 3), z),
                    )
                ids.append(stops[key].id)
            lines.append(
                TramLine(
                    id=f"tram_{number}",
                    name=route.name,
                    kind=route.kind,
                    colour=route.colour,
                    track=[(round(float(x), 2), round(float(y), 2)) for x, y in route.line],
                    stops=ids,
                    offsets=[round(offset, 2) for _, _, offset in route.stops],
                    departures=route.departures,
                    travel=travel,
                )
            )
    return list(stops.values()), lines, left_out


def _routes(site: SiteFacts, left_out: list[Dropped]) -> list[_Route]:
    osm = site.osm
    ways = {
        way.id: way
        for way in osm.ways
        if way.tags.get("railway") in _RAILS
        and len(way.line) > 1
        and on_the_ground(way.tags)
        and not (is_bridge(way.tags) and way.id in site.levels.above)
    }
    found: list[_Route] = []
    for relation in sorted(osm.relations, key=lambda r: r.id):
        tags = relation.tags
        kind = _ROUTES.get(tags.get("route", ""))
        if kind is None or tags.get("type", "route") != "route" or tags.get("state") in ("proposed", "abandoned"):
            continue
        with drop_on_failure(f"r{relation.id}"):
            pieces = _pieces(relation, ways)
            runs = [run for piece in pieces for run in _within(piece, osm)]
            name = tags.get("ref") or tags.get("name") or "Tram"
            if not runs:
                continue
            line = max(runs, key=_length)
            if _length(line) < _LEAST_TRACK:
                left_out.append(
                    Dropped(id=f"r{relation.id}", reason=f"{kind} {name}: {_length(line):.0f} m of track in the window")
                )
                continue
            colour = tags.get("colour", "")
            found.append(
                _Route(
                    f"r{relation.id}",
                    name,
                    kind,
                    colour.lower() if _HEX.fullmatch(colour) else _COLOURS[kind],
                    Track(line),
                    line,
                    interval_of(tags),
                    relation,
                )
            )
    return found


def _pieces(relation: OsmRelation, ways: Mapping[int, OsmWay]) -> list[NDArray[np.float64]]:
    """Tracks of a relation in the direction its ways follow one another."""
    chains: list[tuple[list[int], list[NDArray[np.float64]], float]] = []
    for kind, ref, role in relation.members:
        way = ways.get(ref) if kind == "w" else None
        if way is None or "platform" in role or "stop" in role:
            continue
        against = -1.0 if way.tags.get("oneway") == "-1" else 1.0 if way.tags.get("oneway") == "yes" else 0.0
        nodes, line = list(way.nodes), way.line
        if len(nodes) != len(line):
            continue
        if chains:
            ends, lines, votes = chains[-1]
            if len(lines) == 1 and ends[0] in (nodes[0], nodes[-1]) and ends[-1] not in (nodes[0], nodes[-1]):
                ends.reverse()
                lines[0], votes = lines[0][::-1], -votes
            if ends[-1] in (nodes[0], nodes[-1]):
                forward = ends[-1] == nodes[0]
                ends[-1] = nodes[-1] if forward else nodes[0]
                lines.append(line if forward else line[::-1])
                chains[-1] = ends, lines, votes + (against if forward else -against) * _length(line)
                continue
        chains.append(([nodes[0], nodes[-1]], [line], against * _length(line)))
    pieces = []
    for _, lines, votes in chains:
        whole = np.concatenate([lines[0], *(line[1:] for line in lines[1:])])
        pieces.append(whole[::-1] if votes < 0 else whole)
    return pieces


def _within(line: NDArray[np.float64], osm: OsmData) -> list[NDArray[np.float64]]:
    """Stretches of a line inside the window, a point a metre."""
    along = arc_lengths(line)
    s = np.arange(0.0, along[-1], 1.0)
    points = points_along(line, s, along)
    inside = osm.holds(points)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
    runs = [points[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 1]
    return [shapely.get_coordinates(shapely.LineString(run).simplify(0.04)) for run in runs]


def _length(line: NDArray[np.float64]) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _chosen(routes: Sequence[_Route], osm: OsmData, left_out: list[Dropped]) -> list[_Route]:
    """Choose lines that together run on the most track, each with its longest route of either direction.

    Where none of them is a railway one more is chosen that is and leads through the window.
    """
    named: dict[str, list[_Route]] = defaultdict(list)
    for route in routes:
        named[route.name].append(route)
    lines = []
    for _, members in sorted(named.items()):
        members.sort(key=lambda route: (-route.track.length, route.id))
        first = members[0]
        start, end = first.line[0], first.line[-1]
        back = [r for r in members[1:] if math.dist(r.line[0], end) < math.dist(r.line[0], start)]
        lines.append([first, *back[:1]])
    chosen: list[list[_Route]] = []
    covered = shapely.Polygon()
    most = as_many(_MOST_LINES, osm)
    while lines and len(chosen) < most:
        ways = [shapely.MultiLineString([route.line for route in line]) for line in lines]
        fresh = [round(way.difference(covered).length) for way in ways]
        best = max(range(len(lines)), key=lambda k: (fresh[k], ways[k].length, -k))
        covered = covered.union(ways[best].buffer(_SAME_TRACK))
        chosen.append(lines.pop(best))
    trains = [line for line in lines if line[0].kind == "rail" and all(_leads_through(r, osm) for r in line)]
    if trains and not any(line[0].kind == "rail" for line in chosen):
        # A railway is in no street: one goes beside as many trams.
        best_train = max(trains, key=lambda line: (sum(route.track.length for route in line), line[0].id))
        lines.remove(best_train)
        chosen.append(best_train)
    left_out += [
        Dropped(id=line[0].id, reason=f"{line[0].kind} {line[0].name}: {len(chosen)} other lines on rails are driven")
        for line in lines
    ]
    return [route for line in chosen for route in line]


def _leads_through(route: _Route, osm: OsmData) -> bool:
    """Return whether a route comes into the window at its edge and goes out there."""
    return not osm.holds(route.line[[0, -1]], inset=_EDGE).any()


def _find_stops(route: _Route, osm: OsmData, feeds: Sequence[Feed]) -> None:
    """Find where trams of a route stop: the relation's own stops, else stops on its track, else the timetable's."""
    track = shapely.LineString(route.line)
    members = {
        ref for kind, ref, role in route.relation.members if kind == "n" and ("stop" in role or "platform" in role)
    }
    own = [node for node in osm.nodes if node.id in members]
    on_track = [node for node in osm.nodes if node.tags.get("railway") in ("tram_stop", "halt", "stop")]
    spots = [(f"n{node.id}", node.tags.get("name") or "Stop", node.xy, _STOP_REACH) for node in own]
    if not spots:
        spots = [(f"n{node.id}", node.tags.get("name") or "Stop", node.xy, 2.0) for node in on_track]
    if not spots:
        poles = {s.id: s for feed in feeds for s in feed.stops}
        called = {s for pattern in _patterns(route, feeds) for s in pattern.stops}
        spots = [(f"gtfs:{s}", poles[s].name, np.array(poles[s].xy), _FEED_REACH) for s in sorted(called)]
    found = []
    for key, name, xy, reach in spots:
        point = shapely.Point(xy)
        if track.distance(point) <= reach:
            found.append((float(track.project(point)), key, name))
    for at, key, name in sorted(found):
        # The tram's middle comes to rest where the map has the stop.
        offset = min(max(at + TRAM_LENGTH / 2, TRAM_LENGTH + 2.0), route.track.length - 3.0)
        if abs(offset - TRAM_LENGTH / 2 - at) < TRAM_LENGTH / 2 and (
            not route.stops or offset - route.stops[-1][2] > _STOPS_APART
        ):
            route.stops.append((key, name, offset))


def _travel(route: _Route) -> list[float]:
    """Scheduled seconds to every stop and to the end of the track."""
    clock, here, travel = 0.0, 0.0, []
    for _, _, offset in route.stops:
        clock += route.track.seconds(here, offset) * _RUN_SHARE + _RUN_MORE
        travel.append(round(clock, 1))
        clock, here = clock + BUS_DWELL, offset
    clock += route.track.seconds(here, route.track.length, standing=False) * _RUN_SHARE + _RUN_MORE
    return [*travel, round(clock, 1)]


def _departures(route: _Route, feeds: Sequence[Feed], travel: Sequence[float], number: int) -> list[int]:
    """When trams come in: by a timetable that names the line, else every ten minutes or as often as the map says."""
    times: set[int] = set()
    poles = {s.id: s.xy for feed in feeds for s in feed.stops}
    track = shapely.LineString(route.line)
    for pattern in _patterns(route, feeds):
        near = [
            (k, poles[s]) for k, s in enumerate(pattern.stops) if track.distance(shapely.Point(poles[s])) <= _FEED_REACH
        ]
        along = [float(track.project(shapely.Point(xy))) for _, xy in near]
        if len(near) < 2 or not all(a < b for a, b in pairwise(along)):
            continue
        before = route.track.seconds(0.0, along[0])
        times |= {round(begin + pattern.travel[near[0][0]] - before) % DAY for begin in pattern.departures}
    if times:
        return sorted(times)
    headway = route.interval or _HEADWAY
    return list(range(_FIRST + number * _STAGGER % headway, _LAST, headway))


def _patterns(route: _Route, feeds: Sequence[Feed]) -> list[Pattern]:
    return [
        pattern
        for feed in feeds
        for pattern in feed.patterns
        if pattern.route in {r.id for r in feed.routes if r.kind == "tram" and r.name == route.name}
    ]


def _wait(track: Track, offset: float, left_driving: bool, solids: Sequence[shapely.Polygon]) -> tuple[float, float]:
    """Find where people wait: beside the second door, on the side of the kerb, else on the other one."""
    tree = shapely.STRtree(list(solids))
    best: tuple[float, float] | None = None
    for side in (-1.0, 1.0) if left_driving else (1.0, -1.0):
        for door in (1, 2, 0, 3):
            (x, y), (mx, my) = tram_door(track, offset, door, side)
            share = 1.0 + _GAP / (TRAM_WIDTH / 2)
            spot = mx + (x - mx) * share, my + (y - my) * share
            best = best or spot
            if not len(tree.query(shapely.Point(spot).buffer(0.4), predicate="intersects")):
                return spot
    assert best is not None
    return best
