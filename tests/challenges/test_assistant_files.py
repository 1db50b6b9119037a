"""Task files of the assistant challenge: they read back, and nonsense is refused with the field it is in."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import toy_city
from assistant_by_hand import CAFE_TABLE, CLEO, OUTDOORS, SHOP, subtask, task
from vico.challenges.assistant.tasks import Category, Task, read_task, write_task
from vico.errors import SchemaError
from vico.world.world import World


@pytest.fixture(scope="module")
def city() -> World:
    return toy_city.world()


def made(category: Category, city: World) -> Task:
    end = {"carry": CAFE_TABLE, "delivery": CAFE_TABLE, "search": None}[category]
    return task(category, [subtask([OUTDOORS, SHOP], end, source=1)], city, advanced=True)


@pytest.mark.parametrize("category", ["carry", "delivery", "search"])
def test_a_task_reads_back(city: World, tmp_path: Path, category: Category) -> None:
    written = made(category, city)
    write_task(tmp_path / "t.json", written)
    assert read_task(tmp_path / "t.json", world=city) == written
    assert read_task(tmp_path / "t.json") == written


def set_in(*path: str | int, value: Any) -> Callable[[Any], None]:
    def change(content: Any) -> None:
        for part in path[:-1]:
            content = content[part]
        content[path[-1]] = value

    return change


def set_room_of_thing(room: str) -> Callable[[Any], None]:
    return set_in("objects", 1, "room", value=room)


FIRST = ("subtasks", 0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (set_in("version", value=1), "version 2; generate the task anew"),
        (set_in("schema_name", value="vico.world"), "not a task file"),
        (set_in("steps", value="many"), r"steps: .*integer"),
        (set_in("steps", value=0), r"steps: .*greater than or equal to 1"),
        (set_in("start", value="25:00"), "start: "),
        (set_in("category", value="sell"), "category: "),
        (set_in("assistants", value=[]), "assistants: "),
        (set_in("mood", value="good"), "mood: Extra inputs"),
        (set_in("subtasks", value=[]), "subtasks: "),
        (set_in(*FIRST, "objects", value=["object_9"]), "subtask 0: no object is called 'object_9'"),
        (set_in(*FIRST, "objects", value=[]), r"subtasks\.0\.objects: "),
        (set_in(*FIRST, "index", value=3), "not numbered 0, 1, 2"),
        (set_in(*FIRST, "source", value=2), r"subtasks\.0: .*source 2 of 2 sources"),
        (set_in(*FIRST, "source", value=-1), r"subtasks\.0\.source: "),
        (set_in(*FIRST, "sources", 0, "radius", value=-0.5), r"subtasks\.0\.sources\.0\.radius: "),
        (set_in(*FIRST, "sources", 0, "kind", value="place"), r"subtasks\.0\.sources\.0: .*kind place needs a place"),
        (set_in(*FIRST, "sources", 1, "kind", value="outdoor"),
         r"subtasks\.0\.sources\.1: .*kind outdoor has no place"),
        (set_in(*FIRST, "sources", 1, "centre", value=[1.0, 2.0]), r"subtasks\.0\.sources\.1\.centre"),
        (set_in(*FIRST, "destination", value=None), "subtask 0: delivery and its destination do not go together"),
        (set_in("category", value="search"), "subtask 0: search and its destination do not go together"),
        (set_in("objects", 1, "id", value="object_0"), "two have the id 'object_0'"),
        (set_in("objects", 1, "name", value="red helmet"), "two have the name 'red helmet'"),
        (set_in("objects", 0, "holder", value=CLEO.agent), "object_0: 'resident_2', who holds it"),
        # What the world does not have.
        (set_in("world_digest", value="0" * 64), r"made for another world \(toy\)"),
        (set_in(*FIRST, "sources", 1, "place", value="place_bank"),
         r"subtasks\.0: the world has no place 'place_bank'"),
        (set_in(*FIRST, "destination", "place", value="place_bank"), "the world has no place 'place_bank'"),
        (set_in(*FIRST, "destination", "surface", "room", value="r_shop"), "the world has no room 'r_shop' in"),
        (set_in(*FIRST, "destination", "surface", "entity", value=7), "the world has no surface 7 in 'r_cafe'"),
        (set_room_of_thing("r_bank"), "objects: object_1: the world has no room 'r_bank'"),
        (set_in("objects", 1, "kind", value="piano"), "objects: object_1: there is no blue piano"),
        (set_in("objects", 1, "colour", value="octarine"), "there is no octarine helmet"),
    ],
)  # fmt: skip
def test_nonsense_by_hand_is_refused_with_its_field(
    city: World, tmp_path: Path, change: Callable[[Any], None], said: str
) -> None:
    path = tmp_path / "t.json"
    write_task(path, made("delivery", city))
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(SchemaError, match=said) as refusal:
        read_task(path, world=city)
    assert str(path) in str(refusal.value)


@pytest.mark.parametrize("content", ["[]", "{", "null", '"task"', ""])
def test_what_is_no_task_at_all_is_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "t.json"
    path.write_text(content)
    with pytest.raises(SchemaError, match=r"t\.json"):
        read_task(path)


def test_instructions_tell_what_is_known_and_nothing_else(city: World) -> None:
    told = made("carry", city).instructions()
    (one,) = told
    assert one.keys() == {"index", "category", "text", "person", "objects", "sources", "destination"}
    assert one["objects"] == ["red helmet"]
    assert one["person"] == {"agent": CLEO.agent, "name": CLEO.name, "looks": CLEO.looks}
    assert one["sources"][0].keys() == {"kind", "name", "place", "centre", "radius", "surface"}
    assert one["destination"]["surface"] == {"room": "r_cafe", "kind": "table", "entity": 200_001}
    assert made("search", city).instructions()[0]["destination"] is None
    # Which of the sources is right, where things lie and who has them is not told.
    assert not {"source", "candidates"} & one.keys()
    assert "12.5" not in json.dumps(told)
