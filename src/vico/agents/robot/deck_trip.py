"""A thing's way on a carrier's deck, as the robot with the arm sees to it: called, loaded, sent ahead, unloaded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Observation
from vico.agents.robot.body import Stance, metres_apart
from vico.agents.robot.driving import Drive
from vico.agents.robot.skill import ArmSkill
from vico.agents.robot.stages import ErrandStage
from vico.agents.robot.team import Team, deck_spot, says_come, told_where
from vico.agents.state import AgentState

Array = NDArray[np.float64]

#: How near one comes to where things are put down, metres.
AT_GOAL = 2.0
_WAITS = 90.0  # seconds until a carrier is waited for no longer
# Where the carrier is called to, from the robot with the arm, and how far off it may be, metres.
_ASIDE, _BY = 2.2, 6.0


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
        self._carrier_at = told_where(text) or self._carrier_at

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
        if at is not None and metres_apart(at.position, here.position) < _BY:
            held = self._worker.held
            wide = 0.0 if held is None else 2.0 * float(held.half[0])
            spot, beside = deck_spot(self._team.deck, at, here.position, wide=wide)
            self._worker.place(spot, beside=beside)
            return DeckStep(self._worker.act(observation))
        return DeckStep({"type": "stop"}, ErrandStage.BRING if self._waited > _WAITS else None)

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
        return DeckStep({"type": "stop"}, ErrandStage.END if self._waited > 2.0 * _WAITS else None)

    def _call(self, to: Array) -> DeckStep:
        self._began, self._carrier_at = True, None
        return DeckStep({"type": "communicate", "text": says_come(*to.tolist())})

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
