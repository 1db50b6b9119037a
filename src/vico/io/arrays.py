"""NumPy arrays in files: ``.npy`` larger than one wants to hold, and archives of plain arrays (``.npz``).

Large arrays are written part by part, and read where looked at. Archives can be read from several threads.
"""

from __future__ import annotations

import io
import mmap
import os
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import DTypeLike, NDArray

from vico.errors import MissingFileError, SchemaError
from vico.io.files import new_file


@contextmanager
def new_array(path: Path, shape: tuple[int, ...], kind: DTypeLike, fill: float = 0) -> Iterator[NDArray[Any]]:
    """Yield a new array whose pages lie in a file; it takes the name of `path` when the block ends well.

    Parameters
    ----------
    path
        The ``.npy`` file.
    shape, kind
        Of the array.
    fill
        What it holds at first.

    Raises
    ------
    OutputError
        If there is no room for it, or it cannot be written.
    """
    with new_file(path) as temporary:
        array = np.lib.format.open_memmap(temporary, mode="w+", dtype=np.dtype(kind), shape=shape)
        with temporary.open("r+b") as file:
            # Where the disk is full this says so; writing into pages that have no room would end the process.
            os.posix_fallocate(file.fileno(), 0, os.fstat(file.fileno()).st_size)
        if fill:
            array[...] = fill
        yield np.asarray(array)
        array.flush()


def mapped_array(path: Path) -> NDArray[Any]:
    """Return the array of a file, read page by page where it is looked at; what is written into it nobody else sees.

    Raises
    ------
    MissingFileError, SchemaError
        If the file is not there, or is no array.
    """
    try:
        return np.asarray(np.load(path, mmap_mode="c", allow_pickle=False))
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build it anew") from None
    except (ValueError, OSError, EOFError) as error:
        raise SchemaError(f"{path}: not a readable array ({error}); build it anew") from None


def drop_pages(array: NDArray[Any]) -> None:
    """Give back the memory that a mapped array's file is read into: it is read again where it is looked at.

    What was written into the array is lost. Of other arrays, and where the system can't do it, nothing changes.
    """
    while isinstance(array, np.ndarray):
        if isinstance(array, np.memmap):
            pages = getattr(array, "_mmap", None)
            if isinstance(pages, mmap.mmap):
                drop_map(pages)
            return
        array = array.base  # type: ignore[assignment]


def drop_map(pages: mmap.mmap) -> None:
    """Give back the memory that a mapped file is read into, where the system can do it."""
    if hasattr(pages, "madvise") and hasattr(mmap, "MADV_DONTNEED"):
        pages.madvise(mmap.MADV_DONTNEED)


# numpy reads an array's header with `ast.literal_eval`, and the syntax trees of Python 3.11 and 3.12 count their depth
# once for all threads: two headers read at once can end in "AST constructor recursion depth mismatch"
# (https://github.com/python/cpython/issues/106905).
_HEADERS = threading.Lock()


def read_npz(source: bytes | BinaryIO, names: Iterable[str] | None = None) -> dict[str, NDArray[Any]]:
    """Read an archive's arrays, never anything pickled. Safe to be called from several threads.

    Parameters
    ----------
    source
        The archive: its bytes, or a file open for reading.
    names
        Arrays to read; those that the archive lacks are left out. Default: all.

    Raises
    ------
    ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error
        If it is damaged, or holds objects other than plain arrays.
    """
    file = io.BytesIO(source) if isinstance(source, bytes) else source
    with _HEADERS:
        archive = np.load(file, allow_pickle=False)
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise ValueError("a single array, not an archive of arrays")
        with archive:
            wanted = archive.files if names is None else [name for name in names if name in archive.files]
            return {name: archive[name] for name in wanted}


def npz_bytes(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return the bytes of an archive of arrays, compressed."""
    sink = io.BytesIO()
    np.savez_compressed(sink, **arrays)  # type: ignore[arg-type]
    return sink.getvalue()
