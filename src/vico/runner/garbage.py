"""Python's garbage collector while a run goes on."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def settled() -> Iterator[None]:
    """Keep the garbage collector from what is there already: a world is millions of objects, all of which stay.

    Looking through them takes a quarter of a second, which some step in every hundred would pay for.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
