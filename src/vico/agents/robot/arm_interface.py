"""The interface of what picks things up and puts them down for a robot: tasks, stages, skills and policies of an arm.

A planner (`vico.agents.robot.arm_skills.ArmWorker`) and a learned policy are both an `ArmSkill`.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import AgentState
from vico.agents.robot.grasps import HeldObject, ObjectPose


class ArmStage(StrEnum):
    """What the arm is at."""

    IDLE = "idle"
    COME = "come"
    RAISE = "raise"
    ALIGN = "align"
    LOOK = "look"
    OVER = "over"
    THERE = "there"
    GRIP = "grip"
    AWAY = "away"
    BACK = "back"
    CARRY = "carry"
    INSPECT = "inspect"


class ArmTask(StrEnum):
    """What it does."""

    NOTHING = "nothing"
    PICK = "picked"
    PLACE = "placed"
    OFFER = "handed_over"
    FOLD = "folded"


class ErrandStage(StrEnum):
    """What a robot that brings a thing is at."""

    GO = "go to the source"
    CALL = "call the person"
    SEARCH = "look for the thing"
    PICK = "pick it"
    PUSH = "push it"
    LOAD = "put it on the carrier"
    ALONG = "go along with the carrier"
    UNLOAD = "take it off the carrier"
    FOLLOW = "follow the person"
    BRING = "bring it"
    PLACE = "put it down"
    END = "end"


class PolicyStage(StrEnum):
    """What an arm is at whose policy was learned."""

    IDLE = "idle"
    COME = "come"
    READY = "ready"
    POLICY = "policy"
    FOLD = "fold"


Array = NDArray[np.float64]
Action = dict[str, Any]


class ArmSkill(Protocol):
    """Does one piece of work after the other; asked as often as its robot acts."""

    @property
    def outcome(self) -> str:
        """What came of the last piece of work: ``"picked"``, ``"placed"`` or ``"failed"``."""

    @property
    def why(self) -> str:
        """Why it failed."""

    @property
    def busy(self) -> bool:
        """Whether it is at work."""

    @property
    def held(self) -> HeldObject | None:
        """What is in the jaw, as far as it knows; None for nothing."""

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at what is around it the next time."""

    def has_lost(self, observation: Mapping[str, Any]) -> bool:
        """Return whether a jaw that held something feels it no more; asked once a period while there is no work."""

    def pick(self, entity: int, position: Array, *, beside: Array | None = None) -> None:
        """Begin to pick a thing up that is about at a position, ENU metres."""

    def place(self, spot: Array, *, beside: Array | None = None) -> None:
        """Begin to put down what is held, with its underside at a spot, ENU metres."""

    def fold(self) -> None:
        """Begin to bring the arm to where things are carried, or to its rest with nothing in it."""

    def act(self, observation: Mapping[str, Any]) -> Action:
        """Return the action for the coming period."""

    def state(self) -> AgentState:
        """Return all it remembers."""

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""


class ReadyPose(NamedTuple):
    """How an arm stands when a policy begins to pick.

    Attributes
    ----------
    angles
        Of its joints, rad, shape ``(7,)``.
    opening
        Of each finger, metres.
    """

    angles: Array
    opening: float


class PolicyErrand(NamedTuple):
    """What a policy is asked for.

    Attributes
    ----------
    entity
        Of the thing.
    thing
        As it stands or is held at first, in the frame of the base.
    goal
        Where the middle of what the jaw holds is to be put down, in the frame of the base, metres, shape ``(3,)``; None
        where something is to be picked up.
    """

    entity: int
    thing: ObjectPose
    goal: Array | None


class ArmPolicy(Protocol):
    """A learned policy that moves an arm, and perhaps its base.

    Attributes
    ----------
    ready
        A planner brings the arm there before the policy picks, and before it places holds the thing beside its goal, a
        little above what that lies on: as episodes of training began. None: it begins with the arm as it is.
    drives
        Whether it moves the base: then it takes over in front of the thing; else where the arm reaches that.
    seconds
        That it is given for an errand.
    """

    ready: ReadyPose | None
    drives: bool
    seconds: float

    def begin(self, errand: PolicyErrand, servos: Array) -> None:
        """Begin an errand.

        Parameters
        ----------
        servos
            Where joints and fingers are told to be, shape ``(9,)``.
        """

    def act(self, observation: Mapping[str, Any], thing: ObjectPose) -> Array:
        """Return what the robot is told for the coming period, shape ``(11,)``.

        Places of joints (rad) and fingers (metres), speeds of the base ahead and to the left (m/s, rad/s).

        Raises
        ------
        vico.errors.InputError
            If the policy gives no usable action.
        """

    def state(self) -> AgentState:
        """Return all it remembers."""

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
