"""A robot's own body: its arm, where its base stands, driving and joint paths, and what it sees around the base.

`Drive` brings the base to a point on ways of the map, and knows by the robot's own odometry when it is there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import FieldState
from vico.agents.perception import points_from_depth
from vico.exact import apply_matrix
from vico.geometry import distance, distances, rotation_matrix
from vico.kinematics.arm import Chain, CollisionSpheres, Jaw, collision_spheres, hand_pose

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ArmBody:
    """An arm with a parallel jaw on a base that drives and turns.

    Attributes
    ----------
    chain
        Its joints, in the base's frame.
    radii
        Of its links, metres.
    jaw
        At its end.
    posts
        The base: x, y, radius and top of upright cylinders in its frame, metres, shape ``(p, 4)``.
    rest
        Angles with the arm folded, rad, shape ``(7,)``.
    opening
        Way of each finger at most, metres.
    fastest
        Of the joints, rad/s, and the fingers, m/s, shape ``(9,)``.
    stand
        Height of the base's frame above the ground, metres.
    radius
        Of the base on the ground, metres.
    """

    chain: Chain
    radii: Array
    jaw: Jaw
    posts: Array
    rest: Array
    opening: float
    fastest: Array
    stand: float
    radius: float

    def limbs(self, opening: float) -> CollisionSpheres:
        """Return its body with the fingers so far off the middle, metres."""
        return collision_spheres(self.chain, self.radii, jaw=self.jaw, opening=opening)

    def hand(self, angles: Array) -> Array:
        """Return the pose of the middle between the pads in the base's frame, shape ``(3, 4)``."""
        count = len(self.chain.places)
        pose = np.empty((3, 4))
        hand_pose(self.chain, np.ascontiguousarray(angles), np.empty((count, 3)), np.empty((count, 3)), pose)
        return pose


class Stance(NamedTuple):
    """Where a robot's base is, as it feels it: position, ENU metres, and rotation to the world, shape ``(3, 3)``."""

    position: Array
    rotation: Array

    @classmethod
    def of(cls, observation: Mapping[str, Any]) -> Stance:
        """Return it from an observation's odometry."""
        pose = np.asarray(observation["sensors"]["base_pose"], np.float64)
        return cls(pose[:3], rotation_matrix(pose[3:]))

    def inside(self, points: Array) -> Array:
        """Return points in the frame of the base, shape ``(..., 3)``."""
        return apply_matrix(points - self.position, self.rotation.T)

    def outside(self, points: Array) -> Array:
        """Return points of the base's frame in the world, shape ``(..., 3)``."""
        return apply_matrix(points, self.rotation) + self.position


def ground_distance(a: ArrayLike, b: ArrayLike) -> float:
    """Return how far two points are from each other on the map, whatever their heights, metres."""
    return float(np.hypot(*(np.asarray(a, np.float64)[:2] - np.asarray(b, np.float64)[:2])))


# Fewer pixels are no sight of a thing.
_MIN_PIXELS = 6
# Metres round a spot in which points tell its height, and how many there are at least.
_SURFACE_RADIUS, _MIN_SURFACE_POINTS = 0.06, 8
# Points farther away say nothing about what an arm can do, metres.
_MAX_DEPTH = 6.0


class PointView(NamedTuple):
    """One picture, as points.

    Attributes
    ----------
    points
        In the base's frame, metres, shape ``(n, 3)``.
    entity
        What each belongs to, shape ``(n,)``.
    """

    points: Array
    entity: NDArray[np.int64]

    def of(self, entity: int) -> Array:
        """Return the points of one thing, shape ``(m, 3)``."""
        return self.points[self.entity == entity]

    def without(self, *entities: int) -> Array:
        """Return the points of everything else."""
        return self.points[~np.isin(self.entity, entities)]


def view_points(observation: Mapping[str, Any], *, step: int = 1) -> PointView:
    """Return what an observation's depth and segmentation show, near the base.

    Parameters
    ----------
    step
        Use every `step`-th row and column.
    """
    depth = np.where(observation["depth"] < _MAX_DEPTH, observation["depth"], 0.0)
    points, pixels = points_from_depth(depth, observation["intrinsics"], observation["extrinsics"], step=step)
    entity = np.asarray(observation["segmentation"], np.int64).reshape(-1)[pixels]
    return PointView(Stance.of(observation).inside(points), entity)


class ObjectView(NamedTuple):
    """A thing in a picture.

    Attributes
    ----------
    entity
        Its number in segmentation.
    low
        Where it stands: the middle of its points, as low as they are, in the base's frame, metres, shape ``(3,)``.
    """

    entity: int
    low: Array


def object_in_view(observation: Mapping[str, Any], info: Mapping[str, Any], name: str) -> ObjectView | None:
    """Return where a thing of a name is in a picture; None where it is not in view."""
    named = (int(e) for e, about in info["entities"].items() if about.get("name") == name)
    entity = next(named, 0)
    if not entity:
        return None
    points = view_points(observation).of(entity)
    if len(points) < _MIN_PIXELS:
        return None
    return ObjectView(entity, np.array([*np.median(points[:, :2], axis=0), points[:, 2].min()]))


def surface_height(points: Array, spot: Array) -> float:
    """Return how high what was seen round a spot is, in the points' frame; the spot's own height if that is little."""
    near = points[distances(points[:, :2], spot[:2]) < _SURFACE_RADIUS]
    return float(np.median(near[:, 2])) if len(near) >= _MIN_SURFACE_POINTS else float(spot[2])


def free_distance_ahead(body: ArmBody, points: Array) -> float:
    """Return how far the base can go before it comes to one of some points, metres; in its frame, shape ``(n, 3)``."""
    low, high, radius = -body.stand + 0.08, 1.2, body.radius
    in_the_way = (points[:, 2] > low) & (points[:, 2] < high) & (np.abs(points[:, 1]) < radius) & (points[:, 0] > 0.0)
    ahead = points[in_the_way]
    return float((ahead[:, 0] - np.sqrt(radius**2 - ahead[:, 1] ** 2)).min()) if len(ahead) else math.inf


Action = dict[str, Any]

_STANDSTILL = 0.03  # m/s below which a robot stands
_ARRIVAL_TIME = 1.0  # seconds that it stands where it has arrived
_STUCK_TIME = 12.0  # seconds that it stands before a way is asked for anew
#: How often a way is asked for.
DRIVE_TRIES = 3


class Drive(FieldState):
    """Brings a robot near a point: asks for a way, waits, asks anew where nothing moves.

    Parameters
    ----------
    period
        Seconds between two actions.

    Attributes
    ----------
    arrived
        Whether the last way led near its point.
    why
        Why not; "" if it did.
    """

    _goal: Array | None = None
    _near: float = 0.5
    _stops: bool = False
    _tries: int = 0
    _asked: bool = False
    _stood: float = 0.0
    arrived: bool = False
    why: str = ""

    def __init__(self, *, period: float) -> None:
        self._period = period

    @property
    def busy(self) -> bool:
        """Whether it is on its way."""
        return self._goal is not None

    def begin(self, goal: Array, *, near: float = 0.5, stops: bool = False) -> None:
        """Begin to go to a point, ENU metres, or so near to it; it `stops` there, or goes on as far as it can.

        Who stops keeps off a person, or leaves the point itself to somebody else.
        """
        self._goal, self._near, self._stops = np.array(goal, np.float64)[:2], near, stops
        self._tries, self._asked, self._stood = 0, False, 0.0
        self.arrived, self.why = False, ""

    def act(self, observation: Mapping[str, Any]) -> Action:
        """Return the action for the coming period; once it is not `busy` any more, the robot stands."""
        if self._goal is None:
            return {"type": "stop"}
        sensors, state = observation["sensors"], observation["state"]
        position = np.asarray(sensors["base_pose"], np.float64)[:3]
        away = distance(position[:2], self._goal)
        stands = float(np.abs(sensors["base_velocity"][:2]).max()) < _STANDSTILL
        self._stood = self._stood + self._period if stands else 0.0
        refused = self._asked and state["action_status"] == "refused"
        if away <= self._near and (self._stops or self._stood >= _ARRIVAL_TIME or not self._asked):
            return self._end(arrived=True)
        if not self._asked or self._stood >= _STUCK_TIME or refused:
            if self._tries >= DRIVE_TRIES or refused:
                return self._end(arrived=False, why=str(state["action_reason"]) or "stuck on the way")
            self._asked, self._stood = True, 0.0
            self._tries += 1
            return {"type": "go_to", "target": [*self._goal.tolist(), float(position[2])]}
        return {"type": "wait"}

    def _end(self, *, arrived: bool, why: str = "") -> Action:
        self._goal, self.arrived, self.why = None, arrived, why
        return {"type": "stop"}


def follow_joint_path(way: Array, point: int, servos: Array, most: Array) -> int:
    """Bring servos on along a way, in place, as far as a period allows; return which of its points is next.

    Parameters
    ----------
    way
        Angles, shape ``(m, 7)``, of which those before `point` are behind.
    most
        That each may move, rad, shape ``(7,)``.
    """
    left = 1.0
    while left > 1e-9 and point < len(way):
        missing = way[point] - servos
        longest = float(np.max(np.abs(missing) / most))
        share = min(1.0, left / longest) if longest > 0.0 else 1.0
        servos += share * missing
        left -= longest * share
        if share < 1.0:
            break
        point += 1
    return point


class ArmServos:
    """Positions that the servos of an arm and its jaw are told, and the joint path that they are brought along.

    Parameters
    ----------
    body
        The arm.
    period
        Seconds between two actions.

    Attributes
    ----------
    servos
        Told positions of joints and fingers, rad and metres, shape ``(9,)``.
    way, point
        The path, angles of shape ``(m, 7)``, and the index of its next point; None without a path.
    """

    def __init__(self, body: ArmBody, *, period: float) -> None:
        self.body, self.period = body, period
        self.servos = np.concatenate([body.rest, [0.0, 0.0]])
        self.way: Array | None = None
        self.point = 0

    def follow_way(self, angles: Array, *, speed: float, tolerance: float) -> bool:
        """Bring the servos on along the path; return whether the arm is at its end.

        Parameters
        ----------
        angles
            Measured positions of joints and fingers.
        speed
            Share of the fastest that the joints can.
        tolerance
            Distance from the end that counts as there, rad.
        """
        way = self.way
        assert way is not None
        most = self.body.fastest[:7] * self.period * speed
        self.point = follow_joint_path(way, self.point, self.servos[:7], most)
        return self.point >= len(way) and float(np.abs(way[-1] - angles[:7]).max()) < tolerance

    def fingers(self, goal: float) -> bool:
        """Bring the fingers' servos towards metres off the middle; return whether they are told to be there."""
        most = self.body.fastest[7:] * self.period
        self.servos[7:] += np.clip(goal - self.servos[7:], -most, most)
        return bool(np.abs(self.servos[7:] - goal).max() < 1e-9)

    def hold(self, forward: float = 0.0, turn: float = 0.0) -> Action:
        """Return the action that leaves the servos as they are told, with speeds of the base, m/s and rad/s."""
        return {"type": "control", "vector": [*self.servos.tolist(), forward, turn]}


def rotate_aside(spot: Array, away: float) -> Array:
    """Return a spot at the same distance from the base's middle and at the same height, so many metres to the left."""
    radius = max(float(np.hypot(*spot[:2])), abs(away))
    turn = 2.0 * math.asin(away / (2.0 * radius))
    c, s = math.cos(turn), math.sin(turn)
    return np.array([c * spot[0] - s * spot[1], s * spot[0] + c * spot[1], spot[2]])
