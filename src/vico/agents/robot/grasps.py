"""Where to take hold of a thing, by the points that were seen of it: from above, and from the side."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody
from vico.exact import apply_matrix, dot
from vico.kinematics.limbs import box_points
from vico.kinematics.ways import downward

Array = NDArray[np.float64]

#: Metres that the jaw is wider than a thing, on each side; that the hand comes from; that the pads are deep.
ROOM, BACK, PADS = 0.02, 0.13, 0.035
# Tilts of a hand from above, and how far one from the side looks down, rad.
_TILTS, _SLANTS = (0.0, 0.25, -0.25, 0.5, -0.5), (0.35, 0.0, 0.8)
# A thing this high is taken from the side, too, metres; cosine of the angle off the way from the base.
_TALL, _ASIDE = 0.14, 0.5
# Share of the largest width within reach of pads that counts as that.
_AS_WIDE = 0.95
# From its top the pads' middle is so deep, from and to, metres: below that the palm touches it.
_SHALLOW, _DEEP = 0.06, 0.1
# Above this a hand cannot come from above, in the base's frame, metres.
_TOO_HIGH = 0.75
# Fewer points do not tell a thing's size; of the rest so many at each end are left out as strays.
_FEWEST, _STRAYS = 12, 0.01
# Fingers keep off what a thing stands on, metres.
_OFF = 0.012
# The jaw is so much wider, metres, where it closes towards whoever looks: the far side of a thing is hidden.
_HIDDEN = 0.015
# Half the width of a pad; widths are compared so close to each other, metres; share of the largest that is as wide.
_PAD_WIDE, _BIN, _WIDE = 0.05, 0.015, 0.85


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
        level = apply_matrix(found[:, :2], self.axes.T) + self.centre
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
        along = apply_matrix(points[:, :2], axes)
        ends = np.quantile(along, [_STRAYS, 1.0 - _STRAYS], axis=0)
        size = ends[1] - ends[0]
        area = float(size[0] * size[1])
        if best is None or area < best[0] - 1e-6:
            best = area, axes, apply_matrix((ends[0] + ends[1]) / 2, axes.T), size / 2
    assert best is not None
    _, axes, centre, half = best
    order = np.argsort(half, kind="stable")
    return ThingBox(centre, axes[order], half[order], float(low), float(high))


def grasps_of(box: ThingBox, body: ArmBody, points: Array | None = None) -> list[Grasp]:
    """Return ways to take hold of a thing, those that hold best first; none if it is too wide for the jaw.

    Parameters
    ----------
    points
        Of the thing, that the box is round: where it is wide, the pads hold it; None for anywhere in the box.
    """
    seen = np.zeros((0, 3)) if points is None else points
    above, side = _from_above(box, body, seen), _from_the_side(box, body, seen)
    return side + above if box.high > _TOO_HIGH else above + side


def _from_above(box: ThingBox, body: ArmBody, seen: Array) -> list[Grasp]:
    # The pads hold the upper part of what is high, and do not touch the ground beside what is low.
    grip = max(_grip_height(box, seen), box.low + PADS + _OFF)
    found: list[Grasp] = []
    for axis in sorted((0, 1), key=lambda axis: _opening(box, axis)):
        opening = _opening(box, axis)
        if float(box.half[axis]) + ROOM > body.opening:
            continue
        across, along = box.axes[axis], box.axes[1 - axis]
        first, last = _wide_part(box, seen, axis, low=grip - PADS)
        room = min(_PAD_WIDE, (last - first) / 2)
        # In the middle of that part is most of what it weighs: held off it, a long thing swings in the jaw.
        level = box.centre + along * min(max((first + last) / 2, first + room), last - room)
        for tilt in _TILTS:
            for sign in (1.0, -1.0):
                pose = downward(np.array([*level, grip]), across * sign, tilt)
                found.append(Grasp(pose, min(opening, body.opening), np.array([0.0, 0.0, BACK])))
    return found


def _from_the_side(box: ThingBox, body: ArmBody, seen: Array) -> list[Grasp]:
    if box.high - box.low < _TALL:
        return []
    away = box.centre / max(float(np.hypot(*box.centre)), 1e-6)
    found: list[Grasp] = []
    grip = max((box.low + box.high) / 2, box.low + 0.09)
    for axis in (0, 1):
        # Pads lie flat on two faces: what is held by its edges turns, and slips.
        across, opening = box.axes[axis], float(box.half[axis]) + ROOM
        ahead = box.axes[1 - axis]
        ahead = ahead if dot(ahead, away) > 0.0 else -ahead
        if opening > body.opening or float(dot(ahead, away)) < _ASIDE:
            continue
        # The pads reach into what is deep, not through it.
        first, last = _wide_part(box, seen, axis, low=grip - PADS, high=grip + PADS)
        near = first if dot(ahead, box.axes[1 - axis]) > 0.0 else -last
        at = np.array([*(box.centre + ahead * min(near + 0.05, 0.5 * (last - first) + near)), grip])
        for slant in _SLANTS:
            z = np.array([*(ahead * math.cos(slant)), -math.sin(slant)])
            for sign in (1.0, -1.0):
                y = np.array([*(across * sign), 0.0])
                pose = np.column_stack([np.cross(y, z), y, z, at])
                found.append(Grasp(pose, opening, -z * BACK))
    return found


def _opening(box: ThingBox, axis: int) -> float:
    """Return how far each finger is off the middle before it closes: more where the thing's far side is hidden."""
    away = box.centre / max(float(np.hypot(*box.centre)), 1e-6)
    return float(box.half[axis]) + ROOM + _HIDDEN * abs(float(dot(box.axes[axis], away)))


def _grip_height(box: ThingBox, seen: Array) -> float:
    """Return how high the pads' middle is from above: as high as the thing is about as wide as anywhere in reach.

    A bottle is held below its neck, a bag below its handles.
    """
    heights = np.arange(_SHALLOW, _DEEP + 1e-9, 0.01)
    widths = np.zeros(len(heights))
    for k, height in enumerate((box.high - heights).tolist()):
        slice_ = seen[np.abs(seen[:, 2] - height) < _BIN]
        if len(slice_) >= _FEWEST:
            widths[k] = float(np.ptp(apply_matrix(slice_[:, :2], box.axes), axis=0).max())
    wide = np.flatnonzero(widths >= _AS_WIDE * widths.max())
    return float(box.high - heights[wide[0]])


def _wide_part(box: ThingBox, seen: Array, axis: int, *, low: float, high: float = math.inf) -> tuple[float, float]:
    """Return from where to where a thing is about as wide across an axis as anywhere, along the other one.

    A can has a spout, and a handle: its pads belong on neither.

    Parameters
    ----------
    low, high
        Heights between which its points count, metres.
    """
    whole = -float(box.half[1 - axis]), float(box.half[1 - axis])
    points = seen[(seen[:, 2] >= low) & (seen[:, 2] <= high)]
    # Where no top is seen, two sides say nothing of what is between them.
    if len(points) < _FEWEST or box.high > _TOO_HIGH:
        return whole
    across, along = (dot(points[:, :2] - box.centre, box.axes[k]) for k in (axis, 1 - axis))
    count = max(math.ceil((whole[1] - whole[0]) / _BIN), 1)
    bins = np.clip(((along - whole[0]) / _BIN).astype(int), 0, count - 1)
    least, most = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(least, bins, across)
    np.maximum.at(most, bins, across)
    width = np.maximum(most - least, 0.0)
    wide = np.flatnonzero(width >= _WIDE * width.max())
    return whole[0] + _BIN * float(wide[0]), min(whole[0] + _BIN * float(wide[-1] + 1), whole[1])
