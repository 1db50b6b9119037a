"""An arm's body as balls on its links: what has to stay clear of everything on the way."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.kinematics.arm import Chain, joint_origin, joint_turn

Array = NDArray[np.float64]


class Limbs(NamedTuple):
    """Balls that cover an arm.

    Attributes
    ----------
    link
        Joint that moves each, int64, shape ``(n,)``; they are in order.
    centre
        In that joint's frame, metres, shape ``(n, 3)``.
    radius
        Metres, shape ``(n,)``.
    """

    link: NDArray[np.int64]
    centre: Array
    radius: Array


class Jaw(NamedTuple):
    """Size of a parallel jaw, metres, in the frame of the last joint: it opens along y, its pads lie along z.

    Attributes
    ----------
    palm
        Half its width, and how far it is from the joint.
    pads
        From where to where the fingers reach.
    thickness
        Radius of balls that cover palm and fingers.
    """

    palm: tuple[float, float] = (0.17, 0.045)
    pads: tuple[float, float] = (0.06, 0.19)
    thickness: float = 0.028


def limbs_of(chain: Chain, radii: Array, *, jaw: Jaw, opening: float) -> Limbs:
    """Cover an arm with balls.

    Parameters
    ----------
    radii
        Of each link, metres, shape ``(n,)``.
    jaw
        At its end.
    opening
        Of each finger off the middle, metres.
    """
    found: list[tuple[int, Array, float]] = []
    count = len(chain.places)
    for k in range(count - 1):
        end, radius = chain.places[k + 1], float(radii[k])
        found += [(k, point, radius) for point in _along(np.zeros(3), end, radius)]
    wide, at = jaw.palm
    reach = wide - jaw.thickness
    balls = _along(np.array([0.0, -reach, at]), np.array([0.0, reach, at]), jaw.thickness)
    for side in (-1.0, 1.0):
        finger = [np.array([0.0, side * (opening + jaw.thickness * 0.5), z]) for z in jaw.pads]
        balls += _along(finger[0], finger[1] - np.array([0.0, 0.0, jaw.thickness]), jaw.thickness)
    found += [(count - 1, point, jaw.thickness) for point in balls]
    return _limbs(found)


def with_held(limbs: Limbs, points: Array, radius: float) -> Limbs:
    """Return limbs with a held thing on the last link.

    Parameters
    ----------
    points
        All over the thing, in the frame of the last joint, metres, shape ``(m, 3)``.
    radius
        Of the balls there, metres.
    """
    last = int(limbs.link[-1])
    return Limbs(
        np.concatenate([limbs.link, np.full(len(points), last)]),
        np.concatenate([limbs.centre, points]),
        np.concatenate([limbs.radius, np.full(len(points), radius)]),
    )


def box_points(half: Array, spacing: float) -> Array:
    """Return points on the faces of a box about the origin, no farther apart than told, shape ``(m, 3)``."""
    counts = np.maximum(np.ceil(2.0 * half / spacing).astype(int), 1)
    steps = [np.linspace(-half[k], half[k], counts[k] + 1) for k in range(3)]
    points = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    return points[(np.abs(np.abs(points) - half) < 1e-9).any(axis=1)]


def _along(start: Array, end: Array, radius: float) -> list[Array]:
    """Return points on a line, no farther apart than balls of a radius cover well."""
    count = max(math.ceil(float(np.linalg.norm(end - start)) / (1.2 * radius)), 1)
    return [start + (end - start) * k / count for k in range(count + 1)]


def _limbs(found: list[tuple[int, Array, float]]) -> Limbs:
    found.sort(key=lambda one: one[0])
    return Limbs(
        np.array([one[0] for one in found], np.int64),
        np.array([one[1] for one in found]),
        np.array([one[2] for one in found]),
    )


@compiled
def ball_places(chain, limbs, angles, out):  # type: ignore[no-untyped-def]
    """Write where an arm's balls are in the base's frame, metres, shape ``(n, 3)``."""
    r = np.eye(3)
    p = np.zeros(3)
    ball = 0
    for k in range(len(angles)):
        joint_origin(chain, k, r, p)
        joint_turn(chain, k, angles[k], r)
        while ball < len(limbs.link) and limbs.link[ball] == k:
            for i in range(3):
                out[ball, i] = (
                    p[i]
                    + r[i, 0] * limbs.centre[ball, 0]
                    + r[i, 1] * limbs.centre[ball, 1]
                    + r[i, 2] * limbs.centre[ball, 2]
                )
            ball += 1
