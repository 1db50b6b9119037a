"""Episodes with planners that ask a model, in the toy city: alone, in pairs, with servers that fail."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import toy_city
from llm_server import model_server, refuses
from scripted_planner import ScriptedPlanner, nearest, planner_server
from vico.assets.models.movable import movable_kinds
from vico.challenges.assistant.challenge import play_task
from vico.challenges.assistant.tasks import Person, Region, Start, Subtask, Task, TaskObject
from vico.challenges.records import EpisodeRecord, check_methods, load_challenge
from vico.community.folder import digest_of
from vico.errors import InputError

STEPS = 120
KIND = sorted(movable_kinds())[0]
GREEN = Region(kind="outdoor", name="South Green", place=None, centre=(0.0, -12.0, 0.0), radius=8.0)
LAWN = Region(kind="outdoor", name="West Lawn", place=None, centre=(-15.0, -10.0, 0.0), radius=8.0)
BANK = Region(kind="outdoor", name="East Bank", place=None, centre=(12.0, -8.0, 0.0), radius=8.0)


def thing(index: int, colour: str, x: float, y: float) -> TaskObject:
    name = f"{colour} {KIND}"
    position = (x, y, x * toy_city.SLOPE)
    return TaskObject(
        id=f"object_{index}_0", kind=KIND, colour=colour, name=name, position=position, yaw=0.0, room=None
    )


def task(assistants: int) -> Task:
    things = [thing(0, "red", 1.5, -13.0), thing(1, "blue", -14.0, -12.0), thing(2, "green", 13.0, -10.0)]
    starts = [Start(position=(0.0, -5.0), yaw=-1.5), Start(position=(3.0, -5.0), yaw=3.1)]
    person = Person(agent="resident_0", name="Ada Berg", looks="in a blue shirt")
    subtasks = [
        Subtask(
            index=k,
            text=f"Ada Berg asks: find the {what.name}, lost at {region.name}.",
            person=person,
            objects=[what.id],
            sources=[region],
            source=0,
            destination=None,
            candidates={},
        )
        for k, (what, region) in enumerate(zip(things, (GREEN, LAWN, BANK), strict=True))
    ]
    return Task(
        category="search",
        advanced=False,
        world="toy",
        world_digest=toy_city.world().digest,
        community_digest=digest_of(toy_city.community()),
        seed=3,
        start="09:00",
        steps=STEPS,
        assistants=starts[:assistants],
        objects=things,
        subtasks=subtasks,
    )


def play(method: str, *, assistants: int = 1) -> EpisodeRecord:
    return play_task(toy_city.world(), toy_city.community(), task(assistants), method=method)


@pytest.fixture
def named(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    for name in ("VICO_LLM_KEY", "OPENAI_BASE_URL", "OPENAI_API_KEY", "VICO_LLM_REPLAY", "VICO_LLM_RECORD"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("VICO_LLM_MODEL", "planner")
    return monkeypatch


def test_an_episode_with_a_model_is_played_and_replayed(named: pytest.MonkeyPatch, tmp_path: Path) -> None:
    server = ScriptedPlanner(nearest)
    named.setenv("VICO_LLM_RECORD", str(tmp_path / "calls.jsonl"))
    with planner_server(server) as base:
        named.setenv("VICO_LLM_BASE_URL", base)
        played = play("llm")
    assert sum(part.success for part in played.parts) == 3
    assert played.tokens == 120 * len(server.told) > 0
    assert played.fault_counts == {}
    # Where there is one choice alone nobody is asked.
    assert all(len(told["actions"]) >= 2 for told in server.told)
    assert server.told[-1]["previous"][-1]["outcome"] == "found it and reported it: done"
    named.delenv("VICO_LLM_RECORD")
    named.setenv("VICO_LLM_REPLAY", str(tmp_path / "calls.jsonl"))
    again = play("llm")
    assert (again.state_hash, again.tokens) == (played.state_hash, played.tokens)


def test_a_dead_server_ends_no_episode_and_the_record_says_so(named: pytest.MonkeyPatch) -> None:
    with model_server(refuses(403, "not you")) as (base, script):
        named.setenv("VICO_LLM_BASE_URL", base)
        record = play("llm")
        assert len(script.asked) == 1  # a key that is refused is refused again
    assert sum(part.success for part in record.parts) == 3
    assert record.fault_counts.keys() == {"model"}
    assert record.fault_counts["model"] == len(record.faults) >= 2
    assert (record.faults[0].step, record.faults[0].kind) == (1, "model")
    assert "403" in record.faults[0].reason
    assert record.tokens == 0


def test_pairs_may_be_mixed(named: pytest.MonkeyPatch) -> None:
    server = ScriptedPlanner(nearest, lines=("I begin with the nearest.",))
    with planner_server(server) as base:
        named.setenv("VICO_LLM_BASE_URL", base)
        mixed = play("heuristic+llm", assistants=2)
    assert mixed.method == "heuristic+llm"
    assert mixed.tokens == 120 * len(server.told) > 0
    assert mixed.fault_counts == {}
    assert all(part.success for part in mixed.parts)
    # It sees the colleague at once, and says its line; the heuristic's neither says nor hears anything.
    assert [line["speaker"] for line in server.told[-1]["conversation"]] == ["assistant_1"]


def test_offline_pairs_need_no_model(named: pytest.MonkeyPatch) -> None:
    named.delenv("VICO_LLM_MODEL")
    record = play("heuristic+ours", assistants=2)
    assert (record.method, record.tokens, record.fault_counts) == ("heuristic+ours", 0, {})
    assert all(part.success for part in record.parts)


def test_a_pair_with_a_model_that_nobody_named_is_refused_before_it_begins(named: pytest.MonkeyPatch) -> None:
    named.delenv("VICO_LLM_BASE_URL", raising=False)
    with pytest.raises(InputError, match="method llm: no language model is named"):
        play("heuristic+llm", assistants=2)


def test_a_method_that_asks_a_model_is_refused_before_anything_is_played(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in os.environ if name.startswith(("VICO_LLM_", "OPENAI_"))]:
        monkeypatch.delenv(name)
    for challenge in ("assistant", "commute"):
        with pytest.raises(InputError, match="VICO_LLM_BASE_URL"):
            check_methods(load_challenge(challenge), ["llm"])
