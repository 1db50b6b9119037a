"""Where a grid of values lies above a level."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vico.worldgen.ground.polygons import region_above


def test_a_cone_gives_a_circle() -> None:
    axis = np.arange(-20.0, 20.5, 1.0)
    cone = 20.0 - np.hypot(*np.meshgrid(axis, axis))
    disc = region_above(cone, 8.0, low=-20.0, cell=1.0)
    assert disc.area == pytest.approx(math.pi * 12**2, rel=0.01)
    assert shapely.Point(0, 0).buffer(12).hausdorff_distance(disc) < 0.1


def test_a_gentle_border_has_no_steps() -> None:
    east, north = np.meshgrid(np.arange(40.0), np.arange(40.0))
    region = region_above(north - 0.2 * east - 10.03, 0.0, low=0.0, cell=1.0)
    border = np.array([p for p in shapely.get_coordinates(region) if 1 < p[0] < 38 and 1 < p[1] < 38])
    assert np.abs(border[:, 1] - 0.2 * border[:, 0] - 10.03).max() < 1e-9


def test_a_hole_stays_a_hole_and_the_edge_is_reached() -> None:
    values = np.ones((9, 9))
    values[4, 4] = -1.0
    region = region_above(values, 0.0, low=0.0, cell=2.0)
    assert region.contains(shapely.box(0, 0, 16, 16).boundary)
    assert not region.contains(shapely.Point(8, 8))
    assert region_above(-values, 5.0, low=0.0, cell=2.0).is_empty


def test_values_that_hardly_leave_the_level_close_the_border() -> None:
    values = np.full((6, 6), -1.8e-286)
    values[4, :2] = 9.5e-85, 1.0
    region = region_above(values, 0.0, low=0.0, cell=1.0)
    assert region.is_valid
    assert region.covers(shapely.Point(1, 4))


@given(arrays(np.float64, (6, 6), elements=st.floats(-3.0, 3.0)), st.sampled_from([-1.0, 0.0, 0.5]))
def test_points_of_the_grid_lie_on_their_side(values: np.ndarray, level: float) -> None:
    region = region_above(values, level, low=0.0, cell=1.0)
    assert region.is_valid
    for (i, j), value in np.ndenumerate(values):
        if abs(value - level) > 1e-6:
            assert region.covers(shapely.Point(j, i)) == (value > level)
