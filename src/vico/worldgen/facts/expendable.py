"""One bad object never ends a build: what fails while an object is made costs that object alone, and is reported.

A fault of geometry (the engine refuses an outline, a shape has no extent) is the object's own. Anything else that fails
is a fault of this program that the object brought out; the build goes on all the same, but `check_world` reports each
of them, so that it can't go unseen.
"""

from __future__ import annotations

import logging
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from shapely.errors import ShapelyError

from vico.errors import VicoError
from vico.geo.overlay import OverlayError
from vico.world.model import FAILED, FAULT, Dropped

_GEOMETRY = (ShapelyError, OverlayError, np.linalg.LinAlgError, ArithmeticError)
_log = logging.getLogger(__name__)


@contextmanager
def expendable(name: str, dropped: list[Dropped]) -> Iterator[None]:
    """Do what is needed for one object; if it fails, the object goes into `dropped` with the reason.

    Errors that are about the whole build pass through: bad input (`VicoError`), the disk, the memory.

    Parameters
    ----------
    name
        Id of the object.
    dropped
        Where it is listed.
    """
    try:
        yield
    except _GEOMETRY as error:
        dropped.append(Dropped(id=name, reason=f"{FAILED}: {_sentence(error)}"))
    except (VicoError, OSError, MemoryError):
        raise
    except Exception as error:  # whatever: a building is not worth a city
        frame = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(frame.filename).name}:{frame.lineno}"
        _log.warning("%s is left out: %s at %s", name, _sentence(error), where, exc_info=True)
        dropped.append(Dropped(id=name, reason=f"{FAULT}: {_sentence(error)} at {where}"))


def _sentence(error: Exception) -> str:
    """Return the kind of an error and the first line of what it says."""
    said = str(error).strip().splitlines()
    return f"{type(error).__name__}: {said[0][:200]}" if said else type(error).__name__
