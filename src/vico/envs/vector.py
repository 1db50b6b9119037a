"""Many environments side by side, each in a process: for Gymnasium (one agent each) and for PettingZoo (everybody).

Arrays of observations lie in memory that the processes share: pictures need not go through a pipe.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import Any, Unpack

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array, iterate
from numpy.typing import NDArray

from vico.community.model import Community
from vico.envs.parallel import CommunitySource, WorldSource, make
from vico.envs.spec import EnvOptions
from vico.envs.workers import Call, Workers
from vico.errors import InputError
from vico.world.world import World

#: Where an array of an observation is: keys of Dicts, one in the other.
SpacePath = tuple[str, ...]
_ALIGNED = 64  # bytes at which arrays begin


def boxes_of(space: spaces.Space[Any], where: SpacePath = ()) -> Iterator[tuple[SpacePath, spaces.Box[Any]]]:
    """Yield the Boxes of a space and where they are."""
    if isinstance(space, spaces.Box):
        yield where, space
    elif isinstance(space, spaces.Dict):
        for name, one in space.spaces.items():
            yield from boxes_of(one, (*where, name))


@dataclass(frozen=True)
class Layout:
    """Layout of the arrays of several environments in a block of memory.

    Attributes
    ----------
    arrays
        By where they are in an observation: offset, bytes; shape of one; name of its type.
    count
        Environments.
    size
        Bytes of all.
    """

    arrays: Mapping[SpacePath, tuple[int, tuple[int, ...], str]]
    count: int
    size: int

    @classmethod
    def of(cls, space: spaces.Space[Any], count: int) -> Layout:
        """Return a layout for so many environments."""
        arrays, offset = {}, 0
        for where, box in boxes_of(space):
            arrays[where] = offset, tuple(box.shape), np.dtype(box.dtype).str
            offset += -(-count * int(np.prod(box.shape, dtype=int)) * box.dtype.itemsize // _ALIGNED) * _ALIGNED
        return cls(arrays, count, max(offset, 1))

    def rows(self, memory: SharedMemory) -> dict[SpacePath, NDArray[Any]]:
        """Return the arrays in a block, with a row for each environment."""
        return {
            where: np.ndarray((self.count, *shape), kind, memory.buf, offset)
            for where, (offset, shape, kind) in self.arrays.items()
        }


class SharedArrays:
    """The parent's side: makes the block, and takes it away when it is closed."""

    def __init__(self, space: spaces.Space[Any], count: int) -> None:
        self.space, self.layout = space, Layout.of(space, count)
        self._memory: SharedMemory | None = SharedMemory(create=True, size=self.layout.size)
        self._rows = self.layout.rows(self._memory)

    @property
    def name(self) -> str:
        """By which workers find the block."""
        assert self._memory is not None
        return self._memory.name

    def batch(self, rest: Sequence[Any]) -> Any:
        """Return the observations of all environments as one element of the batched space; arrays are copies.

        Parameters
        ----------
        rest
            What the workers sent: observations without their arrays.
        """
        return self._batch_space(self.space, (), rest)

    def single(self, k: int, rest: Any) -> Any:
        """Return one environment's observation; arrays are copies."""
        return _put_back(rest, (), {where: array[k : k + 1] for where, array in self._rows.items()})

    def close(self) -> None:
        """Take the block away."""
        self._rows = {}
        if self._memory is not None:
            self._memory.close()
            self._memory.unlink()
            self._memory = None

    def _batch_space(self, space: spaces.Space[Any], where: SpacePath, rest: Sequence[Any]) -> Any:
        if where in self._rows:
            return self._rows[where].copy()
        if isinstance(space, spaces.Dict):
            return {
                name: self._batch_space(
                    one, (*where, name), [None if part is None else part.get(name) for part in rest]
                )
                for name, one in space.spaces.items()
            }
        empty: Any = create_empty_array(space, len(rest))
        return concatenate(space, rest, empty)


class Sharing:
    """The worker's side: an environment whose observations' arrays go to the block.

    Parameters
    ----------
    make
        Makes the environment: one of Gymnasium, or of PettingZoo.
    """

    def __init__(self, make: Callable[[], Any]) -> None:
        self.env = make()
        # In this order: the block cannot be closed while there are arrays in it.
        self._rows: dict[SpacePath, NDArray[Any]] = {}
        self._memory: SharedMemory | None = None

    def attach(self, name: str, layout: Layout, k: int) -> None:
        """Write to row `k` of a block from now on."""
        self._memory = SharedMemory(name=name)
        # A slice, not an item: an item of numbers without axes would be no part of the block.
        self._rows = {where: rows[k : k + 1] for where, rows in layout.rows(self._memory).items()}

    def reset(self, *arguments: Any, **options: Any) -> tuple[Any, Any]:
        """Reset the environment; return what is not in the block."""
        observation, info = self.env.reset(*arguments, **options)
        return _take_out(observation, (), self._rows), info

    def step(self, action: Any) -> tuple[Any, ...]:
        """Step the environment; return what is not in the block."""
        observation, *rest = self.env.step(action)
        return (_take_out(observation, (), self._rows), *rest)

    def call(self, name: str, *arguments: Any) -> Any:
        """Return what a method of the environment returns, or an attribute."""
        found = getattr(self.env, name)
        return found(*arguments) if callable(found) else found


def _take_out(observation: Any, where: SpacePath, rows: Mapping[SpacePath, NDArray[Any]]) -> Any:
    """Write arrays to their rows, and return the observation without them."""
    if where in rows:
        rows[where][0] = observation
        return None
    if isinstance(observation, Mapping):
        return {name: _take_out(part, (*where, name), rows) for name, part in observation.items()}
    return observation


def _put_back(rest: Any, where: SpacePath, rows: Mapping[SpacePath, NDArray[Any]]) -> Any:
    if where in rows:
        return np.array(rows[where][0])
    if isinstance(rest, Mapping):
        return {name: _put_back(part, (*where, name), rows) for name, part in rest.items()}
    return rest


#: What `CommunityEnv.reset` and `CommunityEnv.step` return.
Reset = tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]]]
Step = tuple[dict[str, dict[str, Any]], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]

_SPACES = ("observation_space", "action_space")


class VectorAgentEnv(gymnasium.vector.VectorEnv[Any, Any, NDArray[Any]]):
    """One agent in each of several environments, which step at the same time.

    An environment whose episode has ended begins the next one at the following step, whatever that step's action
    (Gymnasium's `AutoresetMode.NEXT_STEP`). Pictures and other arrays of observations come by shared memory
    (`vico.envs.vector`); what `reset` and `step` return are copies.

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
        return self._arrays.batch(observations), _batch_infos(infos)

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
            self._arrays.batch(observations),
            np.array(rewards, np.float64),
            terminations,
            truncations,
            _batch_infos(infos),
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
        return self._with_arrays(self._workers.ask([Call("reset", (one,)) for one in _seeds(seed, self.num_envs)]))

    def step(self, actions: Sequence[Mapping[str, Any]]) -> list[Step]:
        """Step each environment with its agents' actions; what `CommunityEnv.step` returns, of each.

        Who reads ``truncations`` resets those environments that are over with `reset_some`.

        Raises
        ------
        WorkerError
            If an environment fails; all are closed then.
        """
        return self._with_arrays(self._workers.ask([Call("step", (dict(one),)) for one in actions]))

    def reset_some(self, which: Sequence[int]) -> dict[int, Reset]:
        """Start the next episode in some environments; the others stay as they are."""
        calls = [Call("reset") if k in which else None for k in range(self.num_envs)]
        found = self._with_arrays(self._workers.ask(calls))
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

    def _with_arrays(self, answers: Sequence[Any]) -> list[Any]:
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
    return ParallelVectorEnv(env_makers(make, world, community, num_envs=num_envs, options=dict(options)))


def env_makers(
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


def _batch_infos(infos: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return infos as arrays of objects, with ``_name`` beside each: which environments have it."""
    found: dict[str, Any] = {}
    for k, info in enumerate(infos):
        for name, value in info.items():
            if name not in found:
                found[name], found[f"_{name}"] = np.full(len(infos), None, object), np.zeros(len(infos), bool)
            found[name][k], found[f"_{name}"][k] = value, True
    return found
