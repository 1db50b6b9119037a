"""The rich form of observations: all that an agent is told, as elements of the spaces in `vico.envs.spaces`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from vico.envs.spaces import CHARACTERS, LONGEST_NAME
from vico.rules import LONGEST_TEXT

_PLAIN = frozenset(CHARACTERS)
_ESCAPED = re.compile(r"\\U([0-9a-f]{8})|\\u([0-9a-f]{4})")
_NAMES = ("vehicle", "building", "room", "place", "posture", "action_status", "action_code")


def rich_observation(observation: Mapping[str, Any]) -> dict[str, Any]:
    """Return an observation as an element of its `observation_space`.

    Numbers become arrays without axes (float64), ``held`` an array (int64, shape ``(2,)``), points arrays (float64,
    shape ``(3,)``), lists tuples; texts go through `told_text`. Pictures and sensors stay what they are.
    """
    state = observation["state"]
    told = {
        "time": np.array(state["time"], np.float64),
        "cash": np.array(state["cash"], np.float64),
        "held": np.array(state["held"], np.int64),
        "accessible_places": tuple(told_text(place, LONGEST_NAME) for place in state["accessible_places"]),
        "doors": tuple(
            {"to": told_text(door["to"], LONGEST_NAME), "position": np.array(door["position"], np.float64)}
            for door in state["doors"]
        ),
        "action_reason": told_text(state["action_reason"], LONGEST_TEXT),
    }
    told |= {name: told_text(state[name], LONGEST_NAME) for name in _NAMES}
    heard = tuple(
        {
            "time": np.array(message["time"], np.float64),
            "speaker": told_text(message["speaker"], LONGEST_NAME),
            "text": told_text(message["text"], LONGEST_TEXT),
            "position": np.array(message["position"], np.float64),
        }
        for message in observation["events"]
    )
    return {**observation, "events": heard, "state": told}


def told_text(text: str, longest: int) -> str:
    """Return a text in the characters that `vico.envs.spaces.CHARACTERS` has, cut off at a length.

    Others are written as Python writes them, ``\\u4eac`` or ``\\U0001f600``; none is cut in two.
    `text_as_said` undoes it.
    """
    if len(text) <= longest and ((text.isascii() and text.isprintable()) or _PLAIN.issuperset(text)):
        return text
    length, parts = 0, []
    for character in text:
        part = character if character in _PLAIN else _escaped(character)
        length += len(part)
        if length > longest:
            break
        parts.append(part)
    return "".join(parts)


def text_as_said(text: str) -> str:
    """Return what `told_text` was given, as far as it was not cut off."""
    return _ESCAPED.sub(lambda found: chr(int(found[1] or found[2], 16)), text)


def _escaped(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
