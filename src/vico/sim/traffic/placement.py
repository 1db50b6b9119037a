"""Start positions of vehicles and pedestrians: by the seed, at bus stops, or from a file of traffic.

Cars and pedestrians of a file have routes: the network is given the ways that lead there from wherever they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from vico.assets.vehicles import CAR_KINDS
from vico.errors import InputError
from vico.io.data_files import DataRecord, record_of
from vico.seeds import rng
from vico.sim.traffic.car_following import starts_of_cyclists
from vico.sim.traffic.junctions import JunctionRule
from vico.sim.traffic.pedestrian_routes import choose_companions, leave_group
from vico.sim.traffic.pedestrians import place_pedestrian
from vico.sim.traffic.shapes import Shapes
from vico.sim.traffic.state import NONE, LaneNetwork, WalkwayNetwork
from vico.sim.traffic.vehicles import place_vehicle
from vico.world.lanes import LaneGraph
from vico.world.walkways import SIDEWALK, Walkways

_TRIES = 400  # places tried for a car or pedestrian


class NoRoomError(InputError):
    """A world has no room for as many as are asked for.

    Attributes
    ----------
    kind
        Of whom: ``cars``, ``cyclists`` or ``pedestrians``.
    room
        How many there is room for.
    """

    kind = ""
    room = 0


def _no_room(kind: str, room: int, sentence: str) -> NoRoomError:
    error = NoRoomError(f"traffic: {sentence}; take a larger world, or ask for {room} {kind}")
    error.kind, error.room = kind, room
    return error


@dataclass(frozen=True)
class Starting:
    """Vehicles and pedestrians that are given their first places.

    Attributes
    ----------
    lanes, walks, net, paths
        Where they drive and walk.
    fleet, walkers, shapes
        The state, changed in place; see `vico.sim.traffic.state`.
    """

    lanes: LaneGraph
    walks: Walkways
    net: LaneNetwork
    paths: WalkwayNetwork
    fleet: NDArray[np.void]
    walkers: NDArray[np.void]
    shapes: Shapes

    def place_vehicle(self, v: int, lane: int, offset: float, air: float) -> bool:
        """Put a vehicle on a lane; return whether there is room, with so many metres of air around it."""
        return bool(place_vehicle(self.net, self.fleet, v, lane, offset, self.shapes, air))

    def place_buses(self, first: int, starts: Sequence[tuple[int, float]]) -> None:
        """Put buses, vehicles from number `first` on, where their routes begin: a place in the route, and metres.

        Raises
        ------
        InputError
            If somebody is there already; the others raise it where there is no room for all.
        """
        for k, (place, offset) in enumerate(starts):
            v = first + k
            self.fleet["route_index"][v] = place
            lane = self.net.route[self.net.route_first[self.fleet["route"][v]] + place]
            if not self.place_vehicle(v, lane, offset, 1.0):
                raise InputError(f"traffic: no room for bus {k} at its stop; run fewer buses on the line")

    def place_cars(self, seed: int, usable: NDArray[np.int64], first: int, cars: int) -> None:
        """Put the cars from number `first` on somewhere on the usable lanes; `cars`: how many there are in all."""
        random = rng(seed, "traffic", "cars")
        if cars and not len(usable):
            raise _no_room("cars", 0, "the world has no street for cars")
        share = self.lanes.length[usable] / self.lanes.length[usable].sum() if len(usable) else None
        for v in range(first, cars):
            for _ in range(_TRIES):
                lane = int(random.choice(usable, p=share))
                low, high = self.fleet["length"][v] + 1.0, self.lanes.length[lane] - 1.5
                if high > low and self.place_vehicle(v, lane, random.uniform(low, high), 2.0):
                    break
            else:
                raise _no_room("cars", v, f"no room for car {v + 1} of {cars}")

    def place_cyclists(self, seed: int, usable: NDArray[np.int64], cyclists: int) -> None:
        """Put cyclists, the last of the vehicles, somewhere at the kerb of usable lanes."""
        random = rng(seed, "traffic", "cyclists at the start")
        kerb, share = starts_of_cyclists(self.lanes, usable, cyclists)
        for k, v in enumerate(range(len(self.fleet) - cyclists, len(self.fleet))):
            for _ in range(_TRIES):
                lane = int(random.choice(kerb, p=share))
                low, high = self.fleet["length"][v] + 1.0, self.lanes.length[lane] - 1.5
                if high > low and self.place_vehicle(v, lane, random.uniform(low, high), 1.0):
                    break
            else:
                raise _no_room("cyclists", k, f"no room for cyclist {k + 1} of {cyclists}")

    def place_pedestrians(self, seed: int, first: int) -> None:
        """Put the pedestrians from number `first` on somewhere on sidewalks, those who walk together side by side."""
        random = rng(seed, "traffic", "pedestrians")
        usable = np.flatnonzero((self.walks.kind == SIDEWALK) & (self.walks.length > 3.0))
        if len(self.walkers) and not len(usable):
            raise _no_room("pedestrians", 0, "the world has no sidewalk")
        share = self.walks.length[usable] / self.walks.length[usable].sum() if len(usable) else None
        choose_companions(self.walkers, first, seed)
        for i in range(first, len(self.walkers)):
            if self.walkers["leader"][i] != NONE and self._place_companion(i):
                continue
            for _ in range(_TRIES):
                walkway = int(random.choice(usable, p=share))
                offset, way = random.uniform(0.0, self.walks.length[walkway]), 1 if random.random() < 0.5 else -1
                if self._place_pedestrian(i, walkway, offset, way):
                    break
            else:
                raise _no_room("pedestrians", i, f"no room for pedestrian {i + 1} of {len(self.walkers)}")

    def _place_pedestrian(self, i: int, walkway: int, offset: float, way: int) -> bool:
        b = len(self.fleet) + i
        return bool(place_pedestrian(self.paths, self.walkers, i, walkway, offset, way, self.shapes, b))

    def _place_companion(self, i: int) -> bool:
        """Put a pedestrian near who leads it; who finds no room there walks alone."""
        leader = self.walkers[self.walkers["leader"][i]]
        walkway, way, offset = (leader[name].item() for name in ("walkway", "direction", "offset"))
        places = [offset + side * 1.05 * k for k in (1, 2, 3) for side in (-way, way)]
        length = self.walks.length[walkway]
        if any(0.0 <= place <= length and self._place_pedestrian(i, walkway, place, way) for place in places):
            return True
        leave_group(self.walkers, i)
        return False


#: No traffic placed by hand.
NO_TRAFFIC = "none"
_GUIDE = "docs/traffic.md"
_MODELS = [f"{kind}_{colour}" for kind, colours in CAR_KINDS.items() for colour in colours]

Point = tuple[float, float]


class PlacedCar(DataRecord):
    """A car that starts at a place.

    Attributes
    ----------
    at
        Where its front is, ENU metres: the nearest lane within 10 m counts.
    route
        Points whose streets it drives over, one after the other, ENU metres; beyond the last it drives as others do.
    model
        A kind of car and its paint, such as ``sedan_black``; "" leaves it to the seed.
    """

    model_config = ConfigDict(allow_inf_nan=False)

    at: Point
    route: tuple[Point, ...] = ()
    model: str = ""


class PlacedWalker(DataRecord):
    """A pedestrian that starts at a place.

    Attributes
    ----------
    at
        ENU metres: the nearest sidewalk within 10 m counts.
    route
        Points whose sidewalks it walks over, one after the other, ENU metres; then it goes on as others do.
    speed
        Metres a second it prefers; None leaves it to the seed.
    """

    model_config = ConfigDict(allow_inf_nan=False)

    at: Point
    route: tuple[Point, ...] = ()
    speed: float | None = Field(default=None, ge=0.5, le=2.5)


class PlacedTraffic(DataRecord):
    """What a file of traffic lists."""

    cars: tuple[PlacedCar, ...] = Field(default=(), max_length=1000)
    pedestrians: tuple[PlacedWalker, ...] = Field(default=(), max_length=1000)


def placed_traffic(wanted: str | Mapping[str, Any], *, source: str = "traffic") -> PlacedTraffic:
    """Return traffic placed by hand; docs/traffic.md describes it.

    Parameters
    ----------
    wanted
        ``"none"``, or the content of a file of traffic.

    Raises
    ------
    SchemaError
        If it is not of that form.
    InputError
        If it names a model that is not known.
    """
    if isinstance(wanted, str):
        if wanted != NO_TRAFFIC:
            raise InputError(f"{source}: {wanted!r} is not known; take {NO_TRAFFIC}, or a file of traffic (.json)")
        return PlacedTraffic()
    found = record_of(wanted, PlacedTraffic, source=source, guide=_GUIDE)
    for k, car in enumerate(found.cars):
        if car.model and car.model not in _MODELS:
            raise InputError(f"{source}: cars.{k}: no model {car.model!r}; there are {', '.join(_MODELS)}")
    return found


_REACH = 10.0  # m from a point to its lane or sidewalk


def lane_at(lanes: LaneGraph, net: LaneNetwork, point: Point, where: str) -> tuple[int, float]:
    """Return the street lane nearest to a point that cars use, and the metres along it.

    Raises
    ------
    InputError
        If there is none within reach.
    """
    found = lanes.nearest(point, (lanes.inside < 0) & ~net.lanes["closed"], _REACH)
    if found is None:
        raise InputError(f"{where}: no lane for cars within {_REACH:g} m of {list(point)}")
    return found[0], found[1]


def walkway_at(walks: Walkways, point: Point, where: str) -> tuple[int, float]:
    """Return the sidewalk nearest to a point, and the metres along it.

    Raises
    ------
    InputError
        If there is none within reach.
    """
    import shapely

    ways = np.flatnonzero(walks.kind == SIDEWALK)
    lines = [shapely.LineString(walks.line(int(way))) for way in ways]
    away = shapely.distance(lines, shapely.Point(point)) if lines else np.full(1, np.inf)
    best = int(np.argmin(away))
    if away[best] > _REACH:
        raise InputError(f"{where}: no sidewalk within {_REACH:g} m of {list(point)}")
    return int(ways[best]), float(shapely.line_locate_point(lines[best], shapely.Point(point)))


def guided_lanes(
    lanes: LaneGraph, net: LaneNetwork, starts: Sequence[int], routes: Sequence[Sequence[int]]
) -> LaneNetwork:
    """Return the network with the ways to the streets of some lanes, each along the shortest.

    Parameters
    ----------
    starts, routes
        Lane of each car, and lanes over whose streets it is to drive.

    Raises
    ------
    InputError
        If no way leads on from one to the next.
    """
    n = len(lanes)
    from_, to = np.repeat(np.arange(n), np.diff(lanes.next_first)), lanes.next
    open_ = ~(net.lanes["closed"][from_] | net.lanes["closed"][to])
    # Backwards: from a lane to those that lead into it.
    back = csr_matrix((lanes.length[from_[open_]] + 0.01, (to[open_], from_[open_])), shape=(n, n))
    lead: list[NDArray[np.int32]] = []
    for k, (start, route) in enumerate(zip(starts, routes, strict=True)):
        reaches = np.ones(n, np.bool_)
        ways: list[NDArray[np.int32]] = []
        for i in range(len(route) - 1, -1, -1):
            # Only lanes from which there is a way to the next goal, without changing lanes.
            ends = np.flatnonzero((lanes.edge == lanes.edge[route[i]]) & ~net.lanes["closed"] & reaches)
            if not len(ends):
                raise InputError(f"traffic: cars.{k}.route.{i + 1}: no way for cars leads there")
            away, onward, _ = dijkstra(back, indices=ends, min_only=True, return_predecessors=True)
            ways.insert(0, np.where(onward >= 0, onward, NONE).astype(np.int32))
            reaches = np.isfinite(away)
        if not reaches[start]:
            raise InputError(f"traffic: cars.{k}.route.0: no way for cars leads there")
        lead += ways
    edges = np.array([lanes.edge[goal] for route in routes for goal in route], np.int32)
    return net._replace(goal_edge=edges, goal_next=np.array(lead, np.int32).reshape(len(edges), n))


def guided_walks(
    walks: Walkways, paths: WalkwayNetwork, goals: Sequence[int], *, shut: NDArray[np.bool_] | None = None
) -> WalkwayNetwork:
    """Return the network with how far it is from each meeting point to some walkways, without those that are shut."""
    nodes = len(walks.meeting_first) - 1
    away = np.full((len(goals), max(nodes, 1)), np.inf)
    if goals:
        open_ = np.ones(len(walks), np.bool_) if shut is None else ~shut
        ends = walks.ends[open_]
        graph = csr_matrix((walks.length[open_] + 0.01, (ends[:, 0], ends[:, 1])), shape=(nodes, nodes))
        for k, goal in enumerate(goals):
            away[k] = dijkstra(graph, directed=False, indices=walks.ends[goal], min_only=True)
    return paths._replace(goal_walkway=np.asarray(goals, np.int32), goal_away=away)


@dataclass(frozen=True)
class TrafficSetup:
    """What a run asks of its traffic, beside how much of it there is.

    Attributes
    ----------
    junction_rule
        Who may be in a junction.
    placed
        Who is placed by hand: the first cars and the first pedestrians, beside the others.
    cyclists
        How many people nobody plays ride bicycles.
    """

    junction_rule: JunctionRule = JunctionRule.ONE
    placed: PlacedTraffic = field(default_factory=PlacedTraffic)
    cyclists: int = 0


@dataclass(frozen=True)
class HandPlaced:
    """Where those are put who are placed by hand, and the network with the ways to their goals.

    Attributes
    ----------
    cars, walkers
        Lane (walkway) and metres along it of each.
    car_goals, walker_goals
        First of its goals in the network, and the one after its last.
    """

    net: LaneNetwork
    paths: WalkwayNetwork
    cars: list[tuple[int, float]]
    walkers: list[tuple[int, float]]
    car_goals: list[tuple[int, int]]
    walker_goals: list[tuple[int, int]]

    @classmethod
    def of(
        cls, placed: PlacedTraffic, lanes: LaneGraph, walks: Walkways, net: LaneNetwork, paths: WalkwayNetwork
    ) -> HandPlaced:
        """Find lanes, sidewalks and ways.

        Raises
        ------
        InputError
            If a point is on no street, or no way leads to it.
        """
        cars = [lane_at(lanes, net, car.at, f"traffic: cars.{k}.at") for k, car in enumerate(placed.cars)]
        walkers = [
            walkway_at(walks, one.at, f"traffic: pedestrians.{k}.at") for k, one in enumerate(placed.pedestrians)
        ]
        routes = [
            [lane_at(lanes, net, point, f"traffic: cars.{k}.route.{i}")[0] for i, point in enumerate(car.route)]
            for k, car in enumerate(placed.cars)
        ]
        walked = [
            [walkway_at(walks, point, f"traffic: pedestrians.{k}.route.{i}")[0] for i, point in enumerate(one.route)]
            for k, one in enumerate(placed.pedestrians)
        ]
        net = guided_lanes(lanes, net, [lane for lane, _ in cars], routes)
        paths = guided_walks(walks, paths, [goal for route in walked for goal in route])
        found = cls(net, paths, cars, walkers, _spans(routes), _spans(walked))
        for k, ((way, _), route, (first, _)) in enumerate(zip(walkers, walked, found.walker_goals, strict=True)):
            for i, start in enumerate([way, *route[:-1]] if route else []):
                if not np.isfinite(paths.goal_away[first + i, walks.ends[start]]).any():
                    raise InputError(f"traffic: pedestrians.{k}.route.{i}: no way along sidewalks leads there")
        return found

    def put_cars(self, vehicles: NDArray[np.void], shapes: Shapes) -> None:
        """Put the first vehicles where they are to be, and give them their goals.

        Raises
        ------
        InputError
            If somebody is there already.
        """
        for v, ((lane, offset), goals) in enumerate(zip(self.cars, self.car_goals, strict=True)):
            least = float(vehicles["length"][v]) + 0.5
            offset = min(max(offset, least), float(self.net.lanes["length"][lane]) - 1.0)
            if offset < least or not place_vehicle(self.net, vehicles, v, lane, offset, shapes, 0.5):
                raise InputError(f"traffic: cars.{v}.at: no room there for a car; move it a little")
            _give(vehicles[v], goals)

    def put_walkers(self, walkers: NDArray[np.void], shapes: Shapes, first: int) -> None:
        """Put the first pedestrians, whose bodies begin at `first`, where they are to be, and give them their goals.

        Raises
        ------
        InputError
            If somebody is there already.
        """
        for i, ((way, offset), goals) in enumerate(zip(self.walkers, self.walker_goals, strict=True)):
            start, end = self.paths.walkways["start"][way], self.paths.walkways["end"][way]
            away = self.paths.goal_away[goals[0]] if goals[1] > goals[0] else None
            direction = 1 if away is None or away[end] <= away[start] else -1
            if not place_pedestrian(self.paths, walkers, i, way, offset, direction, shapes, first + i):
                raise InputError(f"traffic: pedestrians.{i}.at: somebody is there; move it a little")
            _give(walkers[i], goals)


def _give(record: Any, goals: tuple[int, int]) -> None:
    if goals[1] > goals[0]:
        record["goal"], record["goal_end"] = goals


def _spans(routes: list[list[int]]) -> list[tuple[int, int]]:
    ends = np.cumsum([len(route) for route in routes]).tolist()
    return [(end - len(route), end) for route, end in zip(routes, ends, strict=True)]
