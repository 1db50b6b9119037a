"""Going through the doors of houses: up to the door, a hand on it, and through it when it is open.

Who goes in walks up to the entrance and opens it from outside, who goes out does so from within. `People.door_time`
counts the seconds from the hand on the door on, and is negative before. The leaf begins to move when the hand is on it
(`vico.sim.door_leaves`). Through the open door one walks (`vico.sim.passing`, `People.passing`): in from where one
stands to a step behind the wall, and is in the room then; out from such a step to free ground. That leads through the
wall's opening, which the map knows nothing of; others are kept clear of all the same. One who can't get on goes back.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.rules import ActionStatus
from vico.sim.avatars import CLIP
from vico.sim.holding import free_hand
from vico.sim.moves import gesture, wrapped
from vico.sim.passing import LET_GO, TURN_RATE, begin_passing, entrance_of
from vico.sim.simulation_state import SimulationState
from vico.sim.state import DOOR_OPENING

# Up to the door one takes this long at most, seconds, to so far from it, metres, between these speeds, m/s.
_WAY_UP, _ARM, _SLOWEST, _FASTEST = 1.0, 0.5, 0.6, 1.55
# People walk to the door as soon as they nearly face it, radians.
_AHEAD, _FACING = 0.6, 0.05
_AT_IT = 0.03  # nearer to where one stands at the door nobody walks, metres
_THROUGH = 0.66  # in the cycle of the motion of a hand at a door: it is at the door behind
# The leaf moves from so long after the hand's way to it began, seconds.
_PUSHED = 0.25
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
    room = int(p.room[i])
    if room < 0:
        door = state.base.house_doors[entrance_of(i, state)]
        x, y = float(door["x"]), float(door["y"])
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
    for i in p.at_door().nonzero()[0].tolist():
        if p.passing[i]:
            p.turn_left[i] = p.move_left[i] = 0.0
            continue
        turn, way = _way(i, state)
        step = TURN_RATE * dt
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
    for i in ((p.door >= 0) & (p.passing == 0)).nonzero()[0].tolist():
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
            continue
        if p.door_time[i] >= _PUSHED:
            state.leaves.hold(entrance_of(i, state), LET_GO)
        if p.door_time[i] >= DOOR_OPENING - _EARLY:
            begin_passing(i, state)


def let_go(i: int, state: SimulationState) -> None:
    """Show a hand that lets go of the door that somebody has just come through, if one is free."""
    hand = free_hand(i, state)
    if hand is None:
        return
    p = state.people
    gesture("open_door", i, state, hand=hand)
    p.clip_before[i], p.phase_before[i], p.pace_before[i] = p.clip[i], p.phase[i], p.pace[i]
    p.clip[i], p.phase[i], p.clip_time[i] = CLIP["open_door"], _THROUGH, 0.0
