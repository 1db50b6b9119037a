"""Walking on: who goes straight to a corner, with nothing on the way to decide, is found in arrays.

The rules are those of `vico.agents.wayfinding.Walker`; whoever is near the bounds of one of them is to be asked.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.stays import RUN, SLACK, SLACK_SHARE, WALK
from vico.rules import walk_speed
from vico.world.walkable import CROSSING, ROADWAY, WalkableMap

#: Corners count as passed this close, metres.
CORNER = 0.35
#: Off the line by more than this after a step means turning first, metres; where there is no more room than `NARROW`
#: metres anywhere along the step, by more than `NARROW_DRIFT`.
DRIFT, NARROW, NARROW_DRIFT = 0.12, 0.6, 0.03
#: Shares of a step at which the room to walls is looked at.
ALONG = (0.0, 0.25, 0.5, 0.75, 1.0)
#: Surfaces that are not stepped on without a look for vehicles.
ROAD = (ROADWAY, CROSSING)

# Sines and roots may differ by less than this between one and many, metres.
_MARGIN = 1e-6


class Stride(NamedTuple):
    """What somebody on a straight way goes on with, outdoors and on foot.

    Attributes
    ----------
    x, y
        The corner ahead, ENU metres.
    left
        From the corner to the end of the way, metres.
    pace
        Metres a second; NaN: as the time left until `due` asks for.
    due
        When to be there, second of the day.
    ease, haste
        Pace with time to spare, and when late, metres a second.
    place_x, place_y, least, most
        A point, ENU metres, and between which distances from it nothing changes, metres.
    """

    x: float
    y: float
    left: float
    pace: float
    due: float
    ease: float
    haste: float
    place_x: float
    place_y: float
    least: float
    most: float


def stride_lengths(
    strides: NDArray[np.float64], pose: NDArray[np.float64], second: float, walkable: WalkableMap
) -> NDArray[np.float64]:
    """Return how far ahead each of some walkers goes in the coming second, metres; NaN for those with a decision.

    Parameters
    ----------
    strides
        Rows of `Stride`, shape ``(n, 11)``.
    pose
        As observations have it, shape ``(n, 6)``.
    second
        Of the day.
    """
    corner_x, corner_y, left, pace, due, ease, haste, place_x, place_y, least, most = strides.T
    x, y, heading_x, heading_y = pose[:, 0], pose[:, 1], pose[:, 3], pose[:, 4]
    east, north = corner_x - x, corner_y - y
    away = np.sqrt(east * east + north * north)
    speed = np.where(np.isnan(pace), _paces(away + left, due - second, ease, haste), pace)
    far = np.hypot(x - place_x, y - place_y)
    goes = (away > np.maximum(speed, CORNER) + _MARGIN) & (far > least + _MARGIN) & (far < most - _MARGIN)
    scale = 1.0 / np.maximum(away, 1e-9)
    aside = speed * np.abs(heading_x * north - heading_y * east) * scale / np.hypot(heading_x, heading_y)
    position = np.column_stack([x, y])
    room = walkable.clearance_at(position)
    norm = speed / np.hypot(heading_x, heading_y)
    for share in ALONG[1:]:
        step = np.column_stack([x + share * norm * heading_x, y + share * norm * heading_y])
        room = np.minimum(room, walkable.clearance_at(step))
    allowed = np.where(room > NARROW + _MARGIN, DRIFT, NARROW_DRIFT)
    goes &= (aside < allowed - _MARGIN) & (heading_x * east + heading_y * north > 0.0)
    ahead = np.column_stack([x + east * scale, y + north * scale])
    goes &= np.isin(walkable.class_at(position), ROAD) | ~np.isin(walkable.class_at(ahead), ROAD)
    return np.where(goes, speed, np.nan)


def paces_of(age: float) -> tuple[float, float]:
    """Return how fast somebody goes who has time, and who is late, metres a second."""
    ease = walk_speed(age)
    # Past sixty people run less and less, and past ninety they walk quickly at most.
    slower = min(max((age - 60.0) / 30.0, 0.0), 1.0)
    return ease, RUN + (1.25 * ease - RUN) * slower


def pace_in_time(metres: float, seconds: float, ease: float = WALK, haste: float = RUN) -> float:
    """Return how fast to walk, m/s: at ease while there is time, briskly when it gets short, and to run when late."""
    return min(haste, max(ease, metres * (1.0 + SLACK_SHARE) / max(1.0, seconds - SLACK)))


def _paces(
    metres: NDArray[np.float64], seconds: NDArray[np.float64], ease: NDArray[np.float64], haste: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the same as `pace_in_time`, to the last bit, for many."""
    needed = metres * (1.0 + SLACK_SHARE) / np.maximum(1.0, seconds - SLACK)
    return np.asarray(np.minimum(haste, np.maximum(ease, needed)), np.float64)
