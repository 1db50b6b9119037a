"""Each category's rules: what is a success, and which failure has which cause."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vico.agents.teaming.people import GAVE_UP, I_FOLLOW, LETS_GO
from vico.challenges.assistant.evaluate import entrance_of
from vico.challenges.robot_episodes import world_and_people
from vico.challenges.teaming import accompany, guide, spot
from vico.challenges.teaming import tasks as t
from vico.challenges.teaming.category import JudgeSample
from vico.challenges.teaming.challenge import generate_teaming_task
from vico.challenges.teaming.evaluate import TeamingJudge
from vico.challenges.teaming.tasks import CATEGORIES, Category, TeamingTask
from vico.world.world import World

FAR = np.array([500.0, 500.0, 0.0])


@pytest.fixture(scope="module")
def tasks(helsinki_path: Path) -> dict[Category, TeamingTask]:
    world, people = world_and_people(helsinki_path, t.RESIDENTS)
    return {category: generate_teaming_task(world, people, category, seed=3) for category in CATEGORIES}


class Film:
    """Shows rules one look after the other."""

    def __init__(self, rules: Any, robots: int = 1) -> None:
        self.rules = rules
        self.now = JudgeSample(0.0, np.tile(FAR, (robots, 1)), (True,) * robots, FAR.copy(), "", outdoors=True)

    def show(self, seconds: int = 1, **changes: Any) -> str:
        """Let seconds pass with things as they stand; return the cause by then."""
        self.now = replace(self.now, **changes)
        for _ in range(seconds):
            self.now = replace(self.now, second=self.now.second + 1.0)
            self.rules.look(self.now)
            self.now = replace(self.now, said=())
        return str(self.rules.cause())


def beside(point: Any, metres: float) -> np.ndarray:
    return np.add(np.asarray(point, float), (metres, 0.0, 0.0))[None]


def walked(task: TeamingTask, world: World, *, apart: float) -> tuple[Film, np.ndarray]:
    """Walk to the door with the robot so far from the person; return the film before they go in, and the door."""
    film, door = Film(accompany.Accompany(task, world)), entrance_of(task.destination, world)
    film.show(said=(LETS_GO,), person=door + 20.0, robots=beside(door + 20.0, apart))
    for k in range(20):
        at = door + (20.0 - k)
        film.show(person=at, robots=beside(at, apart))
    return film, door


def test_who_waits_at_the_door_until_they_have_gone_in_has_accompanied(
    tasks: dict[Category, TeamingTask], helsinki: World
) -> None:
    task = with_stay(tasks["accompany"], None)
    film, door = walked(task, helsinki, apart=t.WITH_DISTANCE - 0.1)
    assert film.rules.company.share() == 100.0
    film.show(place=task.destination.place, outdoors=False)
    assert film.show(5, robots=beside(door, t.DOOR_DISTANCE + 0.1)) == "person never came"
    assert not film.rules.over
    assert film.show(1, robots=beside(door, t.DOOR_DISTANCE - 0.1)) != ""
    assert film.show(1) == ""
    assert film.rules.over


def test_who_is_asked_to_wait_until_they_come_out_has_to_be_there_all_the_time(
    tasks: dict[Category, TeamingTask], helsinki: World
) -> None:
    task = with_stay(tasks["accompany"], 30.0)
    for leaves, cause in ((0, ""), (12, "not at the door")):
        film, door = walked(task, helsinki, apart=1.0)
        inside = {"place": task.destination.place, "outdoors": False}
        film.show(int(t.DOOR_GRACE) + 2, robots=beside(door, 2.0), **inside)
        film.show(leaves, robots=beside(door, 9.0))
        film.show(20, robots=beside(door, 2.0))
        assert film.show(1, place="", outdoors=True, person=door) == cause
        assert film.rules.over


def with_stay(task: TeamingTask, stay: float | None) -> TeamingTask:
    assert task.walk is not None
    return task.model_copy(update={"walk": task.walk.model_copy(update={"stay": stay})})


def test_failures_to_accompany_have_their_causes(tasks: dict[Category, TeamingTask], helsinki: World) -> None:
    task = with_stay(tasks["accompany"], None)
    assert Film(accompany.Accompany(task, helsinki)).show(5) == "not met"
    film, door = walked(task, helsinki, apart=1.0)
    assert film.show(9) == "person never came"
    film, door = walked(task, helsinki, apart=t.WITH_DISTANCE + 0.5)
    inside = {"place": task.destination.place, "outdoors": False}
    assert film.show(1, robots=beside(door, 1.0), **inside) == "person lost"
    assert film.rules.over
    film, door = walked(task, helsinki, apart=1.0)
    assert film.show(int(t.DOOR_GRACE) + 1, robots=beside(door, 2.0), stands=(False,), **inside) == "not at the door"


def test_who_comes_to_the_destination_with_the_person_has_guided(
    tasks: dict[Category, TeamingTask], helsinki: World
) -> None:
    task = tasks["guide"]
    goal = np.array(task.destination.centre)
    film = Film(guide.Guide(task, helsinki))
    assert film.show(5, person=goal + 30.0, robots=beside(goal, 0.0)) == "not met"
    assert film.show(5, said=(I_FOLLOW,), robots=beside(goal + 30.0, t.FOLLOWS_WITHIN - 0.1)) == "out of time"
    assert film.show(5, robots=beside(goal + 30.0, t.FOLLOWS_WITHIN + 0.1)) == "out of time"
    assert film.rules.company.share() == 50.0
    assert film.show(5, robots=beside(goal, t.ARRIVED - 0.1)) == "left behind"
    assert film.show(1, person=goal, robots=beside(goal, t.ARRIVED - 0.1)) == ""
    assert film.rules.over


def test_a_person_who_gives_up_is_lost(tasks: dict[Category, TeamingTask], helsinki: World) -> None:
    film = Film(guide.Guide(tasks["guide"], helsinki))
    film.show(3, said=(I_FOLLOW,), robots=beside(FAR, 20.0))
    assert film.show(1, said=(GAVE_UP,)) == "person lost"
    assert film.rules.over


def test_a_thing_is_spotted_when_the_robot_on_the_ground_stands_beside_it(
    tasks: dict[Category, TeamingTask], helsinki: World
) -> None:
    thing = np.zeros(3)
    near, far = np.array([[0, 0, 6], [t.BESIDE_THING - 0.1, 0, 0]]), np.array([[0, 0, 6.0], [9, 0, 0]])
    film = Film(spot.Spot(tasks["spot"], helsinki), robots=2)
    assert film.show(3, thing=thing, robots=far, shown=(t.SEEN_PIXELS - 1, 0)) == "not found"
    assert film.show(3, shown=(t.SEEN_PIXELS, 0)) == "not reached"
    assert film.rules.seen_at == 4.0
    assert film.show(3, robots=near, stands=(True, False)) == "not reached"
    assert film.show(int(t.STANDS_FOR), stands=(False, True)) == ""
    assert film.rules.over


class Scene:
    """A state in which one robot stands, or lies."""

    def __init__(self, task: TeamingTask) -> None:
        self.task, self.names, self.second = task, ["robot_0", "robot_1"][: len(task.team)], 0.0
        self.fallen = False

    def agent_position(self, name: str) -> np.ndarray:
        return FAR

    def agent_place(self, name: str) -> str | None:
        return None

    def agent_room(self, name: str) -> str | None:
        return None

    def object_position(self, name: str) -> np.ndarray:
        return np.zeros(3)

    def object_entity(self, name: str) -> int:
        return 77

    def bodies(self) -> Any:
        return SimpleNamespace(position=np.zeros((len(self.names), 3)))

    def observation(self, robot: int) -> dict[str, np.ndarray]:
        tilted = self.fallen and robot == 0
        gravity = np.array([1.0, 0.0, 0.0]) if tilted else np.array([0.0, 0.0, -1.0])
        return {"fallen": np.array([tilted], np.int8), "gravity": gravity, "base_velocity": np.zeros(3)}


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_robot_that_falls_for_a_moment_has_failed(
    category: Category, tasks: dict[Category, TeamingTask], helsinki: World
) -> None:
    scene = Scene(tasks[category])
    judge = TeamingJudge(tasks[category], helsinki, scene, scene, lambda: scene.second)
    step = SimpleNamespace(actions={}, result=SimpleNamespace(observations={}))
    for fallen in (False, True, False):
        scene.fallen = fallen
        scene.second += 0.2
        judge.on_step(step)  # type: ignore[arg-type]
    assert (judge.over, judge.cause(), judge.done_at) == (True, "fallen", None)


def test_the_judge_counts_the_pixels_of_the_thing_and_hears_the_person(
    tasks: dict[Category, TeamingTask], helsinki: World
) -> None:
    scene = Scene(tasks["spot"])
    judge = TeamingJudge(tasks["spot"], helsinki, scene, scene, lambda: scene.second)
    picture = {"segmentation": np.where(np.arange(100) < t.SEEN_PIXELS, 77, 0)}
    scene.second = 2.0
    judge.on_step(SimpleNamespace(actions={}, result=SimpleNamespace(observations={"robot_0": picture})))  # type: ignore[arg-type]
    assert judge.cause() == "not reached"
    scene = Scene(tasks["guide"])
    judge = TeamingJudge(tasks["guide"], helsinki, scene, scene, lambda: scene.second)
    assert judge.cause() == "not met"
    says = {tasks["guide"].person.agent: {"type": "communicate", "text": I_FOLLOW}}
    judge.on_step(SimpleNamespace(actions=says, result=SimpleNamespace(observations={})))  # type: ignore[arg-type]
    assert judge.cause() == "out of time"
