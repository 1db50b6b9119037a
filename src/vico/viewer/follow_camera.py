"""A camera that follows a person, a robot, a thing or a vehicle: smoothly, and never from within a wall.

A `Target` is who or what is followed at a moment, found by name. `FollowCamera` moves from frame to frame and keeps a
free line of sight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vico.errors import InputError, some_of
from vico.geometry import distances, rotation_matrix
from vico.render.cameras import Cameras
from vico.render.frames import PictureRequest, take_pictures
from vico.render.scene import Scene
from vico.sim.bodies.arrays import Bodies
from vico.sim.bodies.state_arrays import MovableObjects, Vehicle
from vico.sim.people.placement import eye_height
from vico.sim.state.simulation_state import SimulationState
from vico.world.model import Record

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
    ahead = rotation_matrix(things.orientation[k])[:, 0]
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


View = Literal["behind", "front", "eyes", "above", "side", "orbit", "close"]
VIEWS: tuple[View, ...] = get_args(View)

# Where the camera is from what it looks at: metres back along the heading, degrees round it (0 is behind), degrees up,
# and so many in rooms: over clothes racks, counters and beds.
_PLACES = {
    "behind": (3.6, 0.0, 16.0, 40.0),
    "front": (4.0, 165.0, 5.0, 36.0),
    "side": (3.6, 80.0, 8.0, 40.0),
    "above": (15.0, 0.0, 62.0, 62.0),
    "orbit": (4.5, 0.0, 15.0, 38.0),
    "close": (2.6, 105.0, 18.0, 30.0),
}
_ORBIT_SPEED = math.radians(14.0)  # a second
# How far back for those who ride, as a multiple.
_RIDING = {Vehicle.NONE: 1.0, Vehicle.BIKE: 1.3, Vehicle.BUS: 3.6}
_FOV, _EYES_FOV = math.radians(42.0), math.radians(60.0)
# Seconds in which the camera makes up for two thirds of a change.
_TURNS = 0.55
_SHIFTS = 0.12
_WIDENS = 0.9
_NARROWS = 0.12
_ASIDE = tuple(math.radians(k) for k in (0, 35, -35, 70, -70, 110, -110, 150, -150, 180))
_SWING = 1.0  # radians a second at most
_RIM = 0.25  # metres to whatever is behind the camera
# Who comes near makes the camera rise.
_RISES = 2.6  # from this distance on, metres
_RISEN = 1.2  # at this distance it has risen, metres
_ABOVE = 0.4  # them, metres
_LIFTS = 0.3  # seconds, as above
_NEAREST = 0.45


class Angle(Record):
    """From where something is looked at.

    Attributes
    ----------
    away
        Metres from it, whatever its size.
    around
        Degrees round it: 0 is behind, 90 to its right.
    up
        Degrees above the horizon.
    ahead_of
        Name of an agent: degrees round are counted as if what is followed looked away from it; else from where that
        looks. A thing in a hand is seen from beside the arm so, however it is turned.
    """

    away: Annotated[float, Field(ge=0.3, le=200.0)]
    around: float = 0.0
    up: Annotated[float, Field(ge=-20.0, le=89.0)] = 15.0
    ahead_of: str = ""


@dataclass
class FollowCamera:
    """Follows a target from frame to frame.

    Attributes
    ----------
    view
        One of `VIEWS`.
    width, height
        Of the pictures, pixels.
    angle
        From where it looks, if not as the view has it.
    """

    view: str
    width: int
    height: int
    angle: Angle | None = None
    _heading: float = 0.0
    _pitch: float = 0.0
    _focus: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    _distance: float = 0.0
    _angle: float = 0.0
    _aside: float = 0.0
    _lift: float = 0.0
    _place: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    _room: int = -2

    def __post_init__(self) -> None:
        if self.view not in VIEWS:
            raise InputError(f"view: {self.view!r}; it has to be one of {', '.join(VIEWS)}")

    def look(self, scene: Scene, target: Target, dt: float) -> Cameras:
        """Return the camera of the next frame, `dt` seconds after the last one."""
        focus = target.position + np.array([0.0, 0.0, target.eye if self.view == "eyes" else 0.82 * target.eye])
        # At first, and through a door, it is simply there.
        cut = self._room != target.room or float(np.linalg.norm(focus - self._focus)) > LEAP
        self._room = target.room
        if cut:
            self._heading, self._pitch, self._focus = target.yaw, target.pitch, focus
        else:
            turn = math.remainder(target.yaw - self._heading, 2 * math.pi)
            swing = _part(dt, 0.18 if self.view == "eyes" else _TURNS) * turn
            # From outside it swings round slowly: walls come near as fast as it turns towards them.
            self._heading += swing if self.view == "eyes" else float(np.clip(swing, -_SWING * dt, _SWING * dt))
            self._pitch += _part(dt, _TURNS) * (target.pitch - self._pitch)
            # On foot the eye is steady; aboard it goes with the vehicle.
            self._focus = self._focus + _part(dt, _SHIFTS if target.riding == Vehicle.NONE else 1e-6) * (
                focus - self._focus
            )
        if self.view == "eyes":
            across = math.cos(self._pitch)
            ahead = np.array(
                [math.cos(self._heading) * across, math.sin(self._heading) * across, math.sin(self._pitch)]
            )
            return self._cameras(self._focus, ahead, _EYES_FOV, target.entity)
        return self._from_outside(scene, target, dt, cut=cut)

    def _from_outside(self, scene: Scene, target: Target, dt: float, *, cut: bool) -> Cameras:
        wanted, around, up = self._place_from(target)
        if self.view == "orbit":
            self._angle += dt * _ORBIT_SPEED
        turn = self._heading + math.pi + math.radians(around) + self._angle
        aside = self._roomiest(scene, turn, math.radians(up), wanted)
        self._aside = aside if cut else self._aside + _part(dt, _TURNS) * math.remainder(aside - self._aside, math.tau)
        back = _direction(turn + self._aside, math.radians(up))
        lift = self._over(target.others, self._focus + wanted * back if cut else self._place, wanted) - math.radians(up)
        self._lift = max(lift, 0.0) if cut else self._lift + _part(dt, _LIFTS) * (max(lift, 0.0) - self._lift)
        back = _direction(turn + self._aside, math.radians(up) + self._lift)
        free = max(min(wanted, self._free(scene, back, wanted)), _NEAREST)
        if cut:
            self._distance = free
        else:
            self._distance += _part(dt, _NARROWS if free < self._distance else _WIDENS) * (free - self._distance)
            self._distance = min(self._distance, max(free, _NEAREST))
        place = self._place = self._focus + self._distance * back
        # Near a wall, it looks over the shoulder.
        near = max(0.0, 1.0 - self._distance / 1.5)
        ahead = -back * (1.0 - near) + near * np.array([math.cos(self._heading), math.sin(self._heading), -0.1])
        hidden = target.entity if self._distance < min(0.7, target.size) else 0
        return self._cameras(place, ahead, _FOV, hidden)

    def _place_from(self, target: Target) -> tuple[float, float, float]:
        """Return how far away from what it follows the camera would like to be, metres, and where, degrees."""
        if self.angle is not None:
            return self.angle.away, self.angle.around, self.angle.up
        away, around, outdoors, indoors = _PLACES[self.view]
        size = _RIDING[Vehicle(target.riding)] * float(np.clip(target.size / 1.75, 0.5, 4.0))
        return away * size, around, indoors if target.room >= 0 else outdoors

    def _over(self, others: NDArray[np.float64] | None, place: NDArray[np.float64], wanted: float) -> float:
        """Return how steeply the camera has to look down, radians, to be above those who come near it."""
        if others is None or not len(others):
            return 0.0
        away = distances(others[:, :2], place[:2])
        share = np.clip((_RISES - away) / (_RISES - _RISEN), 0.0, 1.0)
        height = float((share * (others[:, 2] + _ABOVE - self._focus[2])).max())
        return math.asin(min(max(height / wanted, 0.0), 0.9))

    def _roomiest(self, scene: Scene, turn: float, rise: float, wanted: float) -> float:
        """Return how far to the side of where it would like to be the camera has some room: not at all, if it has."""
        enough = min(0.45 * wanted, 1.7)
        straight = self._free(scene, _direction(turn, rise), wanted)
        # It goes back only where there is plenty of room, and else stays where it is as long as that will do.
        if straight >= (enough if abs(self._aside) < 0.02 else 1.6 * enough):
            return 0.0
        if abs(self._aside) >= 0.02 and self._free(scene, _direction(turn + self._aside, rise), wanted) >= enough:
            return self._aside
        found = {s: self._free(scene, _direction(turn + s, rise), wanted) for s in _ASIDE}
        return max(_ASIDE, key=lambda s: min(found[s], 2.0 * enough) - 0.25 * enough * abs(s))

    def _free(self, scene: Scene, back: NDArray[np.float64], wanted: float) -> float:
        """Return how far one can go back from the focus before anything that never moves, metres."""
        cone = Cameras(self._focus[None], back[None], fov_y=math.radians(24.0), width=24, height=24, far=wanted + 5.0)
        request = PictureRequest(rgb=False, segmentation=False, moving=False)
        depth = take_pictures(scene, cone, request, threads=1).depth[0]
        seen = depth[depth > 0]
        return float(seen.min()) - _RIM if len(seen) else wanted

    def _cameras(self, place: NDArray[np.float64], ahead: NDArray[np.float64], fov: float, hidden: int) -> Cameras:
        return Cameras(
            place[None], ahead[None], fov_y=fov, width=self.width, height=self.height, near=0.1, hidden_entity=hidden
        )


def _direction(turn: float, rise: float) -> NDArray[np.float64]:
    return np.array([math.cos(turn) * math.cos(rise), math.sin(turn) * math.cos(rise), math.sin(rise)])


def _part(dt: float, constant: float) -> float:
    """Return the share of a change that is made up for in `dt` seconds."""
    return 1.0 - math.exp(-dt / constant)
