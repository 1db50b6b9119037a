"""Carry and Deliver of the community robot challenge for two learners at once, as a PettingZoo environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from vico.challenges.learning.env import begun
from vico.challenges.learning.goals import with_goal, with_goal_space
from vico.challenges.learning.robot_stage import RobotOptions, RobotStage, is_usable
from vico.challenges.robot.episode import CARRIER, MANIPULATOR, UNUSABLE
from vico.challenges.robot.model import Category
from vico.community.model import Community
from vico.envs import StepResult
from vico.envs.form_options import FormOptions
from vico.errors import InputError
from vico.seeds import rng
from vico.world.world import World


class RobotTeamEnv(ParallelEnv):  # type: ignore[misc]
    """Carry or Deliver for the mobile manipulator, ``robot_0``, and the carrier, ``robot_1``.

    Task: as in the challenge (`vico.challenges.robot`); what is asked stands in ``info["instructions"]`` after a reset
    and, in numbers, in the ``goal`` of each observation (`RobotStage.goal`).

    Randomizations: those of the challenge; `reset(seed=n)` starts episode ``n``, without a seed numbers are drawn.

    Success: the challenge's own rule. It ends the episode for both; so does an action of either that holds NaN or
    infinity. Both are given the same reward (`RobotStage`), and both are cut off when the time is over.

    Parameters
    ----------
    tasks
        How many different episodes there are: a seed counts modulo this; None sets no limit.
    seed
        Of the numbers that are drawn before `reset` is given a seed.
    settings
        Of `vico.envs.spec.EnvSpec`.

    Raises
    ------
    InputError
        If there are no tasks, or an option is not usable.
    """

    metadata = {"render_modes": ["rgb_array"], "name": "vico/RobotTeam-v0", "is_parallelizable": True}  # noqa: RUF012
    render_mode = "rgb_array"

    def __init__(
        self,
        world: World,
        community: Community,
        category: Category,
        options: RobotOptions,
        *,
        tasks: int | None = None,
        seed: int = 0,
        **settings: Any,
    ) -> None:
        if tasks is not None and tasks < 1:
            raise InputError(f"env: tasks is {tasks}; it has to be 1 or more")
        self.possible_agents = [MANIPULATOR, CARRIER]
        self.agents: list[str] = []
        self.stage = RobotStage(world, community, category, options, learners=self.possible_agents, settings=settings)
        self._tasks = tasks
        self._random = rng(seed, "robot team episodes")
        self._plain_infos = FormOptions.of(self.stage.env.spec.form).name == "arrays"
        forms, goal = self.stage.env.forms, self.stage.goal_space
        self._observations = {
            name: with_goal_space(forms[name].observation_space, goal) for name in self.possible_agents
        }

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Space of a robot's observations; the same object each time."""
        if agent not in self._observations:
            raise InputError(f"env: no agent is called {agent!r}; there are {', '.join(self.possible_agents)}")
        return self._observations[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Space of a robot's actions; the same object each time."""
        return self.stage.env.action_space(agent)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode; in the rich form ``info`` holds its number as ``task``, and ``instructions``.

        Raises
        ------
        VicoError
            If the world does not hold the task with this seed; or none of many, where no seed is given.
        """
        if seed is not None:
            self._random = rng(seed, "robot team episodes")
        number, result = begun(self._begin, seed, tasks=self._tasks, random=self._random)
        self.agents = list(self.possible_agents)
        return self._told(result, {"task": number, "instructions": self.stage.task.instruction()})

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Let both act for a period; who has no action waits.

        Raises
        ------
        InputError
            If the episode is over, or has not begun.
        """
        if not self.agents:
            raise InputError("env: the episode is over (or has not begun); call reset() before step()")
        stage, names = self.stage, self.possible_agents
        short = {name: stage.env.forms[name].decode(action) for name, action in actions.items() if name in names}
        usable = all(is_usable(action) for action in short.values())
        reward, cause = 0.0, UNUSABLE
        if usable:
            stage.advance(short)
            reward, cause = stage.reward(), stage.cause()
        over, cut = stage.success or not usable, usable and stage.cut
        info: dict[str, Any] = {"is_held": stage.is_held(), "seconds": stage.steps * stage.options.period}
        if over or cut:
            self.agents = []
            info |= {"is_success": stage.success and usable, "cause": cause}
        observations, infos = self._told(stage.result, info)
        return (
            observations,
            dict.fromkeys(names, reward),
            dict.fromkeys(names, over),
            dict.fromkeys(names, cut),
            infos,
        )

    def render(self) -> NDArray[np.uint8]:
        """Return what both see, side by side, uint8, shape ``(image, 2 * image, 3)``."""
        return self.stage.env.render()

    def state_hash(self) -> str:
        """Hash of the whole state."""
        return self.stage.env.state_hash()

    def close(self) -> None:
        """Let go of the simulation."""
        self.stage.env.close()
        self.agents = []

    def _begin(self, number: int) -> StepResult:
        return self.stage.begin(number, {})

    def _told(self, result: StepResult, more: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Return what each is told; in the array form infos hold numbers alone, which libraries make tensors of."""
        observations: dict[str, Any] = {}
        infos: dict[str, dict[str, Any]] = {}
        for name in self.possible_agents:
            observation, info = self.stage.env.told(name, result)
            observations[name] = with_goal(observation, self.stage.goal(name, result), self.stage.goal_space)
            if self._plain_infos:
                infos[name] = {
                    key: float(value) for key, value in more.items() if isinstance(value, bool | int | float)
                }
            else:
                infos[name] = {**info, **more}
        return observations, infos
