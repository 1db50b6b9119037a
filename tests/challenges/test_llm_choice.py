"""A model chooses what tasks are about; what it does not settle is drawn by the seed, question by question."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import toy_city
from llm_server import Script, model_server, refuses
from scripted_planner import impatient
from vico.challenges.assistant.candidates import ChoiceQuestion, llm_chooser
from vico.challenges.assistant.generate import generate_task
from vico.community.model import Community
from vico.llm import Budget
from vico.world.world import World

WHO = toy_city.community().residents[0]
NAMES = [f"Place {k}" for k in range(9)]


def question(text: str = "Where do the things lie?") -> ChoiceQuestion:
    return ChoiceQuestion(text, "delivery", WHO)


def picks(index: int) -> str:
    return json.dumps({"index": index, "reason": "it is on the way to work"})


def test_the_model_is_told_who_asks_and_its_choice_is_taken() -> None:
    with model_server(picks(7)) as (base, script):
        chooser = llm_chooser(impatient(base))
        assert chooser(question(), NAMES) == 7
        said = script.last_words(0)
    assert "of the kind delivery is being made up: things are fetched from one place and brought to another." in said
    assert '"name": "Ada Berg", "age": 30, "occupation": "baker", "hobbies": ["chess"]' in said
    assert '{"index": 8, "name": "Place 8"}' in said
    assert WHO.home not in said  # ids of the world are of no use to it
    assert (chooser.tokens, chooser.drawn, chooser.asked) == (120, [], 1)


def test_an_index_that_is_none_is_asked_for_again_then_drawn() -> None:
    with model_server(picks(9), picks(2), picks(-1)) as (base, script):
        chooser = llm_chooser(impatient(base))
        assert chooser(question(), NAMES) == 2
        assert "index: 9 is none of the candidates; give a number from 0 to 8" in script.last_words(1)
        drawn = chooser(question("What is carried?"), NAMES)
    assert 0 <= drawn < 9
    ((number, why),) = chooser.drawn
    assert number == 1
    assert "none of the candidates" in why


def test_what_is_drawn_is_decided_by_the_seed_and_the_question_alone(caplog: pytest.LogCaptureFixture) -> None:
    def drawn(*answers: str, seed: int = 0) -> list[int]:
        replies = [refuses(500, "out of order") if one == "fail" else one for one in answers]
        with model_server(Script(*replies)) as (base, _):
            chooser = llm_chooser(impatient(base), seed=seed)
            return [chooser(question(), NAMES) for _ in range(3)]

    # Each failure is tried twice.
    failing = drawn("fail", "fail", picks(3), picks(4))
    assert failing[1:] == [3, 4]
    assert drawn("fail")[0] == failing[0]
    assert "drawn by the seed instead (Where do the things lie?)" in caplog.text
    assert {tuple(drawn("fail", seed=seed)) for seed in range(4)} != {tuple(drawn("fail"))}


def test_a_dead_server_or_an_empty_purse_is_not_asked_for_ever() -> None:
    with model_server(refuses(500, "out of order")) as (base, script):
        chooser = llm_chooser(impatient(base))
        assert all(0 <= chooser(question(), NAMES) < 9 for _ in range(6))
        assert len(script.asked) == 6
    assert [number for number, _ in chooser.drawn] == list(range(6))
    assert chooser.drawn[-1][1] == "not asked: it gave no answer before"
    with model_server(picks(1)) as (base, script):
        poor = llm_chooser(impatient(base, budget=Budget(tokens=0)))
        assert all(0 <= poor(question(), NAMES) < 9 for _ in range(2))
        assert script.asked == []
    assert "tokens" in poor.drawn[0][1]


def test_a_task_is_what_the_model_chose(helsinki: World, helsinki_people: Path) -> None:
    from vico.community.folder import read_community

    people: Community = read_community(helsinki_people)
    with model_server(picks(0)) as (base, script):
        chooser = llm_chooser(impatient(base))
        task = generate_task(helsinki, people, "search", seed=1, chooser=chooser)
    assert len(script.asked) == chooser.asked - sum(
        len(names) == 1 for one in task.subtasks for names in one.candidates.values()
    )
    for subtask in task.subtasks:
        assert subtask.true_source.name == subtask.candidates["Where is it lost?"][0]
    assert chooser.drawn == []
