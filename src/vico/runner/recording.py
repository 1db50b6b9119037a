"""The hook that writes a run down."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from vico.agents.base import AgentState
from vico.errors import InputError, SchemaError
from vico.runner.faults import FaultLog
from vico.runner.gather import Gatherer
from vico.runner.loop import Hook, Step
from vico.sim.loop.simulation import Simulation
from vico.sim.recording.recorder import Checkpoint, Recorder
from vico.sim.recording.schema import RUN_FOLDER


def go_on_from(checkpoint: Checkpoint, agents: Gatherer, sim: Simulation) -> FaultLog:
    """Let agents remember what they did at a checkpoint; return what they had done wrong by then.

    Where overlaps are looked for, those that had been found by then count, too.

    Raises
    ------
    SchemaError
        If it is a checkpoint of other agents.
    """
    states = checkpoint.agents
    if states.keys() != agents.agents.keys():
        odd = sorted(states.keys() ^ agents.agents.keys())
        raise SchemaError(f"checkpoint of step {checkpoint.step}: of other agents than these ({odd[0]}); run it anew")
    agents.restore(states)
    counted = checkpoint.notes.get("overlaps")  # runs that were begun before these were kept have none
    if sim.overlap_check is not None and counted is not None:
        sim.overlap_check.restore(counted)
    return FaultLog.of(checkpoint.notes["faults"])


@contextmanager
def recorded_in(
    out: Path, sim: Simulation, faults: FaultLog, *, wanted: int, notes: Mapping[str, Any] | None = None
) -> Iterator[RecordedOnce]:
    """Give a hook that records a run into a folder; when the block ends, the run is complete, or was stopped.

    It may follow a run that is gone on with by further calls of `Runner.run`.

    Parameters
    ----------
    out
        Folder to write; must not exist, or be empty.
    faults
        Of the runner.
    wanted
        Steps the run is meant to have at most.
    notes
        What the run's manifest says besides.

    Raises
    ------
    OutputExistsError
        If the folder holds something.
    InputError
        If the world is in memory alone: a recording names its folder.
    """
    if sim.world.path is None:
        raise InputError(f"{out}: a world in memory has no folder that a recording could name; write it first")
    # The community may have been made for this run alone: the recorder writes it down.
    with Recorder(out, sim, sources={"world": str(sim.world.path.resolve())}, wanted=wanted, notes=notes) as recorder:
        yield RecordedOnce(recorder, faults)


class RecordedOnce(Hook):
    """Records what happens, and the beginning of the first of several runs alone.

    Attributes
    ----------
    recorder
        What it hands everything to.
    """

    def __init__(self, recorder: Recorder, faults: FaultLog) -> None:
        self.recorder = recorder
        self._inner, self._begun = RecordedRun(recorder, faults), False

    def begin(self, observations: Mapping[str, dict[str, Any]]) -> None:
        """Record how things stand, the first time."""
        if not self._begun:
            self._inner.begin(observations)
        self._begun = True

    def on_step(self, step: Step) -> None:
        """Record a step."""
        self._inner.on_step(step)

    def checkpoint(self, states: Mapping[str, AgentState]) -> None:
        """Save the run."""
        self._inner.checkpoint(states)


class RecordedRun(Hook):
    """Hands every step to a recorder, and what agents did wrong; saves the run where it can be gone on with.

    Parameters
    ----------
    recorder
        Of the same simulation.
    faults
        Of the same runner.
    notes
        Gives what else a checkpoint is to keep, plain data; nothing if None.
    """

    def __init__(
        self, recorder: Recorder, faults: FaultLog, *, notes: Callable[[], Mapping[str, Any]] | None = None
    ) -> None:
        self._recorder, self._faults, self._notes = recorder, faults, notes
        self._told = -1

    def begin(self, observations: Mapping[str, dict[str, Any]]) -> None:
        """Record how things stand before the first step; a run that goes on has that already."""
        self._recorder.begin(observations)

    def checkpoint(self, states: Mapping[str, AgentState]) -> None:
        """Save the simulation, what every agent remembers, what they did wrong, and overlaps where they are counted."""
        check = self._recorder.sim.overlap_check
        overlaps = None if check is None else check.state()
        notes = {} if self._notes is None else dict(self._notes())
        self._recorder.checkpoint(states, notes=notes | {"faults": self._faults.record(), "overlaps": overlaps})

    def on_step(self, step: Step) -> None:
        """Record a step."""
        if self._faults.count != self._told:
            self._told = self._faults.count
            self._recorder.notes["faults"] = self._faults.record()
        self._recorder.write(step.result, actions=step.actions)


__all__ = ["RUN_FOLDER", "RecordedOnce", "RecordedRun", "Recorder", "go_on_from", "recorded_in"]
