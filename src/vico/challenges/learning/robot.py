"""Carry and Deliver of the community robot challenge for one learner, who is the mobile manipulator."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Info, Observation
from vico.agents.robot.body import Stance
from vico.agents.robot.carrier import Carrier
from vico.agents.robot.team import says_come
from vico.agents.state import AgentState
from vico.challenges.learning.env import Moment
from vico.challenges.learning.robot_stage import RobotOptions, RobotStage, is_usable
from vico.challenges.robot.episode import CARRIER, MANIPULATOR, UNUSABLE
from vico.challenges.robot.model import Category
from vico.community.model import Community
from vico.envs import StepResult
from vico.world.world import World

# The carrier comes after the other robot once that is so far away, metres, to so far behind it, and not oftener than
# every so many seconds.
_COMES, _BEHIND, _EVERY = 4.0, 2.2, 5.0


class RobotWork:
    """Carry or Deliver for a mobile manipulator, among residents and traffic; see `RobotStage`.

    The carrier is played: it comes along behind the manipulator, and where that calls it to.

    Fail: an action that holds NaN or infinity ends the episode; all else goes on until the time is over.
    """

    def __init__(
        self, world: World, community: Community, category: Category, options: RobotOptions, **settings: Any
    ) -> None:
        self.agent = MANIPULATOR
        self.stage = RobotStage(world, community, category, options, learners=(MANIPULATOR,), settings=settings)
        self.env, self.goal_space = self.stage.env, self.stage.goal_space

    def begin(self, seed: int) -> StepResult:
        """Draw the task of a seed."""
        period = self.stage.options.period
        return self.stage.begin(seed, {CARRIER: _ComesAlong(Carrier(MANIPULATOR, period=period), self._stance, period)})

    def act(self, action: Mapping[str, Any]) -> Moment:
        """Let the manipulator act for a period, the carrier and the residents as they are due, and judge."""
        stage = self.stage
        if not is_usable(action):
            return Moment(stage.result, 0.0, terminated=True, info={"is_success": False, "cause": UNUSABLE})
        result, held = stage.advance({MANIPULATOR: action}), stage.is_held()
        info: dict[str, Any] = {"is_held": held, "seconds": stage.steps * stage.options.period}
        if stage.success or stage.cut:
            info |= {"is_success": stage.success, "cause": stage.cause()}
        return Moment(result, stage.reward(), terminated=stage.success, truncated=stage.cut, info=info)

    def allows(self, action: Mapping[str, Any]) -> bool:
        """Everything."""
        return True

    def goal(self, result: StepResult) -> NDArray[np.float32]:
        """Return what is asked and what is seen of it, in numbers; see `RobotStage.goal`."""
        return self.stage.goal(MANIPULATOR, result)

    def phrases(self) -> list[str]:
        """Nothing is said."""
        return []

    def told(self) -> Mapping[str, Any]:
        """Return the instructions, as robots of the challenge get them."""
        return {"instructions": self.stage.task.instruction()}

    def _stance(self) -> Stance:
        return Stance.of(self.stage.result.observations[MANIPULATOR])


class _ComesAlong:
    """A carrier that comes after the other robot, which has no words where it acts in numbers.

    Parameters
    ----------
    carrier
        That is called.
    leader
        Returns where the other robot stands.
    period
        Seconds between two actions.
    """

    def __init__(self, carrier: Carrier, leader: Callable[[], Stance], period: float) -> None:
        self._carrier, self._leader, self._period = carrier, leader, period
        self._since = _EVERY

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self._since += self._period
        leader, here = self._leader(), Stance.of(observation)
        if self._since >= _EVERY and float(np.hypot(*(leader.position - here.position)[:2])) > _COMES:
            self._since = 0.0
            x, y = (leader.position[:2] - _BEHIND * leader.rotation[:2, 0]).tolist()
            call = {"speaker": MANIPULATOR, "text": says_come(x, y)}
            observation = {**observation, "events": [*observation["events"], call]}
        return self._carrier.act(observation, info)

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {"carrier": self._carrier.state(), "since": self._since}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._carrier.restore(state["carrier"])
        self._since = float(state["since"])
