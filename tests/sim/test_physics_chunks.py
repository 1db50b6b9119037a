"""Physics in a city holds what is around robots: what they do is the same whatever else it holds."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.robots import robot_model
from vico.sim.physics import make_scene, mujoco_scene
from vico.sim.physics.mujoco_engine import MujocoEngine
from vico.sim.physics.mujoco_physics import MujocoScene
from vico.sim.physics.records import Chunk, Party, RigidObject, StaticScene
from vico.world.heights import HeightField

HALF, SIDE = 160.0, 40.0
HUSKY, GO2 = robot_model("husky", packs=False), robot_model("go2", packs=False)
FAR_APART = np.array([[-101.0, -100.0, 0.0], [90.0, 100.0, 1.0]])


class Hills:
    """Rolling ground with walls on it, in chunks of 40 m."""

    side = SIDE

    def __init__(self) -> None:
        axis = np.linspace(-HALF, HALF, 161)
        x, y = np.meshgrid(axis, axis)
        self.height = HeightField((0.8 * np.sin(x / 9.0) * np.cos(y / 11.0)).astype(np.float32), HALF)
        stream = np.random.default_rng(2)
        at, yaw = stream.uniform(-HALF, HALF, (400, 2)), stream.uniform(0.0, 3.0, 400)
        half = np.tile([4.0, 0.2, 1.0], (400, 1))
        self._walls = np.column_stack([at, self.height(at), yaw, half])
        self.asked = list[int]()

    def scene(self, chunks: Collection[Chunk]) -> StaticScene:
        """Return what is in some chunks."""
        self.asked.append(len(chunks))
        squares = np.array(list(chunks), np.float64).reshape(-1, 2) * SIDE - HALF
        away = np.abs(self._walls[:, None, :2] - squares - SIDE / 2).max(axis=2, initial=0.0) < SIDE / 2 + 4.1
        return StaticScene(self.height, boxes=self._walls[away.any(axis=1)], squares=squares, side=SIDE)

    def whole(self) -> StaticScene:
        """Return all of it."""
        return StaticScene(self.height, boxes=self._walls)


def _scene(hills: Hills) -> MujocoScene:
    scene = make_scene("mujoco", hills, (HUSKY, GO2))
    assert isinstance(scene, MujocoScene)
    return scene


def _hold(monkeypatch: pytest.MonkeyPatch, needed: float, ahead: float) -> None:
    monkeypatch.setattr(mujoco_scene, "_NEEDED", needed)
    monkeypatch.setattr(mujoco_scene, "_AHEAD", ahead)


def _drive(engine: MujocoEngine, seconds: int, *, first: int = 0) -> NDArray[np.float64]:
    """Drive the first robot fast through the hills, drop something beside it for a while; return all states."""
    states = list[NDArray[np.float64]]()
    for k in range(first, first + seconds):
        engine.command(0, np.array([14.0, 14.0 - k % 3, 14.0, 14.0 - k % 3]))
        if k == 4:
            place = engine.base(0).position + np.array([0.0, 1.2, 1.0])
            engine.place_object(0, RigidObject(np.full(3, 0.3), 2.0, place, np.array([1.0, 0.0, 0.0, 0.0])))
        if k == 9:
            engine.remove_object(0)
        engine.step(100)
        states += [np.ravel(values).astype(np.float64) for values in engine.arrays().values()]
    return np.concatenate(states)


@pytest.mark.parametrize(("needed", "ahead"), [(6.0, 6.0), (40.0, 1000.0)])
def test_a_robot_moves_alike_with_little_and_with_all_of_a_city(
    monkeypatch: pytest.MonkeyPatch, needed: float, ahead: float
) -> None:
    usual, other = Hills(), Hills()
    states = _drive(_scene(usual).engine(FAR_APART), 40)
    _hold(monkeypatch, needed, ahead)
    engine = _scene(other).engine(FAR_APART)
    other_states = _drive(engine, 40)
    assert engine.base(0).position[0] > FAR_APART[0, 0] + 10.0
    assert np.array_equal(states, other_states)
    everything = round(2 * HALF / SIDE) ** 2
    assert max(other.asked) == everything if ahead > HALF else len(other.asked) > len(usual.asked)
    assert max(usual.asked) < everything


def test_a_saved_state_goes_on_alike_with_other_parts_of_a_city(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = _scene(Hills()).engine(FAR_APART)
    _drive(engine, 7)
    saved = engine.arrays()
    assert saved["present"].any()
    after = _drive(engine, 5, first=7)
    _hold(monkeypatch, 6.0, 6.0)
    again = _scene(Hills()).engine(FAR_APART[::-1])
    again.restore(saved)
    assert np.array_equal(_drive(again, 5, first=7), after)


def test_what_is_let_go_far_from_robots_falls_to_the_ground() -> None:
    hills = Hills()
    engine = _scene(hills).engine(FAR_APART)
    spot = np.array([120.0, -130.0])
    ground = float(hills.height(spot))
    above = engine.clearance_below(np.array([[*spot, ground + 3.0], [*spot, ground - 9.0]]))
    assert above[0] == pytest.approx(3.0, abs=0.05)
    engine.place_object(1, RigidObject(np.full(3, 0.3), 2.0, np.array([*spot, ground + 2.0]), np.eye(4)[0]))
    engine.step(300)
    x, y, z = engine.objects().position[1]
    assert z - float(hills.height([x, y])) == pytest.approx(0.15, abs=0.08)
    touched = engine.contacts()
    rows = (touched.party == Party.OBJECT).any(axis=1)
    assert rows.any()
    assert (touched.party[rows].min(axis=1) == Party.SCENE).all()


def test_copies_of_a_city_move_as_one_does() -> None:
    hills = Hills()
    batch = _scene(hills).batch(3, FAR_APART, threads=2)
    alone = _scene(hills).engine(FAR_APART)
    speed = np.full(4, 12.0)
    batch.command(0, np.tile(speed, (3, 1)))
    alone.command(0, speed)
    for _ in range(12):
        batch.step(100)
        alone.step(100)
    poses, _ = batch.bases(0)
    assert np.array_equal(poses, np.tile(poses[:1], (3, 1)))
    assert np.array_equal(poses[0, :3], alone.base(0).position)
