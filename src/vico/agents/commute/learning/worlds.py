"""Training cities from public maps."""

from __future__ import annotations

import numpy as np

from vico.agents.commute.learning.city import city_arrays
from vico.agents.commute.learning.env import TrainingCity
from vico.rules import BUS_DWELL
from vico.world.public import PublicMap
from vico.world.walkable import OPEN, SIDEWALK

# Room that starts have around them, metres.
_ROOM = 0.5


def training_city(public_map: PublicMap) -> TrainingCity:
    """Return a city to train in: goals are the places one can reach, starts sidewalks and squares."""
    walkable = public_map.walkable
    points = np.array([place.position[:2] for place in public_map.places], np.float64).reshape(-1, 2)
    free = walkable.connected & np.isin(walkable.cls, (OPEN, SIDEWALK)) & (walkable.clearance >= _ROOM)
    rows, columns = np.nonzero(free)
    starts = walkable.centre_of(np.column_stack([columns, rows]))
    return TrainingCity(city_arrays(public_map, dwell=BUS_DWELL), points[walkable.is_connected(points)], starts)
