"""Playing many episodes of a challenge: side by side, on disk as soon as each is over, gone on with after a kill.

Jobs are handed out as a service of `vico.jobs`, in plain data; a worker process plays them.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vico.challenges.episodes import Outcome, Player, code_digest, record_of
from vico.challenges.records import Job, Progress, Setting, check_methods, load_challenge
from vico.errors import InputError
from vico.io.stores import FolderStore, Store, store_at
from vico.jobs import Answer, Service, Task, open_executor
from vico.jobs.contract import check_same_code, check_shared_store, shared_store_marker
from vico.runner.foreign import Terms
from vico.world.folder import fetch_world

_TOLD_EVERY = 10  # steps


def episodes_service(challenge: str, store: str, *, code: str, record: bool, seen: str = "") -> Service:
    """Return the service that plays the jobs of a challenge.

    Parameters
    ----------
    challenge
        Its name, or ``my_module:MY_CHALLENGE``.
    store, code, record
        As `vico.challenges.episodes.Player` has them.
    seen
        Name of a file of the store that whoever plays must see, for other machines; and their code must be ours then.
    """
    options = {"challenge": challenge, "store": store, "code": code, "record": record, "seen": seen}
    return Service("vico.challenges.evaluation:player", options)


def player(
    options: Mapping[str, Any], tell: Callable[[Mapping[str, Any]], None]
) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what plays a job, of `plain_job`, and returns what came of it, for `outcome_of`.

    Raises
    ------
    InputError
        If this machine does not see what the others see, or has other code: what it played would be filed wrongly.
    """
    store = store_at(options["store"])
    check_shared_store(store, options["seen"])
    if options["seen"]:
        check_same_code(options["code"], code_digest())
    episodes = Player(load_challenge(options["challenge"]), store, code=options["code"], record=options["record"])

    def progress(label: str, step: int, limit: int) -> None:
        if step % _TOLD_EVERY == 0 or step == limit:
            tell({"label": label, "step": step, "limit": limit})

    def play(content: Mapping[str, Any]) -> dict[str, Any]:
        url = content["world_url"]
        world = str(fetch_world(url)) if url else content["world"]
        outcome = plain_outcome(episodes.play(job_of({**content, "world": world}), progress))
        if options["seen"] and outcome["reason"] and not os.path.isdir(world):
            outcome["reason"] += f" (on the machine {os.uname().nodename})"
        return outcome

    return play


def plain_job(job: Job) -> dict[str, Any]:
    """Return a job as JSON has it; `job_of` makes the same of it."""
    return {**asdict(job), "world": str(job.world)}


def job_of(content: Mapping[str, Any]) -> Job:
    """Make a job of what `plain_job` returned."""
    return Job(**{**content, "world": Path(content["world"]), "terms": Terms(**content["terms"])})


def plain_outcome(outcome: Outcome) -> dict[str, Any]:
    """Return an outcome, without its job, as JSON has it; `outcome_of` makes the same of it."""
    record = None if outcome.record is None else asdict(outcome.record)
    return {"record": record, "reason": outcome.reason, "world_digest": outcome.world_digest, "kept": outcome.kept}


def outcome_of(job: Job, content: Mapping[str, Any]) -> Outcome:
    """Make an outcome of what `plain_outcome` returned."""
    record = content["record"]
    return Outcome(job, **{**content, "record": None if record is None else record_of(record)})


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

    def take_answer(index: int, answer: Answer) -> None:
        job = jobs[index]
        content = answer.content
        outcomes[index] = Outcome(job, None, answer.reason) if content is None else outcome_of(job, content)
        if finished is not None:
            finished(outcomes[index], len(outcomes), len(jobs))

    def show_progress(message: Mapping[str, Any]) -> None:
        if progress is not None:
            progress(message["label"], message["step"], message["limit"])

    if isinstance(store, FolderStore):
        _clear(store.folder)
    if ray is None:
        workers = min(workers, max(1, len(jobs)))
    with open_executor(workers=workers, ray=ray) as executor, shared_store_marker(store, executor) as seen:
        service = episodes_service(challenge, str(store), code=code_digest(), record=record, seen=seen)
        executor.run(service, tasks, done=take_answer, told=show_progress)
    return [outcomes[index] for index in range(len(jobs))]


def _clear(folder: Path) -> None:
    """Take away what was being written when an evaluation was killed."""
    for pattern in (".seen-*", "episodes/.*", "tasks/.*"):
        for path in folder.glob(pattern):
            path.unlink(missing_ok=True)
