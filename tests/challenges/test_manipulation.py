"""Arms and boxes: the checker is content, batches do what single environments do, a script solves the tasks."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import vico.envs  # noqa: F401  (registers the ids)
from vico.challenges.learning.manipulation import (
    MANIPULATION,
    ManipulationEnv,
    make_manipulation,
    make_manipulation_vec,
)
from vico.challenges.learning.manipulation.batch import BatchedScene
from vico.challenges.learning.manipulation.observation import FULL
from vico.challenges.learning.manipulation.policies import ScriptedExpert
from vico.challenges.learning.manipulation.scene import SIDES, SUBSTEPS, TABLES, ManipulationOptions
from vico.challenges.learning.manipulation.tasks import paper_reward
from vico.envs.spec import ARM_TASKS
from vico.errors import InputError, SchemaError
from vico.seeds import rng

_ZERO = np.zeros(8, np.float32)


def actions_of(steps: int, count: int) -> Any:
    return rng(0, "test actions").uniform(-1, 1, (steps, count, 8)).astype(np.float32)


def play(env: ManipulationEnv, seed: int) -> tuple[dict[str, Any], list[float]]:
    """Let the expert act through an episode; return how it ended, and rewards."""
    env.reset(seed=seed)
    expert, over, info, rewards = ScriptedExpert(env), False, {}, []
    while not over:
        _, reward, ended, cut, info = env.step(expert.act())
        over = ended or cut
        rewards.append(reward)
    return info, rewards


@pytest.mark.parametrize("name", sorted(ARM_TASKS))
@pytest.mark.parametrize("options", [{}, {"reward": "paper", "observation": "paper", "base": "wheels"}])
def test_gymnasiums_checker_is_content(name: str, options: dict[str, Any]) -> None:
    check_env(gymnasium.make(name, **options).unwrapped)


@pytest.mark.parametrize("task", sorted(MANIPULATION))
def test_random_and_zero_agents_come_to_the_end_of_episodes(task: str) -> None:
    batch = make_manipulation_vec(task, num_envs=4, max_steps=30)
    batch.reset(seed=0)
    for agent in (actions_of(30, 4), np.zeros((30, 4, 8), np.float32)):
        for actions in agent:
            seen, reward, ended, cut, info = batch.step(actions)
            assert batch.observation_space.contains(seen)
            assert np.isfinite(reward).all()
        assert cut.all()
        assert not ended.any()
        assert info["_final_info"].all()


@pytest.mark.parametrize("options", [{}, {"base": "wheels", "oracle_grasp": True}])
def test_copies_of_a_batch_do_what_single_environments_do(options: dict[str, Any]) -> None:
    count, steps = 5, 45
    actions = actions_of(steps, count)
    batch = make_manipulation_vec("place", num_envs=count, threads=2, max_steps=20, **options)
    found = [batch.reset(seed=7)[0].copy()]
    rewards = []
    for one in actions:
        seen, reward, _, _, _ = batch.step(one)
        found.append(seen.copy())
        rewards.append(reward)
    for k in range(count):
        env = make_manipulation("place", max_steps=20, **options)
        np.testing.assert_array_equal(env.reset(seed=7 + k)[0], found[0][k])
        for step in range(steps):
            seen, reward, ended, cut, _ = env.step(actions[step, k])
            assert reward == rewards[step][k]
            if ended or cut:
                seen, _ = env.reset()
            np.testing.assert_array_equal(seen, found[step + 1][k])


def test_batched_stepping_is_mujocos_plain_stepping() -> None:
    copies = BatchedScene(MANIPULATION["lift"], ManipulationOptions(), 3)
    copies.seeds[:] = [3, 4, 5]
    copies.begin(range(3))
    for actions in actions_of(10, 3):
        before, targets = copies.state.copy(), copies.targets.copy()
        copies.advance(actions)
        for k, model in enumerate(copies.models):
            data = mujoco.MjData(model)
            mujoco.mj_setState(model, data, before[k], mujoco.mjtState.mjSTATE_FULLPHYSICS)
            data.qacc_warmstart[:] = 0.0
            for part in range(1, SUBSTEPS + 1):
                now = targets[k] + part / SUBSTEPS * (copies.targets[k] - targets[k])
                data.ctrl[:] = [*now, now[7]]
                mujoco.mj_step(model, data)
            np.testing.assert_allclose(data.qpos, copies.state[k, 1 : 1 + model.nq], atol=1e-9)


@pytest.mark.parametrize("task", ["reach", "lift", "place", "pick_place"])
def test_a_scripted_expert_solves_each_task_by_friction_alone(task: str) -> None:
    env = make_manipulation(task)
    results = []
    for seed in range(10):
        info, _ = play(env, seed)
        results.append(info["is_success"])
        assert not env.copies._control[:, :, env.copies.scene.model.nu + env.copies._weld].any()
    assert sum(results) >= 9, results


def test_the_expert_solves_it_on_wheels_and_with_the_arm_folded_at_first() -> None:
    env = make_manipulation("pick_place", base="wheels", start="folded")
    assert sum(play(env, seed)[0]["is_success"] for seed in range(5)) >= 4


def test_an_oracles_grasp_holds_what_friction_cannot() -> None:
    held = {}
    for oracle in (False, True):
        env = make_manipulation("lift", oracle_grasp=oracle)
        env.reset(seed=2)
        env.copies.friction[:] = 1e-3
        env.restore_state(env.save_state())  # writes the box's parameters into the model
        expert, info = ScriptedExpert(env), {}
        for _ in range(120):
            info = env.step(expert.act())[4]
        held[oracle] = info["lifted"]
        assert bool(np.isfinite(env.copies.fastened[0])) == oracle
    assert held == {False: False, True: True}


def test_an_oracles_grasp_is_let_go_of_when_the_jaw_opens() -> None:
    env = make_manipulation("pick_place", oracle_grasp=True)
    info, _ = play(env, 1)
    assert info["is_success"]
    assert np.isnan(env.copies.fastened[0])


def test_the_seed_decides_the_box_and_what_it_stands_on() -> None:
    env, other = make_manipulation("lift"), make_manipulation("lift")
    drawn = []
    for seed in range(30):
        env.reset(seed=seed)
        np.testing.assert_array_equal(env.readings.thing, (other.reset(seed=seed), other.readings.thing)[1])
        drawn.append([*env.copies.half[0], env.copies.mass[0], env.copies.surface[0]])
    half, mass, surface = np.array(drawn)[:, :3], np.array(drawn)[:, 3], np.array(drawn)[:, 4]
    assert half.min() >= SIDES[0] / 2
    assert half.max() <= SIDES[1] / 2
    assert mass.max() <= 2.0
    assert 5 < (surface == 0.0).sum() < 25
    assert (surface[surface > 0] >= TABLES[0]).all()


def test_a_saved_state_goes_on_to_the_same_end() -> None:
    env = make_manipulation("pick_place", oracle_grasp=True)
    env.reset(seed=4)
    expert = ScriptedExpert(env)
    played = [expert.act() for _ in range(1)]
    env.step(played[0])
    for _ in range(45):
        env.step(expert.act())
    kept = env.save_state()
    ahead = actions_of(20, 1)[:, 0]
    first = [env.step(action)[0] for action in ahead]
    other = make_manipulation("pick_place", oracle_grasp=True)
    other.reset(seed=11)
    other.restore_state(kept)
    second = [other.step(action)[0] for action in ahead]
    np.testing.assert_array_equal(first, second)


def test_a_state_of_another_kind_is_refused() -> None:
    kept = make_manipulation_vec("lift", num_envs=2).save_state()
    with pytest.raises(SchemaError, match=r"state of the saved state has shape \(2, 32\), not \(1, 32\)"):
        make_manipulation("lift").restore_state(kept)


def test_an_action_that_is_no_number_ends_the_episode_with_its_cause() -> None:
    batch = make_manipulation_vec("lift", num_envs=3)
    batch.reset(seed=0)
    actions = np.zeros((3, 8), np.float32)
    actions[1, 2] = np.nan
    seen, reward, ended, cut, info = batch.step(actions)
    assert ended.tolist() == [False, True, False]
    assert info["final_info"][1]["cause"] == "the action holds NaN or infinity"
    assert np.isfinite(seen).all()
    assert reward[1] == 0.0
    assert not cut.any()
    env = make_manipulation("lift")
    env.reset(seed=0)
    assert env.step(np.full(8, np.inf))[2:4] == (True, False)
    with pytest.raises(InputError, match="call reset"):
        env.step(_ZERO)


def test_motion_that_breaks_down_ends_the_episode_with_its_cause() -> None:
    env = make_manipulation("lift")
    env.reset(seed=0)
    env.copies.state[0, 1 + env.copies.scene.model.nq + env.copies.scene.thing_rate] = 1e12
    _, reward, ended, _, info = env.step(_ZERO)
    assert (reward, ended, info["is_success"], info["cause"]) == (0.0, True, False, "the motion broke down")


def test_rewards_of_the_paper_are_its_four_terms() -> None:
    env = make_manipulation("pick_place", reward="paper")
    env.reset(seed=0)
    r = env.readings
    away = float(np.linalg.norm(r.hand - r.thing)), float(np.linalg.norm(r.thing - r.goal))
    terms = ("object", "goal", "grasp", "place")
    assert paper_reward(r, terms)[0] == pytest.approx(-0.02 * sum(away))
    far = r._replace(hand=r.thing + 50.0)
    assert paper_reward(far, ("object",))[0] == pytest.approx(-0.2)
    up = r.thing + np.array([0.0, 0.0, 4.0 * float(r.height_half[0])])
    gripped = r._replace(thing=up, pressure=np.full((1, 2), 10.0))
    assert paper_reward(gripped, ("grasp",))[0] == 5.0
    assert paper_reward(gripped._replace(pressure=np.array([[10.0, 0.0]])), ("grasp",))[0] == 0.0
    assert [float(paper_reward(r._replace(at_goal=np.array([n])), ("place",))[0]) for n in (99, 100, 101)] == [
        0,
        100,
        0,
    ]
    _, rewards = play(env, 0)
    assert sum(reward > 90.0 for reward in rewards) == 1


@pytest.mark.parametrize("task", ["reach", "lift", "place", "pick_place"])
def test_the_staged_reward_is_greatest_at_the_end_of_what_is_asked(task: str) -> None:
    env = make_manipulation(task)
    info, rewards = play(env, 3)
    env.reset(seed=3)
    idle = [env.step(_ZERO)[1] for _ in range(60)]
    assert info["is_success"]
    assert min(rewards[-50:]) > 0.85
    assert max(rewards) <= 1.0 + 1e-9
    assert rewards[-1] > 2.0 * max(idle)


def test_stages_of_the_reward_never_take_back_what_an_earlier_one_gave() -> None:
    env = make_manipulation("reach", surface="ground")
    env.reset(seed=0)
    r, staged = env.readings, MANIPULATION["reach"].staged
    down = r.thing_rotation[0, :, 1], np.array([0.0, 0.0, -1.0])
    square = np.column_stack([np.cross(*down), *down])[None]
    width = r.half[:, 1] + 0.02
    over = r.grasp_point + np.array([0.0, 0.0, 0.12])
    path = [
        r,
        r._replace(hand=over),  # above, but neither square nor wide enough
        r._replace(hand=over, hand_rotation=square),
        r._replace(hand=over, hand_rotation=square, joints=np.append(r.joints[0, :7], width)[None]),
    ]
    path += [path[-1]._replace(hand=over - np.array([0.0, 0.0, z])) for z in (0.04, 0.08, 0.12)]
    rewards = [float(staged(one)[0]) for one in path]
    assert all(a < b + 1e-9 for a, b in pairwise(rewards)), rewards
    assert rewards[-1] == pytest.approx(1.0)
    ready = path[3]
    heights = [float(staged(ready._replace(hand=over + np.array([0.0, 0.0, z])))[0]) for z in (0.6, 0.3, 0.1, 0.0)]
    assert all(a < b - 0.01 for a, b in pairwise(heights)), heights


def test_pushing_a_box_to_its_goal_is_no_pick_and_place() -> None:
    env = make_manipulation("pick_place", surface="ground")
    env.reset(seed=0)
    r = env.readings
    at = r._replace(thing=r.goal, pressure=np.zeros((1, 2)))
    assert MANIPULATION["place"].evaluate(at)["success"][0]
    assert not MANIPULATION["pick_place"].evaluate(at)["success"][0]
    assert MANIPULATION["pick_place"].evaluate(at._replace(was_lifted=np.array([True])))["success"][0]


def test_an_episode_ends_with_success_where_that_is_asked_for() -> None:
    env = make_manipulation("reach", terminate_on_success=True)
    env.reset(seed=0)
    expert, ended, steps = ScriptedExpert(env), False, 0
    while not ended:
        _, _, ended, _, info = env.step(expert.act())
        steps += 1
    assert info["is_success"]
    assert steps < 100


def test_observations_hold_what_the_page_lists() -> None:
    env = make_manipulation("lift")
    seen, _ = env.reset(seed=0)
    r, at, parts = env.readings, 0, {}
    for name, size in FULL.items():
        parts[name] = seen[at : at + size]
        at += size
    assert at == len(seen) == 42
    np.testing.assert_allclose(parts["joints"], r.joints[0], atol=1e-6)
    np.testing.assert_allclose(parts["hand_to_object"], (r.thing - r.hand)[0], atol=1e-6)
    level = sorted([*parts["half_sides"][:2], parts["half_sides"][2]]), sorted(r.half[0])
    np.testing.assert_allclose(*level, atol=1e-6)
    assert parts["half_sides"][2] == pytest.approx(r.half[0, 2])
    assert parts["half_sides"][0] == pytest.approx(r.gripped_half[0])
    assert parts["jaw"][1] == pytest.approx(np.cos(4.0 * np.arccos(r.squareness[0])), abs=0.02)


def test_turning_the_jaw_to_the_left_raises_its_angle_to_a_box_on_any_face() -> None:
    env = make_manipulation("lift")
    env.reset(seed=0)
    r = env.readings
    faces = [np.eye(3), np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.diag([1.0, -1.0, -1.0])]
    for face in faces:
        turns = []
        for angle in (0.1, 0.3):
            jaw = np.array([np.cos(angle), np.sin(angle), 0.0])
            hand = np.column_stack([np.cross(jaw, [0, 0, -1.0]), jaw, [0, 0, -1.0]])
            turns.append(
                float(r._replace(thing_rotation=face[None].astype(float), hand_rotation=hand[None]).jaw_turn[0])
            )
        assert turns[1] - turns[0] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reward": "dense"}, "reward is 'dense'; use 'staged' or 'paper'"),
        ({"max_steps": 0}, "max_steps is 0"),
        ({"joint_step": float("nan")}, "joint_step is nan"),
        ({"speed": 3}, "no option 'speed'; there are reward, "),
        ({"render_mode": "human"}, "render_mode is 'human'"),
    ],
)
def test_options_that_are_none_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_manipulation("lift", **options)


def test_ids_make_batches_and_states_have_to_be_begun() -> None:
    batch = gymnasium.make_vec("vico/Lift-v0", num_envs=3, threads=2)
    assert batch.reset(seed=0)[0].shape == (3, 42)
    with pytest.raises(InputError, match=r"shape \(2, 8\); it has to be \(3, 8\)"):
        batch.unwrapped.step(np.zeros((2, 8), np.float32))
    with pytest.raises(InputError, match="no manipulation task 'throw'"):
        make_manipulation("throw")
