"""Floor plans from a language model: mended by the validator's findings, and never silently replaced."""

from __future__ import annotations

import copy
import json
import threading
from pathlib import Path
from typing import Any

import pytest

from http_server import Answer, Request, serve
from llm_server import Script, model_server, refuses, says
from vico.errors import SourceError
from vico.llm import Budget, Connection, Endpoint, LanguageModel, Sampling
from vico.world.check.indoors import walkable_inside
from vico.world.model import Place
from vico.world.world import World
from vico.worldgen.indoor.catalogue import use_of
from vico.worldgen.indoor.layout_library import Layout, findings_of
from vico.worldgen.indoor.layout_llm import EXAMPLE, LlmLayoutAuthor, furnish_drawn
from vico.worldgen.indoor.stage import Indoors, furnish
from vico.worldgen.stages import Stages


def example(use: str, **changes: Any) -> str:
    """The example for another use, small enough for any place."""
    layout = copy.deepcopy(EXAMPLE) | {"use": use} | changes
    return json.dumps(layout)


def small(use: str) -> str:
    """One room of 5 x 5 m."""
    rooms = [{"id": "all", "kind": "shop", "rect": [0, 0, 5, 5]}]
    return example(use, size=[5.0, 5.0], rooms=rooms, doors=[{"between": ["all", "outside"], "at": [2.5, 0]}])


def author_at(base: str, *, workers: int = 1, **options: Any) -> LlmLayoutAuthor:
    connection = Connection(timeout=5.0, retries=1, sleep=lambda seconds: None)
    return LlmLayoutAuthor(LanguageModel(Endpoint(base, "tiny"), connection=connection, **options), workers=workers)


@pytest.fixture
def pubs(helsinki: World) -> list[Place]:
    return [p for p in helsinki.places if use_of(p.category, p.kind) == "bar" and p.building is not None][:3]


def drawn(helsinki: World, places: list[Place], author: LlmLayoutAuthor) -> tuple[Indoors, list[Any]]:
    return furnish_drawn(places, author=author, buildings=helsinki.buildings, height=helsinki.height)


def test_the_example_is_without_a_fault() -> None:
    assert findings_of(Layout.model_validate_json(json.dumps(EXAMPLE))) == []


def test_a_bad_plan_is_mended_and_built(helsinki: World, pubs: list[Place]) -> None:
    pub = pubs[0]
    wide = json.loads(small("bar"))
    wide["rooms"][0]["rect"] = [0, 0, 7, 5]
    with model_server(json.dumps(wide), small("bakery"), small("bar")) as (base, script):
        made, left = drawn(helsinki, [pub], author_at(base))
    assert left == []
    assert [room.kind for room in made.rooms] == ["shop"]
    assert walkable_inside(made.rooms, made.furniture) == []
    asked = script.asked[0]["messages"]
    assert json.dumps(pub.name, ensure_ascii=False) in asked[1]["content"]
    assert '"use": "bar"' in asked[1]["content"]
    assert "restaurant_kitchen" in asked[0]["content"]
    assert "store_rack" in asked[0]["content"]
    assert "it leaves the plan of 5 x 5 m" in script.last_words(1)
    assert "it has to be 'bar'" in script.last_words(2)


def test_a_place_whose_plan_stays_bad_is_planned_by_rule_and_reported(helsinki: World, pubs: list[Place]) -> None:
    with model_server(example("bar", size=[50.0, 50.0])) as (base, script):
        author = author_at(base)
        made, left = drawn(helsinki, [pubs[0]], author)
    assert len(script.asked) == 4
    assert [d.id for d in left] == [pubs[0].id]
    assert pubs[0].name in left[0].reason
    assert "is larger than" in left[0].reason
    assert left[0].reason.endswith("planned by rule")
    by_rule = furnish([pubs[0]], buildings=helsinki.buildings, height=helsinki.height)
    assert made.rooms == by_rule.rooms
    assert author.drawn == 0


def test_a_spent_budget_leaves_the_rest_to_the_rules_one_by_one(helsinki: World, pubs: list[Place]) -> None:
    with model_server(small("bar")) as (base, script):
        _, left = drawn(helsinki, pubs, author_at(base, budget=Budget(calls=1)))
    assert len(script.asked) == 1
    assert [d.id for d in left] == [p.id for p in pubs[1:]]
    assert all("all 1 calls of the budget are spent" in d.reason for d in left)


def test_a_wrong_setup_stops_the_build(helsinki: World, pubs: list[Place]) -> None:
    with (
        model_server(Script(small("bar"), key="secret")) as (base, _),
        pytest.raises(SourceError, match="VICO_LLM_KEY"),
    ):
        drawn(helsinki, pubs, author_at(base))
    with model_server(refuses(503, "down")) as (base, _), pytest.raises(SourceError, match="down"):
        drawn(helsinki, pubs, author_at(base))


def test_a_server_that_dies_midway_costs_the_rest_their_plans_and_is_reported(
    helsinki: World, pubs: list[Place]
) -> None:
    with model_server(small("bar"), refuses(500, "out of memory")) as (base, _):
        _, left = drawn(helsinki, pubs, author_at(base))
    assert [d.id for d in left] == [p.id for p in pubs[1:]]
    assert all("out of memory" in d.reason for d in left)


def test_it_serves_as_any_author_does(helsinki: World, pubs: list[Place]) -> None:
    with model_server(small("bar"), "no") as (base, _):
        author = author_at(base)
        made = furnish(pubs[:2], buildings=helsinki.buildings, height=helsinki.height, author=author)
    assert (author.drawn, len(author.dropped)) == (1, 1)
    assert "shop" in {room.kind for room in made.rooms}


def test_several_are_asked_for_at_a_time(helsinki: World, pubs: list[Place]) -> None:
    meeting = threading.Barrier(3, timeout=10)

    def answer(request: Request) -> Answer:
        meeting.wait()  # goes on when all three calls are here
        return says(small("bar"))

    with serve(answer) as base:
        author = author_at(f"{base}/v1", workers=3)
        _, left = drawn(helsinki, pubs, author)
    assert (author.drawn, left) == (3, [])


def test_a_stage_knows_its_author_and_keeps_what_was_drawn(helsinki: World, pubs: list[Place], tmp_path: Path) -> None:
    def built(author: LlmLayoutAuthor) -> tuple[Stages, Any]:
        stages = Stages(tmp_path)
        stages.register(author, author.digest)
        height = stages.register(helsinki.height, "ground")
        return stages, stages.run(
            "indoor", furnish_drawn, pubs[:2], author=author, buildings=helsinki.buildings, height=height
        )

    with model_server(small("bar"), "no") as (base, _):
        _, (first, left) = built(author_at(base))
    stages, (again, still_left) = built(author_at(base))
    assert stages.kept == ["indoor"]
    assert (again.rooms, still_left) == (first.rooms, left)
    assert len(left) == 1
    with pytest.raises(SourceError, match="nobody listens"):
        built(author_at(base, sampling=Sampling(temperature=0.9)))


def test_branches_of_a_chain_in_rooms_of_one_size_share_a_plan(helsinki: World, pubs: list[Place]) -> None:
    twins = [pubs[0], pubs[0].model_copy(update={"id": "twin"})]
    with model_server(small("bar")) as (base, script):
        author = author_at(base)
        made, left = drawn(helsinki, twins, author)
    assert (len(script.asked), author.drawn, len(made.rooms), left) == (1, 2, 2, [])


def test_a_recording_builds_the_same_rooms_with_the_server_gone(
    helsinki: World, pubs: list[Place], tmp_path: Path
) -> None:
    def answer(request: Request) -> Answer:
        name = json.loads(request.body)["messages"][1]["content"]
        return says(small("bar") if pubs[1].name not in name else "I'd rather not.")

    recording = tmp_path / "calls.jsonl"
    with serve(answer) as base:
        author = author_at(f"{base}/v1", record=recording)
        first = drawn(helsinki, pubs, author)
    replayed = LlmLayoutAuthor(LanguageModel.from_environment({"VICO_LLM_REPLAY": str(recording)}))
    again = drawn(helsinki, pubs, replayed)
    assert (again[0].rooms, again[1]) == (first[0].rooms, first[1])
    assert [d.id for d in first[1]] == [pubs[1].id]
    assert replayed.digest == author.digest
