"""Sitting, sleeping, eating, waiting: what one does on the spot."""

from __future__ import annotations

from vico.rules import ReasonCode
from vico.sim.actions.model import ActionType, Actors, Perform, Refusal, Situation, Values
from vico.sim.moves import gesture
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Posture

_ON_FURNITURE = Situation.ON_FOOT | Situation.SEATED


def check_stand(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge standing up."""
    if state.people.posture[i] == Posture.SITTING:
        return None
    return Refusal(ReasonCode.NOT_SEATED, "stand: not seated")


def check_wake(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge waking up."""
    if state.people.posture[i] == Posture.LYING:
        return None
    return Refusal(ReasonCode.NOT_ASLEEP, "wake: not asleep")


def _take(posture: Posture) -> Perform:
    def perform(values: Values, i: int, state: SimulationState) -> None:
        state.people.posture[i] = posture

    return perform


def _show(clip: str) -> Perform:
    def perform(values: Values, i: int, state: SimulationState) -> None:
        gesture(clip, i, state)

    return perform


def wait(values: Values, i: int, state: SimulationState) -> None:
    """Do nothing for a second."""


POSTURE = (
    ActionType("sit", "Sit down.", _take(Posture.SITTING), when=_ON_FURNITURE),
    ActionType("stand", "Stand up.", _take(Posture.STANDING), check_stand, when=_ON_FURNITURE),
    ActionType("sleep", "Lie down and sleep.", _take(Posture.LYING), when=_ON_FURNITURE | Situation.ASLEEP),
    ActionType("wake", "Wake and get up.", _take(Posture.STANDING), check_wake, when=_ON_FURNITURE | Situation.ASLEEP),
    ActionType("drink", "Drink something.", _show("drink"), when=_ON_FURNITURE | Situation.IN_BUS),
    ActionType("eat", "Eat something.", _show("eat"), when=_ON_FURNITURE | Situation.IN_BUS),
    ActionType("wait", "Do nothing.", wait, when=Situation.ANY, actors=Actors.PEOPLE | Actors.ROBOTS),
)
