"""Which way pedestrians turn beside somebody whom they all but touch."""

from __future__ import annotations

import math

import numpy as np

from vico.sim.traffic.pedestrian_routes import FollowPoint
from vico.sim.traffic.pedestrians import best_heading, may_step_to
from vico.sim.traffic.shapes import Shapes

_RADIUS, _GAP = 0.25, 0.03


def test_beside_the_corner_of_a_tram_one_takes_a_heading_along_which_one_may_step() -> None:
    # A section of 8 m x 2.4 m whose rear left corner is at the origin; who stands just left of it is to go behind it.
    half_length, half_width = 4.0, 1.2
    fields = dict.fromkeys(Shapes._fields, np.zeros(1)) | {
        "x": np.array([half_length]),
        "y": np.array([-half_width]),
        "half_length": np.array([half_length]),
        "half_width": np.array([half_width]),
        "top": np.full(1, 3.5),
    }
    tram, x, y = Shapes(**fields), 0.01, _RADIUS + _GAP
    near = np.zeros(1, np.int64)
    for goal in ((-1.5, -0.9), (-0.8, -1.5), (-1.5, 0.1)):
        point = FollowPoint(*goal, *goal, 0.0, 1.0, (9.0, 9.0, 9.0, 9.0))
        facing = math.atan2(goal[1] - y, goal[0] - x)
        heading, free = best_heading(x, y, point, tram, near, True, facing)
        assert free > 0.2
        assert may_step_to(x + 0.04 * math.cos(heading), y + 0.04 * math.sin(heading), x, y, tram, near)
