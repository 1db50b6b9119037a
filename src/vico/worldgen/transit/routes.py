"""Routes of the map's relations and of timetable feeds: bus routes, and trams and trains as tracks.

Trams and trains are the map's routes on rails above ground, laid through the window with a timetable.
"""

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

from vico.geo.gtfs_feed import DAY, Feed, GtfsRoute, Pattern
from vico.geo.osm import OsmData, OsmRelation, OsmWay, Tags
from vico.geometry import arc_lengths, points_along
from vico.rules import BUS_DWELL, TRAM_WIDTH
from vico.world.heights import HeightField
from vico.world.model import Dropped
from vico.world.opening_hours import weekly_hours
from vico.world.transit import TRAM_LENGTH, Track, TramLine, TramStop, tram_door
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.site import SiteFacts, is_bridge, on_the_ground
from vico.worldgen.transit.bus_lines import scaled_by_area

NOT_ON_THE_MAP = "its rails are not on the map, or not chosen"
_SAME_STOP = 60.0  # metres within which a platform and a stop position of one name are one stop
_BESIDE = 35.0  # and of any name, where one follows the other in the relation
_GONE = ("disused", "abandoned", "proposed", "construction", "razed", "removed")
_WORKING_DAY = 1  # Tuesday, 0 Monday
_CLOCK = re.compile(r"(?:(\d{1,2}):)?(\d{1,3})(?::(\d\d))?")
_PERIOD = re.compile(r"PT(?:(\d+)H)?(?:(\d+)M)?", re.IGNORECASE)
_SHORT_OR_LONG_HEX = re.compile(r"#(?:[0-9a-fA-F]{3}|[0-9a-fA-F]{6})")


@dataclass(frozen=True)
class Pole:
    """A stop of a route: its id at the source, its name, and where it is, ENU metres."""

    key: str
    name: str
    xy: tuple[float, float]


@dataclass(frozen=True)
class Route:
    """A bus route within a window.

    Attributes
    ----------
    id
        At the source: ``r123``, ``gtfs:33``.
    there, back
        Stops in order, and those of the way back (empty where nobody says).
    way
        Lines it is mapped on, None where nobody says.
    departures
        Seconds of the day at which a bus leaves the first stop; empty where no feed says.
    interval, hours
        Seconds between two buses and the span of the day they run in, where the map says.
    """

    id: str
    name: str
    colour: str
    origin: str
    there: tuple[Pole, ...]
    back: tuple[Pole, ...]
    way: shapely.Geometry | None = None
    departures: tuple[int, ...] = ()
    interval: int | None = None
    hours: tuple[int, int] | None = None


def routes_from_osm(osm: OsmData) -> tuple[list[Route], list[Dropped]]:
    """Routes of the map's relations (both schemas of public transport) with two stops or more in the window."""
    spots = _spots(osm)
    lines = {way.id: way.line for way in osm.ways}
    grouped: dict[tuple[str, str], list[tuple[OsmRelation, list[Pole]]]] = defaultdict(list)
    for relation in sorted(osm.relations, key=lambda r: r.id):
        tags = relation.tags
        name = tags.get("ref") or tags.get("name")
        if tags.get("route") not in ("bus", "trolleybus") or not name or tags.get("type", "route") != "route":
            continue
        if any(tags.get(key) == "yes" for key in _GONE) or tags.get("state") in ("proposed", "abandoned"):
            continue
        with drop_on_failure(f"r{relation.id}"):
            for run in _runs(relation, spots, osm):
                grouped[name, tags.get("network", "") or tags.get("operator", "")].append((relation, run))
    routes: list[Route] = []
    dropped: list[Dropped] = []
    for (name, _), members in grouped.items():
        members = sorted(members, key=lambda row: (-len(row[1]), row[0].id))
        first, there = members[0]
        if not there:
            continue
        back = _way_back(there, [run for _, run in members[1:]])
        if len(there) + len(back) < 2:
            dropped.append(Dropped(id=f"r{first.id}", reason=f"bus {name}: one stop in the window"))
            continue
        ways = [lines[ref] for relation, _ in members for kind, ref, _ in relation.members
                if kind == "w" and ref in lines and len(lines[ref]) > 1]  # fmt: skip
        tags = first.tags
        routes.append(
            Route(
                id=f"r{first.id}",
                name=name,
                colour=_colour(tags.get("colour", "")),
                origin="osm",
                there=tuple(there),
                back=tuple(back),
                way=shapely.multilinestrings([shapely.LineString(line) for line in ways]) if ways else None,
                interval=interval_of(tags),
                hours=_hours(tags),
            )
        )
    return routes, dropped


def routes_from_gtfs(feeds: Sequence[Feed]) -> tuple[list[Route], list[Dropped]]:
    """Routes of timetable feeds with two stops or more in the window, those with the most departures first."""
    routes: list[Route] = []
    dropped: list[Dropped] = []
    for feed in feeds:
        poles = {stop.id: Pole(f"gtfs:{stop.id}", stop.name, stop.xy) for stop in feed.stops}
        groups: dict[tuple[str, str], list[GtfsRoute]] = defaultdict(list)
        for route in feed.routes:
            if route.kind == "tram":
                dropped.append(Dropped(id=f"gtfs:{route.id}", reason=f"tram {route.name}: {NOT_ON_THE_MAP}"))
            else:
                groups[route.name, route.agency].append(route)
        for (name, _), members in groups.items():
            ids = {route.id for route in members}
            patterns = [p for p in feed.patterns if p.route in ids]
            patterns.sort(key=lambda p: (len(p.stops) < 2, -len(p.departures), p.stops))
            if not patterns:
                dropped.append(
                    Dropped(id=f"gtfs:{members[0].id}", reason=f"bus {name}: does not run on {feed.day or 'any day'}")
                )
                continue
            lead = patterns[0]
            there = [poles[s] for s in lead.stops]
            others = [p for p in patterns[1:] if not (lead.direction and p.direction == lead.direction)]
            back = _way_back(there, [[poles[s] for s in p.stops] for p in others])
            if len(there) + len(back) < 2:
                dropped.append(Dropped(id=f"gtfs:{members[0].id}", reason=f"bus {name}: one stop in the window"))
                continue
            routes.append(
                Route(
                    id=f"gtfs:{lead.route}",
                    name=name,
                    colour=next((route.colour for route in members if route.colour), ""),
                    origin="gtfs",
                    there=tuple(there),
                    back=tuple(back),
                    way=_way_of(patterns),
                    departures=_bus_departures(lead, patterns),
                )
            )
    routes.sort(key=lambda route: (-len(route.departures), route.name))
    return routes, dropped


def _bus_departures(lead: Pattern, patterns: Sequence[Pattern]) -> tuple[int, ...]:
    """When buses leave the lead's first stop towards its last one, by any of the patterns; seconds of the day."""
    times: set[int] = set()
    for pattern in patterns:
        if lead.stops[0] in pattern.stops:
            at = pattern.stops.index(lead.stops[0])
            if lead.stops[-1] in pattern.stops[at:]:
                times |= {(begin + pattern.travel[at]) % DAY for begin in pattern.departures}
    return tuple(sorted(times))


def _way_of(patterns: Sequence[Pattern]) -> shapely.Geometry | None:
    lines = [shapely.LineString(pattern.line) for pattern in patterns if len(pattern.line) > 1]
    return shapely.multilinestrings(lines) if lines else None


def _way_back(there: Sequence[Pole], others: Sequence[Sequence[Pole]]) -> list[Pole]:
    """Of the other runs, the longest that is no variant of the way there."""
    keys = {pole.key for pole in there}

    def returns(run: Sequence[Pole]) -> bool:
        if not run or 2 * len(keys & {pole.key for pole in run}) >= min(len(keys), len(run)):
            return False
        if len(there) < 2 or len(run) < 2:
            return True
        # It starts where the way there ends, rather than where that starts.
        a, b, c = (np.array(p.xy) for p in (there[0], there[-1], run[0]))
        return math.hypot(*(c - b)) < math.hypot(*(c - a))

    return max((list(run) for run in others if returns(run)), key=lambda run: len(run), default=[])


def _spots(osm: OsmData) -> dict[str, tuple[str, tuple[float, float], int, bool]]:
    """List what stops are mapped as: name, place, rank (platform before pole before stop position), whether one."""
    spots: dict[str, tuple[str, tuple[float, float], int, bool]] = {}
    for node in osm.nodes:
        name, rank, is_stop = _spot(node.tags)
        spots[f"n{node.id}"] = (name, (float(node.xy[0]), float(node.xy[1])), rank, is_stop)
    for way in osm.ways:
        name, rank, is_stop = _spot(way.tags)
        if is_stop:
            x, y = way.line.mean(axis=0)
            spots[f"w{way.id}"] = (name, (float(x), float(y)), rank, True)
    return spots


def _spot(tags: Tags) -> tuple[str, int, bool]:
    kind = tags.get("public_transport", "")
    rank = (
        0 if kind == "platform" or tags.get("highway") == "platform" else 1 if tags.get("highway") == "bus_stop" else 2
    )
    return tags.get("name", ""), rank, rank < 2 or kind == "stop_position"


def _runs(
    relation: OsmRelation, spots: dict[str, tuple[str, tuple[float, float], int, bool]], osm: OsmData
) -> list[list[Pole]]:
    """List the stops of a relation in order; two runs where an old relation has both directions in it."""
    both: tuple[list[tuple[Pole, int]], list[tuple[Pole, int]]] = ([], [])
    split = any(role.startswith(("forward", "backward")) and "stop" in role for *_, role in relation.members)
    for kind, member, role in relation.members:
        key = f"{kind}{member}"
        if key not in spots:
            continue
        name, xy, rank, is_stop = spots[key]
        if not (is_stop or "stop" in role or "platform" in role) or not osm.holds(xy):
            continue
        for run, other in zip(both, ("backward", "forward"), strict=True):
            if role.startswith(other) or (run is both[1] and not split):
                continue
            pole = Pole(key, name, xy)
            if run and _is_same(run[-1][0], pole):
                if rank < run[-1][1]:
                    run[-1] = (Pole(key, name or run[-1][0].name, xy), rank)
            elif all(known.key != key for known, _ in run):
                run.append((pole, rank))
    there = [pole for pole, _ in both[0]]
    back = [pole for pole, _ in both[1]]
    if not split:
        return [there]
    # Many list the stops of the way back in the order of the way there.
    if there and len(back) > 1 and math.dist(back[0].xy, there[0].xy) < math.dist(back[-1].xy, there[0].xy):
        back.reverse()
    return [there, back]


def _is_same(one: Pole, other: Pole) -> bool:
    away = math.dist(one.xy, other.xy)
    return away < (_SAME_STOP if one.name and one.name == other.name else _BESIDE)


def _colour(text: str) -> str:
    text = text.strip()
    if not _SHORT_OR_LONG_HEX.fullmatch(text):
        return ""
    return text.lower() if len(text) == 7 else "#" + "".join(2 * c for c in text[1:].lower())


def interval_of(tags: Tags) -> int | None:
    """Seconds between two buses: ``interval`` (or ``headway``) as minutes, hh:mm, hh:mm:ss or an ISO 8601 period."""
    text = (tags.get("interval") or tags.get("headway") or "").split(";")[0].strip()
    if period := _PERIOD.fullmatch(text):
        seconds = int(period[1] or 0) * 3600 + int(period[2] or 0) * 60
    elif clock := _CLOCK.fullmatch(text):
        seconds = int(clock[1] or 0) * 3600 + int(clock[2]) * 60 + int(clock[3] or 0)
    else:
        return None
    return seconds if 60 <= seconds <= 4 * 3600 else None


def _hours(tags: Tags) -> tuple[int, int] | None:
    """Return the first and the last second at which the map says that buses run on an ordinary working day."""
    week = weekly_hours(tags.get("opening_hours") or tags.get("service_times") or tags.get("hours") or "")
    if week is None or not (spans := week[_WORKING_DAY]):
        return None
    return spans[0][0] * 60, min(spans[-1][1] * 60, DAY)


_ROUTES = {"tram": "tram", "light_rail": "light_rail", "train": "rail"}
_RAILS = ("tram", "light_rail", "rail")
_LEAST_TRACK = 90.0  # metres of track through the window worth a line
_MOST_LINES = 3  # lines of a district, both ways each: with more, streets stand full of trams
_STOP_REACH = 6.0  # metres between a track and a pole or platform of its own
FEED_REACH = 30.0  # metres from a stop of a timetable, whose places are rougher, to its track or lane
_STOPS_APART = 60.0
_SAME_TRACK = 4.0
_EDGE = 3.0  # metres from the window's edge within which tracks lead out of it
_FIRST, _LAST, _HEADWAY = 5 * 3600, 23 * 3600 + 1800, 600
_STAGGER = 130  # seconds between the first trams of two lines
_RUN_SHARE = 1.15  # what streets cost, a share
_RUN_MORE = 4.0  # and seconds a stretch
_COLOURS = {"tram": "#00985f", "light_rail": "#0098a1", "rail": "#8c4799"}
_GAP = 1.0  # metres between where a tram's door is and where one waits
_HEX = re.compile(r"#[0-9a-fA-F]{6}")


@dataclass
class _RailRoute:
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
    routes = _rail_routes(site, left_out)
    chosen = _choose_routes(routes, site.osm, left_out)
    stops: dict[str, TramStop] = {}
    lines: list[TramLine] = []
    for number, route in enumerate(chosen):
        with drop_on_failure(route.id):
            _find_stops(route, site.osm, feeds)
            travel = _travel(route)
            route.departures = _tram_departures(route, feeds, travel, number)
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


def _rail_routes(site: SiteFacts, left_out: list[Dropped]) -> list[_RailRoute]:
    osm = site.osm
    ways = {
        way.id: way
        for way in osm.ways
        if way.tags.get("railway") in _RAILS
        and len(way.line) > 1
        and on_the_ground(way.tags)
        and not (is_bridge(way.tags) and way.id in site.levels.above)
    }
    found: list[_RailRoute] = []
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
                _RailRoute(
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


def _choose_routes(routes: Sequence[_RailRoute], osm: OsmData, left_out: list[Dropped]) -> list[_RailRoute]:
    """Choose lines that together run on the most track, each with its longest route of either direction.

    Where none of them is a railway one more is chosen that is and leads through the window.
    """
    named: dict[str, list[_RailRoute]] = defaultdict(list)
    for route in routes:
        named[route.name].append(route)
    lines = []
    for _, members in sorted(named.items()):
        members.sort(key=lambda route: (-route.track.length, route.id))
        first = members[0]
        start, end = first.line[0], first.line[-1]
        back = [r for r in members[1:] if math.dist(r.line[0], end) < math.dist(r.line[0], start)]
        lines.append([first, *back[:1]])
    chosen: list[list[_RailRoute]] = []
    covered = shapely.Polygon()
    most = scaled_by_area(_MOST_LINES, osm)
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


def _leads_through(route: _RailRoute, osm: OsmData) -> bool:
    """Return whether a route comes into the window at its edge and goes out there."""
    return not osm.holds(route.line[[0, -1]], inset=_EDGE).any()


def _find_stops(route: _RailRoute, osm: OsmData, feeds: Sequence[Feed]) -> None:
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
        spots = [(f"gtfs:{s}", poles[s].name, np.array(poles[s].xy), FEED_REACH) for s in sorted(called)]
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


def _travel(route: _RailRoute) -> list[float]:
    """Scheduled seconds to every stop and to the end of the track."""
    clock, here, travel = 0.0, 0.0, []
    for _, _, offset in route.stops:
        clock += route.track.seconds(here, offset) * _RUN_SHARE + _RUN_MORE
        travel.append(round(clock, 1))
        clock, here = clock + BUS_DWELL, offset
    clock += route.track.seconds(here, route.track.length, standing=False) * _RUN_SHARE + _RUN_MORE
    return [*travel, round(clock, 1)]


def _tram_departures(route: _RailRoute, feeds: Sequence[Feed], travel: Sequence[float], number: int) -> list[int]:
    """When trams come in: by a timetable that names the line, else every ten minutes or as often as the map says."""
    times: set[int] = set()
    poles = {s.id: s.xy for feed in feeds for s in feed.stops}
    track = shapely.LineString(route.line)
    for pattern in _patterns(route, feeds):
        near = [
            (k, poles[s]) for k, s in enumerate(pattern.stops) if track.distance(shapely.Point(poles[s])) <= FEED_REACH
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


def _patterns(route: _RailRoute, feeds: Sequence[Feed]) -> list[Pattern]:
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
