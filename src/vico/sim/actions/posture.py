"""Sitting, sleeping, eating, waiting: what one does on the spot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.rules import REACH, ReasonCode
from vico.sim.actions.fields import Field
from vico.sim.actions.model import ActionType, Actors, Check, Perform, Refusal, Situation, Values
from vico.sim.holding import free_hand
from vico.sim.moves import gesture, get_up, spot_beside_seat, take_seat
from vico.sim.room_to_sit import has_room
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Posture

_TARGET = Field("integer", required=False, slot="entity")
_ON_FURNITURE = Situation.ON_FOOT | Situation.SEATED


def _check_rest(posture: Posture) -> Check:
    """Return what judges sitting or lying down: a free seat or bed within reach."""

    def check(values: Values, i: int, state: SimulationState) -> Refusal | None:
        if state.people.posture[i] == posture:
            return None
        found = _seat_for(posture, values, i, state)
        return found if isinstance(found, Refusal) else None

    return check


def _seat_for(posture: Posture, values: Values, i: int, state: SimulationState) -> int | Refusal:
    """Return the free seat or bed nearest to a person, of the thing that was asked for if one was; or why none."""
    p, seats = state.people, state.seats
    lies, asked = posture == Posture.LYING, values.get("target")
    verb, what = ("sleep", "bed") if lies else ("sit", "seat")
    near = seats.near(_feet(i, state), int(p.room[i]), lies=lies)
    if asked is not None:
        near = near[seats.entity[near] == asked]
        what = f"{what} with the number {asked}"
    if not len(near):
        return Refusal(ReasonCode.NO_SEAT, f"{verb}: no {what} within {REACH} m")
    free = near[~state.seats_taken()[near]].tolist()
    if not free:
        return Refusal(ReasonCode.NO_SEAT, f"{verb}: no {what} within {REACH} m is free")
    if lies and p.room[i] >= 0:
        free = [bed for bed in free if seats.stand_before(bed, state.indoor) is not None]
    if not free:
        return Refusal(ReasonCode.NO_SEAT, f"{verb}: no {what} within {REACH} m can be got out of")
    seat = next((seat for seat in free if has_room(seat, i, state)), None)
    if seat is None:
        return Refusal(ReasonCode.NO_SEAT, f"{verb}: somebody stands at every free {what} within {REACH} m")
    return seat


def _feet(i: int, state: SimulationState) -> NDArray[np.float64]:
    """Return where a person is on the floor: who sits may lie down at once."""
    p = state.people
    x, y, z = p.position[i]
    return np.array([x, y, z if p.seat[i] < 0 else state.seats.floor[p.seat[i]]])


def _check_getting_up(verb: str, i: int, state: SimulationState) -> Refusal | None:
    if spot_beside_seat(i, state) is not None:
        return None
    p, seats = state.people, state.seats
    if p.room[i] >= 0 and seats.stand_before(int(p.seat[i]), state.indoor) is None:
        what = "bed" if p.posture[i] == Posture.LYING else "seat"
        return Refusal(ReasonCode.NO_FREE_SPOT, f"{verb}: walls and furniture leave no room to stand by this {what}")
    return Refusal(ReasonCode.NO_FREE_SPOT, f"{verb}: no room to stand; somebody is in the way")


def check_stand(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge standing up."""
    if state.people.posture[i] == Posture.SITTING:
        return _check_getting_up("stand", i, state)
    return Refusal(ReasonCode.NOT_SEATED, "stand: not seated")


def check_wake(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge waking up."""
    if state.people.posture[i] == Posture.LYING:
        return _check_getting_up("wake", i, state)
    return Refusal(ReasonCode.NOT_ASLEEP, "wake: not asleep")


def _rest(posture: Posture) -> Perform:
    def perform(values: Values, i: int, state: SimulationState) -> None:
        if state.people.posture[i] == posture:
            return
        seat = _seat_for(posture, values, i, state)
        assert isinstance(seat, int)
        take_seat(i, seat, state)

    return perform


def _rise(values: Values, i: int, state: SimulationState) -> None:
    """Get up, and stand beside the seat or the bed."""
    spot = spot_beside_seat(i, state)
    assert spot is not None
    get_up(i, spot, state)


def _show(clip: str) -> Perform:
    def perform(values: Values, i: int, state: SimulationState) -> None:
        hand = free_hand(i, state)
        gesture(clip, i, state, hand=1 if hand is None else hand)

    return perform


def check_hand(kind: str) -> Check:
    """Return what judges eating or drinking: a hand for it."""

    def check(values: Values, i: int, state: SimulationState) -> Refusal | None:
        if free_hand(i, state) is None:
            return Refusal(ReasonCode.HAND_FULL, f"{kind}: both hands are full")
        return None

    return check


def wait(values: Values, i: int, state: SimulationState) -> None:
    """Do nothing for a second."""


POSTURE = (
    ActionType(
        "sit",
        "Sit down on the nearest free seat within 1.5 m, or on a certain one.",
        _rest(Posture.SITTING),
        _check_rest(Posture.SITTING),
        {"target": _TARGET},
        when=_ON_FURNITURE,
    ),
    ActionType("stand", "Stand up from a seat.", _rise, check_stand, when=_ON_FURNITURE),
    ActionType(
        "sleep",
        "Lie down on the nearest free bed within 1.5 m, or on a certain one, and sleep.",
        _rest(Posture.LYING),
        _check_rest(Posture.LYING),
        {"target": _TARGET},
        when=_ON_FURNITURE | Situation.ASLEEP,
    ),
    ActionType("wake", "Wake and get up.", _rise, check_wake, when=_ON_FURNITURE | Situation.ASLEEP),
    ActionType("drink", "Drink something.", _show("drink"), check_hand("drink"), when=_ON_FURNITURE | Situation.IN_BUS),
    ActionType("eat", "Eat something.", _show("eat"), check_hand("eat"), when=_ON_FURNITURE | Situation.IN_BUS),
    ActionType("wait", "Do nothing.", wait, when=Situation.ANY, actors=Actors.PEOPLE | Actors.ROBOTS),
)
