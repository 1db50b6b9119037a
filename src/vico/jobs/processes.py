"""Processes of this machine that do tasks; one that dies is started again, once for the task it died of."""

from __future__ import annotations

import json
import multiprocessing
import signal
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from typing import Any

from vico import threads
from vico.jobs.contract import Answer, Done, Service, Task, Told, answer_of
from vico.jobs.worker import serve

_TRIES = 2
_GRACE = 5.0  # seconds that processes have to end


class _Worker:
    """One process, the connection to it, and what it is at."""

    def __init__(self, service: Service, share: int) -> None:
        # Fresh processes: a fork of one with compiled code and threads in it may hang.
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        told = (theirs, service.maker, json.dumps(dict(service.options)), {threads.WORKERS: str(share)})
        self.process: BaseProcess = context.Process(target=serve, args=told, daemon=True)
        self.process.start()
        theirs.close()
        self.index: int | None = None
        self.near: str | None = None

    def give(self, index: int, task: Task) -> None:
        """Let it do a task."""
        self.index, self.near = index, task.near
        with suppress(OSError):  # it is dead, which is noticed where its answer is waited for
            self.connection.send_bytes(json.dumps(dict(task.content)).encode())

    def end(self) -> str:
        """End it; return how it ended if it had on its own."""
        self.connection.close()
        self.process.join(0.5)
        if self.process.is_alive():
            self.process.kill()
        self.process.join(_GRACE)
        code = self.process.exitcode
        return f"was ended by {signal.Signals(-code).name}" if code and code < 0 else f"ended with exit status {code}"


class Processes:
    """Processes for tasks; started as they are needed, ended with the block.

    Parameters
    ----------
    most
        How many at most; they share the processors.
    """

    one_machine = True

    def __init__(self, most: int) -> None:
        self._most = most
        self._workers: list[_Worker] = []

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def run(self, service: Service, tasks: Sequence[Task], *, done: Done, told: Told | None = None) -> None:
        """Do all tasks; say what came of each as it is over.

        Raises
        ------
        InputError
            If a process cannot make the service.
        OutputError
            If one can't write what it did.
        """
        round_of_tasks = _Round(service, tasks, self._workers, min(self._most, len(tasks)))
        try:
            round_of_tasks.run(done, told)
        finally:
            self._end()  # the next service is another

    def _end(self) -> None:
        for worker in self._workers:
            worker.process.kill()  # whatever it is at: files are written whole or not at all
        for worker in self._workers:
            worker.end()
        self._workers.clear()


class _Round:
    """The tasks of one service, and who is at which."""

    def __init__(self, service: Service, tasks: Sequence[Task], workers: list[_Worker], most: int) -> None:
        self._service, self._tasks, self._workers, self._most = service, tasks, workers, most
        self._share = max(1, threads.workers() // max(1, most))
        self._waiting = list(range(len(tasks)))
        self._died: Counter[int] = Counter()

    def run(self, done: Done, told: Told | None) -> None:
        """Do them all."""
        while True:
            self._hand_out()
            busy: dict[Any, _Worker] = {w.connection: w for w in self._workers if w.index is not None}
            if not busy:
                return
            for connection in wait(list(busy)):
                self._hear(busy[connection], done, told)

    def _hand_out(self) -> None:
        """Give each idle process a task, of the world it knows if there is one."""
        while self._waiting and len(self._workers) < self._most:
            if any(worker.index is None for worker in self._workers):
                break
            self._workers.append(_Worker(self._service, self._share))
            self._give(self._workers[-1])
        for worker in self._workers:
            if worker.index is None and self._waiting:
                self._give(worker)

    def _give(self, worker: _Worker) -> None:
        others = {other.near for other in self._workers if other is not worker}
        same = (i for i in self._waiting if self._tasks[i].near == worker.near)
        free = (i for i in self._waiting if self._tasks[i].near not in others)
        index = next(same, None)
        if index is None:
            index = next(free, self._waiting[0])
        self._waiting.remove(index)
        worker.give(index, self._tasks[index])

    def _hear(self, worker: _Worker, done: Done, told: Told | None) -> None:
        assert worker.index is not None
        message = _received(worker)
        if message is None:
            self._lost(worker, done)
        elif "told" in message:
            if told is not None:
                told(message["told"])
        else:
            answer = answer_of(message)
            index, worker.index = worker.index, None
            done(index, answer)

    def _lost(self, worker: _Worker, done: Done) -> None:
        """Do a dead process's task again in another one; mark it if that was its second try."""
        assert worker.index is not None
        index = worker.index
        how = worker.end()
        self._workers.remove(worker)
        self._died[index] += 1
        if self._died[index] < _TRIES:
            self._waiting.insert(0, index)
            return
        done(index, Answer(None, f"its process {how}, twice; it may lack memory: try fewer --workers"))


def _received(worker: _Worker) -> dict[str, Any] | None:
    """Return the next message; None if there will be none."""
    try:
        message: dict[str, Any] = json.loads(worker.connection.recv_bytes())
    except (EOFError, OSError):
        return None
    return message
