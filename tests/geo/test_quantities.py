"""Heights, storeys, widths and speeds as people type them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vico.geo.quantities import QUANTITIES, Kind, numbers, quantity, read


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("12", 12.0),
        ("12.5", 12.5),
        ("12,5", 12.5),
        (".5", 0.5),
        ("12 m", 12.0),
        ("12m.", 12.0),
        ("12 metres", 12.0),
        ("350 cm", 3.5),
        ("12 ft", 3.6576),
        ("65 feet", 19.812),
        ("40'", 12.192),
        ("40'6\"", 12.3444),
        ("5'-10\"", 1.778),
        ("40 ft 6 in", 12.3444),
        ("12’6”", 3.81),
        ("12½", 12.5),
        ("½", 0.5),
        ("1/2 m", 0.5),
        ("12.m", 12.0),
        ("12\u200b", 12.0),
        ("10ft6in", 3.2004),
        ("1m80", 1.8),
        ("8 m 50 cm", 8.5),
        ("12 Metern", 12.0),
        ("12 1/2 ft", 3.81),
        ("１２", 12.0),
        ("12\u00a0m", 12.0),
        ("1.200,50", 1200.5),
        ("1,200.50", 1200.5),
    ],
)
def test_plain_lengths_need_no_rule(text: str, metres: float) -> None:
    found = read(text, Kind.LENGTH)
    assert found.value == pytest.approx(metres)
    assert found.rule == ""


@pytest.mark.parametrize(
    ("text", "metres", "rule"),
    [
        ("~15", 15.0, "an approximate value"),
        ("ca. 12m", 12.0, "an approximate value"),
        ("15?", 15.0, "an approximate value"),
        ("15 m (to the eaves)", 15.0, "without the remark"),
        ("15 m to the eaves", 15.0, "the words after it left out"),
        (">20", 20.0, "the bound that it names"),
        ("4.6+", 4.6, "the bound that it names"),
        ("10-12", 12.0, "the highest of several values"),
        ("10 – 12 m", 12.0, "the highest of several values"),
        ("30-40 ft", 12.192, "the highest of several values"),
        ("7:90", 7.9, "a colon as the decimal point"),
        ("1,250 ft", 381.0, "a comma between its thousands"),
        ("ungefähr 12 m", 12.0, "an approximate value"),
    ],
)
def test_a_length_read_by_a_rule_names_it(text: str, metres: float, rule: str) -> None:
    found = read(text, Kind.LENGTH)
    assert found.value == pytest.approx(metres)
    assert found.rule == rule


@pytest.mark.parametrize(
    "text", ["", " ", "tall", "m", "12 stories", "12 m2", "12e3", "nan", "inf", "12.5.3", "12 abc", "1'200"]
)
def test_what_is_no_length_is_not_read(text: str) -> None:
    assert read(text, Kind.LENGTH).value is None


@pytest.mark.parametrize(
    ("text", "storeys"),
    [
        ("4", 4.0),
        ("1.5", 1.5),
        ("1,5", 1.5),
        ("3½", 3.5),
        ("4 floors", 4.0),
        ("4F", 4.0),
        (">4", 4.0),
        ("2;3", 3.0),
        ("1,2", 2.0),
        ("1,75", 1.75),
        ("2,50", 2.5),
        ("½", 0.5),
        ("3-storey", 3.0),
        ("3,4,5", 5.0),
        ("10-12", 12.0),
        ("G+4", 5.0),
        ("G + 12", 13.0),
        ("R+3", 4.0),
        ("EG+2+DG", 3.0),
        ("B+G+4", 5.0),
        ("3+1", 4.0),
        ("-1", -1.0),
        ("two", None),
        ("4+x", None),
    ],
)
def test_storeys(text: str, storeys: float | None) -> None:
    assert read(text, Kind.STOREYS).value == storeys


@pytest.mark.parametrize(
    ("text", "kmh"),
    [
        ("50", 50.0),
        ("50 km/h", 50.0),
        ("30 mph", 48.28),
        ("20mph", 32.19),
        ("30 (mph)", 48.28),
        ("DE:urban", 50.0),
        ("FI:zone30", 30.0),
        ("DE:zone:30", 30.0),
        ("walk", 6.0),
    ],
)
def test_speeds(text: str, kmh: float) -> None:
    assert (read(text, Kind.SPEED).value or 0.0) * 3.6 == pytest.approx(kmh, abs=0.01)


@pytest.mark.parametrize(("text", "lanes"), [("2", 2.0), ("2 lanes", 2.0), ("1+1", 2.0), ("2;3", 3.0), ("1/2", 2.0)])
def test_lanes(text: str, lanes: float) -> None:
    assert read(text, Kind.LANES).value == lanes


def test_a_value_that_cannot_be_is_as_good_as_none() -> None:
    assert quantity({"height": "9999"}, "height") is None
    assert quantity({"building:levels": "0.5"}, "building:levels") is None
    assert quantity({"height": "9,5"}, "height") == 9.5
    assert quantity({}, "height") is None


def test_all_numbers_of_a_list() -> None:
    assert numbers("-1;0;1") == [-1.0, 0.0, 1.0]
    assert numbers("0;x") == []


@given(st.text(max_size=40))
def test_no_text_ends_the_reading(text: str) -> None:
    for kind in Kind:
        value = read(text, kind).value
        assert value is None or abs(value) < float("inf")


@given(st.floats(0.1, 500.0).map(lambda value: round(value, 2)), st.sampled_from(sorted(QUANTITIES)))
def test_a_plain_number_is_read_as_it_is(value: float, key: str) -> None:
    kind = QUANTITIES[key].kind
    scale = 1 / 3.6 if kind is Kind.SPEED else 1.0
    assert read(str(value), kind).value == pytest.approx(value * scale)
