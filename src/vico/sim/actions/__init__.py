"""Actions of agents: one table, judged with codes and sentences, then performed."""

from vico.sim.actions.model import ActionType, Command, Refusal
from vico.sim.actions.table import (
    ACTIONS,
    PEOPLE_ACTIONS,
    ROBOT_ACTIONS,
    AgentFault,
    actions_markdown,
    apply_actions,
    check,
    parse,
    perform,
)

__all__ = [
    "ACTIONS",
    "PEOPLE_ACTIONS",
    "ROBOT_ACTIONS",
    "ActionType",
    "AgentFault",
    "Command",
    "Refusal",
    "actions_markdown",
    "apply_actions",
    "check",
    "parse",
    "perform",
]
