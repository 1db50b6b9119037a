"""Trained policies as a robot's arm in a city: each is told what it was trained on, at the rate it was trained at."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.following import turned_aside
from vico.agents.robot.increments import PERIOD
from vico.agents.robot.policy_clock import PolicyClock
from vico.agents.robot.skill import Errand, Ready
from vico.agents.robot.thing_watch import ThingPose, presses
from vico.agents.state import AgentState
from vico.challenges.learning.manipulation.controller import ArmController, ArmMoment
from vico.challenges.learning.manipulation.draws import APART, OPENING, RAISED, ready_angles
from vico.challenges.learning.manipulation.options import RATE
from vico.errors import InputError

Array = NDArray[np.float64]

#: Seconds that policies are given for an errand: those of an episode of training by reinforcement (the paper's 250
#: steps at 20 Hz), and half of an episode of imitation, which has a minute for either part.
RL_SECONDS, IMITATION_SECONDS = 12.5, 60.0
# What lies higher than this above the ground is put on something, metres.
_RAISED_GROUND = 0.15


class ReinforcedArm:
    """Acts with dense networks that `scripts/train_manipulation.py` has trained.

    The observation is the environments' own (`vico.challenges.learning.manipulation.observation`), made from joints,
    finger contacts and the box of the thing, all in the frame of the base, which is told as standing where it is.

    Parameters
    ----------
    pick, place
        For either part; twice the same for a policy of PickPlace.
    lifts
        Whether the first was trained to lift: its goal is above the thing, else beside it on what it stands on.
    period
        Seconds between two actions of the robot.
    """

    drives = False
    seconds = RL_SECONDS

    def __init__(self, pick: ArmController, place: ArmController, *, lifts: bool, period: float) -> None:
        self.ready: Ready | None = Ready(np.array(ready_angles()), OPENING)
        self._pick, self._place = pick, place
        self._lifts = lifts
        self._clock = PolicyClock(period, own=1.0 / RATE)
        self._places = False
        self._entity = 0
        self._goal = np.zeros(3)
        self._from = self._to = np.zeros(9)

    def begin(self, errand: Errand, servos: Array) -> None:
        """Begin an errand."""
        self._places, self._entity = errand.goal is not None, errand.entity
        self._goal = self._picking_goal(errand.thing) if errand.goal is None else errand.goal.copy()
        self._from = self._to = servos.copy()
        self._clock.ticks = 0

    def act(self, observation: Mapping[str, Any], thing: ThingPose) -> Array:
        """Return what the robot is told for the coming period, shape ``(11,)``; the base stands.

        Raises
        ------
        InputError
            If the policy's action holds NaN or infinity.
        """
        due = self._clock.tick()
        controller = self._place if self._places else self._pick
        moment = moment_of(observation, thing, self._goal, pressing=presses(observation, self._entity))
        for _ in range(due.asks):
            self._from = self._to
            controller.reset(self._from)
            self._to = controller.targets(moment)
            if not np.isfinite(self._to).all():
                raise InputError("policy: its action holds NaN or infinity")
        return np.concatenate([self._from + due.share * (self._to - self._from), [0.0, 0.0]])

    def _picking_goal(self, thing: ThingPose) -> Array:
        """Return a goal as training draws it, metres."""
        if self._lifts:
            return thing.middle + np.array([0.0, 0.0, sum(RAISED) / 2])
        # On the side where the arm has more room, as far off as goals are at least and a little more.
        return turned_aside(thing.middle, -1.1 * APART if thing.middle[1] > 0.0 else 1.1 * APART)

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "ticks": self._clock.ticks,
            "places": self._places,
            "entity": self._entity,
            "goal": self._goal.copy(),
            "servos": np.stack([self._from, self._to]),
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._clock.ticks, self._places = int(state["ticks"]), bool(state["places"])
        self._entity, self._goal = int(state["entity"]), np.array(state["goal"])
        self._from, self._to = np.array(state["servos"])


class Imitator(Protocol):
    """A policy that was shown how: `ChunkActor`, `LeRobotActor`."""

    def reset(self) -> None:
        """Forget what was to be done: a new episode begins."""

    def act(self, observation: Mapping[str, Any], instruction: str) -> dict[str, Any]:
        """Return the action for a twentieth of a second."""


class ImitatingArm:
    """Acts with a policy that looks at pictures, feels joints, and reads an instruction.

    Parameters
    ----------
    actor
        The policy; it drives the base, too.
    thing, destination
        As the instruction names them.
    by_deck
        Whether what is picked is going to be put on a deck.
    stand
        Height of the base's frame above the ground, metres.
    period
        Seconds between two actions of the robot.
    """

    ready: Ready | None = None
    drives = True
    seconds = IMITATION_SECONDS

    def __init__(
        self, actor: Imitator, *, thing: str, destination: str, by_deck: bool, stand: float, period: float
    ) -> None:
        self._actor, self._thing, self._destination = actor, thing, destination
        self._by_deck, self._stand = by_deck, stand
        self._clock = PolicyClock(period, own=PERIOD)
        self.instruction = ""
        self._from = self._to = np.zeros(11)

    def begin(self, errand: Errand, servos: Array) -> None:
        """Begin an errand, told in the words of training."""
        raised = self._by_deck
        if errand.goal is not None:
            underside = float(errand.goal[2] - errand.thing.middle[2]) + errand.thing.low
            raised = underside + self._stand > _RAISED_GROUND
        where = "on the table" if raised else f"down next to the {self._destination}"
        self.instruction = f"Pick up the {self._thing} and put it {where}."
        self._actor.reset()
        self._from = self._to = np.concatenate([servos, [0.0, 0.0]])
        self._clock.ticks = 0

    def act(self, observation: Mapping[str, Any], thing: ThingPose) -> Array:
        """Return what the robot is told for the coming period, shape ``(11,)``.

        Raises
        ------
        InputError
            If the policy's action is none.
        """
        due = self._clock.tick()
        speeds = []
        for _ in range(due.asks):
            self._from = self._to
            self._to = np.asarray(self._actor.act(observation, self.instruction)["vector"], np.float64)
            if not np.isfinite(self._to).all():
                raise InputError("policy: its action holds NaN or infinity")
            speeds.append(self._to[9:])
        servos = self._from[:9] + due.share * (self._to[:9] - self._from[:9])
        return np.concatenate([servos, np.mean(speeds, axis=0) if speeds else self._to[9:]])

    def state(self) -> AgentState:
        """Return all it remembers.

        Raises
        ------
        InputError
            If the policy keeps what it is at to itself, as LeRobot's do.
        """
        remembered = getattr(self._actor, "state", None)
        if remembered is None:
            raise InputError("policy: LeRobot's policies keep their actions inside: no run can be saved in the middle")
        said = {"instruction": self.instruction, "ticks": self._clock.ticks, "servos": np.stack([self._from, self._to])}
        return {**said, "actor": remembered()}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._actor.restore(state["actor"])  # type: ignore[attr-defined]
        self.instruction, self._clock.ticks = str(state["instruction"]), int(state["ticks"])
        self._from, self._to = np.array(state["servos"])


def moment_of(
    observation: Mapping[str, Any], thing: ThingPose, goal: Array, *, pressing: NDArray[np.bool_]
) -> ArmMoment:
    """Return what a policy is told of an arm and its thing; all in the frame of the base."""
    sensors = observation["sensors"]
    return ArmMoment(
        joints=np.asarray(sensors["joint_position"], np.float64),
        joint_rates=np.asarray(sensors["joint_velocity"], np.float64),
        box=thing.middle,
        box_rotation=thing.rotation,
        half=thing.half,
        goal=goal,
        pressing=pressing,
    )
