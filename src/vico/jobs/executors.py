"""Executors of tasks on this machine: this process, several processes, or one helper process.

`open_executor` chooses between this process, processes of this machine and a Ray cluster (`vico.jobs.cluster`). A
process that dies is started again, once for the task it died of. A `Helper` is one more process that does tasks in
order, while this one goes on with something else.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from typing import Any

from vico import threads
from vico.errors import InputError
from vico.jobs.contract import (
    Answer,
    AnswerHandler,
    Executor,
    Json,
    MessageHandler,
    Service,
    Task,
    answer_of,
    make_service,
    message_of,
)
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

    one_machine: bool = True

    def __init__(self, most: int) -> None:
        self._most = most
        self._workers: list[_Worker] = []

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def run(
        self, service: Service, tasks: Sequence[Task], *, done: AnswerHandler, told: MessageHandler | None = None
    ) -> None:
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

    def run(self, done: AnswerHandler, told: MessageHandler | None) -> None:
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

    def _hear(self, worker: _Worker, done: AnswerHandler, told: MessageHandler | None) -> None:
        assert worker.index is not None
        message = _receive_message(worker)
        if message is None:
            self._replace_lost(worker, done)
        elif "told" in message:
            if told is not None:
                told(message["told"])
        else:
            answer = answer_of(message)
            index, worker.index = worker.index, None
            done(index, answer)

    def _replace_lost(self, worker: _Worker, done: AnswerHandler) -> None:
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


def _receive_message(worker: _Worker) -> dict[str, Any] | None:
    """Return the next message; None if there will be none."""
    try:
        message: dict[str, Any] = json.loads(worker.connection.recv_bytes())
    except (EOFError, OSError):
        return None
    return message


_MOST_WORKERS = 256


def open_executor(*, workers: int = 1, ray: str | None = None) -> Executor:
    """Return what does tasks side by side.

    Parameters
    ----------
    workers
        Processes on this machine; with one, all is done in this process. With `ray` it only says how many processors
        a cluster has that is started for the occasion.
    ray
        A Ray cluster instead: its address, ``auto`` for the one that ``RAY_ADDRESS`` names or that runs on this machine
        (one is started where there is none), ``local`` for one that is started and ended here.

    Raises
    ------
    InputError
        If there is no such cluster, or `workers` is no number of processes.
    MissingExtraError
        If Ray is not installed.
    """
    if not 1 <= workers <= _MOST_WORKERS:
        raise InputError(f"workers: {workers}; at least one is needed, and no more than {_MOST_WORKERS}")
    if ray is not None:
        from vico.jobs.cluster import RayCluster

        return RayCluster(ray, processors=workers)
    return Processes(workers) if workers > 1 else ThisProcess()


class ThisProcess:
    """Does one task after the other where it was asked."""

    one_machine: bool = True

    def run(
        self, service: Service, tasks: Sequence[Task], *, done: AnswerHandler, told: MessageHandler | None = None
    ) -> None:
        """Do all tasks, in order."""
        work = make_service(service, told or (lambda _: None))
        for index, task in enumerate(tasks):
            done(index, answer_of(message_of(work, task.content)))

    def __enter__(self) -> ThisProcess:
        return self

    def __exit__(self, *_: object) -> None:
        pass


_COMMAND = "from vico.jobs.worker import attend; attend({})"
_STDERR = 2


class Helper:
    """A process that is asked for tasks; closed with its block.

    It is started as a command of its own: a script that leads here needs no ``if __name__ == "__main__"``, as it would
    for processes that `multiprocessing` starts.

    Parameters
    ----------
    service
        What it does.
    share
        Threads it may use.

    Raises
    ------
    OSError
        If no process can be started.
    """

    def __init__(self, service: Service, *, share: int = 1) -> None:
        path = [folder or os.getcwd() for folder in sys.path]
        about = {threads.WORKERS: str(share), "PYTHONPATH": os.pathsep.join(path), "PYTHONSAFEPATH": "1"}
        # Answers have a pipe of their own: whatever prints must not get in between.
        ours, theirs = os.pipe()
        self._heard = os.fdopen(ours, "rb")
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-u", "-c", _COMMAND.format(theirs)],
                stdin=subprocess.PIPE,
                stdout=_STDERR,
                pass_fds=(theirs,),
                env=os.environ | about,
            )
        except OSError:
            self._heard.close()
            raise
        finally:
            os.close(theirs)
        self._asked = 0
        self._answers: dict[int, Answer] = {}
        self._withdrawn: dict[int, bool] = {}
        self._send({"maker": service.maker, "options": dict(service.options)})

    def __enter__(self) -> Helper:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, content: Json) -> int:
        """Have a task done after those that were asked for before; return its number."""
        self._asked += 1
        self._send({"number": self._asked, "content": dict(content)})
        return self._asked

    def withdraw(self, number: int) -> bool:
        """Take a task back; False if it was begun: then it will be answered."""
        if number in self._answers:
            return False
        self._send({"withdraw": number})
        while number not in self._withdrawn and self._hear():
            pass
        return self._withdrawn.pop(number, True)

    def answer(self, number: int) -> Answer:
        """Wait for a task, and return what came of it.

        A process that died, or could not make the service, answers with the reason.

        Raises
        ------
        OutputError
            If nothing can be written.
        """
        while number not in self._answers and self._hear():
            pass
        return self._answers.pop(number, Answer(None, f"its process ended with exit status {self._process.poll()}"))

    def close(self) -> None:
        """End the process, whatever it is at: files are written whole or not at all."""
        self._process.kill()
        self._heard.close()
        assert self._process.stdin is not None
        with suppress(OSError):  # what it was told last it will never read
            self._process.stdin.close()
        self._process.wait()

    def _send(self, message: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        with suppress(OSError):  # it is dead, which is noticed where its answer is waited for
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()

    def _hear(self) -> bool:
        """Take the next message in; False if there will be none."""
        line = self._heard.readline()
        if not line.endswith(b"\n"):
            self._process.wait()
            return False
        message = json.loads(line)
        if "withdrawn" in message:
            self._withdrawn[message["number"]] = message["withdrawn"]
        else:
            self._answers[message["number"]] = answer_of(message)
        return True
