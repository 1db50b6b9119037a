"""Whole episodes on a real place: repeatable, and a planner that sees only what it may gets something done."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import planted_agents
from vico.challenges.assistant import runner
from vico.challenges.assistant.delivery import generate_delivery
from vico.challenges.assistant.model import Task
from vico.challenges.assistant.runner import community_for, run_episode
from vico.challenges.results import EpisodeResult
from vico.community.model import Community
from vico.io.files import read_json
from vico.runner.faults import Fault
from vico.runner.foreign import Terms
from vico.world.folder import World


@pytest.fixture(scope="module")
def few(helsinki: World) -> Community:
    return community_for(helsinki, residents=2)


def play(world: World, people: Community, *, method: str, steps: int, seed: int, assistants: int = 1) -> EpisodeResult:
    task = generate_delivery(world, seed=seed, assistants=assistants, steps=steps)
    return run_episode(world, people, task, method=method)


def metres_of_the_first_errand(task: Task) -> float:
    """From the start to where the things lie, and from there to where they belong; as the crow flies."""
    stops = (task.assistants[0].position, task.subtasks[0].source.centre, task.subtasks[0].destination.centre)
    return sum(math.dist(here[:2], there[:2]) for here, there in pairwise(stops))


def test_the_heuristic_delivers_what_is_near_enough(helsinki: World, few: Community) -> None:
    # How far the first errand of an episode is, is luck: half of them take longer than this. So is whether what is
    # wanted is seen from the door.
    steps = 240
    tasks = [generate_delivery(helsinki, seed=seed, steps=steps) for seed in range(8)]
    nearest = sorted(tasks, key=metres_of_the_first_errand)[:4]
    results = (run_episode(helsinki, few, task, method="heuristic") for task in reversed(nearest))
    result = next(result for result in results if result.success[0])
    assert [step is not None for step in result.done_at] == result.success
    assert all(20 < step <= steps for step in result.done_at if step is not None)
    assert result.steps == steps  # not everything was done


@pytest.mark.parametrize(
    ("method", "assistants"), [pytest.param("random", 1, marks=pytest.mark.slow), ("heuristic", 2)]
)
def test_an_episode_repeats_itself(helsinki: World, few: Community, method: str, assistants: int) -> None:
    first, again = (
        play(helsinki, few, method=method, steps=25, seed=2, assistants=assistants) for _ in range(2)
    )  # fmt: skip
    assert first.state_hash == again.state_hash
    assert first.success == again.success


def test_another_seed_is_another_episode(helsinki: World, few: Community) -> None:
    hashes = {play(helsinki, few, method="random", steps=5, seed=seed).state_hash for seed in (0, 1)}
    assert len(hashes) == 2


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


def test_a_planner_that_crashes_and_lies_ends_no_evaluation(
    helsinki: World, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(runner, "make_planner", lambda *_, **__: _Saboteur())
    monkeypatch.setattr(runner, "community_for", lambda world: community_for(world, residents=2))
    (episode,) = runner.evaluate([helsinki], method="heuristic", assistants=1, seeds=1, steps=21, folder=tmp_path)
    assert not any(episode.success)
    assert episode.fault_counts == {"crashed": 7, "malformed": 12}
    assert Fault(3, "assistant_0", "crashed", "ZeroDivisionError: no plan") in episode.faults
    told = (tmp_path / "results.md").read_text()
    assert "| 7 crashed, 12 malformed |" in told
    assert "assistant_0 crashed at step 3 (ZeroDivisionError: no plan); 7 times in the episode" in told


def test_a_planner_from_elsewhere_is_judged_alone_in_its_process(
    helsinki: World, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(runner, "community_for", lambda world: community_for(world, residents=2))

    def evaluation(name: str) -> EpisodeResult:
        method, folder = f"{planted_agents.__file__}:{name}", tmp_path / name
        terms = Terms(deadline=60.0, isolate=True)
        (episode,) = runner.evaluate(
            [helsinki], method=method, assistants=2, seeds=1, steps=4, folder=folder, terms=terms
        )
        return episode

    # It ends its process in the third step; one that can't be made fails in each.
    assert evaluation("Quitter").fault_counts == {"ended": 4}
    broken = evaluation("Broken")
    assert broken.fault_counts == {"crashed": 8}
    assert "LookupError: no weights" in broken.faults[0].reason
    honest = evaluation("Honest")
    assert (honest.fault_counts, honest.tokens, honest.cost) == ({}, 80, 4.0)


def test_an_interrupted_evaluation_goes_on_and_comes_to_the_same(
    helsinki: World, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(runner, "community_for", lambda world: community_for(world, residents=2))

    def evaluation(folder: Path) -> list[str]:
        episodes = runner.evaluate([helsinki], method="random", assistants=1, seeds=3, steps=5, folder=folder)
        return [episode.state_hash for episode in episodes]

    whole = evaluation(tmp_path / "whole")
    played = runner.run_episode

    def killed_at_the_second(*arguments: Any, **options: Any) -> EpisodeResult:
        if "seed 1" in options["label"]:
            raise KeyboardInterrupt
        return played(*arguments, **options)

    monkeypatch.setattr(runner, "run_episode", killed_at_the_second)
    with pytest.raises(KeyboardInterrupt):
        evaluation(tmp_path / "cut")
    labels: list[str] = []

    def noted(*arguments: Any, **options: Any) -> EpisodeResult:
        labels.append(options["label"])
        return played(*arguments, **options)

    monkeypatch.setattr(runner, "run_episode", noted)
    assert evaluation(tmp_path / "cut") == whole
    assert [label[-6:] for label in labels] == ["seed 1", "seed 2"]
    first, second = (read_json(tmp_path / name / "results.json")["summary"] for name in ("whole", "cut"))
    assert first | {"wall_seconds": 0} == second | {"wall_seconds": 0}
