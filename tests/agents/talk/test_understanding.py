"""Whatever residents answer can be read back."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import toy_city
from vico.agents.talk.grammar import read_grammar
from vico.agents.talk.sentences import SENTENCES, claims_in, place_named, read_sentences, whereabouts
from vico.errors import SchemaError
from vico.io.data_files import PACKAGED
from vico.world.public import PublicMap

FIELDS: dict[str, str | int] = {
    "person": "Ada Berg",
    "source": "Bo Dahl",
    "place": "M. A. D: Micro Aided Design",
    "time": "10:15",
    "until": "11:05",
    "metres": 150,
    "direction": "north-east",
    "steps": "go east along Mikonkatu for about 80 m, and you are there",
    "activity": "have lunch",
    "errand": "here to eat",
    "occupation": "a baker",
}


@pytest.mark.parametrize("name", [name for name, fields in SENTENCES.items() if fields])
def test_each_sentence_is_read_back_between_others(name: str) -> None:
    said = {field: FIELDS[field] for field in SENTENCES[name]}
    text = f"Hello! {read_sentences().say(name, **said)} {read_sentences().say('no_plans')}"
    (claim,) = claims_in(text)
    assert claim.kind == name
    for field, value in said.items():
        got = {"time": claim.time, "until": claim.until}.get(field, getattr(claim, field, claim.text))
        assert got == {"10:15": 36900.0, "11:05": 39900.0}.get(str(value), value), field


@given(
    place=st.text(
        st.characters(categories=["L", "N", "Zs"], include_characters=".,:&-'()"), min_size=1, max_size=60
    ).filter(lambda name: name == " ".join(name.split()))
)
def test_any_name_of_a_place_comes_back(place: str) -> None:
    sentences = read_sentences()
    text = sentences.say("saw_in", person="Ada Berg", place=place, time="10:15")
    assert claims_in(text)[0].place == place


def test_the_surest_and_latest_comes_first() -> None:
    say = read_sentences().say
    text = " ".join(
        [
            say("usual", person="Ada Berg", place="Hat Shop"),
            say("saw_in", person="Ada Berg", place="Corner Café", time="08:00"),
            say("saw_in", person="Ada Berg", place="South Green", time="09:00"),
            say("saw_in", person="Bo Dahl", place="Corner Café", time="09:30"),
        ]
    )
    assert [(one.kind, one.place) for one in whereabouts(text, "ada berg")] == [
        ("saw_in", "South Green"), ("saw_in", "Corner Café"), ("usual", "Hat Shop"),
    ]  # fmt: skip


def test_times_that_are_none_are_not_read() -> None:
    assert claims_in("I saw Ada Berg in Hat Shop at 27:61.") == []


def test_answers_are_no_questions() -> None:
    grammar = read_grammar()
    for name, fields in SENTENCES.items():
        said = read_sentences().say(name, **{field: FIELDS[field] for field in fields})
        assert grammar.question_in(said) is None, said


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('saw_in = "I saw {person} in {place} at {time}."', 'saw_in = "I saw {person} in {place}."', "its fields are"),
        ('saw_in = "I saw {person} in {place} at {time}."', 'saw_in = "{time}: {person} in {place}"', "full stop"),
        ('no_plans = "I have no more plans for today."', "", "missing"),
        ('busy = "Sorry', 'bossy = "Sorry', "missing|unknown"),
    ],
)
def test_a_damaged_file_is_refused(
    old: str, new: str, fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "agents/talk").mkdir(parents=True)
    text = (PACKAGED / "agents" / "talk" / "answers.toml").read_text()
    assert old in text
    (tmp_path / "agents/talk" / "answers.toml").write_text(text.replace(old, new))
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    with pytest.raises(SchemaError, match=f"answers.toml: sentence.*({fault})"):
        read_sentences()


def test_places_are_found_by_name() -> None:
    public = PublicMap.from_world(toy_city.world())
    place = place_named(public, "hat shop")
    assert place is not None
    assert place.id == toy_city.SHOP
    assert place_named([], "Hat Shop") is None
