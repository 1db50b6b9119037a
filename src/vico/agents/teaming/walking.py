"""What robots of a team share: turning towards a point, and looking for somebody or something."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, wrapped
from vico.agents.perception import Sighting, sightings
from vico.agents.robot.body import Stance

Array = NDArray[np.float64]

# Radians off which one looks towards a point; turning, a second for each radian that is missing.
_FACES, _TURN_GAIN = 0.25, 1.5


def bearing(here: Stance, point: Array) -> float:
    """Return how far to the left of a robot's heading a point lies, radians."""
    yaw = math.atan2(here.rotation[1, 0], here.rotation[0, 0])
    return wrapped(math.atan2(point[1] - here.position[1], point[0] - here.position[0]) - yaw)


def turn_towards(here: Stance, point: Array, *, fastest: float) -> Action | None:
    """Return the action that turns a robot on legs or wheels towards a point; None once it faces it.

    Parameters
    ----------
    fastest
        Radians a second.
    """
    error = bearing(here, point)
    if abs(error) <= _FACES:
        return None
    return turn(min(max(_TURN_GAIN * error, -fastest), fastest))


def turn(speed: float) -> Action:
    """Return the action that turns a robot on legs or wheels on the spot, radians a second to the left."""
    return {"type": "control", "space": "velocity", "vector": [0.0, 0.0, speed]}


def sight_of(observation: Mapping[str, Any], info: Mapping[str, Any], name: str, *, least: int = 4) -> Sighting | None:
    """Return what a robot sees of somebody or something by name, with so many pixels at least; None if nothing."""
    entities = info.get("entities", {})
    if "segmentation" not in observation or not any(about.get("name") == name for about in entities.values()):
        return None
    seen = sightings(observation, entities)
    return next((one for one in seen if one.name == name and one.pixels >= least), None)


def apart(a: Any, b: Any) -> float:
    """Metres between two points over the ground."""
    return float(np.hypot(*(np.asarray(a, np.float64)[:2] - np.asarray(b, np.float64)[:2])))
