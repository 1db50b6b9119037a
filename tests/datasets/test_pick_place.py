"""Datasets of pick and place: what a frame holds, the paper's filters, stopped builds, bad requests."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from command_line import vico
from shared_folders import Shared
from vico.agents.robot.increments import INCREMENTS, STATE
from vico.datasets.build import BuildRequest, Contents, tasks_of
from vico.datasets.folder import Dataset
from vico.datasets.inspection import findings_of
from vico.errors import InputError

ARGUMENTS = (
    "dataset", "build", "--challenge", "pick_place", "--episodes", 2, "--first-seed", 7, "--size", 64, "--steps", 60,
    "--successes", "--test", 0, "--to", "lerobot", "--workers", 1,
)  # fmt: skip


@pytest.fixture(scope="session")
def plain(shared: Shared) -> Dataset:
    """Two episodes as they were."""

    def make(out: Path) -> None:
        assert vico(*ARGUMENTS, "--out", out / "demos") == 0

    return Dataset(shared("pick_place_plain", make) / "demos")


@pytest.fixture(scope="session")
def filtered(shared: Shared) -> Dataset:
    """The same with the paper's filters."""

    def make(out: Path) -> None:
        assert vico(*ARGUMENTS, "--drop-below", 0.01, "--clip", 0.01, "--out", out / "demos") == 0

    return Dataset(shared("pick_place_filtered", make) / "demos")


def column(dataset: Dataset, name: str) -> np.ndarray:
    table = pq.read_table(dataset.path / "data" / "chunk-000" / "file-000.parquet")
    return np.array(table[name].to_pylist())


def test_a_frame_holds_picture_joints_increments_and_the_instruction(plain: Dataset) -> None:
    assert findings_of(plain) == []
    assert (plain.about.fps, plain.about.body) == (20, "manipulator")
    assert plain.about.features == {"observation.state": list(STATE), "action": list(INCREMENTS)}
    assert (plain.about.episodes, plain.about.successes) == (2, 2)
    first = plain.episodes()[0]
    assert first["instructions"] == ["Pick up the blue shoe box and put it down next to the pink thermos flask."]
    assert (first["challenge"], first["category"], first["method"]) == ("pick_place", "ground to ground", "arm_worker")
    frames = list(plain.frames(0))
    assert len(frames) == first["frames"]
    assert frames[0]["pictures"]["rgb"].shape == (64, 64, 3)
    state = np.array([frame["observation.state"] for frame in frames])
    action = np.array([frame["action"] for frame in frames])
    # Servos are followed: what a joint is told, it does soon after; fingers close to a grip.
    assert np.abs(state[2:, :7] - (state[:-2, :7] + action[:-2, :7])).max() < 0.06
    assert state[:, 7].max() > 0.05
    assert plain.form.decode(frames[0]["action"], (0, 0, 0, 0))["type"] == "increments"


def test_the_papers_filters(plain: Dataset, filtered: Dataset) -> None:
    assert findings_of(filtered) == []
    before, after = column(plain, "action"), column(filtered, "action")
    large = np.abs(before).max(axis=1) >= 0.01
    assert 0.4 < large.mean() < 1.0
    kept = before[large]
    low, high = np.quantile(kept.astype(np.float32), [0.01, 0.99], axis=0)
    assert after == pytest.approx(np.clip(kept, low, high), abs=1e-6)
    assert column(filtered, "observation.state") == pytest.approx(column(plain, "observation.state")[large])
    setting = filtered.about.made["setting"]
    assert setting == {"seconds": 60, "drop_below": 0.01, "clip": 0.01}
    card = (filtered.path / "README.md").read_text()
    assert "smaller than 0.01 in all of its numbers are left out" in card
    assert "cut to their quantiles 0.01 and 0.99" in card
    assert "An action holds increments of its joints" in card
    stats = json.loads((filtered.path / "meta" / "stats.json").read_text())["action"]
    assert np.array(stats["max"]) == pytest.approx(after.max(axis=0))


def test_a_part_is_decided_by_all_that_it_is_made_of() -> None:
    def keys(seconds: int = 60, drop: float = 0.0, first: int = 0) -> list[str]:
        contents = Contents("lerobot", drop_below=drop)
        request = BuildRequest(contents, category="pick_place", episodes=2, seconds=seconds, first_seed=first)
        return [task["key"] for task in tasks_of(request)]

    assert keys() == keys()
    assert len({*keys(), *keys(seconds=61), *keys(drop=0.01), *keys(first=2)}) == 8


@pytest.mark.parametrize(
    ("category", "drop", "clip", "says"),
    [
        ("pick_place", -1.0, 0.0, "increments below -1.0 dropped"),
        ("pick_place", float("nan"), 0.0, "increments below nan dropped"),
        ("pick_place", 0.0, 0.5, "a share of 0.5 cut"),
        ("delivery", 0.01, 0.0, "only actions of pick_place are increments"),
    ],
)
def test_bad_filters_are_refused(category: str, drop: float, clip: float, says: str) -> None:
    contents = Contents("lerobot", drop_below=drop)
    with pytest.raises(InputError, match=says):
        tasks_of(BuildRequest(contents, category=category, episodes=1, clip=clip))
