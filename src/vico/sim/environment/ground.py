"""Water and snow on open ground: they gather while they fall, and go again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.sim.environment.weather import Weather

#: A film of water this deep is wet through; snow of this much water covers all; mm.
WET, COVERED = 0.3, 4.0

# Deeper water runs off, mm; it dries at this rate in still air of 15 degrees, mm/h, faster in warmth and wind.
_RUNS_OFF = 1.0
_DRIES = 0.25
# Snow melts by so many millimetres of water an hour for each degree above freezing: the degree-day factor of 4 mm a
# day of Hock, Temperature index melt modelling in mountain areas (2003).
_MELTS = 4.0 / 24.0
_MOST_SNOW = 400.0


def aged(water: float, snow: float, weather: Weather, seconds: float) -> tuple[float, float]:
    """Return how much water and snow lie on the ground some seconds later, mm of water.

    Parameters
    ----------
    water, snow
        What lies there now, mm of water.
    """
    hours = seconds / 3600.0
    snow = min(snow + weather.snow * hours, _MOST_SNOW)
    melted = min(snow, _MELTS * max(weather.temperature, 0.0) * hours)
    warmth = min(max((weather.temperature + 5.0) / 20.0, 0.1), 2.0)
    dried = _DRIES * warmth * (1.0 + weather.wind / 5.0) * hours if weather.rain == 0 and snow == 0 else 0.0
    water = min(max(water + weather.rain * hours + melted - dried, 0.0), _RUNS_OFF)
    return water, snow - melted


def settled(weather: Weather) -> NDArray[np.float64]:
    """Return what lies on the ground when it has been like this for three hours: water and snow, mm, shape ``(2,)``."""
    water = snow = 0.0
    for _ in range(18):
        water, snow = aged(water, snow, weather, 600.0)
    return np.array([water, snow])


def wetness(water: float) -> float:
    """Return how wet the ground is, 0..1."""
    return min(water / WET, 1.0)


def cover(snow: float) -> float:
    """Return the share of open ground under snow, 0..1."""
    return min(snow / COVERED, 1.0)
