"""`vico dataset`: make datasets of demonstrations, and look into them."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import Any

from vico.challenges.assistant.thresholds import SUBTASKS
from vico.challenges.pick_place.task import SECONDS
from vico.challenges.records import Setting
from vico.cli.dataset_options import DatasetOptions
from vico.cli.output import check_output, print_json, print_table, progress_bars
from vico.datasets.build import BuildRequest, Contents, build_dataset
from vico.datasets.checking import findings_of
from vico.datasets.contact_sheet import write_contact_sheet
from vico.datasets.folder import DATASET_FOLDER, Dataset
from vico.datasets.splits import SplitRule
from vico.errors import InputError, OutputExistsError
from vico.runner.foreign import Terms
from vico.threads import workers as processors


def build(options: DatasetOptions) -> int:
    """Make a dataset; 1 if some of its episodes could not be made."""
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


def request_of(options: DatasetOptions) -> BuildRequest:
    """Return what the library is asked for."""
    outputs = () if options.outputs.strip() == "none" else tuple(_names(options.outputs))
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


def info(path: Path, *, json: bool) -> int:
    """Say what a dataset holds."""
    about = Dataset(path).about.model_dump(mode="json")
    if json:
        print_json(about)
    else:
        print_table(str(path), _rows(about))
    return 0


def check(path: Path, *, json: bool) -> int:
    """Read a whole dataset; 1 if anything is wrong with it."""
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


def show(path: Path, *, out: Path, episode: int, frames: int, force: bool, json: bool) -> int:
    """Draw a contact sheet of an episode."""
    if out.exists() and not force:
        raise OutputExistsError(f"{out}: exists; give another name, or --force")
    shown = write_contact_sheet(out, Dataset(path), episode, frames=frames)
    if json:
        print_json(shown)
    else:
        print(out)
    return 0


def export(run: Path, *, out: Path, world: Path | None, force: bool) -> int:
    """Write a run for Rerun."""
    from vico.datasets.rerun_export import write_rerun  # an extra's

    if out.exists() and not force:
        raise OutputExistsError(f"{out}: exists; give another name, or --force")
    with progress_bars() as report:
        write_rerun(out, run, world=world, report=lambda done, total: report("steps", done, total))
    print(out)
    return 0


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


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
