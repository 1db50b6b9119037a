"""`vico dataset build`, `info`, `check`, `show` and `export`: demonstrations for trainers."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.cli.options import FLAT, Files, RayAddress, split_names
from vico.errors import InputError, OutputExistsError

if TYPE_CHECKING:
    from vico.challenges.records import Setting
    from vico.datasets.build import BuildRequest

dataset = SubcommandApp()


@dataclass(frozen=True)
class DatasetOptions:
    """What `vico dataset build` is asked for."""

    out: Path  # Folder to make; refused if it exists, unless --force. A build that was stopped goes on where it was.
    to: Literal["lerobot", "webdataset", "parquet"]  # The format: LeRobot v3.0, WebDataset shards, or plain Parquet.
    #: World folders to play in. With --runs: where their world is now. Of pick_place: without any, a level field.
    world: Files = ()
    #: What is played; pick_place: a mobile manipulator picks things up and puts them down (docs/imitation.md).
    challenge: Literal["carry", "delivery", "search", "pick_place"] = "delivery"
    #: By whom: a planner of `vico eval assistant`, or my_module:MyAgent. Of pick_place: always the arm's own skills.
    method: str = "heuristic"
    episodes: int = 0  # How many, over the worlds in turn.
    steps: int = 1500  # Seconds an episode may last; of pick_place never more than 120.
    subtasks: int = 6  # How many of the six subtasks of a task are asked for: the first ones.
    assistants: int = 1  # How many work together; each is an episode of its own.
    first_seed: int = 0  # Of the first episode in each world.
    runs: Files = ()  # Take these recorded runs instead of playing: of vico run, of vico eval --record, played by hand.
    #: Whose demonstrations: names, or residents, assistants, robots; without it the assistants, else all whose pictures
    #: were recorded.
    agents: tuple[str, ...] = ()
    outputs: str = "rgb"  # Pictures, separated by commas: rgb (video), depth and segmentation (exact); or none.
    size: int = 128  # Side of the pictures, pixels.
    instruction: str = ""  # What to say was asked for, where neither a task nor a schedule says it.
    successes: bool = False  # Keep only episodes in which all was done.
    #: Of pick_place: leave out steps whose largest increment is smaller, rad and metres; the paper has 0.01.
    drop_below: float = 0.0
    #: Of pick_place: cut this share of the smallest and of the largest increments; the paper has 0.01.
    clip: float = 0.0
    test: float = 0.1  # Share of the episodes that are kept apart for testing.
    validation: float = 0.0  # Share that is kept apart for validation.
    #: What is never in two splits: a world, a person who acts or asks, or only an episode itself.
    split_by: Literal["world", "person", "episode"] = "episode"
    workers: int = 0  # Processes side by side; 0 is one a processor. Decides nothing but how long it takes.
    #: Make the parts on a Ray cluster instead (the extra "ray"): its address; without one on that which runs here. OUT
    #: and the worlds must be on a folder that all machines share.
    ray: RayAddress = None
    deadline: float = 60.0  # Seconds an agent of yours has for an action; 0 waits for it as long as it takes.
    force: bool = False  # Replace what this verb made there before; refused if the folder holds anything else.
    json: bool = False  # Print what was made as JSON.


@dataset.command(name="build")
def dataset_build(options: Annotated[DatasetOptions, FLAT]) -> int:
    """Make a dataset of demonstrations: episodes played for it, or runs that were recorded. Exit 1 if some are missing.

    Example: vico dataset build --world helsinki --episodes 200 --subtasks 1 --steps 150 --to lerobot --out demos

    Example: vico dataset build --runs try/runs/* --to webdataset --outputs rgb --out demos
    """
    from vico.cli.console import check_output, print_json, print_table, progress_bars
    from vico.datasets.build import build_dataset
    from vico.datasets.folder import DATASET_FOLDER

    request = request_of(options)
    check_output(options.out, *chain(*options.world, *options.runs), force=options.force, kind=DATASET_FOLDER)
    with progress_bars() as report:
        built = build_dataset(
            request, options.out, force=options.force, report=lambda done, total: report("episodes", done, total)
        )
    if options.json:
        print_json({key: value for key, value in built.record.items() if key != "files"})
    else:
        print_table(str(built.out), _rows(built.record))
    for line in built.missing:
        print(f"not made: {line}", file=sys.stderr)
    return 1 if built.missing else 0


@dataset.command(name="info")
def dataset_info(path: Positional[Path], json: bool = False) -> int:
    """Say what a dataset holds.

    Example: vico dataset info demos

    Args:
        path: Folder of a dataset.
        json: Print JSON.
    """
    from vico.cli.console import print_json, print_table
    from vico.datasets.folder import Dataset

    about = Dataset(path).about.model_dump(mode="json")
    if json:
        print_json(about)
    else:
        print_table(str(path), _rows(about))
    return 0


@dataset.command(name="check")
def dataset_check(path: Positional[Path], json: bool = False) -> int:
    """Read a whole dataset and look for what is wrong with it. Exit 1 if anything is.

    Example: vico dataset check demos

    Args:
        path: Folder of a dataset.
        json: Print JSON.
    """
    from vico.cli.console import print_json, progress_bars
    from vico.datasets.folder import Dataset
    from vico.datasets.inspection import findings_of

    dataset = Dataset(path)
    with progress_bars() as report:
        findings = findings_of(dataset, report=lambda done, total: report("episodes", done, total))
    if json:
        print_json({"episodes": dataset.about.episodes, "frames": dataset.about.frames, "findings": findings})
    else:
        for finding in findings:
            print(finding)
        print(f"{path}: {dataset.about.episodes} episodes, {dataset.about.frames} frames, {len(findings)} findings")
    return 1 if findings else 0


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
    from vico.cli.console import print_json
    from vico.datasets.folder import Dataset
    from vico.datasets.inspection import write_contact_sheet

    if out.exists() and not force:
        raise OutputExistsError(f"{out}: exists; give another name, or --force")
    shown = write_contact_sheet(out, Dataset(path), episode, frames=frames)
    if json:
        print_json(shown)
    else:
        print(out)
    return 0


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
    from vico.cli.console import progress_bars
    from vico.datasets.inspection import write_rerun  # an extra's

    if out.exists() and not force:
        raise OutputExistsError(f"{out}: exists; give another name, or --force")
    with progress_bars() as report:
        write_rerun(out, run, world=world, report=lambda done, total: report("steps", done, total))
    print(out)
    return 0


def request_of(options: DatasetOptions) -> BuildRequest:
    """Return what the library is asked for."""
    from vico.challenges.assistant.tasks import SUBTASKS
    from vico.challenges.pick_place.tasks import SECONDS
    from vico.datasets.build import BuildRequest, Contents, SplitRule
    from vico.runner.foreign import Terms
    from vico.threads import workers as processors

    outputs = () if options.outputs.strip() == "none" else tuple(split_names(options.outputs))
    if not 0 <= options.workers <= 256:
        raise InputError(f"--workers {options.workers}; give a number of processes in 1..256, or 0 for one a processor")
    if not 1 <= options.assistants <= 2 or options.steps < 1:
        raise InputError("dataset: episodes are for 1 or 2 assistants, and last at least one step")
    setting: Setting = {"assistants": options.assistants, "advanced": False, "distance": True, "steps": options.steps}
    if options.subtasks != SUBTASKS:
        setting = {**setting, "subtasks": options.subtasks}
    foreign = ":" in options.method
    return BuildRequest(
        contents=Contents(options.to, outputs, options.size, options.agents, options.instruction, options.drop_below),
        runs=tuple(chain(*options.runs)),
        worlds=tuple(chain(*options.world)),
        category=options.challenge,
        method=options.method,
        setting=setting,
        seconds=min(options.steps, SECONDS),
        episodes=options.episodes,
        first_seed=options.first_seed,
        terms=Terms(deadline=options.deadline or None, isolate=True) if foreign else Terms(),
        rule=SplitRule(options.split_by, options.test, options.validation),
        successes=options.successes,
        clip=options.clip,
        workers=options.workers or processors(),
        ray=options.ray,
    )


def _rows(about: Mapping[str, Any]) -> dict[str, Any]:
    pictures = f"{', '.join(about['outputs'])} ({about['size']} px)" if about["outputs"] else "none"
    return {
        "format": about["format"],
        "episodes": about["episodes"],
        "frames": f"{about['frames']} at {about['fps']} a second",
        "successes": f"{about['successes']} of {about['judged']} judged",
        "splits": ", ".join(f"{name} {end - first}" for name, (first, end) in about["splits"].items()),
        "pictures": pictures,
        "state, action": f"{len(about['features']['observation.state'])}, {len(about['features']['action'])} numbers",
        "worlds": ", ".join(world["name"] for world in about["worlds"]),
        "missing": len(about["missing"]),
    }
