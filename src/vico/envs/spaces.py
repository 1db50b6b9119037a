"""Spaces: what an observation looks like, and actions as plain numbers for learners.

Actions may be given in two forms. The short one names the action and its fields, as in
``{"type": "move_forward", "distance": 1.0}``. The other is an element of `action_space`: ``type`` is the action's
number in `vico.sim.actions.PEOPLE_ACTIONS`, and every slot is there, whether the action uses it or not. Which slot each
field of an action is read from stands in the table of actions, `vico.sim.actions.ACTIONS`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from vico.rules import LONGEST_TEXT
from vico.sim.actions import ACTIONS, PEOPLE_ACTIONS
from vico.sim.actions.fields import Field
from vico.sim.eyes import USUAL_OUTPUTS, Lens, shape_of
from vico.sim.robots import ActionSpace, Reading

_PHRASES = ("Hello!", "Good morning.", "Excuse me.", "Thank you.", "See you later.", "Do you need help?")


class TextSpace(spaces.Space[str]):
    """Text in any script, up to a length; samples are everyday phrases."""

    def __init__(self, longest: int, *, seed: int | None = None) -> None:
        super().__init__(dtype=str, seed=seed)
        self.longest = longest

    def sample(self, mask: Any = None, probability: Any = None) -> str:
        """Return one of a few phrases."""
        return _PHRASES[int(self.np_random.integers(len(_PHRASES)))]

    def contains(self, x: Any) -> bool:
        """Whether `x` is text that is not too long."""
        return isinstance(x, str) and len(x) <= self.longest

    @property
    def is_np_flattenable(self) -> bool:
        """Text does not flatten to numbers."""
        return False

    def __repr__(self) -> str:
        return f"TextSpace({self.longest})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TextSpace) and other.longest == self.longest

    __hash__ = None  # type: ignore[assignment]


class ListSpace(spaces.Space[list[Any]]):
    """Lists of any length whose elements belong to one space; samples hold up to three."""

    def __init__(self, element: spaces.Space[Any], *, seed: int | None = None) -> None:
        super().__init__(seed=seed)
        self.element = element

    def sample(self, mask: Any = None, probability: Any = None) -> list[Any]:
        """Return up to three samples of the element's space."""
        return [self.element.sample() for _ in range(int(self.np_random.integers(4)))]

    def contains(self, x: Any) -> bool:
        """Whether `x` is a list of elements of the space."""
        return isinstance(x, list) and all(self.element.contains(part) for part in x)

    @property
    def is_np_flattenable(self) -> bool:
        """Lists of any length do not flatten."""
        return False

    def __repr__(self) -> str:
        return f"ListSpace({self.element})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ListSpace) and other.element == self.element

    __hash__ = None  # type: ignore[assignment]


class NumberSpace(spaces.Space[float]):
    """A plain Python number within bounds."""

    def __init__(self, low: float, high: float, *, whole: bool = False, seed: int | None = None) -> None:
        super().__init__(seed=seed)
        self.low, self.high, self.whole = low, high, whole

    def sample(self, mask: Any = None, probability: Any = None) -> float:
        """Return a number, uniform between the bounds (or within a thousand of the lower one, where it is far)."""
        value = float(self.np_random.uniform(self.low, min(self.high, self.low + 1000.0)))
        return int(value) if self.whole else value

    def contains(self, x: Any) -> bool:
        """Whether `x` is a number within the bounds."""
        good = isinstance(x, int) if self.whole else isinstance(x, (int, float))
        return good and not isinstance(x, bool) and self.low <= x <= self.high

    @property
    def is_np_flattenable(self) -> bool:
        """These stay plain numbers."""
        return False

    def __repr__(self) -> str:
        return f"NumberSpace({self.low}, {self.high})"

    def __eq__(self, other: object) -> bool:
        mine = (self.low, self.high, self.whole)
        return isinstance(other, NumberSpace) and (other.low, other.high, other.whole) == mine

    __hash__ = None  # type: ignore[assignment]


def _number(low: float, high: float, *shape: int, dtype: Any = np.float64) -> spaces.Box:
    return spaces.Box(low, high, shape, dtype)


def observation_space(
    lens: Lens | None, readings: Mapping[str, Reading] | None = None, *, outputs: Sequence[str] = USUAL_OUTPUTS
) -> spaces.Dict:
    """Return the space of an agent's observations.

    Parameters
    ----------
    lens
        Of its pictures; None: it is given none.
    readings
        What a robot's sensors give; None for people.
    outputs
        What its pictures show.
    """
    far, entity = 1e7, 2**31 - 1
    point = ListSpace(NumberSpace(-far, far))
    message = spaces.Dict(
        {
            "time": NumberSpace(0.0, far),
            "speaker": TextSpace(64),
            "text": TextSpace(LONGEST_TEXT),
            "position": point,
        }
    )
    state = spaces.Dict(
        {
            "time": NumberSpace(0.0, far),
            "cash": NumberSpace(-far, far),
            "held": ListSpace(NumberSpace(0, entity, whole=True)),
            "vehicle": TextSpace(16),
            "building": TextSpace(64),
            "room": TextSpace(64),
            "place": TextSpace(64),
            "accessible_places": ListSpace(TextSpace(64)),
            "doors": ListSpace(spaces.Dict({"to": TextSpace(64), "position": point})),
            "posture": TextSpace(16),
            "action_status": TextSpace(16),
            "action_code": TextSpace(32),
            "action_reason": TextSpace(1000),
        }
    )
    parts: dict[str, spaces.Space[Any]] = {
        "pose": _number(-far, far, 6),
        "events": ListSpace(message),
        "state": state,
    }
    if readings is not None:
        parts["sensors"] = sensor_space(readings)
    if lens is not None:
        parts |= {name: _picture(name, lens, entity) for name in outputs}
        parts["extrinsics"] = _number(-np.inf, np.inf, 4, 4)
        parts["intrinsics"] = _number(-np.inf, np.inf, 3, 3)
    return spaces.Dict(parts)


def _picture(output: str, lens: Lens, entity: int) -> spaces.Box:
    """Return the space of one kind of picture; entities are numbers up to `entity`."""
    bounds = {
        "rgb": (0, 255),
        "depth": (0.0, np.inf),
        "segmentation": (0, entity),
        "normals": (-1.001, 1.001),
        "flow": (-np.inf, np.inf),
        "semantic": (0, 255),
    }
    low, high = bounds[output]
    shape, kind = shape_of(output, lens)
    return spaces.Box(low, high, shape, kind)


#: Values of ``where`` in a learner's action: where a thing is put down.
WHERE_AHEAD, WHERE_ENTITY, WHERE_POINT = range(3)


def action_space(places: int, people: int, half: float) -> spaces.Dict:
    """Return the space of an avatar's actions: the number of the action, and every field an action may have.

    ``where`` says where `put` puts a thing: on the ground ahead (0), on what ``entity`` names (1), at ``target`` (2).

    Parameters
    ----------
    places, people
        How many there are: `place` (the world's places, then its rooms) and `agent` are indices.
    half
        Half the side of the world, metres: bounds `target`.
    """
    return spaces.Dict(
        {
            "type": spaces.Discrete(len(PEOPLE_ACTIONS)),
            "amount": _number(0.0, 1.0, dtype=np.float32),
            "target": _number(-half, half, 3, dtype=np.float32),
            "hand": spaces.Discrete(2),
            "entity": spaces.Discrete(2**31 - 1),
            "agent": spaces.Discrete(max(1, people)),
            "place": spaces.Discrete(max(1, places)),
            "index": spaces.Discrete(64),
            "text": TextSpace(LONGEST_TEXT),
            "where": spaces.Discrete(3),
        }
    )


def robot_space(space: ActionSpace) -> spaces.Dict:
    """Return the space of a robot's actions: vectors of one of its action spaces, in that one's units and bounds."""
    return spaces.Dict({"vector": spaces.Box(space.low.astype(np.float32), space.high.astype(np.float32))})


def sensor_space(readings: Mapping[str, Reading]) -> spaces.Dict:
    """Return the space of what a robot feels of itself."""
    return spaces.Dict({name: spaces.Box(r.low, r.high, r.shape, r.dtype) for name, r in readings.items()})


def short_form(action: Any, places: Sequence[str], people: Sequence[str]) -> Any:
    """Translate an element of `action_space` into the short form; anything else is passed on as it is.

    `amount` is a share of the field's `scale`: of 2.5 m for a move, of 180 degrees for a turn, of 10 m for a message.
    """
    if not isinstance(action, Mapping):
        return action
    if "type" not in action:
        vector = action.get("vector")
        return {"type": "control", "vector": vector} if vector is not None else action
    if isinstance(action["type"], str):
        return action
    try:
        kind = PEOPLE_ACTIONS[int(action["type"])]
        fields = ACTIONS[kind].fields.items()
        values = {name: _read(field, action, places, people) for name, field in fields if field.slot}
        return {"type": kind} | {name: value for name, value in values.items() if value is not None}
    except (KeyError, IndexError, TypeError, ValueError):
        # It is refused where all actions are judged, with the reason.
        return action


def _read(field: Field, action: Mapping[str, Any], places: Sequence[str], people: Sequence[str]) -> Any:
    """Read a field of an action from its slot of the learner's action."""
    assert field.slot is not None
    raw = action[field.slot]
    if field.slot == "amount":
        value = float(np.asarray(raw, np.float64).reshape(-1)[0]) * field.scale
        return value if field.least is None else max(field.least, value)
    if field.slot == "target":
        return _point(raw)
    if field.slot == "where":
        where = int(raw)
        if where == WHERE_POINT:
            return _point(action["target"])
        return int(action["entity"]) if where == WHERE_ENTITY else None
    if field.slot == "text":
        return raw
    number = int(raw)
    return {"place": places, "agent": people}[field.slot][number] if field.slot in ("place", "agent") else number


def _point(raw: Any) -> list[float]:
    return [float(value) for value in np.asarray(raw, np.float64)]
