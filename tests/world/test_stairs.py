"""Treads of stairs outdoors."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from vico.world.heights import HeightField, Stairs

_GOING, _RISE, _WIDTH, _COUNT = 0.3, 0.16, 2.0, 12


def flight() -> HeightField:
    """A slope that rises eastwards from the origin, with a flight of stairs on it."""
    edge = np.arange(_COUNT + 1) * _GOING
    corners = [[(a, -1.0), (b, -1.0), (b, 1.0), (a, 1.0)] for a, b in pairwise(edge)]
    level = (np.arange(_COUNT) + 0.5) * _RISE
    n = 401  # of 0.1 m
    x = np.linspace(-20.0, 20.0, n)
    heights = np.tile(np.clip(x, 0.0, _COUNT * _GOING) * _RISE / _GOING, (n, 1)).astype(np.float32)
    return HeightField(heights, 20.0, stairs=Stairs(np.array(corners), level, np.full(_COUNT, _GOING)))


def test_feet_stand_on_level_treads_and_bodies_on_the_slope() -> None:
    height = flight()
    points = np.array([[0.61, 0.2, 0.32], [0.89, -0.4, 0.47]])
    assert height.footing(points) == pytest.approx([2.5 * _RISE] * 2)
    assert height.near(points) == pytest.approx([0.61 * _RISE / _GOING, 0.89 * _RISE / _GOING], abs=1e-3)


def test_off_the_stairs_feet_stand_on_the_ground() -> None:
    height = flight()
    points = np.array([[-3.0, 0.0, 0.0], [0.7, 1.2, 0.37], [9.0, 0.0, 1.92], [0.7, 0.0, 4.0]])
    assert height.footing(points) == pytest.approx(height.near(points))
    assert height.going_at(points) == pytest.approx(0.0)


def test_the_depth_of_treads_is_told_where_they_are() -> None:
    assert flight().going_at(np.array([[1.0, 0.0, 0.53]])) == pytest.approx(_GOING)


def test_stairs_are_kept_in_the_file_of_heights() -> None:
    height = flight()
    again = HeightField.from_arrays(height.arrays())
    points = np.column_stack([np.linspace(-1.0, 5.0, 50), np.zeros(50), height(np.zeros((50, 2)) + 0.5)])
    assert np.array_equal(again.footing(points), height.footing(points))


@pytest.mark.parametrize(
    "broken",
    [{"stairs_level": np.zeros(3)}, {"stairs_going": np.zeros(_COUNT)}, {"stairs_corners": np.zeros((0, 4, 2))}],
)
def test_stairs_that_make_none_are_refused(broken: dict[str, np.ndarray]) -> None:
    with pytest.raises(ValueError, match="stairs"):
        HeightField.from_arrays(flight().arrays() | broken)


def test_a_world_without_stairs_writes_none() -> None:
    assert not [name for name in replace(flight(), stairs=None).arrays() if name.startswith("stairs")]
