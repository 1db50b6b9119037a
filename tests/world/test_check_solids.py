"""Faces that lie in one plane and overlap are found, with the way they face."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vico.world.check.buildings import coplanar_overlaps, open_edges

BOX = np.array(
    [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6],
     [3, 0, 4], [3, 4, 7]]
)  # fmt: skip


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> np.ndarray:
    (x0, y0, z0), (x1, y1, z1) = low, high
    points = np.array([[x, y, z] for z in (z0, z1) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))], float)
    return points[BOX]


def test_a_party_wall_is_two_faces_that_hide_each_other() -> None:
    found = coplanar_overlaps(np.concatenate([box((0, 0, 0), (4, 5, 6)), box((4, 1, 0), (9, 5, 8))]))
    assert found.flickering == 0
    assert found.area[~found.same].sum() == pytest.approx(4 * 6)


def test_walls_flush_with_each_other_flicker_where_they_overlap() -> None:
    found = coplanar_overlaps(np.concatenate([box((0, 0, 0), (4, 5, 6)), box((3, 0, 1), (9, 4, 5))]))
    assert found.area[found.same].sum() == pytest.approx(1 * 4)
    assert found.touching == 0


def test_without_those_that_face_each_other_the_flickering_ones_are_the_same() -> None:
    boxes = [box((0, 0, 0), (4, 5, 6)), box((3, 0, 1), (9, 4, 5)), box((4, 5, 0), (9, 9, 6)), box((0, 5, 0), (4, 9, 8))]
    every = coplanar_overlaps(np.concatenate(boxes))
    alone = coplanar_overlaps(np.concatenate(boxes), facing=False)
    assert every.touching > 0
    assert every.flickering > 0
    assert np.array_equal(alone.first, every.first[every.same])
    assert np.array_equal(alone.second, every.second[every.same])
    assert np.array_equal(alone.area, every.area[every.same])


def test_boxes_apart_have_none() -> None:
    found = coplanar_overlaps(np.concatenate([box((0, 0, 0), (4, 5, 6)), box((5, 0, 0), (9, 5, 6))]))
    assert len(found.first) == 0


def test_only_the_asked_triangles_are_looked_at() -> None:
    both = np.concatenate([box((0, 0, 0), (4, 5, 6)), box((3, 0, 1), (9, 4, 5))])
    assert len(coplanar_overlaps(both, among=np.arange(24) < 12).first) == 0


@given(st.floats(0, 2 * np.pi), st.floats(0.2, 3.8), st.floats(-500, 500))
@settings(max_examples=60, deadline=None)
def test_the_overlap_does_not_hang_on_turn_or_place(yaw: float, share: float, away: float) -> None:
    both = np.concatenate([box((0, 0, 0), (4, 5, 6)), box((share, -2, 6), (9, 4, 8))])
    c, s = np.cos(yaw), np.sin(yaw)
    turned = both @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + (away, -away, 40.0)
    found = coplanar_overlaps(turned)
    assert found.area[~found.same].sum() == pytest.approx((4 - share) * 4, rel=0.02, abs=0.05)
    assert found.flickering == 0


def test_a_missing_face_and_a_turned_face_open_edges() -> None:
    assert not open_edges(BOX).any()
    assert open_edges(BOX[1:]).sum() == 3
    turned = BOX.copy()
    turned[0] = turned[0, ::-1]
    assert open_edges(turned).any()
