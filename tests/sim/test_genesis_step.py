"""What Genesis is asked for a step, in kernels of ours, is what it does by itself."""

from typing import Any

import numpy as np
import pytest

from robot_field import ENGINES
from vico.assets.robots import robot_model
from vico.sim.bodies.arrays import RESIDENT, Bodies
from vico.sim.physics import Capacity, StaticScene, make_scene
from vico.sim.physics.records import RigidObject
from vico.world.heights import HeightField

HILL = HeightField(np.add.outer(np.sin(np.arange(101.0)), np.cos(np.arange(101.0) / 2)).astype(np.float32) * 0.02, 50.0)
#: A wall ahead, a low box that a wheel stands against, and a post on the left; others far away.
CORNERS = np.array([[x, y, z] for x in (1.2, 2.0) for y in (-3.0, 3.0) for z in (-1.0, 6.0)])
FAR = np.array([[30.0 + k, 3.0 * k, 1.0, 0.1 * k, 1.0, 0.5, 1.0] for k in range(5)])
STATIC = StaticScene(
    HILL,
    hulls=(CORNERS, CORNERS + np.array([-20.0, 0.0, 0.0])),
    boxes=np.array([[0.75, -0.3, 0.0, 0.3, 0.1, 0.1, 0.2], *FAR]),
    pillars=np.array([[0.1, 0.75, 1.0, 0.3, 1.0]]),
)
PERSON = Bodies(
    np.array([7], np.int32),
    np.array([RESIDENT], np.int8),
    np.array([[-0.4, -0.7, 0.0]]),
    np.zeros(1),
    np.array([0.25]),
    np.array([0.25]),
    np.array([1.7]),
    np.array([[0.5, 0.5]]),
)


@pytest.mark.parametrize("name", [engine for engine in ENGINES if getattr(engine, "values", ())[:1] == ("genesis",)])
def test_a_step_is_that_of_genesis_and_finds_the_same_contacts(name: str) -> None:
    from vico.sim.physics.genesis_scene import read_contacts

    models = tuple(robot_model(kind, packs=False) for kind in ("husky", "go2"))
    built: Any = make_scene(name, STATIC, models, Capacity(people=3, vehicles=2, objects=2))
    engine = built.engine(np.array([[0.0, 0.0, 0.0], [-2.0, 1.0, 1.0]]))
    engine.place_object(
        0, RigidObject(np.full(3, 0.3), 2.0, np.array([-1.0, 0.0, 0.4]), np.array([1.0, 0.0, 0.0, 0.0]))
    )
    engine.command(0, np.full(4, 4.0))
    for _ in range(8):
        engine.set_dynamic_obstacles(PERSON, 0.1)
        engine.step(5)
    scene = engine._scene
    before = scene.save()

    def after(step: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        scene.load(before)
        scene.place_links()
        step()
        contacts = read_contacts(scene.solver)
        return contacts[np.lexsort(contacts[:, 4::-1].T)], scene.positions.copy(), scene.speeds.copy()

    def its_own() -> None:
        scene.solver._is_forward_pos_updated = scene.solver._is_forward_vel_updated = True
        scene.solver.substep(0)

    ours, theirs = after(scene._solver_step.step), after(its_own)
    assert len({tuple(links) for links in ours[0][:, :2].tolist()}) > 7
    for mine, its in zip(ours, theirs, strict=True):
        assert mine == pytest.approx(its, abs=1e-9)
