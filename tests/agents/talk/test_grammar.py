"""Questions are known by forms in a data file, and small talk is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vico.agents.talk.acquaintance import Acquaintance
from vico.agents.talk.conversation import Conversation, Errand
from vico.agents.talk.grammar import Question, read_grammar
from vico.errors import SchemaError

MIA = ("Mia Holm", "Mia")


@pytest.mark.parametrize(
    ("text", "question"),
    [
        ("Where is the Hat Shop?", Question("where", "Hat Shop")),
        ("Where's Ada Berg, Mia?", Question("where", "Ada Berg", "Mia")),
        ("Excuse me, Mia, how do I get to Hotel St. George?", Question("way", "Hotel St. George", "Mia")),
        ("Could you tell me what is the way to the nearest cafe, please?", Question("way", "cafe")),
        ("Hello! Do you know where Apartments, Annankatu 18 is?", Question("where", "Apartments, Annankatu 18")),
        ("Bob, have you seen Mia?", Question("seen", "Mia", "Bob")),
        ("HAVE YOU SEEN ADA", Question("seen", "ADA")),
        ("Mia Holm, what are you doing?", Question("doing", "", "Mia Holm")),
        ("What did you do today, Mia?", Question("did", "", "Mia")),
        ("Hi, what are your plans for today?", Question("plans")),
        ("It rained. Who are you? I am lost.", Question("who")),
        ("I'm on my way home. And you?", None),
        ("How are you today?", None),
        ("Hello, Mia! Where are you off to?", None),
        ("", None),
        ("where is " + "x" * 500, None),
    ],
)
def test_a_question_is_read(text: str, question: Question | None) -> None:
    assert read_grammar().question_in(text, names=MIA) == question


def test_no_greeting_and_no_reply_is_taken_for_a_question() -> None:
    class Me:
        id, name, age, occupation, hobbies = "resident_1", "Mia Holm", 30, "Baker", ["chess"]

    lines: set[str] = set()
    new: set[str] = set()
    for age in (8, 35):
        for mine in (9, 40):
            Me.age = mine
            for kind in ("friend", "family", "colleague", "neighbour"):
                other = Acquaintance("resident_2", "Bo Dahl", kind, "", age)
                talk = Conversation(Me(), [other], np.random.default_rng(1))
                for errand in (Errand("having lunch", leaves=False), Errand("on my way home", leaves=True)):
                    for hour, indoors in ((8, True), (15, False), (20, True)):
                        lines |= set(talk._greetings(other, hour * 3600.0, errand, indoors=indoors))
                    for text in (*lines, "Hello, Mia!", "I'm on my way home, Mia."):
                        new |= set(talk._answers(other, errand, text) + talk._last_words(other, errand, text))
                    lines |= new
    assert len(lines) > 25
    grammar = read_grammar()
    assert [line for line in lines if grammar.question_in(line, names=("Bo Dahl", "Bo")) is not None] == []


def test_forms_of_ones_own_are_added(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "agents/talk").mkdir(parents=True)
    file = tmp_path / "agents/talk" / "questions_more.toml"
    file.write_text('[[question]]\nkind = "where"\nabout = "Finnish."\nforms = ["missä on {what}"]\n', encoding="utf-8")
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    assert read_grammar().question_in("Missä on Hat Shop?") == Question("where", "Hat Shop")


@pytest.mark.parametrize(
    "form", ["where is", "Where is {what}", "{what} {what}", "where is {name}", "where (is|are) {what}"]
)
def test_a_damaged_form_is_refused_with_its_file(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "agents/talk").mkdir(parents=True)
    (tmp_path / "agents/talk" / "questions_mine.toml").write_text(
        f'[[question]]\nkind = "where"\nabout = "Mine."\nforms = ["{form}"]\n'
    )
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    with pytest.raises(SchemaError, match=r"questions_mine.toml: question 'where'.*docs/talk.md"):
        read_grammar()
