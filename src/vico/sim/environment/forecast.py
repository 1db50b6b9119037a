"""What weather a run is to have: one kind all the time, a list of changes, or weather that changes by itself.

A forecast is fixed when a run begins, and any moment of it can be asked for without those before it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vico.clock import DAY, seconds_of_day
from vico.errors import InputError, SchemaError
from vico.io.data_files import DataRecord, record_of
from vico.seeds import rng
from vico.sim.environment.climate import usual_temperature
from vico.sim.environment.weather import NAMES, Weather, WeatherKind, blended, kind_of_weather, weather_kinds

#: The name of weather that changes by itself.
CHANGING = "changing"

# Changing weather stays between these hours, and takes this long to become another, seconds.
_LEAST_STAY, _MOST_STAY = 1.5, 5.0
_PASSING = 1200.0


@dataclass(frozen=True)
class WeatherSite:
    """Where and when a run is, as weather and sun need it.

    Attributes
    ----------
    lat, lon
        Degrees.
    day
        Day of the year on which the run starts, 1..366.
    """

    lat: float
    lon: float
    day: int

    def temperature(self, seconds: float) -> float:
        """Return the usual temperature some seconds after the first midnight, degrees Celsius."""
        return usual_temperature(self.lat, (self.day - 1 + int(seconds // DAY)) % 365 + 1, seconds % DAY)


class Forecast(Protocol):
    """The weather of a run, as it was asked for."""

    def at(self, seconds: float) -> NDArray[np.float64]:
        """Return the weather some seconds after the first midnight, as `Weather.array`."""


class Steady:
    """One kind of weather all the time; its temperature goes with the hour."""

    def __init__(self, kind: WeatherKind, site: WeatherSite) -> None:
        self._kind, self._site = kind, site

    def at(self, seconds: float) -> NDArray[np.float64]:
        """Return the weather at a moment."""
        return self._kind.weather(self._site.temperature(seconds)).array()


class Changing:
    """Weather that changes every few hours: kinds by how often they are, among those the season is warm enough for."""

    def __init__(self, site: WeatherSite, seed: int) -> None:
        self._site, self._seed = site, seed
        self._of_day = lru_cache(maxsize=8)(self._drawn)

    def at(self, seconds: float) -> NDArray[np.float64]:
        """Return the weather at a moment."""
        day, second = divmod(seconds, float(DAY))
        times, kinds, winds = self._of_day(int(day))
        k = int(np.searchsorted(times, second, side="right")) - 1
        temperature = self._site.temperature(seconds)
        now = kinds[k].weather(temperature, winds[k]).array()
        passed = (second - times[k]) / _PASSING
        if passed >= 1:
            return now
        if k > 0:
            before = kinds[k - 1].weather(temperature, winds[k - 1])
        else:
            _, kinds_before, winds_before = self._of_day(int(day) - 1) if day > 0 else ((), kinds, winds)
            before = kinds_before[-1 if day > 0 else 0].weather(temperature, winds_before[-1 if day > 0 else 0])
        return blended(before.array(), now, passed)

    def _drawn(self, day: int) -> tuple[NDArray[np.float64], list[WeatherKind], list[float]]:
        """Return when the weather of a day changes, seconds, to what, and where the wind comes from."""
        generator = rng(self._seed, "weather", day)
        noon = self._site.temperature(day * DAY + DAY / 2)
        possible = [k for k in weather_kinds().values() if k.coldest <= noon <= k.warmest and k.often > 0]
        shares = np.array([kind.often for kind in possible])
        times, kinds, winds = [], [], []
        second, wind = 0.0, float(generator.uniform(0.0, 360.0))
        # The last change of a day is over before midnight, where the next day's weather goes on from it.
        while second < DAY - _PASSING:
            times.append(second)
            kinds.append(possible[int(generator.choice(len(possible), p=shares / shares.sum()))])
            wind = (wind + float(generator.normal(0.0, 40.0))) % 360.0
            winds.append(wind)
            second += 3600.0 * float(generator.uniform(_LEAST_STAY, _MOST_STAY))
        return np.array(times), kinds, winds


class _Change(DataRecord):
    """A line of a weather file."""

    at: str
    day: int = Field(default=0, ge=0)
    over: float = Field(default=600.0, ge=0)
    kind: str = "clear"
    clouds: float | None = None
    rain: float | None = None
    snow: float | None = None
    visibility: float | None = None
    wind: float | None = None
    wind_from: float | None = None
    temperature: float | None = None


class _File(DataRecord):
    weather: tuple[_Change, ...] = Field(min_length=1)


class Planned:
    """Weather by a list of changes; before the first it is as after it.

    Parameters
    ----------
    changes
        In the order of time: when each begins (seconds after the first midnight), how long it takes (seconds), and
        the weather after it.
    """

    def __init__(self, changes: Sequence[tuple[float, float, Weather]]) -> None:
        self._begins = np.array([begin for begin, _, _ in changes])
        self._over = np.array([over for _, over, _ in changes])
        self._after = [weather.array() for _, _, weather in changes]

    def at(self, seconds: float) -> NDArray[np.float64]:
        """Return the weather at a moment."""
        k = int(np.searchsorted(self._begins, seconds, side="right")) - 1
        if k <= 0:
            return self._after[0].copy()
        gone = seconds - self._begins[k]
        if gone >= self._over[k]:
            return self._after[k].copy()
        return blended(self._after[k - 1], self._after[k], gone / self._over[k])


def planned(record: Mapping[str, Any], site: WeatherSite, *, source: str = "weather") -> Planned:
    """Return the weather that a weather file's content asks for; docs/weather.md describes it.

    Raises
    ------
    SchemaError
        If it is not of that form, or its changes are not in the order of time.
    InputError
        If it names a kind that is not known, or a number is out of range.
    """
    lines = record_of(record, _File, source=source, guide="docs/weather.md").weather
    changes: list[tuple[float, float, Weather]] = []
    for k, line in enumerate(lines):
        begin = float(line.day * DAY + seconds_of_day(line.at))
        if changes and begin < changes[-1][0] + changes[-1][1]:
            raise SchemaError(
                f"{source}: weather.{k}: begins before the change above it has ended; move it, or shorten `over`"
            )
        usual = kind_of_weather(line.kind).weather(site.temperature(begin))
        given = {name: value for name in NAMES if (value := getattr(line, name)) is not None}
        try:
            changes.append((begin, line.over, Weather(**({name: getattr(usual, name) for name in NAMES} | given))))
        except InputError as error:
            raise InputError(f"{source}: weather.{k}: {error}") from None
    return Planned(changes)


def forecast_of(wanted: str | Mapping[str, Any], site: WeatherSite, seed: int) -> Forecast:
    """Return the weather that a configuration asks for.

    Parameters
    ----------
    wanted
        A kind of weather, ``changing``, or the content of a weather file.

    Raises
    ------
    InputError
        If it is none of these.
    """
    if not isinstance(wanted, str):
        return planned(wanted, site)
    if wanted == CHANGING:
        return Changing(site, seed)
    if wanted not in weather_kinds():
        kinds = ", ".join(weather_kinds())
        raise InputError(
            f"weather: {wanted!r} is no kind of weather; take {CHANGING}, a weather file, or one of {kinds}"
        )
    return Steady(kind_of_weather(wanted), site)
