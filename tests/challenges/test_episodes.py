"""Whole assistant episodes on a real place: repeatable, and planners that see only what they may get something done."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import planted_agents
from command_line import vico
from vico.challenges.assistant import challenge as playing
from vico.challenges.assistant.challenge import ASSISTANT, play_task
from vico.challenges.assistant.evaluate import CAUSES
from vico.challenges.assistant.generate import generate_task
from vico.challenges.assistant.tasks import RESIDENTS, Category, Task, read_task, write_task
from vico.challenges.records import EpisodeRecord, Job
from vico.community import build_community
from vico.community.model import Community
from vico.errors import InputError, SchemaError
from vico.runner.foreign import Terms
from vico.runner.gather import Fault
from vico.sim.recording import read_run
from vico.viewer.run_film import RepeatedRun
from vico.world.world import World


@pytest.fixture(scope="module")
def people(helsinki: World) -> Community:
    return build_community(helsinki, residents=RESIDENTS["carry"], seed=0)


@pytest.fixture(scope="module")
def few(people: Community) -> Community:
    """A few of them, for what needs nobody in particular: they cost time."""
    return people.model_copy(update={"residents": people.residents[:6], "relations": [], "groups": []})


def shortened(task: Task, subtask: int, steps: int) -> Task:
    """Return a task of one subtask only."""
    one = task.subtasks[subtask].model_copy(update={"index": 0})
    things = [thing for thing in task.objects if thing.id in one.objects]
    return task.model_copy(update={"subtasks": [one], "objects": things, "steps": steps})


def near_ones(world: World, community: Community, category: Category, *, steps: int, seeds: int) -> list[Task]:
    """Single subtasks, by how far one walks in them as the crow flies."""
    found: list[tuple[float, Task]] = []
    for seed in range(seeds):
        task = generate_task(world, community, category, seed=seed)
        for k, subtask in enumerate(task.subtasks):
            ends = [] if subtask.destination is None else [subtask.destination.centre]
            stops = [task.assistants[0].position, subtask.true_source.centre, *ends]
            metres = sum(math.dist(here[:2], there[:2]) for here, there in pairwise(stops))
            found.append((metres, shortened(task, k, steps)))
    return [task for _, task in sorted(found, key=lambda pair: pair[0])]


def test_the_heuristic_delivers_what_is_near_enough(helsinki: World, few: Community) -> None:
    tasks = near_ones(helsinki, few, "delivery", steps=240, seeds=2)
    records = (play_task(helsinki, few, task, method="heuristic") for task in tasks[:4])
    record = next(record for record in records if record.parts[0].success)
    assert record.metrics == {"SR": 100.0, "Ts": float(record.parts[0].done_at or 0)}
    assert 20 < record.metrics["Ts"] <= 240
    assert record.steps < record.limit == 240  # it was reported, so the episode was over


def test_ours_finds_what_is_lost_near_by(helsinki: World, few: Community) -> None:
    tasks = near_ones(helsinki, few, "search", steps=240, seeds=2)
    records = (play_task(helsinki, few, task, method="ours") for task in tasks[:4])
    record = next(record for record in records if record.parts[0].success)
    assert 5 < record.metrics["Ts"] == record.steps


@pytest.mark.slow
def test_a_person_is_met_followed_and_things_are_put_down_at_home(helsinki: World, people: Community) -> None:
    tasks = near_ones(helsinki, people, "carry", steps=700, seeds=2)
    records = (play_task(helsinki, people, task, method="ours") for task in tasks[:5])
    record = next(record for record in records if record.parts[0].success)
    assert record.metrics.keys() == {"SR", "Ts", "HR", "HR_escort"}
    assert record.metrics["HR_escort"] > 30.0
    assert 0.0 < record.metrics["HR"] < 100.0


@pytest.mark.parametrize(
    ("category", "method", "assistants"),
    [
        ("delivery", "heuristic", 2),
        ("search", "random", 1),
        ("search", "mcts", 1),
        ("carry", "ours+heuristic", 2),
    ],
)
def test_an_episode_repeats_itself_also_from_its_file(
    helsinki: World, people: Community, few: Community, tmp_path: Path, category: Category, method: str, assistants: int
) -> None:
    community = people if category == "carry" else few
    task = generate_task(helsinki, community, category, seed=1, assistants=assistants, steps=20)
    write_task(tmp_path / "t.json", task)
    first = play_task(helsinki, community, task, method=method)
    again = play_task(helsinki, community, read_task(tmp_path / "t.json", world=helsinki), method=method)
    assert replace(first, wall_seconds=0.0) == replace(again, wall_seconds=0.0)
    assert first.steps == first.limit == 20
    assert all(part.cause in CAUSES for part in first.parts if not part.success)
    assert first.setting["assistants"] == assistants


def test_a_recorded_episode_can_be_looked_at_from_anywhere(
    helsinki: World, people: Community, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    task = generate_task(helsinki, people, "carry", seed=1, steps=8)
    record = play_task(helsinki, people, task, method="heuristic", recording=tmp_path / "out.partial" / "runs" / "one")
    (tmp_path / "out.partial").rename(tmp_path / "out")
    monkeypatch.chdir(tmp_path / "out")
    path = Path("runs") / "one"
    who, look = task.subtasks[0].person.agent, ("--size", "64x64", "--samples", 1, "--quality", "plain")
    assert vico("still", path, "--follow", who, "--at", 5, *look, "--out", "still.png") == 0
    assert Path("still.png").is_file()
    repeated = RepeatedRun.of_folders(read_run(path))
    repeated.go_to(8)
    assert repeated.sim.state_hash() == record.state_hash
    assert repeated.sim.ground_truth.object_holder(task.objects[0].name) == task.objects[0].holder
    shutil.rmtree(path / "community")
    assert vico("film", path, "--follow", who, *look, "--out", "film.mp4") == 2


def test_a_task_of_other_people_or_of_another_world_is_refused(helsinki: World, few: Community) -> None:
    task = generate_task(helsinki, few, "search", seed=1, steps=20)
    others = few.model_copy(update={"residents": few.residents[1:]})
    with pytest.raises(SchemaError, match=r"task: made for another community \(\w{12}\) than this one of 5 residents"):
        play_task(helsinki, others, task, method="heuristic")
    moved = task.model_copy(update={"world": "atlantis", "world_digest": "0" * 64})
    with pytest.raises(SchemaError, match=r"task: made for another world \('atlantis', 000000000000\)"):
        play_task(helsinki, few, moved, method="heuristic")


class _Saboteur:
    """Crashes, lies or dawdles by turns."""

    def __init__(self) -> None:
        self._turn = 0

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> Any:
        self._turn += 1
        lies: list[Any] = [
            {"type": "move_forward", "distance": math.nan},
            {"type": "turn_left", "degrees": "many"},
            {"type": "task_complete", "index": 10**9},
            {"type": "give", "agent": "nobody_7"},
            "task_complete",
            None,
            42,
        ]
        if self._turn % 3 == 0:
            raise ZeroDivisionError("no plan")
        return lies[self._turn % len(lies)]


def test_a_planner_that_crashes_and_lies_ends_no_episode(
    helsinki: World, few: Community, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(playing, "make_planner", lambda *_, **__: _Saboteur())
    task = generate_task(helsinki, few, "delivery", seed=0, steps=21)
    record = play_task(helsinki, few, task, method="heuristic")
    assert record.metrics["SR"] == 0.0
    assert record.fault_counts == {"crashed": 7, "malformed": 12}
    assert Fault(3, "assistant_0", "crashed", "ZeroDivisionError: no plan") in record.faults


def test_planners_from_elsewhere_are_judged_alone_in_their_process(helsinki: World, few: Community) -> None:
    task = generate_task(helsinki, few, "search", seed=0, assistants=2, steps=4)

    def record_of(name: str) -> EpisodeRecord:
        terms = Terms(deadline=60.0, isolate=True)
        return play_task(helsinki, few, task, method=f"{planted_agents.__file__}:{name}", terms=terms)

    # It ends its process in the third step; one that can't be made fails in each.
    assert record_of("Quitter").fault_counts == {"ended": 4}
    broken = record_of("Broken")
    assert broken.fault_counts == {"crashed": 8}
    assert "LookupError: no weights" in broken.faults[0].reason
    honest = record_of("Honest")
    assert (honest.fault_counts, honest.tokens, honest.cost) == ({}, 80, 4.0)


def job(world: World, **more: Any) -> Job:
    assert world.path is not None
    fields: dict[str, Any] = {
        "category": "search",
        "method": "heuristic",
        "setting": {},
        "world": world.path,
        "seed": 0,
    }
    return Job(challenge="assistant", **(fields | more))


@pytest.mark.parametrize(
    ("asked", "said"),
    [({"category": "sell"}, "no category called 'sell'"), ({"setting": {"assistants": 3}}, "for 1 or 2"),
     ({"method": "heuristic+random", "setting": {"assistants": 1, "steps": 3}}, "2 planners for 1 assistants")],
)  # fmt: skip
def test_what_can_not_be_played_is_refused(helsinki: World, asked: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        ASSISTANT.play(job(helsinki, **asked))


def test_the_challenge_plays_jobs(helsinki: World) -> None:
    asked = job(helsinki, setting={"steps": 3, "advanced": True, "assistants": 2, "distance": False})
    told: list[tuple[str, int, int]] = []
    record = ASSISTANT.play(asked, progress=lambda *what: told.append(what))
    assert record.setting == {"steps": 3, "advanced": True, "assistants": 2, "distance": False}
    assert len(record.parts) == 6
    assert record.metrics.keys() == {metric.key for metric in ASSISTANT.metrics("search")} == {"SR", "Ts"}
    assert [(number, limit) for _, number, limit in told] == [(1, 3), (2, 3), (3, 3)]
    task = ASSISTANT.task(asked)
    assert Task.model_validate(task).steps == 3
