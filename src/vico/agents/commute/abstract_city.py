"""An abstract city to train commuters in: its arrays, the state of agents, what a policy sees, and a second of it.

The city is where one can walk, the stops with their timetable, and the bicycle stations. A row of named columns stands
for an agent. The loops are compiled.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY
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
from vico.world.public import PublicMap
from vico.world.transit import LineTimes, Stop, TramStop, TramTimes

#: Columns of the state of agents. Time, due and since are seconds of the day; positions ENU metres; heading radians
#: counter-clockwise from east. Call and round are of the bus one rides; last is 1 on a day's last commute.
(X, Y, HEADING, VEHICLE, TIME, DUE, GOAL_X, GOAL_Y, CASH, SINCE, CALL, ROUND, HIT, BEGAN, LAST) = range(15)
STATE_SIZE = 15

#: What one rides.
FOOT, BIKE, BUS = range(3)

#: Actions by number; forward is a step of 1 m on foot and of 3 m on a bicycle, a turn is 30 degrees.
(FORWARD, TURN_LEFT, TURN_RIGHT, ENTER_BUS, EXIT_BUS, ENTER_BIKE, EXIT_BIKE) = range(7)
ACTIONS = ("move_forward", "turn_left", "turn_right", "enter_bus", "exit_bus", "enter_bike", "exit_bike")
TURN = math.radians(30.0)

#: Rays along which one sees how far it is to what stands in the way, the first ahead, counter-clockwise.
RAYS = 16

#: What a policy sees, in order. Directions are cosine and sine from ahead, and ``log(1 + metres) / 6``.
OBSERVATION_NAMES = (
    "goal_ahead",
    "goal_left",
    "goal_distance",
    "time_left",
    "on_foot",
    "on_bicycle",
    "in_bus",
    "was_stopped",
    "cash",
    "station_ahead",
    "station_left",
    "station_distance",
    "station_gives",
    "station_takes",
    "stop_ahead",
    "stop_left",
    "stop_distance",
    "bus_soon",
    "last",
    *(f"free_{round(360 * k / RAYS)}" for k in range(RAYS)),
)
OBSERVATION_SIZE = len(OBSERVATION_NAMES)
_GOAL_AHEAD = OBSERVATION_NAMES.index("goal_ahead")
_TIME_LEFT = OBSERVATION_NAMES.index("time_left")
_ON_FOOT = OBSERVATION_NAMES.index("on_foot")
_WAS_STOPPED = OBSERVATION_NAMES.index("was_stopped")
_CASH_LEFT = OBSERVATION_NAMES.index("cash")
_STATION_AHEAD = OBSERVATION_NAMES.index("station_ahead")
_STATION_GIVES = OBSERVATION_NAMES.index("station_gives")
_STATION_TAKES = OBSERVATION_NAMES.index("station_takes")
_STOP_AHEAD = OBSERVATION_NAMES.index("stop_ahead")
_BUS_SOON = OBSERVATION_NAMES.index("bus_soon")
_IS_LAST = OBSERVATION_NAMES.index("last")
_FREE_AHEAD = OBSERVATION_NAMES.index("free_0")


class CityArrays(NamedTuple):
    """What the abstract city knows of a world.

    Attributes
    ----------
    half, cell
        Half the side of the square, and the side of a cell, metres.
    clearance
        Metres to the nearest solid thing from each cell, 0 where one cannot be, shape ``(n, n)``, ``[iy, ix]``.
    stop_xy
        Where one waits at each stop, shape ``(stops, 2)``.
    station_xy
        Bicycle stations, shape ``(stations, 2)``.
    gives, takes
        Whether a station has a bicycle, and room for one; bool.
    call_stop, call_line, call_after
        Of each call of a line at a stop, ordered by stop: the stop, the line, and the seconds from the beginning of its
        round to the arrival there.
    first_call
        Of each stop the first of its calls, and after the last stop their number; int64.
    next_call
        Of each call the next one of its line, -1 after the last.
    begins, first_begin
        When the rounds of a line begin, seconds of the day, one line after the other; where each line's are.
    dwell
        Seconds that a bus stands at a stop.
    """

    half: float
    cell: float
    clearance: NDArray[np.float32]
    stop_xy: NDArray[np.float64]
    station_xy: NDArray[np.float64]
    gives: NDArray[np.bool_]
    takes: NDArray[np.bool_]
    call_stop: NDArray[np.int64]
    call_line: NDArray[np.int64]
    call_after: NDArray[np.float64]
    first_call: NDArray[np.int64]
    next_call: NDArray[np.int64]
    begins: NDArray[np.float64]
    first_begin: NDArray[np.int64]
    dwell: float


def city_arrays(public_map: PublicMap, *, dwell: float) -> CityArrays:
    """Return a public map as arrays.

    Parameters
    ----------
    dwell
        Seconds that a bus stands at a stop.
    """
    walkable = public_map.walkable
    clearance = np.where(walkable.connected, walkable.clearance, 0.0).astype(np.float32)
    stops: list[Stop | TramStop] = [*public_map.stops, *public_map.tram_stops]
    number = {stop.id: k for k, stop in enumerate(stops)}
    times: list[LineTimes | TramTimes] = [LineTimes.of(line) for line in public_map.lines if line.departures]
    times += [TramTimes(line) for line in public_map.tram_lines if line.departures]
    calls: list[tuple[int, int, int, float]] = []  # stop, line, order, seconds after the round begins
    begins: list[list[float]] = []
    for line, found in enumerate(times):
        begins.append([found.begins(k) for k in range(len(found.line.departures))])
        # A bus stands at its first stop before it leaves; there its round begins.
        after = [found.arrives(0, k) - found.begins(0) for k in range(len(found.line.stops))]
        if found.round and after:
            after[0] -= dwell
        calls += [(number[stop], line, k, after[k]) for k, stop in enumerate(found.line.stops) if stop in number]
    calls.sort()
    index = {(line, order): k for k, (_, line, order, _) in enumerate(calls)}
    of_stop = np.array([call[0] for call in calls], np.int64)
    return CityArrays(
        half=float(walkable.half),
        cell=float(walkable.cell),
        clearance=np.ascontiguousarray(clearance),
        stop_xy=np.array([stop.wait[:2] for stop in stops], np.float64).reshape(-1, 2),
        station_xy=np.array([s.position[:2] for s in public_map.bike_stations], np.float64).reshape(-1, 2),
        gives=np.array([s.bikes > 0 for s in public_map.bike_stations], np.bool_),
        takes=np.array([s.bikes < s.capacity for s in public_map.bike_stations], np.bool_),
        call_stop=of_stop,
        call_line=np.array([call[1] for call in calls], np.int64),
        call_after=np.array([call[3] for call in calls], np.float64),
        first_call=np.searchsorted(of_stop, np.arange(len(stops) + 1)).astype(np.int64),
        next_call=np.array([index.get((line, order + 1), -1) for _, line, order, _ in calls], np.int64),
        begins=np.array([b for line in begins for b in line], np.float64),
        first_begin=np.cumsum([0, *(len(b) for b in begins)]).astype(np.int64),
        dwell=float(dwell),
    )


def is_sound(city: CityArrays) -> bool:
    """Whether the rounds of every line begin one after the other, within two days."""
    parts = [city.begins[a:b] for a, b in pairwise(city.first_begin.tolist())]
    return all((np.diff(part) >= 0).all() and part[-1] < 2 * DAY for part in parts)


_RAY_LENGTH = 20.0  # metres that a ray reaches
_MIN_RAY_STEP = 0.25  # metres that a ray goes on at least
_WALK_SAMPLE = 0.25  # metres between looks at what is ahead of who moves


@compiled
def clearance_at(city: CityArrays, x: float, y: float) -> float:
    """Return the clearance of the cell at a point; 0 outside."""
    n = city.clearance.shape[0]
    ix = math.floor((x + city.half) / city.cell)
    iy = math.floor((y + city.half) / city.cell)
    if ix < 0 or iy < 0 or ix >= n or iy >= n:
        return 0.0
    return float(city.clearance[iy, ix])


@compiled
def cast_ray(city: CityArrays, x: float, y: float, angle: float) -> float:
    """Return how far one can see along the ground until something stands in the way, up to 20 m."""
    east, north, away = math.cos(angle), math.sin(angle), 0.0
    while away < _RAY_LENGTH:
        room = clearance_at(city, x + away * east, y + away * north)
        if room <= 0.0:
            return away
        away += max(_MIN_RAY_STEP, room)
    return _RAY_LENGTH


@compiled
def nearest_index(points: NDArray[np.float64], x: float, y: float) -> int:
    """Return the nearest of some points; -1 if there is none."""
    best, least = -1, math.inf
    for k in range(points.shape[0]):
        away = (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2
        if away < least:
            best, least = k, away
    return best


@compiled
def round_at_call(city: CityArrays, call: int, time: float) -> int:
    """Return the round that stands at a call at a time, among all rounds; -1 if none does."""
    line = city.call_line[call]
    first, last = city.first_begin[line], city.first_begin[line + 1]
    k = np.searchsorted(city.begins[first:last], time - city.call_after[call], side="right") - 1
    if k < 0 or time - city.call_after[call] - city.begins[first + k] >= city.dwell:
        return -1
    return int(first + k)


@compiled
def vehicle_at_stop(city: CityArrays, stop: int, time: float) -> tuple[int, int]:
    """Return a call and a round of a bus or tram that stands at a stop by the timetable; -1, -1 if none does."""
    for call in range(city.first_call[stop], city.first_call[stop + 1]):
        found = round_at_call(city, call, time)
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
def _write_direction(out: NDArray[np.float32], k: int, east: float, north: float, heading: float) -> None:
    """Write a direction as ahead and to the left, and how far it is, three numbers."""
    away = math.hypot(east, north)
    angle = math.atan2(north, east) - heading
    out[k], out[k + 1], out[k + 2] = math.cos(angle), math.sin(angle), math.log1p(away) / 6.0


@compiled
def observe(city: CityArrays, state: NDArray[np.float64], out: NDArray[np.float32]) -> None:
    """Write what an agent knows and sees, in the order of `OBSERVATION_NAMES`.

    Parameters
    ----------
    state
        Of the agent, shape ``(fields,)``.
    out
        Filled in, shape ``(OBSERVATION_SIZE,)``.
    """
    x, y, heading, time = state[X], state[Y], state[HEADING], state[TIME]
    out[:] = 0.0
    _write_direction(out, _GOAL_AHEAD, state[GOAL_X] - x, state[GOAL_Y] - y, heading)
    out[_TIME_LEFT] = min(2.0, max(-1.0, (state[DUE] - time) / 600.0))
    out[_ON_FOOT + int(state[VEHICLE])] = 1.0
    out[_WAS_STOPPED] = state[HIT]
    out[_CASH_LEFT] = min(1.0, state[CASH] / 100.0)
    station = nearest_index(city.station_xy, x, y)
    if station >= 0:
        _write_direction(out, _STATION_AHEAD, city.station_xy[station, 0] - x, city.station_xy[station, 1] - y, heading)
        out[_STATION_GIVES] = 1.0 if city.gives[station] else 0.0
        out[_STATION_TAKES] = 1.0 if city.takes[station] else 0.0
    stop = nearest_index(city.stop_xy, x, y)
    if stop >= 0:
        _write_direction(out, _STOP_AHEAD, city.stop_xy[stop, 0] - x, city.stop_xy[stop, 1] - y, heading)
        out[_BUS_SOON] = 1.0 / (1.0 + next_arrival(city, stop, time) / 60.0)
    out[_IS_LAST] = state[LAST]
    for k in range(RAYS):
        out[_FREE_AHEAD + k] = math.log1p(cast_ray(city, x, y, heading + 2.0 * math.pi * k / RAYS)) / 3.0


@compiled
def _move_forward(city: CityArrays, state: NDArray[np.float64]) -> float:
    """Move straight ahead until something is in the way; return the metres."""
    wanted = BIKE_SPEED if state[VEHICLE] == BIKE else WALK_SPEED
    east, north, gone = math.cos(state[HEADING]), math.sin(state[HEADING]), 0.0
    state[HIT] = 0.0
    while gone < wanted - 1e-9:
        to = min(wanted, gone + _WALK_SAMPLE)
        if clearance_at(city, state[X] + to * east, state[Y] + to * north) <= 0.0:
            state[HIT] = 1.0
            break
        gone = to
    state[X] += gone * east
    state[Y] += gone * north
    return gone


@compiled
def _ride_bus(city: CityArrays, state: NDArray[np.float64]) -> None:
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
    stop = nearest_index(city.stop_xy, state[X], state[Y])
    if state[VEHICLE] != FOOT or stop < 0 or state[CASH] < BUS_FARE:
        return
    if math.hypot(city.stop_xy[stop, 0] - state[X], city.stop_xy[stop, 1] - state[Y]) > BUS_DOOR_REACH:
        return
    call, found = vehicle_at_stop(city, stop, state[TIME])
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
    station = nearest_index(city.station_xy, state[X], state[Y])
    if state[VEHICLE] != FOOT or station < 0 or not city.gives[station] or state[CASH] < BIKE_RATE:
        return
    if math.hypot(city.station_xy[station, 0] - state[X], city.station_xy[station, 1] - state[Y]) <= BIKE_REACH:
        state[VEHICLE], state[SINCE] = BIKE, state[TIME]


@compiled
def _exit_bike(city: CityArrays, state: NDArray[np.float64]) -> None:
    if state[VEHICLE] != BIKE:
        return
    price = BIKE_RATE * math.ceil(max(state[TIME] - state[SINCE], 1e-9) / 60.0)
    station = nearest_index(city.station_xy, state[X], state[Y])
    away = math.hypot(city.station_xy[station, 0] - state[X], city.station_xy[station, 1] - state[Y])
    if away > STATION_REACH or not city.takes[station]:
        price += BIKE_ASTRAY
    state[CASH] -= price
    state[VEHICLE] = FOOT


@compiled
def step_agent(city: CityArrays, state: NDArray[np.float64], action: int) -> float:
    """Let an agent act and a second pass; return the metres it walked."""
    walked = 0.0
    if action == FORWARD and state[VEHICLE] != BUS:
        on_foot = state[VEHICLE] == FOOT
        gone = _move_forward(city, state)
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
        _ride_bus(city, state)
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
        step_agent(city, state, actions[i])
        after = math.hypot(state[GOAL_X] - state[X], state[GOAL_Y] - state[Y])
        may_arrive = state[VEHICLE] == FOOT or (state[VEHICLE] == BIKE and state[LAST] == 0.0)
        reached[i] = after <= reach and may_arrive
        rewards[i] = (before - after) - (cash - state[CASH]) - 0.1
        if reached[i]:
            rewards[i] += 1000.0
        if on_foot and actions[i] == FORWARD:
            rewards[i] -= 1.0


@compiled
def observe_all(city: CityArrays, states: NDArray[np.float64], out: NDArray[np.float32]) -> None:
    """Write what many agents see, shapes ``(k, STATE_SIZE)`` and ``(k, OBSERVATION_SIZE)``."""
    for i in range(states.shape[0]):
        observe(city, states[i], out[i])
