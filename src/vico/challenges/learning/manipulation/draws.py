"""What the seed decides: boxes, where they stand, where they are to be, how the arm begins."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from vico.assets.robots import MobileManipulator, robot_model
from vico.challenges.learning.manipulation.options import ManipulationOptions
from vico.challenges.learning.manipulation.scene import PAD, Array, Thing
from vico.errors import EmptyInputError
from vico.kinematics.arm import Chain, reach_pose
from vico.kinematics.ways import downward
from vico.quaternions import upright

#: Sides of a box, metres; kilograms; friction; height of the table, metres.
SIDES, MASS, FRICTION, TABLES = (0.05, 0.25), (0.1, 2.0), (0.6, 1.0), (0.15, 0.5)
#: Where boxes stand: from the middle of the base, metres, and off straight ahead, rad.
DISTANCE, BEARING = (0.54, 0.70), 0.45
#: From a box to its goal at least; goals above it, metres.
APART, RAISED = 0.2, (0.15, 0.25)
#: Noise of the arm's first angles, rad; way of each finger then, metres.
NOISE, OPENING = 0.05, 0.08
#: Where a hand that is ready is, in the base's frame, metres.
READY = np.array([0.5, -0.1, 0.75])
# How far fingers are told to go past what they hold, and above what it stood on it is held, metres.
_SQUEEZE, _HELD = 0.03, (0.12, 0.2)
_TRIES = 60


@dataclass(frozen=True)
class Episode:
    """How an episode begins.

    Attributes
    ----------
    thing
        The box.
    position, rotation
        Of its middle, metres, shape ``(3,)``, and its quaternion, shape ``(4,)``.
    goal
        Where its middle is to be, metres, shape ``(3,)``.
    arm
        Angles, rad, shape ``(7,)``.
    opening, target
        Way of each finger and where it is told to be, metres.
    """

    thing: Thing
    position: Array
    rotation: Array
    goal: Array
    arm: Array
    opening: float
    target: float


class Hand(NamedTuple):
    """An arm and the height of its base's frame above the ground, metres."""

    chain: Chain
    stand: float


@cache
def hand_of_robot() -> Hand:
    """Return the arm that is drawn for."""
    robot = robot_model("manipulator")
    arm = robot.controller
    assert isinstance(arm, MobileManipulator)
    return Hand(Chain(arm.places, arm.axes, arm.low, arm.high, arm.grip), robot.stand)


@cache
def ready_angles() -> tuple[float, ...]:
    """Return the arm's angles with the hand down in front of the base, rad."""
    found = reach_pose(
        hand_of_robot().chain, downward(READY, np.array([0.0, 1.0]), 0.0), robot_model("manipulator").rest[:7]
    )
    assert found is not None
    return tuple(found.tolist())


def first_angles(chance: np.random.Generator, options: ManipulationOptions) -> Array:
    """Draw the arm's angles, rad, shape ``(7,)``."""
    rest = np.array(ready_angles()) if options.start == "ready" else robot_model("manipulator").rest[:7]
    chain = hand_of_robot().chain
    return np.clip(rest + chance.uniform(-NOISE, NOISE, 7), chain.low, chain.high)


def spot(chance: np.random.Generator) -> Array:
    """Draw a place in front of the base, metres, shape ``(2,)``."""
    away, bearing = chance.uniform(*DISTANCE), chance.uniform(-BEARING, BEARING)
    return np.array([away * math.cos(bearing), away * math.sin(bearing)])


def spot_apart(chance: np.random.Generator, other: Array) -> Array:
    """Draw a place that is not near another one, metres, shape ``(2,)``."""
    for _ in range(_TRIES):
        found = spot(chance)
        if math.dist(found, other) >= APART:
            return found
    raise EmptyInputError(f"env: no place {APART} m from {other} in front of the robot in {_TRIES} draws; draw anew")


def standing_box(chance: np.random.Generator, options: ManipulationOptions) -> Episode:
    """Draw a box on the ground or on a table, turned anyhow; its goal is where it stands."""
    half = chance.uniform(*SIDES, 3) / 2
    mass, friction = float(chance.uniform(*MASS)), float(chance.uniform(*FRICTION))
    # Both are drawn whatever is chosen: the rest of an episode does not depend on the choice.
    on_table, height = bool(chance.random() < 0.5), float(chance.uniform(*TABLES))
    if options.surface != "any":
        on_table = options.surface == "table"
    thing = Thing(half, mass, friction, height if on_table else 0.0)
    place, yaw = spot(chance), float(chance.uniform(-math.pi, math.pi))
    position = np.array([*place, thing.surface + half[2]])
    arm = first_angles(chance, options)
    return Episode(thing, position, upright(yaw), position.copy(), arm, OPENING, OPENING)


def held_box(chance: np.random.Generator, options: ManipulationOptions) -> Episode:
    """Draw a box in the closed jaw above a table or the ground; its goal is where it is.

    Fingers stand on its faces and are told to go past them: friction holds it from the first step on.
    """
    for _ in range(_TRIES):
        drawn = standing_box(chance, options)
        hand, thing = hand_of_robot(), drawn.thing
        up = float(chance.uniform(*_HELD))
        position = drawn.position + np.array([0.0, 0.0, up])
        grip = np.array([*position[:2], grip_height(thing.half[2], position[2]) - hand.stand])
        yaw = 2.0 * math.atan2(drawn.rotation[3], drawn.rotation[0])
        across = 0 if thing.half[0] <= thing.half[1] else 1
        turn = yaw + across * math.pi / 2
        for sign in (1.0, -1.0):
            along = sign * np.array([math.cos(turn), math.sin(turn)])
            arm = reach_pose(hand.chain, downward(grip, along, 0.0), np.array(ready_angles()))
            if arm is not None:
                opening = float(thing.half[across]) - PAD
                held = replace(drawn, position=position, goal=position.copy(), arm=arm, opening=opening)
                return replace(held, target=max(opening - _SQUEEZE, 0.0))
    raise EmptyInputError(f"env: no box that the arm can hold in {_TRIES} draws; draw anew")


def grip_height(half: float, middle: float) -> float:
    """Return where pads hold a box of half a height that stands with its middle at a height, metres."""
    return max(middle + half - 0.06, middle - half + 0.047)


def goal_beside(chance: np.random.Generator, drawn: Episode) -> Episode:
    """Draw a goal on what the box stands on, or is held above, at another place."""
    place = spot_apart(chance, drawn.position[:2])
    return replace(drawn, goal=np.array([*place, drawn.thing.surface + drawn.thing.half[2]]))


def goal_above(chance: np.random.Generator, drawn: Episode) -> Episode:
    """Draw a goal above the box."""
    return replace(drawn, goal=drawn.position + np.array([0.0, 0.0, chance.uniform(*RAISED)]))
