"""How things are turned where they are put down: on what holds them up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vico.agents.robot.grasps import HeldObject, object_box, object_in_jaw, refine_held_object
from vico.agents.robot.reaching import turns_along_heading, turns_by_support
from vico.assets.robots import robot_model
from vico.challenges.robot_tasks import arm_body

BODY = arm_body(robot_model("manipulator"))


def surfaces(half: tuple[float, float, float], *, faces: str) -> np.ndarray:
    """Points of some faces of a box round the origin: t(op), f(ront), s(ide)."""
    stream = np.random.default_rng(3)
    found = []
    for face in faces:
        points = stream.uniform(-1.0, 1.0, (300, 3)) * half
        axis, sign = {"t": (2, 1.0), "f": (0, -1.0), "s": (1, -1.0)}[face]
        points[:, axis] = sign * half[axis]
        found.append(points)
    return np.vstack(found)


def held(half: tuple[float, float, float], *, faces: str = "tfs") -> HeldObject:
    """A box in the jaw, as its faces were seen where the hand closed."""
    middle = BODY.hand(BODY.rest)[:, 3]
    box = object_box(surfaces(half, faces=faces) + middle)
    assert box is not None
    return object_in_jaw(BODY, BODY.rest, box, 0.05)


def test_a_long_thing_is_laid_along_a_narrow_board() -> None:
    thing = held((0.2, 0.05, 0.1))
    stream = np.random.default_rng(1)
    board = np.column_stack([stream.uniform(0.5, 0.62, 3000), stream.uniform(-0.4, 0.4, 3000), np.full(3000, 0.3)])
    floor = np.column_stack([stream.uniform(0.2, 1.0, 3000), stream.uniform(-0.4, 0.4, 3000), np.zeros(3000)])
    good, rest = turns_by_support(thing, np.vstack([board, floor]), np.array([0.56, 0.0, 0.3]))
    for turn in good:
        assert abs(math.sin(thing.heading + turn)) > 0.9  # along y, as the board lies
    assert len(good) + len(rest) >= 8


def test_sides_that_are_alike_may_lie_either_way() -> None:
    assert len(turns_along_heading(held((0.2, 0.05, 0.1)), 0.4)) == 2
    square = held((0.1, 0.1, 0.1))
    assert len(turns_along_heading(square, 0.4)) == 4
    for turn in turns_along_heading(square, 0.4):
        assert math.sin(2.0 * (square.heading + turn - 0.4)) == pytest.approx(0.0, abs=1e-6)


def test_another_look_shows_how_deep_a_thing_is() -> None:
    half = (0.1, 0.14, 0.1)
    front = held(half, faces="f")
    assert front.half.max() == pytest.approx(0.14, abs=0.01)
    assert front.half.min() < 0.02
    whole = refine_held_object(BODY, BODY.rest, front, surfaces(half, faces="ts") + BODY.hand(BODY.rest)[:, 3])
    assert whole.half == pytest.approx([0.1, 0.14], abs=0.015)
    assert whole.middle == pytest.approx([0.0, 0.0], abs=0.015)
    assert not whole.slender
    assert refine_held_object(BODY, BODY.rest, front, np.zeros((3, 3))) is front


def test_what_is_high_for_its_width_is_slender() -> None:
    assert held((0.045, 0.045, 0.15)).slender
    assert not held((0.09, 0.17, 0.19)).slender
