"""Puts cars and pedestrians where a file of traffic has them, and gives them their routes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.sim.traffic.guides import guided_lanes, guided_walks, lane_at, walkway_at
from vico.sim.traffic.junction_rule import JunctionRule
from vico.sim.traffic.pedestrians import place_pedestrian
from vico.sim.traffic.placed import PlacedTraffic
from vico.sim.traffic.shapes import Shapes
from vico.sim.traffic.state import LaneNetwork, WalkwayNetwork
from vico.sim.traffic.vehicles import place_vehicle
from vico.world.lanes import LaneGraph
from vico.world.walkways import Walkways


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
