"""Whole episodes on a real place: repeatable, and a planner that sees only what it may gets something done."""

from __future__ import annotations

import pytest

from vico.challenges.assistant.delivery import generate_delivery
from vico.challenges.assistant.runner import community_for, run_episode
from vico.challenges.results import EpisodeResult
from vico.community.model import Community
from vico.world.folder import World


@pytest.fixture(scope="module")
def few(helsinki: World) -> Community:
    return community_for(helsinki, residents=2)


def play(world: World, people: Community, *, method: str, steps: int, seed: int, assistants: int = 1) -> EpisodeResult:
    task = generate_delivery(world, seed=seed, assistants=assistants, steps=steps)
    return run_episode(world, people, task, method=method)


def test_the_heuristic_delivers_something_within_five_minutes(helsinki: World, few: Community) -> None:
    # How far the first errand of an episode is, is luck; about every other one is near enough.
    results: list[EpisodeResult] = []
    while len(results) < 8 and not any(any(result.success) for result in results):
        results.append(play(helsinki, few, method="heuristic", steps=300, seed=len(results)))
    assert sum(sum(result.success) for result in results) >= 1
    for result in results:
        assert [step is not None for step in result.done_at] == result.success
        assert all(20 < step <= 300 for step in result.done_at if step is not None)
        assert result.steps == 300  # not everything was done


@pytest.mark.parametrize(("method", "assistants"), [("random", 1), ("heuristic", 2)])
def test_an_episode_repeats_itself(helsinki: World, few: Community, method: str, assistants: int) -> None:
    first, again = (
        play(helsinki, few, method=method, steps=25, seed=2, assistants=assistants) for _ in range(2)
    )  # fmt: skip
    assert first.state_hash == again.state_hash
    assert first.success == again.success


def test_another_seed_is_another_episode(helsinki: World, few: Community) -> None:
    hashes = {play(helsinki, few, method="random", steps=5, seed=seed).state_hash for seed in (0, 1)}
    assert len(hashes) == 2
