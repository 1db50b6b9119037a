"""In which form observations and actions are given, as a record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from vico.errors import InputError

NAMES = ("rich", "arrays")
OBSERVATIONS = ("dict", "box")
ACTIONS = ("multi", "discrete")


@dataclass(frozen=True, kw_only=True)
class FormOptions:
    """In which form observations and actions are given.

    Attributes
    ----------
    name
        ``"rich"``: all that agents are told (`vico.envs.spaces`); ``"arrays"``: arrays of fixed shape.
    observation
        Of the arrays: ``"dict"``, a flat dict of Boxes, or ``"box"``, one Box of all its numbers.
    actions
        Of people in the array form: ``"multi"``, type, level, choice and hand (MultiDiscrete), or ``"discrete"``, the
        number of an entry of the list of all actions.
    kinds
        Actions that people may do in the array form; None for all.
    texts
        Whether the dict of arrays holds what was said, as bytes.
    """

    name: str = "rich"
    observation: str = "dict"
    actions: str = "multi"
    kinds: tuple[str, ...] | None = None
    texts: bool = False

    @classmethod
    def of(cls, given: str | Mapping[str, Any]) -> FormOptions:
        """Return options by name, or from the fields of this record.

        Raises
        ------
        InputError
            If a field or its value is unknown.
        """
        content: dict[str, Any] = {"name": given} if isinstance(given, str) else dict(given)
        known = [field.name for field in fields(cls)]
        if odd := [name for name in content if name not in known]:
            raise InputError(f"env: form has no {odd[0]!r}; it has {', '.join(known)}")
        if content.get("kinds") is not None:
            content["kinds"] = tuple(content["kinds"])
        found = cls(**content)
        for name, options in (("name", NAMES), ("observation", OBSERVATIONS), ("actions", ACTIONS)):
            if getattr(found, name) not in options:
                raise InputError(f"env: form {name} is {getattr(found, name)!r}; use {' or '.join(options)}")
        return found
