"""Cyclists nobody plays: slim, slow vehicles that ride beside the kerb of the lanes that cars drive."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicles import BICYCLE_PAINTS, vehicle_size
from vico.errors import InputError
from vico.seeds import rng
from vico.sim.traffic.car_following import COMFORTABLE_BRAKING, TIME_GAP
from vico.sim.traffic.records import NONE
from vico.sim.traffic.vehicle_models import VEHICLE_MODELS
from vico.world.lanes import LaneGraph

#: Half a cyclist's width, and how high one reaches, metres.
HALF_WIDTH, HEIGHT = 0.3, 1.75

_SPEEDS = (3.6, 5.8)  # m/s that they like to ride
_ACCELERATION, _HARD_BRAKING = 0.9, 5.0  # m/s^2, on dry ground
_FROM_EDGE = 0.65  # m from a lane's edge to a cyclist's middle
_STRAIGHT = 0.3  # share of a stretch of lane that is left of it at the kerb, at least: bends are not turned inside out
_SHARPEST = 0.5  # cosine of half the angle at a corner beyond which corners are cut


def kerb_points(lanes: LaneGraph) -> NDArray[np.float64]:
    """Return the points of the lines that cyclists follow: the lanes' own, moved towards the kerb.

    Returns
    -------
    ndarray
        ENU metres, shape ``(points, 2)``.
    """
    points, count = lanes.points, len(lanes.points)
    if not count:
        return points
    owner = np.repeat(np.arange(len(lanes)), np.diff(lanes.first))
    stretch = np.diff(points, axis=0)
    joined = owner[1:] == owner[:-1]
    size = np.hypot(stretch[:, 0], stretch[:, 1])
    unit = np.where(joined[:, None], stretch / np.maximum(size, 1e-9)[:, None], 0.0)
    total = np.zeros((count, 2))
    total[:-1] += unit
    total[1:] += unit
    # Of two stretches that meet half the sum is as long as the cosine of half the angle between them.
    both = np.zeros(count, np.bool_)
    both[1:-1] = joined[:-1] & joined[1:]
    length = np.hypot(total[:, 0], total[:, 1])
    half_angle = np.where(both, np.maximum(length / 2, _SHARPEST), 1.0)
    along = total / np.maximum(length, 1e-9)[:, None]
    right = np.column_stack([along[:, 1], -along[:, 0]]) * (-1.0 if lanes.lefthand else 1.0)
    aside = np.maximum(lanes.width[owner] / 2 - _FROM_EDGE, 0.0) / half_angle
    for _ in range(12):
        moved = points + right * aside[:, None]
        left = (np.diff(moved, axis=0) * unit).sum(axis=1)
        folded = joined & (left < _STRAIGHT * size)
        if not folded.any():
            break
        aside[:-1][folded] *= 0.7
        aside[1:][folded] *= 0.7
    return np.asarray(points + right * aside[:, None], np.float64)


def equip_cyclists(fleet: np.recarray, seed: int) -> NDArray[np.int32]:
    """Give cyclists bicycles and the speeds they like.

    Parameters
    ----------
    fleet
        Their rows, dtype `vico.sim.traffic.records.VEHICLE`; their parameters are set.
    seed
        Decides paints and speeds.

    Returns
    -------
    ndarray
        Model of each one's bicycle, an index into `VEHICLE_MODELS`, int32.
    """
    random = rng(seed, "traffic", "cyclists")
    models = np.array([VEHICLE_MODELS.index(f"bicycle_{paint}") for paint in BICYCLE_PAINTS], np.int32)
    chosen = models[random.integers(len(models), size=len(fleet))]
    fleet.length, _, _, fleet.overhang, fleet.wheelbase = vehicle_size("bicycle")
    fleet.half_width, fleet.is_bicycle, fleet.route = HALF_WIDTH, True, NONE
    fleet.acceleration, fleet.hard_braking = _ACCELERATION, _HARD_BRAKING
    fleet.braking, fleet.time_gap, fleet.speed_factor = COMFORTABLE_BRAKING, TIME_GAP, 1.0
    fleet.target_speed = random.uniform(*_SPEEDS, len(fleet))
    return chosen


def starts_of_cyclists(
    lanes: LaneGraph, usable: NDArray[np.int64], count: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the lanes beside the kerb on which cyclists start, and how likely each is.

    Parameters
    ----------
    usable
        Lanes on which vehicles can start.
    count
        How many cyclists there are.

    Raises
    ------
    InputError
        If there are cyclists, but no lane for them.
    """
    kerb = usable[lanes.right[usable] < 0]
    if count and not len(kerb):
        raise InputError("traffic: the world has no street for cyclists; use --cyclists 0")
    return kerb, lanes.length[kerb] / max(float(lanes.length[kerb].sum()), 1e-9)
