"""`vico motion`: files in, files out, pictures of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from assets.motions import rigs
from command_line import vico
from vico.assets.motions import read_amass, read_motion
from vico.sim.recording import read_run


@pytest.fixture
def dance(tmp_path: Path) -> Path:
    turns = rigs.random_turns(rigs.MIXAMO, 5, seed=3)
    path = tmp_path / "dance.bvh"
    path.write_text(rigs.bvh(rigs.MIXAMO, turns, np.tile([0.0, 0.95, 0.0], (5, 1))))
    return path


def test_a_file_becomes_ours_and_smplx_and_a_picture(
    dance: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ours, theirs, sheet = tmp_path / "a.motion", tmp_path / "a.npz", tmp_path / "a.png"
    assert vico("motion", "import", dance, "--out", ours, "--sheet", sheet) == 0
    assert vico("motion", "import", ours, "--out", theirs, "--json") == 0
    assert '"frames": 5' in capsys.readouterr().out
    np.testing.assert_allclose(read_amass(theirs).pose, read_motion(ours).pose, atol=1e-5)
    with Image.open(sheet) as picture:
        pixels = np.asarray(picture)
    # Eight people stand on a grey floor under the sky: dark clothes in every eighth of the picture.
    dark = (pixels.astype(int).sum(axis=2) < 200).any(axis=0)
    assert all(part.any() for part in np.array_split(dark, 8))


def test_nothing_is_replaced_unasked_and_no_other_kind_is_written(dance: Path, tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(b"mine")
    assert vico("motion", "import", dance, "--out", tmp_path / "a.npz") == 2
    assert (tmp_path / "a.npz").read_bytes() == b"mine"
    assert vico("motion", "import", dance, "--out", tmp_path / "a.fbx") == 2
    assert vico("motion", "import", tmp_path / "none.bvh", "--out", tmp_path / "b.npz") == 2


def test_a_recorded_person_goes_out_as_smplx(helsinki_run: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    run_path, _ = helsinki_run
    out = tmp_path / "resident.npz"
    assert vico("motion", "of-run", run_path, "--agent", "resident_0", "--out", out) == 0
    clip, run = read_amass(out), read_run(run_path)
    assert (len(clip), clip.rate) == (run.last + 1, 1.0)
    entity = next(agent["entity"] for agent in run.agents if agent["name"] == "resident_0")
    rows = run.columns("bodies")
    mine = rows["entity"] == entity
    moved = np.hypot(np.diff(rows["x"][mine]), np.diff(rows["y"][mine]))
    walked = np.linalg.norm(np.diff(clip.position[:, :2], axis=0), axis=1)
    # The pelvis goes where the body goes, but for its sway; lengths are of a body whose hips are 0.92 m high.
    np.testing.assert_allclose(walked, moved, atol=0.15)
    assert vico("motion", "of-run", run_path, "--agent", "robot_0", "--out", tmp_path / "b.npz") == 2
