"""Audit of an isolated agent: what it reaches for and is not given is refused in its process, and reported.

Python tells audit hooks (PEP 578) of files that are opened and of looks at frames and at the garbage collector's list
of objects, and finders of the modules that are imported. This is a lock for honest people and lazy cheats, not a
sandbox: compiled code and processes that an agent starts are not seen, and an agent's code that means to can undo it.
docs/agents.md says what is caught and what is not.
"""

from __future__ import annotations

import os
import re
import site
import sys
import sysconfig
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from vico.errors import InputError

#: Parts of vico that hold the truth, or the tasks' answers.
CLOSED = ("vico.sim", "vico.challenges", "vico.viewer", "vico.worldgen", "vico.runner.truth")

_OTHER_PROCESS = re.compile(r"/proc/(\d+)(/|$)")
_PACKAGE = str(Path(__file__).parents[1]) + os.sep


class UnfairError(InputError):
    """An agent reached for what it is not given; the message says for what."""


class AuditHook:
    """Refuses and notes what agents' code may not do, from when it is started.

    Parameters
    ----------
    world
        Folder that it may not look into.
    own
        Folder or file whose code is the agent's, even where other packages are installed.

    Attributes
    ----------
    noticed
        What was refused and has not been said yet.
    """

    def __init__(self, world: Path, own: Path | None = None) -> None:
        self.noticed: list[str] = []
        self._world = os.path.realpath(world)
        self._own = None if own is None else os.path.realpath(own)
        paths = {sysconfig.get_paths()[name] for name in ("stdlib", "platstdlib", "purelib", "platlib")}
        paths |= {*site.getsitepackages(), site.getusersitepackages()}
        folders = {folder + os.sep for path in paths for folder in (path, os.path.realpath(path))}
        self._libraries = tuple(sorted(folders))
        self._local = threading.local()
        self._paused = False
        self._rules: dict[str, Callable[[FrameType | None, tuple[Any, ...]], str | None]] = {
            "open": self._judge_opening,
            "os.listdir": self._judge_opening,
            "os.scandir": self._judge_opening,
            "os.kill": self._judge_signal,
            "os.killpg": self._judge_signal,
            **dict.fromkeys(("gc.get_objects", "gc.get_referrers", "gc.get_referents"), self._judge_search),
            **dict.fromkeys(("sys._getframe", "sys._current_frames"), self._judge_frame),
        }

    def start(self) -> None:
        """Begin; there is no end to it in this process."""
        sys.addaudithook(self._audit)
        sys.meta_path.insert(0, self)  # a finder that finds nothing; asked for each module

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """Look at the name of a module that is being imported for the first time, as a finder of modules."""
        if not self._paused and (found := self._judge_import(sys._getframe(1), name)) is not None:
            self.noticed.append(found)
            raise UnfairError(found)

    @contextmanager
    def pause(self) -> Iterator[None]:
        """Let vico itself read the world in the block, before the agent is there."""
        self._paused = True
        try:
            yield
        finally:
            self._paused = False

    def take_notices(self) -> str:
        """Return what was noticed, and forget it."""
        said = "; ".join(dict.fromkeys(self.noticed))
        self.noticed.clear()
        return said

    def _audit(self, event: str, arguments: tuple[Any, ...]) -> None:
        rule = self._rules.get(event)
        if rule is None or self._paused or getattr(self._local, "busy", False):
            return
        self._local.busy = True  # looking at frames and paths raises events of its own
        try:
            found = rule(sys._getframe(1), arguments)
        finally:
            self._local.busy = False
        if found is not None:
            self.noticed.append(found)
            raise UnfairError(found)

    def _judge_opening(self, frame: FrameType | None, arguments: tuple[Any, ...]) -> str | None:
        path = arguments[0] if arguments else None
        if not isinstance(path, str | bytes | os.PathLike):
            return None
        real = os.path.realpath(os.fsdecode(path))
        if real == self._world or real.startswith(self._world + os.sep):
            return "reads the world's folder; agents are given observations and the public map"
        other = _OTHER_PROCESS.match(real)
        if other is not None and int(other.group(1)) != os.getpid():
            return "looks into another process"
        return None

    def _judge_import(self, frame: FrameType | None, name: str) -> str | None:
        if not any(name == closed or name.startswith(f"{closed}.") for closed in CLOSED):
            return None
        while frame is not None and "importlib" in frame.f_code.co_filename:
            frame = frame.f_back
        return f"imports {name}; put the agent into a module without it" if self._is_agents(frame) else None

    def _judge_signal(self, frame: FrameType | None, arguments: tuple[Any, ...]) -> str | None:
        # Processes that it started itself it may end.
        return "signals the process that judges it" if arguments and arguments[0] in (os.getppid(), -1) else None

    def _judge_search(self, frame: FrameType | None, arguments: tuple[Any, ...]) -> str | None:
        return "searches the process's objects (gc)" if self._is_agents(frame) else None

    def _judge_frame(self, frame: FrameType | None, arguments: tuple[Any, ...]) -> str | None:
        if frame is not None and frame.f_code.co_filename.endswith(f"{os.sep}inspect.py"):
            frame = frame.f_back
        return "looks at the frames that call it" if self._is_agents(frame) else None

    def _is_agents(self, frame: FrameType | None) -> bool:
        """Whether code is the agent's own: neither vico's, nor Python's, nor of a package that is installed."""
        if frame is None:
            return False
        path = frame.f_code.co_filename
        if self._own is not None and os.path.realpath(path).startswith(self._own):
            return True
        return not path.startswith((_PACKAGE, "<frozen", *self._libraries))
