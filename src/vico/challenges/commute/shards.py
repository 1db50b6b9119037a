"""Commuters of several cities, each city in a process of its own or on a machine of its own, stepped together.

A shard is one city. Its episodes are drawn from a stream of its own, so what a learner sees depends on the cities and
the seed, and not on where the shards are.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

from vico.agents.commute.learning.env import CommuteVectorEnv
from vico.agents.commute.learning.worlds import training_city
from vico.envs.workers import Call
from vico.errors import InputError
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.public import PublicMap


class Group(Protocol):
    """Objects elsewhere that are asked side by side: `vico.envs.workers.Workers`, `vico.jobs.actors.RayActors`."""

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
        seen, rewards, reached, given_up = (np.concatenate([one[k] for one in answers]) for k in range(4))
        found = [one[4] for one in answers]
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
