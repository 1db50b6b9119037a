"""Saying something: to those near, and to whoever judges the task."""

from __future__ import annotations

import math

import numpy as np

from vico.geometry import distances
from vico.rules import EARSHOT
from vico.sim.actions.fields import Field
from vico.sim.actions.model import ActionType, Actors, Situation, Values
from vico.sim.bodies import RESIDENT
from vico.sim.hearing import hearers_of, hearers_of_robot
from vico.sim.holding import free_hand
from vico.sim.moves import gesture, wrapped
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Posture, Vehicle

#: Nobody talks with hands to people farther off, metres.
_TALKING_DISTANCE = 4.0
#: Who looks so nearly at another one faces them, radians.
_FACES = math.radians(15.0)


def communicate(values: Values, i: int, state: SimulationState) -> None:
    """Say something to everybody near in the same space; noise and corners keep some from hearing it."""
    p = state.people
    heard = hearers_of(state, i, values.get("range", EARSHOT))
    state.events.say(p.names[i], values["text"], p.position[i], heard.hearers, heard.missed)
    hand = free_hand(i, state)
    near = _listeners_near(heard.hearers, i, state)
    gesture("wave" if near is None else "talk", i, state, hand=1 if hand is None else hand)
    for j in near or []:
        if p.kind[j] == RESIDENT:
            _face(j, i, state)
    if near:
        _face(i, near[0], state)


def communicate_as_robot(values: Values, robot: int, state: SimulationState) -> None:
    """Say something to people near, as `communicate` does, and to all other robots by radio."""
    assert state.robots is not None
    heard = hearers_of_robot(state, robot, values.get("range", EARSHOT))
    position = state.robots.bodies().position[robot]
    state.events.say(state.robots.names[robot], values["text"], position, heard.hearers, heard.missed)


def _face(i: int, j: int, state: SimulationState) -> None:
    """Turn someone who stands still to somebody else."""
    p = state.people
    if p.move_left[i] or p.turn_left[i] or p.posture[i] != Posture.STANDING or p.vehicle[i] != Vehicle.NONE:
        return
    dx, dy = p.position[j, :2] - p.position[i, :2]
    turn = wrapped(math.atan2(dy, dx) - float(p.yaw[i]))
    if abs(turn) > _FACES:
        p.turn_left[i] = turn


def _listeners_near(listeners: list[str], i: int, state: SimulationState) -> list[int] | None:
    """Return which people listen from so near that one talks with them, the nearest first; None if all are farther."""
    p = state.people
    people = [p.names.index(name) for name in listeners if name in p.names]
    if not people:
        return []
    away = distances(p.position[people, :2], p.position[i, :2])
    near = [people[k] for k in np.argsort(away, kind="stable") if away[k] <= _TALKING_DISTANCE]
    return near or None


def task_complete(values: Values, i: int, state: SimulationState) -> None:
    """Report a task as done."""
    p, index = state.people, values["index"]
    state.events.add("task_complete", p.names[i], f"reports task {index} done", p.position[i], index=index)


_RANGE = Field(
    "number", required=False, low=0.0, high=EARSHOT, above_low=True, unit="m", slot="amount", scale=EARSHOT, least=0.1
)

SPEECH = (
    ActionType(
        "communicate",
        "Say something to everybody within a range in the same space who can hear it above the noise.",
        communicate,
        fields={"text": Field("text", slot="text"), "range": _RANGE},
        when=Situation.AWAKE,
    ),
)
#: What robots do under that name.
ROBOT_SPEECH = (
    ActionType(
        "communicate",
        "Have a robot say something to people near it, and to all other robots by radio; it goes on with what it does.",
        communicate_as_robot,
        fields={"text": Field("text"), "range": _RANGE},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
)
REPORTS = (
    ActionType(
        "task_complete",
        "Report a task as done, by its index.",
        task_complete,
        fields={"index": Field("integer", low=0, slot="index")},
        when=Situation.ANY,
    ),
)
