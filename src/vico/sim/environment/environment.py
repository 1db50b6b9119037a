"""What is the same for everybody outdoors: the weather, what lies on the ground, sun and lamps, and what they do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.sim.environment.agenda import Agenda
from vico.sim.environment.city_event import CityEvent, Region
from vico.sim.environment.effects import Conditions, conditions, sight_in_unlit_room
from vico.sim.environment.forecast import Forecast, WeatherSite, forecast_of
from vico.sim.environment.ground import Ground, aged, cover, iciness, settled, wetness
from vico.sim.environment.sky import Sky
from vico.sim.environment.weather import NAMES, Weather, blended, kind_of_weather

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
        self._ground = np.array(settled(Weather.of(self._forecast.at(second))))
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
            self._ground[:] = aged(Ground(*self._ground.tolist()), self.weather, _AGES_EVERY)
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
        return Weather.of(blended(self._before_after[0], self._before_after[1], share))

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
