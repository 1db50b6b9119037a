"""Services for executors: what they do is in their options and tasks."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from vico.errors import InputError, OutputError


def doubler(options: Mapping[str, Any], tell: Callable[[Mapping[str, Any]], None]) -> Callable[..., dict[str, Any]]:
    """Return what doubles numbers, and does worse where it is asked to."""
    if options.get("refuse"):
        raise InputError("no doubling today")
    made = os.getpid()

    def double(task: Mapping[str, Any]) -> dict[str, Any]:
        tell({"at": task["n"]})
        kill = task.get("kill")
        if kill and not Path(kill).exists():
            Path(kill).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if task.get("always"):
            os.kill(os.getpid(), signal.SIGKILL)
        if task.get("full"):
            raise OutputError("the disk is full")
        if task.get("bug"):
            raise KeyError("no such number")
        return {"twice": 2 * task["n"], "process": made}

    return double


def waiter(options: Mapping[str, Any], tell: Callable[[Mapping[str, Any]], None]) -> Callable[..., dict[str, Any]]:
    """Return what waits for a file, and says, also where nobody should take it for an answer, that it has begun."""

    def wait(task: Mapping[str, Any]) -> dict[str, Any]:
        print("begun")
        Path(task["begun"]).write_text(str(os.getpid()))
        while not Path(task["until"]).exists():
            time.sleep(0.01)
        return {}

    return wait


class Known:
    """An object that says in which process it is."""

    def __init__(self, maker: Callable[[], Any]) -> None:
        self._made = maker()

    def process(self) -> int:
        return os.getpid()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._made, name)
