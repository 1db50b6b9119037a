"""Libraries of reinforcement learning take our environments as they are: each for a thousand steps."""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from typing import Any

import pytest

import toy_city
import vico
from vico.challenges.learning.make import make_point_goal
from vico.world.folder import read_world

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]

STEPS = 1000
BOX = {"name": "arrays", "observation": "box", "actions": "discrete"}
SMALL: dict[str, Any] = {"n_steps": 250, "batch_size": 125, "n_epochs": 1, "device": "cpu", "seed": 0}


def needs(module: str, extra: str) -> Any:
    """Import a library, or skip the test and say how to get it."""
    try:
        return importlib.import_module(module)
    except ImportError:
        pytest.skip(f'{module} is not installed; pip install "virtual-community[{extra}]"')


def everybody(world: Any = None, people: Any = None, **options: Any) -> Any:
    """Three residents and an assistant as arrays."""
    world, people = (toy_city.world(), toy_city.community()) if world is None else (world, people)
    return vico.make(world, people, assistants=1, observe="none", max_steps=50, form=BOX, **options)


def test_stable_baselines3_trains_on_a_task() -> None:
    sb3 = needs("stable_baselines3", "rl")
    from stable_baselines3.common.env_checker import check_env

    env = make_point_goal(toy_city.world())
    check_env(env)
    assert sb3.PPO("MultiInputPolicy", env, **SMALL).learn(STEPS).num_timesteps == STEPS


def test_masked_ppo_takes_the_masks_of_numbers_with_parts() -> None:
    contrib = needs("sb3_contrib", "rl")
    env = make_point_goal(toy_city.world(), form="arrays")
    assert contrib.MaskablePPO("MultiInputPolicy", env, **SMALL).learn(STEPS).num_timesteps == STEPS


def test_torchrl_rolls_out_a_task() -> None:
    gym = needs("torchrl.envs.libs.gym", "torchrl")
    found = gym.GymWrapper(make_point_goal(toy_city.world())).rollout(STEPS, break_when_any_done=False)
    assert found.shape == (STEPS,)
    assert found["next", "done"].any()


def test_torchrl_rolls_out_a_community() -> None:
    pettingzoo = needs("torchrl.envs.libs.pettingzoo", "torchrl")
    env = pettingzoo.PettingZooWrapper(everybody(robots=("husky",)))
    found = env.rollout(STEPS, break_when_any_done=False)
    assert found.shape == (STEPS,)
    assert found["resident", "action_mask"].shape[:2] == (STEPS, 3)
    assert found["robot", "action"].shape == (STEPS, 1, 4)


@pytest.mark.parametrize("many", [False, True], ids=["one agent", "everybody"])
def test_rllib_trains(many: bool) -> None:
    ray = needs("ray", "rllib")
    needs("ray.rllib", "rllib")
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
    from ray.tune.registry import register_env

    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    register_env(
        "vico", lambda _: ParallelPettingZooEnv(everybody()) if many else make_point_goal(toy_city.world(), form=BOX)
    )
    ray.init(num_cpus=1, include_dashboard=False, configure_logging=False)
    try:
        config = (
            PPOConfig()
            .environment("vico")
            .env_runners(num_env_runners=0, create_env_on_local_worker=True)
            .learners(num_learners=0)
            .training(train_batch_size_per_learner=STEPS, minibatch_size=250, num_epochs=1)
        )
        if many:
            config = config.multi_agent(policies={"all"}, policy_mapping_fn=lambda agent, episode, **_: "all")
        algorithm = config.build_algo()
        assert algorithm.train()["env_runners"]["num_env_steps_sampled"] == STEPS
        algorithm.stop()
    finally:
        ray.shutdown()


def test_supersuit_makes_a_vector_of_agents_that_stable_baselines3_trains_on(
    helsinki_path: Path, helsinki_people: Path
) -> None:
    supersuit = needs("supersuit", "supersuit")
    sb3 = needs("stable_baselines3", "rl")
    env = vico.make(
        read_world(helsinki_path), vico.read_community(helsinki_people), observe="none", max_steps=50, form=BOX
    )
    vector = supersuit.concat_vec_envs_v1(
        supersuit.pettingzoo_env_to_vec_env_v1(env), 1, num_cpus=1, base_class="stable_baselines3"
    )
    model = sb3.PPO("MlpPolicy", vector, **(SMALL | {"n_steps": STEPS // 4}))
    assert model.learn(STEPS).num_timesteps >= STEPS
