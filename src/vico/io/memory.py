"""Memory of this process."""

from __future__ import annotations

import ctypes
import gc
import sys


def give_back_memory() -> None:
    """Return to the system what nothing uses any more; on Linux also what C's allocator keeps between blocks in use."""
    gc.collect()
    # glibc has it, other C libraries do not.
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)
