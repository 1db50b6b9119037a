"""A step's actions, applied: checked ones are performed, bad ones refused with a code and a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vico.rules import ActionStatus, ReasonCode, code_name
from vico.sim.actions.check import check
from vico.sim.actions.model import Command
from vico.sim.actions.table import form_of
from vico.sim.simulation_state import SimulationState
from vico.sim.state import REASON_LENGTH

#: How an agent failed to act (late, or with an error), and why.
AgentFault = tuple[ActionStatus, str]


def apply_actions(actions: Mapping[str, Any], faults: Mapping[str, AgentFault], state: SimulationState) -> int:
    """Do what agents ask for, in the order of their names' indices; return how many actions were refused.

    Parameters
    ----------
    actions
        One by agent's name; names nobody has are ignored.
    faults
        Agents that were late or failed: they do nothing, and it is noted.
    """
    refused = 0
    for agent, name in enumerate(state.names):
        if name in faults:
            _note_fault(faults[name], agent, state)
        elif (action := actions.get(name)) is not None and not _is_wait(action):
            verdict = check(action, agent, state)
            if isinstance(verdict, Command):
                perform(verdict, agent, state)
                continue
            refused += 1
            state.set_outcome(agent, ActionStatus.REFUSED, verdict.code, verdict.reason)
            where, code = state.position_of(agent), code_name(verdict.code)
            state.events.add("refused", name, verdict.reason, where, code=code)
    return refused


def _is_wait(action: object) -> bool:
    """Return whether an action is a plain wait, which anybody may do at any time, and which does nothing."""
    if type(action) is not dict or len(action) != 1:
        return False
    kind = action.get("type")
    return isinstance(kind, str) and kind == "wait"


def perform(command: Command, agent: int, state: SimulationState) -> None:
    """Do what `check` allowed. The state must be the one it was checked against."""
    people = len(state.people)
    robot = agent >= people
    form_of(command.kind, robot=robot).perform(command.values, agent - people if robot else agent, state)


def _note_fault(fault: AgentFault, agent: int, state: SimulationState) -> None:
    status, reason = fault
    late = status is ActionStatus.LATE
    state.set_outcome(agent, status, ReasonCode.AGENT_LATE if late else ReasonCode.AGENT_FAILED, reason)
    kind = "agent_late" if late else "agent_failed"
    state.events.add(kind, state.names[agent], reason[:REASON_LENGTH], state.position_of(agent))
