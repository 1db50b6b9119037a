"""Making sure that machines which share out work see the same store."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from vico.errors import InputError
from vico.io.stores import Store
from vico.jobs.contract import Executor
from vico.version import __version__


@contextmanager
def seen_by_all(store: Store, executor: Executor) -> Iterator[str]:
    """Give the name of a file of a store that every machine must see; empty where there is but one machine."""
    if executor.one_machine:
        yield ""
        return
    name = f".seen-{os.uname().nodename}-{os.getpid()}"
    store.write(name, b"Written by the machine that shares out the work; the others look for it here.\n")
    try:
        yield name
    finally:
        store.remove(name)


def check_seen(store: Store, name: str) -> None:
    """Make sure that this machine sees the file that `seen_by_all` gave the name of.

    Raises
    ------
    InputError
        If it does not: what it made would be nowhere.
    """
    if name and not store.has(name):
        raise InputError(
            f"{store}: not the same folder on every machine; give an --out that all of them share, or a URL like "
            "s3://BUCKET/results"
        )


def check_code(asked: str, here: str) -> None:
    """Make sure that the code of this machine, by its digest, is that of whoever asks.

    Raises
    ------
    InputError
        If it is not: what it made would be filed as something else.
    """
    if asked != here:
        raise InputError(
            f"vico {__version__} there is other code, or its $VICO_DATA holds other data, than where the work is asked "
            "for; install the same on every machine"
        )
