"""Playing many episodes of a challenge: side by side, on disk as soon as each is over, gone on with after a kill."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

from vico.challenges.episodes import Outcome, Player, code_digest
from vico.challenges.pool import WorkerPool
from vico.challenges.records import Job, Progress, Setting
from vico.challenges.registry import check_methods, load_challenge
from vico.challenges.worker import plain_job
from vico.errors import InputError
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
    folder: Path,
    *,
    workers: int = 1,
    record: bool = False,
    progress: Progress | None = None,
    finished: Finished | None = None,
) -> list[Outcome]:
    """Play every job whose episode is not in the folder yet.

    What an episode came to goes to ``folder/episodes`` as soon as it is over, its task to ``folder/tasks``. A job that
    can't be played, because its world does not hold what the task needs or is gone, or because its process was ended
    twice, does not end the others: its outcome says why. Nothing depends on how many workers there are, nor on the
    order of the jobs.

    Parameters
    ----------
    challenge
        Its name, or ``my_module:MY_CHALLENGE``.
    workers
        Processes side by side; with one, episodes are played in this process.
    record
        Whether each episode is recorded as a run, in ``folder/runs``, that the viewer replays.
    progress
        Told how far each episode is.
    finished
        Told of each outcome.

    Returns
    -------
    list of Outcome
        In the order of the jobs.

    Raises
    ------
    InputError
        If there is no such challenge, or one job is given twice.
    OutputError
        If the folder can't be written. What is there by then stays, as it does after Ctrl-C.
    """
    if workers < 1:
        raise InputError(f"workers: {workers}; at least one is needed")
    if len({json.dumps(plain_job(job), sort_keys=True) for job in jobs}) < len(jobs):
        raise InputError("evaluate: a job is given twice; its episode would count twice")
    known = load_challenge(challenge)
    outcomes: dict[int, Outcome] = {}

    def done(index: int, outcome: Outcome) -> None:
        outcomes[index] = outcome
        if finished is not None:
            finished(outcome, len(outcomes), len(jobs))

    _clear(folder)
    if min(workers, len(jobs)) <= 1:
        player = Player(known, folder, code=code_digest(), record=record)
        for index, job in enumerate(jobs):
            done(index, player.play(job, progress))
    else:
        with WorkerPool(challenge, folder, code=code_digest(), record=record, workers=workers) as pool:
            pool.play(jobs, done, progress)
    return [outcomes[index] for index in range(len(jobs))]


def _clear(folder: Path) -> None:
    """Take away what was being written when an evaluation was killed."""
    for part in ("episodes", "tasks"):
        for path in (folder / part).glob(".*"):
            path.unlink(missing_ok=True)
