"""Ways of an arm to a thing, to where it is put down, and to where it is carried, planned round what was seen."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody, Stance
from vico.agents.robot.grasps import Grasp, ThingBox, thing_box
from vico.kinematics.inverse import free_reach
from vico.kinematics.limbs import Limbs, with_held
from vico.kinematics.planning import Arm, free_way, is_free, way_is_free
from vico.kinematics.room import Room, room_of, seen_nothing
from vico.kinematics.ways import straight_way

Array = NDArray[np.float64]

#: Metres a thing is lifted, and that hands keep off what stands around on their way.
LIFT, GAP = 0.16, 0.02
# Metres above a spot from which a thing comes down to it: as high as the arm reaches.
_LIFTS = (LIFT, 0.09, 0.04)
# Where hands come near things on purpose, the grid of what was seen is coarser than the room there is.
_CLOSE = -0.03
_NEARER = (0.0, -0.01, -0.02, _CLOSE)
# Where things are carried: hand in the base's frame, the first that can be reached.
_CARRY = ((0.46, -0.17, 0.78), (0.50, 0.0, 0.70), (0.42, -0.25, 0.70))
_CLEAR = 0.06  # metres that pads are long below their middle, and more
_THERE = 0.03  # metres that a hand may miss the end of its way by
# Metres before a person, and above the ground, that things are held out to them.
_ARM_LENGTH, _HELD_OUT = 0.5, 0.75
_OVER = 0.10  # metres above what it is put on that a thing is brought near
_BALL = 0.018  # metres: radius of the balls that a held thing is made of
# Half the width of what is slender, as a share of its height; fewer points are no look; farther off, metres, its middle
# is not where it was taken to be, but the thing another one.
_SLENDER, _GLANCE, _SHIFTED = 0.2, 40, 0.2
#: Turns of what is held about the vertical, rad.
TURNS = tuple(k * math.pi / 4 for k in (0, 1, -1, 2, -2, 3, -3, 4))


class Reach(NamedTuple):
    """Ways of an arm, angles, each shape ``(m, 7)``.

    Attributes
    ----------
    over
        From where it is to before the pose.
    there
        Straight to the pose.
    away
        From it: with a thing up, without one back.
    opening
        Of each finger on the way there, metres.
    number
        Of the grasp, among those that were given.
    """

    over: Array
    there: Array
    away: Array
    opening: float
    number: int


def room_around(body: ArmBody, points: Array) -> Room:
    """Return the room that an arm has among points in its base's frame, on ground as level as the base."""
    return room_of(points, body.posts, ground=-body.stand - 0.04)


def reach_thing(
    body: ArmBody, rooms: tuple[Room, Room], now: Array, grasps: Sequence[Grasp], *, skip: Collection[int] = ()
) -> Reach | None:
    """Return ways to the first of some grasps that can be reached, and up with the thing; None without one.

    Parameters
    ----------
    rooms
        With the thing itself, for the way over, and without it, for the last bit.
    now
        Angles of the arm, rad.
    skip
        Grasps that are not tried.
    """
    for number, grasp in enumerate(grasps):
        if number in skip:
            continue
        arm = Arm(body.chain, body.limbs(grasp.opening), rooms[0], GAP)
        there = _there(arm, body, now, grasp.before, grasp.pose, last=rooms[1])
        if there is None:
            continue
        lifted = grasp.pose.copy()
        lifted[2, 3] += LIFT
        away = straight_way(body.chain, there[1][-1], grasp.pose, lifted)
        if away is None:
            away = there[1][::-1]
        return Reach(*there, away, grasp.opening, number)
    return None


def reach_spot(
    body: ArmBody, room: Room, now: Array, spot: Array, held: Held, turns: Sequence[float] = TURNS
) -> Reach | None:
    """Return ways that bring a held thing's underside to a spot, and the empty hand back up; None without one.

    Parameters
    ----------
    spot
        In the base's frame, metres, shape ``(3,)``.
    turns
        Of the thing about the vertical since it was taken up that may be, those to be preferred first, rad.
    """
    limbs = held.on(body.limbs(held.opening))
    arm = Arm(body.chain, limbs, room, GAP)
    # Swung about, things turn in the jaw: ways on which they stay level come first.
    for level, lift in product((True, False), _LIFTS):
        for number, turn in enumerate(turns):
            pose = held.pose_over(spot, turn)
            above = pose.copy()
            above[2, 3] += lift
            there = _there(arm, body, now, above, pose, level=level)
            if there is not None:
                return Reach(*there, _retreat(body, there[1], pose, held.above), held.opening, number)
    return None


def carry_way(body: ArmBody, room: Room, now: Array, held: Held | None, *, opening: float) -> Array | None:
    """Return a way to where things are carried, or folded without one, shape ``(m, 7)``; None if none is free.

    Parameters
    ----------
    opening
        Of each finger, metres.
    """
    limbs = body.limbs(opening)
    arm = Arm(body.chain, held.on(limbs) if held else limbs, room, GAP)
    if held is None:
        return _way(arm, now, body.rest)
    for place in _CARRY:
        for turn in TURNS:
            goal = np.column_stack([held.turned(turn), place])
            way = _level_way(arm, body, now, goal)
            if way is not None:
                return way
    for place in _CARRY:
        goals = [np.column_stack([held.turned(turn), place]) for turn in TURNS]
        found = free_reach(arm, goals, now, posture=body.rest)
        way = None if found is None else _way(arm, now, found[0])
        if way is not None:
            return way
    return None


def raise_way(body: ArmBody, now: Array, held: Held, height: float) -> Array | None:
    """Return a way straight up, until a held thing's underside is above a height in the base's frame; None if it is.

    Where the arm does not reach that far, the way ends lower.
    """
    pose = body.hand(now)
    arm = Arm(body.chain, held.on(body.limbs(held.opening)), seen_nothing(body.posts), 0.0)
    for up in np.arange(height + held.below + _OVER - float(pose[2, 3]), 0.02, -0.04).tolist():
        goal = pose.copy()
        goal[2, 3] += up
        way = straight_way(body.chain, now, pose, goal)
        if way is not None and _comes(arm, way):
            return way
    return None


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
        return _about_vertical(turn) @ self.rotation

    def pose_over(self, spot: Array, turn: float) -> Array:
        """Return the pose of the hand with which the middle of the thing's underside is at a spot."""
        off = _about_vertical(turn) @ np.array([*self.middle, -self.below])
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
    stood = (points - pose[:, 3]) @ pose[:, :3] @ held.rotation.T
    known = held.box()
    box = thing_box(np.vstack([stood, known.points(0.0, _BALL)]))
    if len(points) < _GLANCE or box is None or float(np.abs(box.centre - known.centre).max()) > _SHIFTED:
        return held
    return _held(body, held.rotation, box._replace(low=min(box.low, known.low)), held.opening)


def _held(body: ArmBody, rotation: Array, box: ThingBox, opening: float) -> Held:
    """Return a thing in the jaw by the box round it, seen from between the pads, along the base as the hand closed."""
    points = box.points(_BALL, 3.0 * _BALL) @ rotation + np.array([0.0, 0.0, body.chain.grip])
    heading = math.atan2(float(box.axes[1, 1]), float(box.axes[1, 0]))
    above = max(box.high, 0.0) + _CLEAR
    return Held(points, -box.low, above, opening, rotation, box.centre.copy(), box.half.copy(), heading)


def _about_vertical(turn: float) -> Array:
    c, s = math.cos(turn), math.sin(turn)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _there(
    arm: Arm, body: ArmBody, now: Array, before: Array, pose: Array, *, last: Room | None = None, level: bool = False
) -> tuple[Array, Array] | None:
    """Return a free way to before a pose and the straight one to it; None if either is not free.

    Parameters
    ----------
    last
        Room that the straight way has, if that is another one.
    level
        Whether the hand is to go straight to before the pose, too.
    """
    comes = arm if last is None else arm._replace(room=last)
    if level:
        over = _level_way(arm, body, now, before)
        straight = None if over is None else straight_way(body.chain, over[-1], before, pose)
        return (over, straight) if straight is not None and over is not None and _comes(comes, straight) else None
    found = free_reach(arm, [before], now, posture=body.rest)
    if found is None:
        return None
    straight = straight_way(body.chain, found[0], before, pose)
    if straight is None or not _comes(comes, straight):
        return None
    over = _way(arm, now, found[0])
    return None if over is None else (over, straight)


def _comes(arm: Arm, straight: Array) -> bool:
    """Return whether a hand may go the last bit to what it is after."""
    return way_is_free(arm._replace(gap=_CLOSE), straight)


def _level_way(arm: Arm, body: ArmBody, now: Array, goal: Array) -> Array | None:
    """Return a straight way of the hand to a pose, on which a thing hardly tilts; None if it is not free."""
    way = straight_way(body.chain, now, body.hand(now), goal)
    if way is None:
        return None
    gap = next((gap for gap in (arm.gap, *_NEARER) if is_free(arm._replace(gap=gap), now)), None)
    return way if gap is not None and way_is_free(arm._replace(gap=gap), np.vstack([now, way])) else None


def _way(arm: Arm, now: Array, goal: Array) -> Array | None:
    """Return a free way; from where something is too near, one that keeps off less."""
    start = now
    for gap in (arm.gap, *_NEARER):
        nearer = arm._replace(gap=gap)
        if is_free(nearer, start):
            return free_way(nearer, start, goal)
    return None


def _retreat(body: ArmBody, there: Array, pose: Array, tall: float) -> Array:
    """Return angles that bring an empty hand off what it put down: back along itself as far as it stands high."""
    for away in np.arange(max(LIFT, tall), 0.03, -0.02).tolist():
        back = pose.copy()
        back[:, 3] -= pose[:, 2] * away
        out = straight_way(body.chain, there[-1], pose, back)
        if out is not None:
            return out
    return there[::-1]
