"""Sun, darkness and weather of a step, as a frame holds them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.environment.environment import Sky

SKY_FIELDS = 16
_AIR = (
    "clouds",
    "rain",
    "snow",
    "visibility",
    "wind",
    "wind_from",
    "temperature",
    "wet",
    "snow_cover",
    "ice",
    "lamps",
)
_MINUTE = 60


class Skylight:
    """Tells where the sun stands over a run, and puts the weather beside it.

    Parameters
    ----------
    sky
        Over the run's world; None where that is not there: then nobody knows where the sun stands.
    """

    def __init__(self, sky: Sky | None) -> None:
        self.over = sky
        self._sun = lru_cache(maxsize=4096)(self._sun_at)

    def sky(self, time: float, air: Mapping[str, Any] | None) -> NDArray[np.float32]:
        """Return the sky of a step, float32, shape ``(16,)``; NaN for what is not known.

        Parameters
        ----------
        time
            Seconds since midnight of the first day.
        air
            Row of the table ``weather``; None in runs from before it.
        """
        found = np.full(SKY_FIELDS, np.nan, np.float32)
        found[:4] = self._sun(int(time))
        if air is not None:
            found[4 : 4 + len(_AIR)] = [air[key] for key in _AIR]
        found[15] = 0.0
        return found

    def _sun_at(self, second: int) -> tuple[float, float, float, float]:
        if self.over is None:
            return np.nan, np.nan, np.nan, np.nan
        x, y, z = self.over.sun(second).tolist()
        # As `vico.sim.environment.Environment.dark` has it: a minute at a time.
        return x, y, z, self.over.dark(second // _MINUTE * _MINUTE)
