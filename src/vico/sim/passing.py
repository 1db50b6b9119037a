"""Walking through the open door of a house, into its first room or out of it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.rules import ActionStatus, ReasonCode
from vico.sim.avatars import free_ground
from vico.sim.footprints import OUTDOORS, Rectangle, gaps, joined_records, records_of
from vico.sim.holding import take_umbrella
from vico.sim.moves import place_in_room, put_outdoors, spot_outside, wrapped
from vico.sim.simulation_state import SimulationState
from vico.sim.state import DOOR_OPENING, LEVEL_GAZE, body_radius

#: People turn at doors so fast, radians a second.
TURN_RATE = 2.0 * math.pi
#: Seconds for which a door stays open after somebody was in it.
LET_GO = 0.4
_AT_IT = 0.03  # metres within which nobody turns to where they go
# Metres behind the closed leaf from which on one is in the room, and where one comes from who leaves it; where one who
# goes out turns to where they want to go, metres before it; how far before it the step begins.
_INSIDE, _FROM, _CLEAR, _STEP = 0.75, 0.8, 0.35, 0.45
_PACE = 1.25  # m/s at which people walk through doors
_PATIENCE = 2.0  # s for which one waits in a door for others
_IN_LINE = 20.0  # s for which one waits at an open door until nobody is in it
_BESIDE, _APART = 0.03, 0.75  # metres that one keeps from others, and two who go the same way through one door
# Bodies are looked at whose middle is nearer than this, metres: people, and vehicles as well.
_REACH, _LONGEST = 1.5, 12.0
_BACK = 3.0  # metres from an entrance within which one who could not go in stands then
_EARLY = 1e-6  # sums of sub-steps are a little more or less than their time, seconds


def entrance_of(i: int, state: SimulationState) -> int:
    """Return the row of the entrance that somebody goes through in ``world.entrances``."""
    entrance = state.world.places[int(state.people.door[i])].entrance
    assert entrance is not None
    return state.base.entrance_index[entrance]


def begin_passing(i: int, state: SimulationState) -> None:
    """Have somebody walk through the door that is open now, as soon as nobody else is in it."""
    p = state.people
    number, outwards = int(p.door[i]), p.room[i] >= 0
    spot = spot_outside(i, state) if outwards else None
    if outwards and spot is None:
        _give_up(i, ReasonCode.BLOCKED, "exit: somebody stands in front of the door", state)
    elif not outwards and _room_for(i, number, state) is None:
        _give_up(i, ReasonCode.FULL, "enter: it is full", state)
    elif p.door_time[i] >= DOOR_OPENING + _IN_LINE:
        _give_up(i, ReasonCode.BLOCKED, f"{'exit' if outwards else 'enter'}: somebody is in the door", state)
    elif _is_free(i, -1 if outwards else 1, state):
        p.passing[i], p.door_time[i], p.action_clip[i] = (-1 if outwards else 1), 0.0, -1
        if outwards:
            assert spot is not None
            _stand_behind(i, number, spot, state)


def _stand_behind(i: int, number: int, spot: NDArray[np.float64], state: SimulationState) -> None:
    """Have somebody stand a step behind the door that they go out by, to a spot."""
    p, door = state.people, state.base.house_doors[entrance_of(i, state)]
    take_umbrella(i, state)
    if number == state.homes[i]:
        p.clothes[i] = state.weather_to_dress_for()
    p.room[i] = p.place[i] = -1
    p.door_spot[i] = spot
    p.position[i] = *_point(door, _FROM), float(door["z"])
    p.yaw[i] = math.atan2(-float(door["inward_y"]), -float(door["inward_x"]))
    p.pitch[i] = LEVEL_GAZE


def _point(door: NDArray[np.void], inside: float) -> tuple[float, float]:
    """Return the point in the middle of a door, so many metres behind its closed leaf."""
    return float(door["x"] + inside * door["inward_x"]), float(door["y"] + inside * door["inward_y"])


def _inside(door: NDArray[np.void], position: NDArray[np.float64]) -> float:
    """Return how far behind the closed leaf of a door a position is, metres."""
    dx, dy = float(position[0] - door["x"]), float(position[1] - door["y"])
    return dx * float(door["inward_x"]) + dy * float(door["inward_y"])


def _is_free(i: int, way: int, state: SimulationState) -> bool:
    """Whether nobody is in the door that somebody wants to go through, but ahead on the same way.

    Nobody who has waited longer to go the other way, either: they stand in front of it, and those who come out one
    after another would keep them there, and one another in the door, for ever.
    """
    p, entrance = state.people, entrance_of(i, state)
    for j in np.flatnonzero((p.door >= 0) & (p.passing == 0) & (p.door_time > p.door_time[i])).tolist():
        if (p.room[j] < 0) != (way > 0) and entrance_of(j, state) == entrance:
            return False
    door = state.base.house_doors[entrance]
    start = _point(door, _FROM) if way < 0 else (float(p.position[i, 0]), float(p.position[i, 1]))
    for j in np.flatnonzero(p.passing != 0).tolist():
        if entrance_of(j, state) != entrance:
            continue
        if p.passing[j] != way or math.dist(start, p.position[j, :2].tolist()) < _APART:
            return False
    return True


def _room_for(i: int, number: int, state: SimulationState) -> NDArray[np.float64] | None:
    """Return where in the first room of a place one comes in; None if it is full."""
    room = state.indoor.index[state.world.places[number].rooms[0]]
    near = state.indoor.arrival(room, -1)
    return None if state.indoor.free_spot(room, near, state.taken_in(room, without=i)) is None else near


def _give_up(i: int, code: ReasonCode, words: str, state: SimulationState) -> None:
    state.people.door[i], state.people.door_time[i] = -1, 0.0
    state.set_outcome(i, ActionStatus.REFUSED, code, words)


def walk_through(
    state: SimulationState, others: NDArray[np.void], dt: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]] | None:
    """Move those who are in open doors on by `dt` seconds.

    Parameters
    ----------
    others
        Bodies that are no avatars, dtype `vico.sim.footprints.BODY`.

    Returns
    -------
    tuple or None
        Who was moved and is outdoors or in a door now, and how fast, m/s; None if nobody was.
    """
    p = state.people
    passing = (p.passing != 0).nonzero()[0]
    if not len(passing):
        return None
    velocity = np.array([_pass_on(i, state, others, dt) for i in passing.tolist()])
    still = p.room[passing] < 0
    return passing[still], velocity[still]


def _pass_on(i: int, state: SimulationState, others: NDArray[np.void], dt: float) -> tuple[float, float]:
    """Move somebody in an open door on; return how fast, m/s."""
    p, entrance = state.people, entrance_of(i, state)
    door = state.base.house_doors[entrance]
    state.leaves.hold(entrance, LET_GO)
    inside, here = _inside(door, p.position[i]), p.position[i, :2].copy()
    if p.passing[i] > 0:
        goal = _point(door, 0.0 if inside < -_BESIDE else _INSIDE)
    else:
        # A spot beside the door may be nearer to the wall than where one turns to others.
        clear = min(_CLEAR, -_inside(door, p.door_spot[i]))
        to_spot = clear <= 0.0 or inside <= _BESIDE - clear
        goal = (p.door_spot[i, 0], p.door_spot[i, 1]) if to_spot else _point(door, -clear)
    dx, dy = float(goal[0] - here[0]), float(goal[1] - here[1])
    left = math.hypot(dx, dy)
    step = min(_PACE * dt, left)
    there = here + np.array([dx, dy]) * (step / left if left > 0.0 else 0.0)
    turn = wrapped(math.atan2(dy, dx) - float(p.yaw[i])) if left > _AT_IT else 0.0
    p.yaw[i] = wrapped(float(p.yaw[i]) + min(max(turn, -TURN_RATE * dt), TURN_RATE * dt))
    p.move_speed[i] = _PACE
    if _is_in_the_way(i, here, there, state, others):
        p.door_time[i] += dt
        if p.door_time[i] >= _PATIENCE:
            _go_back(i, state)
        return 0.0, 0.0
    p.position[i, :2] = there
    inside = _inside(door, there)
    on_step = inside > -_STEP
    p.position[i, 2] = float(door["z"]) if on_step else float(state.world.height(there))
    if p.passing[i] > 0 and inside >= _INSIDE - _EARLY:
        _go_in(i, int(p.door[i]), state)
    elif p.passing[i] < 0 and math.dist(there.tolist(), p.door_spot[i].tolist()) < _EARLY:
        _go_out(i, int(p.door[i]), state)
    return float(there[0] - here[0]) / dt, float(there[1] - here[1]) / dt


def _is_in_the_way(
    i: int, here: NDArray[np.float64], there: NDArray[np.float64], state: SimulationState, others: NDArray[np.void]
) -> bool:
    """Whether a step would bring somebody nearer to another body outdoors than one keeps."""
    p = state.people
    away = np.abs(p.position[:, :2] - there)
    near = np.flatnonzero(p.outdoors() & (away[:, 0] < _REACH) & (away[:, 1] < _REACH))
    near = near[near != i]
    beside = (np.abs(others["x"] - there[0]) < _LONGEST) & (np.abs(others["y"] - there[1]) < _LONGEST)
    beside &= others["space"] == OUTDOORS
    if not len(near) and not beside.any():
        return False
    bodies = joined_records([records_of(p.bodies_of(near)), others[beside]])
    bodies = bodies[bodies["space"] == OUTDOORS]
    if not len(bodies):
        return False
    radius = float(body_radius(p.height[i : i + 1])[0])
    now, then = (gaps(Rectangle(float(xy[0]), float(xy[1]), 1.0, 0.0, 0.0, 0.0), bodies) for xy in (here, there))
    return bool(((then < radius + _BESIDE) & (then < now)).any())


def _go_back(i: int, state: SimulationState) -> None:
    """Have somebody who can't get on in a door go back to where they came from, if there is room."""
    p, number = state.people, int(state.people.door[i])
    inwards = p.passing[i] > 0
    if not inwards:
        near = _room_for(i, number, state)
        if near is not None:
            place_in_room(i, state.indoor.index[state.world.places[number].rooms[0]], state, near=near)
            _give_up(i, ReasonCode.BLOCKED, "exit: somebody stands in front of the door", state)
        return
    entrance = state.entrances[state.world.places[number].entrance or ""]
    spot = free_ground(state.world.walkable, np.asarray(entrance.approach), state.obstacles_to(i), within=_BACK)
    if spot is not None:
        put_outdoors(i, spot, entrance.facing, state)
        _give_up(i, ReasonCode.BLOCKED, "enter: somebody stands in the door", state)


def _go_in(i: int, number: int, state: SimulationState) -> None:
    p, place = state.people, state.world.places[number]
    near = _room_for(i, number, state)
    if near is None:  # it has filled up since
        p.door_time[i] = _PATIENCE
        _go_back(i, state)
        return
    place_in_room(i, state.indoor.index[place.rooms[0]], state, near=near)
    p.door_time[i] = 0.0
    state.events.add("enter", p.names[i], f"enters {place.name}", p.position[i], place=place.id)


def _go_out(i: int, number: int, state: SimulationState) -> None:
    p, place = state.people, state.world.places[number]
    put_outdoors(i, p.door_spot[i].copy(), float(p.yaw[i]), state)
    p.door_time[i] = 0.0
    state.events.add("exit", p.names[i], f"leaves {place.name}", p.position[i], place=place.id)
