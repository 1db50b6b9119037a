"""Things in physics that are made of several convex parts."""

from __future__ import annotations

import numpy as np
import pytest

from vico.errors import InputError
from vico.sim.physics import Capacity, PhysicsEngine, StaticScene, make_scene
from vico.sim.physics.collision_shapes import box_parts, parts_of
from vico.sim.physics.records import BALL, BOX, CYLINDER, RigidObject, RigidPart
from vico.world.heights import HeightField

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
PLAIN = StaticScene(HeightField.flat(20.0))


def engine() -> PhysicsEngine:
    return make_scene("mujoco", PLAIN, (), Capacity(people=1, vehicles=1, objects=3)).engine(np.zeros((0, 3)))


def part(shape: str, half: tuple[float, float, float], at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> RigidPart:
    return RigidPart(shape, np.array(half), np.array(at), UPRIGHT)


def thing(*parts: RigidPart, at: tuple[float, float, float], quaternion: np.ndarray = UPRIGHT) -> RigidObject:
    return RigidObject(np.full(3, 0.2), 1.0, np.array(at), quaternion, parts=parts)


def test_a_box_is_one_part() -> None:
    rows = box_parts(np.array([0.1, 0.2, 0.3]))
    assert rows.is_used.sum() == 1
    assert rows.inertia(3.0) == pytest.approx([0.13, 0.1, 0.05])
    middle, reach = rows._replace(rows=rows.rows[None]).bounds()
    assert middle[0] == pytest.approx([0, 0, 0])
    assert reach[0] == pytest.approx([0.1, 0.2, 0.3])


def test_moments_are_those_of_the_shapes() -> None:
    rod = parts_of(thing(part(CYLINDER, (0.1, 0.1, 0.3)), at=(0, 0, 1)))
    assert rod.inertia(2.0) == pytest.approx([2 * (0.01 / 4 + 0.09 / 3)] * 2 + [2 * 0.01 / 2])
    ball = parts_of(thing(part(BALL, (0.1, 0.1, 0.1)), at=(0, 0, 1)))
    assert ball.inertia(2.0) == pytest.approx([0.4 * 2.0 * 0.01] * 3)
    # Two halves of a box weigh and turn as the box does.
    halves = parts_of(
        thing(part(BOX, (0.1, 0.1, 0.1), (0.1, 0, 0)), part(BOX, (0.1, 0.1, 0.1), (-0.1, 0, 0)), at=(0, 0, 1))
    )
    assert halves.inertia(2.0) == pytest.approx(box_parts(np.array([0.2, 0.1, 0.1])).inertia(2.0))


def test_there_is_room_for_so_many_parts() -> None:
    balls = [part(BALL, (0.1, 0.1, 0.1))] * 2
    with pytest.raises(InputError, match=r"no room for another ball; there is room for 3 box, 2 cylinder, 1 ball"):
        parts_of(thing(*balls, at=(0, 0, 1)))


def test_what_is_laid_on_a_thing_with_a_handle_lies_on_its_handle() -> None:
    physics = engine()
    handle = thing(
        part(BOX, (0.1, 0.1, 0.05), (0, 0, -0.05)), part(BOX, (0.01, 0.1, 0.05), (0, 0, 0.05)), at=(0, 0, 0.1)
    )
    physics.place_object(0, handle)
    points = np.array([[0.0, 0.0, 1.0], [0.07, 0.0, 1.0], [0.3, 0.0, 1.0]])
    assert physics.clearance_below(points) == pytest.approx([0.8, 0.9, 1.0], abs=1e-6)
    physics.step(100)
    assert physics.objects().position[0] == pytest.approx([0, 0, 0.1], abs=2e-3)
    # Another one comes to where this one is a plain box again.
    physics.place_object(0, thing(at=(0, 0, 0.1)))
    assert physics.clearance_below(points) == pytest.approx([0.8, 0.8, 1.0], abs=1e-6)


def test_what_is_round_rolls_and_what_is_a_box_does_not() -> None:
    physics = engine()
    lying = np.array([np.cos(np.pi / 4), np.sin(np.pi / 4), 0.0, 0.0])
    for slot, shape in enumerate((CYLINDER, BOX)):
        rolls = thing(part(shape, (0.05, 0.05, 0.1)), at=(0.0, 2.0 * slot, 0.051), quaternion=lying)
        physics.place_object(slot, RigidObject(**{**rolls.__dict__, "velocity": np.array([0.4, 0.0, 0.0])}))
    physics.step(150)
    moved = physics.objects().position[:2, 0]
    assert moved[0] > 0.3
    assert moved[1] < 0.1


def test_a_restored_engine_goes_on_alike_with_parts() -> None:
    physics, other = engine(), engine()
    physics.place_object(
        1, thing(part(CYLINDER, (0.05, 0.05, 0.1)), part(BALL, (0.06,) * 3, (0.1, 0, 0)), at=(0, 0, 0.4))
    )
    physics.step(20)
    other.restore(physics.arrays())
    physics.step(60)
    other.step(60)
    assert np.array_equal(physics.objects().position[1], other.objects().position[1])
