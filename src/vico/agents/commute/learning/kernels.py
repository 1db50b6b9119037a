"""Compiled: what a policy sees, and a second of the abstract city.

A row of `State` fields stands for an agent; see `vico.agents.commute.learning.fields`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.agents.commute.learning.city import CityArrays
from vico.agents.commute.learning.fields import (
    BIKE,
    BUS,
    CALL,
    CASH,
    DUE,
    ENTER_BIKE,
    ENTER_BUS,
    EXIT_BIKE,
    EXIT_BUS,
    FOOT,
    FORWARD,
    GOAL_X,
    GOAL_Y,
    HEADING,
    HIT,
    LAST,
    RAYS,
    ROUND,
    SINCE,
    TIME,
    TURN,
    TURN_LEFT,
    TURN_RIGHT,
    VEHICLE,
    X,
    Y,
)
from vico.io.compiled import compiled
from vico.rules import (
    BIKE_ASTRAY,
    BIKE_RATE,
    BIKE_REACH,
    BIKE_SPEED,
    BUS_DOOR_REACH,
    BUS_FARE,
    STATION_REACH,
    WALK_SPEED,
)

_FAR = 20.0  # metres that a ray reaches
_LEAST = 0.25  # metres that a ray goes on at least
_STEP = 0.25  # metres between looks at what is ahead of who moves


@compiled
def clear_at(city: CityArrays, x: float, y: float) -> float:
    """Return the clearance of the cell at a point; 0 outside."""
    n = city.clearance.shape[0]
    ix = math.floor((x + city.half) / city.cell)
    iy = math.floor((y + city.half) / city.cell)
    if ix < 0 or iy < 0 or ix >= n or iy >= n:
        return 0.0
    return float(city.clearance[iy, ix])


@compiled
def ray(city: CityArrays, x: float, y: float, angle: float) -> float:
    """Return how far one can see along the ground until something stands in the way, up to 20 m."""
    east, north, away = math.cos(angle), math.sin(angle), 0.0
    while away < _FAR:
        room = clear_at(city, x + away * east, y + away * north)
        if room <= 0.0:
            return away
        away += max(_LEAST, room)
    return _FAR


@compiled
def nearest(points: NDArray[np.float64], x: float, y: float) -> int:
    """Return the nearest of some points; -1 if there is none."""
    best, least = -1, math.inf
    for k in range(points.shape[0]):
        away = (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2
        if away < least:
            best, least = k, away
    return best


@compiled
def round_at(city: CityArrays, call: int, time: float) -> int:
    """Return the round that stands at a call at a time, among all rounds; -1 if none does."""
    line = city.call_line[call]
    first, last = city.first_begin[line], city.first_begin[line + 1]
    k = np.searchsorted(city.begins[first:last], time - city.call_after[call], side="right") - 1
    if k < 0 or time - city.call_after[call] - city.begins[first + k] >= city.dwell:
        return -1
    return int(first + k)


@compiled
def standing_at(city: CityArrays, stop: int, time: float) -> tuple[int, int]:
    """Return a call and a round of a bus or tram that stands at a stop by the timetable; -1, -1 if none does."""
    for call in range(city.first_call[stop], city.first_call[stop + 1]):
        found = round_at(city, call, time)
        if found >= 0 and city.next_call[call] >= 0:
            return call, found
    return -1, -1


@compiled
def next_arrival(city: CityArrays, stop: int, time: float) -> float:
    """Return the seconds until the next bus or tram comes to a stop, 0 while one stands there; infinite without."""
    least = math.inf
    for call in range(city.first_call[stop], city.first_call[stop + 1]):
        if city.next_call[call] < 0:
            continue
        line = city.call_line[call]
        first, last = city.first_begin[line], city.first_begin[line + 1]
        due = time - city.call_after[call]
        k = np.searchsorted(city.begins[first:last], due - city.dwell, side="right")
        if first + k < last:
            least = min(least, max(0.0, city.begins[first + k] - due))
    return least


@compiled
def _note_direction(out: NDArray[np.float32], k: int, east: float, north: float, heading: float) -> None:
    """Note a direction as ahead and to the left, and how far it is, three numbers."""
    away = math.hypot(east, north)
    angle = math.atan2(north, east) - heading
    out[k], out[k + 1], out[k + 2] = math.cos(angle), math.sin(angle), math.log1p(away) / 6.0


@compiled
def see(city: CityArrays, state: NDArray[np.float64], out: NDArray[np.float32]) -> None:
    """Note what an agent knows and sees; `fields.SEEN_NAMES` says in which order.

    Parameters
    ----------
    state
        Of the agent, shape ``(fields,)``.
    out
        Filled in, shape ``(SEEN,)``.
    """
    x, y, heading, time = state[X], state[Y], state[HEADING], state[TIME]
    out[:] = 0.0
    _note_direction(out, 0, state[GOAL_X] - x, state[GOAL_Y] - y, heading)
    out[3] = min(2.0, max(-1.0, (state[DUE] - time) / 600.0))
    out[4 + int(state[VEHICLE])] = 1.0
    out[7] = state[HIT]
    out[8] = min(1.0, state[CASH] / 100.0)
    station = nearest(city.station_xy, x, y)
    if station >= 0:
        _note_direction(out, 9, city.station_xy[station, 0] - x, city.station_xy[station, 1] - y, heading)
        out[12] = 1.0 if city.gives[station] else 0.0
        out[13] = 1.0 if city.takes[station] else 0.0
    stop = nearest(city.stop_xy, x, y)
    if stop >= 0:
        _note_direction(out, 14, city.stop_xy[stop, 0] - x, city.stop_xy[stop, 1] - y, heading)
        out[17] = 1.0 / (1.0 + next_arrival(city, stop, time) / 60.0)
    out[18] = state[LAST]
    for k in range(RAYS):
        out[19 + k] = math.log1p(ray(city, x, y, heading + 2.0 * math.pi * k / RAYS)) / 3.0


@compiled
def _forward(city: CityArrays, state: NDArray[np.float64]) -> float:
    """Move straight ahead until something is in the way; return the metres."""
    wanted = BIKE_SPEED if state[VEHICLE] == BIKE else WALK_SPEED
    east, north, gone = math.cos(state[HEADING]), math.sin(state[HEADING]), 0.0
    state[HIT] = 0.0
    while gone < wanted - 1e-9:
        to = min(wanted, gone + _STEP)
        if clear_at(city, state[X] + to * east, state[Y] + to * north) <= 0.0:
            state[HIT] = 1.0
            break
        gone = to
    state[X] += gone * east
    state[Y] += gone * north
    return gone


@compiled
def _ride(city: CityArrays, state: NDArray[np.float64]) -> None:
    """Take who sits in a bus along, straight from stop to stop by the timetable."""
    call, began = int(state[CALL]), city.begins[int(state[ROUND])]
    time = state[TIME]
    after = city.next_call[call]
    while after >= 0 and time >= began + city.call_after[after]:
        call = after
        after = city.next_call[call]
    state[CALL] = call
    here = city.call_stop[call]
    if after < 0:
        # The round is over: everybody gets off.
        state[X], state[Y], state[VEHICLE] = city.stop_xy[here, 0], city.stop_xy[here, 1], FOOT
        return
    there, leaves = city.call_stop[after], began + city.call_after[call] + city.dwell
    arrives = began + city.call_after[after]
    share = min(1.0, max(0.0, (time - leaves) / max(arrives - leaves, 1.0)))
    state[X] = city.stop_xy[here, 0] + share * (city.stop_xy[there, 0] - city.stop_xy[here, 0])
    state[Y] = city.stop_xy[here, 1] + share * (city.stop_xy[there, 1] - city.stop_xy[here, 1])


@compiled
def _enter_bus(city: CityArrays, state: NDArray[np.float64]) -> None:
    stop = nearest(city.stop_xy, state[X], state[Y])
    if state[VEHICLE] != FOOT or stop < 0 or state[CASH] < BUS_FARE:
        return
    if math.hypot(city.stop_xy[stop, 0] - state[X], city.stop_xy[stop, 1] - state[Y]) > BUS_DOOR_REACH:
        return
    call, found = standing_at(city, stop, state[TIME])
    if call >= 0:
        state[CASH] -= BUS_FARE
        state[VEHICLE], state[CALL], state[ROUND] = BUS, call, found


@compiled
def _exit_bus(city: CityArrays, state: NDArray[np.float64]) -> None:
    if state[VEHICLE] != BUS:
        return
    call = int(state[CALL])
    arrived = city.begins[int(state[ROUND])] + city.call_after[call]
    if state[TIME] < arrived + city.dwell:
        stop = city.call_stop[call]
        state[X], state[Y], state[VEHICLE] = city.stop_xy[stop, 0], city.stop_xy[stop, 1], FOOT


@compiled
def _enter_bike(city: CityArrays, state: NDArray[np.float64]) -> None:
    station = nearest(city.station_xy, state[X], state[Y])
    if state[VEHICLE] != FOOT or station < 0 or not city.gives[station] or state[CASH] < BIKE_RATE:
        return
    if math.hypot(city.station_xy[station, 0] - state[X], city.station_xy[station, 1] - state[Y]) <= BIKE_REACH:
        state[VEHICLE], state[SINCE] = BIKE, state[TIME]


@compiled
def _exit_bike(city: CityArrays, state: NDArray[np.float64]) -> None:
    if state[VEHICLE] != BIKE:
        return
    price = BIKE_RATE * math.ceil(max(state[TIME] - state[SINCE], 1e-9) / 60.0)
    station = nearest(city.station_xy, state[X], state[Y])
    away = math.hypot(city.station_xy[station, 0] - state[X], city.station_xy[station, 1] - state[Y])
    if away > STATION_REACH or not city.takes[station]:
        price += BIKE_ASTRAY
    state[CASH] -= price
    state[VEHICLE] = FOOT


@compiled
def act(city: CityArrays, state: NDArray[np.float64], action: int) -> float:
    """Let an agent act and a second pass; return the metres it walked."""
    walked = 0.0
    if action == FORWARD and state[VEHICLE] != BUS:
        on_foot = state[VEHICLE] == FOOT
        gone = _forward(city, state)
        walked = gone if on_foot else 0.0
    else:
        state[HIT] = 0.0
    if action == TURN_LEFT:
        state[HEADING] += TURN
    elif action == TURN_RIGHT:
        state[HEADING] -= TURN
    elif action == ENTER_BUS:
        _enter_bus(city, state)
    elif action == EXIT_BUS:
        _exit_bus(city, state)
    elif action == ENTER_BIKE:
        _enter_bike(city, state)
    elif action == EXIT_BIKE:
        _exit_bike(city, state)
    state[TIME] += 1.0
    if state[VEHICLE] == BUS:
        _ride(city, state)
    return walked


@compiled
def step_all(
    city: CityArrays,
    states: NDArray[np.float64],
    actions: NDArray[np.int64],
    reach: float,
    rewards: NDArray[np.float64],
    reached: NDArray[np.bool_],
) -> None:
    """Advance many agents by a second, with the paper's reward.

    Parameters
    ----------
    states
        Changed in place, shape ``(k, fields)``.
    reach
        Metres from the goal at which one is there.
    rewards, reached
        Filled in, shape ``(k,)``.
    """
    for i in range(states.shape[0]):
        state = states[i]
        before = math.hypot(state[GOAL_X] - state[X], state[GOAL_Y] - state[Y])
        cash, on_foot = state[CASH], state[VEHICLE] == FOOT
        act(city, state, actions[i])
        after = math.hypot(state[GOAL_X] - state[X], state[GOAL_Y] - state[Y])
        may_arrive = state[VEHICLE] == FOOT or (state[VEHICLE] == BIKE and state[LAST] == 0.0)
        reached[i] = after <= reach and may_arrive
        rewards[i] = (before - after) - (cash - state[CASH]) - 0.1
        if reached[i]:
            rewards[i] += 1000.0
        if on_foot and actions[i] == FORWARD:
            rewards[i] -= 1.0


@compiled
def see_all(city: CityArrays, states: NDArray[np.float64], out: NDArray[np.float32]) -> None:
    """Note what many agents see, shapes ``(k, fields)`` and ``(k, SEEN)``."""
    for i in range(states.shape[0]):
        see(city, states[i], out[i])
