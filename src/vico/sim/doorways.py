"""Going through the doors of houses: up to the door, a hand on it, and then through.

Who goes in walks up to the entrance and opens it from outside, who goes out does so from within; they are on the other
side as soon as the door is open. `People.door_time` counts the seconds from the hand on the door on, and is negative
before. Leaves are part of the walls' pictures, and do not move.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.rules import ActionStatus, ReasonCode
from vico.sim.avatars import CLIP
from vico.sim.holding import free_hand, take_umbrella
from vico.sim.moves import gesture, place_in_room, put_outdoors, spot_outside, wrapped
from vico.sim.simulation_state import SimulationState
from vico.sim.state import DOOR_OPENING

# Up to the door one takes this long at most, seconds, to so far from it, metres, between these speeds, m/s.
_WAY_UP, _ARM, _SLOWEST, _FASTEST = 1.0, 0.5, 0.6, 1.55
# People turn to the door so fast, radians a second, and walk as soon as they nearly face it, radians.
_TURN_RATE, _AHEAD, _FACING = 2.0 * math.pi, 0.6, 0.05
_AT_IT = 0.03  # nearer to where one stands at the door nobody walks, metres
_THROUGH = 0.66  # in the cycle of the motion: one is through, and the hand is at the door behind
_EARLY = 1e-6  # sums of sub-steps are a little more or less than their time, seconds


def begin(i: int, place: int, state: SimulationState) -> None:
    """Have somebody set out for the door of a place: from the street to go in, from its room to go out."""
    p = state.people
    p.door[i] = place
    p.door_time[i] = -_WAY_UP
    turn, way = _way(i, state)
    if way <= _AT_IT and abs(turn) <= _FACING:
        p.door_time[i] = 0.0
        _touch(i, state)


def _way(i: int, state: SimulationState) -> tuple[float, float]:
    """Return how far somebody has to turn to the door, radians, and to walk up to it, metres."""
    p = state.people
    place, room = state.world.places[int(p.door[i])], int(p.room[i])
    if room < 0:
        assert place.entrance is not None
        x, y, _ = state.entrances[place.entrance].position
    else:
        x, y, _ = next(door.position for door in state.indoor.doors[room] if door.to < 0)
    dx, dy = x - float(p.position[i, 0]), y - float(p.position[i, 1])
    away = math.hypot(dx, dy)
    return (wrapped(math.atan2(dy, dx) - float(p.yaw[i])) if away > _AT_IT else 0.0), max(away - _ARM, 0.0)


def _touch(i: int, state: SimulationState) -> None:
    """Have a hand go to the door, if one is free; who has both full pushes it open with what they carry."""
    hand = free_hand(i, state)
    if hand is not None:
        gesture("open_door", i, state, hand=hand)


def walk_up(state: SimulationState, share: NDArray[np.float64], dt: float) -> None:
    """Turn and set going who is on the way to a door; `share`, as `Avatars.advance` takes it, is theirs after it."""
    p = state.people
    for i in np.flatnonzero(p.at_door()).tolist():
        turn, way = _way(i, state)
        step = _TURN_RATE * dt
        p.turn_left[i] = min(max(turn, -step), step) if abs(turn) > _FACING else 0.0
        share[i] = 1.0
        p.move_left[i] = p.move_speed[i] = 0.0
        if p.door_time[i] < 0.0 and abs(turn) < _AHEAD and way > _AT_IT:
            left = max(-float(p.door_time[i]), dt)
            p.move_left[i] = way
            p.move_speed[i] = min(max(way / left, _SLOWEST), _FASTEST)


def follow(state: SimulationState, dt: float) -> None:
    """Let doors be opened and gone through for `dt` seconds."""
    p = state.people
    for i in np.flatnonzero(p.door >= 0).tolist():
        # Whom something stops opens the door from there.
        stopped = p.status[i] == ActionStatus.COLLISION
        if stopped:
            p.status[i], p.contact[i] = ActionStatus.OK, 0
        before = float(p.door_time[i])
        turn, way = _way(i, state)
        if before >= 0.0 or abs(turn) < _AHEAD:
            p.door_time[i] += dt
        if before < 0.0:
            arrived = abs(turn) <= _FACING and (way <= _AT_IT or stopped)
            if arrived or p.door_time[i] >= -_EARLY:
                p.door_time[i] = 0.0
                _touch(i, state)
        elif p.door_time[i] >= DOOR_OPENING - _EARLY:
            _go_through(i, state)
            p.door[i], p.door_time[i] = -1, 0.0


def _go_through(i: int, state: SimulationState) -> None:
    p = state.people
    if p.room[i] < 0:
        _go_in(i, int(p.door[i]), state)
    else:
        _go_out(i, int(p.door[i]), state)


def _go_in(i: int, number: int, state: SimulationState) -> None:
    p, place = state.people, state.world.places[number]
    room = state.indoor.index[place.rooms[0]]
    near = state.indoor.arrival(room, -1)
    if state.indoor.free_spot(room, near, state.taken_in(room, without=i)) is None:
        state.set_outcome(i, ActionStatus.REFUSED, ReasonCode.FULL, "enter: it is full")
        return
    place_in_room(i, room, state, near=near)
    _leave_behind(i, state)
    state.events.add("enter", p.names[i], f"enters {place.name}", p.position[i], place=place.id)


def _go_out(i: int, number: int, state: SimulationState) -> None:
    p, place = state.people, state.world.places[number]
    spot = spot_outside(i, state)
    if spot is None:
        state.set_outcome(i, ActionStatus.REFUSED, ReasonCode.BLOCKED, "exit: somebody stands in front of the door")
        return
    assert place.entrance is not None
    take_umbrella(i, state)
    if number == state.homes[i]:
        p.clothes[i] = state.weather_to_dress_for()
    put_outdoors(i, spot, state.entrances[place.entrance].facing, state)
    _leave_behind(i, state)
    state.events.add("exit", p.names[i], f"leaves {place.name}", p.position[i], place=place.id)


def _leave_behind(i: int, state: SimulationState) -> None:
    """Have the hand that opened the door be at it behind."""
    p = state.people
    if p.clip[i] == CLIP["open_door"]:
        p.phase[i] = _THROUGH


def let_go(i: int, state: SimulationState) -> None:
    """Show a hand that lets go of the door that somebody has just come through, if one is free."""
    hand = free_hand(i, state)
    if hand is None:
        return
    p = state.people
    gesture("open_door", i, state, hand=hand)
    p.clip_before[i], p.phase_before[i], p.pace_before[i] = p.clip[i], p.phase[i], p.pace[i]
    p.clip[i], p.phase[i], p.clip_time[i] = CLIP["open_door"], _THROUGH, 0.0
