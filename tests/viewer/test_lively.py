"""Where somebody starts who is to see the city."""

from __future__ import annotations

import numpy as np
import pytest

import toy_city
from vico.errors import InputError
from vico.viewer.play import busy_sidewalk_spot
from vico.world.walkable import SIDEWALK
from vico.world.world import World


def test_who_is_played_starts_on_a_sidewalk_with_doors_ahead_and_a_long_view(helsinki: World) -> None:
    x, y, yaw = busy_sidewalk_spot(helsinki)
    ways = helsinki.walkable
    assert ways.is_connected((x, y))
    assert ways.class_at((x, y)) == SIDEWALK
    assert max(abs(x), abs(y)) < 0.61 * helsinki.half
    doors = np.array([place.position[:2] for place in helsinki.places if place.entrance is not None]) - (x, y)
    ahead = doors @ (np.cos(yaw), np.sin(yaw))
    assert ((ahead > 5.0) & (ahead < 80.0) & (np.abs(doors @ (-np.sin(yaw), np.cos(yaw))) < 40.0)).sum() >= 5
    along = np.array([x, y]) + np.arange(1.0, 15.0)[:, None] * (np.cos(yaw), np.sin(yaw))
    assert (ways.class_at(along) > 0).all()
    assert busy_sidewalk_spot(helsinki) == (x, y, yaw)


def test_a_window_without_sidewalks_has_a_spot_too() -> None:
    x, y, _ = busy_sidewalk_spot(toy_city.world(), clearance=1.0)
    assert toy_city.world().walkable.clearance_of(x, y) >= 1.0


def test_no_free_ground_is_said() -> None:
    with pytest.raises(InputError, match="no free ground"):
        busy_sidewalk_spot(toy_city.world(), clearance=1e3)
