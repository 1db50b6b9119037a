"""Files and folders that appear whole or not at all, JSON that explains what is wrong with it, hashes, and locks.

Whoever writes into a folder holds a lock on it (`flock` on the folder itself: no lock file is left behind, and the
system lets go of it when the process ends, however it ends). Whoever wants to replace the folder is refused meanwhile.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vico.errors import MissingFileError, OutputError, OutputExistsError, SchemaError, VicoError

_REASONS = {
    errno.ENOSPC: "the disk is full; free some space and give the same command again",
    errno.EDQUOT: "the disk quota is used up; free some space and give the same command again",
    errno.EROFS: "it lies on a read-only file system; choose another folder",
    errno.EACCES: "permission denied; choose another folder, or change its rights",
    errno.EPERM: "permission denied; choose another folder, or change its rights",
    errno.ENOENT: "its folder was taken away while it was written; give the same command again",
    errno.ENOTDIR: "a part of its path is not a folder; choose another path",
    errno.ENAMETOOLONG: "the name is too long; choose a shorter one",
    errno.EMFILE: "too many files are open; raise the limit (ulimit -n)",
}


@contextmanager
def write_errors(path: Path) -> Iterator[None]:
    """Turn any `OSError` of the block, which writes `path`, into an `OutputError` that says how to mend it."""
    try:
        yield
    except VicoError:
        raise
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {reason_of(error)}") from None


def reason_of(error: OSError, *, writing: bool = True) -> str:
    """Return why a file could not be written (or, not `writing`, be used at all), and how to mend it."""
    if error.errno == errno.ENOENT and not writing:
        return "no such file or folder; give one that is there"
    return _REASONS.get(error.errno or 0) or error.strerror or str(error)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Yield a temporary neighbour of `path`, an empty file; it takes the name of `path` when the block ends well.

    For writers that want a path; its suffix is that of `path`. `write_bytes` is for those that have the content.

    Raises
    ------
    OutputError
        If it cannot be written; `path` is then what it was before.
    """
    with write_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}.", suffix=path.suffix)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            with temporary.open("rb") as file:
                os.fsync(file.fileno())
            temporary.chmod(0o644)
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


def write_bytes(path: Path, content: bytes | Sequence[bytes]) -> None:
    """Write a file, given in one or several pieces, whole or not at all.

    Raises
    ------
    OutputError
        If it cannot be written; `path` is then what it was before.
    """
    with new_file(path) as temporary, temporary.open("wb") as file:
        file.writelines([content] if isinstance(content, bytes | bytearray | memoryview) else content)


def json_bytes(content: Any) -> bytes:
    """Return JSON with sorted keys and a fixed layout, so that equal content gives equal bytes."""
    return (json.dumps(content, indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode()


def write_json(path: Path, content: Any) -> None:
    """Write `json_bytes` of the content, whole or not at all."""
    write_bytes(path, json_bytes(content))


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is not JSON; the message gives the line.
    """
    try:
        return json.loads(path.read_bytes())
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise SchemaError(f"{path}: not valid JSON ({error}); restore the file or build it anew") from None


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)


# What file managers leave in folders: nobody's work.
_LITTER = frozenset({".DS_Store", "Thumbs.db", "desktop.ini"})
# How `vico.io.files` names a file until it is whole.
_HALF_WRITTEN = re.compile(r"^\.(.+)\.[a-z0-9_]{8}(?:\.[^.]+)?$")


@dataclass(frozen=True)
class FolderKind:
    """A kind of folder that a verb makes, so that ``--force`` replaces nothing else.

    Attributes
    ----------
    name
        What to call one in errors: ``run``.
    manifest
        File that each of them has.
    patterns
        Returns the files that a folder of this kind may hold, given one with its manifest: paths relative to it, in
        which ``*`` stands for any part of a name and ``**`` for any part of a path.
    """

    name: str
    manifest: str
    patterns: Callable[[Path], Collection[str]]

    def require(self, folder: Path) -> None:
        """Make sure that a folder is of this kind, with nothing of anybody else's in it, or empty.

        Raises
        ------
        OutputExistsError
            If it is not.
        """
        if folder.is_symlink():
            raise OutputExistsError(f"{folder}: is a link, and --force replaces no links; give the folder it leads to")
        if not folder.is_dir():
            article = "an" if self.name[0] in "aeiou" else "a"
            raise OutputExistsError(
                f"{folder}: is no folder, and --force replaces {article} {self.name} alone; choose another"
            )
        there = _files_in(folder)
        if there and self.manifest not in there:
            raise OutputExistsError(
                f"{folder}: holds {min(there)!r} and no {self.manifest}, so it is no {self.name}, and --force replaces "
                "nothing else; choose another --out, or take it away yourself"
            )
        if not there:
            return
        ours = re.compile("|".join(map(_expression, {self.manifest, *self.patterns(folder)})))
        if others := [name for name in there if not ours.fullmatch(name)]:
            raise OutputExistsError(
                f"{folder}: holds {min(others)!r}, which no {self.name} does; --force would delete it: choose another "
                "--out, or take it away yourself"
            )


def _files_in(folder: Path) -> set[str]:
    """Return the files in a folder and below it, and what else is no folder, by their paths relative to it.

    A file that was being written when the program was killed has its own name within a hidden one: it counts as that.
    Empty folders of anybody's count, too.
    """
    found = set()
    for here, folders, files in os.walk(folder):
        inside = Path(here).relative_to(folder)
        links = [name for name in folders if (Path(here) / name).is_symlink()]
        names = [_HALF_WRITTEN.sub(r"\1", name) for name in (*files, *links) if name not in _LITTER]
        found |= {(inside / name).as_posix() for name in names}
    return found


def _expression(pattern: str) -> str:
    """Return a pattern of paths as a regular expression."""
    parts = re.split(r"(\*\*|\*)", pattern)
    return "".join({"*": "[^/]*", "**": ".*"}.get(part, re.escape(part)) for part in parts)


def files_of_manifest(manifest: str, key: str = "files") -> Callable[[Path], Collection[str]]:
    """Return what finds the files of a folder whose manifest lists them by relative path."""

    def names(folder: Path) -> Collection[str]:
        content = read_json(folder / manifest)
        return [str(name) for name in content.get(key, ())] if isinstance(content, dict) else []

    return names


#: What a folder is, by the manifest that it holds.
_MANIFESTS = {
    "world.json": "a world",
    "city.json": "a city",
    "community.json": "a community",
    "run.json": "a run",
    "dataset.json": "a dataset",
    "results.json": "an evaluation",
    "export.json": "an export",
}


def describe_folder(folder: Path) -> str:
    """Say what a folder is, by its manifest: "a community"; empty if it is none of ours."""
    return next((what for manifest, what in _MANIFESTS.items() if (folder / manifest).is_file()), "")


def wrong_folder_sentence(folder: Path, wanted: str, make: str) -> str:
    """Return the sentence on a folder that is not of the kind that is wanted.

    Parameters
    ----------
    wanted
        The kind: ``world``, ``community``.
    make
        The command that makes one.
    """
    found = describe_folder(folder)
    if found:
        return f"{folder}: is {found}, and a {wanted} is wanted here; are two folders exchanged?"
    inside = sorted(path.name for path in folder.iterdir() if path.is_dir() and describe_folder(path) == f"a {wanted}")
    if inside:
        return f"{folder}: is no {wanted}, but holds one: give {folder / inside[0]}"
    return f"{folder}: is no finished {wanted}; make one with {make}"


class FolderLock:
    """The exclusive right to write into a folder, which is there already; held until `release`.

    Parameters
    ----------
    folder
        The folder.
    name
        What to call it in errors; `folder` itself if None.

    Raises
    ------
    OutputError
        If another process (or another lock of this one) holds it, or the folder cannot be opened.
    """

    def __init__(self, folder: Path, *, name: Path | None = None) -> None:
        self.folder, self.name = folder, name or folder
        with write_errors(self.name):
            self._handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            with write_errors(self.name):
                _lock(self._handle, self.name)
            self.confirm()
        except BaseException:
            self.release()
            raise

    def confirm(self) -> None:
        """Make sure that the folder is still the one that was locked.

        Raises
        ------
        OutputError
            If it was deleted, moved or replaced since.
        """
        held = os.fstat(self._handle)
        try:
            there = os.stat(self.folder)
        except OSError:
            there = None
        if there is None or (there.st_ino, there.st_dev) != (held.st_ino, held.st_dev):
            raise OutputError(
                f"{self.name}: {self.folder} was taken away while it was written; give the same command again"
            )

    def release(self) -> None:
        """Let others write; nothing happens if that was done before."""
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1

    def __enter__(self) -> FolderLock:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def _lock(handle: int, name: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OutputError(
            f"{name}: another process is writing it right now; stop that one, or choose another folder"
        ) from None


def is_being_written(folder: Path) -> bool:
    """Return whether a living process holds the lock of a folder."""
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(handle)
    return False


def check_replaceable(out: Path, *, force: bool, kind: FolderKind | None = None) -> None:
    """Make sure that an output folder may be made, or replaced.

    Parameters
    ----------
    kind
        What is to be made; None for folders that only this program has to do with.

    Raises
    ------
    OutputExistsError
        If it holds something and `force` is not given, or something else than a folder of that kind.
    OutputError
        If another process is writing it.
    """
    if not force and (out.exists() or out.is_symlink()) and (not out.is_dir() or any(out.iterdir())):
        raise OutputExistsError(f"{out}: exists already; choose another --out, or replace it with --force")
    if kind is not None and (out.exists() or out.is_symlink()):
        kind.require(out)
    if is_being_written(out):
        raise OutputError(f"{out}: another process is writing it right now; stop that one, or choose another folder")


@contextmanager
def new_folder(
    out: Path, *, force: bool = False, work: Path | None = None, kind: FolderKind | None = None
) -> Iterator[Path]:
    """Yield a locked folder that takes the name of `out` when the block ends well.

    Parameters
    ----------
    out
        Folder to make; its parents are made, too.
    force
        Replace what is there.
    work
        Neighbour of `out` to work in. It is kept when the block fails, so that work can go on there the next time,
        unless it is empty. Without, the work is done in an unnamed neighbour that goes away when the block fails.
    kind
        What is made; None for folders that only this program has to do with.

    Raises
    ------
    OutputExistsError
        If `out` holds something and `force` is not given, or something else than a folder of that kind.
    OutputError
        If another process writes `out` or `work`, the disk is full, the folder is taken away while it is written, or
        rights are missing. What was at `out` is then still there.
    """
    check_replaceable(out, force=force, kind=kind)
    made = [path for path in (*([work] if work else []), *out.parents) if not path.exists()]
    with write_errors(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        if work is None:
            folder = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
            folder.chmod(0o755)
        else:
            folder = work
            folder.mkdir(exist_ok=True)
    with FolderLock(folder, name=out) as lock:
        try:
            with folder_errors(folder, name=out):
                yield folder
                lock.confirm()
                put_in_place(folder, out)
        except BaseException:
            if work is None:
                shutil.rmtree(folder, ignore_errors=True)
            for path in made:
                with suppress(OSError):
                    path.rmdir()  # works on empty folders alone: what was made here and not filled
            raise


@contextmanager
def folder_errors(folder: Path, *, name: Path | None = None) -> Iterator[None]:
    """Turn an `OSError` of the block that is about the disk, or about a path in `folder`, into an `OutputError`.

    Parameters
    ----------
    name
        What to call the folder in errors; `folder` itself if None.
    """
    try:
        yield
    except VicoError:
        raise
    except OSError as error:
        path = Path(os.fsdecode(error.filename)) if isinstance(error.filename, str | bytes) else None
        if error.errno not in _DISK and (path is None or not path.is_relative_to(folder)):
            raise
        raise OutputError(f"{name or folder}: cannot be written: {reason_of(error)}") from None


def put_in_place(folder: Path, out: Path) -> None:
    """Give a finished folder the name `out`; what was there goes once the new one has it.

    Raises
    ------
    OutputError
        If another process is writing what is at `out`, or it cannot be replaced.
    """
    with write_errors(out):
        if not (out.exists() or out.is_symlink()):
            os.replace(folder, out)
            return
        old = out.with_name(f".{out.name}.old-{os.getpid()}")
        if out.is_dir() and not out.is_symlink():
            with FolderLock(out):
                _swap(folder, out, old)
        else:
            _swap(folder, out, old)
        remove_path(old)


def _swap(folder: Path, out: Path, old: Path) -> None:
    os.replace(out, old)
    try:
        os.replace(folder, out)
    except BaseException:
        os.replace(old, out)
        raise


def remove_path(path: Path) -> None:
    """Delete a file, a link or a whole folder; nothing happens where there is none."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
