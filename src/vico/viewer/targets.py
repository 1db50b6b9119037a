"""Who or what a camera follows: people, robots, things and traffic, by name."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError, some_of
from vico.quaternions import matrix_of
from vico.sim.bodies.arrays import Bodies
from vico.sim.bodies.state_arrays import MovableObjects, Vehicle
from vico.sim.people.placement import eye_height
from vico.sim.state.simulation_state import SimulationState

#: Who is farther from where they were a moment ago was not seen on the way, metres.
LEAP = 4.0
_AROUND = 9.0  # metres in which others are looked at


class Target(NamedTuple):
    """Somebody who is followed.

    Attributes
    ----------
    position
        Where it stands, ENU metres.
    yaw, pitch
        Where it looks, radians.
    eye
        Height of its eyes or camera, metres.
    entity
        Its body.
    size
        Its largest extent, metres.
    room
        Index of the room it is in, -1 for none.
    riding
        A `Vehicle`.
    others
        The highest points of the others near by, ENU metres, shape ``(k, 3)``; None for nobody.
    """

    position: NDArray[np.float64]
    yaw: float
    pitch: float
    eye: float
    entity: int
    size: float = 1.75
    room: int = -1
    riding: int = Vehicle.NONE
    others: NDArray[np.float64] | None = None


def target_of(state: SimulationState, name: str) -> Target:
    """Return how somebody stands, a thing lies, or a vehicle is: ``resident_3``, ``Ann Lee``, ``red mug``, ``car 3``.

    Raises
    ------
    InputError
        If nobody has that name.
    """
    if name in state.objects.names:
        return _target_of_thing(state.objects, state.objects.names.index(name))
    known = state.entities.values()
    name = next((one["agent"] for one in known if one["name"] == name and "agent" in one), name)
    if name not in state.names:
        return _target_in_traffic(state, name)
    i = state.names.index(name)
    people = state.people
    if i < len(people):
        return Target(
            people.position[i].copy(),
            float(people.yaw[i]),
            float(people.pitch[i]),
            float(eye_height(state)[i]),
            int(people.entity[i]),
            float(people.height[i]),
            int(people.room[i]),
            int(people.vehicle[i]),
            _others(state, people.position[i], int(people.entity[i])) if people.vehicle[i] == Vehicle.NONE else None,
        )
    assert state.robots is not None
    k = i - len(people)
    return _target_of_body(state.robots.bodies(), k, float(state.robots.camera_heights()[k]))


def _others(state: SimulationState, position: NDArray[np.float64], entity: int) -> NDArray[np.float64]:
    """Return the highest points of the bodies within some metres of somebody, shape ``(k, 3)``."""
    bodies = state.obstacles()
    near = np.abs(bodies.position[:, :2] - position[:2]).max(axis=1) < _AROUND
    near &= (bodies.entity != entity) & (np.abs(bodies.position[:, 2] - position[2]) < 3.0)
    return bodies.position[near] + np.column_stack([np.zeros((int(near.sum()), 2)), bodies.height[near]])


def _target_of_thing(things: MovableObjects, k: int) -> Target:
    """Return how a thing lies; it faces along its x axis."""
    ahead = matrix_of(things.orientation[k])[:, 0]
    size = things.size[k]
    return Target(
        things.position[k].copy(),
        math.atan2(float(ahead[1]), float(ahead[0])),
        0.0,
        0.6 * float(size[2]),
        int(things.entity[k]),
        float(size.max()),
        int(things.room[k]),
    )


def _target_in_traffic(state: SimulationState, name: str) -> Target:
    entity = next((entity for entity, known in state.entities.items() if known["name"] == name), None)
    for owner in state.owners():
        bodies = owner.bodies()
        found: list[int] = np.flatnonzero(bodies.entity == entity).tolist() if entity is not None else []
        if found:
            return _target_of_body(bodies, found[0], 0.85 * float(bodies.height[found[0]]))
    raise InputError(
        f"follow: nobody is called {name!r}, or is not there now; there are {some_of(state.names)}, and traffic, "
        "such as 'car 0'"
    )


def _target_of_body(bodies: Bodies, k: int, eye: float) -> Target:
    size = 2.0 * max(float(bodies.half_length[k]), float(bodies.half_width[k]), 0.5 * float(bodies.height[k]))
    return Target(bodies.position[k].copy(), float(bodies.yaw[k]), 0.0, eye, int(bodies.entity[k]), size)


def target_between(a: Target, b: Target, share: float) -> Target:
    """Return somebody part of the way from one moment to the next; who leapt stays until then."""
    if share >= 1.0:
        return b
    if a.room != b.room or float(np.linalg.norm(b.position - a.position)) > LEAP:
        return a
    turn = math.remainder(b.yaw - a.yaw, 2 * math.pi)
    return a._replace(
        position=a.position + share * (b.position - a.position),
        yaw=a.yaw + share * turn,
        pitch=a.pitch + share * (b.pitch - a.pitch),
        eye=a.eye + share * (b.eye - a.eye),
    )
