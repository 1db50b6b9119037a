"""The weather of a run: records of it, kinds by name, forecasts, and what lies on the ground.

A forecast is one kind all the time, a list of changes, or weather that changes by itself. It is fixed when a run
begins, and any moment of it can be asked for without those before it. Water, snow and ice gather on open ground while
it falls or freezes, and go again.

How warm a place usually is follows from latitude, day of the year and hour: the mean of the year falls from 27 degrees
in the tropics by 0.52 for every degree of latitude beyond 20, and to either side of it the year swings by 0.2 for every
degree of latitude beyond 5: Helsinki (60.2 N) has -5 in January and 17 in July, Singapore 27 all year. Seas and
mountains are left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Annotated, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vico.clock import DAY, seconds_of_day
from vico.errors import InputError, SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record, record_of
from vico.seeds import rng

_GUIDE = "docs/weather.md"


@dataclass(frozen=True, kw_only=True)
class Weather:
    """The weather of a moment, the same everywhere in a world.

    Attributes
    ----------
    clouds
        Share of the sky, 0..1.
    rain, snow
        Water that falls, mm/h.
    visibility
        Meteorological visibility, metres: the distance at which contrast has gone down to 5 %.
    wind
        Mean speed 10 m above ground, m/s.
    wind_from
        Where the wind comes from, degrees clockwise from north.
    temperature
        Of the air, degrees Celsius.
    """

    clouds: float = 0.0
    rain: float = 0.0
    snow: float = 0.0
    visibility: float = 20_000.0
    wind: float = 0.0
    wind_from: float = 240.0
    temperature: float = 15.0

    def __post_init__(self) -> None:
        for name, (low, high, unit) in _BOUNDS.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(f"weather: {name} is {value:g} {unit}; it has to be {low:g}..{high:g}")

    def array(self) -> NDArray[np.float64]:
        """Return the fields in their order, float64, shape ``(7,)``."""
        return np.array([getattr(self, name) for name in NAMES])

    @classmethod
    def of(cls, values: NDArray[np.float64]) -> Weather:
        """Return the weather that `array` described."""
        return cls(**dict(zip(NAMES, values.tolist(), strict=True)))

    @property
    def wind_vector(self) -> tuple[float, float]:
        """How fast the air moves towards east and towards north, m/s."""
        towards = math.radians(self.wind_from + 180.0)
        return self.wind * math.sin(towards), self.wind * math.cos(towards)

    def record(self) -> dict[str, float]:
        """Return the fields by name, rounded for people to read."""
        return {name: round(getattr(self, name), 3) for name in NAMES}


_BOUNDS = {
    "clouds": (0.0, 1.0, "of the sky"),
    "rain": (0.0, 200.0, "mm/h"),
    "snow": (0.0, 50.0, "mm/h"),
    "visibility": (5.0, 100_000.0, "m"),
    "wind": (0.0, 60.0, "m/s"),
    "wind_from": (0.0, 360.0, "degrees"),
    "temperature": (-60.0, 60.0, "degrees Celsius"),
}
#: The fields of `Weather`, in their order.
NAMES = tuple(field.name for field in fields(Weather))

Share = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[float, Field(ge=0)]


class WeatherKind(DataRecord):
    """A kind of weather, as data files name it; see `Weather` for the units.

    Attributes
    ----------
    often
        How often changing weather is like this, relative to the other kinds.
    coldest, warmest
        Air temperatures between which it occurs, degrees Celsius.
    """

    clouds: Share = 0.0
    rain: NotNegative = 0.0
    snow: NotNegative = 0.0
    visibility: Annotated[float, Field(ge=5)] = 20_000.0
    wind: NotNegative = 0.0
    often: NotNegative = 1.0
    coldest: float = -60.0
    warmest: float = 60.0

    def weather(self, temperature: float, wind_from: float = 240.0) -> Weather:
        """Return weather of this kind, as cold or warm as it may be if the air is not that cold or warm."""
        return Weather(
            clouds=self.clouds,
            rain=self.rain,
            snow=self.snow,
            visibility=self.visibility,
            wind=self.wind,
            wind_from=wind_from,
            temperature=min(max(temperature, self.coldest), self.warmest),
        )


class _Kinds(DataRecord):
    weather: dict[str, WeatherKind]


@cached_data
def weather_kinds() -> dict[str, WeatherKind]:
    """Return the kinds of weather by name, in the order of their data files.

    Raises
    ------
    SchemaError
        If a data file is not as docs/weather.md says.
    """
    found: dict[str, WeatherKind] = {}
    for path in data_files("sim/environment", "weather"):
        found |= read_record(path, _Kinds, guide=_GUIDE).weather
    return found


def kind_of_weather(name: str) -> WeatherKind:
    """Return a kind of weather by its name.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    kinds = weather_kinds()
    if name not in kinds:
        raise InputError(f"weather: no kind is called {name!r}; there are {', '.join(kinds)}")
    return kinds[name]


def blend_weather(before: NDArray[np.float64], after: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Return the weather on the way from one to another, as arrays.

    What mixes of visibility is the extinction, its inverse; the wind turns the shorter way.
    """
    mixed = before + (after - before) * share
    k = NAMES.index("visibility")
    mixed[k] = 1.0 / (1.0 / before[k] + (1.0 / after[k] - 1.0 / before[k]) * share)
    k = NAMES.index("wind_from")
    turn = (after[k] - before[k] + 180.0) % 360.0 - 180.0
    mixed[k] = (before[k] + turn * share) % 360.0
    return mixed


_WARMEST_DAY = 201  # of the year, north of the equator; a month after the solstice
_WARMEST_HOUR = 15.0
_DAY_SWING = 4.0  # degrees to either side of the day's mean


def usual_temperature(lat: float, day: int, seconds_of_day: float) -> float:
    """Return the usual temperature of the air, degrees Celsius.

    Parameters
    ----------
    lat
        Latitude, degrees.
    day
        Day of the year, 1..366.
    seconds_of_day
        Since midnight.
    """
    mean = 27.0 - 0.52 * max(abs(lat) - 20.0, 0.0)
    swing = 0.2 * max(abs(lat) - 5.0, 0.0)
    season = math.cos(2 * math.pi * (day - _WARMEST_DAY) / 365.25) * (1 if lat >= 0 else -1)
    hour = math.cos(2 * math.pi * (seconds_of_day / 3600.0 - _WARMEST_HOUR) / 24.0)
    return mean + swing * season + _DAY_SWING * hour


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


def advance_ground(ground: Ground, weather: Weather, seconds: float) -> Ground:
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


def steady_ground(weather: Weather) -> Ground:
    """Return what lies on the ground when it has been like this for three hours."""
    ground = Ground()
    for _ in range(18):
        ground = advance_ground(ground, weather, 600.0)
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
        self._of_day = lru_cache(maxsize=8)(self._draw_day)

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
        return blend_weather(before.array(), now, passed)

    def _draw_day(self, day: int) -> tuple[NDArray[np.float64], list[WeatherKind], list[float]]:
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
        return blend_weather(self._after[k - 1], self._after[k], gone / self._over[k])


def planned_weather(record: Mapping[str, Any], site: WeatherSite, *, source: str = "weather") -> Planned:
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
        return planned_weather(wanted, site)
    if wanted == CHANGING:
        return Changing(site, seed)
    if wanted not in weather_kinds():
        kinds = ", ".join(weather_kinds())
        raise InputError(
            f"weather: {wanted!r} is no kind of weather; take {CHANGING}, a weather file, or one of {kinds}"
        )
    return Steady(kind_of_weather(wanted), site)
