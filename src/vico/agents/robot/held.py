"""A thing in the jaw: how it lies there, how the hand brings it to a spot, where it is held out to somebody."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody, Stance
from vico.agents.robot.grasps import ThingBox
from vico.kinematics.limbs import Limbs, with_held

Array = NDArray[np.float64]

_CLEAR = 0.06  # metres that pads are long below their middle, and more
_THERE = 0.03  # metres that a hand may miss the end of its way by
# Metres before a person, and above the ground, that things are held out to them.
_ARM_LENGTH, _HELD_OUT = 0.5, 0.75
_BALL = 0.018  # metres: radius of the balls that a held thing is made of


class Held(NamedTuple):
    """A thing in the jaw.

    Attributes
    ----------
    points
        All over it, in the frame of the last joint, metres, shape ``(m, 3)``.
    below, above
        From the middle between the pads down to its underside, and how much of it is beside the pads, metres.
    opening
        Of each finger, metres.
    rotation
        Of the hand as it closed, in the base's frame, shape ``(3, 3)``: turned about the vertical alone, the thing
        stands as it stood.
    middle
        From the hand to the thing's middle as it closed, level, in the base's frame, metres, shape ``(2,)``.
    """

    points: Array
    below: float
    above: float
    opening: float
    rotation: Array
    middle: Array

    def on(self, limbs: Limbs) -> Limbs:
        """Return limbs with the thing."""
        return with_held(limbs, self.points, _BALL)

    def turned(self, turn: float) -> Array:
        """Return the rotation of the hand with the thing turned about the vertical, rad, shape ``(3, 3)``."""
        return _about_vertical(turn) @ self.rotation

    def pose_over(self, spot: Array, turn: float) -> Array:
        """Return the pose of the hand with which the middle of the thing's underside is at a spot."""
        off = _about_vertical(turn) @ np.array([*self.middle, -self.below])
        return np.column_stack([self.turned(turn), spot - off])


def came_off(body: ArmBody, now: Array, there: Array, held: Held) -> bool:
    """Return whether an open hand went so far from where it let go that its fingers are off what it put down."""
    gone = body.hand(now)[:, 3] - body.hand(there)[:, 3]
    return float(np.linalg.norm(gone)) > held.above - _THERE


def held_out_at(person: Array, stance: Stance) -> Array:
    """Return where a thing is held out to somebody who stands at a point, before them, ENU metres."""
    away = stance.position[:2] - person[:2]
    return person + np.array([*(away / max(float(np.hypot(*away)), 1e-6) * _ARM_LENGTH), _HELD_OUT])


def held_thing(body: ArmBody, angles: Array, box: ThingBox, opening: float) -> Held:
    """Return what a hand holds.

    Parameters
    ----------
    angles
        Of the arm as it closed.
    box
        Round the thing as it stood then.
    opening
        Of each finger since, metres.
    """
    pose = body.hand(angles)
    joint = pose[:, 3] - body.chain.grip * pose[:, 2]
    points = (box.points(_BALL, 3.0 * _BALL) - joint) @ pose[:, :3]
    return Held(
        points,
        float(pose[2, 3] - box.low),
        float(max(box.high - pose[2, 3], 0.0)) + _CLEAR,
        opening,
        pose[:, :3].copy(),
        box.centre - pose[:2, 3],
    )


def _about_vertical(turn: float) -> Array:
    c, s = math.cos(turn), math.sin(turn)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
