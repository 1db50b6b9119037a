"""What events of the city mean to those who are there: who learns of which, and what the run tells of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.geometry import distances
from vico.sim.environment import Occurrence
from vico.sim.hearing import heard_from
from vico.sim.perception import is_clear, opaque_grid
from vico.sim.simulation_state import SimulationState

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
    state.things.follow(state)
    for one, what in news:
        told = {name: value for name, value in one.event.record().items() if name != "kind" and value}
        told |= {"event": one.id, "event_kind": one.event.kind}
        state.events.add("city", "", f"{one.event.title} {what}", one.middle, **told)


def has_news(state: SimulationState) -> bool:
    """Return whether an event has begun or ended within the last second."""
    agenda = state.environment.agenda
    return len(agenda) > 0 and agenda.changed


def known_events(state: SimulationState, i: int, pose: NDArray[np.float64]) -> list[dict[str, Any]]:
    """Return what somebody knows of events: of those announced, of closed places at whose doors they stand.

    Parameters
    ----------
    i
        The agent's index.
    pose
        Its pose, as from `vico.sim.observations.poses`.
    """
    agenda = state.environment.agenda
    if not len(agenda):
        return []
    outdoors = i >= len(state.people) or state.people.room.item(i) < 0
    found = {one.id: _told(one, ANNOUNCED, state) for one in agenda.announced}
    for one in agenda.going_on if outdoors else ():
        how = _noticed(one, pose, state)
        if how:
            found[one.id] = _told(one, how, state)
    return [found[number] for number in sorted(found)]


def _noticed(one: Occurrence, pose: NDArray[np.float64], state: SimulationState) -> str:
    """Return how somebody outdoors notices an event: by a notice, by seeing it; "" if not at all."""
    doors = [state.base.doors[state.place_index[place]] for place in _shut_by(one, state)]
    if any(math.hypot(*(door - pose[:2])) <= NOTICE for door in doors):
        return "notice"
    if one.noise and heard_from(one.noise, float(np.linalg.norm(one.middle - pose[:3]))) > HEARD:
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


def _told(one: Occurrence, how: str, state: SimulationState) -> dict[str, Any]:
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
