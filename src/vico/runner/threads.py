"""A thread for one agent, which nobody has to wait for: not the run, and not the end of the program."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any

_Task = tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]


class AgentThread:
    """Does one task after the other in a daemon thread, which starts with the first.

    Unlike a pool of the standard library, it does not keep the program from ending while a task never returns.

    Parameters
    ----------
    name
        Of the agent, for debuggers.
    """

    def __init__(self, name: str) -> None:
        self._tasks: SimpleQueue[_Task | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=f"agent {name}", daemon=True)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Do a task after those before it; return what it will come to."""
        future: Future[Any] = Future()
        self._tasks.put((future, task, arguments))
        if not self._thread.ident:
            self._thread.start()
        return future

    def close(self) -> None:
        """Let the thread end after the task it is at."""
        self._tasks.put(None)

    def _work(self) -> None:
        while (wanted := self._tasks.get()) is not None:
            future, task, arguments = wanted
            try:
                future.set_result(task(*arguments))
            except BaseException as error:
                future.set_exception(error)
