"""The pose of a photo from points with known depths: simulated cameras before two walls and the ground."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vico.geo.street_images import camera_rotation, pinhole, rotation_from_axis_angle
from vico.seeds import rng
from vico.worldgen.photos.streetview.matching import Matches
from vico.worldgen.photos.streetview.registration import Pose, correction, fit_pose, project, se3_norm, unproject

pytest.importorskip("cv2", reason="OpenCV is the extra photos")

WIDTH, HEIGHT = 320, 240
LENS = pinhole(WIDTH, HEIGHT, 240.0)
PRIOR = Pose(np.array([0.0, 0.0, 1.8]), camera_rotation(20.0, 6.0))
SMALL = st.floats(-1.0, 1.0)


def depth_of_corner(pose: Pose) -> np.ndarray:
    """Depth image of the ground, a wall 18 m to the north and one 14 m to the east."""
    column, row = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    rays = np.stack([column, row, np.ones_like(row)], axis=-1) @ np.linalg.inv(LENS).T @ pose.rotation
    with np.errstate(divide="ignore"):
        steps = [(level - pose.position[axis]) / rays[..., axis] for axis, level in ((1, 18.0), (0, 14.0), (2, 0.0))]
    return np.min([np.where(step > 0, step, np.inf) for step in steps], axis=0).astype(np.float32)


def matches_of(true: Pose, *, count: int = 150, wrong: float = 0.3, noise: float = 0.4) -> Matches:
    """Points of the prior's view as the true camera sees them; some are matched with just anything."""
    random = rng(0, "matches")
    xy = random.uniform((4, 4), (WIDTH - 4, HEIGHT - 4), (count, 2))
    world, _ = unproject(xy, depth_of_corner(PRIOR), PRIOR, LENS)
    photo = project(world, true, LENS) + random.normal(0, noise, xy.shape)
    bad = random.random(count) < wrong
    photo[bad] += random.uniform(-30, 30, (bad.sum(), 2))
    return Matches(xy, photo, np.ones(count))


@settings(max_examples=15, deadline=None)
@given(st.tuples(SMALL, SMALL, SMALL), st.tuples(SMALL, SMALL, SMALL))
def test_a_pose_is_found_among_wrong_matches(step: tuple[float, ...], turn: tuple[float, ...]) -> None:
    position = PRIOR.position + np.array(step) * (1.5, 1.5, 0.4)
    true = Pose(position, rotation_from_axis_angle(np.array(turn) * 0.06) @ PRIOR.rotation)
    fit = fit_pose(matches_of(true), depth_of_corner(PRIOR), PRIOR, LENS)
    assert fit.refined is not None
    left = correction(true, fit.refined)
    assert left.shift < 0.12
    assert left.turn < 0.3
    assert fit.inliers.mean() > 0.5


def test_the_five_point_method_finds_a_long_step_and_depth_its_length() -> None:
    true = Pose(
        PRIOR.position + np.array([1.6, 0.9, 0.2]), rotation_from_axis_angle([0.02, -0.05, 0.03]) @ PRIOR.rotation
    )
    fit = fit_pose(matches_of(true, noise=0.2), depth_of_corner(PRIOR), PRIOR, LENS)
    assert fit.five_point is not None
    left = correction(true, fit.five_point)
    assert left.shift < 0.25
    assert left.turn < 0.6


def test_matches_with_the_sky_give_no_pose() -> None:
    fit = fit_pose(matches_of(PRIOR), np.zeros((HEIGHT, WIDTH), np.float32), PRIOR, LENS)
    assert fit.refined is None
    assert fit.five_point is None
    assert not fit.inliers.any()


def test_matches_by_chance_find_few_that_agree() -> None:
    fit = fit_pose(matches_of(PRIOR, wrong=1.0), depth_of_corner(PRIOR), PRIOR, LENS)
    assert fit.inliers.sum() < 20


def test_points_beside_an_edge_have_no_clear_depth() -> None:
    depth = np.full((20, 20), 10.0, np.float32)
    depth[:, 10:] = 30.0
    _, clear = unproject(np.array([[5.5, 5.5], [9.5, 5.5], [10.5, 5.5], [15.5, 5.5]]), depth, PRIOR, LENS)
    assert clear.tolist() == [True, False, False, True]


@settings(max_examples=40, deadline=None)
@given(st.tuples(SMALL, SMALL, SMALL), st.tuples(SMALL, SMALL, SMALL))
def test_the_norm_of_a_motion_is_that_of_its_inverse(turn: tuple[float, ...], step: tuple[float, ...]) -> None:
    rotation, translation = rotation_from_axis_angle(np.array(turn) * 1.5), np.array(step) * 5
    norm = se3_norm(rotation, translation)
    assert norm == pytest.approx(se3_norm(rotation.T, -rotation.T @ translation), abs=1e-6)
    assert norm >= 20.0 * np.linalg.norm(np.array(turn) * 1.5) - 1e-6


def test_the_norm_of_a_pure_step_is_its_length_and_of_a_turn_its_arc_at_twenty_metres() -> None:
    assert se3_norm(np.eye(3), np.array([3.0, 4.0, 0.0])) == pytest.approx(5.0)
    assert se3_norm(rotation_from_axis_angle([0.1, 0, 0]), np.zeros(3)) == pytest.approx(2.0)
    assert se3_norm(rotation_from_axis_angle([np.pi, 0, 0]), np.zeros(3)) == pytest.approx(20.0 * np.pi)


def test_a_screw_motion_has_the_norm_of_its_axis_and_pitch() -> None:
    # About and along one axis the logarithm is the motion itself.
    assert se3_norm(rotation_from_axis_angle([0, 0, 0.3]), np.array([0, 0, 2.0])) == pytest.approx(np.hypot(2.0, 6.0))


def test_a_correction_counts_what_the_camera_does() -> None:
    after = Pose(PRIOR.position + np.array([0.0, 2.0, 0.0]), PRIOR.rotation)
    moved = correction(PRIOR, after)
    assert (moved.shift, moved.turn, moved.norm) == pytest.approx((2.0, 0.0, 2.0), abs=1e-6)
