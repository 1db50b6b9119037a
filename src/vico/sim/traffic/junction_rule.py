"""Who may be in a junction: a switch of the run, that every figure names."""

from __future__ import annotations

from enum import StrEnum


class JunctionRule(StrEnum):
    """Who may be in a junction.

    Attributes
    ----------
    ONE
        One vehicle at a time: the paper's rule.
    SHARED
        Those whose lanes through it do not cross, join, or come too near each other; buses alone.
    """

    ONE = "one"
    SHARED = "shared"

    @property
    def is_shared(self) -> bool:
        """Whether several vehicles may be in a junction."""
        return self is JunctionRule.SHARED
