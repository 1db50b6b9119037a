"""What is MuJoCo's own, and what is told to any engine: pieces of surfaces, frames, names of engines."""

from pathlib import Path

import numpy as np
import pytest

from vico.assets.robots import robot_model
from vico.assets.shapes import box
from vico.errors import InputError
from vico.sim.physics import StaticScene, factory, make_engine, make_scene
from vico.sim.physics.frames import COARSE, FINE, FrameCount, FrameNeeds, frame_length
from vico.sim.physics.mujoco_engine import MujocoEngine
from vico.sim.physics.records import PhysicsError
from vico.sim.physics.surroundings import convex_parts
from vico.world.heights import HeightField
from vico.world.mesh import joined


def test_a_motion_that_diverges_is_an_error_and_leaves_no_log_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = StaticScene(HeightField.flat(50.0))
    engine = make_engine("mujoco", scene, [robot_model("husky", packs=False)], np.zeros((1, 3)))
    assert isinstance(engine, MujocoEngine)
    engine.coordinates[1][0] = np.nan
    with pytest.raises(PhysicsError, match=r"diverged at .* s .Nan, Inf or huge value in Q"):
        engine.step()
    assert list(tmp_path.iterdir()) == []


def test_pieces_of_a_collision_surface_are_told_apart() -> None:
    surface = joined([box((1, 1, 1), (x, 0, 0)).of_entity(x) for x in (0, 1, 5)])[0]
    parts = convex_parts(surface)
    # The first two touch but belong to different entities.
    assert sorted(float(part[:, 0].mean()) for part in parts) == [0.0, 1.0, 5.0]
    assert all(len(part) == 8 for part in parts)


def test_an_engine_nobody_knows_and_one_that_is_not_installed_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = StaticScene(HeightField.flat(50.0))
    with pytest.raises(InputError, match="no engine 'bullet'; choose among mujoco"):
        make_scene("bullet", scene, [])
    monkeypatch.setitem(factory._ENGINES, "warp", ("no_such_package", "pip install vico[warp]", "x", "y"))
    with pytest.raises(InputError, match=r"needs the package no_such_package.*: pip install vico\[warp\]"):
        make_scene("warp", scene, [])


@pytest.mark.parametrize("what", ["motor_commands", "fallen", "manipulation", "loose_objects"])
def test_frames_are_fine_where_forces_matter(what: str) -> None:
    assert frame_length(FrameNeeds(), 0.1) == COARSE
    assert frame_length(FrameNeeds(**{what: True}), 0.1) == FINE


def test_frames_are_fine_where_a_coarse_one_does_not_fit() -> None:
    assert [frame_length(FrameNeeds(), ticks * 0.01) for ticks in (1, 2, 3, 10)] == [FINE, COARSE, FINE, COARSE]


def test_frames_are_counted_by_length() -> None:
    count = FrameCount()
    count.add(FINE, 3)
    count.add(COARSE)
    record = count.record()
    assert record["fine"] == {"seconds": 0.01, "frames": 3}
    assert record["coarse"] == {"seconds": 0.02, "frames": 1}
