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
    standard_spelling,
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
        ("Sun-Thu 11AM-10PM, Fri-Sat 11AM-11PM", "Su-Th 11:00-22:00, Fr-Sa 11:00-23:00"),
        ("Tues & Thurs 18-20", "Tu,Th 18:00-20:00"),
        ("Weds-Thur 9a-5p", "We-Th 09:00-17:00"),
        ("Mo-Fr 9：00～18：00", "Mo-Fr 9:00-18:00"),
        ("Mo-Fr 24h", "Mo-Fr 00:00-24:00"),
        ("24x7", "24/7"),
        ("24h/24 7j/7", "24/7"),
        ("11.30am - 2.30pm, 5.30pm - 10pm", "11:30-14:30, 17:30-22:00"),
        ("Mo-Fr 9:00-12:00 14:00-18:00", "Mo-Fr 9:00-12:00,14:00-18:00"),
        ("Mo-Fr 9:00-12:00/14:00-18:00", "Mo-Fr 9:00-12:00,14:00-18:00"),
        ("Mo-Fr 8:00-18:00 | Sa 8:00-12:00", "Mo-Fr 8:00-18:00; Sa 8:00-12:00"),
        ("Mo-Fr 8:00-18:00 / Sa 8:00-12:00", "Mo-Fr 8:00-18:00; Sa 8:00-12:00"),
        ("Mo-Fr 9:00-17:00;;Sa 10:00-12:00", "Mo-Fr 9:00-17:00;Sa 10:00-12:00"),
        ("(sunrise-sunset)", "sunrise-sunset"),
        ("noon-5pm", "12:00-17:00"),
        ("5pm-midnight", "17:00-24:00"),
        ("Mo-Fr 09:00-18:00 hrs", "Mo-Fr 09:00-18:00"),
        ("Mo-Su 11:00-late", "Mo-Su 11:00+"),
        ("930-1830", "9:30-18:30"),
        ("Jun 8-10 Mon 9am-5pm", "Jun 8-10 Mo 09:00-17:00"),
        ("Mon-Fri 9-17; Dec 24-26 off", "Mo-Fr 9:00-17:00; Dec 24-26 off"),
        ("Apr-Oct 10-18", "Apr-Oct 10:00-18:00"),
        ("Di Ruhetag; 11:00-22:00", "11:00-22:00; Tu off"),
        ("Mo-Fr 9-12 “by the back door”", "Mo-Fr 9:00-12:00"),
    ],
)
def test_common_spellings_are_read(typed: str, meant: str) -> None:
    assert (how_read(typed), standard_spelling(typed)) == ("respelled", meant)


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("Mo-So 8-20 Uhr", "Mo-Su 8:00-20:00"),
        ("Montag bis Freitag 9 bis 18 Uhr, So geschlossen", "Mo-Fr 9:00-18:00, Su off"),
        ("Di,Do 10:00-18:00", "Tu,Th 10:00-18:00"),
        ("Sa-Di 14h-18h", "Sa-Su 14:00-18:00"),
        ("du lundi au vendredi de 9h à 18h", "Mo-Fr 9:00-18:00"),
        ("mar-sam 9h30-19h", "Tu-Sa 9:30-19:00"),
        ("Lunes a viernes 9:00-18:00", "Mo-Fr 9:00-18:00"),
        ("lun-ven 9-13 15-19; dom chiuso", "Mo-Fr 9:00-13:00,15:00-19:00; Su off"),
        ("maandag t/m vrijdag van 9.00 tot 17.30 uur", "Mo-Fr 9:00-17:30"),
        ("segunda a sexta 9h-18h", "Mo-Fr 9:00-18:00"),
        ("pn-pt 8-16; sob 9-13", "Mo-Fr 8:00-16:00; Sa 9:00-13:00"),
        ("пн-пт 9:00-18:00; сб,вс выходной", "Mo-Fr 9:00-18:00; Sa,Su off"),
        ("周一至周五 9:00-18:00", "Mo-Fr 9:00-18:00"),
        ("月～金 10:00-19:00、土日祝 10:00-17:00", "Mo-Fr 10:00-19:00, Sa,Su,PH 10:00-17:00"),
        ("Mar-Oct: Di-So 10-18 Uhr", "Mar-Oct: Tu-Su 10:00-18:00"),
    ],
)
def test_days_are_read_in_the_language_that_knows_all_their_names(typed: str, meant: str) -> None:
    assert (how_read(typed), standard_spelling(typed)) == ("respelled", meant)


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("1-5pm", (780, 1020)),
        ("6-10pm", (1080, 1320)),
        ("9-5pm", (540, 1020)),
        ("11-2pm", (660, 840)),
        ("12-9pm", (720, 1260)),
        ("8-11am", (480, 660)),
        ("9:30am-5", (570, 1020)),
        ("6pm-2", (1080, 1560)),
        ("18-2", (1080, 1560)),
    ],
)
def test_half_of_the_day_said_once_counts_for_both_times_where_it_can(typed: str, expected: Span) -> None:
    assert weekly_hours(f"Tu {typed}") == [[], [expected], *[[]] * 5]


@pytest.mark.parametrize(
    "text", ["9-5", "Mo-Fr 9:30-5", "10:00-7", "11-2am", "9am-11", "Ma-Do 9-17", "ma-pe 9-17", "Po-Pá 8-18; So 9-12"]
)
def test_hours_and_days_that_could_be_two_are_not_read(text: str) -> None:
    assert how_read(text) == "not read"


@pytest.mark.parametrize(
    ("text", "first", "second"),
    [
        ("Mo-Su 18:00-02:00; Mo off", [(0, 120)], [(1080, 1560)]),
        ("Mo-Fr 22:00-06:00; Mo off", [], [(1320, 1800)]),
        ("Mo-Su 11:00-01:00; 2026 Jun 8 off", [(0, 60)], [(660, 1500)]),
        ("Mo 18:00-03:00; Tu off", [(1080, 1620)], [(0, 180)]),
        ("Mo-Su 18:00-02:00; Mo 18:00-03:00", [(0, 120), (1080, 1620)], [(0, 180), (1080, 1560)]),
        ("24/7; 22:00-06:00 off", [(360, 1320)], [(360, 1320)]),
    ],
)
def test_a_night_belongs_to_the_day_that_it_begins_on(text: str, first: list[Span], second: list[Span]) -> None:
    found = [open_spans(text, MONDAY, BERLIN), open_spans(text, TUESDAY, BERLIN)]
    assert found == [first, second]


def test_hours_by_the_clock_are_kept_where_clocks_change_at_midnight() -> None:
    cairo, changing = (30.04, 31.23), date(2026, 4, 24)
    assert open_spans("Mo-Su 18:00+", changing - timedelta(days=1), cairo) == [(1080, 1440)]
    assert open_spans("00:00-24:00", changing, cairo) == [(0, 1440)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('Mo-Fr 10:00-18:00; "nach Vereinbarung"', [(600, 1080)]),
        ('Mo-Fr 10:00-18:00, "nach Vereinbarung"', [(600, 1080)]),
        ('Mo-Fr 11:00-14:00 "Lunch", 18:00-22:00 "Dinner"', [(660, 840), (1080, 1320)]),
        ('24/7 "self service"', [(0, 1440)]),
        ('Mo-Fr 10:00-18:00 "opens 9:00; in summer"', [(600, 1080)]),
        ('Mo-Fr 10:00-18:00 open "ring the bell"', [(600, 1080)]),
        ('Mo-Fr 10:00-18:00; Tu off "stocktaking"', []),
        ('"by appointment"', None),
        ('Mo-Fr 09:00-17:00 "by appointment"', None),
        ('Mo-Fr 09:00-17:00 "nur nach telefonischer Vereinbarung"', None),
        ('Mo-Fr 09:00-17:00 "sur rendez-vous"', None),
        ('Mo-Fr 09:00-17:00 "desk 2 by appointment"', [(540, 1020)]),
        ("Mo-Fr 10:00-18:00 unknown", None),
    ],
)
def test_a_comment_beside_hours_is_a_remark(text: str, expected: list[Span] | None) -> None:
    assert (how_read(text), open_spans(text, TUESDAY, BERLIN)) == ("as typed", expected)


def test_remarks_keep_spans_on_their_days() -> None:
    assert open_spans('Mo-Fr 11:00-14:00 open "Lunch", 18:00-22:00 open "Dinner"', SUNDAY, BERLIN) == []


@pytest.mark.parametrize("text", ["Tuesdays 9-5", "summer", "", "by appointment"])
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
