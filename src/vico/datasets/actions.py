"""Actions as vectors of a fixed length, and back.

A vector begins with a one-hot of the action's type; then come the slots, each 0 where the action has no use for it::

    type.NAME ...                            1 for the action's type
    amount                                   distance / 2.5 m, degrees / 180, range of a message / 10 m
    turn                                     of who turns while walking, to the left, degrees / 180
    target.forward target.left target.up     a point in the agent's own frame, metres
    where.entity where.point                 what a target is: an entity, or that point; both 0: left to the simulation
    hand                                     0 left, 1 right
    index                                    of a task that is reported
    entity                                   number of a thing, a seat, a deck
    vector.0 ...                             of a robot's `control`, in the units of its own action space

What is text in an action (what is said, a place's id, an agent's name) goes into a string beside the vector. Whoever
predicts vectors need not be exact: the largest of the one-hot is taken, flags are rounded, numbers are held in range.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.datasets.vectors import in_own_frame, in_world_frame
from vico.errors import InputError
from vico.rules import LONGEST_TEXT
from vico.sim.actions import PEOPLE_ACTIONS, ROBOT_ACTIONS, Command
from vico.sim.actions.model import Field
from vico.sim.actions.table import form_of, parse

#: What stands for an action that is none, and for no action.
IDLE = "wait"
_SLOTS = (
    "amount",
    "turn",
    "target.forward",
    "target.left",
    "target.up",
    "where.entity",
    "where.point",
    "hand",
    "index",
    "entity",
)
# A number that has no part in `amount` is an angle; smaller ones are none, degrees.
_HALF_TURN, _NO_TURN = 180.0, 0.5
_POINT = ("target.forward", "target.left", "target.up")
# Whole numbers beyond it are not all float32.
_LARGEST_ENTITY = 2**24
_TEXTS = ("text", "name")


@dataclass(frozen=True)
class ActionForm:
    """How actions of one kind of agent become vectors.

    Attributes
    ----------
    robot
        Whether it is for robots; else for people.
    width
        How many numbers a robot's `control` takes in its own action space.
    space
        Name of that space.
    """

    robot: bool = False
    width: int = 0
    space: str = ""

    @cached_property
    def types(self) -> tuple[str, ...]:
        """Names of the actions, in the order of the one-hot."""
        return tuple(ROBOT_ACTIONS if self.robot else PEOPLE_ACTIONS)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """What each number of a vector is."""
        vector = (f"vector.{k}" for k in range(self.width))
        return (*(f"type.{name}" for name in self.types), *_SLOTS, *vector)

    @cached_property
    def _place(self) -> dict[str, int]:
        return {name: k for k, name in enumerate(self.names)}

    def encode(self, action: object, pose: Sequence[float]) -> tuple[NDArray[np.float32], str]:
        """Return an action as a vector and a text.

        Parameters
        ----------
        action
            As an agent hands it in. What is no action, or none, is encoded as `IDLE`.
        pose
            x, y, z (ENU metres) and yaw (radians) of who acts.

        Raises
        ------
        InputError
            If the vector cannot hold it: an entity beyond 2**24, or a `control` of another width or a named space.
        """
        vector = np.zeros(len(self.names), np.float32)
        command = parse(action, robot=self.robot)
        if not isinstance(command, Command) or command.kind not in self.types:
            command = Command(IDLE, {})
        vector[self._place[f"type.{command.kind}"]] = 1.0
        text = ""
        for name, field in form_of(command.kind, robot=self.robot).fields.items():
            value = command.values.get(name)
            if value is None:
                continue
            if field.kind in _TEXTS:
                text = self._text(command.kind, name, value)
            else:
                for slot, number in self._numbers(field, value, pose).items():
                    vector[self._place[slot]] = number
        return vector, text

    def decode(self, vector: Sequence[float] | NDArray[Any], pose: Sequence[float], text: str = "") -> dict[str, Any]:
        """Return the action that a vector and a text stand for; see the module for how inexact ones are read.

        Parameters
        ----------
        pose
            As for `encode`.

        Raises
        ------
        InputError
            If the vector has another length or holds what is not finite.
        """
        numbers = np.asarray(vector, np.float64)
        if numbers.shape != (len(self.names),) or not np.isfinite(numbers).all():
            raise InputError(f"action: a vector of shape {numbers.shape}; give {len(self.names)} finite numbers")
        kind = self.types[int(np.argmax(numbers[: len(self.types)]))]
        action: dict[str, Any] = {"type": kind}
        for name, field in form_of(kind, robot=self.robot).fields.items():
            value = text if field.kind in _TEXTS else self._value(field, numbers, pose)
            if value is not None and (field.required or value != ""):
                action[name] = value
        return action

    def _text(self, kind: str, name: str, value: str) -> str:
        if kind == "control":
            if value == self.space:
                return ""
            raise InputError(f"action: control in the space {value!r}; datasets hold a robot's own action space alone")
        return str(value)[:LONGEST_TEXT]

    def _numbers(self, field: Field, value: Any, pose: Sequence[float]) -> dict[str, float]:
        """Return the slots that a field's value fills."""
        if field.kind == "vector":
            if len(value) != self.width:
                raise InputError(f"action: a control of {len(value)} numbers; this dataset's robots take {self.width}")
            return {f"vector.{k}": number for k, number in enumerate(value)}
        if field.kind == "number":
            return {"amount": value / field.scale} if field.slot == "amount" else {"turn": value / _HALF_TURN}
        if field.kind == "hand" or field.slot == "index":
            return {"hand" if field.kind == "hand" else "index": value}
        if isinstance(value, tuple):
            return dict(zip(_POINT, in_own_frame(pose, value), strict=True)) | {"where.point": 1.0}
        if not 0 <= value < _LARGEST_ENTITY:
            raise InputError(f"action: entity {value}; numbers from 0 to {_LARGEST_ENTITY - 1} fit into the vector")
        return {"entity": value, "where.entity": 1.0}

    def _value(self, field: Field, numbers: NDArray[np.float64], pose: Sequence[float]) -> Any:
        """Return what the slots say of a field; None if they leave it out."""

        def slot(name: str) -> float:
            return float(numbers[self._place[name]])

        if field.kind == "vector":
            return [slot(f"vector.{k}") for k in range(self.width)]
        if field.kind == "number" and field.slot != "amount":
            angle = min(max(slot("turn") * _HALF_TURN, field.low), field.high)
            return angle if abs(angle) >= _NO_TURN else None
        if field.kind == "number":
            least = field.low if field.least is None else field.least
            return float(min(max(slot("amount") * field.scale, least), field.high))
        if field.kind == "hand":
            return int(slot("hand") >= 0.5)
        if field.slot == "index":
            return max(0, round(slot("index")))
        return self._target(field, slot("where.entity"), slot("where.point"), round(slot("entity")), pose, numbers)

    def _target(
        self,
        field: Field,
        entity_share: float,
        point_share: float,
        entity: int,
        pose: Sequence[float],
        numbers: NDArray[np.float64],
    ) -> Any:
        """Return a point, an entity's number or None, whichever the two shares say and the field takes."""
        if not field.required and max(entity_share, point_share) < 0.5:
            return None
        takes_point, takes_entity = field.kind in ("point", "target"), field.kind in ("integer", "target")
        if takes_entity and (not takes_point or entity_share >= point_share):
            return max(0, entity)
        first = self._place[_POINT[0]]
        return [float(part) for part in in_world_frame(pose, numbers[first : first + 3].tolist())]


def described(action: Mapping[str, Any]) -> str:
    """Return an action in a few words, as captions show it: ``move_forward 1.5``."""
    parts = [str(action.get("type", "?"))]
    for name, value in action.items():
        if name == "type":
            continue
        if isinstance(value, float):
            parts.append(f"{value:.2f}".rstrip("0").rstrip("."))
        elif isinstance(value, list | tuple):
            parts.append(
                "(" + ", ".join(f"{part:.1f}" for part in value[:6]) + (", ..." if len(value) > 6 else "") + ")"
            )
        else:
            parts.append(str(value) if len(str(value)) <= 40 else f"{str(value)[:37]}...")
    return " ".join(parts)
