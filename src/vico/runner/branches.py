"""A run that goes on otherwise: what was recorded up to a checkpoint, in a folder beside it."""

from __future__ import annotations

import os
import shutil
from itertools import chain, count
from pathlib import Path

from vico.errors import MissingFileError, OutputExistsError
from vico.io.files import write_errors, write_json
from vico.runner.bookmarks import FILE as BOOKMARKS
from vico.sim.recording.interventions import INTERVENTIONS_FILE as INTERVENTIONS
from vico.sim.recording.manifest import cut_cast, read_manifest
from vico.sim.recording.schema import (
    AGENTS,
    CAST,
    CHECKPOINTS,
    COMMUNITY,
    MANIFEST,
    SEGMENTS,
    SETUP,
    SETUP_SHAPES,
    VIEWS,
    checkpoint_steps,
    segments_of,
)

_COPIED = (AGENTS, CAST, SETUP, SETUP_SHAPES, INTERVENTIONS, BOOKMARKS)


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
