"""What agents are told after each step: their own state, what they heard, and what they see."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.rules import ActionStatus, code_name
from vico.sim.bodies import RESIDENT, Bodies
from vico.sim.moves import eye_height
from vico.sim.perception import OUTDOORS, Eyes, InView, in_view, opaque_grid
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Posture, Vehicle

Observation = dict[str, Any]

VEHICLE_NAMES = {Vehicle.NONE: "", Vehicle.BUS: "bus", Vehicle.BIKE: "bike"}


@dataclass(frozen=True)
class Views:
    """Pictures of one step, in the order of the cameras asked for.

    Attributes
    ----------
    rgb
        sRGB, uint8, shape ``(k, h, w, 3)``.
    depth
        Metres along the optical axis, 0 where nothing is hit, float32, shape ``(k, h, w)``.
    segmentation
        Entity ids, 0 where nothing is hit, int32, shape ``(k, h, w)``.
    extrinsics
        World (ENU metres) to camera (x right, y down, z forward), float64, shape ``(k, 4, 4)``.
    intrinsics
        Camera matrix, pixels, the same for all, float64, shape ``(3, 3)``.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]
    extrinsics: NDArray[np.float64]
    intrinsics: NDArray[np.float64]


class ObservationRenderer(Protocol):
    """Renders what agents see; a simulation makes the usual one itself."""

    def render(self, state: SimulationState, poses: NDArray[np.float64], own: NDArray[np.int32]) -> Views:
        """Render one view for each pose in one call.

        Parameters
        ----------
        state
            The state to render.
        poses
            Optical centres (ENU metres) and unit vectors along the optical axes, float64, shape ``(k, 6)``.
        own
            Entity of the body that each view leaves out (the viewer's own), int32, shape ``(k,)``.
        """

    def names(self, entities: Sequence[int]) -> dict[int, dict[str, str]]:
        """Return kind and name of entities that can be seen."""

    def rgb_waiter(self) -> Callable[[], None]:
        """Return what to call, from any thread, to wait for the RGB of the last `render`."""

    def rebind(self, sim: Any) -> ObservationRenderer:
        """Return a renderer of another simulation that keeps as much of the scene as it can."""


def poses(state: SimulationState) -> NDArray[np.float64]:
    """Return every agent's x, y, z (ENU metres) and the unit vector it looks along, float64, shape ``(n, 6)``.

    x, y, z is where the agent stands (feet); the camera is `camera_height` above.
    """
    p = state.people
    facing = np.column_stack([np.cos(p.yaw) * np.cos(p.pitch), np.sin(p.yaw) * np.cos(p.pitch), np.sin(p.pitch)])
    mine = np.column_stack([p.position, facing])
    if state.robots is None:
        return mine
    robots = state.robots.bodies()
    ahead = np.column_stack([np.cos(robots.yaw), np.sin(robots.yaw), np.zeros(len(robots))])
    return np.vstack([mine, np.column_stack([robots.position, ahead])])


def camera_heights(state: SimulationState) -> NDArray[np.float64]:
    """Return the height of every agent's camera above its position, metres."""
    mine = eye_height(state)
    return mine if state.robots is None else np.concatenate([mine, state.robots.camera_heights()])


def observe(
    state: SimulationState,
    seeing: Sequence[int],
    renderer: ObservationRenderer | None,
    *,
    who: Sequence[int] | None = None,
) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
    """Return observations and infos of all agents; those in `seeing` get pictures, rendered in one call.

    Parameters
    ----------
    who
        Indices of the agents that observe; None for all. Those in `seeing` are among them.

    Returns
    -------
    tuple
        Observation by name (``rgb``, ``depth``, ``segmentation``, ``extrinsics``, ``intrinsics`` only for those who
        see; ``sensors`` for robots; ``pose``, ``events``, ``state`` for everybody), and info by name: ``entities``,
        kind and name of what the pictures show, by entity; ``action_code``; for residents ``in_view``, what is in
        view by sight lines (`vico.sim.perception.InView`), the same with and without pictures.
    """
    names = state.names
    stances = poses(state)
    chosen = range(len(names)) if who is None else who
    perceived = look_about(state, stances, chosen)
    found: dict[str, Observation] = {}
    infos: dict[str, dict[str, Any]] = {}
    for i in chosen:
        name = names[i]
        found[name] = {
            "pose": stances[i].copy(),
            "events": [message.record() for message in state.events.heard[name]],
            "state": state_of(i, state),
        }
        if i >= len(state.people) and state.robots is not None:
            found[name]["sensors"] = state.robots.observation(i - len(state.people))
        infos[name] = {"entities": {}, "action_code": found[name]["state"]["action_code"]}
        if i in perceived:
            infos[name]["in_view"] = perceived[i]
    if renderer is None or not len(seeing):
        return found, infos
    order = list(seeing)
    cameras = stances[order].copy()
    cameras[:, 2] += camera_heights(state)[order]
    own = [int(state.people.entity[i]) for i in order if i < len(state.people)]
    if state.robots is not None:
        robots = state.robots.bodies().entity
        own = [
            int(state.people.entity[i]) if i < len(state.people) else int(robots[i - len(state.people)]) for i in order
        ]
    views = renderer.render(state, cameras, np.array(own, np.int32))
    for k, i in enumerate(order):
        found[names[i]] |= {
            "rgb": views.rgb[k],
            "depth": views.depth[k],
            "segmentation": views.segmentation[k],
            "extrinsics": views.extrinsics[k],
            "intrinsics": views.intrinsics,
        }
        seen = _distinct(views.segmentation[k])
        infos[names[i]]["entities"] = renderer.names(seen)
    return found, infos


def look_about(state: SimulationState, stances: NDArray[np.float64], who: Sequence[int]) -> dict[int, InView]:
    """Return what those residents have in view that are in `who`, by index; `stances` as from `poses`."""
    p, indoor = state.people, state.indoor
    residents = np.array([i for i in who if i < len(p) and p.kind[i] == RESIDENT], np.int64)
    if not len(residents):
        return {}
    feet, mine = stances[residents], _spaces(state)
    eyes = Eyes(
        feet[:, :3] + np.column_stack([np.zeros((len(residents), 2)), eye_height(state)[residents]]),
        p.yaw[residents],
        p.entity[residents],
        mine[residents],
    )
    others = [owner.bodies() for owner in (state.traffic, state.transit, state.robots) if owner is not None]
    bodies = Bodies.joined([p.bodies_of(np.arange(len(p))), *others])
    spaces = np.concatenate([mine, np.full(len(bodies) - len(p), OUTDOORS)])
    found = dict(
        zip(residents.tolist(), in_view(eyes, bodies, spaces, opaque_grid(state.world), state.entities), strict=True)
    )
    for i, view in found.items():
        if (room := int(p.room[i])) >= 0:
            view.room = indoor.boxes[room]
            view.furniture = indoor.furniture[indoor.furniture_start[room] : indoor.furniture_start[room + 1]]
    return found


def _spaces(state: SimulationState) -> NDArray[np.int64]:
    """Return in which space each avatar is, as `Eyes.space`: outdoors, its room, or its bus."""
    p = state.people
    spaces = np.where(p.room >= 0, p.room, OUTDOORS).astype(np.int64)
    in_bus = p.vehicle == Vehicle.BUS
    spaces[in_bus] = len(state.indoor.rooms) + p.vehicle_entity[in_bus]
    return spaces


def _distinct(image: NDArray[np.int32]) -> list[int]:
    flat = image.ravel()
    # Neighbouring pixels mostly show the same thing: look at the changes only.
    change = np.flatnonzero(flat[1:] != flat[:-1])
    values = np.unique(np.append(flat[change], flat[-1]))
    return [int(v) for v in values if v > 0]


def state_of(i: int, state: SimulationState) -> dict[str, Any]:
    """Return the state part of an agent's observation; empty strings and 0 stand for "none".

    ``doors`` lists the ways out of the room one is in (empty outdoors); ``posture`` is standing, sitting or lying.
    """
    common: Mapping[str, Any] = {"time": float(state.second)}
    p = state.people
    if i >= len(p):
        assert state.robots is not None
        robots, k = state.robots, i - len(p)
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
            "action_status": ActionStatus(int(robots.action_status[k])).name.lower(),
            "action_code": code_name(int(robots.reason_code[k])),
            "action_reason": str(robots.reason[k]),
        }
    room = state.indoor.rooms[p.room[i]] if p.room[i] >= 0 else None
    place = state.world.places[p.place[i]] if p.place[i] >= 0 else None
    return {
        **common,
        "cash": round(float(p.cash[i]), 2),
        "held": [int(p.held[i, 0]), int(p.held[i, 1])],
        "vehicle": VEHICLE_NAMES[Vehicle(int(p.vehicle[i]))],
        "building": room.building if room else "",
        "room": room.id if room else "",
        "place": place.id if place else "",
        "accessible_places": state.accessible_places(i),
        "doors": state.doors_of(i),
        "posture": Posture(int(p.posture[i])).name.lower(),
        "action_status": ActionStatus(int(p.status[i])).name.lower(),
        "action_code": code_name(int(p.reason_code[i])),
        "action_reason": str(p.reason[i]),
    }


def facing_of(yaw: float, pitch: float) -> tuple[float, float, float]:
    """Return the unit vector of a gaze, ENU; radians."""
    return math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)
