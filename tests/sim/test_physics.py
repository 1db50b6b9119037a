"""The physics engine: walls stand where they are, kinematic bodies push, and snapshots are exact."""

from pathlib import Path

import numpy as np
import pytest

from vico.assets.robots import robot_model
from vico.assets.shapes import box
from vico.errors import SchemaError
from vico.sim.bodies import CAR, RESIDENT, Bodies
from vico.sim.physics import MujocoEngine, StaticScene
from vico.sim.physics.mujoco_engine import PhysicsError
from vico.sim.physics.surroundings import convex_parts
from vico.world.heights import HeightField
from vico.world.mesh import joined

FLAT = HeightField.flat(50.0)


def body(kind: int, x: float, y: float, *, velocity: tuple[float, float] = (0.0, 0.0)) -> Bodies:
    half = (2.0, 0.9) if kind == CAR else (0.25, 0.25)
    return Bodies(
        np.array([7], np.int32),
        np.array([kind], np.int8),
        np.array([[x, y, 0.0]]),
        np.zeros(1),
        np.array([half[0]]),
        np.array([half[1]]),
        np.array([1.6]),
        np.array([velocity]),
    )


def husky(scene: StaticScene, x: float = 0.0, yaw: float = 0.0) -> MujocoEngine:
    return MujocoEngine(scene, [robot_model("husky", packs=False)], np.array([[x, 0.0, yaw]]))


def roll(engine: MujocoEngine, seconds: float, speed: float = 4.0, bodies: Bodies | None = None) -> None:
    engine.command(0, np.full(4, speed))
    for _ in range(round(seconds / 0.1)):
        engine.set_dynamic_obstacles(bodies if bodies is not None else Bodies.none(), 0.1)
        for _ in range(10):
            engine.step()


@pytest.mark.parametrize("solid", ["hull", "box", "pillar"])
def test_solids_of_every_kind_stop_a_robot_at_their_face(solid: str) -> None:
    corners = np.array([[x, y, z] for x in (5.0, 8.0) for y in (-3.0, 3.0) for z in (-1.0, 6.0)])
    scene = {
        "hull": StaticScene(FLAT, hulls=(corners,)),
        "box": StaticScene(FLAT, boxes=np.array([[6.5, 0.0, 1.0, 0.0, 1.5, 3.0, 1.0]])),
        "pillar": StaticScene(FLAT, pillars=np.array([[5.4, 0.0, 1.0, 0.4, 1.0]])),
    }[solid]
    engine = husky(scene)
    roll(engine, 12.0)
    # The front bumper is 0.495 m ahead of the base.
    assert engine.base(0).position[0] + 0.495 == pytest.approx(5.0, abs=0.02)


def test_a_robot_rests_on_the_ground_of_a_hill() -> None:
    axis = np.linspace(-50.0, 50.0, 51)
    hill = HeightField((0.08 * axis[None, :] + 0.05 * axis[:, None]).astype(np.float32), 50.0)
    engine = husky(StaticScene(hill), x=10.0)
    roll(engine, 2.0, speed=0.0)
    base = engine.base(0)
    assert base.position[2] == pytest.approx(float(hill(base.position)) + 0.132, abs=0.02)
    slope = np.array([-0.08, -0.05, 1.0]) / np.linalg.norm([-0.08, -0.05, 1.0])
    assert base.rotation[:, 2] @ slope > 0.9995


def test_a_moving_body_pushes_a_robot_and_a_parked_one_does_not() -> None:
    engine = husky(StaticScene(FLAT))
    roll(engine, 1.0, speed=0.0)
    assert abs(engine.base(0).position[0]) < 0.01
    for k in range(20):
        engine.set_dynamic_obstacles(body(CAR, -4.0 + 0.1 * (k + 1), 0.0, velocity=(1.0, 0.0)), 0.1)
        for _ in range(10):
            engine.step()
    # The car's nose has come to x = 0; the robot's tail was at -0.495.
    assert engine.base(0).position[0] == pytest.approx(0.495 + 0.03, abs=0.03)


def test_a_person_in_the_way_of_raw_wheels_is_not_run_into() -> None:
    engine = husky(StaticScene(FLAT))
    roll(engine, 10.0, speed=6.0, bodies=body(RESIDENT, 4.0, 0.0))
    gap = 4.0 - 0.25 - (engine.base(0).position[0] + 0.495)
    assert 0.0 <= gap < 0.06


def test_a_restored_engine_goes_on_bit_for_bit() -> None:
    models = [robot_model("husky", packs=False), robot_model("go2", packs=False)]
    places = np.array([[0.0, 0.0, 0.3], [0.0, 3.0, 1.0]])
    engines = [
        MujocoEngine(StaticScene(FLAT, pillars=np.array([[3.0, 1.0, 1.0, 0.3, 1.0]])), models, places) for _ in "ab"
    ]
    roll(engines[0], 1.5, bodies=body(RESIDENT, 2.0, 0.4, velocity=(0.1, 0.0)))
    saved = {name: array.copy() for name, array in engines[0].arrays().items()}
    engines[1].restore(saved)
    for engine in engines:
        roll(engine, 3.0, bodies=body(CAR, 6.0, 2.0, velocity=(-0.2, 0.0)))
    for name, array in engines[0].arrays().items():
        assert np.array_equal(array, engines[1].arrays()[name]), name


def test_a_state_of_other_robots_is_refused() -> None:
    one = husky(StaticScene(FLAT))
    other = MujocoEngine(StaticScene(FLAT), [robot_model("go2", packs=False)], np.zeros((1, 3)))
    with pytest.raises(SchemaError, match="belongs to other robots"):
        other.restore(one.arrays())


def test_walls_stand_where_they_are_after_a_restore_too() -> None:
    wall = StaticScene(FLAT, boxes=np.array([[6.5, 0.0, 1.0, 0.0, 1.5, 3.0, 1.0]]))
    first, second = husky(wall), husky(wall)
    roll(first, 1.0)
    second.restore(first.arrays())
    roll(second, 12.0)
    assert second.base(0).position[0] + 0.495 == pytest.approx(5.0, abs=0.02)


@pytest.mark.parametrize(("top", "least", "most"), [(0.05, 3.0, 9.0), (0.13, 1.5, 2.6), (0.2, 1.4, 1.6)])
def test_wheels_climb_a_kerb_and_are_stopped_by_what_is_higher(top: float, least: float, most: float) -> None:
    engine = husky(StaticScene(FLAT, boxes=np.array([[7.0, 0.0, top / 2 - 0.5, 0.0, 5.0, 3.0, top / 2 + 0.5]])))
    roll(engine, 6.0)
    assert least < engine.base(0).position[0] < most


def test_a_motion_that_diverges_is_an_error_and_leaves_no_log_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    engine = husky(StaticScene(FLAT))
    engine._data.qvel[0] = np.nan
    with pytest.raises(PhysicsError, match=r"diverged at .* s .Nan, Inf or huge value in QVEL"):
        engine.step()
    assert list(tmp_path.iterdir()) == []


def test_many_frames_at_once_are_those_frames_one_by_one() -> None:
    engines = [husky(StaticScene(FLAT)) for _ in "ab"]
    for engine in engines:
        engine.command(0, np.full(4, 3.0))
    engines[0].step(50)
    for _ in range(50):
        engines[1].step()
    assert np.array_equal(engines[0].arrays()["state"], engines[1].arrays()["state"])


def test_pieces_of_a_collision_surface_are_told_apart() -> None:
    surface = joined([box((1, 1, 1), (x, 0, 0)).of_entity(x) for x in (0, 1, 5)])[0]
    parts = convex_parts(surface)
    # The first two touch but belong to different entities.
    assert sorted(float(part[:, 0].mean()) for part in parts) == [0.0, 1.0, 5.0]
    assert all(len(part) == 8 for part in parts)
