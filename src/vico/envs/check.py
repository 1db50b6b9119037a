"""Whether an environment keeps its promises: contract, spaces, resets, repeatability, snapshots, refusals, endings."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pettingzoo import ParallelEnv

_BAD_ACTION = {"type": "no such action"}
#: Steps of a short episode.
_SOME = 5


@dataclass(frozen=True)
class EnvFinding:
    """A promise that is not kept.

    Attributes
    ----------
    promise
        ``contract``, ``space``, ``repeatable``, ``reset``, ``snapshot``, ``refusal`` or ``ending``.
    where
        Agent and step.
    what
        What is wrong, with the values.
    """

    promise: str
    where: str
    what: str


def check_env(env: ParallelEnv[str, Any, Any], *, seed: int = 0, max_steps: int = 2000) -> list[EnvFinding]:
    """Play episodes with sampled actions, and look whether the environment keeps its promises.

    Two episodes of one seed, one of the next seed, and the beginning of one of the first again: nothing may stay from
    an episode. Where the environment has `snapshot` and `restore`, what follows a snapshot has to come again after it
    is restored.

    Parameters
    ----------
    env
        Ours, or one around it. It is reset, and left within an episode.
    seed
        Of the episodes and of the actions.
    max_steps
        An episode that is not over by then is left there; that is no finding.

    Returns
    -------
    list of EnvFinding
        What is wrong; nothing if all promises are kept. Of one kind for one agent the first is enough.
    """
    found: dict[tuple[str, str], EnvFinding] = {}
    digests: list[list[str]] = []
    for _ in range(2):
        steps: list[str] = []
        for finding in _episode(env, seed, max_steps, steps):
            found.setdefault((finding.promise, finding.where.split(",")[0]), finding)
        digests.append(steps)
    first, second = digests
    if first != second:
        at = next(
            (k for k, (a, b) in enumerate(zip(first, second, strict=False)) if a != b), min(len(first), len(second))
        )
        what = f"two episodes of seed {seed} differ from step {at} on; draw chance from the seed alone"
        found["repeatable", ""] = EnvFinding("repeatable", f"step {at}", what)
    for finding in (*_check_reset(env, seed, first[: _SOME + 1]), *_check_snapshot(env, seed)):
        found.setdefault((finding.promise, finding.where), finding)
    return list(found.values())


def _check_reset(env: ParallelEnv[str, Any, Any], seed: int, expected: list[str]) -> Iterator[EnvFinding]:
    """Cut an episode of another seed short: an episode of the first seed has to begin as ever after it."""
    again: list[str] = []
    for steps, one in (([], seed + 1), (again, seed)):
        for _ in _episode(env, one, _SOME, steps):
            pass  # what is wrong in every episode has been found before
    if again != expected:
        at = next((k for k, (a, b) in enumerate(zip(again, expected, strict=False)) if a != b), len(expected))
        what = f"after an episode of seed {seed + 1}, seed {seed} gives another one; let nothing stay from an episode"
        yield EnvFinding("reset", f"step {at}", what)


def _check_snapshot(env: ParallelEnv[str, Any, Any], seed: int) -> Iterator[EnvFinding]:
    """Go on from a snapshot twice."""
    whole: Any = env.unwrapped
    if not (hasattr(whole, "snapshot") and hasattr(whole, "restore")):
        return
    env.reset(seed=seed)

    def play(steps: Sequence[Mapping[str, Any]]) -> list[str]:
        found = []
        for actions in steps:
            if env.agents:
                observations, _, _, _, infos = env.step(dict(actions))
                found.append(_digest(observations, infos))
        return found

    steps = [{name: env.action_space(name).sample() for name in env.agents} for _ in range(2 * _SOME)]
    play(steps[:_SOME])
    kept = whole.snapshot()
    first = play(steps[_SOME:])
    whole.restore(kept)
    second = play(steps[_SOME:])
    if first != second:
        at = next((k for k, (a, b) in enumerate(zip(first, second, strict=False)) if a != b), len(second))
        what = "a restored snapshot goes on otherwise than the first time; save everything that decides the future"
        yield EnvFinding("snapshot", f"step {_SOME + at + 1}", what)


# What a step returns.
_PARTS = ("observations", "rewards", "terminations", "truncations", "infos")


def _episode(env: ParallelEnv[str, Any, Any], seed: int, max_steps: int, digests: list[str]) -> Iterator[EnvFinding]:
    observations, infos = env.reset(seed=seed)
    yield from _check_agents(env)
    agents = list(env.agents)
    if set(agents) != set(observations) or set(agents) != set(infos):
        yield EnvFinding("contract", "reset", "observations and infos are not those of `agents`; give one each")
    yield from _check_observations(env, observations, "reset")
    digests.append(_digest(observations, infos))
    for k, name in enumerate(env.possible_agents):
        env.action_space(name).seed(seed + k)
    gone: set[str] = set()
    for step in range(1, max_steps + 1):
        if not agents:
            return
        # Once, everybody asks for what there is not: it has to be refused, and told.
        bad = step == 1
        actions = {name: dict(_BAD_ACTION) if bad else env.action_space(name).sample() for name in agents}
        observations, rewards, ended, cut, infos = env.step(actions)
        for part, content in zip(_PARTS, (observations, rewards, ended, cut, infos), strict=True):
            if set(content) != set(agents):
                yield EnvFinding("contract", f"{part}, step {step}", "not those who acted; give one for each of them")
        for name, reward in rewards.items():
            if not np.isfinite(reward):
                yield EnvFinding("contract", f"{name}, step {step}", f"its reward is {reward}; give a finite number")
        for name in ended:
            flags = (ended[name], cut.get(name))
            if not all(isinstance(flag, (bool, np.bool_)) for flag in flags):
                yield EnvFinding("contract", f"{name}, step {step}", f"its flags are {flags}; give True or False")
        yield from _check_observations(env, observations, f"step {step}")
        if bad:
            yield from _check_refusals(observations)
        gone |= {name for name in agents if ended.get(name) or cut.get(name)}
        back = sorted(gone & set(env.agents))
        if back:
            yield EnvFinding("ending", f"{back[0]}, step {step}", "ended and is among `agents` again; leave it out")
        digests.append(_digest(observations, infos))
        agents = list(env.agents)


def _check_agents(env: ParallelEnv[str, Any, Any]) -> Iterator[EnvFinding]:
    names = list(env.possible_agents)
    if not names or len(set(names)) != len(names):
        yield EnvFinding("contract", "possible_agents", f"{names}: names have to be there, each once")
    if not set(env.agents) <= set(names):
        yield EnvFinding("contract", "agents", "somebody is not among possible_agents; list all there")
    for name in names:
        same = env.observation_space(name) is env.observation_space(name)
        if not same or env.action_space(name) is not env.action_space(name):
            yield EnvFinding("contract", name, "its spaces are made anew each time; return the same objects")


def _check_observations(
    env: ParallelEnv[str, Any, Any], observations: Mapping[str, Any], when: str
) -> Iterator[EnvFinding]:
    for name, seen in observations.items():
        if not env.observation_space(name).contains(seen):
            yield EnvFinding("space", f"{name}, {when}", "its observation is not in its observation space")


def _check_refusals(observations: Mapping[str, Any]) -> Iterator[EnvFinding]:
    for name, seen in observations.items():
        state = seen.get("state", {})
        told = state.get("action_status") == "refused" and state.get("action_code") and state.get("action_reason")
        if not told:
            status = state.get("action_status")
            yield EnvFinding("refusal", name, f"a bad action is {status!r}; refuse it with a code and a reason")


def _digest(observations: Mapping[str, Any], infos: Mapping[str, Any]) -> str:
    """Hash what everybody was given: the state's hash where infos have it, and observations."""
    digest = hashlib.blake2b(digest_size=16)
    for name in sorted(observations):
        digest.update(f"{name}|{infos.get(name, {}).get('hash', '')}|".encode())
        _feed(digest, observations[name])
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    if isinstance(value, Mapping):
        for key in sorted(value):
            digest.update(f"{key}:".encode())
            _feed(digest, value[key])
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    else:
        digest.update(repr(value).encode())


__all__ = ["EnvFinding", "check_env"]
