"""A task as a Gymnasium environment: one agent learns, the others live their day, a judge gives the reward.

The goal is told beside what is observed: in a space of its own, or behind the numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.envs import CommunityEnv, StepResult
from vico.envs.forms import ArrayForm
from vico.errors import InputError, VicoError


def with_goal_space(space: spaces.Space[Any], goal: spaces.Box[Any]) -> spaces.Space[Any]:
    """Return the space of observations with a goal: one more entry of a Dict, more numbers of a Box."""
    if isinstance(space, spaces.Box):
        low, high = (np.concatenate([a, b.reshape(-1)]) for a, b in ((space.low, goal.low), (space.high, goal.high)))
        return spaces.Box(low, high, dtype=np.float32)
    assert isinstance(space, spaces.Dict)
    return spaces.Dict({**space.spaces, "goal": goal})


def with_goal(observation: Any, goal: NDArray[np.float32], space: spaces.Box[Any]) -> Any:
    """Return an observation with a goal, whose numbers are cut off at the bounds of its space."""
    told = np.clip(goal, space.low, space.high).astype(np.float32)
    if isinstance(observation, np.ndarray):
        return np.concatenate([observation, told.reshape(-1)])
    return {**observation, "goal": told}


#: Numbers of tasks are drawn below this where their number is not limited.
_MANY = 2**31 - 1
# A task that a world does not hold is passed over; after so many in a row the world holds none.
_TRIES = 20


@dataclass(frozen=True)
class TaskStep:
    """What came of an action.

    Attributes
    ----------
    result
        What the simulation tells.
    terminated
        Whether the task is over: done, failed, or everything reported.
    truncated
        Whether it was cut off: the steps of an episode are over.
    info
        What is told beside: how the task stands.
    """

    result: StepResult
    reward: float
    terminated: bool = False
    truncated: bool = False
    info: Mapping[str, Any] = field(default_factory=dict)


class LearningTask(Protocol):
    """A task for one agent, one episode after the other.

    Attributes
    ----------
    env
        In which it takes place.
    agent
        Who learns.
    goal_space
        Of what `goal` returns.
    """

    env: CommunityEnv
    agent: str
    goal_space: spaces.Box[Any]

    def begin(self, seed: int) -> StepResult:
        """Start the episode of a number.

        Raises
        ------
        VicoError
            If the world does not hold what the task needs.
        """

    def act(self, action: Mapping[str, Any]) -> TaskStep:
        """Do what the agent asks for, until it is asked again."""

    def allows(self, action: Mapping[str, Any]) -> bool:
        """Whether the rules of the task let the agent do an action now; the simulation has rules of its own."""

    def goal(self, result: StepResult) -> NDArray[np.float32]:
        """Return what the agent is told of its task, as numbers."""

    def phrases(self) -> list[str]:
        """Return what `communicate` says in this episode, beside the usual phrases."""

    def instructions(self) -> Mapping[str, Any]:
        """Return what the agent is told at the start, in words and names."""


class TaskEnv(gymnasium.Env[Any, Any]):
    """One agent's task.

    Observations are the agent's, in the form of the task's community, and ``goal`` beside them (in one Box: behind
    them). Episodes are numbered: `reset(seed=n)` starts number ``n``; without a seed numbers are drawn from the stream
    of chance that the last seed began, at first the one given here.

    Parameters
    ----------
    task
        What is to be done.
    tasks
        How many different episodes there are: a seed counts modulo this; None sets no limit. A task is made when its
        number first comes up and then kept, which saves seconds an episode.
    seed
        Of the numbers that are drawn before `reset` is given a seed.
    render_mode
        None, or ``"rgb_array"``.

    Raises
    ------
    InputError
        If there are no tasks, or there is no such render mode.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 1}  # noqa: RUF012

    def __init__(
        self, task: LearningTask, *, tasks: int | None = None, seed: int = 0, render_mode: str | None = None
    ) -> None:
        if tasks is not None and tasks < 1:
            raise InputError(f"env: tasks is {tasks}; it has to be 1 or more")
        if render_mode not in (None, "rgb_array"):
            raise InputError(f"env: render_mode is {render_mode!r}; use None or 'rgb_array'")
        self.task, self.render_mode = task, render_mode
        self._tasks, self._first_seed = tasks, seed
        self._form = task.env.forms[task.agent]
        self.observation_space = with_goal_space(self._form.observation_space, task.goal_space)
        self.action_space = self._form.action_space
        self._last: StepResult | None = None
        self._over = True

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode; ``info`` holds its number as ``task`` and what is asked.

        Raises
        ------
        VicoError
            If the world does not hold the task with this seed; or none of many, where no seed is given.
        """
        if seed is None and self._np_random is None:
            seed = self._first_seed
            super().reset(seed=seed)
        else:
            super().reset(seed=seed)
        number, self._last = begin_episode(self.task.begin, seed, tasks=self._tasks, random=self.np_random)
        self._over = False
        if isinstance(self._form, ArrayForm):
            self._form.allows = self.task.allows
            self._form.say(self.task.phrases())
        observation, info = self._with_goal(self._last)
        return observation, {**info, **self.task.instructions(), "task": number}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Act until the agent is asked again.

        Raises
        ------
        InputError
            If the episode is over, or has not begun.
        """
        if self._over:
            raise InputError("env: the episode is over (or has not begun); call reset() before step()")
        moment = self.task.act(self._form.decode(action))
        self._last, self._over = moment.result, moment.terminated or moment.truncated
        observation, info = self._with_goal(moment.result)
        return observation, float(moment.reward), moment.terminated, moment.truncated, {**info, **moment.info}

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which actions are possible now, as `sb3_contrib.MaskablePPO` asks for it; all, where nobody knows."""
        community = self.task.env
        mask = self._form.mask(community.possible_agents.index(self.task.agent), community.sim.state)
        if mask is None:
            raise InputError("env: there are masks with form='arrays' alone, and for people alone")
        return mask.astype(bool)

    def render(self) -> NDArray[np.uint8] | None:
        """Return what the agent sees, uint8, shape ``(image, image, 3)``; black where it is given no pictures."""
        if self.render_mode is None:
            return None
        seen = {} if self._last is None else self._last.observations[self.task.agent]
        side = self.task.env.config.image
        return np.asarray(seen["rgb"]).copy() if "rgb" in seen else np.zeros((side, side, 3), np.uint8)

    def close(self) -> None:
        """Let go of the simulation."""
        self.task.env.close()
        self._last, self._over = None, True

    def _with_goal(self, result: StepResult) -> tuple[Any, dict[str, Any]]:
        observation, info = self.task.env.told(self.task.agent, result)
        return with_goal(observation, self.task.goal(result), self.task.goal_space), info


def begin_episode(
    begin: Callable[[int], StepResult], seed: int | None, *, tasks: int | None, random: np.random.Generator
) -> tuple[int, StepResult]:
    """Start the episode of a seed; of the first number drawn that the world holds, where there is none.

    Parameters
    ----------
    begin
        Starts the episode of a number.
    tasks
        How many different episodes there are; None sets no limit.
    random
        Draws numbers.

    Raises
    ------
    VicoError
        If the world does not hold the task with this seed; or none of many, where no seed is given.
    """
    if seed is not None:
        number = seed if tasks is None else seed % tasks
        return number, begin(number)
    for _ in range(_TRIES - 1):
        number = int(random.integers(tasks or _MANY))
        try:
            return number, begin(number)
        except VicoError:
            continue
    number = int(random.integers(tasks or _MANY))
    return number, begin(number)
