"""A thing in the jaw: how it lies there, how the hand brings it to a spot, where it is held out to somebody."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody, Stance
from vico.agents.robot.grasps import ThingBox, thing_box
from vico.exact import apply_matrix, product
from vico.kinematics.limbs import Limbs, with_held

Array = NDArray[np.float64]

_CLEAR = 0.06  # metres that pads are long below their middle, and more
_THERE = 0.03  # metres that a hand may miss the end of its way by
# Metres before a person, and above the ground, that things are held out to them.
_ARM_LENGTH, _HELD_OUT = 0.5, 0.75
_BALL = 0.018  # metres: radius of the balls that a held thing is made of
# Half the width of what is slender, as a share of its height; fewer points are no look; farther off, metres, its middle
# is not where it was taken to be, but the thing another one.
_SLENDER, _GLANCE, _SHIFTED = 0.2, 40, 0.2


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
    half
        Half its sides on the ground, the shorter first, metres, shape ``(2,)``.
    heading
        Of its longer side as the hand closed, in the base's frame, rad.
    """

    points: Array
    below: float
    above: float
    opening: float
    rotation: Array
    middle: Array
    half: Array
    heading: float

    @property
    def slender(self) -> bool:
        """Whether it tips over where what it stands on drives: high for how wide it is."""
        return is_slender(float(self.half[0]), self.below + self.above - _CLEAR)

    def on(self, limbs: Limbs) -> Limbs:
        """Return limbs with the thing."""
        return with_held(limbs, self.points, _BALL)

    def box(self) -> ThingBox:
        """Return the box round it, seen from between the pads, along the base as the hand closed."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        axes = np.array([[-s, c], [c, s]])
        return ThingBox(self.middle, axes, self.half, -self.below, self.above - _CLEAR)

    def turned(self, turn: float) -> Array:
        """Return the rotation of the hand with the thing turned about the vertical, rad, shape ``(3, 3)``."""
        return product(_about_vertical(turn), self.rotation)

    def pose_over(self, spot: Array, turn: float) -> Array:
        """Return the pose of the hand with which the middle of the thing's underside is at a spot."""
        off = apply_matrix(np.array([*self.middle, -self.below]), _about_vertical(turn))
        return np.column_stack([self.turned(turn), spot - off])


def is_slender(half: float, height: float) -> bool:
    """Return whether what is so wide, half of it, and so high, metres, tips over where what it stands on drives."""
    return half < _SLENDER * height


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
    low, high = box.low - float(pose[2, 3]), box.high - float(pose[2, 3])
    return _held(body, pose[:, :3].copy(), box._replace(centre=box.centre - pose[:2, 3], low=low, high=high), opening)


def seen_in_hand(body: ArmBody, angles: Array, held: Held, points: Array) -> Held:
    """Return what a hand holds, after another look at it: where one face of it was seen, others come into view.

    Parameters
    ----------
    angles
        Of the arm now, rad.
    points
        Of the thing, in the base's frame, metres, shape ``(n, 3)``.
    """
    pose = body.hand(angles)
    # As it stood when the hand closed, seen from the hand.
    stood = apply_matrix(apply_matrix(points - pose[:, 3], pose[:, :3].T), held.rotation)
    known = held.box()
    box = thing_box(np.vstack([stood, known.points(0.0, _BALL)]))
    if len(points) < _GLANCE or box is None or float(np.abs(box.centre - known.centre).max()) > _SHIFTED:
        return held
    return _held(body, held.rotation, box._replace(low=min(box.low, known.low)), held.opening)


def _held(body: ArmBody, rotation: Array, box: ThingBox, opening: float) -> Held:
    """Return a thing in the jaw by the box round it, seen from between the pads, along the base as the hand closed."""
    points = apply_matrix(box.points(_BALL, 3.0 * _BALL), rotation.T) + np.array([0.0, 0.0, body.chain.grip])
    heading = math.atan2(float(box.axes[1, 1]), float(box.axes[1, 0]))
    above = max(box.high, 0.0) + _CLEAR
    return Held(points, -box.low, above, opening, rotation, box.centre.copy(), box.half.copy(), heading)


def _about_vertical(turn: float) -> Array:
    c, s = math.cos(turn), math.sin(turn)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
