"""What a robot knows of its own arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.exact import apply_matrix
from vico.kinematics.arm import Chain, hand_pose
from vico.kinematics.limbs import Jaw, Limbs, limbs_of
from vico.quaternions import matrix_of

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

    def limbs(self, opening: float) -> Limbs:
        """Return its body with the fingers so far off the middle, metres."""
        return limbs_of(self.chain, self.radii, jaw=self.jaw, opening=opening)

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
        return cls(pose[:3], matrix_of(pose[3:]))

    def inside(self, points: Array) -> Array:
        """Return points in the frame of the base, shape ``(..., 3)``."""
        return apply_matrix(points - self.position, self.rotation.T)

    def outside(self, points: Array) -> Array:
        """Return points of the base's frame in the world, shape ``(..., 3)``."""
        return apply_matrix(points, self.rotation) + self.position


def metres_apart(a: ArrayLike, b: ArrayLike) -> float:
    """Return how far two points are from each other on the map, whatever their heights, metres."""
    return float(np.hypot(*(np.asarray(a, np.float64)[:2] - np.asarray(b, np.float64)[:2])))
