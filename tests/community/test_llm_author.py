"""The author that asks a model: against a scripted server that answers well, and what stands when it does not answer.

What the script writes says nothing of any model: only that what a model writes well comes through whole.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from http_server import Answer, Request, serve
from scripted_author import ScriptedAuthor, data_of
from vico.community import (
    Author,
    Community,
    build_community,
    check_community,
    digest_of,
    procedural_author,
    read_community,
    write_community,
)
from vico.community.llm import LlmCommunityAuthor
from vico.community.model import CommunityFinding, Origin
from vico.errors import InputError, SchemaError
from vico.llm import Budget, Connection, Endpoint, LanguageModel
from vico.world.world import World


def author_of(base: str, *, workers: int = 4, only: bool = False, **options: object) -> LlmCommunityAuthor:
    connection = Connection(timeout=20.0, retries=0, sleep=lambda seconds: None)
    model = LanguageModel(Endpoint(f"{base}/v1", "scripted"), connection=connection, **options)  # type: ignore[arg-type]
    return LlmCommunityAuthor(model, workers=workers, only=only)


def built(town: World, author: Author, residents: int = 15) -> Community:
    return build_community(town, residents=residents, seed=0, author=author)


@pytest.fixture(scope="module")
def written(town: World) -> tuple[Community, ScriptedAuthor, LlmCommunityAuthor]:
    script = ScriptedAuthor()
    with serve(script) as base:
        author = author_of(base)
        community = built(town, author)
    return community, script, author


Written = tuple[Community, ScriptedAuthor, LlmCommunityAuthor]


def test_what_the_model_writes_well_is_the_community(written: Written, town: World) -> None:
    community, _, author = written
    assert check_community(community, town) == []
    assert community.author == "scripted"
    assert all(r.name.split()[1].startswith("Script") for r in community.residents)
    assert all("Kites fill the hall cupboard." in r.biography for r in community.residents)
    assert all(any(i.activity == "Sleep on the left side" for i in r.schedule) for r in community.residents)
    assert all(group.activity == "Mend kites" for group in community.groups)
    assert author.report is not None
    assert author.report.authorship.fallen_back == []
    assert author.report.authorship == community.authorship
    assert author.report.authorship.written == 15 * 3 + 1


def test_bodies_homes_and_ages_are_those_of_the_procedural_author(written: Written, town: World) -> None:
    community, _, _ = written
    for resident, base in zip(
        community.residents, procedural_author(town, residents=15, seed=0).residents, strict=True
    ):
        assert (resident.age, resident.appearance, resident.home, resident.household, resident.spawn) == (
            base.age, base.appearance, base.home, base.household, base.spawn,
        )  # fmt: skip


def test_questions_have_the_papers_inputs_and_their_replies_its_fields(written: Written) -> None:
    _, script, _ = written
    by_record = {body["response_format"]["json_schema"]["name"]: body for body in script.asked}
    people, day = data_of(by_record["Characters"]), data_of(by_record["DayPlan"])
    assert {"name", "function"} <= people["workplaces"][0].keys()
    assert {"suggested_name", "age", "looks"} <= people["people"][0].keys()
    assert set(day) == {"character", "places", "appointments"}
    assert {"name", "building", "function"} <= day["places"][0].keys()
    definitions = by_record["DayPlan"]["response_format"]["json_schema"]["schema"]["$defs"]
    activity = definitions["ActivityReply"]["properties"]
    assert set(activity) == {"type", "activity", "place", "building", "start_time", "end_time"}
    assert activity["type"]["enum"] == ["commute", "meal", "sleep", "main"]
    # A place that the resident doesn't know can't be said at all where the server holds replies to the schema.
    assert activity["place"]["anyOf"][0]["enum"] == [place["name"] for place in day["places"]]


def test_ways_take_as_long_as_our_router_says(written: Written, town: World) -> None:
    community, _, _ = written
    assert community.authorship is not None
    moved = [one.moved for one in community.authorship.items if one.item.endswith(".schedule")]
    # The script allows four fifths of the way from home: something had to be moved, and by minutes only.
    assert 0 < max(moved) < 20


def test_meetings_stand_in_the_days_of_all_members(written: Written) -> None:
    community, _, _ = written
    people = community.resident_by_id
    for group in community.groups:
        for member in group.members:
            assert any((i.place, i.start) == (group.place, group.start) for i in people[member].schedule)


def test_the_order_of_replies_changes_nothing(written: Written, town: World) -> None:
    with serve(ScriptedAuthor()) as base:
        assert built(town, author_of(base, workers=1)) == written[0]
        assert built(town, author_of(base, workers=16)) == written[0]


def test_a_recorded_session_gives_the_same_bytes_without_a_server(town: World, tmp_path: Path) -> None:
    with serve(ScriptedAuthor()) as base:
        first = built(town, author_of(base, record=tmp_path / "calls.jsonl"))
    again = built(town, author_of("http://127.0.0.1:9", replay=tmp_path / "calls.jsonl"))
    write_community(first, tmp_path / "first")
    write_community(again, tmp_path / "again")
    for file in sorted((tmp_path / "first").iterdir()):
        assert file.read_bytes() == (tmp_path / "again" / file.name).read_bytes()
    assert digest_of(first) == digest_of(again)


def test_a_session_in_which_questions_failed_is_replayed_too(town: World, tmp_path: Path) -> None:
    def failing(record: str, data: dict[str, object], body: dict[str, object]) -> Answer | None:
        name = str(data.get("character", {}).get("name", ""))  # type: ignore[attr-defined]
        return Answer(503, b"busy") if record == "DayPlan" and name.endswith("a") else None

    with serve(ScriptedAuthor(failing)) as base:
        first = built(town, author_of(base, workers=1, record=tmp_path / "calls.jsonl"))
    assert first.authorship is not None
    assert {one.origin for one in first.authorship.fallen_back} == {Origin.NO_ANSWER}
    assert built(town, author_of("http://127.0.0.1:9", replay=tmp_path / "calls.jsonl")) == first


def test_a_recording_of_something_else_is_refused(town: World, tmp_path: Path) -> None:
    with serve(ScriptedAuthor()) as base:
        built(town, author_of(base, record=tmp_path / "calls.jsonl"), residents=2)
    author = author_of("http://127.0.0.1:9", replay=tmp_path / "calls.jsonl")
    with pytest.raises(InputError, match="nothing that is asked was recorded so"):
        build_community(town, residents=2, seed=1, author=author)


def test_answers_are_asked_for_once(town: World, tmp_path: Path) -> None:
    script = ScriptedAuthor()
    with serve(script) as base:
        first = built(town, author_of(base, cache=tmp_path / "cache"), residents=4)
        asked = len(script.asked)
        assert built(town, author_of(base, cache=tmp_path / "cache"), residents=4) == first
    assert len(script.asked) == asked


@pytest.mark.parametrize("budget", [Budget(tokens=0), Budget(calls=0)])
def test_a_budget_of_nothing_leaves_everything_to_the_rules(town: World, community: Community, budget: Budget) -> None:
    with serve(ScriptedAuthor()) as base:
        author = author_of(base, budget=budget)
        made = built(town, author)
    assert made.model_copy(update={"authorship": None}) == community
    assert made.author == "procedural"
    assert author.report is not None
    assert "raise the limit" in author.report.over
    assert author.report.authorship.written == 0
    assert {one.origin for one in author.report.authorship.fallen_back} == {Origin.NO_ANSWER}


def test_a_budget_that_runs_out_keeps_what_was_written(town: World) -> None:
    with serve(ScriptedAuthor()) as base:
        author = author_of(base, budget=Budget(calls=12), workers=1)
        made = built(town, author)
    assert check_community(made, town) == []
    assert author.model.budget.spent.calls == 12
    assert author.report is not None
    assert 0 < author.report.authorship.written < 46
    assert "all 12 calls" in author.report.over


def test_a_dead_server_leaves_everything_to_the_rules(town: World, community: Community) -> None:
    author = author_of("http://127.0.0.1:9")
    made = built(town, author)
    assert made.model_copy(update={"authorship": None}) == community
    assert author.report is not None
    assert "is the server running" in author.report.over


def test_a_wrong_key_is_asked_about_once(town: World) -> None:
    asked: list[Request] = []

    def locked(request: Request) -> Answer:
        asked.append(request)
        return Answer(401, b'{"error": {"message": "no"}}')

    with serve(locked) as base:
        author = author_of(base, workers=1)
        built(town, author, residents=4)
    assert author.report is not None
    assert "set VICO_LLM_KEY" in author.report.over
    assert len(asked) == 1


def test_the_model_alone_or_nothing(town: World) -> None:
    with (
        serve(ScriptedAuthor()) as base,
        pytest.raises(InputError, match=r"46 of 46 items were not written by scripted"),
    ):
        built(town, author_of(base, only=True, budget=Budget(tokens=0)))
    with serve(ScriptedAuthor()) as base:
        assert built(town, author_of(base, only=True), residents=4).author == "scripted"


def test_who_the_validator_named_is_not_asked_for_again(town: World) -> None:
    findings = [CommunityFinding("resident_2.schedule[1]", "wrong", "mend it")]
    with serve(ScriptedAuthor()) as base:
        made = author_of(base)(town, residents=6, seed=0, findings=findings)
    assert made.authorship is not None
    by_item = {one.item: one for one in made.authorship.items}
    assert by_item["resident_2.schedule"].origin is Origin.NOT_ASKED
    assert by_item["resident_5.schedule"].origin is Origin.WRITTEN


def test_one_resident_is_no_network(town: World) -> None:
    with serve(ScriptedAuthor()) as base:
        made = built(town, author_of(base), residents=1)
    assert check_community(made, town) == []
    assert made.residents[0].name == "Ada Scripta" or made.residents[0].name == "Ode Scripta"


def test_who_wrote_what_is_kept_with_the_community(written: Written, tmp_path: Path, town: World) -> None:
    community, _, _ = written
    write_community(community, tmp_path / "people")
    assert read_community(tmp_path / "people", town).authorship == community.authorship
    file = tmp_path / "people" / "authorship.json"
    file.write_text(file.read_text().replace("scripted", "somebody"))
    with pytest.raises(SchemaError, match=r"authorship\.json: changed since"):
        read_community(tmp_path / "people")


def test_a_community_without_a_model_has_no_such_file(community: Community, tmp_path: Path) -> None:
    write_community(community, tmp_path / "people")
    assert not (tmp_path / "people" / "authorship.json").exists()


def test_no_questions_at_a_time_is_refused(town: World) -> None:
    with pytest.raises(InputError, match="0 questions at a time"):
        author_of("http://127.0.0.1:9", workers=0)
