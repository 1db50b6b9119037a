"""Usual hours of places that don't say theirs, and of staff."""

from __future__ import annotations

from vico.community.place_index import staffed_spans, usual_spans


def test_every_category_has_usual_hours() -> None:
    for category in ("accommodation", "food", "store", "office", "entertainment", "open", "transit"):
        assert usual_spans("something unheard of", category)


def test_staff_stay_over_a_short_closing_and_go_home_over_a_long_one() -> None:
    assert staffed_spans([(480, 630), (660, 960)]) == [(420, 1020)]
    assert staffed_spans([(540, 780), (960, 1200)]) == [(480, 840), (900, 1260)]
