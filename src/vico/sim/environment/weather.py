"""What the weather is: a record of numbers, kinds of it by name, and how one passes into another."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vico.errors import InputError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

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
    for path in data_files("environment", "weather"):
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


def blended(before: NDArray[np.float64], after: NDArray[np.float64], share: float) -> NDArray[np.float64]:
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
