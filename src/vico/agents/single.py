"""A Gymnasium environment for one agent, among residents who follow their day."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Unpack

from vico.agents.base import Action, Agent, Info, Observation, split_groups
from vico.agents.schedule import followers_of
from vico.envs.parallel import Answers, CommunityEnv, CommunitySource, SingleAgentEnv, WorldSource, make
from vico.envs.spec import EnvOptions
from vico.envs.vector import VectorAgentEnv, env_makers


def residents_of(env: CommunityEnv, seed: int) -> Mapping[str, Agent]:
    """Return followers of their schedules for all residents that take part."""
    if env.community is None:
        return {}
    followers = followers_of(env.community, env.public_map, seed=seed)
    return {name: follower for name, follower in followers.items() if name in env.possible_agents}


def action_function(agents: Mapping[str, Agent]) -> Answers:
    """Return what asks agents for their actions: those that belong together at once, the others one by one.

    An error of an agent's is raised.
    """
    groups, alone = split_groups(agents)

    def answers(observations: Mapping[str, Observation], infos: Mapping[str, Info]) -> dict[str, Action]:
        found: dict[str, Action] = {}
        for group, members in groups:
            asked = group.act_for([name for name in members if name in observations], observations, infos)
            for name, answer in asked.items():
                if isinstance(answer, Exception):
                    raise answer
                found[name] = answer
        for name in alone:
            if name in observations:
                found[name] = agents[name].act(observations[name], infos[name])
        return found

    return answers


def make_single(
    world: WorldSource,
    community: CommunitySource = None,
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
    return SingleAgentEnv(
        make(world, community, **given), agent, others=lambda env, seed: action_function(residents_of(env, seed))
    )


def make_vec(
    world: WorldSource,
    community: CommunitySource = None,
    *,
    num_envs: int,
    agent: str = "assistant_0",
    **options: Unpack[EnvOptions],
) -> VectorAgentEnv:
    """Make several environments for one agent each, among residents who follow their day, each in a process.

    Parameters
    ----------
    world, community
        Folders, or what was read from them: every process reads the world itself.
    num_envs
        How many; they begin with the seeds ``seed``, ``seed + 1`` and on.
    agent, options
        See `make_single`.

    Raises
    ------
    InputError
        If the world has no folder.
    WorkerError
        If an environment cannot be made: no such agent, a community of another world.
    """
    given = {"agent": agent, **options}
    return VectorAgentEnv(env_makers(make_single, world, community, num_envs=num_envs, options=given))
