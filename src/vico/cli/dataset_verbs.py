"""The verbs for datasets of demonstrations: `vico dataset build`, `info`, `check`, `show`, `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.cli.dataset_options import DatasetOptions

dataset = SubcommandApp()

_FLAT = tyro.conf.arg(name="")


@dataset.command(name="build")
def dataset_build(options: Annotated[DatasetOptions, _FLAT]) -> int:
    """Make a dataset of demonstrations: episodes played for it, or runs that were recorded. Exit 1 if some are missing.

    Example: vico dataset build --world helsinki --episodes 200 --subtasks 1 --steps 150 --to lerobot --out demos

    Example: vico dataset build --runs try/runs/* --to webdataset --outputs rgb --out demos
    """
    from vico.cli import dataset as verb

    return verb.build(options)


@dataset.command(name="info")
def dataset_info(path: Positional[Path], json: bool = False) -> int:
    """Say what a dataset holds.

    Example: vico dataset info demos

    Args:
        path: Folder of a dataset.
        json: Print JSON.
    """
    from vico.cli import dataset as verb

    return verb.info(path, json=json)


@dataset.command(name="check")
def dataset_check(path: Positional[Path], json: bool = False) -> int:
    """Read a whole dataset and look for what is wrong with it. Exit 1 if anything is.

    Example: vico dataset check demos

    Args:
        path: Folder of a dataset.
        json: Print JSON.
    """
    from vico.cli import dataset as verb

    return verb.check(path, json=json)


@dataset.command(name="show")
def dataset_show(
    path: Positional[Path], out: Path, episode: int = 0, frames: int = 12, force: bool = False, json: bool = False
) -> int:
    """Draw a contact sheet of an episode: frames, what was asked for, what was done.

    Example: vico dataset show demos --episode 3 --out episode_3.png

    Args:
        path: Folder of a dataset.
        out: Picture to make (.png).
        episode: Which.
        frames: How many frames, evenly over the episode.
        force: Replace a picture that is there.
        json: Print the frames' values as JSON.
    """
    from vico.cli import dataset as verb

    return verb.show(path, out=out, episode=episode, frames=frames, force=force, json=json)


@dataset.command(name="export")
def dataset_export(
    run: Positional[Path], to: Literal["rerun"], out: Path, world: Path | None = None, force: bool = False
) -> int:
    """Write a recorded run for another viewer: Rerun (.rrd). Needs the extra "rerun".

    Example: vico dataset export morning --to rerun --out morning.rrd

    Args:
        run: Run folder.
        to: The format.
        out: File to make.
        world: The world it ran in, if it is no longer where it was.
        force: Replace a file that is there.
    """
    from vico.cli import dataset as verb

    return verb.export(run, out=out, world=world, force=force)
