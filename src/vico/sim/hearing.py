"""Who hears what is said: a voice gets fainter with distance and behind corners, and noise covers it.

References
----------
ANSI S3.5-1997, Methods for calculation of the speech intelligibility index: a voice at 1 m has 62.35 dB, raised 68.34.
Plomp and Mimpen: Improving the reliability of testing the speech reception threshold for sentences, Audiology 18
(1979): half of all sentences are understood when the voice is 5 dB fainter than the noise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.sim.bodies import BUS, CAR, TRAM, Bodies
from vico.sim.moves import eye_height
from vico.sim.perception import is_clear, opaque_grid
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Vehicle

#: The least a voice may be louder than the noise to be understood, dB.
UNDERSTOOD = -5.0

# Voices at 1 m, dB: who is to be heard farther off than `_NORMAL_RANGE` metres raises it.
_NORMAL, _RAISED = 62.35, 68.34
_NORMAL_RANGE = 3.0
# What a building on the line takes away: sound goes round its corner, dB.
_CORNER = 20.0

# Noise where nothing else is to be heard, dB: in a street, in a room, in a bus.
_STREET, _ROOM, _BUS = 45.0, 40.0, 62.0
# A car at `_PASSING_SPEED`, heard from `_PASSING` metres away, dB; its noise grows with the third power of its speed,
# and is never less than its engine's.
_CAR, _ENGINE, _BUS_MORE = 68.0, 50.0, 6.0
_PASSING, _PASSING_SPEED = 7.5, 50 / 3.6
_FAR = 60.0  # metres; vehicles farther away are part of the street's noise
_NEAREST = 2.0


class Heard(NamedTuple):
    """Who heard something said, and who in reach did not.

    Attributes
    ----------
    hearers
        Agents, in the order of names.
    missed
        Why others within the range did not, by agent: ``"noise"`` or ``"walls"``.
    """

    hearers: list[str]
    missed: dict[str, str]


def hearers_of(state: SimulationState, i: int, reach: float) -> Heard:
    """Return who hears what person `i` says to everybody within `reach` metres in the same space."""
    p = state.people
    outdoors = bool(p.room[i] < 0 and p.vehicle[i] != Vehicle.BUS)
    away = np.linalg.norm(p.position - p.position[i], axis=1)
    near = [j for j in np.flatnonzero(away <= reach).tolist() if j != i and state.same_space(i, j)]
    eyes = eye_height(state).tolist()
    places = [(p.names[j], p.position[j], eyes[j]) for j in near]
    if state.robots is not None and (outdoors or p.room[i] >= 0):
        positions, heights = state.robots.bodies().position, state.robots.camera_heights()
        close = np.linalg.norm(positions - p.position[i], axis=1) <= reach
        close &= state.robots.rooms == p.room[i]
        places += [(state.robots.names[k], positions[k], float(heights[k])) for k in np.flatnonzero(close).tolist()]
    quiet = None if outdoors else _BUS if p.room[i] < 0 else _ROOM
    return _heard(state, p.position[i] + _up(eyes[i]), places, reach, quiet)


def hearers_of_robot(state: SimulationState, robot: int, reach: float) -> Heard:
    """Return who hears what a robot says: people within `reach` metres in the same space, and all other robots.

    Robots hear each other by radio, wherever they are.
    """
    assert state.robots is not None
    p, position, room = state.people, state.robots.bodies().position[robot], int(state.robots.rooms[robot])
    near = np.linalg.norm(p.position - position, axis=1) <= reach
    near &= (p.room == room) & (p.vehicle != Vehicle.BUS)
    eyes = eye_height(state).tolist()
    places = [(p.names[j], p.position[j], eyes[j]) for j in np.flatnonzero(near).tolist()]
    mouth = position + _up(float(state.robots.camera_heights()[robot]))
    found = _heard(state, mouth, places, reach, None if room < 0 else _ROOM)
    found.hearers.extend(name for k, name in enumerate(state.robots.names) if k != robot)
    return found


def _heard(
    state: SimulationState,
    mouth: NDArray[np.float64],
    places: list[tuple[str, NDArray[np.float64], float]],
    reach: float,
    quiet: float | None,
) -> Heard:
    """Return who understands a voice.

    Parameters
    ----------
    places
        Names of who is near, where they stand, and how high they hear, metres.
    reach
        As far as whoever speaks wants to be heard, metres.
    quiet
        How loud it is there, dB; None outdoors, where that is not everywhere the same.
    """
    voice, outdoors = _NORMAL if reach <= _NORMAL_RANGE else _RAISED, quiet is None
    found = Heard([], {})
    vehicles = _driven(state) if outdoors and places else []
    for name, feet, height in places:
        ear = feet + _up(height)
        level = voice - 20.0 * math.log10(max(float(np.linalg.norm(ear - mouth)), 1.0))
        behind = outdoors and not is_clear(mouth, ear, opaque_grid(state.world))
        noise = _noise(state, vehicles, ear) if quiet is None else quiet
        if level - (_CORNER if behind else 0.0) - noise >= UNDERSTOOD:
            found.hearers.append(name)
        else:
            found.missed[name] = "walls" if level - noise >= UNDERSTOOD else "noise"
    return found


def noise_at(state: SimulationState, place: NDArray[np.float64]) -> float:
    """Return how loud it is somewhere outdoors, dB: the street, vehicles, rain and wind."""
    return _noise(state, _driven(state), place)


def _noise(state: SimulationState, vehicles: list[Bodies], place: NDArray[np.float64]) -> float:
    weather = state.environment.weather
    # Rain drums, and wind blows round the ears: a rough fit, 58 dB in 20 mm/h, 61 dB in 17 m/s.
    levels = [
        _STREET,
        42.0 + 12.0 * math.log10(1.0 + weather.rain),
        45.0 + 50.0 * math.log10(max(weather.wind, 1.0) / 8),
    ]
    for one, loud in state.environment.agenda.effects.noises:
        levels.append(heard_from(loud, float(np.linalg.norm(one.middle - place))))
    for bodies in vehicles:
        levels += _of_vehicles(bodies, place)
    return 10.0 * math.log10(sum(10.0 ** (level / 10.0) for level in levels))


def heard_from(loud: float, away: float) -> float:
    """Return how loud it is somewhere, dB, of what is so loud 10 m away."""
    return loud - 20.0 * math.log10(max(away, _NEAREST) / 10.0)


def _driven(state: SimulationState) -> list[Bodies]:
    """Return the cars, buses and trams."""
    found = [owner.bodies() for owner in (state.traffic, state.transit) if owner is not None]
    return [bodies.where(np.isin(bodies.kind, (CAR, BUS, TRAM))) for bodies in found]


def _of_vehicles(bodies: Bodies, place: NDArray[np.float64]) -> list[float]:
    """Return how loud each vehicle that is near is there, dB."""
    away = np.linalg.norm(bodies.position - place, axis=1)
    levels = []
    for k in np.flatnonzero(away < _FAR).tolist():
        speed = max(float(np.hypot(*bodies.velocity[k])), 0.1)
        level = max(_CAR + 30.0 * math.log10(speed / _PASSING_SPEED), _ENGINE)
        level += _BUS_MORE if bodies.kind[k] in (BUS, TRAM) else 0.0
        levels.append(level - 20.0 * math.log10(max(float(away[k]), _NEAREST) / _PASSING))
    return levels


def _up(height: float) -> NDArray[np.float64]:
    return np.array([0.0, 0.0, height])
