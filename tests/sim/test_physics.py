"""What is MuJoCo's own, and what is told to any engine: pieces of surfaces, frames, names of engines."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from robot_field import field
from vico.assets.robots import robot_model
from vico.assets.shapes import box
from vico.errors import InputError
from vico.sim.bodies.arrays import Bodies
from vico.sim.physics import StaticScene, engine, make_engine, make_scene
from vico.sim.physics.collision_shapes import SolidCells, find_near
from vico.sim.physics.mujoco_engine import MujocoEngine
from vico.sim.physics.mujoco_physics import MujocoScene
from vico.sim.physics.records import COARSE, FINE, FrameCount, FrameNeeds, PhysicsError, frame_length
from vico.sim.physics.surroundings import convex_parts
from vico.sim.robots import RobotPopulation
from vico.world.heights import HeightField
from vico.world.mesh import merge_surfaces


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


def test_running_out_of_memory_in_a_step_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = StaticScene(HeightField.flat(50.0))
    engine = make_engine("mujoco", scene, [robot_model("husky", packs=False)], np.zeros((1, 3)))

    def give_up(*_: object) -> None:
        raise mujoco.FatalError("mj_stackAlloc: out of memory")

    monkeypatch.setattr(mujoco, "mj_step", give_up)
    with pytest.raises(PhysicsError, match=r"gave up at .* s .mj_stackAlloc"):
        engine.step()


def test_pieces_of_a_collision_surface_are_told_apart() -> None:
    surface = merge_surfaces([box((1, 1, 1), (x, 0, 0)).of_entity(x) for x in (0, 1, 5)])[0]
    parts = convex_parts(surface)
    # The first two touch but belong to different entities.
    assert sorted(float(part[:, 0].mean()) for part in parts) == [0.0, 1.0, 5.0]
    assert all(len(part) == 8 for part in parts)


def test_cells_near_a_solid_of_any_kind_are_marked_and_far_ones_are_not() -> None:
    hull = np.array([[10.0, 10.0], [14.0, 11.0], [11.0, 15.0]])
    corners = np.vstack([np.column_stack([hull, np.full(3, z)]) for z in (0.0, 3.0)])
    boxes = np.array([[-12.0, 3.0, 1.0, 0.5, 3.0, 0.2, 1.0]])
    pillars = np.array([[5.0, -15.0, 1.0, 0.25, 1.0]])
    grid = SolidCells(StaticScene(HeightField.flat(40.0), (corners,), boxes, pillars), np.array([0.8, 0.3]))
    near = np.zeros(2, np.bool_)

    def are_near(xy: np.ndarray, z: float = 0.5) -> np.ndarray:
        """Whether robots of either reach that stand still at points could touch something, shape ``(n, 2)``."""
        found = np.empty((len(xy), 2), np.bool_)
        first = np.array([[0, 0], [3, 3]])
        for k, (x, y) in enumerate(xy.tolist()):
            state = (np.array([x, y, z] * 2), np.zeros(6), first)
            find_near(grid.cells, grid.reaches, 0.01, state, near)
            found[k] = near
        return found

    rng = np.random.default_rng(3)
    along = np.sort(rng.random((200, 2)), axis=1)
    inside = np.vstack(
        [
            hull[0] * along[:, :1] + hull[1] * np.diff(along, axis=1) + hull[2] * (1.0 - along[:, 1:]),
            np.array([-12.0, 3.0]) + rng.uniform(-3.0, 3.0, (200, 1)) * [np.cos(0.5), np.sin(0.5)],
            np.tile([[5.0, -15.0]], (200, 1)),
        ]
    )
    angle = rng.uniform(0.0, 2 * np.pi, len(inside))
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert are_near(inside + 0.8 * around)[:, 0].all()
    assert are_near(inside + 0.3 * around).all()
    points = rng.uniform(-40.0, 40.0, (4000, 2))
    away = np.linalg.norm(points[:, None] - inside[None], axis=2).min(axis=1)
    assert not are_near(points[away > 3.5])[:, 0].any()
    assert not are_near(points[away > 2.5])[:, 1].any()
    # Who flies above the highest solid by more than it reaches can touch none.
    assert not are_near(inside, 4.0).any()
    assert are_near(inside[:200], 3.7)[:, 0].all()


def test_looking_for_solids_only_where_they_are_near_changes_nothing() -> None:
    walls = np.array([[4.0, 0.0, 1.0, 0.2, 0.2, 5.0, 1.0], [-3.0, 4.0, 1.0, 0.0, 0.2, 0.2, 1.0]])
    # What the second robot stumbles over: each of its links asks for itself.
    walls = np.vstack([walls, [0.2, 20.0, 0.02, 0.3, 0.15, 0.5, 0.02]])
    models = (robot_model("husky", packs=False), robot_model("go2", packs=False))
    scene = make_scene("mujoco", StaticScene(HeightField.flat(50.0), boxes=walls), models)
    assert isinstance(scene, MujocoScene)
    places = np.array([[-3.0, 0.0, 0.1], [0.0, 20.0, 0.0]])
    motions = []
    for everywhere in (False, True):
        if everywhere:
            scene.solids.mark_all()
        engine = scene.engine(places)
        engine.command(0, np.full(4, 6.0))
        path = []
        for _ in range(400):
            engine.step(1)
            path.append(np.concatenate([engine.base(0).position, engine.base(1).position]))
        motions.append(np.array(path))
    assert 3.0 < motions[0][-1, 0] < 3.6  # it stands before the wall
    assert np.array_equal(*motions)


def test_an_engine_nobody_knows_and_one_that_is_not_installed_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = StaticScene(HeightField.flat(50.0))
    with pytest.raises(InputError, match="no engine 'bullet'; choose among genesis, mujoco"):
        make_scene("bullet", scene, [])
    monkeypatch.setitem(engine._ENGINES, "warp", ("no_such_package", "pip install vico[warp]", "x", "y"))
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


def test_what_mujoco_says_of_another_model_is_no_warning_of_this_one() -> None:
    robots = RobotPopulation(field(), ["husky"], [[0, 0, 0]], packs=False)
    other = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(other)
    data.qvel[0] = np.nan
    mujoco.mj_step(other, data)
    robots.advance(0.1, Bodies.none())  # warnings are errors here
