"""What agents are told after each step: their own state, what they heard, and what they see."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.sim.moves import eye_height
from vico.sim.stage import Stage
from vico.sim.state import Posture, Status, Vehicle

Observation = dict[str, Any]

VEHICLE_NAMES = {Vehicle.NONE: "", Vehicle.BUS: "bus", Vehicle.BIKE: "bike"}


@dataclass(frozen=True)
class Views:
    """Pictures of one step, in the order of the agents asked for.

    Attributes
    ----------
    rgb, depth, segmentation
        Shapes ``(k, h, w, 3)`` uint8, ``(k, h, w)`` float32 metres, ``(k, h, w)`` int32 entities.
    extrinsics, intrinsics
        World to camera, ``(k, 4, 4)``; camera matrix, ``(3, 3)``.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]
    extrinsics: NDArray[np.float64]
    intrinsics: NDArray[np.float64]


class Eyes(Protocol):
    """Whoever can render views: takes poses ``(k, 6)`` and the entities whose bodies stay out of each."""

    def look(self, stage: Stage, poses: NDArray[np.float64], own: NDArray[np.int32]) -> Views:
        """Render one view a pose, in one call."""

    def names(self, entities: Sequence[int]) -> dict[int, dict[str, str]]:
        """Kind and name of entities that can be seen."""

    def under_way(self) -> Callable[[], None]:
        """What to call, from any thread, to wait for the colours of the last look."""

    def moved_to(self, sim: Any) -> Eyes:
        """The same for another simulation, with as much of the scene as can be kept."""


def poses(stage: Stage) -> NDArray[np.float64]:
    """Eyes of every agent: x, y, z and the unit vector they look along, float64, shape ``(n, 6)``.

    x, y, z is where the agent stands (feet); the camera is `camera_height` above.
    """
    p = stage.people
    facing = np.column_stack([np.cos(p.yaw) * np.cos(p.pitch), np.sin(p.yaw) * np.cos(p.pitch), np.sin(p.pitch)])
    mine = np.column_stack([p.position, facing])
    if stage.robots is None:
        return mine
    robots = stage.robots.bodies()
    ahead = np.column_stack([np.cos(robots.yaw), np.sin(robots.yaw), np.zeros(len(robots))])
    return np.vstack([mine, np.column_stack([robots.position, ahead])])


def camera_heights(stage: Stage) -> NDArray[np.float64]:
    """Height of every agent's camera above its position, metres."""
    mine = eye_height(stage)
    return mine if stage.robots is None else np.concatenate([mine, stage.robots.camera_heights()])


def observe(
    stage: Stage, seeing: Sequence[int], eyes: Eyes | None
) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
    """Observations and infos of all agents; those in `seeing` get pictures, rendered in one call.

    Returns
    -------
    tuple
        Observation by name (``rgb``, ``depth``, ``segmentation``, ``extrinsics``, ``intrinsics`` only for those who
        see; ``pose``, ``events``, ``state`` for everybody), and info by name (``entities``: kind and name of what is
        in view, by entity).
    """
    names = stage.names
    stances = poses(stage)
    found: dict[str, Observation] = {}
    infos: dict[str, dict[str, Any]] = {}
    for i, name in enumerate(names):
        found[name] = {
            "pose": stances[i].copy(),
            "events": [message.record() for message in stage.events.heard[name]],
            "state": state_of(i, stage),
        }
        infos[name] = {"entities": {}}
    if eyes is None or not len(seeing):
        return found, infos
    order = list(seeing)
    cameras = stances[order].copy()
    cameras[:, 2] += camera_heights(stage)[order]
    own = [int(stage.people.entity[i]) for i in order if i < len(stage.people)]
    if stage.robots is not None:
        robots = stage.robots.bodies().entity
        own = [
            int(stage.people.entity[i]) if i < len(stage.people) else int(robots[i - len(stage.people)]) for i in order
        ]
    views = eyes.look(stage, cameras, np.array(own, np.int32))
    for k, i in enumerate(order):
        found[names[i]] |= {
            "rgb": views.rgb[k],
            "depth": views.depth[k],
            "segmentation": views.segmentation[k],
            "extrinsics": views.extrinsics[k],
            "intrinsics": views.intrinsics,
        }
        seen = _distinct(views.segmentation[k])
        infos[names[i]]["entities"] = eyes.names(seen)
    return found, infos


def _distinct(image: NDArray[np.int32]) -> list[int]:
    flat = image.ravel()
    # Neighbouring pixels mostly show the same thing: look at the changes only.
    change = np.flatnonzero(flat[1:] != flat[:-1])
    values = np.unique(np.append(flat[change], flat[-1]))
    return [int(v) for v in values if v > 0]


def state_of(i: int, stage: Stage) -> dict[str, Any]:
    """The state part of an agent's observation; empty strings and 0 stand for "none".

    ``doors`` lists the ways out of the room one is in (empty outdoors); ``posture`` is standing, sitting or lying.
    """
    common: Mapping[str, Any] = {"time": float(stage.second)}
    p = stage.people
    if i >= len(p):
        assert stage.robots is not None
        reason = stage.robots.reasons[i - len(p)]
        return {
            **common,
            "cash": 0.0,
            "held": [0, 0],
            "vehicle": "",
            "building": "",
            "room": "",
            "place": "",
            "accessible_places": [],
            "doors": [],
            "posture": "standing",
            "action_status": "refused" if reason else "ok",
            "action_reason": reason,
        }
    room = stage.indoor.rooms[p.room[i]] if p.room[i] >= 0 else None
    place = stage.world.places[p.place[i]] if p.place[i] >= 0 else None
    return {
        **common,
        "cash": round(float(p.cash[i]), 2),
        "held": [int(p.held[i, 0]), int(p.held[i, 1])],
        "vehicle": VEHICLE_NAMES[Vehicle(int(p.vehicle[i]))],
        "building": room.building if room else "",
        "room": room.id if room else "",
        "place": place.id if place else "",
        "accessible_places": stage.accessible_places(i),
        "doors": stage.doors_of(i),
        "posture": Posture(int(p.posture[i])).name.lower(),
        "action_status": Status(int(p.status[i])).name.lower(),
        "action_reason": str(p.reason[i]),
    }


def facing_of(yaw: float, pitch: float) -> tuple[float, float, float]:
    """Unit vector of a gaze."""
    return math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)
