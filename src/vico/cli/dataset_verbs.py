"""The verbs for datasets of demonstrations: `vico dataset build`, `info`, `check`, `show`, `export`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.cli.options import RayAddress

dataset = SubcommandApp()

_FLAT = tyro.conf.arg(name="")


@dataclass(frozen=True)
class DatasetOptions:
    """What `vico dataset build` is asked for.

    Attributes
    ----------
    out
        Folder to make; refused if it exists, unless --force. A build that was stopped goes on where it was.
    to
        The format: LeRobot v3.0, WebDataset shards, or plain Parquet.
    world
        World folders to play in. With --runs: where their world is now.
    challenge
        What is played.
    method
        By whom: a planner of `vico eval assistant`, or my_module:MyAgent.
    episodes
        How many, over the worlds in turn.
    steps
        Seconds an episode may last.
    subtasks
        How many of the six subtasks of a task are asked for: the first ones.
    assistants
        How many work together; each is an episode of its own.
    first_seed
        Of the first episode in each world.
    runs
        Take these recorded runs instead of playing: of vico run, of vico eval --record, played by hand.
    agents
        Whose demonstrations: names, or residents, assistants, robots; without it the assistants, else all whose
        pictures were recorded.
    outputs
        Pictures, separated by commas: rgb (video), depth and segmentation (exact); or none.
    size
        Side of the pictures, pixels.
    instruction
        What to say was asked for, where neither a task nor a schedule says it.
    successes
        Keep only episodes in which all was done.
    test
        Share of the episodes that are kept apart for testing.
    validation
        Share that is kept apart for validation.
    split_by
        What is never in two splits: a world, a person who acts or asks, or only an episode itself.
    workers
        Processes side by side; 0 is one a processor. Decides nothing but how long it takes.
    ray
        Make the parts on a Ray cluster instead (the extra "ray"): its address; without one on that which runs here. OUT
        and the worlds must be on a folder that all machines share.
    deadline
        Seconds an agent of yours has for an action; 0 waits for it as long as it takes.
    force
        Replace what is in the output folder.
    json
        Print what was made as JSON.
    """

    out: Path
    to: Literal["lerobot", "webdataset", "parquet"]
    world: tuple[Path, ...] = ()
    challenge: Literal["carry", "delivery", "search"] = "delivery"
    method: str = "heuristic"
    episodes: int = 0
    steps: int = 1500
    subtasks: int = 6
    assistants: int = 1
    first_seed: int = 0
    runs: tuple[Path, ...] = ()
    agents: tuple[str, ...] = ()
    outputs: str = "rgb"
    size: int = 128
    instruction: str = ""
    successes: bool = False
    test: float = 0.1
    validation: float = 0.0
    split_by: Literal["world", "person", "episode"] = "episode"
    workers: int = 0
    ray: RayAddress = None
    deadline: float = 60.0
    force: bool = False
    json: bool = False


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
