"""Trams: long vehicles on rails that keep a timetable, stop for whatever is in their way, and carry people.

A tram is where its front is along its track; its sections stand on the track behind it. It never moves into anybody:
what is in its way ahead, or is about to be, it brakes for, and stands before it. Where tracks cross or meet one tram at
a time is let in (`vico.sim.transit.tram_network`); where signals are obeyed, trams obey those of the lanes beside them
(`vico.sim.transit.tram_network`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.transit_vehicles import (
    SHAPES_OF,
    TRAM_BELLOWS,
    TRAM_CAPACITY,
    TRAM_HEIGHT,
    train_prototypes,
    tram_door_leaves,
    tram_places,
    tram_prototypes,
)
from vico.clock import DAY
from vico.rules import BUS_DWELL, TRAM_SECTION, TRAM_SECTIONS, TRAM_WIDTH
from vico.sim.bodies.arrays import TRAM, Bodies, Drawn
from vico.sim.traffic import Traffic
from vico.sim.traffic.pedestrian_routes import PEDESTRIAN_RADIUS
from vico.sim.transit.passengers import DOOR_TIME, FIRST_PASSENGER, leaf_transforms, step_doors
from vico.sim.transit.tram_network import (
    TramCrossings,
    TramNetwork,
    TramSignal,
    absent_footprints,
    first_obstructed,
    footprint_rows,
    holds_somebody,
    inside_city,
    metres_to_signal,
    people_in_way,
    place_sections,
    section_outlines,
)
from vico.world.mesh import Surface
from vico.world.transit import (
    ACROSS_REACH,
    STEP,
    TRAM_ACCELERATION,
    TRAM_BRAKING,
    TRAM_DOORS,
    TRAM_LENGTH,
    TRAM_SPEED,
    TramLine,
)

#: Where the front of a tram is that is not in the city.
AWAY = -1.0
_WAITS = 0.5  # seconds left of a stop that a tram keeps while somebody has yet to get off
_EDGE = 3.0  # metres from the city's edge within which tracks lead out of it
_TOUCH = 0.03  # metres that are too near
_BEFORE = 1.2  # metres kept to what stands ahead
_FAR = 1e7  # metres to what is not there
_LOOK = TRAM_SPEED**2 / (2 * TRAM_BRAKING) + 6.0  # metres ahead that are watched
_SOON = 1.2  # seconds: who will be in the way by then is in the way
_SLOW = 3.0  # m/s at least that a timetable asks for
_ALIKE = 40.0  # metres of track that have to be free to come in
_HALF_SIZE = TRAM_SECTION / 2 - TRAM_BELLOWS, TRAM_WIDTH / 2  # metres, of a section
_BEHIND = np.arange(TRAM_SECTIONS) * TRAM_SECTION  # metres from a tram's front to each section's
_STANDS = 0.1  # slower is standing, m/s
_ASKS = 4.0  # metres before a tram that stands from which it asks people to go
_BESIDE = 0.3  # ... and metres beside its sections, where they will be next
_NEAR = TRAM_SECTION / 2 + _ASKS + TRAM_WIDTH  # metres from a first section's middle to whom it may ask
_AT = 0.4  # metres from its stopping point at which a tram has arrived


class Trams:
    """All trams of a run, those that are not in the city among them.

    Attributes
    ----------
    front
        Distance of each tram's front along its line's track, metres, `AWAY` out of the city.
    speed
        m/s.
    stop
        Index of the stop it stands at or drives to; as many as there are: to the end of the track.
    dwell
        Seconds it still stands at its stop; 0 on the way.
    open
        How far its doors are open, 0..1.
    due
        Second of the day (counted on past midnight) at which it should have come in.
    riders
        Who is at each place, -1 for nobody, int32, shape ``(trams, TRAM_CAPACITY)``.
    begun
        Departures that each line has begun since the first one of the first day.
    holder
        Tram in each zone, -1 for nobody.
    called
        Where tracks cross lanes, whether a tram is there or comes, shape ``(crossings,)``.
    stops_served, late_total, late_most
        As those of `vico.sim.transit.system.TransitSystem`.
    """

    def __init__(
        self,
        lines: Sequence[TramLine],
        traffic: Traffic,
        *,
        second: float,
        first_entity: int,
        network: TramNetwork | None = None,
    ) -> None:
        self.lines = list(lines)
        #: What never changes; made anew unless given.
        self.network = TramNetwork(lines, traffic.lanes, traffic.walks) if network is None else network
        self.tracks = self.network.tracks
        self.first_entity = first_entity
        self._traffic = traffic
        self._half = traffic.height.half
        # Where the map ends at the city's edge trams drive out of it; where rails end within, they are gone there.
        self._ends = [
            track.length + (TRAM_LENGTH if float(np.abs(track.xy[-1]).max()) > self._half - _EDGE else 0.0)
            for track in self.tracks
        ]
        self._zones, count = self.network.zones
        self._crossings = TramCrossings(self.tracks, traffic, self.network.crossings)
        self.called = self._crossings.called
        obeys = traffic.signals is not None
        self._signals: list[list[TramSignal]] = self.network.signals if obeys else [[] for _ in lines]
        slots = [min(math.ceil((line.travel[-1] + 240.0) / _headway(line)) + 1, 8) for line in lines]
        self.line_of = np.repeat(np.arange(len(lines)), slots).astype(np.int32)
        n = len(self.line_of)
        self.front, self.speed = np.full(n, AWAY), np.zeros(n)
        self.stop = np.zeros(n, np.int32)
        self.dwell, self.open, self.due = np.zeros(n), np.zeros(n), np.zeros(n)
        self.riders = np.full((n, TRAM_CAPACITY), -1, np.int32)
        self.holder = np.full(count, -1, np.int32)
        self.stops_served = np.zeros(n, np.int64)
        self.late_total, self.late_most = np.zeros(n), np.zeros(n)
        self.begun = np.array([_first_after(line, second) for line in lines], np.int64)
        # Where they stand, which sections reach into the city, and their footprints, which begin those of everybody.
        self._poses = np.zeros((n, TRAM_SECTIONS, 3))
        self._inside = np.zeros((n, TRAM_SECTIONS), np.bool_)
        self._everybody = absent_footprints(n * TRAM_SECTIONS)
        self._bodies: Bodies | None = None
        self._entities = first_entity + np.arange(n * TRAM_SECTIONS, dtype=np.int32)
        self._set_out(second)

    def __len__(self) -> int:
        return len(self.front)

    # -- state -------------------------------------------------------------------------------------------------------

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future; none where there are no trams."""
        return {f"tram_{name}": getattr(self, name).copy() for name in _STATE} if len(self) else {}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        for name in _STATE if len(self) else ():
            getattr(self, name)[...] = arrays[f"tram_{name}"]
        for tram in range(len(self)):
            self._stand_where_it_is(tram)

    # -- time --------------------------------------------------------------------------------------------------------

    def advance(self, now: float, dt: float, obstacles: Bodies) -> list[int]:
        """Move all trams on by `dt` seconds up to the second `now`; none comes nearer to anybody than it may.

        Returns
        -------
        list
            Trams that have come to a stop.
        """
        arrived: list[int] = []
        if not len(self):
            return arrived
        self._look_about(obstacles)
        self._come_in(now)
        self._crossings.begin_step(self._everybody[len(self) * TRAM_SECTIONS :])
        for tram in np.flatnonzero(self.front > AWAY).tolist():
            if self.dwell[tram] > 0.0:
                self._stand(tram, now, dt)
                self._crossings.call_under(int(self.line_of[tram]), float(self.front[tram]))
                continue
            self._drive(tram, now, dt)
            if self.dwell[tram] > 0.0:
                arrived.append(tram)
        self._ask_to_go()
        return arrived

    def _ask_to_go(self) -> None:
        """Tell the pedestrians who keep a tram that stands from driving on that it waits for them to go.

        Those before it on its way, and those beside whom its sections would swing out.
        """
        walkers, shapes, first = self._traffic.pedestrian_state, self._traffic.shapes, self._traffic.vehicles
        walkers.before_tram[:] = False
        for tram in np.flatnonzero((self.front > AWAY) & (self.speed < _STANDS) & (self.dwell == 0.0)).tolist():
            ahead = int(max(self.front[tram], 0.0) / STEP) + 1
            points = self.tracks[int(self.line_of[tram])].across[ahead : ahead + int(_ASKS / STEP)]
            poses = self._sections_at(tram, self.front[tram] + STEP)
            sides = section_outlines(poses, inside_city(poses, self._half))
            away = np.hypot(*(self._poses[tram, :, :2, None] - [shapes.x, shapes.y]).swapaxes(0, 1)).min(axis=0)
            near = np.flatnonzero(away < _NEAR)
            near = near[near >= first]
            people = np.column_stack([shapes.x[near], shapes.y[near]])
            found = people_in_way(points, people, ACROSS_REACH + PEDESTRIAN_RADIUS) | people_in_way(
                sides, people, PEDESTRIAN_RADIUS + _BESIDE
            )
            walkers.before_tram[near[found] - first] = True

    def _come_in(self, now: float) -> None:
        """Have the trams that are due come in, where the track begins."""
        for number, line in enumerate(self.lines):
            due = _departure(line, int(self.begun[number]))
            if now < due:
                continue
            free = np.flatnonzero((self.line_of == number) & (self.front <= AWAY))
            if not len(free):
                continue
            tram = int(free[0])
            if self._gap(tram, 0.0, _ALIKE) < _ALIKE or not self._fits(tram, 0.0):
                continue
            if holds_somebody(self._sections_at(tram, 0.0), self._everybody):
                continue
            self.front[tram], self.speed[tram], self.stop[tram], self.due[tram] = 0.0, _SLOW, 0, due
            self.begun[number] += 1
            self._stand_where_it_is(tram)

    def _stand(self, tram: int, now: float, dt: float) -> None:
        # It does not leave before its time, nor its last stop before everybody is off who is played: the others may
        # ride out of the city, and come in again with the same tram.
        time = self.due[tram] + self.lines[self.line_of[tram]].travel[self.stop[tram]] + BUS_DWELL
        played = (self.riders[tram] >= 0) & (self.riders[tram] < FIRST_PASSENGER)
        least = _WAITS if self.ends(tram) and played.any() else 0.0
        self.dwell[tram] = max(self.dwell[tram] - dt, least, time - now)
        self.open[tram] = step_doors(float(self.open[tram]), self.dwell[tram] > DOOR_TIME, dt)
        if self.dwell[tram] == 0.0:
            self.open[tram] = 0.0
            self.stop[tram] += 1

    def _drive(self, tram: int, now: float, dt: float) -> None:
        number = int(self.line_of[tram])
        line, track, front = self.lines[number], self.tracks[number], float(self.front[tram])
        stop = int(self.stop[tram])
        ends = stop >= len(line.stops)
        target = self._ends[number] + 1.0 if ends else line.offsets[stop]
        limit = float(track.speed[min(int(front / STEP), len(track.speed) - 1)])
        left = self.due[tram] + line.travel[stop] - now
        wanted = max(min(target, track.length) - front, 0.0) / max(left - 6.0, 1.0)
        limit = min(limit, max(wanted * 1.1, _SLOW))
        free = min(self._gap(tram, front, _LOOK), self._zone_ahead(tram, number, front))
        if self._signals[number]:
            speed_now, light = float(self.speed[tram]), self._traffic.lane_lights
            free = min(free, metres_to_signal(self._signals[number], front, speed_now, light))
        free = min(free, self._crossings.metres_to_wait(number, front, float(self.speed[tram]), free))
        if not ends:
            limit = min(limit, math.sqrt(2 * TRAM_BRAKING * max(target - front, 0.0)) + 0.15)
        limit = min(limit, math.sqrt(2 * TRAM_BRAKING * max(free, 0.0)))
        speed = min(float(self.speed[tram]) + TRAM_ACCELERATION * dt, limit)
        way = min(speed * dt, max(free, 0.0), max(target - front, 0.0))
        if way > 0.0 and not self._fits(tram, front + way):
            way = 0.0
        self.speed[tram] = way / dt
        self.front[tram] = front + way
        self._leave_zones(tram, number)
        if ends:
            if front + way >= self._ends[number]:
                self.front[tram], self.speed[tram] = AWAY, 0.0
                self.holder[self.holder == tram] = -1
        elif target - front - way < _AT:
            self.dwell[tram] = BUS_DWELL
            self.speed[tram] = 0.0
            late = now - self.due[tram] - line.travel[stop]
            self.stops_served[tram] += 1
            self.late_total[tram] += late
            self.late_most[tram] = max(self.late_most[tram], late)
        self._stand_where_it_is(tram)

    def _stand_where_it_is(self, tram: int) -> None:
        """Have everybody see where a tram is now, and how fast it is."""
        here, rows = self._poses[tram], slice(tram * TRAM_SECTIONS, (tram + 1) * TRAM_SECTIONS)
        if self.front[tram] > AWAY:
            here[:] = self._sections_at(tram, self.front[tram])
            self._inside[tram] = inside_city(here, self._half)
        else:
            self._inside[tram] = False
        place_sections(here, self._inside[tram], *_HALF_SIZE, self.speed[tram], self._everybody[rows])
        self._bodies = None

    def _sections_at(self, tram: int, front: float) -> NDArray[np.float64]:
        """x, y, yaw of a tram's sections with its front there, shape ``(TRAM_SECTIONS, 3)``."""
        return self.tracks[self.line_of[tram]].section(front - _BEHIND)

    def _gap(self, tram: int, front: float, look: float) -> float:
        """Metres of track ahead of a front that nobody is on, or comes onto within a moment; `look` at most."""
        track = self.tracks[int(self.line_of[tram])]
        first = int(max(front, 0.0) / STEP) + 1
        points = track.across[first : first + int(look / STEP) + 2]
        taken = int(first_obstructed(points, *self._but(tram), ACROSS_REACH, _SOON))
        return look if taken == len(points) else max((first + taken) * STEP - front - _BEFORE, 0.0)

    def _fits(self, tram: int, front: float) -> bool:
        """Return whether no section touches anybody with the front there: in bends they swing to the sides."""
        poses = self._sections_at(tram, front)
        outline = section_outlines(poses, inside_city(poses, self._half))
        return bool(first_obstructed(outline, *self._but(tram), _TOUCH, 0.0) == len(outline))

    def _but(self, tram: int) -> tuple[NDArray[np.float64], int, int]:
        """Return the footprints of everybody, and which of them are the tram's own."""
        return self._everybody, tram * TRAM_SECTIONS, TRAM_SECTIONS

    def _look_about(self, others: Bodies) -> None:
        """Note where all others are, behind the trams."""
        own = self._everybody[: len(self) * TRAM_SECTIONS]
        self._everybody = np.concatenate([own, footprint_rows(others)])

    def _zone_ahead(self, tram: int, number: int, front: float) -> float:
        """Metres to the next zone that another tram is in; those that are free are taken in passing."""
        for zone in self._zones[number]:
            ahead = zone.start - front - _BEFORE
            if front - TRAM_LENGTH > zone.end or self.holder[zone.number] == tram:
                continue
            if ahead > _LOOK:
                break
            if self.holder[zone.number] >= 0:
                return max(ahead, 0.0) if ahead > -_BEFORE else _FAR
            self.holder[zone.number] = tram
        return _FAR

    def _leave_zones(self, tram: int, number: int) -> None:
        rear = self.front[tram] - TRAM_LENGTH
        for zone in self._zones[number]:
            if rear > zone.end and self.holder[zone.number] == tram and not self._returns(tram, number, zone.number):
                self.holder[zone.number] = -1

    def _returns(self, tram: int, number: int, zone: int) -> bool:
        """Whether another stretch of a zone lies ahead of a tram within sight."""
        front = self.front[tram]
        return any(
            z.number == zone and z.end > front - TRAM_LENGTH and z.start < front + _LOOK for z in self._zones[number]
        )

    def _set_out(self, second: float) -> None:
        """Put the trams that are under way at the start where they are by the timetable, as far as there is room."""
        self._look_about(self._traffic.bodies())
        for number, line in enumerate(self.lines):
            for back in (1, 2, 3):
                due = _departure(line, int(self.begun[number]) - back)
                if 0.0 < second - due < line.travel[-1] - 20.0:
                    self._place(number, due, second - due)

    def _place(self, number: int, due: float, gone: float) -> None:
        """Put a tram where it is so many seconds after it came in; nowhere if there is no room, or tracks meet."""
        line, track = self.lines[number], self.tracks[number]
        stops, times = [0.0, *line.offsets, track.length], [0.0, *line.travel]
        k = int(np.searchsorted(times, gone, side="right")) - 1
        stands = BUS_DWELL * (k > 0)
        share = max(gone - times[k] - stands, 0.0) / (times[k + 1] - times[k] - stands)
        front = stops[k] + share * (stops[k + 1] - stops[k])
        meets = any(zone.start - _BEFORE < front and front - TRAM_LENGTH < zone.end for zone in self._zones[number])
        free = np.flatnonzero((self.line_of == number) & (self.front <= AWAY))
        if front < TRAM_LENGTH or not len(free) or meets:
            return
        tram = int(free[0])
        if self._gap(tram, front - TRAM_LENGTH, TRAM_LENGTH + 2.0) < TRAM_LENGTH + 2.0:
            return
        self.front[tram], self.stop[tram], self.due[tram] = front, k, due
        self._stand_where_it_is(tram)

    # -- what others see ---------------------------------------------------------------------------------------------

    def bodies(self) -> Bodies:
        """Return the sections that are in the city."""
        if self._bodies is None:
            self._bodies = self._bodies_now()
        return self._bodies

    def _sections_in_city(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Tram, section and x, y, yaw of every section that reaches into the city."""
        trams, section = np.nonzero(self._inside)
        return trams, section, self._poses[trams, section]

    def _bodies_now(self) -> Bodies:
        trams, section, pose = self._sections_in_city()
        n = len(trams)
        if not n:
            return Bodies.none()
        speed = self.speed[trams]
        return Bodies(
            entity=self._entities[trams * TRAM_SECTIONS + section],
            kind=np.full(n, TRAM, np.int8),
            position=np.column_stack([pose[:, :2], self._traffic.height(pose[:, :2])]),
            yaw=pose[:, 2],
            half_length=np.full(n, _HALF_SIZE[0]),
            half_width=np.full(n, _HALF_SIZE[1]),
            height=np.full(n, TRAM_HEIGHT),
            velocity=speed[:, None] * np.column_stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])]),
        )

    def entities(self) -> NDArray[np.int32]:
        """Return the entities of all sections, those out of the city too."""
        return self._entities

    def prototypes(self) -> dict[str, list[Surface]]:
        """Return the shapes `draw` refers to."""
        made_of = {SHAPES_OF[line.kind] for line in self.lines}
        every = tram_prototypes() | train_prototypes()
        return {name: shape for name, shape in every.items() if name.rpartition("_")[0] in made_of}

    def draw(self) -> Drawn:
        """Return the sections and the leaves of their doors."""
        trams, section, pose = self._sections_in_city()
        n = len(trams)
        names = sorted(self.prototypes())
        made_of = [SHAPES_OF[self.lines[line].kind] for line in self.line_of[trams].tolist()]
        bases = np.tile(np.eye(4), (n, 1, 1))
        c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        bases[:, 0, 0], bases[:, 0, 1], bases[:, 1, 0], bases[:, 1, 1] = c, -s, s, c
        bases[:, :2, 3], bases[:, 2, 3] = pose[:, :2], self._traffic.height(pose[:, :2]) if n else np.zeros(0)
        index = [
            np.array(
                [names.index(f"{what}_{_PART[k]}") for what, k in zip(made_of, section.tolist(), strict=True)], np.int32
            )
        ]
        leaves, width = tram_door_leaves()
        kerb = 1.0 if self._traffic.lanes.lefthand else -1.0
        parts = [bases]
        for side in (kerb, -kerb):
            # Only the side of the kerb opens.
            share = self.open[trams] if side == kerb else np.zeros(n)
            parts.append(leaf_transforms(bases, [leaf for leaf in leaves if leaf[1] * side > 0], share, width))
        index.append(np.tile(np.array([names.index(f"{what}_leaf") for what in made_of], np.int32), len(leaves)))
        entity = np.tile(self._entities[trams * TRAM_SECTIONS + section], len(leaves) + 1)
        return Drawn(names, np.concatenate(index), np.concatenate(parts).astype(np.float32), entity)

    def walkways_on_tracks(self) -> NDArray[np.bool_]:
        """Mark the walkways, other than crossings, that lie on a track: nobody is to walk towards a tram there."""
        # None where no tram ever comes.
        return self.network.walkways_on_tracks if len(self) else np.zeros(len(self._traffic.walks), np.bool_)

    # -- riders ------------------------------------------------------------------------------------------------------

    @property
    def standing(self) -> NDArray[np.int64]:
        """Trams that stand at a stop with their doors open."""
        return np.flatnonzero(self.dwell > 0.0)

    def kind(self, tram: int) -> str:
        """Return what a tram is called: tram, or train."""
        return "train" if self.lines[self.line_of[tram]].kind == "rail" else "tram"

    def stopped_at(self, tram: int) -> str | None:
        """Id of the stop at which a tram stands with its doors open, None while it drives or is out of the city."""
        if self.dwell[tram] <= 0.0:
            return None
        return self.lines[self.line_of[tram]].stops[int(self.stop[tram])]

    def will_stop(self, tram: int) -> bool:
        """Return whether a tram is in the city and stands at a stop, or has yet to come to one."""
        return bool(self.front[tram] > AWAY and self.stop[tram] < len(self.lines[self.line_of[tram]].stops))

    def ends(self, tram: int) -> bool:
        """Return whether a tram stands at its last stop in the city."""
        return bool(self.dwell[tram] > 0.0 and self.stop[tram] == len(self.lines[self.line_of[tram]].stops) - 1)

    def doors(self, tram: int, out: float = 0.0) -> NDArray[np.float64]:
        """Where a tram's doors are on the side of the kerb, `out` metres outside them, shape ``(k, 2)``."""
        side = (TRAM_WIDTH / 2 + out) * (-1.0 if self._traffic.lanes.lefthand else 1.0)
        return np.array(
            [
                [x + a * math.cos(yaw) + side * math.sin(yaw), y + a * math.sin(yaw) - side * math.cos(yaw)]
                for x, y, yaw in self._poses[tram].tolist()
                for a in TRAM_DOORS
            ]
        )

    def seat(self, tram: int, place: int) -> NDArray[np.float64]:
        """x, y, yaw of a place in a tram; of one out of the city where it will come in."""
        section, ahead, left = tram_places()[0][place]
        poses = self._poses[tram] if self.front[tram] > AWAY else self._sections_at(tram, 0.0)
        x, y, yaw = poses[int(section)].tolist()
        c, s = math.cos(yaw), math.sin(yaw)
        return np.array([x + ahead * c - left * s, y + ahead * s + left * c, yaw])


_STATE = (
    "front", "speed", "stop", "dwell", "open", "due", "riders", "begun", "holder", "stops_served", "late_total",
    "late_most", "called",
)  # fmt: skip
_PART = ("front",) + ("middle",) * (TRAM_SECTIONS - 2) + ("rear",)


def _headway(line: TramLine) -> float:
    gaps = np.diff(line.departures)
    return float(np.median(gaps)) if len(gaps) else DAY


def _departure(line: TramLine, number: int) -> int:
    days, of_the_day = divmod(number, len(line.departures))
    return line.departures[of_the_day] + DAY * days


def _first_after(line: TramLine, second: float) -> int:
    days, of_the_day = divmod(second, DAY)
    return int(np.searchsorted(line.departures, of_the_day)) + len(line.departures) * int(days)
