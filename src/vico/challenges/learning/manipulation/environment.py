"""Manipulation environments: for one learner, many copies in one process, and scores of policies.

``gymnasium.make("vico/Lift-v0")`` and ``gymnasium.make_vec("vico/Lift-v0", 64)`` make them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from vico.challenges.learning.manipulation.batch import BatchedScene, BatchStep
from vico.challenges.learning.manipulation.observation import BOUND, Bools, Readings, observe, size_of
from vico.challenges.learning.manipulation.scene import ACTIONS, RATE, Array, ManipulationOptions
from vico.challenges.learning.manipulation.tasks import LIFT, PICK_PLACE, PLACE, REACH, ManipulationTask, paper_reward
from vico.errors import InputError

Numbers = NDArray[np.float32]


def observation_space(options: ManipulationOptions) -> spaces.Box[Any]:
    """Return the space of one copy's observations; see `vico.challenges.learning.manipulation.observation`."""
    return spaces.Box(-BOUND, BOUND, (size_of(options.observation),), np.float32)


def action_space() -> spaces.Box[Any]:
    """Return the space of one copy's actions; see `Copies.advance`."""
    return spaces.Box(-1.0, 1.0, (ACTIONS,), np.float32)


def reward_of(task: ManipulationTask, options: ManipulationOptions, done: BatchStep) -> Array:
    """Return the rewards of a step, shape ``(n,)``; none where it broke down."""
    found = paper_reward(done.readings, task.paper_terms) if options.reward == "paper" else task.staged(done.readings)
    return np.where(done.broken, 0.0, found)


def evaluation_of(task: ManipulationTask, done: BatchStep) -> dict[str, Bools]:
    """Return what of the task's rule holds; nothing is a success that broke down."""
    found = task.evaluate(done.readings)
    return {**found, "success": found["success"] & ~done.broken}


class ManipulationEnv(gymnasium.Env[Numbers, Numbers]):
    """One copy of a task; see the task's module for what is asked.

    `reset(seed=n)` begins the first episode of seed ``n``; without a seed the next one. ``info`` holds what of the
    task's rule holds by name, with ``is_success`` among it; where an episode ends by an action that is no number or by
    motion that breaks down, ``cause`` says so.

    Parameters
    ----------
    task
        What is asked.
    options
        See `ManipulationOptions`.
    seed
        Until `reset` is given one.
    """

    metadata = {"render_modes": [], "render_fps": RATE}  # noqa: RUF012

    def __init__(self, task: ManipulationTask, options: ManipulationOptions, *, seed: int = 0) -> None:
        self.task, self.options = task, options
        self.copies = BatchedScene(task, options, 1)
        self.copies.seeds[0] = seed
        self.observation_space, self.action_space = observation_space(options), action_space()
        self.render_mode = None
        self._begun, self._over = False, True

    @property
    def readings(self) -> Readings:
        """What the copy looks like now; ``n`` is 1."""
        return self.copies.readings()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        if seed is not None:
            self.copies.seeds[0], self.copies.episodes[0] = seed, 0
        elif self._begun:
            self.copies.episodes[0] += 1
        self._begun, self._over = True, False
        self.copies.begin([0])
        return self._observe(self.readings), {"episode": int(self.copies.episodes[0])}

    def step(self, action: Numbers) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Act for a twentieth of a second.

        Raises
        ------
        InputError
            If the episode is over or has not begun, or the action has another shape.
        """
        if self._over:
            raise InputError("env: the episode is over (or has not begun); call reset() before step()")
        done = self.copies.advance(np.asarray(action, np.float64)[None])
        found = evaluation_of(self.task, done)
        success = bool(found.pop("success")[0])
        ended = bool(done.broken[0]) or (success and self.options.terminate_on_success)
        cut = not ended and bool(self.copies.steps[0] >= self.options.max_steps)
        self._over = ended or cut
        info: dict[str, Any] = {name: bool(value[0]) for name, value in found.items()}
        info |= {"is_success": success, **({"cause": done.causes[0]} if done.causes else {})}
        reward = float(reward_of(self.task, self.options, done)[0])
        return self._observe(done.readings), reward, ended, cut, info

    def evaluate(self) -> dict[str, bool]:
        """Say what of the task's rule holds now, by name."""
        return {name: bool(value[0]) for name, value in self.task.evaluate(self.readings).items()}

    def save_state(self) -> dict[str, NDArray[Any]]:
        """Return everything of the episode as plain arrays."""
        over = np.array([self._over])
        return {**self.copies.snapshot(), "over": over}

    def restore_state(self, saved: Mapping[str, NDArray[Any]]) -> Numbers:
        """Go back to a saved state; return the observation there.

        Raises
        ------
        SchemaError
            If it was saved by another kind of environment.
        """
        self.copies.restore(saved)
        self._begun, self._over = True, bool(np.asarray(saved.get("over", [False]))[0])
        return self._observe(self.readings)

    def close(self) -> None:
        """Let go of the copy."""
        self.copies.close()

    def _observe(self, readings: Readings) -> Numbers:
        return observe(readings, self.options.observation)[0]


class ManipulationBatch(gymnasium.vector.VectorEnv[Numbers, Numbers, NDArray[Any]]):
    """Many copies of a task in one process, stepped together; each does what a `ManipulationEnv` does.

    A copy whose episode ends begins the next one in the same step (Gymnasium's `AutoresetMode.SAME_STEP`):
    ``info["final_obs"]`` and ``info["final_info"]`` hold what it came to. Copy ``k`` of `reset(seed=n)` has seed
    ``n + k``.

    Parameters
    ----------
    num_envs, threads
        How many copies, and threads that step them.
    """

    def __init__(
        self,
        task: ManipulationTask,
        options: ManipulationOptions,
        *,
        num_envs: int = 1,
        threads: int = 1,
        seed: int = 0,
    ) -> None:
        self.task, self.options = task, options
        self.copies = BatchedScene(task, options, num_envs, threads=threads)
        self.copies.seeds[:] = seed + np.arange(num_envs)
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = observation_space(options), action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {"render_modes": [], "render_fps": RATE, "autoreset_mode": AutoresetMode.SAME_STEP}
        self.render_mode = None
        self._begun = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Start an episode in each copy.

        Parameters
        ----------
        seed
            One a copy, or the first copy's: the others get the following ones; None: the next episodes.
        options
            Not used.

        Raises
        ------
        InputError
            If there are not as many seeds as copies.
        """
        seeds = [seed + k for k in range(self.num_envs)] if isinstance(seed, (int, np.integer)) else seed
        if seeds is not None and len(seeds) != self.num_envs:
            raise InputError(f"env: {len(seeds)} seeds for {self.num_envs} environments; give one for each")
        for k in range(self.num_envs):
            given = None if seeds is None else seeds[k]
            if given is not None:
                self.copies.seeds[k], self.copies.episodes[k] = given, 0
            elif self._begun:
                self.copies.episodes[k] += 1
        self._begun = True
        self.copies.begin(range(self.num_envs))
        return observe(self.copies.readings(), self.options.observation), {}

    def step(self, actions: Numbers) -> tuple[Numbers, Array, Bools, Bools, dict[str, Any]]:
        """Act for a twentieth of a second in all copies.

        Raises
        ------
        InputError
            If `reset` has not been called, or the actions have another shape.
        """
        if not self._begun:
            raise InputError("env: no episode has begun; call reset() before step()")
        done = self.copies.advance(np.asarray(actions, np.float64))
        reward, found = reward_of(self.task, self.options, done), evaluation_of(self.task, done)
        ended = done.broken | (found["success"] & self.options.terminate_on_success)
        cut = ~ended & (self.copies.steps >= self.options.max_steps)
        seen = observe(done.readings, self.options.observation)
        info: dict[str, Any] = {("is_success" if name == "success" else name): value for name, value in found.items()}
        info["steps"] = self.copies.steps.copy()
        over = np.nonzero(ended | cut)[0]
        if len(over):
            info |= self._finals(seen, info, done, over)
            self.copies.episodes[over] += 1
            self.copies.begin(over.tolist())
            seen[over] = observe(self.copies.readings(), self.options.observation)[over]
        return seen, reward, ended, cut, info

    def _finals(
        self, seen: Numbers, info: Mapping[str, Any], done: BatchStep, over: NDArray[np.int64]
    ) -> dict[str, Any]:
        """Return what episodes that are over came to."""
        finals, infos = np.full(self.num_envs, None, object), np.full(self.num_envs, None, object)
        for k in over.tolist():
            finals[k] = seen[k].copy()
            cause = {"cause": done.causes[k]} if k in done.causes else {}
            infos[k] = {**{name: value[k].item() for name, value in info.items()}, **cause}
        has = np.zeros(self.num_envs, bool)
        has[over] = True
        return {"final_obs": finals, "_final_obs": has, "final_info": infos, "_final_info": has.copy()}

    def save_state(self) -> dict[str, NDArray[Any]]:
        """Return everything of all copies as plain arrays."""
        return self.copies.snapshot()

    def restore_state(self, saved: Mapping[str, NDArray[Any]]) -> Numbers:
        """Go back to a saved state; return the observations there.

        Raises
        ------
        SchemaError
            If it was saved by another kind of environment, or by another number of copies.
        """
        self.copies.restore(saved)
        self._begun = True
        return observe(self.copies.readings(), self.options.observation)

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads."""
        self.copies.close()


#: Tasks by name.
MANIPULATION: dict[str, ManipulationTask] = {task.name: task for task in (REACH, LIFT, PLACE, PICK_PLACE)}


def make_manipulation(task: str, *, seed: int = 0, render_mode: None = None, **options: Any) -> ManipulationEnv:
    """Make an environment of one arm.

    Parameters
    ----------
    task
        One of `MANIPULATION`.
    seed
        Of its episodes until `reset` is given one.
    options
        Those of `ManipulationOptions`.

    Raises
    ------
    InputError
        If there is no such task, option or render mode.
    """
    found, given = _checked_options(task, render_mode, options)
    return ManipulationEnv(found, given, seed=seed)


def make_manipulation_vec(
    task: str, *, num_envs: int = 1, threads: int = 1, seed: int = 0, render_mode: None = None, **options: Any
) -> ManipulationBatch:
    """Make many copies of an environment in one process; see `make_manipulation`.

    Parameters
    ----------
    num_envs, threads
        How many copies, and threads that step them.
    """
    found, given = _checked_options(task, render_mode, options)
    return ManipulationBatch(found, given, num_envs=num_envs, threads=threads, seed=seed)


def _checked_options(
    task: str, render_mode: None, options: dict[str, Any]
) -> tuple[ManipulationTask, ManipulationOptions]:
    if task not in MANIPULATION:
        raise InputError(f"env: no manipulation task {task!r}; there are {', '.join(MANIPULATION)}")
    if render_mode is not None:
        raise InputError(f"env: render_mode is {render_mode!r}; manipulation environments draw nothing: use None")
    unknown = sorted(options.keys() - {field.name for field in fields(ManipulationOptions)})
    if unknown:
        known = ", ".join(field.name for field in fields(ManipulationOptions))
        raise InputError(f"env: no option {unknown[0]!r}; there are {known}")
    return MANIPULATION[task], ManipulationOptions(**options)


#: Entry points of the registered ids.
make_reach, make_reach_vec = partial(make_manipulation, "reach"), partial(make_manipulation_vec, "reach")
make_lift, make_lift_vec = partial(make_manipulation, "lift"), partial(make_manipulation_vec, "lift")
make_place, make_place_vec = partial(make_manipulation, "place"), partial(make_manipulation_vec, "place")
make_pick_place = partial(make_manipulation, "pick_place")
make_pick_place_vec = partial(make_manipulation_vec, "pick_place")


#: From observations, shape ``(n, size)``, to actions, shape ``(n, 8)``.
Policy = Callable[[Numbers], NDArray[Any]]


@dataclass(frozen=True)
class Score:
    """What episodes came to.

    Attributes
    ----------
    episodes
        How many.
    success_at_end, success_once
        Share of episodes whose last step was a success, and that had a successful step.
    total_reward
        Of an episode, mean.
    causes
        Of episodes that broke off, by what was said.
    """

    episodes: int
    success_at_end: float
    success_once: float
    total_reward: float
    causes: dict[str, int]

    def __str__(self) -> str:
        found = f"success {self.success_at_end:.2f} at the end, {self.success_once:.2f} at any time, "
        found += f"reward {self.total_reward:.1f}, {self.episodes} episodes"
        return found + (f"; {self.causes}" if self.causes else "")


def score(batch: ManipulationBatch, policy: Policy, *, seed: int = 10**6) -> Score:
    """Play an episode in each copy.

    Parameters
    ----------
    batch
        Has as many copies as episodes are to be played.
    policy
        May remember things between calls: it sees whole episodes from the first step on.
    seed
        Of the first copy's episode; the others have the following ones. Training draws from small seeds.
    """
    seen, _ = batch.reset(seed=seed)
    n = batch.num_envs
    over, once, at_end = np.zeros(n, bool), np.zeros(n, bool), np.zeros(n, bool)
    total, causes = np.zeros(n), dict[str, int]()
    while not over.all():
        seen, reward, ended, cut, info = batch.step(np.asarray(policy(seen), np.float32))
        total += np.where(over, 0.0, reward)
        once |= info["is_success"] & ~over
        ends = (ended | cut) & ~over
        at_end |= info["is_success"] & ends
        for k in np.nonzero(ends)[0].tolist():
            cause = info["final_info"][k].get("cause")
            if cause:
                causes[cause] = causes.get(cause, 0) + 1
        over |= ends
    return Score(n, float(at_end.mean()), float(once.mean()), float(total.mean()), causes)
