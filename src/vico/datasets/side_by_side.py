"""Handing out the parts of a dataset: to this process, to processes side by side, or to a Ray cluster."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from vico.challenges.episodes import code_digest
from vico.io.stores import FolderStore
from vico.jobs import Answer, Service, Task, open_executor
from vico.jobs.shared import seen_by_all

#: What makes parts.
MAKER = "vico.datasets.worker:player"
#: Told the index of a task and what came of it.
Done = Callable[[int, Mapping[str, Any]], None]


def run_tasks(
    options: Mapping[str, Any],
    tasks: Sequence[Mapping[str, Any]],
    *,
    workers: int,
    ray: str | None = None,
    done: Done,
    tell: Callable[[Mapping[str, Any]], None],
) -> None:
    """Hand tasks to `vico.datasets.worker.player`; with one worker, in this process.

    Parameters
    ----------
    options
        Of the player. Its folder of parts must be one that all machines share.
    ray
        A Ray cluster instead of processes: its address, or ``auto``; see `vico.jobs.open_executor`.

    Raises
    ------
    InputError
        If there is no such cluster, or a machine of it sees another folder or has other code.
    OutputError
        If a part cannot be written.
    """

    def over(index: int, answer: Answer) -> None:
        done(index, {"reason": answer.reason} if answer.content is None else answer.content)

    if ray is None:
        workers = min(workers, max(1, len(tasks)))
    parts = FolderStore(Path(options["parts"]))
    with open_executor(workers=workers, ray=ray) as executor, seen_by_all(parts, executor) as seen:
        service = Service(MAKER, {**options, "parts": str(parts), "seen": seen, "code": code_digest()})
        executor.run(service, [Task(task, near=_world(task)) for task in tasks], done=over, told=tell)


def _world(task: Mapping[str, Any]) -> str:
    return str(task["job"]["world"] if "job" in task else task.get("world") or task.get("run", ""))
