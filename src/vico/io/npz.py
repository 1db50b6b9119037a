"""Archives of plain arrays (``.npz``), read from several threads."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterable, Mapping
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

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
