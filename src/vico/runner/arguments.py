"""Arguments of commands to a run, each looked at before it is used."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vico.errors import InputError

_LONGEST_NAME, _LONGEST_TEXT = 60, 1000

#: Arguments of each command that has any.
_KNOWN = {
    "step": ("steps",),
    "speed": ("factor",),
    "snapshot": ("name",),
    "back": ("step", "name"),
    "branch": ("name", "step"),
    "bookmark": ("text", "step", "time"),
}


class Arguments:
    """Arguments of a command, each of which is looked at before it is used."""

    def __init__(self, command: str, given: Mapping[str, Any]) -> None:
        self._command, self._given = command, given
        known = _KNOWN.get(command, ())
        unknown = [name for name in given if name not in known]
        if unknown:
            raise InputError(f"{command}: no argument is called {unknown[0]!r}; there are {', '.join(known) or 'none'}")

    def has(self, name: str) -> bool:
        """Whether one is given."""
        return self._given.get(name) is not None

    def number(self, name: str, usual: float | None, low: float, high: float) -> float:
        """Return a number, or the usual one where it is left out."""
        value = self._given.get(name, usual)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise InputError(f"{self._command}: {name} is {value!r}; it has to be {low:g} to {high:g}")
        return value

    def text(self, name: str) -> str:
        """Return a text; "" where it is left out."""
        value = self._given.get(name, "")
        if not isinstance(value, str) or len(value) > _LONGEST_TEXT:
            raise InputError(f"{self._command}: {name} has to be a short text")
        if name == "name" and (len(value) > _LONGEST_NAME or not all(c.isalnum() or c in "-_ " for c in value)):
            raise InputError(f"{self._command}: name may have {_LONGEST_NAME} letters, digits, spaces, - and _")
        return value.strip()
