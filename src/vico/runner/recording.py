"""Recorded runs: the hook that writes a run down, bookmarks in its folder, and branches.

A branch is a run that goes on otherwise: what was recorded up to a checkpoint, in a folder beside the run.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain, count
from pathlib import Path
from typing import Any

from vico.agents.base import AgentState
from vico.errors import InputError, MissingFileError, OutputExistsError, SchemaError
from vico.io.files import read_json, write_errors, write_json
from vico.runner.gather import FaultLog, Gatherer
from vico.runner.loop import Hook, Step
from vico.sim.loop.simulation import Simulation
from vico.sim.recording.interventions import INTERVENTIONS_FILE as INTERVENTIONS
from vico.sim.recording.manifest import cut_cast, read_manifest
from vico.sim.recording.recorder import Checkpoint, Recorder
from vico.sim.recording.schema import (
    AGENTS,
    CAST,
    CHECKPOINTS,
    COMMUNITY,
    MANIFEST,
    RUN_FOLDER,
    SEGMENTS,
    SETUP,
    SETUP_SHAPES,
    VIEWS,
    checkpoint_steps,
    segments_of,
)

__all__ = [
    "BOOKMARKS_FILE",
    "RUN_FOLDER",
    "RecordedOnce",
    "RecordedRun",
    "Recorder",
    "add_bookmark",
    "bookmarks_of",
    "branch_path",
    "branched_run",
    "free_name",
    "go_on_from",
    "recorded_in",
]


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


#: Name of the file.
BOOKMARKS_FILE = "bookmarks.json"

_MOST_BOOKMARKS = 1000


def bookmarks_of(run: Path) -> list[dict[str, Any]]:
    """Return the bookmarks of a run: ``step``, ``time`` in seconds and ``text`` of each, by step."""
    path = run / BOOKMARKS_FILE
    return list(read_json(path)["bookmarks"]) if path.exists() else []


def add_bookmark(run: Path, *, step: int, time: float, text: str) -> None:
    """Add a bookmark.

    Raises
    ------
    InputError
        If there are too many.
    """
    kept = bookmarks_of(run)
    if len(kept) >= _MOST_BOOKMARKS:
        raise InputError(f"bookmark: there are {_MOST_BOOKMARKS} already")
    kept.append({"step": step, "time": time, "text": text})
    write_json(run / BOOKMARKS_FILE, {"bookmarks": sorted(kept, key=lambda one: one["step"])})


_COPIED = (AGENTS, CAST, SETUP, SETUP_SHAPES, INTERVENTIONS, BOOKMARKS_FILE)


def branched_run(run: Path, step: int, name: str) -> Path:
    """Make a sibling of a run that holds what was recorded up to one of its checkpoints, to go on from there.

    What never changes is not copied but shared by links, where the file system has them.

    Parameters
    ----------
    run
        Folder of the run; it stays as it is.
    step
        Of the checkpoint.
    name
        The sibling is called as the run, a dot and this.

    Returns
    -------
    Path
        The sibling's folder.

    Raises
    ------
    MissingFileError
        If there is no such checkpoint.
    OutputExistsError
        If the sibling is there already.
    """
    if step not in checkpoint_steps(run):
        raise MissingFileError(f"{run}: no checkpoint of step {step}")
    out = branch_path(run, name)
    if out.exists():
        raise OutputExistsError(f"{out}: is there already; give the branch another name")
    work = out.with_name(f".{out.name}.partial")
    with write_errors(out):
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir()
        for segment in segments_of(run):
            if segment.last <= step:
                _share(segment.path, work / SEGMENTS / segment.path.name)
        for kept in checkpoint_steps(run):
            if kept <= step:
                _share(run / CHECKPOINTS / f"{kept:08d}", work / CHECKPOINTS / f"{kept:08d}")
        for path in (run / VIEWS).glob("*/*"):
            if path.suffix in (".mp4", ".npz") and int(path.stem) <= step:
                _link(path, work / VIEWS / path.parent.name / path.name)
        if (run / COMMUNITY).is_dir():
            shutil.copytree(run / COMMUNITY, work / COMMUNITY)
        for file in _COPIED:
            if (run / file).exists():
                shutil.copy2(run / file, work / file)
        cut_cast(work, step)
        # Written last, as in every folder; the first run may be complete, its branch is not.
        write_json(work / MANIFEST, read_manifest(run) | {"status": "stopped"})
        os.replace(work, out)
    return out


def branch_path(run: Path, name: str) -> Path:
    """Return where a branch of a run is kept."""
    return run.with_name(f"{run.name}.{name.replace(' ', '-')}")


def free_name(run: Path, name: str) -> str:
    """Return a name that no branch of a run has yet: the one given, or with a number after it."""
    names = chain([name], (f"{name}-{number}" for number in count(2)))
    return next(one for one in names if not branch_path(run, one).exists())


def _share(folder: Path, into: Path) -> None:
    for path in folder.iterdir():
        _link(path, into / path.name)


def _link(path: Path, into: Path) -> None:
    into.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(path, into)
    except OSError:
        shutil.copy2(path, into)
