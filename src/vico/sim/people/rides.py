"""Buses and bicycles from the rider's side: boarding, paying, being carried, getting off."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.exact import apply_matrix
from vico.geometry import wrap_angle
from vico.rules import BUS_FARE
from vico.sim.bodies.arrays import Bodies
from vico.sim.bodies.avatars import clearances, cyclist_fits, free_ground
from vico.sim.bodies.state_arrays import RADIUS, RIDER_REACH, Posture, Vehicle
from vico.sim.people.placement import gesture, move_held_objects
from vico.sim.state.simulation_state import SimulationState
from vico.sim.transit import TransitSystem
from vico.world.walkable import CROSSING, ROADWAY, WalkableMap

# Who gets off a bicycle steps beside it, no farther than this, metres.
_BESIDE = 2.0
# Directions tried for a bicycle that is mounted, relative to where the rider looks.
_TURNS = tuple(math.radians(d) for d in (0, 30, -30, 60, -60, 90, -90, 135, -135, 180))
# Spots tried for it, relative to the rider: here, and one or two steps to all sides; and the way ahead one wants.
_STEPS = np.array(
    [(0.0, 0.0)]
    + [(r * math.cos(k * math.pi / 4), r * math.sin(k * math.pi / 4)) for r in (0.9, 1.8) for k in range(8)]
)
_RUN_UP = 4.0
# Spots to which one that is left in the street is wheeled, in the same way: up to four steps.
_ASIDE = np.array(
    [(r * math.cos(k * math.pi / 8), r * math.sin(k * math.pi / 8)) for r in (0.9, 1.8, 2.7, 3.6) for k in range(16)]
)
# Where a bicycle that stands takes up room, relative to its middle: metres along it and to the left.
_PARTS = np.array([(u * RIDER_REACH, v * RADIUS) for u in (-1.0, -0.5, 0.0, 0.5, 1.0) for v in (-1.0, 0.0, 1.0)])
_ROAD = (ROADWAY, CROSSING)


def board_bus(i: int, state: SimulationState) -> None:
    """Get into the bus at the stop, and pay."""
    transit, p = _transit(state), state.people
    bus = transit.bus_at(p.position[i])
    assert bus is not None
    p.cash[i] -= transit.board(bus, i)
    p.vehicle[i], p.vehicle_entity[i] = Vehicle.BUS, transit.entity_of(bus)
    p.posture[i] = Posture.SITTING if transit.is_seated(bus, i) else Posture.STANDING
    what, line, name = transit.service_of(bus)
    state.events.add("boarding", p.names[i], f"boards {what} {name}", p.position[i], line=line, fare=BUS_FARE)
    p.vehicle_yaw[i] = p.yaw[i] = transit.seat(bus, i)[2]
    p.moved[i] = 0.0
    gesture("enter_vehicle", i, state)
    _seat(i, state, transit)


def alight_bus(i: int, state: SimulationState) -> None:
    """Get off the bus."""
    transit, p = _transit(state), state.people
    bus = bus_of(i, state, transit)
    spot = spot_beside_bus(bus, state, transit)
    assert spot is not None
    stop, facing = transit.stopped_at(bus), float(transit.seat(bus, i)[2])
    transit.alight(bus, i)
    p.vehicle[i], p.vehicle_entity[i] = Vehicle.NONE, 0
    p.posture[i] = Posture.STANDING
    p.position[i, :2] = spot
    p.yaw[i] = wrap_angle(facing - math.pi / 2)
    gesture("exit_vehicle", i, state)
    state.avatars.settle(np.array([i]))
    move_held_objects(state)
    state.events.add("alighting", p.names[i], f"gets off at {stop}", p.position[i], stop=stop)


def mount_bicycle(i: int, state: SimulationState) -> None:
    """Take a bicycle: it is wheeled to where there is room to ride."""
    transit, p = _transit(state), state.people
    bike = transit.bicycles.at(p.position[i])
    assert bike is not None
    start = room_to_ride(i, bike, state, transit)
    assert start is not None
    transit.bicycles.mount(bike, i, float(transit.clock[0]))
    p.vehicle[i], p.vehicle_entity[i] = Vehicle.BIKE, transit.bicycles.first_entity + bike
    p.posture[i] = Posture.STANDING
    p.position[i, :2], p.yaw[i] = start[:2], start[2]
    state.avatars.settle(np.array([i]))
    transit.bicycles.carry(bike, float(start[0]), float(start[1]), float(start[2]))
    state.events.add("mount", p.names[i], "gets on a bicycle", p.position[i], bike=int(p.vehicle_entity[i]))


def dismount_bicycle(i: int, state: SimulationState) -> None:
    """Leave the bicycle, pay for the ride, and step beside it.

    What one cannot pay is owed: nobody who owes anything is let onto a bus or a bicycle.
    """
    transit, p = _transit(state), state.people
    bike = int(p.vehicle_entity[i]) - transit.bicycles.first_entity
    _wheel_off_the_road(i, bike, state, transit)
    spot = spot_beside_bicycle(i, state, transit)
    assert spot is not None
    price = transit.bicycles.dismount(bike, float(transit.clock[0]))
    paid = min(price, float(p.cash[i]))
    p.cash[i] -= paid
    p.owed[i] += price - paid
    p.vehicle[i], p.vehicle_entity[i] = Vehicle.NONE, 0
    p.position[i, :2] = spot
    gesture("exit_vehicle", i, state)
    state.avatars.settle(np.array([i]))
    move_held_objects(state)
    costs = {"price": round(price, 2)} | ({"owed": round(price - paid, 2)} if paid < price else {})
    state.events.add("dismount", p.names[i], "gets off the bicycle", p.position[i], **costs)


def carry_riders(state: SimulationState) -> None:
    """Carry riders along with their bus, and bicycles with their riders."""
    transit, p = state.transit, state.people
    if transit is None:
        return
    if not p.vehicle.any():
        return
    for i in np.flatnonzero(p.vehicle == Vehicle.BUS).tolist():
        bus = bus_of(i, state, transit)
        if transit.ends(bus) and spot_beside_bus(bus, state, transit) is not None:
            alight_bus(i, state)
        else:
            _seat(i, state, transit)
    for i in np.flatnonzero(p.vehicle == Vehicle.BIKE).tolist():
        bike = int(p.vehicle_entity[i]) - transit.bicycles.first_entity
        transit.bicycles.carry(bike, float(p.position[i, 0]), float(p.position[i, 1]), float(p.yaw[i]))


def _seat(i: int, state: SimulationState, transit: TransitSystem) -> None:
    p = state.people
    bus = bus_of(i, state, transit)
    x, y, yaw = transit.seat(bus, i)
    p.position[i] = x, y, float(state.world.height((x, y))) + transit.floor(bus)
    # Whoever looks out of a window goes on doing so while the bus turns.
    p.yaw[i] = wrap_angle(float(p.yaw[i] + yaw - p.vehicle_yaw[i]))
    p.vehicle_yaw[i] = yaw


def _transit(state: SimulationState) -> TransitSystem:
    assert state.transit is not None
    return state.transit


def bus_of(i: int, state: SimulationState, transit: TransitSystem) -> int:
    """Return the index of the bus that person `i` rides in."""
    return transit.with_entity(int(state.people.vehicle_entity[i]))


def spot_beside_bus(bus: int, state: SimulationState, transit: TransitSystem) -> NDArray[np.float64] | None:
    """Return free ground by one of the doors, the front one first; None if all are blocked."""
    others = state.obstacles()
    for door in transit.exit_spots(bus):
        spot = free_ground(state.world.walkable, door, others, within=1.5)
        if spot is not None:
            return spot
    return None


def spot_beside_bicycle(i: int, state: SimulationState, transit: TransitSystem) -> NDArray[np.float64] | None:
    """Return free ground beside the bicycle person `i` rides, clear of it where it will stand; None if there is none.

    What is brought to a station goes into its place there, and is in nobody's way.
    """
    bike = int(state.people.vehicle_entity[i]) - transit.bicycles.first_entity
    others = [state.obstacles_to(i)]
    if not transit.bicycles.is_at_station(bike):
        others.append(transit.bicycles.standing_bodies(np.array([bike])))
    here = state.people.position[i]
    return free_ground(state.world.walkable, here, Bodies.joined(others), within=_BESIDE, connected=False)


def _wheel_off_the_road(i: int, bike: int, state: SimulationState, transit: TransitSystem) -> None:
    """Wheel a bicycle that is left where vehicles drive to a spot beside the road, if there is one within a few steps.

    It would keep buses and cars there for hours.
    """
    p, walkable = state.people, state.world.walkable
    here, yaw = p.position[i, :2].copy(), float(p.yaw[i])
    if transit.bicycles.is_at_station(bike) or not _is_on_road(here, yaw, walkable):
        return
    others = state.obstacles_to(i)
    for spot in here + _ASIDE:
        if not _clear((here + spot) / 2, others, state):
            continue
        for turn in _TURNS:
            there = wrap_angle(yaw + turn)
            if _is_on_road(spot, there, walkable) or not cyclist_fits(walkable, spot, there, others):
                continue
            _stand_at(i, bike, (spot, there), state, transit)
            if spot_beside_bicycle(i, state, transit) is not None:
                return
    _stand_at(i, bike, (here, yaw), state, transit)


def _stand_at(
    i: int, bike: int, pose: tuple[NDArray[np.float64], float], state: SimulationState, transit: TransitSystem
) -> None:
    (x, y), yaw = pose
    state.people.position[i, :2], state.people.yaw[i] = (x, y), yaw
    transit.bicycles.carry(bike, float(x), float(y), yaw)


def _is_on_road(spot: NDArray[np.float64], yaw: float, walkable: WalkableMap) -> bool:
    """Return whether any of a bicycle that stands at a spot is where vehicles drive."""
    c, s = math.cos(yaw), math.sin(yaw)
    parts = spot + apply_matrix(_PARTS, np.array([[c, -s], [s, c]]))
    return any(walkable.class_of(x, y) in _ROAD for x, y in parts.tolist())


def room_to_ride(i: int, bike: int, state: SimulationState, transit: TransitSystem) -> NDArray[np.float64] | None:
    """Return where the bicycle is wheeled to be ridden off: x, y, yaw; None if there is no room for it.

    Of the spots within a step or two the nearest is taken from which one can ride `_RUN_UP` metres straight on, else
    the one with the longest way ahead.
    """
    p = state.people
    others = state.obstacles_to(i)
    others = others.where(others.entity != transit.bicycles.first_entity + bike)
    best: tuple[float, NDArray[np.float64]] | None = None
    for spot in p.position[i, :2] + _STEPS:
        # One has to walk there.
        if not _clear((p.position[i, :2] + spot) / 2, others, state):
            continue
        for turn in _TURNS:
            yaw = wrap_angle(float(p.yaw[i]) + turn)
            ahead = np.array([math.cos(yaw), math.sin(yaw)])
            way = -1.0
            while way < _RUN_UP and cyclist_fits(state.world.walkable, spot + (way + 1.0) * ahead, yaw, others):
                way += 1.0
            if way >= 0.0 and (best is None or way > best[0]):
                best = way, np.array([*spot, yaw])
            if way >= _RUN_UP:
                return np.array([*spot, yaw])
    return None if best is None else best[1]


def _clear(point: NDArray[np.float64], others: Bodies, state: SimulationState) -> bool:
    """Whether somebody on foot is clear of the map's solids and of all bodies."""
    walkable = state.world.walkable
    if float(walkable.clearance_at(point)) < 0.28 or not bool(walkable.inside(point)):
        return False
    return not len(others) or float(clearances(point, others).min()) > RADIUS + 0.01
