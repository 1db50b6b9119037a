"""A Gymnasium environment for one agent, among residents who follow their day."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Unpack

from vico.agents.base import Agent
from vico.agents.schedule import followers_of
from vico.envs.parallel import CommunityEnv, make
from vico.envs.single import SingleAgentEnv
from vico.envs.spec import EnvOptions


def residents_of(env: CommunityEnv, seed: int) -> Mapping[str, Agent]:
    """Return followers of their schedules for all residents that take part."""
    if env.community is None:
        return {}
    followers = followers_of(env.community, env.public_map, seed=seed)
    return {name: follower for name, follower in followers.items() if name in env.possible_agents}


def make_single(
    world: Path | str,
    community: Path | str | None = None,
    *,
    agent: str = "assistant_0",
    **options: Unpack[EnvOptions],
) -> SingleAgentEnv:
    """Make the environment that is registered as ``vico/Community-v0``.

    Parameters
    ----------
    agent
        Whose observations and actions they are; one assistant takes part unless `assistants` says otherwise, and
        nobody else's views are rendered unless `observe` does.
    options
        See `vico.envs.spec.EnvSpec`.

    Raises
    ------
    InputError
        If there is no such agent, or the community belongs to another world.
    """
    given: EnvOptions = {"assistants": 1, "observe": (agent,), **options}
    return SingleAgentEnv(make(world, community, **given), agent, others=residents_of)
