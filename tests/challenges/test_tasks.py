"""Delivery tasks drawn from a real neighbourhood."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import toy_city
from vico.assets.models.movable import movable_colours, movable_kinds
from vico.challenges.assistant.choose import CANDIDATES
from vico.challenges.assistant.delivery import SOURCE_RADIUS, SUBTASKS, delivered, generate_delivery
from vico.challenges.assistant.model import Task, read_task, write_task
from vico.errors import EmptyInputError, SchemaError
from vico.world.folder import World
from vico.world.routing import Router

SEEDS = range(4)


@pytest.fixture(scope="module")
def tasks(helsinki: World) -> list[Task]:
    return [generate_delivery(helsinki, seed=seed) for seed in SEEDS]


def test_the_same_seed_gives_the_same_task_and_another_another(helsinki: World, tasks: list[Task]) -> None:
    assert generate_delivery(helsinki, seed=1) == tasks[1]
    assert len({task.model_dump_json() for task in tasks}) == len(tasks)


def test_a_second_assistant_changes_nothing_else(helsinki: World, tasks: list[Task]) -> None:
    two = generate_delivery(helsinki, seed=1, assistants=2)
    assert two.model_copy(update={"assistants": two.assistants[:1]}) == tasks[1]
    apart = np.hypot(*np.subtract(two.assistants[0].position, two.assistants[1].position))
    assert apart <= 6.0


def test_every_episode_has_six_errands_over_things_with_names_of_their_own(tasks: list[Task]) -> None:
    for task in tasks:
        assert len(task.subtasks) == SUBTASKS
        assert len({thing.name for thing in task.objects}) == len(task.objects)
        assert sorted(i for s in task.subtasks for i in s.objects) == sorted(thing.id for thing in task.objects)
        assert all(thing.kind in movable_kinds() and thing.colour in movable_colours() for thing in task.objects)


def test_choices_are_made_among_nine(tasks: list[Task]) -> None:
    for task in tasks:
        kinds = {thing.id: thing.kind for thing in task.objects}
        for subtask in task.subtasks:
            assert len(set(subtask.object_candidates)) == CANDIDATES
            assert {kinds[i] for i in subtask.objects} <= set(subtask.object_candidates)
            assert len(subtask.source_candidates) == CANDIDATES
            assert subtask.source.name in subtask.source_candidates
            # Destinations nearer than 20 m to the source are no candidates.
            assert 1 <= len(subtask.destination_candidates) <= CANDIDATES
            assert subtask.destination.name in subtask.destination_candidates


def test_things_lie_inside_their_source(helsinki: World, tasks: list[Task]) -> None:
    for task in tasks:
        things = {thing.id: thing for thing in task.objects}
        for subtask in task.subtasks:
            for thing in (things[i] for i in subtask.objects):
                if subtask.source.kind == "outdoor":
                    assert thing.room is None
                    assert np.hypot(*np.subtract(thing.position[:2], subtask.source.centre[:2])) <= SOURCE_RADIUS
                    continue
                room = helsinki.room_by_id[thing.room]
                assert room.place == subtask.source.place
                c, s = np.cos(room.yaw), np.sin(room.yaw)
                x, y = np.subtract(thing.position[:2], room.centre[:2])
                inside = np.abs([c * x + s * y, c * y - s * x]) <= np.asarray(room.size[:2]) / 2
                assert inside.all()


def test_things_and_places_can_be_walked_to(helsinki: World, tasks: list[Task]) -> None:
    router = Router(helsinki.walkable)
    for task in tasks:
        start = task.assistants[0].position
        assert helsinki.walkable.is_connected(start)
        for subtask in task.subtasks:
            for region in (subtask.source, subtask.destination):
                assert router.path(np.asarray(start), np.asarray(region.centre[:2])) is not None, region.name
        for thing in task.objects:
            if thing.room is None:
                assert helsinki.walkable.is_connected(thing.position[:2]), thing.name


def test_nothing_is_delivered_yet(helsinki: World, tasks: list[Task]) -> None:
    class AtStart:
        def __init__(self, task: Task) -> None:
            self.things = {thing.id: thing for thing in task.objects}

        def object_position(self, name: str) -> np.ndarray:
            return np.array(self.things[name].position)

        def object_room(self, name: str) -> str | None:
            return self.things[name].room

        def object_holder(self, name: str) -> str | None:
            return None

    for task in tasks:
        assert not any(delivered(subtask, AtStart(task), helsinki) for subtask in task.subtasks)


def test_instructions_tell_no_position_of_any_thing(tasks: list[Task]) -> None:
    for task in tasks:
        told = task.instructions()
        rooms = {thing.room for thing in task.objects if thing.room is not None}
        assert not any(room in json.dumps(told) for room in rooms)
        for errand in told:
            assert errand.keys() == {"index", "text", "objects", "source", "destination"}
            regions = errand["source"], errand["destination"]
            assert all(region.keys() == {"kind", "name", "place", "centre", "radius"} for region in regions)
            # The middles of regions are all that is told of where: no thing lies on one.
            middles = np.array([region["centre"][:2] for region in regions])
            for thing in task.objects:
                assert np.hypot(*(middles - thing.position[:2]).T).min() > 0.2
        assert {thing.name for thing in task.objects} == {name for errand in told for name in errand["objects"]}


def test_the_chooser_decides(helsinki: World) -> None:
    asked: list[str] = []

    def last(question: str, candidates: object) -> int:
        asked.append(question)
        return len(candidates) - 1  # type: ignore[arg-type]

    task = generate_delivery(helsinki, seed=0, chooser=last)
    assert len(asked) == 3 * SUBTASKS
    kinds = {thing.id: thing.kind for thing in task.objects}
    assert all(kinds[s.objects[0]] == s.object_candidates[-1] for s in task.subtasks)
    assert all(s.source.name == s.source_candidates[-1] for s in task.subtasks)


def test_a_task_file_reads_back(tasks: list[Task], helsinki: World, tmp_path: Path) -> None:
    write_task(tmp_path / "t.json", tasks[0])
    assert read_task(tmp_path / "t.json", world_digest=helsinki.digest) == tasks[0]


def test_a_task_file_of_another_version_world_or_shape_is_refused(tasks: list[Task], tmp_path: Path) -> None:
    path = tmp_path / "t.json"
    write_task(path, tasks[0])
    content = json.loads(path.read_text())
    with pytest.raises(SchemaError, match="another world"):
        read_task(path, world_digest="0" * 64)
    path.write_text(json.dumps({**content, "version": 2}))
    with pytest.raises(SchemaError, match="version 1"):
        read_task(path)
    path.write_text(json.dumps({**content, "steps": "many"}))
    with pytest.raises(SchemaError, match=r"steps: .*; generate the task anew"):
        read_task(path)
    path.write_text("[]")
    with pytest.raises(SchemaError):
        read_task(path)


def test_a_world_with_too_few_places_says_so() -> None:
    with pytest.raises(EmptyInputError, match="use a larger world"):
        generate_delivery(toy_city.world(), seed=0)
