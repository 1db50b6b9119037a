"""Folders that one process of one test run makes, and all of this run and of later ones read."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol, TypeVar

import house
from vico.io.cache import cache_folder
from vico.worldgen.stages import read_product, write_product

_UNUSED = 21 * 86_400.0  # seconds after which a folder that no run has read goes
_KEPT = 4  # folders of a name: states of the sources between which one goes to and fro

T = TypeVar("T")


class Shared(Protocol):
    """Makes a folder unless a run has, from the same sources: its name, what writes it, and the rooms that takes."""

    def __call__(self, name: str, make: Callable[[Path], object], rooms: Collection[str] | None = None) -> Path: ...


class SharedFolders:
    """What the processes of test runs share, below a folder that outlives them.

    A folder is made anew when what it was made from has changed: source text of the rooms that make it and of those
    below, the file of its maker, packaged data, installed packages (`house.digest`); or when it is not as it was made.
    Whoever reads one holds a lock on it, so that no other run removes it.

    Parameters
    ----------
    root
        Where they lie.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._seen: dict[str, Path] = {}
        self._locks: list[int] = []
        self._digests: dict[Any, str] = {}
        self._doubtful: list[Path] = []

    def folder(self, name: str, make: Callable[[Path], object], rooms: Collection[str] | None = None) -> Path:
        """Return the folder of a name; the first process that asks makes it while others that ask wait.

        Parameters
        ----------
        name
            Of the folder.
        make
            Writes it; the path that it is given does not exist yet, its parent does.
        rooms
            What `make` uses; None stands for all of the house.
        """
        if name in self._seen:
            return self._seen[name]
        maker = Path(make.__code__.co_filename) if hasattr(make, "__code__") else Path(__file__)
        asked = (None if rooms is None else tuple(rooms), maker)
        if asked not in self._digests:
            self._digests[asked] = house.digest(*asked)
        out = self._root / f"{name}-{self._digests[asked]}"
        done = _done(out)
        self._root.mkdir(parents=True, exist_ok=True)
        with open(self._root / f"{out.name}.turn", "w") as turn:
            fcntl.flock(turn, fcntl.LOCK_EX)  # the system lets go of it if this process dies
            # Open as long as this process lives: whoever would remove the folder waits, or leaves it.
            lock = os.open(self._root / f"{out.name}.lock", os.O_CREAT | os.O_RDWR)
            self._locks.append(lock)
            if not _as_made(out):
                fcntl.flock(lock, fcntl.LOCK_EX)
                try:
                    done.unlink(missing_ok=True)
                    shutil.rmtree(out, ignore_errors=True)  # what one that died left
                    make(out)
                    done.write_text(json.dumps(_contents(out)))
                except BaseException:
                    os.close(self._locks.pop())
                    raise
                if house.digest(*asked) != self._digests[asked]:
                    self._doubtful.append(done)  # somebody edited meanwhile: for this run alone
                self._sweep(name)
            fcntl.flock(lock, fcntl.LOCK_SH)
        os.utime(done)
        self._seen[name] = out
        return out

    def product(self, name: str, make: Callable[[], T], rooms: Collection[str] | None = None) -> T:
        """Return what a function makes of ours (arrays, shapes, records): made once, read from a file since."""

        def write(out: Path) -> None:
            out.mkdir()
            write_product(out / "product", make(), key="")

        maker = Path(make.__code__.co_filename)
        stamp = house.digest([], maker)[:6]  # `write` stands in this file
        return read_product(self.folder(f"{name}-{stamp}", write, rooms) / "product")[0]

    def confirm(self) -> None:
        """Make sure that nobody changed what this process read, and let go of it: called once, at the end.

        Raises
        ------
        AssertionError
            If a file or folder came, went, or was written.
        """
        changed = [out for out in self._seen.values() if not _as_made(out)]
        for done in self._doubtful:
            done.unlink(missing_ok=True)
        for lock in self._locks:
            os.close(lock)
        assert not changed, f"a test changed {changed[0]}, which all tests share: let it work on a copy"

    def _sweep(self, name: str) -> None:
        """Remove what no run has read for long, and all but the newest folders of a name, unless a run reads them."""
        used: dict[Path, float] = {}
        for done in self._root.glob("*.done"):
            with suppress(OSError):  # another process removed it just now
                used[done] = done.stat().st_mtime
        old = {done for done, when in used.items() if when < time.time() - _UNUSED}
        own = sorted(
            (done for done in used if re.fullmatch(rf"{re.escape(name)}-[0-9a-f]+\.done", done.name)),
            key=used.__getitem__,
        )
        for done in old | set(own[:-_KEPT]):
            with open(done.with_suffix(".lock"), "w") as lock, suppress(OSError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                done.unlink()
                shutil.rmtree(done.with_suffix(""), ignore_errors=True)


def _done(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.done")


def _as_made(folder: Path) -> bool:
    """Return whether a folder is there, whole, and as it was made."""
    try:
        return bool(json.loads(_done(folder).read_text()) == _contents(folder))
    except (OSError, ValueError):
        return False


def _contents(folder: Path) -> list[list[Any]]:
    """Every path below a folder with its size and when it was written, ns."""
    found = sorted(folder.rglob("*"))
    return [[str(path.relative_to(folder)), path.lstat().st_size, path.lstat().st_mtime_ns] for path in found]


#: Those of this user. Tests that set `VICO_CACHE` find what was there before, too.
FOLDERS = SharedFolders(cache_folder() / "tests")
