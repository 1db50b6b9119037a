"""What two robots know of each other, and what they say: plain sentences that people could say to them, too."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody, Stance
from vico.exact import dot

Array = NDArray[np.float64]

_NUMBER = r"(-?\d+(?:\.\d+)?)"
_HERE = re.compile(rf"^I stand at {_NUMBER} {_NUMBER} {_NUMBER}, heading {_NUMBER}\.$")
_SEEN = re.compile(rf"^I see it at {_NUMBER} {_NUMBER} {_NUMBER}\.$")
_COME = re.compile(rf"^Come to {_NUMBER} {_NUMBER}\.$")
# Things lie so far from the edge of a deck that the arm reaches over, and off its rails, metres.
_FROM_EDGE, _OFF_RAILS = 0.17, 0.02


class Deck(NamedTuple):
    """A carrier's deck.

    Attributes
    ----------
    centre
        Its middle in the frame of the base, metres, shape ``(3,)``.
    length, width
        Along x and y of that frame, metres.
    recess
        The lower part between rails; None where it is level all over.
    """

    centre: Array
    length: float
    width: float
    recess: Deck | None = None


class Team(NamedTuple):
    """A robot with an arm, and one that carries."""

    arm: ArmBody
    deck: Deck


class DeckSpot(NamedTuple):
    """Where to put something on a deck.

    Attributes
    ----------
    spot
        For the middle of its underside, ENU metres, shape ``(3,)``.
    beside
        Unit vector to the side from which it is reached; the thing lies along the deck, across to it, shape ``(2,)``.
    """

    spot: Array
    beside: Array


def deck_spot(deck: Deck, carrier: Stance, near: Array, *, wide: float = 0.0) -> DeckSpot:
    """Return where a deck is reached from the side that is nearer to a point, ENU metres.

    Parameters
    ----------
    wide
        Of the thing across the deck, metres: between rails it stands on neither of them.
    """
    across = carrier.rotation[:, 1]
    side = 1.0 if float(dot((near - carrier.position)[:2], across[:2])) > 0.0 else -1.0
    floor, off = deck.centre, deck.width / 2 - _FROM_EDGE
    if deck.recess is not None:
        room = deck.recess.width / 2 - _OFF_RAILS - wide / 2
        # What is wider than the recess lies on both rails.
        floor, off = (deck.recess.centre, min(off, room)) if room > 0.0 else (deck.centre, 0.0)
    beside = side * across[:2] / max(float(np.hypot(*across[:2])), 1e-6)
    return DeckSpot(carrier.outside(floor + np.array([0.0, side * off, 0.0])), beside)


def says_where(stance: Stance) -> str:
    """Return the sentence in which a carrier tells where it stands."""
    x, y, z = stance.position.tolist()
    yaw = math.atan2(stance.rotation[1, 0], stance.rotation[0, 0])
    return f"I stand at {x:.2f} {y:.2f} {z:.2f}, heading {yaw:.3f}."


def says_come(x: float, y: float) -> str:
    """Return the sentence that calls a carrier to a point, ENU metres."""
    return f"Come to {x:.2f} {y:.2f}."


def says_seen(position: Array) -> str:
    """Return the sentence that tells where a thing was seen, ENU metres, shape ``(3,)``."""
    x, y, z = position.tolist()
    return f"I see it at {x:.2f} {y:.2f} {z:.2f}."


def told_seen(text: str) -> Array | None:
    """Return where a thing was seen; None of any other sentence."""
    found = _SEEN.match(text)
    return None if found is None else np.array([float(value) for value in found.groups()])


def told_where(text: str) -> Stance | None:
    """Return where a carrier stands that said so, upright; None of any other sentence."""
    found = _HERE.match(text)
    if found is None:
        return None
    x, y, z, yaw = (float(value) for value in found.groups())
    c, s = math.cos(yaw), math.sin(yaw)
    return Stance(np.array([x, y, z]), np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))


def told_come(text: str) -> tuple[float, float] | None:
    """Return where a carrier is called to; None of any other sentence."""
    found = _COME.match(text)
    return None if found is None else (float(found[1]), float(found[2]))


def heard_from(observation: Mapping[str, Any], speaker: str) -> list[str]:
    """Return what one has said since the last observation, in order."""
    return [
        str(event["text"]) for event in observation["events"] if event.get("speaker") == speaker and "text" in event
    ]
