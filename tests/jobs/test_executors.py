"""Tasks are done the same by this process, by processes and by a Ray cluster, and what goes wrong is told the same."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from ray_nodes import needs_ray
from vico.errors import InputError, OutputError
from vico.jobs import Answer, Service, Task, open_executor

DOUBLER = "toy_service:doubler"
WHERE = [
    pytest.param({"workers": 1}, id="here"),
    pytest.param({"workers": 2}, id="processes"),
    pytest.param({"workers": 2, "ray": "local"}, id="ray", marks=needs_ray),
]


def run(
    where: dict[str, Any], tasks: list[dict[str, Any]], told: list[Any] | None = None, **options: Any
) -> list[Answer]:
    answers: dict[int, Answer] = {}
    with open_executor(**where) as executor:
        executor.run(
            Service(DOUBLER, options), [Task(task, near=str(task["n"] % 2)) for task in tasks],
            done=answers.__setitem__, told=None if told is None else told.append,
        )  # fmt: skip
    return [answers[index] for index in range(len(tasks))]


@pytest.mark.parametrize("where", WHERE)
def test_every_task_is_done_and_one_that_fails_ends_no_other(where: dict[str, Any]) -> None:
    told: list[Any] = []
    tasks: list[dict[str, Any]] = [{"n": n} for n in range(6)]
    tasks[3]["bug"] = True
    answers = run(where, tasks, told)
    assert [None if a.content is None else a.content["twice"] for a in answers] == [0, 2, 4, None, 8, 10]
    assert answers[3].reason.startswith("KeyError: 'no such number' at toy_service.py")
    if "ray" in where:
        assert told == []
    else:
        assert sorted(message["at"] for message in told) == list(range(6))
    processes = {a.content["process"] for a in answers if a.content is not None}
    assert (os.getpid() in processes) == (where == {"workers": 1})
    assert len(processes) <= 2


@pytest.mark.parametrize("where", WHERE)
def test_a_full_disk_ends_all(where: dict[str, Any]) -> None:
    with pytest.raises(OutputError, match="the disk is full"):
        run(where, [{"n": 0}, {"n": 1, "full": True}, {"n": 2}])


@pytest.mark.parametrize("where", WHERE)
def test_a_service_that_cannot_be_made_is_said_once(where: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="no doubling today"):
        run(where, [{"n": 0}, {"n": 1}], refuse=True)
    with open_executor(**where) as executor, pytest.raises(InputError, match="nowhere:nothing: cannot be made"):
        executor.run(Service("nowhere:nothing"), [Task({}), Task({})], done=lambda *_: None)


@pytest.mark.parametrize("where", WHERE[1:])
def test_a_process_that_dies_is_replaced_and_a_task_that_kills_is_marked(where: dict[str, Any], tmp_path: Path) -> None:
    tasks = [{"n": 0, "kill": str(tmp_path / "killed")}, {"n": 1, "always": True}, {"n": 2}]
    answers = run(where, tasks)
    assert (tmp_path / "killed").exists()
    assert [None if a.content is None else a.content["twice"] for a in answers] == [0, None, 4]
    assert "it may lack memory" in answers[1].reason


def test_tasks_of_the_same_world_go_to_the_same_process() -> None:
    answers = run({"workers": 2}, [{"n": n} for n in range(12)])
    by_process: dict[int, set[int]] = {}
    for n, answer in enumerate(answers):
        assert answer.content is not None
        by_process.setdefault(answer.content["process"], set()).add(n % 2)
    # The last tasks may be shared out; nobody changes between worlds more than once.
    assert sum(len(worlds) for worlds in by_process.values()) <= 3


def test_a_cluster_that_is_not_there_and_a_bad_number_are_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="at least one is needed"):
        open_executor(workers=0)
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    from vico.errors import MissingExtraError

    with pytest.raises(MissingExtraError, match=r"pip install 'virtual-community\[ray\]'"):
        open_executor(ray="auto")


@needs_ray
def test_an_address_where_nothing_answers_is_said_at_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    says = r"--ray .*: nothing answers at 127\.0\.0\.1:9 \(.*\); start a cluster with ray start --head"
    with pytest.raises(InputError, match=says):
        open_executor(ray="127.0.0.1:9")
    with pytest.raises(InputError, match=r"nothing answers at ray://127\.0\.0\.1:9"):
        open_executor(ray="ray://127.0.0.1:9")
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    (tmp_path / "ray").mkdir()
    (tmp_path / "ray" / "ray_current_cluster").write_text("127.0.0.1:9\n")
    with pytest.raises(InputError, match=says):  # a cluster that was killed
        open_executor(ray="auto")
    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:8")
    with pytest.raises(InputError, match=r"nothing answers at 127\.0\.0\.1:8"):
        open_executor(ray="auto")
