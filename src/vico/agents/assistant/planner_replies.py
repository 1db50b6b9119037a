"""What a language model is asked to reply with when it plans for an assistant."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class _Reply(BaseModel):
    model_config = ConfigDict(extra="forbid")


class PlannedAction(_Reply):
    """The number of one of the available actions, and why that one."""

    action: int
    reason: str


class SpokenMessage(_Reply):
    """What is said to the other assistant; null ends the conversation."""

    message: str | None
    reason: str
