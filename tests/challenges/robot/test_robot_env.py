"""Carry and Deliver as Gymnasium environments: seeds repeat, rewards are the paper's, nonsense ends in a cause."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pettingzoo
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test

import vico.envs  # noqa: F401  (registers the ids)
from vico.challenges.learning.make import make_robot_deliver
from vico.challenges.learning.robot import GOAL
from vico.challenges.robot.tasks import DESTINATION_RADIUS
from vico.errors import InputError

SMALL = {"tasks": 1, "image": 48, "seconds": 4, "period": 0.1, "cars": 0, "pedestrians": 2}
BOTH = ("robot_0", "robot_1")
IDS = ("vico/RobotDeliver-v0", "vico/RobotCarry-v0")
# Pictures of extents that have no bounds, and vectors that are no shares, are what they are.
quiet = pytest.mark.filterwarnings("ignore::UserWarning")


@quiet
@pytest.mark.parametrize("name", [IDS[0], pytest.param(IDS[1], marks=pytest.mark.slow)])
def test_gymnasiums_checker_is_content(name: str, helsinki_path: Path) -> None:
    check_env(gymnasium.make(name, world=helsinki_path, **SMALL).unwrapped)


@pytest.mark.parametrize("name", IDS)
def test_random_and_zero_agents_play_to_the_end_and_seeds_repeat(name: str, helsinki_path: Path) -> None:
    env: Any = gymnasium.make(name, world=helsinki_path, **SMALL | {"seconds": 1}).unwrapped
    totals = []
    for zero in (False, False, True):
        seen, info = env.reset(seed=0)
        assert env.observation_space.contains(seen)
        assert info["instructions"]["category"] == name[10:].split("-")[0].lower()
        env.action_space.seed(5)
        rewards, over = [], False
        while not over:
            action = np.zeros(11, np.float32) if zero else env.action_space.sample()
            seen, reward, ended, cut, info = env.step(action)
            rewards.append(reward)
            over = ended or cut
        assert (ended, cut, info["is_success"], len(rewards)) == (False, True, False, 10)
        assert info["cause"] == "not found"
        totals.append((rewards, {name: value.tolist() for name, value in seen.items()}))
    assert totals[0] == totals[1]
    assert totals[0] != totals[2]
    with pytest.raises(InputError, match="reset"):
        env.step(env.action_space.sample())


def test_rewards_are_the_papers_and_success_ends_the_episode(helsinki_path: Path) -> None:
    env = make_robot_deliver(helsinki_path, **SMALL | {"seconds": 30}, observe="none")
    env.reset(seed=0)
    work: Any = env.task
    wait = {"type": "wait"}
    _, reward, *_ = env.step(wait)
    objects = work.env.sim.state.objects
    k = objects.names.index(work.stage.task.thing.name)
    away = float(np.hypot(*(objects.position[k, :2] - work.stage.goal_at[:2])))
    assert away > DESTINATION_RADIUS + 0.1
    robot = work.stage.bodies()[0]
    hand = float(np.hypot(*(objects.position[k, :2] - robot[:2])))
    assert reward == pytest.approx(-0.02 * (min(hand, 10.0) + min(away, 10.0)), abs=0.02)
    objects.position[k] = work.stage.goal_at
    over, rewards, cut, info = False, [], False, {}
    while not over and not cut:
        _, reward, over, cut, info = env.step(wait)
        rewards.append(reward)
    assert (over, info["is_success"], info["cause"]) == (True, True, "")
    assert rewards[-1] > 90.0
    assert max(rewards[:-1]) <= 0.0


def test_what_is_asked_is_told_in_numbers_and_the_thing_where_it_is_seen(helsinki_path: Path) -> None:
    env = make_robot_deliver(helsinki_path, **SMALL | {"image": 160})
    seen, _ = env.reset(seed=0)
    assert seen["goal"].shape == (sum(GOAL.values()),)
    assert seen["goal"][0] == seen["goal"][5] == seen["goal"][15] == 1.0
    assert seen["goal"][20:].tolist() == [0.0] * 7  # it is far off
    work: Any = env.task
    objects, robot = work.env.sim.state.objects, work._stance()
    k = objects.names.index(work.stage.task.thing.name)
    ahead = robot.outside(np.array([1.2, 0.0, 0.0]))
    ahead[2] = float(work.env.world.height(ahead[:2]))
    objects.position[k] = ahead
    for _ in range(3):  # before it rolls off, or tips over, where the ground is no floor
        seen = env.step({"type": "wait"})[0]
    found = seen["goal"][20:]
    assert found[0] == 1.0
    size = np.array(work.stage._truth(work.stage._entity).half)
    assert found[1:3] == pytest.approx([1.2, 0.0], abs=0.15)
    (narrow, wide), sides = np.sort(found[4:6]), np.sort(size[:2])
    assert narrow == pytest.approx(sides[0], abs=0.05)
    # A spout may be hidden.
    least = 0.3 * sides[1] if work.stage.task.thing.kind == "watering can" else sides[1] - 0.05
    assert least < wide < sides[1] + 0.05


def test_an_action_that_is_no_number_ends_the_episode(helsinki_path: Path) -> None:
    env = make_robot_deliver(helsinki_path, **SMALL, observe="none")
    env.reset(seed=0)
    _, reward, ended, cut, info = env.step(np.full(11, np.nan, np.float32))
    assert (reward, ended, cut) == (0.0, True, False)
    assert (info["is_success"], info["cause"]) == (False, "unusable action")


@pytest.mark.parametrize(
    ("options", "says"),
    [({"reward": "money"}, "'paper' or 'sparse'"), ({"period": 0.5}, r"0\.01 to 0\.1"), ({"seconds": 0}, "1 or more")],
)
def test_odd_options_are_refused(options: dict[str, Any], says: str, helsinki_path: Path) -> None:
    with pytest.raises(InputError, match=says):
        make_robot_deliver(helsinki_path, **options)


@quiet
@pytest.mark.parametrize("form", ["rich", "arrays"])
def test_both_robots_learn_at_once_in_a_pettingzoo_environment(form: str, helsinki_path: Path) -> None:
    env: Any = pettingzoo.make("parallel", IDS[0], world=helsinki_path, form=form, **SMALL | {"seconds": 1})
    parallel_api_test(env, num_cycles=12)
    hashes = []
    for _ in range(2):
        seen, infos = env.reset(seed=0)
        assert form == "arrays" or infos["robot_1"]["instructions"]["category"] == "deliver"
        for name in BOTH:
            env.action_space(name).seed(5)
        for _ in range(10):
            assert all(env.observation_space(name).contains(seen[name]) for name in BOTH)
            assert env.agents == list(BOTH)
            seen, rewards, ended, cut, infos = env.step({name: env.action_space(name).sample() for name in BOTH})
        assert rewards["robot_0"] == rewards["robot_1"] < 0.0
        assert (ended, cut, env.agents) == (dict.fromkeys(BOTH, False), dict.fromkeys(BOTH, True), [])
        assert infos["robot_0"]["is_success"] == 0.0
        hashes.append(env.state_hash())
    assert hashes[0] == hashes[1]
    assert env.render().shape == (48, 96, 3)
    env.reset(seed=0)
    broken = {"type": "control", "vector": [np.nan, 0.0]}
    _, rewards, ended, _, infos = env.step({"robot_0": {"type": "wait"}, "robot_1": broken})
    assert (set(rewards.values()), set(ended.values()), env.agents) == ({0.0}, {True}, [])
    with pytest.raises(InputError, match="reset"):
        env.step({})
