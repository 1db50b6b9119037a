"""Environments in processes: the same results as one by one, and nobody is left behind when something fails."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import toy_city
import vico
from counting import Counter
from vico.agents.single import make_single
from vico.envs.workers import Call, WorkerError, Workers
from vico.errors import InputError

OPTIONS: dict[str, Any] = {"cars": 2, "pedestrians": 2, "observe": "none", "max_steps": 4}
WALK = {"type": "move_forward", "distance": 1.0}
TURN = {"type": "turn_left", "degrees": 20.0}


def counters(*starts: int) -> Workers:
    """Workers that count."""
    return Workers([partial(Counter, start) for start in starts], what="counter")


def test_a_vector_of_agents_plays_what_single_environments_play(helsinki_path: Path, helsinki_people: Path) -> None:
    def alone(seed: int) -> list[str]:
        env = make_single(helsinki_path, helsinki_people, seed=seed, **OPTIONS)
        env.reset(seed=seed)
        found = []
        for step in range(6):
            if step == 4:
                found.append(env.reset()[1].get("hash", ""))
            else:
                found.append(env.step(TURN if step % 2 else WALK)[4]["hash"])
        env.close()
        return found

    vector = vico.make_vec(helsinki_path, helsinki_people, num_envs=2, **OPTIONS)
    try:
        observations, _ = vector.reset(seed=5)
        assert observations["pose"].shape == (2, 6)
        hashes, ends = [], []
        for step in range(6):
            _, rewards, terminations, truncations, infos = vector.step([TURN if step % 2 else WALK] * 2)
            hashes.append([info or "" for info in infos.get("hash", ["", ""])])
            ends.append(truncations.tolist())
            assert rewards.tolist() == [0.0, 0.0]
            assert not terminations.any()
    finally:
        vector.close()
    assert [list(column) for column in zip(*hashes, strict=True)] == [alone(5), alone(6)]
    assert ends == [[False, False]] * 3 + [[True, True]] + [[False, False]] * 2


@pytest.mark.slow
def test_sampled_batches_of_actions_are_taken_and_batches_of_observations_fit(helsinki_path: Path) -> None:
    vector = vico.make_vec(helsinki_path, num_envs=2, observe=("assistant_0",), image=16)
    try:
        vector.reset(seed=1)
        vector.action_space.seed(1)
        observations, *_ = vector.step(vector.action_space.sample())
        assert vector.observation_space.contains(observations)
        assert observations["rgb"].shape == (2, 16, 16, 3)
    finally:
        vector.close()


@pytest.mark.slow
def test_a_vector_of_communities_plays_what_single_ones_play(helsinki_path: Path, helsinki_people: Path) -> None:
    def hashes(results: Any) -> list[str]:
        return [step[4]["resident_0"]["hash"] for step in results]

    actions = [{"resident_0": WALK}, {"resident_1": TURN}]
    vector = vico.make_parallel_vec(helsinki_path, helsinki_people, num_envs=2, **OPTIONS)
    try:
        vector.reset(seed=[3, 9])
        found = [hashes(vector.step(actions)) for _ in range(4)]
        assert sorted(vector.reset_some([1])) == [1]
        assert vector.action_space("resident_0") == vico.make(helsinki_path, helsinki_people).action_space("resident_0")
    finally:
        vector.close()
    singles = [vico.make(helsinki_path, helsinki_people, seed=seed, **OPTIONS) for seed in (3, 9)]
    for env in singles:
        env.reset()
    assert found == [hashes([env.step(a) for env, a in zip(singles, actions, strict=True)]) for _ in range(4)]


def test_workers_keep_their_objects_and_answer_in_order() -> None:
    workers = counters(1, 10)
    try:
        workers.ask([Call("add", (1,)), None])
        assert workers.ask([Call("add", (1,)), Call("add", (5,))]) == [3, 15]
    finally:
        workers.close()
    with pytest.raises(InputError, match="closed"):
        workers.ask_all("number")


@pytest.mark.parametrize(
    ("method", "told"),
    [
        ("fail", r"(?s)counter worker 1 of 2 failed in fail: ZeroDivisionError: .*counting"),
        ("refuse", r"counter worker 1 of 2 failed in refuse: counter: refused; ask for something else$"),
    ],
)
def test_a_failure_in_a_worker_says_where_and_closes_all(method: str, told: str) -> None:
    workers = counters(1, 10)
    pids = workers.pids
    with pytest.raises(WorkerError, match=told):
        workers.ask([Call("add", (1,)), Call(method)])
    assert len(workers) == 0
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(int(pid or 0), 0)


def test_a_killed_worker_is_told_from_a_failed_one() -> None:
    workers = counters(1, 10)
    workers.ask_all("number")
    os.kill(int(workers.pids[0] or 0), signal.SIGKILL)
    with pytest.raises(WorkerError, match=r"counter worker 0 of 2, asked for number, was killed by SIGKILL"):
        workers.ask_all("number")


def test_workers_die_with_their_parent_even_in_the_middle_of_a_call() -> None:
    here = Path(__file__).parent
    program = (
        f"import os, signal, sys; sys.path[:0] = [{str(here)!r}, {str(here.parent)!r}]\n"
        "from test_vector import Call, counters\n"
        "if __name__ == '__main__':\n"
        "    workers = counters(1, 2)\n"
        "    print(workers.ask_all('number'), flush=True)\n"
        "    workers._send(0, Call('hang'))\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    # It returns when nobody holds its output any more: not before the last worker is gone.
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=120)
    assert (done.returncode, done.stdout.strip()) == (-signal.SIGKILL, "[1, 2]")


def test_a_world_in_memory_is_refused_in_one_sentence() -> None:
    with pytest.raises(InputError, match="write it with"):
        vico.make_vec(toy_city.world(), toy_city.community(), num_envs=2)


def test_seeds_and_actions_are_counted() -> None:
    workers = counters(1)
    with pytest.raises(InputError, match="2 calls for 1 workers"):
        workers.ask([Call("add", (1,))] * 2)
    assert np.array_equal(workers.ask([Call("number")]), [1])
    workers.close()
