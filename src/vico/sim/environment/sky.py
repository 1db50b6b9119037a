"""Where sun and moon stand over a place on a date, and how dark it is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta

import numpy as np
from astral import Observer, moon, sun
from numpy.typing import NDArray

from vico.errors import InputError

# Sine of the sun's height between which day passes into night, as street lamps are switched.
_DAY, _NIGHT = math.sin(math.radians(2.0)), math.sin(math.radians(-6.0))
_LUNATION = 28.0  # astral's moon phases go from 0 to this
_MOST_OFFSET = 14.0


def first_date(text: str) -> date:
    """Read the date of a run's first day.

    Raises
    ------
    InputError
        If it is not of the form YYYY-MM-DD, or of the years 1900 to 2100.
    """
    try:
        day = date.fromisoformat(text)
    except ValueError:
        raise InputError(f"date: {text!r} is no date; write YYYY-MM-DD, for example 2026-06-21") from None
    if not 1900 <= day.year <= 2100:
        raise InputError(f"date: the year {day.year} is out of range; take 1900..2100")
    return day


@dataclass(frozen=True)
class Sky:
    """Sun and moon over a place.

    Attributes
    ----------
    lat, lon
        Degrees.
    first_day
        Date on which the run starts.
    utc_offset
        Hours that clocks there are ahead of UTC.
    """

    lat: float
    lon: float
    first_day: date
    utc_offset: float

    @classmethod
    def over(cls, lat: float, lon: float, first_day: str, utc_offset: float | None = None) -> Sky:
        """Return the sky over a place; without an offset, clocks show the time zone of 15 degrees it lies in.

        Raises
        ------
        InputError
            If the date is not of the form YYYY-MM-DD, or the offset is no time zone's.
        """
        day = first_date(first_day)
        if utc_offset is not None and not abs(utc_offset) <= _MOST_OFFSET:
            raise InputError(f"utc_offset: {utc_offset:g} hours; it has to be -14..14")
        return cls(lat, lon, day, float(round(lon / 15.0)) if utc_offset is None else utc_offset)

    @property
    def day_of_year(self) -> int:
        """Number of the first day in its year, 1..366."""
        return self.first_day.timetuple().tm_yday

    def _moment(self, seconds: float) -> tuple[Observer, datetime]:
        midnight = datetime(self.first_day.year, self.first_day.month, self.first_day.day, tzinfo=UTC)
        return Observer(self.lat, self.lon), midnight + timedelta(seconds=seconds, hours=-self.utc_offset)

    def sun(self, seconds: float) -> NDArray[np.float64]:
        """Return the unit vector to the sun, ENU, some seconds after the first midnight, shape ``(3,)``."""
        observer, when = self._moment(seconds)
        return _direction(sun.azimuth(observer, when), sun.elevation(observer, when, with_refraction=False))

    def moon(self, seconds: float) -> NDArray[np.float64]:
        """Return the unit vector to the moon, ENU, shape ``(3,)``."""
        observer, when = self._moment(seconds)
        return _direction(moon.azimuth(observer, when), moon.elevation(observer, when))

    def moon_lit(self, seconds: float) -> float:
        """Return the share of the moon's disc that is lit, 0..1."""
        _, when = self._moment(seconds)
        return (1.0 - math.cos(2.0 * math.pi * moon.phase(when.date()) / _LUNATION)) / 2.0

    def dark(self, seconds: float) -> float:
        """Return how dark it is: 0 by day, 1 from the end of civil twilight."""
        share = (_DAY - float(self.sun(seconds)[2])) / (_DAY - _NIGHT)
        return min(max(share, 0.0), 1.0)


def _direction(azimuth: float, elevation: float) -> NDArray[np.float64]:
    a, e = math.radians(azimuth), math.radians(elevation)
    return np.array([math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e)])
