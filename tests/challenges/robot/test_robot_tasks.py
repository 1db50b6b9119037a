"""Robot tasks: drawn the same again, told without what robots are to find out, judged by where things are."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vico.assets.models.movable import movable_kinds
from vico.assets.robots import robot_model
from vico.challenges.assistant.evaluate import entrance_of
from vico.challenges.robot.evaluate import CAUSES, RobotJudge
from vico.challenges.robot.generate import generate_robot_task, portable_kinds
from vico.challenges.robot.tasks import (
    APART,
    CARRIER_COMES,
    CARRY_REACH,
    CATEGORIES,
    DESTINATION_RADIUS,
    GOAL_COMES,
    RESIDENTS,
    RobotTask,
    read_robot_task,
)
from vico.challenges.robot_episodes import world_and_people
from vico.challenges.robot_tasks import RobotReachability, arm_body, write_task_file
from vico.errors import SchemaError
from vico.io.files import read_json, write_json
from vico.world.world import World


@pytest.fixture(scope="module")
def tasks(helsinki_path: Path) -> dict[str, RobotTask]:
    world, people = world_and_people(helsinki_path, RESIDENTS)
    return {category: generate_robot_task(world, people, category, seed=3) for category in CATEGORIES}


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_seed_gives_the_same_task_and_another_seed_another(
    category: Any, tasks: dict[str, RobotTask], helsinki_path: Path
) -> None:
    world, people = world_and_people(helsinki_path, RESIDENTS)
    assert generate_robot_task(world, people, category, seed=3) == tasks[category]
    assert generate_robot_task(world, people, category, seed=4) != tasks[category]


@pytest.mark.parametrize("category", CATEGORIES)
def test_things_fit_the_jaw_and_spots_can_be_reached(
    category: str, tasks: dict[str, RobotTask], helsinki: World
) -> None:
    task = tasks[category]
    size = movable_kinds()[task.thing.kind].size
    assert min(size[:2]) / 2 < arm_body(robot_model("manipulator")).opening
    assert {kind.kind for kind in portable_kinds()} >= {task.thing.kind}
    for spot in (task.manipulator.position, task.carrier.position, task.thing.position[:2]):
        assert helsinki.walkable.is_connected(spot)
        assert helsinki.walkable.clearance_of(*spot) >= 1.0
    away = np.hypot(*np.subtract(task.thing.position[:2], task.destination.centre[:2]))
    assert (APART / 2 if category == "deliver" else 0.0) < away < CARRY_REACH + 30.0
    assert max(len(names) for names in task.candidates.values()) <= 9


@pytest.mark.parametrize("category", CATEGORIES)
def test_both_robots_have_ways_to_the_thing_and_to_its_destination(
    category: str, tasks: dict[str, RobotTask], helsinki: World
) -> None:
    task, arm, husky = tasks[category], robot_model("manipulator"), robot_model("husky")
    ways = RobotReachability(helsinki)
    door = entrance_of(task.destination, helsinki) if category == "carry" else np.array(task.destination.centre)
    for model, start, near in ((arm, task.manipulator, GOAL_COMES), (husky, task.carrier, CARRIER_COMES)):
        points = [(np.array(task.thing.position), near), (door, near)]
        assert ways.stands(model, start.position)
        assert ways.lead(model, start.position, points, within=2 * CARRY_REACH)
        assert not ways.lead(model, start.position, points, within=1.0)
        roof = np.argwhere(~helsinki.walkable.connected & (helsinki.walkable.clearance == 0.0))[0][::-1]
        assert not ways.stands(model, helsinki.walkable.centre_of(roof))


@pytest.mark.parametrize("category", CATEGORIES)
def test_robots_are_told_where_to_look_and_not_where_it_lies(category: str, tasks: dict[str, RobotTask]) -> None:
    task = tasks[category]
    told = task.instruction()
    assert task.thing.name == told["object"]
    if category == "deliver":  # whoever waits with a thing is told to be there
        where = [spot["centre"] for spot in told.values() if isinstance(spot, dict) and "centre" in spot]
        assert where
        assert all(np.hypot(*np.subtract(spot[:2], task.thing.position[:2])) > 0.01 for spot in where)
    assert task.person.name in told["text"]
    assert (task.waits_at is None) == (category == "deliver")


def test_a_task_file_is_read_back_and_nonsense_is_refused(
    tasks: dict[str, RobotTask], helsinki: World, tmp_path: Path
) -> None:
    path = tmp_path / "task.json"
    write_task_file(path, tasks["carry"])
    assert read_robot_task(path, world=helsinki) == tasks["carry"]
    content = read_json(path)
    for change, says in (
        ({"version": 0}, "version 1"),
        ({"category": "juggle"}, "category"),
        ({"thing": content["thing"] | {"holder": None}}, "has to be"),
        ({"waits_at": None}, "waits"),
        ({"thing": content["thing"] | {"kind": "anvil"}}, "no .* anvil"),
        ({"world_digest": "0" * 64}, "another world"),
        ({"destination": content["destination"] | {"place": "nowhere"}}, "no place 'nowhere'"),
        ({"secret": 1}, "secret"),
    ):
        write_json(path, content | change)
        with pytest.raises(SchemaError, match=says):
            read_robot_task(path, world=helsinki)


class Stage:
    """A world in which the judge is shown what is to be judged."""

    def __init__(self, task: RobotTask, world: World) -> None:
        self.task, self.second = task, 0.0
        self.position = np.array(task.thing.position)
        self.holder: str | None = task.thing.holder
        self.jaw = 0
        self.fallen = False
        self.robots_at = np.array([[*task.manipulator.position, 0.0], [*task.carrier.position, 0.0]])
        self.person = np.array(task.thing.position)
        self.inside: str | None = None
        self.names = ("robot_0", "robot_1")
        self.judge = RobotJudge(task, world, self, self, lambda: self.second)

    def object_position(self, name: str) -> np.ndarray:
        return self.position.copy()

    def object_room(self, name: str) -> str | None:
        return None

    def object_holder(self, name: str) -> str | None:
        return self.holder

    def object_entity(self, name: str) -> int:
        return 77

    def agent_position(self, name: str) -> np.ndarray:
        return self.person

    def agent_place(self, name: str) -> str | None:
        return self.inside

    def bodies(self) -> Any:
        return SimpleNamespace(position=self.robots_at)

    def in_hand(self, robot: int) -> int:
        return self.jaw if robot == 0 else 0

    def observation(self, robot: int) -> dict[str, np.ndarray]:
        return {"contacts": np.array([30.0, 40.0]), "fallen": np.array([self.fallen], np.int8)}

    def let(self, seconds: int, *, pixels: int = 0) -> None:
        for _ in range(seconds):
            self.second += 1.0
            seen = {"segmentation": np.where(np.arange(100) < pixels, 77, 0)}
            self.judge.on_step(SimpleNamespace(result=SimpleNamespace(observations={"robot_0": seen})))  # type: ignore[arg-type]

    def lift(self) -> None:
        """Have the arm take the thing up."""
        self.robots_at[0, :2] = self.position[:2] + 0.6
        self.let(2, pixels=40)
        self.jaw = 77
        self.let(3, pixels=40)

    def put_at(self, point: Any) -> None:
        """Have it put down somewhere."""
        self.position = np.array([point[0], point[1], point[2]], float)
        self.robots_at[0, :2] = self.position[:2] + 0.6
        self.jaw = 0
        self.let(4)


def test_what_lies_at_rest_at_its_destination_is_delivered(tasks: dict[str, RobotTask], helsinki: World) -> None:
    task = tasks["deliver"]
    stage = Stage(task, helsinki)
    stage.lift()
    assert stage.judge.story.held is not None
    assert stage.judge.story.force == 30.0
    stage.position = np.array(task.destination.centre)
    stage.let(3)
    assert not stage.judge.over  # still in the jaw
    stage.put_at(np.add(task.destination.centre, (DESTINATION_RADIUS - 0.1, 0, 0)))
    assert stage.judge.over
    assert stage.judge.cause() == ""
    stage.put_at(np.add(task.destination.centre, (DESTINATION_RADIUS + 0.2, 0, 0)))
    assert not stage.judge.over


def test_every_failure_has_its_cause(tasks: dict[str, RobotTask], helsinki: World) -> None:
    task, causes = tasks["deliver"], []

    def new() -> Stage:
        return Stage(task, helsinki)

    stage = new()
    stage.let(3)
    causes.append(stage.judge.cause())
    stage.robots_at[0, :2] = stage.position[:2] + 4.0
    stage.let(2, pixels=40)
    causes.append(stage.judge.cause())
    stage.robots_at[0, :2] = stage.position[:2] + 0.5
    stage.let(2, pixels=40)
    causes.append(stage.judge.cause())
    stage.lift()
    causes.append(stage.judge.cause())
    stage.put_at(np.add(stage.position, (3.0, 0.0, 0.0)))
    causes.append(stage.judge.cause())
    assert stage.judge.story.drops == 1
    stage.fallen = True
    causes.append(stage.judge.cause())
    assert causes == ["not found", "not reached", "not grasped", "out of time", "dropped on the way", "fallen"]
    stage = new()
    stage.lift()
    stage.position = np.array(task.destination.centre)
    stage.let(2)
    assert stage.judge.cause() == "not placed"
    assert {*causes, "not placed"} <= set(CAUSES)


def test_to_carry_is_to_go_along_and_to_be_there_after_the_person(tasks: dict[str, RobotTask], helsinki: World) -> None:
    task = tasks["carry"]
    stage = Stage(task, helsinki)
    stage.let(2)
    assert stage.judge.cause() == "not found"
    stage.holder = None
    stage.robots_at[1] += 300.0
    stage.lift()
    door = next(
        door.position
        for door in helsinki.entrances
        if door.id == helsinki.place_by_id[str(task.destination.place)].entrance
    )
    stage.put_at(door)
    assert not stage.judge.over  # before the person is there
    stage.person = np.add(stage.robots_at[0], (1.0, 0, 0))
    stage.let(5)
    stage.person = np.add(stage.robots_at[0], (9.0, 0, 0))
    stage.let(5)
    assert 30.0 < stage.judge.together() < 90.0
    stage.inside = task.destination.place
    stage.let(2)
    assert stage.judge.over
