"""Polylines."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_array_equal

from vico.geometry import arc_lengths, distance, distances, points_along

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
