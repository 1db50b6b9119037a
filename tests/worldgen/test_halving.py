"""Parting polygons along a line: nothing is lost, nothing lies on the wrong side."""

from __future__ import annotations

import math

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from vico.worldgen.ground.polygons import split_polygons


@st.composite
def stars(draw: st.DrawFn) -> shapely.Polygon:
    """Polygons about the origin, convex or not, some with a hole."""
    radii = draw(st.lists(st.floats(1.0, 9.0), min_size=3, max_size=14))
    ring = [(r * math.cos(k * math.tau / len(radii)), r * math.sin(k * math.tau / len(radii))) for k, r in
            enumerate(radii)]  # fmt: skip
    hole = draw(st.booleans()) and min(radii) > 3.0 and len(radii) > 6
    return shapely.Polygon(ring, [[(0.5, 0.0), (-0.2, 0.4), (-0.2, -0.4)]] if hole else [])


@given(st.lists(stars(), min_size=1, max_size=5), st.floats(-0.9, 0.9), st.sampled_from([0, 1]))
def test_two_parts_make_the_whole(shapes: list[shapely.Polygon], at: float, axis: int) -> None:
    whole = np.array([s for s in shapes if s.bounds[axis] < at < s.bounds[2 + axis]], object)
    if not len(whole):
        return
    middle = np.full(len(whole), at)
    below, beyond = split_polygons(whole, middle, axis)
    for shape, low, high in zip(whole, below, beyond, strict=True):
        assert abs(low.area + high.area - shape.area) < 1e-6
        assert low.bounds[2 + axis] <= at + 1e-9
        assert high.bounds[axis] >= at - 1e-9
        assert shapely.symmetric_difference(shapely.make_valid(low), shape).area < high.area + 1e-6
        assert shapely.make_valid(high).intersection(shape).area > high.area - 1e-6


def test_a_comb_comes_apart_into_its_teeth() -> None:
    comb = shapely.Polygon(
        [(0, 0), (5, 0), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
    )
    below, beyond = split_polygons(np.array([comb], object), np.array([2.0]), 1)
    assert len(shapely.get_parts(beyond[0])) == 3
    assert below[0].area == 5 + 3
    assert beyond[0].area == 3
