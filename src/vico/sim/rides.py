"""Buses and bicycles from the rider's side: boarding, paying, being carried, getting off."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.sim.avatars import clearances, free_ground
from vico.sim.bodies import Bodies
from vico.sim.moves import follow_hands, wrapped
from vico.sim.stage import Stage
from vico.sim.state import RADIUS, RIDER_REACH, Posture, Vehicle
from vico.sim.transit import BIKE_REACH, CAPACITY, DOOR_REACH, FARE, TransitSystem

# A bus's floor above the ground, metres.
_BUS_FLOOR = 0.35
# Directions tried for a bicycle that is mounted, relative to where the rider looks.
_TURNS = tuple(math.radians(d) for d in (0, 30, -30, 60, -60, 90, -90, 135, -135, 180))
# Spots tried for it, relative to the rider: here, and one or two steps to all sides; and the way ahead one wants.
_STEPS = np.array(
    [(0.0, 0.0)]
    + [(r * math.cos(k * math.pi / 4), r * math.sin(k * math.pi / 4)) for r in (0.9, 1.8) for k in range(8)]
)
_RUN_UP = 4.0


def why_not(kind: str, i: int, stage: Stage) -> str | None:
    """Why one of enter_bus, exit_bus, enter_bike, exit_bike can't be done now; None if it can."""
    transit, p = stage.transit, stage.people
    if transit is None:
        return f"{kind}: this run has no transit"
    if kind == "exit_bus":
        return _why_not_alight(i, stage, transit)
    if kind == "exit_bike":
        return None if p.vehicle[i] == Vehicle.BIKE else "exit_bike: not on a bicycle"
    if p.vehicle[i] != Vehicle.NONE:
        return f"{kind}: riding already"
    if p.room[i] >= 0:
        return f"{kind}: go outdoors first"
    if kind == "enter_bus":
        bus = transit.bus_at(p.position[i])
        if bus is None:
            return f"enter_bus: no bus stands with a door within {DOOR_REACH:g} m"
        if transit.aboard[bus] >= CAPACITY:
            return "enter_bus: the bus is full"
        return None if p.cash[i] >= FARE else f"enter_bus: the fare is {FARE:g}, and you have {p.cash[i]:.2f}"
    bike = transit.bike_at(p.position[i])
    if bike is None:
        return f"enter_bike: no free bicycle within {BIKE_REACH:g} m"
    return None if _room_to_ride(i, bike, stage, transit) is not None else "enter_bike: no room to get on here"


def board(i: int, stage: Stage) -> None:
    """Get into the bus at the stop, and pay."""
    transit, p = _transit(stage), stage.people
    bus = transit.bus_at(p.position[i])
    assert bus is not None
    p.cash[i] -= transit.board(bus)
    p.vehicle[i], p.vehicle_entity[i] = Vehicle.BUS, transit.entity_of(bus)
    p.posture[i] = Posture.STANDING
    line = transit.line_of(bus)
    stage.events.add("boarding", p.names[i], f"boards bus {line.name}", p.position[i], line=line.id, fare=FARE)
    p.vehicle_yaw[i] = p.yaw[i] = transit.bus_pose(bus)[2]
    _seat(i, stage, transit)


def _why_not_alight(i: int, stage: Stage, transit: TransitSystem) -> str | None:
    if stage.people.vehicle[i] != Vehicle.BUS:
        return "exit_bus: not in a bus"
    bus = _bus_of(i, stage, transit)
    if transit.stopped_at(bus) is None:
        return "exit_bus: the bus is moving"
    return None if _spot_beside(bus, stage, transit) is not None else "exit_bus: no free ground at the doors"


def alight(i: int, stage: Stage) -> None:
    """Get off the bus."""
    transit, p = _transit(stage), stage.people
    bus = _bus_of(i, stage, transit)
    spot = _spot_beside(bus, stage, transit)
    assert spot is not None
    stop = transit.stopped_at(bus)
    transit.alight(bus)
    p.vehicle[i], p.vehicle_entity[i] = Vehicle.NONE, 0
    p.position[i, :2] = spot
    p.yaw[i] = wrapped(float(transit.bus_pose(bus)[2]) - math.pi / 2)
    stage.avatars.settle(np.array([i]))
    follow_hands(stage)
    stage.events.add("alighting", p.names[i], f"gets off at {stop}", p.position[i], stop=stop)


def mount(i: int, stage: Stage) -> None:
    """Take a bicycle: it is wheeled to where there is room to ride."""
    transit, p = _transit(stage), stage.people
    bike = transit.bike_at(p.position[i])
    assert bike is not None
    start = _room_to_ride(i, bike, stage, transit)
    assert start is not None
    transit.mount(bike, i)
    p.vehicle[i], p.vehicle_entity[i] = Vehicle.BIKE, transit.first_bike + bike
    p.posture[i] = Posture.STANDING
    p.position[i, :2], p.yaw[i] = start[:2], start[2]
    stage.avatars.settle(np.array([i]))
    transit.carry(bike, float(start[0]), float(start[1]), float(start[2]))
    stage.events.add("mount", p.names[i], "gets on a bicycle", p.position[i], bike=int(p.vehicle_entity[i]))


def dismount(i: int, stage: Stage) -> None:
    """Leave the bicycle, pay for the ride, and step beside it."""
    transit, p = _transit(stage), stage.people
    bike = int(p.vehicle_entity[i]) - transit.first_bike
    price = transit.dismount(bike)
    p.cash[i] -= price
    p.vehicle[i], p.vehicle_entity[i] = Vehicle.NONE, 0
    spot = free_ground(stage.world.walkable, p.position[i], stage.obstacles_to(i), within=6.0, connected=False)
    if spot is not None:
        p.position[i, :2] = spot
    stage.avatars.settle(np.array([i]))
    follow_hands(stage)
    stage.events.add("dismount", p.names[i], "gets off the bicycle", p.position[i], price=round(price, 2))


def follow(stage: Stage) -> None:
    """Carry riders along with their bus, and bicycles with their riders."""
    transit, p = stage.transit, stage.people
    if transit is None:
        return
    for i in np.flatnonzero(p.vehicle == Vehicle.BUS):
        _seat(int(i), stage, transit)
    for i in np.flatnonzero(p.vehicle == Vehicle.BIKE):
        bike = int(p.vehicle_entity[i]) - transit.first_bike
        transit.carry(bike, float(p.position[i, 0]), float(p.position[i, 1]), float(p.yaw[i]))


def _seat(i: int, stage: Stage, transit: TransitSystem) -> None:
    p = stage.people
    x, y, yaw = transit.seat(_bus_of(i, stage, transit), i)
    p.position[i] = x, y, float(stage.world.height((x, y))) + _BUS_FLOOR
    # Whoever looks out of a window goes on doing so while the bus turns.
    p.yaw[i] = wrapped(float(p.yaw[i] + yaw - p.vehicle_yaw[i]))
    p.vehicle_yaw[i] = yaw


def _transit(stage: Stage) -> TransitSystem:
    assert stage.transit is not None
    return stage.transit


def _bus_of(i: int, stage: Stage, transit: TransitSystem) -> int:
    return int(stage.people.vehicle_entity[i]) - transit.entity_of(0)


def _spot_beside(bus: int, stage: Stage, transit: TransitSystem) -> NDArray[np.float64] | None:
    """Free ground by one of the doors, the front one first; None if all are blocked."""
    others = stage.obstacles()
    for door in transit.exit_spots(bus):
        spot = free_ground(stage.world.walkable, door, others, within=1.5)
        if spot is not None:
            return spot
    return None


def _room_to_ride(i: int, bike: int, stage: Stage, transit: TransitSystem) -> NDArray[np.float64] | None:
    """Where the bicycle is wheeled to be ridden off: x, y, yaw; None if there is no room for it.

    Of the spots within a step or two the nearest is taken from which one can ride `_RUN_UP` metres straight on, else
    the one with the longest way ahead.
    """
    p = stage.people
    others = stage.obstacles_to(i)
    others = others.where(others.entity != transit.first_bike + bike)
    best: tuple[float, NDArray[np.float64]] | None = None
    for spot in p.position[i, :2] + _STEPS:
        # One has to walk there.
        if not _clear((p.position[i, :2] + spot) / 2, others, stage):
            continue
        for turn in _TURNS:
            yaw = wrapped(float(p.yaw[i]) + turn)
            ahead = np.array([math.cos(yaw), math.sin(yaw)])
            way = -1.0
            while way < _RUN_UP and _fits(spot + (way + 1.0) * ahead, yaw, others, stage):
                way += 1.0
            if way >= 0.0 and (best is None or way > best[0]):
                best = way, np.array([*spot, yaw])
            if way >= _RUN_UP:
                return np.array([*spot, yaw])
    return None if best is None else best[1]


def _clear(point: NDArray[np.float64], others: Bodies, stage: Stage) -> bool:
    """Whether one disc of a body is clear of the map's solids and of all bodies."""
    walkable = stage.world.walkable
    if float(walkable.clearance_at(point)) < 0.28 or not bool(walkable.inside(point)):
        return False
    return not len(others) or float(clearances(point, others).min()) > RADIUS + 0.01


def _fits(position: NDArray[np.float64], yaw: float, others: Bodies, stage: Stage) -> bool:
    """Whether the three discs of a rider are clear of the map's solids and of all bodies."""
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    return all(_clear(position[:2] + k * RIDER_REACH * ahead, others, stage) for k in (-1, 0, 1))
