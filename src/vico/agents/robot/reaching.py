"""Reach planning: paths of an arm to a grasp, to a placement and to where objects are carried, around what was seen.

A held object is turned so that it lies on what holds it up where it is put down, and does not jut out.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody, Stance, surface_height
from vico.agents.robot.grasps import Grasp, HeldObject
from vico.exact import apply_matrix
from vico.geometry import distances
from vico.kinematics.hand_paths import straight_path
from vico.kinematics.planning import (
    Arm,
    DistanceGrid,
    collision_free_reach,
    distance_grid,
    empty_distance_grid,
    is_free,
    is_path_free,
    plan_path,
)

Array = NDArray[np.float64]

#: Metres a thing is lifted, and that hands keep off what stands around on their way.
LIFT, GAP = 0.16, 0.02
# Metres above a spot from which a thing comes down to it: as high as the arm reaches.
_LIFTS = (LIFT, 0.09, 0.04)
# Where hands come near things on purpose, the grid of what was seen is coarser than the room there is.
_END_GAP = -0.03
_START_GAPS = (0.0, -0.01, -0.02, _END_GAP)
# Where things are carried: hand in the base's frame, the first that can be reached.
_CARRY_POINTS = ((0.46, -0.17, 0.78), (0.50, 0.0, 0.70), (0.42, -0.25, 0.70))
_HEIGHT_OVER_SURFACE = 0.10  # metres above what it is put on that a thing is brought near
#: Turns of what is held about the vertical, rad.
TURNS = tuple(k * math.pi / 4 for k in (0, 1, -1, 2, -2, 3, -3, 4))


class ReachPlan(NamedTuple):
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


def room_around(body: ArmBody, points: Array) -> DistanceGrid:
    """Return the room that an arm has among points in its base's frame, on ground as level as the base."""
    return distance_grid(points, body.posts, ground=-body.stand - 0.04)


def plan_grasp(
    body: ArmBody,
    rooms: tuple[DistanceGrid, DistanceGrid],
    now: Array,
    grasps: Sequence[Grasp],
    *,
    skip: Collection[int] = (),
) -> ReachPlan | None:
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
        there = _approach_paths(arm, body, now, grasp.before, grasp.pose, last=rooms[1])
        if there is None:
            continue
        lifted = grasp.pose.copy()
        lifted[2, 3] += LIFT
        away = straight_path(body.chain, there[1][-1], grasp.pose, lifted)
        if away is None:
            away = there[1][::-1]
        return ReachPlan(*there, away, grasp.opening, number)
    return None


def plan_placement(
    body: ArmBody, room: DistanceGrid, now: Array, spot: Array, held: HeldObject, turns: Sequence[float] = TURNS
) -> ReachPlan | None:
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
            there = _approach_paths(arm, body, now, above, pose, level=level)
            if there is not None:
                return ReachPlan(*there, _retreat_path(body, there[1], pose, held.above), held.opening, number)
    return None


def plan_carry(
    body: ArmBody, room: DistanceGrid, now: Array, held: HeldObject | None, *, opening: float
) -> Array | None:
    """Return a way to where things are carried, or folded without one, shape ``(m, 7)``; None if none is free.

    Parameters
    ----------
    opening
        Of each finger, metres.
    """
    limbs = body.limbs(opening)
    arm = Arm(body.chain, held.on(limbs) if held else limbs, room, GAP)
    if held is None:
        return _free_path(arm, now, body.rest)
    for place in _CARRY_POINTS:
        for turn in TURNS:
            goal = np.column_stack([held.rotation_after_turn(turn), place])
            way = _level_path(arm, body, now, goal)
            if way is not None:
                return way
    for place in _CARRY_POINTS:
        goals = [np.column_stack([held.rotation_after_turn(turn), place]) for turn in TURNS]
        found = collision_free_reach(arm, goals, now, posture=body.rest)
        way = None if found is None else _free_path(arm, now, found[0])
        if way is not None:
            return way
    return None


def plan_raise(body: ArmBody, now: Array, held: HeldObject, height: float) -> Array | None:
    """Return a way straight up, until a held thing's underside is above a height in the base's frame; None if it is.

    Where the arm does not reach that far, the way ends lower.
    """
    pose = body.hand(now)
    arm = Arm(body.chain, held.on(body.limbs(held.opening)), empty_distance_grid(body.posts), 0.0)
    for up in np.arange(height + held.below + _HEIGHT_OVER_SURFACE - float(pose[2, 3]), 0.02, -0.04).tolist():
        goal = pose.copy()
        goal[2, 3] += up
        way = straight_path(body.chain, now, pose, goal)
        if way is not None and _is_free_at_end(arm, way):
            return way
    return None


def _approach_paths(
    arm: Arm,
    body: ArmBody,
    now: Array,
    before: Array,
    pose: Array,
    *,
    last: DistanceGrid | None = None,
    level: bool = False,
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
        over = _level_path(arm, body, now, before)
        straight = None if over is None else straight_path(body.chain, over[-1], before, pose)
        return (
            (over, straight) if straight is not None and over is not None and _is_free_at_end(comes, straight) else None
        )
    found = collision_free_reach(arm, [before], now, posture=body.rest)
    if found is None:
        return None
    straight = straight_path(body.chain, found[0], before, pose)
    if straight is None or not _is_free_at_end(comes, straight):
        return None
    over = _free_path(arm, now, found[0])
    return None if over is None else (over, straight)


def _is_free_at_end(arm: Arm, straight: Array) -> bool:
    """Return whether a hand may go the last bit to what it is after."""
    return is_path_free(arm._replace(gap=_END_GAP), straight)


def _level_path(arm: Arm, body: ArmBody, now: Array, goal: Array) -> Array | None:
    """Return a straight way of the hand to a pose, on which a thing hardly tilts; None if it is not free."""
    way = straight_path(body.chain, now, body.hand(now), goal)
    if way is None:
        return None
    gap = next((gap for gap in (arm.gap, *_START_GAPS) if is_free(arm._replace(gap=gap), now)), None)
    return way if gap is not None and is_path_free(arm._replace(gap=gap), np.vstack([now, way])) else None


def _free_path(arm: Arm, now: Array, goal: Array) -> Array | None:
    """Return a free way; from where something is too near, one that keeps off less."""
    start = now
    for gap in (arm.gap, *_START_GAPS):
        nearer = arm._replace(gap=gap)
        if is_free(nearer, start):
            return plan_path(nearer, start, goal)
    return None


def _retreat_path(body: ArmBody, there: Array, pose: Array, tall: float) -> Array:
    """Return angles that bring an empty hand off what it put down: back along itself as far as it stands high."""
    for away in np.arange(max(LIFT, tall), 0.03, -0.02).tolist():
        back = pose.copy()
        back[:, 3] -= pose[:, 2] * away
        out = straight_path(body.chain, there[-1], pose, back)
        if out is not None:
            return out
    return there[::-1]


# Things are let go of so high above what they are put on, metres.
_ABOVE = 0.01
# Cells of what is below a thing, metres; what is so much higher or lower than the spot is no ground for it.
_CELL, _LEVEL_TOLERANCE = 0.03, 0.03
# So much less of a thing held up than at best is as good; less than that is no sight of what is below it.
_AS_GOOD, _SEES = 0.08, 0.3
# Sides that differ by less, as a share, are alike.
_SQUARE_RATIO = 0.85


def plan_supported_placement(
    body: ArmBody,
    points: Array,
    now: Array,
    stance: Stance,
    spot: Array,
    held: HeldObject,
    *,
    beside: Array | None = None,
) -> ReachPlan | None:
    """Return ways that put a held thing down on what was seen at a spot, turned as it is held up best; None if none.

    Parameters
    ----------
    points
        Of all but the thing, in the base's frame, metres, shape ``(n, 3)``.
    now
        Angles of the arm, rad.
    stance
        Where the base is.
    spot
        For the middle of the thing's underside, ENU metres; its height counts where none is seen.
    beside
        Unit vector to the side from which it is reached: the longer side lies across to that; None for any way.
    """
    at = stance.inside(spot)
    at[2] = surface_height(points, at)
    turns = turns_by_support(held, points, at)
    if beside is not None:
        ahead = apply_matrix(beside, stance.rotation[:2, :2].T)
        turns.insert(0, turns_along_heading(held, math.atan2(float(ahead[1]), float(ahead[0])) + math.pi / 2))
    at[2] += _ABOVE
    room = room_around(body, points)
    found = (plan_placement(body, room, now, at, held, group) for group in turns)
    return next((reach for reach in found if reach is not None), None)


def turns_along_heading(held: HeldObject, along: float) -> list[float]:
    """Return turns with which the longer side lies along a heading in the base's frame, rad, small ones first."""
    found = [_wrap_angle(along - held.heading + k * math.pi) for k in (0, 1)]
    if held.half[0] > _SQUARE_RATIO * held.half[1]:
        found += [_wrap_angle(turn + math.pi / 2) for turn in found]
    return sorted(found, key=abs)


def turns_by_support(held: HeldObject, points: Array, spot: Array) -> list[list[float]]:
    """Return turns of a thing about the vertical by how much of it lies on what was seen, in groups, the best first.

    Parameters
    ----------
    points
        Of all but the thing, in the base's frame, metres, shape ``(n, 3)``.
    spot
        For the middle of its underside, in that frame, metres, shape ``(3,)``.
    """
    # Across to the way there: so it juts out least over the edge of a table.
    across = turns_along_heading(held, math.atan2(float(spot[1]), float(spot[0])) + math.pi / 2)
    turns = [*TURNS, *across]
    near = points[distances(points[:, :2], spot[:2]) < float(np.hypot(*held.half)) + _CELL]
    shares = [_supported_share(held, near, spot, turn) for turn in turns]
    best = max(shares)
    if best < _SEES:
        return [across, list(TURNS)]
    good = [turn for turn, share in zip(turns, shares, strict=True) if share >= best - _AS_GOOD]
    rest = sorted(zip(shares, turns, strict=True), key=lambda one: (-one[0], abs(one[1])))
    return [good, [turn for _, turn in rest if turn not in good]]


def _supported_share(held: HeldObject, points: Array, spot: Array, turn: float) -> float:
    """Return the share of the cells below a turned thing in which something was seen that is as high as the spot."""
    c, s = math.cos(held.heading + turn), math.sin(held.heading + turn)
    inside = apply_matrix(points[:, :2] - spot[:2], np.array([[-s, c], [c, s]]))
    counts = np.maximum(np.ceil(2.0 * held.half / _CELL).astype(int), 1)
    cells = np.floor((inside / held.half + 1.0) / 2.0 * counts).astype(int)
    below = np.all((cells >= 0) & (cells < counts), axis=1)
    level = below & (np.abs(points[:, 2] - spot[2]) < _LEVEL_TOLERANCE)
    seen = np.zeros(tuple(counts.tolist()), np.bool_)
    seen[tuple(cells[level].T)] = True
    return float(seen.mean())


def _wrap_angle(turn: float) -> float:
    return (turn + math.pi) % (2.0 * math.pi) - math.pi
