"""How far robots may go before they come too near to somebody, and away from who is too near already."""

import numpy as np
import pytest

from vico.sim.robots.navigation import NEIGHBOUR, SIGHT, free_ahead

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
