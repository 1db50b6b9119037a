"""Objects as an arm sees them: the box round an object, grasps of it, the object in the jaw, and its tracked pose.

Grasps are from above and from the side, by the points that were seen. `HeldObject` says how an object lies in the jaw,
how the hand brings it to a spot, and where it is held out to somebody. `ObjectTracker` says where an object is, picture
by picture: what learned policies are told instead of what a planner looks up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import AgentState
from vico.agents.robot.body import ArmBody, Stance, view_points
from vico.exact import apply_matrix, dot, product
from vico.kinematics.arm import CollisionSpheres, box_points, with_held_object
from vico.kinematics.hand_paths import downward

Array = NDArray[np.float64]

#: Metres that the jaw is wider than a thing, on each side.
JAW_ROOM = 0.02
#: Metres that the hand comes from.
APPROACH_LENGTH = 0.13
#: Metres that the pads are deep.
PAD_DEPTH = 0.035
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
_PAD_WIDE = 0.05  # half the width of a pad, metres
_BIN = 0.015  # metres of the slices in which widths are taken
_WIDE = 0.85  # share of the largest width that is as wide


class ObjectBox(NamedTuple):
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


def object_box(points: Array) -> ObjectBox | None:
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
    return ObjectBox(centre, axes[order], half[order], float(low), float(high))


def candidate_grasps(box: ObjectBox, body: ArmBody, points: Array | None = None) -> list[Grasp]:
    """Return ways to take hold of a thing, those that hold best first; none if it is too wide for the jaw.

    Parameters
    ----------
    points
        Of the thing, that the box is round: where it is wide, the pads hold it; None for anywhere in the box.
    """
    seen = np.zeros((0, 3)) if points is None else points
    above, side = _top_grasps(box, body, seen), _side_grasps(box, body, seen)
    return side + above if box.high > _TOO_HIGH else above + side


def _top_grasps(box: ObjectBox, body: ArmBody, seen: Array) -> list[Grasp]:
    # The pads hold the upper part of what is high, and do not touch the ground beside what is low.
    grip = max(_grip_height(box, seen), box.low + PAD_DEPTH + _OFF)
    found: list[Grasp] = []
    for axis in sorted((0, 1), key=lambda axis: _finger_opening(box, axis)):
        opening = _finger_opening(box, axis)
        if float(box.half[axis]) + JAW_ROOM > body.opening:
            continue
        across, along = box.axes[axis], box.axes[1 - axis]
        first, last = _wide_part(box, seen, axis, low=grip - PAD_DEPTH)
        room = min(_PAD_WIDE, (last - first) / 2)
        # In the middle of that part is most of what it weighs: held off it, a long thing swings in the jaw.
        level = box.centre + along * min(max((first + last) / 2, first + room), last - room)
        for tilt in _TILTS:
            for sign in (1.0, -1.0):
                pose = downward(np.array([*level, grip]), across * sign, tilt)
                found.append(Grasp(pose, min(opening, body.opening), np.array([0.0, 0.0, APPROACH_LENGTH])))
    return found


def _side_grasps(box: ObjectBox, body: ArmBody, seen: Array) -> list[Grasp]:
    if box.high - box.low < _TALL:
        return []
    away = box.centre / max(float(np.hypot(*box.centre)), 1e-6)
    found: list[Grasp] = []
    grip = max((box.low + box.high) / 2, box.low + 0.09)
    for axis in (0, 1):
        # Pads lie flat on two faces: what is held by its edges turns, and slips.
        across, opening = box.axes[axis], float(box.half[axis]) + JAW_ROOM
        ahead = box.axes[1 - axis]
        ahead = ahead if dot(ahead, away) > 0.0 else -ahead
        if opening > body.opening or float(dot(ahead, away)) < _ASIDE:
            continue
        # The pads reach into what is deep, not through it.
        first, last = _wide_part(box, seen, axis, low=grip - PAD_DEPTH, high=grip + PAD_DEPTH)
        near = first if dot(ahead, box.axes[1 - axis]) > 0.0 else -last
        at = np.array([*(box.centre + ahead * min(near + 0.05, 0.5 * (last - first) + near)), grip])
        for slant in _SLANTS:
            z = np.array([*(ahead * math.cos(slant)), -math.sin(slant)])
            for sign in (1.0, -1.0):
                y = np.array([*(across * sign), 0.0])
                pose = np.column_stack([np.cross(y, z), y, z, at])
                found.append(Grasp(pose, opening, -z * APPROACH_LENGTH))
    return found


def _finger_opening(box: ObjectBox, axis: int) -> float:
    """Return how far each finger is off the middle before it closes: more where the thing's far side is hidden."""
    away = box.centre / max(float(np.hypot(*box.centre)), 1e-6)
    return float(box.half[axis]) + JAW_ROOM + _HIDDEN * abs(float(dot(box.axes[axis], away)))


def _grip_height(box: ObjectBox, seen: Array) -> float:
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


def _wide_part(box: ObjectBox, seen: Array, axis: int, *, low: float, high: float = math.inf) -> tuple[float, float]:
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


_PAD_CLEARANCE = 0.06  # metres that pads are long below their middle, and more
_HAND_TOLERANCE = 0.03  # metres that a hand may miss the end of its way by
# Metres before a person, and above the ground, that things are held out to them.
_ARM_LENGTH, _HELD_OUT = 0.5, 0.75
_BALL_RADIUS = 0.018  # metres: radius of the balls that a held thing is made of
_SLENDER = 0.2  # half the width of what is slender, as a share of its height
_GLANCE = 40  # fewer points are no look
_SHIFTED = 0.2  # metres off its place from which on a thing is another one


class HeldObject(NamedTuple):
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
        return is_slender(float(self.half[0]), self.below + self.above - _PAD_CLEARANCE)

    def on(self, limbs: CollisionSpheres) -> CollisionSpheres:
        """Return limbs with the thing."""
        return with_held_object(limbs, self.points, _BALL_RADIUS)

    def box(self) -> ObjectBox:
        """Return the box round it, seen from between the pads, along the base as the hand closed."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        axes = np.array([[-s, c], [c, s]])
        return ObjectBox(self.middle, axes, self.half, -self.below, self.above - _PAD_CLEARANCE)

    def rotation_after_turn(self, turn: float) -> Array:
        """Return the rotation of the hand with the thing turned about the vertical, rad, shape ``(3, 3)``."""
        return product(_rotation_about_vertical(turn), self.rotation)

    def pose_over(self, spot: Array, turn: float) -> Array:
        """Return the pose of the hand with which the middle of the thing's underside is at a spot."""
        off = apply_matrix(np.array([*self.middle, -self.below]), _rotation_about_vertical(turn))
        return np.column_stack([self.rotation_after_turn(turn), spot - off])


def is_slender(half: float, height: float) -> bool:
    """Return whether what is so wide, half of it, and so high, metres, tips over where what it stands on drives."""
    return half < _SLENDER * height


def has_released(body: ArmBody, now: Array, there: Array, held: HeldObject) -> bool:
    """Return whether an open hand went so far from where it let go that its fingers are off what it put down."""
    gone = body.hand(now)[:, 3] - body.hand(there)[:, 3]
    return float(np.linalg.norm(gone)) > held.above - _HAND_TOLERANCE


def offer_point(person: Array, stance: Stance) -> Array:
    """Return where a thing is held out to somebody who stands at a point, before them, ENU metres."""
    away = stance.position[:2] - person[:2]
    return person + np.array([*(away / max(float(np.hypot(*away)), 1e-6) * _ARM_LENGTH), _HELD_OUT])


def object_in_jaw(body: ArmBody, angles: Array, box: ObjectBox, opening: float) -> HeldObject:
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
    return _held_by_box(
        body, pose[:, :3].copy(), box._replace(centre=box.centre - pose[:2, 3], low=low, high=high), opening
    )


def refine_held_object(body: ArmBody, angles: Array, held: HeldObject, points: Array) -> HeldObject:
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
    box = object_box(np.vstack([stood, known.points(0.0, _BALL_RADIUS)]))
    if len(points) < _GLANCE or box is None or float(np.abs(box.centre - known.centre).max()) > _SHIFTED:
        return held
    return _held_by_box(body, held.rotation, box._replace(low=min(box.low, known.low)), held.opening)


def _held_by_box(body: ArmBody, rotation: Array, box: ObjectBox, opening: float) -> HeldObject:
    """Return a thing in the jaw by the box round it, seen from between the pads, along the base as the hand closed."""
    points = apply_matrix(box.points(_BALL_RADIUS, 3.0 * _BALL_RADIUS), rotation.T) + np.array(
        [0.0, 0.0, body.chain.grip]
    )
    heading = math.atan2(float(box.axes[1, 1]), float(box.axes[1, 0]))
    above = max(box.high, 0.0) + _PAD_CLEARANCE
    return HeldObject(points, -box.low, above, opening, rotation, box.centre.copy(), box.half.copy(), heading)


def _rotation_about_vertical(turn: float) -> Array:
    c, s = math.cos(turn), math.sin(turn)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


#: Newtons from which a finger counts as pressing; as in the environments that arms are trained in.
CONTACT_FORCE = 0.5


class ObjectPose(NamedTuple):
    """A box round a thing.

    Attributes
    ----------
    middle
        Metres, shape ``(3,)``.
    rotation
        Its axes in columns, right-handed, shape ``(3, 3)``.
    half
        Half its sides along these, metres, shape ``(3,)``.
    """

    middle: Array
    rotation: Array
    half: Array

    @property
    def low(self) -> float:
        """Height of its lowest point, metres."""
        return float(self.middle[2] - dot(np.abs(self.rotation[2]), self.half))

    def inside(self, stance: Stance) -> ObjectPose:
        """Return it in the frame of a base, if it is one in the world."""
        return ObjectPose(stance.inside(self.middle), product(stance.rotation.T, self.rotation), self.half)

    def outside(self, stance: Stance) -> ObjectPose:
        """Return it in the world, if it is one in the frame of a base."""
        return ObjectPose(stance.outside(self.middle), product(stance.rotation, self.rotation), self.half)

    def as_box(self) -> ObjectBox:
        """Return the upright box that it is, or that stands round it."""
        upright = int(np.abs(self.rotation[2]).argmax())
        sides = [(self.half[k], self.rotation[:2, k]) for k in range(3) if k != upright]
        sides.sort(key=lambda side: float(side[0]))
        axes = np.array([axis / max(float(np.hypot(*axis)), 1e-9) for _, axis in sides])
        high = 2.0 * float(self.middle[2]) - self.low
        return ObjectBox(self.middle[:2].copy(), axes, np.array([half for half, _ in sides]), self.low, high)


#: Truth instead of sight: from an entity to its box in the world; None for one that is not there.
PoseOracle = Callable[[int], ObjectPose | None]


def pose_of_box(box: ObjectBox) -> ObjectPose:
    """Return the pose of the box round a thing's points."""
    x, y = box.axes
    # Sides are ordered by their length: their axes may be left-handed.
    y = y if x[0] * y[1] - x[1] * y[0] > 0.0 else -y
    rotation = np.array([[x[0], y[0], 0.0], [x[1], y[1], 0.0], [0.0, 0.0, 1.0]])
    middle = np.array([*box.centre, (box.low + box.high) / 2])
    return ObjectPose(middle, rotation, np.array([*box.half, (box.high - box.low) / 2]))


def finger_contacts(observation: Mapping[str, Any], entity: int = 0) -> NDArray[np.bool_]:
    """Return whether each finger presses on something, shape ``(2,)``.

    Parameters
    ----------
    entity
        Of a thing that both count as pressing on, too, while the robot is told that it holds it: with oracle grasp
        fingers feel nothing of what they hold.
    """
    if entity and entity in observation.get("state", {}).get("held", ()):
        return np.ones(2, bool)
    return np.asarray(np.asarray(observation["sensors"]["contacts"], np.float64) > CONTACT_FORCE)


class ObjectTracker:
    """Says where one thing is, in the frame of the base.

    While it is in view that is the least upright box round its points in depth and segmentation. Out of view it is
    where it was last, and in a grip it goes with the hand. With `truth` it is that.

    Parameters
    ----------
    body
        The arm.
    truth
        Where things really are, for an oracle; None for what is seen.
    """

    def __init__(self, body: ArmBody, *, truth: PoseOracle | None = None) -> None:
        self._body, self._truth = body, truth
        self._last: ObjectPose | None = None  # in the world
        self._in_hand: ObjectPose | None = None  # in the frame of the hand

    @property
    def looks(self) -> bool:
        """Whether it needs pictures."""
        return self._truth is None

    def forget(self) -> None:
        """Begin anew, with another thing."""
        self._last = self._in_hand = None

    def where(self, observation: Mapping[str, Any], entity: int) -> ObjectPose | None:
        """Return where a thing is now; None if it has not been seen yet.

        Parameters
        ----------
        observation
            With ``sensors``, and with depth and segmentation if it `looks`.
        """
        stance = Stance.of(observation)
        if self._truth is not None:
            found = self._truth(entity)
            return None if found is None else found.inside(stance)
        box = object_box(view_points(observation).of(entity))
        hand = self._hand(observation)
        if box is not None:
            pose = pose_of_box(box)
        elif self._in_hand is not None and finger_contacts(observation, entity).all():
            pose = self._in_hand.outside(hand)
        elif self._last is not None:
            pose = self._last.inside(stance)
        else:
            return None
        self._last, self._in_hand = pose.outside(stance), pose.inside(hand)
        return pose

    def _hand(self, observation: Mapping[str, Any]) -> Stance:
        angles = np.asarray(observation["sensors"]["joint_position"], np.float64)
        pose = self._body.hand(angles[:7])
        return Stance(pose[:, 3], pose[:, :3])

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {name: None if pose is None else {**pose._asdict()} for name, pose in self._poses().items()}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        last, in_hand = (
            None if state[name] is None else ObjectPose(**{key: np.array(value) for key, value in state[name].items()})
            for name in self._poses()
        )
        self._last, self._in_hand = last, in_hand

    def _poses(self) -> dict[str, ObjectPose | None]:
        return {"last": self._last, "in_hand": self._in_hand}
