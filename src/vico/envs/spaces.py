"""The rich form: observations in Gymnasium's own spaces, and actions as plain numbers for learners.

The spaces, and the observations as elements of them: all that an agent is told, with text in the characters of
`TextSpace`.
"""

from __future__ import annotations

import re
import string
from collections.abc import Mapping, Sequence
from copy import copy
from functools import cache
from typing import Any

import numpy as np
from gymnasium import spaces

from vico.rules import LONGEST_TEXT
from vico.sim.actions import ACTIONS, PEOPLE_ACTIONS
from vico.sim.actions.model import Field
from vico.sim.cameras import USUAL_OUTPUTS, Lens, output_shape
from vico.sim.robots import ActionSpace, Reading

#: Characters that texts of observations hold: ASCII, and the letters of Latin, Greek and Cyrillic script with their
#: marks and punctuation. `Text` keeps each in several tables, so all of Unicode would take seconds and megabytes for
#: each text; `vico.envs.spaces.escape_text` writes others as ``\\u4eac``.
CHARACTERS = "".join(
    ["\t\n", *map(chr, range(0x20, 0x7F)), *map(chr, range(0xA0, 0x0530)), *map(chr, range(0x2010, 0x2030)), "€№→−"]
)
#: Characters of messages that are sampled; in the short form messages may hold any.
_SPOKEN = string.ascii_letters + string.digits + string.punctuation + " "
#: Numbers of times and money, and of entities, are no greater than these.
FAR, MOST_ENTITIES = 1e7, 2**31 - 1
#: Names and ids have so many characters at most.
LONGEST_NAME = 64


class TextSpace(spaces.Text):
    """Gymnasium's `Text`, shown by how many characters there are: all of them are more than a screen."""

    def __repr__(self) -> str:
        return f"Text({self.min_length}, {self.max_length}, {len(self.character_set)} characters)"


def text_space(longest: int) -> spaces.Text:
    """Return the space of texts in observations that are no longer than so many characters."""
    # A copy shares the tables of characters, which take ten milliseconds, but not the stream of chance.
    return copy(_cached_text_space(longest))


@cache
def _cached_text_space(longest: int) -> spaces.Text:
    return TextSpace(longest, min_length=0, charset=CHARACTERS)


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
    message = spaces.Dict(
        {
            "time": _number(0.0, FAR),
            "speaker": text_space(LONGEST_NAME),
            "text": text_space(LONGEST_TEXT),
            "position": _number(-FAR, FAR, 3),
        }
    )
    door = spaces.Dict({"to": text_space(LONGEST_NAME), "position": _number(-FAR, FAR, 3)})
    state = spaces.Dict(
        {
            "time": _number(0.0, FAR),
            "cash": _number(-FAR, FAR),
            "held": spaces.Box(0, MOST_ENTITIES, (2,), np.int64),
            "vehicle": text_space(LONGEST_NAME),
            "building": text_space(LONGEST_NAME),
            "room": text_space(LONGEST_NAME),
            "place": text_space(LONGEST_NAME),
            "accessible_places": spaces.Sequence(text_space(LONGEST_NAME)),
            "doors": spaces.Sequence(door),
            "posture": text_space(LONGEST_NAME),
            "action_status": text_space(LONGEST_NAME),
            "action_code": text_space(LONGEST_NAME),
            "action_reason": text_space(LONGEST_TEXT),
        }
    )
    parts: dict[str, spaces.Space[Any]] = {
        "pose": _number(-FAR, FAR, 6),
        "events": spaces.Sequence(message),
        "state": state,
    }
    if readings is not None:
        boxes: dict[str, spaces.Space[Any]] = {
            name: spaces.Box(r.low, r.high, r.shape, r.dtype) for name, r in readings.items()
        }
        parts["sensors"] = spaces.Dict(boxes)
    if lens is not None:
        parts |= {name: picture_space(name, lens) for name in outputs}
        parts["extrinsics"] = _number(-np.inf, np.inf, 4, 4)
        parts["intrinsics"] = _number(-np.inf, np.inf, 3, 3)
    return spaces.Dict(parts)


def picture_space(output: str, lens: Lens) -> spaces.Box:
    """Return the space of one kind of picture."""
    bounds = {
        "rgb": (0, 255),
        "depth": (0.0, np.inf),
        "segmentation": (0, MOST_ENTITIES),
        "normals": (-1.001, 1.001),
        "flow": (-np.inf, np.inf),
        "semantic": (0, 255),
    }
    low, high = bounds[output]
    shape, kind = output_shape(output, lens)
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
            "text": TextSpace(LONGEST_TEXT, charset=_SPOKEN),
            "where": spaces.Discrete(3),
        }
    )


def robot_space(space: ActionSpace) -> spaces.Dict:
    """Return the space of a robot's actions: vectors of one of its action spaces, in that one's units and bounds."""
    return spaces.Dict({"vector": spaces.Box(space.low.astype(np.float32), space.high.astype(np.float32))})


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


_PLAIN = frozenset(CHARACTERS)
_ESCAPED = re.compile(r"\\U([0-9a-f]{8})|\\u([0-9a-f]{4})")
_NAMES = ("vehicle", "building", "room", "place", "posture", "action_status", "action_code")


def rich_observation(observation: Mapping[str, Any]) -> dict[str, Any]:
    """Return an observation as an element of its `observation_space`.

    Numbers become arrays without axes (float64), ``held`` an array (int64, shape ``(2,)``), points arrays (float64,
    shape ``(3,)``), lists tuples; texts go through `escape_text`. Pictures and sensors stay what they are.
    """
    state = observation["state"]
    told = {
        "time": np.array(state["time"], np.float64),
        "cash": np.array(state["cash"], np.float64),
        "held": np.array(state["held"], np.int64),
        "accessible_places": tuple(escape_text(place, LONGEST_NAME) for place in state["accessible_places"]),
        "doors": tuple(
            {"to": escape_text(door["to"], LONGEST_NAME), "position": np.array(door["position"], np.float64)}
            for door in state["doors"]
        ),
        "action_reason": escape_text(state["action_reason"], LONGEST_TEXT),
    }
    told |= {name: escape_text(state[name], LONGEST_NAME) for name in _NAMES}
    heard = tuple(
        {
            "time": np.array(message["time"], np.float64),
            "speaker": escape_text(message["speaker"], LONGEST_NAME),
            "text": escape_text(message["text"], LONGEST_TEXT),
            "position": np.array(message["position"], np.float64),
        }
        for message in observation["events"]
    )
    return {**observation, "events": heard, "state": told}


def escape_text(text: str, longest: int) -> str:
    """Return a text in the characters that `vico.envs.spaces.CHARACTERS` has, cut off at a length.

    Others are written as Python writes them, ``\\u4eac`` or ``\\U0001f600``; none is cut in two.
    `unescape_text` undoes it.
    """
    if len(text) <= longest and ((text.isascii() and text.isprintable()) or _PLAIN.issuperset(text)):
        return text
    length, parts = 0, []
    for character in text:
        part = character
        if character not in _PLAIN:
            code = ord(character)
            part = f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
        length += len(part)
        if length > longest:
            break
        parts.append(part)
    return "".join(parts)


def unescape_text(text: str) -> str:
    """Return what `escape_text` was given, as far as it was not cut off."""
    return _ESCAPED.sub(lambda found: chr(int(found[1] or found[2], 16)), text)
