"""An arm keeps off what was seen: its body, what stands around it, angles for its hand, and ways between them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.robots import MobileManipulator, robot_model
from vico.kinematics.arm import (
    Chain,
    CollisionSpheres,
    Jaw,
    box_points,
    collision_spheres,
    hand_pose,
    sphere_positions,
    with_held_object,
)
from vico.kinematics.hand_paths import downward
from vico.kinematics.planning import (
    Arm,
    DistanceGrid,
    collision_free_reach,
    distance_grid,
    empty_distance_grid,
    is_free,
    is_path_free,
    obstacle_distance,
    plan_path,
)

Array = NDArray[np.float64]

MODEL = robot_model("manipulator")
REST = MODEL.rest[:7].copy()
POSTS = np.array([[0.0, 0.0, 0.27, 0.17], [-0.02, 0.0, 0.12, 0.57], [-0.1, 0.05, 0.035, 1.1]])
RADII = np.array([0.06, 0.06, 0.045, 0.045, 0.045, 0.045, 0.045])


def chain() -> Chain:
    c = MODEL.controller
    assert isinstance(c, MobileManipulator)
    return Chain(c.places, c.axes, c.low, c.high, c.grip)


def arm(room: DistanceGrid, *, limbs: CollisionSpheres | None = None, gap: float = 0.01) -> Arm:
    c = chain()
    return Arm(c, collision_spheres(c, RADII, jaw=Jaw(), opening=0.08) if limbs is None else limbs, room, gap)


def board(corner: tuple[float, ...], along: tuple[float, ...], up: tuple[float, ...]) -> Array:
    """Return points all over a board, 2 cm apart."""
    s, t = (np.linspace(0, 1, round(float(np.linalg.norm(side)) / 0.02) + 1) for side in (along, up))
    grid = np.stack(np.meshgrid(s, t), axis=-1).reshape(-1, 2)
    return np.array(corner) + grid @ np.array([along, up])


def shelf() -> Array:
    """Return a box on its side, open towards the base."""
    boards = [board((0.45, -0.35, z), (0.5, 0, 0), (0, 0.7, 0)) for z in (0.15, 0.75)]
    boards += [board((0.45, y, 0.15), (0.5, 0, 0), (0, 0, 0.6)) for y in (-0.35, 0.35)]
    return np.concatenate(boards)


def ahead(y: float, z: float) -> Array:
    """Return a hand that looks straight ahead, open level."""
    return np.column_stack([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.62, y, z]])


def pose_at(angles: Array) -> Array:
    pose = np.empty((3, 4))
    hand_pose(chain(), angles, np.empty((7, 3)), np.empty((7, 3)), pose)
    return pose


def test_balls_cover_the_arm_where_physics_has_it() -> None:
    c, stream = chain(), np.random.default_rng(1)
    limbs = collision_spheres(c, RADII, jaw=Jaw(), opening=0.08)
    places, origins, pose = np.empty((len(limbs.link), 3)), np.empty((7, 3)), np.empty((3, 4))
    for _ in range(20):
        angles = stream.uniform(c.low, c.high)
        hand_pose(c, angles, origins, np.empty((7, 3)), pose)
        sphere_positions(c, limbs, angles, places)
        for k in range(6):  # every point of each link is in a ball
            points = origins[k] + np.linspace(0, 1, 20)[:, None] * (origins[k + 1] - origins[k])
            away = np.linalg.norm(points[:, None] - places[limbs.link == k], axis=2)
            assert (away.min(axis=1) <= RADII[k]).all()
        fingers = pose[:, 3] + np.array([-1.0, 1.0])[:, None] * 0.09 * pose[:, 1]
        assert np.linalg.norm(fingers[:, None] - places[limbs.link == 6], axis=2).min(axis=1).max() < 0.04


def test_distances_are_to_what_was_seen_and_to_the_base() -> None:
    room = distance_grid(np.array([[0.8, 0.0, 0.5], [9.0, 9.0, 9.0]]), POSTS)
    ball = CollisionSpheres(np.array([6]), np.zeros((1, 3)), np.array([0.05]))
    for away in (0.1, 0.15, 0.2):
        gap = obstacle_distance(room, ball, np.array([[0.8 - away, 0.0, 0.5]]))
        assert gap == pytest.approx(away - 0.05, abs=0.045)
    assert obstacle_distance(room, ball, np.array([[0.3, 0.0, 0.1]])) == pytest.approx(0.3 - 0.27 - 0.05)
    assert obstacle_distance(room, ball, np.array([[0.0, 0.0, 0.1]])) < 0.0
    below = distance_grid(np.zeros((0, 3)), POSTS, ground=-0.1)
    assert (
        obstacle_distance(below, ball, np.array([[0.8, 0.0, -0.15]]))
        < 0.0
        < obstacle_distance(below, ball, np.array([[0.8, 0, 0.2]]))
    )


def test_angles_reach_a_pose_within_bounds_and_touch_nothing() -> None:
    c, stream, reached = chain(), np.random.default_rng(3), 0
    free = arm(empty_distance_grid(POSTS))
    for _ in range(60):
        goal = downward(stream.uniform([0.45, -0.3, 0.0], [0.65, 0.3, 0.6]), np.array([0.0, 1.0]), 0.0)
        found = collision_free_reach(free, [goal], REST, posture=REST)
        if found is None:
            continue
        angles, reached = found[0], reached + 1
        assert ((angles >= c.low) & (angles <= c.high)).all()
        assert is_free(free, angles)
        assert np.abs(pose_at(angles) - goal).max() < 3e-3
    assert reached >= 57


def test_of_several_poses_the_first_that_is_free_is_taken() -> None:
    wall = board((0.4, -0.35, 0.0), (0.5, 0, 0), (0, 0, 0.9))
    room = arm(distance_grid(wall, POSTS))
    goals = [downward(np.array([0.6, y, 0.3]), np.array([0.0, 1.0]), 0.0) for y in (-0.35, 0.1)]
    found = collision_free_reach(room, goals, REST, posture=REST)
    assert found is not None
    assert found[1] == 1
    assert collision_free_reach(room, goals[:1], REST) is None


def test_ways_lead_round_what_is_in_between() -> None:
    room, found = arm(distance_grid(shelf(), POSTS)), 0
    for y in (-0.1, -0.05, 0.0, 0.05, 0.1):
        goal = collision_free_reach(room, [ahead(y, 0.45)], REST, posture=REST)
        assert goal is not None
        # The straight way of the joints from the far side touches the shelf.
        start = REST.copy()
        start[0] = -1.4
        way = plan_path(room, start, goal[0], seed=4)
        assert way is not None
        assert (way[0] == start).all()
        assert np.allclose(way[-1], goal[0])
        assert is_path_free(room, way)
        found += len(way) > 2
        again = plan_path(room, start, goal[0], seed=4)
        assert again is not None
        assert (again == way).all()
    assert found


def test_there_is_no_way_into_what_is_closed_nor_from_within_a_thing() -> None:
    closed = np.concatenate([shelf(), board((0.45, -0.35, 0.15), (0, 0.7, 0), (0, 0, 0.6))])
    inside = collision_free_reach(arm(distance_grid(shelf(), POSTS)), [ahead(0.0, 0.45)], REST, posture=REST)
    assert inside is not None
    assert plan_path(arm(distance_grid(closed, POSTS)), REST, inside[0]) is None
    limbs = collision_spheres(chain(), RADII, jaw=Jaw(), opening=0.08)
    places = np.empty((len(limbs.link), 3))
    sphere_positions(chain(), limbs, REST, places)
    buried = distance_grid(places[limbs.link == 4], POSTS)
    assert plan_path(arm(buried), REST, inside[0]) is None


def test_what_is_held_needs_room_too() -> None:
    c = chain()
    limbs = collision_spheres(c, RADII, jaw=Jaw(), opening=0.08)
    held = with_held_object(limbs, box_points(np.array([0.1, 0.08, 0.15]), 0.05) + np.array([0.0, 0.0, 0.27]), 0.015)
    assert len(held.link) > len(limbs.link)
    goal = downward(np.array([0.55, 0.0, 0.35]), np.array([0.0, 1.0]), 0.0)
    table = distance_grid(board((0.4, -0.4, 0.15), (0.5, 0, 0), (0, 0.8, 0)), POSTS)
    found = collision_free_reach(arm(table), [goal], REST, posture=REST)
    assert found is not None
    assert not is_free(arm(table, limbs=held), found[0])
