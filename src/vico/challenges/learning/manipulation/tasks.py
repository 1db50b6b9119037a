"""The manipulation tasks: Reach, Lift, Place and PickPlace, each with its start, success rule and staged reward.

Reach: bring the open jaw round a box. Lift: take hold of a box and hold it up. Place: put down a box that is held.
Pick and place: take a box and put it down elsewhere. Rewards are the paper's four terms, or parts in stages that
follow each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from vico.challenges.learning.manipulation.observation import Bools, Readings
from vico.challenges.learning.manipulation.scene import (
    Array,
    EpisodeDraw,
    ManipulationOptions,
    goal_above,
    goal_beside,
    held_box,
    standing_box,
)


@dataclass(frozen=True)
class ManipulationTask:
    """A task for an arm.

    Attributes
    ----------
    name
        As in its id.
    begin
        Draws an episode.
    evaluate
        Says for each copy what holds, by name; ``"success"`` is one of the names.
    staged
        Returns the staged reward, per step about 1 at most, shape ``(n,)``.
    paper_terms
        Which terms of the paper's reward there are: ``"object"``, ``"goal"``, ``"grasp"``, ``"place"``.
    """

    name: str
    begin: Callable[[np.random.Generator, ManipulationOptions], EpisodeDraw]
    evaluate: Callable[[Readings], dict[str, Bools]]
    staged: Callable[[Readings], Array]
    paper_terms: tuple[str, ...]


#: Metres from the goal within which the box counts as there; steps that it has to stay (paper, appendix).
NEAR, STAY = 0.1, 100
#: Metres that a box is lifted.
LIFTED = 0.1
# The paper's reward.
PAPER_METRE = 0.02  # cost of a metre from hand to thing, and from thing to goal, each step
PAPER_FARTHEST = 10.0  # metres up to which these distances count
PAPER_GRASP = 5.0  # reward of holding the thing, each step
PAPER_PLACE = 100.0  # reward of a thing that is placed
# Metres above the grasp point where a hand is to be until it is ready to go down.
_HOVER = 0.12
# From so far off a hand is rewarded for coming nearer, metres.
_AWAY = 0.9
# A jaw is wider than a box on each side by no more, metres.
_WIDEST = 0.14


def paper_reward(r: Readings, terms: Collection[str]) -> Array:
    """Return the paper's reward ("Reward Design for Community Robot Challenge"), shape ``(n,)``.

    ``object``: minus 0.02 times the metres from hand to box, 10 at most. ``goal``: the same from box to goal.
    ``grasp``: 5 while the box's middle is more than twice its height above what it stood on, and the gripper is closed
    on it (both pads press). ``place``: 100, once, when the box has been within 0.1 m of the goal for 100 steps.
    """
    total = np.zeros(len(r.hand))
    if "object" in terms:
        total -= np.minimum(np.linalg.norm(r.hand - r.thing, axis=1), PAPER_FARTHEST) * PAPER_METRE
    if "goal" in terms:
        total -= np.minimum(r.goal_distance, PAPER_FARTHEST) * PAPER_METRE
    if "grasp" in terms:
        height = r.thing[:, 2] - r.surface
        total += PAPER_GRASP * ((height > 2.0 * 2.0 * r.height_half) & r.is_gripped)
    if "place" in terms:
        total += PAPER_PLACE * (r.at_goal == STAY)
    return total


def nearness(distance: Array, scale: float) -> Array:
    """Return 1 at no distance, falling to 0 over some times `scale`, metres."""
    return np.asarray(1.0 - np.tanh(distance / scale))


def share_between(value: Array, low: float, high: float) -> Array:
    """Return how far a value is from one number to another, from 0 to 1."""
    return np.clip((value - low) / (high - low), 0.0, 1.0)


def is_inside(r: Readings) -> Bools:
    """Return whether the box is between the pads, at the height they hold it."""
    away = r.grasp_point - r.hand
    across = np.abs(np.einsum("ni,ni->n", away, r.hand_rotation[:, :, 1]))
    along = np.abs(np.einsum("ni,ni->n", away, r.hand_rotation[:, :, 0]))
    return np.asarray((across < 0.03) & (along < 0.04) & (np.abs(away[:, 2]) < 0.03) & (r.squareness > 0.95))


def approach_share(r: Readings) -> Array:
    """Return how near a hand is to being able to close on the box: aligned, open, above it, down; from 0 to 1."""
    away = r.grasp_point - r.hand
    level = np.linalg.norm(away[:, :2], axis=1)
    # Within its sides the hand cannot but be square to a box: alignment counts from an eighth of a turn.
    turned = share_between(r.pointing, 0.5, 0.98) * (0.4 + 0.6 * share_between(r.squareness, 0.72, 0.98))
    inside = is_inside(r)
    is_open = np.where(inside, 1.0, share_between(r.gap, -0.04, 0.012))
    ready = (
        share_between(-level, -0.08, -0.02)
        * share_between(r.pointing, 0.85, 0.97)
        * share_between(r.squareness, 0.88, 0.98)
    )
    ready = ready * np.where(inside, 1.0, share_between(r.gap, 0.0, 0.01))
    above = away + np.array([0.0, 0.0, _HOVER])
    # Who is ready does not lose by going down: it counts how far above that point the hand is, and no longer below.
    far = ready * np.maximum(-above[:, 2], 0.0) + (1.0 - ready) * np.linalg.norm(above, axis=1)
    over = 0.6 * share_between(-far, -_AWAY, 0.0) + 0.4 * nearness(far, 0.12)
    down = ready * (0.2 + 0.8 * nearness(np.linalg.norm(away, axis=1), 0.12))
    return np.asarray(0.2 * turned + 0.35 * over + 0.1 * is_open + 0.35 * down)


def closing_share(r: Readings) -> Array:
    """Return how far a jaw has closed on the box between its pads, from 0 to 1."""
    return np.asarray(
        is_inside(r) * (0.5 * share_between(-r.gap, -_WIDEST, 0.0) + 0.25 * (r.pressure > 0.5).sum(axis=1))
    )


def lifting_share(r: Readings) -> Array:
    """Return how far a gripped box has been lifted and is held still, from 0 to 1."""
    up = share_between(r.clearance, 0.0, 0.15)
    still = (r.clearance > LIFTED) * nearness(r.thing_speed[:, 0], 0.25)
    return np.asarray(r.is_gripped * (0.6 * up + 0.4 * still))


def carrying_share(r: Readings) -> Array:
    """Return how near a gripped box is to its goal: over it, then down on it; from 0 to 1."""
    level = np.linalg.norm((r.goal - r.thing)[:, :2], axis=1)
    there = share_between(-level, -0.12, -0.03)
    high = there + (1.0 - there) * nearness(np.abs(r.goal[:, 2] + 0.1 - r.thing[:, 2]), 0.1)
    low = there * nearness(np.abs(r.clearance), 0.06)
    return np.asarray(r.is_gripped * (0.4 * nearness(level, 0.2) + 0.2 * high + 0.4 * low))


def is_placed(r: Readings) -> Bools:
    """Return whether a box stands still at its goal in nobody's grip."""
    rests = (np.abs(r.clearance) < 0.02) & (r.thing_speed[:, 0] < 0.05) & (r.thing_speed[:, 1] < 0.5)
    return np.asarray((r.goal_distance < NEAR) & rests & ~r.touching)


def releasing_share(r: Readings) -> Array:
    """Return how far a jaw has opened around a box that stands at its goal, from 0 to 1."""
    stands = (r.goal_distance < NEAR) & (np.abs(r.clearance) < 0.02)
    return np.asarray(stands * share_between(r.gap, -0.01, 0.03))


_REACH_NEAR = 0.04  # metres between hand and grasp
_REACH_TILT = 0.35  # rad off straight down
_REACH_TURN = 0.26  # rad off the box
_REACH_MOVED = 0.05  # metres that the box may have been moved


def evaluate_reach(r: Readings) -> dict[str, Bools]:
    """Say what of the rule holds."""
    near = np.linalg.norm(r.grasp_point - r.hand, axis=1) < _REACH_NEAR
    aligned = (r.pointing > math.cos(_REACH_TILT)) & (r.squareness > math.cos(_REACH_TURN))
    is_open = r.gap > 0.0
    unmoved = np.linalg.norm(r.thing - r.start, axis=1) < _REACH_MOVED
    found = {"near": near, "aligned": aligned, "open": is_open, "unmoved": unmoved}
    return {**found, "success": near & aligned & is_open & unmoved}


REACH = ManipulationTask("reach", standing_box, evaluate_reach, approach_share, ("object",))


_LIFT_SLOW = 0.1


def begin_lift(chance: np.random.Generator, options: ManipulationOptions) -> EpisodeDraw:
    """Draw a standing box and a goal above it."""
    return goal_above(chance, standing_box(chance, options))


def evaluate_lift(r: Readings) -> dict[str, Bools]:
    """Say what of the rule holds."""
    lifted, slow = r.clearance >= LIFTED, r.thing_speed[:, 0] < _LIFT_SLOW
    return {"gripped": r.is_gripped, "lifted": lifted, "still": slow, "success": r.is_gripped & lifted & slow}


def staged_lift_reward(r: Readings) -> Array:
    """Return the staged reward: once the box is gripped, all of the approach counts as done."""
    before = np.where(r.is_gripped, 1.0, approach_share(r))
    grip = np.where(r.is_gripped, 1.0, closing_share(r))
    return np.asarray(0.25 * before + 0.25 * grip + 0.5 * lifting_share(r))


LIFT = ManipulationTask("lift", begin_lift, evaluate_lift, staged_lift_reward, ("object", "goal", "grasp", "place"))


def begin_place(chance: np.random.Generator, options: ManipulationOptions) -> EpisodeDraw:
    """Draw a held box and a goal beside it."""
    return goal_beside(chance, held_box(chance, options))


def evaluate_place(r: Readings) -> dict[str, Bools]:
    """Say what of the rule holds."""
    return {"at_goal": r.goal_distance < NEAR, "released": ~r.touching, "success": is_placed(r)}


def staged_place_reward(r: Readings) -> Array:
    """Return the staged reward: what is put down counts as carried there."""
    placed, release = is_placed(r), releasing_share(r)
    carried = np.where(release > 0.0, 1.0, carrying_share(r))
    return np.asarray(np.where(placed, 1.0, 0.6 * carried + 0.25 * release))


PLACE = ManipulationTask(
    "place", begin_place, evaluate_place, staged_place_reward, ("object", "goal", "grasp", "place")
)


def begin_pick_place(chance: np.random.Generator, options: ManipulationOptions) -> EpisodeDraw:
    """Draw a standing box and a goal beside it."""
    return goal_beside(chance, standing_box(chance, options))


def evaluate_pick_place(r: Readings) -> dict[str, Bools]:
    """Say what of the rule holds."""
    found = {"gripped": r.is_gripped, "was_lifted": r.was_lifted, "at_goal": r.goal_distance < NEAR}
    return {**found, "released": ~r.touching, "success": is_placed(r) & r.was_lifted}


def staged_pick_place_reward(r: Readings) -> Array:
    """Return the staged reward: lifting, and carrying once the box has been lifted."""
    held_or_there = r.is_gripped | (r.goal_distance < NEAR)
    later = r.was_lifted & held_or_there
    return np.asarray(np.where(later, 0.4 + 0.6 * staged_place_reward(r), 0.4 * staged_lift_reward(r)))


PICK_PLACE = ManipulationTask(
    "pick_place", begin_pick_place, evaluate_pick_place, staged_pick_place_reward, ("object", "goal", "grasp", "place")
)
