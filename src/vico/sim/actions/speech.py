"""Saying something: to those near, and to whoever judges the task."""

from __future__ import annotations

import numpy as np

from vico.rules import EARSHOT
from vico.sim.actions.fields import Field
from vico.sim.actions.model import ActionType, Situation, Values
from vico.sim.hearing import hearers_of
from vico.sim.moves import gesture
from vico.sim.simulation_state import SimulationState

#: Nobody talks with hands to people farther off, metres.
_TALKING_DISTANCE = 4.0


def communicate(values: Values, i: int, state: SimulationState) -> None:
    """Say something to everybody near in the same space; noise and corners keep some from hearing it."""
    p = state.people
    heard = hearers_of(state, i, values.get("range", EARSHOT))
    state.events.say(p.names[i], values["text"], p.position[i], heard.hearers, heard.missed)
    gesture("talk" if _is_near(heard.hearers, i, state) else "wave", i, state)


def _is_near(listeners: list[str], i: int, state: SimulationState) -> bool:
    """Return whether somebody listens from so near that one talks with them; to those farther off one waves."""
    p = state.people
    people = [p.names.index(name) for name in listeners if name in p.names]
    if not people:
        return True
    away = np.hypot(*(p.position[people, :2] - p.position[i, :2]).T)
    return float(away.min()) <= _TALKING_DISTANCE


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
REPORTS = (
    ActionType(
        "task_complete",
        "Report a task as done, by its index.",
        task_complete,
        fields={"index": Field("integer", low=0, slot="index")},
        when=Situation.ANY,
    ),
)
