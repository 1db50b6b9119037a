"""Budget of a language model: its limits, and its cost so far."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

from vico.errors import InputError, LlmBudgetError


@dataclass(frozen=True)
class Usage:
    """What answers took.

    Attributes
    ----------
    calls
        Answers a server gave; those from the cache are not among them.
    read, written
        Tokens of the requests, and of the answers; estimated (four characters each) where the server does not count.
    cost
        Dollars; 0 where prices are unknown.
    """

    calls: int = 0
    read: int = 0
    written: int = 0
    cost: float = 0.0

    @property
    def tokens(self) -> int:
        """All tokens."""
        return self.read + self.written

    def __add__(self, other: Usage) -> Usage:
        return Usage(
            self.calls + other.calls, self.read + other.read, self.written + other.written, self.cost + other.cost
        )


class Budget:
    """Limits, shared by everybody who is handed this object. Threads may share it.

    A call is refused once a limit is reached, or when its request alone would pass it; the answer to the last call
    may pass the limits of tokens and cost.

    Parameters
    ----------
    calls, tokens, cost
        Most answers, tokens and dollars; no limit where None.

    Attributes
    ----------
    spent
        What was used so far.

    Raises
    ------
    InputError
        If a limit is negative or no number.
    """

    def __init__(self, calls: int | None = None, tokens: int | None = None, cost: float | None = None) -> None:
        for name, value in (("calls", calls), ("tokens", tokens), ("cost", cost)):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise InputError(f"budget: {name} {value}; it must not be negative")
        self.calls, self.tokens, self.cost = calls, tokens, cost
        self.spent = Usage()
        self._asked = Usage()  # by calls that are under way
        self._lock = threading.Lock()

    def take(self, asked: Usage) -> None:
        """Set a call's request aside before it is sent; `settle` or `release` has to follow.

        Raises
        ------
        LlmBudgetError
            If a limit would be passed.
        """
        with self._lock:
            after = self.spent + self._asked + asked
            if self.calls is not None and after.calls > self.calls:
                raise LlmBudgetError(
                    f"language model: all {self.calls:,} calls of the budget are spent; raise the limit"
                )
            if self.tokens is not None and after.tokens > self.tokens:
                raise LlmBudgetError(
                    f"language model: {self.spent.tokens:,} of {self.tokens:,} tokens are spent and the next request "
                    f"has about {asked.tokens:,}; raise the limit"
                )
            if self.cost is not None and after.cost > self.cost:
                raise LlmBudgetError(
                    f"language model: ${self.spent.cost:.4f} of ${self.cost:.4f} are spent and the next request "
                    f"costs about ${asked.cost:.4f}; raise the limit"
                )
            self._asked += asked

    def release(self, asked: Usage) -> None:
        """Give back what was set aside for a call that got no answer."""
        with self._lock:
            self._asked += Usage(-asked.calls, -asked.read, -asked.written, -asked.cost)

    def settle(self, asked: Usage, used: Usage) -> None:
        """Book what a call used, for what was set aside."""
        self.release(asked)
        with self._lock:
            self.spent += used
