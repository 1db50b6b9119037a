"""What becomes of a run whose physics has no finite solution any more: the state before it is kept for a report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

from numpy.typing import NDArray

from vico.errors import OutputError
from vico.io.cache import cache_folder
from vico.sim.physics.records import PhysicsError
from vico.sim.snapshot import state_hash, write_snapshot


class Restorable(Protocol):
    """What has a state that can be kept and gone back to."""

    @property
    def identity(self) -> str:
        """Version, configuration, world, community and objects in one hash."""

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """Return a copy of the whole state."""

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to a snapshot."""


@contextmanager
def kept_if_diverged(sim: Restorable, seconds: float) -> Iterator[None]:
    """Let a block move robots; if their motion diverges, write the state before it and go back to that.

    Parameters
    ----------
    seconds
        That the block takes, for the report.

    Raises
    ------
    PhysicsError
        If it diverged, with the path of the snapshot and how to see it again.
    """
    before = sim.snapshot()
    try:
        yield
    except PhysicsError as error:
        sim.restore(before)
        path = cache_folder() / "diverged" / f"{state_hash(before)}.npz"
        told = str(error).removesuffix("; report it with the snapshot")
        try:
            write_snapshot(path, before, owner=sim.identity)
        except OutputError as failure:
            raise PhysicsError(f"{told}; the state before it could not be kept: {failure}") from error
        raise PhysicsError(
            f"{told}; the state before it is in {path}: report it with that file, the world, the community and the "
            f"configuration. Simulation.load({path.name!r}) and advance({seconds:g}) show it again"
        ) from error
