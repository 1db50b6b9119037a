"""Making parts in processes side by side; a process that dies takes only its own task with it, after a second try."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from vico import threads
from vico.datasets.worker import player

_TRIES = 2

#: Told the index of a task and what came of it.
Done = Callable[[int, Mapping[str, Any]], None]

_make: Callable[[Mapping[str, Any]], Mapping[str, Any]] | None = None


def run_tasks(
    options: Mapping[str, Any],
    tasks: Sequence[Mapping[str, Any]],
    *,
    workers: int,
    done: Done,
    tell: Callable[[Mapping[str, Any]], None],
) -> None:
    """Hand tasks to `vico.datasets.worker.player`; with one worker, in this process.

    Raises
    ------
    OutputError
        If a part cannot be written.
    """
    if min(workers, len(tasks)) <= 1:
        make = player(options, tell)
        for index, task in enumerate(tasks):
            done(index, make(task))
        return
    left = dict(enumerate(tasks))
    died: Counter[int] = Counter()
    share = max(1, threads.workers() // workers)
    while left:
        begun: set[int] = set()
        try:
            _run_some(options, left, workers, share, done, begun)
        except BrokenProcessPool:
            for index in sorted(begun & left.keys()):
                died[index] += 1
                if died[index] >= _TRIES:
                    done(index, {"reason": "its process was ended, twice; it may lack memory: try fewer --workers"})
                    del left[index]


def _run_some(
    options: Mapping[str, Any],
    left: dict[int, Mapping[str, Any]],
    workers: int,
    share: int,
    done: Done,
    begun: set[int],
) -> None:
    """Hand out what is left, a few at a time; note which were handed out, for one of those may end its process."""
    # Fresh processes: a fork of one with compiled code and threads in it may hang.
    context = multiprocessing.get_context("spawn")
    waiting = sorted(left)
    with ProcessPoolExecutor(workers, context, _start, (dict(options), share)) as pool:
        running: dict[Future[Mapping[str, Any]], int] = {}
        try:
            while waiting or running:
                while waiting and len(running) < workers:
                    index = waiting.pop(0)
                    begun.add(index)
                    running[pool.submit(_run, dict(left[index]))] = index
                finished = next(as_completed(running))
                index = running.pop(finished)
                done(index, finished.result())
                del left[index]
                begun.discard(index)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _start(options: Mapping[str, Any], share: int) -> None:
    global _make
    os.environ[threads.WORKERS] = str(share)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _make = player(options, lambda told: None)


def _end_with_parent() -> None:
    """End this process when the one that started it has ended, however it did: nobody waits for what it makes."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run(task: Mapping[str, Any]) -> Mapping[str, Any]:
    assert _make is not None
    return _make(task)
