"""Opening hours in the forms that OSM really has (central Helsinki)."""

from __future__ import annotations

import pytest

from vico.community.hours import open_spans, staffed
from vico.community.usual_hours import usual_spans

TUESDAY, SATURDAY, SUNDAY = 1, 5, 6


@pytest.mark.parametrize(
    ("text", "weekday", "expected"),
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
        ("Mo-Fr 9-18", TUESDAY, [(540, 1080)]),
        ("sunrise-sunset", TUESDAY, None),
        ("Apr-Sep: Mo-Su 10:00-18:00", TUESDAY, None),
        ("by appointment", TUESDAY, None),
    ],
)
def test_opening_hours_are_read(text: str, weekday: int, expected: list[tuple[int, int]] | None) -> None:
    assert open_spans(text, weekday) == expected


def test_every_category_has_usual_hours() -> None:
    for category in ("accommodation", "food", "store", "office", "entertainment", "open", "transit"):
        assert usual_spans("something unheard of", category)


def test_staff_stay_over_a_short_closing_and_go_home_over_a_long_one() -> None:
    assert staffed([(480, 630), (660, 960)]) == [(420, 1020)]
    assert staffed([(540, 780), (960, 1200)]) == [(480, 840), (900, 1260)]
