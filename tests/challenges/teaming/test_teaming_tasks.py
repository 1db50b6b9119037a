"""Teaming tasks: drawn the same again, told without what robots are to find out, read strictly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vico.challenges.assistant.tasks import CANDIDATES
from vico.challenges.robot_episodes import world_and_people
from vico.challenges.robot_tasks import write_task_file
from vico.challenges.teaming import tasks as t
from vico.challenges.teaming.category import visible_kinds
from vico.challenges.teaming.challenge import generate_teaming_task
from vico.challenges.teaming.tasks import CATEGORIES, Category, TeamingTask, read_teaming_task
from vico.errors import SchemaError
from vico.io.files import write_json
from vico.world.world import World

MODELS = {"accompany": [{"h1"}], "guide": [{"go2"}], "spot": [{"drone"}, {"go2", "husky"}]}


@pytest.fixture(scope="module")
def tasks(helsinki_path: Path) -> dict[Category, TeamingTask]:
    world, people = world_and_people(helsinki_path, t.RESIDENTS)
    return {category: generate_teaming_task(world, people, category, seed=3) for category in CATEGORIES}


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_seed_gives_the_same_task_and_another_seed_another(
    category: Category, tasks: dict[Category, TeamingTask], helsinki_path: Path
) -> None:
    world, people = world_and_people(helsinki_path, t.RESIDENTS)
    assert generate_teaming_task(world, people, category, seed=3) == tasks[category]
    assert generate_teaming_task(world, people, category, seed=4) != tasks[category]


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_team_has_its_robots_on_free_ground_and_the_way_is_short(
    category: Category, tasks: dict[Category, TeamingTask], helsinki: World
) -> None:
    task = tasks[category]
    assert all(member.model in known for member, known in zip(task.team, MODELS[category], strict=True))
    assert len(task.team) == len(MODELS[category])
    for member in task.team:
        assert helsinki.walkable.is_connected(member.start.position)
        assert helsinki.walkable.clearance_of(*member.start.position) >= 1.0
    away = np.hypot(*np.subtract(task.team[-1].start.position, task.destination.centre[:2]))
    assert away <= t.MOST_WALK
    assert max(len(names) for names in task.candidates.values()) <= CANDIDATES


@pytest.mark.parametrize("category", ["accompany", "guide"])
def test_robots_are_not_told_how_the_person_walks(
    category: Category, tasks: dict[Category, TeamingTask], helsinki: World
) -> None:
    task = tasks[category]
    told = task.instruction()
    assert task.walk is not None
    assert task.person.name in told["text"]
    assert {"pace", "stay", "pauses", "walk"}.isdisjoint(told)
    assert told["waits_at"] == list(task.walk.waits_at.position)
    assert t.PACES[0] <= task.walk.pace <= t.PACES[1]
    assert all(t.PAUSES[0] <= pause.seconds <= t.PAUSES[1] for pause in task.walk.pauses)
    assert bool(task.walk.pauses) == (category == "guide")
    if category == "accompany":
        assert helsinki.place_by_id[str(task.destination.place)].entrance is not None


def test_robots_are_not_told_where_the_thing_lies(tasks: dict[Category, TeamingTask]) -> None:
    task = tasks["spot"]
    assert task.thing is not None
    assert task.instruction()["object"] == task.thing.name
    x, y, _ = task.thing.position
    assert f"{x}, {y}" not in str(task.instruction())
    assert np.hypot(*np.subtract(task.thing.position, task.destination.centre)[:2]) <= t.AREA
    assert task.thing.kind in {kind.kind for kind in visible_kinds()}


def test_a_task_file_is_read_back_and_nonsense_is_refused(
    tasks: dict[Category, TeamingTask], helsinki: World, tmp_path: Path
) -> None:
    path = tmp_path / "task.json"
    for task in tasks.values():
        write_task_file(path, task)
        assert read_teaming_task(path, world=helsinki) == task
    spot, guide = (tasks[category].model_dump(mode="json") for category in ("spot", "guide"))
    accompany = tasks["accompany"].model_dump(mode="json")
    for content, says in (
        (spot | {"version": 0}, "not a teaming task file of version 1"),
        (spot | {"category": "juggle"}, "category"),
        (spot | {"thing": None}, "no thing to look for"),
        (spot | {"thing": spot["thing"] | {"kind": "anvil"}}, "no .* anvil"),
        (spot | {"team": spot["team"][:1]}, "a team of 1; it takes 2"),
        (spot | {"team": [spot["team"][0], spot["team"][1] | {"model": "tank"}]}, "no robot 'tank'"),
        (guide | {"walk": None}, "nobody walks along"),
        (guide | {"walk": guide["walk"] | {"pace": 0.0}}, "pace"),
        (guide | {"world_digest": "0" * 64}, "another world"),
        (accompany | {"destination": accompany["destination"] | {"place": "nowhere"}}, "no place 'nowhere'"),
        (accompany | {"destination": spot["destination"]}, "no door"),
        (accompany | {"secret": 1}, "secret"),
    ):
        write_json(path, content)
        with pytest.raises(SchemaError, match=says):
            read_teaming_task(path, world=helsinki)
    path.write_text(path.read_text()[:200])
    with pytest.raises(SchemaError, match=r"task\.json"):
        read_teaming_task(path)
