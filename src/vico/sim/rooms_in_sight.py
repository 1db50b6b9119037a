"""Which rooms of a part of a city can be seen: bodies of those who are in others need not be made.

Rooms lie below the ground (docs/formats.md), and open only to rooms of the same place. A camera sees into
those of the place that it is in, and through panes into those of shops.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.render.behind.fronts import OPEN_TO_SIGHT
from vico.sim.indoor import Indoor
from vico.sim.scene_part import ScenePart

# Metres a camera may be outside the walls of its room (in a doorway), below the floor, and above it (on stairs).
_BESIDE, _BELOW, _ABOVE = 1.0, 1.0, 8.0


class RoomsInSight:
    """Says which of a city's rooms may be seen.

    Parameters
    ----------
    indoor
        All rooms of the city.
    part
        The part of it that is looked at.
    """

    def __init__(self, indoor: Indoor, part: ScenePart) -> None:
        self.part = part
        self._here = np.asarray(part.world.room_numbers, np.int64)
        self._boxes, self._floor, self._place = indoor.boxes[self._here], indoor.floor[self._here], indoor.place
        is_open = np.array([place.category in OPEN_TO_SIGHT for place in part.world.whole.places], np.bool_)
        # Of what belongs to no place nobody knows who sees it.
        self._always = np.append(is_open, True)[indoor.place]

    def seen_from(self, eyes: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which of the city's rooms may be seen by agents' cameras at some points, ENU metres, ``(k, 3)``."""
        x, y, yaw, along, across = self._boxes.T
        c, s = np.cos(yaw), np.sin(yaw)
        places: set[int] = set()
        for eye in eyes:
            dx, dy, up = eye[0] - x, eye[1] - y, eye[2] - self._floor
            around = (np.abs(c * dx + s * dy) <= along + _BESIDE) & (np.abs(c * dy - s * dx) <= across + _BESIDE)
            around &= (up > -_BELOW) & (up < _ABOVE)
            places |= set(self._place[self._here[around]].tolist())
        return self._always | np.isin(self._place, sorted(places))
