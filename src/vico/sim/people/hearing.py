"""Hearing of messages, and knowledge of events of the city.

A voice gets fainter with distance and behind corners, and noise covers it. An event is known if it was announced, read
of at the door of a place that it closes, heard, or seen.

References
----------
ANSI S3.5-1997, Methods for calculation of the speech intelligibility index: a voice at 1 m has 62.35 dB, raised 68.34.
Plomp and Mimpen: Improving the reliability of testing the speech reception threshold for sentences, Audiology 18
(1979): half of all sentences are understood when the voice is 5 dB fainter than the noise.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.geometry import distances
from vico.sim.bodies.arrays import BUS, CAR, TRAM, Bodies
from vico.sim.bodies.state_arrays import Vehicle
from vico.sim.environment import Occurrence
from vico.sim.people.placement import eye_height
from vico.sim.perception import is_clear, opaque_grid
from vico.sim.state.simulation_state import SimulationState

#: The least a voice may be louder than the noise to be understood, dB.
UNDERSTOOD = -5.0

# Voices at 1 m, dB: who is to be heard farther off than `_NORMAL_RANGE` metres raises it.
_NORMAL, _RAISED = 62.35, 68.34
_NORMAL_RANGE = 3.0
# What a building on the line takes away: sound goes round its corner, dB.
_CORNER = 20.0

# Noise where nothing else is to be heard.
_STREET = 45.0  # dB
_ROOM = 40.0  # dB
_BUS = 62.0  # dB
# The noise of a car grows with the third power of its speed, and is never less than its engine's.
_CAR = 68.0  # dB at `_PASSING_SPEED`, heard from `_PASSING` metres away
_ENGINE = 50.0  # dB at that distance
_BUS_MORE = 6.0  # dB that a bus or tram is louder than a car
_PASSING = 7.5  # m
_PASSING_SPEED = 50 / 3.6  # m/s
_FAR = 60.0  # metres; vehicles farther away are part of the street's noise
_NEAREST = 2.0


class Listeners(NamedTuple):
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


def listeners_of_person(state: SimulationState, i: int, reach: float) -> Listeners:
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
    return _listeners(state, p.position[i] + _up(eyes[i]), places, reach, quiet)


def listeners_of_robot(state: SimulationState, robot: int, reach: float) -> Listeners:
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
    found = _listeners(state, mouth, places, reach, None if room < 0 else _ROOM)
    found.hearers.extend(name for k, name in enumerate(state.robots.names) if k != robot)
    return found


def _listeners(
    state: SimulationState,
    mouth: NDArray[np.float64],
    places: list[tuple[str, NDArray[np.float64], float]],
    reach: float,
    quiet: float | None,
) -> Listeners:
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
    found = Listeners([], {})
    vehicles = _vehicles(state) if outdoors and places else []
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
    return _noise(state, _vehicles(state), place)


def _noise(state: SimulationState, vehicles: list[Bodies], place: NDArray[np.float64]) -> float:
    weather = state.environment.weather
    # Rain drums, and wind blows round the ears: a rough fit, 58 dB in 20 mm/h, 61 dB in 17 m/s.
    levels = [
        _STREET,
        42.0 + 12.0 * math.log10(1.0 + weather.rain),
        45.0 + 50.0 * math.log10(max(weather.wind, 1.0) / 8),
    ]
    for one, loud in state.environment.agenda.effects.noises:
        levels.append(level_at_distance(loud, float(np.linalg.norm(one.middle - place))))
    for bodies in vehicles:
        levels += _vehicle_levels(bodies, place)
    return 10.0 * math.log10(sum(10.0 ** (level / 10.0) for level in levels))


def level_at_distance(loud: float, away: float) -> float:
    """Return how loud it is somewhere, dB, of what is so loud 10 m away."""
    return loud - 20.0 * math.log10(max(away, _NEAREST) / 10.0)


def _vehicles(state: SimulationState) -> list[Bodies]:
    """Return the cars, buses and trams."""
    found = [owner.bodies() for owner in (state.traffic, state.transit) if owner is not None]
    return [bodies.where(np.isin(bodies.kind, (CAR, BUS, TRAM))) for bodies in found]


def _vehicle_levels(bodies: Bodies, place: NDArray[np.float64]) -> list[float]:
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


#: How those know of an event who were told of it beforehand.
ANNOUNCED = "announced"
#: How near a notice at a door can be read, metres.
NOTICE = 5.0
#: How loud an event has to be to be noticed, dB: 10 more than a street.
HEARD = 55.0
# Things are looked at so far above their feet, by eyes so far above the ground, metres.
_LOOKED_AT, _EYES = np.array([0.0, 0.0, 0.8]), np.array([0.0, 0.0, 1.5])


def follow_city_events(state: SimulationState) -> None:
    """Let everybody take notice of events that have begun or ended: traffic, what stands there, and the log."""
    agenda = state.environment.agenda
    if not len(agenda):
        return
    news = agenda.news()
    if news and state.traffic is not None:
        walkways = agenda.effects.walkways
        if state.transit is not None:
            walkways = state.transit.shut_walkways(walkways)
        state.traffic.set_shut(agenda.effects.lanes, walkways)
        state.traffic.drop_shut_plans()
    if state.traffic is not None:
        state.traffic.gatherings.follow(agenda.gatherings(None if state.transit is None else state.transit.on_tracks))
        state.traffic.gatherings.advance(state.second)
    state.things.follow(state.base, agenda, state.traffic, state.obstacles)
    for one, what in news:
        told = {name: value for name, value in one.event.record().items() if name != "kind" and value}
        told |= {"event": one.id, "event_kind": one.event.kind}
        state.events.add("city", "", f"{one.event.title} {what}", one.middle, **told)


def known_events(state: SimulationState, i: int, pose: NDArray[np.float64]) -> list[dict[str, Any]]:
    """Return what somebody knows of events: of those announced, of closed places at whose doors they stand.

    Parameters
    ----------
    i
        The agent's index.
    pose
        Its pose, as from `vico.sim.observations.agent_poses`.
    """
    agenda = state.environment.agenda
    if not len(agenda):
        return []
    outdoors = i >= len(state.people) or state.people.room.item(i) < 0
    found = {one.id: _event_record(one, ANNOUNCED, state) for one in agenda.announced_events}
    for one in agenda.going_on if outdoors else ():
        how = _how_noticed(one, pose, state)
        if how:
            found[one.id] = _event_record(one, how, state)
    return [found[number] for number in sorted(found)]


def _how_noticed(one: Occurrence, pose: NDArray[np.float64], state: SimulationState) -> str:
    """Return how somebody outdoors notices an event: by a notice, by seeing it; "" if not at all."""
    doors = [state.base.doors[state.place_index[place]] for place in _shut_by(one, state)]
    if any(math.hypot(*(door - pose[:2])) <= NOTICE for door in doors):
        return "notice"
    if one.noise and level_at_distance(one.noise, float(np.linalg.norm(one.middle - pose[:3]))) > HEARD:
        return "heard"
    return "seen" if _is_seen(one, pose, state) else ""


def _is_seen(one: Occurrence, pose: NDArray[np.float64], state: SimulationState) -> bool:
    """Return whether one of an event's things is within sight, whichever way one looks, and nothing hides it."""
    things = state.things.of_event(one.id)
    eye = pose[:3] + _EYES
    near = distances(things.position[:, :2], eye[:2]) <= state.environment.sight_of(things.position)
    grid = opaque_grid(state.world)
    return any(is_clear(eye, at + _LOOKED_AT, grid) for at in things.position[near])


def _shut_by(one: Occurrence, state: SimulationState) -> list[str]:
    return [place for place, by in state.environment.agenda.effects.shut.items() if by.id == one.id]


def _event_record(one: Occurrence, how: str, state: SimulationState) -> dict[str, Any]:
    """Return what is known of an event by whoever knows of it."""
    event = one.event
    return {
        "id": one.id,
        "kind": event.kind,
        "name": event.title,
        "known": how,
        "position": [round(value, 3) for value in one.middle.tolist()],
        "begin": event.begin,
        "end": event.end if math.isfinite(event.end) else None,
        "goes_on": event.goes_on(state.second),
        "closed_places": _shut_by(one, state),
        "closed_ground": [list(circle) for circle in one.circles],
    }
