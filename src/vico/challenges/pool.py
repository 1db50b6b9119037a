"""Processes that play jobs side by side; one that dies is started again, once for the job it died of."""

from __future__ import annotations

import json
import multiprocessing
import signal
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from vico import threads
from vico.challenges.episodes import Outcome
from vico.challenges.records import Job, Progress
from vico.challenges.worker import WorkerOptions, outcome_of, plain_job, serve
from vico.errors import OutputError

_TRIES = 2
_GRACE = 5.0  # seconds that processes have to end

Done = Callable[[int, Outcome], None]


class _Worker:
    """One process, the connection to it, and what it is at."""

    def __init__(self, options: WorkerOptions) -> None:
        # Fresh processes: a fork of one with compiled code and threads in it may hang.
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(target=serve, args=(theirs, options), daemon=True)
        self.process.start()
        theirs.close()
        self.index: int | None = None
        self.world: Path | None = None

    def give(self, index: int, job: Job) -> None:
        """Let it play a job."""
        self.index, self.world = index, job.world
        with suppress(OSError):  # it is dead, which is noticed where its answer is waited for
            self.connection.send_bytes(json.dumps(plain_job(job)).encode())

    def end(self) -> str:
        """End it; return how it ended if it had on its own."""
        self.connection.close()
        self.process.join(0.5)
        if self.process.is_alive():
            self.process.kill()
        self.process.join(_GRACE)
        code = self.process.exitcode
        return f"was ended by {signal.Signals(-code).name}" if code and code < 0 else f"ended with exit status {code}"


class WorkerPool:
    """Processes for the jobs of a challenge; started as they are needed, ended with the block.

    Parameters
    ----------
    challenge
        Its name, or ``my_module:MY_CHALLENGE``.
    folder, code, record
        As `vico.challenges.episodes.Player` has them.
    workers
        How many at most; they share the processors.
    """

    def __init__(self, challenge: str, folder: Path, *, code: str, record: bool, workers: int) -> None:
        share = max(1, threads.workers() // workers)
        self._options = WorkerOptions(challenge, str(folder), code, record, share)
        self._most = workers
        self._workers: list[_Worker] = []
        self._died: Counter[int] = Counter()

    def __enter__(self) -> WorkerPool:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._workers:
            worker.process.kill()  # whatever it is at: files are written whole or not at all
        for worker in self._workers:
            worker.end()
        self._workers.clear()

    def play(self, jobs: Sequence[Job], done: Done, progress: Progress | None = None) -> None:
        """Play all jobs; say what came of each as it is over.

        Raises
        ------
        OutputError
            If a worker can't write what it played.
        """
        waiting = list(range(len(jobs)))
        while True:
            self._hand_out(jobs, waiting)
            busy: dict[Any, _Worker] = {w.connection: w for w in self._workers if w.index is not None}
            if not busy:
                return
            for connection in wait(list(busy)):
                self._hear(busy[connection], jobs, waiting, done, progress)

    def _hand_out(self, jobs: Sequence[Job], waiting: list[int]) -> None:
        """Give each idle worker a job, of the world it knows if there is one."""
        while waiting and len(self._workers) < self._most:
            if any(worker.index is None for worker in self._workers):
                break
            self._workers.append(_Worker(self._options))
            self._give(self._workers[-1], jobs, waiting)
        for worker in self._workers:
            if worker.index is None and waiting:
                self._give(worker, jobs, waiting)

    def _give(self, worker: _Worker, jobs: Sequence[Job], waiting: list[int]) -> None:
        others = {other.world for other in self._workers if other is not worker}
        same = (i for i in waiting if jobs[i].world == worker.world)
        free = (i for i in waiting if jobs[i].world not in others)
        index = next(same, None)
        if index is None:
            index = next(free, waiting[0])
        waiting.remove(index)
        worker.give(index, jobs[index])

    def _hear(
        self, worker: _Worker, jobs: Sequence[Job], waiting: list[int], done: Done, progress: Progress | None
    ) -> None:
        assert worker.index is not None
        message = _received(worker.connection)
        if message is None:
            self._lost(worker, jobs, waiting, done)
        elif "progress" in message:
            if progress is not None:
                label, step, limit = message["progress"]
                progress(label, step, limit)
        elif "output_error" in message:
            raise OutputError(message["output_error"])
        else:
            index, worker.index = worker.index, None
            done(index, outcome_of(jobs[index], message["outcome"]))

    def _lost(self, worker: _Worker, jobs: Sequence[Job], waiting: list[int], done: Done) -> None:
        """Play a dead worker's job again in another process; mark it if that was its second try."""
        assert worker.index is not None
        index = worker.index
        how = worker.end()
        self._workers.remove(worker)
        self._died[index] += 1
        if self._died[index] < _TRIES:
            waiting.insert(0, index)
            return
        reason = f"its process {how}, twice; it may lack memory: try fewer --workers"
        done(index, Outcome(jobs[index], None, reason))


def _received(connection: Connection) -> dict[str, Any] | None:
    """Return the next message; None if there will be none."""
    try:
        message: dict[str, Any] = json.loads(connection.recv_bytes())
    except (EOFError, OSError):
        return None
    return message
