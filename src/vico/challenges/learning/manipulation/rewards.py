"""Rewards: the paper's four terms, and parts in stages that follow each other."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from vico.challenges.learning.manipulation.readings import Bools, Readings
from vico.challenges.learning.manipulation.scene import Array

#: Metres from the goal within which the box counts as there; steps that it has to stay (paper, appendix).
NEAR, STAY = 0.1, 100
#: Metres that a box is lifted.
LIFTED = 0.1
_FAR, _PENALTY, _GRASP, _PLACE = 10.0, 0.02, 5.0, 100.0
# Metres above the grasp point where a hand is to be until it is ready to go down.
_HOVER = 0.12
# From so far off a hand is rewarded for coming nearer, metres.
_AWAY = 0.9
# A jaw is wider than a box on each side by no more, metres.
_WIDEST = 0.14


def paper(r: Readings, terms: Collection[str]) -> Array:
    """Return the paper's reward ("Reward Design for Community Robot Challenge"), shape ``(n,)``.

    ``object``: minus 0.02 times the metres from hand to box, 10 at most. ``goal``: the same from box to goal.
    ``grasp``: 5 while the box's middle is more than twice its height above what it stood on, and the gripper is closed
    on it (both pads press). ``place``: 100, once, when the box has been within 0.1 m of the goal for 100 steps.
    """
    total = np.zeros(len(r.hand))
    if "object" in terms:
        total -= np.minimum(np.linalg.norm(r.hand - r.thing, axis=1), _FAR) * _PENALTY
    if "goal" in terms:
        total -= np.minimum(r.goal_distance, _FAR) * _PENALTY
    if "grasp" in terms:
        height = r.thing[:, 2] - r.surface
        total += _GRASP * ((height > 2.0 * 2.0 * r.height_half) & r.gripped)
    if "place" in terms:
        total += _PLACE * (r.at_goal == STAY)
    return total


def nearness(distance: Array, scale: float) -> Array:
    """Return 1 at no distance, falling to 0 over some times `scale`, metres."""
    return np.asarray(1.0 - np.tanh(distance / scale))


def share(value: Array, low: float, high: float) -> Array:
    """Return how far a value is from one number to another, from 0 to 1."""
    return np.clip((value - low) / (high - low), 0.0, 1.0)


def is_inside(r: Readings) -> Bools:
    """Return whether the box is between the pads, at the height they hold it."""
    away = r.grasp_point - r.hand
    across = np.abs(np.einsum("ni,ni->n", away, r.hand_rotation[:, :, 1]))
    along = np.abs(np.einsum("ni,ni->n", away, r.hand_rotation[:, :, 0]))
    return np.asarray((across < 0.03) & (along < 0.04) & (np.abs(away[:, 2]) < 0.03) & (r.squareness > 0.95))


def approach(r: Readings) -> Array:
    """Return how near a hand is to being able to close on the box: aligned, open, above it, down; from 0 to 1."""
    away = r.grasp_point - r.hand
    level = np.linalg.norm(away[:, :2], axis=1)
    # Within its sides the hand cannot but be square to a box: alignment counts from an eighth of a turn.
    turned = share(r.pointing, 0.5, 0.98) * (0.4 + 0.6 * share(r.squareness, 0.72, 0.98))
    inside = is_inside(r)
    is_open = np.where(inside, 1.0, share(r.gap, -0.04, 0.012))
    ready = share(-level, -0.08, -0.02) * share(r.pointing, 0.85, 0.97) * share(r.squareness, 0.88, 0.98)
    ready = ready * np.where(inside, 1.0, share(r.gap, 0.0, 0.01))
    above = away + np.array([0.0, 0.0, _HOVER])
    # Who is ready does not lose by going down: it counts how far above that point the hand is, and no longer below.
    far = ready * np.maximum(-above[:, 2], 0.0) + (1.0 - ready) * np.linalg.norm(above, axis=1)
    over = 0.6 * share(-far, -_AWAY, 0.0) + 0.4 * nearness(far, 0.12)
    down = ready * (0.2 + 0.8 * nearness(np.linalg.norm(away, axis=1), 0.12))
    return np.asarray(0.2 * turned + 0.35 * over + 0.1 * is_open + 0.35 * down)


def closing(r: Readings) -> Array:
    """Return how far a jaw has closed on the box between its pads, from 0 to 1."""
    return np.asarray(is_inside(r) * (0.5 * share(-r.gap, -_WIDEST, 0.0) + 0.25 * (r.pressure > 0.5).sum(axis=1)))


def lifting(r: Readings) -> Array:
    """Return how far a gripped box has been lifted and is held still, from 0 to 1."""
    up = share(r.clearance, 0.0, 0.15)
    still = (r.clearance > LIFTED) * nearness(r.thing_speed[:, 0], 0.25)
    return np.asarray(r.gripped * (0.6 * up + 0.4 * still))


def carrying(r: Readings) -> Array:
    """Return how near a gripped box is to its goal: over it, then down on it; from 0 to 1."""
    level = np.linalg.norm((r.goal - r.thing)[:, :2], axis=1)
    there = share(-level, -0.12, -0.03)
    high = there + (1.0 - there) * nearness(np.abs(r.goal[:, 2] + 0.1 - r.thing[:, 2]), 0.1)
    return np.asarray(r.gripped * (0.4 * nearness(level, 0.2) + 0.2 * high + 0.4 * lowering(r, there)))


def lowering(r: Readings, there: Array) -> Array:
    """Return how near a box over its goal is to what it is to stand on, from 0 to 1."""
    return np.asarray(there * nearness(np.abs(r.clearance), 0.06))


def is_placed(r: Readings) -> Bools:
    """Return whether a box stands still at its goal in nobody's grip."""
    rests = (np.abs(r.clearance) < 0.02) & (r.thing_speed[:, 0] < 0.05) & (r.thing_speed[:, 1] < 0.5)
    return np.asarray((r.goal_distance < NEAR) & rests & ~r.touching)


def releasing(r: Readings) -> Array:
    """Return how far a jaw has opened around a box that stands at its goal, from 0 to 1."""
    stands = (r.goal_distance < NEAR) & (np.abs(r.clearance) < 0.02)
    return np.asarray(stands * share(r.gap, -0.01, 0.03))
