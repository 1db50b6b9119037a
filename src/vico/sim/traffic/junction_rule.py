"""Who may be in a junction: a switch of the run, that every figure names."""

from __future__ import annotations

from enum import StrEnum


class JunctionRule(StrEnum):
    """Who may be in a junction.

    Attributes
    ----------
    ONE
        One vehicle at a time; signals are not obeyed. The paper's rule.
    SHARED
        Those whose lanes through it do not cross, join, or come too near each other; buses alone; no signals.
    SIGNALS
        The same, and signals are obeyed where the map has them.
    BOTH
        One vehicle at a time, and signals are obeyed.
    """

    ONE = "one"
    SHARED = "shared"
    SIGNALS = "signals"
    BOTH = "both"

    @property
    def is_shared(self) -> bool:
        """Whether several vehicles may be in a junction."""
        return self in (JunctionRule.SHARED, JunctionRule.SIGNALS)

    @property
    def has_signals(self) -> bool:
        """Whether signals are obeyed."""
        return self in (JunctionRule.SIGNALS, JunctionRule.BOTH)
