"""Playing many episodes of a challenge: side by side, on disk as soon as each is over, gone on with after a kill."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from vico.challenges.episodes import Outcome, code_digest
from vico.challenges.records import Job, Progress, Setting
from vico.challenges.registry import check_methods, load_challenge
from vico.challenges.worker import episodes_service, outcome_of, plain_job
from vico.errors import InputError
from vico.io.stores import FolderStore, Store
from vico.jobs import Answer, Task, open_executor
from vico.jobs.shared import seen_by_all
from vico.runner.foreign import Terms

#: Called with each outcome as it comes, how many there are by now, and how many there will be.
Finished = Callable[[Outcome, int, int], None]


def jobs_for(
    challenge: str,
    *,
    categories: Sequence[str],
    methods: Sequence[str],
    setting: Setting,
    worlds: Sequence[Path],
    seeds: int,
    first_seed: int = 0,
    terms: Terms | None = None,
) -> list[Job]:
    """Return the jobs of a table: each world and seed, each category, each method.

    Parameters
    ----------
    challenge
        Its name, or ``my_module:MY_CHALLENGE``.
    seeds
        How many episodes a world: those seeded `first_seed` and on.

    Raises
    ------
    InputError
        If there is no such challenge, category or method, or nothing to play.
    """
    known = load_challenge(challenge)
    if seeds < 1 or not worlds or not methods or not categories:
        raise InputError(f"{known.name}: needs at least one world, one seed and one method")
    if odd := [name for name in categories if name not in known.categories]:
        raise InputError(f"{known.name}: no category called {odd[0]!r}; there are {', '.join(known.categories)}")
    check_methods(known, list(methods))
    if len({path.resolve() for path in worlds}) < len(worlds):
        raise InputError(f"{known.name}: a world is given twice; its episodes would count twice")
    return [
        Job(challenge, category, method, dict(setting), world, seed, terms or Terms())
        for world in worlds
        for seed in range(first_seed, first_seed + seeds)
        for category in categories
        for method in methods
    ]


def evaluate(
    challenge: str,
    jobs: Sequence[Job],
    where: Path | Store,
    *,
    workers: int = 1,
    ray: str | None = None,
    record: bool = False,
    progress: Progress | None = None,
    finished: Finished | None = None,
) -> list[Outcome]:
    """Play every job whose episode is not there yet.

    What an episode came to goes to ``episodes`` as soon as it is over, its task to ``tasks``. A job that can't be
    played, because its world does not hold what the task needs or is gone, or because its process was ended twice, does
    not end the others: its outcome says why. Nothing depends on how many workers or machines there are, nor on the
    order of the jobs.

    Parameters
    ----------
    challenge
        Its name, or ``my_module:MY_CHALLENGE``.
    where
        A folder, which all machines share if there are several, or a store.
    workers
        Processes side by side; with one, episodes are played in this process.
    ray
        Play them on a Ray cluster instead: its address, or ``auto``; see `vico.jobs.open_executor`.
    record
        Whether each episode is recorded as a run, in ``runs``, that the viewer replays.
    progress
        Told how far each episode is, on this machine.
    finished
        Told of each outcome.

    Returns
    -------
    list of Outcome
        In the order of the jobs.

    Raises
    ------
    InputError
        If there is no such challenge, one job is given twice, or a machine of the cluster lacks what is needed.
    OutputError
        If nothing can be written. What is there by then stays, as it does after Ctrl-C.
    """
    if len({json.dumps(plain_job(job), sort_keys=True) for job in jobs}) < len(jobs):
        raise InputError("evaluate: a job is given twice; its episode would count twice")
    load_challenge(challenge)
    store = FolderStore(where) if isinstance(where, Path) else where
    tasks = [Task(plain_job(job), near=str(job.world)) for job in jobs]
    outcomes: dict[int, Outcome] = {}

    def done(index: int, answer: Answer) -> None:
        job = jobs[index]
        content = answer.content
        outcomes[index] = Outcome(job, None, answer.reason) if content is None else outcome_of(job, content)
        if finished is not None:
            finished(outcomes[index], len(outcomes), len(jobs))

    def told(message: Mapping[str, Any]) -> None:
        if progress is not None:
            progress(message["label"], message["step"], message["limit"])

    if isinstance(store, FolderStore):
        _clear(store.folder)
    if ray is None:
        workers = min(workers, max(1, len(jobs)))
    with open_executor(workers=workers, ray=ray) as executor, seen_by_all(store, executor) as seen:
        service = episodes_service(challenge, str(store), code=code_digest(), record=record, seen=seen)
        executor.run(service, tasks, done=done, told=told)
    return [outcomes[index] for index in range(len(jobs))]


def _clear(folder: Path) -> None:
    """Take away what was being written when an evaluation was killed."""
    for pattern in (".seen-*", "episodes/.*", "tasks/.*"):
        for path in folder.glob(pattern):
            path.unlink(missing_ok=True)
