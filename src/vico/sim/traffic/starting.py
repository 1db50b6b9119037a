"""Puts everybody somewhere at the start of a run: buses at their stops, the others where the seed says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.seeds import rng
from vico.sim.traffic.companions import choose_companions, leave_group
from vico.sim.traffic.cyclists import starts_of_cyclists
from vico.sim.traffic.pedestrians import place_pedestrian
from vico.sim.traffic.records import NONE
from vico.sim.traffic.shapes import Shapes
from vico.sim.traffic.state import LaneNetwork, WalkwayNetwork
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
