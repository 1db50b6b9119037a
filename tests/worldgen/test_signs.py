"""Boards: every letter drawn or none, shared pages of bounded size."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from vico.world.model import Category, Place
from vico.worldgen.facades.signs import Lettering, board_text, draw_text, drawable_text, paint_boards


def _place(name: str, key: str = "n1", category: Category = Category.STORE, kind: str = "clothes") -> Place:
    return Place(
        id=key, name=name, category=category, kind=kind, building="w1", entrance="e1", position=(0.0, 0.0, 0.0)
    )


@pytest.mark.parametrize(
    ("name", "drawn"),
    [
        ("Café Größe", "Café Grösse"),
        ("Ångström & Łódź", "Ångström & Łódź"),
        ("Αθήνα", "ΑΘΗΝΑ"),
        ("Жёлтый", "ЖЁЛТЫЙ"),
        ("L’Épicerie – “Nº 1”", 'L\'Épicerie - "No 1"'),
    ],
)
def test_latin_greek_and_cyrillic_names_are_spelled(name: str, drawn: str) -> None:
    assert drawable_text(name) == drawn


@pytest.mark.parametrize("name", ["東京ラーメン", "مقهى", "한식당", "", "🍕", "ไทย"])
def test_names_in_other_scripts_are_not_turned_into_boxes(name: str) -> None:
    assert drawable_text(name) is None


@settings(max_examples=60, deadline=None)
@given(st.text(max_size=24))
def test_any_name_is_drawn_or_refused(name: str) -> None:
    text = drawable_text(name)
    if text is not None:
        picture = draw_text(text, 12)
        assert picture.dtype == np.uint8
        assert picture.shape[0] == 18


@pytest.mark.parametrize("pair", ["eé", "oö", "aå", "cç", "sš", "oø", "lł", "ПГ", "ШЩ", "ΛΔ"])
def test_letters_that_differ_look_different(pair: str) -> None:
    a, b = (draw_text(c, 40) for c in pair)
    wide = max(a.shape[1], b.shape[1])
    a, b = (np.pad(p, ((0, 0), (0, wide - p.shape[1]))) for p in (a, b))
    assert np.abs(a.astype(int) - b).max() > 100


def test_long_names_are_cut_at_a_word() -> None:
    text = board_text(_place("The Extraordinarily Long Winded Company of Haberdashers and Glovers"))
    assert text is not None
    assert len(text) <= 30
    assert text.lower().endswith(" long")


@pytest.mark.parametrize("name", ["Worshipful Haberdashers and of the Glovers", "Schuhmacherei am Gendarmenmarkt & Co"])
def test_no_board_ends_in_a_word_that_joins_others(name: str) -> None:
    text = board_text(_place(name))
    assert text is not None
    assert len(text.split()[-1]) > 3


def test_chains_share_one_board() -> None:
    boards = paint_boards([_place("Fazer", "a"), _place("Fazer", "b"), _place("東京", "c")])
    assert boards.by_place["a"] == boards.by_place["b"]
    assert boards.mute == ("c",)


def test_plates_share_the_pages_and_do_not_shine() -> None:
    plates = [
        Lettering("Rue Grimaldi", (18, 62, 138), (244, 244, 240), (30, 92, 66), shines=False),
        Lettering("12", (18, 62, 138), (244, 244, 240), shines=False),
    ]
    boards = paint_boards([_place("Fazer", "a")], [*plates, *plates])
    assert set(plates) < set(boards.by_lettering)
    (page,) = boards.materials
    assert page.texture is not None
    for plate in plates:
        board = boards.by_lettering[plate]
        left, bottom, right, top = (np.array(board.uv) * np.tile(page.texture.shape[1::-1], 2)).astype(int)
        painted = page.texture[bottom : top + 1, left : right + 1]
        assert (painted[..., 3] == 0).all()
        assert {plate.ground, plate.letters} <= {tuple(c) for c in painted[..., :3].reshape(-1, 3).tolist()}
        assert tuple(painted[0, 5, :3].tolist()) == (plate.rim or plate.ground)
    assert (page.texture[..., 3] > 0).any()


def test_a_thousand_names_fit_on_two_pages_of_three_megabytes() -> None:
    syllables = ["ka", "lo", "mir", "sten", "bru", "vei", "ta", "nor", "gås", "pel"]
    places = [
        _place(f"{syllables[k % 10].title()}{syllables[k // 10 % 10]}{syllables[k // 100]} & Sons", f"n{k}")
        for k in range(1000)
    ]
    boards = paint_boards(places)
    assert len(boards.by_place) == 1000
    assert len(boards.materials) <= 2
    total = 0
    for page in boards.materials:
        assert page.texture is not None
        assert page.texture.shape[0] <= 2048
        assert page.texture.shape[1] == 2048
        sink = io.BytesIO()
        Image.fromarray(page.texture).save(sink, "PNG")
        total += len(sink.getvalue())
    assert total < 3_000_000
    rectangles = {(b.page, b.uv) for b in boards.by_place.values()}
    assert len(rectangles) == 1000
    for page, (left, bottom, right, top) in sorted(rectangles)[:200]:
        others = [uv for p, uv in rectangles if p == page and uv != (left, bottom, right, top)]
        assert not any(x0 < right and x1 > left and y0 < top and y1 > bottom for x0, y0, x1, y1 in others)


def test_of_more_names_than_pages_hold_the_last_have_no_board(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vico.worldgen.facades.signs._MOST_PAGES", 1)
    monkeypatch.setattr("vico.worldgen.facades.signs._MOST_BOARDS", 40)
    monkeypatch.setattr("vico.worldgen.facades.signs._PAGE", 256)
    plates = [Lettering(f"{k:03d}", (0, 0, 0), (255, 255, 255), shines=False) for k in range(4000)]
    boards = paint_boards([_place("Zuletzt", "z")], plates)
    assert set(boards.by_lettering) == set(plates[:40])
    assert boards.mute == ("z",)
