"""Skills that robots of a team share: turning to a point, finding a person in view, messages, and waiting.

Messages are plain sentences that anybody could say.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, FieldState, Info, Observation
from vico.agents.perception import Sighting, sightings
from vico.agents.requester import CALL_DISTANCE, ROBOT_PREFIX
from vico.agents.robot.body import Stance
from vico.agents.talk.acquaintance import is_called
from vico.geometry import wrap_angle

Array = NDArray[np.float64]

# Radians off which one looks towards a point; turning, a second for each radian that is missing.
_FACING_TOLERANCE, _TURN_GAIN = 0.25, 1.5


def bearing(here: Stance, point: Array) -> float:
    """Return how far to the left of a robot's heading a point lies, radians."""
    yaw = math.atan2(here.rotation[1, 0], here.rotation[0, 0])
    return wrap_angle(math.atan2(point[1] - here.position[1], point[0] - here.position[0]) - yaw)


def turn_towards(here: Stance, point: Array, *, fastest: float) -> Action | None:
    """Return the action that turns a robot on legs or wheels towards a point; None once it faces it.

    Parameters
    ----------
    fastest
        Radians a second.
    """
    error = bearing(here, point)
    if abs(error) <= _FACING_TOLERANCE:
        return None
    return turn(min(max(_TURN_GAIN * error, -fastest), fastest))


def turn(speed: float) -> Action:
    """Return the action that turns a robot on legs or wheels on the spot, radians a second to the left."""
    return {"type": "control", "space": "velocity", "vector": [0.0, 0.0, speed]}


def find_in_view(
    observation: Mapping[str, Any], info: Mapping[str, Any], name: str, *, least: int = 4
) -> Sighting | None:
    """Return what a robot sees of somebody or something by name, with so many pixels at least; None if nothing."""
    entities = info.get("entities", {})
    if "segmentation" not in observation or not any(about.get("name") == name for about in entities.values()):
        return None
    seen = sightings(observation, entities)
    return next((one for one in seen if one.name == name and one.pixels >= least), None)


def ground_distance(a: Any, b: Any) -> float:
    """Metres between two points over the ground."""
    return float(np.hypot(*(np.asarray(a, np.float64)[:2] - np.asarray(b, np.float64)[:2])))


_NUMBER = r"(-?\d+(?:\.\d+)?)"
_LOCATION_PATTERN = re.compile(rf"^The (.+) lies at {_NUMBER} {_NUMBER}\.$")
#: What a robot says that has been told where the thing lies.
ON_MY_WAY = "I am on my way there."


def caller_of(observation: Mapping[str, Any], name: str) -> str:
    """Return which robot near by has called somebody by name since the last observation; "" for none."""
    x, y = observation["pose"][:2]
    for message in observation["events"]:
        speaker = str(message.get("speaker", ""))
        near = speaker.startswith(ROBOT_PREFIX) and (
            math.hypot(message["position"][0] - x, message["position"][1] - y) <= CALL_DISTANCE
        )
        if near and is_called(name, str(message["text"])):
            return speaker
    return ""


def messages_from(observation: Mapping[str, Any], speaker: str) -> list[tuple[str, Array]]:
    """Return what one has said since the last observation, in order, and from where, ENU metres."""
    return [
        (str(event["text"]), np.asarray(event["position"], np.float64))
        for event in observation["events"]
        if event.get("speaker") == speaker and "text" in event
    ]


def object_location_message(thing: str, at: Array) -> str:
    """Return the sentence that tells where a thing lies, ENU metres."""
    return f"The {thing} lies at {at[0]:.2f} {at[1]:.2f}."


def parse_object_location(text: str, thing: str) -> Array | None:
    """Return where a thing lies by a sentence, ENU metres, shape ``(2,)``; None of any other sentence."""
    found = _LOCATION_PATTERN.match(text)
    if found is None or found[1] != thing:
        return None
    return np.array([float(found[2]), float(found[3])])


class IdleRobot(FieldState):
    """Stays where it is."""

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at its pictures: never."""
        return False

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        return {"type": "wait"}
