"""The command line and scripts in this process, and in one that is killed."""

from __future__ import annotations

import os
import runpy
import signal
import subprocess
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from vico.cli.main import main


def vico(*arguments: object) -> int:
    """Run a command; return its exit code."""
    with pytest.raises(SystemExit) as exit_:
        main([str(argument) for argument in arguments])
    code = exit_.value.code
    assert code is None or isinstance(code, int)
    return code or 0


def script(path: Path, *words: object) -> subprocess.CompletedProcess[str]:
    """Run a script in this process as Python would in its own; return what it printed and its exit code.

    What it imports from its folder, and what it sets of the process's surroundings, is forgotten after it.
    """
    printed, said, code = StringIO(), StringIO(), 0
    environment, known = dict(os.environ), set(sys.modules)
    command = [str(path), *map(str, words)]
    with (
        pytest.MonkeyPatch.context() as patched, chdir(Path.cwd()), warnings.catch_warnings(),
        redirect_stdout(printed), redirect_stderr(said),
    ):  # fmt: skip
        warnings.resetwarnings()
        warnings.simplefilter("ignore")
        patched.setattr(sys, "argv", command)
        patched.syspath_prepend(str(path.parent))
        try:
            runpy.run_path(str(path), run_name="__main__")
        except SystemExit as exit_:
            if isinstance(exit_.code, str):
                print(exit_.code, file=said)
            code = exit_.code if isinstance(exit_.code, int) else int(exit_.code is not None)
        except Exception:
            traceback.print_exc(file=said)
            code = 1
        finally:
            os.environ.clear()
            os.environ.update(environment)
            for name in set(sys.modules) - known:
                if Path(getattr(sys.modules[name], "__file__", None) or "/").parent == path.parent:
                    del sys.modules[name]
    return subprocess.CompletedProcess(command, code, printed.getvalue(), said.getvalue())


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
