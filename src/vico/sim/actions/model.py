"""What one kind of action is: its fields, who may do it in which situation, how it is checked and done."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Flag, auto
from typing import Any

from vico.rules import ReasonCode
from vico.sim.actions.fields import Field
from vico.sim.simulation_state import SimulationState

Values = Mapping[str, Any]


@dataclass(frozen=True)
class Command:
    """A well-formed action: its kind and its values, in plain types."""

    kind: str
    values: Values


@dataclass(frozen=True)
class Refusal:
    """Why an action will not be done: a code for programs and a sentence for people."""

    code: ReasonCode
    reason: str


#: Judge an action of the person or robot with an index: None if it can be done.
Check = Callable[[Values, int, SimulationState], Refusal | None]
#: Do what was checked.
Perform = Callable[[Values, int, SimulationState], None]


class Situation(Flag):
    """What a person may be doing when an action is asked for."""

    ON_FOOT = auto()
    SEATED = auto()
    ASLEEP = auto()
    IN_BUS = auto()
    ON_BIKE = auto()
    ANY = ON_FOOT | SEATED | ASLEEP | IN_BUS | ON_BIKE
    AWAKE = ON_FOOT | SEATED | IN_BUS | ON_BIKE


class Actors(Flag):
    """Who may do an action."""

    PEOPLE = auto()
    ROBOTS = auto()


def _allowed(values: Values, i: int, state: SimulationState) -> Refusal | None:
    return None


@dataclass(frozen=True)
class ActionType:
    """One kind of action, defined in one place.

    Attributes
    ----------
    name
        The action's ``type``.
    summary
        What it does, one sentence.
    perform
        Does it; the state is the one that was checked.
    check
        Judges it in the light of the state, after fields, ranges, actors and situation have been judged.
    fields
        By name, beside ``type``.
    when
        Situations in which people may do it.
    actors
        Who may do it. `check` and `perform` get the index within their kind: a row of ``state.people``, or a robot's.
    """

    name: str
    summary: str
    perform: Perform
    check: Check = _allowed
    fields: Mapping[str, Field] = field(default_factory=dict)
    when: Situation = Situation.ON_FOOT
    actors: Actors = Actors.PEOPLE
