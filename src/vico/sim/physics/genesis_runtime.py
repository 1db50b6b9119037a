"""Starting Genesis, once a process, and reading and writing its arrays without copies."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError, MissingExtraError

#: The version this engine is written against: it writes to arrays that are no part of Genesis' documented surface.
VERSION = "1.4.5"
_LOCK = threading.Lock()


def genesis() -> Any:
    """Return the package, started in double precision on the processor.

    Raises
    ------
    MissingExtraError
        If it does not import, or is another version.
    InputError
        If somebody started it in this process with other settings.
    """
    try:
        import genesis as gs
    except ImportError as error:
        raise MissingExtraError(
            f"physics: Genesis does not import ({error}): pip install 'virtual-community[genesis]', and on Debian "
            "apt install libgl1 libegl1 libxrender1 libxext6"
        ) from error
    if gs.__version__ != VERSION:
        raise MissingExtraError(
            f"physics: Genesis is {gs.__version__}, and this engine is written for {VERSION}: "
            f"pip install genesis-world=={VERSION}"
        )
    with _LOCK:
        if not getattr(gs, "_initialized", False):
            # Metres from the origin of a city leave too few digits for contacts in single precision.
            gs.init(backend=gs.cpu, precision="64", logging_level="error")
        elif gs.backend != gs.cpu or gs.np_float is not np.float64:
            raise InputError(
                "physics: Genesis was started in this process with other settings; leave starting it to vico, or call "
                "genesis.init(backend=genesis.cpu, precision='64')"
            )
    return gs


def view(array: Any) -> NDArray[Any]:
    """Return an array of Genesis as numpy's, sharing its memory."""
    from genesis.utils.misc import qd_to_torch

    shared: NDArray[Any] = qd_to_torch(array, copy=False).numpy()
    return shared


def state_of(solver: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield what Genesis' rigid solver carries from one step to the next, by name, sharing its memory."""
    from genesis.utils import array_class

    for item in solver.data:
        if isinstance(item, array_class.ArrayItem) and item.kind == array_class.DataKind.STATE:
            yield item.name, view(item.array)
