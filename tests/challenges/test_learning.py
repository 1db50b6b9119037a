"""Tasks as Gymnasium environments: the checker is content, rewards are what they are said to be, seeds repeat."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import toy_city
import vico.envs  # noqa: F401  (registers the ids)
from vico.challenges.learning.make import make_point_goal, make_robot_point_goal
from vico.challenges.learning.point_goal import path_lengths_to
from vico.envs.spec import TASKS
from vico.errors import EmptyInputError, InputError
from vico.world.world import World

#: Pictures of extents that have no bounds, and vectors that are no shares, are what they are.
quiet = pytest.mark.filterwarnings("ignore::UserWarning")
_SMALL = {"tasks": 1, "image": 32}


def play(env: Any, actions: int, *, seed: int) -> list[float]:
    """Take sampled actions; return rewards."""
    env.reset(seed=seed)
    env.action_space.seed(seed)
    found = []
    for _ in range(actions):
        _, reward, ended, cut, _ = env.step(env.action_space.sample())
        found.append(reward)
        if ended or cut:
            env.reset()
    return found


def test_every_task_is_registered_and_its_spec_goes_to_json() -> None:
    assert set(TASKS) <= set(gymnasium.registry)
    assert json.loads(gymnasium.spec("vico/PointGoal-v0").to_json())["id"] == "vico/PointGoal-v0"


@quiet
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("vico/PointGoal-v0", {}),
        ("vico/RobotPointGoal-v0", {}),
        ("vico/Influence-v0", {"tasks": 2, "hours": 0.5}),
        pytest.param("vico/Delivery-v0", _SMALL, marks=pytest.mark.slow),
        pytest.param("vico/Search-v0", _SMALL, marks=pytest.mark.slow),
        pytest.param("vico/Delivery-v0", _SMALL | {"form": "rich"}, marks=pytest.mark.slow),
    ],
)
def test_gymnasiums_checker_is_content(name: str, options: dict[str, Any], helsinki_path: Path) -> None:
    check_env(gymnasium.make(name, world=helsinki_path, **options).unwrapped)


@quiet
@pytest.mark.slow
@pytest.mark.parametrize(("name", "options"), [("vico/Commute-v0", {"tasks": 1}), ("vico/Carry-v0", _SMALL)])
def test_gymnasiums_checker_is_content_in_a_larger_city(name: str, options: Any, helsinki_city: World) -> None:
    check_env(gymnasium.make(name, world=helsinki_city.path, **options).unwrapped)


def test_who_walks_to_the_point_is_rewarded_for_the_metres_and_for_being_there() -> None:
    env = make_point_goal(toy_city.world())
    _, told = env.reset(seed=4)
    total, over, ended, info = 0.0, False, False, told
    steps = 0
    while not over:
        goal = env.task.goal(env._last)  # type: ignore[arg-type]
        angle = float(np.degrees(np.arctan2(goal[2], goal[1])))
        side = "turn_left" if angle > 0 else "turn_right"
        action = {"type": side, "degrees": abs(angle)} if abs(angle) > 5 else {"type": "move_forward", "distance": 1.0}
        _, reward, ended, cut, info = env.step(action)
        total, over, steps = total + reward, ended or cut, steps + 1
    assert (ended, info["is_success"]) == (True, True)
    away = float(np.expm1(float(env.reset(seed=4)[0]["goal"][3]) * 6))
    # A way over cells is up to 8 % longer than the straight one, and ends before the point.
    assert total == pytest.approx(1.0 + away / 10.0 - 0.01 * steps, abs=0.1 * away / 10.0 + 0.25)


def test_the_same_seed_gives_the_same_rewards_and_other_seeds_others() -> None:
    env = make_point_goal(toy_city.world())
    first, other, again = play(env, 20, seed=1), play(env, 20, seed=2), play(env, 20, seed=1)
    assert first == again
    assert first != other


def test_numbers_of_episodes_are_drawn_from_the_seed_and_their_tasks_are_limited() -> None:
    drawn = []
    for _ in range(2):
        env = make_point_goal(toy_city.world(), tasks=3, seed=5)
        drawn.append([env.reset()[1]["task"] for _ in range(8)])
    assert drawn[0] == drawn[1]
    assert set(drawn[0]) <= {0, 1, 2}
    assert env.reset(seed=7)[1]["task"] == 1


def test_an_episode_without_success_is_cut_off_and_cannot_go_on() -> None:
    env = make_point_goal(toy_city.world(), max_steps=2, least=20.0)
    env.reset(seed=0)
    env.step({"type": "wait"})
    _, reward, ended, cut, info = env.step({"type": "wait"})
    assert (reward, ended, cut, info["is_success"]) == (pytest.approx(-0.01), False, True, False)
    with pytest.raises(InputError, match="reset"):
        env.step({"type": "wait"})


def test_a_robot_gets_nearer_by_its_velocity() -> None:
    env = make_robot_point_goal(toy_city.world(), robot="husky:velocity")
    assert env.action_space.shape is not None
    observation, _ = env.reset(seed=2)
    before = float(observation["goal"][3])
    for _ in range(20):
        angle = float(np.arctan2(observation["goal"][2], observation["goal"][1]))
        low, high = env.action_space.low, env.action_space.high  # type: ignore[attr-defined]
        wanted = np.zeros(len(low), np.float32)
        wanted[0], wanted[-1] = (0.8 if abs(angle) < 0.5 else 0.0), angle
        observation, _, ended, *_ = env.step(np.clip(wanted, low, high))
        if ended:
            break
    assert float(observation["goal"][3]) < before - 0.05


def test_ways_lead_round_the_house() -> None:
    walkable = toy_city.world().walkable
    goal = np.array([0.25, 25.25])
    ways, (left, bottom) = path_lengths_to(walkable, goal, 60.0)
    column, row = walkable.cell_of([0.25, 0.25]).tolist()
    way = float(ways[row - bottom, column - left])
    # 20 m wide and 12 m deep: from the middle of one side to beyond the other.
    assert 33.0 < way < 40.0
    assert np.isinf(ways[walkable.cell_of([0.0, 11.0])[1] - bottom, walkable.cell_of([0.0, 11.0])[0] - left])


def test_a_world_without_the_task_says_so() -> None:
    env = make_point_goal(toy_city.world(), least=300.0, most=300.0)
    with pytest.raises(EmptyInputError, match="no two points"):
        env.reset(seed=0)


@pytest.mark.parametrize(
    ("options", "told"),
    [({"reward": "money"}, "sparse"), ({"reach": 50.0}, "grow in this order"), ({"tasks": 0}, "1 or more")],
)
def test_odd_options_are_refused(options: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        make_point_goal(toy_city.world(), **options)


def test_a_day_of_talk_is_rewarded_by_who_is_won_over(helsinki_path: Path) -> None:
    env = gymnasium.make("vico/Influence-v0", world=helsinki_path, hours=1.0, rival="random").unwrapped
    sparse = gymnasium.make(
        "vico/Influence-v0", world=helsinki_path, hours=1.0, rival="random", reward="sparse"
    ).unwrapped
    totals = []
    for one in (env, sparse):
        _, info = one.reset(seed=3)
        won, total, over = info["won"], 0.0, False
        while not over:
            options = np.flatnonzero(info["action_mask"])
            _, reward, over, _, info = one.step(options[-1])
            total += float(reward)
        assert total == pytest.approx(info["won"] - won, abs=1e-6)
        totals.append(total)
    assert totals[0] == pytest.approx(totals[1])
    assert info["visits"] > 0


@pytest.mark.slow
def test_a_delivery_is_worth_one_when_the_things_lie_there(helsinki_path: Path) -> None:
    env = gymnasium.make("vico/Delivery-v0", world=helsinki_path, observe="none", tasks=1, max_steps=20).unwrapped
    task = env.task  # type: ignore[attr-defined]
    env.reset(seed=0)
    rewards = [float(env.step({"type": "wait"})[1])]
    destination = task._task.subtasks[0].destination
    objects = task.env.sim.state.objects
    for name in task._judge.things[0]:
        k = objects.names.index(name)
        if destination.place is None:
            objects.room[k], objects.position[k] = -1, destination.centre
    rewards.append(float(env.step({"type": "wait"})[1]))
    _, reward, ended, _, info = env.step({"type": "task_complete", "index": 0})
    assert rewards[0] == 0.0
    assert rewards[1] == (1.0 if destination.place is None else 0.0)
    assert (reward, ended, info["reported"]) == (0.0, False, 1)
