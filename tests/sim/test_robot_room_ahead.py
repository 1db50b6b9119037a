"""How far robots may go before they come too near to somebody, and away from who is too near already."""

import numpy as np
import pytest

from robot_field import HALF, field, people
from vico.sim.bodies.arrays import OBJECT, Bodies
from vico.sim.robots import RobotPopulation, RobotStatus
from vico.sim.robots.path_following import NEIGHBOUR, SIGHT, NearbyBodies, free_ahead
from vico.world.heights import HeightField

HALF_LENGTH, HALF_WIDTH = 0.25, 0.3


def car(x: float, y: float, vx: float = 0.0) -> np.ndarray:
    """A car headed east."""
    return np.array([(x, y, 0.0, 2.3, 0.9, vx, 0.0, 0.0)], NEIGHBOUR)


def free(yaw: float, others: np.ndarray) -> float:
    """Metres free for a robot at (0, 0) that goes straight on."""
    outline = HALF_LENGTH, HALF_WIDTH
    return float(free_ahead(0.0, 0.0, yaw, 0.25, outline, np.zeros((0, 2)), 0.0, others)[0])


def test_a_robot_stops_for_a_car_ahead_and_not_for_one_that_it_leaves_behind() -> None:
    right_ahead = car(2.3 + 0.32, 0.0)
    assert free(0.0, right_ahead) == 0.0
    assert free(np.pi, right_ahead) == SIGHT
    assert free(np.pi * 0.75, right_ahead) == SIGHT
    # Along its side it stays as near as it is, and towards it nearer: both have to wait.
    beside = car(0.0, 0.9 + 0.32)
    assert free(0.0, beside) < 0.2
    assert free(np.pi / 2, beside) == 0.0


def test_who_backs_off_stops_for_a_second_car_behind_and_for_one_that_follows() -> None:
    two = np.concatenate([car(2.62, 0.0), car(-4.0, 0.0)])
    assert free(np.pi, two) == pytest.approx(4.0 - 2.3 - HALF_WIDTH - 0.15, abs=0.15)
    assert free(np.pi, car(2.62, 0.0, -1.0)) < 0.2


#: Robots beside each other that are told to go downhill, 15 m down in 100 m, as fast as they can; y of each.
KINDS = ("h1", "go2", "husky", "manipulator")
LANES = np.arange(len(KINDS)) * 5.0 - 7.5


def downhill(*walls: tuple[float, float, float, float]) -> RobotPopulation:
    hill = HeightField(np.broadcast_to(-0.15 * np.linspace(-HALF, HALF, 81), (81, 81)).astype(np.float32), HALF)
    robots = RobotPopulation(field(*walls, height=hill), KINDS, [[0.0, y, 0.0] for y in LANES], packs=False)
    for robot in range(len(KINDS)):
        robots.drive(robot, robots.models[robot].velocity_limit * [1, 0, 0])
    return robots


def noses(robots: RobotPopulation) -> np.ndarray:
    """How far east each reaches."""
    found: np.ndarray = robots.bodies().position[:, 0] + robots.scene.outlines.half_length
    return found


def test_robots_told_a_velocity_downhill_stop_before_somebody() -> None:
    robots = downhill()
    standing = people(*[(5.0, float(y)) for y in LANES])
    standing.position[:, 2] = robots.world.height(standing.position)
    furthest = np.full(len(KINDS), -np.inf)
    for _ in range(90):
        robots.advance(0.1, standing)
        furthest = np.maximum(furthest, noses(robots))
    assert (5.0 - 0.25 - furthest > 0.15).all()
    assert (noses(robots) > 3.5).all()
    assert (robots.status == RobotStatus.WAITING).all()
    assert robots.events() == []


def test_robots_told_a_velocity_downhill_touch_a_wall_slowly_and_stay_on_their_feet() -> None:
    robots = downhill((6.0, 0.0, 2.0, 40.0))
    before = np.zeros(len(KINDS))  # 2 cm and less from the wall, how fast each comes
    for _ in range(120):
        speed = robots.bodies().velocity[:, 0]
        robots.advance(0.1, Bodies.none())
        touching = (noses(robots) > 5.0 - 0.02) & (before == 0.0)
        before[touching] = speed[touching]
    assert (before < 0.6).all()
    assert (noses(robots) > 5.0 - 0.2).all()
    assert robots.events() == []


def test_who_stands_on_a_slope_stays_there() -> None:
    robots = downhill()
    for robot in range(len(KINDS)):
        robots.drive(robot, np.zeros(3))
    before = robots.bodies().position[:, :2].copy()
    for _ in range(200):
        robots.advance(0.1, Bodies.none())
    moved = np.hypot(*(robots.bodies().position[:, :2] - before).T)
    assert moved[KINDS.index("husky")] < 0.06
    assert moved[KINDS.index("manipulator")] < 0.06


def test_what_lies_on_a_robot_is_no_obstacle_to_it_and_what_lies_ahead_is() -> None:
    robots = RobotPopulation(field(), ["husky"], [[0.0, 0.0, 0.4]], packs=False)
    one = np.ones(2)
    things = Bodies(
        np.array([900, 901], np.int32),
        np.full(2, OBJECT, np.int8),
        np.array([[0.2, 0.1, 0.4], [2.0, 0.8, 0.0]]),
        np.zeros(2),
        0.1 * one,
        0.1 * one,
        0.2 * one,
        np.zeros((2, 2)),
    )
    near = NearbyBodies(things, robots.bodies()).near(0, 5.0)
    assert near["x"].tolist() == [2.0]
    on_the_ground = things.where(np.array([0]))
    on_the_ground.position[0, 2] = robots.bodies().position[0, 2]
    assert len(NearbyBodies(on_the_ground, robots.bodies()).near(0, 5.0)) == 1
