"""Sun and moon stand where almanacs say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vico.clock import DAY
from vico.errors import InputError
from vico.sim.environment import Sky


def height(vector: np.ndarray) -> float:
    return math.degrees(math.asin(float(vector[2])))


def test_the_sun_stands_highest_at_noon_as_high_as_latitude_and_date_say() -> None:
    # At a solstice or equinox it culminates at 90 degrees - latitude + declination (23.44, 0 and -23.44 degrees).
    for date, declination in (("2026-06-21", 23.44), ("2026-03-20", 0.0), ("2026-12-21", -23.44)):
        sky = Sky.over(60.17, 24.94, date)
        heights = [height(sky.sun(t)) for t in np.arange(0, DAY, 60.0)]
        assert max(heights) == pytest.approx(90 - 60.17 + declination, abs=0.3)
        assert abs(np.argmax(heights) / 60 - 12.3) < 0.4


def test_the_sun_goes_from_east_over_south_to_west() -> None:
    sky = Sky.over(48.1, 11.6, "2026-03-20", utc_offset=1.0)
    morning, noon, evening = (sky.sun(h * 3600.0) for h in (7.0, 12.3, 18.0))
    assert morning[0] > 0.9
    assert noon[1] < -0.6
    assert evening[0] < -0.9


def test_summer_time_puts_the_sun_back() -> None:
    winter_time, summer_time = (Sky.over(60.17, 24.94, "2026-06-21", utc_offset=h) for h in (2.0, 3.0))
    np.testing.assert_allclose(winter_time.sun(8 * 3600.0), summer_time.sun(9 * 3600.0))


@pytest.mark.parametrize(("date", "lit"), [("2025-01-13", 1.0), ("2025-01-29", 0.0), ("2025-02-05", 0.5)])
def test_the_moon_has_its_phases(date: str, lit: float) -> None:
    assert Sky.over(51.5, -0.1, date).moon_lit(DAY / 2) == pytest.approx(lit, abs=0.12)


def test_a_full_moon_stands_opposite_the_sun() -> None:
    sky = Sky.over(51.5, -0.1, "2025-01-13")
    assert float(sky.sun(0.0) @ sky.moon(0.0)) < -0.95


def test_it_is_dark_at_night_and_not_by_day() -> None:
    sky = Sky.over(60.17, 24.94, "2026-12-21")
    assert [sky.dark(h * 3600.0) for h in (0, 12, 23)] == [1.0, 0.0, 1.0]
    assert 0 < min(d for h in np.arange(14, 18, 0.1) if (d := sky.dark(h * 3600)) > 0) < 1


def test_days_follow_each_other() -> None:
    sky = Sky.over(10.0, 20.0, "2026-02-28")
    assert sky.day_of_year == 59
    np.testing.assert_allclose(sky.sun(DAY + 30_000.0), Sky.over(10.0, 20.0, "2026-03-01").sun(30_000.0), atol=1e-12)


@pytest.mark.parametrize(
    ("date", "offset", "words"), [("2026-13-01", None, "date"), ("June", None, "YYYY"), ("2026-06-21", 99.0, "offset")]
)
def test_nonsense_is_refused(date: str, offset: float | None, words: str) -> None:
    with pytest.raises(InputError, match=words):
        Sky.over(0.0, 0.0, date, offset)
