"""Files written whole or not at all, JSON that explains what is wrong with it, and hashes of what was read."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from vico.errors import MissingFileError, OutputError, SchemaError, VicoError

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
