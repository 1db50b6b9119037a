"""Where to take hold of a thing, by the points that were seen of it: from above, and from the side."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody
from vico.kinematics.limbs import box_points
from vico.kinematics.ways import downward

Array = NDArray[np.float64]

#: Metres that the jaw is wider than a thing, on each side; that the hand comes from; that the pads are deep.
ROOM, BACK, PADS = 0.02, 0.13, 0.035
# Tilts of a hand from above, and how far one from the side looks down, rad.
_TILTS, _SLANTS = (0.0, 0.25, -0.25, 0.5, -0.5), (0.35, 0.0, 0.8)
# A thing this high is taken from the side, too, metres; cosine of the angle off the way from the base.
_TALL, _ASIDE = 0.14, 0.5
# Above this a hand cannot come from above, in the base's frame, metres.
_TOO_HIGH = 0.75
# Fewer points do not tell a thing's size; of the rest so many at each end are left out as strays.
_FEWEST, _STRAYS = 12, 0.01
# Fingers keep off what a thing stands on, metres.
_OFF = 0.012


class ThingBox(NamedTuple):
    """The least upright box round a thing's points, in the base's frame.

    Attributes
    ----------
    centre
        Its middle on the ground plane, metres, shape ``(2,)``.
    axes
        Directions of its sides, shape ``(2, 2)``, one a row.
    half
        Half its sides, the shorter first, metres, shape ``(2,)``.
    low, high
        Its bottom and top, metres.
    """

    centre: Array
    axes: Array
    half: Array
    low: float
    high: float

    def points(self, inset: float, spacing: float) -> Array:
        """Return points all over its faces, in the base's frame, shape ``(m, 3)``."""
        half = np.maximum(np.array([*self.half, (self.high - self.low) / 2]) - inset, 1e-3)
        found = box_points(half, spacing)
        level = found[:, :2] @ self.axes + self.centre
        return np.column_stack([level, found[:, 2] + (self.low + self.high) / 2])


class Grasp(NamedTuple):
    """A way to take hold of a thing.

    Attributes
    ----------
    pose
        Of the middle between the pads in the base's frame, shape ``(3, 4)``.
    opening
        Of each finger off the middle, metres.
    back
        From the pose to where the hand comes from, metres, shape ``(3,)``.
    """

    pose: Array
    opening: float
    back: Array

    @property
    def before(self) -> Array:
        """Pose from which the hand goes straight there."""
        pose = self.pose.copy()
        pose[:, 3] += self.back
        return pose


def thing_box(points: Array) -> ThingBox | None:
    """Return the box round a thing's points; None if there are too few."""
    if len(points) < _FEWEST:
        return None
    low, high = np.quantile(points[:, 2], [_STRAYS, 1.0 - _STRAYS])
    best: tuple[float, Array, Array, Array] | None = None
    for turn in np.radians(np.arange(0.0, 90.0, 3.0)):
        axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        along = points[:, :2] @ axes.T
        ends = np.quantile(along, [_STRAYS, 1.0 - _STRAYS], axis=0)
        size = ends[1] - ends[0]
        area = float(size[0] * size[1])
        if best is None or area < best[0] - 1e-6:
            best = area, axes, (ends[0] + ends[1]) / 2 @ axes, size / 2
    assert best is not None
    _, axes, centre, half = best
    order = np.argsort(half, kind="stable")
    return ThingBox(centre, axes[order], half[order], float(low), float(high))


def grasps_of(box: ThingBox, body: ArmBody) -> list[Grasp]:
    """Return ways to take hold of a thing, those that hold best first; none if it is too wide for the jaw."""
    above, side = _from_above(box, body), _from_the_side(box, body)
    return side + above if box.high > _TOO_HIGH else above + side


def _from_above(box: ThingBox, body: ArmBody) -> list[Grasp]:
    # The pads hold the upper part of what is high, and do not touch the ground beside what is low.
    grip = max(box.high - 0.06, box.low + PADS + _OFF)
    found: list[Grasp] = []
    for axis in (0, 1):
        opening = float(box.half[axis]) + ROOM
        if opening > body.opening:
            break
        at, along = np.array([*box.centre, grip]), box.axes[axis]
        for tilt in _TILTS:
            for sign in (1.0, -1.0):
                found.append(Grasp(downward(at, along * sign, tilt), opening, np.array([0.0, 0.0, BACK])))
    return found


def _from_the_side(box: ThingBox, body: ArmBody) -> list[Grasp]:
    if box.high - box.low < _TALL:
        return []
    away = box.centre / max(float(np.hypot(*box.centre)), 1e-6)
    found: list[Grasp] = []
    grip = max((box.low + box.high) / 2, box.low + 0.09)
    for axis in (0, 1):
        # Pads lie flat on two faces: what is held by its edges turns, and slips.
        across, opening = box.axes[axis], float(box.half[axis]) + ROOM
        ahead = np.array([across[1], -across[0]])
        ahead = ahead if ahead @ away > 0.0 else -ahead
        if opening > body.opening or float(ahead @ away) < _ASIDE:
            continue
        # The pads reach into what is deep, not through it.
        deep = float(np.abs(box.axes @ ahead) @ box.half)
        at = np.array([*(box.centre - ahead * max(deep - 0.05, 0.0)), grip])
        for slant in _SLANTS:
            z = np.array([*(ahead * math.cos(slant)), -math.sin(slant)])
            for sign in (1.0, -1.0):
                y = np.array([*(across * sign), 0.0])
                pose = np.column_stack([np.cross(y, z), y, z, at])
                found.append(Grasp(pose, opening, -z * BACK))
    return found
