"""Vectors of a frame: what an agent knows of itself and of its task, and its action; of fixed length, and back.

State and goal are the same from a live observation and from a recording. Actions are either the simulation's, or
increments of joints, as policies of arms give them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.challenges.pick_place.episode import INCREMENTS
from vico.errors import InputError
from vico.rules import LONGEST_TEXT, ActionStatus
from vico.sim.actions import PEOPLE_ACTIONS, ROBOT_ACTIONS, Command
from vico.sim.actions.model import Field
from vico.sim.actions.table import form_of, parse

#: ``observation.state`` of a person. ENU metres, radians, seconds since midnight; flags are 0 or 1.
PERSON_STATE = (
    "x",
    "y",
    "z",
    "heading.east",
    "heading.north",
    "gaze.pitch",
    "indoors",
    "sitting",
    "lying",
    "riding",
    "holds.left",
    "holds.right",
    "cash",
    "time",
    "last.collision",
    "last.refused",
)
#: ``observation.environment_state``: the region to go to and the one to bring things to, seen from where one stands
#: and looks; metres. All 0 of a region that the task does not have.
GOAL = tuple(
    f"{region}.{part}"
    for region in ("source", "destination")
    for part in ("there", "forward", "left", "up", "radius", "indoors")
)
# Regions of places have no radius: their rooms are the bounds.
_INDOORS = "place"


def person_state(observation: Mapping[str, Any]) -> NDArray[np.float32]:
    """Return the state vector of a person's observation, float32, in the order of `PERSON_STATE`."""
    x, y, z, east, north, up = (float(value) for value in observation["pose"])
    state = observation["state"]
    level = math.hypot(east, north)
    held = [bool(entity) for entity in state["held"]]
    posture, status = state["posture"], state["action_status"]
    return np.array(
        [
            *(x, y, z),
            *(east / level, north / level, math.atan2(up, level)),
            bool(state["room"]),
            posture == "sitting",
            posture == "lying",
            bool(state["vehicle"]),
            *held,
            float(state["cash"]),
            float(state["time"]),
            status == "collision",
            status == "refused",
        ],
        np.float32,
    )


def recorded_person_states(rows: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Return the state vectors of a person's recorded rows, float32, shape ``(steps, len(PERSON_STATE))``.

    Parameters
    ----------
    rows
        Columns of the tables ``bodies`` and ``agents`` and the ``time`` of ``steps`` (docs/formats.md), of one person,
        a row a step.
    """
    status = rows["status"]
    columns = [
        *(rows["x"], rows["y"], rows["z"]),
        *(np.cos(rows["yaw"]), np.sin(rows["yaw"]), rows["pitch"]),
        rows["room"] >= 0,
        rows["posture"] == 1,
        rows["posture"] == 2,
        rows["vehicle"] > 0,
        *(rows["held_left"] > 0, rows["held_right"] > 0),
        *(rows["cash"], rows["time"]),
        status == ActionStatus.COLLISION,
        status == ActionStatus.REFUSED,
    ]
    return np.column_stack(columns).astype(np.float32)


def robot_state_names(joints: int) -> tuple[str, ...]:
    """Return what ``observation.state`` of a robot with so many joints holds: pose, joints, time, outcome."""
    base = ("x", "y", "z", "qw", "qx", "qy", "qz")
    return (*base, *(f"joint.{k}" for k in range(joints)), "time", "last.collision", "last.refused")


def recorded_robot_states(rows: Mapping[str, NDArray[Any]], joints: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the state vectors of a robot's recorded rows.

    Parameters
    ----------
    rows
        Columns of the tables ``robots`` and ``agents`` and the ``time`` of ``steps``, of one robot, a row a step.
    joints
        Radians, shape ``(steps, n)``.
    """
    status = rows["status"]
    pose = [rows[name] for name in ("x", "y", "z", "qw", "qx", "qy", "qz")]
    outcome = [status == ActionStatus.COLLISION, status == ActionStatus.REFUSED]
    return np.column_stack([*pose, joints, rows["time"], *outcome]).astype(np.float32)


def goal_vector(pose: Sequence[float], instruction: Mapping[str, Any] | None) -> NDArray[np.float32]:
    """Return what an instruction tells of where to go, seen from a pose; in the order of `GOAL`.

    Parameters
    ----------
    pose
        x, y, z (ENU metres) and yaw (radians).
    instruction
        One of those that assistants are given; the first of its source regions counts. None: there is nothing to do.
    """
    if instruction is None:
        return np.zeros(len(GOAL), np.float32)
    regions = (instruction["sources"][0], instruction["destination"])
    return np.array([part for region in regions for part in _seen_from(pose, region)], np.float32)


def _seen_from(pose: Sequence[float], region: Mapping[str, Any] | None) -> tuple[float, ...]:
    if region is None:
        return (0.0,) * (len(GOAL) // 2)
    return 1.0, *in_own_frame(pose, region["centre"]), float(region["radius"]), float(region["kind"] == _INDOORS)


def in_own_frame(pose: Sequence[float], point: Sequence[float]) -> tuple[float, float, float]:
    """Return a point (ENU metres) as metres forward, to the left and up of who stands at a pose (x, y, z, yaw)."""
    x, y, z, yaw = pose
    east, north, up = point[0] - x, point[1] - y, point[2] - z
    c, s = math.cos(yaw), math.sin(yaw)
    return c * east + s * north, c * north - s * east, up


def in_world_frame(pose: Sequence[float], point: Sequence[float]) -> tuple[float, float, float]:
    """Undo `in_own_frame`."""
    x, y, z, yaw = pose
    forward, left, up = point
    c, s = math.cos(yaw), math.sin(yaw)
    return x + c * forward - s * left, y + s * forward + c * left, z + up


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
    """Form in which actions of one kind of agent become vectors.

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
        """Names of the numbers of a vector."""
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


def action_caption(action: Mapping[str, Any]) -> str:
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


#: Stands where the forms of other actions name one of a robot's action spaces.
SPACE = "increments"


@dataclass(frozen=True)
class IncrementForm:
    """Vectors with an increment for each degree of freedom of a mobile manipulator.

    An increment goes from where a joint is, as the state of the same frame says, to where its servo is told to be;
    `vico.agents.robot.increments.control_of` makes an action of both.
    """

    robot: bool = True
    width: int = len(INCREMENTS)
    space: str = SPACE

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the numbers of a vector, rad and metres."""
        return INCREMENTS

    def decode(self, vector: Sequence[float] | NDArray[Any], pose: Sequence[float], text: str = "") -> dict[str, Any]:
        """Return the vector as a record; only with a state it is an action.

        Raises
        ------
        InputError
            If the vector has another length or holds what is not finite.
        """
        numbers = np.asarray(vector, np.float64)
        if numbers.shape != (self.width,) or not np.isfinite(numbers).all():
            raise InputError(f"action: a vector of shape {numbers.shape}; give {self.width} finite numbers")
        return {"type": SPACE, "vector": numbers.tolist()}


VectorForm = ActionForm | IncrementForm


def action_form_of(*, robot: bool, width: int, space: str) -> VectorForm:
    """Return how actions of a dataset are read, as its record says."""
    if space == SPACE:
        return IncrementForm(robot, width, space)
    return ActionForm(robot, width, space)
