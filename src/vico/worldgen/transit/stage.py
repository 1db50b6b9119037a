"""Public transport: stops, bus lines from timetables, the map or planned, all driveable, and bicycle stations.

Bicycle stations are those of the map, else planned on sidewalks near where people go.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.geo.gtfs_feed import NO_TIMETABLE, Feed
from vico.geo.osm import OsmData
from vico.geometry import distances
from vico.rules import BUS_DOOR_BEHIND_FRONT
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.model import FAILED, FIRST_STOP, Dropped
from vico.world.transit import BikeStation, Line, Stop, Transit
from vico.world.walkways import SIDEWALK, Walkways
from vico.worldgen.facts.fault_isolation import drop_on_failure, leave_out
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.transit.bus_lines import (
    BUS_LENGTH,
    BUS_SPEED,
    DWELL,
    FIRST_DEPARTURE,
    HEADWAY,
    LAST_DEPARTURE,
    MAX_LOOP,
    MAX_STOPS,
    MIN_STOPS,
    Berth,
    Drive,
    Kerbs,
    Timing,
    destinations,
    k_means,
    line_record,
    merge_berth,
    planned_berths,
    planned_loop,
    scaled_by_area,
    timing,
    width_in_districts,
)
from vico.worldgen.transit.routes import (
    FEED_REACH,
    NOT_ON_THE_MAP,
    Pole,
    Route,
    routes_from_gtfs,
    routes_from_osm,
    trams_from_osm,
)

__all__ = [
    "BUS_LENGTH",
    "BUS_SPEED",
    "DWELL",
    "FIRST_DEPARTURE",
    "FIRST_STATION",
    "FIRST_STOP",
    "HEADWAY",
    "LAST_DEPARTURE",
    "bike_stations",
    "transit_from_osm",
]
FIRST_STATION = 95_000

_CAPACITY = 12
_EACH = 40_000.0  # square metres of window for each planned station
_FEWEST = 2  # stations of shared bicycles
_MOST = 6
_APART = 80.0
_INSIDE = 5.0  # metres from the window's edge
_ASIDE = 2.2  # metres from the middle of a footway
_FOOTWAYS = ("pedestrian", "footway", "living_street", "path", "cycleway")


def bike_stations(
    site: SiteFacts, lanes: LaneGraph, walks: Walkways, height: HeightField, seed: int
) -> tuple[list[BikeStation], str]:
    """Rental stations and where they come from (osm, planned)."""
    osm = site.osm
    random = rng(seed, "transit", "bikes")
    found: list[tuple[NDArray[np.float64], str, int]] = []
    places = [(f"n{n.id}", shapely.Point(n.xy), n.tags) for n in osm.nodes]
    places += [(a.id, a.polygon, a.tags) for a in osm.areas if not a.polygon.is_empty]
    for key, shape, tags in places:
        if tags.get("amenity") != "bicycle_rental":
            continue
        with drop_on_failure(key):
            xy = np.array(shape.centroid.coords[0])
            if osm.holds(xy, inset=_INSIDE):
                size = re.match(r"\d{1,4}", tags.get("capacity", ""))
                capacity = int(np.clip(int(size.group()) if size else _CAPACITY, 2, 60))
                name = tags.get("name") or f"Bike station {len(found) + 1}"
                found.append((_off_the_lanes(lanes, xy), name, capacity))
    origin = "osm"
    if not found:
        origin = "planned"
        found = [(xy, f"Bike station {k + 1}", _CAPACITY) for k, xy in enumerate(_plan_stations(site, walks, seed))]
    stations = [
        BikeStation(
            id=f"bikes_{k}",
            entity=FIRST_STATION + k,
            name=name,
            position=(round(float(xy[0]), 3), round(float(xy[1]), 3), round(float(height(xy)), 3)),
            capacity=capacity,
            bikes=max(1, int(capacity * random.uniform(0.4, 0.8))),
        )
        for k, (xy, name, capacity) in enumerate(found)
    ]
    return stations, origin


def _plan_stations(site: SiteFacts, walks: Walkways, seed: int) -> list[NDArray[np.float64]]:
    """Points of long stretches of sidewalk (of footways where there is none), nearest to where people go."""
    osm = site.osm
    stretches = [shapely.LineString(walks.line(int(i))) for i in np.flatnonzero(walks.kind == SIDEWALK)]
    stretches = [line for line in stretches if line.length > 15.0]
    if not stretches:
        west, south, east, north = osm.box
        window = shapely.box(west + _INSIDE, south + _INSIDE, east - _INSIDE, north - _INSIDE)
        for way in osm.ways:
            if way.tags.get("highway") in _FOOTWAYS and len(way.line) > 1:
                # Beside the way, not on it.
                with drop_on_failure(f"w{way.id}"):
                    beside = overlay.offset_curve(shapely.LineString(way.line), -_ASIDE)
                    stretches += [part for part in shapely.get_parts(overlay.intersection(beside, window))
                                  if part.geom_type == "LineString" and part.length > 15.0]  # fmt: skip
    if not stretches:
        return []
    # Not at the very corners, where people cross.
    spots = np.concatenate(
        [shapely.get_coordinates(line.interpolate(np.arange(6.0, line.length - 5.0, 4.0))) for line in stretches]
    )
    spots = spots[osm.holds(spots, inset=_INSIDE, edge=False)]
    wide, high = osm.sides
    count = int(np.clip(round(wide * high / _EACH), _FEWEST, _MOST))
    wanted = destinations(site)
    chosen: list[NDArray[np.float64]] = []
    for centre in k_means(wanted if len(wanted) else spots, count, rng(seed, "transit", "racks")):
        away = distances(spots, centre)
        for other in chosen:
            away = np.where(distances(spots, other) < _APART, np.inf, away)
        if len(away) and np.isfinite(away).any():
            chosen.append(spots[int(np.argmin(away))])
    return chosen


def _off_the_lanes(lanes: LaneGraph, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move a rack from the carriageway onto the kerb where the map has it on the street."""
    for _ in range(6):
        near = lanes.nearest(xy, among=np.ones(len(lanes), bool), reach=8.0)
        if near is None:
            break
        lane, offset, away = near
        least = float(lanes.width[lane]) / 2 + 1.0
        if away >= least:
            break
        x, y, yaw = lanes.at(lane, offset)
        aside = xy - (x, y)
        # To the side it is on already; to the right of the lane where it is on its middle.
        right = np.array([math.sin(yaw), -math.cos(yaw)])
        step = aside / away if away > 0.3 else right
        xy = np.array([x, y]) + step * (least + 0.05)
    return xy


_REACH = 18.0  # a mapped pole stands this near to the lane it serves, metres
_ILL = 6.0  # metres of drive that a metre off the pole is worth
# Lines of a district; with more the buses of central Helsinki bring its cars to a stand. A city has as many an area.
_MOST_LINES = 3
_AT_A_STOP = 2  # lines that stop at one place: the third one's buses would wait behind the others'
_STAGGER = 120  # seconds between the buses of lines that share a stop
_MOST_NAMES = 3  # of lines that are driven as one
_LONG_WAIT = 75.0  # seconds for their time that buses may stand where others drive


@dataclass(frozen=True)
class _DrivenLine:
    """A line that is driven: its names, its loop, its drive, the sources' routes it stands for, and its delay.

    `later` is how many seconds after others its first bus leaves, where nobody says when it does.
    """

    names: tuple[str, ...]
    route: Route | None
    loop: tuple[Berth, ...]
    drive: Drive
    departures: tuple[int, ...] = ()
    ids: tuple[str, ...] = ()
    later: int = 0

    @property
    def timing(self) -> Timing:
        """Its round and its times."""
        return timing(
            self.loop,
            self.drive,
            departures=self.departures,
            interval=self.route.interval if self.route else None,
            hours=self.route.hours if self.route else None,
            later=self.later,
        )

    @property
    def has_timetable(self) -> bool:
        """Whether the sources say when its buses leave the first stop."""
        return bool(self.departures) or (self.route is not None and self.route.interval is not None)


def transit_from_osm(
    site: SiteFacts,
    lanes: LaneGraph,
    height: HeightField,
    *,
    solids: list[shapely.Polygon] | None = None,
    seed: int = 0,
    feeds: Sequence[Feed] = (),
) -> Transit:
    """Plan stops, bus lines with a timetable, and bicycle stations of a window.

    Lines are those of the timetable feeds, then those of the map's relations; where neither gives one that can be
    driven, one is planned over the stops, and stops over the places.

    Parameters
    ----------
    site
        The map and its facts: stops, bus routes, bicycle rental, places.
    lanes
        The lane network of the same window; one without lanes gives no stops and no lines.
    height
        Ground heights.
    solids
        Building footprints, so that nobody is told to wait inside one.
    seed
        Decides what the map leaves open: planned stops, bikes in a station.
    feeds
        Timetables of the same window (`vico.geo.gtfs.read_gtfs`).

    Returns
    -------
    Transit
        Lines are closed drives past two stops at least; `omissions` says why a route of the sources is none.
    """
    osm = site.osm
    kerbs = Kerbs(lanes, height, solids or [])
    timed, left_out = routes_from_gtfs(feeds)
    mapped = _mapped_berths(osm, kerbs, left_out)
    drawn, untold = routes_from_osm(osm)
    known = {route.name for route in timed}
    left_out += [what for what in untold if not known]
    routes = timed + [route for route in drawn if route.name not in known]
    chosen = _choose_driven_lines(routes, kerbs, mapped, left_out, osm)
    names = "osm" if mapped else "planned"
    if timed and any(line.route is not None and line.route.origin == "gtfs" for line in chosen):
        names = "osm and gtfs" if mapped else "gtfs"
    if all(len(line.loop) < MIN_STOPS for line in chosen):
        # Routes that only cut a corner of the window are of no use: a round is planned beside them.
        planned, source = _plan_round(site, kerbs, mapped, seed, least=MIN_STOPS if chosen else 2)
        if planned is not None:
            chosen = [planned, *chosen]
            names = source if len(chosen) == 1 or source != "osm" else names
        elif not chosen:
            why = "no streets for traffic in the window" if not len(lanes) else "no closed drive past two stops"
            left_out.append(Dropped(id="bus lines", reason=f"{why}: none is planned"))
    chosen = _waiting_apart(chosen, left_out)
    served = [berth for line in chosen for berth in line.loop]
    kept = list(dict.fromkeys([*mapped, *served]))
    walks = lanes.walks.clear_of(solids or [])
    waiting = _Waiting(lanes, walks, height)
    stops: dict[Berth, Stop] = {}
    for k, berth in enumerate(kept):
        with drop_on_failure(berth.key):
            stops[berth] = Stop(
                id=f"stop_{k}",
                entity=FIRST_STOP + k,
                name=berth.name,
                wait=waiting.at(berth),
                lane=lanes.ids[berth.lane],
                offset=round(berth.offset, 2),
            )
    lines: list[Line] = []
    for k, line in enumerate(_stagger(chosen)):
        name = "/".join(line.names)
        lost = [berth.name for berth in line.loop if berth not in stops]
        if lost:
            leave_out(line.ids[0] if line.ids else name, f"{FAILED}: its stop {lost[0]} can't")
            continue
        with drop_on_failure(line.ids[0] if line.ids else name):
            colour = line.route.colour if line.route else ""
            lines.append(line_record(k, name, line.timing, line.drive, stops, colour))
    stations, racks = bike_stations(site, lanes, walks, height, seed)
    tram_stops, tram_lines, off_rails = trams_from_osm(
        site, height, solids=solids or [], feeds=feeds, first_entity=FIRST_STOP + len(kept)
    )
    on_rails = {f"tram {line.name}: {NOT_ON_THE_MAP}" for line in tram_lines}
    left_out = [what for what in left_out if what.reason not in on_rails] + off_rails
    if all(line.route is None or line.route.origin != "gtfs" for line in chosen):
        left_out += _unused_feeds(feeds)
    origins = dict.fromkeys("planned" if line.route is None else line.route.origin for line in chosen)
    return Transit(
        stops=list(stops.values()),
        lines=lines,
        bike_stations=stations,
        origin={"stops": names, "lines": " and ".join(origins) or "none", "bike_stations": racks},
        left_out=left_out,
        tram_stops=tram_stops,
        tram_lines=tram_lines,
    )


def _unused_feeds(feeds: Sequence[Feed]) -> list[Dropped]:
    """Say so of feeds whose buses serve the window, as none of them is driven."""
    why = "none of its bus routes can be driven on the map's streets; each is told of with its reason"
    with_buses = [feed for feed in feeds if not feed.nothing and any(route.kind == "bus" for route in feed.routes)]
    return [Dropped(id=feed.name, reason=f"{NO_TIMETABLE} here: {why}") for feed in with_buses]


def _plan_round(
    site: SiteFacts, kerbs: Kerbs, mapped: Sequence[Berth], seed: int, *, least: int
) -> tuple[_DrivenLine | None, str]:
    """Plan a round over the mapped stops, else over planned ones too, and say where its stops come from."""
    drive = Drive(kerbs.lanes)
    if loop := planned_loop(drive, mapped):
        return _DrivenLine(("Loop 1",), None, tuple(loop), drive), "osm"
    more = [b for b in planned_berths(site, kerbs, seed) if merge_berth(b, mapped) == b]
    source = "osm and planned" if mapped else "planned"
    for few in dict.fromkeys((MIN_STOPS, least)):
        if loop := planned_loop(drive, [*mapped, *more], least=few):
            return _DrivenLine(("Loop 1",), None, tuple(loop), drive), source
    return None, source


def _stagger(chosen: Sequence[_DrivenLine]) -> list[_DrivenLine]:
    """Lines whose first buses leave one after another where they share a stop."""
    shared = [sum(bool(set(other.loop) & set(line.loop)) for other in chosen[:k]) for k, line in enumerate(chosen)]
    return [replace(line, later=_STAGGER * count) for line, count in zip(chosen, shared, strict=True)]


def _mapped_berths(osm: OsmData, kerbs: Kerbs, left_out: list[Dropped]) -> list[Berth]:
    """Berths of the mapped bus stops; two poles that share a berth give one. Says which have no room to wait."""
    places = [(f"n{node.id}", node.xy, node.tags) for node in osm.nodes]
    places += [
        (area.id, np.array(area.polygon.centroid.coords[0]), area.tags)
        for area in osm.areas
        if area.tags.get("public_transport") == "platform" and not area.polygon.is_empty
    ]
    berths: list[Berth] = []
    for key, xy, tags in places:
        stop = tags.get("highway") == "bus_stop" or (
            tags.get("public_transport") == "platform"
            and tags.get("tram", "no") == "no"
            and (tags.get("bus") == "yes" or key[0] == "n")
            and "railway" not in tags
        )
        if not stop or not osm.holds(xy):
            continue
        with drop_on_failure(key):
            near = kerbs.near(xy, _REACH)
            if near:
                berth = Berth(key, tags.get("name") or f"Stop {len(berths) + 1}", near[0][1], near[0][2])
                if merge_berth(berth, berths) == berth:
                    berths.append(berth)
            elif kerbs.passes(xy, _REACH):
                left_out.append(Dropped(id=key, reason="bus stop: walls leave no room to wait beside a bus there"))
    return berths


def _choose_driven_lines(
    routes: Sequence[Route], kerbs: Kerbs, mapped: Sequence[Berth], left_out: list[Dropped], osm: OsmData
) -> list[_DrivenLine]:
    """Choose some routes that can be driven as closed rounds: timetables first, then the longest on the map."""
    fits: list[tuple[Route, tuple[Berth, ...], Drive, float]] = []
    ways: list[tuple[set[int], int]] = []
    most, wide = scaled_by_area(_MOST_LINES, osm), width_in_districts(osm)
    for route in routes:
        with drop_on_failure(route.id):
            fit = _fit_route(route, kerbs, [*mapped, *(b for _, loop, _, _ in fits for b in loop)], wide)
            if isinstance(fit, str):
                left_out.append(Dropped(id=route.id, reason=f"bus {route.name}: {fit}"))
            else:
                ways.append(fit[1].lanes_and_turns(fit[0]))
                fits.append((route, *fit))

    def rank(k: int) -> tuple[bool, bool, bool, float, int]:
        route, loop, _, cost = fits[k]
        frequent = -float(len(route.departures))
        return ways[k][1] > 0, route.origin != "gtfs", len(loop) < MIN_STOPS, frequent or cost / len(loop), k

    chosen: list[_DrivenLine] = []
    streets: set[int] = set()
    # First those that share no stop with a better one, so that few lines serve many stops.
    fresh: dict[int, set[Berth]] = {}
    for k in sorted(range(len(fits)), key=rank):
        if not any(stops & set(fits[k][1]) for stops in fresh.values()):
            fresh[k] = set(fits[k][1])
    for k in sorted(range(len(fits)), key=lambda k: (rank(k)[:2], k not in fresh, rank(k))):
        route, loop, drive, _ = fits[k]
        twin = next((i for i, line in enumerate(chosen) if _goes_along(route, loop, line)), -1)
        taken = {berth for line in chosen for berth in line.loop}
        if twin >= 0:
            # Two lines that share their way through the window are driven as one, with the buses of both.
            times = sorted({*chosen[twin].departures, *route.departures})
            line = chosen[twin]
            names, ids = (*line.names, route.name), (*line.ids, route.id)
            chosen[twin] = replace(line, names=names, departures=tuple(times), ids=ids)
        elif ways[k][1] and (streets & ways[k][0] or _gap(route) < _round_seconds(kerbs.lanes, ways[k][0], loop)):
            # A bus that turns on the spot reaches into the opposite lane: two would wait for each other for ever.
            left_out.append(Dropped(id=route.id, reason=f"bus {route.name}: has to turn where others drive"))
        elif (
            len(chosen) < most
            and 3 * len(set(loop) - taken) >= len(loop)
            and max(sum(berth in line.loop for line in chosen) for berth in loop) < _AT_A_STOP
        ):
            if ways[k][1]:
                seconds = _round_seconds(kerbs.lanes, ways[k][0], loop)
                route = replace(route, interval=max(route.interval or 0, int(seconds)))
            chosen.append(_DrivenLine((route.name,), route, loop, drive, route.departures, (route.id,)))
            streets |= ways[k][0]
        else:
            serve = ", ".join("/".join(line.names) for line in chosen if set(loop) & set(line.loop))
            why = (
                f"its stops are served by {serve}"
                if serve
                else f"{most} lines are as many as keep the streets of a window moving"
            )
            left_out.append(Dropped(id=route.id, reason=f"bus {route.name}: {why}"))
    return chosen


def _goes_along(route: Route, loop: tuple[Berth, ...], line: _DrivenLine) -> bool:
    """Whether a route can be driven as one with a chosen line: the same round, or without timetables a part of it."""
    if len(line.names) >= _MOST_NAMES or bool(route.departures) != bool(line.departures):
        return False
    return line.loop == loop or (not line.has_timetable and route.interval is None and set(loop) <= set(line.loop))


def _waiting_apart(chosen: Sequence[_DrivenLine], left_out: list[Dropped]) -> list[_DrivenLine]:
    """Lines whose buses can wait for their time, minutes at a stop, in a lane that no other line drives.

    No bus gets past one that stands at the kerb: buses of several lines that wait in one lane hold one another up for
    a round and more. A line of our own timing starts at such a stop; others' timetables say where theirs do. Most have
    no long wait (see `times`), and go anywhere.
    """
    brief = [line.timing.idle <= _LONG_WAIT for line in chosen]
    ways = [line.drive.lanes_and_turns(line.loop)[0] for line in chosen]

    def start(k: int, kept: Sequence[int]) -> int:
        """Choose line k's stop in a lane of its own among these, best with a lane beside it; -1 if it has none."""
        others = {lane for i in kept if i != k for lane in ways[i]}
        loop = chosen[k].loop[:1] if chosen[k].has_timetable else chosen[k].loop
        own = [n for n, berth in enumerate(loop) if brief[k] or berth.lane not in others]
        # Cars get past where they may change lanes.
        return min(own, key=lambda n: chosen[k].drive.lanes.left[loop[n].lane] < 0, default=-1)

    kept: list[int] = []
    for k in sorted(range(len(chosen)), key=lambda k: (not chosen[k].has_timetable, k)):
        if all(start(i, [*kept, k]) >= 0 for i in [*kept, k]):
            kept.append(k)
            continue
        why = "its buses and others' would wait for their time in each other's way"
        for what, name in zip(chosen[k].ids or chosen[k].names, chosen[k].names, strict=True):
            left_out.append(Dropped(id=what, reason=f"bus {name}: {why}"))
    firsts = [(chosen[k], start(k, kept)) for k in sorted(kept)]
    return [replace(line, loop=(*line.loop[first:], *line.loop[:first])) for line, first in firsts]


def _gap(route: Route) -> float:
    """Seconds between two buses of a timetable, in the median; without one they may be as rare as need be."""
    return float(np.median(np.diff(route.departures))) if len(route.departures) > 1 else math.inf


def _round_seconds(lanes: LaneGraph, way: set[int], loop: Sequence[Berth]) -> float:
    """How long a round takes at most, about: below that between two buses there is but one on the way."""
    return float(lanes.length[sorted(way)].sum()) / 6.0 + 45.0 * len(loop)


def _fit_route(
    route: Route, kerbs: Kerbs, known: Sequence[Berth], wide: float
) -> tuple[tuple[Berth, ...], Drive, float] | str:
    """Find a closed drive past a route's stops, there and back, else there and round; say why not if there is none."""
    drive = Drive(kerbs.lanes, route.way)
    reach = FEED_REACH if route.origin == "gtfs" else _REACH
    by_key = {berth.key: berth for berth in known}

    def choices(poles: Sequence[Pole]) -> list[list[tuple[float, Berth]]]:
        rows: list[list[tuple[float, Berth]]] = []
        for pole in poles:
            berths = kerbs.choices(pole.key, pole.name or "Bus stop", pole.xy, known, reach)
            own = by_key.get(pole.key)
            berths = [own, *(b for b in berths if b != own)] if own is not None else berths
            row = [(_ILL * _ill(kerbs.lanes, berth, pole), berth) for berth in berths]
            rows.append(row)
        return rows

    there, back = _in_one_part(kerbs.lanes, choices(route.there), choices(route.back))
    if len(there) + len(back) < 2:
        return "fewer than two of its stops lie on streets that buses can go round"
    best: tuple[float, list[Berth]] = (math.inf, [])
    most, longest = round(MAX_STOPS * wide), MAX_LOOP * wide
    orders = [[*there, *back], there]
    if route.origin != "gtfs":
        orders.append([*back, *there[::-1]])  # a map's members may be listed backwards; a timetable is not
    for rows in (order[:most] for order in orders):
        loop = list(dict.fromkeys(drive.best_round(rows)[1]))
        cost = drive.round(loop)
        if cost < best[0] and drive.metres_round(loop) < longest:
            best = (cost, loop)
            if not drive.lanes_and_turns(loop)[1]:
                break
    if not best[1]:
        return f"no closed drive of {longest / 1000:g} km past its stops"
    return tuple(best[1]), drive, best[0]


def _in_one_part(lanes: LaneGraph, *runs: list[list[tuple[float, Berth]]]) -> list[list[list[tuple[float, Berth]]]]:
    """Keep the choices on the part of the network, all lanes of which lead to one another, that serves the most stops.

    The window's edge cuts a network into several such parts.
    """
    served: Counter[int] = Counter()
    for run in runs:
        for row in run:
            served.update({int(lanes.component[berth.lane]) for _, berth in row})
    part = min(served, key=lambda c: (-served[c], c), default=0)
    kept = [[[pair for pair in row if lanes.component[pair[1].lane] == part] for row in run] for run in runs]
    return [[row for k, row in enumerate(run) if row and not (k and len(row) == 1 and run[k - 1] == row)]
            for run in kept]  # fmt: skip


def _ill(lanes: LaneGraph, berth: Berth, pole: Pole) -> float:
    """How ill a berth suits a pole, metres: how far off it is, and ten more where it is on the other side."""
    x, y, yaw = lanes.at(berth.lane, berth.offset)
    dx, dy = pole.xy[0] - x, pole.xy[1] - y
    kerb = (dx * math.sin(yaw) - dy * math.cos(yaw) > 0) != lanes.lefthand
    return math.hypot(dx, dy) + (0.0 if kerb else 10.0)


class _Waiting:
    """Finds where people wait: on the sidewalk beside the front door."""

    def __init__(self, lanes: LaneGraph, walks: Walkways, height: HeightField) -> None:
        self._lanes, self._height = lanes, height
        self._sidewalks = [shapely.LineString(walks.line(int(i))) for i in np.flatnonzero(walks.kind == SIDEWALK)]

    def at(self, berth: Berth) -> tuple[float, float, float]:
        x, y, yaw = self._lanes.at(berth.lane, berth.offset - BUS_DOOR_BEHIND_FRONT)
        kerb = (self._lanes.width[berth.lane] / 2 + 1.0) * (-1.0 if self._lanes.lefthand else 1.0)
        xy = np.array([x + math.sin(yaw) * kerb, y - math.cos(yaw) * kerb])
        if self._sidewalks:
            away = shapely.distance(self._sidewalks, shapely.Point(xy))
            best = int(np.argmin(away))
            if 0.3 < away[best] < 4.0:
                line = self._sidewalks[best]
                xy = np.array(line.interpolate(line.project(shapely.Point(xy))).coords[0])
        return round(float(xy[0]), 3), round(float(xy[1]), 3), round(float(self._height(xy)), 3)
