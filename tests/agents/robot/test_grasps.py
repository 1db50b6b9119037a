"""Where to take hold of a thing, by the points that are seen of it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.agents.robot.grasps import JAW_ROOM, Grasp, candidate_grasps, object_box
from vico.assets.models.movable import movable_surfaces
from vico.assets.robots import robot_model
from vico.challenges.robot_tasks import arm_body

BODY = arm_body(robot_model("manipulator"))


def seen(size: tuple[float, float, float], at: tuple[float, float, float], yaw: float) -> NDArray[np.float64]:
    """Return points of the top and two sides of a box, as a camera above the base sees them."""
    stream = np.random.default_rng(2)
    half = np.array(size) / 2
    points = stream.uniform(-1, 1, (600, 3)) * half
    points[:200, 2], points[200:400, 0], points[400:, 1] = half[2], -half[0], -half[1]
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    found: NDArray[np.float64] = points @ turn.T + np.array(at) + [0, 0, half[2]]
    return found


@pytest.mark.parametrize("yaw", [0.0, 0.4, 1.2, 2.5])
def test_the_box_round_a_thing_is_the_things(yaw: float) -> None:
    box = object_box(seen((0.24, 0.1, 0.15), (0.6, 0.1, -0.1), yaw))
    assert box is not None
    assert box.half == pytest.approx([0.05, 0.12], abs=0.012)
    assert box.centre == pytest.approx([0.6, 0.1], abs=0.012)
    assert (box.low, box.high) == pytest.approx((-0.1, 0.05), abs=0.012)
    assert abs(float(box.axes[0] @ [-np.sin(yaw), np.cos(yaw)])) > 0.99
    inside = box.points(0.01, 0.05)
    assert np.abs((inside[:, :2] - box.centre) @ box.axes.T).max(axis=0) == pytest.approx(box.half - 0.01)
    assert object_box(np.zeros((5, 3))) is None


def hand_width(grasp: Grasp) -> float:
    return 2.0 * (grasp.opening - JAW_ROOM)


def test_hands_come_from_above_across_the_narrower_side_and_keep_off_the_ground() -> None:
    box = object_box(seen((0.24, 0.1, 0.15), (0.6, 0.1, -0.1), 0.4))
    assert box is not None
    first, *others = candidate_grasps(box, BODY)
    assert first.pose[:, 2] == pytest.approx([0.0, 0.0, -1.0])
    assert hand_width(first) == pytest.approx(0.1, abs=0.025)
    assert first.before[2, 3] - first.pose[2, 3] == pytest.approx(0.13)
    for grasp in (first, *others):
        assert np.linalg.det(grasp.pose[:, :3]) == pytest.approx(1.0)
        assert grasp.pose[2, 3] - 0.035 > box.low
        assert grasp.opening <= BODY.opening
    flat = object_box(seen((0.2, 0.1, 0.03), (0.6, 0.1, -0.1), 0.4))
    assert flat is not None
    assert candidate_grasps(flat, BODY)[0].pose[2, 3] > flat.low + 0.04


def test_what_is_high_up_is_taken_from_the_side_and_what_is_too_wide_not_at_all() -> None:
    high = object_box(seen((0.1, 0.1, 0.3), (0.6, 0.0, 0.6), 0.3))
    assert high is not None
    first = candidate_grasps(high, BODY)[0]
    assert first.pose[2, 2] > -0.5
    assert np.abs(high.axes @ first.pose[:2, 1]).max() == pytest.approx(1.0)
    wide = object_box(seen((0.5, 0.4, 0.3), (0.7, 0.0, -0.1), 0.0))
    assert wide is not None
    assert candidate_grasps(wide, BODY) == []


def shown(kind: str, at: NDArray[np.float64], yaw: float) -> NDArray[np.float64]:
    """Return points of a thing's faces that a camera above the base sees."""
    stream = np.random.default_rng(6)
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    found = []
    for surface in movable_surfaces(kind, "red"):
        corners = surface.positions[surface.triangles].astype(np.float64) @ turn.T + at
        faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        seen_from = np.array([0.0, 0.0, 0.9]) - corners.mean(axis=1)
        visible = (faces * seen_from).sum(axis=1) > 0.0
        counts = np.ceil(np.linalg.norm(faces, axis=1) / 2 * 40_000 * visible).astype(int)
        share = stream.dirichlet(np.ones(3), int(counts.sum()))
        found.append(np.einsum("sk,skc->sc", share, np.repeat(corners, counts, axis=0)))
    return np.concatenate(found)


@pytest.mark.parametrize("yaw", [0.0, 0.9, 2.0, 4.0])
def test_a_can_is_held_by_its_body_and_not_by_spout_or_handle(yaw: float) -> None:
    at = np.array([0.65, 0.05, -0.25])
    points = shown("watering can", at, yaw)
    box = object_box(points)
    assert box is not None
    grasps = candidate_grasps(box, BODY, points)
    assert np.hypot(*(box.centre - at[:2])) > 0.03  # the box's middle is off the body
    first = grasps[0]
    assert first.pose[2, 2] == pytest.approx(-1.0)
    assert first.opening > 0.125
    off = first.pose[:2, 3] - at[:2]
    assert np.hypot(*off) < 0.035


def test_a_bottle_is_held_below_its_neck_and_an_umbrella_where_it_is_heavy() -> None:
    at = np.array([0.6, 0.0, -0.1])
    bottle = shown("water bottle", at, 0.3)
    box = object_box(bottle)
    assert box is not None
    assert (
        candidate_grasps(box, BODY, bottle)[0].pose[2, 3] - at[2] < 0.225
    )  # shoulders begin at 0.19, the neck at 0.27
    umbrella = shown("umbrella", at, 0.0)
    box = object_box(umbrella)
    assert box is not None
    assert candidate_grasps(box, BODY, umbrella)[0].pose[0, 3] - at[0] < -0.1  # its canopy is on that side
