"""Traffic as others see it: bodies, models, lights, how people walk, and who rides in buses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.animation.stride import TURN_OF_CRANKS
from vico.sim.bodies import Bodies, Drawn
from vico.sim.traffic.axles import axle_transforms
from vico.sim.traffic.drawing import TrafficDrawing
from vico.sim.traffic.jams import JamLog
from vico.sim.traffic.levels import TrafficLevels
from vico.sim.traffic.records import GAIT_TIME, NONE, PRESENT
from vico.sim.traffic.shapes import Shapes
from vico.sim.traffic.state import LaneNetwork, WalkwayNetwork
from vico.sim.traffic.walking_gaits import PedestrianGaits, StairGaits
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.mesh import Surface

#: Positions, shape ``(n, 3)``, yaws, and whether people sit.
Seating = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]


class SeenTraffic:
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
    _bodies: Bodies | None  # as they stand since they last moved; asked for by everybody

    def bodies(self) -> Bodies:
        """Vehicles but those out of service, then the pedestrians in the street."""
        if self._bodies is None:
            found = self._everybody()
            riding = self.riding
            out = np.concatenate([np.ones(len(found) - self.pedestrians, np.bool_), ~riding])
            self._bodies = found.where(out) if riding.any() else found
        return self._bodies

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
