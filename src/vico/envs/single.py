"""One agent of a community as a Gymnasium environment; the others act by policies of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

from vico.envs.parallel import CommunityEnv


class Policy(Protocol):
    """Turns observations into actions; see `vico.agents.base.Agent`."""

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        """Return the action for the coming second."""


#: Given the community's environment and the seed of an episode, the policies of agents by name.
Others = Callable[[CommunityEnv, int], Mapping[str, Policy]]


class SingleAgentEnv(gymnasium.Env[dict[str, Any], Any]):
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
        self._others: Mapping[str, Policy] = {}
        self._seen: tuple[dict[str, Any], dict[str, Any]] = ({}, {})

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Start an episode; see `CommunityEnv.reset`."""
        super().reset(seed=seed)
        self._seen = self.community.reset(seed=seed, options=options)
        if self._make_others is not None:
            policies = self._make_others(self.community, self.community.sim.config.seed)
            self._others = {name: policy for name, policy in policies.items() if name != self.agent}
        observations, infos = self._seen
        return observations[self.agent], infos[self.agent]

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Advance until the agent is due again; the others act upon what they saw last."""
        me = self.agent
        actions = {me: action}
        while True:
            observations, infos = self._seen
            actions |= {
                n: policy.act(observations[n], infos[n]) for n, policy in self._others.items() if n in observations
            }
            observations, rewards, ended, cut, infos = self.community.step(actions)
            self._seen = observations, infos
            if me in observations:
                return observations[me], rewards[me], ended[me], cut[me], infos[me]
            actions = {}

    def render(self) -> NDArray[np.uint8]:
        """Return what the agent sees, uint8, shape ``(image, image, 3)``."""
        seen = self._seen[0].get(self.agent, {})
        return seen["rgb"] if "rgb" in seen else self.community.render()

    def close(self) -> None:
        """Let go of the simulation."""
        self.community.close()
