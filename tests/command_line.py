"""The command line in this process, and in one that is killed."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable

import pytest

from vico.cli.main import main


def vico(*arguments: object) -> int:
    """Run a command; return its exit code."""
    with pytest.raises(SystemExit) as exit_:
        main([str(argument) for argument in arguments])
    code = exit_.value.code
    assert code is None or isinstance(code, int)
    return code or 0


def kill_once(arguments: list[object], ready: Callable[[], bool]) -> None:
    """Start a command and kill it, without warning, as soon as `ready`."""
    process = subprocess.Popen(
        [sys.executable, "-m", "vico.cli.main", *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 240
    while not ready():
        assert process.poll() is None, f"finished before it was killed: {process.communicate()[1]}"
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.kill()
    process.communicate()
    assert process.returncode == -signal.SIGKILL


def interrupted(arguments: list[object], ready: Callable[[], bool], number: signal.Signals) -> tuple[int, str]:
    """Start a command, send it a signal as soon as `ready`, and return its exit code and what it said."""
    process = subprocess.Popen(
        [sys.executable, "-m", "vico.cli.main", *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 240
    while not ready():
        assert process.poll() is None, f"finished before it was interrupted: {process.communicate()[1]}"
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(number)
    _, said = process.communicate(timeout=120)
    return process.returncode, said
