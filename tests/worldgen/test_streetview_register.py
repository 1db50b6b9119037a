"""Photos nudged to lie on a wall, and kept only where they show it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vico.geo.street_images import camera_rotation
from vico.seeds import rng
from vico.worldgen.photos.atlas import Chart
from vico.worldgen.photos.streetview.registration import Pose, agreement, nudge_of

cv2 = pytest.importorskip("cv2", reason="OpenCV is the extra photos")

TEXEL = 0.1
SHAPE = 120, 200
CHART = Chart(
    1, 0, 0, 0, 200, 120, np.zeros(3), np.array([TEXEL, 0, 0]), np.array([0, 0, TEXEL]), np.array([0, -1.0, 0])
)
CAMERA = Pose(np.array([6.0, -9.0, 1.7]), camera_rotation(0.0, 10.0))
WHOLE = np.ones(SHAPE, np.bool_)


def windows(column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Luminance of a wall with rows of windows of many widths, at any place in texels."""
    made = np.full(np.broadcast_shapes(column.shape, row.shape), 170.0, np.float32)
    random = rng(0, "windows")
    for y in range(8, SHAPE[0] - 14, 30):
        for x in range(6, SHAPE[1] - 14, 26):
            wide, tall = random.integers(8, 13), random.integers(12, 18)
            made[(column > x) & (column < x + wide) & (row > y) & (row < y + tall)] = random.integers(30, 90)
    return np.asarray(cv2.GaussianBlur(made, (0, 0), 1.0), np.float32)


def places() -> tuple[np.ndarray, np.ndarray]:
    column, row = np.meshgrid(np.arange(SHAPE[1]) + 0.5, np.arange(SHAPE[0]) + 0.5)
    return column, row


@settings(max_examples=12, deadline=None)
@given(st.floats(-0.45, 0.45), st.floats(-0.45, 0.45))
def test_a_photo_that_is_off_is_moved_back(along: float, up: float) -> None:
    column, row = places()
    wall = cv2.GaussianBlur(windows(column, row), (0, 0), 1.5)
    photo = windows(column - along / TEXEL, row - up / TEXEL) * 0.7 + 20
    found = nudge_of(CHART, photo.astype(np.float32), WHOLE, wall, WHOLE, CAMERA)
    # A texel is moved as far as the wall shows it, wherever its plane stands.
    middle = (np.array([10.0, 6.0]) - [6.0, 1.7]) / 9.0
    moved = found.offset[[0, 2]] + -found.offset[1] * middle
    assert moved == pytest.approx([along, up], abs=0.06)
    assert found.after > 0.8


def test_a_wall_behind_its_place_is_found() -> None:
    column, row = places()
    wall = windows(column, row)
    stand = -0.3  # metres out of the wall
    foot = np.array([60.0, 17.0])  # texels
    photo = windows(column - (column - foot[0]) * stand / 9.0, row - (row - foot[1]) * stand / 9.0)
    found = nudge_of(CHART, photo, WHOLE, wall, WHOLE, CAMERA)
    assert -found.offset[1] == pytest.approx(stand, abs=0.12)
    assert found.after >= found.before


def test_a_plain_wall_moves_nothing() -> None:
    column, row = places()
    plain = np.full(SHAPE, 150, np.float32)
    found = nudge_of(CHART, windows(column, row), WHOLE, plain, WHOLE, CAMERA)
    assert not found.offset.any()
    tiny = replace(CHART, width=4, height=4)
    corner = slice(4), slice(4)
    assert not nudge_of(tiny, plain[corner], WHOLE[corner], plain[corner], WHOLE[corner], CAMERA).offset.any()


def test_a_photo_counts_where_it_shows_the_wall_and_not_where_a_tree_stands() -> None:
    column, row = places()
    grey = windows(column, row) / 2.55
    wall = np.stack([grey, np.zeros_like(grey), np.full_like(grey, 8)], axis=-1)
    photo = wall.copy()
    leaves = rng(0, "leaves").uniform(10, 70, (60, 50)).astype(np.float32)
    photo[40:100, 120:170] = np.stack(
        [cv2.GaussianBlur(leaves, (0, 0), 1.0), leaves * 0 - 30, leaves * 0 + 30], axis=-1
    )
    found = agreement(photo, WHOLE, wall, WHOLE, TEXEL)
    assert found[:, :90].mean() > 0.95
    assert found[55:85, 132:158].max() < 0.5


def test_the_sky_over_the_eaves_is_no_wall() -> None:
    column, row = places()
    grey = windows(column, row) / 2.55
    wall = np.stack([grey, np.zeros_like(grey), np.full_like(grey, 8)], axis=-1)
    known = WHOLE.copy()
    known[100:] = False
    photo = wall.copy()
    photo[100:] = (85.0, -8.0, -40.0)
    assert agreement(photo, WHOLE, wall, known, TEXEL)[106:118].max() < 0.5
    assert agreement(wall, WHOLE, wall, known, TEXEL)[106:118].min() > 0.5
