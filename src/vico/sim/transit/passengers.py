"""Passengers of buses and trams without an agent, and the doors of those vehicles.

Passengers wait at stops, get in by a door, sit, and get off later. Where a bus is asked for, numbers from the number of
buses on are trams, as with `vico.sim.transit.TransitSystem`. Doors are told by how far they are open.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.exact import product
from vico.geometry import distances
from vico.seeds import rng
from vico.sim.bodies.arrays import Bodies
from vico.sim.bodies.avatars import free_ground
from vico.sim.traffic.drawing import Seating
from vico.sim.traffic.population import Traffic
from vico.sim.traffic.state import BOARD, NONE, STOP
from vico.world.transit import Stop, TramStop, Transit
from vico.world.walkable import WalkableMap
from vico.world.walkways import SIDEWALK

#: Among a bus's riders pedestrians are numbered from here.
FIRST_PASSENGER = 1_000_000
# Riders of a bus at which no more pedestrians get in: there is room for those who are played.
_FULL = 24
_AT_START, _MOST_AT_START = 0.1, 8  # share of those who walk alone that ride at the start, and most in one bus
_RIDE = 4  # stops they ride at the most
_LEAST_DWELL = 9.0  # s a bus has to stand on for somebody to set out to its door
_AT_DOOR = 0.5  # m from the door's front where one gets in
_BESIDE = 1.5  # m from the door where one gets off if there is no room before it
_STOP_REACH = 8.0  # m from where passengers wait to a sidewalk


class HasBuses(Protocol):
    """Transit, as far as its riders are concerned; `vico.sim.transit.TransitSystem` tells each."""

    transit: Transit
    traffic: Traffic

    @property
    def services(self) -> int:
        """How many buses and trams there are, those out of service too."""

    def ends_service(self, bus: int) -> bool:
        """Whether a bus goes to the depot from the stop it is at, or a tram out of the city."""

    def boards_for(self, bus: int) -> float:
        """Seconds for which a bus keeps its doors open at the least; 0 while they are not wholly open."""

    def will_stop(self, bus: int) -> bool:
        """Whether a bus is in service and has yet to come to a stop, or stands at one."""

    def stopped_at(self, bus: int) -> str | None:
        """Id of the stop at which a bus stands."""

    def bodies(self) -> Bodies:
        """Bodies of trams and of bicycles that stand about."""

    def doors(self, bus: int) -> NDArray[np.float64]:
        """Where the doors are."""

    def exit_spots(self, bus: int) -> NDArray[np.float64]:
        """Points outside each door."""

    def seat(self, bus: int, rider: int) -> NDArray[np.float64]:
        """x, y, yaw of where a rider is."""

    def is_seated(self, bus: int, rider: int) -> bool:
        """Whether a rider has a seat."""

    def aboard(self, bus: int) -> int:
        """How many ride in a bus."""

    def capacity(self, bus: int) -> int:
        """How many a bus takes."""

    def floor(self, bus: int) -> float:
        """Height of the floor riders are on above the ground, metres."""

    def take_in(self, bus: int, rider: int) -> None:
        """Give a rider a place."""

    def alight(self, bus: int, rider: int) -> None:
        """Let a rider off."""


class Passengers:
    """Moves pedestrians into buses and out again; what it knows is in their records and among the buses' riders.

    Parameters
    ----------
    transit
        Whose buses and trams they ride.
    walkable
        Where one can get off.
    seed
        Decides who rides at the start.
    """

    def __init__(self, transit: HasBuses, walkable: WalkableMap, seed: int) -> None:
        self._transit, self._traffic, self._walkable = transit, transit.traffic, walkable
        self._walkers = transit.traffic.pedestrian_state
        self._traffic.seats = self.seats
        every: list[Stop | TramStop] = [*transit.transit.stops, *transit.transit.tram_stops]
        self._number = {stop.id: k for k, stop in enumerate(every)}
        self._sidewalks = _sidewalks_at(transit)
        if self._traffic.pedestrians and transit.services:
            self._start(rng(seed, "traffic", "passengers"))

    def _start(self, random: np.random.Generator) -> None:
        """Have some ride at the start."""
        walkers, buses = self._walkers, self._transit.services
        draws, chosen = random.random(len(walkers)), random.integers(0, buses, len(walkers))
        alone = (walkers.group_size == 1) & (walkers.goal == NONE) & (draws < _AT_START)
        for i in np.flatnonzero(alone).tolist():
            bus = int(chosen[i])
            if self._transit.will_stop(bus) and self._transit.aboard(bus) < _MOST_AT_START:
                self._get_in(i, bus)

    def seats(self, who: NDArray[np.int64]) -> Seating:
        """Return where some who ride are: positions, yaws, and whether they sit."""
        transit, aboard = self._transit, self._walkers.aboard
        poses = np.array([transit.seat(int(aboard[i]), FIRST_PASSENGER + int(i)) for i in who]).reshape(-1, 3)
        sits = [transit.is_seated(int(aboard[i]), FIRST_PASSENGER + int(i)) for i in who]
        floor = self._traffic.height(poses[:, :2]) + [transit.floor(int(aboard[i])) for i in who]
        return np.column_stack([poses[:, :2], floor]), poses[:, 2], np.array(sits, np.bool_)

    def arrive(self, bus: int) -> None:
        """Note that a bus has come to a stop."""
        self._walkers.stops_left[self._walkers.aboard == bus] -= 1

    def advance(self, obstacles: Bodies) -> None:
        """Let people in and out of buses that stand with open doors; once a second.

        Parameters
        ----------
        obstacles
            Everybody's bodies.
        """
        walkers = self._walkers
        if not len(walkers):
            return
        boarding = np.flatnonzero(walkers.stand_kind == BOARD)
        for i in boarding.tolist():
            self._board(i, int(walkers.boards[i]))
        for bus in range(self._transit.services):
            stop, left = self._transit.stopped_at(bus), self._transit.boards_for(bus)
            if stop is None or left == 0.0:
                continue
            ends = self._transit.ends_service(bus)
            due = np.flatnonzero((walkers.aboard == bus) & ((walkers.stops_left <= 0) | ends))
            if len(due):
                self._get_off(int(due[0]), bus, stop, obstacles)
            elif not ends and left >= _LEAST_DWELL:
                self._call(bus, stop)

    def _call(self, bus: int, stop: str) -> None:
        """Have those who wait at a stop go to the nearest door of a bus, as long as there is room."""
        walkers, doors, fronts = self._walkers, self._transit.doors(bus), self._transit.exit_spots(bus)
        waiting = np.flatnonzero((walkers.stand_kind == STOP) & (walkers.spot != NONE))
        stops = self._traffic.spots["stop"][walkers.spot[waiting]]
        room = _FULL - self._transit.aboard(bus) - int(((walkers.stand_kind == BOARD) & (walkers.boards == bus)).sum())
        for i in waiting[stops == self._number[stop]][: max(room, 0)].tolist():
            here = self._position(i)
            door = int(np.argmin(distances(fronts, here)))
            walkers.stand_kind[i], walkers.boards[i], walkers.spot[i] = BOARD, bus, NONE
            walkers.stand_xy[i] = fronts[door]
            walkers.stand_yaw[i] = math.atan2(*(doors[door] - fronts[door])[::-1])

    def _board(self, i: int, bus: int) -> None:
        """Let somebody in who stands before a door; who comes too late walks on."""
        walkers = self._walkers
        if self._transit.boards_for(bus) == 0.0:
            walkers.stand_kind[i], walkers.boards[i] = 0, NONE
        elif np.hypot(*(walkers.stand_xy[i] - self._position(i))) < _AT_DOOR:
            self._get_in(i, bus)

    def _get_in(self, i: int, bus: int) -> None:
        walkers = self._walkers
        if self._transit.aboard(bus) >= self._transit.capacity(bus):
            return
        self._transit.take_in(bus, FIRST_PASSENGER + i)
        walkers.aboard[i], walkers.boards[i], walkers.stand_kind[i] = bus, NONE, 0
        walkers.stops_left[i] = 1 + int(walkers.random[i] % np.uint64(_RIDE))
        self._traffic.take_off(i)

    def _get_off(self, i: int, bus: int, stop: str, obstacles: Bodies) -> None:
        """Let somebody off beside a door, if there is room."""
        way = self._sidewalks.get(stop)
        everybody = Bodies.joined([self._traffic.bodies(), self._transit.bodies(), obstacles])
        for door in self._transit.exit_spots(bus) if way is not None else ():
            spot = free_ground(self._walkable, door, everybody, within=_BESIDE)
            if spot is not None and way is not None:
                self._transit.alight(bus, FIRST_PASSENGER + i)
                self._walkers.aboard[i] = NONE
                self._traffic.set_down(i, spot, *way)
                return

    def _position(self, i: int) -> NDArray[np.float64]:
        shapes, b = self._traffic.shapes, self._traffic.vehicles + i
        return np.array([shapes.x[b], shapes.y[b]])


def _sidewalks_at(transit: HasBuses) -> dict[str, tuple[int, float]]:
    """Return the sidewalk by each stop, and metres along it."""
    walks = transit.traffic.walks
    ways = np.flatnonzero(walks.kind == SIDEWALK)
    lines: list[Any] = [shapely.LineString(walks.line(int(way))) for way in ways]
    found: dict[str, tuple[int, float]] = {}
    every: list[Stop | TramStop] = [*transit.transit.stops, *transit.transit.tram_stops]
    tree = shapely.STRtree(lines)
    for stop in every if lines else ():
        point = shapely.Point(stop.wait[:2])
        near = np.sort(tree.query(point, "dwithin", _STOP_REACH))
        if len(near):
            best = int(near[np.argmin(shapely.distance([lines[k] for k in near.tolist()], point))])
            found[stop.id] = int(ways[best]), float(shapely.line_locate_point(lines[best], point))
    return found


#: Seconds that doors take to open or close.
DOOR_TIME = 1.6
_PLUG = 0.05  # metres that open leaves stand out from the side


def step_doors(share: float, wanted: bool, dt: float) -> float:
    """Return how far doors are open, 0..1, that have opened (or closed, if that is wanted) for `dt` seconds more."""
    return min(max(share + (dt if wanted else -dt) / DOOR_TIME, 0.0), 1.0)


def leaf_transforms(
    bases: NDArray[np.float64], leaves: Sequence[tuple[float, float, float]], share: NDArray[np.float64], width: float
) -> NDArray[np.float64]:
    """Return where door leaves are, an open one before the wall beside its door.

    Parameters
    ----------
    bases
        Model to world of each vehicle, shape ``(n, 4, 4)``.
    leaves
        Of each leaf when closed the middle's x and y in the vehicle, metres, and which way along x it slides.
    share
        How far the doors of each vehicle are open, 0..1, shape ``(n,)``.
    width
        Metres that a leaf slides.

    Returns
    -------
    ndarray
        Shape ``(leaves * n, 4, 4)``, leaf by leaf.
    """
    n = len(bases)
    found = []
    for x, y, way in leaves:
        local = np.tile(np.eye(4), (n, 1, 1))
        local[:, 0, 3] = x + share * width * way
        local[:, 1, 3] = y + math.copysign(_PLUG, y) * np.minimum(share * 8.0, 1.0)
        found.append(product(bases, local))
    return np.concatenate(found) if found else np.zeros((0, 4, 4))
