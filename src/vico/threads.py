"""Work side by side: how many threads there are, and results that are the same for any number of them."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sized
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from vico.errors import InputError

T = TypeVar("T")
R = TypeVar("R")

WORKERS = "VICO_WORKERS"
_MOST = 256


def workers() -> int:
    """Return how many threads to use: `$VICO_WORKERS`, else the processors this process may run on.

    Raises
    ------
    InputError
        If the variable is no number in 1..256.
    """
    chosen = os.environ.get(WORKERS, "").strip()
    if chosen:
        if not (chosen.isascii() and chosen.isdigit() and 1 <= int(chosen) <= _MOST):
            raise InputError(f"{WORKERS}: {chosen[:20]!r}; give a number of threads in 1..{_MOST}, or unset it")
        return int(chosen)
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), _MOST)
    return min(os.cpu_count() or 1, _MOST)


def use_workers(number: int) -> None:
    """Use so many threads in this process from now on; 0 changes nothing.

    Raises
    ------
    InputError
        If it is no number in 0..256.
    """
    if not 0 <= number <= _MOST:
        raise InputError(f"--workers {number}; give a number of threads in 1..{_MOST}, or 0 for one a processor")
    if number:
        os.environ[WORKERS] = str(number)


def in_order(task: Callable[[T], R], items: Iterable[T], *, most: int = _MOST) -> Iterator[R]:
    """Do a task for each item in threads, and yield what they return in the order of the items.

    Parameters
    ----------
    task
        Must not depend on what the others do. Gains where it lets go of the interpreter's lock: compiled code, numpy,
        ray casts, pictures being encoded.
    items
        Taken as they are needed: no more than one beyond the threads waits to be yielded.
    most
        Threads to use at most, where each needs much memory.

    Yields
    ------
    object
        What `task` returned. What it raises is raised here, after the tasks under way are done.
    """
    many = min(workers(), most)
    if many == 1 or (isinstance(items, Sized) and len(items) == 1):
        yield from map(task, items)
        return
    with ThreadPoolExecutor(many) as pool:
        waiting: deque[Future[R]] = deque()
        try:
            for item in items:
                waiting.append(pool.submit(task, item))
                if len(waiting) > many:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()


def for_each(task: Callable[[T], object], items: Iterable[T], *, most: int = _MOST) -> None:
    """Do a task for each item in threads; all are done afterwards."""
    for _ in in_order(task, items, most=most):
        pass


def meanwhile(task: Callable[[], R]) -> Callable[[], R]:
    """Begin a task in a thread.

    Returns
    -------
    callable
        Waits for the task, and returns what it returned or raises what it raised; with one worker, does it then.
    """
    if workers() == 1:
        return task
    pool = ThreadPoolExecutor(1)
    future = pool.submit(task)
    pool.shutdown(wait=False)
    return future.result
