"""Vectors of what an agent knows of itself and of its task: the same from a live observation and from a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.rules import ActionStatus

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
