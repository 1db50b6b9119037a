"""Cities that are stepped elsewhere: the same episodes wherever they are, also when a process is lost on the way."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ray_nodes import needs_ray
from toy_service import Known
from vico.challenges.learning.commute import ShardedCommuters, shard, shard_makers
from vico.envs.workers import Call, Workers
from vico.errors import InputError

AGENTS, STEPS = 8, 40


class Here:
    """Shards in this process."""

    def __init__(self, makers: list[Callable[[], Any]]) -> None:
        self._made = [maker() for maker in makers]

    def __len__(self) -> int:
        return len(self._made)

    def ask(self, calls: list[Call]) -> list[Any]:
        found = [getattr(one, call.method) for one, call in zip(self._made, calls, strict=True)]
        return [f(*call.arguments) if callable(f) else f for f, call in zip(found, calls, strict=True)]

    def ask_all(self, method: str) -> list[Any]:
        return self.ask([Call(method)] * len(self._made))


def rollout(group: Any, *, at: int = -1, do: Callable[[], None] = lambda: None) -> list[Any]:
    """Return all that a rollout sees, with something done to the group on the way."""
    env = ShardedCommuters(group, num_envs=AGENTS)
    chance = np.random.default_rng(3)
    kept: list[Any] = [env.reset()[0]]
    for k in range(STEPS):
        if k == at:
            do()
        seen, rewards, reached, given_up, infos = env.step(chance.integers(0, env.single_action_space.n, AGENTS))
        kept += [seen, rewards, reached, given_up, *(infos[name] for name in sorted(infos))]
    return kept


def assert_same(one: list[Any], other: list[Any]) -> None:
    assert len(one) == len(other)
    for mine, theirs in zip(one, other, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_processes_see_what_one_process_sees(helsinki_path: Path) -> None:
    makers = shard_makers([helsinki_path, helsinki_path], num_envs=AGENTS, seed=4)
    here = rollout(Here(makers))
    assert here[0].shape == (AGENTS, here[0].shape[1])
    assert not np.array_equal(here[0][:4], here[0][4:])  # each city draws its own episodes
    workers = Workers(makers)
    try:
        assert_same(rollout(workers), here)
    finally:
        workers.close()
    with pytest.raises(InputError, match="9 agents in 2 cities"):
        shard_makers([helsinki_path] * 2, num_envs=9, seed=4)


@needs_ray
def test_a_city_whose_process_is_killed_comes_back_as_it_was(helsinki_path: Path) -> None:
    from vico.jobs.cluster import RayActors

    makers = shard_makers([helsinki_path, helsinki_path], num_envs=AGENTS, seed=4)
    here = rollout(Here(makers))
    group = RayActors([partial(Known, maker) for maker in makers], address="local")

    def kill() -> None:
        os.kill(group.ask_all("process")[1], signal.SIGKILL)
        time.sleep(0.5)

    try:
        assert_same(rollout(group, at=STEPS // 2, do=kill), here)
    finally:
        group.close()


def test_a_shard_is_an_environment_of_one_city(helsinki_path: Path) -> None:
    env = shard(str(helsinki_path), 3, 7)
    assert env.reset()[0].shape[0] == 3
