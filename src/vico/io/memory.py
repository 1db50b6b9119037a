"""Memory of this process: given back to the system, and a table of what was used last."""

from __future__ import annotations

import ctypes
import gc
import sys
from threading import Lock
from typing import Generic, TypeVar


def give_back_memory() -> None:
    """Return to the system what nothing uses any more; on Linux also what C's allocator keeps between blocks in use."""
    gc.collect()
    # glibc has it, other C libraries do not.
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)


K = TypeVar("K")
V = TypeVar("V")


class LruCache(Generic[K, V]):
    """Keeps what was used last; what was not used longest is dropped. Threads may share it.

    Parameters
    ----------
    most
        How many are kept.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: dict[K, V] = {}
        self._lock = Lock()

    def get(self, key: K) -> V | None:
        """Return what is kept under a key; None if nothing is."""
        with self._lock:
            value = self._kept.pop(key, None)
            if value is not None:
                self._kept[key] = value
            return value

    def keep(self, key: K, value: V) -> None:
        """Keep a value, which is not None, under a key."""
        with self._lock:
            self._kept.pop(key, None)
            self._kept[key] = value
            if len(self._kept) > self._most:
                del self._kept[next(iter(self._kept))]
