"""What robots are told of their own bodies."""

from __future__ import annotations

import numpy as np

from vico.agents.robot.body import ArmBody
from vico.agents.robot.team import Deck, Team
from vico.assets.robots import DeckModel, MobileManipulator, RobotModel
from vico.errors import InputError
from vico.kinematics.arm import Chain
from vico.kinematics.limbs import Jaw

# As in the model's geometry: links, and the base, column and mast that they must not touch (x, y, radius, top).
_RADII = (0.06, 0.06, 0.045, 0.045, 0.045, 0.045, 0.045)
_POSTS = ((0.0, 0.0, 0.27, 0.17), (-0.02, 0.0, 0.12, 0.57), (-0.1, 0.05, 0.035, 1.1))
# Of joints, rad/s, and fingers, m/s.
_JOINT_SPEED, _FINGER_SPEED = 0.9, 0.12


def arm_body(model: RobotModel) -> ArmBody:
    """Return what a mobile manipulator knows of its arm.

    Raises
    ------
    InputError
        If the model has no arm on a base that drives.
    """
    settings = model.controller
    if not isinstance(settings, MobileManipulator):
        raise InputError(f"{model.title} has no arm on a base that drives; take manipulator")
    return ArmBody(
        chain=Chain(settings.places, settings.axes, settings.low, settings.high, settings.grip),
        radii=np.array(_RADII),
        jaw=Jaw(),
        posts=np.array(_POSTS),
        rest=model.rest[:7].copy(),
        opening=settings.opening,
        fastest=np.array([_JOINT_SPEED] * 7 + [_FINGER_SPEED] * 2),
        stand=model.stand,
        radius=model.half_width,
    )


def team_of(manipulator: RobotModel, carrier: RobotModel) -> Team:
    """Return what two robots know of each other's bodies.

    Raises
    ------
    InputError
        If the first has no arm, or the second no deck.
    """
    deck = carrier.deck
    if deck is None:
        raise InputError(f"{carrier.title} has no deck; take husky")
    return Team(arm_body(manipulator), _deck(deck))


def _deck(deck: DeckModel) -> Deck:
    recess = None if deck.recess is None else _deck(deck.recess)
    return Deck(np.array(deck.centre), deck.length, deck.width, recess)
