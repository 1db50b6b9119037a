"""What schedule items are about: said by the author, or told by rule where the author was silent."""

from __future__ import annotations

from pathlib import Path

from vico.community import ActivityTag, Community, check_community, read_community, with_tags, write_community
from vico.community.model import ItemType
from vico.world.world import World


def silent(community: Community) -> Community:
    """The same community by an author that gives no tags."""
    residents = [
        r.model_copy(update={"schedule": [item.model_copy(update={"tag": None}) for item in r.schedule]})
        for r in community.residents
    ]
    return community.model_copy(update={"residents": residents})


def test_the_author_tags_every_item(community: Community) -> None:
    assert [item for r in community.residents for item in r.schedule if item.tag is None] == []


def test_a_silent_authors_folder_is_read_with_tags(community: Community, town: World, tmp_path: Path) -> None:
    write_community(silent(community), tmp_path / "people")
    read = read_community(tmp_path / "people", town)
    assert read == with_tags(silent(community), town.places)
    assert check_community(read, town) == []


def test_rules_and_author_agree_on_what_needs_no_words(community: Community, town: World) -> None:
    sure = {ActivityTag.SLEEP, ActivityTag.COMMUTE, ActivityTag.MEAL_HOME}
    told = [item.tag for r in with_tags(silent(community), town.places).residents for item in r.schedule]
    said = [item.tag for r in community.residents for item in r.schedule]
    assert [(a, b) for a, b in zip(said, told, strict=True) if a != b and {a, b} & sure] == []


def test_words_decide_nothing(community: Community, town: World) -> None:
    def muddled(c: Community) -> Community:
        residents = [
            r.model_copy(
                update={"schedule": [i.model_copy(update={"activity": "Run and eat at work"}) for i in r.schedule]}
            )
            for r in c.residents
        ]
        return c.model_copy(update={"residents": residents})

    tags = [[i.tag for i in r.schedule] for r in with_tags(silent(community), town.places).residents]
    assert [[i.tag for i in r.schedule] for r in with_tags(muddled(silent(community)), town.places).residents] == tags


def test_a_tag_that_does_not_go_with_the_type_is_found(community: Community, town: World) -> None:
    first = community.residents[0]
    items = [
        item.model_copy(update={"tag": ActivityTag.SHOP}) if item.type is ItemType.SLEEP else item
        for item in first.schedule
    ]
    people = [first.model_copy(update={"schedule": items}), *community.residents[1:]]
    found = check_community(community.model_copy(update={"residents": people}), town)
    assert found
    assert all("does not go with its type" in finding.what for finding in found)
