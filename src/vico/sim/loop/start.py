"""The state at the start of a run: everybody and everything, from the world, the community and the configuration.

Residents are where their schedule puts them, assistants and robots on free ground; traffic, transit and robots are
made from the world and the configuration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import date
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.rules import TRAM_SECTIONS
from vico.seeds import rng
from vico.sim.bodies.arrays import ASSISTANT, KINDS, RESIDENT, Bodies
from vico.sim.bodies.avatars import Avatars, clearances, free_ground
from vico.sim.bodies.seats import Lines
from vico.sim.bodies.state_arrays import (
    FIRST_ASSISTANT,
    FIRST_BIKE,
    FIRST_RESIDENT,
    FIRST_ROBOT,
    FIRST_TRAFFIC,
    FIRST_TRAM,
    MovableObjects,
    People,
)
from vico.sim.config import NO_DAY, SimConfig
from vico.sim.environment import Agenda, Environment, Sky
from vico.sim.people.placement import habit_of, place_in_room, put_outdoors, take_seat, take_umbrella
from vico.sim.robots import RobotPopulation
from vico.sim.state.base import Appointment, OpeningHours, SimulationBase, whereabouts
from vico.sim.state.simulation_state import SimulationState
from vico.sim.state.steps import TICKS_PER_SECOND, Events
from vico.sim.traffic import JunctionRule, Traffic, TrafficSetup
from vico.sim.traffic.placement import placed_traffic
from vico.sim.transit import BusPlan, TransitSystem

if TYPE_CHECKING:
    from vico.community.model import Resident
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
    places: dict[str, NDArray[np.float64]] = {}
    for name, values in config.robot_places.items():
        if name not in names:
            raise InputError(f"robot_places: nobody is called {name!r}; there are {', '.join(names)}")
        place = np.array(values)
        if not world.walkable.is_connected(place[:2]) or float(world.walkable.clearance_at(place[:2])) < _ROBOT_RADIUS:
            raise InputError(
                f"robot_places: {name}: at ({place[0]:.1f}, {place[1]:.1f}) there is no free ground that one gets away "
                "from; give another place"
            )
        near = [other for other, at in places.items() if np.hypot(*(at - place)[:2]) < 2 * _ROBOT_RADIUS]
        if near:
            apart = 2 * _ROBOT_RADIUS
            raise InputError(f"robot_places: {name} would stand in {near[0]}; give them places {apart} m apart")
        places[name] = place
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


_PASSAGE_KINDS = ("hall", "corridor", "stairs", "lift", "storage", "bathroom", "washroom", "shower_room")


def place_residents(state: SimulationState, days: Sequence[Sequence[Appointment]], second: int) -> None:
    """Put each resident where the day says: in a place, or on the way to one.

    Raises
    ------
    InputError
        If somebody has no schedule, or there is no room where they should be.
    """
    for i, stays in enumerate(days):
        where = whereabouts(stays, second)
        name = state.people.names[i]
        if where is None:
            raise InputError(f"{name}: no item of the schedule names a place of this world; check the community")
        if where.share >= 1.0 or where.origin == where.place:
            place_at(i, where.place, state)
            if any(begin <= second < end for stay in stays for begin, end in stay.asleep):
                put_to_bed(i, state)
            continue
        path = state.base.way(where.origin, where.place)
        if path is None or len(path) < 2 or where.share <= 0.0:
            place_at(i, where.origin, state)
            continue
        point, yaw = point_along(path, where.share)
        spot = free_ground(state.world.walkable, point, state.obstacles(), within=8.0)
        if spot is None:
            raise InputError(f"{name}: no free ground near {point.round(1).tolist()} to start from")
        put_outdoors(i, spot, yaw, state)


def place_at(i: int, index: int, state: SimulationState) -> None:
    """Put someone into a place: its first room with space, or the ground in front of it."""
    place = state.world.places[index]
    # Where people stay comes before where they pass; within each, rooms near the street come first.
    order = sorted(place.rooms, key=lambda name: state.indoor.rooms[state.indoor.index[name]].kind in _PASSAGE_KINDS)
    for room_id in order:
        room = state.indoor.index[room_id]
        inside = state.indoor.rooms[room].inside
        if state.indoor.free_spot(room, inside, state.taken_in(room, without=i)) is not None:
            place_in_room(i, room, state)
            return
    spot = free_ground(state.world.walkable, np.asarray(place.position), state.obstacles(), within=12.0)
    if spot is None:
        raise InputError(f"{state.people.names[i]}: {place.name} is full, and so is the ground in front of it")
    put_outdoors(i, spot, 0.0, state)


def put_to_bed(i: int, state: SimulationState) -> None:
    """Lay someone into the first free bed of the place they are in, if it has one that they can get out of."""
    p, seats, indoor = state.people, state.seats, state.indoor
    if p.place[i] < 0:
        return
    taken = state.seats_taken()
    for name in state.world.places[int(p.place[i])].rooms:
        room = indoor.index[name]
        inside = seats.in_room(room)
        free = inside.start + np.flatnonzero(seats.lies[inside] & ~taken[inside])
        bed = next((k for k in free.tolist() if seats.stand_before(k, indoor) is not None), None)
        if bed is not None:
            p.room[i] = room
            take_seat(i, bed, state)
            p.moved[i] = 0.0
            return


def point_along(path: NDArray[np.float64], share: float) -> tuple[NDArray[np.float64], float]:
    """Point at a share of a path's length, and the direction of travel there, radians."""
    legs = np.diff(path, axis=0)
    lengths = np.hypot(legs[:, 0], legs[:, 1])
    goal = share * float(lengths.sum())
    ends = np.cumsum(lengths)
    k = min(int(np.searchsorted(ends, goal)), len(legs) - 1)
    rest = (goal - (ends[k] - lengths[k])) / max(lengths[k], 1e-9)
    return path[k] + legs[k] * rest, math.atan2(legs[k, 1], legs[k, 0])


def place_assistants(first: int, places: Mapping[str, Sequence[float]], state: SimulationState, seed: int) -> None:
    """Put everybody from a number on where a run gives them a place, x, y and yaw by name; else where the seed says.

    Raises
    ------
    InputError
        If nobody is called so, or there is no free ground within a metre.
    """
    walkable = state.world.walkable
    names = state.people.names[first:]
    unknown = [name for name in places if name not in names]
    if unknown:
        raise InputError(f"assistant_places: nobody is called {unknown[0]!r}; there are {', '.join(names) or 'none'}")
    for i, name in enumerate(names, first):
        if name not in places:
            continue
        x, y, yaw = places[name]
        spot = free_ground(walkable, np.array([x, y]), state.obstacles(), within=1.0)
        if spot is None or not walkable.is_connected(spot):
            raise InputError(
                f"assistant_places: {name}: at ({x:.1f}, {y:.1f}) there is no free ground that one gets away from; "
                "give another place"
            )
        put_outdoors(i, spot, yaw, state)
    for i, name in enumerate(names, first):
        if name in places:
            continue
        stream = rng(seed, "spawn", name)
        for _ in range(100):
            spot = free_ground(walkable, walkable.random_point(stream), state.obstacles(), within=5.0)
            if spot is not None:
                put_outdoors(i, spot, float(stream.uniform(-math.pi, math.pi)), state)
                break
        else:
            raise InputError(f"{name}: found no free ground to start on; let fewer people take part")


_NOWHERE = 2**30


def initial_state(
    base: SimulationBase,
    residents: Sequence[Resident],
    days: Sequence[Sequence[Appointment]],
    config: SimConfig,
    day: date | None = None,
) -> SimulationState:
    """Make the state before the first step.

    Parameters
    ----------
    residents, days
        Who takes part, and their appointments: residents start where these put them.
    day
        The date that their days are of; None: the run's own.

    Raises
    ------
    InputError
        If a robot's model is not known, or there is no free ground for everybody.
    """
    people = _people(residents, config)
    avatars = Avatars(people, base.indoor, base.world.walkable, base.world.height)
    events = Events(people.names)
    tick = config.start * TICKS_PER_SECOND
    origin = base.world.manifest.origin
    sky = Sky.over(origin.lat, origin.lon, config.date or NO_DAY.isoformat(), config.utc_offset)
    second = float(config.start)
    agenda = Agenda(base.event_sites, config.events, seed=config.seed, second=second)
    environment = Environment(sky, config.weather, seed=config.seed, second=second, agenda=agenda)
    state = SimulationState(base, people, MovableObjects.none(), avatars, events, environment, tick=tick)
    state.lines = Lines.of(len(people))
    if config.opening_hours:
        opened = day or state.environment.sky.first_day
        state.openings = OpeningHours(base.world.places, opened, (origin.lat, origin.lon), residents, days)
    # Nobody has a place yet: until then avatars are nowhere that could be in anybody's way.
    people.room[:] = _NOWHERE
    state.traffic, state.transit = traffic_and_transit_of(base, config)
    base.world.drop_pages()  # streets look at the ground of all the city, and so do those who find their places below
    state.show_signals()
    robots = robots_of(base, config, state.obstacles(), errands=config.errands)
    if robots is not None:
        robots.attach_objects(state.objects)
        robots.attach_people(people)
    state.robots = robots
    state.entities = _entities(state, residents, config)
    events.names = state.names
    events.begin(0, state.second, events.names)
    place_residents(state, days, config.start)
    place_assistants(len(residents), config.assistant_places, state, config.seed)
    take_umbrella(slice(None), state)
    state.homes = np.full(len(people), -1, np.int32)
    state.homes[: len(residents)] = [base.place_index.get(resident.home, -1) for resident in residents]
    state.clothes_at_start = state.weather_to_dress_for()
    people.clothes[:] = state.clothes_at_start
    return state


def _people(residents: Sequence[Resident], config: SimConfig) -> People:
    names = [r.id for r in residents] + [f"assistant_{i}" for i in range(config.assistants)]
    kinds = [RESIDENT] * len(residents) + [ASSISTANT] * config.assistants
    entities = [FIRST_RESIDENT + i for i in range(len(residents))]
    entities += [FIRST_ASSISTANT + i for i in range(config.assistants)]
    people = People.standing(names, kinds, entities)
    for i, resident in enumerate(residents):
        people.cash[i] = float(resident.cash)
        people.height[i] = resident.appearance["height"]
    people.umbrella_habit[:] = [habit_of(config.seed, name) for name in names]
    return people


def _entities(state: SimulationState, residents: Sequence[Resident], config: SimConfig) -> dict[int, dict[str, str]]:
    """Kind and name of every body of the run by entity, and the agent's name of those that have one."""
    found: dict[int, dict[str, str]] = {}
    for i, (entity, name) in enumerate(zip(state.people.entity.tolist(), state.people.names, strict=True)):
        kind = "resident" if i < len(residents) else "assistant"
        shown = residents[i].name if i < len(residents) else name
        found[entity] = {"kind": kind, "name": shown, "agent": name}
    for k, entity in enumerate(state.robots.bodies().entity.tolist() if state.robots is not None else []):
        found[entity] = {"kind": "robot", "name": f"robot {k}"}
    if state.traffic is not None:
        entities, kinds = state.traffic.entities()
        for k, (entity, kind) in enumerate(zip(entities.tolist(), kinds.tolist(), strict=True)):
            found[entity] = {"kind": KINDS[kind], "name": f"{KINDS[kind]} {k}"}
    # Bicycles in their stations are nobody's obstacle, but are seen.
    for k, entity in enumerate(state.transit.bicycles.entities().tolist() if state.transit is not None else []):
        found[entity] = {"kind": "bicycle", "name": f"bicycle {k}"}
    for k, entity in enumerate(state.transit.trams.entities().tolist() if state.transit is not None else []):
        tram = k // TRAM_SECTIONS
        kind = state.transit.trams.kind(tram) if state.transit is not None else "tram"
        found[entity] = {"kind": kind, "name": f"{kind} {tram}"}
    for k, name in enumerate(state.robots.names if state.robots is not None else []):
        found[FIRST_ROBOT + k] |= {"name": f"{config.robots[k].partition(':')[0]} {k}", "agent": name}
    return found
