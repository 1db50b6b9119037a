"""Cars, buses and pedestrians nobody plays: one population on the lane graph, moved by compiled kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.assets.vehicles import CAR_KINDS, mirrored, vehicle_prototypes, vehicle_size
from vico.errors import InputError
from vico.sim import traffic_vehicles as driving
from vico.sim import traffic_walkers as walking
from vico.sim.bodies import ASSISTANT, BUS, CAR, PEDESTRIAN, RESIDENT, Bodies, Drawn
from vico.sim.traffic_shapes import Shapes, count_overlaps
from vico.sim.traffic_ways import TRAIL
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.mesh import Surface
from vico.world.seeds import rng
from vico.world.walkways import CROSSING, SIDEWALK, Walkways

PERSON_HEIGHT = 1.72
# A car that nothing has let move for so long is taken out and comes back in at the map's edge (the way SUMO does it).
PATIENCE = 150.0
_ENTRY_SPEED = 6.0
_FAR = 1e7  # where bodies are before they have a place


class Traffic:
    """Vehicles and pedestrians, as arrays.

    Parameters
    ----------
    lanes
        Where they drive and walk.
    height
        Ground heights.
    cars, pedestrians
        How many of each.
    seed
        Decides who starts where, paces, makes and turns.
    first_entity
        Entities are numbered from here: cars, then buses, then pedestrians.
    routes
        Closed sequences of lane numbers that buses follow; `buses` holds the index of each bus's route.
    bus_starts
        Lane's place in its route and metres along it of each bus at the start.
    solids
        Footprints nobody walks through.

    Attributes
    ----------
    fleet, crowd, gates, shapes
        The state; see the kernels' modules.

    Raises
    ------
    InputError
        If there is not enough road or sidewalk for so many.
    """

    def __init__(
        self,
        lanes: LaneGraph,
        height: HeightField,
        *,
        cars: int,
        pedestrians: int,
        seed: int,
        first_entity: int,
        routes: Sequence[Sequence[int]] = (),
        buses: Sequence[int] = (),
        bus_starts: Sequence[tuple[int, float]] = (),
        solids: Sequence[shapely.Polygon] = (),
    ) -> None:
        self.lanes, self.height = lanes, height
        self.cars, self.buses, self.pedestrians = cars, len(buses), pedestrians
        self.vehicles = cars + len(buses)
        self.first_entity = first_entity
        self.walks = _connected(lanes.walks.clear_of(list(solids)))
        self._net = _net(lanes, self.walks, routes)
        self._paths = _paths(self.walks)
        n = self.vehicles + pedestrians
        self._prototypes = [f"{kind}_{colour}" for kind, colours in CAR_KINDS.items() for colour in colours] + ["bus"]
        makes_random = rng(seed, "traffic", "makes")
        shares = np.array(
            [share for kind, colours in CAR_KINDS.items() for share in [_SHARE[kind] / len(colours)] * len(colours)]
        )
        self.prototype = np.concatenate(
            [
                makes_random.choice(len(shares), cars, p=shares / shares.sum()),
                np.full(len(buses), len(shares)),
            ]
        ).astype(np.int32)
        sizes = np.array([vehicle_size(name) for name in self._prototypes])
        self._sizes = sizes[self.prototype].reshape(-1, 5)
        self._makes = driving.Makes(
            length=self._sizes[:, 0].copy(),
            half_width=self._sizes[:, 1] / 2,
            overhang=self._sizes[:, 3].copy(),
            wheelbase=self._sizes[:, 4].copy(),
            acceleration=np.where(np.arange(self.vehicles) < cars, 1.6, 1.1),
            haste=np.concatenate([makes_random.uniform(0.85, 1.05, cars), np.full(len(buses), 0.95)]),
            line=np.concatenate([np.full(cars, -1), np.asarray(buses, np.int64)]).astype(np.int32),
        )
        self._bodies: Bodies | None = None  # as they stand since they last moved; asked for by everybody
        self.fleet = _new_fleet(self.vehicles, seed)
        self.crowd = _new_crowd(pedestrians, seed)
        self.gates = driving.Gates(
            holder=np.full(max(lanes.zones, 1), -1, np.int32),
            walkers_on=np.zeros(len(self.walks), np.int32),
            walker_wait=np.zeros(len(self.walks)),
            vehicle_wait=np.zeros(len(self.walks)),
            longest=np.zeros(max(lanes.zones, 1)),
            busy=np.zeros(len(self.walks), np.bool_),
        )
        self.shapes = Shapes(
            x=np.full(n, _FAR) + np.arange(n) * 100.0,
            y=np.full(n, _FAR),
            yaw=np.zeros(n),
            half_length=np.concatenate([self._makes.length / 2, np.full(pedestrians, walking.RADIUS)]),
            half_width=np.concatenate([self._makes.half_width, np.full(pedestrians, walking.RADIUS)]),
            disc=np.arange(n) >= self.vehicles,
            vx=np.zeros(n),
            vy=np.zeros(n),
        )
        self._streets = np.zeros(len(lanes.edges), np.int32)
        usable = (lanes.inside < 0) & ~self._net.closed & (np.diff(lanes.next_first) > 0) & (lanes.length > 12.0)
        usable &= ~self._net.leaves
        self._entries = np.flatnonzero(usable & _at_border(lanes, lanes.first[:-1])).astype(np.int32)
        if not len(self._entries):
            self._entries = np.flatnonzero(usable & (lanes.zone < 0)).astype(np.int32)
        self._place_buses(bus_starts)
        self._place_cars(seed, np.flatnonzero(usable & (lanes.zone < 0)))
        self._place_pedestrians(seed)

    # -- start -------------------------------------------------------------------------------------------------------

    def _place_buses(self, starts: Sequence[tuple[int, float]]) -> None:
        for k, (place, offset) in enumerate(starts):
            v = self.cars + k
            line = self._makes.line[v]
            self.fleet.place[v] = place
            lane = self._net.route[self._net.route_first[line] + place]
            if not driving.place_vehicle(self._net, self._makes, self.fleet, v, lane, offset, self.shapes, 1.0):
                raise InputError(f"traffic: no room for bus {k} at its stop; run fewer buses on the line")

    def _place_cars(self, seed: int, usable: NDArray[np.int64]) -> None:
        random = rng(seed, "traffic", "cars")
        if self.cars and not len(usable):
            raise InputError("traffic: the world has no street for cars; use --cars 0")
        share = self.lanes.length[usable] / self.lanes.length[usable].sum() if len(usable) else None
        for v in range(self.cars):
            for _ in range(400):
                lane = int(random.choice(usable, p=share))
                low, high = self._makes.length[v] + 1.0, self.lanes.length[lane] - 1.5
                if high > low and driving.place_vehicle(
                    self._net, self._makes, self.fleet, v, lane, random.uniform(low, high), self.shapes, 2.0
                ):
                    break
            else:
                raise InputError(f"traffic: no room for car {v + 1} of {self.cars}; use fewer, as in --cars {v}")

    def _place_pedestrians(self, seed: int) -> None:
        random = rng(seed, "traffic", "pedestrians")
        usable = np.flatnonzero((self.walks.kind == SIDEWALK) & (self.walks.length > 3.0))
        if self.pedestrians and not len(usable):
            raise InputError("traffic: the world has no sidewalk; use --pedestrians 0")
        share = self.walks.length[usable] / self.walks.length[usable].sum() if len(usable) else None
        for i in range(self.pedestrians):
            for _ in range(400):
                stretch = int(random.choice(usable, p=share))
                offset, way = random.uniform(0.0, self.walks.length[stretch]), 1 if random.random() < 0.5 else -1
                if walking.place_walker(
                    self._paths, self.crowd, i, stretch, offset, way, self.shapes, self.vehicles + i
                ):
                    break
            else:
                raise InputError(
                    f"traffic: no room for pedestrian {i + 1} of {self.pedestrians}; use fewer, as in --pedestrians {i}"
                )

    # -- the subsystem contract --------------------------------------------------------------------------------------

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future, random streams among them."""
        state: dict[str, NDArray[Any]] = {}
        for name, part in self._parts():
            state |= {f"{name}.{field}": getattr(part, field).copy() for field in part._fields}
        return state

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        for name, part in self._parts():
            for field in part._fields:
                getattr(part, field)[...] = arrays[f"{name}.{field}"]
        self._bodies = None

    def _parts(self) -> list[tuple[str, Any]]:
        return [("fleet", self.fleet), ("crowd", self.crowd), ("gates", self.gates), ("shapes", self.shapes)]

    def bodies(self) -> Bodies:
        """Vehicles, then pedestrians."""
        if self._bodies is None:
            self._bodies = self._bodies_now()
        return self._bodies

    def _bodies_now(self) -> Bodies:
        n = len(self.shapes.x)
        xy = np.column_stack([self.shapes.x, self.shapes.y])
        return Bodies(
            entity=np.arange(self.first_entity, self.first_entity + n, dtype=np.int32),
            kind=np.repeat(np.array([CAR, BUS, PEDESTRIAN], np.int8), [self.cars, self.buses, self.pedestrians]),
            position=np.column_stack([xy, self.height(xy)]),
            yaw=self.shapes.yaw.copy(),
            half_length=self.shapes.half_length.copy(),
            half_width=self.shapes.half_width.copy(),
            height=np.concatenate([self._sizes[:, 2], np.full(self.pedestrians, PERSON_HEIGHT)]),
            velocity=np.column_stack([self.shapes.vx, self.shapes.vy]),
        )

    def advance(self, dt: float, obstacles: Bodies) -> None:
        """Move everybody on by `dt` seconds; nobody touches anybody, `obstacles` (all other bodies) among them."""
        n = len(self.shapes.x)
        disc = (obstacles.kind == RESIDENT) | (obstacles.kind == ASSISTANT) | (obstacles.kind == PEDESTRIAN)
        all_ = Shapes(
            x=np.concatenate([self.shapes.x, obstacles.position[:, 0]]),
            y=np.concatenate([self.shapes.y, obstacles.position[:, 1]]),
            yaw=np.concatenate([self.shapes.yaw, obstacles.yaw]),
            half_length=np.concatenate([self.shapes.half_length, obstacles.half_length]),
            half_width=np.concatenate([self.shapes.half_width, obstacles.half_width]),
            disc=np.concatenate([self.shapes.disc, disc]),
            vx=np.concatenate([self.shapes.vx, obstacles.velocity[:, 0]]),
            vy=np.concatenate([self.shapes.vy, obstacles.velocity[:, 1]]),
        )
        net, makes, fleet, gates = self._net, self._makes, self.fleet, self.gates
        driving.mark_busy(net, makes, fleet, gates)
        walking.advance_walkers(self._paths, self.crowd, gates, fleet.blocker, fleet.still, all_, self.vehicles, dt)
        gates.vehicle_wait[:] = 0.0
        driving.streets_count(net, fleet, self._streets)
        driving.advance_vehicles(net, makes, fleet, gates, all_, self._streets, dt)
        driving.relocate(net, makes, fleet, gates, all_, self._entries, _ENTRY_SPEED, PATIENCE)
        for field in ("x", "y", "yaw", "vx", "vy"):
            getattr(self.shapes, field)[:] = getattr(all_, field)[:n]
        self._bodies = None

    def draw(self) -> Drawn:
        """Cars and buses; pedestrians are drawn by whoever skins people."""
        m = self.vehicles
        c, s = np.cos(self.shapes.yaw[:m]), np.sin(self.shapes.yaw[:m])
        xy = np.column_stack([self.shapes.x[:m], self.shapes.y[:m]])
        half = self._makes.wheelbase / 2
        along = np.column_stack([c, s]) * half[:, None]
        # On slopes a vehicle stands on its axles: pitch follows the ground between them.
        front, back = self.height(xy + along), self.height(xy - along)
        slope = (front - back) / (2 * half) if m else np.zeros(0)
        size = np.sqrt(1.0 + slope**2)
        transforms = np.zeros((m, 4, 4), np.float32)
        forward = np.column_stack([c / size, s / size, slope / size])
        left = np.column_stack([-s, c, np.zeros(m)])
        transforms[:, :3, 0], transforms[:, :3, 1] = forward, left
        transforms[:, :3, 2] = np.cross(forward, left)
        transforms[:, :2, 3], transforms[:, 2, 3] = xy, (front + back) / 2
        transforms[:, 3, 3] = 1.0
        entity = np.arange(self.first_entity, self.first_entity + m, dtype=np.int32)
        return Drawn(self._prototypes, self.prototype, transforms, entity)

    def prototypes(self) -> dict[str, list[Surface]]:
        """Models of the vehicles, by the names `draw` uses."""
        models = vehicle_prototypes()
        # Doors open to the kerb.
        return models | {"bus": [mirrored(part) for part in models["bus"]]} if self.lanes.lefthand else models

    # -- what others ask ---------------------------------------------------------------------------------------------

    @property
    def walkers(self) -> Bodies:
        """The pedestrians alone."""
        everybody = self.bodies()
        return Bodies(*(getattr(everybody, name)[self.vehicles :] for name in Bodies.__dataclass_fields__))

    @property
    def gait(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Speed (m/s) and distance walked so far (m) of each pedestrian: what sets a walking clip's rate and phase."""
        return self.crowd.speed.copy(), self.crowd.walked.copy()

    def overlaps(self, others: Bodies | None = None) -> int:
        """Pairs of touching bodies among traffic (and `others`): 0 at all times."""
        bodies = Bodies.joined([self.bodies(), others or Bodies.none()])
        disc = (bodies.kind == RESIDENT) | (bodies.kind == ASSISTANT) | (bodies.kind == PEDESTRIAN)
        shapes = Shapes(
            bodies.position[:, 0].copy(), bodies.position[:, 1].copy(), bodies.yaw, bodies.half_length,
            bodies.half_width, disc, bodies.velocity[:, 0].copy(), bodies.velocity[:, 1].copy(),
        )  # fmt: skip
        return int(count_overlaps(shapes, 0.0))


_SHARE = {"hatchback": 0.3, "sedan": 0.27, "suv": 0.23, "van": 0.12, "taxi": 0.08}


def _net(lanes: LaneGraph, walks: Walkways, routes: Sequence[Sequence[int]]) -> driving.Net:
    over_first, over, until = _crossed(lanes, walks)
    leaves = (lanes.inside < 0) & _at_border(lanes, lanes.first[1:] - 1)
    n = np.arange(len(lanes))
    turn = lanes.at(n, lanes.length)[:, 2] - lanes.at(n, 0.0)[:, 2]
    u_turn = (lanes.inside >= 0) & (np.abs((turn + np.pi) % (2 * np.pi) - np.pi) > 2.6)
    route_first = np.zeros(len(routes) + 1, np.int32)
    route_first[1:] = np.cumsum([len(route) for route in routes])
    return driving.Net(
        first=lanes.first,
        points=lanes.points,
        along=lanes.along,
        length=lanes.length,
        speed=lanes.speed,
        zone=lanes.zone,
        inside=lanes.inside,
        edge=lanes.edge,
        closed=_closed(lanes, leaves),
        left=lanes.left,
        right=lanes.right,
        next_first=lanes.next_first,
        next=lanes.next,
        over_first=over_first,
        over=over,
        over_until=until,
        u_turn=u_turn,
        leaves=leaves,
        route_first=route_first,
        route=np.array([lane for route in routes for lane in route], np.int32),
    )


def _closed(lanes: LaneGraph, leaves: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Lanes cars keep off: those of buses, and pockets that lead neither off the map nor back into the streets.

    Cars that found the way into such a pocket would gather there.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    n = len(lanes)
    if not n:
        return np.zeros(0, bool)
    a, b = np.repeat(np.arange(n), np.diff(lanes.next_first)), lanes.next
    driven = ~(lanes.buses_only[a] | lanes.buses_only[b])
    a, b = a[driven], b[driven]
    _, part = connected_components(csr_matrix((np.ones(len(a)), (a, b)), shape=(n, n)), connection="strong")
    streets = part == np.argmax(np.bincount(part, weights=lanes.length * ~lanes.buses_only))
    # Backwards from one more node, which stands for having got out.
    out = np.flatnonzero((leaves | streets) & ~lanes.buses_only)
    starts, ends = np.concatenate([b, np.full(len(out), n)]), np.concatenate([a, out])
    back = csr_matrix((np.ones(len(starts)), (starts, ends)), shape=(n + 1, n + 1))
    closed = np.ones(n + 1, bool)
    closed[breadth_first_order(back, n, return_predecessors=False)] = False
    return closed[:n]


def _at_border(lanes: LaneGraph, point: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Which points (one a lane) lie where the map cuts the streets off."""
    reach = np.abs(lanes.points).max(initial=0.0)
    return np.asarray(np.abs(lanes.points[point]).max(axis=1) > reach - 6.0)


def _crossed(lanes: LaneGraph, walks: Walkways) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    """For each lane the crossings it runs over, and the metres along it at which a vehicle's rear is past each."""
    crossings = np.flatnonzero(walks.kind == CROSSING)
    areas = [
        shapely.LineString(walks.line(int(c))).buffer(walks.width[c] / 2 + 0.3, cap_style="square") for c in crossings
    ]
    lines = [shapely.LineString(lanes.line(i)) for i in range(len(lanes))]
    rows: list[list[tuple[int, float]]] = [[] for _ in range(len(lanes))]
    if areas:
        tree = shapely.STRtree(areas)
        for i, line in enumerate(lines):
            swept = line.buffer(0.9, cap_style="flat")
            for k in np.sort(tree.query(swept, predicate="intersects")).tolist():
                part = areas[k].intersection(line)
                ends = [line.project(shapely.Point(p)) for p in shapely.get_coordinates(part)] or [line.length]
                rows[i].append((int(crossings[k]), max(ends) + 0.5))
    first = np.zeros(len(lanes) + 1, np.int32)
    first[1:] = np.cumsum([len(row) for row in rows])
    flat = [pair for row in rows for pair in row]
    return first, np.array([c for c, _ in flat], np.int32), np.array([u for _, u in flat], np.float64)


def _connected(walks: Walkways) -> Walkways:
    """Without the scraps of sidewalk too small to walk along."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    if not len(walks):
        return walks
    nodes = len(walks.meeting_first) - 1
    graph = csr_matrix((np.ones(len(walks), np.int8), (walks.ends[:, 0], walks.ends[:, 1])), shape=(nodes, nodes))
    _, part = connected_components(graph, directed=False)
    size = np.bincount(part[walks.ends[:, 0]], weights=walks.length)
    return walks.without(size[part[walks.ends[:, 0]]] < 60.0)


def _paths(walks: Walkways) -> walking.Paths:
    return walking.Paths(
        walks.first, walks.points, walks.along, walks.length, walks.room, walks.reach, walks.kind, walks.ends,
        walks.meeting_first, walks.meeting,
    )  # fmt: skip


def _streams(seed: int, name: str, n: int) -> NDArray[np.uint64]:
    return rng(seed, "traffic", name).integers(0, 2**63, n, dtype=np.uint64)


def _new_fleet(n: int, seed: int) -> driving.Fleet:
    return driving.Fleet(
        lane=np.zeros(n, np.int32),
        offset=np.zeros(n),
        speed=np.zeros(n),
        trail=np.full((n, TRAIL), -1, np.int32),
        plan=np.full((n, driving.PLAN), -1, np.int32),
        planned=np.zeros(n, np.int32),
        granted=np.zeros(n, np.int32),
        held=np.full((n, driving.HELD), -1, np.int32),
        shift=np.zeros(n),
        changed=np.zeros(n),
        blocker=np.full(n, -1, np.int32),
        pace=np.full(n, driving.TOP_SPEED),
        still=np.zeros(n),
        waited=np.zeros(n),
        queue=np.full(n, -1, np.int32),
        rested=np.zeros(n),
        place=np.zeros(n, np.int32),
        goal=np.full(n, -1, np.int32),
        goal_offset=np.zeros(n),
        arrived=np.zeros(n, np.bool_),
        rounds=np.zeros(n, np.int32),
        rescued=np.zeros(n, np.int32),
        random=_streams(seed, "turns", n),
    )


def _new_crowd(n: int, seed: int) -> walking.Crowd:
    random = rng(seed, "traffic", "paces")
    return walking.Crowd(
        stretch=np.zeros(n, np.int32),
        offset=np.zeros(n),
        way=np.ones(n, np.int32),
        side=random.uniform(0.1, 0.95, n),
        pace=random.uniform(1.0, 1.5, n),
        speed=np.zeros(n),
        walked=np.zeros(n),
        stuck=np.zeros(n),
        jammed=np.zeros(n),
        anchor=np.zeros((n, 2)),
        waited=np.zeros(n),
        leaving=np.full(n, -1, np.int32),
        since=np.zeros(n),
        random=_streams(seed, "ways", n),
    )
