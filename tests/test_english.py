"""Articles go by sound, participles by rule and exception."""

from __future__ import annotations

import pytest

from vico.english import enumerate_words, participle, split_name, uncapitalize, with_article


@pytest.mark.parametrize(
    "said",
    [
        "an engineer", "a baker", "a UX designer", "a university lecturer", "an usher", "a urologist", "an HR manager",
        "an hour", "a hotelier", "an MRI technician", "an IT consultant", "a European", "a one-man band",
        "an Uber driver",
        "a UK citizen", "a NASA engineer", "an 18-year-old student", "an 8-year-old", "a 19-year-old student",
        "an undertaker", "an unemployed person", "an X-ray technician", "a user", "an Éclair baker",
    ],
)  # fmt: skip
def test_an_article_goes_by_sound(said: str) -> None:
    assert with_article(said.split(" ", 1)[1]) == said


@pytest.mark.parametrize(
    ("verb", "turned"),
    [
        ("have", "having"), ("be", "being"), ("see", "seeing"), ("lie", "lying"), ("sit", "sitting"),
        ("cut", "cutting"),
        ("knit", "knitting"), ("quiz", "quizzing"), ("play", "playing"), ("sew", "sewing"), ("fix", "fixing"),
        ("eat", "eating"), ("weigh", "weighing"), ("repot", "repotting"), ("begin", "beginning"), ("open", "opening"),
        ("visit", "visiting"), ("travel", "travelling"), ("true", "truing"), ("catalogue", "cataloguing"),
        ("dye", "dyeing"), ("picnic", "picnicking"), ("window-shop", "window-shopping"), ("study", "studying"),
    ],
)  # fmt: skip
def test_a_participle_follows_the_rules_of_spelling(verb: str, turned: str) -> None:
    assert participle(verb) == turned


def test_abbreviations_stay_capitals() -> None:
    assert [uncapitalize(text) for text in ("Write code", "UX designer", "F1 races", "I")] == [
        "write code", "UX designer", "F1 races", "I",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("Ada Berg", ("", "Ada", "Berg")), ("Dr. Amina van der Berg", ("Dr", "Amina", "van der Berg")),
        ("Prof Dr. Ivo Ek", ("Dr", "Ivo", "Ek")), ("Cher", ("", "Cher", "")), ("Dr.", ("", "Dr.", "")),
    ],
)  # fmt: skip
def test_a_title_is_no_first_name(name: str, parts: tuple[str, str, str]) -> None:
    assert split_name(name) == parts


def test_words_are_enumerated_with_a_final_and() -> None:
    assert [enumerate_words(list("abc")[:k]) for k in (1, 2, 3)] == ["a", "a and b", "a, b and c"]
