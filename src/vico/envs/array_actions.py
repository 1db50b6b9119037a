"""The array form of people's actions: a type, a level, a choice and a hand, and the actions they stand for.

========  ==========================================================================================================
type      the action, by its place among the kinds that may be done (all that people can do, unless told)
level     of `LEVELS`: metres, or degrees
choice    which place, thing, person, report or phrase, in the order in which observations tell of them
hand      0 left, 1 right
========  ==========================================================================================================

A part that an action does not use decides nothing; fields that need not be given are left out, but for where to put
things. A choice of what is not there leaves its field out, and the
simulation refuses the action and says why; masks tell before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.envs.array_observations import PEOPLE, PLACES, THINGS, Surroundings
from vico.errors import InputError
from vico.rules import BIKE_SPEED, RUN_SPEED
from vico.sim.actions import ACTIONS, PEOPLE_ACTIONS, Refusal
from vico.sim.actions.model import Field
from vico.sim.actions.table import check
from vico.sim.state.simulation_state import SimulationState

_DEGREES = (5.0, 10.0, 15.0, 30.0, 45.0, 60.0, 90.0, 180.0)
#: What a level stands for, by action. The last step is that of a bicycle: on foot it is as far as one can run.
LEVELS: dict[str, tuple[float, ...]] = {
    "move_forward": (0.1, 0.25, 0.5, 0.75, 1.0, 1.5, RUN_SPEED, BIKE_SPEED),
    "turn_left": _DEGREES,
    "turn_right": _DEGREES,
}
LEVEL_COUNT = 8
#: What `communicate` says, unless a task has phrases of its own.
PHRASES = (
    "Hello!",
    "Good morning.",
    "Excuse me.",
    "Thank you.",
    "See you later.",
    "Do you need help?",
    "Where are you going?",
    "Please wait.",
)
#: Reports that can be made: the indices of tasks.
REPORTS = 8
#: How many choices the fields read from each slot of a learner's action have.
_CHOICES = {
    "entity": THINGS,
    "target": THINGS,
    "where": THINGS + 1,  # the first one is the ground ahead
    "agent": PEOPLE,
    "place": PLACES,
    "index": REPORTS,
    "text": len(PHRASES),
}
CHOICE_COUNT = max(_CHOICES.values())


class Entry(NamedTuple):
    """An action as numbers."""

    type: int
    level: int = 0
    choice: int = 0
    hand: int = 0


class ActionTable:
    """Actions as numbers, and numbers as actions.

    Parameters
    ----------
    kinds
        Those that may be done; None for all that people can do.
    phrases
        What `communicate` says, `PHRASES` unless told; as many.

    Raises
    ------
    InputError
        If there is no such action, or there are more or fewer phrases.
    """

    def __init__(self, kinds: Sequence[str] | None = None, *, phrases: Sequence[str] = PHRASES) -> None:
        self.kinds = tuple(PEOPLE_ACTIONS if kinds is None else kinds)
        if odd := [kind for kind in self.kinds if kind not in PEOPLE_ACTIONS]:
            raise InputError(f"env: people have no action {odd[0]!r}; there are {', '.join(PEOPLE_ACTIONS)}")
        if len(phrases) != len(PHRASES):
            raise InputError(f"env: {len(phrases)} phrases; give {len(PHRASES)}")
        self.phrases = tuple(phrases)
        #: Every action that differs from the others, in the order of the flat space's numbers.
        self.menu = tuple(entry for k in range(len(self.kinds)) for entry in self._entries(k))
        self._number = {entry: k for k, entry in enumerate(self.menu)}

    @property
    def space(self) -> spaces.MultiDiscrete:
        """Type, level, choice, hand."""
        return spaces.MultiDiscrete([len(self.kinds), LEVEL_COUNT, CHOICE_COUNT, 2])

    def action_of(self, entry: Entry, around: Surroundings, *, riding: bool = False) -> dict[str, Any]:
        """Return what numbers stand for, as the short form has it.

        Parameters
        ----------
        around
            What the choice is made of.
        riding
            Whether the agent is on a bicycle.
        """
        kind = self.kinds[entry.type]
        values = {name: self._value(kind, field, entry, around) for name, field in ACTIONS[kind].fields.items()}
        if kind == "move_forward" and not riding:
            values["distance"] = min(values["distance"], RUN_SPEED)
        return {"type": kind} | {name: value for name, value in values.items() if value is not None}

    def entry_of(self, action: Mapping[str, Any], around: Surroundings) -> Entry:
        """Return the numbers of an action: the nearest level, and the choice that it names.

        Raises
        ------
        InputError
            If it is none of the kinds, or names what is not around.
        """
        kind = action.get("type")
        if kind not in self.kinds:
            raise InputError(f"env: no action {kind!r} here; there are {', '.join(self.kinds)}")
        level = choice = hand = 0
        for name, field in ACTIONS[kind].fields.items():
            value = action.get(name)
            if value is None or not _is_given(field):
                continue
            if field.slot == "amount":
                level = int(np.argmin(np.abs(np.array(_levels(kind, field)) - float(value))))
            elif field.slot == "hand":
                hand = int(value)
            else:
                choice = self._choice_of(kind, name, field, value, around)
        entry = Entry(self.kinds.index(kind), level, choice, hand)
        return self.canonical(entry)

    def number_of(self, entry: Entry) -> int:
        """Return the number of an entry in `menu`."""
        return self._number[self.canonical(entry)]

    def mask(
        self,
        agent: int,
        state: SimulationState,
        around: Surroundings,
        *,
        allows: Callable[[Mapping[str, Any]], bool],
        riding: bool = False,
    ) -> NDArray[np.int8]:
        """Return which entries of `menu` would be accepted, 0 or 1, int8, shape ``(len(menu),)``.

        Parameters
        ----------
        agent
            Its index in ``state.names``.
        allows
            What else decides whether an action may be done.
        """
        judged: dict[Entry, bool] = {}
        mask = np.zeros(len(self.menu), np.int8)
        for k, entry in enumerate(self.menu):
            # Levels lie within their fields' bounds whatever they are.
            one = entry._replace(level=0)
            if one not in judged:
                action = self.action_of(one, around, riding=riding)
                judged[one] = not isinstance(check(action, agent, state), Refusal)
            mask[k] = judged[one] and allows(self.action_of(entry, around, riding=riding))
        return mask

    def parts_mask(self, mask: NDArray[np.int8]) -> NDArray[np.int8]:
        """Return the mask of each number of `space`, one after the other: what occurs in some entry that is accepted.

        A choice may be open for one type and not for another; the flat space has no such gaps.
        """
        sizes = self.space.nvec.tolist()
        parts = [np.zeros(size, np.int8) for size in sizes]
        for entry, allowed in zip(self.menu, mask.tolist(), strict=True):
            if allowed:
                for part, value in zip(parts, entry, strict=True):
                    part[value] = 1
        for part in parts:
            if not part.any():  # nothing at all: an agent that cannot even wait
                part[0] = 1
        return np.concatenate(parts)

    def _entries(self, k: int) -> list[Entry]:
        kind = self.kinds[k]
        fields = ACTIONS[kind].fields.values()
        slots = {field.slot for field in fields if _is_given(field)}
        levels = LEVEL_COUNT if "amount" in slots else 1
        choices = max([_CHOICES[slot] for slot in slots if slot in _CHOICES], default=1)
        hands = 2 if "hand" in slots else 1
        return [Entry(k, a, b, c) for a in range(levels) for b in range(choices) for c in range(hands)]

    def canonical(self, entry: Entry) -> Entry:
        """Return the entry of `menu` that stands for the same action: what it does not use is 0."""
        own = self._entries(entry.type)
        most = Entry(entry.type, *(max(getattr(one, name) for one in own) for name in ("level", "choice", "hand")))
        return Entry(
            entry.type,
            entry.level if most.level else 0,
            min(entry.choice, most.choice) if most.choice else 0,
            entry.hand if most.hand else 0,
        )

    def _value(self, kind: str, field: Field, entry: Entry, around: Surroundings) -> Any:
        """Return a field's value; None leaves it out."""
        if not _is_given(field):
            return None
        if field.slot == "amount":
            return _levels(kind, field)[entry.level]
        if field.slot == "hand":
            return entry.hand
        if field.slot == "index":
            return entry.choice if entry.choice < REPORTS else None
        if field.slot == "text":
            return self.phrases[entry.choice] if entry.choice < len(self.phrases) else None
        choice = entry.choice
        if field.slot == "where":
            return around.things[choice - 1].entity if 0 < choice <= len(around.things) else None
        found = {"entity": around.things, "target": around.things, "agent": around.people, "place": around.places}
        options = found[str(field.slot)]
        if choice >= len(options):
            return None
        one = options[choice]
        if field.slot == "entity":
            return one.entity
        return [float(value) for value in one.position] if field.slot == "target" else one.name or None

    def _choice_of(self, kind: str, name: str, field: Field, value: Any, around: Surroundings) -> int:
        for choice in range(_CHOICES[str(field.slot)]):
            found = self._value(kind, field, Entry(0, choice=choice), around)
            same = found is not None and (
                np.allclose(found, value, atol=1e-3) if field.slot == "target" else found == value
            )
            if same:
                return choice
        raise InputError(f"env: {kind}: {name} {value!r} is none of what is told of; choose one of those")


def _is_given(field: Field) -> bool:
    return field.slot is not None and (field.required or field.slot == "where")


def _levels(kind: str, field: Field) -> tuple[float, ...]:
    """Return what the levels of an action stand for; equal parts of the field's scale where no list says."""
    if kind in LEVELS:
        return LEVELS[kind]
    return tuple(field.scale * (k + 1) / LEVEL_COUNT for k in range(LEVEL_COUNT))
