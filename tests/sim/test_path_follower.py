"""A robot on its way knows when it gets no further."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vico.assets.robots import robot_model
from vico.sim.physics.records import Base
from vico.sim.robots.path_following import NEIGHBOUR, PathFollower

NOBODY = np.zeros(0, NEIGHBOUR)
DT = 0.1


def base(x: float, yaw: float, speed: float) -> Base:
    c, s = math.cos(yaw), math.sin(yaw)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    there, velocity = np.array([x, 0.0, 0.0]), np.array([speed, 0.0, 0.0])
    return Base(there, turned, velocity, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


def follower() -> PathFollower:
    found = PathFollower(robot_model("husky"))
    found.begin(np.array([[0.0, 0.0], [20.0, 0.0]]))
    return found


def seconds_until_it_backs_off(one: PathFollower, *, rocks: float, goes: float = 0.0) -> float:
    """Try for ten seconds: the base rocks by so much, at 0.3 m/s to and fro, and goes on at a speed, m/s."""
    for step in range(100):
        side = 1.0 if step % 2 else -1.0
        if one.steer(base(goes * step * DT + side * rocks, 0.0, 0.3 * side), NOBODY, DT)[0] < 0.0:
            return step * DT
    return math.inf


@pytest.mark.parametrize("rocks", [0.0, 0.03])
def test_who_rocks_against_a_kerb_backs_off_as_who_stands_before_a_wall(rocks: float) -> None:
    one = follower()
    assert 2.0 < seconds_until_it_backs_off(one, rocks=rocks) < 4.0
    again = follower()
    again.restore(one.path, np.array(one.numbers()))
    assert again.numbers() == one.numbers()


def seconds_of_turning_until_it_backs_off(*, most: float) -> float:
    """Turn in place at 0.4 rad/s for 20 seconds: to and fro by `most` radians; the way leads straight on."""
    one, yaw, speed = follower(), 0.0, 0.4
    for step in range(200):
        yaw += speed * DT
        speed = -speed if abs(yaw) > most else speed
        if one.steer(base(0.0, yaw, 0.0), NOBODY, DT)[0] < 0.0:
            return step * DT
    return math.inf


def test_who_turns_to_and_fro_before_a_kerb_backs_off() -> None:
    assert 2.0 < seconds_of_turning_until_it_backs_off(most=0.3) < 6.0


def test_who_turns_about_does_not_before_it_is_round() -> None:
    assert math.pi / 0.4 < seconds_of_turning_until_it_backs_off(most=math.inf)


def test_who_goes_on_slowly_does_not() -> None:
    assert seconds_until_it_backs_off(follower(), rocks=0.02, goes=0.1) == math.inf
