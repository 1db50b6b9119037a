"""One agent of a community as a Gymnasium environment; the others act by policies of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

from vico.envs.parallel import CommunityEnv
from vico.errors import InputError
from vico.sim.loop.simulation import StepResult


class Policy(Protocol):
    """Turns observations into actions; see `vico.agents.base.Agent`."""

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        """Return the action for the coming second."""


#: Given what all observe and their infos, as the simulation tells them, the actions of some agents by name.
Answers = Callable[[Mapping[str, dict[str, Any]], Mapping[str, dict[str, Any]]], Mapping[str, dict[str, Any]]]
#: Given the community's environment and the seed of an episode, the policies of agents by name, or what asks them all.
Others = Callable[[CommunityEnv, int], Mapping[str, Policy] | Answers]


class SingleAgentEnv(gymnasium.Env[Any, Any]):
    """One agent among others.

    Parameters
    ----------
    env
        The community.
    agent
        Whose observations and actions they are.
    others
        Gives those who act beside it; without it, and for whom it gives no policy, the others wait.

    Raises
    ------
    InputError
        If there is no such agent.
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012
    render_mode = "rgb_array"

    def __init__(self, env: CommunityEnv, agent: str, *, others: Others | None = None) -> None:
        self.community = env
        self.agent = agent
        self.observation_space = env.observation_space(agent)
        self.action_space = env.action_space(agent)
        self._make_others = others
        self._others: Answers = _nobody
        self._last: StepResult | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode; see `CommunityEnv.reset`."""
        super().reset(seed=seed)
        self._last = self.community.begin(seed)
        if self._make_others is not None:
            made = self._make_others(self.community, self.community.sim.config.seed)
            self._others = made if callable(made) else _one_by_one(made)
        return self.community.told(self.agent, self._last)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance until the agent is due again; the others act upon what they saw last."""
        own = {self.agent: action}
        while True:
            others = {} if self._last is None else self._others(self._last.observations, self._last.infos)
            self._last = self.community.advance({**others, **own})
            if self.agent in self._last.observations:
                observation, info = self.community.told(self.agent, self._last)
                return observation, 0.0, False, not self.community.agents, info
            own = {}

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which actions are possible now, as `sb3_contrib.MaskablePPO` asks for it.

        Raises
        ------
        InputError
            If the form of the environment has no masks.
        """
        community = self.community
        mask = community.forms[self.agent].mask(community.possible_agents.index(self.agent), community.sim.state)
        if mask is None:
            raise InputError("env: there are masks with form='arrays' alone, and for people alone")
        return mask.astype(bool)

    def render(self) -> NDArray[np.uint8]:
        """Return what the agent sees, uint8, shape ``(image, image, 3)``."""
        seen = {} if self._last is None else self._last.observations[self.agent]
        return seen["rgb"] if "rgb" in seen else self.community.render()

    def close(self) -> None:
        """Let go of the simulation."""
        self.community.close()


def _nobody(
    observations: Mapping[str, dict[str, Any]], infos: Mapping[str, dict[str, Any]]
) -> Mapping[str, dict[str, Any]]:
    return {}


def _one_by_one(policies: Mapping[str, Policy]) -> Answers:
    """Ask each of some policies that has an observation."""

    def answers(
        observations: Mapping[str, dict[str, Any]], infos: Mapping[str, dict[str, Any]]
    ) -> Mapping[str, dict[str, Any]]:
        return {n: one.act(observations[n], infos[n]) for n, one in policies.items() if n in observations}

    return answers
