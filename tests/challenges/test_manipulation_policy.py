"""Policies in files: read by numpy alone, refused where they do not fit; training writes such a file and goes on."""

from __future__ import annotations

import csv
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from vico.challenges.learning.manipulation import ArrayPolicy, make_manipulation, make_manipulation_vec, read_policy
from vico.challenges.learning.manipulation.environment import score
from vico.challenges.learning.manipulation.observation import input_scaling, size_of
from vico.challenges.learning.manipulation.policies import (
    PLACES,
    ArmController,
    ArmState,
    DecomposedPolicy,
    write_policy,
)
from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.files import read_json, sha256_of
from vico.seeds import rng

SCRIPT = Path(__file__).parents[2] / "scripts" / "train_manipulation.py"
KEPT = Path(__file__).parents[2] / "benchmarks" / "policies" / "decomposed"


def network(sizes: tuple[int, ...] = (42, 16, 8), seed: int = 0) -> ArrayPolicy:
    draw = rng(seed, "test network")
    pairs = list(zip(sizes[1:], sizes[:-1], strict=True))
    weights = tuple(draw.normal(size=pair).astype(np.float32) / 4 for pair in pairs)
    biases = tuple(draw.normal(size=pair[0]).astype(np.float32) / 4 for pair in pairs)
    return ArrayPolicy(weights, biases, np.zeros(sizes[0], np.float32), np.ones(sizes[0], np.float32))


def test_a_policy_is_what_it_was_when_it_was_written(tmp_path: Path) -> None:
    policy = network()
    write_policy(tmp_path / "policy.npz", policy)
    seen = rng(0, "seen").normal(size=(5, 42)).astype(np.float32)
    again = read_policy(tmp_path / "policy.npz", inputs=42, outputs=8)
    np.testing.assert_array_equal(again.act(seen), policy.act(seen))
    assert np.abs(again.act(1000.0 * seen)).max() <= 1.0


def test_a_policy_is_dense_layers_with_elu_between_them() -> None:
    policy = network()
    x = np.full(42, 0.3, np.float64)
    hidden = policy.weights[0].astype(np.float64) @ x + policy.biases[0]
    hidden = np.where(hidden > 0, hidden, np.exp(hidden) - 1)
    out = policy.weights[1] @ hidden + policy.biases[1]
    np.testing.assert_allclose(policy.act(x), np.clip(out, -1, 1), atol=1e-5)


class Harmful:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.mkdir, ("harm",)


def test_a_pickle_is_refused_and_never_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plain.npz").write_bytes(pickle.dumps(Harmful()))
    np.savez(tmp_path / "inside.npz", weight_0=np.array([Harmful()], object))
    (tmp_path / "cut.npz").write_bytes(b"PK\x03\x04 nothing")
    for name in ("plain.npz", "inside.npz", "cut.npz"):
        with pytest.raises(SchemaError, match="is no archive of plain arrays"):
            read_policy(tmp_path / name)
    assert not (tmp_path / "harm").exists()
    with pytest.raises(MissingFileError, match="no such file"):
        read_policy(tmp_path / "none.npz")


def test_a_policy_of_the_wrong_shape_is_refused_in_a_sentence(tmp_path: Path) -> None:
    good = network()
    arrays = {"weight_0": good.weights[0], "weight_1": good.weights[1], "bias_0": good.biases[0]}
    arrays |= {"bias_1": good.biases[1], "mean": good.mean, "deviation": good.deviation}
    wrong = {
        "holds bias_0, bias_1": {"mean": None},
        r"weight_1 has shape \(8, 3\)": {"weight_1": np.zeros((8, 3), np.float32)},
        "bias_0 is float64": {"bias_0": np.zeros(16)},
        "or holds NaN": {"bias_0": np.full(16, np.nan, np.float32)},
        "deviation has to have": {"deviation": np.zeros(42, np.float32)},
    }
    for message, changes in wrong.items():
        np.savez(tmp_path / "p.npz", **{k: v for k, v in {**arrays, **changes}.items() if v is not None})
        with pytest.raises(SchemaError, match=message):
            read_policy(tmp_path / "p.npz")
    write_policy(tmp_path / "p.npz", good)
    with pytest.raises(SchemaError, match="has 42 inputs, not 31: it was trained on another task"):
        read_policy(tmp_path / "p.npz", inputs=size_of("paper"))
    with pytest.raises(SchemaError, match="a network of 42 inputs; make the environment"):
        good.act(np.zeros(31))


def test_policies_are_scored_on_whole_episodes() -> None:
    batch = make_manipulation_vec("lift", num_envs=3, max_steps=12)
    found = score(batch, network().act, seed=5)
    assert (found.episodes, found.success_at_end, found.causes) == (3, 0.0, {})
    broken = score(batch, lambda seen: np.full((3, 8), np.nan), seed=5)
    assert broken.causes == {"the action holds NaN or infinity": 3}


def test_one_policy_lifts_until_another_places() -> None:
    lift, place = network(seed=1), network(seed=2)
    both = DecomposedPolicy(lift, place)
    seen, _ = make_manipulation("pick_place").reset(seed=0)
    seen = seen[None]
    first = both.act(seen)
    told = seen.copy()
    told[:, PLACES["object_to_goal"]] = [0.0, 0.0, 0.2]
    told[:, PLACES["hand_to_goal"]] = seen[:, PLACES["hand_to_object"]] + np.array([0.0, 0.0, 0.2], np.float32)
    np.testing.assert_allclose(first, lift.act(told), atol=1e-6)
    up = seen.copy()
    up[:, PLACES["object"]] += np.array([0.0, 0.0, 0.15], np.float32)
    up[:, PLACES["pressing"]] = 1.0
    np.testing.assert_array_equal(both.act(up), place.act(up))
    assert both.places.tolist() == [True]
    both.act(seen)  # it lies on the ground again
    assert both.places.tolist() == [False]
    with pytest.raises(InputError, match="lift has 31 inputs, not 42"):
        DecomposedPolicy(network((31, 8)), place)


def test_a_policy_on_a_robot_elsewhere_does_what_it_does_in_its_environment() -> None:
    env, policy = make_manipulation("place"), network(seed=3)
    seen, _ = env.reset(seed=1)
    controller = ArmController(policy.act, env.options)
    stand = np.array([0.0, 0.0, env.copies.scene.stand])
    controller.reset(np.append(env.readings.targets[0], env.readings.targets[0, 7]))
    for _ in range(30):
        r, state = env.readings, env.copies.state[0]
        positions, rates = state[1 : 1 + env.copies.scene.model.nq], state[1 + env.copies.scene.model.nq :]
        joints, speeds = positions[env.copies.scene.joints], rates[env.copies.scene.joint_rates]
        moment = ArmState(
            joints, speeds, r.thing[0] - stand, r.thing_rotation[0], r.half[0], r.goal[0] - stand, r.pressure[0] > 0.5
        )
        np.testing.assert_allclose(controller.observation(moment)[0], seen, atol=1e-6)
        targets = controller.targets(moment)
        seen = env.step(policy.act(seen))[0]
        np.testing.assert_allclose(targets, [*env.readings.targets[0], env.readings.targets[0, 7]], atol=1e-5)


def test_what_networks_are_told_is_of_the_order_of_one() -> None:
    for observation in ("full", "paper"):
        batch = make_manipulation_vec("pick_place", num_envs=64, observation=observation)
        seen, _ = batch.reset(seed=0)
        mean, deviation = input_scaling(observation)
        assert np.abs((seen - mean) / deviation).max() < 6.0


def train(out: Path, *words: str) -> subprocess.CompletedProcess[str]:
    small = ("--task", "reach", "--envs", "8", "--save-every", "1", "--seed", "3", "--out", str(out))
    return subprocess.run(
        [sys.executable, str(SCRIPT), *small, *words], capture_output=True, text=True, timeout=300, check=False
    )


@pytest.mark.slow
def test_training_goes_on_where_it_was_killed_to_the_same_weights(tmp_path: Path) -> None:
    pytest.importorskip("rsl_rl", reason='needs pip install "virtual-community[rsl]"')
    whole = train(tmp_path / "whole", "--iterations", "3")
    assert whole.returncode == 0, whole.stderr
    assert train(tmp_path / "parts", "--iterations", "1").returncode == 0
    assert train(tmp_path / "parts", "--iterations", "3").returncode == 0
    digests = [sha256_of(tmp_path / name / "policy.npz") for name in ("whole", "parts")]
    assert digests[0] == digests[1] == read_json(tmp_path / "parts" / "policy.json")["sha256"]
    assert digests[0] in whole.stdout
    read_policy(tmp_path / "parts" / "policy.npz", inputs=42, outputs=8)
    with (tmp_path / "parts" / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["iteration"] for row in rows] == ["1", "2", "3"]
    other = train(tmp_path / "parts", "--reward", "paper", "--iterations", "4")
    assert other.returncode == 2
    assert "holds another training" in other.stderr


@pytest.mark.parametrize(
    "folder", [KEPT / "lift", KEPT / "place", KEPT.parent / "pickplace"], ids=lambda path: path.name
)
def test_a_kept_policy_is_what_its_record_says(folder: Path) -> None:
    about = read_json(folder / "policy.json")
    assert about["sha256"] == sha256_of(folder / "policy.npz")
    read_policy(folder / "policy.npz", inputs=42, outputs=8)
    with (folder / "curve.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["iteration"]) for row in rows] == list(range(1, about["iterations"] + 1))


@pytest.mark.parametrize("task", ["lift", "place"])
def test_a_kept_policy_solves_its_task(task: str) -> None:
    batch = make_manipulation_vec(task, num_envs=12)
    policy = read_policy(KEPT / task / "policy.npz", inputs=42, outputs=8)
    assert score(batch, policy.act).success_at_end >= 0.9


def test_the_kept_policies_pick_and_place_together() -> None:
    lift, place = (read_policy(KEPT / task / "policy.npz", inputs=42, outputs=8) for task in ("lift", "place"))
    batch = make_manipulation_vec("pick_place", num_envs=12)
    assert score(batch, DecomposedPolicy(lift, place).act).success_at_end >= 0.9
