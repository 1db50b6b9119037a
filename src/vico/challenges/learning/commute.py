"""The commute challenge for one learner: be in time at every place of a day; see `vico.challenges.commute`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.agents.commute.learning.city import city_arrays
from vico.agents.commute.learning.fields import ALL_FIELDS, SEEN
from vico.agents.commute.learning.kernels import see
from vico.agents.commute.learning.policy import take_in
from vico.challenges.commute import rules
from vico.challenges.commute.generate import generate_commute
from vico.challenges.commute.judge import CommuteLog, DayJudge
from vico.challenges.commute.legal import CommuteInfo, refusal
from vico.challenges.commute.model import CommuteTask
from vico.challenges.commute.play import AGENT, for_size, set_up, stay_until, stops_of
from vico.challenges.learning.env import Moment
from vico.clock import clock_of
from vico.envs import CommunityEnv, StepResult, make
from vico.errors import InputError
from vico.rules import BUS_DWELL
from vico.runner.loop import Step
from vico.world.world import World

#: What a day's last place, a place in time, and one too late are worth.
IN_TIME, LATE = 1.0, 0.5
#: Of the paper's reward, what one unit is here.
PAPER_UNIT = 0.01


@dataclass(frozen=True, kw_only=True)
class CommuteOptions:
    """What an episode is.

    Attributes
    ----------
    commutes
        After how many commutes it is over; None for the whole day.
    hours
        Of the day; see `vico.challenges.commute.rules.HOURS`.
    reward
        ``"sparse"`` or ``"shaped"``.
    max_steps
        Steps of an episode, at most; None for as many as the day has.
    """

    commutes: int | None = None
    hours: float = rules.HOURS
    reward: str = "sparse"
    max_steps: int | None = None


class CommuteTaskEnv:
    """A commuter's day.

    Task, randomisation and success are those of the challenge. An agent is asked while it is on its way alone; a step
    in which it arrives lasts until its stay is over. What is not legal on a commute is done as a wait.

    Reward: 1 for a place reached in time, 0.5 for one reached late, 0 for one that is missed. Shaped: a hundredth of
    the paper's beside it: the metres that one got nearer, -1 a step on foot, -1 a unit of money, -0.1 an action.
    """

    def __init__(self, world: World, options: CommuteOptions, **settings: Any) -> None:
        if options.reward not in ("sparse", "shaped"):
            raise InputError(f"env: reward is {options.reward!r}; use 'sparse' or 'shaped'")
        if options.commutes is not None and options.commutes < 1:
            raise InputError(f"env: commutes is {options.commutes}; it has to be 1 or more")
        self.options, self.agent = options, AGENT
        given = {
            "assistants": 1,
            "cars": for_size(rules.CARS, world),
            "pedestrians": for_size(rules.PEDESTRIANS, world),
            "observe": "none",
            "max_steps": 10**9,  # the day has an end of its own
            **settings,
        }
        self.env: CommunityEnv = make(world, None, **given)
        self.goal_space = spaces.Box(-10.0, 10.0, (SEEN,), np.float32)
        self._city = city_arrays(self.env.public_map, dwell=BUS_DWELL)
        self._known: dict[int, CommuteTask] = {}
        self._result: StepResult
        self._state, self._seen = np.zeros(ALL_FIELDS), np.zeros(SEEN, np.float32)
        self._steps = 0

    def begin(self, seed: int) -> StepResult:
        """Draw the day of a seed."""
        if seed not in self._known:
            self._known[seed] = generate_commute(self.env.world, seed=seed, hours=self.options.hours)
        self._day = self._known[seed]
        self.env.arrange(partial(set_up, task=self._day), start=self._day.appointments[0].end)
        self._result = self.env.begin(self._day.seed)
        self._steps, self._told = 0, CommuteInfo(self._day.instructions())
        self._judge = DayJudge(self._day, AGENT, self.env.sim.ground_truth, stops_of(self.env.public_map))
        self._judge.begin(self._result.observations)
        return self._result

    def act(self, action: Mapping[str, Any]) -> Moment:
        """Do what is legal for a second; on arrival let the stay pass."""
        judge, log = self._judge, self._judge.logs[-1]
        vehicle = str(self._result.observations[AGENT]["state"]["vehicle"])
        refused = refusal(action, vehicle)
        before = self._away(log)
        spent = log.spent
        self._result = self.env.advance({AGENT: {"type": "wait"} if refused else action})
        self._steps += 1
        judge.on_step(Step(self._steps, {}, {}, self._result))
        reward = self._worth(log)
        if self.options.reward == "shaped":
            on_foot = not vehicle
            paper = (before - self._away(log)) - on_foot - (log.spent - spent) - 0.1
            reward += PAPER_UNIT * paper
        done = judge.over or self._commutes() >= (self.options.commutes or math.inf)
        if judge.stays and not done:
            self._stay()
        self._told.index = min(len(judge.logs), len(self._day.appointments) - 1)
        cut = self.options.max_steps is not None and self._steps >= self.options.max_steps
        info: dict[str, Any] = {
            "commutes": self._commutes(),
            "in_time": self._in_time(),
            "illegal": refused is not None,
        }
        if refused is not None:
            info["action_code"], info["action_reason"] = refused
        if done:
            info["is_success"] = self._in_time() == self._commutes()
        return Moment(self._result, reward, terminated=done, truncated=cut and not done, info=info)

    def allows(self, action: Mapping[str, Any]) -> bool:
        """Whether an action is legal on a commute."""
        return refusal(action, str(self._result.observations[AGENT]["state"]["vehicle"])) is None

    def goal(self, result: StepResult) -> NDArray[np.float32]:
        """Return what trained commuters see, as `vico.agents.commute.learning.fields.SEEN_NAMES` has it."""
        take_in(self._state, result.observations[AGENT], self._told.current())
        see(self._city, self._state, self._seen)
        return self._seen.copy()

    def phrases(self) -> list[str]:
        """Nothing is said."""
        return []

    def told(self) -> Mapping[str, Any]:
        """Return the day."""
        start = clock_of(self._day.appointments[0].end)
        return {"instructions": self._day.instructions(), "starts": start}

    def _stay(self) -> None:
        stay_until(self.env.sim, self._judge.logs[-1].item.end)
        observations, infos = self.env.sim.observe()
        self._result = StepResult(observations, infos, self._result.events, self.env.sim.state_hash)
        self._judge.release(float(self.env.sim.state.second))
        self._judge.begin(observations)

    def _worth(self, log: CommuteLog) -> float:
        """Return what a commute that ended in this step is worth."""
        if log.ended is None or log.arrived is None:
            return 0.0
        return LATE if log.late else IN_TIME

    def _commutes(self) -> int:
        return sum(log.ended is not None for log in self._judge.logs)

    def _in_time(self) -> int:
        return sum(log.ended is not None and not log.late for log in self._judge.logs)

    def _away(self, log: CommuteLog) -> float:
        x, y = self._result.observations[AGENT]["pose"][:2]
        return math.dist((float(x), float(y)), log.item.position)
