"""Opening hours in the forms that people type: what they mean on days, at places, and how they were read."""

from __future__ import annotations

import json
from datetime import date, timedelta
from pathlib import Path

import pytest

from vico.world.opening_hours import (
    Span,
    customary_weekday,
    how_read,
    is_public_holiday,
    open_spans,
    respelled,
    weekly_hours,
)

BERLIN, HELSINKI, NEW_YORK = (52.52, 13.40), (60.17, 24.94), (40.71, -73.99)
MONDAY = date(2026, 6, 8)
TUESDAY, SATURDAY, SUNDAY = (MONDAY + timedelta(days=k) for k in (1, 5, 6))
TABLE = Path(__file__).parent / "opening_hours.tsv"


def minutes(text: str) -> int:
    hour, _, minute = text.partition(":")
    return int(hour) * 60 + int(minute)


def spans_in(cell: str) -> list[Span] | None:
    if cell in "?-":
        return None if cell == "?" else []
    pairs = (span.split("-") for span in cell.split())
    return [(minutes(start), minutes(end)) for start, end in pairs]


def test_every_value_of_eleven_cities_means_on_seven_days_what_the_table_says() -> None:
    rows = [line.split("\t") for line in TABLE.read_text("utf-8").splitlines() if not line.startswith("#")]
    wrong = {}
    for cell, how, *days in rows:
        text = json.loads(cell)
        found = [open_spans(text, MONDAY + timedelta(days=k), BERLIN) for k in range(7)]
        if how_read(text) != how or found != [spans_in(day) for day in days]:
            wrong[text] = found
    assert len(rows) > 1_100
    assert wrong == {}


@pytest.mark.parametrize(
    ("text", "day", "expected"),
    [
        ("24/7", TUESDAY, [(0, 1440)]),
        ("10:00-20:00", SUNDAY, [(600, 1200)]),
        ("Mo-Fr 10:00-18:00;Sa 10:00-15:00", SATURDAY, [(600, 900)]),
        ("Mo-Fr 10:00-18:00; Sa 10:00-15:00; PH off", SUNDAY, []),
        ("Mo-Fr 11:00-14:30,17:00-00:00; Sa 12:00-00:00; Su 17:00-23:00", TUESDAY, [(660, 870), (1020, 1440)]),
        ("Mo,Tu 08:00-22:00; We-Sa 08:00-24:00, Su 09:00-22:00", SUNDAY, [(540, 1320)]),
        ("Mo-Fr 08:00-20:00; Sa 11:00-17:00, Su closed", SUNDAY, []),
        ("Mo-Su 12:00-02:00", TUESDAY, [(0, 120), (720, 1560)]),
        ("Su-Th 14:00-02:00, Fr 14:00-05:00, Sa 12:00-05:00", SUNDAY, [(0, 300), (840, 1560)]),
        ("Mo-Fr 12:00-01:00; Sa 12:00-02:00; Su off", SUNDAY, [(0, 120)]),
        ("Mo-Fr 9-18", TUESDAY, [(540, 1080)]),
        ("Sa,Su 10:00-16:00", SATURDAY, [(600, 960)]),
        ("Mo-Sa 10:00-20:00; Su,PH off", SUNDAY, []),
        ("Mo, We 10:00-12:00", MONDAY, [(600, 720)]),
        ("Apr-Sep: Mo-Su 10:00-18:00", TUESDAY, [(600, 1080)]),
        ("Oct-Mar: Mo-Su 10:00-16:00", TUESDAY, []),
        ("Jun 8-14 off; Mo-Fr 10:00-12:00", TUESDAY, [(600, 720)]),
        ("Mo-Fr 10:00-12:00; Jun 8-14 off", TUESDAY, []),
        ("Tu[2] 10:00-12:00", TUESDAY, [(600, 720)]),
        ("week 23 Mo-Fr 10:00-12:00", TUESDAY, []),
        ("by appointment", TUESDAY, None),
        ('Mo-Fr 08:00-16:00 || "on appointment"', TUESDAY, [(480, 960)]),
        ('Mo-Fr 08:00-16:00; Sa "by appointment"', SATURDAY, []),
        ('Mo-Fr 08:00-16:00 open "main hall"', TUESDAY, [(480, 960)]),
        ("PH off", TUESDAY, None),
        ("SH off", TUESDAY, None),
        ("Su off", SUNDAY, []),
        ("Su off", TUESDAY, None),
        ("closed", TUESDAY, []),
    ],
)
def test_hours_on_a_day(text: str, day: date, expected: list[Span] | None) -> None:
    assert open_spans(text, day, BERLIN) == expected


def test_hours_that_last_beyond_noon_of_the_next_day_are_the_next_days() -> None:
    text = "Fr 20:00-24:00; Sa 00:00-24:00"
    assert open_spans(text, date(2026, 6, 12)) == [(1200, 1440)]
    assert open_spans(text, SATURDAY) == [(0, 1440)]


@pytest.mark.parametrize(
    ("coordinates", "day"), [(HELSINKI, date(2025, 12, 6)), (NEW_YORK, date(2025, 7, 4)), (BERLIN, date(2025, 10, 3))]
)
def test_public_holidays_are_those_of_the_country(coordinates: tuple[float, float], day: date) -> None:
    others = [where for where in (HELSINKI, NEW_YORK, BERLIN) if where != coordinates]
    assert open_spans("Mo-Su 10:00-12:00; PH off", day, coordinates) == []
    assert [open_spans("Mo-Su 10:00-12:00; PH off", day, where) for where in others] == [[(600, 720)]] * 2
    assert is_public_holiday(day, coordinates)
    assert customary_weekday(day, coordinates) == 6


def test_the_sun_sets_when_it_does_at_the_place() -> None:
    ((_, summer),) = open_spans("sunrise-sunset", date(2026, 6, 21), HELSINKI) or []
    ((_, winter),) = open_spans("sunrise-sunset", date(2026, 12, 21), HELSINKI) or []
    assert 22 * 60 < summer < 23 * 60  # 22:50, almanac of the University of Helsinki
    assert 15 * 60 < winter < 15.5 * 60  # 15:13


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("Mo-Fr 9-18", "Mo-Fr 9:00-18:00"),
        ("mon - fri 9am - 5:30pm", "Mo-Fr 09:00-17:30"),
        ("Monday to Friday 10:00-18:00, Saturday 10-14", "Mo-Fr 10:00-18:00, Sa 10:00-14:00"),
        ("Mo–Fr 10–18 Uhr", "Mo-Fr 10:00-18:00"),
        ("Mo-Fr 10h30-18h", "Mo-Fr 10:30-18:00"),
        ("Mo-Fr 10.00-18.00", "Mo-Fr 10:00-18:00"),
        ("Mo-Fr 0900-1700", "Mo-Fr 09:00-17:00"),
        ("Mo-Fr 09:00-17:00 Sa 10:00-12:00", "Mo-Fr 09:00-17:00, Sa 10:00-12:00"),
        ("Mo-Fr 09:00-12:00 und 13:00-17:00", "Mo-Fr 09:00-12:00,13:00-17:00"),
        ("Su-Th 15-00; Fr-Sa 15-02", "Su-Th 15:00-00:00; Fr-Sa 15:00-02:00"),
        ("Daily 10:00-18:00", "Mo-Su 10:00-18:00"),
        ("24 hours", "24/7"),
    ],
)
def test_common_spellings_are_read(typed: str, meant: str) -> None:
    assert (how_read(typed), respelled(typed)) == ("respelled", meant)


@pytest.mark.parametrize("text", ["Tuesdays 9-5", "summer", "Mo-Fr 07:00-late", "", "lundi 10-12"])
def test_what_could_mean_several_things_is_not_read(text: str) -> None:
    assert how_read(text) == "not read"
    assert open_spans(text, TUESDAY, BERLIN) is None


def test_an_ordinary_week_knows_no_exceptions() -> None:
    assert weekly_hours("24/7; Dec 25 off") == [[(0, 1440)]] * 7
    assert weekly_hours("Mo-Sa 10:00-20:00; Dec 24-26 off; PH off") == [[(600, 1200)]] * 6 + [[]]
    assert weekly_hours("Fr,Sa 20:00-04:00") == [[], [], [], [], [(1200, 1680)], [(1200, 1680)], []]


@pytest.mark.parametrize(
    "text", ["sunrise-sunset", "week 1-52/2 Mo 10:00-12:00", "We[1] 10:00-12:00", "Apr-Sep 10:00-18:00", "PH off"]
)
def test_there_is_no_ordinary_week_where_weeks_differ(text: str) -> None:
    assert weekly_hours(text) is None
