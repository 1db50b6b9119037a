"""Traffic, transit and robots of a run, made from the world and the configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.seeds import rng
from vico.sim.avatars import clearances
from vico.sim.base import SimulationBase
from vico.sim.bodies import Bodies
from vico.sim.config import SimConfig
from vico.sim.robots import RobotPopulation
from vico.sim.state import FIRST_BIKE, FIRST_ROBOT, FIRST_TRAFFIC, FIRST_TRAM
from vico.sim.traffic import JunctionRule, Traffic, TrafficSetup
from vico.sim.traffic.placement import placed_traffic
from vico.sim.transit import BusPlan, TransitSystem
from vico.world.world import World

# Robots start where there is this much free ground, and this far from everybody, metres.
_ROBOT_ROOM = 1.0
_ROBOT_APART = 1.5
# Those with a place of their own need no more than this.
_ROBOT_RADIUS = 0.6


def traffic_and_transit_of(base: SimulationBase, config: SimConfig) -> tuple[Traffic | None, TransitSystem | None]:
    """Cars, cyclists and pedestrians, buses and bicycles; None for what nobody asked for, or the world has not."""
    world = base.world
    has_transit = config.transit and bool(
        world.transit.lines or world.transit.bike_stations or world.transit.tram_lines
    )
    setup = TrafficSetup(JunctionRule(config.junctions), placed_traffic(config.traffic), config.cyclists)
    by_hand = setup.placed.cars or setup.placed.pedestrians
    if not (has_transit or config.cars or config.cyclists or config.pedestrians or by_hand):
        return None, None
    plan = base.bus_plan(config.start) if has_transit else BusPlan()
    traffic = Traffic(
        base.streets,
        world.height,
        cars=config.cars,
        pedestrians=config.pedestrians,
        seed=config.seed,
        first_entity=FIRST_TRAFFIC,
        buses=plan.bus_routes,
        setup=setup,
    )
    if not has_transit:
        return traffic, None
    second = float(config.start)
    transit = TransitSystem(
        world.transit,
        traffic,
        plan,
        second=second,
        first_bike=FIRST_BIKE,
        first_tram=FIRST_TRAM,
        network=base.tram_network,
    )
    transit.take_passengers(world.walkable, config.seed)
    return traffic, transit


def robots_of(base: SimulationBase, config: SimConfig, others: Bodies, *, errands: bool) -> RobotPopulation | None:
    """Robots on free ground, clear of `others`; None where nobody asked for any.

    Raises
    ------
    InputError
        If a model is not known, or there is no room for all.
    """
    if not config.robots:
        return None
    world = base.world
    names = [f"robot_{i}" for i in range(len(config.robots))]
    places = _given_places(config.robot_places, names, world)
    for i, kind in enumerate(config.robots):
        if names[i] in places:
            continue
        stream = rng(config.seed, "robot spawn", i)
        for _ in range(300):
            xy = world.walkable.random_point(stream, clearance=_ROBOT_ROOM)
            far = all(np.hypot(*(xy - place[:2])) > 2 * _ROBOT_APART for place in places.values())
            if far and (not len(others) or clearances(xy, others).min() > _ROBOT_APART):
                break
        else:
            raise InputError(f"robots: no free ground for robot {i} ({kind}); take fewer robots")
        places[names[i]] = np.array([*xy, stream.uniform(-np.pi, np.pi)])
    robots = RobotPopulation(
        world,
        config.robots,
        np.array([places[name] for name in names]),
        seed=config.seed,
        first_entity=FIRST_ROBOT,
        errands=errands,
        scene=base.robot_scene(config.robots, config.physics),
    )
    if config.oracle_grasp:
        robots.give_oracle_grasp()
    return robots


def _given_places(
    given: Mapping[str, Sequence[float]], names: Sequence[str], world: World
) -> dict[str, NDArray[np.float64]]:
    """Return where robots start that a run gives places, by name: x, y, yaw."""
    found: dict[str, NDArray[np.float64]] = {}
    for name, values in given.items():
        if name not in names:
            raise InputError(f"robot_places: nobody is called {name!r}; there are {', '.join(names)}")
        place = np.array(values)
        if not world.walkable.is_connected(place[:2]) or float(world.walkable.clearance_at(place[:2])) < _ROBOT_RADIUS:
            raise InputError(
                f"robot_places: {name}: at ({place[0]:.1f}, {place[1]:.1f}) there is no free ground that one gets away "
                "from; give another place"
            )
        near = [other for other, at in found.items() if np.hypot(*(at - place)[:2]) < 2 * _ROBOT_RADIUS]
        if near:
            apart = 2 * _ROBOT_RADIUS
            raise InputError(f"robot_places: {name} would stand in {near[0]}; give them places {apart} m apart")
        found[name] = place
    return found
