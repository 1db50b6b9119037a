"""Traffic for other systems: bodies, drawn vehicles with their lamps, gaits of pedestrians, and passengers.

Nothing here changes the traffic. Vehicles stand on slopes on their axles.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicle_parts import mirror
from vico.assets.vehicles import CRANK_AXLE, lit_lamps, night_lamps, ridden_prototypes, vehicle_prototypes
from vico.exact import product
from vico.sim.animation.motions import TURN_OF_CRANKS
from vico.sim.bodies.arrays import Bodies, Drawn, concatenate_drawn
from vico.sim.traffic.car_following import VEHICLE_MODELS
from vico.sim.traffic.jams import JamLog
from vico.sim.traffic.lights import LampDrawing
from vico.sim.traffic.route import is_taken
from vico.sim.traffic.shapes import Shapes, TrafficLevels
from vico.sim.traffic.signals import SignalHeads
from vico.sim.traffic.state import GAIT_TIME, NONE, PRESENT, LaneNetwork, WalkwayNetwork
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.mesh import Surface
from vico.world.walkways import Walkways


class TrafficDrawing:
    """Draws traffic.

    Parameters
    ----------
    models
        Of each vehicle, an index into `VEHICLE_MODELS`.
    entities
        Of each vehicle.
    heads
        Of the signals that are obeyed; None where none are.
    """

    def __init__(self, models: NDArray[np.int32], entities: NDArray[np.int32], heads: SignalHeads | None) -> None:
        self._models, self._entities, self._heads = models, entities, heads
        self._lamps = LampDrawing([VEHICLE_MODELS[k].split("_")[0] for k in models])

    def draw(
        self,
        transforms: NDArray[np.float32],
        there: NDArray[np.int64],
        lights: NDArray[np.uint8],
        elapsed: float,
        shown: tuple[NDArray[np.uint8], NDArray[np.uint8]],
        pedals: NDArray[np.float64],
    ) -> Drawn:
        """Return what is seen now.

        Parameters
        ----------
        transforms
            Model to world of every vehicle, shape ``(vehicles, 4, 4)``.
        there
            Vehicles that are in the world.
        lights
            Which lights each vehicle shows.
        elapsed
            Seconds since the traffic began.
        shown
            What signals show on each lane, and on each walkway.
        pedals
            Turns of the cranks of each cyclist, who are the last vehicles.
        """
        vehicles = Drawn(VEHICLE_MODELS, self._models, transforms, self._entities)
        parts = [Drawn(VEHICLE_MODELS, self._models[there], transforms[there], self._entities[there])]
        parts.append(self._lamps.draw(lights, elapsed, vehicles))
        if len(pedals):
            ridden = slice(len(transforms) - len(pedals), len(transforms))
            c, s = np.cos(2 * np.pi * pedals), np.sin(2 * np.pi * pedals)  # turns of the cranks
            cranks = np.tile(np.eye(4), (len(pedals), 1, 1))
            cranks[:, 0, 0], cranks[:, 0, 2], cranks[:, 2, 0], cranks[:, 2, 2] = c, s, -s, c
            cranks[:, :3, 3] = CRANK_AXLE
            turned = product(transforms[ridden].astype(np.float64), cranks).astype(np.float32)
            parts.append(Drawn(["cranks"], np.zeros(len(pedals), np.int32), turned, self._entities[ridden]))
        if self._heads is not None:
            parts.append(self._heads.draw(*shown))
        return concatenate_drawn(parts)

    def prototypes(self, *, lefthand: bool) -> dict[str, list[Surface]]:
        """Models of the vehicles and signals, by the names `draw` uses; doors of buses open to the kerb."""
        models = vehicle_prototypes()
        if any(VEHICLE_MODELS[k].startswith("bicycle") for k in np.unique(self._models)):
            models = models | ridden_prototypes()
        lit = [name for name in VEHICLE_MODELS if name in models]
        models = models | {name: [*models[name], night_lamps(name.split("_")[0])] for name in lit}
        models = models | lit_lamps()
        if self._heads is not None:
            models = models | self._heads.prototypes()
        return models | {"bus": [mirror(part) for part in models["bus"]]} if lefthand else models


Floats = NDArray[np.float64]


def axle_transforms(xy: Floats, yaw: Floats, half: Floats, heights: Callable[[Floats], Floats]) -> NDArray[np.float32]:
    """Return model to world of vehicles, whose pitch follows the ground between their axles.

    Parameters
    ----------
    xy
        Centres, ENU metres, shape ``(n, 2)``.
    yaw
        Headings, radians counter-clockwise from east, shape ``(n,)``.
    half
        Half of each one's wheelbase, metres, shape ``(n,)``.
    heights
        Gives the height of the ground at points ``(n, 2)``, one for each vehicle, metres.

    Returns
    -------
    ndarray
        Shape ``(n, 4, 4)``.
    """
    n = len(xy)
    c, s = np.cos(yaw), np.sin(yaw)
    along = np.column_stack([c, s]) * half[:, None]
    front, back = (heights(xy + side) for side in (along, -along))
    slope = (front - back) / (2 * half) if n else np.zeros(0)
    size = np.sqrt(1.0 + slope**2)
    transforms = np.zeros((n, 4, 4), np.float32)
    forward = np.column_stack([c / size, s / size, slope / size])
    left = np.column_stack([-s, c, np.zeros(n)])
    transforms[:, :3, 0], transforms[:, :3, 1] = forward, left
    transforms[:, :3, 2] = np.cross(forward, left)
    transforms[:, :2, 3], transforms[:, 2, 3] = xy, (front + back) / 2
    transforms[:, 3, 3] = 1.0
    return transforms


class StairGaits(NamedTuple):
    """How pedestrians walk on stairs; one number of each.

    Attributes
    ----------
    depth, depth_before
        Of the treads they walk on now, and before those changed, metres; 0 off stairs.
    time
        Seconds since they changed, counted up to `GAIT_TIME`.
    cycles
        Of the gait on treads since they set out.
    walked_then, cycles_then
        `PedestrianGaits.walked` and `cycles` when the treads changed.
    """

    depth: NDArray[np.float64]
    depth_before: NDArray[np.float64]
    time: NDArray[np.float64]
    cycles: NDArray[np.float64]
    walked_then: NDArray[np.float64]
    cycles_then: NDArray[np.float64]


class PedestrianGaits(NamedTuple):
    """How pedestrians walk; one number of each.

    Attributes
    ----------
    pace
        Speed that each prefers and that strides are those of, metres a second.
    walked
        Metres since it last set out, but for those on stairs.
    time
        Seconds since then, or since it stopped if negative; counted up to `GAIT_TIME`.
    standing
        Why it stands, or goes to stand: `WINDOW`, `TALK` and so on, 0 for who walks along.
    seated
        Whether it sits in a bus.
    cycling
        Whether it is a cyclist: it never stands for anything, and `walked` is what it has ridden.
    afoot
        Whether its feet are on the ground: it rides neither in a bus nor on a bicycle.
    treads
        On stairs; None where there are none.
    """

    pace: NDArray[np.float64]
    walked: NDArray[np.float64]
    time: NDArray[np.float64]
    standing: NDArray[np.uint8]
    seated: NDArray[np.bool_]
    cycling: NDArray[np.bool_]
    afoot: NDArray[np.bool_]
    treads: StairGaits | None = None


#: Positions, shape ``(n, 3)``, yaws, and whether people sit.
Seating = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]


class TrafficView:
    """What others ask of traffic and never change; see `vico.sim.traffic.population.Traffic`.

    Attributes
    ----------
    seats
        Tells where pedestrians are who ride in buses, by their numbers.
    """

    vehicles: int
    cyclists: int
    pedestrians: int
    lanes: LaneGraph
    walks: Walkways
    height: HeightField
    paths: WalkwayNetwork
    fleet: Any
    pedestrian_state: Any
    shapes: Shapes
    jams: JamLog
    ridden: NDArray[np.float64]
    seats: Callable[[NDArray[np.int64]], Seating] | None
    _net: LaneNetwork
    _vehicles: NDArray[np.void]
    _walkers: NDArray[np.void]
    _own_entities: NDArray[np.int32]
    _kinds: NDArray[np.int8]
    _heights: NDArray[np.float64]
    _riding_speed: NDArray[np.float64]
    _levels: TrafficLevels
    _drawing: TrafficDrawing
    _shut: tuple[NDArray[np.bool_] | None, NDArray[np.bool_] | None]  # lanes and walkways
    _bodies: Bodies | None  # as they stand since they last moved; asked for by everybody

    def bodies(self) -> Bodies:
        """Vehicles but those out of service, then the pedestrians in the street."""
        if self._bodies is None:
            found = self._everybody()
            riding = self.riding
            out = np.concatenate([np.ones(len(found) - self.pedestrians, np.bool_), ~riding])
            self._bodies = found.where(out) if riding.any() else found
        return self._bodies

    def is_taken(self, lanes: NDArray[np.bool_]) -> bool:
        """Return whether a car is on some lanes (a mask), or on its way there."""
        return bool(is_taken(self._net, self._vehicles, lanes))

    @property
    def shut_lanes(self) -> NDArray[np.bool_] | None:
        """Which lanes events keep cars off, without those that lead nowhere else; None for none."""
        return self._shut[0]

    @property
    def shut_walkways(self) -> NDArray[np.bool_] | None:
        """Which walkways nobody is to walk on; None for none."""
        return self._shut[1]

    def is_shut_street_taken(self) -> bool:
        """Return whether a car is where an event keeps cars off."""
        return self._shut[0] is not None and self.is_taken(self._shut[0])

    def _everybody(self) -> Bodies:
        """Return vehicles and all pedestrians, who ride in buses far away."""
        xy = np.column_stack([self.shapes.x, self.shapes.y])
        everybody = Bodies(
            entity=self._own_entities,
            kind=self._kinds,
            position=np.column_stack([xy, self._levels.heights(xy)]),
            yaw=self.shapes.yaw.copy(),
            half_length=self.shapes.half_length,
            half_width=self.shapes.half_width,
            height=self._heights,
            velocity=np.column_stack([self.shapes.vx, self.shapes.vy]),
        )
        there = self._present()
        walkers = np.arange(self.vehicles, len(xy))
        return everybody.where(np.r_[there, walkers]) if len(there) < self.vehicles else everybody

    def _present(self) -> NDArray[np.int64]:
        """Return the vehicles that are not out of service."""
        return np.flatnonzero(self._vehicles["presence"] == PRESENT)

    def draw(self) -> Drawn:
        """Cars, buses and what signals show; pedestrians are drawn by whoever skins people."""
        transforms, lights, elapsed = self.vehicle_transforms(), self.fleet.lights, float(self.jams.elapsed[0])
        shown = self._net.lanes["light"], self.paths.walkways["light"]
        pedals = self.ridden / TURN_OF_CRANKS
        return self._drawing.draw(transforms, self._present(), lights, elapsed, shown, pedals)

    def vehicle_transforms(self) -> NDArray[np.float32]:
        """Model to world of every vehicle, shape ``(vehicles, 4, 4)``; of those away it means nothing."""
        m, half = self.vehicles, self.fleet.wheelbase / 2
        xy = np.column_stack([self.shapes.x[:m], self.shapes.y[:m]])
        return axle_transforms(xy, self.shapes.yaw[:m], half, lambda points: self._levels.at(points, slice(0, m)))

    def prototypes(self) -> dict[str, list[Surface]]:
        """Models of the vehicles and signals, by the names `draw` uses."""
        return self._drawing.prototypes(lefthand=self.lanes.lefthand)

    @property
    def lights(self) -> NDArray[np.uint8]:
        """Which lights each vehicle shows, bits as `vico.sim.traffic.lights` has them; in the order of `bodies`."""
        return np.asarray(self.fleet.lights[self._present()], np.uint8)

    def entities(self) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
        """Return entity and kind of all, vehicles, then pedestrians; buses that are out of service are among them."""
        return self._own_entities, self._kinds

    @property
    def walkers(self) -> Bodies:
        """The pedestrians alone, in buses, too, then the cyclists."""
        everybody = self._everybody()
        people, n = self.pedestrians, len(everybody)
        found = everybody.where(np.r_[n - people : n, n - people - self.cyclists : n - people])
        riding = np.flatnonzero(self._walkers["aboard"] != NONE)
        if len(riding) and self.seats is not None:
            position, yaw, _ = self.seats(riding)
            found.position[riding], found.yaw[riding] = position, yaw
        return found

    @property
    def riding(self) -> NDArray[np.bool_]:
        """Which pedestrians ride in buses, shape ``(pedestrians,)``."""
        return np.asarray(self._walkers["aboard"] != NONE)

    @property
    def passengers(self) -> Bodies:
        """The pedestrians who ride in buses, where they sit or stand."""
        return self.walkers.where(np.flatnonzero(self.riding))

    @property
    def gait(self) -> PedestrianGaits:
        """How each pedestrian walks, then how each cyclist rides: what sets a clip's rate and phase."""
        walkers, n = self.pedestrian_state, self.cyclists
        walked = walkers.distance_walked - walkers.set_out
        seated = np.zeros(len(walked) + n, np.bool_)
        riding = np.flatnonzero(walkers.aboard != NONE)
        if len(riding) and self.seats is not None:
            seated[riding] = self.seats(riding)[2]
        cycling = np.arange(len(seated)) >= len(walked)
        afoot = ~cycling
        afoot[riding] = False
        return PedestrianGaits(
            np.concatenate([walkers.preferred_speed, self._riding_speed]),
            np.concatenate([walked, self.ridden]),
            np.concatenate([walkers.gait_time, np.full(n, GAIT_TIME)]),
            np.concatenate([walkers.stand_kind, np.zeros(n, np.uint8)]),
            seated,
            cycling,
            afoot,
            None if self.height.stairs is None else self._on_stairs(),
        )

    def _on_stairs(self) -> StairGaits:
        walkers, none = self.pedestrian_state, np.zeros(self.cyclists)
        fields = "tread", "tread_before", "tread_time", "tread_cycles", "change_walked", "change_cycles"
        return StairGaits(*(np.concatenate([walkers[name], none]) for name in fields))
