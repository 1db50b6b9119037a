"""A robot that has nothing to do."""

from __future__ import annotations

from vico.agents.base import Action, Info, Observation
from vico.agents.state import AgentState


class Resting:
    """Stays where it is."""

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at its pictures: never."""
        return False

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        return {"type": "wait"}

    def state(self) -> AgentState:
        """Return nothing: it remembers nothing."""
        return {}

    def restore(self, state: AgentState) -> None:
        """Remember nothing."""
