"""Checkpoints of a run: the exact state of the simulation and of the agents at a step, from which it can go on."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from vico.errors import MissingFileError
from vico.io.files import read_json, write_json
from vico.io.plain_data import read_plain, write_plain
from vico.sim.recording.schema import AGENT_STATES, CHECKPOINTS, CLOCK, SIMULATION_STATE
from vico.sim.recording.segments import written_folder
from vico.sim.snapshot import read_snapshot, write_snapshot

_NAME = re.compile(r"\d{8,}")


@dataclass(frozen=True)
class Checkpoint:
    """The state of a run at a step.

    Attributes
    ----------
    step
        The step it was taken after.
    arrays
        The whole state of the simulation; `Simulation.restore` goes back to it.
    agents
        State of each agent, by name.
    notes
        What else whoever ran the simulation kept.
    clock
        Wall-clock seconds spent so far: ``wall_seconds`` in all, and ``seconds_by_phase``.
    """

    step: int
    arrays: dict[str, NDArray[Any]]
    agents: dict[str, Any]
    notes: dict[str, Any]
    clock: dict[str, Any]

    @property
    def interventions(self) -> int:
        """How many lines of the run's interventions had been done by then."""
        return int(self.notes.get("interventions", 0))


def write_checkpoint(run: Path, checkpoint: Checkpoint, *, owner: str) -> None:
    """Write a checkpoint, whole or not at all; `owner` is the identity of its simulation."""
    with written_folder(run / CHECKPOINTS / f"{checkpoint.step:08d}") as folder:
        write_snapshot(folder / SIMULATION_STATE, checkpoint.arrays, owner=owner)
        write_plain(folder / AGENT_STATES, {"agents": checkpoint.agents, "notes": checkpoint.notes})
        write_json(folder / CLOCK, checkpoint.clock)


def checkpoint_steps(run: Path) -> list[int]:
    """Return the steps of which a run has checkpoints, in their order."""
    folder = run / CHECKPOINTS
    return sorted(
        int(path.name) for path in (folder.iterdir() if folder.is_dir() else ()) if _NAME.fullmatch(path.name)
    )


def read_checkpoint(run: Path, step: int, *, owner: str) -> Checkpoint:
    """Read a checkpoint.

    Raises
    ------
    MissingFileError
        If there is none of that step.
    SchemaError
        If it is damaged, or of another simulation than `owner`.
    """
    folder = run / CHECKPOINTS / f"{step:08d}"
    if not folder.is_dir():
        steps = ", ".join(map(str, checkpoint_steps(run))) or "none"
        raise MissingFileError(f"{run}: no checkpoint of step {step}; there are: {steps}")
    arrays = read_snapshot(folder / SIMULATION_STATE, owner=owner)
    kept = read_plain(folder / AGENT_STATES)
    return Checkpoint(step, arrays, kept["agents"], kept["notes"], read_json(folder / CLOCK))


def drop_checkpoints_after(run: Path, step: int) -> None:
    """Delete checkpoints of later steps, and what an interrupted writer left unfinished."""
    folder = run / CHECKPOINTS
    kept = {f"{k:08d}" for k in checkpoint_steps(run) if k <= step}
    for path in list(folder.iterdir()) if folder.is_dir() else ():
        if path.name not in kept:
            shutil.rmtree(path)


__all__ = [
    "Checkpoint",
    "checkpoint_steps",
    "drop_checkpoints_after",
    "read_checkpoint",
    "write_checkpoint",
]
