"""Weather: kinds of it, forecasts, what lies on the ground, and what it does to those outdoors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.clock import DAY
from vico.errors import InputError, SchemaError
from vico.sim.environment import Agenda, Environment, EventSites, Sky, Weather, weather_kinds
from vico.sim.environment.environment import CLEAR_SIGHT
from vico.sim.environment.weather import (
    Changing,
    Ground,
    WeatherSite,
    advance_ground,
    cover,
    forecast_of,
    iciness,
    usual_temperature,
    wetness,
)

HELSINKI = WeatherSite(60.17, 24.94, 172)
JANUARY = WeatherSite(60.17, 24.94, 15)


def environment(wanted: Any = "fair", *, hour: float = 12.0, date: str = "2026-06-21") -> Environment:
    agenda = Agenda(EventSites(toy_city.world()))
    return Environment(Sky.over(60.17, 24.94, date), wanted, seed=0, second=hour * 3600, agenda=agenda)


def test_every_kind_of_weather_is_weather() -> None:
    for name, kind in weather_kinds().items():
        weather = kind.weather(10.0)
        assert kind.coldest <= weather.temperature <= kind.warmest, name
        assert not (weather.rain and weather.snow), name


@pytest.mark.parametrize("field", [{"rain": -1.0}, {"clouds": 1.5}, {"visibility": 0.0}, {"wind": float("nan")}])
def test_numbers_out_of_range_are_refused(field: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(field))):
        Weather(**field)


def test_kinds_of_ones_own_are_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sim/environment").mkdir(parents=True)
    (tmp_path / "sim/environment" / "weather_mine.toml").write_text(
        "[weather.sandstorm]\nvisibility = 60.0\nwind = 15.0\n"
    )
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    assert forecast_of("sandstorm", HELSINKI, 0).at(0.0)[3] == 60.0
    (tmp_path / "sim/environment" / "weather_mine.toml").write_text("[weather.sandstorm]\nsand = 1.0\n")
    monkeypatch.setenv("VICO_DATA", str(tmp_path) + "/")
    with pytest.raises(SchemaError, match=r"weather_mine\.toml.*sand"):
        weather_kinds()


def test_changing_weather_depends_on_seed_and_moment_alone() -> None:
    moments = np.arange(0, 3 * DAY, 613.0)
    first = np.array([Changing(HELSINKI, 1).at(t) for t in moments])
    again = Changing(HELSINKI, 1)
    np.testing.assert_array_equal([again.at(t) for t in moments[::-1]][::-1], first)
    assert not np.array_equal([Changing(HELSINKI, 2).at(t) for t in moments], first)


def test_changing_weather_has_no_jumps() -> None:
    moments = np.arange(0, 4 * DAY, 10.0)
    changing = Changing(HELSINKI, 5)
    found = np.array([changing.at(t) for t in moments])
    clouds, rain = found[:, 0], found[:, 1]
    assert np.ptp(clouds) > 0.3
    assert np.abs(np.diff(clouds)).max() < 0.01 + 10 / 1200
    assert np.abs(np.diff(rain)).max() <= 20.0 * 10 / 1200 + 1e-9


def test_snow_falls_in_winter_and_not_in_summer() -> None:
    moments = np.arange(0, 20 * DAY, 1800.0)
    winter, summer = (np.array([Changing(site, 3).at(t) for t in moments]) for site in (JANUARY, HELSINKI))
    assert winter[:, 2].max() > 0
    assert summer[:, 2].max() == 0 < summer[:, 1].max()


def test_the_year_and_the_day_swing() -> None:
    assert usual_temperature(60.0, 200, 15 * 3600) - usual_temperature(60.0, 20, 15 * 3600) > 15
    assert usual_temperature(-35.0, 20, 0) > usual_temperature(-35.0, 200, 0)
    assert usual_temperature(1.0, 20, 15 * 3600) - usual_temperature(1.0, 20, 3 * 3600) == pytest.approx(8.0)


def test_a_weather_file_says_when_it_becomes_what() -> None:
    lines = [{"at": "08:00", "kind": "clear"}, {"at": "09:00", "over": 600.0, "kind": "rain", "rain": 8.0}]
    forecast = forecast_of({"weather": lines}, HELSINKI, 0)
    rain = [float(forecast.at(t)[1]) for t in (0.0, 9 * 3600.0, 9 * 3600 + 300.0, 9 * 3600 + 600.0, 20 * 3600.0)]
    assert rain == [0.0, 0.0, 4.0, 8.0, 8.0]


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ({}, "weather"),
        ({"weather": []}, "weather"),
        ({"weather": [{"at": "25:00"}]}, "25:00"),
        ({"weather": [{"at": "08:00", "kind": "frogs"}]}, "frogs"),
        ({"weather": [{"at": "08:00", "rain": -3.0}]}, r"weather\.0: .*rain"),
        ({"weather": [{"at": "08:00", "hail": 3.0}]}, r"weather\.0\.hail"),
        ({"weather": [{"at": "08:00"}, {"at": "07:00"}]}, r"weather\.1: begins before"),
        ({"weather": [{"at": "08:00", "rain": float("nan")}]}, "rain"),
    ],
)
def test_weather_files_with_nonsense_are_refused(record: dict[str, Any], words: str) -> None:
    with pytest.raises((SchemaError, InputError), match=words):
        forecast_of(record, HELSINKI, 0)


def test_unknown_weather_is_refused_with_what_there_is() -> None:
    with pytest.raises(InputError, match=r"frogs.*changing.*drizzle"):
        environment("frogs")


def test_rain_wets_the_ground_and_sun_dries_it() -> None:
    ground = advance_ground(Ground(), weather_kinds()["rain"].weather(12.0), 600.0)
    assert wetness(ground.water) == 1.0
    for _ in range(6 * 8):
        ground = advance_ground(ground, weather_kinds()["clear"].weather(20.0), 600.0)
    assert ground == Ground()


def test_snow_lies_while_it_freezes_and_melts_into_water() -> None:
    ground = Ground()
    for _ in range(12):
        ground = advance_ground(ground, weather_kinds()["snow"].weather(-5.0), 600.0)
    assert cover(ground.snow) == 1.0
    assert ground.water == 0.0
    after = advance_ground(ground, weather_kinds()["clear"].weather(8.0), 3600.0)
    assert after.snow < ground.snow
    assert after.water > 0


def test_wet_ground_freezes_in_a_cold_night_and_thaws() -> None:
    ground = Ground(water=0.5)
    for _ in range(12):
        ground = advance_ground(ground, weather_kinds()["clear"].weather(-4.0), 600.0)
    assert iciness(ground.ice) == 1.0
    assert ground.water + ground.ice == pytest.approx(0.5)
    thawed = advance_ground(ground, weather_kinds()["clear"].weather(6.0), 3600.0)
    assert thawed.ice == 0.0 < thawed.water


def test_rain_below_zero_freezes_where_it_falls() -> None:
    glazed = advance_ground(Ground(), weather_kinds()["freezing_rain"].weather(-3.0), 1800.0)
    assert glazed.water == 0.0
    assert iciness(glazed.ice) == 1.0


def test_conditions_get_worse_with_weather_and_dark() -> None:
    fair, rain, snow, fog = (environment(kind).conditions for kind in ("fair", "rain", "snow", "fog"))
    ice = environment("freezing_rain").conditions
    assert fair.sight == CLEAR_SIGHT
    assert fair.driving == 1.0
    assert fair.friction > rain.friction > snow.friction > ice.friction
    assert fair.hard_braking == 8.0
    assert snow.hard_braking == pytest.approx(0.25 * 9.81)
    assert ice.hard_braking == pytest.approx(0.1 * 9.81)
    assert fair.driving > rain.driving > snow.driving >= 0.5
    assert fair.time_gap == 1.0 < rain.time_gap < snow.time_gap < ice.time_gap
    assert fair.traction > rain.traction > snow.traction > ice.traction
    assert fair.cycling == 1.0 > rain.cycling > snow.cycling > ice.cycling
    assert fog.safe_speed < fair.safe_speed
    assert ice.walking < snow.walking < fair.walking == 1.0
    thick = environment({"weather": [{"at": "08:00", "kind": "fog", "visibility": 30.0}]}).conditions
    assert thick.sight == pytest.approx(12.0)
    # Whoever drives at the safe speed stops within what he sees: one second and full braking.
    reach = thick.safe_speed + thick.safe_speed**2 / (2 * thick.hard_braking)
    assert reach == pytest.approx(30.0)


def test_at_night_lamps_help_sight() -> None:
    night = environment(hour=23.0, date="2026-12-21")
    assert night.dark == 1.0
    lit = night.conditions.sight
    night.set_lamps(0.0)
    assert night.conditions.sight == 15.0 < lit < CLEAR_SIGHT


def test_weather_can_be_called_for_and_goes_on_after_a_restore() -> None:
    one = environment("fair", hour=10.0)
    one.change_weather("rain", over=120.0)
    for _ in range(60):
        one.advance(1.0)
    assert one.weather.rain == pytest.approx(2.0)
    saved = {name: array.copy() for name, array in one.arrays().items()}
    other = environment("fair", hour=10.0)
    other.restore(saved)
    for step in range(7200):
        one.advance(1.0)
        if step % 2:
            other.advance(2.0)
    assert one.record() == other.record()
    assert one.weather.rain == 4.0
    assert one.wet == 1.0


def test_a_run_begins_on_ground_that_fits_its_weather() -> None:
    assert environment("rain").wet == 1.0
    assert environment("snow", date="2026-01-15").snow_cover == 1.0
    assert environment("fair").wet == 0.0
