"""Cars, buses, cyclists and pedestrians nobody plays: one population on the lane graph, moved by compiled kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.bodies.arrays import BUS, CAR, CYCLIST, PEDESTRIAN, STEP_HEIGHT, Bodies
from vico.sim.bodies.footprints import neighbour_grid
from vico.sim.environment import Conditions
from vico.sim.traffic.car_following import (
    COMFORTABLE_BRAKING,
    CYCLIST_HALF_WIDTH,
    CYCLIST_HEIGHT,
    TIME_GAP,
    choose_models,
    equip_cyclists,
    kerb_points,
)
from vico.sim.traffic.drawing import TrafficDrawing, TrafficView
from vico.sim.traffic.gatherings import Gatherings
from vico.sim.traffic.jams import STUCK_AFTER, Jam, JamLog
from vico.sim.traffic.junctions import crossed_tracks
from vico.sim.traffic.network import TrafficNetwork
from vico.sim.traffic.pedestrian_routes import PEDESTRIAN_RADIUS, mark_busy_crossings
from vico.sim.traffic.pedestrians import advance_pedestrians, stand_at_start
from vico.sim.traffic.placement import HandPlaced, Starting, TrafficSetup
from vico.sim.traffic.route import count_per_street, drop_shut_plans, widen_shut
from vico.sim.traffic.shapes import Shapes, TrafficLevels, shapes_of
from vico.sim.traffic.signals import Circles, SignalClock, SignalHeads, SignalsShown
from vico.sim.traffic.state import (
    AWAY,
    COMING,
    NONE,
    PEDESTRIAN_RECORD,
    TOP_SPEED,
    VEHICLE_STATE,
    BusRoutes,
    new_fleet,
    new_junctions,
    new_pedestrians,
)
from vico.sim.traffic.stopping_places import without_deliveries
from vico.sim.traffic.vehicles import advance_vehicles, bring_back, come_back, place_vehicle, take_away
from vico.world.heights import HeightField

PERSON_HEIGHT = 1.72
# A car that nothing has let move for so long (s) comes back in at the map's edge, as SUMO does it.
PATIENCE = 150.0
_ENTRY_SPEED = 6.0  # m/s
_FAR = 1e7  # where bodies are before they have a place, m
_CELL = 25.0  # of the grid of neighbours, m
_DRIFT = 2.0 * TOP_SPEED  # nobody moves faster, m/s


class Traffic(TrafficView):
    """Vehicles and pedestrians, as arrays.

    Parameters
    ----------
    network
        Where they drive and walk.
    height
        Ground heights.
    cars, pedestrians
        How many of each.
    seed
        Decides who starts where, paces, makes and turns.
    first_entity
        Entities are numbered from here: cars, then buses, then cyclists, then pedestrians.
    buses
        Their routes and where they start.
    setup
        How many cyclists there are, who may be in a junction, and who is placed by hand.

    Attributes
    ----------
    fleet, pedestrian_state, junctions, shapes
        The state; see `vico.sim.traffic.state`.
    jams
        Remembers who was taken out of a jam.

    Raises
    ------
    InputError
        If there is not enough road or sidewalk for so many.
    """

    def __init__(
        self,
        network: TrafficNetwork,
        height: HeightField,
        *,
        cars: int,
        pedestrians: int,
        seed: int,
        first_entity: int,
        buses: BusRoutes | None = None,
        setup: TrafficSetup | None = None,
    ) -> None:
        buses, setup = buses or BusRoutes(), setup or TrafficSetup()
        junction_rule, placed, cyclists = setup.junction_rule, setup.placed, setup.cyclists
        cars, pedestrians = cars + len(placed.cars), pedestrians + len(placed.pedestrians)
        lanes = network.lanes
        self.lanes, self.height, self.walks = lanes, height, network.walks
        self.cars, self.buses, self.pedestrians = cars, len(buses.buses), pedestrians
        self.cyclists = cyclists
        self.vehicles = self.cars + self.buses + cyclists
        self.first_entity = first_entity
        self.junction_rule = junction_rule
        net = network.with_routes(buses.routes, shared=junction_rule.is_shared)
        net = without_deliveries(net, net.route)
        if cyclists:
            net = net._replace(kerb_points=kerb_points(lanes))
        # Copies of one's own: how fast lanes are driven follows the weather of the run, and what is shut its events.
        walked = network.walked._replace(walkways=network.walked.walkways.copy())
        hand = HandPlaced.of(placed, lanes, network.walks, net._replace(lanes=net.lanes.copy()), walked)
        self._net, self.paths = hand.net, hand.paths
        self._shut: tuple[NDArray[np.bool_] | None, NDArray[np.bool_] | None] = None, None
        self._speed_limits = net.lanes["speed"].copy()
        self._conditions: Conditions | None = None
        self._walking_pace = 1.0
        self._vehicles = new_fleet(self.vehicles, seed)
        self.fleet = self._vehicles.view(np.recarray)
        models = [car.model for car in placed.cars]
        ridden = slice(self.vehicles - cyclists, self.vehicles)
        motor, height_of_motor = choose_models(
            self._vehicles[: ridden.start].view(np.recarray), buses.buses, models, seed
        )
        self.prototype = np.concatenate([motor, equip_cyclists(self._vehicles[ridden].view(np.recarray), seed)])
        self._vehicle_height = np.concatenate([height_of_motor, np.full(cyclists, CYCLIST_HEIGHT)])
        #: Metres that each cyclist has ridden.
        self.ridden = np.zeros(cyclists)
        self._riding_speed = self.fleet.target_speed[ridden].copy()
        self._dry_acceleration, self._dry_braking = self.fleet.acceleration.copy(), self.fleet.hard_braking.copy()
        self._bodies = None
        self._walkers = new_pedestrians(pedestrians, seed)
        self.pedestrian_state = self._walkers.view(np.recarray)
        self.junctions = new_junctions(lanes.zones, len(self.walks), len(lanes), shared=junction_rule.is_shared)
        self.jams = JamLog(first_entity)
        self._entities = np.zeros(0, np.int32)  # of all bodies of the last step, in the order of its shapes
        self.shapes = self._new_shapes()
        self.signals = SignalClock(lanes, network.walks, seed) if junction_rule.has_signals else None
        heads = SignalHeads(lanes, network.walks, network.poles, height) if self.signals else None
        self._levels = TrafficLevels(height, lanes, network.walks, self._heights, self.shapes.bottom.copy())
        self.seats = None
        self._drawing = TrafficDrawing(self.prototype, self._own_entities[: self.vehicles], heads)
        self._street_load = np.zeros(len(lanes.edges), np.int32)
        self._entries = self._all_entries = network.entries
        start = Starting(lanes, self.walks, self._net, self.paths, self._vehicles, self._walkers, self.shapes)
        start.place_buses(self.cars, buses.starts)
        hand.put_cars(self._vehicles, self.shapes)
        hand.put_walkers(self._walkers, self.shapes, self.vehicles)
        for i, one in enumerate(placed.pedestrians):
            self.pedestrian_state.preferred_speed[i] = one.speed or self.pedestrian_state.preferred_speed[i]
        start.place_cars(seed, network.starts, len(placed.cars), self.cars)
        start.place_cyclists(seed, network.starts, cyclists)
        start.place_pedestrians(seed, len(placed.pedestrians))
        stand_at_start(self.paths, self._walkers, self.shapes, self.vehicles, seed)
        #: Leads pedestrians to events.
        self.gatherings = Gatherings(self)
        far = np.full(len(self.shapes.x), _FAR)
        self._follow_levels(far, far)

    # -- start -------------------------------------------------------------------------------------------------------

    def _new_shapes(self) -> Shapes:
        n = self.vehicles + self.pedestrians
        # What never changes of the bodies.
        self._own_entities = np.arange(self.first_entity, self.first_entity + n, dtype=np.int32)
        kinds = np.array([CAR, BUS, CYCLIST, PEDESTRIAN], np.int8)
        self._kinds = np.repeat(kinds, [self.cars, self.buses, self.cyclists, self.pedestrians])
        self._heights = np.concatenate([self._vehicle_height, np.full(self.pedestrians, PERSON_HEIGHT)])
        walks = np.arange(n) >= self.vehicles
        is_person = (self._kinds == CYCLIST) | walks
        return Shapes(
            x=np.full(n, _FAR) + np.arange(n) * 100.0,
            y=np.full(n, _FAR),
            yaw=np.zeros(n),
            half_length=np.concatenate([self.fleet.length / 2, np.full(self.pedestrians, PEDESTRIAN_RADIUS)]),
            half_width=np.concatenate([self.fleet.half_width, np.full(self.pedestrians, PEDESTRIAN_RADIUS)]),
            rounding=np.where(walks, PEDESTRIAN_RADIUS, np.where(is_person, CYCLIST_HALF_WIDTH, 0.0)),
            bottom=np.where(is_person, STEP_HEIGHT, 0.0),
            top=self._heights.copy(),
            vx=np.zeros(n),
            vy=np.zeros(n),
        )

    def _place_vehicle(self, v: int, lane: int, offset: float, air: float) -> bool:
        return bool(place_vehicle(self._net, self._vehicles, v, lane, offset, self.shapes, air))

    # -- the subsystem contract --------------------------------------------------------------------------------------

    def take_away(self, v: int) -> None:
        """Take a vehicle on a route out of the world: it holds nothing, and is no body, until it is called back."""
        take_away(self._net, self._vehicles, v, self.junctions)
        self.shapes.x[v], self.shapes.y[v] = _FAR + v * 100.0, _FAR
        self.shapes.vx[v] = self.shapes.vy[v] = 0.0
        self._bodies = None

    def call_back(self, v: int, wanted: bool = True) -> None:
        """Have a vehicle that was taken away come back at its stop as soon as there is room, or stay away after all."""
        self.fleet.presence[v] = COMING if wanted else AWAY

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future, random streams among them."""
        return {name: array.copy() for name, array in self._state().items()}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        for name, array in self._state().items():
            array[...] = arrays[name]
        # Cyclists' speeds are of the state and of the conditions outdoors: these are to be set again.
        self._bodies = self._conditions = None

    def _state(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of the state by name, not copied."""
        found = {f"fleet.{field[0]}": self._vehicles[field[0]] for field in VEHICLE_STATE}
        found |= {f"pedestrians.{field}": self._walkers[field] for field in PEDESTRIAN_RECORD.fields or ()}
        for name, part in (("junctions", self.junctions.arrays()), ("shapes", self.shapes._asdict())):
            found |= {f"{name}.{field}": array for field, array in part.items()}
        found |= self._levels.arrays() | ({"cyclists.ridden": self.ridden} if self.cyclists else {})
        return found | {f"jams.{name}": array for name, array in self.jams.arrays().items()}

    def set_conditions(self, conditions: Conditions) -> None:
        """Have everybody drive and walk as it is outdoors now: part of the environment's state, not of this one's."""
        if conditions == self._conditions:
            return
        self._conditions = conditions
        net, fleet = self._net, self.fleet
        np.minimum(self._speed_limits * conditions.driving, conditions.safe_speed, out=net.lanes["speed"])
        np.minimum(self._dry_acceleration, conditions.traction, out=fleet.acceleration)
        fleet.braking = COMFORTABLE_BRAKING * conditions.braking
        np.minimum(self._dry_braking, conditions.hard_braking, out=fleet.hard_braking)
        fleet.time_gap = TIME_GAP * conditions.time_gap
        self._walking_pace = conditions.walking
        fleet.target_speed[self.vehicles - self.cyclists :] = self._riding_speed * conditions.cycling

    def set_shut(self, lanes: NDArray[np.bool_] | None, walkways: NDArray[np.bool_] | None) -> None:
        """Have cars keep off some lanes and pedestrians off some walkways: part of the environment's state.

        Buses keep to the rounds they are given (`set_rounds`). Cars that are there drive on until they are out; nobody
        enters any more. Where a street leads nowhere else, it is shut, too.

        Parameters
        ----------
        lanes, walkways
            Masks; None for none. The same arrays again cost nothing.
        """
        if lanes is self._shut[0] and walkways is self._shut[1]:
            return
        self._shut = lanes, walkways
        shut = np.zeros(len(self._net.lanes), np.bool_) if lanes is None else lanes.copy()
        if lanes is not None:
            widen_shut(self._net, shut)
        self._net.lanes["shut"] = shut
        self.paths.walkways["shut"] = False if walkways is None else walkways
        left = self._all_entries[~shut[self._all_entries]]
        self._entries = left if len(left) else self._all_entries

    def set_signals(self, second: int, dark: Circles) -> None:
        """Have signals show what they do at a second: part of the time and the environment's state, not of this one's.

        A junction whose signals are dark has one occupant at a time.

        Parameters
        ----------
        second
            Since midnight of the first day.
        dark
            Where the power is cut: x, y and radius of circles, ENU metres.
        """
        if self.signals is None:
            return
        clusters = self.signals.show(second, dark, self._net, self.paths)
        if clusters is not None and self.junction_rule.is_shared:
            exclusive = self.junctions.claims.exclusive
            exclusive[:] = False
            exclusive[clusters[clusters >= 0]] = True

    def signals_shown(self) -> SignalsShown | None:
        """Return what all signals show now; None where they are not obeyed."""
        return None if self.signals is None else self.signals.signals_shown(self._net, self.paths)

    @property
    def lane_lights(self) -> NDArray[np.uint8]:
        """What the signal of each lane shows now: DARK, GREEN, AMBER or RED, shape ``(lanes,)``."""
        return np.asarray(self._net.lanes["light"], np.uint8)

    def drop_shut_plans(self) -> None:
        """Have cars plan anew that were about to drive where it is shut since."""
        drop_shut_plans(self._net, self._vehicles)

    def set_rounds(self, rounds: Sequence[Sequence[int]]) -> None:
        """Have buses drive by other rounds: lane numbers of each; `fleet.route` are their numbers."""
        first = np.zeros(len(rounds) + 1, np.int32)
        first[1:] = np.cumsum([len(one) for one in rounds])
        flat = np.array([lane for one in rounds for lane in one], np.int32)
        self._net = self._net._replace(route_first=first, route=flat)

    def put_tracks(self, crossings: NDArray[np.void]) -> NDArray[np.bool_]:
        """Have vehicles let trams go first where their tracks cross lanes.

        Parameters
        ----------
        crossings
            Lane by lane, dtype `vico.sim.traffic.state.TRACK_CROSSING`.

        Returns
        -------
        ndarray
            Where a tram is or comes, to be written to, bool, shape ``(crossings,)``.
        """
        tracks = crossings.copy()
        lanes = self._net.lanes
        lanes["first_track"] = np.searchsorted(tracks["lane"], np.arange(len(lanes)))
        lanes["end_track"] = np.searchsorted(tracks["lane"], np.arange(len(lanes)), side="right")
        self._net = self._net._replace(tracks=tracks)
        return tracks["called"]

    def crossed_tracks(self) -> NDArray[np.bool_]:
        """Return on which of these crossings vehicles are or will not stop before, bool, shape ``(crossings,)``."""
        return np.asarray(crossed_tracks(self._net, self._vehicles), np.bool_)

    def advance(self, dt: float, obstacles: Bodies) -> None:
        """Advance everybody by `dt` seconds; nobody touches anybody, `obstacles` (all other bodies) among them."""
        mine, others = self.shapes, shapes_of(obstacles, self._levels)
        everybody = Shapes(*map(np.concatenate, zip(mine, others, strict=True)))
        net, fleet, junctions = self._net, self._vehicles, self.junctions
        mark_busy_crossings(net, fleet, junctions)
        widest = float((everybody.half_length + everybody.half_width).max(initial=0.0))
        grid = neighbour_grid(everybody.x, everybody.y, _CELL, widest + _DRIFT * dt)
        advance_pedestrians(
            self.paths, self._walkers, junctions, fleet, everybody, grid, (self._walking_pace, self._treads()), dt
        )
        junctions.vehicle_wait[:] = 0.0
        count_per_street(net, fleet, self._street_load)
        advance_vehicles(net, fleet, junctions, everybody, grid, self._street_load, dt)
        self.ridden += fleet["speed"][self.vehicles - self.cyclists :] * dt
        self._entities = np.concatenate([self._own_entities, obstacles.entity])
        self.jams.elapsed += dt
        self._bring_back(everybody)
        before, n = (mine.x.copy(), mine.y.copy()), len(mine.x)
        mine.x[:], mine.y[:], mine.yaw[:] = everybody.x[:n], everybody.y[:n], everybody.yaw[:n]
        mine.vx[:], mine.vy[:] = everybody.vx[:n], everybody.vy[:n]
        self._follow_levels(*before)
        self._bodies = None

    def _treads(self) -> NDArray[np.float64]:
        """Return how deep the treads are that each pedestrian walks on, metres; 0 off stairs."""
        if self.height.stairs is None:
            return np.zeros(self.pedestrians)
        points = np.empty((self.pedestrians, 3))
        points[:, 0], points[:, 1] = self.shapes.x[self.vehicles :], self.shapes.y[self.vehicles :]
        points[:, 2] = self.height(points)
        return self.height.going_at(points)

    def _follow_levels(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
        """Take everybody along the decks they are on, from where they were before."""
        fleet, walkers, shapes = self._vehicles, self._walkers, self.shapes
        places = (fleet["lane"], fleet["offset"]), (walkers["walkway"], walkers["offset"])
        self._levels.follow((x, y), np.column_stack([shapes.x, shapes.y]), *places, (shapes.bottom, shapes.top))

    def _bring_back(self, everybody: Shapes) -> None:
        """Bring cars back in that left the map, and vehicles that were stuck for too long; the latter are noted."""
        stopped, teleports = self._vehicles["stopped_time"], self._vehicles["teleports"]
        stuck = stopped >= PATIENCE
        due = stuck.nonzero()[0]
        where = [(float(everybody.x[v]), float(everybody.y[v])) for v in due.tolist()]
        stood, before = stopped[due], teleports[due]
        blockers = [self._before(v) for v in due.tolist()]
        if self._levels.any:
            leaving = self._net.lanes["leaves"][self._vehicles["lane"]] | stuck
            self._levels.clear(leaving.nonzero()[0], (everybody.bottom, everybody.top))
        bring_back(self._net, self._vehicles, self.junctions, everybody, self._entries, _ENTRY_SPEED, PATIENCE)
        for k in (teleports[due] > before).nonzero()[0].tolist():
            self.jams.note_rescue(int(due[k]), where[k], float(stood[k]), blockers[k])
        coming = (self._vehicles["presence"] == COMING).nonzero()[0]
        if len(coming):
            self._levels.clear(coming, (everybody.bottom, everybody.top))
        for v in coming.tolist():
            come_back(self._net, self._vehicles, v, everybody)

    def _before(self, v: int) -> int:
        """Return the entity of the body that a vehicle stands behind, 0 for nobody."""
        blocker = int(self.fleet.blocker[v])
        return int(self._entities[blocker]) if NONE < blocker < len(self._entities) else 0

    @property
    def reentered(self) -> int:
        """How often cars that had left the map came back in at its edge."""
        return int(self.fleet.laps.sum())

    def stuck(self) -> list[Jam]:
        """Return who has got nowhere for `STUCK_AFTER` seconds or longer: vehicles, then pedestrians."""
        now = float(self.jams.elapsed[0])
        since = np.concatenate([self.fleet.stopped_time, self.pedestrian_state.jammed_time])
        return [
            Jam(
                self.first_entity + k,
                (float(self.shapes.x[k]), float(self.shapes.y[k])),
                now,
                float(since[k]),
                self._before(k) if k < self.vehicles else 0,
            )
            for k in np.flatnonzero(since >= STUCK_AFTER).tolist()
        ]

    def take_off(self, i: int) -> None:
        """Take a pedestrian out of the street: it rides in a bus from now on."""
        b = self.vehicles + i
        self.shapes.x[b], self.shapes.y[b] = _FAR + b * 100.0, _FAR
        self.shapes.vx[b] = self.shapes.vy[b] = 0.0
        self._walkers["speed"][i] = 0.0
        self._bodies = None

    def set_down(self, i: int, xy: NDArray[np.float64], walkway: int, offset: float) -> None:
        """Put a pedestrian back into the street, to walk on along a walkway."""
        b, walker = self.vehicles + i, self._walkers[i]
        before = self.shapes.x.copy(), self.shapes.y.copy()
        self.shapes.x[b], self.shapes.y[b] = xy
        walker["walkway"], walker["offset"], walker["progress_xy"] = walkway, offset, xy
        walker["stuck_time"] = walker["jammed_time"] = walker["crossing_wait"] = 0.0
        self._follow_levels(*before)
        self._bodies = None

    @property
    def spots(self) -> NDArray[np.void]:
        """Where people stand beside walkways, dtype `SPOT`."""
        return self.paths.spots
