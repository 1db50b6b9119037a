"""Makers of the registered tasks: ``gymnasium.make("vico/PointGoal-v0", world=...)``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vico.challenges.assistant.challenge import world_and_people
from vico.challenges.assistant.tasks import RESIDENTS, Category
from vico.challenges.commute.tasks import LEGAL
from vico.challenges.learning.env import TaskEnv
from vico.challenges.learning.influence import InfluenceEnv
from vico.challenges.learning.point_goal import KINDS, PointGoal, PointGoalOptions
from vico.challenges.robot.tasks import Category as RobotCategory
from vico.community import build_community
from vico.community.model import Community
from vico.envs.vector import VectorAgentEnv, env_makers
from vico.world.folder import kept_world
from vico.world.world import World

if TYPE_CHECKING:
    from vico.challenges.learning.robot import RobotTeamEnv
_OF_ENV = ("tasks", "seed", "render_mode")


def make_point_goal(world: World | Path | str, **options: Any) -> TaskEnv:
    """Make ``vico/PointGoal-v0``: go to a point.

    Parameters
    ----------
    options
        Those of `PointGoalOptions`, of `TaskEnv` (`tasks`, `seed`, `render_mode`) and of `vico.envs.spec.EnvSpec`
        (`observe`, `image`, `form`, ...).
    """
    form = {"name": "arrays", "actions": "discrete", "kinds": KINDS}
    return _env(partial(PointGoal, world_of(world)), PointGoalOptions, options, form=form)


def make_robot_point_goal(world: World | Path | str, **options: Any) -> TaskEnv:
    """Make ``vico/RobotPointGoal-v0``: drive a robot to a point by velocities; see `make_point_goal`."""
    return make_point_goal(world, **{"robot": "go2:velocity", "max_steps": 200, **options})


def make_commute(world: World | Path | str, **options: Any) -> TaskEnv:
    """Make ``vico/Commute-v0``: be in time at every place of a day.

    Parameters
    ----------
    options
        Those of `CommuteOptions`, of `TaskEnv` and of `vico.envs.spec.EnvSpec`.
    """
    from vico.challenges.learning.commute import CommuteOptions, CommuteTaskEnv  # compiled code, slow to import

    form = {"name": "arrays", "actions": "discrete", "kinds": LEGAL}
    return _env(partial(CommuteTaskEnv, world_of(world)), CommuteOptions, options, form=form)


def make_carry(world: World | Path | str, **options: Any) -> TaskEnv:
    """Make ``vico/Carry-v0``; see `make_assistant`."""
    return make_assistant(world, "carry", **options)


def make_delivery(world: World | Path | str, **options: Any) -> TaskEnv:
    """Make ``vico/Delivery-v0``; see `make_assistant`."""
    return make_assistant(world, "delivery", **options)


def make_search(world: World | Path | str, **options: Any) -> TaskEnv:
    """Make ``vico/Search-v0``; see `make_assistant`."""
    return make_assistant(world, "search", **options)


def make_assistant(world: World | Path | str, category: Category, **options: Any) -> TaskEnv:
    """Make an environment of the community assistant's tasks, with the people of the challenge.

    Parameters
    ----------
    options
        Those of `vico.challenges.learning.assistant.AssistantOptions`, of `TaskEnv` and of `vico.envs.spec.EnvSpec`.
    """
    from vico.challenges.learning.assistant import AssistantOptions, AssistantTask

    if isinstance(world, World):
        found, people = world, build_community(world, residents=RESIDENTS[category], seed=0)
    else:
        found, people = world_and_people(Path(world), category)
    return _env(partial(AssistantTask, found, people, category), AssistantOptions, options)


def make_robot_carry(world: World | Path | str, **options: Any) -> TaskEnv:
    """Make ``vico/RobotCarry-v0``; see `make_robot_work`."""
    return make_robot_work(world, "carry", **options)


def make_robot_deliver(world: World | Path | str, **options: Any) -> TaskEnv:
    """Make ``vico/RobotDeliver-v0``; see `make_robot_work`."""
    return make_robot_work(world, "deliver", **options)


def make_robot_work(world: World | Path | str, category: RobotCategory, **options: Any) -> TaskEnv:
    """Make an environment of the community robot challenge for its mobile manipulator.

    Parameters
    ----------
    options
        Those of `vico.challenges.learning.robot.RobotOptions`, of `TaskEnv` and of `vico.envs.spec.EnvSpec`.
    """
    from vico.challenges.learning.robot import RobotOptions, RobotWork

    return _env(partial(RobotWork, *_robot_stage(world), category), RobotOptions, options)


def make_robot_team(world: World | Path | str, category: RobotCategory, **options: Any) -> RobotTeamEnv:
    """Make a PettingZoo environment of the community robot challenge for both of its robots.

    Parameters
    ----------
    options
        Those of `vico.challenges.learning.robot.RobotOptions`, of `RobotTeamEnv` (`tasks`, `seed`) and of
        `vico.envs.spec.EnvSpec`; ``form`` is rich unless told.
    """
    from vico.challenges.learning.robot import RobotOptions, RobotTeamEnv

    of_task, rest = _split(options, [field.name for field in fields(RobotOptions)])
    return RobotTeamEnv(*_robot_stage(world), category, RobotOptions(**of_task), **rest)


def make_robot_carry_team(world: World | Path | str, **options: Any) -> RobotTeamEnv:
    """Make ``vico/RobotCarry-v0`` for both robots; see `make_robot_team`."""
    return make_robot_team(world, "carry", **options)


def make_robot_deliver_team(world: World | Path | str, **options: Any) -> RobotTeamEnv:
    """Make ``vico/RobotDeliver-v0`` for both robots; see `make_robot_team`."""
    return make_robot_team(world, "deliver", **options)


def _robot_stage(world: World | Path | str) -> tuple[World, Community]:
    """Return a world, and the people of the community robot challenge."""
    from vico.challenges.robot.tasks import RESIDENTS as ROBOT_RESIDENTS
    from vico.challenges.robot_episodes import world_and_people as world_and_residents

    if isinstance(world, World):
        return world, build_community(world, residents=ROBOT_RESIDENTS, seed=0)
    return world_and_residents(Path(world), ROBOT_RESIDENTS)


def make_influence(world: World | Path | str, **options: Any) -> InfluenceEnv:
    """Make ``vico/Influence-v0``; see `InfluenceEnv` for its options."""
    return InfluenceEnv(world_of(world), **options)


def make_task_vec(
    maker: str, world: World | Path | str, *, num_envs: int = 1, seed: int = 0, **options: Any
) -> VectorAgentEnv:
    """Make several environments of a task, each in a process that reads the world itself.

    Parameters
    ----------
    maker
        Name of a function of this module, such as ``"make_point_goal"``.
    num_envs
        How many; without seeds of `reset` they draw their tasks by ``seed``, ``seed + 1`` and on.
    options
        As the function takes them.

    Raises
    ------
    InputError
        If the world has no folder.
    WorkerError
        If an environment cannot be made.
    """
    made = env_makers(_make_by_name, world, None, num_envs=num_envs, options={"maker": maker, "seed": seed, **options})
    return VectorAgentEnv(made)


#: Several of each, by what makes one.
make_point_goal_vec = partial(make_task_vec, "make_point_goal")
make_robot_point_goal_vec = partial(make_task_vec, "make_robot_point_goal")
make_commute_vec = partial(make_task_vec, "make_commute")
make_carry_vec = partial(make_task_vec, "make_carry")
make_delivery_vec = partial(make_task_vec, "make_delivery")
make_search_vec = partial(make_task_vec, "make_search")
make_robot_carry_vec = partial(make_task_vec, "make_robot_carry")
make_robot_deliver_vec = partial(make_task_vec, "make_robot_deliver")
make_influence_vec = partial(make_task_vec, "make_influence")


def _make_by_name(world: Path, community: None, *, maker: str, **options: Any) -> Any:
    return globals()[maker](world, **options)


def world_of(source: World | Path | str) -> World:
    """Return a world; one that is read from a folder is kept."""
    return source if isinstance(source, World) else kept_world(Path(source))


def _env(make: Callable[..., Any], of_options: Any, options: Mapping[str, Any], *, form: Any = "arrays") -> TaskEnv:
    """Make an environment of a task.

    Parameters
    ----------
    make
        Given the task's own options, and the simulation's settings by name, makes the task.
    of_options
        What the task's own options are.
    form
        Of observations and actions, unless the options say otherwise.
    """
    of_env, rest = _split(options, _OF_ENV)
    of_task, settings = _split(rest, [field.name for field in fields(of_options)])
    settings.setdefault("form", form)
    return TaskEnv(make(of_options(**of_task), **settings), **of_env)


def _split(options: Mapping[str, Any], names: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the options of these names, and the others."""
    mine = {name: value for name, value in options.items() if name in names}
    return mine, {name: value for name, value in options.items() if name not in names}
