"""Action-chunk policies: what they are taught, how they act, what is refused."""

from __future__ import annotations

import csv
import importlib.util
import io
import json
import pickle
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from felt_arm import sensors
from vico.agents.robot.chunk_policy import (
    ChunkActor,
    ChunkPolicy,
    downscale_picture,
    new_network,
    relative_chunk,
    word_ids,
)
from vico.agents.robot.increments import ChunkShape, arm_state
from vico.challenges.pick_place.episode import play
from vico.challenges.pick_place.tasks import draw_task
from vico.errors import InputError, MissingExtraError, MissingFileError, SchemaError
from vico.io.files import read_json, sha256_of
from vico.io.plain_data import decode, encode

HAS_TORCH = importlib.util.find_spec("torch") is not None
needs_torch = pytest.mark.skipif(not HAS_TORCH, reason="needs pip install 'virtual-community[imitation]'")
# Of torch, which the project's own warnings-are-errors is not about.
pytestmark = pytest.mark.filterwarnings("ignore")
SMALL = ChunkShape(side=32, chunk=4, words=8, vocabulary=16, width=32, heads=2, encoders=1, decoders=1)
ARM = slice(0, 9)
KEPT = Path(__file__).parents[3] / "benchmarks" / "policies" / "chunk_small"


class Counting:
    """Stands in for a network: its n-th chunk wants each joint k steps on at 0.1 n + 0.01 k from where it is."""

    shape = SMALL

    def __init__(self) -> None:
        self.asked = 0

    def chunk(self, picture: Any, state: Any, instruction: str) -> NDArray[np.float32]:
        self.asked += 1
        found = np.zeros((4, 11), np.float32)
        found[:, ARM] = 0.1 * self.asked + 0.01 * np.arange(4)[:, None]
        return found


def observation(shift: float = 0.0) -> dict[str, Any]:
    felt = sensors()
    felt["joint_position"] = felt["joint_position"] + shift
    return {"rgb": np.zeros((32, 32, 3), np.uint8), "sensors": felt}


def saved(path: Path, shape: ChunkShape = SMALL) -> Path:
    _, network = new_network(shape)
    scales = {"state_mean": np.zeros(20), "state_std": np.ones(20)}
    scales |= {"action_mean": np.zeros((shape.chunk, 11)), "action_std": np.full((shape.chunk, 11), 0.01)}
    np.savez(path, **ChunkPolicy(shape, scales, network).arrays())
    return path


def test_a_chunk_counts_from_where_its_first_frame_is() -> None:
    chance = np.random.default_rng(0)
    states, actions = chance.normal(size=(5, 20)).astype("f4"), chance.normal(size=(5, 11)).astype("f4")
    chunk = relative_chunk(states, actions)
    assert chunk[0] == pytest.approx(actions[0])
    assert chunk[3, ARM] + states[0, ARM] == pytest.approx(actions[3, ARM] + states[3, ARM], abs=1e-6)
    assert chunk[:, 9:] == pytest.approx(actions[:, 9:])


def test_words_have_the_same_number_in_every_process() -> None:
    numbers = word_ids("Pick up the red toolbox, and put it on the table.", ChunkShape())
    assert numbers[:4].tolist() == [412, 113, 487, 400]  # 1 + zlib.crc32 of pick, up, the, red, modulo 512
    assert (numbers > 0).sum() == 11
    assert len(word_ids("a " * 100, SMALL)) == SMALL.words


def test_pictures_get_smaller_and_never_larger() -> None:
    picture = np.zeros((64, 64, 3), np.uint8)
    picture[::2] = 200
    assert downscale_picture(picture, 32).shape == (32, 32, 3)
    assert np.unique(downscale_picture(picture, 32)).tolist() == [100]
    for bad, side in ((picture, 128), (picture[:32], 32)):
        with pytest.raises(InputError, match="give a square one"):
            downscale_picture(bad, side)


def test_a_chunk_is_followed_wherever_the_joints_are_meanwhile() -> None:
    policy = Counting()
    actor = ChunkActor(policy, every=3)  # type: ignore[arg-type]
    start = arm_state(observation())[ARM]
    told = [actor.act(observation(0.5 * k), "")["vector"][:9] for k in range(4)]
    assert policy.asked == 2
    for k in range(3):
        assert told[k] == pytest.approx(start + 0.1 + 0.01 * k, abs=1e-5)
    assert told[3] == pytest.approx(start + 1.5 + 0.2, abs=1e-5)


def test_temporal_ensembling_weighs_the_oldest_most() -> None:
    actor = ChunkActor(Counting(), ensemble=1.0)  # type: ignore[arg-type]
    start = arm_state(observation())[ARM]
    actor.act(observation(), "")
    again = ChunkActor(Counting(), ensemble=1.0)  # type: ignore[arg-type]
    again.restore(decode(encode(actor.state())))
    w = np.exp(-1.0)
    # The first chunk says 0.11 of the second action, the second 0.2.
    assert actor.act(observation(), "")["vector"][:9] == pytest.approx(start + (0.11 + w * 0.2) / (1 + w), abs=1e-5)
    assert again.act(observation(), "")["vector"][:9] == pytest.approx(start + (0.11 + w * 0.1) / (1 + w), abs=1e-5)


@pytest.mark.parametrize("options", [{"every": 0}, {"every": 5}, {"ensemble": -1.0}, {"ensemble": float("nan")}])
def test_bad_options_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="chunk policy"):
        ChunkActor(Counting(), **options)  # type: ignore[arg-type]


@needs_torch
def test_a_policy_of_its_full_size_has_six_million_weights() -> None:
    _, network = new_network(ChunkShape())
    assert sum(weight.numel() for weight in network.parameters()) == pytest.approx(6.25e6, rel=0.01)


@needs_torch
def test_a_saved_policy_acts_in_the_simulation_as_before(tmp_path: Path) -> None:
    path = saved(tmp_path / "policy.npz")
    task = draw_task(3, seconds=1)
    played = [
        play(task, None, ChunkActor(ChunkPolicy.read(path), every=2), side=64, outputs=("rgb",)) for _ in range(2)
    ]
    assert played[0].actions.shape == (20, 11)
    assert np.abs(played[0].actions).max() > 0.0
    assert np.array_equal(played[0].actions, played[1].actions)
    assert (played[0].success, played[0].cause) == (False, "out of time")


@needs_torch
def test_what_a_policy_does_depends_on_picture_state_and_words(tmp_path: Path) -> None:
    policy = ChunkPolicy.read(saved(tmp_path / "policy.npz"))
    state, picture = arm_state(observation()), np.full((32, 32, 3), 90, np.uint8)
    plain = policy.chunk(picture, state, "Pick up the red toolbox")
    assert not np.allclose(plain, policy.chunk(255 - picture, state, "Pick up the red toolbox"), atol=1e-7)
    assert not np.allclose(plain, policy.chunk(picture, -state, "Pick up the red toolbox"), atol=1e-7)
    assert not np.allclose(plain, policy.chunk(picture, state, "Pick up the blue umbrella"), atol=1e-7)


def test_pickles_and_what_is_no_policy_are_refused_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "policy.npz"
    with pytest.raises(MissingFileError, match="no such file"):
        ChunkPolicy.read(path)
    path.write_bytes(pickle.dumps({"weight": 1}))
    with pytest.raises(SchemaError, match="pickled weights, which could run code, are never read"):
        ChunkPolicy.read(path)
    np.savez(path, hidden=np.array([{"a": 1}], object), allow_pickle=True)
    with pytest.raises(SchemaError, match="are never read"):
        ChunkPolicy.read(path)
    np.savez(path, other=np.zeros(3))
    with pytest.raises(SchemaError, match="says no sizes of a policy"):
        ChunkPolicy.read(path)


def test_policies_for_other_robots_are_refused(tmp_path: Path) -> None:
    sizes = {"schema_name": "vico.chunk_policy", "version": 1, **asdict(ChunkShape(state=14, action=7))}
    np.savez(tmp_path / "other.npz", shape=np.frombuffer(json.dumps(sizes).encode(), np.uint8))
    with pytest.raises(SchemaError, match="for 14 numbers of state and 7 of action"):
        ChunkPolicy.read(tmp_path / "other.npz")


@needs_torch
def test_weights_of_the_wrong_shape_are_refused(tmp_path: Path) -> None:
    with np.load(saved(tmp_path / "policy.npz")) as archive:
        arrays = dict(archive)
    for change, says in (
        ({"weight/queries": np.zeros((5, 32))}, r"weight queries is of shape \(5, 32\)"),
        ({"weight/queries": np.full((4, 32), np.nan)}, "weight queries"),
        ({"weight/more": np.zeros(1)}, "no weight is called more"),
        ({"action_std": np.zeros(3)}, "action_std is not"),
    ):
        sink = io.BytesIO()
        np.savez(sink, **(arrays | change))
        (tmp_path / "wrong.npz").write_bytes(sink.getvalue())
        with pytest.raises(SchemaError, match=says):
            ChunkPolicy.read(tmp_path / "wrong.npz")


@pytest.mark.skipif(HAS_TORCH, reason="torch is installed")
def test_without_torch_it_is_said_what_to_type() -> None:
    with pytest.raises(MissingExtraError, match=r"pip install 'virtual-community\[imitation\]'"):
        new_network(SMALL)


def test_the_kept_policy_is_what_its_record_says() -> None:
    about = read_json(KEPT / "policy.json")
    assert about["sha256"] == sha256_of(KEPT / "policy.npz")
    assert about["dataset"] == sha256_of(KEPT / "dataset.json")
    with (KEPT / "curve.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert int(rows[-1]["step"]) == about["steps"]
    assert float(rows[-1]["validation_loss"]) == about["validation_loss"]


@needs_torch
def test_the_kept_policy_acts() -> None:
    policy = ChunkPolicy.read(KEPT / "policy.npz")
    state = arm_state(observation())
    chunk = policy.chunk(np.zeros((96, 96, 3), np.uint8), state, "Pick up the red toolbox and put it on the table.")
    assert chunk.shape == (20, 11)
    assert np.isfinite(chunk).all()
