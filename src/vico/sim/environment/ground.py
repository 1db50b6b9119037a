"""Water, snow and ice on open ground: they gather while it falls or freezes, and go again."""

from __future__ import annotations

from typing import NamedTuple

from vico.sim.environment.weather import Weather

#: A film of water this deep is wet through, ice this thick leaves no grip, snow of this much water covers all; mm.
WET, ICED, COVERED = 0.3, 0.3, 4.0

# Deeper water runs off, mm; it dries at this rate in still air of 15 degrees, mm/h, faster in warmth and wind.
_RUNS_OFF = 1.0
_DRIES = 0.25
# Snow and ice melt by so many millimetres of water an hour for each degree above freezing: the degree-day factor of
# 4 mm a day of Hock, Temperature index melt modelling in mountain areas (2003). A wet road freezes at that rate for
# each degree below: 15 W/m^2 a degree from surface to air, as on a still night, are 0.16 mm of ice an hour.
_MELTS = 4.0 / 24.0
_MOST_SNOW, _MOST_ICE = 400.0, 20.0


class Ground(NamedTuple):
    """What lies on open ground, mm of water: `water`, `snow` and `ice`."""

    water: float = 0.0
    snow: float = 0.0
    ice: float = 0.0


def aged(ground: Ground, weather: Weather, seconds: float) -> Ground:
    """Return what lies on the ground some seconds later; rain that falls below zero freezes where it falls."""
    hours = seconds / 3600.0
    warm, cold = max(weather.temperature, 0.0), max(-weather.temperature, 0.0)
    rain = weather.rain * hours
    snow = min(ground.snow + weather.snow * hours, _MOST_SNOW)
    frozen = rain + min(ground.water, _MELTS * cold * hours) if cold else 0.0
    ice = min(ground.ice + frozen, _MOST_ICE)
    melted_snow, melted_ice = (min(depth, _MELTS * warm * hours) for depth in (snow, ice))
    warmth = min(max((weather.temperature + 5.0) / 20.0, 0.1), 2.0)
    dries = weather.rain == 0 and snow == 0 and ice == 0
    dried = _DRIES * warmth * (1.0 + weather.wind / 5.0) * hours if dries else 0.0
    water = min(max(ground.water + rain - frozen + melted_snow + melted_ice - dried, 0.0), _RUNS_OFF)
    return Ground(water, snow - melted_snow, ice - melted_ice)


def settled(weather: Weather) -> Ground:
    """Return what lies on the ground when it has been like this for three hours."""
    ground = Ground()
    for _ in range(18):
        ground = aged(ground, weather, 600.0)
    return ground


def wetness(water: float) -> float:
    """Return how wet the ground is, 0..1."""
    return min(water / WET, 1.0)


def cover(snow: float) -> float:
    """Return the share of open ground under snow, 0..1."""
    return min(snow / COVERED, 1.0)


def iciness(ice: float) -> float:
    """Return the share of open ground under ice, 0..1."""
    return min(ice / ICED, 1.0)
