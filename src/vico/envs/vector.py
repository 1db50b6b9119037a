"""Many environments side by side, each in a process: for Gymnasium (one agent each) and for PettingZoo (everybody).

Gymnasium's own `AsyncVectorEnv` is not used. Its shared memory carries no text and no lists, which our observations
and actions hold; it makes one environment more than asked for, in the parent; and a worker that is killed leaves it
with an end-of-file error that does not say which.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Unpack

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space, iterate
from numpy.typing import NDArray

from vico.community.model import Community
from vico.envs.parallel import CommunitySource, WorldSource, make
from vico.envs.shared import SharedArrays, Sharing
from vico.envs.spec import EnvOptions
from vico.envs.workers import Call, Workers
from vico.errors import InputError
from vico.world.world import World

#: What `CommunityEnv.reset` and `CommunityEnv.step` return.
Reset = tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]]]
Step = tuple[dict[str, dict[str, Any]], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]

_SPACES = ("observation_space", "action_space")


class VectorAgentEnv(gymnasium.vector.VectorEnv[Any, Any, NDArray[Any]]):
    """One agent in each of several environments, which step at the same time.

    An environment whose episode has ended begins the next one at the following step, whatever that step's action
    (Gymnasium's `AutoresetMode.NEXT_STEP`). Pictures and other arrays of observations come by shared memory
    (`vico.envs.shared`); what `reset` and `step` return are copies.

    Parameters
    ----------
    makers
        Make one Gymnasium environment each, in its process; see `vico.envs.workers.Workers`.

    Raises
    ------
    InputError
        If there are no makers.
    WorkerError
        If one cannot be made.
    """

    def __init__(self, makers: Sequence[Callable[[], gymnasium.Env[Any, Any]]]) -> None:
        self._workers = Workers([partial(Sharing, make) for make in makers])
        self.num_envs = len(makers)
        spaces_of = [self._workers.ask([Call("call", (kind,))] * self.num_envs)[0] for kind in _SPACES]
        self.single_observation_space: spaces.Space[Any] = spaces_of[0]
        self.single_action_space: spaces.Space[Any] = spaces_of[1]
        self._arrays = SharedArrays(self.single_observation_space, self.num_envs)
        self._workers.ask([Call("attach", (self._arrays.name, self._arrays.layout, k)) for k in range(self.num_envs)])
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.metadata = {"render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.render_mode = "rgb_array"
        self._over = np.zeros(self.num_envs, bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode in each environment.

        Parameters
        ----------
        seed
            One a environment, or the first environment's: the others get the following ones.
        options
            Not used.
        """
        calls = [Call("reset", (), {"seed": one, "options": options}) for one in _seeds(seed, self.num_envs)]
        observations, infos = zip(*self._workers.ask(calls), strict=True)
        self._over[:] = False
        return self._batched(observations), _batched_infos(infos)

    def step(
        self, actions: Any
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Advance every environment until its agent is due again.

        Parameters
        ----------
        actions
            An element of `action_space`, or a list with an action for each environment (in the short form, say).

        Raises
        ------
        WorkerError
            If an environment fails; all are closed then.
        """
        each = list(actions if isinstance(actions, list) else iterate(self.action_space, actions))
        if len(each) != self.num_envs:
            raise InputError(f"env: {len(each)} actions for {self.num_envs} environments; give one for each")
        again = self._over.tolist()
        calls = [Call("reset") if over else Call("step", (one,)) for one, over in zip(each, again, strict=True)]
        answers = [
            (found[0], 0.0, False, False, found[1]) if over else found
            for found, over in zip(self._workers.ask(calls), again, strict=True)
        ]
        observations, rewards, ended, cut, infos = zip(*answers, strict=True)
        terminations, truncations = np.array(ended, bool), np.array(cut, bool)
        self._over = terminations | truncations
        return (
            self._batched(observations),
            np.array(rewards, np.float64),
            terminations,
            truncations,
            _batched_infos(infos),
        )

    def render(self) -> tuple[Any, ...]:
        """Return what each agent sees, uint8, shape ``(image, image, 3)`` each."""
        return tuple(self._workers.ask([Call("call", ("render",))] * self.num_envs))

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which actions are possible now, a row for each environment; see `SingleAgentEnv.action_masks`."""
        return np.stack(self._workers.ask([Call("call", ("action_masks",))] * self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """End the processes."""
        self._workers.close()
        self._arrays.close()

    @property
    def pids(self) -> list[int | None]:
        """Numbers of the processes."""
        return self._workers.pids

    def _batched(self, rest: Sequence[Any]) -> Any:
        return self._arrays.batched(rest)


class ParallelVectorEnv:
    """Whole communities side by side: a list of PettingZoo environments, each in a process.

    Parameters
    ----------
    makers
        Make one `CommunityEnv` each, in its process; see `vico.envs.workers.Workers`.
    """

    def __init__(self, makers: Sequence[Callable[[], Any]]) -> None:
        self._workers = Workers([partial(Sharing, make) for make in makers])
        self.num_envs = len(makers)
        self.possible_agents: list[str] = self._first("possible_agents")
        self._spaces: dict[str, dict[str, spaces.Space[Any]]] = {
            kind: {name: self._first(kind, name) for name in self.possible_agents} for kind in _SPACES
        }
        whole = spaces.Dict(dict(self._spaces["observation_space"]))
        self._arrays = SharedArrays(whole, self.num_envs)
        self._workers.ask([Call("attach", (self._arrays.name, self._arrays.layout, k)) for k in range(self.num_envs)])

    def __repr__(self) -> str:
        return f"ParallelVectorEnv({self.num_envs} environments of {len(self.possible_agents)} agents)"

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Space of an agent's observations, in every environment."""
        return self._spaces["observation_space"][agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Space of an agent's actions, in every environment."""
        return self._spaces["action_space"][agent]

    def reset(self, seed: int | Sequence[int | None] | None = None) -> list[Reset]:
        """Start an episode in each environment; seeds as for `VectorAgentEnv.reset`."""
        return self._told(self._workers.ask([Call("reset", (one,)) for one in _seeds(seed, self.num_envs)]))

    def step(self, actions: Sequence[Mapping[str, Any]]) -> list[Step]:
        """Step each environment with its agents' actions; what `CommunityEnv.step` returns, of each.

        Who reads ``truncations`` resets those environments that are over with `reset_some`.

        Raises
        ------
        WorkerError
            If an environment fails; all are closed then.
        """
        return self._told(self._workers.ask([Call("step", (dict(one),)) for one in actions]))

    def reset_some(self, which: Sequence[int]) -> dict[int, Reset]:
        """Start the next episode in some environments; the others stay as they are."""
        calls = [Call("reset") if k in which else None for k in range(self.num_envs)]
        found = self._told(self._workers.ask(calls))
        return {k: found[k] for k in which}

    def close(self) -> None:
        """End the processes."""
        self._workers.close()
        self._arrays.close()

    @property
    def pids(self) -> list[int | None]:
        """Numbers of the processes."""
        return self._workers.pids

    def _first(self, name: str, *arguments: Any) -> Any:
        """Return what the first environment has."""
        calls = [Call("call", (name, *arguments)), *[None] * (self.num_envs - 1)]
        return self._workers.ask(calls)[0]

    def _told(self, answers: Sequence[Any]) -> list[Any]:
        """Put the arrays back into what environments returned."""
        return [
            None if answer is None else (self._arrays.single(k, answer[0]), *answer[1:])
            for k, answer in enumerate(answers)
        ]


def make_parallel_vec(
    world: WorldSource,
    community: CommunitySource = None,
    *,
    num_envs: int,
    **options: Unpack[EnvOptions],
) -> ParallelVectorEnv:
    """Make several environments of a world and a community, each in a process.

    Parameters
    ----------
    world, community
        Folders, or what was read from them: every process reads them itself.
    num_envs
        How many; they begin with the seeds ``seed``, ``seed + 1`` and on.
    options
        See `vico.envs.make`.

    Raises
    ------
    InputError
        If the world has no folder.
    """
    return ParallelVectorEnv(makers(make, world, community, num_envs=num_envs, options=dict(options)))


def makers(
    function: Callable[..., Any],
    world: WorldSource,
    community: CommunitySource,
    *,
    num_envs: int,
    options: Mapping[str, Any],
) -> list[Callable[[], Any]]:
    """Return what makes each of several environments in its process, by a function that takes a world's folder."""
    if num_envs < 1:
        raise InputError(f"env: num_envs is {num_envs}; it has to be 1 or more")
    folder = world.path if isinstance(world, World) else Path(world)
    if folder is None:
        raise InputError("env: a world in memory cannot be given to processes; write it with vico.world.write_world")
    who = community if community is None or isinstance(community, Community) else Path(community)
    first = int(options.get("seed", 0))
    return [partial(function, folder, who, **{**options, "seed": first + k}) for k in range(num_envs)]


def _seeds(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    if seed is None:
        return [None] * count
    if isinstance(seed, (int, np.integer)):
        return [int(seed) + k for k in range(count)]
    if len(seed) != count:
        raise InputError(f"env: {len(seed)} seeds for {count} environments; give one for each, or the first")
    return list(seed)


def _batched_infos(infos: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return infos as arrays of objects, with ``_name`` beside each: which environments have it."""
    found: dict[str, Any] = {}
    for k, info in enumerate(infos):
        for name, value in info.items():
            if name not in found:
                found[name], found[f"_{name}"] = np.full(len(infos), None, object), np.zeros(len(infos), bool)
            found[name][k], found[f"_{name}"][k] = value, True
    return found
