"""The carrier: its deck, the sentences that two robots exchange, and who drives it.

The sentences are plain: people could say them to robots, too. `Carrier` comes where it is called to, and tells where it
stands. `Scout` looks about as well: it comes along to the source, says where it sees the thing, and goes with the
person. `DeckTrip` is a thing's way on the deck, as the robot with the arm sees to it: called, loaded, sent ahead,
unloaded.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, AgentState, FieldState, Info, Observation
from vico.agents.requester import TAKEN_TEXT
from vico.agents.robot.arm_interface import ArmSkill, ErrandStage
from vico.agents.robot.body import ArmBody, Drive, Stance, ground_distance, object_in_view
from vico.exact import dot

Array = NDArray[np.float64]

_NUMBER = r"(-?\d+(?:\.\d+)?)"
_POSITION_PATTERN = re.compile(rf"^I stand at {_NUMBER} {_NUMBER} {_NUMBER}, heading {_NUMBER}\.$")
_SIGHTING_PATTERN = re.compile(rf"^I see it at {_NUMBER} {_NUMBER} {_NUMBER}\.$")
_CALL_PATTERN = re.compile(rf"^Come to {_NUMBER} {_NUMBER}\.$")
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


def position_message(stance: Stance) -> str:
    """Return the sentence in which a carrier tells where it stands."""
    x, y, z = stance.position.tolist()
    yaw = math.atan2(stance.rotation[1, 0], stance.rotation[0, 0])
    return f"I stand at {x:.2f} {y:.2f} {z:.2f}, heading {yaw:.3f}."


def call_message(x: float, y: float) -> str:
    """Return the sentence that calls a carrier to a point, ENU metres."""
    return f"Come to {x:.2f} {y:.2f}."


def sighting_message(position: Array) -> str:
    """Return the sentence that tells where a thing was seen, ENU metres, shape ``(3,)``."""
    x, y, z = position.tolist()
    return f"I see it at {x:.2f} {y:.2f} {z:.2f}."


def parse_sighting(text: str) -> Array | None:
    """Return where a thing was seen; None of any other sentence."""
    found = _SIGHTING_PATTERN.match(text)
    return None if found is None else np.array([float(value) for value in found.groups()])


def parse_position(text: str) -> Stance | None:
    """Return where a carrier stands that said so, upright; None of any other sentence."""
    found = _POSITION_PATTERN.match(text)
    if found is None:
        return None
    x, y, z, yaw = (float(value) for value in found.groups())
    c, s = math.cos(yaw), math.sin(yaw)
    return Stance(np.array([x, y, z]), np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))


def parse_call(text: str) -> tuple[float, float] | None:
    """Return where a carrier is called to; None of any other sentence."""
    found = _CALL_PATTERN.match(text)
    return None if found is None else (float(found[1]), float(found[2]))


def messages_from(observation: Mapping[str, Any], speaker: str) -> list[str]:
    """Return what one has said since the last observation, in order."""
    return [
        str(event["text"]) for event in observation["events"] if event.get("speaker") == speaker and "text" in event
    ]


# Seconds between two sentences while it stands; near enough to where it was called to, metres.
_TELLS_EVERY, _CARRIER_ARRIVES = 2.0, 1.0


class Carrier(FieldState):
    """Drives to where the other robot calls it, stands, and says where that is.

    Parameters
    ----------
    caller
        Name of the robot with the arm.
    period
        Seconds between two actions.
    """

    _drive: Drive
    _called: bool = False
    _told: float = 0.0

    def __init__(self, caller: str, *, period: float) -> None:
        self._caller, self._period = caller, period
        self._drive = Drive(period=period)

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at its pictures: never."""
        return False

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self._told += self._period
        for text in messages_from(observation, self._caller):
            goal = parse_call(text)
            if goal is not None:
                self._called = True
                self._drive.begin(np.array(goal), near=_CARRIER_ARRIVES)
        if self._drive.busy:
            return self._drive.act(observation)
        if self._called and self._told > _TELLS_EVERY:
            self._told = 0.0
            return {"type": "communicate", "text": position_message(Stance.of(observation))}
        return {"type": "wait"}


# How near to the source it comes, metres: the other robot needs room there; a turn to look about, rad/s.
_AT_SOURCE, _SCOUT_TURN_SPEED = 4.5, 0.7
# Seconds that one turn takes; who went on turning would wander off on a slope.
_SCOUT_TURN_TIME = 9.5
_LOOKS_EVERY = 0.5  # seconds between two looks
_SAYS_EVERY = 6.0  # seconds between two sentences
_FOLLOW_AFTER = 80.0  # seconds until it goes after a person who may have gone


class Scout:
    """Looks for the thing from another place than the robot with the arm; with Carry, goes along with the person.

    Parameters
    ----------
    told
        What the task tells (`vico.challenges.robot.tasks.RobotTask.instruction`), and ``period``, seconds.
    caller
        Name of the robot with the arm.
    """

    def __init__(self, told: Mapping[str, Any], caller: str) -> None:
        self._told, self._caller = dict(told), caller
        self._period = float(told["period"])
        self._drive = Drive(period=self._period)
        self._began = self._taken = self._follows = False
        self._clock = self._looked = self._said = self._turned = 0.0

    @property
    def wants_picture(self) -> bool:
        """Whether it looks about the next time."""
        return self._lies_about and not self._taken and self._clock + self._period - self._looked >= _LOOKS_EVERY

    @property
    def _lies_about(self) -> bool:
        """Whether the thing lies about; else a person has it."""
        return bool(self._told["category"] == "deliver")

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self._clock += self._period
        self._taken = self._taken or any(TAKEN_TEXT in text for text in messages_from(observation, self._caller))
        if not self._lies_about:
            return self._go_along()
        if self._taken:
            return {"type": "stop"}
        said = self._look(observation, info)
        if said is not None:
            return said
        if not self._began:
            self._began = True
            self._drive.begin(np.array(self._told["source"]["centre"]), near=_AT_SOURCE, stops=True)
        if self._drive.busy:
            return self._drive.act(observation)
        self._turned += self._period
        if self._turned > _SCOUT_TURN_TIME:
            return {"type": "stop"}
        return {"type": "control", "space": "velocity", "vector": [0.0, 0.0, _SCOUT_TURN_SPEED]}

    def _go_along(self) -> Action:
        """Go with the person once the thing was taken up, or long after it should have been."""
        if self._follows:
            return {"type": "wait"}
        if not self._taken and self._clock < _FOLLOW_AFTER:
            return {"type": "stop"}
        self._follows = True
        return {"type": "follow", "agent": str(self._told["person"]["agent"])}

    def _look(self, observation: Observation, info: Info) -> Action | None:
        """Look for the thing twice a second; return what to say where it is in view."""
        if self._clock - self._looked < _LOOKS_EVERY or "depth" not in observation:
            return None
        self._looked = self._clock
        seen = object_in_view(observation, info, str(self._told["object"]))
        if seen is None or (self._said and self._clock - self._said < _SAYS_EVERY):
            return None
        self._said = self._clock
        return {"type": "communicate", "text": sighting_message(Stance.of(observation).outside(seen.low))}

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "drive": self._drive.state(),
            "flags": [self._began, self._taken, self._follows],
            "seconds": [self._clock, self._looked, self._said, self._turned],
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._drive.restore(state["drive"])
        self._began, self._taken, self._follows = (bool(flag) for flag in state["flags"])
        self._clock, self._looked, self._said, self._turned = (float(value) for value in state["seconds"])


#: How near one comes to where things are put down, metres.
AT_GOAL = 2.0
_CARRIER_PATIENCE = 90.0  # seconds until a carrier is waited for no longer
# Where the carrier is called to, from the robot with the arm, and how far off it may be, metres.
_ASIDE, _BESIDE_WAY = 2.2, 6.0


class DeckStep(NamedTuple):
    """What the robot does for a period, and what it is at from then on; None for the same as before."""

    action: Action
    then: ErrandStage | None = None


class DeckTrip:
    """Loads and unloads a carrier, and tells it where to come.

    Parameters
    ----------
    team
        The robots' bodies.
    worker, drive
        Of the robot with the arm.
    period
        Seconds between two actions.
    """

    def __init__(self, team: Team, worker: ArmSkill, drive: Drive, *, period: float) -> None:
        self._team, self._worker, self._drive, self._period = team, worker, drive, period
        self._carrier_at: Stance | None = None
        self._began = False
        self._waited = 0.0

    def hear(self, text: str) -> None:
        """Take in what the carrier says: where it stands."""
        self._carrier_at = parse_position(text) or self._carrier_at

    def begin(self) -> None:
        """Begin a stage."""
        self._began, self._waited = False, 0.0

    def load(self, observation: Observation) -> DeckStep:
        """Call the carrier, wait until it stands, and put the thing on its deck."""
        here = Stance.of(observation)
        if self._worker.busy:
            action = self._worker.act(observation)
            if self._worker.busy:
                return DeckStep(action)
            return DeckStep(action, ErrandStage.ALONG if self._worker.held is None else ErrandStage.BRING)
        if not self._began:
            return self._call(here.position[:2] - here.rotation[:2, 0] * _ASIDE)
        self._waited += self._period
        at = self._carrier_at
        if at is not None and ground_distance(at.position, here.position) < _BESIDE_WAY:
            held = self._worker.held
            wide = 0.0 if held is None else 2.0 * float(held.half[0])
            spot, beside = deck_spot(self._team.deck, at, here.position, wide=wide)
            self._worker.place(spot, beside=beside)
            return DeckStep(self._worker.act(observation))
        return DeckStep({"type": "stop"}, ErrandStage.BRING if self._waited > _CARRIER_PATIENCE else None)

    def go_along(self, observation: Observation, goal: Array, entity: int) -> DeckStep:
        """Send the carrier to a point, ENU metres, go there, and begin to take a thing off its deck."""
        if not self._began:
            self._drive.begin(goal, near=AT_GOAL)
            return self._call(goal)
        if self._drive.busy:
            return DeckStep(self._drive.act(observation))
        self._waited += self._period
        if self._carrier_at is not None:
            spot, beside = deck_spot(self._team.deck, self._carrier_at, Stance.of(observation).position)
            self._worker.pick(entity, spot, beside=beside)
            return DeckStep({"type": "stop"}, ErrandStage.UNLOAD)
        return DeckStep({"type": "stop"}, ErrandStage.END if self._waited > 2.0 * _CARRIER_PATIENCE else None)

    def _call(self, to: Array) -> DeckStep:
        self._began, self._carrier_at = True, None
        return DeckStep({"type": "communicate", "text": call_message(*to.tolist())})

    def state(self) -> AgentState:
        """Return all it remembers."""
        at = self._carrier_at
        return {
            "carrier": None if at is None else [at.position.copy(), at.rotation.copy()],
            "began": self._began,
            "waited": self._waited,
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        at = state["carrier"]
        self._carrier_at = None if at is None else Stance(np.array(at[0]), np.array(at[1]))
        self._began, self._waited = bool(state["began"]), float(state["waited"])
