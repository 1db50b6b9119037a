"""First choices where it is uncertain where things are: worked out by hand, and against the best of all orders."""

from __future__ import annotations

import numpy as np
import pytest

from vico.agents.assistant.rollouts import (
    DONE,
    IN_HAND,
    OPEN,
    Situation,
    best_first_choice,
    draw_worlds,
    expected_worth,
)
from vico.seeds import rng

LEFT = 600.0


def situation(
    spots: list[tuple[int, float, float]],
    *,
    tasks: int,
    left: float = LEFT,
    service: float = 10.0,
    stage: list[int] | None = None,
    brought: bool = False,
    hands: int = 2,
    end: float = 0.0,
) -> Situation:
    """Spots on a line, as ``(subtask, metres from here, chance)``, at a metre a second; one is at 0."""
    at = np.array([0.0, *(metres for _, metres, _ in spots), end])
    stages = np.array(stage or [OPEN] * tasks, np.int64)
    return Situation(
        travel=np.abs(at[:, None] - at[None, :]),
        spot_point=np.arange(1, len(spots) + 1, dtype=np.int64),
        spot_task=np.array([task for task, _, _ in spots], np.int64),
        spot_seconds=np.full(len(spots), 5.0),
        spot_chance=np.array([chance for _, _, chance in spots], np.float64),
        spot_finds=np.ones(len(spots)),
        end=np.full(tasks, len(at) - 1 if brought else -1, np.int64),
        service=np.full((len(at), tasks), service),
        brought=np.full(tasks, brought),
        pick=np.full(tasks, 2.0),
        put=np.full(tasks, 2.0),
        load=np.ones(tasks, np.int64) * int(brought),
        stage=stages,
        hands=hands,
        left=left,
    )


def chosen(one: Situation, *, seed: int = 0) -> int:
    return best_first_choice(one, rng(seed, "rollouts"), worlds=200)


def test_the_nearer_of_two_equal_spots_comes_first() -> None:
    assert chosen(situation([(0, 90.0, 0.5), (0, 30.0, 0.5)], tasks=1)) == 1


def test_the_likelier_of_two_spots_as_near_comes_first() -> None:
    assert chosen(situation([(0, 50.0, 0.2), (0, -50.0, 0.7)], tasks=1)) == 1


def test_what_cannot_be_done_in_time_is_not_begun() -> None:
    assert chosen(situation([(0, 90.0, 1.0)], tasks=1, left=90.0)) == -1
    assert chosen(situation([], tasks=0)) == -1
    assert chosen(situation([(0, 10.0, 1.0)], tasks=1, stage=[DONE])) == -1


def test_it_looks_further_than_the_nearest() -> None:
    # There is time for the far one alone, or for the two on the other side, of which the nearest is a little farther.
    one = situation([(0, 60.0, 1.0), (1, -65.0, 1.0), (2, -70.0, 1.0)], tasks=3, left=120.0)
    assert chosen(one) in (1, 2)


def test_what_is_in_hand_is_brought_and_full_hands_pick_nothing_up() -> None:
    full = situation([(1, 5.0, 1.0)], tasks=2, stage=[IN_HAND, OPEN], brought=True, hands=0, end=20.0)
    assert chosen(full) == 1 + 0  # the first subtask's things, after the one spot
    free = situation([(1, 5.0, 1.0)], tasks=2, stage=[IN_HAND, OPEN], brought=True, hands=1, end=20.0)
    assert chosen(free) == 0


def test_the_same_stream_gives_the_same_choice_and_worlds() -> None:
    one = situation([(k % 3, 20.0 * k - 50.0, 0.3) for k in range(6)], tasks=3)
    assert chosen(one, seed=5) == chosen(one, seed=5)
    for first, second in zip(draw_worlds(one, rng(1, "w"), 50), draw_worlds(one, rng(1, "w"), 50), strict=True):
        assert np.array_equal(first, second)


def test_worlds_are_drawn_by_the_chances() -> None:
    one = situation([(0, 10.0, 0.6), (0, 20.0, 0.3), (1, 30.0, 0.5)], tasks=2)
    truth, finds = draw_worlds(one, rng(2, "w"), 1000)
    assert truth.shape == (1000, 2)
    assert finds.all()
    shares = [float(np.mean(truth[:, k] == spot)) for k, spot in ((0, 0), (0, 1), (0, -1), (1, 2), (1, -1))]
    assert shares == pytest.approx([0.6, 0.3, 0.1, 0.5, 0.5], abs=0.002)


def test_worth_counts_what_is_done_in_time() -> None:
    sure = expected_worth(situation([(0, 10.0, 1.0), (1, 20.0, 1.0)], tasks=2), rng(0, "worth"), worlds=50)
    half = expected_worth(situation([(0, 10.0, 0.5), (1, 20.0, 0.5)], tasks=2), rng(0, "worth"), worlds=50)
    assert 1.9 < sure <= 2.0
    assert half == pytest.approx(sure / 2, abs=0.05)
    assert expected_worth(situation([(0, 10.0, 1.0)], tasks=1, left=5.0), rng(0, "worth"), worlds=50) == 0.0


@pytest.mark.parametrize("seed", range(20))
def test_the_first_choice_of_certain_errands_is_not_far_from_the_best_order(seed: int) -> None:
    chance = rng(seed, "certain")
    metres = [float(m) for m in chance.uniform(-150.0, 150.0, 5)]
    one = situation([(k, m, 1.0) for k, m in enumerate(metres)], tasks=5, left=400.0)
    first = chosen(one)
    assert first >= 0

    def best(at: float, time: float, left: frozenset[int]) -> float:
        worths = [0.0]
        for k in left:
            after = time + abs(metres[k] - at) + 5.0 + 10.0
            if after <= 400.0:
                worths.append(1.0 - 0.25 * after / 400.0 + best(metres[k], after, left - {k}))
        return max(worths)

    everything = frozenset(range(5))
    after = abs(metres[first]) + 15.0
    begun = 1.0 - 0.25 * after / 400.0 + best(metres[first], after, everything - {first})
    assert begun >= 0.8 * best(0.0, 0.0, everything)
