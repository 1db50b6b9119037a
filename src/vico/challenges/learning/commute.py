"""The commute challenge for one learner: be in time at every place of a day; see `vico.challenges.commute`.

Commuters of several cities are stepped together, each city in a process of its own or on a machine of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.agents.commute.abstract_city import OBSERVATION_SIZE, STATE_SIZE, city_arrays, observe
from vico.agents.commute.learning import CommuteVectorEnv, fill_state, training_city
from vico.challenges.commute import tasks
from vico.challenges.commute.challenge import AGENT, CommuteInfo, refusal, set_up, stay_until, stops_of
from vico.challenges.commute.evaluate import CommuteLog, DayJudge
from vico.challenges.commute.generate import generate_commute
from vico.challenges.commute.tasks import CommuteTask
from vico.challenges.episodes import for_size
from vico.challenges.learning.env import TaskStep
from vico.clock import clock_of
from vico.envs import CommunityEnv, StepResult, make
from vico.envs.workers import Call
from vico.errors import InputError
from vico.rules import BUS_DWELL
from vico.runner.loop import Step
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.public import PublicMap
from vico.world.world import World


class Group(Protocol):
    """Objects elsewhere that are asked side by side: `vico.envs.workers.Workers`, `vico.jobs.cluster.RayActors`."""

    def __len__(self) -> int: ...

    def ask(self, calls: Sequence[Call | None]) -> list[Any]:
        """Make one call of each."""

    def ask_all(self, method: str) -> list[Any]:
        """Make the same call of each."""


def shard(world: str, num_envs: int, seed: int) -> CommuteVectorEnv:
    """Return the environment of one city, made where it is stepped."""
    return CommuteVectorEnv(
        [training_city(PublicMap.from_world(read_world(Path(world))))], num_envs=num_envs, seed=seed
    )


def shard_makers(worlds: Sequence[Path], *, num_envs: int, seed: int) -> list[partial[CommuteVectorEnv]]:
    """Return what makes the shards, to be handed to a `Group`.

    Raises
    ------
    InputError
        If `num_envs` is no multiple of the number of worlds.
    """
    if not worlds or num_envs < 1 or num_envs % len(worlds):
        raise InputError(f"commute training: {num_envs} agents in {len(worlds)} cities; give a multiple of them")
    seeds = [int(rng(seed, "commute training shard", k).integers(2**31)) for k in range(len(worlds))]
    each = num_envs // len(worlds)
    return [partial(shard, str(path.absolute()), each, one) for path, one in zip(worlds, seeds, strict=True)]


class ShardedCommuters:
    """All shards as one environment, with what `CommuteVectorEnv` has for a learner.

    Parameters
    ----------
    group
        The shards, as `shard_makers` makes them.
    num_envs
        Agents in all.
    """

    def __init__(self, group: Group, *, num_envs: int) -> None:
        self._group, self.num_envs = group, num_envs
        self.single_observation_space: gymnasium.spaces.Box = group.ask_all("single_observation_space")[0]
        self.single_action_space: gymnasium.spaces.Discrete = group.ask_all("single_action_space")[0]

    def reset(self) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode for every agent; what is seen has the shape ``(num_envs, fields)``."""
        return np.concatenate([seen for seen, _ in self._group.ask_all("reset")]), {}

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Advance all by a second; see `CommuteVectorEnv.step`."""
        parts = np.split(np.ascontiguousarray(actions, np.int64), len(self._group))
        answers = self._group.ask([Call("step", (part,)) for part in parts])
        *arrays, found = zip(*answers, strict=True)
        seen, rewards, reached, given_up = map(np.concatenate, arrays)
        return seen, rewards, reached, given_up, self._together(seen, found)

    def _together(self, seen: NDArray[np.float32], found: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """Return the infos of all shards as those of one environment."""
        each = self.num_envs // len(self._group)
        ended = [(k, one) for k, one in enumerate(found) if one]
        if not ended:
            return {}
        final = seen.copy()  # of shards where nobody was done, what they saw
        for k, one in ended:
            final[k * each : (k + 1) * each] = one["final_obs"]
        together: dict[str, Any] = {"final_obs": final}
        together["ended"] = np.concatenate([one["ended"] + k * each for k, one in ended])
        for name in ("returns", "seconds", "arrived", "late"):
            together[name] = np.concatenate([one[name] for _, one in ended])
        return together


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
        Of the day; see `vico.challenges.commute.tasks.HOURS`.
    reward
        ``"sparse"`` or ``"shaped"``.
    max_steps
        Steps of an episode, at most; None for as many as the day has.
    """

    commutes: int | None = None
    hours: float = tasks.HOURS
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
            "cars": for_size(tasks.CARS, world),
            "pedestrians": for_size(tasks.PEDESTRIANS, world),
            "observe": "none",
            "max_steps": 10**9,  # the day has an end of its own
            **settings,
        }
        self.env: CommunityEnv = make(world, None, **given)
        self.goal_space = spaces.Box(-10.0, 10.0, (OBSERVATION_SIZE,), np.float32)
        self._city = city_arrays(self.env.public_map, dwell=BUS_DWELL)
        self._known: dict[int, CommuteTask] = {}
        self._result: StepResult
        self._state, self._seen = np.zeros(STATE_SIZE), np.zeros(OBSERVATION_SIZE, np.float32)
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

    def act(self, action: Mapping[str, Any]) -> TaskStep:
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
        return TaskStep(self._result, reward, terminated=done, truncated=cut and not done, info=info)

    def allows(self, action: Mapping[str, Any]) -> bool:
        """Whether an action is legal on a commute."""
        return refusal(action, str(self._result.observations[AGENT]["state"]["vehicle"])) is None

    def goal(self, result: StepResult) -> NDArray[np.float32]:
        """Return what trained commuters see, as `vico.agents.commute.abstract_city.OBSERVATION_NAMES` has it."""
        fill_state(self._state, result.observations[AGENT], self._told.current())
        observe(self._city, self._state, self._seen)
        return self._seen.copy()

    def phrases(self) -> list[str]:
        """Nothing is said."""
        return []

    def instructions(self) -> Mapping[str, Any]:
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
