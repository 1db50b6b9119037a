"""Objects in processes of their own, asked side by side: what vector environments are made of.

Processes are spawned, not forked: compiled code and threads do not survive a fork. A worker ends with its parent,
however that ends, and what goes wrong in a worker is raised in the parent.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from typing import Any

from vico.errors import InputError, VicoError
from vico.threads import WORKERS, workers

_PATIENCE = 5.0  # seconds a worker has to end by itself


class WorkerError(VicoError, RuntimeError):
    """A worker failed or ended."""


@dataclass(frozen=True)
class Call:
    """A method of a worker's object, and what it is called with."""

    method: str
    arguments: tuple[Any, ...] = ()
    keywords: dict[str, Any] = field(default_factory=dict)


class Workers:
    """One object a process.

    Parameters
    ----------
    makers
        Make the objects, each in its process: functions of a module (or `functools.partial` of them), with arguments
        that can be pickled.
    what
        What the objects are, for errors.

    Raises
    ------
    InputError
        If there are no makers.
    """

    def __init__(self, makers: Sequence[Callable[[], Any]], *, what: str = "env") -> None:
        if not makers:
            raise InputError(f"{what}: there are 0 of them to make; ask for 1 or more")
        self._what = what
        context = multiprocessing.get_context("spawn")
        # The workers share the processors.
        threads = os.environ.get(WORKERS, "").strip() or str(max(1, workers() // len(makers)))
        self._pipes: list[Connection] = []
        self._processes = []
        for k, maker in enumerate(makers):
            mine, theirs = context.Pipe()
            process = context.Process(
                target=_serve, args=(maker, theirs, threads), name=f"vico {what} {k}", daemon=True
            )
            process.start()
            theirs.close()
            self._pipes.append(mine)
            self._processes.append(process)

    def __len__(self) -> int:
        return len(self._pipes)

    @property
    def pids(self) -> list[int | None]:
        """Numbers of the processes."""
        return [process.pid for process in self._processes]

    def ask(self, calls: Sequence[Call | None]) -> list[Any]:
        """Make one call of each worker, all at the same time; return what they return, None where none was made.

        Raises
        ------
        WorkerError
            If one fails or has ended; all of them are closed then.
        InputError
            If they are closed.
        """
        if not self._pipes:
            raise InputError(f"{self._what}: the workers are closed; make new ones")
        if len(calls) != len(self):
            raise InputError(f"{self._what}: {len(calls)} calls for {len(self)} workers; give one for each")
        try:
            for k, call in enumerate(calls):
                if call is not None:
                    self._send(k, call)
            return [None if call is None else self._receive(k, call) for k, call in enumerate(calls)]
        except BaseException:
            self.close(patience=0.0)
            raise

    def ask_all(self, method: str) -> list[Any]:
        """Make the same call of every worker."""
        return self.ask([Call(method)] * len(self))

    def close(self, *, patience: float = _PATIENCE) -> None:
        """End the processes."""
        for pipe in self._pipes:
            try:
                pipe.send(None)
            except OSError:
                continue
        for pipe, process in zip(self._pipes, self._processes, strict=True):
            process.join(patience)
            if process.is_alive():
                process.kill()
                process.join()
            pipe.close()
        self._pipes, self._processes = [], []

    def _send(self, k: int, call: Call) -> None:
        try:
            self._pipes[k].send(call)
        except (BrokenPipeError, ConnectionError):
            raise self._exit_error(k, call) from None

    def _receive(self, k: int, call: Call) -> Any:
        try:
            good, value = self._pipes[k].recv()
        except (EOFError, ConnectionError):
            raise self._exit_error(k, call) from None
        if not good:
            raise WorkerError(f"{self._name(k)} failed in {call.method}: {value}")
        return value

    def _exit_error(self, k: int, call: Call) -> WorkerError:
        self._processes[k].join(_PATIENCE)
        code = self._processes[k].exitcode
        if code is not None and code < 0:
            how = f"was killed by {signal.Signals(-code).name}; if there is not enough memory, make fewer"
        else:
            how = f"ended with code {code}; a script that makes workers has to do so under if __name__ == '__main__':"
        return WorkerError(f"{self._name(k)}, asked for {call.method}, {how}")

    def _name(self, k: int) -> str:
        return f"{self._what} worker {k} of {len(self)}"


def _serve(maker: Callable[[], Any], pipe: Connection, threads: str) -> None:
    """Make an object and answer calls until there are no more."""
    os.environ[WORKERS] = threads
    # Ctrl-C is the parent's, which ends the workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    made: Any = None
    while True:
        try:
            call = pipe.recv()
        except (EOFError, OSError):
            return
        if call is None:
            return
        try:
            made = maker() if made is None else made
            found = getattr(made, call.method)
            answer = True, found(*call.arguments, **call.keywords) if callable(found) else found
        except VicoError as error:
            answer = False, str(error)
        except Exception as error:
            where = "".join(traceback.format_tb(error.__traceback__))
            answer = False, f"{type(error).__name__}: {error}\n{where}".rstrip()
        try:
            pipe.send(answer)
        except OSError:
            return


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
