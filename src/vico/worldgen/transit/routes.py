"""Bus routes as the map's relations and timetable feeds have them, before anything is driven."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from vico.geo.gtfs_feed import DAY, Feed, GtfsRoute, Pattern
from vico.geo.osm import OsmData, OsmRelation, Tags
from vico.world.model import Dropped
from vico.world.opening_hours import weekly_hours
from vico.worldgen.facts.fault_isolation import drop_on_failure

NOT_ON_THE_MAP = "its rails are not on the map, or not chosen"
_SAME_STOP = 60.0  # metres within which a platform and a stop position of one name are one stop
_BESIDE = 35.0  # and of any name, where one follows the other in the relation
_GONE = ("disused", "abandoned", "proposed", "construction", "razed", "removed")
_WORKING_DAY = 1  # Tuesday, 0 Monday
_CLOCK = re.compile(r"(?:(\d{1,2}):)?(\d{1,3})(?::(\d\d))?")
_PERIOD = re.compile(r"PT(?:(\d+)H)?(?:(\d+)M)?", re.IGNORECASE)
_HEX = re.compile(r"#(?:[0-9a-fA-F]{3}|[0-9a-fA-F]{6})")


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
                    departures=_departures(lead, patterns),
                )
            )
    routes.sort(key=lambda route: (-len(route.departures), route.name))
    return routes, dropped


def _departures(lead: Pattern, patterns: Sequence[Pattern]) -> tuple[int, ...]:
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
    if not _HEX.fullmatch(text):
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
