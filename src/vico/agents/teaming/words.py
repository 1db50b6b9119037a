"""What robots and people of a team say to each other: plain sentences that anybody could say."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.requester import CALL_DISTANCE
from vico.agents.talk.address import is_called

Array = NDArray[np.float64]

#: Names of the robots begin so.
ROBOTS = "robot_"
_NUMBER = r"(-?\d+(?:\.\d+)?)"
_LIES = re.compile(rf"^The (.+) lies at {_NUMBER} {_NUMBER}\.$")
#: What a robot says that has been told where the thing lies.
ON_MY_WAY = "I am on my way there."


def caller_of(observation: Mapping[str, Any], name: str) -> str:
    """Return which robot near by has called somebody by name since the last observation; "" for none."""
    x, y = observation["pose"][:2]
    for message in observation["events"]:
        speaker = str(message.get("speaker", ""))
        near = speaker.startswith(ROBOTS) and (
            math.hypot(message["position"][0] - x, message["position"][1] - y) <= CALL_DISTANCE
        )
        if near and is_called(name, str(message["text"])):
            return speaker
    return ""


def heard_from(observation: Mapping[str, Any], speaker: str) -> list[tuple[str, Array]]:
    """Return what one has said since the last observation, in order, and from where, ENU metres."""
    return [
        (str(event["text"]), np.asarray(event["position"], np.float64))
        for event in observation["events"]
        if event.get("speaker") == speaker and "text" in event
    ]


def says_lies(thing: str, at: Array) -> str:
    """Return the sentence that tells where a thing lies, ENU metres."""
    return f"The {thing} lies at {at[0]:.2f} {at[1]:.2f}."


def told_lies(text: str, thing: str) -> Array | None:
    """Return where a thing lies by a sentence, ENU metres, shape ``(2,)``; None of any other sentence."""
    found = _LIES.match(text)
    if found is None or found[1] != thing:
        return None
    return np.array([float(found[2]), float(found[3])])
