"""One bad object never ends a build: what fails while an object is made costs that object alone, and is reported.

Every stage does what it does for one object within `drop_on_failure`, under the object's id, and joins the shapes of
many objects with `union_named`, which leaves out the one that the geometry engine refuses. What is lost goes to whoever
listens (`collect_losses`): a build listens to each of its stages, puts what it hears into the stage's report, and keeps
it with what the stage made, so that a build that goes on tells it again.

A fault of geometry (the engine refuses an outline, a shape has no extent) is the object's own. Anything else that fails
is a fault of this program that the object brought out; the build goes on all the same, but `check_world` reports each
of them, so that it can't go unseen.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from shapely.errors import ShapelyError
from shapely.geometry.base import BaseGeometry

from vico.errors import VicoError, line_of, sentence_of
from vico.geo import overlay
from vico.geo.overlay import GRID, OverlayError, Shapes
from vico.world.model import FAILED, FAULT, Dropped

_GEOMETRY = (ShapelyError, OverlayError, np.linalg.LinAlgError, ArithmeticError)
_log = logging.getLogger(__name__)
T = TypeVar("T")


@dataclass
class Losses:
    """Objects that were left out within a `with` block.

    Attributes
    ----------
    dropped
        Objects with the reasons, each once.
    tried
        Ids of all objects that something was done for.
    """

    dropped: list[Dropped] = field(default_factory=list)
    tried: set[str] = field(default_factory=set)

    @property
    def ids(self) -> frozenset[str]:
        """Ids of what was left out."""
        return frozenset(one.id for one in self.dropped)


_LISTENER: ContextVar[Losses | None] = ContextVar("losses", default=None)


@contextmanager
def collect_losses() -> Iterator[Losses]:
    """Gather what is left out within, also by what is called there."""
    losses = Losses()
    before = _LISTENER.set(losses)
    try:
        yield losses
    finally:
        _LISTENER.reset(before)


def leave_out(name: str, reason: str, dropped: list[Dropped] | None = None) -> None:
    """Report an object that is left out, and why, to the enclosing stage; or list it in `dropped`."""
    losses, lost = _LISTENER.get(), Dropped(id=name, reason=reason)
    _log.info("%s is left out: %s", name, reason)
    listed = dropped if dropped is not None else losses.dropped if losses is not None else []
    if lost not in listed:
        listed.append(lost)


@contextmanager
def drop_on_failure(name: str, dropped: list[Dropped] | None = None) -> Iterator[None]:
    """Do what is needed for one object; if it fails, the object is left out with the reason.

    Errors that are about the whole build pass through: bad input (`VicoError`), the disk, the memory.

    Parameters
    ----------
    name
        Id of the object.
    dropped
        Where it is listed, for a stage that returns what it left out; without, whoever listens is told.
    """
    losses = _LISTENER.get()
    if losses is not None and dropped is None:
        losses.tried.add(name)
    try:
        yield
    except _GEOMETRY as error:
        leave_out(name, f"{FAILED}: {sentence_of(error)}", dropped)
    except (VicoError, OSError, MemoryError):
        raise
    except Exception as error:  # whatever: a building is not worth a city
        _log.warning("%s is left out: %s", name, sentence_of(error))
        _log.info("where it failed", exc_info=True)
        leave_out(name, f"{FAULT}: {sentence_of(error)} at {line_of(error)}", dropped)


@dataclass(frozen=True, slots=True)
class NamedShape:
    """A geometry and the id of the object it belongs to."""

    id: str
    shape: BaseGeometry


def named_parts(name: str, shapes: Iterable[BaseGeometry]) -> list[NamedShape]:
    """Return shapes of one object under its id."""
    return [NamedShape(name, shape) for shape in shapes]


def union_named(shapes: Iterable[NamedShape], *, grid: float | None = GRID) -> BaseGeometry:
    """Return what lies in any of the shapes, as `overlay.union_all`; those that the engine refuses are left out."""
    return _without_refused(shapes, lambda kept, _: overlay.union_all(kept, grid=grid))[1]


def overlay_named(shapes: Iterable[NamedShape], operation: Callable[[Shapes], Shapes]) -> list[NamedShape]:
    """Apply an operation of `overlay` to all shapes at once; those that the engine refuses are left out."""
    kept, made = _without_refused(shapes, lambda each, _: operation(each))
    return [NamedShape(one.id, shape) for one, shape in zip(kept, made, strict=True)]


def buffer_named(shapes: Iterable[NamedShape], distances: NDArray[np.float64], **style: Any) -> list[NamedShape]:
    """Return everything within a distance of each shape, as `overlay.buffer`, without those that the engine refuses.

    Parameters
    ----------
    shapes
        Geometries, metres.
    distances
        One for each, metres.
    style
        As `shapely.buffer` takes it.
    """
    kept, made = _without_refused(shapes, lambda each, own: overlay.buffer(each, distances[own], **style))
    return [NamedShape(one.id, shape) for one, shape in zip(kept, made, strict=True)]


def _without_refused(
    shapes: Iterable[NamedShape], operation: Callable[[Shapes, NDArray[np.int64]], T]
) -> tuple[list[NamedShape], T]:
    """Do an overlay of many shapes without those that are at fault when it fails: the shapes left, and the result.

    All are tried at once: nothing is looked at one by one unless something fails. The operation is told which of the
    shapes it is given.
    """
    given = list(shapes)
    array = np.empty(len(given), object)
    array[:] = [one.shape for one in given]
    own = np.arange(len(given))
    while True:
        try:
            return [given[k] for k in own.tolist()], operation(array[own], own)
        except OverlayError as error:
            if error.at is None:
                raise
            leave_out(given[int(own[error.at])].id, f"{FAILED}: {sentence_of(error)}")
            own = np.delete(own, error.at)
