"""Buying: standing in line at a till."""

from __future__ import annotations

from vico.geometry import distance
from vico.rules import ReasonCode
from vico.sim.actions.model import ActionType, Refusal, Values
from vico.sim.queues import place_in_line
from vico.sim.simulation_state import SimulationState
from vico.sim.tills import AT_SPOT, PRICE, SERVICE


def check_queue(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge joining a line: a till in the room, at its end, with the money."""
    p, room = state.people, int(state.people.room[i])
    if room not in state.tills:
        return Refusal(ReasonCode.UNKNOWN_TARGET, "queue: there is no till in this room")
    if state.lines.room[i] == room:
        return None
    place = place_in_line(i, state)
    if place is None:
        return Refusal(
            ReasonCode.FULL, f"queue: {len(state.lines.waiting(room))} stand in line, and there is no room for more"
        )
    away = distance(p.position[i, :2], place[1])
    if away > AT_SPOT:
        return Refusal(
            ReasonCode.TOO_FAR, f"queue: the end of the line is {away:.1f} m away; {AT_SPOT:g} m or less is needed"
        )
    cash = float(p.cash[i])
    if cash < PRICE:
        return Refusal(ReasonCode.NO_MONEY, f"queue: one pays {PRICE:g}, and you have {cash:.2f}")
    return None


def queue(values: Values, i: int, state: SimulationState) -> None:
    """Stand at the end of the line, or stay in it."""
    room = int(state.people.room[i])
    if state.lines.room[i] != room:
        before = len(state.lines.waiting(room))
        state.lines.join(i, room)
        state.events.add("queue", state.people.names[i], f"stands in line behind {before}", state.people.position[i])


SHOPS = (
    ActionType(
        "queue",
        f"Stand in line at the till of the room, at its end: served in turn, {SERVICE:g} s each, for {PRICE:g}.",
        queue,
        check_queue,
    ),
)
