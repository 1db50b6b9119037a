"""An action type: its fields, its actors and situations, its check and its effect.

A field says what values it takes, and how anything at all is turned into one or refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Flag, auto
from typing import Any, Literal

import numpy as np

from vico.rules import LONGEST_TEXT, ReasonCode
from vico.sim.state.simulation_state import SimulationState

Kind = Literal["number", "integer", "point", "vector", "text", "hand", "target", "name"]
#: Parts of a learner's action that fields are read from; `vico.envs.spaces` gives each its space.
Slot = Literal["amount", "target", "hand", "entity", "agent", "place", "index", "text", "where"]

#: What a value of each kind has to be, in words.
FORMS: dict[Kind, str] = {
    "number": "a finite number",
    "integer": "a whole number",
    "point": "three finite numbers x, y, z",
    "vector": "a list of finite numbers",
    "text": f"1 to {LONGEST_TEXT} characters of text",
    "hand": "0 (left) or 1 (right)",
    "target": "an entity number or three finite numbers x, y, z",
    "name": "a name",
}
_LONGEST_LIST = 64
_LARGEST = 1e12


@dataclass(frozen=True)
class Field:
    """One field of an action.

    Attributes
    ----------
    kind
        What values it takes.
    required
        Whether it has to be given.
    low, high
        Bounds of a number; `low` itself is out of range where `above_low`.
    unit
        Of a number, in words.
    slot
        Part of a learner's action it is read from; None if learners can't give it.
    scale, least
        A number read from ``amount`` (0..1) is that share of `scale`, and no less than `least`.
    """

    kind: Kind
    required: bool = True
    low: float = -math.inf
    high: float = math.inf
    above_low: bool = False
    unit: str = ""
    slot: Slot | None = None
    scale: float = 1.0
    least: float | None = None

    def read(self, raw: object) -> Any:
        """Return a value as a plain number, tuple or text; None if it is none of this kind."""
        if self.kind == "number":
            return _number(raw)
        if self.kind == "integer":
            return _integer(raw)
        if self.kind == "hand":
            whole = _integer(raw)
            return whole if whole in (0, 1) else None
        if self.kind in ("text", "name"):
            return raw if isinstance(raw, str) and raw.strip() and len(raw) <= LONGEST_TEXT else None
        if self.kind == "target" and not _is_list(raw):
            return _integer(raw)
        return _numbers(raw, length=None if self.kind == "vector" else 3)

    def in_range(self, value: Any) -> bool:
        """Whether a value lies within the bounds; whatever is no number does."""
        if self.kind not in ("number", "integer"):
            return True
        return self.low <= value <= self.high and not (self.above_low and value == self.low)

    @property
    def range(self) -> str:
        """The bounds in words; "" without bounds."""
        if math.isinf(self.low):
            return ""
        unit = f" {self.unit}" if self.unit else ""
        if math.isinf(self.high):
            return f"{self.low:g}{unit} or more"
        return f"{'more than ' if self.above_low else ''}{self.low:g} to {self.high:g}{unit}"


def short(value: object) -> str:
    """Return a value as it may stand in a sentence."""
    try:
        text = repr(value)
    except Exception:
        # A value that can't even be shown is still only a bad action.
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


def _is_list(raw: object) -> bool:
    return isinstance(raw, (list, tuple)) or (isinstance(raw, np.ndarray) and raw.ndim == 1)


def _numbers(raw: object, *, length: int | None) -> tuple[float, ...] | None:
    if not _is_list(raw):
        return None
    numbers = [_number(part) for part in raw]  # type: ignore[attr-defined]
    if None in numbers or (length is not None and len(numbers) != length) or not 0 < len(numbers) <= _LONGEST_LIST:
        return None
    return tuple(number for number in numbers if number is not None)


def _number(raw: object) -> float | None:
    if isinstance(raw, np.ndarray) and raw.size == 1:
        raw = raw.reshape(-1)[0]
    if isinstance(raw, (bool, np.bool_)) or not isinstance(raw, (int, float, np.integer, np.floating)):
        return None
    try:
        value = float(raw)
    except OverflowError:
        return None
    return value if math.isfinite(value) and abs(value) <= _LARGEST else None


def _integer(raw: object) -> int | None:
    value = _number(raw)
    return int(value) if value is not None and value == int(value) else None


Values = Mapping[str, Any]


@dataclass(frozen=True)
class Command:
    """A well-formed action: its kind and its values, in plain types."""

    kind: str
    values: Values


@dataclass(frozen=True)
class Refusal:
    """Why an action will not be done: a code for programs and a sentence for people."""

    code: ReasonCode
    reason: str


#: Judge an action of the person or robot with an index: None if it can be done.
Check = Callable[[Values, int, SimulationState], Refusal | None]
#: Do what was checked.
Perform = Callable[[Values, int, SimulationState], None]


class Situation(Flag):
    """What a person may be doing when an action is asked for."""

    ON_FOOT = auto()
    SEATED = auto()
    ASLEEP = auto()
    IN_BUS = auto()
    ON_BIKE = auto()
    ANY = ON_FOOT | SEATED | ASLEEP | IN_BUS | ON_BIKE
    AWAKE = ON_FOOT | SEATED | IN_BUS | ON_BIKE


class Actors(Flag):
    """Who may do an action."""

    PEOPLE = auto()
    ROBOTS = auto()


def _allow(values: Values, i: int, state: SimulationState) -> Refusal | None:
    return None


@dataclass(frozen=True)
class ActionType:
    """One kind of action, defined in one place.

    Attributes
    ----------
    name
        The action's ``type``.
    summary
        What it does, one sentence.
    perform
        Does it; the state is the one that was checked.
    check
        Judges it in the light of the state, after fields, ranges, actors and situation have been judged.
    fields
        By name, beside ``type``.
    when
        Situations in which people may do it.
    actors
        Who may do it. `check` and `perform` get the index within their kind: a row of ``state.people``, or a robot's.
    """

    name: str
    summary: str
    perform: Perform
    check: Check = _allow
    fields: Mapping[str, Field] = field(default_factory=dict)
    when: Situation = Situation.ON_FOOT
    actors: Actors = Actors.PEOPLE
