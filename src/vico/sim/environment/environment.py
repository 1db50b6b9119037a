"""Outdoor conditions, the same for everybody: weather, the ground's state, sun and lamps, and their effects.

`conditions` says how far people see, how well vehicles brake and how fast they go; each is one function of the weather
and the dark, so that whoever moves or looks asks for the same figure. `Sky` says where sun and moon stand over a place
on a date.

References
----------
Bosch Automotive Handbook, tyre grip at 50 km/h, new to worn tyres: dry 0.85-1.0, wet 0.65-0.5, heavy rain 0.55-0.4, ice
0.1 and less.
Wallman and Astrom: Friction measurement methods and the correlation between road friction and traffic safety, VTI
meddelande 911A (2001): friction 0.8-1.0 on dry roads, 0.2-0.3 on packed snow, 0.1-0.2 on ice.
US Federal Highway Administration, Road Weather Management Program: average speeds fall by 3-13 % in light rain or snow,
3-16 % in heavy rain, 5-40 % in heavy snow, 10-12 % in low visibility.
How much wider drivers' gaps get, and how much slower people walk and ride on snow and ice, are assumptions of ours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from astral import Observer, moon, sun
from numpy.typing import NDArray

from vico.errors import InputError
from vico.rules import walking_factor
from vico.sim.environment.agenda import Agenda
from vico.sim.environment.city_events import CityEvent, Region
from vico.sim.environment.weather import (
    NAMES,
    Forecast,
    Ground,
    Weather,
    WeatherSite,
    advance_ground,
    blend_weather,
    cover,
    forecast_of,
    iciness,
    kind_of_weather,
    steady_ground,
    wetness,
)

#: How far anybody is noticed by daylight in clear air, metres.
CLEAR_SIGHT = 40.0

# Friction of tyres on the ground.
_DRY = 0.9
_WET = 0.55
_SNOW = 0.25
_ICE = 0.1
_GRAVITY = 9.81  # m/s²
# Bodies are told from what is behind them as far as this share of meteorological visibility.
_NOTICED = 0.4
# In the dark, people are noticed this far off where no lamps are lit, metres.
_UNLIT_SIGHT = 15.0
# ... and in rooms without a lamp, to which little of the night comes in.
_DARK_ROOM_SIGHT = 3.0
_LAMPLIT = 0.75  # of the sight by day, where lamps are lit
_REACTION = 1.0  # s
# Half of a car's weight is on its driven wheels, and drivers use this share of what these can do.
_DRIVEN, _USED = 0.5, 0.7
_SLOWEST = 0.5  # of the usual speed, in the worst weather


class Conditions(NamedTuple):
    """What it is like outdoors, for whoever moves or looks there.

    Attributes
    ----------
    sight
        How far bodies are noticed, metres.
    friction
        Between tyres or soles and the ground.
    braking
        Factor on comfortable braking, 0..1.
    hard_braking
        The most a vehicle can brake, m/s^2.
    traction
        The most a vehicle speeds up, m/s^2.
    time_gap
        Factor on the time that drivers keep behind another vehicle, 1 or more.
    driving
        Factor on the speed people drive at, 0..1.
    safe_speed
        Speed from which a driver stops within what he sees, m/s.
    walking
        Factor on the speed people walk at, 0..1.
    cycling
        Factor on the speed people ride a bicycle at, 0..1.
    """

    sight: float
    friction: float
    braking: float
    hard_braking: float
    traction: float
    time_gap: float
    driving: float
    safe_speed: float
    walking: float
    cycling: float

    @property
    def grip(self) -> float:
        """Friction as a share of that on dry ground."""
        return self.friction / _DRY


def sight_in_unlit_room(dark: float) -> float:
    """Return how far off anybody is noticed in a room whose lamps are out, metres; `dark`: 0 by day, 1 at night."""
    return CLEAR_SIGHT + (_DARK_ROOM_SIGHT - CLEAR_SIGHT) * dark


def conditions(
    *,
    rain: float,
    snowfall: float,
    visibility: float,
    wet: float,
    cover: float,
    ice: float,
    dark: float,
    lamps: float,
) -> Conditions:
    """Return the conditions outdoors.

    Parameters
    ----------
    rain, snowfall
        Water that falls, mm/h.
    visibility
        Meteorological visibility, metres.
    wet, cover, ice
        How wet the ground is, and how far under snow and ice, 0..1.
    dark
        0 by day, 1 at night.
    lamps
        Share of the street lamps that are lit when it is dark, 0..1.
    """
    friction = ((_DRY + (_WET - _DRY) * wet) * (1 - cover) + _SNOW * cover) * (1 - ice) + _ICE * ice
    by_night = _UNLIT_SIGHT / CLEAR_SIGHT + (_LAMPLIT - _UNLIT_SIGHT / CLEAR_SIGHT) * lamps
    sight = min(CLEAR_SIGHT, _NOTICED * visibility) * (1 + (by_night - 1) * dark)
    hard = min(8.0, friction * _GRAVITY)
    # Drivers see vehicles and their lamps as far as the air lets them; they keep what they need to stop.
    seen = visibility * (1.0 if dark < 0.5 else 0.8)
    safe = hard * (math.sqrt(_REACTION**2 + 2 * seen / hard) - _REACTION)
    slower = 0.12 * min(rain / 8.0, 1.0) + 0.12 * min(snowfall / 2.0, 1.0) + 0.20 * cover
    slower += 0.11 * min(max((400.0 - visibility) / 200.0, 0.0), 1.0) + 0.30 * ice
    braking = min(friction / _DRY * 1.5, 1.0)
    return Conditions(
        sight=sight,
        friction=friction,
        braking=braking,
        hard_braking=hard,
        traction=_DRIVEN * _USED * friction * _GRAVITY,
        time_gap=1.0 + 0.5 * (1.0 - braking),
        driving=max(1.0 - slower, _SLOWEST),
        safe_speed=safe,
        walking=walking_factor(cover, ice),
        cycling=1.0 - max(0.25 * cover, 0.40 * ice, 0.05 * min(rain / 8.0, 1.0)),
    )


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


# What lies on the ground is reckoned anew this often, and the sun looked at, seconds.
_AGES_EVERY = 60


class Environment:
    """Weather, ground, light and events of a run; part of its state.

    Parameters
    ----------
    sky
        Over the world.
    wanted
        The weather that is asked for; see `forecast_of`.
    seed
        Decides weather that changes by itself.
    second
        Seconds since midnight of the first day; the ground is as it would be after hours of the weather then.
    agenda
        The run's events.

    Attributes
    ----------
    sky, agenda
        Those.
    """

    def __init__(self, sky: Sky, wanted: str | Mapping[str, Any], *, seed: int, second: float, agenda: Agenda) -> None:
        self.sky, self.agenda = sky, agenda
        self._forecast: Forecast = forecast_of(wanted, WeatherSite(sky.lat, sky.lon, sky.day_of_year), seed)
        # When a change that was called for begins and ends, and the weather before and after it; none: never.
        self._change = np.full(2, np.inf)
        self._before_after = np.zeros((2, len(NAMES)))
        self._ground = np.array(steady_ground(Weather.of(self._forecast.at(second))))
        self._lamps = np.ones(1)
        self._second = np.array([second])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future."""
        return {
            "second": self._second,
            "change": self._change,
            "before_after": self._before_after,
            "ground": self._ground,
            "lamps": self._lamps,
            **self.agenda.arrays(),
        }

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        for array, name in (
            (self._second, "second"),
            (self._change, "change"),
            (self._before_after, "before_after"),
            (self._ground, "ground"),
            (self._lamps, "lamps"),
        ):
            array[:] = arrays[name]
        self.agenda.restore(arrays, float(self._second[0]))
        self._forget()

    def advance(self, seconds: float) -> None:
        """Go on by some seconds; the ground gets wet or dry every minute, and events begin and end."""
        before = int(self._second[0])
        self._second += seconds
        for _ in range(int(self._second[0]) // _AGES_EVERY - before // _AGES_EVERY):
            self._ground[:] = advance_ground(Ground(*self._ground.tolist()), self.weather, _AGES_EVERY)
        self._forget()
        self.agenda.advance(float(self._second[0]))

    # What it is like.

    @cached_property
    def weather(self) -> Weather:
        """The weather now."""
        now = float(self._second[0])
        begin, end = self._change.tolist()
        if now < begin:
            return Weather.of(self._forecast.at(now))
        share = 1.0 if now >= end else (now - begin) / (end - begin)
        return Weather.of(blend_weather(self._before_after[0], self._before_after[1], share))

    def rain_within(self, ahead: Sequence[float]) -> float:
        """Return the most rain now and at some moments ahead, seconds, as far as it is forecast, mm/h."""
        now = float(self._second[0])
        return max(self.weather.rain, *(Weather.of(self._forecast.at(now + seconds)).rain for seconds in ahead))

    @property
    def wet(self) -> float:
        """How wet open ground is, 0..1."""
        return wetness(float(self._ground[0]))

    @property
    def snow_cover(self) -> float:
        """Share of open ground under snow, 0..1."""
        return cover(float(self._ground[1]))

    @property
    def ice(self) -> float:
        """Share of open ground under ice, 0..1."""
        return iciness(float(self._ground[2]))

    @property
    def lamps(self) -> float:
        """Share of the lamps that are lit when it is dark, 0..1."""
        return float(self._lamps[0])

    @cached_property
    def dark(self) -> float:
        """How dark it is outdoors: 0 by day, 1 at night."""
        return self.sky.dark(float(self._second[0]) // _AGES_EVERY * _AGES_EVERY)

    @cached_property
    def conditions(self) -> Conditions:
        """What it is like for whoever moves or looks outdoors."""
        return self._conditions(self.lamps)

    def _conditions(self, lamps: float) -> Conditions:
        weather = self.weather
        return conditions(
            rain=weather.rain,
            snowfall=weather.snow,
            visibility=weather.visibility,
            wet=self.wet,
            cover=self.snow_cover,
            ice=self.ice,
            dark=self.dark,
            lamps=lamps,
        )

    def has_power(self, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return whether lamps can be lit at some points, ENU metres, shape ``(n, >= 2)``."""
        powered = np.full(len(xy), self.lamps > 0.0)
        for x, y, radius in self.agenda.effects.dark:
            powered &= np.hypot(xy[:, 0] - x, xy[:, 1] - y) > radius
        return powered

    def sight_of(
        self, points: NDArray[np.float64], indoors: NDArray[np.bool_] | None = None
    ) -> float | NDArray[np.float64]:
        """Return how far off what is at some points (ENU metres, shape ``(n, 3)``) is noticed, metres.

        One for all, unless lamps are out somewhere. `indoors` says which points are in rooms, shape ``(n,)``; in those
        it is pitch-dark at night when the power is cut.
        """
        dark = self.agenda.effects.dark
        if not dark:
            return self.conditions.sight
        unlit = np.any([np.hypot(points[:, 0] - x, points[:, 1] - y) <= radius for x, y, radius in dark], axis=0)
        sight = np.where(unlit, self._conditions(0.0).sight, self.conditions.sight)
        if indoors is not None:
            sight[unlit & indoors] = sight_in_unlit_room(self.dark)
        return sight

    def record(self) -> dict[str, Any]:
        """Return what anybody outdoors notices: the weather, the ground, and how dark it is."""
        return {
            **self.weather.record(),
            "wet": round(self.wet, 3),
            "snow_cover": round(self.snow_cover, 3),
            "ice": round(self.ice, 3),
            "dark": round(self.dark, 3),
        }

    # What can be called for while a run goes on.

    def change_weather(self, wanted: str | Weather, *, over: float = 300.0) -> None:
        """Let the weather become another, and stay so, instead of what the forecast says.

        Parameters
        ----------
        wanted
            A kind of weather, or the weather itself.
        over
            How long that takes, seconds.

        Raises
        ------
        InputError
            If no kind is called so, or the time is negative.
        """
        if not over >= 0:
            raise InputError(f"weather: a change over {over} s; it has to be 0 or more")
        now = self.weather
        after = kind_of_weather(wanted).weather(now.temperature, now.wind_from) if isinstance(wanted, str) else wanted
        self._before_after[:] = now.array(), after.array()
        self._change[:] = float(self._second[0]), float(self._second[0]) + over
        self._forget()

    def set_lamps(self, share: float) -> None:
        """Let a share of the lamps be lit when it is dark, as in a power cut; 0..1.

        Raises
        ------
        InputError
            If the share is out of range.
        """
        if not 0 <= share <= 1:
            raise InputError(f"lamps: a share of {share} is lit; it has to be 0..1")
        self._lamps[0] = share
        self._forget()

    def start_event(
        self,
        kind: str,
        *,
        place: str = "",
        street: str = "",
        region: Region | None = None,
        minutes: float = math.inf,
        name: str = "",
        **numbers: Any,
    ) -> int:
        """Let an event begin in the city, now; everybody and everything takes notice from the next second on.

        Parameters
        ----------
        kind
            As docs/events.md lists them.
        place, street, region
            Where: a place's id or name, a street's name, or x, y and radius, ENU metres.
        minutes
            How long it goes on, unless `end_event` ends it.
        name
            What it is called.
        **numbers
            Further fields of `vico.sim.environment.CityEvent`.

        Returns
        -------
        int
            The event's id.

        Raises
        ------
        InputError
            If there is no such kind or place, or a number is out of range.
        """
        now = float(self._second[0])
        if unknown := set(numbers) - {"noise", "walkways"}:
            raise InputError(f"events: {sorted(unknown)[0]!r} is no number of an event; there are noise, walkways")
        if not minutes > 0:
            raise InputError(f"events: {kind}: for {minutes:g} minutes; it has to be more than 0")
        end = now + 60.0 * minutes
        event = CityEvent(
            kind=kind, place=place, street=street, region=region, begin=now, end=end, name=name, **numbers
        )
        return self.agenda.start(event, now)

    def end_event(self, number: int) -> None:
        """Let an event of the city be over now, or never begin.

        Parameters
        ----------
        number
            Its id, as `start_event` returned it; events that were planned count from 1.

        Raises
        ------
        InputError
            If there is no such event, or it is over.
        """
        self.agenda.end(number, float(self._second[0]))

    def _forget(self) -> None:
        for name in ("weather", "dark", "conditions"):
            self.__dict__.pop(name, None)
