"""What makes each registered task: ``gymnasium.make("vico/Lift-v0")``, ``gymnasium.make_vec("vico/Lift-v0", 64)``."""

from __future__ import annotations

from dataclasses import fields
from functools import partial
from typing import Any

from vico.challenges.learning.manipulation.environment import ManipulationBatch, ManipulationEnv
from vico.challenges.learning.manipulation.lift import LIFT
from vico.challenges.learning.manipulation.options import ManipulationOptions
from vico.challenges.learning.manipulation.pick_place import PICK_PLACE
from vico.challenges.learning.manipulation.place import PLACE
from vico.challenges.learning.manipulation.reach import REACH
from vico.challenges.learning.manipulation.tasks import ManipulationTask
from vico.errors import InputError

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
    found, given = _checked(task, render_mode, options)
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
    found, given = _checked(task, render_mode, options)
    return ManipulationBatch(found, given, num_envs=num_envs, threads=threads, seed=seed)


def _checked(task: str, render_mode: None, options: dict[str, Any]) -> tuple[ManipulationTask, ManipulationOptions]:
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
