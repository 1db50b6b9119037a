"""Where an arm puts things on another robot's deck, and where it stands for that: beside it, with nothing between."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.exact import apply_matrix
from vico.sim.carrying import DeckPose
from vico.sim.robots.drawing import deck_of
from vico.sim.robots.path_follower import footprint_discs
from vico.sim.robots.state import RobotRun
from vico.sim.robots.ways import way_to

# Metres from the edges of a deck that things are put at; free room between two robots where the arm's way ends.
_FROM_EDGE, _BESIDE = 0.16, 0.3


def deck_spot(run: RobotRun, robot: int, entity: int) -> NDArray[np.float64] | None:
    """Where on the deck of the robot with an entity another one can put something, ENU metres; None without a deck.

    It is near the edge of the side, left or right, that the other one is on: before and behind a deck there is more of
    its robot than an arm reaches across.
    """
    deck = deck_of(run, entity)
    if deck is None:
        return None
    return np.asarray(deck.position + apply_matrix(_spot(run, robot, deck), deck.rotation))


def _spot(run: RobotRun, robot: int, deck: DeckPose) -> NDArray[np.float64]:
    """Return the spot in the frame of the deck's robot."""
    x, y, _ = apply_matrix(run.position(robot) - deck.position, deck.rotation.T) - deck.centre
    half = np.array([deck.length, deck.width]) / 2 - _FROM_EDGE
    return np.asarray(deck.centre + np.array([min(max(x, -half[0]), half[0]), math.copysign(half[1], y), 0.0]))


def way_beside_deck(run: RobotRun, robot: int, entity: int) -> NDArray[np.float64] | None:
    """Return a way round the robot with an entity to where another one stands beside its deck; None if there is none.

    Raises
    ------
    ValueError
        If there is no such robot.
    """
    carrier, deck = run.entities.tolist().index(entity), deck_of(run, entity)
    if deck is None:
        return None
    mine, theirs, base = run.scene.models[robot], run.scene.models[carrier], run.engine.base(carrier)
    spot = _spot(run, robot, deck)
    spot[1] = math.copysign(theirs.half_width + mine.half_width + _BESIDE, spot[1] - deck.centre[1])
    goal = deck.position + apply_matrix(spot, deck.rotation)
    pose = float(base.position[0]), float(base.position[1]), base.yaw
    closed = footprint_discs(pose, theirs.half_length, theirs.half_width, mine.half_width + _BESIDE / 2)
    return way_to(run, robot, goal, np.array(closed))
