"""Angles, distances and polylines in the plane."""

from __future__ import annotations

import math

import numpy as np
from numpy.testing import assert_array_equal

from vico.geometry import (
    arc_lengths,
    direction,
    distance,
    distances,
    points_along,
    polyline_length,
    rotate,
    wrap_angle,
)

LINE = np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 4.0], [3.0, 10.0]])


def test_points_lie_as_far_along_a_line_as_it_is_long_up_to_them() -> None:
    assert arc_lengths(LINE).tolist() == [0.0, 5.0, 5.0, 11.0]


def test_points_along_a_line_keep_to_its_ends() -> None:
    found = points_along(LINE, np.array([-1.0, 2.5, 5.0, 8.0, 20.0]))
    assert found.tolist() == [[0.0, 0.0], [1.5, 2.0], [3.0, 4.0], [3.0, 7.0], [3.0, 10.0]]


def test_lengths_that_are_known_are_taken() -> None:
    at = np.linspace(0.0, 11.0, 7)
    assert_array_equal(points_along(LINE, at, arc_lengths(LINE)), points_along(LINE, at))


def test_distances_are_those_of_the_plane() -> None:
    assert distance(LINE[0], LINE[1]) == distance(LINE[0], (3.0, 4.0)) == 5.0
    assert distances(LINE, LINE[0]).tolist() == [0.0, 5.0, 5.0, float(np.hypot(3.0, 10.0))]
    assert distances(LINE, LINE).tolist() == [0.0] * 4
    assert polyline_length(LINE) == 11.0


def test_angles_are_wrapped_to_half_a_turn_on_either_side() -> None:
    assert [wrap_angle(angle) for angle in (0.0, math.pi, -math.pi, 5 * math.pi)] == [0.0, -math.pi, -math.pi, -math.pi]
    assert abs(wrap_angle(7.0) - (7.0 - 2 * math.pi)) < 1e-12


def test_a_point_ahead_is_turned_to_where_a_yaw_points() -> None:
    assert direction(0.3).tolist() == rotate(np.array([1.0, 0.0]), 0.3).tolist()
    assert np.allclose(rotate(rotate(LINE, 0.3), -0.3), LINE, atol=1e-12)
