"""What workers do in tests: in a module of its own, so that their processes import little."""

from __future__ import annotations

import threading

from vico.errors import InputError


class Counter:
    """Counts, fails, or never comes back."""

    def __init__(self, start: int) -> None:
        self.number = start

    def add(self, n: int) -> int:
        """Add to the number."""
        self.number += n
        return self.number

    def fail(self) -> None:
        """Divide by zero."""
        self.number = 1 // 0

    def refuse(self) -> None:
        """Say what to mend."""
        raise InputError("counter: refused; ask for something else")

    def hang(self) -> None:
        """Wait for what never happens."""
        threading.Event().wait()
