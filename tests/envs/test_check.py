"""The checker of environments: silent on ours, and it tells each promise that is broken."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import toy_city
import vico
from vico.envs import CommunityEnv, check_env


class Wrapped:
    """Ours, with a fault put in."""

    def __init__(self, fault: str) -> None:
        self.env = small()
        self.fault = fault
        self.resets = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.env, name)

    def action_space(self, name: str) -> Any:
        space = self.env.action_space(name)
        return type(space)(dict(space.spaces)) if self.fault == "contract" else space

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        self.resets += 1
        return self.env.reset(seed=(seed or 0) + self.resets if self.fault == "repeatable" else seed)

    def step(self, actions: dict[str, Any]) -> Any:
        observations, rewards, ended, cut, infos = self.env.step(actions)
        if self.fault == "space":
            observations["assistant_0"]["pose"] = np.zeros(3)
        if self.fault == "refusal":
            observations["assistant_0"]["state"]["action_code"] = ""
        if self.fault == "ending":
            ended["assistant_0"] = True
        return observations, rewards, ended, cut, infos


def small() -> CommunityEnv:
    return vico.make(toy_city.world(), toy_city.community(), assistants=1, observe="none", max_steps=12)


def test_our_environment_keeps_its_promises() -> None:
    assert check_env(small(), seed=3) == []


@pytest.mark.parametrize("promise", ["contract", "space", "repeatable", "refusal", "ending"])
def test_a_broken_promise_is_found(promise: str) -> None:
    assert promise in {finding.promise for finding in check_env(Wrapped(promise), seed=1)}  # type: ignore[arg-type]


class Forgetful(CommunityEnv):
    """Leaves the people out of its snapshots."""

    def snapshot(self) -> dict[str, Any]:
        """Return a snapshot in which people are where they are when it is restored."""
        return {name: array for name, array in super().snapshot().items() if not name.startswith("people.")}

    def restore(self, arrays: Mapping[str, Any]) -> None:
        """Go back to it, people apart."""
        super().restore({**self.sim.snapshot(), **arrays})


class Sticky(CommunityEnv):
    """Gives people what they had at the end of the episode before."""

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Start an episode that is richer by the seed of the last one."""
        last = self.config.seed
        result = super().reset(seed, options)
        self.sim.state.people.cash += last if seed is not None and last != seed else 0
        return result if last == seed else self.sim.observe()


def test_a_snapshot_that_lacks_something_is_found() -> None:
    environment = Forgetful(toy_city.world(), toy_city.community(), spec=small().spec)
    assert {finding.promise for finding in check_env(environment, max_steps=12)} == {"snapshot"}


def test_what_stays_from_another_seeds_episode_is_found() -> None:
    environment = Sticky(toy_city.world(), toy_city.community(), spec=small().spec)
    assert {finding.promise for finding in check_env(environment, seed=0, max_steps=12)} == {"reset"}
