"""Folders that one process of a test run makes and all of them read."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Callable
from pathlib import Path

#: Makes a folder unless a process of this run has: its name, and what writes it.
Shared = Callable[[str, Callable[[Path], object]], Path]


class SharedFolders:
    """What the processes of a test run share, below pytest's temporary folder.

    Parameters
    ----------
    temporary
        The temporary folder of this process. With pytest-xdist it lies in the one of the whole run.
    """

    def __init__(self, temporary: Path) -> None:
        own_process = "PYTEST_XDIST_WORKER" in os.environ
        self._root = (temporary.parent if own_process else temporary) / "shared"
        self._root.mkdir(exist_ok=True)
        self._seen: dict[Path, list[tuple[str, int, int]]] = {}

    def folder(self, name: str, make: Callable[[Path], object]) -> Path:
        """Return the folder of a name; the first process that asks makes it while others that ask wait.

        Parameters
        ----------
        name
            Of the folder.
        make
            Writes it; the path that it is given does not exist yet, its parent does.
        """
        out, done = self._root / name, self._root / f"{name}.done"
        if out in self._seen:
            return out
        with open(self._root / f"{name}.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # the system lets go of it if this process dies
            if not done.exists():
                shutil.rmtree(out, ignore_errors=True)  # what one that died left
                make(out)
                done.touch()
        self._seen[out] = _contents(out)
        return out

    def confirm(self) -> None:
        """Make sure that nobody changed what this process read.

        Raises
        ------
        AssertionError
            If a file or folder came, went, or was written.
        """
        for out, before in self._seen.items():
            assert _contents(out) == before, f"a test changed {out}, which all tests share: let it work on a copy"


def _contents(folder: Path) -> list[tuple[str, int, int]]:
    """Every path below a folder with its size and when it was written, ns."""
    found = sorted(folder.rglob("*"))
    return [(str(path.relative_to(folder)), path.lstat().st_size, path.lstat().st_mtime_ns) for path in found]
